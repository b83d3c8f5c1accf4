"""The layout of a table of text: its header, the delimiter between its cells, and its decimal sign."""

from __future__ import annotations

import csv
import math
import re
from collections import Counter
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from fourpole.errors import TableError
from fourpole.io.clock import is_date, is_moment
from fourpole.io.names import listed, named
from fourpole.units import column_unit, is_unit, shown

#: Delimiters in the order in which they are tried; a space means any white space.
_DELIMITERS = ("\t", ";", ",", " ")
#: First lines of a file from which the layout is found, and those that suffice if all the others are plain rows.
_SAMPLE, _FIRST_LINES = 200, 20
#: Nearest lines above the numbers among which the header is sought.
_NEAREST = 5
#: First rows from which header and decimal sign are found.
_FIRST_ROWS = 50
_LONGEST_LINE = 4_000_000
_COMMENTS = ("#", "%")
_MISSING = frozenset({"", "nan", "na", "n/a", "#n/a", "null", "none", "-", "--", "-nan", "+nan"})
_NUMBER = re.compile(r"[+-]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]+)?")
_DECIMAL_COMMA = re.compile(r"[+-]?[0-9]*,[0-9]+(?:[eE][+-]?[0-9]+)?")
_WORD = re.compile(r'"[^"]*"|\S+')
_NAME_AND_UNIT = re.compile(r"[^\s\[\]]+\s*\[[^\[\]]*\]|\S+")
# The name of a column of times in files of catman, which have lines with sensors and rates below the header.
_CATMAN_TIME = re.compile(r"(?:Time|Zeit|Temps)  ?[0-9]+ - .*")
_NTH = re.compile(r"(.+)\.([1-9][0-9]{0,3})")
#: A line without letters but those of exponents: a row of numbers.
_NUMBERS = re.compile(r"[^A-DF-Za-df-z0-9\u0080-\U0010ffff]*[0-9][^A-DF-Za-df-z\u0080-\U0010ffff]*")
_SIGNS = re.compile(r"[|=&<>]+")
#: Share of the cells of a row of units that are known units.
_KNOWN_UNITS = 0.5
#: A narrow or fixed blank between thousands.
_THOUSANDS = re.compile(r"(?<=[0-9])[\u00a0\u2009\u202f](?=[0-9]{3}(?![0-9]))")
_UNIT_CELL = re.compile(r"\[[^\[\]]*\]|\((?![+-]?[0-9.]+[+-])[^()]*\)")


@dataclass(frozen=True)
class Layout:
    """The header and the shape of a table; lines are counted from 1."""

    names: tuple[str, ...]
    """The columns' names as written, with their units if these are in brackets there."""
    units: tuple[str | None, ...]
    delimiter: str
    decimal: str
    header_line: int
    first_row: int
    """The first line after header and units, a row of numbers if the file has any."""
    clocks: frozenset[int] = frozenset()
    """The columns that hold times of day, with or without a date."""

    @property
    def width(self) -> int:
        """Number of columns."""
        return len(self.names)

    def cells(self, line: str) -> list[str]:
        """The cells of a line; a delimiter at the end of the line adds no blank cell."""
        return trimmed(split_cells(line, self.delimiter), self.width)


def split_lines(text: str) -> list[str]:
    """The lines of a text, which end with LF, CR LF or CR; `str.splitlines` also splits at characters within a cell."""
    return text.replace("\r\n", "\n").replace("\r", "\n").split("\n")


def is_missing(cell: str) -> bool:
    """Whether a cell is blank or has a sign for a missing value, such as NaN or a dash."""
    return cell.strip().lower() in _MISSING


def number(cell: str, decimal: str = ".") -> float | None:
    """The finite number in a cell; None if there is none."""
    text = cell.strip()
    if not text.isascii():
        text = _THOUSANDS.sub("", text)
    if decimal == "," and "," in text:
        if "." in text:
            return None
        text = text.replace(",", ".")
    if _NUMBER.fullmatch(text) is None:
        return None
    value = float(text)
    return value if math.isfinite(value) else None


def plain_numbers(cells: Sequence[str]) -> NDArray[np.float64] | None:
    """The numbers of some cells; None unless all of them are finite numbers with a decimal point."""
    try:
        values = np.array([float(cell) for cell in cells])
    except ValueError:
        return None
    return values if np.isfinite(values).all() and not any("_" in cell for cell in cells) else None


