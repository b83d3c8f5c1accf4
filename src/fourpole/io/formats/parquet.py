"""Parquet: each column of numbers is a channel; a column of times states the times of all others.

A column's unit is the metadata `unit` or `units` of its Arrow field, or else the file's metadata `units` (a JSON object
by columns, also as pandas keeps `DataFrame.attrs`), or else the unit in its name, as in `F1 [N]`. The times are a
column of timestamps or durations, or else a column called `t` or `time`, if there is exactly one of them. Without one,
the file's metadata `rate` (or `sample_rate`, ...; or the step `dt`, ...) applies. Timestamps become seconds from the
first one.

The footer is read here before polars opens the file: columns must lie in this file, and a page must not unpack to more
memory than allowed.

References
----------
Apache Parquet, "File Format" and "parquet.thrift"; Apache Thrift, "Compact protocol encoding"; Apache Arrow,
"Columnar Format" (Schema.fbs).
"""

from __future__ import annotations

import base64
import binascii
import json
import os
import struct
import threading
from collections.abc import Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from fourpole.errors import TableError
from fourpole.io.formats.attributes import RATES, STEPS, UNITS
from fourpole.io.formats.guard import afford, find, is_time, of_name, tidy, time_scale
from fourpole.io.formats.tracks import OpenFile, Part, Track, remembered, track_format
from fourpole.io.signals import FileInfo, Request, SignalInfo
from fourpole.units import shown

_KIND = "a Parquet file"
_MAGIC, _ENCRYPTED = b"PAR1", b"PARE"
_LARGEST_FOOTER = 1 << 26
_MOST_PAGES = 1_000_000
_LONGEST_PAGE_HEADER = 1 << 16
_DEEPEST = 16
_TICKS = {"ms": 1e3, "us": 1e6, "ns": 1e9}


# --- the footer ---


class _Thrift:
    """Values in Thrift's compact protocol: structures as dictionaries by the numbers of their fields."""

    def __init__(self, content: bytes) -> None:
        self._content, self.at = content, 0

    def _byte(self) -> int:
        if self.at >= len(self._content):
            raise EOFError("a structure ends after its block")
        self.at += 1
        return self._content[self.at - 1]

    def _varint(self) -> int:
        value = shift = 0
        while True:
            byte = self._byte()
            value |= (byte & 0x7F) << shift
            shift += 7
            if byte < 0x80:
                return value
            if shift > 63:
                raise ValueError("a number is too long")

    def _integer(self) -> int:
        value = self._varint()
        return (value >> 1) ^ -(value & 1)

    def _text(self) -> bytes:
        length = self._varint()
        self.at += length
        if self.at > len(self._content):
            raise EOFError("a text ends after its block")
        return self._content[self.at - length : self.at]

    def structure(self, depth: int = 0) -> dict[int, Any]:
        """The structure that begins here."""
        fields: dict[int, Any] = {}
        number = 0
        while head := self._byte():
            number = number + (head >> 4) if head >> 4 else self._integer()
            kind = head & 15
            fields[number] = kind == 1 if kind in (1, 2) else self._value(kind, depth + 1)
        return fields

    def _value(self, kind: int, depth: int) -> Any:
        if depth > _DEEPEST:
            raise ValueError("structures within structures")
        if kind in (1, 2, 3):
            return self._byte()
        if kind in (4, 5, 6):
            return self._integer()
        if kind == 7:
            self.at += 8
            return None
        if kind == 8:
            return self._text()
        if kind in (9, 10):
            head = self._byte()
            count = head >> 4 if head >> 4 < 15 else self._varint()
            return [self._value(head & 15, depth + 1) for _ in range(count)]
        if kind == 11:
            count = self._varint()
            kinds = self._byte() if count else 0
            return [(self._value(kinds >> 4, depth + 1), self._value(kinds & 15, depth + 1)) for _ in range(count)]
        if kind == 12:
            return self.structure(depth)
        raise ValueError(f"a value is of the unknown kind {kind}")


@dataclass(frozen=True)
class _Footer:
    """The footer of the file: its rows, the places of its columns and its metadata."""

    rows: int
    groups: tuple[int, ...]
    """Number of rows of each row group."""
    chunks: dict[str, list[tuple[int, int]]]
    """Place and length of the parts of each column that is not nested [byte]."""
    notes: dict[str, str]
    creator: str


