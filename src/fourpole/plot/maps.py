"""Maps: the operating map over pressure, and quantities over pressure and frequency between the tests."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence, Set
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TypeAlias

import numpy as np
import scipy

from fourpole import quantities as q
from fourpole.core.arrays import BoolArray, FloatArray
from fourpole.core.condition import FREQUENCY, Axis
from fourpole.core.confidence import NORMAL_95
from fourpole.fitting.amplitude import amplitudes_of
from fourpole.fitting.modelfile import MapEntry, ModelFile, map_of
from fourpole.models.operating import Answer, OperatingMap
from fourpole.plot.cards import linked
from fourpole.plot.data import AxisData, Field, FigureData, Panel, Role, Series, plain_text, shade
from fourpole.plot.part import part_of
from fourpole.plot.sheet import Sheet, few, leading, means, read_sheet
from fourpole.plot.states import (
    DECADE,
    State,
    axis_shown,
    by_tyre,
    curve_of,
    differing,
    place_text,
    stated_text,
    tested,
    values_of,
)
from fourpole.quantities import Quantity
from fourpole.study.study import Study

_MOST_COLUMNS = 4
_FREQUENCIES = 3
_GRID = 41
#: Distance of a point from the tested conditions, in half spans, up to which it counts as tested.
_NEAR = 0.02
_PRESSURE, _PRELOAD = q.PRESSURE.head, q.PRELOAD.head
#: Tests at an amplitude of the deflection within this ratio of that of a panel are shown.
_ALIKE = 1.2
_Pair: TypeAlias = tuple[Quantity, Quantity]


@dataclass(frozen=True)
class _Cut:
    """The map of one tyre along one axis, with the other axes at constant values; `rank` is that of the first value."""

    entry: MapEntry
    found: OperatingMap
    tyre: int
    along: int
    axes: tuple[Axis, ...]
    held: dict[int, float] = field(default_factory=dict)
    rank: int = 0

    @property
    def amplitude(self) -> float | None:
        """Amplitude of the deflection that is shown [m]: the middle of the tested ones if the map depends on it."""
        tested = self.entry.amplitude
        return None if tested is None else float(np.sqrt(tested[0] * tested[-1]))

    @property
    def column(self) -> str:
        """Head of the column of the abscissa."""
        return self.found.axes.names[self.along]

    def points(self) -> FloatArray:
        """Points (Q, d) along the abscissa within the tested conditions."""
        axes = self.found.axes
        rows = np.tile([self.held.get(at, 0.0) for at in range(len(axes.names))], (_GRID, 1))
        own = axes.points[:, self.along]
        rows[:, self.along] = np.linspace(own.min(), own.max(), _GRID)
        kept = []
        for row in rows:
            far, nearest = axes.outside(row)
            if far <= _NEAR:  # the tests of one setting are not all at quite the same value of it
                kept.append(nearest)
        return np.array(kept).reshape(-1, len(axes.names))

    def tests(self, sheet: Sheet) -> BoolArray:
        """True for tests at the constant values of the panel."""
        mask = sheet.tyre == self.tyre
        for at, value in self.held.items():
            own = sheet.values(self.found.axes.names[at]).tolist()
            mask = mask & np.array([self.axes[at].same(one, value) for one in own], dtype=bool)
        if self.amplitude is not None:
            off = np.abs(np.log(np.maximum(amplitudes_of(sheet.table), 1e-300) / self.amplitude))
            mask = mask & (off <= np.log(_ALIKE))
        return np.asarray(mask)


def operating(results: Study) -> FigureData | None:
    """K2 and C over pressure or, without pressure, the first axis of the map; K' and K'' if K2 and C are unknown."""
    if results.maps is None:
        return None
    sheet = read_sheet(results, texts_only=True)
    known = [entry for entry in results.maps.maps if entry.axes and entry.tyre in sheet.names]
    every = [one for entry in known for one in _cuts(entry, sheet, results.maps)]
    if part_of(results) is not None:
        every = [one for one in every if one.tests(sheet).any()]
    if not every:
        return None
    notes: list[str] = []
    every = sorted(every, key=lambda cut: (cut.rank, cut.tyre))
    cuts = leading(every, _MOST_COLUMNS, "pairs of specimen and condition", notes)
    pair = (q.K2, q.C) if _has_arm(sheet, cuts) else (q.STORAGE, q.LOSS)
    said: list[str] = []
    groups = _frequencies(sheet, cuts, said)
    panels = [_cut_panel(results, sheet, one, groups, pair, at) for at in range(2) for one in cuts]
    notes = [*_maps_said(sheet, cuts), *said, *notes, *_said(results, cuts, pair)]
    return FigureData(tuple(panels), len(cuts), sheet.labels, notes=tuple(notes), panel_height=2.2, aligned=True,
                      block=2)  # fmt: skip


