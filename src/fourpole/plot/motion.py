"""Transmissibility: figure 14, and measured against predicted."""

from __future__ import annotations

from itertools import combinations, product

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from fourpole import quantities as q
from fourpole.core.arrays import BoolArray, FloatArray
from fourpole.plot.layout import MOST_NAMED, Grid, Key, Notes
from fourpole.plot.panels import Extent, curve, extent_of, limit, rejected_tests, span
from fourpole.plot.properties import tyre_marks
from fourpole.plot.sheet import Sheet, means, present, read_sheet
from fourpole.plot.spec import FigureSpec
from fourpole.plot.style import Style
from fourpole.study.results import Results

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


def mark_crossings(ax: Axes, found: list[tuple[float, float, str]], *, style: Style) -> Axes:
    """Draw a thin line down from each crossing, and write their frequencies [Hz] into the lower left corner."""
    if not found:
        return ax
    for x, y, _ in found:
        ax.plot([x, x], [0.0, y], color=style.look.ink, linewidth=0.7, linestyle=(0, (2, 2)), label="_crossing")
    text = "\n".join(["the curves cross at", *(f"{x:.1f} Hz{where}" for x, _, where in found)])
    # Below the resonance TR is above 1, so no curve reaches the lower left corner.
    ax.text(0.025, 0.03, text, transform=ax.transAxes, fontsize=style.font(7.0), va="bottom", linespacing=1.25,
            bbox={"facecolor": style.look.paper, "edgecolor": "none", "pad": 1.5})  # fmt: skip
    return ax


def transmissibility(results: Results, style: Style) -> Figure | None:
    """TR against frequency at the pressures nearest to 1.00 and 1.68 bar, a panel per preload and setting."""
    sheet = read_sheet(results)
    notes, key = Notes(), Key()
    quantity = q.TR_MEASURED
    y, std = sheet.shown(quantity)
    if not np.any(np.isfinite(y)):
        quantity = q.TR_PREDICTED
        y, std = sheet.shown(quantity)
        notes.say("predicted from K* and the rig: V2 was not measured")
    x, _ = sheet.shown(q.FREQUENCY)
    bare, said = sheet.bare("TR")
    visible = np.isfinite(x) & np.isfinite(y) & bare
    if not np.any(visible):
        return None
    notes.say(said)
    pressures = _pressures(sheet, visible)
    concerned = np.isin(sheet.pressure, pressures) & bare
    found = list(present(sheet.pressure, visible))
    notes.chosen(len(pressures), len(found), "pressures")
    visible &= concerned
    used, lost = visible & ~sheet.rejected, visible & sheet.rejected
    places = sorted(set(zip(sheet.load[visible].tolist(), sheet.setting[visible].tolist(), strict=True)))
    places = notes.first(places, _MOST_PANELS, "settings")
    settings = len({setting for _, setting in places})
    columns = min(3, settings if settings > 1 else len(places) if len(places) != 4 else 2)
    grid = Grid.of(len(places), columns, panel_height=2.9 if len(places) <= columns else 2.2, style=style)
    extent = extent_of(y, std, used, visible, positive=True)
    limits = extent.limits(zero=True)
    tyres = list(present(sheet.tyre, visible))
    for ax, (load, setting) in zip(grid.panels, places, strict=True):
        here = sheet.where(load=load, setting=setting)
        for tyre, pressure in product(tyres, pressures):
            mask = used & here & sheet.where(tyre=tyre, pressure=pressure)
            marks = tyre_marks(sheet, style, tyre, pressure, load)
            curve(ax, x[mask], y[mask], marks=marks, std=std[mask], keys=sheet.frequency[mask].tolist())
        rejected_tests(ax, x[here & lost], y[here & lost], style=style)
        mark_crossings(ax, _crossings(sheet, x, y, used & here, tyres, pressures), style=style)
        parts = [sheet.name_of_load(load), sheet.settings[setting] if settings > 1 else ""]
        ax.set_title(", ".join(part for part in parts if part), loc="left", pad=4.5)
        limit(ax, span([x[visible]]), limits, style=style, ticks=6 if columns < 3 else 4)
    key.tyres(sheet, tyres, style)
    key.pressures(sheet, pressures, style)
    key.loads(sheet, list(dict.fromkeys(load for load, _ in places)), style)
    key.rejected(style, lost)
    notes.tests(sheet.rejected[concerned], visible[concerned], "TR")
    notes.outside(extent, limits, style, y[lost], "TR")
    return grid.finish(key=key, notes=notes, x_label=q.FREQUENCY.label, y_labels=[quantity.label])


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


def measured_against_predicted(results: Results, style: Style) -> Figure | None:
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
    notes, key = Notes(), Key()
    grid = Grid.of(2, 2, panel_height=2.75, style=style)
    left, right = grid.panels
    tyres, pressures = list(present(sheet.tyre, visible)), list(present(sheet.pressure, visible))
    for tyre, pressure in product(tyres, pressures):
        mask = used & sheet.where(tyre=tyre, pressure=pressure)
        marks = tyre_marks(sheet, style, tyre, pressure, 0, joined=False)
        curve(left, predicted[mask], measured[mask], marks=marks)
        curve(right, frequency[mask], difference[mask], marks=marks, std=difference_std[mask])
    rejected_tests(left, predicted[lost], measured[lost], style=style)
    rejected_tests(right, frequency[lost], difference[lost], style=style)
    shown = used if np.any(used) else visible
    both, extent = Extent(), Extent()
    both.add(np.concatenate([measured[shown], predicted[shown]]))
    extent.add(np.append(difference[shown], 0.0), np.append(difference_std[shown], 0.0))
    ends = both.limits()
    left.plot(ends, ends, color=style.look.ink, linewidth=0.8, label="_equal", zorder=1.0)
    right.axhline(0.0, color=style.look.ink, linewidth=0.8, zorder=1.0)
    limit(left, ends, ends, style=style)
    free = Style(style.theme)
    limit(right, span([frequency[shown]]), extent.limits(), style=free)
    key.tyres(sheet, tyres, style)
    key.pressures(sheet, pressures, style)
    key.rejected(style, lost)
    notes.tests(sheet.rejected, visible, "TR measured and predicted")
    notes.outside(extent, extent.limits(), free, difference[lost], "the difference")
    if len(pressures) > MOST_NAMED:
        notes.say("the key names some of the pressures")
    figure = grid.finish(
        key=key, notes=notes, x_label=q.TR_PREDICTED.label, y_labels=[q.TR_MEASURED.label], share_x=False, share_y=False
    )
    right.set_xlabel(q.FREQUENCY.label)
    right.set_ylabel("TR measured less predicted [% of predicted]")
    return figure


#: Figures of this module, in the order of a report.
FIGURES = (
    FigureSpec(
        "fig14",
        "Figure 14: transmissibility against frequency",
        "The ratio TR of the motions above and below the tyre at two pressures, with the frequencies at which "
        "the tyres' curves cross.",
        transmissibility,
        apart=True,
    ),
    FigureSpec(
        "tr-measured-predicted",
        "Transmissibility measured and predicted",
        "TR from V2 and V1 against TR from K* and the rig as stated, and their difference against frequency.",
        measured_against_predicted,
        apart=True,
    ),
)
