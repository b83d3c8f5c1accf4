"""Averaged cross spectra of the channels of a recording, by Welch's method with Hann windows that overlap by half.

Their ratios of F1, V1 and V2 are free of the bias by noise; the noise that channels share is found beside them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
import scipy

from fourpole.core.arrays import BoolArray, ByValue, ComplexArray, FloatArray
from fourpole.core.demodulation.tracks import Track
from fourpole.errors import RecordingError, TooShortError

#: Fewest segments: the covariance of a ratio needs a matrix of more averages than channels.
_FEWEST = 8
#: Samples that are transformed at a time: they stay in the cache of the processor.
_AT_A_TIME = 100_000
#: Relative round-off of a frequency.
_ROUND_OFF = 1e-9


@dataclass(frozen=True, eq=False)
class CrossSpectra(ByValue):
    r"""Averaged one-sided cross spectra, :math:`G_{ab} = E[X_a X_b^*]`.

    Attributes
    ----------
    frequency : (L,) float array [Hz]
        Frequency of each line; that of the motion's mean power where several bins are averaged.
    matrix : (L, C, C) complex array
        Spectral densities, Hermitian, in the units of the channels per Hz.
    averages : (L,) float array [1]
        Number of independent averages with the same variance.
    width : (L,) float array [Hz]
        Width of the band that a line stands for.
    foreign : (L,) bool array or bool
        Lines whose power is that of another frequency, as beside a sine.
    broad : (L,) bool array or bool
        Lines that are a mean over frequency; others are sines.
    """

    frequency: FloatArray
    matrix: ComplexArray
    averages: FloatArray
    width: FloatArray
    foreign: BoolArray | bool = False
    broad: BoolArray | bool = True

    def coherence(self, a: int, b: int) -> FloatArray:
        """Coherence (L,) of two channels [1]."""
        power = (self.matrix[:, a, a] * self.matrix[:, b, b]).real
        return np.abs(self.matrix[:, a, b]) ** 2 / np.maximum(power, 1e-300)


def cross_spectra(track: Track, segment: float, band: tuple[float, float]) -> CrossSpectra:
    r"""Averaged cross spectra of all bins in a band of frequencies.

    .. math:: G_{ab}(f_k) = \frac{2}{f_s \sum w^2}\,\frac1K \sum_{i=1}^{K} X_{a,i}(f_k)\,X_{b,i}^*(f_k)

    Parameters
    ----------
    track : Track
        Channels with the same sampling times. Segments with a missing sample are left out.
    segment : float [s]
        Length of a segment; the bins are 1/segment apart.
    band : (float, float) [Hz]
        Lowest and highest frequency.

    Returns
    -------
    CrossSpectra
        A line for each bin. Neighbours are not independent: see `fourpole.core.spectra.averaged.thinned`.

    Raises
    ------
    TooShortError
        If there are fewer than eight segments.
    RecordingError
        If no bin lies in the band.

    References
    ----------
    P. D. Welch, "The use of fast Fourier transform for the estimation of power spectra", IEEE Trans. Audio
    Electroacoust. 15, 1967; J. S. Bendat and A. G. Piersol, "Random Data", 4th ed., 2010, ch. 11.
    """
    size = round(segment * track.rate)
    starts = starts_of(track.present, size)
    if starts.size < _FEWEST:
        raise TooShortError(
            f"the recording has {starts.size} segments of {segment:.3g} s without a missing sample, at least {_FEWEST} "
            "are needed: record longer"
        )
    frequency, inside = bins_of(size, track.rate, band)
    window, channels = hann(size), len(track.names)
    matrix: ComplexArray = np.zeros((channels, channels, frequency.size), dtype=complex)
    squares = np.zeros((channels, 2 * frequency.size))
    count = max(1, _AT_A_TIME // (size * channels))
    for first in range(0, starts.size, count):
        lines = lines_of(track.signals, starts[first : first + count], window, inside)
        parts = lines.view(float)
        for a in range(channels):
            for b in range(a):
                product = (lines[a] * lines[b].conj()).sum(axis=0)
                matrix[a, b] += product
                matrix[b, a] += product.conj()
            squares[a] += np.einsum("kl,kl->l", parts[a], parts[a])
    for a in range(channels):
        matrix[a, a] = squares[a, 0::2] + squares[a, 1::2]
    scale = 2.0 / (track.rate * np.sum(window**2) * starts.size)
    averages, width = np.full(frequency.size, independent(starts.size, 1)), np.full(frequency.size, track.rate / size)
    return CrossSpectra(frequency, scale * matrix.transpose(2, 0, 1), averages, width)


def bins_of(size: int, rate: float, band: tuple[float, float]) -> tuple[FloatArray, slice]:
    """Frequencies [Hz] and places of the bins of segments of a size in a band; RecordingError if there are none."""
    frequency = np.arange(1, size // 2 + 1) * rate / size
    inside = (frequency >= band[0] * (1 - _ROUND_OFF)) & (frequency <= band[1] * (1 + _ROUND_OFF))
    if not inside.any():
        raise RecordingError(
            f"no line of a spectrum lies between {band[0]:.4g} and {band[1]:.4g} Hz: sample faster, or record longer"
        )
    first, last = np.flatnonzero(inside)[[0, -1]].tolist()
    return frequency[first : last + 1], slice(first + 1, last + 2)


def lines_of(signals: FloatArray, starts: np.ndarray, window: FloatArray, inside: slice) -> ComplexArray:
    """Some bins of the Fourier transforms (C, K, L) of the segments of signals (C, T) from some samples on."""
    segments = np.lib.stride_tricks.sliding_window_view(signals, window.size, axis=1)
    hop = np.diff(starts)
    even = hop.size > 0 and bool((hop == hop[0]).all())
    held = segments[:, starts[0] : starts[-1] + 1 : hop[0]] if even else segments[:, starts]
    lines = scipy.fft.rfft(held * window, axis=2, overwrite_x=True)
    if inside.start < 2:  # the mean of a segment is in the first two lines of a Hann window
        lines[:, :, :2] -= held.mean(axis=2)[:, :, None] * window.size * np.array([0.5, -0.25])
    return lines[:, :, inside]


def hann(size: int) -> FloatArray:
    """A periodic Hann window (size,) [1]."""
    return np.asarray(0.5 - 0.5 * np.cos(2 * np.pi * np.arange(size) / size))


def starts_of(present: BoolArray, size: int) -> np.ndarray:
    """First samples of the segments of a size that overlap by half and miss no sample."""
    starts = np.arange(0, present.size - size + 1, max(1, size // 2)) if 2 <= size <= present.size else np.zeros(0, int)
    if starts.size == 0 or present.all():
        return starts
    missing = np.concatenate([[0], np.cumsum(~present)])
    return starts[missing[starts + size] == missing[starts]]


def independent(segments: float, bins: int) -> float:
    r"""Number of independent averages in a mean over segments and neighbouring bins.

    The covariance of two spectral estimates is the sum of :math:`|c_{ms}|^2` over the shifts s between their segments,
    with m the bins between them and :math:`c_{ms} = \sum_t w_t w_{t+s} e^{2\pi jmt/N} / \sum_t w_t^2`. For Hann windows
    that overlap by half c is 1, 1/6 and, one bin apart, 2/3 and 0.13.

    Parameters
    ----------
    segments : float [1]
        Number of segments.
    bins : int
        Number of neighbouring bins.

    Examples
    --------
    >>> round(independent(100, 1), 1), round(independent(100, 4) / independent(100, 1), 2)
    (94.8, 2.32)
    """
    variance = 0.0
    for m in range(min(bins, 4)):
        # Sum over the shifts of segments of the squared correlation of two bins.
        correlated = _overlap(m, 0.0) + 2.0 * (1.0 - 1.0 / segments) * _overlap(m, 0.5)
        variance += (1.0 if m == 0 else 2.0 * (1.0 - m / bins)) * correlated
    return float(segments * bins / variance)


def of_sine(segments: float) -> float:
    r"""Number of independent averages of a sine in noise, in segments that it passes with the same phase.

    The noise of overlapping segments correlates by 1/6, and enters the mean product with the sine by its first power:
    :math:`n = K / (1 + 2\,(1 - 1/K)/6)`.

    Examples
    --------
    >>> round(of_sine(29.0), 1)
    20.9
    """
    return segments / (1.0 + (1.0 - 1.0 / segments) / 3.0) - 1.0


@cache
def _overlap(bins: int, shift: float) -> float:
    """Squared correlation of the spectra of two Hann windows, the second later by a share of its length."""
    t = (np.arange(512) + 0.5) / 512
    first, second = np.sin(np.pi * t) ** 2, np.where(t >= shift, np.sin(np.pi * (t - shift)) ** 2, 0.0)
    return float(abs(np.mean(first * second * np.exp(2j * np.pi * bins * t))) ** 2 / np.mean(first**2) ** 2)


#: A ratio of cross spectra: the logarithm is a sum of those of G_ab, each with a power.
Terms = Sequence[tuple[int, int, float]]

#: Fewest lines of which one has two neighbours.
_NEIGHBOURS = 3
#: Fewest lines that tell whether channels share noise.
_FEWEST_LINES = 8
#: A ratio is outside of H1 and H2 by more than chance from so many standard uncertainties on.
_CHANCE = 2.0
#: Places of F1, V1 and V2 in a matrix of all three.
_F, _ONE, _TWO = 0, 1, 2


@dataclass(frozen=True, eq=False)
class Ratios(ByValue):
    """Logarithms of complex ratios with their covariance.

    Attributes
    ----------
    values : (L, R) complex array
        The ratios.
    covariance : (L, 2R, 2R) float array [1]
        Covariance of Re and Im, interleaved, of the logarithms of the ratios.
    """

    values: ComplexArray
    covariance: FloatArray


def ratios(matrix: ComplexArray, averages: FloatArray, wanted: Sequence[Terms]) -> Ratios:
    r"""Products and quotients of averaged cross spectra, with their covariance to first order.

    .. math::
        \operatorname{cov}(G_{ab}, G_{cd}^*) = \frac{G_{ac}\,G_{bd}^*}{n}, \qquad
        \operatorname{cov}(G_{ab}, G_{cd}) = \frac{G_{ad}\,G_{cb}}{n}

    Parameters
    ----------
    matrix : (L, C, C) complex array
        Cross spectra :math:`G_{ab} = E[X_a X_b^*]`.
    averages : (L,) float array [1]
        Number n of independent averages.
    wanted : sequence of terms
        Each ratio as terms (a, b, power): the product of :math:`G_{ab}^{power}`, on the principal branch.

    References
    ----------
    D. R. Brillinger, "Time Series: Data Analysis and Theory", 1981, theorem 4.3 and section 7.4.

    Examples
    --------
    >>> amplitudes = np.array([[3.0, 2.0j, 1.0]])
    >>> exact = ratios(amplitudes[:, :, None] * amplitudes[:, None, :].conj(), np.array([100.0]), OF_V2)
    >>> complex(exact.values[0, 0].round(12)), float(abs(exact.covariance).max().round(12))
    (-1.5j, 0.0)
    """
    values = np.ones((matrix.shape[0], len(wanted)), dtype=complex)
    for i, terms in enumerate(wanted):
        for a, b, power in terms:
            values[:, i] *= matrix[:, a, b] ** power
    size = len(wanted)
    covariance = np.empty((matrix.shape[0], 2 * size, 2 * size))
    for i, first in enumerate(wanted):
        for k, second in enumerate(wanted):
            straight = _summed(matrix, first, second, conjugate=True) / averages
            turned = _summed(matrix, first, second, conjugate=False) / averages
            covariance[:, 2 * i, 2 * k] = 0.5 * (straight + turned).real
            covariance[:, 2 * i + 1, 2 * k + 1] = 0.5 * (straight - turned).real
            covariance[:, 2 * i, 2 * k + 1] = 0.5 * (turned - straight).imag
            covariance[:, 2 * i + 1, 2 * k] = 0.5 * (turned + straight).imag
    return Ratios(values, covariance)


def _summed(matrix: ComplexArray, first: Terms, second: Terms, *, conjugate: bool) -> ComplexArray:
    """N times the covariance (L,) of two logarithms, the second conjugate or not."""
    total = np.zeros(matrix.shape[0], dtype=complex)
    for a, b, power in first:
        for c, d, other in second:
            if conjugate:
                moment = matrix[:, a, c] * matrix[:, d, b] / (matrix[:, a, b] * matrix[:, c, d].conj())
            else:
                moment = matrix[:, a, d] * matrix[:, c, b] / (matrix[:, a, b] * matrix[:, c, d])
            total += power * other * moment
    return total


def with_bias(estimate: Ratios, coherence: FloatArray, share: float) -> Ratios:
    r"""The ratios with the bias that noise may leave where no channel is an instrument.

    H1 and H2 differ by the coherence, :math:`\ln(H_2/H_1) = -\ln\gamma^2`. The truth lies anywhere between them, whose
    standard uncertainty is :math:`-\ln\gamma^2/\sqrt{12}` from the middle and twice as much from an end.

    Parameters
    ----------
    estimate : Ratios
        One ratio at each line.
    coherence : (L,) float array [1]
        Coherence of its channels.
    share : float [1]
        1 for a ratio in the middle of H1 and H2, 2 for one of them.
    """
    covariance = estimate.covariance.copy()
    covariance[:, 0, 0] += (share * np.log(np.maximum(coherence, 1e-300))) ** 2 / 12.0
    return Ratios(estimate.values, covariance)


def beyond_bounds(matrix: ComplexArray, averages: FloatArray) -> tuple[FloatArray, FloatArray]:
    """How far F1/V1 and V2/V1 by the instruments V2 and F1 are outside of H1 and H2.

    Their moduli lie between these, whatever the noise of the three channels, unless an instrument shares noise with
    another channel: where the rig resonates F1 vanishes, and what leaks into it from other frequencies is in V2, too.

    Parameters
    ----------
    matrix : (L, 3, 3) complex array
        Cross spectra of F1, V1 and V2.
    averages : (L,) float array [1]
        Number of independent averages.

    Returns
    -------
    off, pull : (L, 2) float arrays [1]
        Distance of the logarithm of each modulus, 0 inside, and the same in its standard uncertainty.

    Examples
    --------
    >>> spectra = np.diag([1.0, 0.0, 0.0]) + np.ones((3, 3)) + 0j
    >>> [part.tolist() for part in beyond_bounds(spectra[None], np.array([50.0]))]
    [[[0.0, 0.0]], [[0.0, 0.0]]]
    """
    off, pull = np.zeros((2, len(matrix), 2))
    for i, (of, instrument) in enumerate(((_F, _TWO), (_TWO, _F))):
        ratio = (of, instrument, 1), (_ONE, instrument, -1)
        bounds = ((of, _ONE, -1), (_ONE, _ONE, 1)), ((of, of, -1), (_ONE, of, 1))
        beside = ratios(matrix, averages, [(*ratio, *bound) for bound in bounds])
        outside = np.maximum(np.log(np.abs(beside.values)) * [-1.0, 1.0], 0.0)
        std = np.sqrt(np.maximum(np.diagonal(beside.covariance, axis1=1, axis2=2)[:, ::2], _ROUND_OFF**2))
        off[:, i], pull[:, i] = outside.max(axis=1), (outside / std).max(axis=1)
    return off, pull


def with_shared_noise(estimate: Ratios, off: FloatArray, pull: FloatArray) -> Ratios:
    """F1/V1 and V2/V1 with the error of G_F2, which both have in common: what `beyond_bounds` gives beyond chance."""
    error = np.max(np.where(pull > _CHANCE, off, 0.0), axis=1)
    both = np.array([1.0, 0.0, 1.0, 0.0])
    return Ratios(estimate.values, estimate.covariance + error[:, None, None] ** 2 * np.outer(both, both))


def with_bend(estimate: Ratios, weight: ComplexArray, broad: BoolArray | bool = True) -> Ratios:
    r"""The ratios with the error that their change over the width of a line makes, as at a sharp resonance.

    A line is a mean over frequency with the weight S. Its departure from the ratio g in the middle is

    .. math::
        \tfrac12 g''\sigma^2 + g'\frac{S'}{S}\sigma^2 \approx
        \frac{g_+ - 2g + g_-}{24} + \frac{(g_+ - g_-)\ln(S_+/S_-)}{48}

    where + and - are the neighbouring lines. The variance over frequency is a twelfth of the squared distance of the
    lines, in a band as for Hann windows two bins apart. Without a change of g, noise enlarges the uncertainty by 1 %.

    Parameters
    ----------
    estimate : Ratios
        Ratios (L, R) at lines in the order of their frequency.
    weight : (L, R) complex array
        The cross spectrum by which each ratio is weighted, its denominator.
    broad : (L,) bool array or bool
        False for a line that is a sine, and no mean over frequency.
    """
    if len(weight) < _NEIGHBOURS:
        return estimate
    below, here, above = estimate.values[:-2], estimate.values[1:-1], estimate.values[2:]
    with np.errstate(divide="ignore", invalid="ignore"):
        bend = ((above - 2.0 * here + below) / 24.0 + (above - below) * np.log(weight[2:] / weight[:-2]) / 48.0) / here
    bend = np.nan_to_num(np.concatenate([bend[:1], bend, bend[-1:]]), posinf=0.0, neginf=0.0)
    bend = np.where(np.broadcast_to(broad, len(bend))[:, None], bend, 0.0)
    covariance = estimate.covariance.copy()
    for i in range(bend.shape[1]):
        covariance[:, 2 * i, 2 * i] += bend[:, i].real ** 2
        covariance[:, 2 * i + 1, 2 * i + 1] += bend[:, i].imag ** 2
    return Ratios(estimate.values, covariance)


def with_instrument(place: int) -> tuple[Terms, ...]:
    """F1/V1 and V2/V1 with one instrument, at a place in the matrix."""
    return ((_F, place, 1), (_ONE, place, -1)), ((_TWO, place, 1), (_ONE, place, -1))


#: F1/V1 with the instrument V2, and V2/V1 with the instrument F1.
OF_V2: tuple[Terms, ...] = (((_F, _TWO, 1), (_ONE, _TWO, -1)), ((_TWO, _F, 1), (_ONE, _F, -1)))
#: F1/V1 as the geometric mean of H1 and H2: its phase is that of G_F1.
OF_V1: tuple[Terms, ...] = (((_F, _ONE, 0.5), (_ONE, _F, -0.5), (_F, _F, 0.5), (_ONE, _ONE, -0.5)),)
#: The closure phase: the product of the cross spectra around F1, V1, V2, which is real if noises are independent.
CLOSURE: tuple[Terms, ...] = (((_F, _ONE, 1), (_ONE, _TWO, 1), (_TWO, _F, 1)),)


def correlations_of(matrix: ComplexArray, closure: FloatArray) -> FloatArray:
    r"""Correlation of the noises of each pair of channels, from the closure phases of all lines.

    Noise that two channels share adds :math:`c\sqrt{N_aN_b}` to :math:`G_{ab}`, which turns the closure phase by

    .. math:: \mathrm{Im}\bigl(c \sqrt{N_aN_b}/G_{ab}\bigr), \qquad
        N_a = G_{aa} - |G_{ab}||G_{ca}|/|G_{bc}|

    c is taken as the same over the band. What it has in phase with the signal at a line is not seen there.

    Parameters
    ----------
    matrix : (L, 3, 3) complex array
        Cross spectra of F1, V1 and V2.
    closure : (L, 2) float array [rad]
        Closure phases and their standard uncertainties.

    Returns
    -------
    (3, 4) float array [1]
        For F1 and V1, V1 and V2, V2 and F1: modulus of c, its standard uncertainty, the chi-square of two degrees of
        freedom that c explains, and the relative error of the cross spectrum, in the median of the lines.
    """
    moduli = np.abs(matrix)
    noise = [
        np.maximum(matrix[:, a, a].real - moduli[:, a, b] * moduli[:, a, c] / np.maximum(moduli[:, b, c], 1e-300), 0.0)
        for a, b, c in ((0, 1, 2), (1, 2, 0), (2, 0, 1))
    ]
    known = np.isfinite(closure).all(axis=1) & (closure[:, 1] > 0)
    rows = []
    for a, b in ((_F, _ONE), (_ONE, _TWO), (_TWO, _F)):
        turned = np.sqrt(noise[a] * noise[b]) / np.where(matrix[:, a, b] == 0, 1.0, matrix[:, a, b])
        design = np.stack([turned.imag, turned.real], axis=1)[known] / closure[known, 1, None]
        normal = design.T @ design
        if known.sum() < _FEWEST_LINES or not np.linalg.cond(normal) < 1e12:
            rows.append((0.0, np.inf, 0.0, 0.0))
            continue
        by = design.T @ (closure[known, 0] / closure[known, 1])
        parts, inverse = np.linalg.solve(normal, by), np.linalg.inv(normal)
        size = float(np.linalg.norm(parts))
        along = parts / max(size, 1e-300)
        error = size * float(np.median(np.abs(turned[known])))
        rows.append((size, float(np.sqrt(along @ inverse @ along)), float(by @ parts), error))
    return np.array(rows)
