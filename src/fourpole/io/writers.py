"""Writers of recordings: groups of channels, then blocks of samples, and remarks on what is not kept.

ASAM MDF 4.10 has a channel group per time base, whose master has the times. CSV and Parquet have a column of times,
names with their units in brackets, and numbers with all their digits.
"""

from __future__ import annotations

import datetime as dt
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fourpole.core.arrays import ByValue
from fourpole.errors import TableError
from fourpole.io.formats.guard import need
from fourpole.units import column_unit

if TYPE_CHECKING:
    import polars as pl


FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class WrittenChannel:
    """Name, unit and note of a channel that is to be written."""

    name: str
    unit: str | None
    note: str = ""


@dataclass(frozen=True)
class Group:
    """Channels that are sampled at the same times.

    Attributes
    ----------
    name : str
        Name of the group in the file that is read; several groups may have the same name.
    channels : tuple of WrittenChannel
        The channels of the group; at least one.
    rate, start : float or None, float [Hz], [s]
        Rate and first time of even times. None if the times are not even, or not known.
    stamped : bool
        Whether each block has the times that the file states.
    count : int
        Samples of a channel, as the header of the file states them.
    """

    name: str
    channels: tuple[WrittenChannel, ...]
    rate: float | None
    start: float
    stamped: bool
    count: int

    @property
    def timed(self) -> bool:
        """Whether the times of the samples are known."""
        return self.stamped or self.rate is not None

    def even(self, first: int, count: int) -> FloatArray:
        """The times of some samples by the rate [s]."""
        return self.start + (first + np.arange(count)) / (self.rate or np.nan)

    @property
    def words(self) -> str:
        """Samples, rate and channels of the group, as a phrase for messages."""
        names = ", ".join(channel.name for channel in self.channels[:6]) + (", ..." if len(self.channels) > 6 else "")
        when = f"at {self.rate:.10g} Hz" if self.rate else "at uneven times" if self.stamped else "without times"
        return f"{f'{self.name}: ' if self.name else ''}{self.count} samples {when} ({names})"


@dataclass(frozen=True, eq=False)
class Block(ByValue):
    """The next samples of a group: those from number `first` on."""

    first: int
    columns: list[FloatArray]
    stamps: FloatArray | None

    def __len__(self) -> int:
        return len(self.columns[0]) if self.columns else 0

    def times(self, group: Group) -> FloatArray | None:
        """The times of the samples [s]; None if they are not known."""
        if self.stamps is not None or group.rate is None:
            return self.stamps
        return group.even(self.first, len(self))

    def table(self, group: Group) -> list[FloatArray]:
        """The columns of a table: the times, if they are known, then the channels."""
        times = self.times(group)
        return self.columns if times is None else [times, *self.columns]


Add = Callable[[int, Block], None]
"""Writes the next samples of a group, by the group's number, into a file that is open."""


@dataclass
class Remarks:
    """The notes of the file that is read, and remarks on what the written file changes or does not keep.

    Attributes
    ----------
    notes : tuple of str
        Notes of the file that is read.
    lost : list of str
        Sentences on what is changed or not kept; a writer adds its own before the first sample.
    """

    notes: tuple[str, ...] = ()
    lost: list[str] = field(default_factory=list)

    def renamed(self, before: Sequence[str], after: Sequence[str]) -> None:
        """Add a remark on each name that differs after the change."""
        for old, new in zip(before, after, strict=True):
            if old != new:
                self.lost.append(f"{old} is called {new} there")

    def no_notes(self, channels: Iterable[WrittenChannel]) -> None:
        """Add a remark that notes are not kept, if there are any."""
        counts = len(self.notes), sum(bool(channel.note) for channel in channels)
        what = [f"{count} {name}" for count, name in zip(counts, ("of the file", "of channels"), strict=True) if count]
        if what:
            self.lost.append(f"notes are not kept ({' and '.join(what)})")


@dataclass(frozen=True)
class Writer:
    """A format in which recordings are written.

    Attributes
    ----------
    kind, name : str
        Name on the command line, and name in messages.
    endings : tuple of str
        Endings of a file's name that select this writer.
    one_table : bool
        Whether all channels must have the same times.
    open : callable
        Takes path, groups and remarks, and returns a context with an `Add`; the file is complete when the context ends.
    """

    kind: str
    name: str
    endings: tuple[str, ...]
    one_table: bool
    open: Callable[[Path, Sequence[Group], Remarks], AbstractContextManager[Add]]


def distinct(names: Sequence[str], taken: Iterable[str] = (), longest: int = 1000) -> list[str]:
    """The names, cut to `longest`; a number is appended to a name that is taken or repeated, in any case."""
    seen = {one.casefold() for one in taken}
    result = []
    for name in names:
        number, new = 1, name[:longest]
        while new.casefold() in seen:
            number += 1
            new = f"{name[: longest - 1 - len(str(number))]}_{number}"
        seen.add(new.casefold())
        result.append(new)
    return result