def _footer(file: BinaryIO, name: str, max_bytes: int) -> _Footer:
    end = os.fstat(file.fileno()).st_size
    file.seek(max(end - 8, 0))
    length, magic = struct.unpack("<I4s", file.read(8).rjust(8))
    if magic == _ENCRYPTED:
        raise TableError(f"{name}: is encrypted; save it without encryption")
    if magic != _MAGIC or length > end - 12:
        raise TableError(f"{name}: is cut short: it does not end as {_KIND} does; copy or export it again")
    afford(40 * length, max_bytes, name, "its list of parts")
    if length > _LARGEST_FOOTER:
        raise TableError(f"{name}: has too many parts; save it in larger row groups")
    file.seek(end - 8 - length)
    stated = _Thrift(file.read(length)).structure()
    groups = tuple(int(one[3]) for one in stated.get(4, []))
    chunks: dict[str, list[tuple[int, int]]] = {}
    for group, rows in zip(stated.get(4, []), groups, strict=True):
        for column in group[1]:
            _take(column, rows, chunks, end - 8 - length, name)
    if min(groups, default=0) < 0 or sum(groups) != stated[3]:
        raise TableError(f"{name}: is damaged: declares {stated[3]} rows and has {sum(groups)}; export it again")
    notes = {_decoded(one.get(1)): _decoded(one.get(2)) for one in stated.get(5, [])}
    return _Footer(int(stated[3]), groups, chunks, notes, _decoded(stated.get(6)))


def _take(column: dict[int, Any], rows: int, chunks: dict[str, list[tuple[int, int]]], end: int, name: str) -> None:
    """Add a part of a column to `chunks`; TableError if it lies outside the file."""
    if column.get(1):
        raise TableError(f"{name}: has its samples in another file, which is not read; save it as one file")
    stated = column[3]
    begin, length = min(stated[9], stated.get(11, stated[9]) or stated[9]), stated[7]
    if not 4 <= begin <= begin + length <= end:
        raise TableError(f"{name}: is cut short or damaged: a column lies outside the file; copy or export it again")
    if len(stated[3]) == 1:
        if stated[5] != rows:
            raise TableError(f"{name}: is damaged: a column has {stated[5]} of {rows} values; export it again")
        chunks.setdefault(_decoded(stated[3][0]), []).append((begin, length))


def _decoded(text: Any) -> str:
    return text.decode("utf-8", errors="replace") if isinstance(text, bytes) else ""


def _check_pages(file: BinaryIO, chunks: Sequence[tuple[int, int]], name: str, max_bytes: int) -> None:
    """TableError or FileError if a page of a column lies outside it, or unpacks to more memory than allowed."""
    count = 0
    for begin, length in chunks:
        at = begin
        while at < begin + length:
            count += 1
            file.seek(at)
            reader = _Thrift(file.read(min(_LONGEST_PAGE_HEADER, begin + length - at)))
            head = reader.structure()
            unpacked, packed = head[2], head[3]
            at += reader.at + packed
            if count > _MOST_PAGES or packed < 0 or unpacked < 0 or at > begin + length:
                raise TableError(f"{name}: is damaged: a page lies outside its column; export it again")
            afford(4 * unpacked, max_bytes, name, "one of its pages")


# --- units ---


def _field_units(encoded: str) -> dict[str, str]:
    """Units in the metadata of Arrow fields, by the names of the fields; empty if the metadata cannot be read."""
    try:
        content = base64.b64decode(encoded, validate=True)
        table = _Table(content, 8 + _at(content, 8, "I")) if content[:4] == b"\xff" * 4 else None
        schema = table.table(2) if table else None
        fields = schema.tables(1) if schema else []
        found = {}
        for one in fields:
            stated = {pair.text(0): pair.text(1) for pair in one.tables(6)}
            unit = next((stated[key] for key in UNITS if stated.get(key)), "")
            if unit:
                found[one.text(0)] = unit
    except (binascii.Error, ValueError, struct.error, IndexError):
        return {}
    return found


def _at(content: bytes, at: int, form: str) -> int:
    if at < 0:
        raise ValueError("before the beginning")
    return int(struct.unpack_from(f"<{form}", content, at)[0])


