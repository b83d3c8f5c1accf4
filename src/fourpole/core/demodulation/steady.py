"""The steady part of a recording: what lies before and after it, lead-in, run-up and run-down, is told apart."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fourpole.core.arrays import BoolArray, ComplexArray, FloatArray
from fourpole.core.demodulation.envelope import Envelope, envelope
from fourpole.core.demodulation.tracks import tracks_of
from fourpole.core.phasor import CHANNELS
from fourpole.core.recording import Recording
from fourpole.errors import RecordingError

__all__ = ["steady_part"]

#: Further from the level of V1, or from its speed, than this the drive is not up.
_LEVEL, _SPEED = 0.2, 0.03
#: The steady part is as steady as its middle: within this, or so many standard deviations of the middle half.
_WITHIN, _DEVIATIONS = 2e-3, 5.0
#: An end that is further off than this is cut, though V1 is up.
_ROUGH = 0.005
#: What is kept must be most of what runs, and a start rings out within a share of that.
_MOST_OF_IT, _LONGEST_RING = 0.7, 0.3
#: Each round the middle is that of what was left.
_ROUNDS = 2
_FEWEST_STRETCHES = 8
#: Cycles that must be left.
_FEWEST_CYCLES = 6.0


def steady_part(recording: Recording, frequency: float) -> tuple[float, float] | None:
    """From when to when the drive runs steadily [s]; None where it does from end to end, or where that is not clear.

    Parameters
    ----------
    recording : Recording
    frequency : float [Hz]
        About that of the excitation.

    Notes
    -----
    A stretch is steady where V1 has its level and speed, and where F1 and V2 have come to rest against V1, so that the
    rig's own motion after the start is cut too.
    """
    names = [name for name in CHANNELS if name in recording.channels]
    try:
        tracks = tracks_of(recording, names)
    except RecordingError:
        return None
    found = _bridged(envelope(tracks, 2 * np.pi * frequency))
    if found is None:
        return None
    size, speed = np.abs(found.amplitudes["motion_in"]), _speed(found)
    level = float(np.median(size[size > 0.5 * np.max(size)]))
    up = np.abs(size / level - 1) < _LEVEL
    up &= np.abs(speed - np.median(speed[up])) < _SPEED if up.any() else False
    first, last = _longest(up)
    if last - first < max(_FEWEST_STRETCHES, _MOST_OF_IT * up.sum()):
        return None  # up and down and up again: a beat with a line near by, not a drive that starts
    begin, end = first, last
    for _ in range(_ROUNDS):
        settled, rough = _settled(found, speed, slice(begin, end))
        begin, end = (
            begin + (_cut(settled) if begin > 1 or rough[0] else 0),
            end - (_cut(settled[::-1]) if end < up.size - 1 or rough[-1] else 0),
        )
        if end - begin < _FEWEST_STRETCHES // 2:
            return None
    if begin <= 1 and end >= up.size - 1:
        return None
    if (end - begin) * found.hop * frequency < _FEWEST_CYCLES:
        return None
    low, high = recording.span
    middle = 0.5 * (low + high)
    return (
        low if begin <= 1 else middle + float(found.time[begin]),
        high if end >= up.size - 1 else middle + float(found.time[end - 1]),
    )


def _bridged(found: Envelope) -> Envelope | None:
    """The envelope with straight lines over stretches whose samples are missing; None where too little is known."""
    amplitudes: dict[str, ComplexArray] = {}
    for name, row in found.amplitudes.items():
        known = np.isfinite(row)
        if known.sum() < max(_FEWEST_STRETCHES, row.size // 2):
            return None
        amplitudes[name] = np.interp(found.time, found.time[known], row[known])
    return replace(found, amplitudes=amplitudes)


def _speed(found: Envelope) -> FloatArray:
    """Speed of V1 beyond the frequency assumed, as a share of it."""
    return np.asarray(np.gradient(found.phase("motion_in"), found.time) / found.omega)


def _longest(flags: BoolArray) -> tuple[int, int]:
    """The longest run of true flags, as a range."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(int)))
    runs = edges.reshape(-1, 2)
    if not runs.size:
        return 0, 0
    first, last = runs[np.argmax(runs[:, 1] - runs[:, 0])]
    return int(first), int(last)


def _settled(found: Envelope, speed: FloatArray, part: slice) -> tuple[BoolArray, BoolArray]:
    """Which stretches of a part are as steady as its middle half, and which are far from that."""
    motion = found.amplitudes["motion_in"][part]
    rows = [np.abs(motion), 1.0 + speed[part]]
    rows += [found.amplitudes[name][part] / motion for name in found.amplitudes if name != "motion_in"]
    count = motion.size
    half = slice(count // 4, count - count // 4)
    good, rough = np.ones(count, dtype=bool), np.zeros(count, dtype=bool)
    for row in rows:
        off = np.abs(row / np.mean(row[half]) - 1)
        spread = float(np.sqrt(np.mean(off[half] ** 2)))
        good &= off < max(_WITHIN, _DEVIATIONS * spread)
        rough |= off > max(_ROUGH, 2 * _DEVIATIONS * spread)
    return good, rough


def _cut(settled: BoolArray) -> int:
    """Stretches to cut before two in a row are settled; none where that takes too long to be a start that rings out."""
    count = _until(settled) + 1
    return count if count <= _LONGEST_RING * settled.size else 0


def _until(flags: BoolArray) -> int:
    """How many stretches pass until two in a row are good."""
    pairs = np.flatnonzero(flags[:-1] & flags[1:])
    return int(pairs[0]) if pairs.size else flags.size
