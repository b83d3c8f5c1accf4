"""Figures 6 to 13: C and K2 against pressure at constant frequency, and against frequency at constant pressure."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from itertools import product

import numpy as np
from matplotlib.figure import Figure

from fourpole import quantities as q
from fourpole.core.arrays import BoolArray
from fourpole.plot.layout import Grid, Key, Notes
from fourpole.plot.panels import Marks, curve, extent_of, limit, rejected_tests, span, tyre_heading
from fourpole.plot.sheet import Sheet, present, read_sheet
from fourpole.plot.spec import FigureSpec
from fourpole.plot.style import Style, load_dashes, load_marker, pressure_marker
from fourpole.quantities import Quantity
from fourpole.study.results import Results

_MOST_PANELS = 12
_MOST_FREQUENCIES = 12
_MOST_PRESSURES = 8


def property_figure(
    results: Results, style: Style, *, quantity: Quantity, against: Quantity, high: bool
) -> Figure | None:
    """A quantity against pressure, a curve per frequency, or against frequency, a curve per pressure.

    A panel per tyre and preload; with `high`, of all preloads but the lowest, otherwise of the lowest.
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
    notes, key = Notes(), Key()
    tyres = list(present(sheet.tyre, visible))
    places = notes.first([(load, tyre) for load in chosen for tyre in tyres], _MOST_PANELS,
                         "pairs of tyre and preload are")  # fmt: skip
    columns = min(3, len(tyres))
    grid = Grid.of(len(places), columns, panel_height=2.35 if len(places) <= columns else 1.9, style=style)
    extent = extent_of(y, std, used, visible, positive=True)
    x_limits, y_limits = span([x[visible]]), extent.limits()
    by_frequency = against is q.PRESSURE
    curves_of = (_by_frequency if by_frequency else _by_pressure)(sheet, used, style, key, notes)
    keys = sheet.pressure if by_frequency else sheet.frequency
    for ax, (load, tyre) in zip(grid.panels, places, strict=True):
        here = sheet.where(load=load, tyre=tyre)
        for group, marks in curves_of(load, tyre):
            mask = here & used & group
            curve(ax, x[mask], y[mask], marks=marks, std=std[mask], keys=keys[mask].tolist())
        rejected_tests(ax, x[here & lost], y[here & lost], style=style)
        tyre_heading(
            ax, sheet.labels[tyre], style.colour(tyre), sheet.name_of_load(load), style=style, letters=60 // columns
        )
        limit(ax, x_limits, y_limits, style=style, ticks=6 if columns < 3 else 4)
    key.rejected(style, lost)
    notes.tests(sheet.rejected[concerned], visible[concerned], quantity.name)
    notes.outside(extent, y_limits, style, y[lost], quantity.name)
    return grid.finish(key=key, notes=notes, x_label=against.label, y_labels=[quantity.label])


#: The tests of each curve of one preload and tyre, and the marks of the curve.
_Series = Callable[[int, int], Iterator[tuple[BoolArray, Marks]]]


def _by_frequency(sheet: Sheet, used: BoolArray, style: Style, key: Key, notes: Notes) -> _Series:
    """A curve per frequency, coloured on the sequential scale."""
    chosen = notes.some(list(present(sheet.frequency, used & (sheet.frequency >= 0))), _MOST_FREQUENCIES, "frequencies")
    values = [sheet.frequencies.values[group] for group in chosen]
    width = max(values) - min(values) if values else 0.0
    parts = [(value - min(values)) / width if width > 0 else 0.5 for value in values]
    colours = {group: style.frequency_colour(part) for group, part in zip(chosen, parts, strict=True)}
    for group in chosen:
        key.line(sheet.frequencies.labels[group], colours[group], 2.4)

    def series(load: int, _tyre: int) -> Iterator[tuple[BoolArray, Marks]]:
        for group in chosen:
            yield sheet.frequency == group, Marks(colours[group], load_marker(load), dashes=load_dashes(load))

    return series


def _by_pressure(sheet: Sheet, used: BoolArray, style: Style, key: Key, notes: Notes) -> _Series:
    """A curve per pressure in the colour of the tyre, with the marker of the pressure."""
    chosen = notes.some(list(present(sheet.pressure, used)), _MOST_PRESSURES, "pressures")
    key.pressures(sheet, chosen, style)

    def series(load: int, tyre: int) -> Iterator[tuple[BoolArray, Marks]]:
        for group in chosen:
            yield sheet.pressure == group, tyre_marks(sheet, style, tyre, group, load)

    return series


def tyre_marks(sheet: Sheet, style: Style, tyre: int, pressure: int, load: int, *, joined: bool = True) -> Marks:
    """Colour, marker, fill and line style of a tyre at a pressure and a preload, the same in every figure."""
    face = style.face(tyre, pressure, len(sheet.pressures))
    return Marks(style.colour(tyre), pressure_marker(pressure), face, load_dashes(load), joined)


#: Figures 6 to 13 plot C and then K2, each against pressure and then frequency, each at low and then high preload.
FIGURES = tuple(
    FigureSpec(
        f"fig{number:02d}",
        f"Figure {number}: {words} against {against.name}, {'high' if high else 'low'} preload",
        f"The {words} of each tyre against {against.name}, each curve at {curves}; "
        f"{'the higher preloads' if high else 'the lowest preload'}, bars of one standard uncertainty.",
        partial(property_figure, quantity=quantity, against=against, high=high),
        apart=True,
    )
    for number, ((quantity, words), (against, curves), high) in enumerate(
        product(
            ((q.C, "damping coefficient C"), (q.K2, "dynamic stiffness K2")),
            ((q.PRESSURE, "constant frequency"), (q.FREQUENCY, "constant pressure")),
            (False, True),
        ),
        start=6,
    )
)
