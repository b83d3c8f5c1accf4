"""The parts of a panel, and its series drawn: points that lead to cards, curves, bands, labels, headings and limits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import compress
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgba
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullFormatter, NullLocator
from numpy.typing import ArrayLike

from fourpole.core.arrays import BoolArray, ByValue, FloatArray, IntArray
from fourpole.core.confidence import COVERAGE_FACTOR
from fourpole.plot.data import FigureData, Panel, Place, Role, Series, Tone, plain_text
from fourpole.plot.layout import links
from fourpole.plot.style import Style, load_dashes, mixed, pressure_marker

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


def line(ax: Axes, x: ArrayLike, y: ArrayLike, **look: Any) -> None:
    """Draw a line; `look` has further properties of matplotlib's line."""
    ax.add_artist(Line2D(x, y, **look))


def bars(
    ax: Axes, x: FloatArray, y: FloatArray, half: FloatArray, colour: str, *, level: bool = False, strong: bool = False
) -> Axes:
    """Draw bars of a half-length as one line with gaps: of y, or with `level` of x; `strong` ones wider."""
    known = np.isfinite(x) & np.isfinite(y) & np.isfinite(half) & (half > 0)
    if np.any(known):
        fixed, moved = (y[known], x[known]) if level else (x[known], y[known])
        gap = np.full(fixed.size, np.nan)
        across = np.column_stack([fixed, fixed, gap]).ravel()
        along = np.column_stack([moved - half[known], moved + half[known], gap]).ravel()
        if level:
            across, along = along, across
        line(ax, across, along, color=colour, alpha=0.5, linewidth=1.6 if strong else 0.8, label="_bars", zorder=1.5)
    return ax


