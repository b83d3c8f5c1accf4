"""Workbook: every table as a sheet with all digits of its numbers."""

from __future__ import annotations

import io
import math
from collections.abc import Callable, Iterator, Sequence
from functools import cache
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import polars as pl

from fourpole.core.arrays import FloatArray
from fourpole.core.checks import Verdict
from fourpole.export.source import SIGNS, ExportTables, need
from fourpole.io.write import write_bytes
from fourpole.plot.sheet import floats
from fourpole.study.tables import TABLES

#: Most rows of a sheet below the head, and most characters of a cell.
_MOST_ROWS = 1_048_575
_MOST_SIGNS = 32_767
_WIDEST = 44
_ABOUT_WIDTH = 110
#: First characters of a text that a spreadsheet would take for a formula when the cell is edited.
_FORMULA = ("=", "+", "-", "@", "\t", "\r")
#: Returns the cell format with these properties, which is made once.
Styles: TypeAlias = Callable[..., Any]
#: Colours of fill and text of a verdict.
_VERDICTS: dict[str, tuple[str, str]] = {
    Verdict.OK: ("#DCF1EA", "#00553D"),
    Verdict.WARNING: ("#FCEBC8", "#6B4600"),
    Verdict.REJECTED: ("#F7D9C7", "#7A2F00"),
}


class _Exact(float):
    """A float that any format writes with the fewest digits from which the same float is read."""

    def __format__(self, spec: str) -> str:
        return repr(float(self))


def write(source: ExportTables, path: Path) -> tuple[str, ...]:
    """Write the workbook with all tables; returns no notes, as nothing is left out."""
    xlsxwriter = need("xlsxwriter", "export")
    buffer = io.BytesIO()
    with xlsxwriter.Workbook(buffer, {"in_memory": True, "default_date_format": "yyyy-mm-dd"}) as book:
        book.set_properties({"title": source.title, "created": source.made.replace(tzinfo=None), "author": ""})
        styles = cache(lambda **properties: book.add_format(properties))
        sheets = [part for name, table in source.tables.items() for part in _parts(name, table)]
        _write_about(book.add_worksheet("about"), source, [name for name, _ in sheets], styles)
        for name, table in sheets:
            _write_table(book.add_worksheet(name), table, styles)
    write_bytes(path, buffer.getvalue())
    return ()


def _parts(name: str, table: pl.DataFrame, most: int = _MOST_ROWS) -> Iterator[tuple[str, pl.DataFrame]]:
    """A table as sheets; a table that is too long for a sheet continues on the next."""
    for number, start in enumerate(range(0, max(table.height, 1), most), start=1):
        yield (name if number == 1 else f"{name} ({number})"), table.slice(start, most)


def _write_table(sheet: Any, table: pl.DataFrame, styles: Styles) -> None:
    """Write a table from the first cell of a sheet; the head stays visible, and columns are as wide as their texts."""
    sheet.freeze_panes(1, 1)
    sheet.repeat_rows(0)
    sheet.set_row(0, 32)
    head = styles(bold=True, bottom=1, bg_color="#E3E6E9", text_wrap=True, valign="top")
    for at, name in enumerate(table.columns):
        _write_text(sheet, 0, at, name, head, styles)
        if table.schema[name].is_numeric():
            values = floats(table, name)
            number = styles(num_format=number_format(values))
            sheet.set_column(at, at, _width(name, [""]))
            for row, value in enumerate(values.tolist(), start=1):
                if np.isfinite(value):
                    sheet.write_number(row, at, _Exact(value), number)
        else:
            texts = [text or "" for text in table[name].to_list()]
            sheet.set_column(at, at, _width(name, texts))
            for row, text in enumerate(texts, start=1):
                _write_text(sheet, row, at, text, _verdict(name, text, styles), styles)
    if table.height:
        sheet.autofilter(0, 0, table.height, len(table.columns) - 1)


def _width(name: str, texts: Sequence[str]) -> float:
    """Width of a column [character]: that of its longest text; a head may have two lines."""
    lengths = [len(text) for text in (*texts[:10_000], *name.split())]
    return float(min(max(*lengths, len(name) * 0.8, 10) + 2, _WIDEST))


