"""The rows of a table of text as columns of numbers, one part of the file after the other.

polars reads a part that is written plainly. A part that polars refuses is read row by row: padded cells and blank lines
are accepted, and any other deviation is reported with its row, column and value.
"""

from __future__ import annotations

import csv
import io
import re
from codecs import BOM_UTF8
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice
from typing import TYPE_CHECKING, Any, BinaryIO, cast

import numpy as np
from numpy.typing import NDArray

from fourpole.core.kernel import cells
from fourpole.errors import TableError
from fourpole.io.clock import Clock, is_moment
from fourpole.io.layout import Layout, is_aside, is_missing, number, plain_numbers, trimmed
from fourpole.units import shown

if TYPE_CHECKING:
    import polars as pl

PART = 1 << 23
"""Bytes that are read at a time; a longer line is refused."""
#: Largest number of rows, and of cells, that are read row by row at a time.
_CHUNK, _CELLS = 20_000, 2_000_000
_LINE_END = re.compile(rb"\r\n|\r|\n")
_NAN_WORDS = ["NaN", "nan", "NAN", "NA", "N/A", "n/a", "#N/A", "null", "NULL", "None", "-"]


@dataclass(frozen=True)
class Piece:
    """Rows that follow each other in a file: their first line, bytes and number."""

    line: int
    begin: int
    end: int
    rows: int


Values = dict[int, NDArray[np.float64]]
"""Columns of numbers by their index in the table."""


@dataclass(frozen=True)
class Table:
    """A table that is being read: its layout, and the index of each wanted column by the name that the caller uses."""

    layout: Layout
    encoding: str
    wanted: dict[str, int]
    clocks: dict[int, Clock]
    name: str
    above: tuple[str, ...]
    pieces: tuple[Piece, ...] = ()
    """The rows of the table; all lines from the layout's first row on, if there is none."""

    @property
    def numbers(self) -> set[int]:
        """Indices of the wanted columns that are no times of day."""
        return set(self.wanted.values()) - set(self.clocks)

    @property
    def units(self) -> dict[str, str | None]:
        """The unit of each wanted column."""
        return {one: "s" if at in self.clocks else self.layout.units[at] for one, at in self.wanted.items()}

    def empty(self) -> TableError:
        """The error for a table without rows."""
        return TableError(f"{self.name}: has a header (line {self.layout.header_line}) but no row below it")


def length(values: Values) -> int:
    """Number of rows."""
    return len(next(iter(values.values()), ()))


class Span(io.RawIOBase):
    """Some bytes of a file as a file of their own."""

    def __init__(self, file: BinaryIO, begin: int, end: int) -> None:
        self._file, self._begin, self._end, self._at = file, begin, end, begin

    def readable(self) -> bool:
        """Always."""
        return True

    def seekable(self) -> bool:
        """Always."""
        return True

    def seek(self, offset: int, whence: int = 0, /) -> int:
        """Go to a byte, counted from the first one of the span."""
        base = (self._begin, self._at, self._end)[whence]
        self._at = min(max(base + offset, self._begin), self._end)
        return self._at - self._begin

    def readinto(self, buffer: Any, /) -> int:
        """Fill a buffer with the next bytes."""
        self._file.seek(self._at)
        content = self._file.read(min(len(buffer), self._end - self._at))
        buffer[: len(content)] = content
        self._at += len(content)
        return len(content)


def parts(source: BinaryIO, start: bytes, table: Table) -> Iterator[Values]:
    """The wanted columns, one part of the file after the other; `start` are the first lines of the file."""
    ending = line_end(start)
    if not table.pieces:
        yield from _parts(source, line_start(start, table.layout.first_row), ending, table.layout.first_row, table)
    for piece in table.pieces:
        span = io.BufferedReader(Span(source, piece.begin, piece.end))
        yield from _parts(cast("BinaryIO", span), 0, ending, piece.line, table)


