"""Transmissibility: figure 14, and measured against predicted."""

from __future__ import annotations

from itertools import combinations, product

import numpy as np

from fourpole import quantities as q
from fourpole.core.arrays import BoolArray, FloatArray
from fourpole.plot.data import AxisData, FigureData, Panel, Role, Series, Tone
from fourpole.plot.marks import (
    MOST_NAMED,
    curve_of,
    load_key,
    points_of,
    pressure_key,
    rejected_of,
    tyre_look,
    zero_line,
)
from fourpole.plot.sheet import Sheet, leading, means, not_all, present, read_sheet, tests_said
from fourpole.study.study import Study

#: The two pressures of the paper's figure 14 [Pa].
_PRESSURES = (100e3, 168e3)
_MOST_PANELS = 9


def crossings(first: tuple[FloatArray, FloatArray], second: tuple[FloatArray, FloatArray]) -> list[tuple[float, float]]:
    """Points (x, y) at which two curves cross; each curve is (x, y) with rising x, interpolated linearly.

    Examples
    --------
    >>> crossings((np.array([0.0, 2.0]), np.array([0.0, 2.0])), (np.array([0.0, 2.0]), np.array([1.0, 1.0])))
    [(1.0, 1.0)]
    """
    if first[0].size < 2 or second[0].size < 2:
        return []
    low, high = max(first[0][0], second[0][0]), min(first[0][-1], second[0][-1])
    grid = np.unique(np.concatenate([first[0], second[0]]))
    grid = grid[(grid >= low) & (grid <= high)]
    one = np.interp(grid, *first)
    gap = one - np.interp(grid, *second)
    at = np.flatnonzero(gap[:-1] * gap[1:] < 0)
    part = gap[at] / (gap[at] - gap[at + 1])
    x = grid[at] + part * (grid[at + 1] - grid[at])
    y = one[at] + part * (one[at + 1] - one[at])
    return list(zip(x.tolist(), y.tolist(), strict=True))


def transmissibility(results: Study) -> FigureData | None:
    """TR against frequency at the pressures nearest to 1.00 and 1.68 bar, a panel per preload and setting."""
    sheet, notes = read_sheet(results), list[str]()
    quantity = q.TR_MEASURED
    y, std = sheet.shown(quantity)
    if not np.any(np.isfinite(y)):
        quantity = q.TR_PREDICTED
        y, std = sheet.shown(quantity)
        notes.append("predicted from K* and the rig: V2 was not measured")
    x, _ = sheet.shown(q.FREQUENCY)
    bare, said = sheet.bare("TR")
    visible = np.isfinite(x) & np.isfinite(y) & bare
    if not np.any(visible):
        return None
    notes += said
    pressures = _pressures(sheet, visible)
    concerned = np.isin(sheet.pressure, pressures) & bare
    notes += not_all(len(pressures), len(list(present(sheet.pressure, visible))), "pressures")
    visible &= concerned
    used, lost = visible & ~sheet.rejected, visible & sheet.rejected
    places = sorted(set(zip(sheet.load[visible].tolist(), sheet.setting[visible].tolist(), strict=True)))
    places = leading(places, _MOST_PANELS, "settings", notes)
    settings = len({setting for _, setting in places})
    tyres, panels = list(present(sheet.tyre, visible)), []
    for load, setting in places:
        here, series = sheet.where(load=load, setting=setting), []
        for tyre, pressure in product(tyres, pressures):
            mask = used & here & sheet.where(tyre=tyre, pressure=pressure)
            marks = tyre_look(tyre, pressure, load)
            series += curve_of(results, mask, (x, y), std, sheet.frequency, marks)
        series += rejected_of(results, here & lost, (x, y))
        found = _crossings(sheet, x, y, used & here, tyres, pressures)
        series += [Series(Role.LINE, np.full(2, at), np.array([0.0, top]), tone=Tone.INK, dash=2)
                   for at, top, _ in found]  # fmt: skip
        # Below the resonance TR is above 1, so no curve reaches the lower left corner.
        corner = "\n".join(["the curves cross at", *(f"{at:.1f} Hz{where}" for at, _, where in found)]) if found else ""
        parts = [sheet.name_of_load(load), sheet.settings[setting] if settings > 1 else ""]
        title = ", ".join(part for part in parts if part)
        axis = AxisData(quantity.name, quantity.shown, zero=True)
        panels.append(Panel(AxisData.of(q.FREQUENCY), axis, tuple(series), title, corner=corner))
    notes += tests_said(sheet.rejected[concerned], visible[concerned], "TR")
    columns = min(3, settings if settings > 1 else len(places) if len(places) != 4 else 2)
    loads = list(dict.fromkeys(load for load, _ in places))
    return FigureData(
        tuple(panels), columns, sheet.labels, keyed=tuple(tyres), notes=tuple(notes), aligned=True,
        key=(*pressure_key(sheet, pressures), *load_key(sheet, loads)),
        panel_height=2.9 if len(places) <= columns else 2.2,
    )  # fmt: skip


