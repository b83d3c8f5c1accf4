"""Workbooks, .xlsx, .xlsb, .xls and .ods: each sheet that holds a table is a group, read by the rules of text.

The cells of a sheet become a text with tabs, and so the header, the row of units and the rate above the table are found
as in any text. A number keeps all its digits; the value of a formula is the one that was saved. Points in time are
times of day with their date. A decimal comma in a cell of text is a decimal sign.
"""

from __future__ import annotations

import zipfile
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, BinaryIO

from fourpole.errors import TableError
from fourpole.io.formats import text
from fourpole.io.formats.guard import guard, tidy
from fourpole.io.formats.tracks import Content, OpenFile, Track, opened, remembered, track_format
from fourpole.io.signals import MAX_FILE_BYTES, FileInfo, Request, SignalInfo
from fourpole.io.source import name_of
from fourpole.units import shown

if TYPE_CHECKING:
    import polars as pl

_KIND = "a workbook"
_ZIP = b"PK\x03\x04"
#: Largest number of cells of a sheet.
_MOST_CELLS = 3_000_000
_MOST_SHEETS = 200
_SHEETS = ("xl/workbook.xml", "xl/workbook.bin", "content.xml")
_OTHER = {"word/": "a document of Word", "ppt/": "a presentation of PowerPoint", "visio/": "a drawing of Visio"}
_ODS = "application/vnd.oasis.opendocument.spreadsheet"
_DECIMAL_COMMA = r"^\s*[+-]?[0-9]+,[0-9]+(?:[eE][+-]?[0-9]+)?\s*$"
#: Day that a time of day without a date is stored with.
_NO_DAY = r"^1899-12-3[01] "


def _check_archive(content: BinaryIO, name: str) -> None:
    """TableError if an archive is no workbook."""
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


def _book(file: OpenFile) -> Any:
    """A workbook as the library reads it."""
    if file.file.read(len(_ZIP)) == _ZIP:
        _check_archive(file.file, file.name)
    import_module("polars")  # so that the memory which is left is that of the cells
    library = file.load("fastexcel")
    try:
        return library.read_excel(str(file.path))
    except library.FastExcelError as error:
        if "assword" in str(error) or "ncrypt" in str(error):
            raise TableError(f"{file.name}: is protected by a password; save it without one") from None
        raise


def _tables(file: OpenFile) -> tuple[dict[str, tuple[Path, FileInfo]], list[str]]:
    """The sheets of a workbook that hold tables, each with a text of its cells, and why others are none."""
    book, folder = _book(file), file.closing.enter_context(TemporaryDirectory())
    sheets: dict[str, tuple[Path, FileInfo]] = {}
    refused: list[str] = []
    for at, sheet in enumerate(book.sheet_names[:_MOST_SHEETS]):
        place = Path(folder, f"{at}.txt")
        called = shown(sheet, 60)
        why = _write_text(book, sheet, place, file.name)
        try:
            if not why:
                label = f"{file.name} sheet {called}"
                sheets[sheet] = place, text.FORMAT.survey(place, label, MAX_FILE_BYTES)
        except TableError as error:
            why = str(error).partition(f"sheet {called}")[2].strip(": ")
        if why:
            refused.append(f"sheet {called} is no table: {tidy(why, 300)}")
    if not sheets:
        raise TableError(f"{file.name}: {'; '.join(refused[:5]) or 'has no sheet'}; name a workbook with a table")
    return sheets, refused


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


def _track(sheet: str, place: Path, signal: SignalInfo, name: str) -> Track:
    """A column of a sheet as a channel."""
    label = f"{name} sheet {shown(sheet, 60)}"
    request = Request(place, (signal.name,), signal.group, label, MAX_FILE_BYTES)
    whole = remembered(lambda *_: text.FORMAT.read(request)[0].samples)

    def samples(first: int, last: int) -> Any:
        return whole(0, signal.count)[first:last]

    group = f"{sheet}/{signal.group}" if signal.group else sheet
    return Track(signal.name, signal.unit, signal.count, samples, signal.rate, group=group, note=signal.note)


def _content(file: OpenFile) -> Content:
    """The channels of an open file."""
    sheets, refused = _tables(file)
    tracks = [_track(sheet, place, one, file.name) for sheet, (place, info) in sheets.items() for one in info.signals]
    said = [(f"{tidy(sheet, 60)}: " if len(sheets) > 1 else "", info.notes) for sheet, (_, info) in sheets.items()]
    notes = [*(f"{before}{one}" for before, every in said for one in every), *refused]
    return Content("workbook", tracks, notes[:40])


def texts(path: Path, label: str) -> dict[str, str]:
    """The cells of each sheet that holds a table, as text with tabs, by the name of the sheet."""
    name = name_of(path, label)
    with guard(name, _KIND), opened("workbook", _KIND, path, name) as file:
        return {sheet: place.read_text(encoding="utf-8") for sheet, (place, _) in _tables(file)[0].items()}


def first_table(path: Path, label: str) -> str:
    """The cells of the first sheet that is not blank, as a table of CSV; a row keeps its number."""
    import polars as pl

    name = name_of(path, label)
    with guard(name, _KIND), opened("workbook", _KIND, path, name) as file:
        book = _book(file)
        for sheet in book.sheet_names[:_MOST_SHEETS]:
            cells = pl.DataFrame(book.load_sheet(sheet, header_row=None, skip_rows=0, dtypes="string"))
            if cells.height:
                return cells.with_columns(pl.all().str.replace(_NO_DAY, "")).write_csv(include_header=False)
        raise TableError(f"{name}: is blank; write its table into the first sheet")


FORMAT = track_format("workbook", "workbook", (".xlsx", ".xlsm", ".xlsb", ".xls", ".ods"), _KIND, _content)
