"""Random excitation and sweeps: the part of F1 that is not linear in the motion, told from the noise of the sensors."""

from __future__ import annotations

import numpy as np
import scipy

from fourpole.core import stats
from fourpole.core.arrays import ComplexArray, FloatArray
from fourpole.core.confidence import SEARCH_CHANCE
from fourpole.core.demodulation.steady import longest
from fourpole.core.demodulation.tracks import Track
from fourpole.core.recording import Recording
from fourpole.core.spectra.average import bins_of, hann, lines_of, starts_of
from fourpole.core.spectra.excited import Excited, factor_of, prepared
from fourpole.core.spectra.motion import CYCLES

#: Samples per second over the top of the band, and the most of these samples that are looked at.
_RATE, _MOST = 2.6, 1 << 14
#: Usual number of segments, and the fewest.
_SEGMENTS, _FEWEST = 64, 16
#: Variance of a sum over Hann windows that overlap by half, over that of as many independent terms:
#: mean(W²)/(mean(w²) mean(W)), with W the sum of the squares of both windows w at a sample.
_OVERLAP = 19.0 / 9.0
#: Steepness of the smooth sign of the velocity over its standard deviation.
_STEEP = 3.0
#: Eigenvalue of the correlations of the functions below which a function is the sum of others.
_ALIKE = 1e-3
#: Share of the power at a line that single precision leaves.
_ROUND_OFF = 1e-6
#: Distance in samples up to which a period is a whole number of samples.
_WHOLE = 0.1
#: A function over time, and the means of its slopes by the deflection and by the velocity.
_Function = tuple[FloatArray, float, float]


