"""The figure of a plan: the uncertainty to expect at each frequency, by each route and with each mass."""

from __future__ import annotations

import io
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from fourpole import quantities as q
from fourpole.core.plan import PLAN_ROUTES
from fourpole.errors import CampaignError
from fourpole.io.write import write_bytes
from fourpole.plot.layout import Grid, Key, Notes
from fourpole.plot.style import Dashes, Style, drawing, mixed

__all__ = ["draw_plan", "write_plan_figure"]

_KEY = "plan"
_TITLE = "Uncertainty to expect of K*, K2 and C"
_COLUMNS = ((q.K_STAR.relative_head, "K*"), (q.K2.relative_head, "K2"), (q.C.relative_head, "C"))
#: What K1 leaves, and what it is to be divided by.
_OF_K1 = {"K2": (q.K2.u_head_from(q.K1), q.K2.head), "C": (q.C.u_head_from(q.K1), q.C.head)}
_K1_LINE: Dashes = (0.0, (6.0, 1.5, 1.5, 1.5))
#: Colour of the palette, marker and dashes of each route as stated.
_LOOKS: dict[str, tuple[int, str, Dashes]] = {
    "mobility": (1, "o", (0.0, (4.0, 1.6))),
    "relative": (2, "^", (0.0, (5.0, 1.4, 1.0, 1.4))),
    "transmissibility": (3, "s", (0.0, (1.0, 1.3))),
    "joint": (0, "D", "solid"),
}
_MASS_MARKERS = ("v", "P", "X", "*", "<", ">")