def _cuts(entry: MapEntry, sheet: Sheet, file: ModelFile) -> list[_Cut]:
    """A panel for each value of the preload; without preload, of the first axis that is not the abscissa."""
    found = map_of(entry)
    names, points = found.axes.names, found.axes.points
    along = names.index(_PRESSURE) if _PRESSURE in names else 0
    others = [at for at in range(len(names)) if at != along]
    axes = tuple(map(file.axis, names))
    panel = _Cut(entry, found, sheet.names.index(entry.tyre), along, axes)
    if panel.amplitude is not None:
        panel = replace(panel, found=replace(found, model=found.model.at_amplitude(panel.amplitude)))
    if not others:
        return [panel]
    first = names.index(_PRELOAD) if _PRELOAD in names and names.index(_PRELOAD) in others else others[0]
    made = []
    for rank, (level, near) in enumerate(_levels(axes[first], points[:, first])):
        # Each further axis has the value of most tests.
        further = {at: _levels(axes[at], points[near, at]) for at in others if at != first}
        commonest = {at: max(found, key=lambda one: int(one[1].sum()))[0] for at, found in further.items()}
        made.append(replace(panel, held={first: level} | commonest, rank=rank))
    return made


def _levels(axis: Axis, values: FloatArray) -> list[tuple[float, BoolArray]]:
    """Distinct values on an axis in rising order, each with a mask of the points that have it."""
    groups, middles = axis.middles(values)
    return [(middle, groups == at) for at, middle in enumerate(middles)]


def _has_arm(sheet: Sheet, panels: Sequence[_Cut]) -> bool:
    """Whether tests and maps both have K2."""
    if not np.any(np.isfinite(sheet.values(q.K2.head))):
        return False
    maps = [panel.found for panel in panels]
    middle = [one.ask(one.axes.points, np.full(len(one.axes.points), np.sqrt(np.prod(one.band)))) for one in maps]
    return all(np.mean(np.isfinite(one.k2)) > 0.5 for one in middle)


def _frequencies(sheet: Sheet, panels: Sequence[_Cut], notes: list[str]) -> list[float]:
    """A few frequencies that were tested [Hz], within the bands of the maps; adds a note on the others."""
    low, high = min(one.found.band[0] for one in panels), max(one.found.band[1] for one in panels)
    tested = [value for value in sheet.frequencies.values if _in_band(value, (low, high))]
    if not tested:
        return list(dict.fromkeys([low, float(np.sqrt(low * high)), high]))
    return few(tested, _FREQUENCIES, "frequencies", notes)


def _in_band(frequency: float, band: tuple[float, float]) -> bool:
    """Whether a frequency lies in a band or is the same as one of its ends."""
    return band[0] <= frequency <= band[1] or any(FREQUENCY.same(frequency, end) for end in band)


def _cut_panel(results: Study, sheet: Sheet, cut: _Cut, groups: Sequence[float], pair: _Pair, which: int) -> Panel:
    """One quantity of a cut through a map: a curve per frequency, and the tests; frequencies beyond the map have none.

    `which` is 0 for the first quantity of the pair, 1 for the second.
    """
    shown = results.shown.of(pair[which])
    name, unit, scale = axis_shown(cut.column, results.shown)
    points, tests = cut.points(), cut.tests(sheet) & ~sheet.rejected & ~sheet.massed
    frequency, place = sheet.values(q.FREQUENCY.head), sheet.values(cut.column)
    values, stds = (sheet.values(head) / shown.scale for head in shown.heads)
    low, high = cut.found.band
    series = []
    for at, group in enumerate(groups):
        if not _in_band(group, cut.found.band) or not len(points):
            continue
        answer = cut.found.ask(points, np.full(len(points), np.clip(group, low, high)))
        line, std = _asked(answer, pair, which)
        curve = Series(
            Role.MODEL, points[:, cut.along] / scale, line / shown.scale, NORMAL_95 * std / shown.scale,
            label=f"{float(f'{group:.3g}'):.10g} Hz", tyre=cut.tyre, shade=shade(at, len(groups)),
        )  # fmt: skip
        near = np.abs(frequency - group) <= FREQUENCY.relative * group
        rows = np.flatnonzero(tests & near & np.isfinite(values) & np.isfinite(place))
        marks = replace(curve, role=Role.POINTS, x=place[rows] / scale, y=values[rows], spread=stds[rows], label="")
        series += [curve, linked(results, marks, rows)]
    held = [place_text(results, cut.found.axes.names[at], value) for at, value in cut.held.items()]
    head = (sheet.labels[cut.tyre] if sheet.names[cut.tyre] else cut.entry.model) if which == 0 else ""
    return Panel(
        AxisData(name, unit), AxisData(shown.name, shown.shown, log=True), tuple(series), head,
        ", ".join(held) if which == 0 else "", cut.tyre if which == 0 else -1,
    )  # fmt: skip


