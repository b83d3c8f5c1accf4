"""Rests of a stepped record: the stretches in which a load is held before the next step."""

from __future__ import annotations

import numpy as np
import scipy

from fourpole.core.arrays import BoolArray, FloatArray, IntArray

#: A record of at least so many samples is stepped if it makes this share of its way in at most this share of its
#: samples, with steps of so many times the median and of this share of the span, between rests at so many levels.
_FEWEST_STEPPED, _WAY, _MOVING, _QUICK, _STEP, _FEWEST_LEVELS, _HELD = 60, 0.5, 0.3, 4.0, 0.005, 4, 0.5
#: The way within the rests, from the first to the last sample of each, is at most this share of that between them.
_FLAT = 0.2
#: Levels differ by more than this share of the span. The rests of a level agree if their variance about it is below
#: this share of the whole variance.
_APART, _LOOSE = 0.05, 0.01
#: The steps are looked for in medians of blocks; this is the largest number of blocks.
_BLOCKS = 800


def rests(deflection: FloatArray, load: FloatArray | None = None) -> IntArray | None:
    """Number of the rest to which each sample of a stepped record belongs, -1 between rests; None for one that flows.

    Either deflection or load may be the quantity that is held.
    """
    for one in [deflection] if load is None else [deflection, load]:
        number = _rests_of(one)
        if number is not None:
            rank = ranks(number, deflection, load)
            if rank.max() >= _FEWEST_LEVELS - 1:
                return number
    return None


def means(number: IntArray, values: FloatArray) -> FloatArray:
    """Mean of the values over each rest."""
    held = number >= 0
    count = np.bincount(number[held])
    used = np.flatnonzero(count)
    return np.asarray(np.bincount(number[held], values[held])[used] / count[used])


def ranks(number: IntArray, deflection: FloatArray, load: FloatArray | None = None) -> IntArray:
    """Rank of the level of each rest, from 0 on, of the quantity that is held.

    That is the one with fewer levels, if the rests of each of its levels agree.
    """
    found = []
    for one in [deflection] if load is None else [deflection, load]:
        middle = means(number, one)
        rank = _levels(middle, float(np.ptp(one)))
        own = np.bincount(rank, middle) / np.bincount(rank)
        found.append((bool(np.var(middle - own[rank]) > _LOOSE * np.var(middle)), int(rank.max()), rank))
    return min(found, key=lambda one: one[:2])[2]


def passes_levels(rank: IntArray) -> bool:
    """Whether the steps pass the levels one by one; three in ten may leave out a level, none two of them."""
    steps = np.abs(np.diff(rank))
    steps = steps[steps > 0]
    return bool(np.all(steps <= 2) and np.mean(steps == 2) <= 0.3)


def _levels(values: FloatArray, span: float) -> IntArray:
    """Rank of the cluster to which each value belongs; clusters are apart by more than `_APART` of the span."""
    order = np.argsort(values)
    rank = np.empty(values.size, dtype=int)
    rank[order] = np.concatenate([[0], np.cumsum(np.diff(values[order]) > _APART * span)])
    return rank


def _rests_of(values: FloatArray) -> IntArray | None:
    """Number of the rest of each sample of one quantity, which makes most of its way in few samples; else None."""
    count, span = values.size, float(np.ptp(values))
    if count < _FEWEST_STEPPED or not span > 0.0:
        return None
    size = -(-count // _BLOCKS)
    blocks = -(-count // size)
    padded = np.append(values, np.full(blocks * size - count, values[-1]))
    middle = np.median(padded.reshape(blocks, size), axis=1)
    smooth = scipy.ndimage.median_filter(middle, size=max(5, blocks // 50 | 1), mode="nearest")
    steps = np.abs(np.diff(smooth, prepend=smooth[0]))
    moves = steps > max(_QUICK * float(np.median(steps)), _STEP * span)
    if steps[moves].sum() < _WAY * steps.sum() or moves.mean() > _MOVING:
        return None
    number = _numbered(moves)
    if np.mean(number >= 0) < _HELD or not _flat(number, smooth):
        return None
    return np.repeat(number, size)[:count]


def _flat(number: IntArray, values: FloatArray) -> bool:
    """Whether the way within the rests is small beside that between them."""
    held = np.flatnonzero(number >= 0)
    changes = np.flatnonzero(np.diff(number[held]))
    first, last = values[held[np.append(0, changes + 1)]], values[held[np.append(changes, held.size - 1)]]
    return bool(np.abs(last - first).sum() <= _FLAT * np.abs(first[1:] - last[:-1]).sum())


def _numbered(moves: BoolArray) -> IntArray:
    """Number of the rest of each block, -1 where it moves or where a rest is too short to count."""
    number = np.cumsum(np.diff(moves.astype(int), prepend=1) < 0) - 1
    number = np.where(moves, -1, number)
    lengths = np.bincount(number[number >= 0], minlength=1)
    long = lengths >= max(5, moves.size // 200)
    return np.where(long[number] & (number >= 0), number, -1)
