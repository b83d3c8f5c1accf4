"""The figure of two compared results: both curves over frequency with their bands, and below the difference with U."""

from __future__ import annotations

from collections.abc import Sequence

import polars as pl
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from fourpole import quantities as q
from fourpole.core.confidence import COVERAGE_FACTOR
from fourpole.plot.layout import WIDTH, new_figure
from fourpole.plot.names import plain_text
from fourpole.plot.style import Style, drawing
from fourpole.quantities import Quantity

_HEIGHT, _LONGEST = 4.3, 40


def draw_compared(
    rows: pl.DataFrame, quantities: Sequence[Quantity], names: tuple[str, str], style: Style | None = None
) -> Figure:
    """Two quantities of one condition side by side.

    Parameters
    ----------
    rows : polars.DataFrame
        Rows of `fourpole.findings.compared.Compared` of one condition, by rising frequency.
    quantities : two of Quantity
        Those shown, with the unit shown.
    names : (str, str)
        Names of the first and of the second.
    style : Style, optional
        Theme and colours.
    """
    style = style or Style()
    with drawing(style, "compared"):
        figure = new_figure(WIDTH, _HEIGHT)
        grid = figure.subplots(2, 2, sharex=True, gridspec_kw={"height_ratios": (2.0, 1.0)})
        for column, quantity in enumerate(quantities):
            own = rows.filter(pl.col("quantity") == quantity.column)
            _curves(grid[0, column], own, quantity, names, style)
            _difference(grid[1, column], own, quantity, style)
            grid[1, column].set_xlabel(q.FREQUENCY.label)
        grid[0, 0].legend(loc="best", frameon=False, fontsize=8)
        figure.align_ylabels(grid)
        figure.tight_layout()
    return figure


def _curves(axes: Axes, rows: pl.DataFrame, quantity: Quantity, names: tuple[str, str], style: Style) -> None:
    """Both curves with a band of U about each."""
    frequency = rows[q.FREQUENCY.head].to_numpy()
    for at, (head, marker) in enumerate((("first", "o"), ("second", "s"))):
        value, u = (rows[one].to_numpy() / quantity.scale for one in (head, f"u({head})"))
        reach, colour = COVERAGE_FACTOR * u, style.colour(at)
        axes.fill_between(frequency, value - reach, value + reach, color=colour, alpha=0.2, linewidth=0)
        axes.plot(frequency, value, color=colour, marker=marker, markersize=4, label=plain_text(names[at], _LONGEST))
        if frequency.size == 1:  # a band has no width there
            axes.errorbar(frequency, value, yerr=reach, color=colour, capsize=3, linewidth=1)
    axes.set_ylabel(quantity.label)


def _difference(axes: Axes, rows: pl.DataFrame, quantity: Quantity, style: Style) -> None:
    """The difference with U, about the line of no difference."""
    value, u = (rows[one].to_numpy() / quantity.scale for one in ("difference", "u(difference)"))
    axes.axhline(0.0, color=style.look.muted, linewidth=0.8)
    frequency, colour, reach = rows[q.FREQUENCY.head].to_numpy(), style.look.ink, COVERAGE_FACTOR * u
    axes.errorbar(frequency, value, yerr=reach, fmt="o", color=colour, markersize=3.5, capsize=3, linewidth=1)
    axes.set_ylabel(f"difference [{quantity.shown}]")
