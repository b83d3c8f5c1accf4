"""The steady sinusoids and slow loops of a motion that a test machine makes one after the other in one recording."""

from __future__ import annotations

from dataclasses import dataclass, replace
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
#: Least amplitude of a loop over the largest height [1]; what is smaller is rest or a ramp.
_WHOLE = 0.25
#: Departure in height of the half cycles at the ends, while the machine begins and stops, that are left out [1].
_FULL = 0.02
#: Half cycles at the beginning of a sinusoid that are left out, while the specimen and the machine settle.
_SETTLING = 2
#: Frequency [Hz] below which cycles are loops of a static test, as for a recording of its own.
SLOW = 0.5


@dataclass(frozen=True)
class Segment:
    """A part of a recording in which its motion is one thing.

    Attributes
    ----------
    kind : str
        "sine" or "loop".
    start, end : float [s]
        Of the part that is steady, from the first sample of the motion.
    frequency : float [Hz]
        Cycles over time.
    amplitude, mean : float
        Half the height of a cycle, and the middle between its ends, in the unit of the motion.
    """

    kind: Literal["sine", "loop"]
    start: float
    end: float
    frequency: float
    amplitude: float
    mean: float


def segments(motion: FloatArray, rate: float) -> list[Segment]:
    """The steady sinusoids and slow loops of a motion, in their order.

    The motion is cut at its turning points, those that stand out of the noise. Half cycles of one length and height in
    a row are a segment; its ends are where the motion passes the middle, which noise moves least. What is between
    segments is rest, a ramp, or a motion of another kind, such as a sweep or a random one, which has none.

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
    if turns.size < _SINE:
        return []
    at = _middles(motion, turns) / rate
    height = np.abs(np.diff(motion[turns]))
    found, first = list[Segment](), 0
    while first < height.size:
        last = _alike(at, height, first, noise)
        one = _segment(motion[turns[first : last + 1]], turns[[first, last]] / rate, at[first:last], noise)
        if one is not None and (one.kind == "sine" or one.amplitude > _WHOLE * height.max()):
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
        if abs(lengths[last - 1] / usual - 1.0) > _LENGTH + unsure or abs(height[last] / high - 1.0) > _HEIGHT + unsure:
            break
        last += 1
    return last


def _segment(values: FloatArray, ends: FloatArray, at: FloatArray, noise: float) -> Segment | None:
    """The segment of half cycles between turning points, which pass their middles at some times; None if it is none."""
    amplitude, mean = 0.5 * np.median(np.abs(np.diff(values))), 0.5 * np.median(values[1:] + values[:-1])
    lengths = np.diff(at)
    if lengths.size and np.median(lengths) > 0.55 / SLOW:
        frequency = 0.5 / np.mean(lengths)
        return Segment("loop", float(ends[0]), float(ends[1]), float(frequency), float(amplitude), float(mean))
    if at.size < _SINE:
        return None
    full = np.flatnonzero(np.abs(0.5 * np.abs(np.diff(values)) / amplitude - 1.0) < _FULL + _NOISE * noise / amplitude)
    at = at[max(_SETTLING, full[0]) : full[-1] + 1]
    lengths = np.diff(at)
    if lengths.size < _SETTLING:
        return None
    usual, spread = float(np.mean(lengths)), float(np.std(lengths))
    change = abs(np.polyfit(np.arange(lengths.size), lengths, 1)[0]) * lengths.size
    if change > _SWEPT * usual + 4.0 * spread / np.sqrt(lengths.size):
        return None
    return Segment("sine", float(at[0]), float(at[-1]), 0.5 / usual, float(amplitude), float(mean))
