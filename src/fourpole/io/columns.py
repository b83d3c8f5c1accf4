"""Columns of numbers out of a recording of 10 000 to some 1 000 000 000 rows, a part of the file at a time.

polars reads what is written plainly. A part that it refuses is read again by the slow way, which takes
padded cells and blank lines, and otherwise names the row, the column and the value that is wrong.
"""

from __future__ import annotations

import csv
import io
import os
import re
from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import date
from itertools import islice
from typing import TYPE_CHECKING, BinaryIO

import numpy as np
from numpy.typing import NDArray

from fourpole.core.arrays import ByValue
from fourpole.errors import TableError
from fourpole.io.clock import is_moment, seconds
from fourpole.io.layout import (
    Layout,
    find_column,
    find_layout,
    is_aside,
    is_missing,
    number,
    plain_numbers,
    split_lines,
    trimmed,
)
from fourpole.io.source import decode, encoding_of, name_of, open_regular
from fourpole.units import shown

if TYPE_CHECKING:
    import polars as pl

__all__ = ["Columns", "Survey", "column_blocks", "read_columns", "survey_columns"]

_HEAD = 32_768
_LARGEST_HEAD = 4_000_000
_TAIL = 4096
_BLOCK = 1 << 18  # bytes that stay in the processor's cache
_PART = 1 << 25  # bytes that are read at a time, and so the longest line
_CHUNK = 20_000
_CELLS = 2_000_000  # of the rows that the slow way holds
_LARGEST_WIDE = 2_000_000_000  # bytes of UTF-16, which is held whole
_UTF8_MARK = b"\xef\xbb\xbf"
_LINE_END = re.compile(rb"\r\n|\r|\n")
_DAY = 86_400.0
_SLASHED = re.compile(rb"(?<![0-9])([0-9]{1,2})/([0-9]{1,2})/([0-9]{4})[T ]")
_UNDATED = re.compile(r"\s*[0-9]{1,2}:")
_NAN_WORDS = ["NaN", "nan", "NAN", "NA", "N/A", "n/a", "#N/A", "null", "NULL", "None", "-"]


@dataclass(frozen=True, eq=False)
class Columns(ByValue):
    """Columns of numbers from a recording.

    Attributes
    ----------
    values : dict of str to (rows,) float array [the column's unit]
        By the names that were asked for; NaN where the file has no value.
    units : dict of str to str or None
        The units that the file states.
    first_row : int
        Number of the first row's line in the file, from 1.
    above : tuple of str
        The lines above the rows that are neither names nor units alone: title, date, rate.
    """

    values: dict[str, NDArray[np.float64]]
    units: dict[str, str | None]
    first_row: int
    above: tuple[str, ...] = ()

    def __getitem__(self, name: str) -> NDArray[np.float64]:
        return self.values[name]

    def __len__(self) -> int:
        return len(next(iter(self.values.values()), ()))


@dataclass(frozen=True)
class Survey:
    """What a recording of text holds, without its numbers.

    Attributes
    ----------
    layout : Layout
    encoding : str
    above : tuple of str
        The lines above the rows that are neither names nor units alone: title, date, rate.
    rows : int
        Lines from the first row on, blank ones at the end left out.
    """

    layout: Layout
    encoding: str
    above: tuple[str, ...]
    rows: int


def survey_columns(path: str | os.PathLike[str], *, max_bytes: int = 4_000_000_000, label: str | None = None) -> Survey:
    """What columns a recording has, and how many rows; see `read_columns`."""
    name = name_of(path, label)
    with open_regular(path, max_bytes=max_bytes, label=label) as file:
        source, layout, encoding, start = _laid_out(file, name)
        above = _above(start, encoding, layout)
        file.seek(0)
        written, _ = encoding_of(file.read(4) if source is not file else start, name)
        rows = _row_count(source, start, layout.first_row)
        return Survey(layout, written, above, rows)