def split_cells(line: str, delimiter: str) -> list[str]:
    """The cells of a line; a space as the delimiter means any white space."""
    if delimiter == " ":
        words = _WORD.findall(line) if '"' in line else line.split()
        return [word[1:-1] if word[0] == word[-1] == '"' and len(word) > 1 else word for word in words]
    if '"' in line:
        with suppress(csv.Error, StopIteration):  # a cell beyond the limit of the csv module
            return [cell.strip() for cell in next(csv.reader([line], delimiter=delimiter, skipinitialspace=True))]
    return [cell.strip() for cell in line.split(delimiter)]


def find_layout(lines: Sequence[str], name: str) -> Layout:
    """The layout of a table from its first lines.

    Raises TableError if there is no header, or no row below it.
    """
    sample = _table_lines(lines, name)
    delimiter, width = _delimiter([lines[index] for index in sample])
    fitting = [index for index in sample if width <= _cell_count(lines[index], delimiter) <= width + 1]
    split_rows = ((index, trimmed(split_cells(lines[index], delimiter), width)) for index in fitting)
    rows = {index: cells for index, cells in islice(split_rows, _FIRST_ROWS) if len(cells) == width}
    decimal = _decimal(rows.values(), delimiter)
    names, header = _header(lines, rows, delimiter, decimal, name)
    if header is None:
        first = next(index for index, row in rows.items() if _has_value(row, decimal))
        clocks = _clocks(_rows_from(rows, first))
        return Layout(names, (None,) * width, delimiter, decimal, 0, first + 1, clocks)
    units, described = _units(lines, names, header, delimiter, _last_described(lines, rows, names, header, decimal))
    names = _named(names, _rows_from(rows, header + 1), decimal)
    below = [index for index in sample if index > max(header, described)]
    if not below:
        raise TableError(f"{name}: has a header (line {header + 1}) but no row below it")
    clocks = _clocks(_rows_from(rows, below[0]))
    return Layout(names, units, delimiter, decimal, header + 1, below[0] + 1, clocks)


def plain_layout(lines: Sequence[str], name: str) -> Layout | None:
    """The layout by the first lines, if all lines of the sample below its header are rows of numbers; else None."""
    with suppress(TableError):
        layout = find_layout(lines[:_FIRST_LINES], name)
        delimiter, rows = layout.delimiter, lines[layout.first_row - 1 : _SAMPLE]
        even = delimiter != " " and {row.count(delimiter) for row in rows} == {layout.width - 1}
        other = "".join(rows).encode().translate(None, b"0123456789+-eE" + f"{delimiter}{layout.decimal}".encode())
        if even and not other and not layout.clocks and holds_numbers(lines[:_FIRST_LINES], layout):
            return layout
    return None


def _rows_from(rows: dict[int, list[str]], first: int) -> list[list[str]]:
    return [row for index, row in rows.items() if index >= first]


def table_delimiter(lines: Sequence[str]) -> str | None:
    """The delimiter of a table, by the lines that hold numbers only if there are any; None without any line."""
    filled = [line for line in lines if not is_aside(line)]
    numbers = [line for line in filled if _NUMBERS.fullmatch(line)]
    shown = numbers if len(numbers) > 1 else filled
    return _delimiter(shown[:_SAMPLE])[0] if shown else None


def layout_below(
    above: Sequence[str], rows: Sequence[list[str]], delimiter: str, line: int, *, headless: bool
) -> Layout | None:
    """The layout of some rows by the lines above them; None if these have no header.

    Parameters
    ----------
    above : sequence of str
        The lines above the rows.
    rows : sequence of list of str
        The cells of the first rows.
    delimiter : str
    line : int
        Number of the first row's line.
    headless : bool
        Whether columns may be named by their numbers, if all lines above are blank, comments or of one cell.
    """
    first = len(above)
    lines, keyed = [*above, *(delimiter.join(row) for row in rows)], dict(enumerate(map(list, rows), first))
    found = _nearest_names(lines, keyed, first, delimiter)
    decimal, clocks = _decimal(rows, delimiter), _clocks(list(rows))
    if found is None or not any(map(_is_name, found[0])) or not _are_names(found[0]):
        bare = all(is_aside(one) or len(split_cells(one, delimiter)) == 1 for one in above)
        if headless and bare and all(_is_values(row, widest_sign(delimiter)) for row in rows):
            width = len(rows[0])
            return Layout(by_number(width), (None,) * width, delimiter, decimal, 0, line, clocks)
        return None
    names, header = found
    units, _ = _units(lines[:first], names, header, delimiter, max(first - 1, header))
    names = _named(names, rows, decimal)
    return Layout(names, units, delimiter, decimal, line - first + header, line, clocks)


