"""Workbooks, .xlsx, .xlsb, .xls and .ods: each sheet that holds a table is a group, read by the rules of text.

The cells of a sheet become a text with tabs, and so the header, the row of units and the rate above the table are found
as in any text. A number keeps all its digits; the value of a formula is the one that was saved. Points in time are
times of day with their date. A decimal comma in a cell of text is a decimal sign.
"""

from __future__ import annotations

import re
import zipfile
from collections.abc import Generator, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, BinaryIO

from fourpole.errors import TableError
from fourpole.io.door import open_regular, path_for_library
from fourpole.io.formats import text
from fourpole.io.formats.guard import Guard, find, guarded, tidy
from fourpole.io.known import BEGINS
from fourpole.io.signals import HEAD_BYTES, MAX_FILE_BYTES, FileInfo, Format, Request, Signal, SignalInfo
from fourpole.io.source import name_of
from fourpole.units import shown

if TYPE_CHECKING:
    import polars as pl

_KIND = "a workbook"
_ZIP = b"PK\x03\x04"
#: Largest workbook [byte], and largest number of cells of its sheets with tables.
_MOST_BYTES, _MOST_CELLS = 300_000_000, 3_000_000
_MOST_SHEETS = 200
#: Address space of the worker [byte]: 400 MB of it are that of the libraries, most of which stay on the disk.
_MOST_MEMORY = 600_000_000
_SHEETS = ("xl/workbook.xml", "xl/workbook.bin", "content.xml")
_OTHER = {"word/": "a document of Word", "ppt/": "a presentation of PowerPoint", "visio/": "a drawing of Visio"}
_ODS = "application/vnd.oasis.opendocument.spreadsheet"
_DECIMAL_COMMA = r"^\s*[+-]?[0-9]+,[0-9]+(?:[eE][+-]?[0-9]+)?\s*$"
#: Day that a time of day without a date is stored with.
_NO_DAY = r"^1899-12-3[01] "
#: Largest size of a workbook after unpacking, and of its texts [byte], and bytes that are unpacked at a time.
_MOST_UNPACKED, _MOST_TEXT, _PART = 1_000_000_000, 100_000_000, 1 << 20
#: Cells of a rectangle that are allowed for each filled cell, and beside them.
_SPARSE, _BESIDE = 50, 200_000
_CELL = re.compile(rb"<(?:[a-z]+:)?c (?:[^<>]*? )?r=\"([A-Z]{1,3})([0-9]{1,7})\"")
_PLACE = re.compile(rb"<table:(table|table-row|(?:covered-)?table-cell)(?![a-z-])([^<>]*)>")
_FILLED = re.compile(rb"value-type=")
_COLUMNS, _ROWS = (re.compile(rb"number-%s-repeated=\"([0-9]{1,9})\"" % kind) for kind in (b"columns", b"rows"))


@dataclass(frozen=True)
class _Sheet:
    name: str
    path: Path
    """The text that holds its cells."""
    info: FileInfo


def check_cells(archive: zipfile.ZipFile, name: str, most: int) -> None:
    """TableError if a sheet has more cells than `most`, or cells so far apart that the rectangle has."""
    size = sum(one.file_size for one in archive.infolist())
    if size > _MOST_UNPACKED:
        raise TableError(f"{name}: unpacks to {size / 1e6:.4g} MB; save its table as CSV, Parquet or HDF5")
    texts = sum(one.file_size for one in archive.infolist() if one.filename.startswith("xl/sharedStrings"))
    if texts > _MOST_TEXT:
        raise TableError(f"{name}: holds {texts / 1e6:.4g} MB of words; save its table as CSV, Parquet or HDF5")
    for one in archive.namelist():
        if one.startswith("xl/worksheets/") and one.endswith(".xml"):
            _check_excel(archive, one, name, most)
        elif one == "content.xml":
            _check_ods(archive, name, most)