def read_columns(
    path: str | os.PathLike[str],
    names: Sequence[str],
    *,
    max_bytes: int = 4_000_000_000,
    label: str | None = None,
) -> Columns:
    r"""Read some columns of a recording as floats.

    Parameters
    ----------
    path : path
        A regular file of text: comma, semicolon, tab or white space between the cells, a header, and
        perhaps a row of units below it. A column of times of day, with or without dates, gives the
        seconds from the first one.
    names : sequence of str
        The columns to read, as in the header, with or without their unit, in any case.
    max_bytes : int [byte]
        A larger file is refused.
    label : str, optional
        The file's name in messages; by default the last part of the path.

    Returns
    -------
    Columns

    Raises
    ------
    FileError
        If the file is missing, no regular file or too large.
    TableError
        If a column is missing or ambiguous, a cell holds text, or a row has too many or too few cells.

    Examples
    --------
    >>> import tempfile, pathlib
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = pathlib.Path(folder, "D1.csv")
    ...     _ = file.write_text("t [s],F1 [N],V1\n0,1.5,0.1\n0.001,,0.2\n")
    ...     recording = read_columns(file, ["t", "F1"])
    >>> recording["F1"].tolist(), recording.units
    ([1.5, nan], {'t': 's', 'F1': 'N'})
    """
    with _opened(path, names, max_bytes, label) as (source, start, table):
        found = _joined(list(_parts(source, start, table)))
    values = {one: found.get(index, np.empty(0)) for one, index in table.wanted.items()}
    if any(not len(column) for column in values.values()):
        raise table.empty()
    return Columns(values, table.units, table.layout.first_row)


def _laid_out(file: BinaryIO, name: str) -> tuple[BinaryIO, Layout, str, bytes]:
    """A recording to be read, its layout and encoding, and its first lines."""
    source: BinaryIO = file
    start, whole = _head(file, name)
    encoding, mark = encoding_of(start, name)
    if encoding.startswith("utf-16"):
        if os.fstat(file.fileno()).st_size > _LARGEST_WIDE:
            most = f"{_LARGEST_WIDE / 1e9:g} GB"
            raise TableError(f"{name}: is text in UTF-16, of which no more than {most} is read; save it as UTF-8")
        text, _ = decode(start + file.read(), name)
        source, encoding, mark = io.BytesIO(text.encode()), "utf-8", 0
        start, whole = _head(source, name)
    lines = split_lines(start[mark:].decode(encoding, errors="replace"))
    return source, find_layout(lines if whole else lines[:-1], name), encoding, start


def _above(start: bytes, encoding: str, layout: Layout) -> tuple[str, ...]:
    """The lines above the rows, less the header."""
    lines = split_lines(start.removeprefix(_UTF8_MARK).decode(encoding, errors="replace"))[: layout.first_row - 1]
    return tuple(line for at, line in enumerate(lines, 1) if at != layout.header_line)


def _row_count(file: BinaryIO, start: bytes, first_row: int) -> int:
    """Lines from the first row on, blank ones at the end left out."""
    ending = b"\n" if b"\n" in start else b"\r"
    file.seek(_line_start(start, first_row))
    count, last = 0, ending
    while block := file.read(_BLOCK):
        count += int(np.count_nonzero(np.frombuffer(block, dtype=np.uint8) == ending[0]))
        last = block[-1:]
    return max(count + (last != ending) - _blank_lines_at_end(file, ending), 0)


def _head(file: BinaryIO, name: str) -> tuple[bytes, bool]:
    """The first lines of a file, at least a few, and whether they are all of it."""
    start = file.read(_HEAD)
    while start.count(b"\n") + start.count(b"\r") < 4:
        more = file.read(len(start))
        start += more
        if not more:
            return start, True
        if len(start) > _LARGEST_HEAD:
            raise TableError(f"{name}: the first lines have more than {len(start)} bytes; this is no table of text")
    return start, len(start) < _HEAD


