"""Lines of averaged spectra that are independent of each other."""

from __future__ import annotations

import numpy as np

from fourpole.core.arrays import FloatArray
from fourpole.core.spectra.average import CrossSpectra, independent, of_sine
from fourpole.core.spectra.motion import Fine
from fourpole.errors import RecordingError

#: Bins from one line to the next: with Hann windows the correlation of next but one bins is 0.04.
_APART = 2
#: A band has more bins than this.
_FEWEST = 3
#: Distance in bins from which on the power of a line belongs to another line.
_AWAY = 0.6
#: Largest width of a band over its frequency. In the middle of a resonance of quality 10 the mean over such a band is
#: 3e-4 below the value at its centre.
_WIDEST = 0.01


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
    kept = np.where(counts <= _FEWEST, 1, counts)
    frequency, matrix = np.empty(starts.size), np.empty((starts.size, *spectra.matrix.shape[1:]), dtype=complex)
    for at, (start, count) in enumerate(zip(starts.tolist(), kept.tolist(), strict=True)):
        part = slice(start, start + count)
        frequency[at] = np.average(spectra.frequency[part], weights=power[part])
        matrix[at] = spectra.matrix[part].mean(axis=0)
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


def at_periods(spectra: CrossSpectra, period: float, segments: float, *, bands: bool = True) -> CrossSpectra:
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
    at = np.clip(
        np.round((multiples / period - spectra.frequency[0]) / step).astype(int), 0, spectra.frequency.size - 1
    )
    frequency, matrix = multiples / period, spectra.matrix[at]
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
        edges.append(edges[-1] + (count if count > _FEWEST else apart))
    edges[-1] = min(edges[-1], size)
    return np.array(edges)
