"""Tracks: channels of which any part can be read, and formats whose channels are tracks, read whole or in chunks."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from fourpole.errors import TableError
from fourpole.io.door import open_regular, path_for_library
from fourpole.io.formats.guard import Guard, afford, find, guarded
from fourpole.io.known import BEGINS
from fourpole.io.names import Place
from fourpole.io.signals import HEAD_BYTES, MAX_FILE_BYTES, FileInfo, Format, Request, Signal
from fourpole.io.source import name_of

Part = Callable[[int, int], NDArray[np.float64]]
"""A function of two indices that returns the values from the first index up to, without, the second one."""


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
    """

    name: str
    unit: str | None
    count: int
    samples: Part
    rate: float | None = None
    start: float = 0.0
    time: Part | None = None

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
        samples = self.samples(first, last)
        if self.time is None:
            start = self.start if not self.rate else self.start + first / self.rate
            return Signal(self.name, self.unit, samples, start, self.rate)
        time = self.time(first, last)
        start = float(time[0]) if len(time) else self.start
        return Signal(self.name, self.unit, samples, start, self.rate, time)


def remembered(read: Part) -> Part:
    """The same function, which keeps its last result: channels with the same times do not read them again."""
    held: dict[tuple[int, int], NDArray[np.float64]] = {}

    def part(first: int, last: int) -> NDArray[np.float64]:
        if (first, last) not in held:
            held.clear()
            held[first, last] = read(first, last)
        return held[first, last]

    return part


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
    max_bytes : int [byte]
        Largest memory that may be needed.
    guard : Guard
        Loads the library, and is entered already.
    closing : ExitStack
        Closes whatever the reader adds to it, before the file itself is closed.
    """

    path: Path
    file: BinaryIO
    name: str
    max_bytes: int
    guard: Guard
    closing: ExitStack


class Content(ABC):
    """The channels of an open file; a format adds how they are described and read.

    Attributes
    ----------
    places : sequence of Place
        Group and name of each channel.
    sample_bytes : int [byte]
        Memory that each sample of a channel needs which is read whole.
    """

    places: Sequence[Place] = ()
    sample_bytes = 16

    def __init__(self, opened: OpenFile) -> None:
        self._file, self._name, self._max_bytes = opened.file, opened.name, opened.max_bytes

    @abstractmethod
    def info(self) -> FileInfo:
        """The description of the file and its channels."""

    @abstractmethod
    def track(self, index: int) -> Track:
        """The channel of an index in `places`; TableError if it cannot be read."""

    def tracks(self, request: Request, *, whole: bool) -> list[Track]:
        """The channels of a request; if `whole`, FileError if all their samples together need too much memory."""
        tracks = [self.track(index) for index in find(self.places, request)]
        if whole:
            afford(self.sample_bytes * sum(one.count for one in tracks), self._max_bytes, self._name)
        return tracks


def track_format(
    module: str,
    name: str,
    endings: tuple[str, ...],
    kind: str,
    content: Callable[[OpenFile], Content],
    *,
    by_library: bool = False,
) -> Format:
    """The format of a module, whose channels can be read in any part; `kind` is that of its `Guard`."""

    @contextmanager
    def opened(path: Path, label: str, guard: Guard, max_bytes: int) -> Iterator[Content]:
        with ExitStack() as closing:
            file = closing.enter_context(open_regular(path, max_bytes=MAX_FILE_BYTES, label=label))
            name = name_of(path, label)
            if not BEGINS[module](file.read(HEAD_BYTES)):
                raise TableError(f"{name}: is not {kind}: it does not begin as one; check what wrote it")
            file.seek(0)
            with path_for_library(path, file, label=name) as same:
                yield content(OpenFile(same, file, name, max_bytes, guard, closing))

    def survey(path: Path, label: str, max_bytes: int) -> FileInfo:
        guard = Guard(name_of(path, label), kind)
        with guard, opened(path, label, guard, max_bytes) as found:
            return found.info()

    def read(request: Request) -> list[Signal]:
        guard = Guard(name_of(request.path, request.label), kind)
        with guard, opened(request.path, request.label, guard, request.max_bytes) as found:
            return [one.part(0, one.count) for one in found.tracks(request, whole=True)]

    def chunks(request: Request, rows: int, guard: Guard) -> Generator[list[Signal]]:
        with opened(request.path, request.label, guard, request.max_bytes) as found:
            yield from in_step(found.tracks(request, whole=False), rows)

    def blocks(request: Request, rows: int) -> Iterator[list[Signal]]:
        guard = Guard(name_of(request.path, request.label), kind)
        return guarded(chunks(request, rows, guard), guard)

    return Format(name, endings, survey, read, blocks, by_library)
