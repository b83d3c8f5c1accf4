r"""Loading and unloading branches of a deflection record, the rests of a stepped one, and noise with memory.

At a rest a load is held. Noise with memory is white noise beside a part that fades exponentially along the record: each
residual is :math:`w_i + c_i` with white w and :math:`c_i = \rho\,c_{i-1} + \eta_i`; the share of c in the variance is
:math:`\lambda`. Whitening turns such residuals into independent ones of equal variance.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from fourpole.core.arrays import BoolArray, FloatArray, IntArray

#: Lengths over which the correlated part fades [rows], and its shares of the variance.
_LENGTHS = (1.5, 5.0, 15.0, 50.0, 300.0)
_SHARES = (0.05, 0.3, 0.8, 1.0)


@lru_cache(maxsize=1)
def memories() -> tuple[FloatArray, FloatArray, FloatArray]:
    """Decay per row, share of the correlated part and number of parameters of each memory; the first is white."""
    decay = [0.0, *(float(np.exp(-1.0 / length)) for length in _LENGTHS for _ in _SHARES)]
    share = [0.0, *_SHARES * len(_LENGTHS)]
    count = [0.0, *(1.0 if part == 1.0 else 2.0 for part in share[1:])]
    return np.array(decay), np.array(share), np.array(count)


def whitened(rows: FloatArray, starts: BoolArray, *, plain: bool = False) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Rows whitened for each memory, the sum of the logarithms of their variances, and the parameters of each memory.

    Parameters
    ----------
    rows : (M, K) float array
        Columns of a linear model along the record.
    starts : (M,) bool array
        Whether a row is the first of a stretch; stretches are independent of each other.
    plain : bool
        Whether only white noise is considered.

    Returns
    -------
    rows : (G, M, K) float array
    log_variance : (G,) float array
    count : (G,) float array
    """
    decay, _, count = memories()
    if plain:
        return rows[None], np.zeros(1), count[:1]
    place = np.arange(starts.size) - np.maximum.accumulate(np.where(starts, np.arange(starts.size), 0))
    variance, gain = (table[place] for table in _prediction(1 << (starts.size - 1).bit_length()))
    fade = np.where(np.append(starts[1:], True)[:, None], 0.0, decay)
    guess = np.zeros((starts.size + 1, decay.size, rows.shape[1]))
    np.multiply((fade * gain)[..., None], rows[:, None], out=guess[1:])
    for i, kept in enumerate((fade * (1.0 - gain))[..., None]):
        guess[i + 1] += kept * guess[i]
    out = rows[:, None] - guess[:-1]
    out /= np.sqrt(variance)[..., None]
    return np.swapaxes(out, 0, 1), np.log(variance).sum(axis=0), count


@lru_cache(maxsize=2)
def _prediction(count: int) -> tuple[FloatArray, FloatArray]:
    """Variance of a row, given the rows of its stretch before it, and gain of the next prediction (count, G)."""
    decay, share, _ = memories()
    variance, ahead = np.empty((2, count, decay.size))
    ahead[0] = share
    for i in range(count):
        variance[i] = ahead[i] + 1.0 - share
        ahead[i + 1 : i + 2] = decay**2 * ahead[i] * (1.0 - ahead[i] / variance[i]) + share * (1.0 - decay**2)
    return variance, ahead / variance


#: A record of at least so many samples is stepped if it makes this share of its way in at most this share of its
#: samples, with steps of so many times the median and of this share of the span, between rests at so many levels.
_FEWEST_STEPPED, _WAY, _MOVING, _QUICK, _STEP, _FEWEST_LEVELS, _HELD = 60, 0.5, 0.3, 4.0, 0.005, 4, 0.5
#: The way within the rests, from the first to the last sample of each, is at most this share of that between them.
_CREPT = 0.2
#: Levels differ by more than this share of the span. The rests of a level agree if their variance about it is below
#: this share of the whole variance.
_APART, _LOOSE = 0.05, 0.01
#: The steps are looked for in medians of blocks; this is the largest number of blocks.
_BLOCKS = 800


