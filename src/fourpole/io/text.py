"""Small tables of text, such as results and load-deflection curves, read whole and with tolerance.

Recordings are read by `read_columns`, which is faster and stricter.
"""

from __future__ import annotations

import io
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fourpole.errors import TableError
from fourpole.io.door import read_bytes
from fourpole.io.layout import (
    Layout,
    check_even,
    find_column,
    find_layout,
    holds_numbers,
    is_aside,
    is_missing,
    number,
    split_lines,
)
from fourpole.io.names import in_group
from fourpole.io.source import AnyPath, decode, name_of
from fourpole.io.stretches import Stretch, stretches_of
from fourpole.units import column_unit, shown
from fourpole.words import first_of

#: Largest number of lines that a quoted cell may have.
_LONGEST_QUOTE = 100
#: First bytes of a file by which its lines are parted into cells.
_HEAD = 32_768
#: Rows of a table that only sums up another one, and largest number of tables in a message.
_SUMMARY, _MOST_SHOWN = 2, 8
#: First lines among which a header is sought that does not fit its rows, and largest number of lines of a table.
_UNEVEN, _MOST_LINES = 200, 500_000


@dataclass(frozen=True)
class TextTable:
    """A table of text, with the cells as written.

    Attributes
    ----------
    names : list of str
        Names of the columns, without their units.
    units : list of str or None
        Units as written in the header or in a row below it.
    columns : list of list of str
        The cells of each column.
    lines : list of int
        Number of the line of each row in the file, from 1.
    skipped : list of (int, str)
        Number and text of the lines below the header that are no rows of the table.
    headers : list of str
        Names of the columns as written.
    decimal : str
        The decimal sign.
    label : str
        The file's name in messages.
    """

    names: list[str]
    units: list[str | None]
    columns: list[list[str]]
    lines: list[int]
    skipped: list[tuple[int, str]]
    headers: list[str]
    decimal: str
    label: str

    def index(self, name: str) -> int:
        """Index of a column; TableError if it is missing (with the nearest name) or ambiguous."""
        return find_column(self.headers, name, self.label)

    def unit(self, name: str) -> str | None:
        """The unit stated for a column."""
        return self.units[self.index(name)]

    def column(self, name: str) -> NDArray[np.float64]:
        """The numbers of a column, in its own unit.

        Parameters
        ----------
        name : str
            Name in the header, with or without its unit; upper and lower case are equal.

        Returns
        -------
        (rows,) float array [the column's unit]
            NaN where a cell is blank or has text.

        Raises
        ------
        TableError
            If the column is missing or ambiguous, or has no number.
        """
        index = self.index(name)
        values = _numbers(self.columns[index], self.decimal)
        if np.isnan(values).all():
            for line, cell in zip(self.lines, self.columns[index], strict=True):
                if not is_missing(cell):
                    where = f"{self.label} row {line}, column {shown(self.names[index])}"
                    raise TableError(f"{where}: {shown(cell)} is no number, nor is any other in that column")
        return values


def read_table(path: AnyPath, *, group: str = "", max_bytes: int = 64_000_000, label: str | None = None) -> TextTable:
    r"""Read a table of text: names in a header, units with them or in a row below.

    Comma, semicolon, tab or white space separate the cells; the decimal sign is a point or a comma; the encoding is
    UTF-8, UTF-16 with its mark, GB 18030, Shift-JIS, cp1252 or Latin-1. Lines before the header and comments (#, %) are
    skipped. The columns of a table without a header are named by their numbers: 1, 2, ...

    Parameters
    ----------
    path : path
        A regular file.
    group : str, optional
        The table to read from a file with several headers: its title, or its number; see `stretches_of`.
    max_bytes : int [byte]
        A larger file is refused.
    label : str, optional
        The file's name in messages; by default the last part of the path.

    Returns
    -------
    TextTable

    Raises
    ------
    FileError
        If the file is missing, no regular file or too large.
    TableError
        If it holds no table, or several of which none is named.

    Examples
    --------
    >>> import tempfile, pathlib
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = pathlib.Path(folder, "curve.csv")
    ...     _ = file.write_text("deflection [mm];load [N]\n0,0;0\n1,5;300,2\nend of test\n")
    ...     curve = read_table(file)
    >>> curve.names, curve.units, curve.column("deflection").tolist()
    (['deflection', 'load'], ['mm', 'N'], [0.0, 1.5])
    >>> curve.skipped
    [(4, "'end of test'")]
    """
    name = name_of(path, label)
    tables = tables_of(decode(read_bytes(path, max_bytes=max_bytes, label=label), name)[0], name, group)
    long = [one for _, one in tables if len(one.lines) > _SUMMARY] if len(tables) > 1 else [tables[0][1]]
    if len(long) == 1:
        return long[0]
    titles = first_of([shown(one) for one, _ in tables], _MOST_SHOWN)
    raise TableError(f"{name}: holds {len(tables)} tables: {titles}; name one, as in {name}#{tables[0][0]}")


