"""Columns of numbers out of a recording of 10 000 to 10 000 000 rows.

polars reads what is written plainly. What it refuses is read again by the slow way, which takes
padded cells and blank lines, and otherwise names the row, the column and the value that is wrong.
"""

from __future__ import annotations

import csv
import io
import mmap
import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import islice
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from fourpole.errors import TableError
from fourpole.io.clock import is_moment, seconds
from fourpole.io.layout import (
    Layout,
    find_column,
    find_layout,
    is_aside,
    is_missing,
    number,
    split_lines,
    trimmed,
)
from fourpole.io.source import decode, encoding_of, name_of, open_regular
from fourpole.units import shown

__all__ = ["Columns", "Survey", "read_columns", "survey_columns"]

_HEAD = 32_768
_LARGEST_HEAD = 4_000_000
_TAIL = 4096
_BLOCK = 1 << 18  # bytes that stay in the processor's cache
_CHUNK = 20_000
_UTF8_MARK = b"\xef\xbb\xbf"
_NAN_WORDS = ["NaN", "nan", "NAN", "NA", "N/A", "n/a", "#N/A", "null", "NULL", "None", "-"]


@dataclass(frozen=True)
class Columns:
    """Columns of numbers from a recording.

    Attributes
    ----------
    values : dict of str to (rows,) float array [the column's unit]
        By the names that were asked for; NaN where the file has no value.
    units : dict of str to str or None
        The units that the file states.
    first_row : int
        Number of the first row's line in the file, from 1.
    """

    values: dict[str, NDArray[np.float64]]
    units: dict[str, str | None]
    first_row: int

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
        lines = split_lines(start.removeprefix(_UTF8_MARK).decode(encoding, errors="replace"))[: layout.first_row - 1]
        above = tuple(line for at, line in enumerate(lines, 1) if at != layout.header_line)
        file.seek(0)
        written, _ = encoding_of(file.read(4) if source is not file else start, name)
        return Survey(layout, written, above, _row_count(source, start, layout.first_row))


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
    name = name_of(path, label)
    with open_regular(path, max_bytes=max_bytes, label=label) as file:
        source, layout, encoding, start = _laid_out(file, name)
        wanted = {one: find_column(layout.names, one, name) for one in names}
        values = _quickly(source, start, layout, wanted)
        if values is None:
            source.seek(len(_UTF8_MARK) if start.startswith(_UTF8_MARK) else 0)
            values = _slowly(source, encoding, layout, wanted, name)
    units = {one: "s" if index in layout.clocks else layout.units[index] for one, index in wanted.items()}
    return Columns(values, units, layout.first_row)


def _laid_out(file: BinaryIO, name: str) -> tuple[BinaryIO, Layout, str, bytes]:
    """A recording to be read, its layout and encoding, and its first lines."""
    source: BinaryIO = file
    start, whole = _head(file, name)
    encoding, mark = encoding_of(start, name)
    if encoding.startswith("utf-16"):
        text, _ = decode(start + file.read(), name)
        source, encoding, mark = io.BytesIO(text.encode()), "utf-8", 0
        start, whole = _head(source, name)
    lines = split_lines(start[mark:].decode(encoding, errors="replace"))
    return source, find_layout(lines if whole else lines[:-1], name), encoding, start


def _row_count(file: BinaryIO, start: bytes, first_row: int) -> int:
    """Lines from the first row on, blank ones at the end left out."""
    ending = b"\n" if b"\n" in start else b"\r"
    offset = _line_start(start, ending, first_row)
    if offset is None:
        return 0
    with _content(file) as content:
        count = _count(ending, content, offset) + (content[-1:] != ending)
    return max(count - _blank_lines_at_end(file, ending), 0)


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


def _quickly(
    file: BinaryIO, start: bytes, layout: Layout, wanted: dict[str, int]
) -> dict[str, NDArray[np.float64]] | None:
    """The columns as polars reads them; None if anything is not as plain as it must be."""
    if layout.delimiter == " " or not wanted:
        return None
    import polars as pl  # here: it takes half a second

    ending = b"\n" if b"\n" in start else b"\r"
    if ending == b"\n" and start.count(b"\r") > start.count(b"\r\n") + start.endswith(b"\r"):
        return None  # two kinds of line end
    offset = _line_start(start, ending, layout.first_row)
    if offset is None or _has(b'"', file, offset):
        return None  # what a quote means depends on what is before it
    last = layout.width - 1
    indices = sorted({*wanted.values(), last})
    floats = set(wanted.values()) - layout.clocks
    schema = {str(index): pl.Float64() if index in floats else pl.String() for index in range(layout.width)}
    for words in (None, _NAN_WORDS):  # looking for words makes it a quarter slower
        file.seek(0)
        try:
            frame = pl.read_csv(
                file,
                has_header=False,
                skip_rows=layout.first_row - 1,
                columns=indices,
                schema=schema,
                separator=layout.delimiter,
                eol_char=ending.decode(),
                quote_char=None,
                null_values=words,
                decimal_comma=layout.decimal == ",",
            )
            break
        except (pl.exceptions.PolarsError, pl.exceptions.PanicException, ValueError, OSError):
            continue
    else:
        return None
    frame = frame.head(len(frame) - _blank_lines_at_end(file, ending))
    # To polars a row with too few cells ends in nulls, and of one with too many it may not read the rest.
    if (len(indices) < layout.width or frame[str(last)].null_count()) and not _is_full(
        file, offset, layout, len(frame)
    ):
        return None
    columns = {index: frame[str(index)].to_numpy() for index in floats}
    if any(np.isinf(column).any() for column in columns.values()):
        return None
    for index in layout.clocks.intersection(wanted.values()):
        columns[index] = seconds(frame[str(index)])
        if np.isnan(columns[index]).any():
            return None
    return {one: columns[index] for one, index in wanted.items()}