def rests(deflection: FloatArray, load: FloatArray | None = None) -> IntArray | None:
    """Number of the rest to which each sample of a stepped record belongs, -1 between rests; None for one that flows.

    Either deflection or load may be the quantity that is held.
    """
    for values in [deflection] if load is None else [deflection, load]:
        number = _rests_of(values)
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
    choices = []
    for values in [deflection] if load is None else [deflection, load]:
        middle = means(number, values)
        rank = _levels(middle, float(np.ptp(values)))
        own = np.bincount(rank, middle) / np.bincount(rank)
        choices.append((bool(np.var(middle - own[rank]) > _LOOSE * np.var(middle)), int(rank.max()), rank))
    return min(choices, key=lambda values: values[:2])[2]


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
    width = max(5, blocks // 50 | 1)
    smooth = np.median(sliding_window_view(np.pad(middle, width // 2, mode="edge"), width), axis=1)
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
    return bool(np.abs(last - first).sum() <= _CREPT * np.abs(first[1:] - last[:-1]).sum())


def _numbered(moves: BoolArray) -> IntArray:
    """Number of the rest of each block, -1 where it moves or where a rest is too short to count."""
    number = np.cumsum(np.diff(moves.astype(int), prepend=1) < 0) - 1
    number = np.where(moves, -1, number)
    lengths = np.bincount(number[number >= 0], minlength=1)
    long = lengths >= max(5, moves.size // 200)
    return np.where(long[number] & (number >= 0), number, -1)


#: A turn is accepted if the deflection then returns by this share of its whole range.
_TURN = 0.3
#: A branch is complete if its length is at least this share of the median length.
_COMPLETE = 0.9
#: A branch of a stepped record has more than so many rests; the step back to the start alone is no branch.
_FEWEST_RESTS = 2
#: Parts of the span in which deflections are counted.
_BINS = 20
#: A record rests within this share of its span.
_AT_REST = 0.02
#: Free travel covers at least this share of the deflection, below this share of the load span, with a slope below this
#: share of the mean slope.
_FREE_TRAVEL, _LIGHT, _FLAT = 0.05, 0.01, 0.02


@dataclass(frozen=True)
class Branches:
    """The branches of a record, and the pairs of them that are complete cycles.

    Attributes
    ----------
    ends : tuple of (int, int)
        Indices of the first and the last sample of each branch.
    rising : tuple of bool
        Whether the deflection rises along each branch.
    cycles : tuple of (int, int)
        Indices of the two branches of each complete cycle.
    ordered : bool
        Whether the deflections have an order in time; False for points at deflections in no order.
    """

    ends: tuple[tuple[int, int], ...]
    rising: tuple[bool, ...]
    cycles: tuple[tuple[int, int], ...]
    ordered: bool = True

    @property
    def measured(self) -> str:
        """What a tangent is of: "mean" of both branches, "loading", "unloading", or "points" in no order."""
        if self.cycles:
            return "mean"
        if not self.ordered:
            return "points"
        return "loading" if self.rising[0] else "unloading"

    def of_cycle(
        self, cycle: int, deflection: FloatArray, load: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray | None]:
        """Deflection, load and side (+1 loading, -1 unloading) of a cycle; without one, the only branch and None."""
        if not self.cycles:
            first, last = self.ends[0]
            return deflection[first : last + 1], load[first : last + 1], None
        pair = self.cycles[cycle]
        pieces = [slice(self.ends[i][0], self.ends[i][1] + 1) for i in pair]
        side = [np.full(p.stop - p.start, 1.0 if self.rising[i] else -1.0) for i, p in zip(pair, pieces, strict=True)]
        return (
            np.concatenate([deflection[p] for p in pieces]),
            np.concatenate([load[p] for p in pieces]),
            np.concatenate(side),
        )


def split_branches(deflection: FloatArray, load: FloatArray | None = None) -> Branches:
    """Split a deflection record at its turns.

    A cycle is a complete loading branch with the complete unloading branch after it. If a record has no such pair, a
    cycle is an unloading branch with the loading branch after it. Unordered points, with more turns than a third of
    their number, or of a load that steps in no order, are one branch.
    """
    turns = _turning_points(deflection)
    number = rests(deflection, load)
    ordered = len(turns) <= 2 + deflection.size // 3
    ordered = ordered and (number is None or passes_levels(ranks(number, deflection, load)))
    if not ordered:
        turns = [0, deflection.size - 1]
    else:
        turns = [_rest(deflection, turns[0], -1), *turns[1:-1], _rest(deflection, turns[-1], 1)]
    ends = tuple(pairwise(turns))
    rising = tuple(bool(deflection[b] > deflection[a]) for a, b in ends)
    lengths = np.array([abs(deflection[b] - deflection[a]) for a, b in ends])
    if number is not None:
        held = np.array([np.unique(number[a : b + 1]).size > _FEWEST_RESTS for a, b in ends])
        lengths = np.where(held, lengths, 0.0) if held.any() else lengths
    complete = lengths >= _COMPLETE * np.median(lengths[lengths > 0])
    cycles = _pairs(rising, complete, first=True) or _pairs(rising, complete, first=False)
    if len(turns) == 2:
        cycles = ()
    if not cycles and len(turns) > 2:
        # The longest branch alone is used.
        longest = int(np.argmax(lengths))
        ends, rising = (ends[longest],), (rising[longest],)
    return Branches(ends, rising, cycles, ordered)


def levels(deflection: FloatArray) -> int:
    """Number of deflections that differ by more than a twentieth of their span, about: clumped points count as one."""
    if deflection.size == 0:
        return 0
    low, span = float(deflection.min()), float(np.ptp(deflection)) or 1.0
    bins = np.minimum((deflection - low) / span * _BINS, _BINS - 1).astype(int)
    return int(np.count_nonzero(np.bincount(bins)))


def _rest(deflection: FloatArray, turn: int, step: int) -> int:
    """The first or last sample (`step` -1 or 1) of the rest at the first or last turn."""
    beyond = deflection[: turn + 1][::-1] if step < 0 else deflection[turn:]
    away = np.flatnonzero(np.abs(beyond - deflection[turn]) > _AT_REST * float(np.ptp(deflection)))
    return turn + step * (int(away[0]) - 1 if away.size else beyond.size - 1)


def _pairs(rising: tuple[bool, ...], complete: BoolArray, *, first: bool) -> tuple[tuple[int, int], ...]:
    """Pairs of neighbouring complete branches whose first one rises (if `first`) or falls."""
    return tuple((i, i + 1) for i in range(len(rising) - 1) if rising[i] is first and complete[i] and complete[i + 1])


def _turning_points(deflection: FloatArray) -> list[int]:
    """Indices of the first extreme, of every turn of more than `_TURN` of the range, and of the last extreme."""
    threshold = _TURN * float(np.ptp(deflection))
    x = deflection.tolist()
    turns: list[int] = []
    low = high = extreme = 0
    direction = 0
    for i, value in enumerate(x):
        if direction == 0:
            low, high = (i if value <= x[low] else low), (i if value >= x[high] else high)
            if value - x[low] > threshold:
                turns, direction, extreme = [low], 1, i
            elif x[high] - value > threshold:
                turns, direction, extreme = [high], -1, i
        elif direction * (value - x[extreme]) >= 0:
            extreme = i
        elif direction * (x[extreme] - value) > threshold:
            turns.append(extreme)
            direction, extreme = -direction, i
    return [*turns, extreme]


def in_contact(deflection: FloatArray, load: FloatArray) -> BoolArray:
    """Flags of the points with the specimen in contact; a flat start without load, before contact, is excluded."""
    everything = np.ones(load.size, dtype=bool)
    span, reach = float(np.ptp(load)), float(np.ptp(deflection))
    light = load < load.min() + _LIGHT * span
    touch = float(np.min(deflection[~light]))
    before = deflection < touch
    if np.unique(deflection[before]).size < 3 or touch - deflection.min() < _FREE_TRAVEL * reach:
        return everything
    slope = np.polyfit(deflection[before], load[before], 1)[0]
    return ~before if abs(slope) < _FLAT * span / reach else everything
