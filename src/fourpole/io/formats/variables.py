"""Files of named variables, as MATLAB and NumPy write them: vectors, columns of matrices and fields as channels.

If the only matrix of a struct, or of the top of the file, has beside it an array with a text per column, the texts are
the names (`names`, `labels`, `channels`, ...) or the units (`units`, ...) of the columns. Two such arrays beside
vectors, or in a struct beside them (`channel.name`, `channel.units`), give the units of the vectors.

The times of a channel are a vector or column beside it that is called `t` or `time` (also `Time`, `zeit`) and has the
same length. If there is none, its rate is a number beside or above it called `fs`, `rate`, `sample_rate`, ..., or the
step `dt`, `Ts`.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from fourpole.core.arrays import ByValue
from fourpole.io.formats.guard import is_time, of_name, seconds, tidy, time_scale
from fourpole.io.formats.tracks import Content, OpenFile, Part, Track, remembered
from fourpole.io.signals import FileInfo, Request, SignalInfo

LONGEST_TEXT = 1000
MOST_TEXTS = 4096


@dataclass(eq=False)
class Node(ByValue):
    """A variable, a field of a struct or a cell."""

    name: str
    kind: str = "other"
    """numbers, text, cells, struct or other."""
    dims: tuple[int, ...] = ()
    value: float | str | None = None
    """The value of a single number or a short text."""
    below: list[Node] = field(default_factory=list)
    samples: Any = None
    """What the reader of the format takes the numbers from."""
    unit: str | None = None
    """The unit that its type states: "s" for points in time and durations."""
    numbered: tuple[str, str] = ("[:,{}]", "[{},:]")
    """What a column and a row of a matrix are called after the name of the matrix, counted from 1."""

    @property
    def texts(self) -> list[str] | None:
        """The texts of a cell array; None if it has any cell that is no text."""
        found = [one.value for one in self.below if isinstance(one.value, str)]
        return found if self.kind == "cells" and found and len(found) == len(self.below) else None

    @property
    def is_table(self) -> bool:
        """Whether it is a matrix of numbers with several rows and columns."""
        return self.kind == "numbers" and len(self.dims) == 2 and min(self.dims) > 1

    @property
    def is_vector(self) -> bool:
        """Whether it is a single row or column of several numbers."""
        return self.kind == "numbers" and len(self.dims) == 2 and min(self.dims) == 1 and max(self.dims) > 1


_RATES = re.compile(r"(?:fs|f_s|rate|sample_?rate|sampling_?rate|sampling_?frequency|samp_?freq)", re.IGNORECASE)
_STEPS = re.compile(r"(?:dt|ts|delta_?t|increment|sample_?time|sampling_?time)", re.IGNORECASE)
_NAMES = re.compile(r"name|label|channel|signal|header|column|title", re.IGNORECASE)
_UNITS = re.compile(r"unit|einheit|dimension", re.IGNORECASE)


@dataclass(frozen=True)
class Channel:
    """The place of the samples of a channel, its unit and its time base."""

    name: str
    unit: str | None
    path: tuple[str, ...]
    node: Node
    column: int | None
    count: int
    rate: float | None = None
    time: Channel | None = None

    @property
    def place(self) -> tuple[tuple[str, ...], int | None]:
        """Its variable and fields, and its column: what no other channel has, even one of the same name."""
        return self.path, self.column


def channels_within(nodes: Sequence[Node], path: tuple[str, ...], above: float | None) -> Iterator[Channel]:
    """The channels of a struct, or of the top of the file; `above` is the rate that a struct above states [Hz]."""
    rate = _rate(nodes) or above
    found = list(_channels_of(nodes, path))
    times = [one for one in found if one.node.unit == "s"] or [one for one in found if is_time(one.name)]
    for channel in found:
        time = next((other for other in times if other.count == channel.count), None)
        if channel in times:
            yield channel
        else:
            yield replace(channel, rate=None if time else rate, time=time)
    for one in nodes:
        if one.kind == "struct":
            yield from channels_within(one.below, (*path, one.name), rate)


def _channels_of(nodes: Sequence[Node], path: tuple[str, ...]) -> Iterator[Channel]:
    """The vectors and columns among some nodes, without their times."""
    tables = [one for one in nodes if one.is_table]
    unit = _only_text(nodes, _UNITS) if sum(one.is_vector for one in nodes) == 1 else None
    named = _units_by_name(nodes)
    for one in nodes:
        called = ".".join(filter(None, [*path, one.name]))
        if one.is_vector:
            stated = of_name(one.name, one.unit or unit or named.get(one.name))
            yield Channel(called, stated, (*path, one.name), one, None, max(one.dims))
        elif one.is_table:
            yield from _columns(one, called, path, nodes if len(tables) == 1 else ())


def _columns(one: Node, called: str, path: tuple[str, ...], beside: Sequence[Node]) -> Iterator[Channel]:
    long, wide = one.dims[0] >= one.dims[1], min(one.dims)
    if wide > MOST_TEXTS:
        return
    named = _texts(beside, _NAMES, wide)
    units = _texts(beside, _UNITS, wide)
    for column in range(wide):
        bare = called + one.numbered[0 if long else 1].format(column + 1)
        name = named[column] if named and named[column] else bare
        unit = of_name(name if named else "", units[column] if units else None)
        yield Channel(name, unit, (*path, one.name), one, column, max(one.dims))


def _texts(nodes: Sequence[Node], wanted: re.Pattern[str], count: int) -> list[str] | None:
    """The texts beside a matrix, one per column, in an array of a wanted name; None if there is none."""
    for one in nodes:
        texts = one.texts
        if texts is not None and len(texts) == count and wanted.search(one.name):
            return texts
    return None


def _units_by_name(nodes: Sequence[Node]) -> dict[str, str]:
    """Units of vectors by their names, if two cell arrays beside them, or in a struct beside them, list both."""
    vectors = {one.name for one in nodes if one.is_vector}
    for place in (nodes, *(one.below for one in nodes if one.kind == "struct")):
        lists = [(one.name, texts) for one in place if (texts := one.texts)]
        units = next((texts for name, texts in lists if _UNITS.search(name)), [])
        names = next((texts for name, texts in lists if _NAMES.search(name) and len(texts) == len(units)), [])
        if not vectors.isdisjoint(names):
            return dict(zip(names, units, strict=True))
    return {}


def _only_text(nodes: Sequence[Node], wanted: re.Pattern[str]) -> str | None:
    return next((one.value for one in nodes if isinstance(one.value, str) and wanted.search(one.name)), None)


def _rate(nodes: Sequence[Node]) -> float | None:
    """The rate that a number among the nodes states [Hz]; None if there is none."""
    for pattern, invert in ((_RATES, False), (_STEPS, True)):
        for one in nodes:
            value = one.value
            if isinstance(value, float) and pattern.fullmatch(one.name) and np.isfinite(value) and value > 0:
                return 1.0 / value if invert else value
    return None


class Variables(Content):
    """The channels of an open file of named variables; a format adds how the numbers of a channel are read.

    Attributes
    ----------
    format : str
        Name and version of the format.
    notes : sequence of str
        Statements on the file beside those of its variables.
    in_parts : bool
        Whether a part of a channel is read without the rest of it.
    """

    format: str
    notes: Sequence[str] = ()
    in_parts = False

    def __init__(self, opened: OpenFile, variables: Sequence[Node]) -> None:
        super().__init__(opened)
        self._variables, self._channels = variables, list(channels_within(variables, (), None))
        self.places = [("", one.name) for one in self._channels]
        self._times: dict[tuple[tuple[str, ...], int | None], Part] = {}

    def reader(self, one: Channel, /) -> Part:
        """The function that reads a part of a channel."""
        raise NotImplementedError

    def info(self) -> FileInfo:
        """The description of the file and its channels."""
        times = {one.time.place: self._ends(one.time) for one in self._channels if one.time is not None}
        signals = []
        for one in self._channels:
            ends = times[one.time.place] if one.time is not None else None
            note = f"time from {tidy(one.time.name)}" if one.time else ""
            signals.append(SignalInfo.timed(one.name, one.unit, "", one.count, rate=one.rate, ends=ends, note=note))
        notes = list(self.notes)
        notes += [f"{tidy(one.name)}: {tidy(one.value)}" for one in self._variables if one.value is not None][:20]
        return FileInfo(self.format, tuple(signals), tuple(notes))

    def _ends(self, time: Channel) -> tuple[float, float] | None:
        """First and last time [s]; None if they are not finite, or their unit is none of time."""
        scale, part = seconds(time.unit), self.reader(time)
        if scale is None or not time.count:
            return None
        ends = float(part(0, 1)[0]), float(part(time.count - 1, time.count)[0])
        return (ends[0] * scale, ends[1] * scale) if np.isfinite(ends).all() else None

    def tracks(self, request: Request, *, whole: bool) -> list[Track]:
        """The channels of a request; a format that does not read in parts holds all their samples in any case."""
        return super().tracks(request, whole=whole or not self.in_parts)

    def track(self, index: int) -> Track:
        """A channel; those with the same times share the function that reads them."""
        one, time = self._channels[index], self._channels[index].time
        if time is not None and time.place not in self._times:
            scale, values = time_scale(time.unit, time.name, self._name), self.reader(time)
            self._times[time.place] = remembered(lambda first, last: scale * values(first, last))
        seconds_of = None if time is None else self._times[time.place]
        return Track(one.name, one.unit, one.count, self.reader(one), one.rate, 0.0, seconds_of)
