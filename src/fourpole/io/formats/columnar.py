"""Tables of columns that polars reads, as in Parquet and Arrow: each column of numbers is a channel.

A column's unit is the metadata `unit` or `units` of its Arrow field, or else the file's metadata `units` (a JSON object
by columns, also as pandas keeps `DataFrame.attrs`), or else the unit in its name, as in `F1 [N]`. The times are a
column of timestamps or durations, or else a column called `t` or `time`, if there is exactly one of them. Without one,
the file's metadata `rate` (or `sample_rate`, ...; or the step `dt`, ...) applies. Timestamps become seconds from the
first one.

References
----------
Apache Arrow, "Columnar Format" (Schema.fbs, Message.fbs).
"""

from __future__ import annotations

import json
import struct
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fourpole.errors import TableError
from fourpole.io.formats.guard import RATES, STEPS, UNITS, is_time, of_name, tidy
from fourpole.io.formats.tracks import Content, OpenFile, Part, Track, remembered, times_by
from fourpole.io.signals import FileInfo, Request, Words

_TICKS = {"ms": 1e3, "us": 1e6, "ns": 1e9}
#: Rows among which the first point in time is sought.
_TO_FIRST = 1 << 20
#: Cells of the largest table that is read at once.
_AT_ONCE = 1 << 22
#: Rows of the longest column of words that is read.
_MOST_WORDS = 100_000


# --- units ---


def arrow_schema(content: bytes) -> tuple[dict[str, str], dict[str, str]]:
    """Units in the metadata of the fields, by their names, and the metadata of the table, from a message of Arrow.

    Both are empty if the message cannot be read.
    """
    try:
        table = _Table(content, 8 + _at(content, 8, "I")) if content[:4] == b"\xff" * 4 else None
        schema = table.table(2) if table else None
        fields = schema.tables(1) if schema else []
        found = {}
        for one in fields:
            stated = {pair.text(0): pair.text(1) for pair in one.tables(6)}
            unit = next((stated[key] for key in UNITS if stated.get(key)), "")
            if unit:
                found[one.text(0)] = unit
        return found, {pair.text(0): pair.text(1) for pair in schema.tables(2)} if schema else {}
    except (ValueError, struct.error, IndexError):
        return {}, {}


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


def stated_units(notes: dict[str, str]) -> dict[str, str]:
    """Units by column, from all places in the file's metadata that may state them."""
    found: dict[str, str] = {}
    stated: list[Any] = [_json(notes[key]) for key in UNITS if key in notes]
    for attributes in (_json(notes.get("PANDAS_ATTRS", "")), _inner(_json(notes.get("pandas", "")), "attributes")):
        stated += [_inner(attributes, key) for key in UNITS]
    for one in stated:
        if isinstance(one, dict):
            found |= {str(key): value for key, value in one.items() if isinstance(value, str)}
    return found


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


def caught(ask: Callable[..., Any], *arguments: Any, **more: Any) -> Any:
    """The result of a function of polars; ValueError in place of its panic, which is no ordinary exception."""
    from polars.exceptions import PanicException

    try:
        return ask(*arguments, **more)
    except PanicException as error:
        raise ValueError(str(error)) from None


@dataclass(frozen=True)
class _Columns(Content):
    """The columns of an open file; those of a request are read together, which takes less time than one by one."""

    scan: Any = None
    name: str = ""
    rows: int = 0
    clock: Track | None = None

    def info(self) -> FileInfo:
        """The description of the file and its channels."""
        _check_rows(self.scan, self.rows, self.name)
        return super().info()

    def asked(self, request: Request) -> list[Track]:
        """The columns of a request, and their times."""
        found = super().asked(request)
        clock = self.clock if any(one.time for one in found) else None
        names = {one.name for one in (*found, *([clock] if clock else []))}
        read = _together(self.scan, caught(self.scan.collect_schema), names, self.name, self.rows)
        time = None if clock is None else times_by(replace(clock, samples=read(clock.name)), self.name)
        return [replace(one, samples=read(one.name), time=time if one.time else None) for one in found]


