"""The figure of a Prony series: K' and K'' over the band, and below them the stiffness of each arm at its time."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fourpole import quantities as q
from fourpole.core.arrays import ByValue, FloatArray
from fourpole.errors import ModelError
from fourpole.fitting.modelfile import model_of
from fourpole.plot.data import AxisData, FigureData, Panel, Role, Series, look
from fourpole.plot.fitted import Drawn
from fourpole.plot.frequency import Shown, condition_panel, words
from fourpole.plot.residuals import models_said, title_of
from fourpole.plot.sheet import read_sheet
from fourpole.plot.spec import FigureSpec
from fourpole.plot.states import State, states
from fourpole.quantities import ShownUnits
from fourpole.study.study import Study

_MOST_COLUMNS = 3
#: Least number of arms with a stiffness above zero that make a spectrum.
_FEWEST = 3
#: Decades of stiffness below the stiffest arm that are shown.
_DEEP = 5.0
#: Marker of an arm whose stiffness is zero.
_DOWN = 4


@dataclass(frozen=True, eq=False)
class _Spectrum(ByValue):
    """Arms of one condition: 1/(2 pi tau) [Hz], stiffness and the ends of its 95 % interval [N/m]."""

    frequency: FloatArray
    springs: FloatArray
    low: FloatArray
    high: FloatArray


def spectrum(results: Study) -> FigureData | None:
    """K', K'' and the relaxation spectrum of the first condition of each specimen whose model is a Prony series."""
    if results.models is None:
        return None
    sheet = read_sheet(results, texts_only=True)
    firsts: dict[int, tuple[State, _Spectrum]] = {}
    fitted = [one for one in states(results) if one.model is not None]
    for one in fitted:
        if one.tyre not in firsts and one.model is not None and (arms := _arms(one.model)) is not None:
            firsts[one.tyre] = (one, arms)
    if not firsts:
        return None
    tyres, notes = list(firsts)[:_MOST_COLUMNS], []
    if len(tyres) < len(firsts):
        notes.append(f"{len(tyres)} of {len(firsts)} specimens shown")
    if any(sum(one.tyre == tyre for one in fitted) > 1 for tyre in tyres):
        notes.append("the first condition of each specimen is shown")
    axis, panels = AxisData("frequency, or 1/(2π τ)", "Hz", log=True), []
    known = np.ones(sheet.tyre.size, dtype=bool)
    for quantity in (q.STORAGE, q.LOSS):
        for tyre in tyres:
            state = firsts[tyre][0]
            made = replace(condition_panel(results, quantity, [Shown(state)], known, log=True), x=axis)
            place = words(results, state, [column for column, value in state.place.items() if not np.isnan(value)])
            headed = replace(made, title=title_of(results, sheet, tyre), right=place, tyre=tyre)
            panels.append(headed if quantity is q.STORAGE else made)
    panels += [_arm_panel(firsts[tyre][1], tyre, axis, results.shown) for tyre in tyres]
    key = [(look(Role.RANGE), "95 % interval of K_i")]
    if any((firsts[tyre][1].springs == 0).any() for tyre in tyres):
        key.append((look(marker=_DOWN, hollow=True), "K_i = 0: upper end of its interval"))
    notes += [*models_said(results, sheet, tyres), "each arm stands at the frequency 1/(2π τ_i) of its relaxation time"]
    return FigureData(
        tuple(panels), len(tyres), sheet.labels, key=tuple(key), notes=tuple(notes), panel_height=1.5, shared=False,
        aligned=True, block=3,
    )  # fmt: skip


def _arms(one: Drawn) -> _Spectrum | None:
    """The arms of a condition with their intervals; None if its model is no Prony series of several arms."""
    model, condition = model_of(one.entry), one.entry.conditions[one.at]
    try:
        arms = model.prony(condition.values)
    except ModelError:
        return None
    if np.sum(arms.springs > 0) < _FEWEST:
        return None
    places = [model.symbols.index(f"K_{at + 1}") for at in range(arms.springs.size)]
    ends = [condition.intervals[place] for place in places]
    return _Spectrum(
        1.0 / (2.0 * np.pi * arms.times),
        arms.springs,
        np.array([0.0 if low is None else low for low, _ in ends]),
        np.array([np.nan if high is None else high for _, high in ends]),
    )


def _arm_panel(arms: _Spectrum, tyre: int, axis: AxisData, units: ShownUnits) -> Panel:
    """The arms as points with their intervals; those of zero stiffness at the upper end of theirs."""
    shown = units.of(q.STORAGE)
    floor = arms.springs.max() / 10**_DEEP
    active = arms.springs > 0
    low, high = np.maximum(arms.low, floor) / shown.scale, np.maximum(arms.high, floor) / shown.scale
    known = active & np.isfinite(high)
    series = [
        Series(Role.RANGE, arms.frequency[known], 0.5 * (high + low)[known], 0.5 * (high - low)[known], tyre=tyre),
        Series(Role.POINTS, arms.frequency[active], arms.springs[active] / shown.scale, tyre=tyre),
    ]
    none = ~active & np.isfinite(high)
    if none.any():
        series.append(Series(Role.POINTS, arms.frequency[none], high[none], tyre=tyre, marker=_DOWN, hollow=True))
    return Panel(axis, AxisData("K_i", shown.shown, log=True), tuple(series))


#: Figures of this module, in the order of a report.
FIGURES = (
    FigureSpec(
        "spectrum",
        "The relaxation spectrum",
        "K' and K'' of a condition with the Prony series and its 95 % band, and the stiffness K_i of each arm at its "
        "relaxation time with its 95 % interval.",
        data=spectrum,
    ),
)
