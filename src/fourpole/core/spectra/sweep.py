"""A sweep, fast, slow or stepped: amplitudes at many frequencies from the spectra of the whole record.

The transients are part of the fit.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy

from fourpole.core.arrays import ComplexArray, FloatArray
from fourpole.core.demodulation.tracks import Track
from fourpole.core.phasor import circular_covariance
from fourpole.core.recording import DRIVE, Recording
from fourpole.core.spectra.average import CrossSpectra, Ratios
from fourpole.core.spectra.averaged import periodic_amplitudes
from fourpole.core.spectra.excited import Excited, deflection_in, excited, is_whole, prepared, to_true
from fourpole.core.spectra.motion import period_of
from fourpole.errors import RecordingError, TooShortError

#: Powers of the frequency by which a ratio, and the transient, change over a band.
_POWERS = 3
#: Fewest bands of which one has two neighbours to either side.
_NEIGHBOURS = 5
#: Fewest bins of a band: the fit of a ratio has six parameters.
_BINS = 21
#: Width of a band over its frequency, where that is more bins.
_WIDTH = 0.01
#: Each ratio as its channels Y and X and its instrument: F1/V1 and V2/V1.
_WHOLE, _WITHOUT_V2 = ((0, 1, 2), (2, 1, 0)), ((0, 1, 1),)
#: Bins that are corrected at a time: their matrices need memory.
_AT_A_TIME = 100_000
#: Misfit of the closure phases above which the periods of a motion are not alike.
_MISSES = 4.0
#: Largest width of the lowest band over its frequency.
_WIDEST = 0.25
#: Fewest cycles of the lowest frequency in a recording.
SHORTEST = _BINS / _WIDEST


def sweep_amplitudes(recording: Recording, band: tuple[float, float]) -> Excited:
    r"""Complex amplitudes of F1, V1, V2 at the lines of a band, from the spectra of a whole record.

    Each ratio is a polynomial of the frequency in a band of bins, beside a polynomial for the transient: see
    `_local_ratios`. No steady state is needed, so that neither the rate of the sweep nor the
    settling of the rig makes an error; a fast sweep has fewer, wider bands for its record is shorter. V2 is the
    instrument for F1/V1, F1 for V2/V1; a recorded drive is the instrument for both.

    Parameters
    ----------
    recording : Recording
        Channels with the same sampling times, none missing. The sweep may be stepped.
    band : (float, float) [Hz]
        Lowest and highest frequency.

    Raises
    ------
    RecordingError
        If the channels differ in their sampling times, a sample is missing, or a channel is constant.
    TooShortError
        If the lowest band, of 21 bins, would be wider than a quarter of its frequency.
    """
    track, inside = prepared(recording, band)
    if not track.present.all():
        raise RecordingError(
            f"{recording.label}: {np.mean(~track.present):.2%} of the samples are missing, a sweep needs all of them: "
            "cut with window [s], or fill them in"
        )
    period = period_of(track, inside)
    if period is not None and (repeated := repeated_amplitudes(recording, track, inside, period)) is not None:
        return replace(repeated, period=period)
    length = track.time.size / track.rate
    if not fits_whole(track, inside):
        raise TooShortError(
            f"{recording.label} is {length:.4g} s long, which is too short for a sweep from {inside[0]:.4g} Hz on: "
            f"record {max(_BINS / (_WIDEST * inside[0]), _BINS / (inside[1] - inside[0])):.3g} s or more"
        )
    return whole_amplitudes(recording, track, inside)


def repeated_amplitudes(
    recording: Recording, track: Track, band: tuple[float, float], period: float, segment: float = 0.0
) -> Excited | None:
    """The amplitudes of a motion that repeats; None if it has too few periods, or a few sines.

    Where the closure phase shows that the first periods are not alike, as of a rig that is still settling, they are
    those of the whole record, if these close better.
    """
    periodic = periodic_amplitudes(recording, track, band, period, segment)
    if periodic is None or periodic.driven or not periodic.misfit > _MISSES or not fits_whole(track, band):
        return periodic
    other = whole_amplitudes(recording, track, band)
    return other if other.misfit < periodic.misfit else periodic


def whole_amplitudes(recording: Recording, track: Track, band: tuple[float, float]) -> Excited:
    """The amplitudes from the spectra of the whole record, whatever the excitation is."""
    frequency = scipy.fft.rfftfreq(track.time.size, 1.0 / track.rate)
    kept = (frequency >= band[0]) & (frequency <= band[1])
    length = track.time.size / track.rate
    lines = scipy.fft.rfft(track.signals, axis=1)[:, kept]
    for first in range(0, lines.shape[1], _AT_A_TIME):
        some = slice(first, first + _AT_A_TIME)
        lines[:, some] = np.einsum("lab,bl->al", to_true(recording, track.names, frequency[kept][some]), lines[:, some])
    whole, driven = is_whole(track.names), DRIVE in track.names
    wanted: tuple[tuple[int, int, int], ...] = _WHOLE if whole else _WITHOUT_V2
    if driven:
        place = track.names.index(DRIVE)
        wanted = ((0, 1, place), (2, 1, place))[: 1 + whole]
    products, estimate, noise = _local_ratios(lines, frequency[kept], wanted)
    density = 2.0 / (track.rate * track.time.size)
    spectra = replace(products, matrix=density * products.matrix)
    closure = _closure(estimate.values, noise, spectra.averages) if whole else None
    far = lines[track.names.index("motion_out")] if "motion_out" in track.names else 0.0
    power = np.abs(lines[1] - far) ** 2
    deflection = deflection_in(frequency[kept], density * power, 1.0 / length)
    return excited(
        recording, track.names, spectra, estimate, closure=closure, bias=2.0, deflection=deflection, length=length
    )


def fits_whole(track: Track, band: tuple[float, float]) -> bool:
    """Whether the spectra of the whole record resolve the band, and no sample is missing."""
    length = track.time.size / track.rate
    return bool(track.present.all()) and _BINS / length <= min(_WIDEST * band[0], band[1] - band[0])


def _closure(values: ComplexArray, noise: ComplexArray, averages: FloatArray) -> FloatArray:
    r"""Closure phase (L, 2) and its standard uncertainty [rad].

    The residuals are :math:`e_1 = N_F - (F_1/V_1) N_1` and :math:`e_2 = N_2 - (V_2/V_1) N_1`. If the noises N are
    independent, :math:`E[e_1 e_2^*]` has the phase of :math:`(F_1/V_1)(V_2/V_1)^*`. What it has across that, over
    :math:`|F_1||V_2|`, is the closure phase of the averaged spectra; the variance of n averages is the determinant of
    the covariance of both residuals over 2n.
    """
    along = np.exp(-1j * (np.angle(values[:, 0]) - np.angle(values[:, 1])))
    across = (noise[:, 0, 1] * along).imag
    determinant = np.maximum(np.linalg.det(noise).real, 0.0)
    return np.stack([across, np.sqrt(determinant / (2.0 * averages))], axis=1)


def _local_ratios(
    lines: ComplexArray, frequency: FloatArray, wanted: tuple[tuple[int, int, int], ...]
) -> tuple[CrossSpectra, Ratios, ComplexArray]:
    r"""Ratios of the spectra of a whole record, each with an instrument, by local polynomials.

    In a band around :math:`f_0`, with :math:`\delta = f - f_0`,

    .. math:: Y(f) = (g_0 + g_1\delta + g_2\delta^2)\,X(f) + t_0 + t_1\delta + t_2\delta^2 + e(f)

    g is the ratio and t the transient: what the ends of the record leave, in a resonance too. The six parameters follow
    from the products with the instrument Z, :math:`(Z, Z\delta, Z\delta^2, 1, \delta, \delta^2)`, whose noise is in
    neither X nor Y: noise of X leaves no bias. The covariance is that of the residuals e, and of what ratio and
    transient have of third and fourth order in a band, from the neighbouring bands.

    Parameters
    ----------
    lines : (C, B) complex array
        Spectra of the channels at all bins.
    frequency : (B,) float array [Hz]
        Frequencies of the bins, evenly spaced.
    wanted : tuple of (int, int, int)
        Each ratio as the channels Y, X and Z.

    Returns
    -------
    CrossSpectra
        Mean products of the spectra in each band, at its middle; averages are the bins less the parameters.
    Ratios
    (L, R, R) complex array
        Covariance of the residuals of the ratios, each over the root mean square of its channel Y.

    References
    ----------
    R. Pintelon and J. Schoukens, "System Identification: A Frequency Domain Approach", 2nd ed., 2012, ch. 7 (the local
    polynomial method); T. Soderstrom and P. Stoica, "System Identification", 1989, ch. 8 (instruments).
    """
    bands, step = _bands(frequency), float(frequency[1] - frequency[0])
    sizes = np.array([band.stop - band.start for band in bands])
    fits = [_of_band(lines[:, band], band.stop - band.start, wanted) for band in bands]
    values, covariance, noise, matrix, of_ratio, transient, of_transient = map(np.stack, zip(*fits, strict=True))
    bend = np.hypot(_remainder(values, of_ratio) / np.abs(values), _remainder(transient, of_transient))
    for place in range(2 * bend.shape[1]):
        covariance[:, place, place] += 0.5 * bend[:, place // 2] ** 2
    middles = np.array([0.5 * (frequency[band.start] + frequency[band.stop - 1]) for band in bands])
    return CrossSpectra(middles, matrix, sizes - 2.0 * _POWERS, sizes * step), Ratios(values, covariance), noise


def _remainder(values: ComplexArray, weights: ComplexArray) -> FloatArray:
    r"""Size (L, R) of the error of a ratio by its third and fourth order in a band, from the values of its neighbours.

    With half of a band as the unit of :math:`\delta`, the coefficients are a 96th of
    :math:`g_{+2} - 2g_{+1} + 2g_{-1} - g_{-2}` and a 384th of :math:`g_{+2} - 4g_{+1} + 6g - 4g_{-1} + g_{-2}`.

    Parameters
    ----------
    values : (L, R) complex array
        Values at the middles of neighbouring bands.
    weights : (L, R, 2) complex array
        Error of the ratio by :math:`\delta^3` and :math:`\delta^4`.
    """
    if len(values) < _NEIGHBOURS:
        return np.zeros(values.shape)
    third = (values[4:] - 2.0 * values[3:-1] + 2.0 * values[1:-3] - values[:-4]) / 96.0
    fourth = (values[4:] - 4.0 * values[3:-1] + 6.0 * values[2:-2] - 4.0 * values[1:-3] + values[:-4]) / 384.0
    ends = ((2, 2), (0, 0))
    third, fourth = np.pad(third, ends, "edge"), np.pad(fourth, ends, "edge")
    return np.asarray(np.hypot(np.abs(third * weights[:, :, 0]), np.abs(fourth * weights[:, :, 1])))


def _bands(frequency: FloatArray) -> list[slice]:
    """The bins of each band."""
    bands, step, first = [], float(frequency[1] - frequency[0]), 0
    while first + _BINS <= frequency.size:
        count = max(_BINS, int(_WIDTH * frequency[first] / step) | 1)
        bands.append(slice(first, min(first + count, frequency.size)))
        first += count
    return bands


def _of_band(lines: ComplexArray, count: int, wanted: tuple[tuple[int, int, int], ...]) -> tuple[np.ndarray, ...]:
    """The fit of a band of bins.

    Returns
    -------
    (R,), (2R, 2R), (R, R), (C, C)
        Ratios, covariance of their logarithms, covariance of the residuals, and mean products of the spectra.
    (R, 2), (R,), (R, 2)
        Error of the logarithms by third and fourth order in the ratio; transients, and the same for them.
    """
    delta = np.linspace(-1.0, 1.0, count)
    powers = delta ** np.arange(_POWERS)[:, None]
    further = delta ** np.array([[_POWERS], [_POWERS + 1]])
    size = np.sqrt(np.mean(np.abs(lines) ** 2, axis=1))
    scaled = lines / np.maximum(size, 1e-300)[:, None]
    values, weights, left, of_ratio, transient = [], [], [], [], []
    for y, x, z in wanted:
        regressors = np.concatenate([scaled[x] * powers, powers])
        instruments = np.concatenate([scaled[z] * powers, powers])
        inverse = np.linalg.pinv(instruments.conj() @ regressors.T)
        solution = inverse @ (instruments.conj() @ scaled[y])
        values.append(solution[0] * size[y] / size[x])
        weights.append(inverse[0] @ instruments.conj() / solution[0])
        left.append(scaled[y] - solution @ regressors)
        of_ratio.append((further * scaled[x]) @ weights[-1] * solution[0])
        transient.append(solution[_POWERS] * size[y])
    shape = np.stack(weights)
    noise = np.stack(left) @ np.stack(left).conj().T / (count - 2 * _POWERS)
    covariance = circular_covariance((shape @ shape.conj().T) * noise)
    by_size = size[[y for y, _, _ in wanted]]
    return (
        np.array(values),
        covariance,
        noise,
        lines @ lines.conj().T / count,
        np.array(of_ratio),
        np.array(transient),
        shape @ further.T / np.maximum(by_size, 1e-300)[:, None],
    )
