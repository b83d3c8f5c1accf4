"""Tracks: channels of which any part can be read, and formats whose channels are tracks, read whole or in chunks."""

from __future__ import annotations

import math
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from fourpole.errors import TableError
from fourpole.io.door import open_regular, path_for_library
from fourpole.io.formats.guard import afford, find, guard, guarded, need, tidy, time_scale
from fourpole.io.recordings import BEGINS
from fourpole.io.signals import HEAD_BYTES, MAX_FILE_BYTES, FileInfo, Format, Request, Signal, SignalInfo, Words
from fourpole.io.source import name_of
from fourpole.units import shown

Part = Callable[[int, int], NDArray[np.float64]]
"""A function of two indices that returns the values from the first index up to, without, the second one."""
#: Largest number of notes on a file, and of those on channels that cannot be read.
_MOST_NOTES = 20


@dataclass(frozen=True)
class Track:
    """A channel of which any part can be read.

    Attributes
    ----------
    name, unit, rate, start
        See `Signal`.
    count : int
        Number of samples.
    samples : Part
        Returns the samples from one index to another.
    time : Part or None [s]
        Returns their times, if the file states each time; channels with the same times share this function.
    group, note : str
        See `SignalInfo`.
    barred : str
        The reason why it cannot be read; empty if it can.
    """

    name: str
    unit: str | None
    count: int
    samples: Part
    rate: float | None = None
    start: float = 0.0
    time: Part | None = None
    group: str = ""
    note: str = ""
    barred: str = ""

    def when(self, index: int) -> float:
        """Time of a sample [s]; its index if neither rate nor times are known."""
        if self.time is None:
            return self.start + index / (self.rate or 1.0)
        return float(self.time(index, index + 1)[0])

    def until(self, limit: float, first: int, last: int) -> int:
        """Index, from `first` to `last`, of the first sample whose time is not before `limit` [s]."""
        if self.time is None:
            return math.ceil(min(max((limit - self.start) * (self.rate or 1.0), first), last))
        reached = self.time(first, last) >= limit
        return first + int(np.argmax(reached)) if reached.any() else last

    def part(self, first: int, last: int) -> Signal:
        """The samples from index `first` up to `last`, as a signal."""
        samples, time = self.samples(first, last), None if self.time is None else self.time(first, last)
        for values in (samples, samples if time is None else time):
            if len(values) != last - first:
                raise ValueError(f"channel {shown(self.name)} has {first + len(values)} of {self.count} samples")
        if time is None:
            start = self.start if not self.rate else self.start + first / self.rate
        else:
            start = float(time[0]) if len(time) else self.start
        return Signal(self.name, self.unit, samples, start, self.rate, time)

    def info(self) -> SignalInfo:
        """The description of the channel; its duration is that of its times if these are finite."""
        ends = None
        if self.time is not None and self.count:
            with suppress(TableError, IndexError):  # a time in a unit that is none, or that is cut short
                found = self.when(0), self.when(self.count - 1)
                ends = found if np.isfinite(found).all() else None
        note = "; ".join(filter(None, (self.barred, self.note)))
        return SignalInfo.timed(
            self.name, self.unit, self.group, self.count, rate=self.rate, start=self.start, ends=ends, note=note
        )


def remembered(read: Part) -> Part:
    """The same function, which keeps its last result: channels with the same times do not read them again."""
    held: dict[tuple[int, int], NDArray[np.float64]] = {}

    def part(first: int, last: int) -> NDArray[np.float64]:
        if (first, last) not in held:
            held.clear()
            held[first, last] = read(first, last)
        return held[first, last]

    return part


def times_by(time: Track, file: str) -> Part:
    """The function that reads a part of the times [s] which a channel of a file states, in its unit."""
    return remembered(lambda first, last: time_scale(time.unit, time.name, file) * time.samples(first, last))


def _paced(tracks: Sequence[Track]) -> list[Track]:
    """The channels; one without times is spread evenly over the longest duration of the others."""
    ends = [(one.when(0), one.when(one.count - 1)) for one in tracks if (one.rate or one.time) and one.count]
    spans = [(start, end - start) for start, end in ends if math.isfinite(end - start) and end > start]
    start, span = max(spans, key=lambda one: one[1], default=(0.0, 1.0))
    return [one if one.rate or one.time else replace(one, rate=max(one.count, 1) / span, start=start) for one in tracks]


def in_step(tracks: Sequence[Track], rows: int) -> Generator[list[Signal]]:
    """All samples of some channels in chunks: at most `rows` samples of each channel, and of about the same time.

    There is at least one chunk.
    """
    rows = max(rows, 1)
    same = len({(one.count, one.rate, one.start, one.time) for one in tracks}) <= 1
    paced = [] if same else _paced(tracks)
    at = [0] * len(tracks)
    while True:
        ends = [min(first + rows, one.count) for first, one in zip(at, tracks, strict=True)]
        if not same:
            ends = _together(paced, at, ends)
        yield [one.part(first, last) for one, first, last in zip(tracks, at, ends, strict=True)]
        at = ends
        if all(first >= one.count for first, one in zip(at, tracks, strict=True)):
            return