def _named(names: Sequence[str], rows: Sequence[list[str]], decimal: str) -> tuple[str, ...]:
    """The names of the columns; a column with numbers but without a name has its number, unless it counts the rows."""
    bare = {at for at, one in enumerate(names) if at and not one}
    known = {at for at in bare if any(number(row[at], decimal) is not None for row in rows)}
    return tuple(str(at + 1) if at in known else one for at, one in enumerate(names))


def check_even(lines: Sequence[str], name: str) -> None:
    """TableError if the rows below a header have another number of cells than it has names."""
    delimiter = table_delimiter(lines)
    cells = [[] if delimiter is None or is_aside(line) else split_cells(line, delimiter) for line in lines]
    for at in range(1, len(cells) - 1):
        width, above = len(cells[at]), cells[at - 1]
        if not 1 < width == len(cells[at + 1]) or width == len(above) or len(above) < 2:
            continue
        if all(_is_values(cells[one], ",") for one in (at, at + 1)) and all(_is_name(one) for one in above if one):
            top = next((one for one in range(at - 2, -1, -1) if len(cells[one]) != len(above)), -1) + 1
            raise TableError(_uneven(name, top, len(above), width))


def _are_names(cells: Sequence[str]) -> bool:
    """Whether cells may be the names of columns: no times of day, and no lines or signs that part words."""
    return not any(is_moment(cell) or is_date(cell) or _SIGNS.fullmatch(cell) for cell in cells)


def _is_name(cell: str) -> bool:
    return not is_missing(cell) and not is_value(cell, ",")


def _table_lines(lines: Sequence[str], name: str) -> list[int]:
    """Indices of the first lines that are neither blank nor comments."""
    for index, line in enumerate(lines[:_SAMPLE]):
        if len(line) > _LONGEST_LINE:
            raise TableError(f"{name} line {index + 1}: has {len(line)} characters; this is no table of text")
    sample = [index for index, line in enumerate(lines[:_SAMPLE]) if not is_aside(line)]
    if not sample:
        raise TableError(f"{name}: has no table, only blank lines or comments")
    return sample


def _last_described(
    lines: Sequence[str], rows: dict[int, list[str]], names: Sequence[str], header: int, decimal: str
) -> int:
    """Index of the last line below the header that may state units; of catman's, all lines above the values."""
    first = next((index for index in range(header + 1, len(lines)) if lines[index].strip()), header)
    if not _CATMAN_TIME.fullmatch(names[0]):
        return first
    values = (index for index, row in rows.items() if index > header and _is_values(row, decimal))
    return max(header, next(values, first + 1) - 1)


def _units(
    lines: Sequence[str], names: Sequence[str], header: int, delimiter: str, described: int
) -> tuple[tuple[str | None, ...], int]:
    """The unit of each column, and the index of the last line that is no row because it states them."""
    units: tuple[str | None, ...] = tuple(column_unit(one)[1] for one in names)
    last = described if _CATMAN_TIME.fullmatch(names[0]) else header
    for index in (*range(header + 1, described + 1), *range(max(header - 1, 0), header)):
        stated = _names_in(lines[index], delimiter, len(names), False)
        if stated and _is_units_row(stated):
            return tuple(map(_unit_of, units, stated)), max(last, index)
    return units, last


def _unit_of(bracket: str | None, cell: str) -> str | None:
    """The unit of a column from the brackets in its name, unless only the row of units has one that is known."""
    stated = _stated(cell)
    known = bracket is not None and (is_unit(bracket) or stated is None or not is_unit(stated))
    return bracket if known else stated


def holds_numbers(lines: Sequence[str], layout: Layout) -> bool:
    """Whether at least half of the first lines are rows, and half of the cells of one of their columns are numbers."""
    if not _are_names(layout.names) and layout.header_line:
        return False
    below = [line for line in lines[layout.first_row - 1 : layout.first_row - 1 + _SAMPLE] if not is_aside(line)]
    width = layout.width
    rows = [cells for cells in map(layout.cells, below) if len(cells) == width]
    if 2 * len(rows) < len(below):
        return False
    return any(_are_numbers([row[at] for row in rows], layout.decimal) for at in set(range(width)) - layout.clocks)


def _are_numbers(cells: Sequence[str], decimal: str) -> bool:
    """Whether at least half of the cells that are not blank are numbers."""
    filled = [cell for cell in cells if not is_missing(cell)]
    return bool(filled) and 2 * sum(number(cell, decimal) is not None for cell in filled) >= len(filled)


