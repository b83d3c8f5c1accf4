"""Workbook: every table as a sheet, numbers to the last bit, and charts that the program itself draws."""

from __future__ import annotations

import io
import math
from collections.abc import Iterator, Sequence
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from fourpole.core.arrays import FloatArray
from fourpole.export.charts import add_charts
from fourpole.export.source import SIGNS, ExportTables, need
from fourpole.io.write import write_bytes
from fourpole.plot.sheet import floats

__all__ = ["write"]

#: Rows below the head that a sheet holds, and signs that a cell holds.
_MOST_ROWS = 1_048_575
_MOST_SIGNS = 32_767
_WIDEST = 44
_ABOUT_WIDTH = 110
#: What a spreadsheet would take for a formula, were the cell typed again.
_FORMULA = ("=", "+", "-", "@", "\t", "\r")
#: Fill and ink of a verdict; the word says it too.
_VERDICTS = {"ok": ("#DCF1EA", "#00553D"), "warning": ("#FCEBC8", "#6B4600"), "rejected": ("#F7D9C7", "#7A2F00")}
_ABOUT = {
    "static": "K1 of each static test at each preload in use",
    "dynamic": "one row per dynamic test: amplitudes, V1/F1, K*, K2, C, TR, each with its uncertainty",
    "rig": "values of the rig and gains of the channels, as stated and as found",
    "residuals": "F1/V2 less the rig's impedance, of each test that the joint route used",
    "quantiles": "intervals of K2 and C that are not normal",
    "budget": "what each source gives to the uncertainty of each result",
}


class _Exact(float):
    """A float that is written with the fewest digits that give the same float back, whatever is asked for."""

    def __format__(self, spec: str) -> str:
        return repr(float(self))


class Styles:
    """The formats of a workbook, each made once."""

    def __init__(self, book: Any) -> None:
        self._book = book
        self._made: dict[tuple[tuple[str, Any], ...], Any] = {}

    def of(self, **properties: Any) -> Any:
        """A format of these properties."""
        key = tuple(sorted(properties.items()))
        if key not in self._made:
            self._made[key] = self._book.add_format(properties)
        return self._made[key]

    @property
    def head(self) -> Any:
        """The head of a table."""
        return self.of(bold=True, bottom=1, bg_color="#E3E6E9", text_wrap=True, valign="top")


def write(source: ExportTables, path: Path) -> tuple[str, ...]:
    """Write the workbook; nothing is left out of its tables."""
    xlsxwriter = need("xlsxwriter", "export")
    buffer = io.BytesIO()
    with xlsxwriter.Workbook(buffer, {"in_memory": True, "default_date_format": "yyyy-mm-dd"}) as book:
        book.set_properties({"title": source.title, "created": source.made.replace(tzinfo=None), "author": ""})
        styles = Styles(book)
        about, charts = book.add_worksheet("about"), book.add_worksheet("charts")
        sheets = [part for name, table in source.tables.items() for part in _parts(name, table)]
        for name, table in sheets:
            write_table(book.add_worksheet(name), table, styles)
        notes = add_charts(book, charts, source, lambda sheet, table: write_table(sheet, table, styles))
        _write_about(about, source, [name for name, _ in sheets], styles, notes)
        about.activate()
    write_bytes(path, buffer.getvalue())
    return notes


def _parts(name: str, table: pl.DataFrame, most: int = _MOST_ROWS) -> Iterator[tuple[str, pl.DataFrame]]:
    """A table as sheets; one that is too long for a sheet goes on on the next."""
    for number, start in enumerate(range(0, max(table.height, 1), most), start=1):
        yield (name if number == 1 else f"{name} ({number})"), table.slice(start, most)


def write_table(sheet: Any, table: pl.DataFrame, styles: Styles) -> None:
    """A table from the sheet's first cell on: a head that stays, columns as wide as they must be."""
    sheet.freeze_panes(1, 1)
    sheet.repeat_rows(0)
    sheet.set_row(0, 32)
    for at, name in enumerate(table.columns):
        _write_text(sheet, 0, at, name, styles.head, styles)
        if table.schema[name] == pl.Float64:
            values = floats(table, name)
            number = styles.of(num_format=number_format(values))
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
    """Width of a column: its longest text; a head may take two lines."""
    lengths = [len(text) for text in (*texts[:10_000], *name.split())]
    return float(min(max(*lengths, len(name) * 0.8, 10) + 2, _WIDEST))


