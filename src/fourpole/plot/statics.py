"""The static tests: load against deflection of each specimen, with the preloads at which K1 is taken."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import polars as pl

from fourpole import quantities as q
from fourpole.core.arrays import ByValue, FloatArray
from fourpole.core.checks import Verdict
from fourpole.core.condition import PRESSURE
from fourpole.plot.cards import static_cards
from fourpole.plot.data import MOST_LABELLED, AxisData, FigureData, Panel, Role, Scale, Series, shade
from fourpole.plot.sheet import Sheet, few, read_sheet
from fourpole.quantities import ShownUnits
from fourpole.study.study import Study

#: Deflection [mm] and load [kN] of a curve.
_MM, _KN = 1e3, 1e-3
_MOST_TYRES, _MOST_COLUMNS, _MOST_CURVES = 6, 3, 12


@dataclass(frozen=True, eq=False)
class LoadLine(ByValue):
    """Mean load-deflection curve of one static test: deflection [mm] from the point of zero load, load [kN]."""

    test: str
    tyre: int
    pressure: float
    deflection: FloatArray
    load: FloatArray
    rejected: bool


def load_lines(results: Study, sheet: Sheet) -> list[LoadLine]:
    """The load-deflection curves of the static tests that have one."""
    previews = results.previews
    if q.MEAN_LOAD.head not in previews.columns or not sheet.static.height:
        return []
    curves = previews.filter(pl.col(q.MEAN_LOAD.head).list.len() > 1)
    by_test = {row["test"]: row for row in curves.select("test", q.MEAN_DEFLECTION.head, q.MEAN_LOAD.head).to_dicts()}
    lines = []
    for (test,), rows in sheet.static.group_by("test", maintain_order=True):
        if test not in by_test:
            continue
        x = np.array(by_test[test][q.MEAN_DEFLECTION.head], dtype=float) * _MM
        load = np.array(by_test[test][q.MEAN_LOAD.head], dtype=float) * _KN
        order = np.argsort(x, kind="stable")
        x, load = x[order], load[order]
        pressure = rows[q.PRESSURE.head][0]
        lines.append(
            LoadLine(
                test=str(test),
                tyre=sheet.names.index(rows["tyre"][0] or ""),
                pressure=np.nan if pressure is None else float(pressure),
                deflection=x - _zero_load(x, load),
                load=load,
                rejected=all(verdict == Verdict.REJECTED for verdict in rows["verdict"]),
            )
        )
    return lines


def _zero_load(deflection: FloatArray, load: FloatArray) -> float:
    """Deflection [mm] of zero load; if the curve does not reach zero, extrapolated along a tenth of the curve."""
    below = np.flatnonzero((load[:-1] <= 0) & (load[1:] > 0))
    if below.size:
        at, step = int(below[-1]), 1
    else:
        at, step = min(int(np.argmin(np.abs(load))), load.size - 2), max(1, load.size // 10)
    end = min(at + step, load.size - 1)
    rise = float(load[end] - load[at])
    return float(deflection[at] - load[at] * (deflection[end] - deflection[at]) / rise) if rise > 0 else 0.0


def over_deflection(results: Study) -> FigureData | None:
    """Mean load-deflection curves, a panel per specimen; points are the preloads at which K1 is their tangent."""
    sheet = read_sheet(results, texts_only=True)
    lines = load_lines(results, sheet)
    if not lines:
        return None
    notes: list[str] = []
    shown = few(sorted({line.tyre for line in lines}), _MOST_TYRES, "specimens", notes)
    notes += ["curves: mean of loading and unloading, from the point of zero load", "points: K1 is the slope there"]
    chosen = {}
    for tyre in shown:
        own = sorted((one for one in lines if one.tyre == tyre), key=lambda one: (np.isnan(one.pressure), one.pressure))
        chosen[tyre] = few(own, _MOST_CURVES, f"tests of {sheet.labels[tyre]}", notes)
    units = results.shown
    pressures = [one.pressure for each in chosen.values() for one in each if not np.isnan(one.pressure)]
    many = max(map(len, chosen.values())) > MOST_LABELLED and len(set(pressures)) > 1
    pressure = units.of(q.PRESSURE)
    ends = [pick(pressures) / pressure.scale for pick in (min, max)] if many else []
    scale = Scale(pressure.name, pressure.shown, *ends) if ends else None
    panels = [_panel(results, sheet, chosen[tyre], scaled=many) for tyre in shown]
    columns = min(len(shown), _MOST_COLUMNS)
    return FigureData(tuple(panels), columns, sheet.labels, scale=scale, notes=tuple(notes), panel_height=2.4)


def _panel(results: Study, sheet: Sheet, lines: Sequence[LoadLine], *, scaled: bool) -> Panel:
    """The curves of one specimen."""
    units, cards = results.shown, static_cards(results)
    moved, load, pressure = (units.of(one) for one in (q.DEFLECTION_AMPLITUDE, q.PRELOAD, q.PRESSURE))
    several, series = len({one.pressure for one in lines}) > 1, []
    for at, one in enumerate(lines):
        x, y = one.deflection / _MM / moved.scale, one.load / _KN / load.scale
        known = not np.isnan(one.pressure)
        place = sheet.pressures.nearest(one.pressure) if known else 0
        look = Series(Role.LINE, x, y, tyre=-1 if one.rejected else one.tyre, dash=2 if one.rejected else 0,
                      shade=shade(at, len(lines)), marker=place,
                      level=one.pressure / pressure.scale if scaled and not one.rejected else np.nan)  # fmt: skip
        label = "" if scaled else _label(one, units, sheet.pressures.labels[place], several=several)
        series.append(replace(look, label=label, tests=(one.test,), cards=(cards[one.test],)))
        at_preload = _preloads(sheet.static, one)
        if at_preload.size:
            x, count = np.interp(at_preload, one.load / _KN, one.deflection) / _MM / moved.scale, at_preload.size
            points = replace(look, role=Role.POINTS, x=x, y=at_preload / load.scale)
            series.append(replace(points, tests=(one.test,) * count, cards=(cards[one.test],) * count))
    tyre = lines[0].tyre
    x_axis, y_axis = AxisData("deflection", moved.shown), AxisData("load", load.shown)
    return Panel(x_axis, y_axis, tuple(series), sheet.labels[tyre], "", tyre)


def _label(one: LoadLine, units: ShownUnits, usual: str, *, several: bool) -> str:
    """The pressure of a curve, where it differs from that of others."""
    if not several or np.isnan(one.pressure):
        return ""
    return usual if q.PRESSURE.unit not in units.wanted else units.setting(PRESSURE.column, one.pressure)


def _preloads(static: pl.DataFrame, one: LoadLine) -> FloatArray:
    """The preloads [N] at which a test gives K1, within its curve."""
    rows = static.filter((pl.col("test") == one.test) & pl.col(q.K1.head).is_not_null())
    values = rows[q.PRELOAD.head].drop_nulls().to_numpy() if rows.height else np.zeros(0)
    return np.asarray(values[(values >= one.load.min() / _KN) & (values <= one.load.max() / _KN)], dtype=float)


#: The figures of this module by their keys in catalogue.toml.
FIGURES = {"static": over_deflection}