def _parts(archive: zipfile.ZipFile, member: str, end: bytes) -> Iterator[bytes]:
    """The content of a member in parts that end with a given mark."""
    rest = b""
    with archive.open(member) as file:
        while part := file.read(_PART):
            cut = part.rfind(end) + len(end)
            if cut < len(end):
                rest += part
                if len(rest) > 64 * _PART:
                    raise ValueError(f"{member} has a part that does not end")
                continue
            yield rest + part[:cut]
            rest = part[cut:]
    yield rest


def _check_excel(archive: zipfile.ZipFile, member: str, name: str, most: int) -> None:
    count = right = bottom = 0
    for part in _parts(archive, member, b">"):
        found = _CELL.findall(part)
        count += len(found)
        right = max(right, max((_column_number(one) for one in {column for column, _ in found}), default=0))
        bottom = max(bottom, max((int(row) for _, row in found), default=0))
    _check_rectangle(count, right * bottom, name, most)


def _column_number(letters: bytes) -> int:
    number = 0
    for one in letters:
        number = 26 * number + one - 64
    return number


def _check_ods(archive: zipfile.ZipFile, name: str, most: int) -> None:
    count = row = column = right = bottom = 0
    repeated = 1
    for part in _parts(archive, "content.xml", b">"):
        for one in _PLACE.finditer(part):
            kind, stated = one[1], one[2]
            if kind == b"table":
                _check_rectangle(count, right * bottom, name, most)
                count = row = right = bottom = 0
                repeated = 0
            elif kind == b"table-row":
                row, column = row + repeated, 0
                repeated = _times(_ROWS, stated)
            else:
                column += _times(_COLUMNS, stated)
                if _FILLED.search(stated):
                    count, right, bottom = count + 1, max(right, column), max(bottom, row + repeated)
    _check_rectangle(count, right * bottom, name, most)


def _times(pattern: re.Pattern[bytes], stated: bytes) -> int:
    found = pattern.search(stated)
    return int(found[1]) if found else 1


def _check_rectangle(count: int, room: int, name: str, most: int) -> None:
    if max(count, room) > most and room <= _SPARSE * count:
        raise TableError(f"{name}: has a sheet of {room} cells; save its table as CSV, Parquet or HDF5")
    if room > _SPARSE * count + _BESIDE:
        what = f"a sheet with {count} filled cells so far apart that the rectangle around them has {room}"
        raise TableError(f"{name}: has {what}; delete the cells that do not belong to the table")


def _check_archive(content: BinaryIO, name: str) -> None:
    """TableError if an archive is no workbook, or its cells need too much memory."""
    with zipfile.ZipFile(content) as archive:
        names = set(archive.namelist())
        for folder, what in _OTHER.items():
            if any(one.startswith(folder) for one in names):
                raise TableError(f"{name}: is {what}; copy its table into a workbook or a CSV file")
        if not names.intersection(_SHEETS):
            raise TableError(f"{name}: is an archive, not a workbook; unpack it and name a file in it")
        if "mimetype" in names and "xl/workbook.xml" not in names:
            with archive.open("mimetype") as file:
                kind = file.read(200).decode("latin-1")
            if not kind.startswith(_ODS):
                raise TableError(f"{name}: is {shown(kind, 80)}, not a table; save it as .ods or .xlsx")
        check_cells(archive, name, _MOST_CELLS)


@contextmanager
def _book(path: Path, label: str | None, guard: Guard, max_bytes: int) -> Iterator[Any]:
    """A workbook as the library reads it."""
    name = name_of(path, label)
    with open_regular(path, max_bytes=min(max_bytes, _MOST_BYTES), label=label) as file:
        head = file.read(HEAD_BYTES)
        if not BEGINS["workbook"](head):
            raise TableError(f"{name}: is not {_KIND}: it does not begin as one; check what wrote it")
        if head.startswith(_ZIP):
            _check_archive(file, name)
        import_module("polars")  # so that the memory which is left is that of the cells
        library = guard.load("fastexcel")
        with path_for_library(path, file, label=label) as same:
            try:
                book = library.read_excel(str(same))
            except library.FastExcelError as error:
                if "assword" in str(error) or "ncrypt" in str(error):
                    raise TableError(f"{name}: is protected by a password; save it without one") from None
                raise
    yield book


