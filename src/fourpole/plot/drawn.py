"""A figure's data drawn with matplotlib: panels with their limits, the key and the notes."""

from __future__ import annotations

import textwrap
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, MaxNLocator
from matplotlib.transforms import Bbox

from fourpole.core.arrays import FloatArray
from fourpole.core.confidence import COVERAGE_FACTOR
from fourpole.plot.data import AxisData, Field, FigureData, Panel, Place, Role, Series, counted, look, plain_text
from fourpole.plot.layout import Grid, Key
from fourpole.plot.panels import (
    ALIKE,
    LETTER,
    OFF_POINT,
    Extent,
    colour_of,
    draw_series,
    end_labels,
    face_of,
    few_ticks,
    numbered,
    power_or_plain,
    span,
    steep_limits,
    tyre_heading,
)
from fourpole.plot.style import Style, load_dashes, pressure_marker

#: Largest number of points of a figure that lead to their cards one by one; more are drawn as lines of markers.
_MOST_LINKS = 1500
#: Least width of a panel of several in a row [in], height of a row of names, and least height of other panels [in].
_LEAST_WIDTH, _NAME_HEIGHT, _LEAST_HEIGHT = 1.3, 0.135, 0.5
#: Distance of panels that share their ordinate [in].
_GAP = 0.16
#: Distance of a name from its row [pt], and room above and below all rows [rows].
_NAME_PAD, _NAME_MARGIN = 3.5, 0.6
#: Least height of a panel with labels above its curves [in], and room for them as a share of its ordinate.
_LEAST_HIGH, _HEADROOM = 1.3, 0.08
#: Length of a letter of a label [pt].
_LABEL_LETTER = 4.9
#: Number of levels of a map, about.
_LEVELS = 9
#: A curve whose label is shorter than this [letters] takes no more room for it.
_LEAST_ROOM = 4
#: Width that a number of an axis needs [in], and largest number of them.
_TICK, _MOST_TICKS = 0.5, 6
#: Largest share of a panel that texts on its right take.
_MOST_ROOM = 0.55
#: Bars of signed values longer than this many times the median do not set the axis.
_LONG = 5.0


@dataclass
class _Beyond:
    """Numbers of values and bars beyond the axes of all panels."""

    values: int = 0
    cut: int = 0
    lost: Counter[str] = field(default_factory=Counter)

    def said(self, what: str, *, chosen: bool) -> Iterator[str]:
        """The notes on them; `chosen`: whether the limits are the reader's."""
        for name, count in self.lost.items():
            yield f"{name} of {counted(count, what)} beyond the axes"
        if self.values:
            why = "" if chosen else ": they are known to no better than 100 %"
            yield f"{counted(self.values, 'value')} beyond the axes{why}"
        if self.cut:
            yield f"{counted(self.cut, 'uncertainty bar')} {'leaves' if self.cut == 1 else 'leave'} the axes"


def figure_of(data: FigureData, style: Style) -> Figure:
    """A matplotlib figure of the data, not registered with pyplot.

    A narrow one has fewer panels in a row; one of a stated height has as many rows of panels as there is room for.
    """
    gap = _gap(data, style)
    free = style.width - style.font(data.right) + (gap - style.font(data.left) if data.shared else 0.0)
    data = _narrowed(data, max(1, int(free / (style.font(_LEAST_WIDTH) + gap))))
    figure = _figure(data, style)
    while style.size.height is not None and figure.get_size_inches()[1] > style.size.height + 1e-6:
        fewer = _shorter(data)
        if fewer is data:
            break
        data = fewer
        figure = _figure(data, style)
    return figure


def _shorter(data: FigureData) -> FigureData:
    """The figure without its last rows of panels; the same if it has no others."""
    panels = data.panels[: -data.block * data.columns]
    if not panels:
        return data
    said = "only the first rows of panels: the height has no room for more"
    notes = data.notes if said in data.notes else (said, *data.notes)
    return replace(data, panels=panels, notes=notes)