def _together(tracks: Sequence[Track], at: Sequence[int], ends: Sequence[int]) -> list[int]:
    """Ends of a chunk at which no channel is later in time than the channel that fills its rows first."""
    limits = [one.when(last) for one, last in zip(tracks, ends, strict=True) if last < one.count]
    limit = min((one for one in limits if math.isfinite(one)), default=math.inf)
    if math.isinf(limit):
        return list(ends)
    found = [one.until(limit, first, last) for one, first, last in zip(tracks, at, ends, strict=True)]
    return found if found != list(at) else list(ends)


@dataclass(frozen=True)
class OpenFile:
    """A file that is open for the reader of its format.

    Attributes
    ----------
    path : Path
        The path of the file, for a library that must open it by name; see `fourpole.io.recordings.BY_PATH`.
    file : BinaryIO
        The open file, at its beginning.
    name : str
        The file's name in messages.
    kind : str
        The kind of file that is expected.
    closing : ExitStack
        Closes whatever the reader adds to it, before the file itself is closed.
    """

    path: Path
    file: BinaryIO
    name: str
    kind: str
    closing: ExitStack

    def load(self, module: str) -> Any:
        """The module of a library that the base installation lacks; FileError if it is not installed."""
        return need(module, self.name, self.kind)


@dataclass(frozen=True)
class Content:
    """The channels of an open file.

    Attributes
    ----------
    format, notes, began
        See `FileInfo`.
    tracks : sequence of Track
    closed : sequence of Track
        What is no channel, and why, for those who name it.
    sample_bytes : int [byte]
        Memory that each sample of a channel needs which is read whole.
    words : callable
        Returns the columns of words.
    """

    format: str
    tracks: Sequence[Track]
    notes: Sequence[str] = ()
    began: float | None = None
    closed: Sequence[Track] = ()
    sample_bytes: int = 16
    words: Callable[[], list[Words]] = list

    def info(self) -> FileInfo:
        """The description of the file and its channels."""
        return FileInfo(self.format, tuple(one.info() for one in self.tracks), tuple(self.notes), self.began)

    def asked(self, request: Request) -> list[Track]:
        """The channels of a request; TableError if one is missing, ambiguous, or cannot be read."""
        every = [*self.tracks, *self.closed]
        found = [every[at] for at in find([(one.group, one.name) for one in every], request)]
        for one in found:
            if one.barred:
                raise TableError(f"{name_of(request.path, request.label)}: channel {shown(one.name)} {one.barred}")
        return found


def refused(closed: Sequence[Track]) -> list[str]:
    """Notes on what is no channel, and why."""
    return [f"{tidy(f'{one.group}/{one.name}'.lstrip('/'))} {one.barred}" for one in closed[:_MOST_NOTES]]


@contextmanager
def opened(module: str, kind: str, path: Path, label: str) -> Iterator[OpenFile]:
    """A file that is open for the reader of a module, once its first bytes have been looked at."""
    with ExitStack() as closing:
        file = closing.enter_context(open_regular(path, max_bytes=MAX_FILE_BYTES, label=label))
        if not BEGINS[module](file.read(HEAD_BYTES)):
            raise TableError(f"{label}: is not {kind}: it does not begin as one; check what wrote it")
        file.seek(0)
        with path_for_library(path, file, label=label) as same:
            yield OpenFile(same, file, label, kind, closing)


def track_format(
    module: str, name: str, endings: tuple[str, ...], kind: str, content: Callable[[OpenFile], Content]
) -> Format:
    """The format of a module whose function `content` gives the channels of an open file; `kind` is for its `guard`."""

    def survey(path: Path, label: str, _: int) -> FileInfo:
        label = name_of(path, label)
        with guard(label, kind), opened(module, kind, path, label) as file:
            return content(file).info()

    def read(request: Request) -> list[Signal]:
        label = name_of(request.path, request.label)
        with guard(label, kind), opened(module, kind, request.path, label) as file:
            found = content(file)
            tracks = found.asked(request)
            afford(found.sample_bytes * sum(one.count for one in tracks), request.max_bytes, label)
            return [one.part(0, one.count) for one in tracks]

    def chunks(request: Request, rows: int, label: str) -> Generator[list[Signal]]:
        with opened(module, kind, request.path, label) as file:
            yield from in_step(content(file).asked(request), rows)

    def blocks(request: Request, rows: int) -> Iterator[list[Signal]]:
        label = name_of(request.path, request.label)
        return guarded(chunks(request, rows, label), label, kind)

    def words(path: Path, label: str) -> list[Words]:
        with guard(label, kind), opened(module, kind, path, label) as file:
            return content(file).words()

    return Format(name, endings, survey, read, blocks, by_library=True, words=words)