Values = dict[int, NDArray[np.float64]]
"""Columns by their place in the table."""


class _Clock:
    """A column of times of day, part by part, as seconds from the first of them."""

    def __init__(self, day_first: bool) -> None:
        self._day_first = day_first
        self._zero: str | None = None
        self.state = (0.0, np.nan)
        """Midnights passed, and the last time of day."""

    def seconds(self, cells: pl.Series) -> NDArray[np.float64]:
        """NaN where a cell holds none."""
        import polars as pl

        if self._zero is None:
            self._zero = next((cell for cell in cells if cell is not None and is_moment(cell)), None)
            if self._zero is None:
                return np.full(len(cells), np.nan)
        cells = pl.Series([self._zero], dtype=pl.String).append(cells)
        undated = _UNDATED.match(self._zero) is not None
        if undated:
            cells = "2000-01-01 " + cells.str.strip_chars()
        else:
            how = "${3}-${2}-${1}" if self._day_first else "${3}-${1}-${2}"
            cells = cells.str.replace(r"^\s*([0-9]{1,2})/([0-9]{1,2})/([0-9]{4})", how)
        since = seconds(cells)[1:]
        known = np.flatnonzero(np.isfinite(since))
        if undated and len(known):
            days, last = self.state
            passed = days + np.cumsum(np.diff(since[known], prepend=last) < -_DAY / 2)
            self.state = float(passed[-1]), float(since[known[-1]])
            since[known] += _DAY * passed
        return since


@dataclass(frozen=True)
class _Table:
    """A recording that is being read: its layout, and what is wanted of it."""

    layout: Layout
    encoding: str
    wanted: dict[str, int]
    clocks: dict[int, _Clock]
    name: str
    above: tuple[str, ...]

    @property
    def numbers(self) -> set[int]:
        """The wanted columns that are no times of day."""
        return set(self.wanted.values()) - set(self.clocks)

    @property
    def units(self) -> dict[str, str | None]:
        return {one: "s" if at in self.clocks else self.layout.units[at] for one, at in self.wanted.items()}

    def empty(self) -> TableError:
        return TableError(f"{self.name}: has a header (line {self.layout.header_line}) but no row below it")


def column_blocks(
    path: str | os.PathLike[str],
    names: Sequence[str],
    rows: int,
    *,
    max_bytes: int = 4_000_000_000,
    label: str | None = None,
) -> Iterator[Columns]:
    r"""Read some columns of a recording piece by piece; together they are what `read_columns` gives.

    Parameters
    ----------
    path, names, max_bytes, label
        As for `read_columns`.
    rows : int
        Rows of each piece but the last, which has the rest; at least 1.

    Yields
    ------
    Columns
        The next rows; `first_row` is that of the recording.

    Raises
    ------
    FileError, TableError
        As `read_columns`, when the row that is wrong is reached.

    Examples
    --------
    >>> import tempfile, pathlib
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = pathlib.Path(folder, "D1.csv")
    ...     _ = file.write_text("t [s],F1 [N]\n0,1.5\n0.001,2\n0.002,2.5\n")
    ...     [block["F1"].tolist() for block in column_blocks(file, ["F1"], 2)]
    [[1.5, 2.0], [2.5]]
    """
    with _opened(path, names, max_bytes, label) as (source, start, table):
        empty = True
        for values in _cut(_parts(source, start, table), max(rows, 1)):
            empty = False
            found = {one: values[index] for one, index in table.wanted.items()}
            yield Columns(found, table.units, table.layout.first_row, table.above)
        if empty and names:
            raise table.empty()


