"""The figure of a Prony series: K' and K'' over the band, and below them the stiffness of each arm at its time."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fourpole import quantities as q
from fourpole.core.arrays import FloatArray
from fourpole.errors import ModelError
from fourpole.fitting.modelfile import model_of
from fourpole.models.interface import Arms
from fourpole.plot.data import AxisData, FigureData, Panel, Role, Series, look
from fourpole.plot.fitted import Drawn, models_said
from fourpole.plot.frequency import Shown, condition_panel, headed
from fourpole.plot.sheet import leading, read_sheet
from fourpole.plot.states import State, stated_text, states
from fourpole.quantities import ShownUnits
from fourpole.study.study import Study

_MOST_COLUMNS = 3
#: Least number of arms with a stiffness above zero that make a spectrum.
_FEWEST = 3
#: Decades of stiffness below the stiffest arm that are shown.
_DEEP = 5.0
#: Marker of an arm whose stiffness is zero.
_DOWN = 4


def spectrum(results: Study) -> FigureData | None:
    """K', K'' and the relaxation spectrum of the first condition of each specimen whose model is a Prony series."""
    if results.models is None:
        return None
    sheet = read_sheet(results, texts_only=True)
    fitted = [state for state in states(results) if state.model is not None]
    firsts: dict[int, tuple[State, Arms, FloatArray]] = {}
    for state in fitted:
        if state.tyre not in firsts and (series := _arms(state.model)) is not None:
            firsts[state.tyre] = (state, *series)
    if not firsts:
        return None
    notes: list[str] = []
    tyres = leading(list(firsts), _MOST_COLUMNS, "specimens", notes)
    if any(sum(state.tyre == tyre for state in fitted) > 1 for tyre in tyres):
        notes.append("the first condition of each specimen is shown")
    axis, every = AxisData("frequency, or 1/(2π τ)", "Hz", log=True), np.ones(sheet.tyre.size, dtype=bool)
    panels = [
        replace(condition_panel(results, quantity, [Shown(firsts[tyre][0])], every, log=True), x=axis)
        for quantity in (q.STORAGE, q.LOSS)
        for tyre in tyres
    ]
    panels = headed(results, panels, tyres)
    for column, tyre in enumerate(tyres):
        panels[column] = replace(panels[column], right=stated_text(results, firsts[tyre][0].place))
    panels += [_arm_panel(*firsts[tyre][1:], tyre, axis, results.shown) for tyre in tyres]
    key = [(look(Role.RANGE), "95 % interval of K_i")]
    if any((firsts[tyre][1].springs == 0).any() for tyre in tyres):
        key.append((look(marker=_DOWN, hollow=True), "K_i = 0: upper end of its interval"))
    notes += [*models_said(results, sheet, tyres), "each arm stands at the frequency 1/(2π τ_i) of its relaxation time"]
    return FigureData(
        tuple(panels), len(tyres), sheet.labels, key=tuple(key), notes=tuple(notes), panel_height=1.5, shared=False,
        aligned=True, block=3,
    )  # fmt: skip


def _arms(fitted: Drawn | None) -> tuple[Arms, FloatArray] | None:
    """The arms of a condition with their 95 % intervals (n, 2) [N/m]; None without a Prony series of several arms."""
    if fitted is None:
        return None
    model, condition = model_of(fitted.entry), fitted.entry.conditions[fitted.at]
    try:
        arms = model.prony(condition.values)
    except ModelError:
        return None
    if np.sum(arms.springs > 0) < _FEWEST:
        return None
    intervals = [condition.intervals[model.symbols.index(f"K_{arm + 1}")] for arm in range(arms.springs.size)]
    ends = [(0.0 if low is None else low, np.nan if high is None else high) for low, high in intervals]
    return arms, np.array(ends)


def _arm_panel(arms: Arms, ends: FloatArray, tyre: int, axis: AxisData, units: ShownUnits) -> Panel:
    """The arms as points with their intervals; those of zero stiffness at the upper end of theirs."""
    shown = units.of(q.STORAGE)
    frequency, active = 1.0 / (2.0 * np.pi * arms.times), arms.springs > 0
    low, high = np.maximum(ends, arms.springs.max() / 10**_DEEP).T / shown.scale
    known, none = active & np.isfinite(high), ~active & np.isfinite(high)
    series = [
        Series(Role.RANGE, frequency[known], 0.5 * (high + low)[known], 0.5 * (high - low)[known], tyre=tyre),
        Series(Role.POINTS, frequency[active], arms.springs[active] / shown.scale, tyre=tyre),
    ]
    if none.any():
        series.append(Series(Role.POINTS, frequency[none], high[none], tyre=tyre, marker=_DOWN, hollow=True))
    return Panel(axis, AxisData("K_i", shown.shown, log=True), tuple(series))


#: The figures of this module by their keys in catalogue.toml.
FIGURES = {"spectrum": spectrum}