def _asked(answer: Answer, pair: _Pair, which: int) -> tuple[FloatArray, FloatArray]:
    """Values and standard uncertainties of a quantity in SI units."""
    arm = pair[0] is q.K2
    values = (answer.k2, answer.c) if arm else (answer.stiffness.real, answer.stiffness.imag)
    covariance = answer.arm_covariance if arm else answer.covariance
    return values[which], np.sqrt(covariance[:, which, which])


def _maps_said(sheet: Sheet, cuts: Sequence[_Cut]) -> list[str]:
    """The models of the maps, and whether they are causal."""
    entries = {one.tyre: one.entry for one in cuts}
    parts = {tyre: f"{plain_text(one.model)}{'' if one.causal else ' (not causal)'}" for tyre, one in entries.items()}
    if len(set(parts.values())) == 1:
        return [f"model: {next(iter(parts.values()))}"]
    return ["models: " + ", ".join(f"{text} of {sheet.labels[tyre]}" for tyre, text in parts.items())]


def _said(results: Study, cuts: Sequence[_Cut], pair: _Pair) -> list[str]:
    errors = {one.entry.tyre: one.entry.leave_one_out[0] for one in cuts}
    known = [f"{100 * error:.2g} %" + (f" ({plain_text(tyre)})" if tyre else "")
             for tyre, error in errors.items() if error]  # fmt: skip
    said = [f"leave-one-out error of K* over the conditions: {', '.join(known)}"] if known else []
    if pair[0] is not q.K2:
        said.append("no K2 and C: K1 is not known, or no passive arm has this K*")
    moved = sorted({one.amplitude for one in cuts if one.amplitude is not None})
    if moved:
        texts_of = ", ".join(results.shown.text(q.DEFLECTION_AMPLITUDE, one, 3) for one in moved)
        said.append(f"amplitude of the deflection: {texts_of}, and tests near it")
    return [*said, "curves end where the tests do"]


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
    lowest = [each[tyre][0] for tyre in tyres]
    apart = {*differing(lowest)} - {q.PRESSURE.head}
    place = lowest[0].place
    if alike := stated_text(
        results, {column: value for column, value in place.items() if column not in (*apart, q.PRESSURE.head)}
    ):
        notes.insert(0, f"at {alike}")
    notes += _places_said(results, sheet, lowest, apart)
    panels = [_field_panel(results, sheet, each[tyre], quantity, known) for quantity in quantities for tyre in tyres]
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
    values = np.asarray(scipy.interpolate.PchipInterpolator(pressures, tested, axis=0)(rows))
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


def _places_said(results: Study, sheet: Sheet, lowest: Sequence[State], apart: Set[str]) -> list[str]:
    """Which specimens are shown at which values of the columns in which they differ: no room for it beside a name."""
    names: dict[str, list[str]] = {}
    for state in lowest:
        place = stated_text(results, {column: value for column, value in state.place.items() if column in apart})
        names.setdefault(place, []).append(sheet.labels[state.tyre])
    return ["; ".join(f"{' and '.join(who)} at {place}" for place, who in names.items())] if apart else []


def _field_panel(results: Study, sheet: Sheet, found: Sequence[State], quantity: Quantity, known: BoolArray) -> Panel:
    """The map of a quantity for the conditions of one specimen."""
    tyre, made = found[0].tyre, _fields(results, sheet, found, quantity, known)
    assert made is not None  # specimens without a map are left out
    x, y, z = made
    pressures, seen = results.shown.of(q.PRESSURE), results.shown.of(quantity)
    bar = q.PRESSURE.scale / pressures.scale
    rows = np.flatnonzero(known & np.any([one.rows for one in found], axis=0))
    frequency, pressure = sheet.values(q.FREQUENCY.head)[rows], sheet.values(q.PRESSURE.head)[rows] / pressures.scale
    tests = linked(results, Series(Role.POINTS, frequency, pressure), rows)
    return Panel(
        AxisData.of(q.FREQUENCY, log=bool(x[-1] > DECADE * x[0])),
        AxisData.of(pressures),
        (tests,),
        title=sheet.labels[tyre],
        right=seen.label,
        tyre=tyre,
        field=Field(x, bar * y, quantity.scale / seen.scale * z, seen.name, seen.shown),
    )


#: The figures of this module by their keys in catalogue.toml.
FIGURES = {
    "map": operating,
    "pressure-frequency": partial(over_pressure_and_frequency, quantities=(q.MODULUS, q.LOSS_ANGLE)),
}
