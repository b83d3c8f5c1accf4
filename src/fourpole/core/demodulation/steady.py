"""The steady part of a recording: the time between lead-in or run-up and run-down."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np

from fourpole.core.arrays import BoolArray, ComplexArray, FloatArray
from fourpole.core.demodulation.envelope import ENVELOPE, Envelope, envelope
from fourpole.core.demodulation.spectrum import median
from fourpole.core.demodulation.spoilt import runs_of
from fourpole.core.demodulation.tracks import Track, tracks_of
from fourpole.core.phasor import CHANNELS
from fourpole.core.recording import Recording
from fourpole.errors import RecordingError

#: The drive runs in stretches whose V1 is within these shares of its usual level and of its usual speed.
_LEVEL, _SPEED = 0.2, 0.03
#: A stretch is steady within this share of the mean of the middle half, or within this many of its standard deviations.
_WITHIN, _DEVIATIONS = 2e-3, 5.0
#: An end of the recording is trimmed where a stretch differs by more than this share, although the drive runs.
_ROUGH = 0.005
#: The longest run must hold this share of all stretches in which the drive runs.
_MOST_OF_IT = 0.7
#: The transient after a start lasts at most this share of the stretches examined.
_LONGEST_RING = 0.3
#: Number of trimmings; each takes the middle of what the one before has kept.
_ROUNDS = 2
_FEWEST_STRETCHES = 8
#: Fewest excitation cycles of a steady part, and of what lies between two rests.
_FEWEST_CYCLES, _FEWEST_MOVING = 6.0, 4.0
#: The drive rests in a half cycle whose range is below this share of the usual one; the start lasts so many cycles.
_REST, _START = 0.2, 1.0


def steady_part(recording: Recording, frequency: float) -> tuple[float, float] | None:
    """Start and end of the time in which the drive runs steadily [s].

    Parameters
    ----------
    recording : Recording
    frequency : float [Hz]
        Frequency of the excitation, as a rough estimate.

    Returns
    -------
    (float, float) or None
        None if the drive runs steadily from end to end, or if no steady part can be identified.

    Notes
    -----
    A stretch is steady if V1 has its usual level and speed, and if F1/V1 and V2/V1 have their usual values. The second
    condition excludes the free vibration of the rig after a start. A recording of few cycles is cut only where the
    drive rests, and by one cycle for the start.
    """
    names = [name for name in CHANNELS if name in recording.channels]
    try:
        tracks = tracks_of(recording, names)
    except RecordingError:
        return None
    found = recording.made[ENVELOPE] = envelope(tracks, 2 * np.pi * frequency)
    stretches = _bridged(found)
    if stretches is None:
        return _between_rests(tracks[0], frequency, recording.span)
    phase = np.unwrap(np.angle(stretches.amplitudes["motion_in"]))
    speed = np.gradient(phase, stretches.hop) / stretches.omega  # relative to the assumed frequency
    running = _running(stretches, speed)
    kept = None if running is None else _trimmed(stretches, speed, *running)
    if kept is None:
        return None
    (begin, end), last = kept, stretches.time.size - 1
    if (begin <= 1 and end >= last) or (end - begin) * stretches.hop * frequency < _FEWEST_CYCLES:
        return None
    low, high = recording.span
    middle = 0.5 * (low + high)
    return (
        low if begin <= 1 else middle + float(stretches.time[begin]),
        high if end >= last else middle + float(stretches.time[end - 1]),
    )


def _between_rests(track: Track, frequency: float, span: tuple[float, float]) -> tuple[float, float] | None:
    """Start and end [s] of the motion between rests, without its first cycle; None if there is no rest to cut."""
    motion = track.signals[track.names.index("motion_in")]
    edges = np.arange(0.0, motion.size + 0.5, track.rate / (2 * frequency)).astype(int)
    if edges.size < _FEWEST_STRETCHES or not track.present.all():
        return None
    spread = np.array([np.ptp(motion[low:high]) for low, high in pairwise(edges)])
    first, last = longest(spread > _REST * float(np.median(spread[spread > 0.5 * spread.max()])))
    begin = span[0] if first == 0 else span[0] + edges[first] / track.rate + _START / frequency
    end = span[1] if last == spread.size else span[0] + edges[last] / track.rate
    moving = (end - begin) * frequency >= _FEWEST_MOVING
    return (begin, end) if moving and (begin, end) != span else None


def _running(stretches: Envelope, speed: FloatArray) -> tuple[int, int] | None:
    """Range of the stretches in which the drive runs; None if it starts and stops several times.

    A beat with an interfering line also gives several such ranges, and no start to cut.
    """
    size = np.abs(stretches.amplitudes["motion_in"])
    level = float(median(size[size > 0.5 * size.max()]))
    up = np.abs(size / level - 1) < _LEVEL
    up &= np.abs(speed - median(speed[up])) < _SPEED if up.any() else False
    first, last = longest(up)
    return None if last - first < max(_FEWEST_STRETCHES, _MOST_OF_IT * up.sum()) else (first, last)


def _trimmed(stretches: Envelope, speed: FloatArray, begin: int, end: int) -> tuple[int, int] | None:
    """The range without the unsteady stretches at its ends; None if too few stretches remain.

    An end of the recording is trimmed only if its stretch differs much: a start within the range is always trimmed.
    """
    for _ in range(_ROUNDS):
        steady, rough = _steady(stretches, speed, slice(begin, end))
        before = _cut(steady) if begin > 1 or rough[0] else 0
        after = _cut(steady[::-1]) if end < stretches.time.size - 1 or rough[-1] else 0
        begin, end = begin + before, end - after
        if end - begin < _FEWEST_STRETCHES // 2:
            return None
    return begin, end


def _bridged(stretches: Envelope) -> Envelope | None:
    """The envelope, interpolated linearly over stretches with missing samples; None if too many are missing."""
    amplitudes: dict[str, ComplexArray] = {}
    for name, row in stretches.amplitudes.items():
        known = np.isfinite(row)
        count = np.count_nonzero(known)
        if count < max(_FEWEST_STRETCHES, row.size // 2):
            return None
        whole = count == row.size
        amplitudes[name] = row if whole else np.interp(stretches.time, stretches.time[known], row[known])
    return replace(stretches, amplitudes=amplitudes)


def longest(flags: BoolArray) -> tuple[int, int]:
    """First index of the longest run of true flags, and the index after its end; 0, 0 without a true flag."""
    return max(runs_of(flags), key=lambda run: run[1] - run[0], default=(0, 0))


def _steady(stretches: Envelope, speed: FloatArray, part: slice) -> tuple[BoolArray, BoolArray]:
    """Flags of the stretches of a part that are as steady as its middle half, and of those that differ much from it."""
    motion = stretches.amplitudes["motion_in"][part]
    others = [row[part] / motion for name, row in stretches.amplitudes.items() if name != "motion_in"]
    rows = np.array([np.abs(motion), 1.0 + speed[part], *others])
    half = slice(motion.size // 4, motion.size - motion.size // 4)
    off = np.abs(rows * ((half.stop - half.start) / np.add.reduce(rows[:, half], axis=1, keepdims=True)) - 1)
    spread = np.sqrt(np.add.reduce(off[:, half] ** 2, axis=1, keepdims=True) / (half.stop - half.start))
    steady = off < np.maximum(_WITHIN, _DEVIATIONS * spread)
    rough = off > np.maximum(_ROUGH, 2 * _DEVIATIONS * spread)
    return np.asarray(steady.all(axis=0)), np.asarray(rough.any(axis=0))


def _cut(steady: BoolArray) -> int:
    """Number of stretches to cut before two successive ones are steady; 0 if that is too long for a start."""
    pairs = np.flatnonzero(steady[:-1] & steady[1:])
    count = 1 + (int(pairs[0]) if pairs.size else steady.size)
    return count if count <= _LONGEST_RING * steady.size else 0