def find_column(names: Sequence[str], wanted: str, name: str) -> int:
    """Index of a wanted column: by its name as written, without its unit, or in another case.

    If several columns have the same name, F1.1 is the first and F1.2 the next one. TableError if the column is missing
    (with the nearest name) or ambiguous.
    """
    spelling = wanted.strip()
    found = named([("", one) for one in names], range(len(names)), spelling)
    if len(found) > 1:
        which = ", ".join(f"{shown(names[index])} (column {index + 1})" for index in found[:5])
        how = f"write {shown(f'{spelling}.1')} for the first, {shown(f'{spelling}.2')} for the next"
        raise TableError(f"{name}: column {shown(wanted)} is ambiguous: {which}; {how}, or rename one of them")
    at = found[0] if found else _nth_of_name(names, spelling)
    if at is not None:
        return at
    raise TableError(
        f"{name}: there is no column {shown(wanted)}{listed([column_unit(one)[0] for one in names], wanted)}"
    )


def _nth_of_name(names: Sequence[str], spelling: str) -> int | None:
    """Index of the n-th column of a name, such as F1.2 for the second F1; None if there is none."""
    nth = _NTH.fullmatch(spelling)
    if nth is None:
        return None
    stem = column_unit(nth[1])[0].casefold()
    same = [index for index, one in enumerate(names) if column_unit(one)[0].casefold() == stem]
    return same[int(nth[2]) - 1] if 1 < len(same) >= int(nth[2]) else None


def is_aside(line: str) -> bool:
    """Whether a line is blank or a comment."""
    return not line.strip() or line.lstrip().startswith(_COMMENTS)


def trimmed(cells: list[str], width: int) -> list[str]:
    """The cells of a line; a delimiter at the end of the line adds no blank cell."""
    return cells[:-1] if len(cells) == width + 1 and not cells[-1] else cells


def _delimiter(lines: Sequence[str]) -> tuple[str, int]:
    """The delimiter that splits most lines into the same number of cells (at least two), and this number."""
    best, share, width = ",", 0, 1
    for delimiter in _DELIMITERS:
        counts = Counter([_cell_count(line, delimiter) for line in lines])
        count, often = max(counts.items(), key=lambda item: (item[1], item[0]))
        if count >= 2 and (often > share or (often == share and delimiter == " " and _spaced(lines, best))):
            best, share, width = delimiter, often, count
    return best, width


def _spaced(lines: Sequence[str], best: str) -> bool:
    """Whether the commas of the last line are decimal signs of numbers that blanks separate."""
    words = lines[-1].split()
    return best == "," and len(words) >= 2 and all(_DECIMAL_COMMA.fullmatch(word) for word in words)


def _cell_count(line: str, delimiter: str) -> int:
    if delimiter == " " and '"' not in line:
        return len(line.split())
    if '"' in line:
        return len(split_cells(line, delimiter))
    return line.count(delimiter) + 1


def _decimal(rows: Iterable[list[str]], delimiter: str) -> str:
    """The decimal sign: a comma if more cells are numbers with it than with a point."""
    if delimiter == ",":
        return "."
    cells = [cell for row in rows for cell in row[:50]]
    commas = sum(_DECIMAL_COMMA.fullmatch(_THOUSANDS.sub("", cell)) is not None for cell in cells)
    points = sum("." in cell and _NUMBER.fullmatch(cell) is not None for cell in cells)
    return "," if commas > points else "."


def _header(
    lines: Sequence[str], rows: dict[int, list[str]], delimiter: str, decimal: str, name: str
) -> tuple[tuple[str, ...], int | None]:
    """The names of the columns, and the index of their line; their numbers and None if there is no header."""
    for index, row in rows.items():
        if _CATMAN_TIME.fullmatch(row[0]):
            return tuple(row), index
    first = next((i for i, row in rows.items() if _has_value(row, decimal)), None)
    if first is not None and not _is_values(rows[first], decimal):
        first = _below_preamble(rows, decimal)
    if first is None:
        top = next(iter(rows))
        return tuple(rows[top]), top  # the rows contain text, so the first row is the header
    found = _nearest_names(lines, rows, first, delimiter)
    if found is not None:
        return found
    for index in reversed(range(first)):
        count = 1 if is_aside(lines[index]) else _cell_count(lines[index], delimiter)
        if count > 1:
            width = len(rows[first])
            raise TableError(_uneven(name, index, count, width))
    return by_number(len(rows[first])), None


