"""K* and what surrounds it: K', K'' and loss factor, the Nyquist plot, the routes side by side, the mobility."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from fourpole import quantities as q
from fourpole.core.arrays import BoolArray, ComplexArray, FloatArray
from fourpole.core.rig import PARAMETERS, Rig
from fourpole.core.routes import mobility_route, relative_route, transmissibility_route
from fourpole.core.tyre import zener_stiffness
from fourpole.errors import RigError
from fourpole.plot.layout import Grid, Key, Notes
from fourpole.plot.panels import Extent, Marks, bars, curve, limit, means, rejected_tests, span, tyre_heading
from fourpole.plot.properties import tyre_marks
from fourpole.plot.sheet import Sheet, present, read_sheet, spread
from fourpole.plot.style import Dashes, Style, mixed
from fourpole.quantities import Quantity
from fourpole.study.results import Results

__all__ = ["mobility", "nyquist", "rig_stated", "route_stiffness", "routes", "stiffness"]

_MOST_PRESSURES = 5
_MOST_LOADS = 3
_MOST_TYRES = 12
_MOST_COLUMNS = 4
_ROUTE_MARKS: dict[str, tuple[str, Dashes]] = {
    "mobility": ("o", "solid"),
    "relative": ("^", (0.0, (4.0, 1.6))),
    "transmissibility": ("s", (0.0, (1.0, 1.3))),
}


@dataclass(frozen=True)
class _Choice:
    """The conditions that a figure of many curves shows."""

    tyres: list[int]
    pressures: list[int]
    loads: list[int]

    def conditions(self) -> list[tuple[int, int]]:
        """Each pressure with each load."""
        return [(pressure, load) for load in self.loads for pressure in self.pressures]

    def mask(self, sheet: Sheet) -> BoolArray:
        """Tests of these conditions."""
        return (
            np.isin(sheet.tyre, self.tyres) & np.isin(sheet.pressure, self.pressures) & np.isin(sheet.load, self.loads)
        )


def _choose(sheet: Sheet, visible: BoolArray, notes: Notes) -> _Choice:
    chosen: list[list[int]] = []
    for groups, most, what in (
        (sheet.tyre, _MOST_TYRES, "tyres"),
        (sheet.pressure, _MOST_PRESSURES, "pressures"),
        (sheet.load, _MOST_LOADS, "preloads"),
    ):
        found = list(present(groups, visible))
        chosen.append([found[at] for at in spread(len(found), most)])
        notes.chosen(len(chosen[-1]), len(found), what)
    return _Choice(*chosen)


def stiffness(results: Results, style: Style) -> Figure | None:
    """K', K'' and the loss factor against frequency, a column per tyre."""
    sheet = read_sheet(results)
    shown = [sheet.shown(quantity) for quantity in (q.STORAGE, q.LOSS, q.LOSS_FACTOR)]
    return _rows(sheet, style, (q.STORAGE, q.LOSS, q.LOSS_FACTOR), shown, what="K*")


def mobility(results: Results, style: Style) -> Figure | None:
    """R and I as measured, with the curve of the model through K2 and C on the rig as stated."""
    sheet = read_sheet(results)
    shown = [sheet.shown(quantity) for quantity in (q.R, q.I)]
    rigs = _rigs(results, sheet)

    def model(mask: BoolArray) -> tuple[FloatArray, list[FloatArray]] | None:
        return _model_curve(sheet, mask, rigs)

    return _rows(sheet, style, (q.R, q.I), shown, what="R and I", model=model)


_Model = Callable[[BoolArray], tuple[FloatArray, list[FloatArray]] | None]


