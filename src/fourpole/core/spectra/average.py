"""Averaged cross spectra of the channels of a recording, by Welch's method with Hann windows that overlap by half."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import fft

from fourpole.core.arrays import BoolArray, ByValue, ComplexArray, FloatArray
from fourpole.core.demodulation.tracks import Track
from fourpole.errors import RecordingError, TooShortError

#: Fewest segments: the covariance of a ratio needs a matrix of more averages than channels.
_FEWEST = 8
#: Samples that are transformed at a time.
_AT_A_TIME = 2_000_000
#: Correlation of the motion in neighbouring segments above which it is one sine; that of noise is 1/6.
_STEADY = 0.7
#: Relative round-off of a frequency.
_ROUND_OFF = 1e-9
#: Distance in bins from which on a sine belongs to another bin.
_AWAY = 0.6


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
    held : (L,) float array [1]
        Number of segments that hold the power of the motion: all of them under steady excitation, a few in a sweep.
    foreign : (L,) bool array
        Whether the motion at the line is that of a sine at another frequency, as between the sines of a multisine.
    """

    frequency: FloatArray
    matrix: ComplexArray
    averages: FloatArray
    width: FloatArray
    held: FloatArray
    foreign: BoolArray

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
        A line for each bin. Neighbours are not independent: see `fourpole.core.spectra.lines.thinned`. If the phase of
        the motion advances alike from segment to segment, the motion is one sine, whose frequency the advance gives.

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
    starts = _starts(track.present, size)
    if starts.size < _FEWEST:
        raise TooShortError(
            f"the recording has {starts.size} segments of {segment:.3g} s without a missing sample, at least {_FEWEST} "
            "are needed: record longer"
        )
    frequency = np.arange(size // 2 + 1) * track.rate / size
    low, high = band[0] * (1 - _ROUND_OFF), band[1] * (1 + _ROUND_OFF)
    inside = (frequency >= low) & (frequency <= high) & (frequency > 0)
    if not inside.any():
        raise RecordingError(
            f"no line of a spectrum lies between {band[0]:.4g} and {band[1]:.4g} Hz: sample faster, or record longer"
        )
    first, last = np.flatnonzero(inside)[[0, -1]].tolist()
    sums = _Sums(track.names.index("motion_in"), len(track.names), last + 1 - first)
    window = hann(size)
    for some in _batches(starts, max(1, _AT_A_TIME // (size * len(track.names)))):
        pieces = np.stack([track.signals[:, start : start + size] for start in some.tolist()], axis=1)
        pieces -= pieces.mean(axis=2, keepdims=True)
        pieces *= window
        sums.add(fft.rfft(pieces, axis=2)[:, :, first : last + 1])
    scale = 2.0 / (track.rate * np.sum(window**2) * starts.size)
    found, step = frequency[inside], track.rate / size
    return CrossSpectra(
        found,
        scale * sums.matrix.transpose(2, 0, 1),
        np.full(found.size, independent(starts.size, 1)),
        np.full(found.size, step),
        sums.held(starts.size),
        sums.foreign(found, max(1, size // 2) / track.rate, step),
    )


class _Sums:
    """Sums over segments of the products of their lines, and of what tells a sine or a sweep of the motion."""

    def __init__(self, motion: int, channels: int, lines: int) -> None:
        self.matrix: ComplexArray = np.zeros((channels, channels, lines), dtype=complex)
        self._motion, self._last = motion, np.zeros((0, lines), dtype=complex)
        self._advance, self._fourth = np.zeros(lines, dtype=complex), np.zeros(lines)

    def add(self, lines: ComplexArray) -> None:
        """Add the lines (channels, segments, lines) of some segments that follow those before."""
        for a in range(lines.shape[0]):
            for b in range(a + 1):
                product = np.einsum("kl,kl->l", lines[a], lines[b].conj())
                self.matrix[a, b] += product
                if a != b:
                    self.matrix[b, a] += product.conj()
        moved = np.concatenate([self._last, lines[self._motion]])
        self._advance += np.einsum("kl,kl->l", moved[1:], moved[:-1].conj())
        power = lines[self._motion].real ** 2 + lines[self._motion].imag ** 2
        self._fourth += np.einsum("kl,kl->l", power, power)
        self._last = moved[-1:]

    def held(self, segments: int) -> FloatArray:
        """Number of segments that hold the power. Gaussian noise has a fourth moment of 2 times its power squared."""
        square = self.matrix[self._motion, self._motion].real
        return np.minimum(2.0 * square**2 / np.maximum(self._fourth, 1e-300), float(segments))

    def foreign(self, frequency: FloatArray, hop: float, step: float) -> BoolArray:
        """Lines whose motion is a sine at another frequency; segments are `hop` [s] apart, bins `step` [Hz]."""
        sine = np.abs(self._advance) > _STEADY * self.matrix[self._motion, self._motion].real
        off = np.angle(self._advance * np.exp(-2j * np.pi * frequency * hop)) / (2 * np.pi * hop)
        return np.asarray(sine & (np.abs(off) > _AWAY * step))


def hann(size: int) -> FloatArray:
    """A periodic Hann window (size,) [1]."""
    return np.asarray(0.5 - 0.5 * np.cos(2 * np.pi * np.arange(size) / size))


def _starts(present: BoolArray, size: int) -> np.ndarray:
    """First samples of the segments of a size that overlap by half and miss no sample."""
    starts = np.arange(0, present.size - size + 1, max(1, size // 2)) if 2 <= size <= present.size else np.zeros(0, int)
    missing = np.concatenate([[0], np.cumsum(~present)])
    return starts[missing[starts + size] == missing[starts]] if starts.size else starts


def _batches(starts: np.ndarray, count: int) -> list[np.ndarray]:
    return [starts[at : at + count] for at in range(0, starts.size, count)]


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
    apart = np.arange(bins)
    variance = sum(
        (1.0 if m == 0 else 2.0 * (1.0 - m / bins)) * _correlated(int(m), segments) for m in apart.tolist() if m < 4
    )
    return float(segments * bins / variance)


def _correlated(bins: int, segments: float) -> float:
    """Sum over the shifts of segments of the squared correlation of two bins."""
    same, half = (_overlap(bins, shift) for shift in (0.0, 0.5))
    return same + 2.0 * (1.0 - 1.0 / segments) * half


def _overlap(bins: int, shift: float) -> float:
    """Squared correlation of the spectra of two Hann windows, the second later by a share of its length."""
    t = (np.arange(512) + 0.5) / 512
    first, second = np.sin(np.pi * t) ** 2, np.where(t >= shift, np.sin(np.pi * (t - shift)) ** 2, 0.0)
    return float(abs(np.mean(first * second * np.exp(2j * np.pi * bins * t))) ** 2 / np.mean(first**2) ** 2)
