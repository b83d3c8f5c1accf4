"""What a test machine does one after the other in one recording: rests, ramps, holds, loops, sines, sweeps, random."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Literal

import numpy as np

from fourpole.core.arrays import FloatArray, IntArray

#: Turning points closer to each other than so many standard deviations of the noise are none.
_NOISE = 12.0
#: Samples of a part of the motion; the noise is that of the quietest part.
_PART = 64
#: Departure of a half cycle from its fellows, in length and in height, up to which it is one of them [1].
_LENGTH, _HEIGHT = 0.08, 0.2
#: Change of the length of a half cycle over a segment [1], from which the motion is a sweep.
_SWEPT = 0.02
#: Fewest half cycles of a sinusoid.
_SINE = 9
#: Least amplitude of a loop over the largest height [1], and of two loops or more; what is smaller is rest or a ramp.
_WHOLE, _TWICE = 0.25, 0.1
#: Departure in height of the half cycles at the ends, while the machine begins and stops, that are left out [1].
_FULL = 0.02
#: Half cycles at the beginning of a sinusoid that are left out, while the specimen and the machine settle.
_SETTLING = 2
#: Half cycles, and samples, of the part of a sinusoid that is used: fewer are too short for an analysis.
_LASTING, _FEWEST = 7, 32
#: Tolerance of the height by noise [1], above which half cycles cannot be compared.
_UNSURE = 0.3
#: A jump is so many times as large as this share of all steps; steps beside it, and what is left after the jump back,
#: over it [1]; longest part between two jumps [samples].
_JUMP, _USUAL, _SUDDEN, _SHORT = 5.0, 0.5, 0.3, 64
#: Third harmonic of slow cycles over their fundamental [1], above which they are no sinusoid; a triangle has 1/9.
_TRIANGLE = 0.05
#: Frequency [Hz] below which few cycles are loops of a static test, as for a recording of its own.
SLOW = 0.5
#: Fewest half cycles of a sweep or of a random motion; least change of the logarithm of their length in a sweep.
_MANY, _CHIRPED = 40, 0.3
#: Range of the motion over the amplitude of the cycles beside it [1], up to which it rests.
_STILL = 0.02
#: Rest over the motion beside it [1], in time, from which it is none of the turns of a cycle; net change of a ramp [1].
_DWELL, _ONE_WAY = 0.3, 0.8
#: Range of a rest over that of the recording [1], from which the noise hides what is not a cycle.
_SEEN = 0.2
#: Share of a recording that the steady sinusoids and loops must have, or they are parts of another motion [1].
_COVERED = 0.1
#: Number of parts of what is between the segments; fewest samples of one.
_BLOCKS, _LEAST = 100, 4
#: Kinds of segments that are tests.
TESTS = ("loop", "sine", "sweep", "random")


@dataclass(frozen=True)
class Segment:
    """A part of a recording in which its motion is one thing.

    Attributes
    ----------
    kind : str
        "sine"; "loop", slow cycles of a static test; "rest" at the level of the beginning, "hold" at another one;
        "ramp" between them; "sweep", "random".
    start, end : float [s]
        Of the part that is steady, from the first sample of the motion.
    frequency : float [Hz]
        Cycles over time; 0 without cycles.
    amplitude, mean : float
        Half the height of a cycle, and the middle between its ends, in the unit of the motion.
    """

    kind: Literal["rest", "ramp", "hold", "loop", "sine", "sweep", "random"]
    start: float
    end: float
    frequency: float
    amplitude: float
    mean: float


def segments(motion: FloatArray, rate: float) -> list[Segment]:
    """The segments of a motion, in their order.

    The motion is cut at its turning points, those that stand out of the noise. Half cycles of one length and height in
    a row are a sinusoid or a loop; its ends are where the motion passes the middle, which noise moves least. What lies
    between is cut where the motion stops and begins; its settling belongs to no segment.

    Parameters
    ----------
    motion : (N,) float array
        Displacement, velocity or force, at even times.
    rate : float [Hz]
        Samples per second.

    Returns
    -------
    list of Segment

    Examples
    --------
    >>> t = np.arange(8000) / 1000.0
    >>> motion = np.where(t < 4.0, np.sin(2 * np.pi * 5 * t), 0.5 * np.sin(2 * np.pi * 20 * t))
    >>> [(one.kind, round(one.frequency, 2), round(one.amplitude, 2)) for one in segments(motion, 1000.0)]
    [('sine', 5.0, 1.0), ('sine', 20.0, 0.5)]
    """
    if motion.size < _SINE:
        return []
    noise = _noise(motion)
    turns = _turning_points(motion, noise)
    cycles = _cycles(motion, turns, rate, noise) if turns.size >= _SINE else []
    if sum(one.end - one.start for one in cycles) * rate < _COVERED * motion.size:
        cycles = []  # a random motion has a few cycles that are alike
    found, before = list[Segment](), None
    for one in [*cycles, None]:
        beside = [each for each in (before, one) if each is not None]
        ends = int(before.end * rate) + 1 if before else 0, int(one.start * rate) if one else motion.size
        least = max(_NOISE * noise, _STILL * min((each.amplitude for each in beside), default=0.0))
        between = list(_between(motion, turns, ends, rate, least)) if least < _SEEN * np.ptp(motion) else []
        half = max((0.5 / each.frequency for each in beside if each.kind == "sine"), default=0.0)
        found += [each for each in between if each.end - each.start > half]  # what is shorter is a cycle that settles
        found += [one] if one is not None else []
        before = one
    return found


def labelled(found: Iterable[Segment]) -> list[tuple[str, Segment]]:
    """Each segment with its kind and its number among those of this kind, as "sine 3"."""
    counts, labels = Counter[str](), list[tuple[str, Segment]]()
    for one in found:
        counts[one.kind] += 1
        labels.append((f"{one.kind} {counts[one.kind]}", one))
    return labels


def without_dropouts(motion: FloatArray) -> FloatArray:
    """The motion (N,) with straight lines in place of short parts that jump away and back, as drop-outs to zero do.

    Examples
    --------
    >>> without_dropouts(np.array([1.0, 1.1, 1.2, 0.0, 1.4, 1.5, 1.6, 1.7])).round(1).tolist()
    [1.0, 1.1, 1.2, 1.3, 1.4, 1.5, 1.6, 1.7]
    """
    steps = np.diff(motion)
    sizes = np.abs(steps)
    usual = np.quantile(sizes, _USUAL) if sizes.size else 0.0
    jumps = np.flatnonzero(sizes > _JUMP * usual)
    mended, place = motion.copy(), 0
    while usual > 0.0 and place + 1 < jumps.size:
        low, high = int(jumps[place]), int(jumps[place + 1]) + 1
        least = _SUDDEN * min(sizes[low], sizes[high - 1])
        sudden = sizes[max(low - 1, 0)] < least and sizes[min(high, sizes.size - 1)] < least
        back = abs(motion[high] - motion[low]) < least and steps[low] * steps[high - 1] < 0
        if high - low <= _SHORT and sudden and back:
            mended[low : high + 1] = np.linspace(motion[low], motion[high], high - low + 1)
            place += 1
        place += 1
    return mended


def _cycles(motion: FloatArray, turns: IntArray, rate: float, noise: float) -> list[Segment]:
    """The steady sinusoids and the loops."""
    at = _middles(motion, turns) / rate
    height = np.abs(np.diff(motion[turns]))
    found, first = list[Segment](), 0
    while first < height.size:
        last = _alike(at, height, first, noise)
        one = _segment(motion, turns[first : last + 1], at[first:last], rate, noise)
        least = (_WHOLE if last - first < 4 else _TWICE) * height.max()
        if one is not None and (one.kind == "sine" or one.amplitude > least):
            goes_on = found and one.kind == found[-1].kind == "loop" and one.start <= found[-1].end
            found.append(replace(found.pop(), end=one.end) if goes_on else one)
        first = max(last, first + 1)
    return found


def _turning_points(motion: FloatArray, noise: float) -> IntArray:
    """Places where the motion turns, each further from the one before than noise reaches."""
    least = _NOISE * noise
    slope = np.sign(np.diff(motion))
    moving = np.flatnonzero(slope)
    bends = np.flatnonzero(np.diff(slope[moving]))
    places = np.concatenate([[0], moving[bends] + 1, [motion.size - 1]])
    kept = [int(places[0])]
    values, way = motion[places], 0.0
    for place, value in zip(places[1:].tolist(), values[1:].tolist(), strict=True):
        step = value - motion[kept[-1]]
        if way * step > 0.0 or (not way and abs(step) > least):
            if way * step > 0.0:
                kept[-1] = place  # further the same way
            else:
                kept.append(place)
                way = np.sign(step)
        elif way and abs(step) > least:
            kept.append(place)
            way = -way
    return np.array(kept)


def _noise(motion: FloatArray) -> float:
    """Standard deviation of the noise of single samples, where they are quietest, or the step of the converter."""
    second = np.diff(motion, 2) / np.sqrt(6.0)
    parts = second[: second.size // _PART * _PART].reshape(-1, _PART)
    quietest = float(np.min(np.std(parts, axis=1))) if parts.size else 0.0
    steps = np.abs(np.diff(motion))
    return max(quietest, float(np.min(steps[steps > 0.0], initial=np.inf)) / np.sqrt(12.0) if steps.any() else 0.0)


def _middles(motion: FloatArray, turns: IntArray) -> FloatArray:
    """Places, between samples, at which each half cycle passes the middle of its ends."""
    found = []
    for one, other in zip(turns[:-1].tolist(), turns[1:].tolist(), strict=True):
        part = motion[one : other + 1]
        middle = 0.5 * (part[0] + part[-1])
        beyond = (part - middle) * (part[-1] - part[0]) > 0.0
        after = int(np.argmax(beyond))
        share = (middle - part[after - 1]) / (part[after] - part[after - 1]) if after else 0.0
        found.append(one + after - 1 + share)
    return np.array(found)


def _alike(at: FloatArray, height: FloatArray, first: int, noise: float) -> int:
    """The end of the half cycles from `first` on that are of one length and height, as far as the noise lets see."""
    last, lengths = first + 1, np.diff(at)
    while last < height.size:
        usual, high = np.median(lengths[first:last]), np.median(height[first : last + 1])
        unsure = _NOISE * noise / high
        if unsure > _UNSURE:
            break
        if abs(lengths[last - 1] / usual - 1.0) > _LENGTH + unsure or abs(height[last] / high - 1.0) > _HEIGHT + unsure:
            break
        last += 1
    return last


def _segment(motion: FloatArray, turns: IntArray, at: FloatArray, rate: float, noise: float) -> Segment | None:
    """The segment of half cycles between turning points, which pass their middles at some times; None if it is none."""
    values, ends = motion[turns], turns[[0, -1]] / rate
    amplitude, mean = 0.5 * np.median(np.abs(np.diff(values))), 0.5 * np.median(values[1:] + values[:-1])
    lengths = np.diff(at)
    slow = lengths.size and np.median(lengths) > 0.55 / SLOW
    even = (turns.size - 2) // 2 * 2  # a rest before the first turn is a part of its half cycle
    if slow and (at.size < _SINE or _third(motion[turns[1] : turns[1 + even]], even) > _TRIANGLE):
        frequency = 0.5 / np.mean(lengths)
        return Segment("loop", float(ends[0]), float(ends[1]), float(frequency), float(amplitude), float(mean))
    if at.size < _SINE:
        return None
    full = np.flatnonzero(np.abs(0.5 * np.abs(np.diff(values)) / amplitude - 1.0) < _FULL + _NOISE * noise / amplitude)
    # The last half cycle may end in a rest: it then goes on to the first turn of the next motion.
    begin, end = int(full[0]), int(full[-1])
    at = at[max(_SETTLING, begin) if end - _SETTLING > _LASTING else begin : end]
    lengths = np.diff(at)
    if lengths.size < _LASTING - 1 or (at[-1] - at[0]) * rate < _FEWEST:
        return None
    usual, spread = float(np.mean(lengths)), float(np.std(lengths))
    change = abs(np.polyfit(np.arange(lengths.size), lengths, 1)[0]) * lengths.size
    if change > _SWEPT * usual + 4.0 * spread / np.sqrt(lengths.size):
        return None
    return Segment("sine", float(at[0]), float(at[-1]), 0.5 / usual, float(amplitude), float(mean))


def _third(motion: FloatArray, halves: int) -> float:
    """Third harmonic over the fundamental of a motion of so many half cycles, a multiple of two [1]."""
    turn = np.exp(-1j * np.pi * halves * np.arange(motion.size) / motion.size)
    return float(abs(np.mean(motion * turn**3)) / abs(np.mean(motion * turn)))


def _between(
    motion: FloatArray, turns: IntArray, ends: tuple[int, int], rate: float, least: float
) -> Iterator[Segment]:
    """What lies between two of the steady segments: rests, holds and ramps; sweeps and random motions.

    The motion is still where its range is at most `least`, or a small part of that between the segments.
    """
    inside = turns[(turns > ends[0]) & (turns < ends[1] - 1)]
    for low, high, still in _runs(motion, inside, ends, least):
        part, turned = motion[low:high], inside[(inside > low) & (inside < high - 1)]
        times, mean = (float(low / rate), float(high / rate)), float(np.mean(part))
        if still:
            yield Segment("rest" if abs(mean - motion[0]) <= 2 * least else "hold", *times, 0.0, 0.0, mean)
        elif turned.size >= _MANY:
            lengths = np.diff(turned)
            first, last = (float(np.mean(each)) for each in np.array_split(lengths, 3)[::2])
            change = abs(np.log(last / first))
            swept = change > _CHIRPED and np.std(np.diff(np.log(lengths))) < 0.5 * change
            frequency, height = float(0.5 * rate / np.mean(lengths)), float(np.median(np.abs(np.diff(motion[turned]))))
            yield Segment("sweep" if swept else "random", *times, frequency, 0.5 * height, mean)
        elif abs(part[-1] - part[0]) > _ONE_WAY * np.ptp(part):
            yield Segment("ramp", *times, 0.0, 0.0, mean)


def _runs(motion: FloatArray, turns: IntArray, ends: tuple[int, int], least: float) -> Iterator[tuple[int, int, bool]]:
    """First and last place of each part in which the motion is still, or moves; a turn of a cycle is not still."""
    if ends[1] - ends[0] < _LEAST:
        return
    edges = np.unique(np.linspace(*ends, min(_BLOCKS, (ends[1] - ends[0]) // _LEAST) + 1).astype(int))
    least = max(least, 0.5 * _STILL * float(np.ptp(motion[slice(*ends)])))
    still = np.array([np.ptp(motion[low:high]) <= least for low, high in pairwise(edges)], dtype=bool)
    at = [0, *(np.flatnonzero(np.diff(still)) + 1).tolist(), still.size]
    runs = [(int(edges[low]), int(edges[high]), bool(still[low])) for low, high in pairwise(at)]
    half = [(high - low) / (1 + np.count_nonzero((turns > low) & (turns < high))) for low, high, _ in runs]
    begun = runs[0][0]
    for place, (low, high, rests) in enumerate(runs):
        beside = max((*half[max(place - 1, 0) : place], *half[place + 1 : place + 2]), default=0.0)
        if rests and high - low > _DWELL * beside:
            if begun < low:
                yield begun, low, False
            yield low, high, True
            begun = high
    if begun < ends[1]:
        yield begun, ends[1], False