def _gap(data: FigureData, style: Style) -> float:
    """Distance of the panels of a row [in]."""
    return _GAP if data.shared else style.font(data.left)


def _figure(data: FigureData, style: Style) -> Figure:
    named = max((len(panel.names) for panel in data.panels), default=0)
    high = data.panel_height * (style.size.font if named else 1.0)
    grid = Grid.of(len(data.panels), data.columns, panel_height=high, style=style)
    margins = style.font(data.left + data.right) + (data.columns - 1) * _gap(data, style)
    beyond = _draw_panels(grid.panels, data, style, (style.width - margins) / data.columns)
    above = any(map(_labelled_above, data.panels))
    figure = grid.finish(
        key=_key(data, style), notes=(*data.notes, *beyond.said(data.lost, chosen=style.ylim is not None)),
        x_label=data.panels[0].x.label,
        y_labels=["" if row[0].names or not data.shared else row[0].y.label for row in data.rows],
        share_x=_same_abscissa(grid.panels, data), share_y=data.shared,
        headings=_headings(data), scale=data.scale, height=data.height, left=data.left, right=data.right,
        least=style.font(max(_LEAST_HIGH if above else _LEAST_HEIGHT, _NAME_HEIGHT * (named + 0.2))),
    )  # fmt: skip
    for ax, panel in zip(grid.panels, data.panels, strict=True):
        _label_panel(ax, panel, style, 72 * figure.get_size_inches(), shared=data.shared)
    return figure


def _draw_panels(axes: Sequence[Axes], data: FigureData, style: Style, width: float) -> _Beyond:
    """Draw the content of all panels of some width [in]; returns what lies beyond their axes."""
    beyond, ends, free = _Beyond(), _joined_ends(data.panels), iter(axes)
    linked = sum(len(series.cards) for series in data.series) <= _MOST_LINKS
    for panels in data.rows:
        extents = [_extent(panel) for panel in panels]
        if data.shared:
            extents = [_joined(extents)] * len(panels)
        for panel, extent, ax in zip(panels, extents, free, strict=False):
            # The reader's limits of the ordinate are in the unit of the first panel.
            own = style if panel.y == data.panels[0].y else replace(style, ylim=None)
            reach = ends[panel.x.label] if data.aligned else _ends(panel)
            _limit(ax, panel, extent, own, beyond, ends=reach, width=width)
            if panel.field is not None:
                _draw_field(ax, panel.field, style, _levels(panels))
            draw_series(ax, panel, data, style, linked=linked)
            _head(ax, panel, style, int(72 * width / style.font(5.0)))
    return beyond


def _label_panel(ax: Axes, panel: Panel, style: Style, size: FloatArray, *, shared: bool) -> None:
    """Write the labels of a panel and of its curves, once the figure has its size [pt]."""
    if ax.get_xlabel():
        ax.set_xlabel(panel.x.label)
    if panel.names:
        _name_rows(ax, panel, style)
    elif not shared:
        ax.set_ylabel(panel.y.label)
    place, (wide, high) = ax.get_position(), size
    ax.set_ylabel(_wrapped(ax.get_ylabel(), int(place.height * high / style.font(_LABEL_LETTER))))
    end_labels(ax, panel, style, place.width * wide, place.height * high)
    if panel.field is not None:
        _part_numbers(ax)


def _wrapped(label: str, letters: int) -> str:
    """A label in lines of so many letters."""
    return "\n".join(textwrap.wrap(label, max(letters, 8), break_long_words=False)) if len(label) > letters else label


def _part_numbers(ax: Axes) -> None:
    """Hide the numbers of a map's lines that would lie on others."""
    kept: list[Bbox] = []
    for text in ax.texts:
        box = text.get_window_extent()
        if any(box.overlaps(other) for other in kept):
            text.set_visible(False)
        else:
            kept.append(box)


