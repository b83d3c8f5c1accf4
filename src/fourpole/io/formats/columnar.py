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
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fourpole.errors import TableError
from fourpole.io.formats.guard import RATES, STEPS, UNITS, find, is_time, of_name, tidy, time_scale
from fourpole.io.formats.tracks import Content, OpenFile, Part, Track, remembered
from fourpole.io.signals import FileInfo, Request, SignalInfo
from fourpole.units import shown

_TICKS = {"ms": 1e3, "us": 1e6, "ns": 1e9}


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
class _Column:
    name: str
    unit: str | None
    kind: str
    """numbers, moments (timestamps), durations or other."""
    ticks: float
    """Units of a stored moment or duration per second."""


class Columns(Content):
    """The columns of an open file.

    Parameters
    ----------
    scan : polars.LazyFrame
        The table.
    opened : OpenFile
    format_ : str
        Name of the format.
    notes : dict of str to str
        Metadata of the table.
    units : dict of str to str
        Units by column.
    """

    sample_bytes = 24

    def __init__(self, scan: Any, opened: OpenFile, format_: str, notes: dict[str, str], units: dict[str, str]) -> None:
        import polars as pl

        super().__init__(opened)
        self._pl = pl
        self._scan, self._format, self._notes = scan, format_, notes
        self._columns = [self._column(one, kind, units) for one, kind in caught(self._scan.collect_schema).items()]
        self.places = [("", one.name) for one in self._columns]
        times = [one for one in self._columns if one.kind in ("moments", "durations")]
        times = times or [one for one in self._columns if one.kind == "numbers" and is_time(one.name)]
        self._time = times[0] if len(times) == 1 else None
        self._firsts: dict[str, int] = {}
        self._whole: dict[str, Any] = {}

    @cached_property
    def rows(self) -> int:
        """Number of rows that the file declares, or that it has if it has been read whole."""
        return int(caught(self._scan.select(self._pl.len()).collect).item())

    def _column(self, name: str, kind: Any, units: dict[str, str]) -> _Column:
        pl = self._pl
        if isinstance(kind, pl.Datetime | pl.Duration):
            return _Column(
                name, "s", "moments" if isinstance(kind, pl.Datetime) else "durations", _TICKS[kind.time_unit]
            )
        numeric = kind.is_numeric() or kind == pl.Boolean
        return _Column(name, of_name(name, units.get(name)), "numbers" if numeric else "other", 1.0)

    def _part(self, one: _Column, first: int, last: int) -> NDArray[np.float64]:
        """Values of a column from row `first` up to `last`; a missing value is not-a-number."""
        if one.kind == "numbers":
            return self._taken(one, first, last, self._pl.Float64).fill_null(np.nan).to_numpy().astype(np.float64)
        cells = self._taken(one, first, last, self._pl.Int64)
        zero = self._first(one) if one.kind == "moments" else 0
        return (cells - zero).cast(self._pl.Float64).fill_null(np.nan).to_numpy() / one.ticks

    def _first(self, one: _Column) -> int:
        if one.name not in self._firsts:
            known = self._taken(one, 0, min(self.rows, 1 << 20), self._pl.Int64).drop_nulls()
            self._firsts[one.name] = int(known[0]) if len(known) else 0
        return self._firsts[one.name]

    def _taken(self, one: _Column, first: int, last: int, kind: Any) -> Any:
        if (first, last) == (0, self.rows) and one.name in self._whole:
            cells = self._whole.pop(one.name)
        else:
            asked = self._scan.select(self._pl.col(one.name).cast(kind)).slice(first, last - first)
            cells = caught(asked.collect).to_series()
        if len(cells) != last - first:
            what = f"column {shown(one.name)} has {first + len(cells)} of {self.rows} values"
            raise TableError(f"{self._name}: is cut short: {what}; copy or export it again")
        return cells

    def _take_whole(self, columns: Iterable[_Column]) -> None:
        """Read columns together, which takes less time than one after the other, or than asking for the rows first."""
        pl = self._pl
        kinds = [pl.col(one.name).cast(pl.Float64 if one.kind == "numbers" else pl.Int64) for one in columns]
        table = caught(self._scan.select(kinds).collect)
        self.rows = table.height
        self._whole = table.to_dict()

    def _check_rows(self) -> None:
        """TableError if the groups of rows have another number of rows than the file declares."""
        pl = self._pl
        numbered = self._scan.with_row_index("fourpole").select(pl.col("fourpole").max())
        last = caught(numbered.collect, engine="streaming").item()
        there = 0 if last is None else int(last) + 1
        if there != self.rows:
            raise TableError(
                f"{self._name}: is damaged: declares {self.rows} rows and has {there}; copy or export it again"
            )

    @cached_property
    def _seconds(self) -> Part | None:
        """The function that reads times of all channels [s]; None if no column states them."""
        time = self._time
        if time is None:
            return None
        scale = time_scale(time.unit, time.name, self._name)
        return remembered(lambda first, last: scale * self._part(time, first, last))

    def track(self, index: int) -> Track:
        """A column as a channel."""
        one, time = self._columns[index], self._seconds

        def samples(first: int, last: int) -> NDArray[np.float64]:
            return self._part(one, first, last) if last > first else np.empty(0)

        if one == self._time:
            return Track(one.name, one.unit, self.rows, samples)
        rate = _rate(self._notes) if time is None else None
        return Track(one.name, one.unit, self.rows, samples, rate, 0.0, time)

    def info(self) -> FileInfo:
        """The description of the file and its columns."""
        rows, time, ends = self.rows, self._seconds, None
        if time is not None and rows:
            first, last = float(time(0, 1)[0]), float(time(rows - 1, rows)[0])
            ends = (first, last) if np.isfinite((first, last)).all() else None
        signals = tuple(self._info(one, ends) for one in self._columns)
        hidden = ("ARROW:schema", "pandas", "PANDAS_ATTRS")
        notes = [f"{tidy(key, 60)}: {tidy(value)}" for key, value in self._notes.items() if key not in hidden]
        return FileInfo(self._format, signals, tuple(notes[:20]))

    def _info(self, one: _Column, ends: tuple[float, float] | None) -> SignalInfo:
        name, unit, rows = one.name, one.unit, self.rows
        if one.kind == "other":
            return SignalInfo.timed(name, unit, "", rows, note="no numbers")
        if self._time is None or one == self._time:
            rate = _rate(self._notes) if self._time is None else None
            note = "seconds from the first" if one.kind == "moments" else ""
            return SignalInfo.timed(name, unit, "", rows, rate=rate, note=note)
        return SignalInfo.timed(name, unit, "", rows, ends=ends, note=f"time from {tidy(self._time.name)}")

    def tracks(self, request: Request, *, whole: bool) -> list[Track]:
        """The channels of a request; if `whole`, they are read together."""
        chosen = [self._columns[at] for at in find(self.places, request)]
        for one in chosen:
            if one.kind == "other":
                raise TableError(f"{self._name}: column {shown(one.name)} holds no numbers; name another column")
        if whole:
            self._take_whole(dict.fromkeys([*chosen, *([self._time] if self._time else [])]))
        else:
            self._check_rows()
        return super().tracks(request, whole=whole)