def nonlinear_share(recording: Recording, band: tuple[float, float], lines: Excited) -> float:
    r"""Part of F1 that functions of the deflection and its velocity explain beyond all that is linear.

    The deflection d is that of the best linear approximation. With u and w, d and its velocity over their standard
    deviations, the functions g are :math:`u^2, u^3, w^2, w|w|, u|w|, u^2w, uw^2` and a smooth sign of w. At each
    frequency, what is linear in d is removed from F1 and from g:

    .. math::
        d = \frac{(1 - V_2/V_1)\,V_1}{j\omega}, \qquad
        F_1 - G\,d = \Bigl(1 - \frac{V_2}{V_1}\Bigr) \sum_i c_i\,g_i^\perp + e

    The coefficients c are the same at all frequencies. For a linear specimen they are zero, whatever the noise of the
    sensors is: a chi-square tests this, with the chance `SEARCH_CHANCE` of a false alarm. Noise of V1 is in e and in g.
    These are uncorrelated all the same if the motion is Gaussian (Bussgang). For another motion their correlation is
    known but for the size of the noise, which is at most all that is incoherent; it is removed.

    Parameters
    ----------
    recording : Recording
    band : (float, float) [Hz]
        Lowest and highest frequency.
    lines : Excited
        The amplitudes in this band.

    Returns
    -------
    float [1]
        Root mean square of the sum over that of F1 in the band. It is a lower limit, because the law of a specimen may
        be another one. 0 where noise explains it; not-a-number where the recording is too short.

    References
    ----------
    J. J. Bussgang, "Crosscorrelation functions of amplitude-distorted Gaussian signals", MIT RLE report 216, 1952;
    R. Pintelon and J. Schoukens, "System Identification: A Frequency Domain Approach", 2nd ed., 2012, ch. 3 (the best
    linear approximation).
    """
    track, band = prepared(recording, band)
    signals = _part(track, _MOST / (_RATE * band[1]), lines.period)
    count = signals.shape[1]
    if 2.0 * band[0] * count < (_FEWEST + 1.0) * track.rate:  # a segment has less than a cycle of the lowest frequency
        return np.nan
    bins = slice(int(np.ceil(band[0] * count / track.rate)), int(band[1] * count / track.rate) + 1)
    size = scipy.fft.next_fast_len(int(_RATE * bins.stop), real=True)
    rate = size * track.rate / count
    usual = max(2.0 * size / (_SEGMENTS + 1.0), CYCLES * rate / band[0])
    length = int(min(lines.length * rate if lines.length * rate < size else usual, 2.0 * size / (_FEWEST + 1.0)))
    _, v1, v2 = lines.phasors.amplitudes.T
    with np.errstate(divide="ignore", invalid="ignore"):
        moved = np.where(np.isfinite(v2 / v1), 1.0 - v2 / v1, 1.0)

    def over_time(spectrum: ComplexArray) -> FloatArray:
        """Samples [of the unit of the spectrum] at the lower rate."""
        whole = np.zeros(size // 2 + 1, dtype=np.complex64)
        whole[bins] = spectrum
        return np.asarray(scipy.fft.irfft(whole, size))

    frequency = np.arange(bins.start, bins.stop) * track.rate / count
    factors = [factor_of(recording.channels[name], frequency) for name in track.names[:2]]
    force, motion = scipy.fft.rfft(signals, axis=1)[:, bins] * factors
    velocity = motion * np.interp(frequency, lines.phasors.frequency, moved)
    u, w = over_time(velocity / (2j * np.pi * frequency)), over_time(velocity)
    deviations = float(u.std()), float(w.std())
    functions = _functions(u / deviations[0], w / deviations[1])
    rows = np.stack([over_time(force), w, *(values for values, _, _ in functions)])
    frequency, inside = bins_of(length, rate, band)
    starts = starts_of(np.ones(size, dtype=bool), length)
    spectra = lines_of(rows, starts, hann(length).astype(np.float32), inside).transpose(2, 0, 1)
    matrix = spectra @ spectra.conj().transpose(0, 2, 1)
    # What is left of F1 and of the functions without what is linear in the deflection.
    whole, moving = np.maximum(np.einsum("lii->il", matrix).real[:2], 1e-30)
    response = matrix[:, :, 1] / moving[:, None]
    turn = np.interp(frequency, lines.phasors.frequency, moved)[:, None]
    left = matrix - response[:, :, None] * matrix[:, 1, None, :]
    noise = np.maximum(left[:, 0, 0].real, _ROUND_OFF * whole)
    weight = (len(starts) - 1.0) / noise
    powers = (np.abs(turn) ** 2)[:, :, None] * left[:, 2:, 2:].real
    products = weight @ (turn * left[:, 2:, 0]).real
    # The products if all that is incoherent is noise of V1.
    by_u, by_w = np.array([slopes for _, *slopes in functions]).T
    slopes = by_u / (2j * np.pi * frequency[:, None] * deviations[0]) + by_w / deviations[1]
    uneven = turn * (slopes - response[:, 2:])
    shared = -(weight * noise * moving / whole) @ (uneven.conj() * response[:, :1]).real
    coefficients, statistic = _fitted(np.tensordot(weight, powers, 1), products, shared)
    if statistic <= stats.chi2.isf(SEARCH_CHANCE, len(functions)):
        return 0.0
    explained = coefficients @ powers.sum(axis=0) @ coefficients / whole.sum()
    return float(np.sqrt(explained * (1.0 - len(functions) / statistic)))


def _functions(u: FloatArray, w: FloatArray) -> list[_Function]:
    """The functions of deflection and velocity over their standard deviations, with their mean slopes by each."""
    sign, size = np.tanh(_STEEP * w), np.abs(w)
    return [
        (u * u, 2 * u.mean(), 0.0),
        (u**3, 3 * np.mean(u * u), 0.0),
        (w * w, 0.0, 2 * w.mean()),
        (w * size, 0.0, 2 * size.mean()),
        (u * size, size.mean(), np.mean(u * np.sign(w))),
        (u * u * w, 2 * np.mean(u * w), np.mean(u * u)),
        (u * w * w, np.mean(w * w), 2 * np.mean(u * w)),
        (sign, 0.0, _STEEP * np.mean(1 - sign * sign)),
    ]


def _fitted(normal: FloatArray, products: FloatArray, shared: FloatArray) -> tuple[FloatArray, float]:
    """Coefficients (J,) of the functions and their chi-square, without what noise of V1 can explain.

    Parameters
    ----------
    normal, products, shared : (J, J), (J,) and (J,) float arrays
        Products of the functions with each other and with the error, and the most that noise of V1 adds to these.
    """
    scale = 1.0 / np.sqrt(np.maximum(np.diag(normal), 1e-300))
    values, vectors = np.linalg.eigh(normal * scale[:, None] * scale)
    kept = values > _ALIKE
    turn = scale[:, None] * vectors[:, kept] / np.sqrt(values[kept])
    left, by_noise = turn.T @ products, turn.T @ shared
    left = left - by_noise * np.clip(left @ by_noise / max(by_noise @ by_noise, 1e-300), 0.0, 1.0)
    return turn @ left, float(2.0 / _OVERLAP * left @ left)


def _part(track: Track, most: float, period: float) -> FloatArray:
    """F1 and V1 (2, N) of the longest part without a missing sample, at most some length [s].

    What repeats is no further evidence: of a motion with a period [s] it is one, the mean of all of them if it has a
    whole number of samples.
    """
    first, last = longest(track.present)
    signals, size = track.signals[:2, first:last], period * track.rate
    if np.isfinite(size) and abs(size - round(size)) < _WHOLE:
        times = max(1, signals.shape[1] // round(size))
        signals = signals[:, : times * round(size)].reshape(2, times, -1).mean(axis=1)
    count = min(signals.shape[1], int(np.fmin(most, period) * track.rate + _WHOLE))
    count -= count % 128  # other lengths are slow to transform
    first = (signals.shape[1] - count) // 2
    return signals[:, first : first + count]
