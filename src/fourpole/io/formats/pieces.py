"""Recordings in pieces: channels of which any part can be read go on together, each at its own rate."""

from __future__ import annotations

import math
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from fourpole.io.formats.guard import Guard, guarded
from fourpole.io.signals import Request, Signal
from fourpole.io.source import name_of

__all__ = ["Part", "Track", "by_tracks", "in_step", "remembered"]

Part = Callable[[int, int], NDArray[np.float64]]
"""Values from a first one to before a last one."""


@dataclass(frozen=True)
class Track:
    """A channel of which any part can be read.

    Attributes
    ----------
    name, unit, rate, start
        As of a `Signal`.
    count : int
        Its samples.
    samples : callable
    time : callable or None [s]
        Where the file states the times one by one; channels with the same times share it.
    """

    name: str
    unit: str | None
    count: int
    samples: Part
    rate: float | None = None
    start: float = 0.0
    time: Part | None = None

    def part(self, first: int, last: int) -> Signal:
        """Some of its samples."""
        samples = self.samples(first, last)
        if self.time is None:
            start = self.start if not self.rate else self.start + first / self.rate
            return Signal(self.name, self.unit, samples, start, self.rate)
        time = self.time(first, last)
        start = float(time[0]) if len(time) else self.start
        return Signal(self.name, self.unit, samples, start, self.rate, time)

    def whole(self) -> Signal:
        """All of them."""
        return self.part(0, self.count)


def remembered(read: Part) -> Part:
    """A part that is asked for again, as the times of several channels are, is read once."""
    held: dict[tuple[int, int], NDArray[np.float64]] = {}

    def part(first: int, last: int) -> NDArray[np.float64]:
        if (first, last) not in held:
            held.clear()
            held[first, last] = read(first, last)
        return held[first, last]

    return part


@dataclass(frozen=True)
class _Pace:
    """When the samples of a channel are; where it has no time of its own, evenly over that of the others."""

    count: int
    rate: float
    start: float
    time: Part | None

    def when(self, index: int) -> float:
        if self.time is None:
            return self.start + index / self.rate
        return float(self.time(index, index + 1)[0])

    def until(self, limit: float, first: int, last: int) -> int:
        """The first of some samples that is not before a time."""
        if self.time is None:
            return math.ceil(min(max((limit - self.start) * self.rate, first), last))
        reached = self.time(first, last) >= limit
        return first + int(np.argmax(reached)) if reached.any() else last


def _paces(tracks: Sequence[Track]) -> list[_Pace]:
    known = [_Pace(one.count, one.rate or 1.0, one.start, one.time) for one in tracks]
    timed = [one for one, track in zip(known, tracks, strict=True) if (track.rate or track.time) and one.count]
    ends = [(one.when(0), one.when(one.count - 1)) for one in timed]
    spans = [(start, end - start) for start, end in ends if math.isfinite(end - start) and end > start]
    start, span = max(spans, key=lambda one: one[1], default=(0.0, 1.0))
    return [
        one if track.rate or track.time else _Pace(one.count, max(one.count, 1) / span, start, None)
        for one, track in zip(known, tracks, strict=True)
    ]


def in_step(tracks: Sequence[Track], rows: int) -> Generator[list[Signal]]:
    """All samples of some channels, piece by piece: `rows` of each at most, and of about the same time.

    There is one piece at least.
    """
    rows = max(rows, 1)
    same = len({(one.count, one.rate, one.start, one.time) for one in tracks}) <= 1
    paces = [] if same else _paces(tracks)
    at = [0] * len(tracks)
    while True:
        ends = [min(first + rows, one.count) for first, one in zip(at, tracks, strict=True)]
        if not same:
            ends = _together(paces, at, ends)
        yield [one.part(first, last) for one, first, last in zip(tracks, at, ends, strict=True)]
        at = ends
        if all(first >= one.count for first, one in zip(at, tracks, strict=True)):
            return


def _together(paces: Sequence[_Pace], at: Sequence[int], ends: Sequence[int]) -> list[int]:
    """Where pieces end so that none goes further in time than the one that is full first."""
    limits = [one.when(last) for one, last in zip(paces, ends, strict=True) if last < one.count]
    limit = min((one for one in limits if math.isfinite(one)), default=math.inf)
    if math.isinf(limit):
        return list(ends)
    found = [one.until(limit, first, last) for one, first, last in zip(paces, at, ends, strict=True)]
    return found if found != list(at) else list(ends)


class Opening(Protocol):
    """Opens a file under a guard, and gives the channels of a request while it is open."""

    def __call__(self, request: Request, guard: Guard, /, *, whole: bool) -> AbstractContextManager[list[Track]]:
        """`whole`: all of them will be held at once, which must be afforded."""


def by_tracks(
    kind: str, library: str, tracks: Opening
) -> tuple[Callable[[Request], list[Signal]], Callable[[Request, int], Iterator[list[Signal]]]]:
    """What `Format.read` and `Format.blocks` are for a format any part of whose channels can be read.

    `kind` and `library` are those of its `Guard`.
    """

    def read(request: Request) -> list[Signal]:
        guard = Guard(name_of(request.path, request.label), kind, library)
        with guard, tracks(request, guard, whole=True) as opened:
            return [one.whole() for one in opened]

    def stretches(request: Request, rows: int, guard: Guard) -> Generator[list[Signal]]:
        with tracks(request, guard, whole=False) as opened:
            yield from in_step(opened, rows)

    def blocks(request: Request, rows: int) -> Iterator[list[Signal]]:
        guard = Guard(name_of(request.path, request.label), kind, library)
        return guarded(stretches(request, rows, guard), guard)

    return read, blocks