def _parts(source: BinaryIO, offset: int, ending: bytes, line: int, table: Table) -> Iterator[Values]:
    """The wanted columns from a byte on, which is the first one of a line."""
    source.seek(offset)
    if table.layout.delimiter == " ":
        yield from _slowly(source, line, table)
        return
    for part, quoted in _spans(source, ending, table):
        if ending == b"\r" and b"\n" in part:
            break  # two kinds of line end
        values = None if quoted else _quickly(part, ending, table)
        if values is not None:
            line += length(values)
            yield values
        else:
            yield from _slowly(io.BytesIO(part), line, table)
            line += len(_LINE_END.findall(part))
        offset += len(part)
    else:
        return
    source.seek(offset)
    yield from _slowly(source, line, table)


def _spans(source: BinaryIO, ending: bytes, table: Table) -> Iterator[tuple[bytes, bool]]:
    """The rest of a file in whole rows, and whether they have quotes; an open quote goes on in the next lines."""
    held = b""
    for piece in whole_lines(source, ending, table.name):
        part, held = held + piece, b""
        first = part.rfind(ending, 0, max(part.find(b'"'), 0)) + 1
        last = (part.find(ending, part.rfind(b'"')) + 1 or len(part)) if b'"' in part else 0
        if part[:first]:
            yield part[:first], False
        rows = _closed_rows(part[first:last], ending, table)
        if rows < last - first:
            held = part[first + rows :]
            if len(held) > csv.field_size_limit():  # no cell is as long, so the row is refused
                yield part[first:], True
                held = b""
                continue
            last = len(part)
        if rows:
            yield part[first : first + rows], True
        if part[last:]:
            yield part[last:], False
    if held:
        yield held, True


def _closed_rows(part: bytes, ending: bytes, table: Table) -> int:
    """Number of bytes of some lines up to the last row with an open quote; all bytes if there is none."""
    lines = part.split(ending)
    if not any(line.count(b'"') % 2 for line in lines):
        return len(part)
    reader = csv.reader(
        (line.decode(table.encoding, errors="replace") + "\n" for line in [*lines, b""]),
        delimiter=table.layout.delimiter,
        skipinitialspace=True,
    )
    begins = ends = 0
    try:
        for _ in reader:
            begins, ends = ends, reader.line_num
    except csv.Error:
        return len(part)
    # A last row of one line is the blank line that was appended; a longer one has a quote that is still open.
    return len(part) - len(ending.join(lines[begins:])) if ends - begins > 1 else len(part)


def whole_lines(source: BinaryIO, ending: bytes, name: str) -> Iterator[bytes]:
    """The rest of a file in parts that end with a line, without the blank lines at its end."""
    held = rest = b""
    while block := source.read(PART - len(rest)):
        cut = block.rfind(ending) + 1
        if cut:
            if held:
                yield held
            held, rest = rest + block[:cut], block[cut:]
        elif len(rest) + len(block) >= PART:
            raise too_long(name)
        else:
            rest += block
    held += rest
    filled = len(held.rstrip()) if held[-2:].isspace() else len(held)  # to look is quicker than to copy
    end = held.find(ending, filled)
    if filled:
        yield held if end < 0 else held[: end + 1]


def _each_line(text: io.TextIOWrapper, name: str) -> Iterator[str]:
    while line := text.readline(PART):
        if len(line) >= PART:
            raise too_long(name)
        yield line


def too_long(name: str) -> TableError:
    """The error for a line that no table has."""
    return TableError(f"{name}: has a line of more than {PART} bytes; this is no table of text")


