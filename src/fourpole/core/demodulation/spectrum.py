"""Spectra of a residual: interfering lines, and the noise beside a frequency."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from fourpole.core.arrays import BoolArray, ByValue, ComplexArray, FloatArray
from fourpole.core.demodulation.sinefit import SineFit
from fourpole.core.demodulation.sums import hann

#: Power over the local noise at which a line is real: one false line in some ten thousand records of 10 000 bins.
LINE_LIMIT = 30.0
#: Closest that a line may lie to a fitted frequency, in bins of 1/T.
LINE_GAP = 2.5
_BLOCK = 64
_FEWEST_CYCLES = 2.5
_MOST_BINS = 16
_ALL_OFFSETS = np.r_[-_MOST_BINS:-1, 2 : _MOST_BINS + 1]
_BAND = 0.4
_FEWEST_BINS = 4
#: Least share of a line's amplitude that a bin has under a Hann window; parts of a bin to which a guess is rounded.
_SCALLOP, _QUARTERS = 0.84, 4
#: Farthest that a line may lie from the bin at its maximum, in bins: half a bin, and noise.
_FARTHEST = 0.75
#: A weaker line than this share of the strongest is no excitation.
_WEAK = 0.3


@dataclass(frozen=True, eq=False)
class Noise(ByValue):
    """Noise of the channels' complex amplitudes at one frequency.

    Attributes
    ----------
    covariance : (channels, channels) complex
        E[dX dX*] of the complex amplitudes dX, for amplitudes whose variance under white noise is 4/N.
    band : (float, float) [Hz]
        Lowest and highest frequency of the bins used.
    dof : float [1]
        Degrees of freedom of the covariance.
    """

    covariance: ComplexArray
    band: tuple[float, float]
    dof: float


@dataclass(frozen=True)
class Line:
    """A line of a motion, converted to a velocity.

    Attributes
    ----------
    frequency : float [Hz]
        Its frequency.
    bin : float [Hz]
        The frequency, rounded to a quarter of a bin.
    amplitude : float
        Its amplitude, times N/4.
    """

    frequency: float
    bin: float
    amplitude: float


def strongest_lines(spectrum: ComplexArray, resolution: float, *, order: int) -> list[Line]:
    """The lines of a motion that reach 0.3 of the strongest, converted to a velocity; the strongest first.

    Parameters
    ----------
    spectrum : (N // 2 + 1,) complex array
        The motion under a Hann window.
    resolution : float [Hz]
        Width of a bin, 1/T.
    order : {-1, 0, 1}
        Number of differentiations that make the motion a velocity.
    """
    power = _power(spectrum)
    lowest = int(np.ceil(_FEWEST_CYCLES))  # lower bins show drift, not lines
    falls = power[lowest - 1] > power[lowest]
    power[:lowest] = 0.0
    stands_out = _excess(power[None], _BLOCK, np.zeros((1, 1))) > LINE_LIMIT
    if stands_out.any():  # otherwise differentiated noise could exceed a line
        power[~stands_out] = 0.0
    power[lowest:] *= (2 * np.pi * resolution * np.arange(lowest, power.size)) ** (2 * order)
    lines = []
    for top in _maxima(power, _WEAK * _SCALLOP):
        off = -0.5 if falls and top == lowest else _off_bin(spectrum, top)
        size = float(np.sqrt(power[top]) * (1 + off / top) ** order / (np.sinc(off) / (1 - off**2)))
        lines.append(Line((top + off) * resolution, round(_QUARTERS * (top + off)) / _QUARTERS * resolution, size))
    lines.sort(key=lambda line: -line.amplitude)
    return [line for line in lines if line.amplitude >= _WEAK * lines[0].amplitude]


def _maxima(power: FloatArray, share: float) -> list[int]:
    """Places of the maxima of a spectrum whose amplitude reaches a share of the largest; one at least."""
    largest = int(np.argmax(power))
    middle = power[1:-1]
    tops = (middle >= share**2 * power[largest]) & (middle >= power[:-2]) & (middle >= power[2:]) & (middle > 0)
    places = (np.flatnonzero(tops) + 1).tolist()
    return places if largest in places else [*places, largest]


def _off_bin(spectrum: ComplexArray, top: int) -> float:
    """Distance of a line from the bin at its maximum under a Hann window, in bins.

    For a complex sine it is exact. Other lines, n bins away, change it by 1/n^4, less than they change a bin.
    """
    if not 0 < top < spectrum.size - 1:
        return 0.0
    left, middle, right = spectrum[top - 1 : top + 2].tolist()
    around = 2 * middle - left - right
    off = 2 * ((left - right) / around).real if around else 0.0
    return off if abs(off) < _FARTHEST else 0.0


def _vertex(three: FloatArray) -> float:
    """Place of a maximum of the power against the middle one of three bins, by a parabola through the logarithms."""
    if three.size < 3 or np.any(three <= 0):
        return 0.0
    left, mid, right = np.log(three).tolist()
    bend = left - 2 * mid + right
    return 0.5 * (left - right) / bend if bend < 0 else 0.0


def sharpened(spectrum: ComplexArray, resolution: float, frequency: float) -> float:
    """Frequency of the line near a first guess [Hz], in a spectrum under a Hann window."""
    top = round(frequency / resolution)
    sharper = (top + _off_bin(spectrum, top)) * resolution
    return sharper if abs(sharper - frequency) < 0.25 * resolution else frequency


def off_multiples(frequency: ArrayLike, base: float) -> FloatArray:
    """Distance of frequencies (...,) from the nearest multiple of a base frequency, which is a multiple too [Hz]."""
    values = np.asarray(frequency, dtype=float)
    return np.abs(values - base * np.maximum(np.round(values / base), 1.0))


def peak_place(spectrum: FloatArray, index: int) -> float:
    """Position of a maximum in bins, by a parabola through the logarithms of three bins."""
    return index + _vertex(spectrum[max(index - 1, 0) : index + 2] ** 2)


def find_lines(residual: FloatArray, rate: float, least: FloatArray) -> FloatArray:
    """Frequencies [Hz] of the lines that stand out of the residual's noise in any channel, strongest first.

    Lines with an amplitude below `least` (channels,) are ignored.
    """
    count = residual.shape[1]
    power = _power(np.fft.rfft(residual * hann(count), axis=1))
    smallest = (0.25 * count * least[:, None]) ** 2  # the window has the mean 0.5
    excess = _excess(power, _BLOCK, smallest)
    middle = excess[1:-1]
    peaks = np.flatnonzero((middle > LINE_LIMIT) & (middle >= excess[:-2]) & (middle > excess[2:])) + 1
    peaks = peaks[np.argsort(-excess[peaks])]
    return np.array([index + _vertex(excess[index - 1 : index + 2]) for index in peaks.tolist()]) * rate / count


def _power(spectrum: ComplexArray) -> FloatArray:
    """Squared moduli."""
    return np.asarray(spectrum.real**2 + spectrum.imag**2)


def _excess(power: FloatArray, block: int, smallest: FloatArray) -> FloatArray:
    """Power (channels, bins) over the local noise, the largest of the channels; 0 far from bins that may stand out.

    The noise level is the mean of exponential noise, from the median of each block of bins. Power below `smallest`
    (channels, 1) never stands out.
    """
    channels, bins = power.shape
    size = min(block, bins)
    count = bins // size
    blocks = power[:, : count * size].reshape(channels, count, size)
    excess = np.zeros(bins)
    shown = _may_stand_out(power, blocks, smallest)
    if not shown.any():
        return excess
    shown[:-1] |= shown[1:]
    shown[1:] |= shown[:-1]
    level = np.maximum(median(blocks[:, shown]) / np.log(2.0), np.maximum(smallest / LINE_LIMIT, 1e-300))
    excess[: count * size].reshape(count, size)[shown] = np.max(blocks[:, shown] / level[:, :, None], axis=0)
    if shown[-1]:
        excess[count * size :] = np.max(power[:, count * size :] / level[:, -1:], axis=0)
    return excess


def _may_stand_out(power: FloatArray, blocks: FloatArray, smallest: FloatArray) -> BoolArray:
    """Flags (blocks,) of those in which a bin may exceed `LINE_LIMIT` times the local level; False is certain.

    The median of a block is at least its largest bin times log(2) over the limit, unless half of its bins are smaller.
    The bins after the last block count as its own.
    """
    largest = blocks.max(axis=2)
    rest = power[:, blocks.shape[1] * blocks.shape[2] :]
    if rest.size:
        largest[:, -1] = np.maximum(largest[:, -1], rest.max(axis=1))
    below = (blocks < (largest * (np.log(2.0) / LINE_LIMIT))[:, :, None]).sum(axis=2)
    return np.asarray(((largest > smallest) & (below >= blocks.shape[2] // 2)).any(axis=0))


def median(values: FloatArray) -> FloatArray:
    """Median along the last axis of finite values."""
    half = values.shape[-1] // 2
    low = half - 1 + values.shape[-1] % 2
    parted = np.partition(values, sorted({low, half}), axis=-1)
    return np.asarray(0.5 * (parted[..., low] + parted[..., half]))


def noise_beside(fits: Sequence[SineFit], harmonics: int = 1) -> list[Noise]:
    """Cross-spectra of the residuals in the bins beside the fundamental and beside its next harmonics.

    At most 16 bins on each side of a harmonic and within 0.4 of its frequency are used, without the bins next to it and
    to removed lines. If fewer than four bins remain, the noise is taken as white and as large as the whole residual.
    """
    resolution, rate = fits[0].resolution, min(fit.track.exact_rate for fit in fits)
    frequencies = fits[0].omega / (2 * np.pi) * np.arange(1, harmonics + 1)
    used = _used(frequencies, resolution, rate, np.concatenate([fit.lines / (2 * np.pi) for fit in fits]))
    enough = np.count_nonzero(used, axis=1) >= _FEWEST_BINS
    widest = int(np.abs(_ALL_OFFSETS * (used & enough[:, None])).max())
    bins = np.concatenate([_bins(fit, harmonics, widest) for fit in fits])
    noises = []
    for k, frequency in enumerate(frequencies.tolist()):
        if not enough[k]:
            noises.append(_white(fits, rate))
            continue
        offsets = _ALL_OFFSETS[used[k]]
        beside = bins[:, k, offsets + widest]
        low, high = (frequency + offset * resolution for offset in offsets[[0, -1]].tolist())
        noises.append(Noise(beside @ beside.conj().T / offsets.size, (low, high), 2.0 * offsets.size))
    return noises


def _used(frequencies: FloatArray, resolution: float, rate: float, lines: FloatArray) -> BoolArray:
    """Flags (frequencies, offsets) of the bins beside frequencies [Hz] that show their noise."""
    reach = np.minimum(_BAND * frequencies / resolution, (0.5 * rate - frequencies) / resolution - 1).astype(int)
    used = np.abs(_ALL_OFFSETS) <= reach[:, None]
    if lines.size:
        places = frequencies[:, None] + _ALL_OFFSETS * resolution
        used &= (np.abs(places - lines[:, None, None]) > 1.5 * resolution).all(axis=0)
    return np.asarray(used)


def _bins(fit: SineFit, harmonics: int, reach: int) -> ComplexArray:
    """Amplitudes (channels, harmonics, 2 reach + 1) of the residual, whole bins beside each harmonic, at the middle."""
    sums = fit.rows.beside(fit.residual, harmonics, 2 * np.pi * fit.resolution, reach)
    return np.asarray(sums * (2.0 / fit.track.known))


def _white(fits: Sequence[SineFit], rate: float) -> Noise:
    """White noise of the level of each fit's residual, without correlation between fits."""
    blocks = [fit.residual @ fit.residual.T / max(fit.dof, 1) * (4.0 / fit.track.known) for fit in fits]
    dof = min(fit.dof for fit in fits)
    whole = np.block(
        [[one if one is other else np.zeros((len(one), len(other))) for other in blocks] for one in blocks]
    )
    return Noise(whole.astype(complex), (0.0, 0.5 * rate), float(max(dof, 1)))
