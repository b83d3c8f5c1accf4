"""Variables of a MATLAB file of version 5 to 7, from a walk over its elements that reads no samples.

The walk bounds what the library builds later: an element that declares more than it holds is refused here.
"""

from __future__ import annotations

import os
import struct
import zlib
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import BinaryIO, Protocol

import numpy as np

from fourpole.errors import TableError
from fourpole.io.formats import hdf5
from fourpole.units import shown

KIND = "a MATLAB file"
LONGEST_TEXT = 1000
MOST_TEXTS = 4096
_MATRIX, _COMPRESSED = 14, 15
_SIZES = {1: 1, 2: 1, 3: 2, 4: 2, 5: 4, 6: 4, 7: 4, 9: 8, 12: 8, 13: 8, 16: 1, 17: 2, 18: 4}
_CODES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
_CELL, _STRUCT, _CHAR = 1, 2, 4
_NUMERIC = range(6, 16)
_MOST_NODES = 200_000
_DEEPEST = 16
_BLOCK = 1 << 16


@dataclass
class Node:
    """A variable, a field of a struct or a cell, without its samples."""

    name: str
    kind: str = "other"
    """numbers, text, cells, struct or other."""
    dims: tuple[int, ...] = ()
    value: float | str | None = None
    """The value of a single number or a short text."""
    below: list[Node] = field(default_factory=list)
    ends: tuple[float, float] | None = None
    """First and last of several numbers, as stored; None in version 7.3."""
    size: int = 0
    """Memory that the node and all below it need [byte]."""
    leaf: hdf5.Leaf | None = None

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


class _Bytes(Protocol):
    """A source of bytes."""

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
    """Bytes of a compressed element, unpacked one small block at a time."""

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


class Walk:
    """The walk over the elements of a file of version 5 to 7."""

    def __init__(self, file: BinaryIO, name: str, max_bytes: int) -> None:
        self._file, self._name, self._max_bytes = file, name, max_bytes
        self._order = "<"
        self._nodes = 0

    def variables(self) -> list[Node]:
        """The variables that have a name, in the order of the file."""
        end = os.fstat(self._file.fileno()).st_size
        head = self._file.read(128)
        if len(head) < 128 or head[126:128] not in (b"IM", b"MI"):
            raise TableError(f"{self._name}: is not {KIND} of version 5 or later; save it with '-v7'")
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
        """Type and size [byte] of an element; also its data, if they are in the tag, otherwise None."""
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

    def _matrix(self, source: _Bytes, depth: int, called: str | None = None) -> Node:
        """The node of a matrix element whose tag has been read."""
        self._nodes += 1
        if self._nodes > _MOST_NODES or depth > _DEEPEST:
            raise TableError(f"{self._name}: has too many parts, or parts within parts; save the channels as vectors")
        _, flags = self._data(source)
        (word,) = struct.unpack(f"{self._order}I", flags[:4])
        kind, is_complex = word & 0xFF, bool(word & 0x800)
        if kind == 17:  # an object of MATLAB: it has no dimensions
            _, title = self._data(source)
            node = Node(called or title.decode("latin-1"))
            for _ in range(2):
                self._data(source)
            self._below(source, node, [""], 1, depth)
            return node
        _, shape = self._data(source)
        dims = tuple(struct.unpack(f"{self._order}{len(shape) // 4}i", shape[: len(shape) // 4 * 4]))
        _, title = self._data(source)
        node = Node(called or title.decode("latin-1"), dims=dims)
        count = int(np.prod(dims, dtype=object)) if dims else 0
        if count < 0 or min(dims, default=0) < 0:
            raise ValueError("a dimension is negative")
        self._content(source, node, kind, is_complex, count, depth)
        return node

    def _content(self, source: _Bytes, node: Node, kind: int, is_complex: bool, count: int, depth: int) -> None:
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

    def _below(self, source: _Bytes, node: Node, names: Sequence[str], count: int, depth: int) -> None:
        for number in range(count * len(names)):
            kind, size, data = self._tag(source)
            if kind != _MATRIX or data is not None:
                raise ValueError("a field is no matrix")
            title = names[number % len(names)]
            if size == 0:
                self._nodes += 1
                one = Node(title)
                if self._nodes > _MOST_NODES:
                    raise TableError(f"{self._name}: has more than {_MOST_NODES} parts; save the channels as vectors")
            else:
                one = self._matrix(source, depth + 1, title)
            node.size += one.size + 100
            if node.kind in ("struct", "cells") and len(node.below) < MOST_TEXTS:
                node.below.append(one)

    def _numbers(self, source: _Bytes, node: Node, count: int) -> None:
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

    def _text(self, source: _Bytes, node: Node, count: int) -> None:
        node.kind = "text"
        kind, size, data = self._tag(source)
        node.size += 8 * count + size
        if data is None:
            data = source.read(size) if size <= 2 * LONGEST_TEXT else None
            source.skip(-size % 8 if data is not None else size + -size % 8)
        rows = node.dims[0] if node.dims else 0
        if data is not None and rows <= 1:
            wide = {4: "utf-16", 17: "utf-16", 18: "utf-32"}.get(kind)
            order = "-le" if self._order == "<" else "-be"
            node.value = data.decode(f"{wide}{order}" if wide else "utf-8", errors="replace").strip()

    def _passed(self, source: _Bytes, node: Node) -> None:
        _, size, data = self._tag(source)
        node.size += 8 * size
        if data is None:
            source.skip(size + -size % 8)
