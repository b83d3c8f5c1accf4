"""The figure of a model over the amplitude of the deflection: K' and K'' at a few frequencies, and the tests."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fourpole import quantities as q
from fourpole.core.arrays import BoolArray
from fourpole.core.condition import FREQUENCY
from fourpole.core.confidence import NORMAL_95
from fourpole.fitting.amplitude import amplitudes_of
from fourpole.fitting.query import response
from fourpole.plot.cards import linked
from fourpole.plot.data import AxisData, FigureData, Panel, Role, Series, shade
from fourpole.plot.fitted import Drawn, conditions_of, models_said, title_of
from fourpole.plot.sheet import Sheet, leading, read_sheet, spread
from fourpole.plot.states import stated_text
from fourpole.quantities import Quantity
from fourpole.study.study import Study

_MOST_COLUMNS, _FREQUENCIES, _GRID = 3, 4, 81
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
    panels = [_panel(results, sheet, one, groups, quantity) for quantity in _QUANTITIES for one in shown]
    notes = [*models_said(results, sheet, list(dict.fromkeys(one.tyre for one in shown))), *notes]
    return FigureData(tuple(panels), len(shown), sheet.labels, notes=tuple(notes), panel_height=2.0, shared=False,
                      aligned=True, block=2)  # fmt: skip


def _frequencies(found: Sequence[Drawn], sheet: Sheet) -> list[float]:
    """A few of the tested frequencies [Hz], rising."""
    own = sheet.values(q.FREQUENCY.head)[np.any([_rows(one, sheet) for one in found], axis=0)]
    label = FREQUENCY.groups(own.tolist())
    tested = [float(np.median(own[label == one])) for one in np.unique(label)]
    return [tested[at] for at in spread(len(tested), _FREQUENCIES)]


def _rows(one: Drawn, sheet: Sheet) -> BoolArray:
    """The rows that the whole condition was fitted to, all amplitudes together."""
    names = set(one.entry.conditions[one.at].tests)
    there = sheet.tyre == one.tyre
    return np.asarray(there & np.isin(sheet.table["test"].to_list(), list(names)) if names else there)


def _panel(results: Study, sheet: Sheet, one: Drawn, groups: Sequence[float], quantity: Quantity) -> Panel:
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
FIGURES = {"amplitude": over_amplitude}
