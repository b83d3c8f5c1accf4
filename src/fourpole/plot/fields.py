"""Maps over pressure and frequency: |K*| and the loss angle of each specimen between its tests."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from functools import partial

import numpy as np
from scipy.interpolate import PchipInterpolator

from fourpole import quantities as q
from fourpole.core.arrays import BoolArray, FloatArray
from fourpole.plot.cardids import dynamic_cards
from fourpole.plot.data import AxisData, Field, FigureData, Panel, Role, Series
from fourpole.plot.fitted import DECADE
from fourpole.plot.sheet import Sheet, means, read_sheet, spread, texts
from fourpole.plot.spec import FigureSpec
from fourpole.plot.states import State, curve_of, place_text, states, values_of
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
    found = [one for one in states(results) if np.any(known & one.rows)]
    every = {tyre: _at_one_load([one for one in found if one.tyre == tyre]) for tyre in sorted({s.tyre for s in found})}
    each = {tyre: own for tyre, own in every.items() if len(own) >= _FEWEST}
    each = {tyre: own for tyre, own in each.items() if _fields(results, sheet, own, quantities[0], known) is not None}
    if not each:
        return None
    notes = ["between the tested pressures: monotone cubic interpolation"]
    tyres = [list(each)[at] for at in spread(len(each), _MOST_TYRES)]
    if len(tyres) < len(each):
        notes.insert(0, f"{len(tyres)} of {len(each)} specimens shown")
    panels = []
    for quantity in quantities:
        for tyre in tyres:
            made = _panel(results, sheet, each[tyre], quantity, known)
            panels.append(made)
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
    cards, names = dynamic_cards(results), texts(sheet.table, q.TEST.head)
    frequency, pressure = sheet.values(q.FREQUENCY.head)[rows], sheet.values(q.PRESSURE.head)[rows] / pressures.scale
    tests = Series(Role.POINTS, frequency, pressure, tests=tuple(names[at] for at in rows),
                   cards=tuple(cards[at] for at in rows))  # fmt: skip
    place = {k: v for k, v in found[0].place.items() if k != q.PRESSURE.head and not np.isnan(v)}
    return Panel(
        AxisData.of(q.FREQUENCY, log=bool(x[-1] > DECADE * x[0])),
        AxisData.of(pressures),
        (tests,),
        title=sheet.labels[tyre],
        right=", ".join([seen.label, *(place_text(results, column, value) for column, value in place.items())]),
        tyre=tyre,
        field=Field(x, bar * y, quantity.scale / seen.scale * z, seen.name, seen.shown),
    )


#: Figures of this module, in the order of a report.
FIGURES = (
    FigureSpec(
        "pressure-frequency",
        "Where is it stiff, where does it lose?",
        "|K*| and the loss angle over frequency and pressure, with lines of equal value; the points are the tests.",
        data=partial(over_pressure_and_frequency, quantities=(q.MODULUS, q.LOSS_ANGLE)),
    ),
)
