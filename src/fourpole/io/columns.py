"""Columns of numbers from a recording in text, which may have 10 000 to some 1 000 000 000 rows."""

from __future__ import annotations

import os
import re
import sys
from codecs import BOM_UTF8
from collections.abc import Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, nullcontext, suppress
from dataclasses import dataclass
from datetime import date
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from fourpole.core.arrays import ByValue
from fourpole.errors import TableError
from fourpole.io.clock import Clock
from fourpole.io.door import open_regular
from fourpole.io.layout import Layout, check_even, find_column, find_layout, holds_numbers, plain_layout, split_lines
from fourpole.io.rows import Piece, Table, Values, length, line_end, line_start, parts, whole_lines
from fourpole.io.source import AnyPath, as_utf8, encoding_of, name_of
from fourpole.io.stretches import Stretch, stretches_of

#: Bytes of the first lines that are read to find the layout, and the most that are read if lines are long.
_HEAD, _LARGEST_HEAD = 32_768, 4_000_000
_SLASHED = re.compile(rb"(?<![0-9])([0-9]{1,2})/([0-9]{1,2})/([0-9]{4})[T ]")


@dataclass(frozen=True, eq=False)
class Columns(ByValue):
    """Columns of numbers from a recording.

    Attributes
    ----------
    values : dict of str to (rows,) float array [the column's unit]
        The columns by the names that the caller uses; NaN where the file has no value.
    units : dict of str to str or None
        The units that the file states.
    first_row : int
        Number of the first row's line in the file, from 1.
    above : tuple of str
        The lines above the rows, without the header: title, date, rate.
    """

    values: dict[str, NDArray[np.float64]]
    units: dict[str, str | None]
    first_row: int
    above: tuple[str, ...] = ()

    def __getitem__(self, name: str) -> NDArray[np.float64]:
        return self.values[name]

    def __len__(self) -> int:
        return len(next(iter(self.values.values()), ()))


def survey_tables(
    path: AnyPath, *, max_bytes: int = 4_000_000_000, label: str | None = None
) -> tuple[list[Stretch], bool, str]:
    """The tables of a recording in text, without their numbers; see `read_columns` for the files that are accepted.

    Returns
    -------
    tables : list of Stretch
    is_one : bool
        Whether it is one table that begins with the first lines, and not a header further down, or several.
    encoding : str
    """
    name = name_of(path, label)
    with _text(path, max_bytes, label) as (source, start, encoding, written):
        mark = len(BOM_UTF8) if start.startswith(BOM_UTF8) else 0
        stretches = stretches_of(source, start, mark, encoding, name)
        if len(stretches) > 1 or any(len(one.pieces) > 1 or one.repeats for one in stretches):
            return stretches, False, written
        with suppress(TableError) if stretches else nullcontext():
            layout, above = _layout(start, encoding, name)
            begin = line_start(start, layout.first_row)
            if not stretches or stretches[0].layout.first_row == layout.first_row:
                rows = stretches[0].rows if stretches else _row_count(source, start, begin, name)
                rest = Piece(layout.first_row, begin, source.seek(0, os.SEEK_END), rows)
                return [Stretch("", layout, above, (rest,))], True, written
        return stretches, False, written


