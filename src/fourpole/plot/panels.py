"""Panels: what one pair of axes shows. Axes in, axes out; values in the units of the axes."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

from fourpole.core.arrays import ByValue, FloatArray
from fourpole.plot.style import Dashes, Marker, Style, plain_text

__all__ = ["Extent", "Marks", "bars", "curve", "means", "rejected_tests", "span", "tyre_heading"]


_MOST_MARKERS = 60


@dataclass(frozen=True)
class Marks:
    """How a series is drawn."""

    colour: str
    marker: Marker = "o"
    face: str | None = None
    dashes: Dashes = "solid"
    joined: bool = True


@dataclass(eq=False)
class Extent(ByValue):
    """Values that panels show, to choose axes that hold them, and what does not fit.

    Of a `positive` quantity, values smaller than their uncertainty are known to nothing and set no axis.
    """

    positive: bool = False
    values: list[FloatArray] = field(default_factory=list)
    bars: list[FloatArray] = field(default_factory=list)

    def add(self, values: FloatArray, bars: FloatArray | None = None) -> None:
        """Take in the values of a series and their uncertainties."""
        known = np.isfinite(values)
        self.values.append(values[known])
        self.bars.append(np.zeros(int(known.sum())) if bars is None else np.nan_to_num(bars[known]))

    @property
    def empty(self) -> bool:
        """Whether nothing was taken in."""
        return not any(values.size for values in self.values)

    def limits(self, zero: bool = False) -> tuple[float, float]:
        """Axis limits: on the values; bars count only where they are not longer than the span of the values."""
        if self.empty:
            return 0.0, 1.0
        values, bars = np.concatenate(self.values), np.concatenate(self.bars)
        sure = bars < np.abs(values)
        if self.positive and np.any(sure):
            values, bars = values[sure], bars[sure]
        low, high = float(values.min()), float(values.max())
        reach = max(high - low, 0.1 * max(abs(low), abs(high)), 1e-12)
        fits = bars <= reach
        if np.any(fits):
            low, high = min(low, float((values - bars)[fits].min())), max(high, float((values + bars)[fits].max()))
        if zero:
            low = min(low, 0.0)
        width = max(high - low, reach)
        pad_low = 0.0 if zero and low == 0.0 else 0.06
        if high - low < reach:
            middle = 0.5 * (low + high)
            low, high = (low if zero else middle - 0.5 * reach), middle + 0.5 * reach
        return low - pad_low * width, high + 0.06 * width

    def outside(self, limits: tuple[float, float]) -> tuple[int, int]:
        """How many values, and how many bars of the other values, leave the limits."""
        if self.empty:
            return 0, 0
        values, bars = np.concatenate(self.values), np.concatenate(self.bars)
        low, high = min(limits), max(limits)
        slack = 1e-9 * (high - low)
        inside = (values >= low - slack) & (values <= high + slack)
        cut = inside & ((values - bars < low - slack) | (values + bars > high + slack))
        return int(np.sum(~inside)), int(np.sum(cut))


def means(x: FloatArray, y: FloatArray, keys: Iterable[int] | None = None) -> tuple[FloatArray, FloatArray]:
    """Mean of the points that share a condition, in rising order of x: the line through repeats."""
    known = np.isfinite(x) & np.isfinite(y)
    if keys is None:
        x, y = x[known], y[known]
    else:
        groups = np.asarray(list(keys))[known]
        _, place = np.unique(groups, return_inverse=True)
        count = np.bincount(place) if place.size else np.ones(0)
        x = np.bincount(place, x[known]) / count if place.size else x[known]
        y = np.bincount(place, y[known]) / count if place.size else y[known]
    order = np.argsort(x, kind="stable")
    return x[order], y[order]


def curve(
    ax: Axes,
    x: FloatArray,
    y: FloatArray,
    *,
    marks: Marks,
    std: FloatArray | None = None,
    keys: Iterable[int] | None = None,
) -> Axes:
    """Points with bars of one standard uncertainty, and a line through the mean at each condition.

    Parameters
    ----------
    ax : Axes
        Where to draw.
    x, y : (N,) float arrays
        Not-a-number is left out.
    marks : Marks
        Colour, marker and line.
    std : (N,) float array, optional
        Standard uncertainty of `y`.
    keys : (N,) ints, optional
        Points of equal key are repeats of one condition.

    Returns
    -------
    Axes
        The same axes.
    """
    known = np.isfinite(x) & np.isfinite(y)
    if not np.any(known):
        return ax
    if std is not None:
        bars(ax, x[known], y[known], std[known], marks.colour)
    if marks.joined:
        ax.plot(*means(x, y, keys), color=marks.colour, linestyle=marks.dashes, marker="", label="_line", zorder=2.0)
    if marks.marker:
        order = np.argsort(x[known], kind="stable")
        # A sweep of hundreds of points is a line: then a marker here and there tells which.
        every = 1 if order.size <= _MOST_MARKERS or not marks.joined else -(-order.size // _MOST_MARKERS)
        ax.plot(
            x[known][order],
            y[known][order],
            linestyle="none",
            marker=marks.marker,
            color=marks.colour,
            markerfacecolor=marks.face or marks.colour,
            markevery=every,
            label="_points",
            zorder=3.0,
        )
    return ax


def bars(ax: Axes, x: FloatArray, y: FloatArray, std: FloatArray, colour: str, *, level: bool = False) -> Axes:
    """Bars of one standard uncertainty, up and down or to the sides, all in one line with gaps."""
    known = np.isfinite(x) & np.isfinite(y) & np.isfinite(std) & (std > 0)
    if np.any(known):
        fixed, moved = (y[known], x[known]) if level else (x[known], y[known])
        gap = np.full(fixed.size, np.nan)
        across = np.column_stack([fixed, fixed, gap]).ravel()
        along = np.column_stack([moved - std[known], moved + std[known], gap]).ravel()
        if level:
            across, along = along, across
        ax.plot(across, along, color=colour, alpha=0.5, linewidth=0.8, marker="", label="_bars", zorder=1.5)
    return ax


def rejected_tests(ax: Axes, x: FloatArray, y: FloatArray, *, style: Style) -> Axes:
    """Open grey crosses at the values of rejected tests."""
    known = np.isfinite(x) & np.isfinite(y)
    if np.any(known):
        ax.plot(
            x[known],
            y[known],
            linestyle="none",
            marker="X",
            markersize=6.0,
            markerfacecolor=style.look.paper,
            markeredgecolor=style.look.muted,
            markeredgewidth=0.9,
            label="_rejected",
            zorder=2.5,
        )
    return ax


def tyre_heading(ax: Axes, name: str, colour: str, right: str = "", *, style: Style, columns: int = 1) -> Axes:
    """Name of the tyre above the panel, a bar in its colour under it, the condition on the right."""
    ax.plot([0.0, 1.0], [1.0, 1.0], color=colour, linewidth=2.6, transform=ax.transAxes, clip_on=False, zorder=4.0,
            solid_capstyle="butt", label="_tyre")  # fmt: skip
    longest = {1: 60, 2: 34, 3: 20}.get(columns, 15) - max(0, len(right) - 6)
    ax.set_title(plain_text(name, max(longest, 8)), loc="left", pad=4.5)
    if right:
        ax.set_title(right, loc="right", pad=4.5, color=style.look.muted, fontsize=7.5)
    return ax


def span(values: Sequence[FloatArray], pad: float = 0.05) -> tuple[float, float]:
    """Limits of an abscissa that hold all values."""
    known = np.concatenate([np.asarray(v)[np.isfinite(v)] for v in values]) if values else np.zeros(0)
    if not known.size:
        return 0.0, 1.0
    low, high = float(known.min()), float(known.max())
    if high - low < 1e-9 * max(abs(high), 1e-12):
        half = 0.15 * abs(high) or 0.5
        return low - half, high + half
    return low - pad * (high - low), high + pad * (high - low)


def limit(ax: Axes, x: tuple[float, float], y: tuple[float, float], *, style: Style, ticks: int = 6) -> Axes:
    """Limits of both axes, the reader's before those of the values, and few ticks."""
    ax.set_xlim(style.xlim or x)
    ax.set_ylim(style.ylim or y)
    ax.xaxis.set_major_locator(MaxNLocator(ticks, steps=[1, 2, 5, 10]))
    ax.yaxis.set_major_locator(MaxNLocator(5, steps=[1, 2, 2.5, 5, 10]))
    return ax
