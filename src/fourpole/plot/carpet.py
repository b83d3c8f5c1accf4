"""Figure 5: load against deflection as a lattice (carpet) plot, a panel per tyre."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import polars as pl
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from fourpole.plot.layout import Grid, Key, Notes
from fourpole.plot.names import counted, plain_text
from fourpole.plot.panels import tyre_heading
from fourpole.plot.sheet import read_sheet
from fourpole.plot.spec import FigureSpec
from fourpole.plot.statics import LoadLine, load_lines
from fourpole.plot.style import Style
from fourpole.study.results import Results


def load_deflection(results: Results, style: Style) -> Figure | None:
    """Curves of constant pressure with an offset in proportion to it, joined by lines of constant deflection."""
    sheet = read_sheet(results)
    lines = load_lines(results, sheet)
    if not lines:
        return None
    notes = Notes()
    rejected = results.static.filter(pl.col("verdict") == "rejected")["test"].n_unique()
    missing = len(set(results.static["test"].to_list()) - {line.test for line in lines})
    if rejected:
        count = counted(rejected, "static test")
        notes.say(f"{count} rejected" + (f", {missing} without a curve" if missing else ""))
    grey = sum(line.rejected for line in lines)
    if grey:
        notes.say(f"dotted grey: {grey} curves without K1" if grey > 1 else "dotted grey: a curve without K1")

    tyres = sorted({line.tyre for line in lines})
    columns = min(3, len(tyres))
    grid = Grid.of(len(tyres), columns, panel_height=3.4 if len(tyres) <= columns else 2.8, style=style)
    offset = _Offset.of(lines)
    top = max(float(line.load.max()) for line in lines)
    widest = max(float(line.deflection.max()) + offset(line.pressure) for line in lines)
    x_limits = style.xlim or (-0.03 * widest, 1.15 * widest)
    # Width of the label of a pressure in the units of the abscissa.
    room = 0.26 * columns / max(style.width - 1.0, 1.0) * abs(x_limits[1] - x_limits[0])
    for ax, tyre in zip(grid.panels, tyres, strict=True):
        own = [line for line in lines if line.tyre == tyre]
        carpet(ax, own, offset=offset, colour=style.colour(tyre), room=room, style=style)
        tyre_heading(ax, sheet.labels[tyre], style.colour(tyre), style=style, letters=60 // columns)
        ax.set_xlim(x_limits)
        ax.set_ylim(style.ylim or (0.0, 1.1 * top))
        ax.yaxis.set_major_locator(MaxNLocator(8, steps=[1, 2, 2.5, 5, 10]))
        ax.xaxis.set_major_locator(MaxNLocator(6, steps=[1, 2, 2.5, 5, 10]))
    several = offset.per_bar > 0
    x_label = "deflection [mm]"
    if several:
        x_label = "deflection + offset [mm]"
        notes.say(f"the offset is {offset.per_bar:.3g} mm per bar above {offset.start:.3g} bar")
        notes.say("each coloured curve is a pressure, each dark line a deflection: read the load at their crossing")
    notes.say("deflection counts from the point of zero load")
    return grid.finish(key=Key(), notes=notes, x_label=x_label, y_labels=["load [kN]"])


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


def carpet(ax: Axes, lines: Sequence[LoadLine], *, offset: _Offset, colour: str, room: float, style: Style) -> Axes:
    """Draw the lattice of one tyre.

    Parameters
    ----------
    ax : Axes
        The panel.
    lines : sequence of LoadLine
        The tyre's curves.
    offset : callable
        Shift of a curve [mm] by its pressure [Pa].
    colour : str
        Colour of the tyre.
    room : float
        Width of a label [mm]; of curves that are closer, only one is labelled.
    style : Style
        Theme.

    Returns
    -------
    Axes
        The same axes.
    """
    ordered = sorted(lines, key=lambda line: (np.isnan(line.pressure), line.pressure))
    for line in ordered:
        ax.plot(
            line.deflection + offset(line.pressure),
            line.load,
            color=style.look.muted if line.rejected else colour,
            linestyle="dotted" if line.rejected else "solid",
            linewidth=style.look.line if len(lines) <= 8 else 0.8,
            label="_constant pressure",
            zorder=2.5,
        )
    knots = [line for line in ordered if np.isfinite(line.pressure) and not line.rejected]
    if offset.per_bar > 0 and len({line.pressure for line in knots}) > 1:
        _cross_lines(ax, knots, offset, style)
    _pressure_labels(ax, ordered, offset, room)
    return ax


def _cross_lines(ax: Axes, lines: Sequence[LoadLine], offset: _Offset, style: Style) -> None:
    """Draw lines of constant deflection, each with a label at the highest pressure that reaches it."""
    reach = max(float(line.deflection.max()) for line in lines)
    levels = MaxNLocator(7, steps=[1, 2, 2.5, 5, 10]).tick_values(0.0, reach)
    for level in (float(value) for value in levels if 0 < value <= reach):
        held = [line for line in lines if line.deflection[0] <= level <= line.deflection[-1]]
        if not held:
            continue
        x = [level + offset(line.pressure) for line in held]
        y = [float(np.interp(level, line.deflection, line.load)) for line in held]
        ax.plot(x, y, color=style.look.ink, linewidth=0.8, marker=".", markersize=3.0, label="_constant deflection",
                zorder=2.2)  # fmt: skip
        # The label is on the right, or on the left if the curve of the highest pressure ends at a smaller deflection.
        right = held[-1] is lines[-1]
        at, shift, side = (-1, (4, -2), "left") if right else (0, (-4, 2), "right")
        ax.annotate(f"{level:g} mm", (x[at], y[at]), shift, textcoords="offset points", fontsize=6.8,
                    ha=side, va="top" if right else "bottom")  # fmt: skip


def _pressure_labels(ax: Axes, lines: Sequence[LoadLine], offset: _Offset, room: float) -> None:
    """Write the pressure at the upper end of each curve that has room for it."""
    stated = [line for line in lines if np.isfinite(line.pressure)]
    labelled: list[float] = []
    for line in [*stated[:1], *stated[:0:-1]]:
        shift = offset(line.pressure)
        if any(abs(shift - other) < room for other in labelled):
            continue
        # The lowest pressure is labelled first, the highest second; only the label of the highest has the unit.
        unit = " bar" if len(labelled) == 1 or len(stated) == 1 else ""
        labelled.append(shift)
        _end_label(ax, line, shift, f"{line.pressure * 1e-5:.3g}{unit}", (-6, 3) if unit else (0, 3))
    for line in lines:
        if np.isnan(line.pressure):
            _end_label(ax, line, 0.0, plain_text(line.test, 12), (0, 3))


def _end_label(ax: Axes, line: LoadLine, shift: float, text: str, off: tuple[float, float]) -> None:
    """Write a label at the upper end of a curve, `off` points from it."""
    end = (float(line.deflection[-1]) + shift, float(line.load[-1]))
    ax.annotate(text, end, off, textcoords="offset points", fontsize=6.8, ha="left" if off[0] else "center",
                va="bottom")  # fmt: skip


#: Figures of this module, in the order of a report.
FIGURES = (
    FigureSpec(
        "fig05",
        "Figure 5: static load against deflection",
        "Lattice of mean load-deflection curves: each curve is one pressure, each cross-line one deflection.",
        load_deflection,
        apart=True,
    ),
)
