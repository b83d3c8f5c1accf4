"""Charts of the workbook: native ones, on data laid out for them, in the colours of the figures."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import polars as pl

from fourpole import quantities as q
from fourpole.core.arrays import FloatArray
from fourpole.export.source import ExportTables
from fourpole.plot.sheet import floats, spread
from fourpole.plot.style import Style
from fourpole.quantities import Quantity

__all__ = ["add_charts"]

_DATA, _STATIC = "chart data", "chart data K1"
_QUANTITIES = (q.K2, q.C, q.STORAGE, q.LOSS_FACTOR, q.TR_MEASURED)
_MARKERS = ("circle", "square", "triangle", "diamond", "star", "plus")
_DASHES = ("solid", "dash", "round_dot", "dash_dot", "long_dash", "long_dash_dot")
#: A chart with more curves than that shows none of them.
_MOST_CURVES = 30
_WIDE, _HIGH = 640, 400
_COLUMNS, _ROWS = 11, 21  # cells of a chart and the gap after it, at their default size


@dataclass(frozen=True)
class _Curve:
    """Rows of a sheet with chart data, named by their first column, and how they look."""

    first: int
    last: int
    colour: str
    fill: str
    marker: str
    dash: str


def add_charts(
    book: Any, sheet: Any, source: ExportTables, write_table: Callable[[Any, pl.DataFrame], None]
) -> tuple[str, ...]:
    """Add the charts and the sheets with their data; gives back what they do not show."""
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
    """As many curves as a reader can tell apart."""
    chosen = [curves[at] for at in spread(len(curves), _MOST_CURVES)]
    said = f"the chart shows {len(chosen)} of {len(curves)} conditions" if len(chosen) < len(curves) else ""
    return chosen, said


def _dynamic_data(source: ExportTables) -> tuple[pl.DataFrame, dict[int, list[_Curve]]]:
    """The tests by condition, in the units of the axes, and the curves by load."""
    sheet, style = source.sheet, Style()
    rows: list[int] = []
    names: list[str] = []
    curves: dict[int, list[_Curve]] = {}
    for condition in source.conditions:
        first = len(rows) + 1
        rows += condition.rows
        names += [source.name_of(condition, load=False)] * len(condition.rows)
        count = len(sheet.pressures)
        look = (style.colour(condition.tyre), style.face(condition.tyre, condition.pressure, count))
        marker = _MARKERS[condition.pressure % len(_MARKERS)]
        dash = _DASHES[(condition.setting + condition.repeat) % len(_DASHES)]
        curves.setdefault(condition.load, []).append(_Curve(first, len(rows), *look, marker, dash))
    frame = sheet.table[rows].select("test", "tyre", q.PRELOAD.head, "verdict")
    columns = {"curve": names, q.FREQUENCY.label: sheet.shown(q.FREQUENCY)[0][rows]}
    for quantity in _QUANTITIES:
        value, std = sheet.shown(quantity)
        columns |= {quantity.label: value[rows], quantity.u_label: std[rows]}
    return frame.with_columns(_series(columns)).select(
        "curve", "test", "tyre", q.PRELOAD.head, *list(columns)[1:], "verdict"
    ), curves


def _series(columns: dict[str, Any]) -> Iterator[pl.Series]:
    for name, values in columns.items():
        yield pl.Series(name, values, dtype=pl.String if isinstance(values, list) else pl.Float64)


def _static_data(source: ExportTables) -> tuple[pl.DataFrame, list[_Curve]]:
    """K1 by tyre and load over pressure."""
    sheet, style, static = source.sheet, Style(), source.sheet.static
    pressure, k1, std = (floats(static, name) for name in (q.PRESSURE.head, q.K1.head, q.K1.u_head))
    load, verdicts = floats(static, q.PRELOAD.head), static["verdict"].to_list()
    tyres = [text or "" for text in static["tyre"].to_list()]
    used = [
        row
        for row in range(static.height)
        if verdicts[row] != "rejected" and np.isfinite([pressure[row], k1[row]]).all()
    ]
    curves: list[_Curve] = []
    order: list[int] = []
    names: list[str] = []
    keys = sorted({(sheet.names.index(tyres[row]), _group(source, load[row])) for row in used})
    for tyre, at in keys:
        mine = [row for row in used if tyres[row] == sheet.names[tyre] and _group(source, load[row]) == at]
        mine.sort(key=lambda row: pressure[row])
        first = len(order) + 1
        order += mine
        named = ", ".join(part for part in (sheet.labels[tyre], sheet.name_of_load(at) if at >= 0 else "") if part)
        colour = style.colour(tyre)
        names += [named] * len(mine)
        curves.append(_Curve(first, len(order), colour, colour, _MARKERS[at % 6], _DASHES[at % len(_DASHES)]))
    frame = static[order].select("test", "tyre", q.PRELOAD.head)
    shown = {q.PRESSURE.label: pressure / q.PRESSURE.scale, q.K1.label: k1 / q.K1.scale, q.K1.u_label: std / q.K1.scale}
    columns = {"curve": names, **{name: values[order] for name, values in shown.items()}}
    return frame.with_columns(_series(columns)).select("curve", *frame.columns, *list(columns)[1:]), curves


def _group(source: ExportTables, load: float) -> int:
    """The load's group; -1 where it is not stated."""
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
    seen = values[np.isfinite(values)]
    low, high = (float(seen.min()), float(seen.max())) if seen.size else (0.0, 1.0)
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
        error = {
            "type": "custom",
            "plus_values": bars,
            "minus_values": bars,
            "line": {"color": curve.colour, "width": 0.5},
        }
        chart.add_series(
            {
                # A cell, not a text: a text that begins with = would be taken for a formula.
                "name": [sheet, curve.first, 0],
                "categories": [sheet, curve.first, x_at, curve.last, x_at],
                "values": [sheet, curve.first, y_at, curve.last, y_at],
                "line": line,
                "marker": {
                    "type": curve.marker,
                    "size": 6,
                    "fill": {"color": curve.fill},
                    "border": {"color": curve.colour},
                },
                **({"y_error_bars": error} if known else {}),
            }
        )


def _range(sheet: str, curve: _Curve, column: int) -> str:
    """Cells of a column, as a chart names them."""
    letters, rest = "", column + 1
    while rest:
        rest, letter = divmod(rest - 1, 26)
        letters = chr(ord("A") + letter) + letters
    return f"='{sheet}'!${letters}${curve.first + 1}:${letters}${curve.last + 1}"
