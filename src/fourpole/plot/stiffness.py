"""Figures of K*: the Nyquist plot, the routes, and the mobility."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from fourpole import quantities as q
from fourpole.core.arrays import BoolArray, ComplexArray, FloatArray
from fourpole.core.rig import PARAMETERS, Rig
from fourpole.core.routes import mobility_route, relative_route, transmissibility_route
from fourpole.core.tyre import zener_stiffness
from fourpole.errors import RigError
from fourpole.plot.layout import Grid, Key, Notes
from fourpole.plot.panels import (
    Extent,
    Marks,
    bars,
    condition,
    curve,
    extent_of,
    limit,
    rejected_tests,
    span,
    tyre_heading,
)
from fourpole.plot.properties import tyre_marks
from fourpole.plot.sheet import IntArray, Sheet, means, present, read_sheet, texts
from fourpole.plot.spec import FigureSpec
from fourpole.plot.style import Dashes, Style, mixed
from fourpole.quantities import Quantity
from fourpole.study.results import Results, section

_MOST_PRESSURES = 5
_MOST_LOADS = 3
_MOST_TYRES = 12
_MOST_COLUMNS = 4
#: Marker and line style of each route.
_ROUTE_MARKS: dict[str, tuple[str, Dashes]] = {
    "mobility": ("o", "solid"),
    "relative": ("^", (0.0, (4.0, 1.6))),
    "transmissibility": ("s", (0.0, (1.0, 1.3))),
}


@dataclass(frozen=True)
class _Choice:
    """Tyres, pressures and preloads that a figure of many curves shows."""

    tyres: list[int]
    pressures: list[int]
    loads: list[int]

    def conditions(self) -> list[tuple[int, int]]:
        """Pairs of each pressure with each preload."""
        return [(pressure, load) for load in self.loads for pressure in self.pressures]

    def tests(self, sheet: Sheet) -> BoolArray:
        """True for tests of these conditions."""
        here = np.isin(sheet.tyre, self.tyres) & np.isin(sheet.pressure, self.pressures)
        return here & np.isin(sheet.load, self.loads)


def _choose(sheet: Sheet, visible: BoolArray, notes: Notes) -> _Choice:
    """The conditions to show among those of the visible tests."""
    return _Choice(
        notes.some(list(present(sheet.tyre, visible)), _MOST_TYRES, "tyres"),
        notes.some(list(present(sheet.pressure, visible)), _MOST_PRESSURES, "pressures"),
        notes.some(list(present(sheet.load, visible)), _MOST_LOADS, "preloads"),
    )


def mobility(results: Results, style: Style) -> Figure | None:
    """R and I as measured, with the curve that K1, K2 and C and the rig as stated give."""
    sheet = read_sheet(results)
    return _rows(
        sheet, style, (q.R, q.I), what="R and I", model=partial(_model_curve, sheet, rigs_stated(results, sheet))
    )


#: Frequencies [Hz] of the tests of a condition, and R and I in the units of their axes; None if there is no curve.
_Model = Callable[[BoolArray], tuple[FloatArray, list[FloatArray]] | None]


def _rows(
    sheet: Sheet,
    style: Style,
    quantities: Sequence[Quantity],
    *,
    what: str,
    model: _Model | None = None,
) -> Figure | None:
    """A row per quantity and a column per tyre, against frequency.

    A line joins the points; with `model`, the curve of the model is drawn instead of this line.
    """
    frequency, _ = sheet.shown(q.FREQUENCY)
    shown = [sheet.shown(quantity) for quantity in quantities]
    bare, said = sheet.bare("mobility") if model else (np.ones(frequency.size, dtype=bool), "")
    visible = np.isfinite(frequency) & np.isfinite(shown[0][0]) & bare
    if not np.any(visible):
        return None
    notes, key = Notes(), Key()
    notes.say(said)
    choice = _choose(sheet, visible, notes)
    chosen = visible & choice.tests(sheet)
    used, lost = chosen & ~sheet.rejected, chosen & sheet.rejected
    tyres = notes.first(choice.tyres, _MOST_COLUMNS, "tyres")
    columns = len(tyres)
    grid = Grid.of(len(quantities) * columns, columns, panel_height=1.95, style=style)
    settings = list(present(sheet.setting, chosen)) if model else [-1]
    for row, (quantity, (values, stds)) in enumerate(zip(quantities, shown, strict=True)):
        extent = extent_of(values, stds, used, chosen, positive=quantity is not q.I)
        limits = extent.limits()
        for column, tyre in enumerate(tyres):
            ax = grid.panels[row * columns + column]
            for pressure, load in choice.conditions():
                here = used & sheet.where(tyre=tyre, pressure=pressure, load=load)
                marks = tyre_marks(sheet, style, tyre, pressure, load, joined=model is None)
                keys = sheet.frequency[here].tolist()
                curve(ax, frequency[here], values[here], marks=marks, std=stds[here], keys=keys)
                for setting in settings:
                    found = model(here & (sheet.setting == setting)) if model else None
                    if found:
                        ax.plot(found[0], found[1][row], color=marks.colour, linestyle=marks.dashes, linewidth=1.0,
                                label="_model", zorder=2.0)  # fmt: skip
            crosses = lost & (sheet.tyre == tyre)
            rejected_tests(ax, frequency[crosses], values[crosses], style=style)
            if row == 0:
                tyre_heading(ax, sheet.labels[tyre], style.colour(tyre), style=style, letters=60 // columns)
            limit(ax, span([frequency[chosen]]), limits, style=style, ticks=6 if columns < 3 else 4)
        notes.outside(extent, limits, style, values[lost], quantity.name)
    key.pressures(sheet, choice.pressures, style)
    key.loads(sheet, choice.loads, style)
    key.rejected(style, lost)
    notes.tests(sheet.rejected[bare], visible[bare], what)
    labels = [quantity.label for quantity in quantities]
    return grid.finish(key=key, notes=notes, x_label=q.FREQUENCY.label, y_labels=labels, headings="top")


def _model_curve(
    sheet: Sheet, rigs: Mapping[str, Rig | None], mask: BoolArray
) -> tuple[FloatArray, list[FloatArray]] | None:
    """Frequencies [Hz] with R and I [mm/(N s)] of the Zener model; K1, K2 and C are interpolated between the tests."""
    at = np.flatnonzero(mask)
    rig = rigs.get(sheet.rigs[at[0]]) if at.size else None
    if rig is None:
        return None
    frequency = sheet.values(q.FREQUENCY.head)[mask]
    keys = sheet.frequency[mask].tolist()
    x, k1 = means(frequency, sheet.values(q.K1.head)[mask], keys)
    x2, k2 = means(frequency, sheet.values(q.K2.head)[mask], keys)
    _, c = means(frequency, sheet.values(q.C.head)[mask], keys)
    if x2.size < 2 or x.size != x2.size:
        return None
    grid = np.linspace(x2[0], x2[-1], 61)
    omega = 2 * np.pi * grid
    tyre = zener_stiffness(np.interp(grid, x, k1), np.interp(grid, x2, k2), np.interp(grid, x2, c), omega)
    # The measured force also accelerates the mass between the force transducer and the contact.
    inner = 1j * omega / tyre + rig.mobility(omega, float(sheet.added[at[0]]))
    whole = 1.0 / (1.0 / inner + 1j * omega * rig.input_mass) * 1e3
    return grid, [whole.real, whole.imag]


def nyquist(results: Results, style: Style) -> Figure | None:
    """K'' against K' along frequency, a panel per tyre."""
    sheet = read_sheet(results)
    real, real_std = sheet.shown(q.STORAGE)
    imag, std = sheet.shown(q.LOSS)
    visible = np.isfinite(real) & np.isfinite(imag)
    if not np.any(visible):
        return None
    notes, key = Notes(), Key()
    choice = _choose(sheet, visible, notes)
    chosen = visible & choice.tests(sheet)
    used, lost = chosen & ~sheet.rejected, chosen & sheet.rejected
    columns = min(3, len(choice.tyres))
    grid = Grid.of(len(choice.tyres), columns, panel_height=2.6 if len(choice.tyres) <= columns else 2.1, style=style)
    across = extent_of(real, real_std, used, chosen, positive=True)
    along = extent_of(imag, std, used, chosen, positive=True)
    for ax, tyre in zip(grid.panels, choice.tyres, strict=True):
        for pressure, load in choice.conditions():
            here = used & sheet.where(tyre=tyre, pressure=pressure, load=load)
            marks = tyre_marks(sheet, style, tyre, pressure, load)
            x, y = _along_frequency(sheet, real, imag, here)
            ax.plot(x, y, color=marks.colour, linestyle=marks.dashes, label="_line", zorder=2.0)
            bars(ax, real[here], imag[here], real_std[here], marks.colour, level=True)
            curve(ax, real[here], imag[here], std=std[here], marks=replace(marks, joined=False))
        crosses = lost & (sheet.tyre == tyre)
        rejected_tests(ax, real[crosses], imag[crosses], style=style)
        tyre_heading(ax, sheet.labels[tyre], style.colour(tyre), _frequency_range(sheet, used, tyre), style=style,
                     letters=60 // columns)  # fmt: skip
        limit(ax, across.limits(), along.limits(), style=style, ticks=5)
    key.pressures(sheet, choice.pressures, style)
    key.loads(sheet, choice.loads, style)
    key.rejected(style, lost)
    notes.tests(sheet.rejected, visible, "K*")
    notes.outside(along, along.limits(), style, imag[lost], q.LOSS.name)
    return grid.finish(key=key, notes=notes, x_label=q.STORAGE.label, y_labels=[q.LOSS.label])


def _along_frequency(
    sheet: Sheet, real: FloatArray, imag: FloatArray, mask: BoolArray
) -> tuple[FloatArray, FloatArray]:
    """Real and imaginary parts of the tests of a mask in rising order of frequency; repeats are averaged."""
    frequency = sheet.values(q.FREQUENCY.head)[mask]
    keys = sheet.frequency[mask].tolist()
    return means(frequency, real[mask], keys)[1], means(frequency, imag[mask], keys)[1]


def _frequency_range(sheet: Sheet, used: BoolArray, tyre: int) -> str:
    """Lowest and highest frequency of a tyre, as a heading."""
    found = [at for at in present(sheet.frequency, used & (sheet.tyre == tyre)) if at >= 0]
    if not found:
        return ""
    first, last = sheet.frequencies.labels[found[0]], sheet.frequencies.labels[found[-1]]
    return first if first == last else f"{first.removesuffix(' Hz')} to {last}"


def rig_stated(stated: Mapping[str, Any]) -> Rig | None:
    """A rig from its statement in study.json; None if the statement is not valid."""
    try:
        values: dict[str, Any] = {name: float(stated[name]["value"]) for name in PARAMETERS if stated.get(name)}
        return Rig(**values, blocked=stated.get("output") == "blocked")
    except (RigError, AttributeError, KeyError, TypeError, ValueError):
        return None


def rigs_stated(results: Results, sheet: Sheet) -> dict[str, Rig | None]:
    """The stated rig of each name in dynamic.csv; None if there is no valid statement."""
    stated = section(results.record, "stated", "rigs")
    return {name: rig_stated(stated[name]) if name in stated else None for name in set(sheet.rigs)}


def phasors(sheet: Sheet, rig: Rig | None, at: IntArray) -> tuple[ComplexArray, FloatArray, ComplexArray]:
    """F1 at the contact [N], V1 and V2 [m/s] of some tests; V1 has the phase 0.

    The force transducer also accelerates the input mass of the rig, so its inertia force is subtracted.
    """
    omega, v1 = 2 * np.pi * sheet.values(q.FREQUENCY.head)[at], sheet.values(q.V1.head)[at]
    cell, v2 = (
        (sheet.values(size.head) * np.exp(1j * sheet.values(phase.head)))[at]
        for size, phase in ((q.F1, q.PHASE_F1), (q.V2, q.PHASE_V2))
    )
    return cell - 1j * omega * v1 * (rig.input_mass if rig else 0.0), v1, v2


def route_stiffness(results: Results, sheet: Sheet) -> dict[str, ComplexArray]:
    """K* [N/m] of every test by each route; not-a-number if the test lacks a phasor or the rig that a route needs."""
    every = 2 * np.pi * sheet.values(q.FREQUENCY.head)
    names = np.array(sheet.rigs, dtype=object)
    found = {route: np.full(every.size, np.nan, dtype=complex) for route in _ROUTE_MARKS}
    with np.errstate(all="ignore"):
        for name, rig in rigs_stated(results, sheet).items():
            at = np.flatnonzero((names == name) & np.isfinite(every))
            omega, added = every[at], sheet.added[at]
            f1, v1, v2 = phasors(sheet, rig, at)
            found["relative"][at] = relative_route(f1, v1, v2, omega)
            if rig is None:
                continue
            found["mobility"][at] = mobility_route(v1 / f1, rig.mobility(omega, added), omega)
            if not rig.blocked:
                found["transmissibility"][at] = transmissibility_route(v2 / v1, rig.impedance(omega, added), omega)
    return {route: value for route, value in found.items() if np.any(np.isfinite(value))}


def routes(results: Results, style: Style) -> Figure | None:
    """K' by each route at one condition, and the relative differences of K' and K'' from the K* in use."""
    sheet = read_sheet(results)
    frequency, _ = sheet.shown(q.FREQUENCY)
    reference = sheet.values(q.STORAGE.head) + 1j * sheet.values(q.LOSS.head)
    visible = np.isfinite(frequency) & np.isfinite(reference)
    found = route_stiffness(results, sheet)
    used = visible & ~sheet.rejected
    if len(found) < 2 or not np.any(used):
        return None
    notes, key = Notes(), Key()
    tyres = notes.first(list(present(sheet.tyre, used)), _MOST_COLUMNS, "tyres")
    columns = len(tyres)
    grid = Grid.of(3 * columns, columns, panel_height=1.8, style=style)
    extents = [Extent(), Extent(), Extent()]
    pale = dict(zip(_ROUTE_MARKS, (1.0, 0.45, 0.1), strict=True))
    for column, tyre in enumerate(tyres):
        own = used & (sheet.tyre == tyre)
        pressure, load = _fullest(sheet, own)
        here = own & sheet.where(pressure=pressure, load=load)
        for route, value in found.items():
            marker, dashes = _ROUTE_MARKS[route]
            face = mixed(style.look.paper, style.colour(tyre), pale[route])
            marks = Marks(style.colour(tyre), marker, face, dashes)
            off = 100 * (value - reference)
            y = value.real / q.STORAGE.scale
            curve(grid.panels[column], frequency[here], y[here], marks=marks)
            extents[0].add(y[here])
            for row, y in enumerate((off.real / reference.real, off.imag / reference.imag), start=1):
                ax = grid.panels[row * columns + column]
                extents[row].add(*middle_and_range(ax, sheet, own & np.isfinite(y), y, marks=marks))
        tyre_heading(grid.panels[column], sheet.labels[tyre], style.colour(tyre), style=style, letters=60 // columns)
        where = [sheet.pressures.labels[pressure], sheet.loads.labels[load]]
        text = ", ".join(part for part in where if part[0].isdigit())
        condition(grid.panels[column], text, style=style)
        condition(grid.panels[columns + column], "all conditions: median, range", style=style, pad=2.5)
    free = Style(style.theme, xlim=style.xlim)
    for at, ax in enumerate(grid.panels):
        row = at // columns
        limits = extents[row].limits()
        limit(ax, span([frequency[used]]), limits, style=free if row else style, ticks=6 if columns < 3 else 4)
        notes.cut(extents[row], limits, free, "range")
    for route in found:
        marker, dashes = _ROUTE_MARKS[route]
        in_use = np.mean([text == route for text in texts(sheet.table, "route")]) > 0.5
        key.line(f"{route} route" + (" (in use)" if in_use else ""), style.look.muted, linestyle=dashes, marker=marker,
                 markerfacecolor=mixed(style.look.paper, style.look.muted, pale[route]))  # fmt: skip
    notes.tests(sheet.rejected, visible & ~sheet.rejected, "K*")
    labels = [q.STORAGE.label, "difference of K' [%]", "difference of K'' [%]"]
    return grid.finish(key=key, notes=notes, x_label=q.FREQUENCY.label, y_labels=labels, headings="all")


def middle_and_range(
    ax: Axes, sheet: Sheet, mask: BoolArray, y: FloatArray, *, marks: Marks
) -> tuple[FloatArray, FloatArray]:
    """Draw the median of the tests at each frequency, with a bar from the smallest to the largest value.

    Returns the medians, and for each the distance to the farther end of its bar.
    """
    groups = [mask & (sheet.frequency == group) for group in present(sheet.frequency, mask)]
    x = np.array([sheet.values(q.FREQUENCY.head)[group].mean() for group in groups])
    median, low, high = (np.array([pick(y[group]) for group in groups]) for pick in (np.median, np.min, np.max))
    middle, half = 0.5 * (high + low), 0.5 * (high - low)
    curve(ax, x, median, marks=marks)
    bars(ax, x, middle, half, marks.colour)
    return median, np.abs(middle - median) + half


def _fullest(sheet: Sheet, own: BoolArray) -> tuple[int, int]:
    """Pressure and preload with the most tests; if several have as many, the lowest preload and a middle pressure."""
    counts = Counter(zip(sheet.load[own].tolist(), sheet.pressure[own].tolist(), strict=True))
    alike = sorted(place for place, count in counts.items() if count == max(counts.values()))
    lowest = [pressure for load, pressure in alike if load == alike[0][0]]
    return lowest[len(lowest) // 2], alike[0][0]


#: Figures of this module, in the order of a report.
FIGURES = (
    FigureSpec(
        "nyquist",
        "Nyquist plot of the dynamic stiffness",
        "Loss stiffness K'' against storage stiffness K', each curve along frequency.",
        nyquist,
        apart=True,
    ),
    FigureSpec(
        "routes",
        "Routes side by side",
        "K' by each route at one condition, and how far K' and K'' by each route lie from the K* in use.",
        routes,
        apart=True,
    ),
    FigureSpec(
        "mobility",
        "Mobility measured and modelled",
        "Real part R and imaginary part I of V1/F1, points measured, lines from K1 and the interpolated K2 and C "
        "on the rig as stated.",
        mobility,
        apart=True,
    ),
)