@contextmanager
def _opened(
    path: str | os.PathLike[str], names: Sequence[str], max_bytes: int, label: str | None
) -> Iterator[tuple[BinaryIO, bytes, _Table]]:
    """A recording to be read, its first lines, and what is to be read of it."""
    name = name_of(path, label)
    with open_regular(path, max_bytes=max_bytes, label=label) as file:
        source, layout, encoding, start = _laid_out(file, name)
        wanted = {one: find_column(layout.names, one, name) for one in names}
        clocks = layout.clocks.intersection(wanted.values())
        day_first = not clocks or _is_day_first(source, start, layout, name)
        made = {at: _Clock(day_first) for at in clocks}
        yield source, start, _Table(layout, encoding, wanted, made, name, _above(start, encoding, layout))


def _is_day_first(source: BinaryIO, start: bytes, layout: Layout, name: str) -> bool:
    """Whether 01/02/2024 is in February: what reads more of the dates is right, else the shorter recording."""
    offset = _line_start(start, layout.first_row)
    if _SLASHED.search(start, offset) is None:
        return True
    source.seek(offset)
    found: set[tuple[bytes, ...]] = set()
    for part in _lines(source, b"\n" if b"\n" in start else b"\r", name):
        found.update(_SLASHED.findall(part))
    dates = [tuple(map(int, one)) for one in found]
    return _likely((y, m, d) for d, m, y in dates) >= _likely((y, m, d) for m, d, y in dates)


def _likely(dates: Iterable[tuple[int, int, int]]) -> tuple[int, int]:
    days = []
    for one in dates:
        try:
            days.append(date(*one).toordinal())
        except ValueError:
            continue
    return len(days), min(days, default=0) - max(days, default=0)


def _parts(source: BinaryIO, start: bytes, table: _Table) -> Iterator[Values]:
    """The columns, part of the file by part: quickly where it is written plainly, else row by row."""
    line = table.layout.first_row
    offset = _line_start(start, line)
    ending = b"\n" if b"\n" in start else b"\r"
    if table.layout.delimiter != " ":
        source.seek(offset)
        for part in _lines(source, ending, table.name):
            if b'"' in part or (ending == b"\r" and b"\n" in part):
                break  # what a quote means depends on what is before it, and so where a row ends
            values = _quickly(part, ending, table)
            if values is not None:
                line += _length(values)
                yield values
            else:
                yield from _slowly(io.BytesIO(part), line, table)
                line += len(_LINE_END.findall(part))
            offset += len(part)
        else:
            return
    source.seek(offset)
    yield from _slowly(source, line, table)


def _lines(source: BinaryIO, ending: bytes, name: str) -> Iterator[bytes]:
    """The rest of a file in parts of whole lines, without the blank lines at its end."""
    held = rest = b""
    while block := source.read(_PART - len(rest)):
        cut = block.rfind(ending) + 1
        if cut:
            if held:
                yield held
            held, rest = rest + block[:cut], block[cut:]
        elif len(rest) + len(block) >= _PART:
            raise _too_long(name)
        else:
            rest += block
    held += rest
    filled = len(held.rstrip())
    end = held.find(ending, filled)
    if filled:
        yield held if end < 0 else held[: end + 1]


def _each_line(text: io.TextIOWrapper, name: str) -> Iterator[str]:
    while line := text.readline(_PART):
        if len(line) >= _PART:
            raise _too_long(name)
        yield line


def _too_long(name: str) -> TableError:
    return TableError(f"{name}: has a line of more than {_PART} bytes; this is no table of text")


def _cut(parts: Iterator[Values], rows: int) -> Iterator[Values]:
    """The same rows in pieces of equal length."""
    held: deque[Values] = deque()
    count = 0
    for part in parts:
        held.append(part)
        count += _length(part)
        while count >= rows:
            yield _taken(held, rows)
            count -= rows
    if count:
        yield _taken(held, count)


def _taken(held: deque[Values], rows: int) -> Values:
    """The next rows, taken off what is held."""
    found: list[Values] = []
    while rows:
        part = held.popleft()
        left = max(_length(part) - rows, 0)
        if left:
            held.appendleft({index: column[-left:] for index, column in part.items()})
            part = {index: column[:-left].copy() for index, column in part.items()}  # else it keeps the whole part
        rows -= _length(part)
        found.append(part)
    return _joined(found)


