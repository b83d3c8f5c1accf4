"""Parquet: each column of numbers is a channel, one of times the time of all the others.

A column's unit is the metadata `unit` or `units` of its Arrow field, else what the file's metadata `units` (a JSON
object by columns, also as pandas keeps `DataFrame.attrs`) has for it, else that in its name: `F1 [N]`. Its time is a
column of timestamps or durations, else one called `t` or `time`, if there is one of them; without one, the file's
metadata `rate` (or `sample_rate`, ...; or the step `dt`, ...) counts. Timestamps become the seconds from the first.

Before polars sees the file, its footer is read here: columns must lie in the file and in no other, and a page
must not unpack to more than may be held.

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
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from fourpole.errors import TableError
from fourpole.io.formats.guard import Guard, afford, find, is_time, of_name, seconds, tidy
from fourpole.io.formats.pieces import Part, Track, by_tracks, remembered
from fourpole.io.signals import MAX_FILE_BYTES, FileInfo, Format, Request, SignalInfo
from fourpole.io.source import name_of, open_regular
from fourpole.units import shown

__all__ = ["FORMAT"]

_KIND = "a Parquet file"
_MAGIC, _ENCRYPTED = b"PAR1", b"PARE"
_LARGEST_FOOTER = 1 << 26
_MOST_PAGES = 1_000_000
_LONGEST_PAGE_HEADER = 1 << 16
_DEEPEST = 16
_UNITS = ("unit", "units", "Unit", "Units")
_RATES = ("rate", "sample_rate", "sampling_rate", "samplerate", "fs", "Fs", "sampling_frequency")
_STEPS = ("dt", "increment", "step", "sample_interval")
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
    """What the end of the file says of it."""

    rows: int
    groups: tuple[int, ...]
    """Rows of each row group."""
    chunks: dict[str, list[tuple[int, int]]]
    """Where the parts of each column that is not nested are, and their length."""
    notes: dict[str, str]
    creator: str


def _footer(file: BinaryIO, name: str, max_bytes: int) -> _Footer:
    end = os.fstat(file.fileno()).st_size
    if file.read(4) != _MAGIC or end < 12:
        raise TableError(f"{name}: is not {_KIND}: it does not begin as one; check what wrote it")
    file.seek(end - 8)
    length, magic = struct.unpack("<I4s", file.read(8))
    if magic == _ENCRYPTED:
        raise TableError(f"{name}: is encrypted; save it without encryption")
    if magic != _MAGIC or length > end - 12:
        raise TableError(f"{name}: is cut short: it does not end as {_KIND} does; copy or export it again")
    afford(40 * length, max_bytes, name, "its list of parts")
    if length > _LARGEST_FOOTER:
        raise TableError(f"{name}: has too many parts; save it in larger row groups")
    file.seek(end - 8 - length)
    said = _Thrift(file.read(length)).structure()
    groups = tuple(int(one[3]) for one in said.get(4, []))
    chunks: dict[str, list[tuple[int, int]]] = {}
    for group, rows in zip(said.get(4, []), groups, strict=True):
        for column in group[1]:
            _take(column, rows, chunks, end - 8 - length, name)
    if min(groups, default=0) < 0 or sum(groups) != said[3]:
        raise TableError(f"{name}: is damaged: declares {said[3]} rows and has {sum(groups)}; export it again")
    notes = {_told(one.get(1)): _told(one.get(2)) for one in said.get(5, [])}
    return _Footer(int(said[3]), groups, chunks, notes, _told(said.get(6)))


def _take(column: dict[int, Any], rows: int, chunks: dict[str, list[tuple[int, int]]], end: int, name: str) -> None:
    """Add a part of a column, if it lies where it may."""
    if column.get(1):
        raise TableError(f"{name}: has its samples in another file, which is not read; save it as one file")
    said = column[3]
    begin, length = min(said[9], said.get(11, said[9]) or said[9]), said[7]
    if not 4 <= begin <= begin + length <= end:
        raise TableError(f"{name}: is cut short or damaged: a column lies outside the file; copy or export it again")
    if len(said[3]) == 1:
        if said[5] != rows:
            raise TableError(f"{name}: is damaged: a column has {said[5]} of {rows} values; export it again")
        chunks.setdefault(_told(said[3][0]), []).append((begin, length))


def _told(text: Any) -> str:
    return text.decode("utf-8", errors="replace") if isinstance(text, bytes) else ""


def _check_pages(file: BinaryIO, chunks: Sequence[tuple[int, int]], name: str, max_bytes: int) -> None:
    """Walk over the pages of a column."""
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
    """Units in the metadata of Arrow fields, by the fields' names."""
    try:
        content = base64.b64decode(encoded, validate=True)
        table = _Table(content, 8 + _at(content, 8, "I")) if content[:4] == b"\xff" * 4 else None
        schema = table.table(2) if table else None
        fields = schema.tables(1) if schema else []
        found = {}
        for one in fields:
            stated = {pair.text(0): pair.text(1) for pair in one.tables(6)}
            unit = next((stated[key] for key in _UNITS if stated.get(key)), "")
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
        """Where a field is; 0 where it is not stated."""
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
    """Units by column, from all that the file's metadata say."""
    found: dict[str, str] = {}
    stated: list[Any] = [_json(notes[key]) for key in _UNITS if key in notes]
    for attributes in (_json(notes.get("PANDAS_ATTRS", "")), _inner(_json(notes.get("pandas", "")), "attributes")):
        stated += [_inner(attributes, key) for key in _UNITS]
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
    """The rate that the file's metadata state."""
    for keys, inverse in ((_RATES, False), (_STEPS, True)):
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
    """numbers, moments (timestamps), lengths (of time) or other."""
    ticks: float
    """Of moments and lengths, in a second."""