def _verdict(name: str, text: str, styles: Styles) -> Any:
    if name != "verdict" or text not in _VERDICTS:
        return None
    fill, ink = _VERDICTS[text]
    return styles.of(bg_color=fill, font_color=ink)


def _write_text(sheet: Any, row: int, column: int, text: str, style: Any, styles: Styles) -> None:
    """A text as a text, whatever it begins with; one that looks like a formula stays one when it is edited."""
    if not text:
        return
    if len(text) > _MOST_SIGNS:
        text = f"{text[: _MOST_SIGNS - 1]}…"
    if style is None and text.startswith(_FORMULA):
        style = styles.of(quote_prefix=True)
    sheet.write_string(row, column, text, style)


def number_format(values: FloatArray) -> str:
    """How a column's numbers are shown; the cells hold all digits.

    Examples
    --------
    >>> number_format(np.array([170123.4])), number_format(np.array([0.31])), number_format(np.array([1e-7]))
    ('0.0', '0.0000', '0.000E+00')
    """
    seen = np.abs(values[np.isfinite(values) & (values != 0)])
    if not seen.size:
        return "0"
    if np.all(seen == np.round(seen)) and seen.max() < 1e9:
        return "0"
    middle = float(np.median(seen))
    if seen.max() >= 1e9 or middle < 1e-2:
        return "0.000E+00"
    return "0.0" if middle >= 1e4 else "0.00" if middle >= 100 else "0.0000"


def _write_about(sheet: Any, source: ExportTables, tables: Sequence[str], styles: Styles, notes: Sequence[str]) -> None:
    """The first sheet: what this is, how it was made, what to know of it."""
    sheet.set_column(0, 0, 24)
    sheet.set_column(1, 1, _ABOUT_WIDTH + 10)
    sheet.hide_gridlines(2)
    sheet.set_landscape()
    sheet.fit_to_pages(1, 0)
    sheet.write_string(0, 0, source.title, styles.of(bold=True, font_size=14))
    name, text = styles.of(bold=True, valign="top"), styles.of(text_wrap=True, valign="top")
    row = 2
    for key, value in _said(source, tables, notes):
        if key:
            sheet.write_string(row, 0, key, name)
        sheet.write_string(row, 1, value[:_MOST_SIGNS], text)
        sheet.set_row(row, 15 * min(math.ceil(len(value) / _ABOUT_WIDTH), 20))  # no row grows by itself everywhere
        row += 1


def _said(source: ExportTables, tables: Sequence[str], notes: Sequence[str]) -> Iterator[tuple[str, str]]:
    yield "results of", f"{source.version}, analysed {_time(source.made)}"
    yield "route to K*", source.route
    yield "tests", ", ".join(f"{count} {verdict}" for verdict, count in source.section("verdicts").items())
    yield "numbers", SIGNS
    if "assumptions" in source.results.record:
        yield from _block("assumed", source.listed("assumptions") or ["nothing: the campaign states all of it"])
    table, rejected = source.dynamic, source.sheet.rejected
    names = zip(table["test"].to_list(), source.texts("remarks"), rejected, strict=True)
    yield from _block("rejected", [f"{test}: {why}" for test, why, is_rejected in names if is_rejected])
    yield "sheet charts", "K2, C, K', loss factor and TR over frequency, K1 over pressure; one colour per tyre"
    for one in tables:
        yield f"sheet {one}", _ABOUT.get(one, "the rows that the sheet before it could not hold")
    yield "chart data", "what the charts show, without rejected tests; change it and they follow"
    yield from _block("charts", notes)
    versions = source.section("versions").items()
    yield "versions", ", ".join(f"{package} {version}" for package, version in versions)


def _block(name: str, lines: Sequence[str]) -> Iterator[tuple[str, str]]:
    """Lines under one name."""
    for at, line in enumerate(lines):
        yield (name if at == 0 else ""), line


def _time(made: datetime) -> str:
    return f"{made:%Y-%m-%d %H:%M} UTC"
