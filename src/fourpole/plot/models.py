"""Figures of fitted models: their choice, their spectrum, and K' and K'' over the amplitude of the deflection."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from fourpole import quantities as q
from fourpole.core.arrays import BoolArray, FloatArray
from fourpole.core.condition import FREQUENCY
from fourpole.core.confidence import NORMAL_95
from fourpole.errors import ModelError
from fourpole.fitting.amplitude import amplitudes_of
from fourpole.fitting.modelfile import CandidateFile, ModelEntry, model_of
from fourpole.fitting.query import response
from fourpole.models.interface import Arms
from fourpole.plot.cards import linked
from fourpole.plot.data import AxisData, FigureData, Panel, Role, Series, look, plain_text, shade
from fourpole.plot.frequency import Shown, condition_panel, headed
from fourpole.plot.sheet import Sheet, leading, read_sheet, spread
from fourpole.plot.states import Drawn, State, conditions_of, models_said, stated_text, states, title_of
from fourpole.quantities import Quantity, ShownUnits
from fourpole.study.study import Study

#: Difference of BIC within which models are equally good, and difference up to which its axis is linear.
_ALIKE, _LINEAR = 6.0, 10.0
_MOST_CANDIDATES, _MOST_TYRES = 14, 8
#: Ratio of the ends of an axis beyond which it is logarithmic.
_DECADE = 10.0
#: A criterion that is ideally 1 is not shown below this; a model with as many parameters as data has none.
_FLOOR = 1e-3
_ROW, _MARGIN, _NAMES = 0.17, 0.2, 1.05
_CROSS_VALIDATION = 2


def choice(results: Study) -> FigureData | None:
    """Candidates by BIC, chi-square per degree of freedom and cross-validation error, a row of panels per specimen."""
    if results.models is None:
        return None
    sheet = read_sheet(results, texts_only=True)
    entries = [one for one in results.models.models if len(one.candidates) > 1 and one.tyre in sheet.names]
    if not entries:
        return None
    notes: list[str] = []
    shown = leading(entries, _MOST_TYRES, "specimens", notes)
    most = max(len(one.candidates) for one in shown)
    if most > _MOST_CANDIDATES:
        notes.append(f"the best {_MOST_CANDIDATES} models shown")
    tried = [one for entry in shown for one in entry.candidates[:_MOST_CANDIDATES]]
    axes = (
        AxisData("BIC less the best", "1", linear=_LINEAR if _most_off(shown) > 5 * _LINEAR else 0.0),
        AxisData("chi-square / dof", "1", log=_steep([_chi2(one) for one in tried])),
        AxisData(q.CROSS_VALIDATION.name, "1", log=_steep([one.cross_validation for one in tried])),
    )
    panels: list[Panel] = []
    for entry in shown:
        tyre = sheet.names.index(entry.tyre)
        made = [_criterion_panel(entry, axis, criterion, tyre) for criterion, axis in enumerate(axes)]
        panels += [replace(made[0], title=title_of(results, sheet, tyre), tyre=tyre), *made[1:]]
    notes += ["dashed: BIC 6 above the best, up to which models are alike; chi-square/dof and error of 1",
              "cross-validation error: root mean square over the frequencies, in standard uncertainties"]  # fmt: skip
    if any(_chi2(one) < _FLOOR for one in tried):
        notes.append(f"values below {_FLOOR:g} stand there")
    if any(one.cross_validation is None for one in tried):
        notes.append("n: not tried, for the model is far from the best or too few frequencies are left")
    key = [(look(), "chosen"), (look(hollow=True), "others")]
    if not all(one.causal for one in tried):
        key.append((look(marker=2, hollow=True), "not causal"))
    return FigureData(
        tuple(panels), 3, sheet.labels, key=tuple(key), notes=tuple(notes), left=_NAMES, right=0.3, aligned=True,
        panel_height=_ROW * min(most, _MOST_CANDIDATES) + _MARGIN,
    )  # fmt: skip


def _most_off(entries: Sequence[ModelEntry]) -> float:
    """The largest difference of BIC that is shown."""
    return max(one.bic - min(each.bic for each in entry.candidates) for entry in entries
               for one in entry.candidates[:_MOST_CANDIDATES])  # fmt: skip


def _chi2(one: CandidateFile) -> float:
    return one.chi2 / max(one.dof, 1)


def _at_least(value: float | None) -> float | None:
    return None if value is None else max(value, _FLOOR)


def _steep(values: Sequence[float | None]) -> bool:
    """Whether some values and 1 span more than a decade."""
    known = [1.0, *(value for value in map(_at_least, values) if value is not None)]
    return max(known) > _DECADE * min(known)


def _criterion_panel(entry: ModelEntry, axis: AxisData, criterion: int, tyre: int) -> Panel:
    """The candidates of one specimen by one criterion, the best on top."""
    tried, least = entry.candidates[:_MOST_CANDIDATES], min(one.bic for one in entry.candidates)
    level = _ALIKE if criterion == 0 else 1.0
    high = np.array([-0.6, len(tried) - 0.4])
    series = [Series(Role.LINE, np.full(2, level), high, dash=1)]
    for row, one in enumerate(tried):
        value = (one.bic - least, _at_least(_chi2(one)), _at_least(one.cross_validation))[criterion]
        if value is not None:
            chosen = one.model == entry.model
            series.append(Series(Role.POINTS, np.array([value]), np.array([float(row)]), tyre=tyre if chosen else -1,
                                 marker=0 if one.causal else 2, hollow=not chosen))  # fmt: skip
    lacking = tuple("n" if one.cross_validation is None else "" for one in tried)
    return Panel(
        axis, AxisData("model", "1"), tuple(series), names=tuple(plain_text(one.model, 14) for one in tried),
        beside=lacking if criterion == _CROSS_VALIDATION else (),
    )  # fmt: skip


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


_FREQUENCIES, _GRID = 4, 81
_QUANTITIES = (q.STORAGE, q.LOSS)


def over_amplitude(results: Study) -> FigureData | None:
    """K' and K'' over the amplitude of the deflection, for each condition of a model whose K* depends on it."""
    if results.models is None:
        return None
    sheet = read_sheet(results, texts_only=True)
    every = [one for entry in results.models.models for one in conditions_of(entry, sheet, results.models)]
    found = list({(one.entry.tyre, one.at): one for one in every if one.amplitude is not None}.values())
    if not found:
        return None
    notes: list[str] = []
    shown = leading(found, _MOST_COLUMNS, "conditions", notes)
    groups = _frequencies(shown, sheet)
    panels = [_amplitude_panel(results, sheet, one, groups, quantity) for quantity in _QUANTITIES for one in shown]
    notes = [*models_said(results, sheet, list(dict.fromkeys(one.tyre for one in shown))), *notes]
    return FigureData(tuple(panels), len(shown), sheet.labels, notes=tuple(notes), panel_height=2.0, shared=False,
                      aligned=True, block=2)  # fmt: skip


