"""Previews: a few cycles of signal and fit, and the extremes of the residual, small enough to keep for every test."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fourpole.core.arrays import ByValue, FloatArray, IntArray
from fourpole.core.demodulation.sinefit import SineFit
from fourpole.core.demodulation.tracks import Track

_CYCLES = 3.0
#: Most samples of an excerpt, and most blocks of the residual.
POINTS = 96
BLOCKS = 60


@dataclass(frozen=True, eq=False)
class Preview(ByValue):
    """Excerpts of a demodulated recording for a figure.

    Attributes
    ----------
    time : (n,) float [s]
        Times of about three cycles around the middle of the record.
    signals, fit : (channels, n) float
        Samples minus their mean, and the whole fit, in the channels' SI units.
    blocks : (2 m,) float [s]
        Middle of each of m equal blocks of the whole record; each value stands twice.
    residual : (channels, 2 m) float
        Least and largest residual of each block in turn.
    """

    time: FloatArray
    signals: FloatArray
    fit: FloatArray
    blocks: FloatArray
    residual: FloatArray


def preview(fits: Sequence[SineFit], order: Sequence[int]) -> Preview:
    """The preview of the fits of all tracks, its channels in the order of the given indices."""
    first = fits[0]
    count = first.track.time.size
    step = float(first.track.time[1] - first.track.time[0])
    half = min(count // 2, max(8, round(0.5 * _CYCLES * 2 * np.pi / first.omega / step)))
    window = np.arange(count // 2 - half, count // 2 + half)
    shown = first.track.time[window[:: max(1, int(np.ceil(window.size / POINTS)))]]
    blocks = min(BLOCKS, *(fit.track.time.size for fit in fits))
    signals = np.stack([np.interp(shown, fit.track.time, row) for fit in fits for row in fit.track.signals])
    left = np.stack([np.interp(shown, fit.track.time, row) for fit in fits for row in fit.residual])
    return Preview(
        time=shown,
        signals=signals[list(order)],
        fit=(signals - left)[list(order)],
        blocks=np.repeat(_middles(first.track.time, blocks), 2),
        residual=np.concatenate([_extremes(fit.residual, blocks) for fit in fits])[list(order)],
    )


def raw_preview(track: Track, channels: int) -> Preview:
    """The preview of a recording without a fit: samples from its middle, and the extremes over the whole record.

    The signals are those of the first channels of the track. `fit` is empty, and `residual` holds the extremes.
    """
    count = track.time.size
    first = max(0, (count - POINTS) // 2)
    part = slice(first, first + POINTS)
    signals = track.signals[:channels]
    blocks = min(BLOCKS, count)
    return Preview(
        time=track.time[part],
        signals=signals[:, part],
        fit=np.zeros((channels, 0)),
        blocks=np.repeat(_middles(track.time, blocks), 2),
        residual=_extremes(signals, blocks),
    )


def _extremes(values: FloatArray, blocks: int) -> FloatArray:
    """Least and largest value of each block in turn, (channels, 2 blocks)."""
    starts = _starts(values.shape[1], blocks)
    pairs = np.minimum.reduceat(values, starts, axis=1), np.maximum.reduceat(values, starts, axis=1)
    return np.stack(pairs, axis=2).reshape(len(values), -1)


def _middles(time: FloatArray, blocks: int) -> FloatArray:
    """Middle of each block of a uniform time [s]."""
    starts = _starts(time.size, blocks)
    return np.asarray(0.5 * (time[starts] + time[np.append(starts[1:], time.size) - 1]))


def _starts(count: int, blocks: int) -> IntArray:
    """First index of each of nearly equal blocks of `count` samples."""
    return np.asarray(np.arange(blocks) * (count // blocks) + np.minimum(np.arange(blocks), count % blocks))
