"""Previews: a few cycles of signal and fit, and the residual's extremes, small enough to keep for every test."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fourpole.core.arrays import FloatArray
from fourpole.core.sinefit import SineFit

__all__ = ["Preview", "preview"]

_CYCLES = 3.0
_POINTS = 96
_BLOCKS = 60


@dataclass(frozen=True)
class Preview:
    """What a person wants to see of a demodulated recording.

    Attributes
    ----------
    time : (n,) float [s]
        About three cycles around the middle of the record.
    signals, fit : (channels, n) float
        Samples less their mean, and the whole fit, in the channels' SI units.
    blocks : (2 m,) float [s]
        Middle of each of m equal blocks of the whole record, twice each.
    residual : (channels, 2 m) float
        Least and largest residual of each block.
    """

    time: FloatArray
    signals: FloatArray
    fit: FloatArray
    blocks: FloatArray
    residual: FloatArray


def preview(fit: SineFit, signals: FloatArray) -> Preview:
    """Pick a preview out of a fit to (channels, N) signals."""
    count = fit.time.size
    step = float(fit.time[1] - fit.time[0])
    half = min(count // 2, max(8, round(0.5 * _CYCLES * 2 * np.pi / fit.omega / step)))
    window = np.arange(count // 2 - half, count // 2 + half)
    shown = window[:: max(1, int(np.ceil(window.size / _POINTS)))]
    blocks = np.array_split(np.arange(count), min(_BLOCKS, count))
    extremes = [(fit.residual[:, block].min(axis=1), fit.residual[:, block].max(axis=1)) for block in blocks]
    return Preview(
        time=fit.time[shown],
        signals=signals[:, shown],
        fit=(signals - fit.residual)[:, shown],
        blocks=np.repeat([fit.time[block].mean() for block in blocks], 2),
        residual=np.array(extremes).reshape(-1, signals.shape[0]).T,
    )
