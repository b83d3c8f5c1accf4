"""Figures 6 to 13: C and K2 against pressure at constant frequency, and against frequency at constant pressure."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from itertools import product

import numpy as np

from fourpole import quantities as q
from fourpole.core.arrays import BoolArray
from fourpole.plot.data import MOST_LABELLED, AxisData, FigureData, Panel, Role, Scale, Series, look
from fourpole.plot.marks import curve_of, pressure_key, rejected_of, tyre_look
from fourpole.plot.sheet import Sheet, few, leading, present, read_sheet, tests_said
from fourpole.quantities import Quantity
from fourpole.study.study import Study

_MOST_PANELS = 12
_MOST_FREQUENCIES = 12


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
    places = leading(pairs, _MOST_PANELS, "pairs of tyre and preload are", notes)
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


#: The figures of this module by their keys in catalogue.toml: C and then K2, each against pressure and then frequency,
#: each at low and then high preload.
FIGURES = {
    f"fig{number:02d}": partial(property_figure, quantity=quantity, against=against, high=high)
    for number, (quantity, against, high) in enumerate(
        product((q.C, q.K2), (q.PRESSURE, q.FREQUENCY), (False, True)), start=6
    )
}
