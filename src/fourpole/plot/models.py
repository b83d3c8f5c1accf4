"""The figure of the chosen model: K* and the model with its 95 % band, and the residuals."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from fourpole import quantities as q
from fourpole.core.arrays import FloatArray
from fourpole.fitting.amplitude import COLUMN
from fourpole.plot.figure import FigureSpec
from fourpole.plot.fitted import DECADE, Curves, Drawn, conditions_of, curves_of
from fourpole.plot.layout import Grid, Key, Notes
from fourpole.plot.names import plain_text
from fourpole.plot.panels import Extent, Marks, band, curve, limit, numbered, span, steep_limits, tyre_heading
from fourpole.plot.sheet import Sheet, read_sheet
from fourpole.plot.style import Dashes, Style, load_dashes, mixed, pressure_marker
from fourpole.study.results import Results

_MOST_COLUMNS = 4
#: Largest number of conditions in a panel: over less than a decade of frequency, where bands overlap, and over more.
_MOST_SERIES, _MOST_WIDE = 3, 5
#: Smallest share of the tyre's colour in the colour of a model's line.
_LEAST_INK = 0.5
#: Bound that about 95 % of residuals lie within, and smallest end of their axis, in standard uncertainties.
_USUAL, _LEAST_SHOWN = 2.0, 3.0


def models(results: Results, style: Style) -> Figure | None:
    """K' and K'' with the chosen model of each tyre, and below them the residuals in standard uncertainties."""
    if results.models is None:
        return None
    sheet = read_sheet(results, texts_only=True)
    found = [one for entry in results.models.models for one in conditions_of(entry, sheet, results.models)]
    if not found:
        return None
    notes, key = Notes(), Key()
    places = sorted({(one.load, one.tyre) for one in found})
    places = notes.first(places, _MOST_COLUMNS, "pairs of tyre and preload")
    columns = len(places)
    found = [one for one in found if (one.load, one.tyre) in places]
    every = sorted({one.series for one in found})
    most = _MOST_WIDE if _logarithmic(found) else _MOST_SERIES
    shown = notes.some(every, most, "pressures" if _by_pressure(found) else "conditions of each")
    found = [one for one in found if one.series in shown]
    curves = [curves_of(one, sheet) for one in found]
    log = _logarithmic(found)
    grid = Grid.of(4 * columns, columns, panel_height=1.5, style=style)
    for row in range(4):
        limits = _row_limits([part for one in curves for part in _row(one, row)], residual=row > 1, log=log)
        for column, place in enumerate(places):
            ax = grid.panels[row * columns + column]
            for one, drawn in zip(found, curves, strict=True):
                if (one.load, one.tyre) == place:
                    marks = _marks(one, found, sheet, style)
                    _draw_condition(ax, drawn, row, marks)
            if row > 1:
                _usual(ax, style)
            own = Style(style.theme, style.xlim, None if row > 1 else style.ylim)
            _finish_panel(ax, found, limits, own, log=log, ticks=6 if columns < 3 else 4)
            if row == 0:
                load, tyre = place
                entry = next(one.entry for one in found if (one.load, one.tyre) == place)
                heading(ax, sheet, entry.model, tyre, sheet.name_of_load(load), style, columns)
    _model_keys(key, found, sheet, style)
    _series_keys(key, found, shown, sheet, style)
    key.band(style)
    _say(notes, found, curves)
    labels = [q.STORAGE.label, q.LOSS.label, "residual K' [1]", "residual K'' [1]"]
    return grid.finish(key=key, notes=notes, x_label=q.FREQUENCY.label, y_labels=labels, headings="top")


def _row(one: Curves, row: int) -> list[tuple[FloatArray, FloatArray]]:
    """Values and uncertainties that a row of panels shows: of the points, and of the model's line."""
    if row > 1:
        return [(one.residuals[row - 2], np.zeros(one.frequency.size))]
    return [(one.values[row], one.stds[row]), (one.line[row], one.half[row])]


def _row_limits(
    shown: Sequence[tuple[FloatArray, FloatArray]], *, residual: bool, log: bool
) -> tuple[tuple[float, float], bool]:
    """Limits of a row of panels, and whether its axis is logarithmic."""
    if residual:
        sizes = np.concatenate([np.abs(points[np.isfinite(points)]) for points, _ in shown])
        top = max(1.12 * float(sizes.max(initial=0.0)), _LEAST_SHOWN)
        return (-top, top), False
    extent = Extent()
    for values, spreads in shown:
        extent.add(values, spreads)
    return steep_limits(extent) if log else (extent.limits(), False)


def _draw_condition(ax: Axes, one: Curves, row: int, marks: Marks) -> None:
    """Draw the points of a condition, and in the rows of K' and K'' the model's line with its band."""
    if row > 1:
        curve(ax, one.frequency, one.residuals[row - 2], marks=marks)
        return
    curve(ax, one.frequency, one.values[row], marks=marks, std=one.stds[row])
    band(ax, one.grid, one.line[row], one.half[row], marks.colour)
    # The line is as pale as the fill of the marker, mixed with the tyre's colour so that it stays visible.
    line = mixed(marks.face or marks.colour, marks.colour, _LEAST_INK)
    ax.plot(one.grid, one.line[row], color=line, linestyle=marks.dashes, linewidth=1.1, label="_model", zorder=2.0)


def _usual(ax: Axes, style: Style) -> None:
    """Draw lines at zero and at the bounds that about 95 % of residuals lie within."""
    dashed: Dashes = (0.0, (4.0, 2.0))
    for level, dashes, label in ((0.0, "solid", "_zero"), (-_USUAL, dashed, "_usual"), (_USUAL, dashed, "_usual")):
        ax.axhline(level, color=style.look.muted, linewidth=0.8, linestyle=dashes, label=label, zorder=1.1)


