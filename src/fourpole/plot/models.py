"""The model chosen for K*: through the data, with its band and what it leaves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from fourpole import quantities as q
from fourpole.core.arrays import BoolArray, FloatArray
from fourpole.core.condition import axis_of
from fourpole.fitting.modelfile import ConditionFile, ModelEntry, column_of, response
from fourpole.models.data import NORMAL_95
from fourpole.plot.layout import Grid, Key, Notes
from fourpole.plot.panels import Extent, Marks, curve, limit, span, tyre_heading
from fourpole.plot.sheet import Sheet, read_sheet, spread
from fourpole.plot.style import Style, load_dashes, mixed, plain_text, pressure_marker
from fourpole.study.results import Results

__all__ = ["band", "heading", "key_of_band", "models", "numbered", "share", "steep", "steep_limits"]

_MOST_COLUMNS = 4
#: Conditions of a panel: over less than a decade more bands than this melt into one.
_MOST_SERIES, _MOST_WIDE = 3, 5
#: Beyond a decade of frequency its axis is logarithmic; beyond this ratio of K' or K'' theirs is.
_DECADE, _STEEP = 10.0, 20.0
#: Points of a line, over more than a decade and less.
_GRID_WIDE, _GRID = 121, 51
_LEAST_INK = 0.5
#: Residuals that most lie within, and the least that their axis shows.
_USUAL, _LEAST_SHOWN = 2.0, 3.0
_CORRELATION = q.CORR_K.head
_STATED = (q.PRESSURE.head, q.PRELOAD.head)


@dataclass(frozen=True)
class _Drawn:
    """A condition of a model: where it stands among the others, and the tests that it was fitted to."""

    entry: ModelEntry
    at: int
    tyre: int
    pressure: int
    load: int
    others: tuple[tuple[str, float], ...]
    rows: BoolArray

    @property
    def series(self) -> tuple[int, tuple[float, ...]]:
        """What tells it from the others of its panel, in the order of a key."""
        return self.pressure, tuple(value for _, value in self.others)

    @property
    def band(self) -> tuple[float, float]:
        """Lowest and highest frequency fitted [Hz]."""
        return self.entry.conditions[self.at].band


@dataclass(frozen=True)
class _Curves:
    """A condition as it is drawn: points, the model's line and band in the units of the axes, and what is left."""

    frequency: FloatArray
    values: tuple[FloatArray, FloatArray]
    stds: tuple[FloatArray, FloatArray]
    residuals: tuple[FloatArray, FloatArray]
    grid: FloatArray
    line: tuple[FloatArray, FloatArray]
    half: tuple[FloatArray, FloatArray]


def models(results: Results, style: Style) -> Figure | None:
    """The chosen model of each tyre through K' and K'', and below it what it leaves, in standard units."""
    if results.models is None:
        return None
    sheet = read_sheet(results, texts_only=True)
    found = [one for entry in results.models.models for one in _conditions(entry, sheet)]
    if not found:
        return None
    notes, key = Notes(), Key()
    places = sorted({(one.load, one.tyre) for one in found})
    columns = min(_MOST_COLUMNS, len(places))
    notes.chosen(columns, len(places), "pairs of tyre and preload")
    places = places[:columns]
    found = [one for one in found if (one.load, one.tyre) in places]
    every = sorted({one.series for one in found})
    shown = [every[at] for at in spread(len(every), _MOST_WIDE if _logarithmic(found) else _MOST_SERIES)]
    notes.chosen(len(shown), len(every), "pressures" if _by_pressure(found) else "conditions of each")
    found = [one for one in found if one.series in shown]
    curves = [_curves(one, sheet) for one in found]
    log = _logarithmic(found)
    grid = Grid.of(4 * columns, columns, panel_height=1.5, style=style)
    for row in range(4):
        limits = _row_limits([part for one in curves for part in _row(one, row)], residual=row > 1, log=log)
        for column, place in enumerate(places):
            ax = grid.panels[row * columns + column]
            for one, drawn in zip(found, curves, strict=True):
                if (one.load, one.tyre) == place:
                    marks = _marks(one, found, sheet, style)
                    # The line is as pale as the marker, but never so pale that it is lost.
                    line = mixed(marks.face or marks.colour, marks.colour, _LEAST_INK)
                    _draw_condition(ax, drawn, row, marks, line)
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
    key_of_band(key, style)
    _say(notes, found, curves)
    labels = [q.STORAGE.label, q.LOSS.label, "residual K' [1]", "residual K'' [1]"]
    return grid.finish(key=key, notes=notes, x_label=q.FREQUENCY.label, y_labels=labels, headings="top")