def _nearest_names(
    lines: Sequence[str], rows: dict[int, list[str]], first: int, delimiter: str
) -> tuple[tuple[str, ...], int] | None:
    """The names in the nearest line above the first row, which has to fit it, and the index of that line."""
    width = len(rows[first])
    above = [index for index in reversed(range(first)) if lines[index].strip()]
    ended = all(not row[-1] for index, row in rows.items() if index >= first)
    found = {index: _names_in(lines[index], delimiter, width, ended) for index in above[:_NEAREST]}
    for index, names in found.items():
        if names is None:
            if is_aside(lines[index]):
                continue
            return None
        # A line of units has names above it: at least as many. Units are looked at last, because that loads a library.
        higher = (cells for other, cells in found.items() if other < index and cells is not None)
        if not (_filled(next(higher, [])) >= _filled(names) and _is_units_row(names)):
            return tuple(names), index
    return None


def _filled(cells: Sequence[str]) -> int:
    return sum(not is_missing(cell) for cell in cells)


def widest_sign(delimiter: str) -> str:
    """The decimal sign of a cell that may be a number: a comma, which allows a point, unless it is the delimiter."""
    return "." if delimiter == "," else ","


def by_number(width: int) -> tuple[str, ...]:
    """The names of the columns of a table without a header: their numbers, from 1."""
    return tuple(map(str, range(1, width + 1)))


def _names_in(line: str, delimiter: str, width: int, ended: bool) -> list[str] | None:
    """The names in a header line, or None. The line may be a comment, or have one delimiter more or less."""
    text = line.lstrip("".join(_COMMENTS)).strip() if is_aside(line) else line
    cells = split_cells(text, delimiter)
    ways = [trimmed(cells, width)]
    if delimiter == " ":
        ways += [_NAME_AND_UNIT.findall(text), re.split(r"\s{2,}|\t", text.strip())]
    elif ended:
        ways.append([*cells, ""])  # the rows end with a delimiter, the header does not
    return next((way for way in ways if len(way) == width), None)


def _below_preamble(rows: dict[int, list[str]], decimal: str) -> int | None:
    """Index of the first row of values if all rows above it are names or lines such as "rate;2000;Hz"; else None."""
    last = max((i for i, row in rows.items() if not _is_values(row, decimal)), default=None)
    if last is None or _has_value(rows[last], decimal):
        return None  # the last line above the values is no header
    valued = [row for i, row in rows.items() if i < last and _has_value(row, decimal)]
    if any(is_value(row[0], decimal) or len(row) - row.count("") > 3 for row in valued):
        return None
    return next((i for i in rows if i > last), None)


def _has_value(cells: list[str], decimal: str) -> bool:
    return any(is_value(cell, decimal) for cell in cells)


def is_value(cell: str, decimal: str) -> bool:
    """Whether a cell holds a number or a point in time."""
    return number(cell, decimal) is not None or is_moment(cell) or is_date(cell)


def _is_values(cells: list[str], decimal: str) -> bool:
    """Whether a row has at least one value, and no text."""
    kinds = [is_value(cell, decimal) or (None if is_missing(cell) else False) for cell in cells]
    return any(kinds) and False not in kinds


def _clocks(rows: list[list[str]]) -> frozenset[int]:
    """Indices of the columns that hold times of day."""
    columns = (
        (index, [cell for cell in cells if not is_missing(cell)]) for index, cells in enumerate(zip(*rows, strict=True))
    )
    return frozenset(
        index
        for index, cells in columns
        if cells and is_moment(cells[0]) and 2 * sum(map(is_moment, cells)) >= len(cells)
    )


def _stated(cell: str) -> str | None:
    """The unit in a cell, with or without brackets."""
    if not cell:
        return None
    return column_unit(f"x {cell}" if _UNIT_CELL.fullmatch(cell) else f"x [{cell}]")[1]


def _is_units_row(cells: list[str]) -> bool:
    """Whether a row holds units only: all in brackets, or most of them known."""
    stated = [cell.strip() for cell in cells if cell.strip() not in ("", "-", "1")]
    if not stated or any(number(cell, ",") is not None for cell in stated):
        return False
    known = sum(map(is_unit, stated))
    return all(_UNIT_CELL.fullmatch(cell) for cell in stated) or known > _KNOWN_UNITS * len(stated)


def _uneven(name: str, line: int, names: int, width: int) -> str:
    """Message on a header that does not fit the rows below it."""
    remedy = "name each column; if commas are decimal signs, export with ; or tabs between the cells"
    return f"{name} line {line + 1}: the header has {names} names, but the rows {width} cells; {remedy}"