def _pressures(sheet: Sheet, visible: BoolArray) -> list[int]:
    """The pressures with a value of TR that are nearest to the two of the paper."""
    found = list(present(sheet.pressure, visible))
    values = np.array([sheet.pressures.values[at] for at in found])
    if np.all(np.isnan(values)):
        return found[:1]
    return sorted({found[int(np.nanargmin(np.abs(values - wanted)))] for wanted in _PRESSURES})


def _crossings(
    sheet: Sheet, x: FloatArray, y: FloatArray, used: BoolArray, tyres: list[int], pressures: list[int]
) -> list[tuple[float, float, str]]:
    """Crossings of the curves of every two tyres at each pressure; none if there are more than four."""

    def line(tyre: int, pressure: int) -> tuple[FloatArray, FloatArray]:
        mask = used & sheet.where(tyre=tyre, pressure=pressure)
        return means(x[mask], y[mask], sheet.frequency[mask].tolist())

    found = []
    for (first, second), pressure in product(combinations(tyres, 2), pressures):
        where = f" ({sheet.pressures.labels[pressure]})" if len(pressures) > 1 else ""
        if len(tyres) > 2:
            where += f": {sheet.labels[first]}, {sheet.labels[second]}"
        found += [(*at, where) for at in crossings(line(first, pressure), line(second, pressure))]
    return found if len(found) <= 4 else []


def measured_against_predicted(results: Study) -> FigureData | None:
    """TR measured against TR predicted from K* and the rig; beside it their difference against frequency."""
    sheet = read_sheet(results)
    measured, _ = sheet.shown(q.TR_MEASURED)
    predicted, std = sheet.shown(q.TR_PREDICTED)
    frequency, _ = sheet.shown(q.FREQUENCY)
    visible = np.isfinite(measured) & np.isfinite(predicted) & (predicted > 0)
    if not np.any(visible):
        return None
    used, lost = visible & ~sheet.rejected, visible & sheet.rejected
    with np.errstate(divide="ignore", invalid="ignore"):
        difference, difference_std = 100 * (measured / predicted - 1), 100 * std / predicted
    tyres, pressures = list(present(sheet.tyre, visible)), list(present(sheet.pressure, visible))
    shown = used if np.any(used) else visible
    every = np.concatenate([measured[shown], predicted[shown]])
    ends = np.array([every.min(), every.max()])
    left, right = [Series(Role.LINE, ends, ends, tone=Tone.INK)], [zero_line(frequency[shown])]
    for tyre, pressure in product(tyres, pressures):
        mask, marks = used & sheet.where(tyre=tyre, pressure=pressure), tyre_look(tyre, pressure, 0)
        left += points_of(results, mask, (predicted, measured), marks)
        right += points_of(results, mask, (frequency, difference), marks, stds=(None, difference_std))
    left += rejected_of(results, lost, (predicted, measured))
    right += rejected_of(results, lost, (frequency, difference))
    notes = tests_said(sheet.rejected, visible, "TR measured and predicted")
    if len(pressures) > MOST_NAMED:
        notes.append("the key names some of the pressures")
    panels = (
        Panel(AxisData.of(q.TR_PREDICTED), AxisData.of(q.TR_MEASURED), tuple(left)),
        Panel(AxisData.of(q.FREQUENCY), AxisData("difference from predicted", "%", signed=True), tuple(right)),
    )
    return FigureData(
        panels, 2, sheet.labels, keyed=tuple(tyres), key=tuple(pressure_key(sheet, pressures)),
        notes=tuple(notes), panel_height=2.75, shared=False,
    )  # fmt: skip


#: The figures of this module by their keys in catalogue.toml.
FIGURES = {"fig14": transmissibility, "tr-measured-predicted": measured_against_predicted}