def tyre_heading(ax: Axes, name: str, colour: str, right: str = "", *, style: Style, letters: int = 60) -> Axes:
    """Write the tyre's name above the panel and the condition on the right, and draw a bar in the tyre's colour."""
    line(ax, [0.0, 1.0], [1.0, 1.0], color=colour, linewidth=2.6, transform=ax.transAxes, clip_on=False, zorder=4.0,
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


#: Width of a letter and height of a line of the labels at the ends of curves [pt], and their size [pt].
LETTER, LINE, SIZE = 3.75, 7.6, 6.6
#: A curve with more points than this is drawn through those that are needed, to within this distance [px].
_FEW, _OFF = 20, 0.015
#: Size of the markers of points, those with links, rejected ones, and those beside names or of many tests [pt].
_LINKED, _LOST, _LARGE, _SMALL = 3.87, 5.48, 4.5, 3.0
#: Curves whose ends are no farther apart than this share of the panel, or a label, have their labels in one column.
_COLUMN = 0.1
#: Distance of a text from its point [pt].
OFF_POINT = 4.5
#: Numbers of the palette that tones have.
_TONES = {Tone.SURE: 0, Tone.DOUBT: 1, Tone.ALARM: 4}


def draw_series(ax: Axes, panel: Panel, data: FigureData, style: Style, *, linked: bool) -> None:
    """Draw the series of a panel; with `linked`, each point leads to the card of its test."""
    for one in panel.series:
        colour = colour_of(one, data, style)
        if one.role in (Role.MODEL, Role.LINE):
            _curve(ax, one, colour, faint=data.scale is not None)
            continue
        if one.role is not Role.REJECTED:
            for reach, level in ((one.spread, False), (one.across, True)):
                if reach is not None:
                    half = COVERAGE_FACTOR * reach if one.role is Role.POINTS else reach
                    bars(ax, one.x, one.y, half, colour, level=level, strong=one.role is Role.RANGE)
        if one.role is not Role.RANGE:
            _marks(ax, one, colour, style, linked=linked, large=bool(panel.names))
        _texts(ax, one, style)


def _curve(ax: Axes, one: Series, colour: str, *, faint: bool) -> None:
    at = _needed(one, ax) if one.x.size > _FEW else slice(None)
    if one.spread is not None:
        band(ax, one.x[at], one.y[at], one.spread[at], colour, faint=faint)
    thin = one.tyre < 0 and one.tone in (Tone.NONE, Tone.INK) and np.isnan(one.level)
    line(ax, one.x[at], one.y[at], color=colour, linestyle=load_dashes(one.dash), linewidth=0.8 if thin else 1.2,
         label=f"_{one.role}", zorder=2.0, url=links(one.cards[:1], one.tests[:1]) if one.cards else None)  # fmt: skip


def _needed(one: Series, ax: Axes) -> IntArray:
    """The points of a dense curve that are enough to draw it, with its band, to a fraction of a line's width.

    A chord over n steps of second difference d is off by about n²d/8.
    """
    edges = [one.y] if one.spread is None else [one.y, one.y - one.spread, one.y + one.spread]
    density = np.zeros(one.x.size)
    for y in edges:
        place = ax.transData.transform(np.column_stack([one.x, np.nan_to_num(y)]))
        bend = np.linalg.norm(np.diff(place, 2, axis=0), axis=1)
        density[1:-1] = np.maximum(density[1:-1], np.sqrt(np.nan_to_num(bend) / (8 * _OFF)))
    kept = np.unique(np.floor(np.cumsum(density)), return_index=True)[1]
    return np.union1d(kept, [0, one.x.size - 1])


def face_of(one: Series, colour: str, style: Style) -> str:
    """Fill of the markers of a series."""
    if one.hollow or one.role is Role.REJECTED:
        return style.look.paper
    plain = not np.isnan(one.level) or one.tone is not Tone.NONE
    return colour if plain else mixed(style.look.paper, colour, 0.75)


def _marks(ax: Axes, one: Series, colour: str, style: Style, *, linked: bool, large: bool) -> None:
    """Draw points; each leads to the card of its test, if they are few enough."""
    lost, linked = one.role is Role.REJECTED, linked and bool(one.cards)
    size, width = (_LOST if lost else _LINKED, 0.8) if linked else (_LARGE, 0.8) if large else (_SMALL, 0.6)
    look = {
        "linestyle": "none", "marker": "X" if lost else pressure_marker(one.marker), "markeredgewidth": width,
        "markersize": size * style.size.font, "color": style.look.muted if lost else colour,
        "markerfacecolor": face_of(one, colour, style), "label": f"_{one.role}", "zorder": 2.5 if lost else 3.0,
    }  # fmt: skip
    # An SVG has no marks beyond its edges, so that links are counted for those within the axes.
    within = _within_axes(ax, one)
    url = links(*(tuple(compress(texts, within)) for texts in (one.cards, one.tests))) if linked else None
    for part, address in ((within, url), (~within, None)):
        if part.any():
            line(ax, one.x[part], one.y[part], url=address, **look)


def _within_axes(ax: Axes, one: Series) -> BoolArray:
    """True for the points of a series within the limits of the axes."""
    (left, right), (low, high) = sorted(ax.get_xlim()), sorted(ax.get_ylim())
    return np.asarray((one.x >= left) & (one.x <= right) & (one.y >= low) & (one.y <= high))


def _texts(ax: Axes, one: Series, style: Style) -> None:
    """Write the texts of points beside them."""
    for x, y, text in zip(one.x.tolist(), one.y.tolist(), one.texts, strict=False):
        if text:
            ax.annotate(plain_text(text, 60), (x, y), (OFF_POINT, 0.0), textcoords="offset points", ha="left",
                        va="center", fontsize=style.font(SIZE), annotation_clip=True, zorder=4.0)  # fmt: skip


def colour_of(one: Series, data: FigureData, style: Style) -> str:
    """Colour of a series: of its level, its tone or its specimen, else grey."""
    if data.scale is not None and not np.isnan(one.level):
        return style.frequency_colour(data.scale.part(one.level))
    if one.tone is Tone.INK:
        return style.look.ink
    if one.tone in _TONES:
        return style.look.tyres[_TONES[one.tone]]
    if one.tyre < 0:
        return style.look.muted
    colour = style.colour(one.tyre)
    return mixed(mixed(style.look.paper, colour, 0.5), colour, one.shade)


def end_labels(ax: Axes, panel: Panel, style: Style, width: float, height: float) -> None:
    """Write the label of each curve at its right end; labels are moved apart, with a line to the end of the curve.

    `width` and `height` are those of the panel [pt].
    """
    _other_labels(ax, panel, style)
    ends = [(one, *_end(one, ax)) for one in panel.series if one.label and one.place is Place.RIGHT]
    ends = sorted((end for end in ends if np.isfinite(end[2])), key=lambda end: -end[1])
    gap = style.font(LINE) / height
    while ends:
        # Curves that end at about the same place have their labels in one column.
        right = ends[0][1]
        column: list[tuple[Series, float, float]] = []
        for one, x, y in ends:
            near = any(abs(y - other) < 2 * gap for *_, other in column)
            if right - x < (max(_COLUMN, _share(one.label, style, width)) if near else _COLUMN):
                column.append((one, x, y))
        ends = [end for end in ends if not any(end[0] is one for one, *_ in column)]
        # Of curves that end at the same height, the label of the leftmost is the highest.
        column.sort(key=lambda end: (round(end[2], 2), -end[1]))
        places = _within(_apart(np.array([end[2] for end in column]), gap), gap)
        for (one, x, y), place in zip(column, places.tolist(), strict=True):
            at = right + 0.02
            if abs(place - y) > 0.3 * gap or right - x > 0.01:
                line(ax, [x + 0.004, at - 0.004], [y, place], color=style.look.muted, linewidth=0.5, label="_leader",
                     transform=ax.transAxes, zorder=1.4)  # fmt: skip
            ax.text(at, place, plain_text(one.label, 34), transform=ax.transAxes, fontsize=style.font(SIZE),
                    va="center", ha="left", zorder=4.0)  # fmt: skip


def _share(label: str, style: Style, width: float) -> float:
    """Width of a label as a share of a panel of some width [pt]."""
    return style.font(LETTER) * (len(label) + 1) / width


def _other_labels(ax: Axes, panel: Panel, style: Style) -> None:
    """Write the labels that stand above the right end of their curves or beside the left one.

    Of those above, the first and then the last have room before others, which are left out where they have none.
    """
    above = [one for one in panel.series if one.label and one.place is Place.ABOVE]
    taken: list[tuple[float, float]] = []
    for one in [*above[:1], *above[:0:-1]]:
        x, half = ax.transData.transform((one.x[-1], one.y[-1]))[0] * 72 / ax.figure.dpi, 0.0
        half = 0.5 * style.font(LETTER) * (len(one.label) + 1)
        if all(abs(x - other) >= half + wide for other, wide in taken):
            taken.append((x, half))
            _label(ax, one, -1, (0.0, 3.0), ("center", "bottom"), style)
    for one in panel.series:
        if one.label and one.place is Place.LEFT:
            _label(ax, one, 0, (-4.0, 2.0), ("right", "bottom"), style)


def _label(ax: Axes, one: Series, at: int, off: tuple[float, float], how: tuple[str, str], style: Style) -> None:
    ax.annotate(plain_text(one.label, 34), (one.x[at], one.y[at]), off, textcoords="offset points", ha=how[0],
                va=how[1], fontsize=style.font(SIZE), zorder=4.0)  # fmt: skip


def _end(one: Series, ax: Axes) -> tuple[float, float]:
    """The right end of a series in shares of the axes; not-a-number if it lies outside."""
    known = np.flatnonzero(np.isfinite(one.x) & np.isfinite(one.y))
    if not known.size:
        return np.nan, np.nan
    at = known[np.argmax(one.x[known])]
    x, y = ax.transAxes.inverted().transform(ax.transData.transform((one.x[at], one.y[at])))
    inside = -0.01 <= y <= 1.01 and x <= 1.0
    return (float(x), float(y)) if inside else (np.nan, np.nan)


def _apart(places: FloatArray, gap: float) -> FloatArray:
    """Rising places moved as little as possible so that neighbours are at least a gap apart.

    Examples
    --------
    >>> _apart(np.array([0.5, 0.5, 0.9]), 0.1).round(2)
    array([0.45, 0.55, 0.9 ])
    """
    blocks: list[tuple[float, int]] = []  # mean place of the first of a block were it alone, and number
    for place in places.tolist():
        blocks.append((place, 1))
        while len(blocks) > 1 and blocks[-1][0] < blocks[-2][0] + gap * blocks[-2][1]:
            (low, few), (high, more) = blocks[-2:]
            blocks[-2:] = [((low * few + (high - gap * few) * more) / (few + more), few + more)]
    return np.concatenate([start + gap * np.arange(count) for start, count in blocks])


def _within(places: FloatArray, gap: float) -> FloatArray:
    """Rising places moved into the panel, 0 to 1, without bringing neighbours nearer than a gap."""
    rank = np.arange(places.size)
    top = 1.0 - gap * (0.5 + rank[::-1])
    return np.asarray(np.maximum(np.minimum(places, top), gap * (0.5 + rank)))