_LISTENING = threading.Lock()


@contextmanager
def _unheard() -> Iterator[None]:
    """Keep from the terminal what a library prints that is not written in Python."""
    with _LISTENING, ExitStack() as stack:
        with suppress(OSError):
            kept = os.dup(2)
            stack.callback(os.close, kept)
            nowhere = os.open(os.devnull, os.O_WRONLY)
            stack.callback(os.close, nowhere)
            os.dup2(nowhere, 2)
            stack.callback(os.dup2, kept, 2)
        yield


class _File:
    """A file that has passed the check of its footer."""

    def __init__(self, path: Path, footer: _Footer, name: str) -> None:
        import polars as pl

        self._pl, self._name, self.footer = pl, name, footer
        # The name is that of one file, however many signs it has that mean more than themselves.
        self._scan = pl.scan_parquet(path, glob=False, hive_partitioning=False)
        units = _units(footer.notes)
        self.columns = [self._column(one, kind, units) for one, kind in self.caught(self._scan.collect_schema).items()]
        times = [one for one in self.columns if one.kind in ("moments", "lengths")]
        times = times or [one for one in self.columns if one.kind == "numbers" and is_time(one.name)]
        self.time = times[0] if len(times) == 1 else None
        self._firsts: dict[str, int] = {}

    def _column(self, name: str, kind: Any, units: dict[str, str]) -> _Column:
        pl = self._pl
        if name not in self.footer.chunks:
            return _Column(name, None, "other", 1.0)
        if isinstance(kind, pl.Datetime | pl.Duration):
            return _Column(name, "s", "moments" if isinstance(kind, pl.Datetime) else "lengths", _TICKS[kind.time_unit])
        numeric = kind.is_numeric() or kind == pl.Boolean
        return _Column(name, of_name(name, units.get(name)), "numbers" if numeric else "other", 1.0)

    def caught(self, ask: Any, *arguments: Any, **more: Any) -> Any:
        """What polars answers; a panic is no ordinary exception, and is told to whoever may listen."""
        try:
            with _unheard():
                return ask(*arguments, **more)
        except self._pl.exceptions.PanicException as error:
            raise ValueError(str(error)) from None

    def part(self, one: _Column, first: int, last: int) -> NDArray[np.float64]:
        """Some values of a column; those that are missing are not-a-number."""
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
        asked = self._scan.select(self._pl.col(one.name).cast(kind)).slice(first, last - first)
        cells = self.caught(asked.collect).to_series()
        if len(cells) != last - first:
            said = f"column {shown(one.name)} has {first + len(cells)} of {self.footer.rows} values"
            raise TableError(f"{self._name}: is cut short: {said}; copy or export it again")
        return cells

    def seconds(self) -> Part | None:
        """The times of all channels."""
        time = self.time
        if time is None:
            return None
        scale = seconds(time.unit)
        if scale is None:
            what = f"has the unit {shown(time.unit)}; state it in s, ms or µs"
            raise TableError(f"{self._name}: the time {shown(time.name)} {what}")
        return remembered(lambda first, last: scale * self.part(time, first, last))

    def track(self, one: _Column, time: Part | None) -> Track:
        def samples(first: int, last: int) -> NDArray[np.float64]:
            return self.part(one, first, last) if last > first else np.empty(0)

        rows = self.footer.rows
        if one == self.time:
            return Track(one.name, one.unit, rows, samples)
        rate = _rate(self.footer.notes) if time is None else None
        return Track(one.name, one.unit, rows, samples, rate, 0.0, time)


