"""A recording as a stream of chunks: channels of a file in successive parts of the time, with their times.

The time base of a recording is reconciled only here. The times come from a stated rate, a stated column, the file
itself, or a column whose name or unit is that of a time.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path
from typing import Literal, TypeVar

import numpy as np
from numpy.typing import NDArray

from fourpole import units
from fourpole.errors import FileError, FourpoleError, TableError, UnitError
from fourpole.io.formats.guard import is_time, seconds
from fourpole.io.recordings import format_of
from fourpole.io.signals import MAX_FILE_BYTES, FileInfo, Format, Request, Signal, SignalInfo
from fourpole.units import shown

FloatArray = NDArray[np.float64]
Result = TypeVar("Result")

Chunk = list[Signal]
"""The next samples of each channel, in the order of the request, with their times if these are known."""

#: A file up to this size is read whole without a survey of its channels [byte].
_SMALL = 20_000_000
#: Channels up to the first size are read whole; a request that needs more memory than the second is refused [byte].
_WHOLE, _MOST_MEMORY = 200_000_000, 2_000_000_000
#: Rows of a chunk of a long file: 8 MB per channel.
_ROWS = 1 << 20
#: Samples of a chunk of a surveyed stream: all channels together (32 MB), and the least number of each channel.
_AT_ONCE, _LEAST_ROWS = 1 << 22, 1 << 10
#: Largest relative difference between a stated rate and the file's own.
_SAME_RATE = 1e-4
#: Largest relative difference between two steps of a column that has no unit and counts the time.
_EVEN = 1e-3
_TIME_OF_DAY = "times of day"


@dataclass(frozen=True)
class StreamSource:
    """The channels to read from a recording, and what campaign.toml states of their times.

    Attributes
    ----------
    path : Path
        The file.
    names : tuple of str
        The channels.
    label : str
        The file's name in messages.
    group : str
        The group, if the file has several recordings.
    rate : float or None [Hz]
        Stated rate, which replaces the times of the file.
    clock, unit : str or None, str
        Stated column of the times, and its unit; a file that states its own times need not have the column.
    needs : {"times", "order", "nothing"}
        "times": every channel needs its times. "order": channels with equal counts need no times, since they were
        sampled row by row. "nothing": times are given if they are known.
    rows : int
        Largest number of samples of a channel in a chunk; 0 leaves the choice to the stream.
    """

    path: Path
    names: tuple[str, ...]
    label: str
    group: str = ""
    rate: float | None = None
    clock: str | None = None
    unit: str = "s"
    needs: Literal["times", "order", "nothing"] = "times"
    rows: int = 0


@dataclass(frozen=True)
class Stream:
    """Chunks of some channels, which can be iterated once; there is at least one chunk.

    Attributes
    ----------
    count : int
        Number of samples of the longest channel; 0 if the recording is one chunk, and for a surveyed stream.
    chunks : iterator of Chunk
        The recording from its beginning to its end.
    clocks : dict of int to int
        For a surveyed stream: index of the column that states the times of a channel, by the index of the channel.
    """

    count: int
    chunks: Iterator[Chunk]
    clocks: dict[int, int]


def times_of(signal: Signal) -> FloatArray | None:
    """The time of each sample of a chunk [s]; None if the times are not known."""
    if signal.time is not None:
        return signal.time
    return signal.start + np.arange(signal.samples.size) / signal.rate if signal.rate else None


def _timeless(signals: Iterable[Signal]) -> bool:
    """Whether the file states the times of none of the signals."""
    return all(one.rate is None and one.time is None for one in signals)


# --- channels by name, with the times that campaign.toml states -------------------------------------------------------


def stream(source: StreamSource) -> Stream:
    """The named channels of a recording: one chunk if they need little memory, or else one chunk after the other.

    Raises
    ------
    FileError, TableError
        If the file cannot be read, lacks a channel, does not fit into memory and cannot be read in parts, or if
        the times that are needed are neither stated nor known.
    """
    kind = format_of(source.path, max_bytes=MAX_FILE_BYTES, label=source.label)
    names = tuple(dict.fromkeys(source.names))
    if kind.name == "text" and source.clock is not None:
        names = tuple(dict.fromkeys([*names, source.clock]))
    count, chunks = _read(kind, source, names)
    first = next(chunks)
    if source.clock is not None and source.clock not in names and _timeless(first):
        names = (*names, source.clock)
        count, chunks = _read(kind, source, names)
        first = next(chunks)
    return Stream(count, _reconciled(chain([first], chunks), source, names, kind.name == "text"), {})


class ReadOnce:
    """Reads the channels of a recording once for all parts of it that are wanted one after the other.

    A recording that is read in chunks, because it needs much memory, is read again for each part.
    """

    def __init__(self) -> None:
        self._held: tuple[StreamSource, Chunk] | None = None

    def stream(self, source: StreamSource) -> Stream:
        """The named channels of a recording, as `stream` gives them."""
        if self._held is None or self._held[0] != source:
            run = stream(source)
            if run.count:
                return run
            self._held = source, next(run.chunks)
        return Stream(0, iter([self._held[1]]), {})


def _read(kind: Format, source: StreamSource, names: tuple[str, ...]) -> tuple[int, Iterator[Sequence[Signal]]]:
    """Number of samples of the longest channel (0 if it is one chunk), and the chunks with the times of the file."""
    request = Request(source.path, names, source.group, source.label, _MOST_MEMORY)
    if source.rows:
        return 0, kind.blocks(request, source.rows)
    count = _count(kind, source, names, least=_SMALL)
    if 8 * count * len(names) <= _WHOLE:
        try:
            return 0, iter([kind.read(replace(request, max_bytes=2 * _WHOLE))])
        except FourpoleError:  # a small file may unpack to a long recording, which is read in chunks
            count = _count(kind, source, names, least=0)
            if 8 * count * len(names) <= _WHOLE:
                raise
    return count, kind.blocks(request, _ROWS)


def _count(kind: Format, source: StreamSource, names: tuple[str, ...], *, least: int) -> int:
    """Number of samples of the longest named channel; 0 if the file has at most `least` bytes."""
    if source.path.stat().st_size <= least:
        return 0
    found = kind.survey(source.path, source.label, MAX_FILE_BYTES)
    inside = [one.count for one in found.signals if one.name in names and source.group in ("", one.group)]
    return max(inside or [one.count for one in found.signals], default=0)


def _reconciled(
    chunks: Iterable[Sequence[Signal]], source: StreamSource, names: Sequence[str], is_table: bool
) -> Iterator[Chunk]:
    """Chunks with reconciled times: stated times take precedence over those of the file."""
    done = dict.fromkeys(names, 0)
    for chunk in chunks:
        signals = dict(zip(names, chunk, strict=True))
        stamps = None
        if source.clock is not None and source.clock in signals:
            clock = signals[source.clock]
            if is_table or _timeless(chunk):
                stamps = clock.samples * units.unit_scale(agreed(source.clock, clock.unit, source.unit, "time"), "time")
        by_row = source.needs == "order" and len({one.samples.size for one in chunk}) == 1
        timed = []
        for name in source.names:
            signal = signals[name]
            if by_row:
                signal = replace(signal, rate=1.0, time=None)
            elif source.rate is not None:
                signal = _at_rate(signal, source.rate, done[name])
            elif stamps is not None:
                signal = replace(signal, time=stamps)
            elif source.needs != "nothing" and _timeless([signal]):
                raise TableError(
                    f"{source.label}: does not say when its samples were taken: state sample_rate, or the column "
                    "time, in [channels] of campaign.toml"
                )
            timed.append(signal)
        yield timed
        for name in names:
            done[name] += signals[name].samples.size


def _at_rate(signal: Signal, rate: float, done: int) -> Signal:
    """A signal at a stated rate; TableError if the file states another rate."""
    if signal.rate is not None and abs(signal.rate - rate) > _SAME_RATE * rate:
        raise TableError(
            f"{shown(signal.name)} was sampled at {signal.rate:.8g} Hz by the file, at {rate:.8g} Hz by "
            "campaign.toml: correct or leave out sample_rate in campaign.toml"
        )
    return replace(signal, rate=rate, start=done / rate, time=None)


def agreed(column: str, written: str | None, unit: str, kind: str) -> str:
    """The stated unit of a column; TableError if the file states another unit of the same kind."""
    if written is None or written == unit:
        return unit
    try:
        differs = units.channel_scale(written, (kind, "voltage")) != units.channel_scale(unit, (kind, "voltage"))
    except UnitError:
        differs = units.is_unit(written)
    if differs:
        raise TableError(
            f"column {shown(column)} is in {shown(written)} by the file, "
            f"in {shown(unit)} by campaign.toml: correct the unit in campaign.toml"
        )
    return unit


# --- channels by their indices in a survey, with the times of the file -----------------------------------------


def surveyed_stream(path: Path, found: FileInfo, chosen: Sequence[int], *, label: str) -> Stream:
    """Some channels of a surveyed file, in limited memory if its format can be read in parts.

    Parameters
    ----------
    path : Path
        The file.
    found : FileInfo
        Its description by `survey`.
    chosen : sequence of int
        Indices of the channels in `found.signals`.
    label : str
        The file's name in messages.

    Raises
    ------
    FileError, TableError
        If a channel cannot be read; also while the chunks are taken.
    """
    kind = format_of(path, max_bytes=MAX_FILE_BYTES, label=label)
    clocks = {one: at for one in chosen if (at := _stated_clock(found.signals, found.signals[one])) is not None}
    guess = kind.name == "text" and not clocks and bool(found.signals)
    asked = list(dict.fromkeys([*chosen, *clocks.values(), *([0] if guess else [])]))
    grouped = any(one.group for one in found.signals)  # groups may repeat names
    infos = [found.signals[at] for at in asked]
    names = tuple(f"{one.group}/{one.name}" if grouped else one.name for one in infos)
    rows = max(_LEAST_ROWS, _AT_ONCE // max(len(names), 1))
    blocks = kind.blocks(Request(path, names, "", label, _MOST_MEMORY), rows)
    chunks = (dict(zip(asked, chunk, strict=True)) for chunk in blocks)
    first = next(chunks)
    clocks = {one: at for one, at in clocks.items() if _is_clock(first[at], first[one])}
    if guess and found.signals[0].unit is None and _counts_time(first[0]):
        clocks = {one: 0 for one in chosen if _timeless([first[one]])}
    return Stream(0, (_timed(part, chosen, clocks, label) for part in chain([first], chunks)), clocks)


def by_halves(
    chosen: Sequence[int], read: Callable[[list[int]], Result]
) -> Iterator[tuple[list[int], Result | TableError | FileError]]:
    """The result of `read` for parts of the chosen channels, or the error of a single channel that cannot be read.

    A part that raises TableError or FileError is halved, so that one unreadable channel does not exclude the others.
    """
    waiting = [list(chosen)] if chosen else []
    while waiting:
        some = waiting.pop()
        result: Result | TableError | FileError
        try:
            result = read(some)
        except (TableError, FileError) as error:
            if len(some) > 1:
                half = len(some) // 2
                waiting += [some[half:], some[:half]]
                continue
            result = error
        yield some, result


def _stated_clock(signals: Sequence[SignalInfo], one: SignalInfo) -> int | None:
    """Index of the channel that by its note, name or unit has the times of a channel; None if there is none."""
    beside = [at for at, other in enumerate(signals) if (other.group, other.count) == (one.group, one.count)]
    timely = [at for at in beside if seconds(signals[at].unit) is not None]
    of_day = (at for at in timely if signals[at].note.startswith(_TIME_OF_DAY))
    named = (at for at in timely if is_time(signals[at].name))
    return next(chain(of_day, named, (at for at in timely if signals[at].unit)), None)


def _is_clock(clock: Signal, signal: Signal) -> bool:
    """Whether a column has the times of a channel: it rises, or equals the times that the file states."""
    own, values = times_of(signal), clock.samples * (seconds(clock.unit) or 1.0)
    if own is not None:
        return values.size == own.size and np.allclose(values, own, rtol=1e-12, atol=0.0)
    if values.size < 2:
        return bool(values.size == 1)
    # Up to a tenth of the steps may be lost or repeated samples.
    return bool(np.mean(np.diff(values) >= 0) > 0.9 and values[-1] > values[0])


def _counts_time(column: Signal) -> bool:
    """Whether a column rises by equal steps below 1; a column that rises by whole numbers may be a row number."""
    steps = np.diff(column.samples)
    middle = float(np.median(steps)) if steps.size else 0.0
    return 0 < middle < 1 and bool(np.all(np.abs(steps - middle) <= _EVEN * middle))


def _timed(part: dict[int, Signal], chosen: Sequence[int], clocks: dict[int, int], label: str) -> Chunk:
    timed = []
    times: dict[int, FloatArray] = {}
    for one in chosen:
        signal = part[one]
        if one in clocks and _timeless([signal]):
            clock = part[clocks[one]]
            if clock.samples.size != signal.samples.size:
                raise TableError(f"{label}: {shown(signal.name)} has not as many samples as {shown(clock.name)}")
            time = times.setdefault(clocks[one], clock.samples * (seconds(clock.unit) or 1.0))
            signal = replace(signal, time=time, start=float(time[0]) if time.size else 0.0)
        timed.append(signal)
    return timed
