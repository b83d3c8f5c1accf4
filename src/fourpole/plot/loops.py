"""Hysteresis loops and measured signals of tests: force over deflection, and the recorded cycles with their fit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import polars as pl

from fourpole import quantities as q
from fourpole.core.arrays import FloatArray
from fourpole.fitting.rows import keys_of
from fourpole.plot.cards import linked
from fourpole.plot.data import MOST_LABELLED, AxisData, FigureData, Panel, Role, Series, shade
from fourpole.plot.part import part_of
from fourpole.plot.sheet import Sheet, few, present, read_sheet, spread, texts
from fourpole.plot.states import by_tyre, stated_text, tested
from fourpole.study.record import section, stated_blocked
from fourpole.study.study import Study

_MOST_TYRES, _MOST_SIGNALS, _POINTS = 3, 3, 145
_SIGNALS = (("F1", "force_in"), ("V1", "motion_in"), ("V2", "motion_out"))
_UNITS = {"force": "N", "displacement": "m", "velocity": "m/s", "acceleration": "m/s²"}


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
    shown = few(list(present(sheet.tyre, known)), _MOST_TYRES, "specimens", notes)
    panels = [_loop_panel(results, sheet, tyre, known, force, deflection) for tyre in shown]
    if sum(len(panel.series) for panel in panels) < known[np.isin(sheet.tyre, shown)].sum():
        notes.append("of each specimen the condition with the most tests; --pressure, --preload or --test name others")
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
    shown = [key for key in keys if any(_has(table, found[key], f"{s} fit") for s, _ in _SIGNALS)][:_MOST_SIGNALS]
    if not shown:
        return None
    every = keys_of(sheet.table)
    stated = section(results.record, "stated", "channels")
    symbols = [(s, role) for s, role in _SIGNALS if any(_has(table, found[key], s) for key in shown)]
    panels = []
    for symbol, role in symbols:
        unit = _UNITS.get(str(section(stated, role).get("quantity", "")), "N" if symbol == "F1" else "SI")
        for key in shown:
            at = every.index(key)
            tyre, (recorded, fit) = int(sheet.tyre[at]), _signal(table, found[key], symbol)
            series = (recorded, linked(results, replace(fit, tyre=tyre), [at]))
            title = f"{key[0]}: {_label(sheet, at)}" if symbol == symbols[0][0] else ""
            panels.append(Panel(AxisData("time", "s"), AxisData(symbol, unit), series, title, tyre=tyre))
    notes = ["points: recorded, less their mean; line: fitted sinusoid"]
    if len(shown) < len(keys):
        notes.append(f"{len(shown)} of {len(keys)} tests shown; --test names others")
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
FIGURES = {"loops": loops, "signals": signals}
