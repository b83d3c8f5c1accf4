"""Figures 1 to 14 of the paper: line art of its models and rigs, and curves of its two tyres."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import combinations, product
from typing import TYPE_CHECKING

import numpy as np

from fourpole import quantities as q
from fourpole.core.arrays import BoolArray, FloatArray
from fourpole.core.checks import Verdict
from fourpole.paper1982.companions import curve_of, load_key, pressure_key, rejected_of, tyre_look
from fourpole.plot.cards import static_cards
from fourpole.plot.data import (
    MOST_LABELLED,
    AxisData,
    FigureData,
    Panel,
    Place,
    Role,
    Scale,
    Series,
    Tone,
    counted,
    look,
    plain_text,
)
from fourpole.plot.loops import LoadLine, load_lines
from fourpole.plot.sheet import Sheet, few, leading, means, not_all, present, read_sheet, rig_stated, tests_said
from fourpole.quantities import Quantity
from fourpole.study.record import section
from fourpole.study.study import Study

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from fourpole.plot.style import Style

#: Number of lines of constant deflection in figure 5, about.
_LEVELS = 6
#: Panels and frequencies of figures 6 to 13.
_MOST_PAIRS, _MOST_FREQUENCIES = 12, 12
#: The two pressures of the paper's figure 14 [Pa], and its panels.
_TR_PRESSURES, _MOST_SETTINGS = (100e3, 168e3), 9


# ---- figure 5


def load_deflection(results: Study) -> FigureData | None:
    """Curves of constant pressure with an offset in proportion to it, joined by lines of constant deflection."""
    sheet = read_sheet(results)
    lines = load_lines(results, sheet)
    if not lines:
        return None
    notes: list[str] = []
    rejected = results.static.filter(results.static["verdict"] == Verdict.REJECTED)["test"].n_unique()
    missing = len(set(results.static["test"].to_list()) - {line.test for line in lines})
    if rejected:
        count = counted(rejected, "static test")
        notes.append(f"{count} rejected" + (f", {missing} without a curve" if missing else ""))
    grey = sum(line.rejected for line in lines)
    if grey:
        notes.append(f"dotted grey: {grey} curves without K1" if grey > 1 else "dotted grey: a curve without K1")
    tyres, offset, cards = sorted({line.tyre for line in lines}), _Offset.of(lines), static_cards(results)
    several = offset.per_bar > 0
    axes = AxisData("deflection + offset" if several else "deflection", "mm"), AxisData("load", "kN", zero=True)
    panels = []
    for tyre in tyres:
        own = [line for line in lines if line.tyre == tyre]
        own.sort(key=lambda line: (np.isnan(line.pressure), line.pressure))
        series = [_curve(line, own, offset, cards[line.test]) for line in own]
        knots = [line for line in own if np.isfinite(line.pressure) and not line.rejected]
        if several and len({line.pressure for line in knots}) > 1:
            series += _cross_lines(knots, offset)
        panels.append(Panel(*axes, tuple(series), sheet.labels[tyre], "", tyre))
    if several:
        notes.append(f"the offset is {offset.per_bar:.3g} mm per bar above {offset.start:.3g} bar")
        notes.append("each coloured curve is a pressure, each dark line a deflection: read the load at their crossing")
    notes.append("deflection counts from the point of zero load")
    columns = min(3, len(tyres))
    return FigureData(
        tuple(panels), columns, sheet.labels, notes=tuple(notes), aligned=True,
        panel_height=3.4 if len(tyres) <= columns else 2.8,
    )  # fmt: skip


@dataclass(frozen=True)
class _Offset:
    """Shift of a curve [mm] in proportion to its pressure [Pa], which allows interpolation between curves."""

    start: float
    per_bar: float

    @classmethod
    def of(cls, lines: Sequence[LoadLine]) -> _Offset:
        """A shift with a round number of mm per bar; zero if all curves have one pressure."""
        known = [line.pressure * 1e-5 for line in lines if np.isfinite(line.pressure)]
        if not known or max(known) - min(known) < 0.02 * max(known):
            return cls(known[0] if known else 0.0, 0.0)
        reach = max(float(line.deflection.max()) for line in lines)
        raw = reach / (max(known) - min(known))
        size = 10.0 ** np.floor(np.log10(raw))
        steps = (1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 7.5)
        return cls(min(known), float(size * max(step for step in steps if step * size <= raw)))

    def __call__(self, pressure: float) -> float:
        return self.per_bar * (pressure * 1e-5 - self.start) if np.isfinite(pressure) else 0.0


def _curve(line: LoadLine, own: Sequence[LoadLine], offset: _Offset, card: str) -> Series:
    """The curve of one pressure; the label of the highest one, or of the only one, has the unit."""
    stated = [one for one in own if np.isfinite(one.pressure)]
    if np.isfinite(line.pressure):
        label = f"{line.pressure * 1e-5:.3g}{' bar' if line is stated[-1] else ''}"
    else:
        label = plain_text(line.test, 12)
    return Series(
        Role.LINE, line.deflection + offset(line.pressure), line.load, label=label, place=Place.ABOVE,
        tyre=-1 if line.rejected else line.tyre, dash=2 if line.rejected else 0, tests=(line.test,), cards=(card,),
    )  # fmt: skip


def _cross_lines(lines: Sequence[LoadLine], offset: _Offset) -> list[Series]:
    """Lines of constant deflection, each with a label at the highest pressure that reaches it.

    The label is on the right, or on the left if the curve of the highest pressure ends at a smaller deflection.
    """
    reach = max(float(line.deflection.max()) for line in lines)
    found = []
    for level in _round_levels(reach):
        held = [line for line in lines if line.deflection[0] <= level <= line.deflection[-1]]
        if held:
            x = np.array([level + offset(line.pressure) for line in held])
            y = np.array([float(np.interp(level, line.deflection, line.load)) for line in held])
            place = Place.RIGHT if held[-1] is lines[-1] else Place.LEFT
            found.append(Series(Role.LINE, x, y, label=f"{level:g} mm", place=place, tone=Tone.INK))
    return found


def _round_levels(reach: float) -> list[float]:
    """Round deflections up to a reach, rising."""
    size = 10.0 ** np.floor(np.log10(reach / _LEVELS))
    step = float(size * next(one for one in (1.0, 2.0, 2.5, 5.0, 10.0) if one * size >= reach / _LEVELS))
    return [step * at for at in range(1, int(reach / step) + 1)]


# ---- figures 6 to 13


def property_figure(results: Study, *, quantity: Quantity, against: Quantity, high: bool) -> FigureData | None:
    """A quantity against pressure, a curve per frequency, or against frequency, a curve per pressure.

    A panel per specimen and preload; with `high`, of all preloads but the lowest, otherwise of the lowest.
    """
    sheet = read_sheet(results)
    x, _ = sheet.shown(against)
    y, std = sheet.shown(quantity)
    visible = np.isfinite(x) & np.isfinite(y)
    loads = list(present(sheet.load, visible))
    chosen = loads[1:] if high else loads[:1]
    if not chosen:
        return None
    concerned = np.isin(sheet.load, chosen) | ~np.isin(sheet.load, loads)
    visible &= concerned
    used, lost = visible & ~sheet.rejected, visible & sheet.rejected
    notes: list[str] = []
    tyres = list(present(sheet.tyre, visible))
    pairs = [(load, tyre) for load in chosen for tyre in tyres]
    places = leading(pairs, _MOST_PAIRS, "pairs of tyre and preload are", notes)
    by_frequency = against is q.PRESSURE
    keys = sheet.pressure if by_frequency else sheet.frequency
    groups = _groups(sheet, used, notes, by_frequency=by_frequency)
    scale = _scale(sheet, groups) if by_frequency and groups else None
    panels = []
    for load, tyre in places:
        here, series = sheet.where(load=load, tyre=tyre), []
        for group, marks in _looks(sheet, groups, load, tyre, by_frequency=by_frequency):
            mask = here & used & group
            series += curve_of(results, mask, (x, y), std, keys, marks)
        series += rejected_of(results, here & lost, (x, y))
        axes, right = (AxisData.of(against), AxisData.of(quantity)), sheet.name_of_load(load)
        panels.append(Panel(*axes, tuple(series), sheet.labels[tyre], right, tyre))
    notes += tests_said(sheet.rejected[concerned], visible[concerned], quantity.name)
    columns = min(3, len(tyres))
    rows = -(-len(places) // columns)
    return FigureData(
        tuple(panels), columns, sheet.labels, scale=scale, notes=tuple(notes), aligned=True,
        key=() if by_frequency else tuple(pressure_key(sheet, groups)), panel_height=2.35 if rows == 1 else 1.9,
    )  # fmt: skip


def _groups(sheet: Sheet, used: BoolArray, notes: list[str], *, by_frequency: bool) -> list[int]:
    """The frequencies, or the pressures, that have a curve."""
    if by_frequency:
        found = list(present(sheet.frequency, used & (sheet.frequency >= 0)))
        return few(found, _MOST_FREQUENCIES, "frequencies", notes)
    return few(list(present(sheet.pressure, used)), MOST_LABELLED, "pressures", notes)


def _scale(sheet: Sheet, groups: Sequence[int]) -> Scale:
    """The colour scale of the frequencies."""
    values = [sheet.frequencies.values[group] for group in groups]
    return Scale(q.FREQUENCY.name, q.FREQUENCY.shown, min(values), max(values))


def _looks(
    sheet: Sheet, groups: Sequence[int], load: int, tyre: int, *, by_frequency: bool
) -> Iterator[tuple[BoolArray, Series]]:
    """The tests and the look of each curve: a frequency on the colour scale, or a pressure with its marker."""
    for group in groups:
        if by_frequency:
            level = sheet.frequencies.values[group]
            yield sheet.frequency == group, look(Role.POINTS, tyre=tyre, dash=load, level=level)
        else:
            yield sheet.pressure == group, tyre_look(tyre, group, load)


# ---- figure 14


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
    places = leading(places, _MOST_SETTINGS, "settings", notes)
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
    return sorted({found[int(np.nanargmin(np.abs(values - wanted)))] for wanted in _TR_PRESSURES})


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


def drawn(results: Study, style: Style, *, file: str) -> Figure:  # noqa: ARG001  every figure takes the results
    """Figures 1, 3 and 4, which have nothing of a campaign."""
    return _figure(file, style)


def whole_model(results: Study, style: Style) -> Figure:
    """Figure 2: the tyre, the moving mass, the preload spring and the foundation, with the values stated."""
    rigs = section(results.record, "stated", "rigs")
    rig = rig_stated(next(iter(rigs.values()))) if len(rigs) == 1 else None
    if rig is None:
        return _figure("fig02.svg", style, m="m", K3="K3", blocked="")
    return _figure(
        "fig02-damped.svg" if rig.preload_damping > 0 else "fig02.svg", style,
        m=f"m = {rig.moving_mass:.4g} kg",
        K3=f"K3 = {rig.preload_stiffness / 1e3:.4g} kN/m",
        c3=f"c3 = {rig.preload_damping:.4g} N s/m",
        blocked="the rig of this campaign is blocked beyond the specimen: V2 = 0" if rig.blocked else "",
    )  # fmt: skip


def _figure(file: str, style: Style, **values: str) -> Figure:
    """A drawing of this room as a figure of its size."""
    from fourpole.plot.lineart import Canvas, drawing_of  # loads matplotlib, which figures as data do not need

    drawing = drawing_of("fourpole.paper1982", file)
    canvas = Canvas(float(drawing.attrib["viewBox"].split()[3]), style)
    canvas.place(drawing, values=values)
    return canvas.figure


#: The figures of this module by their keys in catalogue.toml; 6 to 13 are C and then K2, each against pressure and then
#: frequency, each at low and then high preload.
FIGURES = {
    "fig02": whole_model,
    **{key: partial(drawn, file=f"{key}.svg") for key in ("fig01", "fig03", "fig04")},
    "fig05": load_deflection,
    **{
        f"fig{number:02d}": partial(property_figure, quantity=quantity, against=against, high=high)
        for number, (quantity, against, high) in enumerate(
            product((q.C, q.K2), (q.PRESSURE, q.FREQUENCY), (False, True)), start=6
        )
    },
    "fig14": transmissibility,
}
