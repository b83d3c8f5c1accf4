"""NumPy files: the arrays of an .npz by their names, and the one array of an .npy.

A vector is called by its name, in an .npy "1"; a field of an array of records by its own name. A matrix gives a channel
per column, counted from 1: `M.3`, in an .npy "3"; one that is wider than long gives a channel per row. Names, units and
times are as `variables` says; points in time become seconds from the first, durations seconds. Pickled objects are
never opened.

References
----------
NumPy Enhancement Proposal 1, "A simple file format for NumPy arrays".
"""

from __future__ import annotations

import ast
import os
import struct
import zipfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from fourpole.errors import TableError
from fourpole.io.formats.tracks import OpenFile, Part, track_format
from fourpole.io.formats.variables import LONGEST_TEXT, MOST_TEXTS, Channel, Node, Variables
from fourpole.units import shown

_KIND = "a NumPy file"
_MAGIC, _ZIP = b"\x93NUMPY", b"PK\x03\x04"
_ENDING = ".npy"
#: Longest header of an array [byte], and largest number of arrays.
_LONGEST_HEADER, _MOST_ARRAYS = 10_000, 10_000
#: Bytes that are decoded at a time.
_BLOCK = 1 << 26
_NUMBERED = (".{}", ".{}")


@dataclass(frozen=True, eq=False)
class _Stored:
    """Where the numbers of an array, or of a field of its records, are."""

    open: Callable[[], BinaryIO]
    begin: int
    dtype: np.dtype[Any]
    shape: tuple[int, ...]
    by_column: bool
    """Whether the values of a column follow each other (the order of Fortran)."""
    part: str | None = None
    held: dict[tuple[int, int], NDArray[Any]] = field(default_factory=dict)
    """The items that were read last: the columns of a matrix, and the fields of records, do not decode them again."""

    @property
    def values(self) -> np.dtype[Any]:
        """The type of a value."""
        return self.dtype if self.part is None else self.dtype[self.part]

    def items(self, first: int, last: int) -> NDArray[Any]:
        """Stored items from one index to another, in the order of the file."""
        if (first, last) not in self.held:
            file = self.open()
            file.seek(self.begin + first * self.dtype.itemsize)
            content = file.read((last - first) * self.dtype.itemsize)
            if len(content) != (last - first) * self.dtype.itemsize:
                raise ValueError("its samples end too soon")
            self.held.clear()
            self.held[first, last] = np.frombuffer(content, dtype=self.dtype)
        found = self.held[first, last]
        return found if self.part is None else found[self.part]

    def whole(self) -> NDArray[Any]:
        """All values of a small array."""
        count = int(np.prod(self.shape, dtype=np.int64))
        return self.items(0, count)

    def texts(self) -> list[str]:
        """All values of a small array of texts."""
        return [one.decode("latin-1") if isinstance(one, bytes) else str(one) for one in self.whole()]


def _header(file: BinaryIO, size: int) -> tuple[np.dtype[Any], tuple[int, ...], bool, int]:
    """Type, shape, whether the order is by column, and begin of the values; ValueError if the header lies."""
    start = file.read(8)
    if len(start) < 8 or start[:6] != _MAGIC or start[6] not in (1, 2, 3):
        raise ValueError("is no array")
    form = "<H" if start[6] == 1 else "<I"
    (length,) = struct.unpack(form, file.read(struct.calcsize(form)))
    if length > _LONGEST_HEADER:
        raise ValueError(f"has a header of {length} bytes")
    stated = ast.literal_eval(file.read(length).decode("utf-8" if start[6] == 3 else "latin-1").strip())
    dtype = np.lib.format.descr_to_dtype(stated["descr"])
    shape = tuple(int(one) for one in stated["shape"])
    begin = 8 + struct.calcsize(form) + length
    if min(shape, default=0) < 0 or (not dtype.itemsize and max(shape, default=0)):
        raise ValueError(f"declares the shape {shape}")
    needed = dtype.itemsize
    for one in shape:
        needed *= one
    if not dtype.hasobject and begin + needed > size:
        raise ValueError(f"is cut short: declares {needed} bytes of values, has {size - begin}")
    return dtype, shape, bool(stated["fortran_order"]) and len(shape) > 1, begin