def _verdict(name: str, text: str, styles: Styles) -> Any:
    """Format of a verdict; None for any other cell."""
    if not name.startswith("verdict") or text not in _VERDICTS:
        return None
    fill, ink = _VERDICTS[text]
    return styles(bg_color=fill, font_color=ink)


def _write_text(sheet: Any, row: int, column: int, text: str, style: Any, styles: Styles) -> None:
    """Write a text as a text, never as a formula; it remains a text when the cell is edited."""
    if not text:
        return
    if len(text) > _MOST_SIGNS:
        text = f"{text[: _MOST_SIGNS - 1]}…"
    if style is None and text.startswith(_FORMULA):
        style = styles(quote_prefix=True)
    sheet.write_string(row, column, text, style)


def number_format(values: FloatArray) -> str:
    """Number format of a column, which sets the digits shown; the cells have all digits.

    Examples
    --------
    >>> number_format(np.array([170123.4])), number_format(np.array([0.31])), number_format(np.array([1e-7]))
    ('0.0', '0.0000', '0.000E+00')
    """
    sizes = np.abs(values[np.isfinite(values) & (values != 0)])
    if not sizes.size or (np.all(sizes == np.round(sizes)) and sizes.max() < 1e9):
        return "0"
    middle = float(np.median(sizes))
    if sizes.max() >= 1e9 or middle < 1e-2:
        return "0.000E+00"
    return "0.0" if middle >= 1e4 else "0.00" if middle >= 100 else "0.0000"


def _write_about(sheet: Any, source: ExportTables, tables: Sequence[str], styles: Styles) -> None:
    """Write the first sheet: origin, settings, assumptions and a description of each sheet."""
    sheet.set_column(0, 0, 24)
    sheet.set_column(1, 1, _ABOUT_WIDTH + 10)
    sheet.hide_gridlines(2)
    sheet.set_landscape()
    sheet.fit_to_pages(1, 0)
    sheet.write_string(0, 0, source.title, styles(bold=True, font_size=14))
    name, text = styles(bold=True, valign="top"), styles(text_wrap=True, valign="top")
    row = 2
    for key, value in _about_rows(source, tables):
        if key:
            sheet.write_string(row, 0, key, name)
        sheet.write_string(row, 1, value[:_MOST_SIGNS], text)
        sheet.set_row(
            row, 15 * min(math.ceil(len(value) / _ABOUT_WIDTH), 20)
        )  # not every program adapts the height of a row to its text
        row += 1


def _about_rows(source: ExportTables, tables: Sequence[str]) -> Iterator[tuple[str, str]]:
    """Name and text of each row of the first sheet; a row that continues another has no name."""
    yield "results of", f"{source.version}, analysed {source.made:%Y-%m-%d %H:%M} UTC"
    yield "route to K*", source.route
    yield "tests", ", ".join(f"{count} {verdict}" for verdict, count in source.section("verdicts").items())
    yield "numbers", SIGNS
    if "assumptions" in source.results.record:
        yield from _block("assumed", source.listed("assumptions") or ["nothing: the campaign states all of it"])
    yield from _block("notes", source.listed("notes"))
    table, rejected = source.dynamic, source.sheet.rejected
    names = zip(table["test"].to_list(), source.texts("remarks"), rejected, strict=True)
    yield from _block("rejected", [f"{test}: {why}" for test, why, is_rejected in names if is_rejected])
    yield "figures", "in the report of the results, and one by one with fourpole plot"
    for one in tables:
        about = f"each row: {TABLES[one].about}" if one in TABLES else "the rows that did not fit into the sheet before"
        yield f"sheet {one}", about
    versions = source.section("versions").items()
    yield "versions", ", ".join(f"{package} {version}" for package, version in versions)


def _block(name: str, lines: Sequence[str]) -> Iterator[tuple[str, str]]:
    """Lines under one name."""
    for at, line in enumerate(lines):
        yield (name if at == 0 else ""), line