class _Table:
    """A table of a flatbuffer."""

    def __init__(self, content: bytes, at: int) -> None:
        self._content, self._start = content, at

    def _field(self, number: int) -> int:
        """Place of a field in the content; 0 if the table does not have it."""
        lengths = self._start - _at(self._content, self._start, "i")
        place = 4 + 2 * number
        offset = _at(self._content, lengths + place, "H") if place < _at(self._content, lengths, "H") else 0
        return self._start + offset if offset else 0

    def _follow(self, number: int) -> int:
        place = self._field(number)
        return place + _at(self._content, place, "I") if place else 0

    def table(self, number: int) -> _Table | None:
        place = self._follow(number)
        return _Table(self._content, place) if place else None

    def tables(self, number: int) -> list[_Table]:
        place = self._follow(number)
        count = min(_at(self._content, place, "I"), len(self._content) // 4) if place else 0
        places = (place + 4 + 4 * index for index in range(count))
        return [_Table(self._content, one + _at(self._content, one, "I")) for one in places]

    def text(self, number: int) -> str:
        place = self._follow(number)
        length = _at(self._content, place, "I") if place else 0
        return self._content[place + 4 : place + 4 + length].decode("utf-8", errors="replace")


def _units(notes: dict[str, str]) -> dict[str, str]:
    """Units by column, from all places in the file's metadata that may state them."""
    found: dict[str, str] = {}
    stated: list[Any] = [_json(notes[key]) for key in UNITS if key in notes]
    for attributes in (_json(notes.get("PANDAS_ATTRS", "")), _inner(_json(notes.get("pandas", "")), "attributes")):
        stated += [_inner(attributes, key) for key in UNITS]
    for one in stated:
        if isinstance(one, dict):
            found |= {str(key): value for key, value in one.items() if isinstance(value, str)}
    return found | _field_units(notes.get("ARROW:schema", ""))


def _json(text: str) -> Any:
    try:
        return json.loads(text) if text else None
    except (ValueError, RecursionError):
        return None


def _inner(value: Any, key: str) -> Any:
    return value.get(key) if isinstance(value, dict) else None


def _rate(notes: dict[str, str]) -> float | None:
    """The rate that the file's metadata state [Hz]; None if they state none."""
    for keys, inverse in ((RATES, False), (STEPS, True)):
        for key in keys:
            value = _json(notes.get(key, ""))
            if isinstance(value, int | float) and not isinstance(value, bool) and 1e-12 < value < 1e12:
                return 1.0 / value if inverse else float(value)
    return None


# --- columns ---


@dataclass(frozen=True)
class _Column:
    name: str
    unit: str | None
    kind: str
    """numbers, moments (timestamps), durations or other."""
    ticks: float
    """Units of a stored moment or duration per second."""


#: The standard error output belongs to the process: only one thread at a time may redirect it.
_REDIRECTING = threading.Lock()


@contextmanager
def _silenced() -> Iterator[None]:
    """Discard what a library that is not written in Python prints to the standard error output."""
    with _REDIRECTING, ExitStack() as stack:
        with suppress(OSError):
            kept = os.dup(2)
            stack.callback(os.close, kept)
            nowhere = os.open(os.devnull, os.O_WRONLY)
            stack.callback(os.close, nowhere)
            os.dup2(nowhere, 2)
            stack.callback(os.dup2, kept, 2)
        yield


class _Content:
    """The columns of an open file whose footer has been checked."""

    def __init__(self, opened: OpenFile) -> None:
        import polars as pl

        self._pl, self._name, self._opened = pl, opened.name, opened
        self.footer = footer = _footer(opened.file, opened.name, opened.max_bytes)
        # `glob=False`: characters such as * and [ in the file's name mean themselves.
        self._scan = pl.scan_parquet(opened.path, glob=False, hive_partitioning=False)
        units = _units(footer.notes)
        self.columns = [self._column(one, kind, units) for one, kind in self.caught(self._scan.collect_schema).items()]
        times = [one for one in self.columns if one.kind in ("moments", "durations")]
        times = times or [one for one in self.columns if one.kind == "numbers" and is_time(one.name)]
        self.time = times[0] if len(times) == 1 else None
        self._firsts: dict[str, int] = {}
        self._whole: dict[str, Any] = {}

    def _column(self, name: str, kind: Any, units: dict[str, str]) -> _Column:
        pl = self._pl
        if name not in self.footer.chunks:
            return _Column(name, None, "other", 1.0)
        if isinstance(kind, pl.Datetime | pl.Duration):
            return _Column(
                name, "s", "moments" if isinstance(kind, pl.Datetime) else "durations", _TICKS[kind.time_unit]
            )
        numeric = kind.is_numeric() or kind == pl.Boolean
        return _Column(name, of_name(name, units.get(name)), "numbers" if numeric else "other", 1.0)

    def caught(self, ask: Any, *arguments: Any, **more: Any) -> Any:
        """The result of a function of polars; ValueError in place of its panic, which is no ordinary exception."""
        try:
            with _silenced():
                return ask(*arguments, **more)
        except self._pl.exceptions.PanicException as error:
            raise ValueError(str(error)) from None

    def part(self, one: _Column, first: int, last: int) -> NDArray[np.float64]:
        """Values of a column from row `first` up to `last`; a missing value is not-a-number."""
        if one.kind == "numbers":
            return self._taken(one, first, last, self._pl.Float64).fill_null(np.nan).to_numpy().astype(np.float64)
        cells = self._taken(one, first, last, self._pl.Int64)
        zero = self._first(one) if one.kind == "moments" else 0
        return (cells - zero).cast(self._pl.Float64).fill_null(np.nan).to_numpy() / one.ticks

    def _first(self, one: _Column) -> int:
        if one.name not in self._firsts:
            known = self._taken(one, 0, min(self.footer.rows, 1 << 20), self._pl.Int64).drop_nulls()
            self._firsts[one.name] = int(known[0]) if len(known) else 0
        return self._firsts[one.name]

    def _taken(self, one: _Column, first: int, last: int, kind: Any) -> Any:
        if (first, last) == (0, self.footer.rows) and one.name in self._whole:
            cells = self._whole.pop(one.name)
        else:
            asked = self._scan.select(self._pl.col(one.name).cast(kind)).slice(first, last - first)
            cells = self.caught(asked.collect).to_series()
        if len(cells) != last - first:
            what = f"column {shown(one.name)} has {first + len(cells)} of {self.footer.rows} values"
            raise TableError(f"{self._name}: is cut short: {what}; copy or export it again")
        return cells

    def _take_whole(self, columns: Iterable[_Column]) -> None:
        """Read columns together, which takes less time than one after the other."""
        pl = self._pl
        kinds = [pl.col(one.name).cast(pl.Float64 if one.kind == "numbers" else pl.Int64) for one in columns]
        self._whole = self.caught(self._scan.select(kinds).collect).to_dict()

    def seconds(self) -> Part | None:
        """The function that reads times of all channels [s]; None if no column states them."""
        time = self.time
        if time is None:
            return None
        scale = time_scale(time.unit, time.name, self._name)
        return remembered(lambda first, last: scale * self.part(time, first, last))

    def track(self, one: _Column, time: Part | None) -> Track:
        def samples(first: int, last: int) -> NDArray[np.float64]:
            return self.part(one, first, last) if last > first else np.empty(0)

        rows = self.footer.rows
        if one == self.time:
            return Track(one.name, one.unit, rows, samples)
        rate = _rate(self.footer.notes) if time is None else None
        return Track(one.name, one.unit, rows, samples, rate, 0.0, time)

    def info(self) -> FileInfo:
        rows, time, ends = self.footer.rows, self.seconds(), None
        if self.time is not None and time is not None and rows:
            self._check(self.time)
            first, last = float(time(0, 1)[0]), float(time(rows - 1, rows)[0])
            ends = (first, last) if np.isfinite((first, last)).all() else None
        signals = tuple(self._info(one, ends) for one in self.columns)
        hidden = ("ARROW:schema", "pandas", "PANDAS_ATTRS")
        notes = [f"{tidy(key, 60)}: {tidy(value)}" for key, value in self.footer.notes.items() if key not in hidden]
        written = [f"written by {tidy(self.footer.creator)}"] if self.footer.creator else []
        return FileInfo("Parquet", signals, (*written, *notes[:20]))

    def _info(self, one: _Column, ends: tuple[float, float] | None) -> SignalInfo:
        name, unit, rows = one.name, one.unit, self.footer.rows
        if one.kind == "other":
            return SignalInfo.timed(name, unit, "", rows, note="no numbers")
        if self.time is None or one == self.time:
            rate = _rate(self.footer.notes) if self.time is None else None
            note = "seconds from the first" if one.kind == "moments" else ""
            return SignalInfo.timed(name, unit, "", rows, rate=rate, note=note)
        return SignalInfo.timed(name, unit, "", rows, ends=ends, note=f"time from {tidy(self.time.name)}")

    def tracks(self, request: Request, /, *, whole: bool) -> list[Track]:
        chosen = [self.columns[at] for at in find([("", one.name) for one in self.columns], request)]
        for one in chosen:
            if one.kind == "other":
                raise TableError(f"{self._name}: column {shown(one.name)} holds no numbers; name another column")
        rows = self.footer.rows if whole else max(self.footer.groups, default=0)
        afford(24 * rows * max(len(chosen), 1), self._opened.max_bytes, self._name)
        needed = dict.fromkeys([*chosen, *([self.time] if self.time else [])])
        for one in needed:
            self._check(one)
        if whole and rows:
            self._take_whole(needed)
        time = self.seconds()
        return [self.track(one, time) for one in chosen]

    def _check(self, one: _Column) -> None:
        chunks = self.footer.chunks.get(one.name, [])
        _check_pages(self._opened.file, chunks, self._name, self._opened.max_bytes)


def _recognises(head: bytes) -> bool:
    return head[:4] == _MAGIC


FORMAT = track_format("Parquet", (".parquet", ".pq"), _recognises, _KIND, _Content, by_library=True)