def read_columns(
    path: AnyPath,
    names: Sequence[str],
    *,
    max_bytes: int = 4_000_000_000,
    label: str | None = None,
    stretch: Stretch | None = None,
) -> Columns:
    r"""Read some columns of a recording as floats.

    Parameters
    ----------
    path : path
        A regular file of text: comma, semicolon, tab or white space between the cells, a header, and perhaps a row of
        units below it. A column of times of day, with or without dates, gives the seconds from its first time.
    names : sequence of str
        Names of the columns in the header, with or without their unit, in any case.
    max_bytes : int [byte]
        A larger file is refused.
    label : str, optional
        The file's name in messages; by default the last part of the path.
    stretch : Stretch, optional
        The header and rows to read; by default the first header, and all lines below it.

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
    (found,) = column_blocks(path, names, sys.maxsize, max_bytes=max_bytes, label=label, stretch=stretch)
    return found


@contextmanager
def _text(path: AnyPath, max_bytes: int, label: str | None) -> Iterator[tuple[BinaryIO, bytes, str, str]]:
    """An open text, as UTF-8 if it was UTF-16; its first lines, its encoding, and that of the file."""
    name = name_of(path, label)
    with ExitStack() as stack:
        source = stack.enter_context(open_regular(path, max_bytes=max_bytes, label=label))
        start = _head(source, name)
        encoding, _ = encoding_of(start, name)
        written = encoding
        if encoding.startswith("utf-16"):
            source = stack.enter_context(as_utf8(source, encoding, name))
            start, encoding = _head(source, name), "utf-8"
        yield source, start, encoding, written


def _layout(start: bytes, encoding: str, name: str) -> tuple[Layout, tuple[str, ...]]:
    """The layout of a recording from its first lines, and the lines above its rows, without the header.

    TableError if the lines are no table of numbers.
    """
    every = split_lines(start.removeprefix(BOM_UTF8).decode(encoding, errors="replace"))
    lines = every[:-1] if len(start) >= _HEAD else every
    plain = plain_layout(lines, name)
    layout = plain or find_layout(lines, name)
    if plain is None and not holds_numbers(lines, layout):
        check_even(lines, name)
        raise TableError(f"{name}: is text without a table of numbers; name a file with a line of names above its rows")
    above = enumerate(every[: layout.first_row - 1], 1)
    return layout, tuple(line for number, line in above if number != layout.header_line)


def _row_count(file: BinaryIO, start: bytes, begin: int, name: str) -> int:
    """Number of lines from a byte on, without blank lines at the end."""
    ending = line_end(start)
    file.seek(begin)
    return sum(part.count(ending) + (not part.endswith(ending)) for part in whole_lines(file, ending, name))


def _head(file: BinaryIO, name: str) -> bytes:
    """The first lines of a file, at least four if it has them."""
    start = file.read(_HEAD)
    while start.count(b"\n") + start.count(b"\r") < 4:
        more = file.read(len(start))
        start += more
        if not more:
            break
        if len(start) > _LARGEST_HEAD:
            raise TableError(f"{name}: the first lines have more than {len(start)} bytes; this is no table of text")
    return start


def column_blocks(
    path: AnyPath,
    names: Sequence[str],
    rows: int,
    *,
    max_bytes: int = 4_000_000_000,
    label: str | None = None,
    stretch: Stretch | None = None,
) -> Iterator[Columns]:
    r"""Read some columns of a recording in chunks; all chunks together equal the result of `read_columns`.

    Parameters
    ----------
    path, names, max_bytes, label, stretch
        See `read_columns`.
    rows : int
        Rows of each chunk, at least 1; the last chunk has the rest.

    Yields
    ------
    Columns
        The next rows; `first_row` is the first row of the recording.

    Raises
    ------
    FileError, TableError
        See `read_columns`; an error is raised only when the faulty row is reached.

    Examples
    --------
    >>> import tempfile, pathlib
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = pathlib.Path(folder, "D1.csv")
    ...     _ = file.write_text("t [s],F1 [N]\n0,1.5\n0.001,2\n0.002,2.5\n")
    ...     [block["F1"].tolist() for block in column_blocks(file, ["F1"], 2)]
    [[1.5, 2.0], [2.5]]
    """
    with _opened(path, names, max_bytes, label, stretch) as (source, start, table):
        empty = True
        for values in _cut(parts(source, start, table), max(rows, 1)):
            empty = False
            found = {one: values[index] for one, index in table.wanted.items()}
            yield Columns(found, table.units, table.layout.first_row, table.above)
        if empty and names:
            raise table.empty()


@contextmanager
def _opened(
    path: AnyPath, names: Sequence[str], max_bytes: int, label: str | None, stretch: Stretch | None
) -> Iterator[tuple[BinaryIO, bytes, Table]]:
    """An open recording, its first lines, and the table with the wanted columns."""
    name = name_of(path, label)
    with _text(path, max_bytes, label) as (source, start, encoding, _):
        layout, above = _layout(start, encoding, name) if stretch is None else (stretch.layout, stretch.above)
        wanted = {one: find_column(layout.names, one, name) for one in names}
        clocks = layout.clocks.intersection(wanted.values())
        day_first = not clocks or _is_day_first(source, start, layout, name)
        made = {at: Clock(day_first=day_first) for at in clocks}
        yield source, start, Table(layout, encoding, wanted, made, name, above, stretch.pieces if stretch else ())


def _is_day_first(source: BinaryIO, start: bytes, layout: Layout, name: str) -> bool:
    """Whether 01/02/2024 is in February: the order that makes more dates valid, or else the recording shorter."""
    offset = line_start(start, layout.first_row)
    if _SLASHED.search(start, offset) is None:
        return True
    source.seek(offset)
    found: set[tuple[bytes, ...]] = set()
    for part in whole_lines(source, line_end(start), name):
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


def _cut(parts: Iterator[Values], rows: int) -> Iterator[Values]:
    """The same rows in chunks of equal length."""
    held: list[Values] = []
    for part in parts:
        first = 0
        while first < length(part):
            last = first + rows - sum(map(length, held))
            # A view would keep the whole part in memory.
            whole = first == 0 and last >= length(part)
            held.append(part if whole else {index: column[first:last].copy() for index, column in part.items()})
            first = last
            if sum(map(length, held)) == rows:
                yield _joined(held)
                held = []
    if held:
        yield _joined(held)


def _joined(parts: list[Values]) -> Values:
    return parts[0] if len(parts) == 1 else {index: np.concatenate([one[index] for one in parts]) for index in parts[0]}