def _logarithmic(found: Sequence[Drawn]) -> bool:
    """Whether the axis of frequency is logarithmic."""
    return max(one.band[1] for one in found) > DECADE * min(one.band[0] for one in found)


def _finish_panel(
    ax: Axes,
    found: Sequence[Drawn],
    limits: tuple[tuple[float, float], bool],
    style: Style,
    *,
    log: bool,
    ticks: int,
) -> None:
    """Set the limits of a panel, and make its axes logarithmic if the row or the frequencies need it."""
    ends = np.array([end for one in found for end in one.band])
    limit(ax, span([ends]), limits[0], style=style, ticks=ticks)
    if log:
        ax.set_xscale("log")
        room = (ends.max() / ends.min()) ** 0.04
        ax.set_xlim(style.xlim if style.xlim and min(style.xlim) > 0 else (ends.min() / room, ends.max() * room))
        numbered(ax, "x", most=ticks)
    if limits[1]:
        steep(ax, limits[0], style)


def steep(ax: Axes, limits: tuple[float, float], style: Style) -> None:
    """Make the ordinate logarithmic."""
    ax.set_yscale("log")
    ax.set_ylim(style.ylim if style.ylim and min(style.ylim) > 0 else limits)
    numbered(ax, "y", most=5)


def heading(ax: Axes, sheet: Sheet, model: str, tyre: int, right: str, style: Style, columns: int) -> None:
    """Write the name of the tyre above a panel, or the name of the model if the tyre has none."""
    name = sheet.labels[tyre] if sheet.names[tyre] else model
    tyre_heading(ax, name, style.colour(tyre), right, style=style, columns=columns)


def _by_pressure(found: Sequence[Drawn]) -> bool:
    """Whether the conditions of a panel differ in pressure alone."""
    return len({one.series[1] for one in found}) < 2


def _rank(one: Drawn, found: Sequence[Drawn], sheet: Sheet) -> tuple[int, int]:
    """Rank of a condition among the conditions of a panel, and their number; of pressures if only these differ."""
    if _by_pressure(found):
        return one.pressure, len(sheet.pressures)
    every = sorted({each.series for each in found})
    return every.index(one.series), len(every)


def _marks(one: Drawn, found: Sequence[Drawn], sheet: Sheet, style: Style) -> Marks:
    rank, count = _rank(one, found, sheet)
    face = style.face(one.tyre, rank, count)
    return Marks(style.colour(one.tyre), pressure_marker(rank), face, load_dashes(one.load), joined=False)


def share(part: float) -> str:
    """A relative error as text in per cent."""
    return f"{100 * part:.2g} %"


def _model_keys(key: Key, found: Sequence[Drawn], sheet: Sheet, style: Style) -> None:
    """Add the model of each tyre to the key, with its model discrepancy."""
    for tyre, entry in {one.tyre: one.entry for one in sorted(found, key=lambda one: one.tyre)}.items():
        discrepancy = f", model discrepancy {share(entry.discrepancy)}" if entry.discrepancy > 0 else ""
        key.line(f"{model_of(sheet, tyre)}{plain_text(entry.model)}{discrepancy}", style.colour(tyre), 2.6)


def model_of(sheet: Sheet, tyre: int) -> str:
    """The name of a tyre before that of its model in a key; empty if the tyre has no name."""
    return f"{sheet.labels[tyre]}: " if sheet.names[tyre] else ""


def _series_keys(
    key: Key, found: Sequence[Drawn], shown: Sequence[tuple[int, tuple[float, ...]]], sheet: Sheet, style: Style
) -> None:
    """Add the markers of the conditions to the key."""
    if _by_pressure(found):
        key.pressures(sheet, [series[0] for series in shown], style)
        return
    for series in shown:
        one = next(each for each in found if each.series == series)
        rank, count = _rank(one, found, sheet)
        pressure = [] if np.isnan(sheet.pressures.values[one.pressure]) else [sheet.pressures.labels[one.pressure]]
        label = ", ".join([*pressure, *(_other(column, value) for column, value in one.others)])
        key.marker(label, pressure_marker(rank), style.look.muted, style.neutral_face(rank, count))


def _other(column: str, value: float) -> str:
    """The value of a further axis of the condition, as the key has it."""
    name, _, unit = column.removesuffix("]").partition(" [")
    if column == COLUMN:
        return f"amplitude {1e3 * value:.3g} mm"
    if name == "temperature":
        return f"{value:.4g} °C"
    return plain_text(f"{name} {value:.4g} {'' if unit == '1' else unit}".rstrip())


def _say(notes: Notes, found: Sequence[Drawn], curves: Sequence[Curves]) -> None:
    left = np.concatenate([np.concatenate(one.residuals) for one in curves])
    left = left[np.isfinite(left)]
    if left.size:
        outside = int(np.sum(np.abs(left) > _USUAL))
        notes.say(
            f"residuals are in standard uncertainties of measurement and model together; {outside} of {left.size} "
            f"are beyond ±{_USUAL:g}"
        )
    if any(one.entry.discrepancy > 0 for one in found):
        notes.say("model discrepancy: relative error of K* with which chi-square equals its degrees of freedom")


#: Figures of this module, in the order of a report.
FIGURES = (
    FigureSpec(
        "model",
        "The chosen model through the data",
        "K' and K'' of each tyre with standard uncertainties, the model's line with its 95 % band, and below the "
        "residuals in standard uncertainties; dashed lines are at ±2.",
        models,
    ),
)