def _joined(parts: list[Values]) -> Values:
    if len(parts) == 1:
        return parts[0]
    return {index: np.concatenate([part[index] for part in parts]) for index in (parts[0] if parts else ())}


def _length(values: Values) -> int:
    return len(next(iter(values.values()), ()))


def _plain_frame(
    part: bytes, ending: bytes, layout: Layout, numbers: set[int], indices: list[int]
) -> pl.DataFrame | None:
    """Some columns as polars reads them, those of numbers as such; None where it cannot."""
    import polars as pl  # here: it takes half a second

    schema = {str(index): pl.Float64() if index in numbers else pl.String() for index in range(layout.width)}
    for words in (None, _NAN_WORDS):  # looking for words makes it a quarter slower
        try:
            return pl.read_csv(
                part,
                has_header=False,
                columns=indices,
                schema=schema,
                separator=layout.delimiter,
                eol_char=ending.decode(),
                quote_char=None,
                null_values=words,
                decimal_comma=layout.decimal == ",",
            )
        except (pl.exceptions.PolarsError, pl.exceptions.PanicException, ValueError, OSError):
            continue
    return None


def _quickly(part: bytes, ending: bytes, table: _Table) -> Values | None:
    """The columns as polars reads them; None if anything is not as plain as it must be."""
    if not table.wanted or part.count(b"\r") > (part.count(b"\r\n") if ending == b"\n" else len(part)):
        return None  # two kinds of line end
    layout, numbers = table.layout, table.numbers
    last = layout.width - 1
    indices = sorted({*table.wanted.values(), last})
    frame = _plain_frame(part, ending, layout, numbers, indices)
    if frame is None:
        return None
    # To polars a row with too few cells ends in nulls, and of one with too many it may not read the rest.
    if (len(indices) < layout.width or frame[str(last)].null_count()) and not _is_full(part, ending, layout):
        return None
    columns = {index: frame[str(index)].to_numpy() for index in numbers}
    if any(np.isinf(column).any() for column in columns.values()):
        return None
    states = {index: clock.state for index, clock in table.clocks.items()}
    for index, clock in table.clocks.items():
        columns[index] = clock.seconds(frame[str(index)])
    if any(np.isnan(columns[index]).any() for index in table.clocks):
        for index, clock in table.clocks.items():
            clock.state = states[index]
        return None
    return columns


def _line_start(start: bytes, line: int) -> int:
    """Where a line begins, lines counted from 1."""
    ends = islice(_LINE_END.finditer(start), line - 1)
    return max((end.end() for end in ends), default=len(_UTF8_MARK) if start.startswith(_UTF8_MARK) else 0)


def _blank_lines_at_end(file: BinaryIO, ending: bytes) -> int:
    """Blank lines after the last row, those in a small block."""
    size = file.seek(0, os.SEEK_END)
    file.seek(max(0, size - _TAIL))
    lines = file.read().split(ending)
    if not lines[-1]:
        lines.pop()
    return next((count for count, line in enumerate(reversed(lines)) if line.strip()), 0)


def _is_full(part: bytes, ending: bytes, layout: Layout) -> bool:
    """Whether each line has as many delimiters as a full row, one column alone something in each line."""
    content = np.frombuffer(part, dtype=np.uint8)
    if layout.width == 1:
        return False
    ends = content == ending[0]
    signs = ends[ends | (content == ord(layout.delimiter))]
    if not part.endswith(ending):
        signs = np.append(signs, True)
    if len(signs) % layout.width:
        return False
    rows = signs.reshape(-1, layout.width)
    return bool(rows[:, -1].all()) and np.count_nonzero(rows) == len(rows)


