"""MATLAB files, versions 5 to 7 and 7.3: vectors, columns of matrices and fields of structs as channels.

A vector is called as in MATLAB, with the structs that hold it: `F1`, `data.F1`. A matrix gives a channel
per column, counted from 1: `M[:,3]` is MATLAB's M(:,3); a matrix that is wider than long gives its
rows, `M[3,:]`. Where the only matrix of a place has beside it a cell array with a text per column, these
are the names (`names`, `labels`, `channels`, ...) or the units (`units`, ...) of its columns. Two such arrays beside
vectors, or in a struct beside them (`channel.name`, `channel.units`), give the vectors' units.

The time of a channel is a vector or column beside it called `t` or `time` (also `Time`, `zeit`) and as
long; without one, its rate is a number beside it or above it called `fs`, `rate`, `sample_rate`, ..., or
the step `dt`, `Ts`. Objects, functions and tables of MATLAB are neither read nor made.
"""

from __future__ import annotations

import os
import re
import struct
import zlib
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, BinaryIO, Protocol

import numpy as np

from fourpole.errors import TableError
from fourpole.io.formats import hdf5
from fourpole.io.formats.guard import Guard, afford, find, floats, is_time, of_name, seconds, tidy
from fourpole.io.formats.pieces import Part, Track, by_tracks, remembered
from fourpole.io.signals import MAX_FILE_BYTES, FileInfo, Format, Request, SignalInfo
from fourpole.io.source import name_of, open_regular
from fourpole.units import shown

__all__ = ["FORMAT"]

_KIND = "a MATLAB file"
_V5, _V73 = b"MATLAB 5.0 MAT-file", b"MATLAB 7.3 MAT-file"
_RATES = re.compile(r"(?:fs|f_s|rate|sample_?rate|sampling_?rate|sampling_?frequency|samp_?freq)", re.IGNORECASE)
_STEPS = re.compile(r"(?:dt|ts|delta_?t|increment|sample_?time|sampling_?time)", re.IGNORECASE)
_NAMES = re.compile(r".*(?:name|label|channel|signal|header|column|title).*", re.IGNORECASE)
_UNITS = re.compile(r".*(?:unit|einheit|dimension).*", re.IGNORECASE)

_MATRIX, _COMPRESSED, _UTF16_TYPE = 14, 15, 17
_SIZES = {1: 1, 2: 1, 3: 2, 4: 2, 5: 4, 6: 4, 7: 4, 9: 8, 12: 8, 13: 8, 16: 1, 17: 2, 18: 4}
_CODES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
_CELL, _STRUCT, _CHAR = 1, 2, 4
_NUMERIC = range(6, 16)
_INTEGERS = tuple(f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64))
_CLASSES = (None, "double", "single", "logical", *_INTEGERS)
_MOST_NODES = 200_000
_DEEPEST = 16
_LONGEST_TEXT = 1000
_MOST_TEXTS = 4096
_BLOCK = 1 << 16


@dataclass
class _Node:
    """A variable, a field or a cell, without its samples."""

    name: str
    kind: str = "other"
    """numbers, text, cells, struct or other."""
    dims: tuple[int, ...] = ()
    value: float | str | None = None
    """Of a single number or a short text."""
    below: list[_Node] = field(default_factory=list)
    ends: tuple[float, float] | None = None
    """First and last of several numbers, as they are stored."""
    size: int = 0
    """Bytes it takes in memory, with what is below."""
    leaf: hdf5.Leaf | None = None

    @property
    def texts(self) -> list[str] | None:
        """The texts of a cell array that has nothing else."""
        found = [one.value for one in self.below if isinstance(one.value, str)]
        return found if self.kind == "cells" and found and len(found) == len(self.below) else None

    @property
    def is_table(self) -> bool:
        return self.kind == "numbers" and len(self.dims) == 2 and min(self.dims) > 1

    @property
    def is_vector(self) -> bool:
        return self.kind == "numbers" and len(self.dims) == 2 and min(self.dims) == 1 and max(self.dims) > 1


@dataclass(frozen=True)
class _Channel:
    """Where the samples of a channel are, and what is known of them."""

    name: str
    unit: str | None
    path: tuple[str, ...]
    node: _Node
    column: int | None
    count: int
    rate: float | None = None
    time: _Channel | None = None