@contextmanager
def _opened(path: Path, label: str | None, guard: Guard, max_bytes: int) -> Iterator[list[_Sheet]]:
    """The sheets of a workbook that hold tables, as texts that are there while the workbook is open."""
    name = name_of(path, label)
    with _book(path, label, guard, max_bytes) as book, TemporaryDirectory() as folder:
        sheets: list[_Sheet] = []
        refused: list[str] = []
        for at, sheet in enumerate(book.sheet_names[:_MOST_SHEETS]):
            place = Path(folder, f"{at}.txt")
            called = shown(sheet, 60)
            why = _write_text(book, sheet, place, name)
            try:
                if not why:
                    sheets.append(_Sheet(sheet, place, text.FORMAT.survey(place, f"{name} sheet {called}", max_bytes)))
            except TableError as error:
                why = str(error).partition(f"sheet {called}")[2].strip(": ")
            if why:
                refused.append(f"sheet {called} is no table: {tidy(why, 300)}")
        if not sheets:
            raise TableError(f"{name}: {'; '.join(refused[:5]) or 'has no sheet'}; name a workbook with a table")
        first = replace(sheets[0], info=replace(sheets[0].info, notes=(*sheets[0].info.notes, *refused)))
        yield [first, *sheets[1:]]


def _write_text(book: Any, sheet: str, place: Path, name: str) -> str:
    """Write the cells of a sheet as text with tabs; return why it is no table, if it is none."""
    import polars as pl

    try:
        words = pl.DataFrame(book.load_sheet(sheet, header_row=None, skip_rows=0, dtypes="string"))
    except (ValueError, RuntimeError) as error:
        return str(error)
    if words.height * words.width > _MOST_CELLS:
        raise TableError(f"{name}: has {words.height * words.width} cells; save them as CSV, Parquet or HDF5")
    if not words.height:
        return "it is blank"
    numbers = pl.DataFrame(book.load_sheet(sheet, header_row=None, skip_rows=0, dtypes="float"))
    columns = [_column(words[one], numbers[one]) for one in words.columns if words[one].null_count() < words.height]
    counted = [one.cast(pl.Float64, strict=False).count() for one in columns]
    if max(counted, default=0) < 2:
        return "it holds no column of numbers"
    lines = pl.DataFrame(columns).select(pl.concat_str(pl.all(), separator="\t", ignore_nulls=False)).to_series()
    place.write_text("\n".join(lines), encoding="utf-8")
    return ""


def _column(words: pl.Series, numbers: pl.Series) -> pl.Series:
    """The cells of a column as text: numbers with all their digits, other cells on one line."""
    import polars as pl

    said = words.str.replace_all(r"[\t\r\n\"]+", " ").str.replace(_NO_DAY, "")
    comma = said.str.contains(_DECIMAL_COMMA)
    cells = pl.DataFrame({"said": said, "comma": comma, "number": numbers.cast(pl.Float64)})
    plain = pl.when("comma").then(pl.col("said").str.replace(",", ".", literal=True)).otherwise("said")
    exact = pl.when(pl.col("number").is_not_null()).then(pl.col("number").cast(pl.String)).otherwise(plain)
    return cells.select(exact.fill_null("").alias(words.name)).to_series()


def _group(sheet: _Sheet, signal: SignalInfo) -> str:
    return f"{sheet.name}/{signal.group}" if signal.group else sheet.name


