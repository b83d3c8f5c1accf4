"""Curves of single tests: load over deflection of static ones, hysteresis loops and signals of dynamic ones."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import polars as pl

from fourpole import quantities as q
from fourpole.core.arrays import ByValue, FloatArray
from fourpole.core.checks import Verdict
from fourpole.core.condition import PRESSURE
from fourpole.core.phasor import SYMBOLS
from fourpole.core.recording import UNITS
from fourpole.fitting.rows import keys_of
from fourpole.plot.cards import linked, static_cards
from fourpole.plot.data import MOST_LABELLED, AxisData, FigureData, Panel, Role, Scale, Series, shade
from fourpole.plot.part import part_of
from fourpole.plot.sheet import Sheet, few, present, read_sheet, spread, texts
from fourpole.plot.states import by_tyre, stated_text, tested
from fourpole.quantities import ShownUnits
from fourpole.study.record import section, stated_blocked
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
    panels = [_static_panel(results, sheet, chosen[tyre], scaled=many) for tyre in shown]
    columns = min(len(shown), _MOST_COLUMNS)
    return FigureData(tuple(panels), columns, sheet.labels, scale=scale, notes=tuple(notes), panel_height=2.4)


def _static_panel(results: Study, sheet: Sheet, lines: Sequence[LoadLine], *, scaled: bool) -> Panel:
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
        label = "" if scaled else _pressure_label(one, units, sheet.pressures.labels[place], several=several)
        series.append(replace(look, label=label, tests=(one.test,), cards=(cards[one.test],)))
        at_preload = _preloads(sheet.static, one)
        if at_preload.size:
            x, count = np.interp(at_preload, one.load / _KN, one.deflection) / _MM / moved.scale, at_preload.size
            points = replace(look, role=Role.POINTS, x=x, y=at_preload / load.scale)
            series.append(replace(points, tests=(one.test,) * count, cards=(cards[one.test],) * count))
    tyre = lines[0].tyre
    x_axis, y_axis = AxisData("deflection", moved.shown), AxisData("load", load.shown)
    return Panel(x_axis, y_axis, tuple(series), sheet.labels[tyre], "", tyre)


def _pressure_label(one: LoadLine, units: ShownUnits, usual: str, *, several: bool) -> str:
    """The pressure of a curve, where it differs from that of others."""
    if not several or np.isnan(one.pressure):
        return ""
    return usual if q.PRESSURE.unit not in units.wanted else units.setting(PRESSURE.column, one.pressure)


def _preloads(static: pl.DataFrame, one: LoadLine) -> FloatArray:
    """The preloads [N] at which a test gives K1, within its curve."""
    rows = static.filter((pl.col("test") == one.test) & pl.col(q.K1.head).is_not_null())
    values = rows[q.PRELOAD.head].drop_nulls().to_numpy() if rows.height else np.zeros(0)
    return np.asarray(values[(values >= one.load.min() / _KN) & (values <= one.load.max() / _KN)], dtype=float)


_MOST_LOOPS, _MOST_SIGNALS, _POINTS = 3, 3, 145


def loops(results: Study) -> FigureData | None:
    """Force over the deflection of the specimen in one cycle, from the amplitudes of the tests; a panel per specimen.

    Of many tests those of the condition with the most of them are shown, spread over the frequencies.
    """
    sheet = read_sheet(results, texts_only=True)
    force, deflection = _amplitudes(results, sheet)
    known = np.isfinite(force) & np.isfinite(deflection) & (np.abs(deflection) > 0) & ~sheet.rejected & ~sheet.massed
    if not known.any():
        return None
    notes: list[str] = []
    shown = few(list(present(sheet.tyre, known)), _MOST_LOOPS, "specimens", notes)
    panels = [_loop_panel(results, sheet, tyre, known, force, deflection) for tyre in shown]
    if sum(len(panel.series) for panel in panels) < known[np.isin(sheet.tyre, shown)].sum():
        notes.append("of each specimen the condition with the most tests")
    notes.append("area of a loop: energy lost in a cycle")
    return FigureData(tuple(panels), len(panels), sheet.labels, notes=tuple(notes), panel_height=2.6, shared=True)


def _amplitudes(results: Study, sheet: Sheet) -> tuple[np.ndarray, np.ndarray]:
    """Complex amplitudes of F1 [N] and of the deflection [m] of all tests; V1 has the phase 0."""
    omega = 2 * np.pi * sheet.values(q.FREQUENCY.head)
    f1 = sheet.values(q.F1.head) * np.exp(1j * sheet.values(q.PHASE_F1.head))
    blocked = np.array([stated_blocked(results.record, name) for name in sheet.rigs], dtype=bool)
    v2 = sheet.values(q.V2.head) * np.exp(1j * sheet.values(q.PHASE_V2.head))
    v2 = np.where(blocked, 0.0, v2)
    with np.errstate(divide="ignore", invalid="ignore"):
        return f1, (sheet.values(q.V1.head) - v2) / (1j * omega)


def _loop_panel(
    results: Study, sheet: Sheet, tyre: int, known: np.ndarray, force: np.ndarray, deflection: np.ndarray
) -> Panel:
    own = by_tyre(tested(results, known))[tyre]
    state = max(own, key=lambda one: int(np.sum(known & one.rows)))
    rows = np.flatnonzero(known & sheet.where(tyre=tyre) & (state.rows if part_of(results) is None else True))
    rows = rows[np.argsort(sheet.values(q.FREQUENCY.head)[rows], kind="stable")]
    rows = rows[spread(rows.size, MOST_LABELLED)]
    moved, pushed = results.shown.of(q.DEFLECTION_AMPLITUDE), results.shown.of(q.F1)
    turn = np.exp(1j * np.linspace(0, 2 * np.pi, _POINTS))
    series = []
    for at, row in enumerate(rows.tolist()):
        x, y = (amplitude[row] * turn for amplitude in (deflection / moved.scale, force / pushed.scale))
        line = Series(Role.LINE, x.real, y.real, label=_label(sheet, row), tyre=tyre, shade=shade(at, rows.size))
        series.append(linked(results, line, [row]))
    right = stated_text(results, state.place) if len(own) > 1 else ""
    x_axis = AxisData("deflection", moved.shown)
    return Panel(x_axis, AxisData.of(pushed), tuple(series), sheet.labels[tyre], right, tyre)


def _label(sheet: Sheet, row: int) -> str:
    frequency = int(sheet.frequency[row])
    return sheet.frequencies.labels[frequency] if frequency >= 0 else texts(sheet.table, q.TEST.head)[row]


def signals(results: Study) -> FigureData | None:
    """The cycles of the recordings that previews.parquet has, with the fitted sinusoids; a column per test."""
    sheet = read_sheet(results, texts_only=True)
    table = results.previews
    if q.TIME.head not in table.columns:
        return None
    found = {key: row for row, key in enumerate(keys_of(table))}
    keys = [key for key in keys_of(sheet.table) if key in found]
    shown = [key for key in keys if any(_has(table, found[key], f"{s} fit") for s in SYMBOLS.values())][:_MOST_SIGNALS]
    if not shown:
        return None
    every = keys_of(sheet.table)
    stated = section(results.record, "stated", "channels")
    symbols = [(s, role) for role, s in SYMBOLS.items() if any(_has(table, found[key], s) for key in shown)]
    panels = []
    for symbol, role in symbols:
        unit = UNITS.get(str(section(stated, role).get("quantity", "")), "N" if symbol == "F1" else "SI")
        for key in shown:
            at = every.index(key)
            tyre, (recorded, fit) = int(sheet.tyre[at]), _signal(table, found[key], symbol)
            series = (recorded, linked(results, replace(fit, tyre=tyre), [at]))
            title = f"{key[0]}: {_label(sheet, at)}" if symbol == symbols[0][0] else ""
            panels.append(Panel(AxisData("time", "s"), AxisData(symbol, unit), series, title, tyre=tyre))
    notes = ["points: recorded, less their mean; line: fitted sinusoid"]
    if len(shown) < len(keys):
        notes.append(f"{len(shown)} of {len(keys)} tests shown")
    return FigureData(tuple(panels), len(shown), sheet.labels, notes=tuple(notes), panel_height=1.3, shared=False)


def _signal(table: pl.DataFrame, row: int, symbol: str) -> tuple[Series, Series]:
    """The recorded samples of a channel, and the fit."""
    time, recorded, fit = (_array(table, row, column) for column in (q.TIME.head, symbol, f"{symbol} fit"))
    count = min(time.size, recorded.size, fit.size)
    return Series(Role.POINTS, time[:count], recorded[:count]), Series(Role.LINE, time[:count], fit[:count])


def _array(table: pl.DataFrame, row: int, column: str) -> FloatArray:
    """The samples of one test; empty if the table has none."""
    held = table[column][row] if column in table.columns else None
    values = np.zeros(0) if held is None else np.asarray(held, dtype=float)
    return values[: int(np.isfinite(values).sum())]


def _has(table: pl.DataFrame, row: int, column: str) -> bool:
    return _array(table, row, column).size > 1


#: The figures of this module by their keys in catalogue.toml.
FIGURES = {"static": over_deflection, "loops": loops, "signals": signals}
