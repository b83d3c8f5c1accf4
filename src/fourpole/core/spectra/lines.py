"""Lines of averaged spectra that are independent of each other."""

from __future__ import annotations

import numpy as np

from fourpole.core.arrays import FloatArray
from fourpole.core.spectra.average import CrossSpectra, independent

#: Bins from one line to the next: with Hann windows the correlation of next but one bins is 0.04.
_APART = 2
#: Largest width of a band over its frequency. In the middle of a resonance of quality 10 the mean over such a band is
#: 3e-4 below the value at its centre.
_WIDEST = 0.01


def thinned(spectra: CrossSpectra, segments: float) -> CrossSpectra:
    """Lines that are independent: every other bin, or bands of bins where these are narrow for their frequency.

    Bands of more than three bins touch each other; the correlation of neighbours is then below 0.1. A band stands at
    the mean of its frequencies, weighted by the power of V1.

    Parameters
    ----------
    spectra : CrossSpectra
        A line for each bin.
    segments : float [1]
        Number of segments, for the number of independent averages in a band.
    """
    power = np.maximum(spectra.matrix[:, 1, 1].real, 1e-300)
    edges = _edges(spectra.frequency, float(spectra.width[0]))
    starts, counts = edges[:-1], np.diff(edges)
    kept = np.where(counts <= _APART + 1, 1, counts)
    frequency, matrix = np.empty(starts.size), np.empty((starts.size, *spectra.matrix.shape[1:]), dtype=complex)
    for at, (start, count) in enumerate(zip(starts.tolist(), kept.tolist(), strict=True)):
        part = slice(start, start + count)
        frequency[at] = np.average(spectra.frequency[part], weights=power[part])
        matrix[at] = spectra.matrix[part].mean(axis=0)
    averages = {count: independent(segments, count) for count in set(kept.tolist())}
    return CrossSpectra(
        frequency,
        matrix,
        np.array([averages[count] for count in kept.tolist()]),
        kept * spectra.width[starts],
    )


def _edges(frequency: FloatArray, bin_width: float) -> np.ndarray:
    """First bin of each line (L + 1,)."""
    edges, size = [0], frequency.size
    while edges[-1] < size:
        count = int(_WIDEST * frequency[edges[-1]] / bin_width)
        edges.append(edges[-1] + (count if count > _APART + 1 else _APART))
    edges[-1] = min(edges[-1], size)
    return np.array(edges)