def _survey(path: Path, label: str, max_bytes: int) -> FileInfo:
    guard = Guard(name_of(path, label), _KIND)
    with guard, _opened(path, label, guard, max_bytes) as sheets:
        signals = tuple(replace(one, group=_group(sheet, one)) for sheet in sheets for one in sheet.info.signals)
        many = len(sheets) > 1
        notes = [f"{tidy(one.name, 60)}: {note}" if many else note for one in sheets for note in one.info.notes]
        return FileInfo("workbook", signals, tuple(notes[:40]))


def _asked(sheets: Sequence[_Sheet], request: Request) -> list[tuple[_Sheet, list[int], tuple[str, ...], str]]:
    """The sheets of a request, with the indices and names of their channels, and the group within the sheet."""
    places = [(sheet, one) for sheet in sheets for one in sheet.info.signals]
    found = find([(_group(sheet, one), one.name) for sheet, one in places], request)
    chosen: dict[tuple[str, str], list[int]] = {}
    for at, place in enumerate(found):
        chosen.setdefault((places[place][0].name, places[place][1].group), []).append(at)
    return [
        (places[found[ats[0]]][0], ats, tuple(places[found[at]][1].name for at in ats), group)
        for (_, group), ats in chosen.items()
    ]


def _inside(sheet: _Sheet, names: tuple[str, ...], group: str, request: Request) -> Request:
    label = f"{name_of(request.path, request.label)} sheet {shown(sheet.name, 60)}"
    return replace(request, path=sheet.path, names=names, group=group, label=label)


def _read(request: Request) -> list[Signal]:
    guard = Guard(name_of(request.path, request.label), _KIND)
    signals: dict[int, Signal] = {}
    with guard, _opened(request.path, request.label, guard, MAX_FILE_BYTES) as sheets:
        for sheet, ats, names, group in _asked(sheets, request):
            signals |= zip(ats, text.FORMAT.read(_inside(sheet, names, group, request)), strict=True)
    return [signals[at] for at in range(len(request.names))]


def _chunks(request: Request, rows: int, guard: Guard) -> Generator[list[Signal]]:
    with _opened(request.path, request.label, guard, MAX_FILE_BYTES) as sheets:
        asked = _asked(sheets, request)
        if len(asked) != 1 or text.FORMAT.blocks is None:
            raise TableError(f"{name_of(request.path, request.label)}: a recording is read from one sheet; name one")
        sheet, _, names, group = asked[0]
        for chunk in text.FORMAT.blocks(_inside(sheet, names, group, request), rows):
            yield list(chunk)


def _blocks(request: Request, rows: int) -> Iterator[list[Signal]]:
    guard = Guard(name_of(request.path, request.label), _KIND)
    return guarded(_chunks(request, rows, guard), guard)


def texts(path: Path, label: str) -> dict[str, str]:
    """The cells of each sheet that holds a table, as text with tabs, by the name of the sheet."""
    guard = Guard(name_of(path, label), _KIND)
    with guard, _opened(path, label, guard, _MOST_BYTES) as sheets:
        return {one.name: one.path.read_text(encoding="utf-8") for one in sheets}


def first_table(path: Path, label: str) -> str:
    """The cells of the first sheet that is not blank, as a table of CSV; a row keeps its number."""
    import polars as pl

    guard = Guard(name_of(path, label), _KIND)
    with guard, _book(path, label, guard, _MOST_BYTES) as book:
        for sheet in book.sheet_names[:_MOST_SHEETS]:
            cells = pl.DataFrame(book.load_sheet(sheet, header_row=None, skip_rows=0, dtypes="string"))
            if cells.height:
                return cells.with_columns(pl.all().str.replace(_NO_DAY, "")).write_csv(include_header=False)
        raise TableError(f"{name_of(path, label)}: is blank; write its table into the first sheet")


_ENDINGS = (".xlsx", ".xlsm", ".xlsb", ".xls", ".ods")
FORMAT = Format("workbook", _ENDINGS, _survey, _read, _blocks, by_library=True, memory=_MOST_MEMORY)