def _line_start(start: bytes, ending: bytes, line: int) -> int | None:
    """Where a line begins, lines counted from 1."""
    at = 0
    for _ in range(line - 1):
        at = start.find(ending, at) + 1
        if at == 0:
            return None
    return at


def _blank_lines_at_end(file: BinaryIO, ending: bytes) -> int:
    """Blank lines after the last row; more of them than fit in a small block are found by the slow way."""
    size = file.seek(0, os.SEEK_END)
    file.seek(max(0, size - _TAIL))
    lines = file.read().split(ending)
    if not lines[-1]:
        lines.pop()
    return next((count for count, line in enumerate(reversed(lines)) if line.strip()), 0)


@contextmanager
def _content(file: BinaryIO) -> Iterator[mmap.mmap | bytes]:
    if isinstance(file, io.BytesIO):
        yield file.getvalue()
        return
    with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as content:
        yield content


def _has(sign: bytes, file: BinaryIO, offset: int) -> bool:
    """Whether a sign stands anywhere from the offset on."""
    with _content(file) as content:
        return content.find(sign, offset) >= 0


def _is_full(file: BinaryIO, offset: int, layout: Layout, rows: int) -> bool:
    """Whether there are as many delimiters from the offset on as full rows have."""
    with _content(file) as content:
        return _count(layout.delimiter.encode(), content, offset) == rows * (layout.width - 1)


def _count(sign: bytes, content: mmap.mmap | bytes, offset: int) -> int:
    """How often a sign stands from the offset on."""
    blocks = (content[at : at + _BLOCK] for at in range(offset, len(content), _BLOCK))
    return sum(int(np.count_nonzero(np.frombuffer(block, dtype=np.uint8) == ord(sign))) for block in blocks)


def _slowly(
    file: BinaryIO, encoding: str, layout: Layout, wanted: dict[str, int], name: str
) -> dict[str, NDArray[np.float64]]:
    """The columns row by row; TableError names the first that cannot be read."""
    text = io.TextIOWrapper(file, encoding=encoding, errors="replace")
    try:
        for _ in range(layout.first_row - 1):
            text.readline()
        rows = _full_rows(text, layout, name)
        parts: list[list[NDArray[np.float64]]] = [[] for _ in wanted]
        moments: dict[int, list[str | None]] = {index: [] for index in layout.clocks.intersection(wanted.values())}
        while chunk := list(islice(rows, _CHUNK)):
            for index in moments:
                moments[index] += _moments(chunk, index, layout, name)
            for part, index in zip(parts, wanted.values(), strict=True):
                if index not in moments:
                    part.append(_floats(chunk, index, layout, name))
        clocks = {index: _since_first(cells, index, layout, name) for index, cells in moments.items()}
    finally:
        text.detach()
    values = {
        one: clocks[index] if index in clocks else np.concatenate([np.empty(0), *part])
        for (one, index), part in zip(wanted.items(), parts, strict=True)
    }
    if any(not len(column) for column in values.values()):
        raise TableError(f"{name}: has a header (line {layout.header_line}) but no row below it")
    return values


def _full_rows(text: io.TextIOWrapper, layout: Layout, name: str) -> Iterator[tuple[int, list[str]]]:
    """Rows with the numbers of their lines; blank lines and comments are passed over."""
    before = layout.first_row - 1
    if layout.delimiter == " ":
        rows: Iterator[list[str]] = (line.split() for line in text)
        numbered = ((before + count, row) for count, row in enumerate(rows, 1))
    else:
        reader = csv.reader(text, delimiter=layout.delimiter, skipinitialspace=True)
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


def _since_first(cells: list[str | None], index: int, layout: Layout, name: str) -> NDArray[np.float64]:
    """Seconds since the first of a column's moments."""
    import polars as pl

    found = seconds(pl.Series(cells, dtype=pl.String))
    for cell, value in zip(cells, found, strict=True):
        if cell is not None and np.isnan(value):
            where = f"{name}, column {shown(layout.names[index])}"
            raise TableError(f"{where}: {shown(cell)} is no time of day, or not written as the first one; mend it")
    return found


def _floats(chunk: list[tuple[int, list[str]]], index: int, layout: Layout, name: str) -> NDArray[np.float64]:
    """One column of some rows."""
    cells = [row[index] for _, row in chunk]
    try:
        values = np.array([float(cell) for cell in cells])
        if np.isfinite(values).all() and not any("_" in cell for cell in cells):
            return values
    except ValueError:
        pass
    values = np.full(len(cells), np.nan)
    for at, cell in enumerate(cells):
        value = number(cell, layout.decimal)
        if value is not None:
            values[at] = value
        elif not is_missing(cell):
            where = f"{name} row {chunk[at][0]}, column {shown(layout.names[index])}"
            raise TableError(f"{where}: {shown(cell)} is no number; mend it, or leave it blank if it is not known")
    return values