def _conditions(entry: ModelEntry, sheet: Sheet) -> list[_Drawn]:
    if entry.tyre not in sheet.names:
        return []
    tyre = sheet.names.index(entry.tyre)
    found = []
    for at, one in enumerate(entry.conditions):
        state = {column_of(each.name, each.unit): each.value for each in one.state}
        others = tuple((column, value) for column, value in state.items() if column not in _STATED)
        pressure, load = (
            groups.nearest(state[column]) if column in state else len(groups) - 1
            for groups, column in zip((sheet.pressures, sheet.loads), _STATED, strict=True)
        )
        rows = _rows(one, state, sheet) & (sheet.tyre == tyre)
        found.append(_Drawn(entry, at, tyre, pressure, load, others, rows))
    return found


def _rows(one: ConditionFile, state: dict[str, float], sheet: Sheet) -> BoolArray:
    """The tests of a condition by name; where they have none, by where they stand."""
    if one.tests:
        return np.isin(np.array(sheet.table["test"].to_list(), dtype=object).astype(str), one.tests)
    frequency = sheet.values(q.FREQUENCY.head)
    mask = (frequency >= one.band[0] * (1 - 1e-9)) & (frequency <= one.band[1] * (1 + 1e-9))
    for column, value in state.items():
        mask &= np.array([axis_of(column).same(own, value) for own in sheet.values(column).tolist()], dtype=bool)
    return np.asarray(mask)


def _curves(one: _Drawn, sheet: Sheet) -> _Curves:
    frequency = sheet.values(q.FREQUENCY.head)[one.rows]
    order = np.argsort(frequency, kind="stable")
    frequency = frequency[order]
    shown = [sheet.shown(quantity) for quantity in (q.STORAGE, q.LOSS)]
    real, imag = (value[one.rows][order] for value, _ in shown)
    stds = tuple(std[one.rows][order] for _, std in shown)
    low, high = one.band
    grid = np.geomspace(low, high, _GRID_WIDE) if high > _DECADE * low else np.linspace(low, high, _GRID)
    line, spread_of_line = response(one.entry, one.at, grid)
    foretold, doubt = response(one.entry, one.at, frequency)
    correlation = np.nan_to_num(sheet.values(_CORRELATION)[one.rows][order])
    off = np.stack([real, imag], axis=1) - np.stack([foretold.real, foretold.imag], axis=1) / q.STORAGE.scale
    whole = doubt / q.STORAGE.scale**2 + _data_covariance(stds[0], stds[1], correlation)
    left = whitened(off, whole)
    half = NORMAL_95 / q.STORAGE.scale * np.sqrt(np.diagonal(spread_of_line, axis1=1, axis2=2))
    return _Curves(
        frequency,
        (real, imag),
        (stds[0], stds[1]),
        (left[:, 0], left[:, 1]),
        grid,
        (line.real / q.STORAGE.scale, line.imag / q.STORAGE.scale),
        (half[:, 0], half[:, 1]),
    )


def _data_covariance(first: FloatArray, second: FloatArray, correlation: FloatArray) -> FloatArray:
    """Covariance (N, 2, 2) of K' and K''; none where it is not stated."""
    a, b = np.nan_to_num(first), np.nan_to_num(second)
    cross = correlation * a * b
    return np.stack([np.stack([a**2, cross], -1), np.stack([cross, b**2], -1)], -2)


