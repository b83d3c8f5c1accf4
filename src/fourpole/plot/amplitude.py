"""The figure of a model over the amplitude of the deflection: K' and K'' at a few frequencies, and the tests."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from fourpole import quantities as q
from fourpole.core.arrays import FloatArray
from fourpole.core.condition import FREQUENCY
from fourpole.core.confidence import NORMAL_95
from fourpole.fitting.amplitude import amplitudes_of
from fourpole.fitting.query import response
from fourpole.plot.fitted import Drawn, conditions_of
from fourpole.plot.layout import Grid, Key, Notes
from fourpole.plot.models import heading, model_of
from fourpole.plot.names import plain_text
from fourpole.plot.panels import Marks, band, curve, numbered
from fourpole.plot.sheet import Sheet, read_sheet, spread
from fourpole.plot.spec import FigureSpec
from fourpole.plot.style import Style
from fourpole.study.results import Results

_MOST_COLUMNS, _FREQUENCIES, _GRID = 3, 4, 81
_QUANTITIES = (q.STORAGE, q.LOSS)


def over_amplitude(results: Results, style: Style) -> Figure | None:
    """K' and K'' over the amplitude of the deflection, for each condition of a model whose K* depends on it."""
    if results.models is None:
        return None
    sheet = read_sheet(results, texts_only=True)
    every = [one for entry in results.models.models for one in conditions_of(entry, sheet, results.models)]
    found = list({(one.entry.tyre, one.at): one for one in every if one.amplitude is not None}.values())
    if not found:
        return None
    notes, key = Notes(), Key()
    found = notes.first(found, _MOST_COLUMNS, "conditions")
    columns = len(found)
    groups = _frequencies(found, sheet)
    colours = [style.frequency_colour(at / max(len(groups) - 1, 1)) for at in range(len(groups))]
    grid = Grid.of(2 * columns, columns, panel_height=2.0, style=style)
    for column, one in enumerate(found):
        panels = [grid.panels[row * columns + column] for row in range(2)]
        for frequency, colour in zip(groups, colours, strict=True):
            if one.band[0] * (1 - FREQUENCY.relative) <= frequency <= one.band[1] * (1 + FREQUENCY.relative):
                _draw(panels, one, frequency, sheet, Marks(colour, "o", style.look.paper, joined=False))
        _decades(panels, one)
        heading(panels[0], sheet, one.entry.model, one.tyre, sheet.name_of_load(one.load), style, columns)
    for tyre, entry in {one.tyre: one.entry for one in found}.items():
        key.line(f"{model_of(sheet, tyre)}{plain_text(entry.model)}", style.colour(tyre), 2.6)
    for frequency, colour in zip(groups, colours, strict=True):
        key.line(f"{frequency:.3g} Hz", colour, 2.4)
    key.band(style)
    labels = [one.label for one in _QUANTITIES]
    return grid.finish(
        key=key, notes=notes, x_label=q.DEFLECTION_AMPLITUDE.label, y_labels=labels, share_y=False, headings="top"
    )


def _frequencies(found: Sequence[Drawn], sheet: Sheet) -> list[float]:
    """A few of the tested frequencies [Hz], rising."""
    own = sheet.values(q.FREQUENCY.head)[np.any([_rows(one, sheet) for one in found], axis=0)]
    label = FREQUENCY.groups(own.tolist())
    tested = [float(np.median(own[label == one])) for one in np.unique(label)]
    return [tested[at] for at in spread(len(tested), _FREQUENCIES)]


def _rows(one: Drawn, sheet: Sheet) -> np.ndarray:
    """The rows that the whole condition was fitted to, all amplitudes together."""
    names = set(one.entry.conditions[one.at].tests)
    there = sheet.tyre == one.tyre
    return there & np.isin(sheet.table["test"].to_list(), list(names)) if names else there


def _draw(panels: Sequence[Axes], one: Drawn, frequency: float, sheet: Sheet, marks: Marks) -> None:
    """Draw the model with its band over the tested amplitudes at one frequency [Hz], and the tests there."""
    grid = np.geomspace(*_range(one), _GRID)
    line, covariance = response(one.entry, one.at, np.full(_GRID, frequency), grid)
    half = NORMAL_95 * np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
    tested = sheet.values(q.FREQUENCY.head)
    rows = np.flatnonzero(_rows(one, sheet) & (np.abs(tested - frequency) <= FREQUENCY.relative * frequency))
    at, shown = amplitudes_of(sheet.table)[rows], q.DEFLECTION_AMPLITUDE.scale
    for row, (ax, quantity, part) in enumerate(zip(panels, _QUANTITIES, (line.real, line.imag), strict=True)):
        values, std = (each[rows] for each in sheet.shown(quantity))
        curve(ax, at / shown, values, marks=marks, std=std)
        band(ax, grid / shown, part / quantity.scale, half[:, row] / quantity.scale, marks.colour)
        ax.plot(grid / shown, part / quantity.scale, color=marks.colour, linewidth=1.1, label="_model", zorder=2.0)


def _range(one: Drawn) -> tuple[float, float]:
    """Lowest and highest amplitude fitted [m]."""
    tested = one.entry.conditions[one.at].amplitude
    assert tested is not None  # `over_amplitude` has left out the others
    return tested[0], tested[-1]


def _decades(panels: Sequence[Axes], one: Drawn) -> None:
    """Make the axis of the amplitude logarithmic, and the ordinates as high as what they show."""
    ends: FloatArray = np.array(_range(one)) / q.DEFLECTION_AMPLITUDE.scale
    room = max(float(ends[1] / ends[0]) ** 0.04, 1.02)
    for ax in panels:
        ax.set_xscale("log")
        ax.set_xlim(ends[0] / room, ends[1] * room)
        numbered(ax, "x", most=6)


#: Figures of this module, in the order of a report.
FIGURES = (
    FigureSpec(
        "amplitude",
        "The model over the amplitude of the deflection",
        "K' and K'' of a condition over the 0-to-peak amplitude of the deflection: the model's line with its 95 % "
        "band, and the tests with standard uncertainties; each colour is a frequency.",
        over_amplitude,
    ),
)