def _rows(
    sheet: Sheet,
    style: Style,
    quantities: Sequence[Quantity],
    shown: Sequence[tuple[FloatArray, FloatArray]],
    *,
    what: str,
    model: _Model | None = None,
) -> Figure | None:
    """A row per quantity and a column per tyre, against frequency; with a model, its curve in place of the line."""
    frequency, _ = sheet.shown(q.FREQUENCY)
    bare, said = sheet.bare("mobility") if model else (np.ones(frequency.size, dtype=bool), "")
    visible = np.isfinite(frequency) & np.isfinite(shown[0][0]) & bare
    if not np.any(visible):
        return None
    notes, key = Notes(), Key()
    notes.say(said)
    choice = _choose(sheet, visible, notes)
    chosen = visible & choice.mask(sheet)
    used = chosen & ~sheet.rejected
    columns = min(_MOST_COLUMNS, len(choice.tyres))
    tyres = choice.tyres[:columns]
    notes.chosen(columns, len(choice.tyres), "tyres")
    grid = Grid.of(len(quantities) * columns, columns, panel_height=1.95, style=style)
    settings = list(present(sheet.setting, chosen)) if model else [-1]
    for row, (values, stds) in enumerate(shown):
        extent = Extent(positive=quantities[row] is not q.I)
        extent.add(values[used] if np.any(used) else values[chosen], stds[used] if np.any(used) else None)
        limits = extent.limits()
        for column, tyre in enumerate(tyres):
            ax = grid.panels[row * columns + column]
            for pressure, load in choice.conditions():
                here = used & (sheet.tyre == tyre) & (sheet.pressure == pressure) & (sheet.load == load)
                marks = tyre_marks(sheet, style, tyre, pressure, load, joined=model is None)
                keys = sheet.frequency[here].tolist()
                curve(ax, frequency[here], values[here], marks=marks, std=stds[here], keys=keys)
                for setting in settings:
                    found = model(here & (sheet.setting == setting)) if model else None
                    if found:
                        ax.plot(found[0], found[1][row], color=marks.colour, linestyle=marks.dashes, linewidth=1.0,
                                label="_model", zorder=2.0)  # fmt: skip
            lost = chosen & sheet.rejected & (sheet.tyre == tyre)
            rejected_tests(ax, frequency[lost], values[lost], style=style)
            if row == 0:
                tyre_heading(ax, sheet.labels[tyre], style.colour(tyre), style=style, columns=columns)
            limit(ax, span([frequency[chosen]]), limits, style=style, ticks=6 if columns < 3 else 4)
        notes.beyond(values[chosen & sheet.rejected], style.ylim or limits, quantities[row].name)
        notes.cut(extent, limits, style)
    key.pressures(sheet, choice.pressures, style)
    key.loads(sheet, choice.loads, style)
    if np.any(chosen & sheet.rejected):
        key.rejected(style)
    notes.tests(sheet.rejected[bare], visible[bare], what)
    labels = [quantity.label for quantity in quantities]
    return grid.finish(key=key, notes=notes, x_label=q.FREQUENCY.label, y_labels=labels, headings="top")


def _model_curve(
    sheet: Sheet, mask: BoolArray, rigs: Mapping[str, Rig | None]
) -> tuple[FloatArray, list[FloatArray]] | None:
    """Frequencies with R and I [mm/(N s)] of the Zener tyre, K2 and C interpolated between the tests."""
    names = sheet.table["rig"].to_list()
    at = np.flatnonzero(mask)
    rig = rigs.get(names[at[0]] or "") if at.size else None
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
    added = float(np.nan_to_num(sheet.values(q.ADDED_MASS.head))[at[0]])
    # The force cell also drives the mass between it and the contact.
    inner = 1j * omega / tyre + rig.mobility(omega, added)
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
    chosen = visible & choice.mask(sheet)
    used = chosen & ~sheet.rejected
    base = used if np.any(used) else chosen
    columns = min(3, len(choice.tyres))
    grid = Grid.of(len(choice.tyres), columns, panel_height=2.6 if len(choice.tyres) <= columns else 2.1, style=style)
    across, along = Extent(positive=True), Extent(positive=True)
    across.add(real[base], real_std[base])
    along.add(imag[base], std[base])
    for ax, tyre in zip(grid.panels, choice.tyres, strict=True):
        for pressure, load in choice.conditions():
            here = used & (sheet.tyre == tyre) & (sheet.pressure == pressure) & (sheet.load == load)
            marks = tyre_marks(sheet, style, tyre, pressure, load)
            x, y = _along_frequency(sheet, real, imag, here)
            ax.plot(x, y, color=marks.colour, linestyle=marks.dashes, label="_line", zorder=2.0)
            bars(ax, real[here], imag[here], real_std[here], marks.colour, level=True)
            curve(ax, real[here], imag[here], std=std[here],
                  marks=Marks(marks.colour, marks.marker, marks.face, joined=False))  # fmt: skip
        lost = chosen & sheet.rejected & (sheet.tyre == tyre)
        rejected_tests(ax, real[lost], imag[lost], style=style)
        tyre_heading(ax, sheet.labels[tyre], style.colour(tyre), _frequency_range(sheet, used, tyre), style=style,
                     columns=columns)  # fmt: skip
        limit(ax, across.limits(), along.limits(), style=style, ticks=5)
    key.pressures(sheet, choice.pressures, style)
    key.loads(sheet, choice.loads, style)
    if np.any(chosen & sheet.rejected):
        key.rejected(style)
    notes.tests(sheet.rejected, visible, "K*")
    notes.beyond(imag[chosen & sheet.rejected], style.ylim or along.limits(), q.LOSS.name)
    notes.cut(along, along.limits(), style)
    return grid.finish(key=key, notes=notes, x_label=q.STORAGE.label, y_labels=[q.LOSS.label])