# --- version 5 to 7: a walk over the elements, so that nothing is built that the file only declares ---


class _Bytes(Protocol):
    def read(self, count: int) -> bytes: ...

    def skip(self, count: int) -> None: ...


class _Plain:
    """Bytes of the file itself."""

    def __init__(self, file: BinaryIO, stop: int) -> None:
        self._file, self._stop = file, stop

    def read(self, count: int) -> bytes:
        if count > self._stop - self._file.tell():
            raise EOFError("an element ends after the file")
        return self._file.read(count)

    def skip(self, count: int) -> None:
        if count > self._stop - self._file.tell():
            raise EOFError("an element ends after the file")
        self._file.seek(count, os.SEEK_CUR)


class _Inflated:
    """Bytes of a compressed element, never more of them than a block at a time."""

    def __init__(self, source: _Plain, count: int, most: int) -> None:
        self._source, self._left, self._most = source, count, most
        self._stream = zlib.decompressobj()
        self._held = b""

    def read(self, count: int) -> bytes:
        if count > _BLOCK * 16:
            raise EOFError("a header is larger than it can be")
        while len(self._held) < count:
            self._held += self._more()
        part, self._held = self._held[:count], self._held[count:]
        return part

    def skip(self, count: int) -> None:
        while count > len(self._held):
            count -= len(self._held)
            self._held = self._more()
        self._held = self._held[count:]

    def _more(self) -> bytes:
        packed = self._stream.unconsumed_tail
        if not packed:
            if self._left <= 0 or self._stream.eof:
                raise EOFError("a compressed element ends too early")
            packed = self._source.read(min(self._left, _BLOCK))
            self._left -= len(packed)
        part = self._stream.decompress(packed, _BLOCK)
        self._most -= len(part)
        if self._most < 0:
            raise MemoryError
        return part


