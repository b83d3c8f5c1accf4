"""The figure of a Prony series: K' and K'' over the band, and below them the stiffness of each arm at its time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from fourpole import quantities as q
from fourpole.core.arrays import ByValue, FloatArray
from fourpole.errors import ModelError
from fourpole.fitting.modelfile import model_of
from fourpole.plot.fitted import Drawn, conditions_of, curves_of
from fourpole.plot.layout import Grid, Key, Notes
from fourpole.plot.models import heading, share
from fourpole.plot.names import plain_text
from fourpole.plot.panels import Marks, band, curve, numbered
from fourpole.plot.sheet import Sheet, read_sheet
from fourpole.plot.spec import FigureSpec
from fourpole.plot.style import Style
from fourpole.study.results import Results

_MOST_COLUMNS = 3
#: Least number of arms with a stiffness above zero that make a spectrum.
_FEWEST = 3
#: Decades of stiffness below the stiffest arm that are shown.
_DEEP = 5.0


@dataclass(frozen=True, eq=False)
class _Spectrum(ByValue):
    """Arms of one condition: 1/(2 pi tau) [Hz], stiffness and the ends of its 95 % interval in the unit of K'."""

    frequency: FloatArray
    springs: FloatArray
    low: FloatArray
    high: FloatArray


def spectrum(results: Results, style: Style) -> Figure | None:
    """K', K'' and the relaxation spectrum of the first condition of each tyre whose model is a Prony series."""
    if results.models is None:
        return None
    sheet = read_sheet(results, texts_only=True)
    every = [conditions_of(entry, sheet, results.models) for entry in results.models.models]
    found = [(one[0], arms) for one in every if one and (arms := _arms(one[0])) is not None]
    if not found:
        return None
    notes, key = Notes(), Key()
    found = notes.first(found, _MOST_COLUMNS, "tyres")
    if any(len(one) > 1 for one in every):
        notes.say("the first condition of each tyre is shown")
    columns = len(found)
    grid = Grid.of(3 * columns, columns, panel_height=1.5, style=style)
    for column, (one, arms) in enumerate(found):
        panels = [grid.panels[row * columns + column] for row in range(3)]
        _draw(panels, one, arms, sheet, style)
        _decades(panels, one, arms)
        heading(panels[0], sheet, one.entry.model, one.tyre, sheet.name_of_load(one.load), style, columns)
        discrepancy = f", model discrepancy {share(one.entry.discrepancy)}" if one.entry.discrepancy > 0 else ""
        name = f"{sheet.labels[one.tyre]}: " if sheet.names[one.tyre] else ""
        key.line(f"{name}{plain_text(one.entry.model)}{discrepancy}", style.colour(one.tyre), 2.6)
    key.band(style)
    key.line("95 % interval of K_i", style.look.muted, 3.0, alpha=0.5)
    if any((arms.springs == 0).any() for _, arms in found):
        key.marker("K_i = 0: upper end of its interval", "v", style.look.muted, style.look.paper, markersize=3.5)
    notes.say("each arm stands at the frequency 1/(2π τ_i) of its relaxation time")
    labels = [q.STORAGE.label, q.LOSS.label, q.STORAGE.label.replace("K'", "K_i", 1)]
    return grid.finish(
        key=key, notes=notes, x_label="frequency, or 1/(2π τ) [Hz]", y_labels=labels, share_y=False, headings="top"
    )


def _arms(one: Drawn) -> _Spectrum | None:
    """The arms of a condition with their intervals; None if its model is no Prony series of several arms."""
    model, condition = model_of(one.entry), one.entry.conditions[one.at]
    try:
        arms = model.prony(condition.values)
    except ModelError:
        return None
    if np.sum(arms.springs > 0) < _FEWEST:
        return None
    places = [model.symbols.index(f"K_{at + 1}") for at in range(arms.springs.size)]
    ends = [condition.intervals[place] for place in places]
    return _Spectrum(
        1.0 / (2.0 * np.pi * arms.times),
        arms.springs / q.STORAGE.scale,
        np.array([0.0 if low is None else low for low, _ in ends]) / q.STORAGE.scale,
        np.array([np.nan if high is None else high for _, high in ends]) / q.STORAGE.scale,
    )


def _draw(panels: list[Axes], one: Drawn, arms: _Spectrum, sheet: Sheet, style: Style) -> None:
    """Draw K' and K'' with the model's line and band, and the arms as stems with their intervals."""
    drawn, colour = curves_of(one, sheet), style.colour(one.tyre)
    marks = Marks(colour, "o", style.look.paper, joined=False)
    for ax, values, std, line, half in zip(panels, drawn.values, drawn.stds, drawn.line, drawn.half, strict=False):
        curve(ax, drawn.frequency, values, marks=marks, std=std)
        band(ax, drawn.grid, line, np.minimum(half, (1 - 1e-6) * line), colour)
        ax.plot(drawn.grid, line, color=colour, linewidth=1.1, label="_model", zorder=3.0)
        positive = np.concatenate([values[values > 0], line[line > 0]])
        ax.set_ylim(positive.min() / 1.6, positive.max() * 1.6)
    ax = panels[2]
    floor = arms.springs.max() / 10**_DEEP
    active, high = arms.springs > 0, np.maximum(arms.high, floor)
    low = np.maximum(arms.low, floor)
    ax.vlines(arms.frequency[active], low[active], high[active], colors=colour, linewidth=3.0, alpha=0.35,
              label="_interval", zorder=1.5)  # fmt: skip
    ax.vlines(arms.frequency[active], floor, arms.springs[active], colors=colour, linewidth=0.9, label="_stem")
    ax.plot(arms.frequency[active], arms.springs[active], linestyle="none", marker="o", markersize=3.2, color=colour,
            label="_arm", zorder=3.0)  # fmt: skip
    ax.plot(arms.frequency[~active], high[~active], linestyle="none", marker="v", markersize=3.5, color=colour,
            markerfacecolor=style.look.paper, label="_zero", zorder=2.0)  # fmt: skip
    ends = np.concatenate([arms.springs[active], high[np.isfinite(high)]])
    ax.set_ylim(max(floor, ends[ends > floor].min() / 4.0), ends.max() * 1.8)


def _decades(panels: list[Axes], one: Drawn, arms: _Spectrum) -> None:
    """Make all axes logarithmic, over the band and the arms."""
    low, high = min(one.band[0], arms.frequency.min()), max(one.band[1], arms.frequency.max())
    room = (high / low) ** 0.03
    for ax in panels:
        limits = ax.get_ylim()
        ax.set_xscale("log")
        ax.set_yscale("log")
        ax.set_xlim(low / room, high * room)
        ax.set_ylim(limits)
        numbered(ax, "x", most=6)
        numbered(ax, "y", most=5)


#: Figures of this module, in the order of a report.
FIGURES = (
    FigureSpec(
        "spectrum",
        "The relaxation spectrum",
        "K' and K'' of a condition with the Prony series and its 95 % band, and the stiffness K_i of each arm at its "
        "relaxation time with its 95 % interval.",
        spectrum,
    ),
)