def whitened(off: FloatArray, covariance: FloatArray) -> FloatArray:
    """Pairs (N, 2) in standard units, made independent while each stays as near to its own as can be.

    Examples
    --------
    >>> whitened(np.array([[2.0, 3.0]]), np.array([[[4.0, 0.0], [0.0, 9.0]]]))
    array([[1., 1.]])
    """
    std = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
    with np.errstate(divide="ignore", invalid="ignore"):
        own = off / std
        rho = np.clip(covariance[:, 0, 1] / (std[:, 0] * std[:, 1]), -1 + 1e-9, 1 - 1e-9)
        both = (own[:, 0] + own[:, 1]) / np.sqrt(1 + rho)
        between = (own[:, 0] - own[:, 1]) / np.sqrt(1 - rho)
    return np.asarray(np.stack([both + between, both - between], axis=1) / 2)


def _row(one: _Curves, row: int) -> list[tuple[FloatArray, FloatArray]]:
    """What a row shows: points with their standard uncertainties, the line with its band."""
    if row > 1:
        return [(one.residuals[row - 2], np.zeros(one.frequency.size))]
    return [(one.values[row], one.stds[row]), (one.line[row], one.half[row])]


def _row_limits(
    shown: Sequence[tuple[FloatArray, FloatArray]], *, residual: bool, log: bool
) -> tuple[tuple[float, float], bool]:
    """Limits of a row of panels, and whether they are logarithmic."""
    if residual:
        sizes = np.concatenate([np.abs(points[np.isfinite(points)]) for points, _ in shown])
        top = max(1.12 * float(sizes.max(initial=0.0)), _LEAST_SHOWN)
        return (-top, top), False
    extent = Extent()
    for values, spreads in shown:
        extent.add(values, spreads)
    return steep_limits(extent) if log else (extent.limits(), False)


def steep_limits(extent: Extent) -> tuple[tuple[float, float], bool]:
    """Limits, and whether the values range so widely that they need a logarithmic axis."""
    seen = np.concatenate(extent.values) if extent.values else np.zeros(0)
    if seen.size and seen.min() > 0 and seen.max() > _STEEP * seen.min():
        room = (seen.max() / seen.min()) ** 0.06
        return (float(seen.min() / room), float(seen.max() * room)), True
    return extent.limits(), False


def _draw_condition(ax: Axes, one: _Curves, row: int, marks: Marks, line: str) -> None:
    if row > 1:
        curve(ax, one.frequency, one.residuals[row - 2], marks=marks)
        return
    curve(ax, one.frequency, one.values[row], marks=marks, std=one.stds[row])
    band(ax, one.grid, one.line[row], one.half[row], marks.colour)
    ax.plot(one.grid, one.line[row], color=line, linestyle=marks.dashes, linewidth=1.1, label="_model", zorder=2.0)


def band(ax: Axes, x: FloatArray, y: FloatArray, half: FloatArray, colour: str) -> Axes:
    """The 95 % band about a line, with an edge that can be told where several lie over each other."""
    known = np.isfinite(y) & np.isfinite(half)
    ax.fill_between(x, y - half, y + half, where=known, facecolor=to_rgba(colour, 0.14),
                    edgecolor=to_rgba(colour, 0.45), linewidth=0.5, label="_band", zorder=1.2)  # fmt: skip
    return ax


def _usual(ax: Axes, style: Style) -> None:
    """Zero, and where most residuals should lie."""
    ax.axhline(0.0, color=style.look.muted, linewidth=0.8, label="_zero", zorder=1.1)
    for level in (-_USUAL, _USUAL):
        ax.axhline(level, color=style.look.muted, linewidth=0.8, linestyle=(0.0, (4.0, 2.0)), label="_usual",
                   zorder=1.1)  # fmt: skip


def _logarithmic(found: Sequence[_Drawn]) -> bool:
    return max(one.band[1] for one in found) > _DECADE * min(one.band[0] for one in found)


def _finish_panel(
    ax: Axes,
    found: Sequence[_Drawn],
    limits: tuple[tuple[float, float], bool],
    style: Style,
    *,
    log: bool,
    ticks: int,
) -> None:
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
    """A logarithmic ordinate."""
    ax.set_yscale("log")
    ax.set_ylim(style.ylim if style.ylim and min(style.ylim) > 0 else limits)
    numbered(ax, "y", most=5)


