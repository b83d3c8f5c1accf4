"""Averaged cross spectra of the channels of a recording, by Welch's method with Hann windows that overlap by half."""

from __future__ import annotations

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
