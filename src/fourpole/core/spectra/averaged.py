"""Amplitudes from averaged cross spectra: of segments of any excitation, or of whole periods of a periodic one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fourpole.core.arrays import ComplexArray
from fourpole.core.demodulation.tracks import Track
from fourpole.core.recording import DRIVE, Recording
from fourpole.core.spectra.average import CrossSpectra, cross_spectra
from fourpole.core.spectra.excited import Excited, Found, deflection_in, excited, power_of_deflection, to_true
from fourpole.core.spectra.lines import at_periods, thinned
from fourpole.core.spectra.motion import Fine, fine_spectrum
from fourpole.core.spectra.ratios import CLOSURE, OF_V1, OF_V2, ratios, with_bend, with_bias, with_instrument
from fourpole.core.spectra.shared import correlations_of

#: Places of F1, V1 and V2 in a matrix of all channels.
_F, _ONE, _TWO = 0, 1, 2
#: Fewest segments of a periodic motion, and further lengths of a segment that are tried for whole samples.
_FEWEST, _TRIED = 9.0, 8
#: Round-off of a number of segments.
_ROUND_OFF = 1e-3
#: Power of a multiple of 1/period over the largest from which on it is excited, and the least share of these multiples.
_EXCITED, _MANY = 1e-6, 0.5


def periodic_amplitudes(
    recording: Recording, track: Track, band: tuple[float, float], period: float, segment: float
) -> Excited | None:
    """The amplitudes at the multiples of 1/period [Hz]; None if there are fewer than ten periods, or only a few sines.

    A segment has an even number of periods, so that no line leaks into another, and some length [s] or more if the
    record has enough of them.
    """
    count = _periods(track, period, segment)
    if not count:
        return None
    held = cross_spectra(track, round(count * period * track.rate) / track.rate, band)
    segments = 2.0 * track.time.size / (track.rate * count * period) - 1.0
    power = at_periods(held, period, segments, bands=False).matrix[:, 1, 1].real
    if np.mean(power > _EXCITED * power.max()) < _MANY:
        return None
    every = _turned(recording, track, held)
    return _found(recording, track, every, at_periods(every, period, segments), count * period)


def segment_amplitudes(
    recording: Recording, track: Track, band: tuple[float, float], segment: float, fine: Fine | None = None
) -> Excited:
    """The amplitudes with segments of a length [s]."""
    segment = round(segment * track.rate) / track.rate
    every = _turned(recording, track, cross_spectra(track, segment, band))
    count = 2.0 * track.time.size / (segment * track.rate) - 1.0
    spectra = thinned(every, count, fine_spectrum(track) if fine is None else fine)
    return _found(recording, track, every, spectra, segment)


def _turned(recording: Recording, track: Track, recorded: CrossSpectra) -> CrossSpectra:
    """Cross spectra of force and velocities from those of the recorded channels."""
    turned = to_true(recording, track.names, recorded.frequency)
    return replace(recorded, matrix=turned @ recorded.matrix @ turned.conj().transpose(0, 2, 1))


def _found(recording: Recording, track: Track, every: CrossSpectra, spectra: CrossSpectra, segment: float) -> Excited:
    """The amplitudes from the spectra of all bins and those of independent lines."""
    closure = np.full((spectra.frequency.size, 2), np.nan)
    whole, driven = "motion_out" in track.names, DRIVE in track.names
    if whole:
        around = ratios(spectra.matrix, spectra.averages, CLOSURE)
        std = np.sqrt(np.maximum(around.covariance[:, 1, 1], 0.0))
        closure = np.stack([np.angle(around.values[:, 0]), std], axis=1)
    moved = deflection_in(
        every.frequency, power_of_deflection(_motions(every.matrix, whole=whole)), float(every.width[0])
    )
    terms, instruments = (OF_V2, [_TWO, _F]) if whole else (OF_V1, [_ONE])
    if driven:
        place = track.names.index(DRIVE)
        terms, instruments = with_instrument(place)[: 1 + whole], [place] * (1 + whole)
    held = with_bend(
        ratios(spectra.matrix, spectra.averages, terms), spectra.matrix[:, _ONE, instruments], spectra.broad
    )
    if not whole and not driven:
        held = with_bias(held, spectra.coherence(_F, _ONE), 1.0)
    shared = correlations_of(spectra.matrix, closure) if whole else None
    found = Found(held, closure, moved, segment, shared)
    return excited(recording, track.names, spectra, found)


def _motions(matrix: ComplexArray, *, whole: bool) -> ComplexArray:
    """The part of the matrices that F1, V1 and, if it is recorded, V2 have."""
    count = 2 + whole
    return matrix[:, :count, :count]


def _periods(track: Track, period: float, segment: float) -> int:
    """Even number of periods in a segment of some length or more, whose samples are whole; 0 if there are too few."""
    most = int(track.time.size / (track.rate * period) / (_FEWEST + 1.0) + _ROUND_OFF)
    least = max(1, round(0.5 * segment / period))
    counts = range(min(least, most), min(least + _TRIED, most) + 1)
    return 2 * min(counts, key=lambda count: round(_broken(2 * count * period * track.rate), 1), default=0)


def _broken(samples: float) -> float:
    """Distance of a number of samples from a whole number."""
    return abs(samples - round(samples))
