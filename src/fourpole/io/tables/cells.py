"""A table of any format as columns: head, unit, numbers, and the cells of a column of words."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from pathlib import Path

import numpy as np

from fourpole.core.arrays import ByValue, FloatArray
from fourpole.errors import TableError
from fourpole.io.child import read_apart
from fourpole.io.door import read_bytes
from fourpole.io.formats import workbook
from fourpole.io.layout import is_missing, number, split_lines
from fourpole.io.names import in_group
from fourpole.io.recordings import format_of, survey
from fourpole.io.signals import MAX_FILE_BYTES, Request, Signal
from fourpole.io.source import decode, name_of
from fourpole.io.stream import by_halves
from fourpole.io.text import TextTable, tables_of
from fourpole.units import shown
from fourpole.words.heads import head_and_unit

#: Memory that the numbers of a table may need [byte], and the most columns of a table.
_MOST_BYTES, _MOST_COLUMNS = 500_000_000, 2000
#: Largest text [byte]; words before a header, a line of units and a row in an export of TRIOS for LIMS.
_LARGEST_TEXT, _LIMS = 64_000_000, ("Variables", "Units", "Data point")
#: End of the remark on a header that does not fit its rows.
BY_NUMBER = "the columns are known by their numbers"
#: Names of the parts of a complex variable.
_COMPLEX = ("re", "im", "real", "imag", "abs", "mag", "phase")
#: A complex number.
_COMPLEX_CELL = re.compile(
    r"\(?(?P<re>[+-]?[0-9.]+(?:[eE][+-]?[0-9]+)?) ?(?P<im>[+-] ?[0-9.]+(?:[eE][+-]?[0-9]+)?) ?\*?[ij]\)?"
)
#: A line of numbers alone.
_ROW = re.compile(r"[\s;,0-9.eE+-]+")


@dataclass(frozen=True, eq=False)
class Column(ByValue):
    """A column of a table.

    Attributes
    ----------
    head : str
        The head as written.
    name : str
        The head without its unit.
    unit : str or None
    values : (N,) float array [the column's unit]
        NaN where a cell is blank or has words.
    words : tuple of str
        The cells, where most of them are words; empty in a column of numbers.
    bad : tuple of (int, str)
        Index of the row and text of the cells that are words among numbers.
    """

    head: str
    name: str
    unit: str | None
    values: FloatArray
    words: tuple[str, ...] = ()
    bad: tuple[tuple[int, str], ...] = ()


@dataclass(frozen=True, eq=False)
class Cells(ByValue):
    """A table.

    Attributes
    ----------
    label : str
        The file's name in messages.
    group : str
        Name of the sheet or group; empty if the file has one table.
    columns : tuple of Column
    lines : list of int
        Line, or else number, of each row in the file, from 1.
    remarks : tuple of str
        Sentences on lines and columns that were left out.
    """

    label: str
    group: str
    columns: tuple[Column, ...]
    lines: list[int]
    remarks: tuple[str, ...] = ()

    @property
    def where(self) -> str:
        """The name of the table in messages."""
        return f"{self.label} sheet or group {shown(self.group)}" if self.group else self.label

    @property
    def heads(self) -> str:
        """The first heads of the table, for a message that a column is missing."""
        return ", ".join(shown(one.head)[1:-1] for one in self.columns[:20])


def tables_in(path: Path, *, group: str = "", label: str | None = None) -> list[Cells]:
    """The tables of a file in any format; of one group or sheet, if `group` names one.

    Raises
    ------
    FileError
        If the file is missing, or its library is not installed.
    TableError
        If the file is damaged, or has no table or no such group.
    """
    name = name_of(path, label)
    kind = format_of(path, max_bytes=MAX_FILE_BYTES, label=name)
    if kind.name == "text":
        text, _ = decode(read_bytes(path, max_bytes=_LARGEST_TEXT, label=name), name)
        return _of_texts(text, group, name)
    if kind.name == workbook.FORMAT.name:
        sheets = read_apart(workbook.texts, path, name, label=name)
        return _of_sheets(sheets, group, name)
    found = read_apart(recorded, path, group, name, classes=(Signal,), label=name)
    if not found:
        raise TableError(f"{name}: holds no column of numbers that could be read; export its table as CSV")
    return [_of_signals(signals, missing, words, name, inside) for inside, signals, missing, words in found]


def _of_texts(text: str, group: str, label: str) -> list[Cells]:
    """The tables of a text; of a header that does not fit the rows, with columns known by their numbers.

    TRIOS writes a word before each header, line of units and row in its exports for LIMS: it is left out.
    """
    if all(f"\n{one}\t" in text for one in _LIMS):
        text = re.sub(rf"^(?:{'|'.join(_LIMS)})\t", "", text, flags=re.MULTILINE)
    try:
        return [_of_text(one, inside) for inside, one in tables_of(text, label, group)]
    except TableError as error:
        bare = "\n".join(line if _ROW.fullmatch(line) and not line.isspace() else "" for line in split_lines(text))
        try:
            tables = tables_of(bare, label, group)
        except TableError:
            raise error from None
        remark = f"{str(error).removeprefix(label).strip()}; {BY_NUMBER}"
        return [replace(one, remarks=(remark, *one.remarks)) for one in (_of_text(each, at) for at, each in tables)]


def _of_sheets(sheets: dict[str, str], group: str, label: str) -> list[Cells]:
    """The tables of the sheets of a workbook; `group` is the name of a sheet, or of a sheet and a table in it."""
    found = []
    for sheet, text in sheets.items():
        for title, table in tables_of(text, label):
            found.append(_of_text(table, f"{sheet}/{title}" if title else sheet))
    names = [sheet for sheet in sheets if group and sheet.casefold() == group.casefold()]
    if names:
        return [one for one in found if one.group == names[0] or one.group.startswith(f"{names[0]}/")]
    return [found[at] for at in in_group([(one.group, "") for one in found], group, label)]


#: Channels of equal length of a group, names of those that cannot be read, and columns of words, by name.
_Recorded = tuple[str, list[Signal], list[str], dict[str, list[str]]]


def recorded(path: Path, group: str, label: str) -> list[_Recorded]:
    """The columns of each group of a recording."""
    info = survey(path, max_bytes=MAX_FILE_BYTES, label=label)
    kind = format_of(path, max_bytes=MAX_FILE_BYTES, label=label)
    places = [(one.group, one.name) for one in info.signals]
    chosen = in_group(places, group, label)[:_MOST_COLUMNS]
    result = []
    words = [] if kind.words is None else kind.words(path, label)

    def alike(at: int) -> tuple[str, int]:
        return info.signals[at].group, info.signals[at].count

    for (inside, _), some in groupby(sorted(chosen, key=alike), alike):
        signals: list[Signal] = []
        lost: list[str] = []

        def read(part: list[int], inside: str = inside) -> Sequence[Signal]:
            names = tuple(info.signals[at].name for at in part)
            return kind.read(Request(path, names, inside, label, _MOST_BYTES))

        for part, got in by_halves(list(some), read):
            if isinstance(got, Exception):
                lost += [info.signals[at].name for at in part]
            else:
                signals += got
        if signals:
            count = signals[0].samples.size
            beside = {name: cells for at, name, cells in words if at == inside and len(cells) == count}
            result.append((inside, signals, [one for one in lost if one not in beside], beside))
    return result


def _of_signals(
    signals: Sequence[Signal], lost: Sequence[str], words: dict[str, list[str]], label: str, group: str
) -> Cells:
    columns = []
    heads = [_innermost(one.name) for one in signals]
    heads = heads if len({*heads}) == len(heads) else [one.name for one in signals]
    for head, one in zip(heads, signals, strict=True):
        name, unit = head_and_unit(head, one.unit)
        columns.append(Column(one.name, name, unit, one.samples))
    blank = np.full(signals[0].samples.size, np.nan)
    columns += [Column(_innermost(one), _innermost(one), None, blank, words=tuple(words[one])) for one in words]
    remarks = [f"column '{one}' holds no numbers and was left out" for one in lost]
    return Cells(label, group, tuple(columns), list(range(1, signals[0].samples.size + 1)), tuple(remarks))


def _innermost(name: str) -> str:
    """The head in a name of nested variables: "freq" of "data.freq", "re K" of "data.K.re"."""
    *outer, last = name.split(".")
    return f"{last} {outer[-1]}" if outer and last.casefold() in _COMPLEX else last


def _of_text(table: TextTable, group: str) -> Cells:
    filled = [at for at, row in enumerate(zip(*table.columns, strict=True)) if not all(map(is_missing, row))]
    heads = zip(table.headers, table.units, table.columns, strict=True)
    columns = [
        one for head, unit, cells in heads for one in _columns(head, unit, [cells[at] for at in filled], table.decimal)
    ]
    remarks = [f"line {line} is not data and was left out: {text}" for line, text in table.skipped]
    return Cells(table.label, group, tuple(columns), [table.lines[at] for at in filled], tuple(remarks))


def _columns(head: str, stated: str | None, cells: list[str], decimal: str) -> list[Column]:
    """The column of a head; of complex numbers, as 1.5+0.2j or (1.5-0.2i), that of each part."""
    there = [cell for cell in cells if not is_missing(cell)]
    if not there or _COMPLEX_CELL.fullmatch(there[0]) is None or not all(map(_COMPLEX_CELL.fullmatch, there)):
        return [_column(head, stated, cells, decimal)]
    parts = [_COMPLEX_CELL.fullmatch(cell) for cell in cells]
    texts = {key: ["" if one is None else one[key].replace(" ", "") for one in parts] for key in ("re", "im")}
    return [_column(f"{key} {head}", stated, texts[key], decimal) for key in texts]


def _column(head: str, stated: str | None, cells: list[str], decimal: str) -> Column:
    """A column of numbers, or of words if most of its cells are."""
    name, unit = head_and_unit(head, stated)
    there = [not is_missing(cell) for cell in cells]
    found = [number(cell, decimal) if known else None for cell, known in zip(cells, there, strict=True)]
    bad = tuple((at, cell) for at, cell in enumerate(cells) if there[at] and found[at] is None)
    values = np.array([np.nan if one is None else one for one in found], dtype=float)
    if 2 * len(bad) > sum(there):
        return Column(head, name, unit, values, words=tuple(cells))
    return Column(head, name, unit, values, bad=bad)
