"""The input of a writer: groups of channels, then blocks of samples; and its remarks on what is not kept."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fourpole.core.arrays import ByValue
from fourpole.errors import TableError
from fourpole.units import column_unit

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
        return group.start + (self.first + np.arange(len(self))) / group.rate

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
