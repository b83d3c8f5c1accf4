"""MATLAB files, versions 5 to 7 and 7.3: vectors, columns of matrices and fields of structs as channels.

A vector is called as in MATLAB, with the structs that hold it: `F1`, `data.F1`. A matrix gives a channel per column,
counted from 1: `M[:,3]` is MATLAB's M(:,3). A matrix that is wider than long gives a channel per row, `M[3,:]`. If the
only matrix of a struct, or of the top of the file, has beside it a cell array with a text per column, the texts are the
names (`names`, `labels`, `channels`, ...) or the units (`units`, ...) of the columns. Two such arrays beside vectors,
or in a struct beside them (`channel.name`, `channel.units`), give the units of the vectors.

The times of a channel are a vector or column beside it that is called `t` or `time` (also `Time`, `zeit`) and has the
same length. If there is none, its rate is a number beside or above it called `fs`, `rate`, `sample_rate`, ..., or the
step `dt`, `Ts`. Objects, functions and tables of MATLAB are not read.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fourpole.errors import TableError
from fourpole.io.formats import hdf5
from fourpole.io.formats.guard import afford, find, floats, is_time, of_name, seconds, tidy, time_scale
from fourpole.io.formats.matlab_73 import variables_73
from fourpole.io.formats.matlab_nodes import MOST_TEXTS, Node, variables_5
from fourpole.io.formats.tracks import OpenFile, Part, Track, remembered, track_format
from fourpole.io.signals import FileInfo, Request, SignalInfo
from fourpole.units import shown

_KIND = "a MATLAB file"
_V5, _V73 = b"MATLAB 5.0 MAT-file", b"MATLAB 7.3 MAT-file"
_RATES = re.compile(r"(?:fs|f_s|rate|sample_?rate|sampling_?rate|sampling_?frequency|samp_?freq)", re.IGNORECASE)
_STEPS = re.compile(r"(?:dt|ts|delta_?t|increment|sample_?time|sampling_?time)", re.IGNORECASE)
_NAMES = re.compile(r".*(?:name|label|channel|signal|header|column|title).*", re.IGNORECASE)
_UNITS = re.compile(r".*(?:unit|einheit|dimension).*", re.IGNORECASE)


@dataclass(frozen=True)
class _Channel:
    """The place of the samples of a channel, its unit and its time base."""

    name: str
    unit: str | None
    path: tuple[str, ...]
    node: Node
    column: int | None
    count: int
    rate: float | None = None
    time: _Channel | None = None

    @property
    def place(self) -> tuple[tuple[str, ...], int | None]:
        """Its variable and fields, and its column: what no other channel has, even one of the same name."""
        return self.path, self.column


def _within(nodes: Sequence[Node], path: tuple[str, ...], above: float | None) -> Iterator[_Channel]:
    """The channels of a struct, or of the top of the file; `above` is the rate that a struct above states [Hz]."""
    rate = _rate(nodes) or above
    tables = [one for one in nodes if one.is_table]
    found: list[_Channel] = []
    unit = _only_text(nodes, _UNITS) if sum(one.is_vector for one in nodes) == 1 else None
    named = _units_by_name(nodes)
    for one in nodes:
        called = ".".join([*path, one.name])
        if one.is_vector:
            stated = of_name(one.name, unit or named.get(one.name))
            found.append(_Channel(called, stated, (*path, one.name), one, None, max(one.dims)))
        elif one.is_table:
            found.extend(_columns(one, called, path, nodes if len(tables) == 1 else ()))
    times = [one for one in found if is_time(one.name)]
    for channel in found:
        time = next((other for other in times if other.count == channel.count), None)
        if channel in times:
            yield channel
        else:
            yield replace(channel, rate=None if time else rate, time=time)
    for one in nodes:
        if one.kind == "struct":
            yield from _within(one.below, (*path, one.name), rate)


def _columns(one: Node, called: str, path: tuple[str, ...], beside: Sequence[Node]) -> Iterator[_Channel]:
    long, wide = one.dims[0] >= one.dims[1], min(one.dims)
    if wide > MOST_TEXTS:
        return
    named = _texts(beside, _NAMES, wide)
    units = _texts(beside, _UNITS, wide)
    for column in range(wide):
        bare = f"{called}[:,{column + 1}]" if long else f"{called}[{column + 1},:]"
        name = named[column] if named and named[column] else bare
        unit = of_name(name if named else "", units[column] if units else None)
        yield _Channel(name, unit, (*path, one.name), one, column, max(one.dims))


def _texts(nodes: Sequence[Node], wanted: re.Pattern[str], count: int) -> list[str] | None:
    """The texts beside a matrix, one per column, in an array of a wanted name; None if there is none."""
    for one in nodes:
        texts = one.texts
        if texts is not None and len(texts) == count and wanted.fullmatch(one.name):
            return texts
    return None


def _units_by_name(nodes: Sequence[Node]) -> dict[str, str]:
    """Units of vectors by their names, if two cell arrays beside them, or in a struct beside them, list both."""
    for place in (nodes, *(one.below for one in nodes if one.kind == "struct")):
        lists = [(one.name, one.texts) for one in place if one.texts]
        units = next((texts for name, texts in lists if texts and _UNITS.fullmatch(name)), [])
        names = next(
            (texts for name, texts in lists if texts and _NAMES.fullmatch(name) and len(texts) == len(units)), []
        )
        if names and any(one.is_vector and one.name in names for one in nodes):
            return dict(zip(names, units, strict=True))
    return {}


def _only_text(nodes: Sequence[Node], wanted: re.Pattern[str]) -> str | None:
    return next((one.value for one in nodes if isinstance(one.value, str) and wanted.fullmatch(one.name)), None)


def _rate(nodes: Sequence[Node]) -> float | None:
    """The rate that a number among the nodes states [Hz]; None if there is none."""
    for pattern, invert in ((_RATES, False), (_STEPS, True)):
        for one in nodes:
            value = one.value
            if isinstance(value, float) and pattern.fullmatch(one.name) and np.isfinite(value) and value > 0:
                return 1.0 / value if invert else value
    return None


def _recognises(head: bytes) -> bool:
    return head.startswith((_V5, _V73)) or (
        len(head) >= 128 and head[:6] == b"MATLAB" and head[126:128] in (b"IM", b"MI")
    )


class _Content:
    """The channels of an open file."""

    def __init__(self, opened: OpenFile) -> None:
        self._name, self._max_bytes = opened.name, opened.max_bytes
        self._is_73 = opened.file.read(len(_V73)) == _V73
        opened.file.seek(0)
        if self._is_73:
            h5py = opened.guard.load("h5py")
            root = opened.closing.enter_context(h5py.File(opened.file, "r"))
            self._variables = variables_73(h5py, root, opened.name)
        else:
            from scipy.io import loadmat

            self._variables = variables_5(loadmat(opened.file, struct_as_record=True))
        self._channels = list(_within(self._variables, (), None))
        leaves = ((one.name, one.leaf) for one in self._variables if one.leaf is not None)
        self._closed = {name: leaf for name, leaf in leaves if leaf.dataset is None}
        """Leaves that cannot be opened, by name."""

    def info(self) -> FileInfo:
        times = {one.time.place: self._ends(one.time) for one in self._channels if one.time is not None}
        signals = []
        for one in self._channels:
            ends = times[one.time.place] if one.time is not None else None
            note = f"time from {tidy(one.time.name)}" if one.time else ""
            signals.append(SignalInfo.timed(one.name, one.unit, "", one.count, rate=one.rate, ends=ends, note=note))
        notes = [f"{tidy(leaf.path)} {leaf.barred}" for leaf in self._closed.values()]
        notes += [f"{tidy(one.name)}: {tidy(one.value)}" for one in self._variables if one.value is not None][:20]
        return FileInfo(f"MATLAB {'7.3' if self._is_73 else '5'}", tuple(signals), tuple(notes))

    def _ends(self, time: _Channel) -> tuple[float, float] | None:
        """First and last time [s]; None if they are not finite, or their unit is none of time."""
        scale, part = seconds(time.unit), self._reader(time)
        if scale is None or not time.count:
            return None
        ends = float(part(0, 1)[0]), float(part(time.count - 1, time.count)[0])
        return (ends[0] * scale, ends[1] * scale) if np.isfinite(ends).all() else None

    def tracks(self, request: Request, /, *, whole: bool) -> list[Track]:
        names = tuple(re.sub(r"\((:|\d+),(:|\d+)\)$", r"[\1,\2]", one) for one in request.names)
        for name in names:
            if name in self._closed:
                raise TableError(f"{self._name}: channel {shown(name)} {self._closed[name].barred}")
        places = find([("", one.name) for one in self._channels], replace(request, names=names))
        chosen = [self._channels[at] for at in places]
        if whole or not self._is_73:
            afford(16 * sum(one.count for one in chosen), self._max_bytes, self._name)
        needed = {one.place: one for channel in chosen for one in (channel, channel.time) if one is not None}
        readers = {place: self._reader(one) for place, one in needed.items()}
        times: dict[tuple[tuple[str, ...], int | None], Part] = {}
        tracks = []
        for one in chosen:
            time = None
            if one.time is not None:
                if one.time.place not in times:
                    times[one.time.place] = _in_seconds(one.time, readers[one.time.place], self._name)
                time = times[one.time.place]
            tracks.append(Track(one.name, one.unit, one.count, readers[one.place], one.rate, 0.0, time))
        return tracks

    def _reader(self, one: _Channel) -> Part:
        """The function that reads a part of a channel."""
        node, name = one.node, one.name
        long = node.dims[0] >= node.dims[1]
        if node.samples is None:
            if node.leaf is None:
                raise TableError(f"{self._name}: channel {shown(name)} holds no numbers; name another channel")
            # In the file of version 7.3 a matrix is transposed.
            return hdf5.reader(node.leaf, self._max_bytes, self._name, row=one.column, axis=0 if long else 1)
        table = node.samples
        values = table.ravel() if one.column is None else table[:, one.column] if long else table[one.column]
        return lambda first, last: floats(values[first:last], name, self._name)


def _in_seconds(time: _Channel, values: Part, name: str) -> Part:
    scale = time_scale(time.unit, time.name, name)
    return remembered(lambda first, last: scale * values(first, last))


FORMAT = track_format("MATLAB", (".mat",), _recognises, _KIND, _Content, extra="formats", by_library=True)
