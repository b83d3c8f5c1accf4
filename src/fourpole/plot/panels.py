"""The parts of a panel: curves, bars, crosses, bands, headings and limits. Values are in the units of the axes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgba
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullFormatter, NullLocator

from fourpole.core.arrays import ByValue, FloatArray
from fourpole.plot.names import plain_text
from fourpole.plot.style import Style

#: Values that are below zero by a smaller share of their span do not move the end of an axis from it.
_ZERO = 0.01
#: Ratio of the ends of an ordinate beyond which it is logarithmic.
_STEEP = 20.0
#: Numbers of an axis beyond this, or below its inverse, are powers of ten; no minor ticks over a larger ratio of ends.
_LONG, _MANY = 3e5, 1e12
_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


@dataclass(eq=False)
class Extent(ByValue):
    """The values and uncertainty bars of panels with a common axis, from which its limits follow.

    If the quantity is `positive`, values smaller than their uncertainty do not count for the limits.
    """

    positive: bool = False
    values: list[FloatArray] = field(default_factory=list)
    bars: list[FloatArray] = field(default_factory=list)

    def add(self, values: FloatArray, bars: FloatArray | None = None) -> None:
        """Add values and their standard uncertainties."""
        known = np.isfinite(values)
        self.values.append(values[known])
        self.bars.append(np.zeros(int(known.sum())) if bars is None else np.nan_to_num(bars[known]))

    @property
    def empty(self) -> bool:
        """Whether no value was added."""
        return not any(values.size for values in self.values)

    def limits(self, zero: bool = False) -> tuple[float, float]:
        """Axis limits that hold the values, and the bars that are not longer than the span of the values.

        With `zero`, the axis begins at zero or below.
        """
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
            low = 0.0 if low > -_ZERO * (high - low) else low
        width = max(high - low, reach)
        pad_low = 0.0 if zero and low == 0.0 else 0.06
        if high - low < reach:
            middle = 0.5 * (low + high)
            low, high = (low if zero else middle - 0.5 * reach), middle + 0.5 * reach
        return low - pad_low * width, high + 0.06 * width

    def outside(self, limits: tuple[float, float]) -> tuple[int, int]:
        """Number of values outside the limits, and number of bars of the other values that cross the limits."""
        if self.empty:
            return 0, 0
        values, bars = np.concatenate(self.values), np.concatenate(self.bars)
        low, high = min(limits), max(limits)
        slack = 1e-9 * (high - low)
        inside = (values >= low - slack) & (values <= high + slack)
        cut = inside & ((values - bars < low - slack) | (values + bars > high + slack))
        return int(np.sum(~inside)), int(np.sum(cut))


def bars(
    ax: Axes, x: FloatArray, y: FloatArray, std: FloatArray, colour: str, *, level: bool = False, strong: bool = False
) -> Axes:
    """Draw bars of one standard uncertainty as one line with gaps: of y, or with `level` of x; `strong` ones wider."""
    known = np.isfinite(x) & np.isfinite(y) & np.isfinite(std) & (std > 0)
    if np.any(known):
        fixed, moved = (y[known], x[known]) if level else (x[known], y[known])
        gap = np.full(fixed.size, np.nan)
        across = np.column_stack([fixed, fixed, gap]).ravel()
        along = np.column_stack([moved - std[known], moved + std[known], gap]).ravel()
        if level:
            across, along = along, across
        ax.plot(across, along, color=colour, alpha=0.5, linewidth=1.6 if strong else 0.8, marker="", label="_bars",
                zorder=1.5)  # fmt: skip
    return ax


def tyre_heading(ax: Axes, name: str, colour: str, right: str = "", *, style: Style, letters: int = 60) -> Axes:
    """Write the tyre's name above the panel and the condition on the right, and draw a bar in the tyre's colour."""
    ax.plot([0.0, 1.0], [1.0, 1.0], color=colour, linewidth=2.6, transform=ax.transAxes, clip_on=False, zorder=4.0,
            solid_capstyle="butt", label="_tyre")  # fmt: skip
    ax.set_title(plain_text(name, max(letters - len(right) - 1, 8)), loc="left", pad=4.5)
    if right:
        condition(ax, right, style=style)
    return ax


def condition(ax: Axes, text: str, *, style: Style, pad: float = 4.5) -> None:
    """Write a condition above the panel on the right."""
    ax.set_title(text, loc="right", pad=pad, color=style.look.muted, fontsize=style.font(7.5))


def band(ax: Axes, x: FloatArray, y: FloatArray, half: FloatArray, colour: str, *, faint: bool = False) -> Axes:
    """Draw a band of half-width `half` about a line; its edge remains visible where bands overlap.

    A `faint` one, of many, is paler and has no edge.
    """
    known = np.isfinite(y) & np.isfinite(half)
    ax.fill_between(x, y - half, y + half, where=known, facecolor=to_rgba(colour, 0.08 if faint else 0.14),
                    edgecolor="none" if faint else to_rgba(colour, 0.45), linewidth=0.0 if faint else 0.5,
                    label="_band", zorder=1.2)  # fmt: skip
    return ax


def rows_of_names(ax: Axes, names: Sequence[str], margin: float = 0.6) -> None:
    """Make the ordinate a list of names from the top down."""
    ax.set_yticks(range(len(names)), names)
    ax.tick_params(axis="y", length=0)
    ax.grid(visible=False, axis="y")
    ax.set_ylim(len(names) - 1 + margin, -margin)


#: Values that differ by a smaller share of the largest are one value on an axis.
ALIKE = 1e-4


def span(values: Sequence[FloatArray], pad: float = 0.05) -> tuple[float, float]:
    """Limits of an abscissa that hold all values, with a margin of `pad` times their span."""
    known = np.concatenate([np.asarray(v)[np.isfinite(v)] for v in values]) if values else np.zeros(0)
    if not known.size:
        return 0.0, 1.0
    low, high = float(known.min()), float(known.max())
    if high - low < ALIKE * max(abs(high), 1e-12):
        half = 0.15 * abs(high) or 0.5
        return low - half, high + half
    return low - pad * (high - low), high + pad * (high - low)


def few_ticks(ax: Axes, most: int) -> None:
    """Numbers at 1, 2 or 5 times a power of ten on the abscissa, at most about so many."""
    ax.xaxis.set_major_locator(MaxNLocator(most, steps=[1, 2, 5, 10]))


def steep_limits(extent: Extent) -> tuple[tuple[float, float], bool]:
    """Limits, and whether the axis is logarithmic because the ratio of the largest to the smallest value is large."""
    values = np.concatenate(extent.values) if extent.values else np.zeros(0)
    if values.size and values.min() > 0 and values.max() > _STEEP * values.min():
        room = (values.max() / values.min()) ** 0.06
        return (float(values.min() / room), float(values.max() * room)), True
    return extent.limits(), False


def numbered(ax: Axes, which: str, most: int) -> None:
    """Numbers on a logarithmic axis, "x" or "y": at 1, 2 and 5 over less than two decades, otherwise at 1.

    They are powers of ten where plain numbers would be long.
    """
    axis = ax.xaxis if which == "x" else ax.yaxis
    low, high = sorted(ax.get_xlim() if which == "x" else ax.get_ylim())
    few = high < 100 * low
    axis.set_major_locator(LogLocator(10.0, subs=(1.0, 2.0, 5.0) if few else (1.0,), numticks=most + 2))
    long = not few and (high > _LONG or low < 1 / _LONG)
    axis.set_major_formatter(FuncFormatter(power_of_ten if long else lambda value, _: f"{value:g}"))
    axis.set_minor_locator(LogLocator(10.0, subs=tuple(range(2, 10)), numticks=200))
    if high > _MANY * low:
        axis.set_minor_locator(NullLocator())
    axis.set_minor_formatter(NullFormatter())


def power_or_plain(value: float, place: int) -> str:
    """A power of ten that would be long as a plain number, or else a plain number."""
    return power_of_ten(value, place) if value > _LONG else f"{value:g}"


def power_of_ten(value: float, _: int) -> str:
    """A power of ten with a raised exponent."""
    return f"10{str(round(np.log10(value))).translate(_RAISED)}"
