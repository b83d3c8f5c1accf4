"""What a writer is told of a recording before its samples come, and how they come."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from fourpole.core.arrays import ByValue
from fourpole.units import column_unit

__all__ = ["Block", "Group", "Sink", "Told", "Track", "Writer", "distinct", "time_name", "titled"]

FloatArray = NDArray[np.float64]

#: Of a step: what no one misses of a time.
_EXACT = 1e-6


@dataclass(frozen=True)
class Track:
    """A channel that is to be written."""

    name: str
    unit: str | None
    note: str = ""


@dataclass(frozen=True)
class Group:
    """Channels that are sampled at the same times.

    Attributes
    ----------
    name : str
        Of the group in the file that is read; several may have the same.
    tracks : tuple of Track
    rate, start : float or None, float [Hz], [s]
        Of even times. None: they are not even, or not known.
    stamped : bool
        Whether each block has its times, as the file that is read states them.
    count : int
        Samples of a channel, as far as is known before.
    off : float [s]
        How far the times that the file states are from those of the rate.
    """

    name: str
    tracks: tuple[Track, ...]
    rate: float | None
    start: float
    stamped: bool
    count: int
    off: float = 0.0

    @property
    def timed(self) -> bool:
        """Whether it is known when the samples were taken."""
        return self.stamped or self.rate is not None

    @property
    def words(self) -> str:
        """What it is, for messages."""
        names = ", ".join(track.name for track in self.tracks[:6]) + (", ..." if len(self.tracks) > 6 else "")
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
        """When they were taken [s]; None where that is not known."""
        if self.stamps is not None or group.rate is None:
            return self.stamps
        return group.start + (self.first + np.arange(len(self))) / group.rate


class Sink(Protocol):
    """What takes samples."""

    def add(self, at: int, block: Block, /) -> None:
        """Take the next samples of the group of this number."""


@dataclass
class Told:
    """What is known of the whole, and what is to be said of the file that is written.

    Attributes
    ----------
    notes : tuple of str
        Of the file that is read.
    lost : list of str
        Sentences on what is changed or cannot be kept; writers add theirs before the first sample comes.
    """

    notes: tuple[str, ...] = ()
    lost: list[str] = field(default_factory=list)

    def renamed(self, before: Sequence[str], after: Sequence[str]) -> None:
        """Say which names were changed."""
        for old, new in zip(before, after, strict=True):
            if old != new:
                self.lost.append(f"{old} is called {new} there")

    def by_rate(self, group: Group) -> None:
        """Say that a rate stands for times, where that changes them."""
        if group.stamped and group.rate is not None and group.off * group.rate > _EXACT:
            said = f"{group.rate:.10g} Hz from {group.start:.10g} s on, up to {group.off:.2g} s off"
            self.lost.append(f"the times are kept as a rate: {said}")

    def no_notes(self, tracks: Iterable[Track]) -> None:
        """Say that notes are lost."""
        said = len(self.notes), sum(bool(track.note) for track in tracks)
        what = [f"{count} {name}" for count, name in zip(said, ("of the file", "of channels"), strict=True) if count]
        if what:
            self.lost.append(f"notes are not kept ({' and '.join(what)})")


@dataclass(frozen=True)
class Writer:
    """A format that recordings are written in.

    Attributes
    ----------
    kind, name : str
        As on the command line, and in words.
    endings : tuple of str
    one_table : bool
        Whether all channels must have the same times.
    open : callable
        A Sink of (path, groups, told), to be entered; the file is complete when it is left.
    """

    kind: str
    name: str
    endings: tuple[str, ...]
    one_table: bool
    open: Callable[[Path, Sequence[Group], Told], AbstractContextManager[Sink]]


def distinct(names: Sequence[str], taken: Iterable[str] = (), longest: int = 1000) -> list[str]:
    """Names of which none is there twice in whatever case: later ones get a number."""
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


def titled(track: Track) -> str:
    """A channel's name with its unit in brackets."""
    bare, own = column_unit(track.name)
    unit = track.unit or own
    return f"{bare} [{unit}]" if unit else bare


def time_name(tracks: Sequence[Track]) -> str:
    """What the column of times is called: t, where no channel is called so."""
    taken = {column_unit(track.name)[0].casefold() for track in tracks}
    return next(name for name in ("t", "time", *(f"time_{at}" for at in range(2, 1000))) if name not in taken)
