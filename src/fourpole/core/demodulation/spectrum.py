"""Spectra of a residual: interfering lines, and the noise beside a frequency."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy import linalg

from fourpole.core.arrays import ByValue, ComplexArray, FloatArray
from fourpole.core.demodulation.sinefit import SineFit

#: Power over the local noise at which a line is real: one false line in some ten thousand records of 10 000 bins.
LINE_LIMIT = 30.0
#: Closest that a line may lie to a fitted frequency, in bins of 1/T.
LINE_GAP = 2.5
_BLOCK = 64
_FEWEST_CYCLES = 2.5
_MOST_BINS = 16
_BAND = 0.4
_FEWEST_BINS = 4
_MANY = 1 << 18


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


def strongest_line(samples: FloatArray, rate: float, *, order: int) -> tuple[float, FloatArray, FloatArray]:
    """Frequency [Hz] of the strongest line of a motion, converted to a velocity, with the spectrum searched.

    Parameters
    ----------
    samples : (N,) float array
        The motion.
    rate : float [Hz]
        Samples per second.
    order : {-1, 0, 1}
        Number of differentiations that make the motion a velocity.

    Returns
    -------
    float [Hz], (n,) float array [Hz], (n,) float array
        Frequency of the line; frequencies and amplitudes of the spectrum.
    """
    window = hann(samples.size)
    padded = (4 if samples.size < _MANY else 1) * samples.size  # a long record has fine bins without padding
    spectrum = np.abs(np.fft.rfft(samples * window, padded)) * 2.0 / window.sum()
    frequency = np.fft.rfftfreq(padded, 1.0 / rate)
    lowest = int(np.ceil(_FEWEST_CYCLES * padded / samples.size))  # lower bins show drift, not lines
    spectrum[:lowest] = 0.0
    stands_out = spectrum**2 > LINE_LIMIT * _floor(spectrum[None] ** 2, 4 * _BLOCK)[0]
    if stands_out.any():  # otherwise differentiated noise could exceed a line
        spectrum = np.where(stands_out, spectrum, 0.0)
    spectrum[lowest:] *= (2 * np.pi * frequency[lowest:]) ** order
    return peak_place(spectrum, int(np.argmax(spectrum))) * rate / padded, frequency, spectrum


def off_multiples(frequency: ArrayLike, base: float) -> FloatArray:
    """Distance of frequencies (...,) from the nearest multiple of a base frequency, which is a multiple too [Hz]."""
    at = np.asarray(frequency, dtype=float)
    return np.abs(at - base * np.maximum(np.round(at / base), 1.0))


def hann(count: int) -> FloatArray:
    """Hann window of a record of `count` samples."""
    return 0.5 - 0.5 * np.cos(2 * np.pi / count * np.arange(count))


def peak_place(spectrum: FloatArray, index: int) -> float:
    """Position of a maximum in bins, by a parabola through the logarithms of three bins."""
    if not 0 < index < spectrum.size - 1 or np.any(spectrum[index - 1 : index + 2] <= 0):
        return float(index)
    left, mid, right = np.log(spectrum[index - 1 : index + 2])
    bend = left - 2 * mid + right
    return index + (0.5 * (left - right) / bend if bend < 0 else 0.0)


def find_lines(residual: FloatArray, rate: float, least: FloatArray) -> FloatArray:
    """Frequencies [Hz] of the lines that stand out of the residual's noise in any channel, strongest first.

    Lines with an amplitude below `least` (channels,) are ignored.
    """
    count = residual.shape[1]
    window = hann(count)
    power = np.abs(np.fft.rfft(residual * window, axis=1)) ** 2
    floor = np.maximum(_floor(power), (0.5 * window.sum() * least[:, None]) ** 2 / LINE_LIMIT)
    excess = np.max(power / np.maximum(floor, 1e-300), axis=0)
    middle = excess[1:-1]
    peaks = np.flatnonzero((middle > LINE_LIMIT) & (middle >= excess[:-2]) & (middle > excess[2:])) + 1
    peaks = peaks[np.argsort(-excess[peaks])]
    root = np.sqrt(excess)
    return np.array([peak_place(root, int(index)) for index in peaks]) * rate / count


def _floor(power: FloatArray, block: int = _BLOCK) -> FloatArray:
    """Local noise level of a power spectrum: the mean of exponential noise, from the median of each block of bins."""
    bins = power.shape[1]
    size = min(block, bins)
    blocks = power[:, : bins // size * size].reshape(power.shape[0], -1, size)
    level = np.median(blocks, axis=2) / np.log(2.0)
    return level[:, np.minimum(np.arange(bins) // size, level.shape[1] - 1)]


def noise_beside(fits: Sequence[SineFit], frequency: float) -> Noise:
    """Cross-spectrum of the residuals in the bins beside a frequency [Hz].

    At most 16 bins on each side and within 0.4 of the frequency are used, without the bins next to the frequency and to
    removed lines. If fewer than four bins remain, the noise is assumed to be white and taken from the whole residual.
    """
    resolution, rate = fits[0].resolution, min(fit.rate for fit in fits)
    reach = min(_MOST_BINS, int(_BAND * frequency / resolution), int((0.5 * rate - frequency) / resolution) - 1)
    offsets = np.arange(2, reach + 1)
    offsets = np.concatenate([-offsets[::-1], offsets])
    places = frequency + offsets * resolution
    lines = np.concatenate([fit.lines / (2 * np.pi) for fit in fits])
    if lines.size:
        offsets = offsets[np.min(np.abs(places[:, None] - lines), axis=1) > 1.5 * resolution]
    if offsets.size < _FEWEST_BINS:
        return _white(fits, rate)
    bins = np.concatenate([_bins(fit, frequency, offsets) for fit in fits])
    covariance = bins @ bins.conj().T / offsets.size
    band = (frequency + float(offsets.min()) * resolution, frequency + float(offsets.max()) * resolution)
    return Noise(covariance, band, 2.0 * offsets.size)


def _bins(fit: SineFit, frequency: float, offsets: np.ndarray) -> ComplexArray:
    """Amplitudes (channels, offsets) of the residual, whole bins beside the fundamental, at the record's middle."""
    phase = 2 * np.pi * frequency * fit.track.time
    shifted = fit.residual * np.exp(-1j * (phase if fit.track.course is None else phase + fit.track.course.turn))
    to_middle = np.exp(-2j * np.pi * offsets * fit.resolution * fit.track.time[0])
    return np.asarray(np.fft.fft(shifted, axis=1)[:, offsets] * (2.0 / fit.track.present.sum()) * to_middle)


def _white(fits: Sequence[SineFit], rate: float) -> Noise:
    """White noise of the level of each fit's residual, without correlation between fits."""
    blocks = [fit.residual @ fit.residual.T / max(fit.dof, 1) * (4.0 / fit.track.present.sum()) for fit in fits]
    dof = min(fit.dof for fit in fits)
    return Noise(linalg.block_diag(*blocks).astype(complex), (0.0, 0.5 * rate), float(max(dof, 1)))