def _head(ax: Axes, panel: Panel, style: Style, letters: int) -> None:
    """Write the heading of a panel, at most so many letters, and the text in its corner."""
    if panel.title and panel.tyre >= 0:
        tyre_heading(ax, panel.title, style.colour(panel.tyre), panel.right, style=style, letters=letters)
    elif panel.title:
        ax.set_title(plain_text(panel.title, max(letters, 8)), loc="left", pad=4.5)
    if panel.corner:
        ax.text(0.025, 0.03, panel.corner, transform=ax.transAxes, fontsize=style.font(7.0), va="bottom",
                linespacing=1.25, bbox={"facecolor": style.look.paper, "edgecolor": "none", "pad": 1.5})  # fmt: skip


def _name_rows(ax: Axes, panel: Panel, style: Style) -> None:
    """Make the ordinate the names of the panel from the top down, and write the texts beside them on the right."""
    beyond = ax.get_yaxis_transform()
    own = ax.yaxis.get_tick_params().get("labelleft", True)  # not where the names of the first panel stand for all
    for at, name in enumerate(panel.names if own else ()):
        head: dict[str, Any] = {"color": style.look.muted, "fontstyle": "italic"} if at in panel.heads else {}
        ax.annotate(name, (0.0, at), (-_NAME_PAD, 0.0), beyond, "offset points", ha="right", va="center_baseline",
                    fontsize=style.font(7.5), annotation_clip=False, **head)  # fmt: skip
    for at, text in enumerate(panel.beside):
        ax.text(1.015, at, text, transform=beyond, va="center", fontsize=style.font(7.0))
    ax.set(yticks=[], ylim=(len(panel.names) - 1 + _NAME_MARGIN, -_NAME_MARGIN))


def _same_abscissa(axes: Sequence[Axes], data: FigureData) -> bool:
    """Whether the panels below each other have the same abscissa, so that the lowest alone needs numbers."""
    seen = [(panel.x.label, tuple(np.round(ax.get_xlim(), 9))) for ax, panel in zip(axes, data.panels, strict=True)]
    return all(len(set(seen[at :: data.columns])) == 1 for at in range(data.columns))


def _narrowed(data: FigureData, columns: int) -> FigureData:
    """The figure with at most so many panels in a row.

    The panels of a column stay below each other; those of a row if one heading stands for all of them.
    """
    if data.columns <= columns:
        return data
    if any(row[0].title for row in data.rows) and not any(panel.title for row in data.rows for panel in row[1:]):
        return replace(data, columns=1, height=None, block=data.block * data.columns)
    groups = range(0, data.columns, columns)
    panels = tuple(panel for first in groups for row in data.rows for panel in row[first : first + columns])
    return replace(data, panels=panels, columns=columns, height=None)


def _headings(data: FigureData) -> str:
    """Which rows of panels have headings."""
    headed = [any(panel.title for panel in row) for row in data.rows]
    return "all" if any(headed[1:]) else "top" if headed[0] else "none"


def _draw_field(ax: Axes, field: Field, style: Style, levels: FloatArray) -> None:
    """Draw a map as colours between lines of equal value, which carry their numbers."""
    colours = [style.frequency_colour(part) for part in np.linspace(0.08, 0.92, levels.size - 1)]
    ax.contourf(field.x, field.y, field.z, levels, colors=colours, zorder=0.8)
    lines = ax.contour(field.x, field.y, field.z, levels, colors=style.look.paper, linewidths=0.6, zorder=0.9)
    labels = ax.clabel(lines, fontsize=style.font(6.6), fmt=lambda value: f"{value:g}", colors=style.look.ink)
    for label in labels:
        label.set_bbox({"facecolor": style.look.paper, "alpha": 0.75, "pad": 0.8, "edgecolor": "none"})
    ax.grid(visible=False)


def _levels(panels: Sequence[Panel]) -> FloatArray:
    """Round values that the maps of a row share."""
    every = np.concatenate([panel.field.z.ravel() for panel in panels if panel.field is not None])
    low, high = float(np.nanmin(every)), float(np.nanmax(every))
    return np.asarray(MaxNLocator(_LEVELS, steps=[1, 2, 2.5, 5, 10]).tick_values(low, high), dtype=float)