def _slowly(file: BinaryIO, line: int, table: _Table) -> Iterator[Values]:
    """The columns row by row from a line on; TableError names the first that cannot be read."""
    import polars as pl

    text = io.TextIOWrapper(file, encoding=table.encoding, errors="replace")
    layout, name = table.layout, table.name
    try:
        rows = _full_rows(text, line, layout, name)
        while chunk := list(islice(rows, max(min(_CHUNK, _CELLS // layout.width), 1))):
            values = {index: _floats(chunk, index, layout, name) for index in table.numbers}
            for index, clock in table.clocks.items():
                cells = _moments(chunk, index, layout, name)
                values[index] = clock.seconds(pl.Series(cells, dtype=pl.String))
                _check_moments(chunk, cells, values[index], index, table)
            yield values
    finally:
        text.detach()


def _full_rows(text: io.TextIOWrapper, line: int, layout: Layout, name: str) -> Iterator[tuple[int, list[str]]]:
    """Rows with the numbers of their lines; blank lines and comments are passed over."""
    before = line - 1
    if layout.delimiter == " ":
        rows: Iterator[list[str]] = (one.split() for one in _each_line(text, name))
        numbered = ((before + count, row) for count, row in enumerate(rows, 1))
    else:
        reader = csv.reader(_each_line(text, name), delimiter=layout.delimiter, skipinitialspace=True)
        numbered = ((before + reader.line_num, row) for row in reader)
    line = before
    try:
        for line, row in numbered:
            cells = trimmed(row, layout.width)
            if len(cells) == layout.width and not (layout.width == 1 and is_aside(cells[0])):
                yield line, cells
            elif cells and not is_aside("".join(cells)):
                _ragged(cells, line, layout, name)
    except csv.Error as error:
        raise TableError(f"{name} row {line + 1}: cannot be parted into cells ({error}); mend or remove it") from None


def _ragged(cells: list[str], line: int, layout: Layout, name: str) -> None:
    found = f"{len(cells)} cell{'s' if len(cells) > 1 else ''} ({shown(layout.delimiter.join(cells), 40)})"
    raise TableError(f"{name} row {line}: has {found} where the header has {layout.width}; mend or remove it")


def _moments(chunk: list[tuple[int, list[str]]], index: int, layout: Layout, name: str) -> list[str | None]:
    """One column of times of day of some rows, None where there is none."""
    cells: list[str | None] = []
    for line, row in chunk:
        if is_moment(row[index]):
            cells.append(row[index])
        elif is_missing(row[index]):
            cells.append(None)
        else:
            where = f"{name} row {line}, column {shown(layout.names[index])}"
            raise TableError(f"{where}: {shown(row[index])} is no time of day as those above it are; mend it")
    return cells


def _check_moments(
    chunk: list[tuple[int, list[str]]],
    cells: list[str | None],
    found: NDArray[np.float64],
    index: int,
    table: _Table,
) -> None:
    for (line, _), cell, value in zip(chunk, cells, found, strict=True):
        if cell is not None and np.isnan(value):
            where = f"{table.name} row {line}, column {shown(table.layout.names[index])}"
            raise TableError(f"{where}: {shown(cell)} is no time of day, or not written as the first one; mend it")


def _floats(chunk: list[tuple[int, list[str]]], index: int, layout: Layout, name: str) -> NDArray[np.float64]:
    """One column of some rows."""
    cells = [row[index] for _, row in chunk]
    values = plain_numbers(cells)
    if values is not None:
        return values
    values = np.full(len(cells), np.nan)
    for at, cell in enumerate(cells):
        value = number(cell, layout.decimal)
        if value is not None:
            values[at] = value
        elif not is_missing(cell):
            where = f"{name} row {chunk[at][0]}, column {shown(layout.names[index])}"
            raise TableError(f"{where}: {shown(cell)} is no number; mend it, or leave it blank if it is not known")
    return values
