"""A sweep, fast, slow or stepped: amplitudes at many frequencies from the spectra of the whole record."""

from __future__ import annotations

import numpy as np
from scipy import fft

from fourpole.core.arrays import ComplexArray, FloatArray
from fourpole.core.demodulation.tracks import Track
from fourpole.core.recording import DRIVE, Recording
from fourpole.core.spectra.average import CrossSpectra
from fourpole.core.spectra.averaged import periodic_amplitudes
from fourpole.core.spectra.excited import Excited, Found, deflection_in, excited, prepared, to_true
from fourpole.core.spectra.local import BINS, LocalRatios, local_ratios
from fourpole.core.spectra.motion import period_of
from fourpole.core.spectra.ratios import Ratios, with_bias
from fourpole.errors import RecordingError, TooShortError

#: Each ratio as its channels Y and X and its instrument: F1/V1 and V2/V1.
_WHOLE, _WITHOUT_V2 = ((0, 1, 2), (2, 1, 0)), ((0, 1, 1),)
#: Bins that are corrected at a time: their matrices need memory.
_AT_A_TIME = 100_000
#: Misfit of the closure phases above which the periods of a motion are not alike.
_MISSES = 4.0
#: Largest width of the lowest band over its frequency.
_WIDEST = 0.25
#: Fewest cycles of the lowest frequency in a recording.
SHORTEST = BINS / _WIDEST


def sweep_amplitudes(recording: Recording, band: tuple[float, float]) -> Excited:
    r"""Complex amplitudes of F1, V1, V2 at the lines of a band, from the spectra of a whole record.

    Each ratio is a polynomial of the frequency in a band of bins, beside a polynomial for the transient: see
    `fourpole.core.spectra.local.local_ratios`. No steady state is needed, so that neither the rate of the sweep nor the
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
    found = None if period is None else repeated_amplitudes(recording, track, inside, period)
    if found is not None:
        return found
    length = track.time.size / track.rate
    if not fits_whole(track, inside):
        raise TooShortError(
            f"{recording.label} is {length:.4g} s long, which is too short for a sweep from {inside[0]:.4g} Hz on: "
            f"record {max(BINS / (_WIDEST * inside[0]), BINS / (inside[1] - inside[0])):.3g} s or more"
        )
    return whole_amplitudes(recording, track, inside)


def repeated_amplitudes(
    recording: Recording, track: Track, band: tuple[float, float], period: float, segment: float = 0.0
) -> Excited | None:
    """The amplitudes of a motion that repeats; None if it has too few periods, or a few sines.

    Where the closure phase shows that the first periods are not alike, as of a rig that is still settling, they are
    those of the whole record, if these close better.
    """
    found = periodic_amplitudes(recording, track, band, period, segment)
    if found is None or found.driven or not found.misfit > _MISSES or not fits_whole(track, band):
        return found
    other = whole_amplitudes(recording, track, band)
    return other if other.misfit < found.misfit else found


def whole_amplitudes(recording: Recording, track: Track, band: tuple[float, float]) -> Excited:
    """The amplitudes from the spectra of the whole record, whatever the excitation is."""
    frequency = fft.rfftfreq(track.time.size, 1.0 / track.rate)
    kept = (frequency >= band[0]) & (frequency <= band[1])
    length = track.time.size / track.rate
    lines = fft.rfft(track.signals, axis=1)[:, kept]
    for at in range(0, lines.shape[1], _AT_A_TIME):
        some = slice(at, at + _AT_A_TIME)
        lines[:, some] = np.einsum("lab,bl->al", to_true(recording, track.names, frequency[kept][some]), lines[:, some])
    whole, driven = "motion_out" in track.names, DRIVE in track.names
    wanted: tuple[tuple[int, int, int], ...] = _WHOLE if whole else _WITHOUT_V2
    if driven:
        place = track.names.index(DRIVE)
        wanted = ((0, 1, place), (2, 1, place))[: 1 + whole]
    local = local_ratios(lines, frequency[kept], wanted)
    density = 2.0 / (track.rate * track.time.size)
    closure = _closure(local) if whole else np.full((local.frequency.size, 2), np.nan)
    spectra = CrossSpectra(local.frequency, density * local.matrix, local.averages, local.width)
    held = Ratios(local.values, local.covariance)
    found = Found(
        held if whole or driven else with_bias(held, spectra.coherence(0, 1), 2.0),
        closure,
        deflection_in(frequency[kept], density * _power_of_deflection(lines, whole=whole), 1.0 / length),
        length,
    )
    return excited(recording, track.names, spectra, found)


def fits_whole(track: Track, band: tuple[float, float]) -> bool:
    """Whether the spectra of the whole record resolve the band, and no sample is missing."""
    length = track.time.size / track.rate
    return bool(track.present.all()) and BINS / length <= min(_WIDEST * band[0], band[1] - band[0])


def _power_of_deflection(lines: ComplexArray, *, whole: bool) -> FloatArray:
    """Squared modulus (L,) of V1 - V2, or of V1 where V2 is not recorded."""
    return np.abs(lines[1] - lines[2] if whole else lines[1]) ** 2


def _closure(local: LocalRatios) -> FloatArray:
    r"""Closure phase (L, 2) and its standard uncertainty [rad].

    The residuals are :math:`e_1 = N_F - (F_1/V_1) N_1` and :math:`e_2 = N_2 - (V_2/V_1) N_1`. If the noises N are
    independent, :math:`E[e_1 e_2^*]` has the phase of :math:`(F_1/V_1)(V_2/V_1)^*`. What it has across that, over
    :math:`|F_1||V_2|`, is the closure phase of the averaged spectra; the variance of n averages is the determinant of
    the covariance of both residuals over 2n.
    """
    along = np.exp(-1j * (np.angle(local.values[:, 0]) - np.angle(local.values[:, 1])))
    across = (local.noise[:, 0, 1] * along).imag
    determinant = np.maximum(np.linalg.det(local.noise).real, 0.0)
    return np.stack([across, np.sqrt(determinant / (2.0 * local.averages))], axis=1)