def _bars(one: Series) -> FloatArray | None:
    """Half the length of the bars of a series: U of points."""
    return one.spread if one.spread is None or one.role is not Role.POINTS else COVERAGE_FACTOR * one.spread


def _extent(panel: Panel) -> Extent:
    """The values of the tests in use with their uncertainties, and the curves; of all tests if none is in use."""
    extent = Extent(positive=not panel.y.signed)
    shown = [one for one in panel.series if one.role is not Role.REJECTED] or panel.series
    for one in shown:
        bars = _bars(one)
        extent.add(one.y, bars if one.role is not Role.REJECTED else None)
        if one.role is Role.RANGE and one.spread is not None:
            extent.add(np.concatenate([one.y - one.spread, one.y + one.spread]))
        if panel.y.signed and bars is not None and one.y.size:
            reach = np.minimum(np.nan_to_num(bars), _LONG * np.nanmedian(np.append(bars, 0.0)))
            extent.add(np.concatenate([one.y - reach, one.y + reach]))
    if panel.y.signed:
        extent.add(np.zeros(1))
    return extent


def _joined(extents: Sequence[Extent]) -> Extent:
    positive = all(one.positive for one in extents)
    return Extent(positive, list(chain(*(one.values for one in extents))), list(chain(*(one.bars for one in extents))))


def _limit(
    ax: Axes, panel: Panel, extent: Extent, style: Style, beyond: _Beyond, *, ends: tuple[float, float], width: float
) -> None:
    """Set limits and ticks of a panel of some width [in]; `ends` are those of the values on the abscissa."""
    ticks = int(np.clip(width / style.font(_TICK), 2, _MOST_TICKS))
    _set_kind(ax, panel.x)
    ax.set_xlim(style.xlim or _with_room(panel, ends, style, width))
    limits, steep = steep_limits(extent) if panel.x.log or panel.y.log else (extent.limits(panel.y.zero), False)
    if _labelled_above(panel):
        limits = limits[0], limits[1] + _HEADROOM * (limits[1] - limits[0])
    if steep:
        ax.set_yscale("log")
    ax.set_ylim(style.ylim or limits)
    _set_ticks(ax, panel.x, ticks)
    if style.xlim is None and ax.get_xlim()[1] > ends[1]:
        _end_with_data(ax, ends[1])
    if steep:
        numbered(ax, "y", most=5)
    else:
        ax.yaxis.set_major_locator(MaxNLocator(5, steps=[1, 2, 2.5, 5, 10]))
    _count_beyond(panel, style.ylim or limits, beyond)


def _count_beyond(panel: Panel, limits: tuple[float, float], beyond: _Beyond) -> None:
    """Add what lies beyond the ordinate of a panel."""
    shown = Extent(positive=True)
    for one in panel.series:
        if one.role is Role.POINTS and not panel.names:
            shown.add(one.y, _bars(one))
        elif one.role is Role.REJECTED:
            count = int(np.sum((one.y < min(limits)) | (one.y > max(limits))))
            beyond.lost.update({panel.y.name: count} if count else {})
    values, cut = shown.outside(limits)
    beyond.values += values
    beyond.cut += cut


def _set_kind(ax: Axes, axis: AxisData) -> None:
    if axis.linear:
        ax.set_xscale("symlog", linthresh=axis.linear, linscale=0.8)
    elif axis.log:
        ax.set_xscale("log")


