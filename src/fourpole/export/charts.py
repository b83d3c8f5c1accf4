"""Charts of the workbook, which the spreadsheet program draws from sheets of data, in the colours of the figures."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import polars as pl

from fourpole import quantities as q
from fourpole.core.arrays import FloatArray
from fourpole.core.checks import Verdict
from fourpole.export.source import ExportTables, need
from fourpole.plot.sheet import floats, spread, texts
from fourpole.plot.style import Style
from fourpole.quantities import Quantity

_DATA, _STATIC = "chart data", "chart data K1"
_QUANTITIES = (q.K2, q.C, q.STORAGE, q.LOSS_FACTOR, q.TR_MEASURED)
_MARKERS = ("circle", "square", "triangle", "diamond", "star", "plus")
_DASHES = ("solid", "dash", "round_dot", "dash_dot", "long_dash", "long_dash_dot")
#: Most curves of a chart; with more, a reader cannot distinguish them.
_MOST_CURVES = 30
#: Size of a chart [pixel].
_WIDE, _HIGH = 640, 400
#: Number of cells of default size that a chart and the gap after it take.
_COLUMNS, _ROWS = 11, 21


@dataclass(frozen=True)
class _Curve:
    """First and last row of a curve in a sheet of chart data, and its look; the first column has its name."""

    first: int
    last: int
    colour: str
    fill: str
    marker: str
    dash: str


def add_charts(
    book: Any, sheet: Any, source: ExportTables, write_table: Callable[[Any, pl.DataFrame], None]
) -> tuple[str, ...]:
    """Add the charts and the sheets with their data; returns notes on what the charts do not show."""
    notes: list[str] = []
    table, curves = _dynamic_data(source)
    static, static_curves = _static_data(source)
    sheet.hide_gridlines(2)
    sheet.set_landscape()
    sheet.fit_to_pages(1, 0)
    sheet.set_h_pagebreaks([2 * _ROWS, 4 * _ROWS])
    for name, data in ((_DATA, table), (_STATIC, static)):
        if data.height:
            write_table(book.add_worksheet(name), data)
    loads = sorted(curves)
    for down, quantity in enumerate(_QUANTITIES):
        if not np.isfinite(floats(table, quantity.label)).any():
            continue
        for across, load in enumerate(loads):
            shown, said = _fewer(curves[load])
            notes += [f"{quantity.name}, {source.sheet.name_of_load(load)}: {said}"] if said else []
            title = ", ".join(part for part in (quantity.name, source.sheet.name_of_load(load)) if part)
            chart = _chart(book, title, table, (q.FREQUENCY, quantity))
            _add_curves(chart, _DATA, table, shown, (q.FREQUENCY, quantity))
            sheet.insert_chart(down * _ROWS, across * _COLUMNS, chart)
    if static_curves:
        shown, said = _fewer(static_curves)
        notes += [f"K1: {said}"] if said else []
        chart = _chart(book, "Static stiffness K1", static, (q.PRESSURE, q.K1))
        _add_curves(chart, _STATIC, static, shown, (q.PRESSURE, q.K1))
        sheet.insert_chart(len(_QUANTITIES) * _ROWS, 0, chart)
    return tuple(dict.fromkeys(notes))


def _fewer(curves: Sequence[_Curve]) -> tuple[list[_Curve], str]:
    """The curves that a chart shows, and a note if these are not all."""
    chosen = [curves[at] for at in spread(len(curves), _MOST_CURVES)]
    said = f"the chart shows {len(chosen)} of {len(curves)} conditions" if len(chosen) < len(curves) else ""
    return chosen, said


class _ChartData:
    """The data of charts: rows of a table in the order of the curves, with the name of its curve in each row."""

    def __init__(self) -> None:
        self.rows: list[int] = []
        self.names: list[str] = []

    def curve(self, name: str, rows: Sequence[int], colour: str, fill: str, marker: int, dash: int) -> _Curve:
        """Append the rows of a curve; marker and dash count through those that a chart has."""
        first = len(self.rows) + 1
        self.rows += rows
        self.names += [name] * len(rows)
        marks = _MARKERS[marker % len(_MARKERS)], _DASHES[dash % len(_DASHES)]
        return _Curve(first, len(self.rows), colour, fill, *marks)

    def frame(self, table: pl.DataFrame, values: Mapping[str, FloatArray], *more: str) -> pl.DataFrame:
        """Name of the curve, test, tyre and preload, values in the units of the axes, and further columns."""
        rows = table[self.rows]
        return pl.DataFrame(
            [
                pl.Series("curve", self.names, dtype=pl.String),
                *(rows[name] for name in ("test", "tyre", q.PRELOAD.head)),
                *(pl.Series(label, column[self.rows], dtype=pl.Float64) for label, column in values.items()),
                *(rows[name] for name in more),
            ]
        )


def _dynamic_data(source: ExportTables) -> tuple[pl.DataFrame, dict[int, list[_Curve]]]:
    """The tests by condition in the units of the axes, and the curves by preload."""
    sheet, style, data = source.sheet, Style(), _ChartData()
    curves: dict[int, list[_Curve]] = {}
    for one in source.conditions:
        name, fill = source.name_of(one, load=False), style.face(one.tyre, one.pressure, len(sheet.pressures))
        marks = one.pressure, one.setting + one.repeat
        curves.setdefault(one.load, []).append(data.curve(name, one.rows, style.colour(one.tyre), fill, *marks))
    columns = {q.FREQUENCY.label: sheet.shown(q.FREQUENCY)[0]}
    for quantity in _QUANTITIES:
        columns |= dict(zip((quantity.label, quantity.u_label), sheet.shown(quantity), strict=True))
    return data.frame(sheet.table, columns, "verdict"), curves


def _static_data(source: ExportTables) -> tuple[pl.DataFrame, list[_Curve]]:
    """K1 of the static tests that are used, in the units of the axes, and a curve per tyre and preload."""
    sheet, style, data = source.sheet, Style(), _ChartData()
    curves = []
    for (tyre, load), rows in sorted(_static_rows(source).items()):
        name = ", ".join(part for part in (sheet.labels[tyre], sheet.name_of_load(load) if load >= 0 else "") if part)
        curves.append(data.curve(name, rows, style.colour(tyre), style.colour(tyre), load, load))
    columns = {one.label: floats(sheet.static, one.head) / one.scale for one in (q.PRESSURE, q.K1)}
    columns[q.K1.u_label] = floats(sheet.static, q.K1.u_head) / q.K1.scale
    return data.frame(sheet.static, columns), curves


def _static_rows(source: ExportTables) -> dict[tuple[int, int], list[int]]:
    """Rows of static.csv that are used, in rising order of pressure, by tyre and preload."""
    sheet, static = source.sheet, source.sheet.static
    pressure, load = floats(static, q.PRESSURE.head), floats(static, q.PRELOAD.head)
    rejected = np.array([verdict == Verdict.REJECTED for verdict in texts(static, "verdict")], dtype=bool)
    used = np.isfinite(pressure) & np.isfinite(floats(static, q.K1.head)) & ~rejected
    tyres = texts(static, "tyre")
    rows: dict[tuple[int, int], list[int]] = {}
    for row in np.argsort(pressure, kind="stable").tolist():
        if used[row]:
            rows.setdefault((sheet.names.index(tyres[row]), _group(source, load[row])), []).append(row)
    return rows


def _group(source: ExportTables, load: float) -> int:
    """Group of a preload; -1 if it is not stated."""
    return source.sheet.loads.nearest(load) if np.isfinite(load) and len(source.sheet.loads) else -1


def _chart(book: Any, title: str, table: pl.DataFrame, axes: tuple[Quantity, Quantity]) -> Any:
    chart = book.add_chart({"type": "scatter", "subtype": "straight_with_markers"})
    font, grid = {"size": 9}, {"visible": True, "line": {"color": "#E3E6E9", "width": 0.75}}
    x, y = (quantity.label for quantity in axes)
    low, high, step = _ends(floats(table, x))
    shared = {"name_font": {"size": 9, "bold": False}, "num_font": font, "major_gridlines": grid}
    chart.set_title({"name": title, "name_font": {"size": 11, "bold": True}, "overlay": False})
    chart.set_x_axis({"name": x, "min": low, "max": high, "major_unit": step, "label_position": "low", **shared})
    chart.set_y_axis({"name": y, "num_format": "General", "label_position": "low", **shared})
    chart.set_legend({"position": "right", "font": {"size": 8}})
    chart.set_size({"width": _WIDE, "height": _HIGH})
    chart.show_blanks_as("gap")
    return chart


def _ends(values: FloatArray) -> tuple[float, float, float]:
    """Round ends and step of an axis that holds all values."""
    known = values[np.isfinite(values)]
    low, high = (float(known.min()), float(known.max())) if known.size else (0.0, 1.0)
    span = high - low or abs(high) or 1.0
    power = float(10.0 ** np.floor(np.log10(span / 5)))
    step = power * max(part for part in (1.0, 2.0, 5.0) if part * power <= span / 5)
    return round(step * np.floor(low / step - 0.05), 9), round(step * np.ceil(high / step + 0.05), 9), round(step, 9)


def _add_curves(
    chart: Any, sheet: str, table: pl.DataFrame, curves: Sequence[_Curve], axes: tuple[Quantity, Quantity]
) -> None:
    """Curves with error bars of one standard uncertainty."""
    x, y = axes
    x_at, y_at, std_at = (table.columns.index(name) for name in (x.label, y.label, y.u_label))
    for curve in curves:
        bars = _range(sheet, curve, std_at)
        line = {"color": curve.colour, "width": 1.25, "dash_type": curve.dash}
        known = np.isfinite(floats(table, table.columns[std_at])[curve.first - 1 : curve.last]).any()
        thin, border = {"color": curve.colour, "width": 0.5}, {"color": curve.colour}
        error = {"type": "custom", "plus_values": bars, "minus_values": bars, "line": thin}
        chart.add_series(
            {
                # The name is a reference to a cell, because a text that begins with = would become a formula.
                "name": [sheet, curve.first, 0],
                "categories": [sheet, curve.first, x_at, curve.last, x_at],
                "values": [sheet, curve.first, y_at, curve.last, y_at],
                "line": line,
                "marker": {"type": curve.marker, "size": 6, "fill": {"color": curve.fill}, "border": border},
                **({"y_error_bars": error} if known else {}),
            }
        )


def _range(sheet: str, curve: _Curve, column: int) -> str:
    """Cells of a column, as a chart names them."""
    utility = need("xlsxwriter.utility", "export")
    return f"={utility.xl_range_formula(sheet, curve.first, column, curve.last, column)}"
