"""Maps over pressure and frequency: |K*| and the loss angle of each specimen between its tests."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from functools import partial

import numpy as np
from scipy.interpolate import PchipInterpolator

from fourpole import quantities as q
from fourpole.core.arrays import BoolArray, FloatArray
from fourpole.plot.cards import linked
from fourpole.plot.data import AxisData, Field, FigureData, Panel, Role, Series
from fourpole.plot.fitted import DECADE
from fourpole.plot.sheet import Sheet, few, means, read_sheet
from fourpole.plot.states import State, by_tyre, curve_of, stated_text, tested, values_of
from fourpole.quantities import Quantity
from fourpole.study.study import Study

#: Least number of pressures of a map, and largest number of specimens.
_FEWEST, _MOST_TYRES = 3, 3
#: Number of pressures and frequencies of the grid of a map.
_ROWS, _COLUMNS = 41, 61


def over_pressure_and_frequency(results: Study, quantities: Sequence[Quantity]) -> FigureData | None:
    """Quantities over frequency and pressure, a column of panels per specimen with three pressures or more.

    Along frequency the values are those of the model, or of the tests where there is none; between the tested
    pressures they are interpolated by monotone cubics.
    """
    sheet = read_sheet(results, texts_only=True)
    frequency, (first, _) = sheet.values(q.FREQUENCY.head), values_of(sheet, quantities[0])
    known = np.isfinite(frequency) & np.isfinite(first) & ~sheet.rejected
    every = {tyre: _at_one_load(own) for tyre, own in by_tyre(tested(results, known)).items()}
    each = {tyre: own for tyre, own in every.items() if len(own) >= _FEWEST}
    each = {tyre: own for tyre, own in each.items() if _fields(results, sheet, own, quantities[0], known) is not None}
    if not each:
        return None
    notes: list[str] = []
    tyres = few(list(each), _MOST_TYRES, "specimens", notes)
    notes.append("between the tested pressures: monotone cubic interpolation")
    panels = [_panel(results, sheet, each[tyre], quantity, known) for quantity in quantities for tyre in tyres]
    return FigureData(tuple(panels), len(tyres), sheet.labels, notes=tuple(notes), panel_height=1.9)


def _at_one_load(found: Sequence[State]) -> list[State]:
    """The conditions that differ in pressure alone, of the preload and further values with the most pressures."""
    stated = [one for one in found if not np.isnan(one.place[q.PRESSURE.head])]
    others = [tuple((k, str(v)) for k, v in one.place.items() if k != q.PRESSURE.head) for one in stated]
    if not stated:
        return []
    usual = Counter(others).most_common(1)[0][0]
    return [one for one, other in zip(stated, others, strict=True) if other == usual]


def _fields(
    results: Study, sheet: Sheet, found: Sequence[State], quantity: Quantity, known: BoolArray
) -> tuple[FloatArray, FloatArray, FloatArray] | None:
    """Frequencies [Hz], pressures [bar] and values (pressures, frequencies); None without a band in common."""
    lines = [_line(results, sheet, one, quantity, known) for one in found]
    low, high = max(x[0] for x, _ in lines), min(x[-1] for x, _ in lines)
    if not high > 1.02 * low:
        return None
    grid = np.geomspace(low, high, _COLUMNS) if high > DECADE * low else np.linspace(low, high, _COLUMNS)
    pressures = np.array([one.place[q.PRESSURE.head] for one in found]) / q.PRESSURE.scale
    tested = np.array([np.interp(grid, x, y) for x, y in lines])
    rows = np.linspace(pressures[0], pressures[-1], _ROWS)
    values = np.asarray(PchipInterpolator(pressures, tested, axis=0)(rows))
    return grid, rows, values


def _line(
    results: Study, sheet: Sheet, state: State, quantity: Quantity, known: BoolArray
) -> tuple[FloatArray, FloatArray]:
    """Frequencies [Hz] and values of a condition: of its model, or of its tests."""
    curve = curve_of(results, state, quantity)
    if curve is not None:
        return curve[0], curve[1]
    rows = known & state.rows
    return means(
        sheet.values(q.FREQUENCY.head)[rows], values_of(sheet, quantity)[0][rows], sheet.frequency[rows].tolist()
    )


def _panel(results: Study, sheet: Sheet, found: Sequence[State], quantity: Quantity, known: BoolArray) -> Panel:
    tyre, made = found[0].tyre, _fields(results, sheet, found, quantity, known)
    assert made is not None  # specimens without a map are left out
    x, y, z = made
    pressures, seen = results.shown.of(q.PRESSURE), results.shown.of(quantity)
    bar = q.PRESSURE.scale / pressures.scale
    rows = np.flatnonzero(known & np.any([one.rows for one in found], axis=0))
    frequency, pressure = sheet.values(q.FREQUENCY.head)[rows], sheet.values(q.PRESSURE.head)[rows] / pressures.scale
    tests = linked(results, Series(Role.POINTS, frequency, pressure), rows)
    others = {column: value for column, value in found[0].place.items() if column != q.PRESSURE.head}
    place = stated_text(results, others)
    return Panel(
        AxisData.of(q.FREQUENCY, log=bool(x[-1] > DECADE * x[0])),
        AxisData.of(pressures),
        (tests,),
        title=sheet.labels[tyre],
        right=f"{seen.label}, {place}" if place else seen.label,
        tyre=tyre,
        field=Field(x, bar * y, quantity.scale / seen.scale * z, seen.name, seen.shown),
    )


#: The figures of this module by their keys in catalogue.toml.
FIGURES = {"pressure-frequency": partial(over_pressure_and_frequency, quantities=(q.MODULUS, q.LOSS_ANGLE))}