def titled(channel: WrittenChannel) -> str:
    """A channel's name with its unit in brackets."""
    bare, own = column_unit(channel.name)
    unit = channel.unit or own
    return f"{bare} [{unit}]" if unit else bare


def time_name(channels: Sequence[WrittenChannel]) -> str:
    """Name of the column of times: t, or else time, time_2, ..., so that no channel has it."""
    taken = {column_unit(channel.name)[0].casefold() for channel in channels}
    return next(name for name in ("t", "time", *(f"time_{at}" for at in range(2, 1000))) if name not in taken)


def check_timed(groups: Sequence[Group], path: Path, name: str) -> None:
    """TableError if a group has no times, for a format that needs them."""
    for group in groups:
        if not group.timed:
            raise TableError(f"{path.name}: {name} needs times, and these have none: {group.words}; write .csv")


@contextmanager
def _open_mdf(path: Path, groups: Sequence[Group], remarks: Remarks) -> Iterator[Add]:
    asammdf = need("asammdf", path.name, "an ASAM MDF file")
    check_timed(groups, path, "MDF")
    for group in groups:
        names = [channel.name for channel in group.channels]
        remarks.renamed(names, distinct(names, [time_name(group.channels)]))
    named = [group.name[:60] for group in groups]
    if len(groups) > 1:
        named = [name or "recording" for name in named]
    names = distinct(named)
    remarks.renamed(named, names)
    with asammdf.MDF(version="4.10") as mdf:
        mdf.header.start_time = dt.datetime(1970, 1, 1, tzinfo=dt.UTC)  # the date of the recording is not known
        mdf.header.comment = "\n".join(remarks.notes)
        places: dict[int, int] = {}

        def add(number: int, block: Block) -> None:
            group = groups[number]
            times = np.ascontiguousarray(block.times(group))
            if number in places:
                parts = [(np.ascontiguousarray(part), None) for part in (times, *block.columns)]
                mdf.extend(places[number], parts)
                return
            master = (time_name(group.channels), 1)
            places[number] = len(mdf.groups)
            called = distinct([channel.name for channel in group.channels], [master[0]])
            signals = [
                asammdf.Signal(
                    samples, times, unit=channel.unit or "", name=name, comment=channel.note, master_metadata=master
                )
                for name, channel, samples in zip(called, group.channels, block.columns, strict=True)
            ]
            mdf.append(signals, acq_name=names[number] or None, common_timebase=True)

        yield add
        mdf.save(path.with_suffix(".mf4"), overwrite=True)
    path.with_suffix(".mf4").rename(path)


MDF = Writer("mf4", "ASAM MDF 4.10", (".mf4",), False, _open_mdf)


def _heads(group: Group, remarks: Remarks) -> list[str]:
    """The heads of a table's columns; the first is that of the times, if they are known."""
    remarks.no_notes(group.channels)
    heads = [titled(channel) for channel in group.channels]
    found = distinct(heads)
    remarks.renamed(heads, found)
    return [f"{time_name(group.channels)} [s]", *found] if group.timed else found


def _frame(heads: Sequence[str], block: Block, group: Group) -> pl.DataFrame:
    import polars as pl

    return pl.DataFrame(dict(zip(heads, block.table(group), strict=True)))


@contextmanager
def _open_csv(path: Path, groups: Sequence[Group], remarks: Remarks) -> Iterator[Add]:
    heads = _heads(groups[0], remarks)
    with path.open("wb") as file:

        def add(_number: int, block: Block) -> None:
            frame = _frame(heads, block, groups[0]).fill_nan(None)
            frame.write_csv(file, include_header=block.first == 0)

        yield add


@contextmanager
def _open_parquet(path: Path, groups: Sequence[Group], remarks: Remarks) -> Iterator[Add]:
    """Each block goes to a file of its own, and the files are joined at the end: polars cannot append to a file."""
    import polars as pl

    heads = _heads(groups[0], remarks)
    parts: list[Path] = []

    def add(_number: int, block: Block) -> None:
        part = path.with_name(f"{path.name}.{len(parts)}")
        _frame(heads, block, groups[0]).write_parquet(part)
        parts.append(part)

    yield add
    if len(parts) == 1:
        parts[0].rename(path)
    elif parts:
        pl.scan_parquet(parts, glob=False).sink_parquet(path, maintain_order=True)


CSV = Writer("csv", "CSV", (".csv",), True, _open_csv)
PARQUET = Writer("parquet", "Parquet", (".parquet", ".pq"), True, _open_parquet)
