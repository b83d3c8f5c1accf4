"""The figure of a plan: the expected uncertainty at each frequency, by each route and with each added mass."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import polars as pl
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from fourpole import quantities as q
from fourpole.core.plan import PLAN_ROUTES
from fourpole.io.write import write_bytes
from fourpole.plot.figure import figure_bytes
from fourpole.plot.layout import Grid, Key
from fourpole.plot.panels import numbered
from fourpole.plot.style import Dashes, Style, drawing, mixed

_KEY = "plan"
#: Title of the figure.
PLAN_TITLE = "Uncertainty to expect of K*, K2 and C"
_COLUMNS = ((q.K_STAR.relative_head, "K*"), (q.K2.relative_head, "K2"), (q.C.relative_head, "C"))
#: Heads of the uncertainty that K1 contributes, and of the value that it is divided by.
_OF_K1 = {"K2": (q.K2.u_head_from(q.K1), q.K2.head), "C": (q.C.u_head_from(q.K1), q.C.head)}
_K1_LINE: Dashes = (0.0, (6.0, 1.5, 1.5, 1.5))
_WANTED: Dashes = (0.0, (1.5, 1.5))
#: Colour of the palette, marker and dashes of each route as stated.
_LOOKS: dict[str, tuple[int, str, Dashes]] = {
    "mobility": (1, "o", (0.0, (4.0, 1.6))),
    "relative": (2, "^", (0.0, (5.0, 1.4, 1.0, 1.4))),
    "transmissibility": (3, "s", (0.0, (1.0, 1.3))),
    "joint": (0, "D", "solid"),
}
_MASS_MARKERS = ("v", "P", "X", "*", "<", ">")


@dataclass(frozen=True, eq=False)
class _Curve:
    """Rows of the plan that make one curve, with its label in the key and its look."""

    frame: pl.DataFrame
    label: str
    colour: str
    marker: str
    dashes: Dashes


def draw_plan(frame: pl.DataFrame, *, wanted: float | None = None, style: Style | None = None) -> Figure:
    """Draw the table of a plan.

    Parameters
    ----------
    frame : polars.DataFrame
        A table that `plan_table` returned.
    wanted : float [1], optional
        Relative standard uncertainty at which a line is drawn.
    style : Style, optional
        Theme and limits.

    Returns
    -------
    Figure
        A panel each for K*, K2 and C. Curves are medians if there are several conditions; a band shows the range over
        the conditions for the joint route with the rig as stated.
    """
    style = style or Style()
    with drawing(style, _KEY):
        grid = Grid.of(len(_COLUMNS), len(_COLUMNS), panel_height=2.9, style=style)
        key, notes = Key(), list[str]()
        curves = list(_curves(frame, style))
        one_condition = ["plan", "rig", "route", q.FREQUENCY.head, q.ADDED_MASS.head]
        several = bool(frame.select(one_condition).is_duplicated().any())
        left_by_k1 = bool(frame[q.K1.u_head].max())
        for ax, (column, name) in zip(grid.panels, _COLUMNS, strict=True):
            for curve in curves:
                _draw(ax, curve, column, several=several, style=style)
            if left_by_k1 and name in _OF_K1:
                _draw_k1(ax, frame, name, style)
            if wanted is not None:
                ax.axhline(100 * wanted, color=style.look.ink, linewidth=0.9, linestyle=_WANTED, zorder=1.5)
            ax.set_yscale("log")
            ax.set_title(f"u({name}) over {name}")
        _same_limits(grid.panels, style)
        for curve in curves:
            key.line(curve.label, curve.colour, marker=curve.marker, linestyle=curve.dashes)
        if left_by_k1:
            key.line("left by K1 alone", style.look.muted, 1.0, linestyle=_K1_LINE)
        if wanted is not None:
            key.line(f"wanted: {100 * wanted:g} %", style.look.ink, 0.9, linestyle=_WANTED)
        if several:
            notes.append("curves are medians over the conditions of the tyres, the band their range by the joint route")
        labels = ["standard uncertainty to expect (%)"]
        return grid.finish(key=key, notes=notes, x_label="frequency (Hz)", y_labels=labels)


def _curves(frame: pl.DataFrame, style: Style) -> Iterator[_Curve]:
    """A curve per route with the rig as stated, and one of the joint route per further plan."""
    plans = frame["plan"].unique(maintain_order=True).to_list()
    stated = frame.filter(pl.col("plan") == plans[0])
    routes = stated["route"].unique().to_list()
    for route in PLAN_ROUTES:
        if route in routes:
            colour, marker, dashes = _LOOKS[route]
            yield _Curve(stated.filter(pl.col("route") == route), route, style.colour(colour), marker, dashes)
    for rank, plan in enumerate(plans[1:]):
        bare = pl.col(q.ADDED_MASS.head) == 0  # K* of the tyre itself, which the mass serves
        added = frame.filter((pl.col("plan") == plan) & (pl.col("route") == "joint") & bare)
        if added.height:
            part = 0.2 + 0.55 * rank / max(len(plans) - 2, 1)
            colour_of_mass = mixed(style.colour(0), style.look.ink, part)
            marker = _MASS_MARKERS[rank % len(_MASS_MARKERS)]
            yield _Curve(added, f"joint, {plan} as well", colour_of_mass, marker, "solid")


def _draw(ax: Axes, curve: _Curve, column: str, *, several: bool, style: Style) -> None:
    """Draw the median over the conditions at each frequency; of the joint route as stated, the range, too."""
    percent = 100 * pl.col(column)
    rows = curve.frame.drop_nulls(column).group_by(q.FREQUENCY.head)
    by = rows.agg(middle=percent.median(), low=percent.min(), high=percent.max()).sort(q.FREQUENCY.head)
    x, middle, low, high = by.to_numpy().T
    ax.plot(x, middle, color=curve.colour, marker=curve.marker, linestyle=curve.dashes,
            markerfacecolor=style.look.paper, label="_curve")  # fmt: skip
    if several and curve.label == "joint":
        ax.fill_between(x, low, high, color=curve.colour, alpha=0.09, linewidth=0)


def _draw_k1(ax: Axes, frame: pl.DataFrame, name: str, style: Style) -> None:
    """Draw the relative uncertainty that K1 alone contributes."""
    over, under = _OF_K1[name]
    stated = frame.filter(pl.col("plan") == frame["plan"][0])
    by = stated.group_by(q.FREQUENCY.head).agg((pl.col(over) / pl.col(under)).median()).sort(q.FREQUENCY.head)
    ax.plot(
        by[q.FREQUENCY.head].to_numpy(), 100 * by[over].to_numpy(), color=style.look.muted, linewidth=1.0,
        linestyle=_K1_LINE, label="_k1", zorder=1.8,
    )  # fmt: skip


def _same_limits(panels: list[Axes], style: Style) -> None:
    """Give all panels the same ordinate."""
    seen = np.concatenate([np.asarray(line.get_ydata(), dtype=float) for ax in panels for line in ax.get_lines()])
    seen = seen[np.isfinite(seen) & (seen > 0)]
    if not seen.size:
        return
    low, high = style.ylim or (seen.min() / 1.4, seen.max() * 1.4)
    for ax in panels:
        ax.set(xlim=style.xlim or ax.get_xlim(), ylim=(low, high))
        numbered(ax, "y", most=5)


def plan_figure_svg(figure: Figure) -> str:
    """The figure that `draw_plan` returned as a whole SVG file."""
    return figure_bytes(figure, _KEY, PLAN_TITLE, "svg").decode()


def write_plan_figure(figure: Figure, path: str | Path, style: Style | None = None) -> Path:
    """Write the figure in one step; the same plan gives the same bytes.

    Parameters
    ----------
    figure : Figure
        A figure that `draw_plan` returned.
    path : path
        The file; its name ends in .svg, .png or .pdf.
    style : Style, optional
        The style that the figure was drawn with.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    CampaignError
        If the name has another ending.
    FileError
        If the file cannot be written.
    """
    path = Path(path)
    write_bytes(path, figure_bytes(figure, _KEY, PLAN_TITLE, path.suffix.lower().removeprefix("."), style))
    return path