def _plain_frame(
    part: bytes, ending: bytes, layout: Layout, numbers: list[int], indices: list[int]
) -> pl.DataFrame | None:
    """Columns as polars reads them, `numbers` as floats and the others as text; None if polars refuses the part."""
    import polars as pl  # not at the top: the import takes half a second

    schema = {str(index): pl.Float64() if index in numbers else pl.String() for index in range(layout.width)}
    for words in (None, _NAN_WORDS):  # the search for words takes a quarter more time
        try:
            return pl.read_csv(
                part,
                has_header=False,
                columns=indices if len(indices) < layout.width else None,
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


def _quickly(part: bytes, ending: bytes, table: Table) -> Values | None:
    """The wanted columns as polars reads them; None if the part must be read row by row."""
    two = ending == b"\n" and b"\r" in part and part.count(b"\r") > part.count(b"\r\n")  # kinds of line end
    if two or not table.wanted:
        return None
    layout, numbers = table.layout, sorted(table.numbers)
    if not table.clocks:
        made = cells(part, layout.delimiter, ending, layout.decimal, numbers, layout.width)
        if made is not None:
            return dict(zip(numbers, made, strict=True))
    last = layout.width - 1
    indices = sorted({*table.wanted.values(), last})
    frame = _plain_frame(part, ending, layout, numbers, indices)
    if frame is None:
        return None
    # polars fills a row with too few cells with nulls, and may ignore the surplus cells of a row with too many.
    if (len(indices) < layout.width or frame[str(last)].null_count()) and not _is_full(part, ending, layout):
        return None
    columns = {index: frame[str(index)].to_numpy() for index in numbers}
    if any(np.isinf(column).any() for column in columns.values()):
        return None
    times = _times(frame, table.clocks)
    return None if times is None else columns | times


def _times(frame: pl.DataFrame, clocks: dict[int, Clock]) -> Values | None:
    """The columns of times of day [s]; None, with the clocks as before, if a cell has no time."""
    states = {index: clock.state for index, clock in clocks.items()}
    times = {index: clock.seconds(frame[str(index)]) for index, clock in clocks.items()}
    if not any(np.isnan(column).any() for column in times.values()):
        return times
    for index, clock in clocks.items():
        clock.state = states[index]
    return None


def line_end(start: bytes) -> bytes:
    """The end of a line in a file with these first lines; that of CR LF is LF."""
    return b"\n" if b"\n" in start else b"\r"


def line_start(start: bytes, line: int) -> int:
    """First byte of a line, lines counted from 1."""
    ends = islice(_LINE_END.finditer(start), line - 1)
    return max((end.end() for end in ends), default=len(BOM_UTF8) if start.startswith(BOM_UTF8) else 0)


def _is_full(part: bytes, ending: bytes, layout: Layout) -> bool:
    """Whether each line has as many delimiters as a full row; False for a table of one column."""
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


def _slowly(file: BinaryIO, line: int, table: Table) -> Iterator[Values]:
    """The wanted columns, read row by row from a line on; TableError at the first row that cannot be read."""
    text = io.TextIOWrapper(file, encoding=table.encoding, errors="replace")
    layout, name = table.layout, table.name
    try:
        rows = _full_rows(text, line, layout, name)
        while chunk := list(islice(rows, max(min(_CHUNK, _CELLS // layout.width), 1))):
            values = {index: _floats(chunk, index, layout, name) for index in table.numbers}
            yield values | {index: _seconds(chunk, index, table) for index in table.clocks}
    finally:
        text.detach()


def _full_rows(text: io.TextIOWrapper, line: int, layout: Layout, name: str) -> Iterator[tuple[int, list[str]]]:
    """Rows with the numbers of their lines, without blank lines and comments."""
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


def _seconds(chunk: list[tuple[int, list[str]]], index: int, table: Table) -> NDArray[np.float64]:
    """The times of one column of times of day [s]; not-a-number for a missing value, TableError at any other text."""
    import polars as pl

    cells = [row[index] for _, row in chunk]
    moments = pl.Series([cell if is_moment(cell) else None for cell in cells], dtype=pl.String)
    found = table.clocks[index].seconds(moments)
    for (line, _), cell, value in zip(chunk, cells, found, strict=True):
        if np.isnan(value) and not is_missing(cell):
            where = f"{table.name} row {line}, column {shown(table.layout.names[index])}"
            what = f"{where}: {shown(cell)} is no time of day"
            if is_moment(cell):
                raise TableError(f"{what}, or not written as the first one; mend it")
            raise TableError(f"{what}, as the cells above it are; correct it")
    return found


def _floats(chunk: list[tuple[int, list[str]]], index: int, layout: Layout, name: str) -> NDArray[np.float64]:
    """The numbers of one column; not-a-number for a missing value, TableError at any other text."""
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