def _along_frequency(
    sheet: Sheet, real: FloatArray, imag: FloatArray, mask: BoolArray
) -> tuple[FloatArray, FloatArray]:
    frequency = sheet.values(q.FREQUENCY.head)[mask]
    keys = sheet.frequency[mask].tolist()
    return means(frequency, real[mask], keys)[1], means(frequency, imag[mask], keys)[1]


def _frequency_range(sheet: Sheet, used: BoolArray, tyre: int) -> str:
    found = [at for at in present(sheet.frequency, used & (sheet.tyre == tyre)) if at >= 0]
    if not found:
        return ""
    first, last = sheet.frequencies.labels[found[0]], sheet.frequencies.labels[found[-1]]
    return first if first == last else f"{first.removesuffix(' Hz')} to {last}"


def rig_stated(stated: Mapping[str, Any]) -> Rig | None:
    """The rig of study.json; None where it is not one."""
    try:
        values: dict[str, Any] = {name: float(stated[name]["value"]) for name in PARAMETERS if stated.get(name)}
        return Rig(**values, blocked=stated.get("output") == "blocked")
    except (RigError, KeyError, TypeError, ValueError):
        return None


def _rigs(results: Results, sheet: Sheet) -> dict[str, Rig | None]:
    stated = (results.record.get("stated") or {}).get("rigs") or {}
    names = {name or "" for name in sheet.table["rig"].to_list()}
    return {name: rig_stated(stated[name]) if name in stated else None for name in names}


def route_stiffness(results: Results, sheet: Sheet) -> dict[str, ComplexArray]:
    """K* [N/m] of every test by each route that its phasors and rig allow; not-a-number where they do not."""
    omega = 2 * np.pi * sheet.values(q.FREQUENCY.head)
    cell = sheet.values(q.F1.head) * np.exp(1j * sheet.values(q.PHASE_F1.head))
    v1 = sheet.values(q.V1.head)
    v2 = sheet.values(q.V2.head) * np.exp(1j * sheet.values(q.PHASE_V2.head))
    added = np.nan_to_num(sheet.values(q.ADDED_MASS.head))
    names = np.array([name or "" for name in sheet.table["rig"].to_list()], dtype=object)
    found = {route: np.full(omega.size, np.nan, dtype=complex) for route in _ROUTE_MARKS}
    with np.errstate(all="ignore"):
        for name, rig in _rigs(results, sheet).items():
            at = np.flatnonzero((names == name) & np.isfinite(omega))
            f1 = cell[at] - 1j * omega[at] * v1[at] * (rig.input_mass if rig else 0.0)
            found["relative"][at] = relative_route(f1, v1[at], v2[at], omega[at])
            if rig is None:
                continue
            found["mobility"][at] = mobility_route(v1[at] / f1, rig.mobility(omega[at], added[at]), omega[at])
            if not rig.blocked:
                impedance = rig.impedance(omega[at], added[at])
                found["transmissibility"][at] = transmissibility_route(v2[at] / v1[at], impedance, omega[at])
    return {route: value for route, value in found.items() if np.any(np.isfinite(value))}