def _check_rows(scan: Any, declared: int, name: str) -> None:
    """TableError if a table has another number of rows than it declares."""
    import polars as pl

    numbered = scan.with_row_index("fourpole").select(pl.col("fourpole").max())
    last = caught(numbered.collect, engine="streaming").item()
    if declared != (0 if last is None else last + 1):
        what = f"declares {declared} rows and has {0 if last is None else last + 1}"
        raise TableError(f"{name}: is damaged: {what}; copy or export it again")


def _together(scan: Any, schema: Any, names: set[str], name: str, rows: int | None = None) -> Callable[[str], Part]:
    """The function that gives the one which reads a part of a column, of some that are read together.

    If the table declares so many `rows`, this is checked, and a small table is read at once.
    """
    import polars as pl

    kinds = [pl.col(one).cast(pl.Int64 if schema[one].is_temporal() else pl.Float64) for one in schema if one in names]
    query, whole = scan.select(kinds), None
    if rows is not None and rows * len(names) <= _AT_ONCE:
        whole = caught(query.collect)
    if rows is not None and (whole is None or whole.height != rows):
        _check_rows(scan, rows, name)

    part_of = whole.slice if whole is not None else lambda *part: caught(query.slice(*part).collect)
    table: Any = remembered(lambda first, last: part_of(first, last - first))
    firsts: dict[str, int] = {}

    def read(column: str) -> Part:
        def part(first: int, last: int) -> NDArray[np.float64]:
            if first == last:
                return np.empty(0)
            cells, kind = table(first, last)[column], schema[column]
            if not kind.is_temporal():
                return np.asarray(cells.to_numpy())  # a missing value is not-a-number
            if isinstance(kind, pl.Datetime) and column not in firsts:
                known = caught(query.select(column).slice(0, _TO_FIRST).collect)[column].drop_nulls()
                firsts[column] = int(known[0]) if len(known) else 0
            since = (cells - firsts.get(column, 0)).cast(pl.Float64).fill_null(np.nan)
            return np.asarray(since.to_numpy() / _TICKS[kind.time_unit])

        return part

    return read


def columns(scan: Any, opened: OpenFile, form: str, notes: dict[str, str], units: dict[str, str]) -> Content:
    """The columns of an open file.

    Parameters
    ----------
    scan : polars.LazyFrame
        The table.
    opened : OpenFile
    form : str
        Name of the format.
    notes : dict of str to str
        Metadata of the table.
    units : dict of str to str
        Units by column.
    """
    import polars as pl

    schema, rows = caught(scan.collect_schema), int(caught(scan.select(pl.len()).collect).item())
    moments = [one for one, kind in schema.items() if isinstance(kind, pl.Datetime | pl.Duration)]
    numbers = [one for one, kind in schema.items() if kind.is_numeric() or kind == pl.Boolean]
    clocks = moments or [one for one in numbers if is_time(one)]
    clock = clocks[0] if len(clocks) == 1 else None

    def track(one: str) -> Track:
        unit = "s" if one in moments else of_name(one, units.get(one))
        barred = "" if one in moments or one in numbers else "holds no numbers"
        return Track(one, unit, rows, _together(scan, schema, {one}, opened.name)(one), barred=barred)

    timer = None if clock is None else track(clock)
    time, rate = (None, _rate(notes)) if timer is None else (times_by(timer, opened.name), None)
    tracks = []
    for one in map(track, schema):
        note = "seconds from the first" if isinstance(schema[one.name], pl.Datetime) else ""
        if one.barred or one.name == clock:
            tracks.append(replace(one, note=note))
        else:
            note = note if time is None else f"time from {tidy(clock)}"
            tracks.append(replace(one, rate=rate, time=time, note=note))
    hidden = ("ARROW:schema", "pandas", "PANDAS_ATTRS")
    said = [f"{tidy(key, 60)}: {tidy(value)}" for key, value in notes.items() if key not in hidden]
    texts = [one for one, kind in schema.items() if kind in (pl.String, pl.Categorical) or kind == pl.Enum]

    def words() -> list[Words]:
        if not texts or rows > _MOST_WORDS:
            return []
        cells = caught(scan.select(pl.col(texts).cast(pl.String).fill_null("")).collect)
        return [("", one, cells[one].to_list()) for one in texts]

    return _Columns(
        form, tracks, said[:20], sample_bytes=24, words=words, scan=scan, name=opened.name, rows=rows, clock=timer
    )