def _recognises(head: bytes) -> bool:
    return head[:4] == _MAGIC


def _survey(path: Path, label: str, max_bytes: int) -> FileInfo:
    name = name_of(path, label)
    with open_regular(path, max_bytes=max(max_bytes, MAX_FILE_BYTES), label=label) as file, Guard(name, _KIND):
        content = _File(path, _footer(file, name, max_bytes), name)
        rows, rate = content.footer.rows, _rate(content.footer.notes)
        start, length = (0.0, max(rows - 1, 0) / rate) if rate and content.time is None else (None, None)
        if content.time is not None and rows and (time := content.seconds()) is not None:
            _check_pages(file, content.footer.chunks[content.time.name], name, max_bytes)
            ends = float(time(0, 1)[0]), float(time(rows - 1, rows)[0])
            start, length = (ends[0], ends[1] - ends[0]) if np.isfinite(ends).all() else (None, None)
        signals = []
        for one in content.columns:
            timed = one != content.time and one.kind != "other"
            note = "no numbers" if one.kind == "other" else "seconds from the first" if one.kind == "moments" else ""
            if timed and content.time is not None:
                note = f"time from {tidy(content.time.name)}"
            even = rate if timed and content.time is None else None
            signals.append(
                SignalInfo(
                    one.name, one.unit, "", rows, even, start if timed else None, length if timed else None, note
                )
            )
        hidden = ("ARROW:schema", "pandas", "PANDAS_ATTRS")
        said = [f"{tidy(key, 60)}: {tidy(value)}" for key, value in content.footer.notes.items() if key not in hidden]
        written = [f"written by {tidy(content.footer.creator)}"] if content.footer.creator else []
        return FileInfo("Parquet", tuple(signals), (*written, *said[:20]))


@contextmanager
def _tracks(request: Request, _: Guard, *, whole: bool) -> Iterator[list[Track]]:
    """The channels of a request, of which any part can be read."""
    name = name_of(request.path, request.label)
    with open_regular(request.path, max_bytes=request.max_file_bytes, label=request.label) as file:
        content = _File(request.path, _footer(file, name, request.max_bytes), name)
        chosen = [content.columns[at] for at in find([("", one.name) for one in content.columns], request)]
        for one in chosen:
            if one.kind == "other":
                raise TableError(f"{name}: column {shown(one.name)} holds no numbers; name another column")
        rows = content.footer.rows if whole else max(content.footer.groups, default=0)
        afford(24 * rows * max(len(chosen), 1), request.max_bytes, name)
        for one in {*chosen, *([content.time] if content.time else [])}:
            _check_pages(file, content.footer.chunks.get(one.name, []), name, request.max_bytes)
        time = content.seconds()
        yield [content.track(one, time) for one in chosen]


_read, _blocks = by_tracks(_KIND, "", _tracks)
FORMAT = Format("Parquet", (".parquet", ".pq"), _recognises, _survey, _read, blocks=_blocks)
