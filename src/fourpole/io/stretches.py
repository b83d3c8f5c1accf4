"""Stretches of a file of text: each header with the rows below it, wherever in the file it stands.

A stretch begins with a row of numbers below a header that has as many names, and ends at the next line that is no such
row. Lines of units may stand between header and rows; a line above the header may have the title. Rows below the same
header and title whose times go on continue the stretch before. The file is read once, in parts; a part without a letter
holds rows only and is not looked into.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from itertools import groupby
from typing import BinaryIO

import numpy as np

from fourpole.errors import TableError
from fourpole.io.formats.guard import is_time, seconds
from fourpole.io.layout import (
    Layout,
    is_aside,
    is_missing,
    is_value,
    layout_below,
    number,
    split_cells,
    table_delimiter,
    trimmed,
    widest_sign,
)
from fourpole.io.names import numbered
from fourpole.io.rows import PART, Piece, line_end, too_long

#: Largest number of headers, of stretches, and of lines in a row that belong to none.
_MOST_HEADERS, _MOST_STRETCHES, _MOST_ASIDE = 20_000, 2_000, 20_000
#: Lines above a header that are kept: the first ones and the last ones.
_KEPT = 200
#: Rows that show how the rows of a stretch are written.
_SHOWN = 20
#: Least share of the lines of a table that are rows; half of them in a table of one column.
_FEW, _HALF = 0.02, 0.5
#: Least number of values in a row that begins with a word, such as "Data point".
_LABELLED = 3
#: Longest line that is looked at [byte], and longest title.
_LONGEST, _TITLE = 100_000, 60
#: Bytes that are read at a time: they stay in the processor's cache.
_CHUNK = 1 << 18
#: Bytes of the end of a stretch among which its last row is found.
_TAIL = 1 << 16
_EXPONENT = (ord("e"), ord("E"))
_LETTER = ord("A")
#: First bytes that a row of values may have: a digit, a sign or a point.
_FIRST = np.zeros(256, dtype=bool)
_FIRST[list(b"0123456789+-.")] = True
_RESULT = re.compile(r"(?:result|test|step|segment|block|ergebnis|abschnitt|schritt|résultat)(?: name)?\s*:?", re.I)


@dataclass(frozen=True)
class Stretch:
    """A header with its rows.

    Attributes
    ----------
    name : str
        Its title, with a number if several have it; else its number.
    layout : Layout
        Its header, with lines as in the file.
    above : tuple of str
        The lines above the header, from the stretch before on.
    pieces : tuple of Piece
        Its rows.
    repeats : bool
        Whether its header stands once more below its rows, without rows.
    """

    name: str
    layout: Layout
    above: tuple[str, ...]
    pieces: tuple[Piece, ...]
    repeats: bool = False

    @property
    def rows(self) -> int:
        """Number of lines with rows."""
        return sum(one.rows for one in self.pieces)


@dataclass
class _Run:
    """Rows below a header, while the file is read."""

    layout: Layout
    title: str
    above: tuple[str, ...]
    line: int
    begin: int
    first: list[str]
    lettered: bool = False
    """Whether the rows hold letters, such as NaN or a status."""
    rows: int = 0
    end: int = 0
    last: list[str] = field(default_factory=list)

    def clock(self) -> int | None:
        """Index of the column of times; None if there is none."""
        for at, name in enumerate(self.layout.names):
            if is_time(name) and seconds(self.layout.units[at]) is not None:
                return at
        return None

    def follows(self, before: _Run) -> bool:
        """Whether it has the header and title of the run `before`, and its times go on."""
        same = (self.title, self.layout.names, self.layout.units)
        at = self.clock()
        if same != (before.title, before.layout.names, before.layout.units) or at is None:
            return False
        sign = self.layout.decimal
        ended, begins = number(before.last[at], sign), number(self.first[at], sign)
        return ended is not None and begins is not None and ended < begins


def stretches_of(source: BinaryIO, start: bytes, offset: int, encoding: str, name: str) -> list[Stretch]:
    """The stretches of a file from a byte on, whose first lines are `start`; empty if it has none."""
    lines = [line.decode(encoding, errors="replace") for line in start[offset:].splitlines()]
    delimiter = table_delimiter([line for line in lines[:-1] or lines if len(line) < _LONGEST])
    if delimiter is None:
        return []
    scan = _Scan(delimiter, encoding, name, line_end(start), offset)
    source.seek(offset)
    while chunk := source.read(_CHUNK):
        scan.feed(chunk)
        if scan.aside > _MOST_ASIDE:
            break
    runs = scan.finished()
    return _together(runs, repeats=bool(runs) and scan.repeats(runs[-1].layout))


def _together(runs: list[_Run], *, repeats: bool) -> list[Stretch]:
    """The stretches that some runs make; `repeats` is that of the last one."""
    groups: list[list[_Run]] = []
    latest: dict[tuple[str, tuple[str, ...]], list[_Run]] = {}
    for run in runs:
        key = (run.title, run.layout.names)
        if key in latest and run.follows(latest[key][-1]):
            latest[key].append(run)
            continue
        latest[key] = [run]
        groups.append(latest[key])
    names = numbered([group[0].title or str(at) for at, group in enumerate(groups, 1)])
    return [
        Stretch(
            name,
            group[0].layout,
            group[0].above,
            tuple(Piece(run.line, run.begin, run.end, run.rows) for run in group),
            repeats and group[-1] is runs[-1],
        )
        for name, group in zip(names, groups, strict=True)
    ]


class _Scan:
    """The runs of rows of a file that is read in parts."""

    def __init__(self, delimiter: str, encoding: str, name: str, ending: bytes, offset: int) -> None:
        self.aside = 0
        """Number of lines since the last row."""
        self._delimiter, self._encoding, self._name, self._ending = delimiter, encoding, name, ending
        self._sign = widest_sign(delimiter)
        self._offset, self._line, self._blank = offset, 1, 0
        self._rest = self._tail = b""
        self._runs: list[_Run] = []
        self._run: _Run | None = None
        self._above: list[str] = []
        self._headers: set[tuple[str, tuple[str, ...]]] = set()

    def finished(self) -> list[_Run]:
        """All runs; none if there are so few rows among so many lines that the text is no table."""
        self._look_into(self._rest, last=True)
        if self._run is not None:
            self._end(self._tail)
        rows = sum(run.rows for run in self._runs)
        least = _FEW if any(sum(map(bool, run.layout.names)) > 1 for run in self._runs) else _HALF
        return self._runs if rows >= least * (self._line - 1 - self._blank) else []

    def repeats(self, layout: Layout) -> bool:
        """Whether the header of the last run is among the lines below it, which have no rows."""
        return any(layout.cells(line) == list(layout.names) for line in self._above)

    def feed(self, chunk: bytes) -> None:
        """Take the next bytes of the file."""
        whole = chunk.rfind(self._ending) + 1
        if self._run is None or _has_letter(chunk) or _has_letter(self._rest):
            chunk = self._rest + chunk
            whole = self._look_into(chunk[: chunk.rfind(self._ending) + 1])
        elif whole:
            count = int(np.count_nonzero(np.frombuffer(chunk, dtype=np.uint8) == self._ending[0]))
            self._run.rows += count
            self._line += count
            self._offset += len(self._rest) + whole
            self._run.end = self._offset
            self._keep(self._rest + chunk[:whole])
        else:
            chunk = self._rest + chunk
        self._rest = chunk[whole:]
        if len(self._rest) > PART:
            raise too_long(self._name)

    def _keep(self, part: bytes) -> None:
        """Keep the end of what has been read."""
        self._tail = part[-_TAIL:] if len(part) >= _TAIL else (self._tail + part)[-_TAIL:]

    def _look_into(self, part: bytes, *, last: bool = False) -> int:
        """Take some lines one by one; number of bytes taken. A stretch begins only where its first rows are seen."""
        data = np.frombuffer(part, dtype=np.uint8)
        starts = np.append(0, np.flatnonzero(data == self._ending[0]) + 1)
        lines = _Lines(part, starts[starts < len(part)], data, self._offset, self._line, self._encoding)
        at = 0
        while at < len(lines):
            if self._run is not None:
                at = self._leave(lines, at, self._run)
            elif not last and len(lines) - at < _SHOWN and len(part) - lines.starts[at] < _CHUNK:
                break
            else:
                at = self._enter(lines, at)
        taken = int(lines.starts[at]) if at < len(lines) else len(part)
        self._line += at
        self._offset += taken
        self._keep(part[:taken])
        return taken

    def _enter(self, lines: _Lines, at: int) -> int:
        """Take a line that is in no run; it may begin one. Index of the next line."""
        text = lines.text(at)[:_LONGEST]
        rows = self._rows(lines, at)
        if rows:
            layout = layout_below(self._above, rows, self._delimiter, lines.line(at), headless=not self._runs)
            if layout is not None:
                self._begin(layout, rows, lines, at)
                return at
            if self._runs and self._runs[-1].layout.width == len(rows[0]):
                self._run = self._runs.pop()  # a line that belongs to no table interrupts the rows
                self._run.rows += lines.line(at) - self._run.line - self._run.rows
                self._above, self.aside = [], 0
                return at
        self.aside += 1
        self._blank += not text.strip()
        self._above.append(text)
        if len(self._above) > 2 * _KEPT:
            del self._above[_KEPT]
        return at + 1

    def _rows(self, lines: _Lines, at: int) -> list[list[str]]:
        """The cells of the next lines, if they are rows of values; empty if the line is none."""
        first = self._cells(lines, at)
        if not _opens(first, self._sign):
            return []
        width, rows = len(first), [first]
        for one in range(at + 1, min(at + _SHOWN, len(lines))):
            cells = trimmed(self._cells(lines, one), width)
            if len(cells) != width or not _opens(cells, self._sign):
                break
            rows.append(cells)
        plain = all(is_missing(cell) or is_value(cell, self._sign) for cell in first)
        return rows if plain or len(rows) > 1 or at + 1 == len(lines) else []

    def _cells(self, lines: _Lines, at: int) -> list[str]:
        text = lines.text(at)
        return [] if len(text) > _LONGEST or is_aside(text) else split_cells(text, self._delimiter)

    def _begin(self, layout: Layout, rows: list[list[str]], lines: _Lines, at: int) -> None:
        """Begin a run with the row of this line."""
        upper = len(self._above) - (lines.line(at) - layout.header_line)
        above = tuple(self._above[: max(upper, 0)])
        title = _title(list(above), self._delimiter)
        lettered = any(_has_letter("".join(row).encode()) for row in rows)
        self._run = _Run(layout, title, above, lines.line(at), lines.begin(at), rows[0], lettered)
        self._above, self.aside = [], 0
        self._headers.add((title, layout.names))
        if len(self._headers) > _MOST_STRETCHES or len(self._runs) > _MOST_HEADERS:
            most = _MOST_STRETCHES if len(self._headers) > _MOST_STRETCHES else _MOST_HEADERS
            raise TableError(f"{self._name}: has more than {most} headers with rows; split it")

    def _leave(self, lines: _Lines, at: int, run: _Run) -> int:
        """Take the rows of a run from a line on; index of the line at which it ends."""
        for one in lines.suspects(at, lettered=run.lettered):
            if self._is_row(lines, one, run):
                continue
            run.rows += one - at
            run.end = lines.begin(one)
            end = run.end - lines.offset
            self._end(self._tail + lines.part[max(end - _LONGEST, 0) : end])
            return one
        run.rows += len(lines) - at
        run.end = lines.offset + len(lines.part)
        return len(lines)

    def _is_row(self, lines: _Lines, at: int, run: _Run) -> bool:
        text = lines.text(at)
        if is_aside(text):
            return True
        cells = run.layout.cells(text)
        return len(cells) == run.layout.width and _opens(cells, self._sign)

    def _end(self, before: bytes) -> None:
        """End the run, the bytes before whose end are given; blank lines at its end do not count."""
        run, self._run = self._run, None
        assert run is not None
        filled = before.rstrip()
        blank = before[len(filled) :]
        run.rows -= max(blank.count(b"\n") if b"\n" in blank else blank.count(b"\r"), 1) - 1
        row = filled[max(filled.rfind(b"\n"), filled.rfind(b"\r")) + 1 :].decode(self._encoding, errors="replace")
        cells = run.layout.cells(row)
        run.last = cells if len(cells) == run.layout.width else run.first
        self._runs.append(run)


@dataclass(frozen=True, eq=False)
class _Lines:
    """The lines of a part of a file, by their index."""

    part: bytes
    starts: np.ndarray
    data: np.ndarray
    offset: int
    before: int
    encoding: str

    def __len__(self) -> int:
        return len(self.starts)

    def text(self, at: int) -> str:
        """A line without its end."""
        end = self.starts[at + 1] if at + 1 < len(self) else len(self.part)
        return self.part[self.starts[at] : end].decode(self.encoding, errors="replace").rstrip("\r\n")

    def line(self, at: int) -> int:
        """Number of a line in the file."""
        return self.before + at

    def begin(self, at: int) -> int:
        """First byte of a line in the file."""
        return self.offset + int(self.starts[at])

    def suspects(self, at: int, *, lettered: bool) -> Iterator[int]:
        """Indices of the lines from `at` on that may be no rows.

        They have letters; where rows have some too, they do not begin as a number does.
        """
        found = self._odd if lettered else self._lettered
        return (int(one) for one in found[np.searchsorted(found, at) :])

    @cached_property
    def _odd(self) -> np.ndarray:
        return np.flatnonzero(~_FIRST[self.data[self.starts]])

    @cached_property
    def _lettered(self) -> np.ndarray:
        lines = np.searchsorted(self.starts, np.flatnonzero(_letters(self.data)), side="right") - 1
        return lines[np.diff(lines, prepend=-1) > 0]


def _letters(data: np.ndarray) -> np.ndarray:
    return (data >= _LETTER) & (data != _EXPONENT[0]) & (data != _EXPONENT[1])


def _has_letter(content: bytes) -> bool:
    """Whether some bytes have a letter that is no exponent."""
    data = np.frombuffer(content, dtype=np.uint8)
    high = int(np.count_nonzero(data >= _LETTER))
    return high > 0 and high > sum(int(np.count_nonzero(data == one)) for one in _EXPONENT)


def _opens(cells: list[str], sign: str) -> bool:
    """Whether cells may be a row of a table: a value and mostly values, or a word and some values behind it."""
    filled = [cell for cell in cells if not is_missing(cell)]
    values = [is_value(cell, sign) for cell in filled]
    if not any(values):
        return False
    if values[0]:
        return 2 * sum(values) >= len(values)
    return len(values) > _LABELLED and values[1] and 4 * sum(values) >= 3 * (len(values) - 1)


def _title(above: list[str], delimiter: str) -> str:
    """The title of a stretch: the nearest line of one cell above its header, or the first line of that paragraph."""
    paragraphs = _paragraphs(above, delimiter)
    paragraph = paragraphs[-1] if paragraphs else []
    stated = [one[1] for one in paragraph if len(one) > 1 and _RESULT.fullmatch(one[0])]
    if titles := stated or _single(paragraph):
        return _tidy(titles[-1])
    title = _value(paragraph[0]) if paragraph else ""
    if number(title) is None:
        return title
    before = (one for lines in reversed(paragraphs[:-1]) for one in reversed(lines))
    whole = next((_value(one) for one in before if _RESULT.fullmatch(one[0])), "")
    return f"{whole} {title}".strip()


def _paragraphs(lines: list[str], delimiter: str) -> list[list[list[str]]]:
    """The cells that are filled, by line and by paragraph; a blank line ends a paragraph."""
    cells = [[cell for cell in split_cells(line, delimiter) if cell] if line.strip() else [] for line in lines]
    return [list(group) for filled, group in groupby(cells, bool) if filled]


def _single(paragraph: list[list[str]]) -> list[str]:
    """The lines of one cell that may be a title."""
    return [one[0] for one in paragraph if len(one) == 1 and not one[0].startswith("[") and one[0][-1] not in ":="]


def _value(cells: list[str]) -> str:
    """What a line says: its first cell, or the second one behind a name with a colon."""
    return _tidy(cells[1] if len(cells) > 1 and cells[0].endswith(":") else cells[0])


def _tidy(text: str) -> str:
    return " ".join(text.replace("#", " ").split())[:_TITLE].strip(" :*=-")