class _Walk:
    """The variables of a file of version 5 to 7."""

    def __init__(self, file: BinaryIO, name: str, max_bytes: int) -> None:
        self._file, self._name, self._max_bytes = file, name, max_bytes
        self._order = "<"
        self._nodes = 0

    def variables(self) -> list[_Node]:
        end = os.fstat(self._file.fileno()).st_size
        head = self._file.read(128)
        if len(head) < 128 or head[126:128] not in (b"IM", b"MI"):
            raise TableError(f"{self._name}: is not {_KIND} of version 5 or later; save it with '-v7'")
        self._order = "<" if head[126:128] == b"IM" else ">"
        found = []
        while self._file.tell() < end:
            plain = _Plain(self._file, end)
            kind, size = struct.unpack(f"{self._order}II", plain.read(8))
            start = self._file.tell()
            if size > end - start:
                raise TableError(
                    f"{self._name}: is cut short: a variable at byte {start} ends after the file; copy it again"
                )
            inner: _Bytes = plain
            if kind == _COMPRESSED:
                inner = _Inflated(plain, size, self._max_bytes)
                kind, _ = struct.unpack(f"{self._order}II", inner.read(8))
            if kind != _MATRIX:
                raise TableError(f"{self._name}: is damaged: there is no variable at byte {start}; save it again")
            found.append(self._matrix(inner, 0))
            self._file.seek(start + size)
        return [one for one in found if one.name]

    def _tag(self, source: _Bytes) -> tuple[int, int, bytes | None]:
        """Type and size of an element; its data too where they are in the tag."""
        head = source.read(8)
        (first,) = struct.unpack(f"{self._order}I", head[:4])
        if first >> 16:
            kind, size = first & 0xFFFF, first >> 16
            if size > 4:
                raise ValueError("an element is larger than its place")
            return kind, size, head[4 : 4 + size]
        (size,) = struct.unpack(f"{self._order}I", head[4:])
        return first, size, None

    def _data(self, source: _Bytes, most: int = _BLOCK) -> tuple[int, bytes]:
        kind, size, data = self._tag(source)
        if data is None:
            if size > most:
                raise ValueError("a header is larger than it can be")
            data = source.read(size)
            source.skip(-size % 8)
        return kind, data

    def _matrix(self, source: _Bytes, depth: int, called: str | None = None) -> _Node:
        """A matrix element behind its tag."""
        self._nodes += 1
        if self._nodes > _MOST_NODES or depth > _DEEPEST:
            raise TableError(f"{self._name}: has too many parts, or parts within parts; save the channels as vectors")
        _, flags = self._data(source)
        (word,) = struct.unpack(f"{self._order}I", flags[:4])
        kind, is_complex = word & 0xFF, bool(word & 0x800)
        if kind == 17:  # an object of MATLAB: it has no dimensions
            _, title = self._data(source)
            node = _Node(called or title.decode("latin-1"))
            for _ in range(2):
                self._data(source)
            self._below(source, node, [""], 1, depth)
            return node
        _, shape = self._data(source)
        dims = tuple(struct.unpack(f"{self._order}{len(shape) // 4}i", shape[: len(shape) // 4 * 4]))
        _, title = self._data(source)
        node = _Node(called or title.decode("latin-1"), dims=dims)
        count = int(np.prod(dims, dtype=object)) if dims else 0
        if count < 0 or min(dims, default=0) < 0:
            raise ValueError("a dimension is negative")
        self._content(source, node, kind, is_complex, count, depth)
        return node

    def _content(self, source: _Bytes, node: _Node, kind: int, is_complex: bool, count: int, depth: int) -> None:
        if kind in _NUMERIC:
            node.kind = "other" if is_complex else "numbers"
            for _ in range(1 + is_complex):
                self._numbers(source, node, count)
        elif kind == _CHAR:
            self._text(source, node, count)
        elif kind == _CELL:
            node.kind = "cells"
            self._below(source, node, [""], count, depth)
        elif kind in (_STRUCT, 3):
            if kind == 3:
                self._data(source)  # the class of an object
            _, width = self._data(source)
            (wide,) = struct.unpack(f"{self._order}i", width[:4])
            _, raw = self._data(source, 1 << 20)
            names = [raw[at : at + wide].split(b"\0")[0].decode("latin-1") for at in range(0, len(raw), max(wide, 1))]
            node.kind = "struct" if kind == _STRUCT and count == 1 else "other"
            self._below(source, node, names, count, depth)
        elif kind == 5:  # sparse: rows, columns, values
            for _ in range(3 + is_complex):
                self._passed(source, node)
        elif kind == 16:
            self._below(source, node, [""], 1, depth)
        else:
            raise ValueError(f"a variable is of the unknown class {kind}")

    def _below(self, source: _Bytes, node: _Node, names: Sequence[str], count: int, depth: int) -> None:
        for number in range(count * len(names)):
            kind, size, data = self._tag(source)
            if kind != _MATRIX or data is not None:
                raise ValueError("a field is no matrix")
            title = names[number % len(names)]
            if size == 0:
                self._nodes += 1
                one = _Node(title)
                if self._nodes > _MOST_NODES:
                    raise TableError(f"{self._name}: has more than {_MOST_NODES} parts; save the channels as vectors")
            else:
                one = self._matrix(source, depth + 1, title)
            node.size += one.size + 100
            if node.kind in ("struct", "cells") and len(node.below) < _MOST_TEXTS:
                node.below.append(one)

    def _numbers(self, source: _Bytes, node: _Node, count: int) -> None:
        kind, size, data = self._tag(source)
        if kind not in _CODES or size != count * _SIZES[kind]:
            raise ValueError(f"{shown(node.name)} declares {count} numbers and has {size} bytes")
        node.size += 8 * count + size
        wide = _SIZES[kind]
        if data is None and count > 1:
            first = source.read(wide)
            source.skip(size - 2 * wide)
            data = first + source.read(wide)
            source.skip(-size % 8)
        elif data is None:
            data = source.read(size)
            source.skip(-size % 8)
        if count and node.kind == "numbers":
            values = np.frombuffer(data, np.dtype(f"{self._order}{_CODES[kind]}"))
            node.value = float(values[0]) if count == 1 else None
            node.ends = float(values[0]), float(values[-1])

    def _text(self, source: _Bytes, node: _Node, count: int) -> None:
        node.kind = "text"
        kind, size, data = self._tag(source)
        node.size += 8 * count + size
        if data is None:
            data = source.read(size) if size <= 2 * _LONGEST_TEXT else None
            source.skip(-size % 8 if data is not None else size + -size % 8)
        rows = node.dims[0] if node.dims else 0
        if data is not None and rows <= 1:
            wide = {4: "utf-16", 17: "utf-16", 18: "utf-32"}.get(kind)
            order = "-le" if self._order == "<" else "-be"
            node.value = data.decode(f"{wide}{order}" if wide else "utf-8", errors="replace").strip()

    def _passed(self, source: _Bytes, node: _Node) -> None:
        _, size, data = self._tag(source)
        node.size += 8 * size
        if data is None:
            source.skip(size + -size % 8)


# --- version 7.3: HDF5, its matrices transposed ---


def _variables_73(h5py: Any, root: Any, name: str) -> list[_Node]:
    top = _Node("")
    places = {"": top}
    for leaf in hdf5.leaves(h5py, root, name):
        if leaf.group.startswith("#") or leaf.name.startswith("#"):
            continue
        parent = top
        path = ""
        for part in leaf.group.split("/") if leaf.group else ():
            path = f"{path}/{part}" if path else part
            if path not in places:
                places[path] = _Node(part, kind="struct", dims=(1, 1))
                parent.below.append(places[path])
            parent = places[path]
        parent.below.append(_node_73(h5py, root, leaf, name))
    return top.below


def _node_73(h5py: Any, root: Any, leaf: hdf5.Leaf, name: str, *, in_cell: bool = False) -> _Node:
    node = _Node(leaf.name, leaf=leaf)
    dataset = leaf.dataset
    if dataset is None or hdf5.is_elsewhere(h5py, dataset):
        return node
    node.dims = tuple(reversed(dataset.shape or ()))
    if len(node.dims) == 1:
        node.dims = (node.dims[0], 1)
    stated = hdf5.attributes(h5py, dataset)
    kind = stated.get("MATLAB_class")
    if stated.get("MATLAB_empty"):
        return node
    if kind == "char":
        node.kind, node.value = "text", _text_73(dataset, leaf, name)
    elif kind == "cell" and not in_cell and h5py.check_ref_dtype(dataset.dtype) is h5py.Reference:
        node.kind = "cells"
        node.below = _cells_73(h5py, root, dataset, name)
    elif not leaf.barred and kind in _CLASSES:
        node.kind = "numbers"
        node.size = 16 * int(np.prod(node.dims, dtype=object))
        if dataset.size == 1:
            node.value = float(hdf5.samples(leaf, 1 << 20, name).ravel()[0])
    return node


def _text_73(dataset: Any, leaf: hdf5.Leaf, name: str) -> str | None:
    if (
        leaf.barred
        or dataset.size > _LONGEST_TEXT
        or dataset.dtype.kind not in "ui"
        or min(dataset.shape, default=0) > 1
    ):
        return None
    codes = hdf5.samples(leaf, 1 << 24, name).ravel()
    return "".join(chr(int(code)) for code in codes if 0 < code < 0x110000).strip()


def _cells_73(h5py: Any, root: Any, dataset: Any, name: str) -> list[_Node]:
    if dataset.size > _MOST_TEXTS or (
        dataset.chunks is not None and np.prod(dataset.chunks, dtype=object) > 10 * _MOST_TEXTS
    ):
        return []
    below = []
    for reference in np.asarray(dataset[()]).T.ravel():
        target = root[reference] if reference else None
        if isinstance(target, h5py.Dataset):
            below.append(_node_73(h5py, root, hdf5.leaf_of(h5py, target), name, in_cell=True))
        else:
            below.append(_Node(""))
    return below


# --- both: which of it are channels ---


def _channels(variables: Sequence[_Node]) -> list[_Channel]:
    return list(_within(variables, (), None))


def _within(nodes: Sequence[_Node], path: tuple[str, ...], above: float | None) -> Iterator[_Channel]:
    """The channels of a place: the top of the file, or a struct."""
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
            yield _with(channel, None if time else rate, time)
    for one in nodes:
        if one.kind == "struct":
            yield from _within(one.below, (*path, one.name), rate)


def _with(one: _Channel, rate: float | None, time: _Channel | None) -> _Channel:
    return _Channel(one.name, one.unit, one.path, one.node, one.column, one.count, rate, time)


def _columns(one: _Node, called: str, path: tuple[str, ...], beside: Sequence[_Node]) -> Iterator[_Channel]:
    long, wide = one.dims[0] >= one.dims[1], min(one.dims)
    if wide > _MOST_TEXTS:
        return
    named = _texts(beside, _NAMES, wide)
    units = _texts(beside, _UNITS, wide)
    for column in range(wide):
        bare = f"{called}[:,{column + 1}]" if long else f"{called}[{column + 1},:]"
        name = named[column] if named and named[column] else bare
        unit = of_name(name if named else "", units[column] if units else None)
        yield _Channel(name, unit, (*path, one.name), one, column, max(one.dims))


def _texts(nodes: Sequence[_Node], wanted: re.Pattern[str], count: int) -> list[str] | None:
    """The texts beside a matrix, one per column."""
    for one in nodes:
        texts = one.texts
        if texts is not None and len(texts) == count and wanted.fullmatch(one.name):
            return texts
    return None


def _units_by_name(nodes: Sequence[_Node]) -> dict[str, str]:
    """Units of vectors by their names, where two cell arrays beside them, or in a struct beside them, list both."""
    for place in (nodes, *(one.below for one in nodes if one.kind == "struct")):
        lists = [(one.name, one.texts) for one in place if one.texts]
        units = next((texts for name, texts in lists if texts and _UNITS.fullmatch(name)), [])
        names = next(
            (texts for name, texts in lists if texts and _NAMES.fullmatch(name) and len(texts) == len(units)), []
        )
        if names and any(one.is_vector and one.name in names for one in nodes):
            return dict(zip(names, units, strict=True))
    return {}


def _only_text(nodes: Sequence[_Node], wanted: re.Pattern[str]) -> str | None:
    return next((one.value for one in nodes if isinstance(one.value, str) and wanted.fullmatch(one.name)), None)


def _rate(nodes: Sequence[_Node]) -> float | None:
    """The rate that a number in this place states."""
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


def _is_73(file: BinaryIO, name: str) -> bool:
    head = file.read(4096)
    if not _recognises(head):
        raise TableError(f"{name}: is not {_KIND} of version 5 to 7.3; save it in MATLAB with '-v7' or '-v7.3'")
    file.seek(0)
    return head.startswith(_V73)


def _survey(path: Path, label: str, max_bytes: int) -> FileInfo:
    name = name_of(path, label)
    most = max(max_bytes, MAX_FILE_BYTES)
    with open_regular(path, max_bytes=most, label=label) as file, Guard(name, _KIND, "h5py") as guard:
        if _is_73(file, name):
            h5py = guard.load("h5py")
            with hdf5.opened(guard, file, name) as root:
                variables = _variables_73(h5py, root, name)
                channels = _channels(variables)
                times = {one.time.name: one.time for one in channels if one.time is not None}
                ends = {called: _ends_73(one, max_bytes, name) for called, one in times.items()}
                signals = [_info(one, ends[one.time.name] if one.time is not None else None) for one in channels]
                barred = [one.leaf for one in variables if one.leaf is not None and one.leaf.dataset is None]
                notes = [f"{tidy(one.path)} {one.barred}" for one in barred]
            version = "7.3"
        else:
            variables, notes, version = _Walk(file, name, max_bytes).variables(), [], "5"
            signals = [_info(one, _ends(one.time)) for one in _channels(variables)]
    notes += [f"{tidy(one.name)}: {tidy(one.value)}" for one in variables if one.value is not None][:20]
    return FileInfo(f"MATLAB {version}", tuple(signals), tuple(notes))


def _info(one: _Channel, ends: tuple[float, float] | None) -> SignalInfo:
    note = f"time from {tidy(one.time.name)}" if one.time else ""
    start = 0.0 if one.rate else None
    duration = max(one.count - 1, 0) / one.rate if one.rate else None
    scale = seconds(one.time.unit) if one.time else None
    if ends is not None and scale is not None and np.isfinite(ends).all():
        start, duration = ends[0] * scale, (ends[1] - ends[0]) * scale
    return SignalInfo(one.name, one.unit, "", one.count, one.rate, start, duration, note)


def _ends(time: _Channel | None) -> tuple[float, float] | None:
    """First and last of a time, where it is a vector."""
    return time.node.ends if time is not None and time.column is None else None


def _ends_73(time: _Channel, max_bytes: int, name: str) -> tuple[float, float] | None:
    if not time.count:
        return None
    part = _reader_73(time, max_bytes, name)
    return float(part(0, 1)[0]), float(part(time.count - 1, time.count)[0])


@contextmanager
def _tracks(request: Request, guard: Guard, *, whole: bool) -> Iterator[list[Track]]:
    """The channels of a request, of which any part can be read while the file is open."""
    name, limit = name_of(request.path, request.label), request.max_bytes
    with open_regular(request.path, max_bytes=request.max_file_bytes, label=request.label) as file:
        if _is_73(file, name):
            h5py = guard.load("h5py")
            with hdf5.opened(guard, file, name) as root:
                chosen = _chosen(_variables_73(h5py, root, name), request, name, whole=whole)
                yield _of_channels(chosen, lambda one: _reader_73(one, limit, name), name)
            return
        variables = _Walk(file, name, limit).variables()
        chosen = _chosen(variables, request, name, whole=True)
        tops = {path[0] for one in chosen for path in (one.path, one.time.path if one.time else one.path)}
        held = sum(one.size for one in variables if one.name in tops)
        afford(held + 16 * sum(one.count for one in chosen), limit, name)
        file.seek(0)
        from scipy.io import loadmat

        content = loadmat(file, variable_names=sorted(tops), struct_as_record=True) if tops else {}
        yield _of_channels(chosen, lambda one: _reader(content, one, name), name)


def _chosen(variables: Sequence[_Node], request: Request, name: str, *, whole: bool) -> list[_Channel]:
    channels = _channels(variables)
    written = tuple(re.sub(r"\((:|\d+),(:|\d+)\)$", r"[\1,\2]", one) for one in request.names)
    barred = {one.name: one.leaf for one in variables if one.leaf is not None and one.leaf.barred}
    for one in written:
        leaf = barred.get(one)
        if leaf is not None and leaf.dataset is None:
            raise TableError(f"{name}: channel {shown(one)} {leaf.barred}")
    asked = Request(request.path, written, request.group, request.label, request.max_bytes)
    chosen = [channels[at] for at in find([("", one.name) for one in channels], asked)]
    if whole:
        afford(16 * sum(one.count for one in chosen), request.max_bytes, name)
    return chosen


def _of_channels(chosen: Sequence[_Channel], reader: Callable[[_Channel], Part], name: str) -> list[Track]:
    times: dict[str, Part] = {}
    tracks = []
    for one in chosen:
        if one.time is not None and one.time.name not in times:
            times[one.time.name] = _seconds(one.time, reader, name)
        time = times[one.time.name] if one.time is not None else None
        tracks.append(Track(one.name, one.unit, one.count, reader(one), one.rate, 0.0, time))
    return tracks


def _seconds(time: _Channel, reader: Callable[[_Channel], Part], name: str) -> Part:
    scale, values = seconds(time.unit), reader(time)
    if scale is None:
        what = f"has the unit {shown(time.unit)}; state it in s, ms or µs"
        raise TableError(f"{name}: the time {shown(time.name)} {what}")
    return remembered(lambda first, last: scale * values(first, last))


def _reader(content: dict[str, Any], one: _Channel, name: str) -> Part:
    values = content[one.path[0]]
    for part in one.path[1:]:
        values = values[part][0, 0]
    if one.column is None:
        values = values.ravel()
    else:
        values = values[:, one.column] if one.node.dims[0] >= one.node.dims[1] else values[one.column]
    return lambda first, last: floats(values[first:last], one.name, name)


def _reader_73(one: _Channel, max_bytes: int, name: str) -> Part:
    leaf = one.node.leaf
    if leaf is None:
        raise TableError(f"{name}: channel {shown(one.name)} holds no numbers; name another channel")
    if one.column is None:
        return hdf5.reader(leaf, max_bytes, name)
    long = one.node.dims[0] >= one.node.dims[1]  # of the matrix as MATLAB has it: in the file it lies on its side
    return hdf5.reader(leaf, max_bytes, name, row=one.column, axis=0 if long else 1)


_read, _blocks = by_tracks(_KIND, "h5py", _tracks)
FORMAT = Format("MATLAB", (".mat",), _recognises, _survey, _read, "formats", _blocks)