@dataclass(frozen=True)
class _Curve:
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
        What `plan_table` gave.
    wanted : float [1], optional
        Relative uncertainty that is marked.
    style : Style, optional
        Theme and limits.

    Returns
    -------
    Figure
        A panel each for K*, K2 and C; where there are several conditions, their median and the range of the joint
        route as stated.
    """
    style = style or Style()
    with drawing(style, _KEY):
        grid = Grid.of(len(_COLUMNS), len(_COLUMNS), panel_height=2.9, style=style)
        key, notes = Key(), Notes()
        curves = list(_curves(frame, style))
        several = bool(
            (frame.group_by("plan", "rig", "route", q.FREQUENCY.head, q.ADDED_MASS.head).len()["len"] > 1).any()
        )
        left_by_k1 = bool(frame[q.K1.u_head].max())
        for ax, (column, name) in zip(grid.panels, _COLUMNS, strict=True):
            for curve in curves:
                _draw(ax, curve, column, several=several, style=style)
            if left_by_k1 and name in _OF_K1:
                _draw_k1(ax, frame, name, style)
            if wanted is not None:
                ax.axhline(100 * wanted, color=style.look.ink, linewidth=0.9, linestyle=(0.0, (1.5, 1.5)), zorder=1.5)
            _axes(ax, style)
            ax.set_title(f"u({name}) over {name}")
        _same_limits(grid.panels, style)
        for curve in curves:
            handle = Line2D([], [], color=curve.colour, marker=curve.marker, linestyle=curve.dashes)
            key.add(handle, curve.label)
        if left_by_k1:
            handle = Line2D([], [], color=style.look.muted, linewidth=1.0, linestyle=_K1_LINE)
            key.add(handle, "left by K1 alone")
        if wanted is not None:
            dots = Line2D([], [], color=style.look.ink, linewidth=0.9, linestyle=(0.0, (1.5, 1.5)))
            key.add(dots, f"wanted: {100 * wanted:g} %")
        if several:
            notes.say("curves are medians over the conditions of the tyres, the band their range by the joint route")
        return grid.finish(
            key=key,
            notes=notes,
            x_label="frequency (Hz)",
            y_labels=["standard uncertainty to expect (%)"],
            share_y=True,
        )


def _curves(frame: pl.DataFrame, style: Style) -> Iterator[_Curve]:
    plans = frame["plan"].unique(maintain_order=True).to_list()
    stated = frame.filter(pl.col("plan") == plans[0])
    routes = stated["route"].unique().to_list()
    for route in PLAN_ROUTES:
        if route in routes:
            colour, marker, dashes = _LOOKS[route]
            yield _Curve(stated.filter(pl.col("route") == route), route, style.colour(colour), marker, dashes)
    for rank, plan in enumerate(plans[1:]):
        added = frame.filter((pl.col("plan") == plan) & (pl.col("route") == "joint"))
        if added.height:
            part = 0.2 + 0.55 * rank / max(len(plans) - 2, 1)
            colour_of_mass = mixed(style.colour(0), style.look.ink, part)
            marker = _MASS_MARKERS[rank % len(_MASS_MARKERS)]
            yield _Curve(added, f"joint, {plan} as well", colour_of_mass, marker, "solid")


def _draw(ax: Axes, curve: _Curve, column: str, *, several: bool, style: Style) -> None:
    by = (
        curve.frame.drop_nulls(column)
        .group_by(q.FREQUENCY.head)
        .agg(
            pl.col(column).median().alias("middle"),
            pl.col(column).min().alias("low"),
            pl.col(column).max().alias("high"),
        )
        .sort(q.FREQUENCY.head)
    )
    x, middle, low, high = (by[name].to_numpy() for name in (q.FREQUENCY.head, "middle", "low", "high"))
    ax.plot(
        x, 100 * middle, color=curve.colour, marker=curve.marker, linestyle=curve.dashes,
        markerfacecolor=style.look.paper, label="_curve",
    )  # fmt: skip
    if several and curve.label == "joint":
        ax.fill_between(x, 100 * low, 100 * high, color=curve.colour, alpha=0.09, linewidth=0)


def _draw_k1(ax: Axes, frame: pl.DataFrame, name: str, style: Style) -> None:
    over, under = _OF_K1[name]
    stated = frame.filter(pl.col("plan") == frame["plan"][0])
    by = stated.group_by(q.FREQUENCY.head).agg((pl.col(over) / pl.col(under)).median()).sort(q.FREQUENCY.head)
    ax.plot(
        by[q.FREQUENCY.head].to_numpy(), 100 * by[over].to_numpy(), color=style.look.muted, linewidth=1.0,
        linestyle=_K1_LINE, label="_k1", zorder=1.8,
    )  # fmt: skip


def _axes(ax: Axes, style: Style) -> None:
    ax.set_yscale("log")
    ax.yaxis.set_major_locator(LogLocator(10.0, subs=(1.0,)))
    ax.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    ax.yaxis.set_minor_locator(LogLocator(10.0, subs=(2.0, 5.0)))
    ax.yaxis.set_minor_formatter(NullFormatter())
    ax.grid(visible=True, which="minor", axis="y", linewidth=0.35)
    if style.xlim is not None:
        ax.set_xlim(style.xlim)


def _same_limits(panels: list[Axes], style: Style) -> None:
    """The same ordinate on all panels, with numbers at 2 and 5 where there are few decades."""
    seen = np.concatenate([np.asarray(line.get_ydata(), dtype=float) for ax in panels for line in ax.get_lines()])
    seen = seen[np.isfinite(seen) & (seen > 0)]
    if not seen.size:
        return
    low, high = style.ylim or (seen.min() / 1.4, seen.max() * 1.4)
    for at, ax in enumerate(panels):
        ax.set_ylim(low, high)
        if high / low < 200 and at == 0:
            ax.yaxis.set_minor_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
            ax.tick_params(axis="y", which="minor", labelsize=7.5)


def write_plan_figure(figure: Figure, path: str | Path, style: Style | None = None) -> Path:
    """Write the figure in one step; the same plan gives the same bytes.

    Parameters
    ----------
    figure : Figure
        What `draw_plan` gave.
    path : path
        It ends in .svg or .png.
    style : Style, optional
        The one it was drawn with.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    CampaignError
        If the ending is another.
    FileError
        If the file cannot be written.
    """
    path = Path(path)
    form = path.suffix.lower().removeprefix(".")
    metadata: dict[str, dict[str, Any]] = {
        "svg": {"Date": None, "Creator": "fourpole", "Title": _TITLE},
        "png": {"Software": None, "Title": _TITLE},
    }
    if form not in metadata:
        raise CampaignError(f"no format {form!r} of a plan's figure: choose svg or png")
    content = io.BytesIO()
    with drawing(style or Style(), _KEY):
        figure.savefig(content, format=form, dpi=150, metadata=metadata[form])
    write_bytes(path, content.getvalue())
    return path