def _set_ticks(ax: Axes, axis: AxisData, most: int) -> None:
    """Numbers on the abscissa."""
    if axis.linear:
        top = max(ax.get_xlim()[1], axis.linear)
        decades = [10.0**power for power in range(1, int(np.log10(top)) + 1)]
        ax.set_xticks([0.0, *decades[:: -(-len(decades) // max(most - 1, 1))]])
        ax.minorticks_off()
        ax.xaxis.set_major_formatter(FuncFormatter(power_or_plain))
    elif axis.log:
        numbered(ax, "x", most=most)
    else:
        few_ticks(ax, most)


def _end_with_data(ax: Axes, end: float) -> None:
    """End the abscissa with the data where there is room for labels on the right of them."""
    low = ax.get_xlim()[0]
    ax.spines["bottom"].set_bounds(low, end)
    for minor in (False, True):
        ax.set_xticks([at for at in ax.get_xticks(minor=minor) if low <= at <= end], minor=minor)


def _ends(panel: Panel) -> tuple[float, float]:
    """Limits of the abscissa that hold all values, with a margin."""
    every = [one.x + sign * _reach(one) for one in panel.series for sign in (-1, 1)]
    if panel.x.linear:
        top = max((float(np.max(x)) for x in every if x.size), default=1.0)
        return -0.06 * panel.x.linear, 1.6 * max(top, panel.x.linear)
    if not panel.x.log:
        return span(every)
    known = np.concatenate([x[np.isfinite(x) & (x > 0)] for x in every] or [np.ones(1)])
    known = known if known.size else np.ones(1)
    ratio = known.max() / known.min()
    room = ratio**0.04 if ratio > 1.0 + ALIKE else 1.15
    return float(known.min() / room), float(known.max() * room)


def _joined_ends(panels: Sequence[Panel]) -> dict[str, tuple[float, float]]:
    """The limits of each abscissa, by its label, that hold the values of all its panels."""
    found: dict[str, tuple[float, float]] = {}
    for panel in panels:
        low, high = _ends(panel)
        other = found.get(panel.x.label, (low, high))
        found[panel.x.label] = (min(low, other[0]), max(high, other[1]))
    return found


def _reach(one: Series) -> FloatArray:
    return np.zeros(one.x.size) if one.across is None else np.nan_to_num(one.across)


def _with_room(panel: Panel, ends: tuple[float, float], style: Style, width: float) -> tuple[float, float]:
    """Limits of the abscissa with room on the right for the labels of curves and the texts of points."""
    low, high = ends
    letter = style.font(LETTER) / 72 / max(width, 0.5)
    share = 1.0 - min(_room(panel) * letter, 0.45)
    to, back = (np.log, np.exp) if panel.x.log else (float, float)
    for one in panel.series:
        for x, text in zip(one.x.tolist(), one.texts, strict=False):
            place = (to(x) - to(low)) / (to(high) - to(low)) if text and not panel.x.linear else 0.0
            if place > 0:
                share = min(share, (1.0 - len(text) * letter - OFF_POINT / 72 / width) / place)
    share = max(share, 1.0 - _MOST_ROOM)
    return (low, high) if share >= 1 else (low, float(back(to(low) + (to(high) - to(low)) / share)))


def _labelled_above(panel: Panel) -> bool:
    return any(one.label and one.place is Place.ABOVE for one in panel.series)


def _room(panel: Panel) -> int:
    """Length of the longest label at the end of a curve [letters]; 0 without labels."""
    longest = max((len(one.label) for one in panel.series if one.place is Place.RIGHT), default=0)
    return max(longest, _LEAST_ROOM) + 1 if longest else 0


def _key(data: FigureData, style: Style) -> Key:
    key, muted = Key(), style.look.muted
    for tyre in data.keyed:
        key.line(data.names[tyre], style.colour(tyre), 2.6)
    entries = [(look(Role.LINE, dash=rank), text) for rank, text in data.dashes]
    for one, text in (*data.key, *entries):
        colour = colour_of(one, data, style)
        if one.role in (Role.LINE, Role.MODEL, Role.RANGE):
            key.line(text, colour, 3.0 if one.role is Role.RANGE else None, linestyle=load_dashes(one.dash))
        else:
            key.marker(text, pressure_marker(one.marker), colour, face_of(one, colour, style))
    if any(series.role is Role.MODEL and series.spread is not None for series in data.series):
        key.band(style)
    if any(series.role is Role.REJECTED for series in data.series):
        key.marker(data.lost, "X", muted, style.look.paper, markersize=6.0)
    return key