def routes(results: Results, style: Style) -> Figure | None:
    """K' by each route at one condition, and how far K' and K'' of each route lie from the K* in use."""
    sheet = read_sheet(results)
    frequency, _ = sheet.shown(q.FREQUENCY)
    reference = sheet.values(q.STORAGE.head) + 1j * sheet.values(q.LOSS.head)
    visible = np.isfinite(frequency) & np.isfinite(reference)
    found = route_stiffness(results, sheet)
    used = visible & ~sheet.rejected
    if len(found) < 2 or not np.any(used):
        return None
    notes, key = Notes(), Key()
    tyres = list(present(sheet.tyre, used))
    columns = min(_MOST_COLUMNS, len(tyres))
    notes.chosen(columns, len(tyres), "tyres")
    grid = Grid.of(3 * columns, columns, panel_height=1.8, style=style)
    tyres = tyres[:columns]
    extents = [Extent(), Extent(), Extent()]
    pale = dict(zip(_ROUTE_MARKS, (1.0, 0.45, 0.1), strict=True))
    for column, tyre in enumerate(tyres):
        own = used & (sheet.tyre == tyre)
        pressure, load = _fullest(sheet, own)
        condition = own & (sheet.pressure == pressure) & (sheet.load == load)
        for route, value in found.items():
            marker, dashes = _ROUTE_MARKS[route]
            face = mixed(style.look.paper, style.colour(tyre), pale[route])
            marks = Marks(style.colour(tyre), marker, face, dashes)
            off = 100 * (value - reference)
            y = value.real / q.STORAGE.scale
            curve(grid.panels[column], frequency[condition], y[condition], marks=marks)
            extents[0].add(y[condition])
            for row, y in enumerate((off.real / reference.real, off.imag / reference.imag), start=1):
                ax = grid.panels[row * columns + column]
                extents[row].add(*middle_and_range(ax, sheet, own & np.isfinite(y), y, marks=marks))
        tyre_heading(grid.panels[column], sheet.labels[tyre], style.colour(tyre), style=style, columns=columns)
        where = [sheet.pressures.labels[pressure], sheet.loads.labels[load]]
        text = ", ".join(part for part in where if part[0].isdigit())
        if text:
            grid.panels[column].set_title(text, loc="right", pad=4.5, color=style.look.muted, fontsize=7.5)
        grid.panels[columns + column].set_title(
            "all conditions: median, range", loc="right", pad=2.5, color=style.look.muted, fontsize=7.5
        )
    free = Style(style.theme, xlim=style.xlim)
    for at, ax in enumerate(grid.panels):
        row = at // columns
        limit(
            ax,
            span([frequency[used]]),
            extents[row].limits(),
            style=free if row else style,
            ticks=6 if columns < 3 else 4,
        )
        notes.cut(extents[row], extents[row].limits(), free, "range")
    for route in found:
        marker, dashes = _ROUTE_MARKS[route]
        handle = Line2D([], [], color=style.look.muted, linestyle=dashes, marker=marker)
        handle.set_markerfacecolor(mixed(style.look.paper, style.look.muted, pale[route]))
        in_use = np.mean([text == route for text in sheet.table["route"].to_list()]) > 0.5
        key.add(handle, f"{route} route" + (" (in use)" if in_use else ""))
    notes.tests(sheet.rejected, visible & ~sheet.rejected, "K*")
    labels = [q.STORAGE.label, "difference of K' [%]", "difference of K'' [%]"]
    return grid.finish(key=key, notes=notes, x_label=q.FREQUENCY.label, y_labels=labels, headings="all")


def middle_and_range(
    ax: Axes, sheet: Sheet, mask: BoolArray, y: FloatArray, *, marks: Marks
) -> tuple[FloatArray, FloatArray]:
    """Median of many tests at each frequency, with a bar from the least to the largest; what was drawn."""
    groups = list(present(sheet.frequency, mask))
    frequency = sheet.values(q.FREQUENCY.head)
    x = np.array([frequency[mask & (sheet.frequency == group)].mean() for group in groups])
    parts = [y[mask & (sheet.frequency == group)] for group in groups]
    median = np.array([np.median(part) for part in parts])
    curve(ax, x, median, marks=marks)
    middle = np.array([0.5 * (part.max() + part.min()) for part in parts])
    half = np.array([0.5 * (part.max() - part.min()) for part in parts])
    bars(ax, x, middle, half, marks.colour)
    return median, np.abs(middle - median) + half


def _fullest(sheet: Sheet, own: BoolArray) -> tuple[int, int]:
    """The condition with the most tests; of equals the lowest load and the middle pressure."""
    counts = {}
    for load in present(sheet.load, own):
        for pressure in present(sheet.pressure, own & (sheet.load == load)):
            counts[(pressure, load)] = int(np.sum(own & (sheet.load == load) & (sheet.pressure == pressure)))
    best = max(counts.values())
    alike = [condition for condition, count in counts.items() if count == best]
    lowest = [condition for condition in alike if condition[1] == alike[0][1]]
    return lowest[len(lowest) // 2]