def _frequencies(found: Sequence[Drawn], sheet: Sheet) -> list[float]:
    """A few of the tested frequencies [Hz], rising."""
    _, tested = FREQUENCY.middles(sheet.values(q.FREQUENCY.head)[np.any([_rows(one, sheet) for one in found], axis=0)])
    return [tested[at] for at in spread(len(tested), _FREQUENCIES)]


def _rows(one: Drawn, sheet: Sheet) -> BoolArray:
    """The rows that the whole condition was fitted to, all amplitudes together."""
    names = set(one.entry.conditions[one.at].tests)
    there = sheet.tyre == one.tyre
    return np.asarray(there & np.isin(sheet.table["test"].to_list(), list(names)) if names else there)


def _amplitude_panel(results: Study, sheet: Sheet, one: Drawn, groups: Sequence[float], quantity: Quantity) -> Panel:
    """The model over the tested amplitudes at some frequencies [Hz], and the tests there."""
    moved, shown = results.shown.of(q.DEFLECTION_AMPLITUDE), results.shown.of(quantity)
    tested, amplitude = sheet.values(q.FREQUENCY.head), amplitudes_of(sheet.table)
    values, std = (sheet.values(head) / shown.scale for head in (quantity.head, quantity.u_head))
    part, grid, series = _QUANTITIES.index(quantity), np.geomspace(*_range(one), _GRID), []
    low, high = one.band
    here = [f for f in groups if low * (1 - FREQUENCY.relative) <= f <= high * (1 + FREQUENCY.relative)]
    own = _rows(one, sheet) & ~sheet.rejected & np.isfinite(values) & (np.nan_to_num(amplitude) > 0)
    for at, frequency in enumerate(here):
        line, covariance = response(one.entry, one.at, np.full(_GRID, frequency), grid)
        half = NORMAL_95 * np.sqrt(covariance[:, part, part]) / shown.scale
        tone = shade(at, len(here))
        series.append(Series(Role.MODEL, grid / moved.scale, (line.real, line.imag)[part] / shown.scale, half,
                             label=f"{frequency:.3g} Hz", tyre=one.tyre, shade=tone))  # fmt: skip
        rows = np.flatnonzero(own & (np.abs(tested - frequency) <= FREQUENCY.relative * frequency))
        x = amplitude[rows] / moved.scale
        points = Series(Role.POINTS, x, values[rows], std[rows], tyre=one.tyre, shade=tone)
        series.append(linked(results, points, rows))
    place = {axis.column: axis.value for axis in one.entry.conditions[one.at].state}
    headed = quantity is _QUANTITIES[0]
    return Panel(
        AxisData.of(moved, log=True), AxisData.of(shown), tuple(series),
        title_of(results, sheet, one.tyre) if headed else "",
        stated_text(results, place) if headed else "",
        one.tyre if headed else -1,
    )  # fmt: skip


def _range(one: Drawn) -> tuple[float, float]:
    """Lowest and highest amplitude fitted [m]."""
    tested = one.entry.conditions[one.at].amplitude
    assert tested is not None  # `over_amplitude` has left out the others
    return tested[0], tested[-1]


#: The figures of this module by their keys in catalogue.toml.
FIGURES = {"model-choice": choice, "spectrum": spectrum, "amplitude": over_amplitude}
