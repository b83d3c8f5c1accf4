"""Figures 6 to 13: C and K2 against pressure at constant frequency, and against frequency at constant pressure."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from fourpole import quantities as q
from fourpole.core.arrays import BoolArray
from fourpole.plot.layout import Grid, Key, Notes
from fourpole.plot.panels import Extent, Marks, curve, limit, rejected_tests, span, tyre_heading
from fourpole.plot.sheet import Sheet, present, read_sheet, spread
from fourpole.plot.style import Style, load_dashes, load_marker, pressure_marker
from fourpole.quantities import Quantity
from fourpole.study.results import Results

__all__ = ["against_frequency", "against_pressure"]

_MOST_PANELS = 12
_MOST_FREQUENCIES = 12
_MOST_PRESSURES = 8


def against_pressure(results: Results, style: Style, *, quantity: Quantity, high: bool) -> Figure | None:
    """C or K2 against pressure, a curve per frequency, a panel per tyre; of the low preload, or of all others."""
    sheet = read_sheet(results)
    return _figure(sheet, style, quantity, q.PRESSURE, high)


def against_frequency(results: Results, style: Style, *, quantity: Quantity, high: bool) -> Figure | None:
    """C or K2 against frequency, a curve per pressure, a panel per tyre; of the low preload, or of all others."""
    sheet = read_sheet(results)
    return _figure(sheet, style, quantity, q.FREQUENCY, high)


def _figure(sheet: Sheet, style: Style, quantity: Quantity, against: Quantity, high: bool) -> Figure | None:
    x, _ = sheet.shown(against)
    y, std = sheet.shown(quantity)
    visible = np.isfinite(x) & np.isfinite(y)
    loads = [load for load in range(len(sheet.loads)) if np.any(visible & (sheet.load == load))]
    chosen = loads[1:] if high else loads[:1]
    if not chosen:
        return None
    concerned = np.isin(sheet.load, chosen) | ~np.isin(sheet.load, loads)
    visible &= concerned
    notes, key = Notes(), Key()
    tyres = [tyre for tyre in range(len(sheet.names)) if np.any(visible & (sheet.tyre == tyre))]
    places = [(load, tyre) for load in chosen for tyre in tyres]
    notes.chosen(min(len(places), _MOST_PANELS), len(places), "pairs of tyre and preload are")
    places = places[:_MOST_PANELS]
    columns = min(3, len(tyres))
    grid = Grid.of(len(places), columns, panel_height=2.35 if len(places) <= columns else 1.9, style=style)

    used = visible & ~sheet.rejected
    extent = Extent(positive=True)
    extent.add(y[used], std[used])
    if extent.empty:
        extent.add(y[visible])
    x_limits, y_limits = span([x[visible]]), extent.limits()
    draw = _by_frequency if against is q.PRESSURE else _by_pressure
    drawn = draw(sheet, used, style, key, notes)
    for ax, (load, tyre) in zip(grid.panels, places, strict=True):
        here = (sheet.load == load) & (sheet.tyre == tyre)
        for group, marks in drawn(load, tyre):
            mask = here & used & group
            if np.any(mask):
                keys = sheet.pressure[mask] if against is q.PRESSURE else sheet.frequency[mask]
                curve(ax, x[mask], y[mask], marks=marks, std=std[mask], keys=keys.tolist())
        lost = here & visible & sheet.rejected
        rejected_tests(ax, x[lost], y[lost], style=style)
        tyre_heading(ax, sheet.labels[tyre], style.colour(tyre), sheet.name_of_load(load), style=style, columns=columns)
        limit(ax, x_limits, y_limits, style=style, ticks=6 if columns < 3 else 4)
    if np.any(visible & sheet.rejected):
        key.rejected(style)
    notes.tests(sheet.rejected[concerned], visible[concerned], quantity.name)
    notes.beyond(y[visible & sheet.rejected], style.ylim or y_limits, quantity.name)
    notes.cut(extent, y_limits, style)
    return grid.finish(key=key, notes=notes, x_label=against.label, y_labels=[quantity.label])


_Series = Callable[[int, int], Iterator[tuple[BoolArray, Marks]]]


def _by_frequency(sheet: Sheet, used: BoolArray, style: Style, key: Key, notes: Notes) -> _Series:
    """A curve per frequency, coloured on the sequential scale."""
    found = list(present(sheet.frequency, used & (sheet.frequency >= 0)))
    chosen = [found[at] for at in spread(len(found), _MOST_FREQUENCIES)]
    notes.chosen(len(chosen), len(found), "frequencies")
    values = [sheet.frequencies.values[group] for group in chosen]
    width = max(values) - min(values) if values else 0.0
    parts = [(value - min(values)) / width if width > 0 else 0.5 for value in values]
    colours = {group: style.frequency_colour(part) for group, part in zip(chosen, parts, strict=True)}
    for group in chosen:
        key.add(Line2D([], [], color=colours[group], linewidth=2.4), sheet.frequencies.labels[group])

    def series(load: int, _tyre: int) -> Iterator[tuple[BoolArray, Marks]]:
        for group in chosen:
            yield sheet.frequency == group, Marks(colours[group], load_marker(load), dashes=load_dashes(load))

    return series


def _by_pressure(sheet: Sheet, used: BoolArray, style: Style, key: Key, notes: Notes) -> _Series:
    """A curve per pressure in the colour of the tyre, with the marker of the pressure."""
    found = list(present(sheet.pressure, used))
    chosen = [found[at] for at in spread(len(found), _MOST_PRESSURES)]
    notes.chosen(len(chosen), len(found), "pressures")
    key.pressures(sheet, chosen, style)

    def series(load: int, tyre: int) -> Iterator[tuple[BoolArray, Marks]]:
        for group in chosen:
            yield sheet.pressure == group, tyre_marks(sheet, style, tyre, group, load)

    return series


def tyre_marks(sheet: Sheet, style: Style, tyre: int, pressure: int, load: int, *, joined: bool = True) -> Marks:
    """What stands for a tyre at a pressure and a load, in every figure."""
    face = style.face(tyre, pressure, len(sheet.pressures))
    return Marks(style.colour(tyre), pressure_marker(pressure), face, load_dashes(load), joined)