def numbered(ax: Axes, which: str, most: int) -> None:
    """Numbers as people write them on a logarithmic axis: at 2 and 5 too, where there are few decades."""
    axis = ax.xaxis if which == "x" else ax.yaxis
    low, high = sorted(ax.get_xlim() if which == "x" else ax.get_ylim())
    few = high < 100 * low
    axis.set_major_locator(LogLocator(10.0, subs=(1.0, 2.0, 5.0) if few else (1.0,), numticks=most + 2))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_locator(LogLocator(10.0, subs=tuple(range(2, 10)), numticks=200))
    axis.set_minor_formatter(NullFormatter())


def heading(ax: Axes, sheet: Sheet, model: str, tyre: int, right: str, style: Style, columns: int) -> None:
    """Name of the tyre above a panel; that of the model where the tyre has none."""
    name = sheet.labels[tyre] if sheet.names[tyre] else model
    tyre_heading(ax, name, style.colour(tyre), right, style=style, columns=columns)


def _by_pressure(found: Sequence[_Drawn]) -> bool:
    """Whether conditions of a panel differ in pressure alone."""
    return len({one.series[1] for one in found}) < 2


def _rank(one: _Drawn, found: Sequence[_Drawn], sheet: Sheet) -> tuple[int, int]:
    """Place among the series, and how many there are: that of the pressure where nothing else differs."""
    if _by_pressure(found):
        return one.pressure, len(sheet.pressures)
    every = sorted({each.series for each in found})
    return every.index(one.series), len(every)


def _marks(one: _Drawn, found: Sequence[_Drawn], sheet: Sheet, style: Style) -> Marks:
    rank, count = _rank(one, found, sheet)
    face = style.face(one.tyre, rank, count)
    return Marks(style.colour(one.tyre), pressure_marker(rank), face, load_dashes(one.load), joined=False)


def share(part: float) -> str:
    """A relative error in per cent."""
    return f"{100 * part:.2g} %"


def _model_keys(key: Key, found: Sequence[_Drawn], sheet: Sheet, style: Style) -> None:
    """Which model each tyre has, and what was granted to it."""
    for tyre, entry in {one.tyre: one.entry for one in sorted(found, key=lambda one: one.tyre)}.items():
        granted = f", granted {share(entry.granted)}" if entry.granted > 0 else ""
        name = f"{sheet.labels[tyre]}: " if sheet.names[tyre] else ""
        handle = Line2D([], [], color=style.colour(tyre), linewidth=2.6)
        key.add(handle, f"{name}{plain_text(entry.model)}{granted}")


def _series_keys(
    key: Key, found: Sequence[_Drawn], shown: Sequence[tuple[int, tuple[float, ...]]], sheet: Sheet, style: Style
) -> None:
    if _by_pressure(found):
        key.pressures(sheet, [series[0] for series in shown], style)
        return
    for series in shown:
        one = next(each for each in found if each.series == series)
        rank, count = _rank(one, found, sheet)
        handle = Line2D([], [], linestyle="none", marker=pressure_marker(rank), color=style.look.muted,
                        markerfacecolor=style.neutral_face(rank, count))  # fmt: skip
        pressure = [] if np.isnan(sheet.pressures.values[one.pressure]) else [sheet.pressures.labels[one.pressure]]
        key.add(handle, ", ".join([*pressure, *(_other(column, value) for column, value in one.others)]))


def _other(column: str, value: float) -> str:
    """A condition besides pressure and preload, in words."""
    name, _, unit = column.removesuffix("]").partition(" [")
    if name == "temperature":
        return f"{value:.4g} °C"
    return plain_text(f"{name} {value:.4g} {'' if unit == '1' else unit}".rstrip())


def key_of_band(key: Key, style: Style) -> None:
    """The band's entry."""
    key.add(Patch(facecolor=style.look.muted, alpha=0.35, linewidth=0.0), "95 % band")


def _say(notes: Notes, found: Sequence[_Drawn], curves: Sequence[_Curves]) -> None:
    left = np.concatenate([np.concatenate(one.residuals) for one in curves])
    left = left[np.isfinite(left)]
    if left.size:
        outside = int(np.sum(np.abs(left) > _USUAL))
        notes.say(
            f"residuals are in standard uncertainties of measurement and model together; {outside} of {left.size} "
            f"are beyond ±{_USUAL:g}"
        )
    if any(one.entry.granted > 0 for one in found):
        notes.say("granted: relative error that the model was allowed so that it fits; it is in the band")