def _node(name: str, stored: _Stored) -> Node:
    """An array, or a field of records, as a variable."""
    kind, dims = stored.values.kind, stored.shape
    node = Node(name, dims=(dims[0], 1) if len(dims) == 1 else dims, samples=stored, numbered=_NUMBERED)
    count = int(np.prod(dims, dtype=np.int64))
    if kind in "fiub" or (kind in "mM" and np.datetime_data(stored.values)[0] not in ("generic", "Y", "M")):
        node.kind, node.unit = "numbers", "s" if kind in "mM" else None
        if count == 1 and kind not in "mM":
            node.value = float(stored.whole()[0])
    elif kind in "US" and count <= MOST_TEXTS and stored.values.itemsize <= 4 * LONGEST_TEXT:
        texts = stored.texts()
        if len(dims) == 1:
            node.kind, node.below = "cells", [Node("", kind="text", value=one) for one in texts]
        elif not dims:
            node.kind, node.value = "text", texts[0]
    return node


def _nodes(name: str, stored: _Stored) -> Iterator[Node]:
    """The variables of an array: itself, or the fields of its records."""
    names = stored.dtype.names
    if not names:
        yield _node(name, stored)
        return
    fields = [_node(one, replace(stored, part=one)) for one in names if stored.dtype[one].shape == ()]
    if len(stored.shape) != 1:
        return
    if name:
        yield Node(name, kind="struct", dims=(1, 1), below=fields)
    else:
        yield from fields


class _Content(Variables):
    """The channels of an open file."""

    format = "NumPy"
    in_parts = True

    def __init__(self, opened: OpenFile) -> None:
        self.notes: list[str] = []
        alone = opened.file.read(4) != _ZIP
        opened.file.seek(0)
        variables = [*(self._array(opened) if alone else self._archive(opened))]
        super().__init__(opened, variables)
        if alone and not variables[0].name:
            self._channels = [replace(one, name=one.name.removeprefix(".") or "1") for one in self._channels]
            self.places = [("", one.name) for one in self._channels]

    def _array(self, opened: OpenFile) -> Iterator[Node]:
        size = os.fstat(opened.file.fileno()).st_size
        dtype, shape, by_column, begin = _header(opened.file, size)
        if dtype.hasobject:
            raise TableError(f"{opened.name}: holds Python objects, which are never opened; save numbers")
        yield from _nodes("", _Stored(lambda: opened.file, begin, dtype, shape, by_column))

    def _archive(self, opened: OpenFile) -> Iterator[Node]:
        archive = opened.closing.enter_context(zipfile.ZipFile(opened.file))
        members = archive.infolist()
        if len(members) > _MOST_ARRAYS:
            raise TableError(f"{opened.name}: has {len(members)} arrays; save at most {_MOST_ARRAYS} in a file")
        for member in members:
            if not member.filename.endswith(_ENDING):
                self.notes.append(f"{shown(member.filename)} is no array and was left out")
                continue
            name = member.filename.removesuffix(_ENDING)
            file = opened.closing.enter_context(archive.open(member))
            try:
                dtype, shape, by_column, begin = _header(file, member.file_size)  # type: ignore[arg-type]
            except (ValueError, TypeError, KeyError, SyntaxError, struct.error) as error:
                raise TableError(
                    f"{opened.name}: array {shown(name)} {shown(str(error))[1:-1]}; save it again"
                ) from None
            if dtype.hasobject:
                self.notes.append(f"{shown(name)} holds Python objects, which are never opened")
                continue
            yield from _nodes(name, _Stored(lambda held=file: held, begin, dtype, shape, by_column))  # type: ignore[misc]

    def reader(self, one: Channel, /) -> Part:
        """The function that reads a part of a channel."""
        stored: _Stored = one.node.samples
        is_moment = stored.values.kind == "M" and one.count
        zero = _values(stored, one, 0, 1)[0] if is_moment else None

        def part(first: int, last: int) -> NDArray[np.float64]:
            found = _values(stored, one, first, last)
            if zero is not None:
                found = found - zero
            return found / np.timedelta64(1, "s") if found.dtype.kind == "m" else found.astype(np.float64)

        return part


def _values(stored: _Stored, one: Channel, first: int, last: int) -> NDArray[Any]:
    """Values of a channel from one index to another, as they are stored."""
    begin, width = 0, 1
    if one.column is not None:
        rows, columns = stored.shape
        if (rows >= columns) == stored.by_column:  # the samples of the channel follow each other
            begin = one.column * max(rows, columns)
        else:
            begin, width = one.column, min(rows, columns)
    step = max(_BLOCK // (width * stored.dtype.itemsize), 1)
    offset = begin if width > 1 else 0
    begin -= offset
    parts = [
        stored.items(begin + at * width, begin + min(at + step, last) * width)[offset::width]
        for at in range(first, last, step)
    ]
    return np.concatenate(parts) if parts else np.empty(0, dtype=stored.values)


FORMAT = track_format("npz", "NumPy", (".npz", ".npy"), _KIND, _Content, by_library=True)
