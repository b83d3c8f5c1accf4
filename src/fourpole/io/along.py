"""Recordings along their time: some channels of a file, stretch by stretch, each with the times it has."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fourpole.errors import TableError
from fourpole.io.formats.guard import is_time, listed, seconds
from fourpole.io.recordings import format_of
from fourpole.io.signals import MAX_FILE_BYTES, FileInfo, Request, Signal, SignalInfo
from fourpole.units import column_unit, shown

__all__ = ["Along", "along", "chosen_of", "times_of"]

_MOST_MEMORY = 2_000_000_000
#: Samples of a stretch, all channels together: 32 MB.
_AT_ONCE = 1 << 22
_LEAST_ROWS = 1 << 10
_EVEN = 1e-3
_TIME_OF_DAY = "times of day"


@dataclass(frozen=True)
class Along:
    """Some channels of a file, to be gone through once.

    Attributes
    ----------
    clocks : dict of int to int
        Of channels, by their places in `FileInfo.signals`, whose times a column of the file says: its place.
    stretches : iterator of list of Signal
        Each time one Signal per channel, in the order asked for, with its next samples; those whose times a column
        says have them as `time`. There is one stretch at least.
    """

    clocks: dict[int, int]
    stretches: Iterator[list[Signal]]


def along(path: Path, found: FileInfo, chosen: Sequence[int], *, label: str) -> Along:
    """Go through some channels of a file, with bounded memory where its format can be read in part.

    Parameters
    ----------
    path : Path
    found : FileInfo
        What `survey` says of it.
    chosen : sequence of int
        Places of the channels in `found.signals`.
    label : str
        The file's name in messages.

    Raises
    ------
    FileError, TableError
        If a channel cannot be read; also while the stretches are taken.
    """
    kind = format_of(path, max_bytes=MAX_FILE_BYTES, label=label)
    stated = {one: _stated_clocks(found.signals, found.signals[one]) for one in chosen}
    asked = list(dict.fromkeys([*chosen, *(clock for clocks in stated.values() for clock in clocks)]))
    if kind.name == "text" and found.signals and not any(stated.values()) and 0 not in asked:
        asked.append(0)
    names = tuple(_called(found.signals, one) for one in asked)
    request = Request(path, names, "", label, _MOST_MEMORY)
    rows = max(_LEAST_ROWS, _AT_ONCE // max(len(names), 1))
    several = kind.blocks(request, rows) if kind.blocks is not None else iter([kind.read(request)])
    first = dict(zip(asked, next(iter(several)), strict=True))
    clocks = {one: _clock(one, first, found, stated[one], guess=kind.name == "text") for one in chosen}
    known = {one: clock for one, clock in clocks.items() if clock is not None}
    rest = (dict(zip(asked, several_more, strict=True)) for several_more in several)
    return Along(known, (_timed(part, chosen, known, label) for part in chain([first], rest)))


def _called(signals: Sequence[SignalInfo], at: int) -> str:
    """The name that means this channel alone, where groups repeat names."""
    one = signals[at]
    return f"{one.group}/{one.name}" if any(other.group for other in signals) else one.name


def _stated_clocks(signals: Sequence[SignalInfo], one: SignalInfo) -> list[int]:
    """Places of the channels that by name or unit are the time of another, the likeliest first."""
    beside = [at for at, other in enumerate(signals) if (other.group, other.count) == (one.group, one.count)]
    timely = [at for at in beside if seconds(signals[at].unit) is not None]
    of_day = [at for at in timely if signals[at].note.startswith(_TIME_OF_DAY)]
    named = [at for at in timely if is_time(signals[at].name)]
    return [*of_day, *named, *(at for at in timely if signals[at].unit)][:1]


def times_of(signal: Signal) -> NDArray[np.float64] | None:
    """The time of each sample of a stretch [s]; None where it is not known."""
    if signal.time is not None:
        return signal.time
    return signal.start + np.arange(signal.samples.size) / signal.rate if signal.rate else None


def _clock(at: int, first: dict[int, Signal], found: FileInfo, stated: Sequence[int], *, guess: bool) -> int | None:
    """Which column says the times of a channel, seen that it rises."""
    own = times_of(first[at])
    for one in stated:
        values = first[one].samples * (seconds(found.signals[one].unit) or 1.0)
        if own is None and _rises(values):
            return one
        if own is not None and values.size == own.size and np.allclose(values, own, rtol=1e-12, atol=0.0):
            return one
    if own is None and guess and not stated and 0 in first and found.signals[0].unit is None:
        steps = np.diff(first[0].samples)
        middle = float(np.median(steps)) if steps.size else 0.0
        # a column that rises by whole numbers may count the rows
        if 0 < middle < 1 and np.all(np.abs(steps - middle) <= _EVEN * middle):
            return 0
    return None


def _rises(values: NDArray[np.float64]) -> bool:
    """Whether a column goes forward as times do, but for a few lost or repeated ones."""
    if values.size < 2:
        return values.size == 1
    return bool(np.mean(np.diff(values) >= 0) > 0.9 and values[-1] > values[0])


def _timed(part: dict[int, Signal], chosen: Sequence[int], clocks: dict[int, int], label: str) -> list[Signal]:
    timed = []
    times: dict[int, NDArray[np.float64]] = {}
    for one in chosen:
        signal = part[one]
        if one in clocks and times_of(signal) is None:
            clock = part[clocks[one]]
            if clock.samples.size != signal.samples.size:
                raise TableError(f"{label}: {shown(signal.name)} has not as many samples as {shown(clock.name)}")
            time = times.setdefault(clocks[one], clock.samples * (seconds(clock.unit) or 1.0))
            signal = replace(signal, time=time, start=float(time[0]) if time.size else 0.0)
        timed.append(signal)
    return timed


def chosen_of(found: FileInfo, group: str, names: Sequence[str], label: str) -> list[int]:
    """Places of the channels of a group, of all where it is empty, or of those that are named.

    A name is taken as written, with its group as in `group/name`, in another case, or without its unit; TableError
    where there is none.
    """
    signals = found.signals
    places = list(range(len(signals)))
    if group:
        places = [at for at in places if signals[at].group == group]
        places = places or [at for at, one in enumerate(signals) if one.group.casefold() == group.casefold()]
        if not places:
            known = list(dict.fromkeys(one.group for one in signals if one.group))
            none = f"{label}: has no groups; leave out {shown(group)}"
            raise TableError(f"{label}: there is no group {shown(group)}{listed(known, group)}" if known else none)
    chosen: list[int] = []
    for wanted in names:
        same = _named(signals, places, wanted)
        if not same:
            there = listed([signals[at].name for at in places], wanted)
            raise TableError(f"{label}: there is no channel {shown(wanted)}{there}")
        chosen += same
    return list(dict.fromkeys(chosen)) if names else places


def _named(signals: Sequence[SignalInfo], places: Sequence[int], wanted: str) -> list[int]:
    ways: list[list[int]] = [[], [], []]
    bare = column_unit(wanted)[0].casefold()
    for at in places:
        one = signals[at]
        both = (one.name, f"{one.group}/{one.name}")
        ways[0] += [at] * (wanted in both)
        ways[1] += [at] * (wanted.casefold() in (text.casefold() for text in both))
        ways[2] += [at] * (column_unit(one.name)[0].casefold() == bare)
    return next((way for way in ways if way), [])
