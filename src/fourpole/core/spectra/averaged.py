"""Amplitudes from averaged cross spectra: of segments of any excitation, or of whole periods of a periodic one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fourpole.core.arrays import FloatArray
from fourpole.core.demodulation.tracks import Track
from fourpole.core.recording import DRIVE, Recording
from fourpole.core.spectra.average import (
    CLOSURE,
    OF_V1,
    OF_V2,
    CrossSpectra,
    beyond_bounds,
    correlations_of,
    cross_spectra,
    independent,
    of_sine,
    ratios,
    with_bend,
    with_instrument,
    with_shared_noise,
)
from fourpole.core.spectra.excited import Excited, deflection_in, excited, is_whole, to_true
from fourpole.core.spectra.motion import Fine, fine_spectrum
from fourpole.errors import RecordingError

#: Places of F1, V1 and V2 in a matrix of all channels; without F1, V2 takes its place.
_F, _ONE, _TWO = 0, 1, 2
#: Fewest segments of a periodic motion, and further lengths of a segment that are tried for whole samples.
_FEWEST, _TRIED = 9.0, 8
#: Round-off of a number of segments.
_ROUND_OFF = 1e-3
#: Power of a multiple of 1/period over the largest from which on it is excited, and the least share of these multiples.
_EXCITED, _MANY = 1e-6, 0.5
#: Bins from one line to the next: with Hann windows the correlation of next but one bins is 0.04.
_APART = 2
#: A band has more bins than this.
_FEWEST_BINS = 3
#: Distance in bins from which on the power of a line belongs to another line.
_AWAY = 0.6
#: Largest width of a band over its frequency. In the middle of a resonance of quality 10 the mean over such a band is
#: 3e-4 below the value at its centre.
_WIDEST = 0.01


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
    recorded = cross_spectra(track, round(count * period * track.rate) / track.rate, band)
    segments = 2.0 * track.time.size / (track.rate * count * period) - 1.0
    power = _at_periods(recorded, period, segments, bands=False).matrix[:, 1, 1].real
    if np.mean(power > _EXCITED * power.max()) < _MANY:
        return None
    every = _turned(recording, track, recorded)
    return _amplitudes(recording, track, every, _at_periods(every, period, segments), count * period)


def segment_amplitudes(
    recording: Recording, track: Track, band: tuple[float, float], segment: float, fine: Fine | None = None
) -> Excited:
    """The amplitudes with segments of a length [s]."""
    segment = round(segment * track.rate) / track.rate
    every = _turned(recording, track, cross_spectra(track, segment, band))
    count = 2.0 * track.time.size / (segment * track.rate) - 1.0
    spectra = thinned(every, count, fine_spectrum(track) if fine is None else fine)
    return _amplitudes(recording, track, every, spectra, segment)


def _turned(recording: Recording, track: Track, recorded: CrossSpectra) -> CrossSpectra:
    """Cross spectra of force and velocities from those of the recorded channels."""
    turned = to_true(recording, track.names, recorded.frequency)
    return replace(recorded, matrix=turned @ recorded.matrix @ turned.conj().transpose(0, 2, 1))


def _amplitudes(
    recording: Recording, track: Track, every: CrossSpectra, spectra: CrossSpectra, segment: float
) -> Excited:
    """The amplitudes from the spectra of all bins and those of independent lines."""
    closure: FloatArray | None = None
    shared: FloatArray | None = None
    whole, driven = is_whole(track.names), DRIVE in track.names
    if whole:
        around = ratios(spectra.matrix, spectra.averages, CLOSURE)
        std = np.sqrt(np.maximum(around.covariance[:, 1, 1], 0.0))
        closure = np.stack([np.angle(around.values[:, 0]), std], axis=1)
        shared = correlations_of(spectra.matrix, closure)
    power = every.matrix[:, _ONE, _ONE].real.copy()
    if "motion_out" in track.names:
        far = track.names.index("motion_out")
        power += every.matrix[:, far, far].real - 2.0 * every.matrix[:, _ONE, far].real
    power = np.maximum(power, 0.0)  # rounding, where V1 and V2 are equal
    terms, instruments = (OF_V2, [_TWO, _F]) if whole else (OF_V1, [_ONE])
    if driven:
        place = track.names.index(DRIVE)
        terms, instruments = with_instrument(place)[: 1 + whole], [place] * (1 + whole)
    estimate = ratios(spectra.matrix, spectra.averages, terms)
    beyond = 0.0
    if whole and not driven:
        off, pull = beyond_bounds(spectra.matrix, spectra.averages)
        beyond = float(np.mean(pull**2, axis=0).max())
        estimate = with_shared_noise(estimate, off, pull)
    estimate = with_bend(estimate, spectra.matrix[:, _ONE, instruments], spectra.broad)
    found = excited(
        recording,
        track.names,
        spectra,
        estimate,
        closure=closure,
        bias=1.0,
        deflection=deflection_in(every.frequency, power, float(every.width[0])),
        length=segment,
        shared=shared,
    )
    return replace(found, beyond=beyond)


def _periods(track: Track, period: float, segment: float) -> int:
    """Even number of periods in a segment of some length or more, whose samples are whole; 0 if there are too few."""
    most = int(track.time.size / (track.rate * period) / (_FEWEST + 1.0) + _ROUND_OFF)
    least = max(1, round(0.5 * segment / period))
    counts = range(min(least, most), min(least + _TRIED, most) + 1)

    def broken(count: int) -> float:
        """Distance of the samples of a segment from a whole number, to a tenth."""
        samples = 2 * count * period * track.rate
        return round(abs(samples - round(samples)), 1)

    return 2 * min(counts, key=broken, default=0)


def thinned(spectra: CrossSpectra, segments: float, fine: Fine) -> CrossSpectra:
    """Lines that are independent: every other bin, or bands of bins where these are narrow for their frequency.

    Bands of more than three bins touch each other; the correlation of neighbours is then below 0.1. A band stands at
    the mean of its frequencies, weighted by the power of V1.

    Parameters
    ----------
    spectra : CrossSpectra
        A line for each bin.
    segments : float [1]
        Number of segments, for the number of independent averages in a band.
    fine : Fine
        Spectrum of the whole record: where it consists of lines, there are fewer independent averages.
    """
    power = np.maximum(spectra.matrix[:, 1, 1].real, 1e-300)
    edges = _edges(spectra.frequency, float(spectra.width[0]), _APART)
    starts, counts = edges[:-1], np.diff(edges)
    kept = np.where(counts <= _FEWEST_BINS, 1, counts)
    frequency, matrix = np.empty(starts.size), np.empty((starts.size, *spectra.matrix.shape[1:]), dtype=complex)
    for i, (start, count) in enumerate(zip(starts.tolist(), kept.tolist(), strict=True)):
        part = slice(start, start + count)
        frequency[i] = np.average(spectra.frequency[part], weights=power[part])
        matrix[i] = spectra.matrix[part].mean(axis=0)
    averages = {count: independent(segments, count) for count in set(kept.tolist())}
    step = float(spectra.width[0])
    ends = zip(spectra.frequency[starts].tolist(), spectra.frequency[starts + kept - 1].tolist(), strict=True)
    seen = np.array([fine.seen(first, last, step)[1:] for first, last in ends])
    foreign = np.abs(seen[:, 0] - frequency) > 0.5 * (kept - 1) * step + _AWAY * step
    return CrossSpectra(
        frequency,
        matrix,
        np.array([averages[count] for count in kept.tolist()]) * seen[:, 1],
        kept * spectra.width[starts],
        foreign,
    )


def _at_periods(spectra: CrossSpectra, period: float, segments: float, *, bands: bool = True) -> CrossSpectra:
    """Lines of a periodic motion, at multiples of 1/period [Hz], from bins of segments of an even number of periods.

    A line touches no other bin of the motion, so that all of them are independent. Lines that are narrow for their
    frequency are averaged in bands, if `bands`.
    """
    step = float(spectra.width[0])
    first, last = spectra.frequency[0] - 0.5 * step, spectra.frequency[-1] + 0.5 * step
    multiples = np.arange(max(1, int(np.ceil(first * period))), int(np.floor(last * period)) + 1)
    if multiples.size == 0:
        raise RecordingError(
            f"the motion repeats every {period:.4g} s, and no multiple of {1 / period:.4g} Hz is in the band: take a "
            "longer period"
        )
    bins = np.clip(
        np.round((multiples / period - spectra.frequency[0]) / step).astype(int), 0, spectra.frequency.size - 1
    )
    frequency, matrix = multiples / period, spectra.matrix[bins]
    edges = _edges(frequency, 1.0 / period, 1) if bands else np.arange(frequency.size + 1)
    starts, counts = edges[:-1], np.diff(edges)
    power = np.maximum(matrix[:, 1, 1].real, 1e-300)
    return CrossSpectra(
        np.add.reduceat(power * frequency, starts) / np.add.reduceat(power, starts),
        np.add.reduceat(matrix, starts, axis=0) / counts[:, None, None],
        counts * of_sine(segments),
        counts / period,
        broad=counts > 1,
    )


def _edges(frequency: FloatArray, bin_width: float, apart: int) -> np.ndarray:
    """First bin of each line (L + 1,), of lines some bins apart or of bands."""
    edges, size = [0], frequency.size
    while edges[-1] < size:
        count = int(_WIDEST * frequency[edges[-1]] / bin_width)
        edges.append(edges[-1] + (count if count > _FEWEST_BINS else apart))
    edges[-1] = min(edges[-1], size)
    return np.array(edges)