def tables_of(text: str, name: str, group: str = "") -> list[tuple[str, TextTable]]:
    """The tables that a text holds, each with its title or number, which is empty if the text has one header.

    See `read_table`; only the table of the name `group`, if one is given. `name` is that of the file in messages.
    """
    lines, content = split_lines(text), text.encode()
    if len(lines) > _MOST_LINES:
        raise TableError(f"{name}: has {len(lines)} lines; a table has at most {_MOST_LINES}: keep the rows that count")
    stretches = stretches_of(io.BytesIO(content), content[:_HEAD], 0, "utf-8", name)
    try:
        found = find_layout(lines, name)
    except TableError:
        if not stretches:
            raise
        found = None
    pieces = sum(len(one.pieces) for one in stretches)
    numbers = found is not None and holds_numbers(lines, found)
    if not pieces and not numbers:
        check_even(lines[:_UNEVEN], name)
    if found is not None and pieces < 2 and (not pieces or numbers):
        in_group([], group, name)
        return [("", _table(lines, found, name))]
    chosen = in_group([(one.name, "") for one in stretches], group, name)
    many = len(stretches) > 1
    return [(stretches[at].name if many else "", _table_of(stretches[at], lines, name)) for at in chosen]


def _table_of(stretch: Stretch, lines: list[str], name: str) -> TextTable:
    """The table of one of several headers; all lines but those of its rows count as blank."""
    kept = [""] * len(lines)
    for piece in stretch.pieces:
        rows = slice(piece.line - 1, piece.line - 1 + piece.rows)
        kept[rows] = lines[rows]
    return _table(kept, stretch.layout, name)


def _table(lines: list[str], layout: Layout, name: str) -> TextTable:
    """The table of some lines, of which those of other tables are blank."""
    numbers, rows, skipped = _rows(lines, layout)
    if not rows:
        raise TableError(f"{name}: has a header (line {layout.header_line}) but no row that fits it")
    return TextTable(
        names=[column_unit(one)[0] for one in layout.names],
        units=list(layout.units),
        columns=[list(column) for column in zip(*rows, strict=True)],
        lines=numbers,
        skipped=skipped,
        headers=list(layout.names),
        decimal=layout.decimal,
        label=name,
    )


def _rows(lines: list[str], layout: Layout) -> tuple[list[int], list[list[str]], list[tuple[int, str]]]:
    """Number of the line of each row, the cells of each row, and the lines that are no rows."""
    numbers: list[int] = []
    rows: list[list[str]] = []
    skipped: list[tuple[int, str]] = []
    short: list[tuple[int, list[str], str]] = []
    for line, text in _records(lines, layout):
        cells = layout.cells(text)
        if len(cells) == layout.width:
            rows += [[*some, *[""] * (layout.width - len(some))] for _, some, _ in short]
            numbers += [number for number, _, _ in short]
            short.clear()
            rows.append(cells)
            numbers.append(line)
        elif 1 < len(cells) < layout.width and layout.delimiter != " ":
            short.append((line, cells, text))  # blank cells at the end of a row may be missing, but not in the last row
        else:
            skipped.append((line, shown(text.strip(), 40)))
    skipped += [(line, shown(text.strip(), 40)) for line, _, text in short]
    _drop_words(numbers, rows, skipped, layout.decimal)
    return numbers, rows, sorted(skipped)


def _drop_words(numbers: list[int], rows: list[list[str]], skipped: list[tuple[int, str]], decimal: str) -> None:
    """Move rows of words from the end of a table of numbers to `skipped`."""
    filled = [[number(cell, decimal) is not None for cell in row if not is_missing(cell)] for row in rows]
    words = next((count for count, kinds in enumerate(reversed(filled)) if not kinds or any(kinds)), len(rows))
    kinds = [kind for row in filled[: len(rows) - words][-50:] for kind in row]
    if kinds.count(True) > 4 * kinds.count(False):
        skipped.extend((numbers.pop(), shown(" ".join(rows.pop()), 40)) for _ in range(words))


def _records(lines: list[str], layout: Layout) -> Iterator[tuple[int, str]]:
    """Numbered lines from the first row on, without blanks and comments; the lines of a quoted cell are joined."""
    at = layout.first_row - 1
    while at < len(lines):
        start, text = at, lines[at]
        at += 1
        if '"' in text and text.count('"') % 2 and layout.delimiter != " ":
            joined = text
            for more in range(at, min(at + _LONGEST_QUOTE, len(lines))):
                joined += "\n" + lines[more]
                if lines[more].count('"') % 2:
                    text, at = joined, more + 1
                    break
        if not is_aside(text):
            yield start + 1, text


def _numbers(cells: list[str], decimal: str) -> NDArray[np.float64]:
    values = (number(cell, decimal) for cell in cells)
    return np.array([np.nan if value is None else value for value in values], dtype=np.float64)
