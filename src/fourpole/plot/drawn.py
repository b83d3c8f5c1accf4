"""A figure's data drawn with matplotlib: points that lead to the cards of their tests, curves, bands and labels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import chain

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from fourpole.core.arrays import FloatArray, IntArray
from fourpole.plot.data import Field, FigureData, Panel, Role, Series
from fourpole.plot.layout import Grid, Key, Notes
from fourpole.plot.links import link
from fourpole.plot.names import plain_text
from fourpole.plot.panels import (
    ALIKE,
    Extent,
    band,
    bars,
    few_ticks,
    numbered,
    rows_of_names,
    span,
    steep_limits,
    tyre_heading,
)
from fourpole.plot.style import Style, load_dashes, mixed, pressure_marker

#: Largest number of points of a figure that lead to their cards one by one; more are drawn as lines of markers.
_MOST_LINKS = 1500
#: Width of a letter and height of a line of the labels at the ends of curves [pt].
_LETTER, _LINE = 3.75, 7.6
#: A curve with more points than this is drawn through those that are needed, to within this distance [px].
_FEW, _OFF = 20, 0.015
#: Curves whose ends are no farther apart than this share of the panel have their labels in one column.
_COLUMN = 0.1
#: Least width of a panel of several in a row [in].
_LEAST_WIDTH = 1.3
#: Number of levels of a map, about.
_LEVELS = 9
#: A curve whose label is shorter than this [letters] takes no more room for it.
_LEAST_ROOM = 4


def figure_of(data: FigureData, style: Style) -> Figure:
    """A matplotlib figure of the data, not registered with pyplot; a narrow one has fewer panels in a row."""
    beside = 0.16 if data.shared else data.left * style.size.font
    data = _narrowed(data, max(1, int((style.width - style.font(0.8)) / (style.font(_LEAST_WIDTH) + beside))))
    grid = Grid.of(len(data.panels), data.columns, panel_height=data.panel_height, style=style)
    notes = Notes(list(data.notes))
    linked = sum(len(one.cards) for panel in data.panels for one in panel.series) <= _MOST_LINKS
    for row in range(0, len(data.panels), data.columns):
        panels = data.panels[row : row + data.columns]
        extents = [_extent(panel) for panel in panels]
        if data.shared:
            extents = [_joined(extents)] * len(panels)
        for at, (panel, extent) in enumerate(zip(panels, extents, strict=True)):
            ax = grid.panels[row + at]
            # The reader's limits of the ordinate are in the unit of the first panel.
            own = style if panel.y == data.panels[0].y else replace(style, ylim=None)
            _limit(ax, panel, extent, own, notes, columns=data.columns)
            if panel.field is not None:
                _draw_field(ax, panel.field, style, _levels(panels))
            _draw(ax, panel, data, style, linked=linked)
            if panel.title and panel.tyre >= 0:
                colour = style.colour(panel.tyre)
                tyre_heading(ax, panel.title, colour, panel.right, style=style, columns=data.columns)
            elif panel.title:
                ax.set_title(plain_text(panel.title, 40), loc="left", pad=4.5)
    figure = grid.finish(
        key=_key(data, style), notes=notes, x_label=data.panels[0].x.label,
        y_labels=[panel.y.label for panel in data.panels[:: data.columns]] if data.shared else [""],
        share_x=_same_abscissa(grid.panels, data.columns), share_y=data.shared,
        headings=_headings(data), scale=data.scale, height=data.height, left=data.left,
    )  # fmt: skip
    for ax, panel in zip(grid.panels, data.panels, strict=True):
        if panel.names:
            rows_of_names(ax, panel.names)
        elif not data.shared:
            ax.set_ylabel(panel.y.label)
        _end_labels(ax, panel, style, 72 * ax.get_position().height * figure.get_size_inches()[1])
    return figure


def _same_abscissa(panels: Sequence[Axes], columns: int) -> bool:
    """Whether the panels below each other have the same limits, so that the lowest alone needs numbers."""
    each = [{tuple(np.round(ax.get_xlim(), 9)) for ax in panels[at::columns]} for at in range(columns)]
    return all(len(limits) == 1 for limits in each)


def _narrowed(data: FigureData, columns: int) -> FigureData:
    """The figure with at most so many panels in a row; the panels of a column stay below each other."""
    if data.columns <= columns:
        return data
    rows = [data.panels[at : at + data.columns] for at in range(0, len(data.panels), data.columns)]
    groups = range(0, data.columns, columns)
    panels = tuple(panel for at in groups for row in rows for panel in row[at : at + columns])
    return replace(data, panels=panels, columns=columns, height=None)


def _headings(data: FigureData) -> str:
    """Which rows of panels have headings."""
    headed = [any(panel.title for panel in data.panels[at : at + data.columns])
              for at in range(0, len(data.panels), data.columns)]  # fmt: skip
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


def _draw(ax: Axes, panel: Panel, data: FigureData, style: Style, *, linked: bool) -> None:
    for one in panel.series:
        colour = _colour(one, data, style)
        if one.role in (Role.MODEL, Role.LINE):
            at = _needed(one, ax) if one.x.size > _FEW else slice(None)
            if one.spread is not None:
                band(ax, one.x[at], one.y[at], one.spread[at], colour, faint=data.scale is not None)
            (line,) = ax.plot(one.x[at], one.y[at], color=colour, linestyle=load_dashes(one.dash),
                              linewidth=0.8 if one.tyre < 0 else 1.2,
                              label=f"_{one.role}", zorder=2.0)  # fmt: skip
            if one.cards:
                line.set_url(link(one.cards[0], one.tests[0]))
            continue
        if one.spread is not None and one.role is Role.POINTS:
            bars(ax, one.x, one.y, one.spread, colour)
        _marks(ax, one, colour, style, linked=linked)


def _needed(one: Series, ax: Axes) -> IntArray:
    """The points of a dense curve that are enough to draw it, with its band, to a fraction of a line's width.

    A chord over n steps of second difference d is off by about n²d/8.
    """
    edges = [one.y] if one.spread is None else [one.y, one.y - one.spread, one.y + one.spread]
    density = np.zeros(one.x.size)
    for y in edges:
        place = ax.transData.transform(np.column_stack([one.x, np.nan_to_num(y)]))
        bend = np.linalg.norm(np.diff(place, 2, axis=0), axis=1)
        density[1:-1] = np.maximum(density[1:-1], np.sqrt(bend / (8 * _OFF)))
    kept = np.unique(np.floor(np.cumsum(density)), return_index=True)[1]
    return np.union1d(kept, [0, one.x.size - 1])


def _marks(ax: Axes, one: Series, colour: str, style: Style, *, linked: bool) -> None:
    """Draw points; each leads to the card of its test, if they are few enough."""
    lost = one.role is Role.REJECTED
    marker = "X" if lost else pressure_marker(one.marker)
    face = style.look.paper if lost else colour if one.level == one.level else mixed(style.look.paper, colour, 0.75)
    edge = style.look.muted if lost else colour
    if not linked or not one.cards:
        ax.plot(one.x, one.y, linestyle="none", marker=marker, markersize=3.0, color=edge, markerfacecolor=face,
                markeredgewidth=0.6, label=f"_{one.role}", zorder=3.0)  # fmt: skip
        return
    found = ax.scatter(one.x, one.y, s=30.0 if lost else 15.0, marker=marker, facecolors=face, edgecolors=edge,
                       linewidths=0.8, label=f"_{one.role}", zorder=2.5 if lost else 3.0)  # fmt: skip
    found.set_urls([link(card, test) for card, test in zip(one.cards, one.tests, strict=True)])


def _colour(one: Series, data: FigureData, style: Style) -> str:
    if data.scale is not None and one.level == one.level:
        return style.frequency_colour(data.scale.part(one.level))
    if one.tyre < 0:
        return style.look.muted
    colour = style.colour(one.tyre)
    return mixed(mixed(style.look.paper, colour, 0.5), colour, one.shade)


def _extent(panel: Panel) -> Extent:
    """The values of the tests in use with their uncertainties, and the curves; of all tests if none is in use."""
    extent = Extent(positive=True)
    shown = [one for one in panel.series if one.role is not Role.REJECTED] or panel.series
    for one in shown:
        extent.add(one.y, one.spread if one.role is not Role.REJECTED else None)
    return extent


def _joined(extents: Sequence[Extent]) -> Extent:
    return Extent(True, list(chain(*(one.values for one in extents))), list(chain(*(one.bars for one in extents))))


def _limit(ax: Axes, panel: Panel, extent: Extent, style: Style, notes: Notes, *, columns: int) -> None:
    """Set limits and ticks; a panel with labels at the ends of curves has room for them on the right."""
    ticks = 6 if columns < 3 else 4
    low, high = span([one.x for one in panel.series])
    if panel.x.log:
        ax.set_xscale("log")
        every = np.concatenate([one.x[one.x > 0] for one in panel.series] or [np.ones(1)])
        ratio = every.max() / every.min()
        room = ratio**0.04 if ratio > 1.0 + ALIKE else 1.15
        low, high = every.min() / room, every.max() * room
    width = style.width / columns - 0.6
    share = min(_room(panel) * style.font(_LETTER) / 72 / max(width, 0.5), 0.45)
    if share > 0:
        high = low * (high / low) ** (1 / (1 - share)) if panel.x.log else low + (high - low) / (1 - share)
    ax.set_xlim(style.xlim or (low, high))
    limits, steep = steep_limits(extent) if panel.x.log or panel.y.log else (extent.limits(), False)
    if steep:
        ax.set_yscale("log")
    ax.set_ylim(style.ylim or limits)
    if panel.x.log:
        numbered(ax, "x", most=ticks)
    else:
        few_ticks(ax, ticks)
    if steep:
        numbered(ax, "y", most=5)
    else:
        ax.yaxis.set_major_locator(MaxNLocator(5, steps=[1, 2, 2.5, 5, 10]))
    bars = Extent(positive=True)
    for one in panel.series:
        if one.role is Role.POINTS:
            bars.add(one.y, one.spread)
    notes.cut(bars, limits, style)


def _room(panel: Panel) -> int:
    """Length of the longest label at the end of a curve [letters]; 0 without labels."""
    longest = max((len(one.label) for one in panel.series), default=0)
    return max(longest, _LEAST_ROOM) + 1 if longest else 0


def _end_labels(ax: Axes, panel: Panel, style: Style, height: float) -> None:
    """Write the label of each curve at its right end; labels are moved apart, with a line to the end of the curve.

    `height` is that of the panel [pt].
    """
    ends = [(one, *_end(one, ax)) for one in panel.series if one.label]
    ends = sorted((end for end in ends if np.isfinite(end[2])), key=lambda end: -end[1])
    gap = style.font(_LINE) / height
    while ends:
        # Curves that end at about the same place have their labels in one column.
        right = ends[0][1]
        column = [end for end in ends if right - end[1] < _COLUMN]
        # Of curves that end at the same height, the label of the leftmost is the highest.
        column.sort(key=lambda end: (round(end[2], 2), -end[1]))
        ends = ends[len(column) :]
        places = _within(_apart(np.array([end[2] for end in column]), gap), gap)
        for (one, x, y), place in zip(column, places.tolist(), strict=True):
            at = right + 0.02
            if abs(place - y) > 0.3 * gap or right - x > 0.01:
                ax.plot([x + 0.004, at - 0.004], [y, place], color=style.look.muted, linewidth=0.5, label="_leader",
                        transform=ax.transAxes, zorder=1.4)  # fmt: skip
            ax.text(at, place, plain_text(one.label, 34), transform=ax.transAxes, fontsize=style.font(6.6),
                    va="center", ha="left", zorder=4.0)  # fmt: skip


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


def _key(data: FigureData, style: Style) -> Key:
    key, look = Key(), style.look
    for tyre in data.keyed:
        key.line(data.names[tyre], style.colour(tyre), 2.6)
    for rank, text in data.dashes:
        key.line(text, look.muted, linestyle=load_dashes(rank))
    if data.has_band:
        key.band(style)
    if data.rejected:
        key.marker("rejected test", "X", look.muted, look.paper, markersize=6.0)
    return key
