"""The figure of the chosen model: K* and the model with its 95 % band, and the residuals."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter, NullLocator

from fourpole import quantities as q
from fourpole.core.arrays import BoolArray, ByValue, FloatArray
from fourpole.core.confidence import NORMAL_95
from fourpole.fitting.amplitude import COLUMN, amplitudes_of, levels_of
from fourpole.fitting.modelfile import ConditionFile, ModelEntry, ModelFile
from fourpole.fitting.query import response
from fourpole.fitting.rows import keys_of
from fourpole.plot.figure import FigureSpec
from fourpole.plot.layout import Grid, Key, Notes
from fourpole.plot.panels import Extent, Marks, band, curve, limit, span, tyre_heading
from fourpole.plot.sheet import Sheet, read_sheet, texts
from fourpole.plot.style import Dashes, Style, load_dashes, mixed, plain_text, pressure_marker
from fourpole.study.results import Results

_MOST_COLUMNS = 4
#: Largest number of conditions in a panel: over less than a decade of frequency, where bands overlap, and over more.
_MOST_SERIES, _MOST_WIDE = 3, 5
#: Amplitudes of the deflection within this ratio are one series.
_LEVEL = 1.3
#: Ratios of the ends of an axis beyond which it is logarithmic: of frequency, and of K' or K''.
_DECADE, _STEEP = 10.0, 20.0
#: Number of points of a model's line over more than a decade of frequency, and over less.
_GRID_WIDE, _GRID = 121, 51
#: Smallest share of the tyre's colour in the colour of a model's line.
_LEAST_INK = 0.5
#: Bound that about 95 % of residuals lie within, and smallest end of their axis, in standard uncertainties.
_USUAL, _LEAST_SHOWN = 2.0, 3.0
#: Numbers of an axis beyond this, or below its inverse, are powers of ten; no minor ticks over a larger ratio of ends.
_LONG, _MANY = 3e5, 1e12
_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_STATED = (q.PRESSURE.head, q.PRELOAD.head)


@dataclass(frozen=True, eq=False)
class Drawn(ByValue):
    """A condition of a model: its groups in the sheet, its values on further axes, and the tests it was fitted to."""

    entry: ModelEntry
    at: int
    tyre: int
    pressure: int
    load: int
    others: tuple[tuple[str, float], ...]
    rows: BoolArray
    amplitude: float | None = None

    @property
    def series(self) -> tuple[int, tuple[float, ...]]:
        """Index of the pressure and values on further axes, in which the conditions of a panel differ."""
        return self.pressure, tuple(value for _, value in self.others)

    @property
    def band(self) -> tuple[float, float]:
        """Lowest and highest frequency fitted [Hz]."""
        return self.entry.conditions[self.at].band


@dataclass(frozen=True, eq=False)
class Curves(ByValue):
    """One condition: points, line and half-width of the band of the model in the units of the axes; residuals."""

    frequency: FloatArray
    values: tuple[FloatArray, FloatArray]
    stds: tuple[FloatArray, FloatArray]
    residuals: tuple[FloatArray, FloatArray]
    grid: FloatArray
    line: tuple[FloatArray, FloatArray]
    half: tuple[FloatArray, FloatArray]


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


def conditions_of(entry: ModelEntry, sheet: Sheet, file: ModelFile) -> list[Drawn]:
    """The conditions of a model; none if its tyre is in no table."""
    if entry.tyre not in sheet.names:
        return []
    tyre = sheet.names.index(entry.tyre)
    found = []
    for at, one in enumerate(entry.conditions):
        state = {each.column: each.value for each in one.state}
        others = tuple((column, value) for column, value in state.items() if column not in _STATED)
        pressure, load = (
            groups.nearest(state[column]) if column in state else len(groups) - 1
            for groups, column in zip((sheet.pressures, sheet.loads), _STATED, strict=True)
        )
        rows = _rows(one, state, sheet, file) & (sheet.tyre == tyre)
        drawn = Drawn(entry, at, tyre, pressure, load, others, rows)
        found += _by_level(drawn, sheet) if one.amplitude is not None else [drawn]
    return found


def _by_level(drawn: Drawn, sheet: Sheet) -> list[Drawn]:
    """A condition of a model that depends on the amplitude of the deflection, once for each level of it."""
    amplitude = amplitudes_of(sheet.table)
    rows = np.flatnonzero(drawn.rows & np.isfinite(amplitude) & (np.nan_to_num(amplitude) > 0))
    level, found = levels_of(amplitude[rows], _LEVEL), []
    for one in np.unique(level):
        here = np.zeros(amplitude.size, dtype=bool)
        here[rows[level == one]] = True
        middle = float(np.exp(np.mean(np.log(amplitude[here]))))
        found.append(
            replace(drawn, others=(*drawn.others, (COLUMN, float(f"{middle:.2g}"))), rows=here, amplitude=middle)
        )
    return found


def _rows(one: ConditionFile, state: dict[str, float], sheet: Sheet, file: ModelFile) -> BoolArray:
    """The rows that a condition was fitted to: by the names of tests, or, for tests without a name, by the state.

    If the model file does not have the points, those of a test with several points are those in the band fitted.
    """
    frequency = sheet.values(q.FREQUENCY.head)
    mask = (frequency >= one.band[0] * (1 - 1e-9)) & (frequency <= one.band[1] * (1 + 1e-9))
    if one.tests:
        if one.points:
            used = {*zip(one.tests, one.points, strict=True)}
            return np.array([key in used for key in keys_of(sheet.table)], dtype=bool)
        names = np.array(texts(sheet.table, q.TEST.head), dtype=object)
        points = Counter(names.tolist())
        single = np.array([points[name] == 1 for name in names], dtype=bool)
        return np.isin(names.astype(str), one.tests) & (single | (mask & ~sheet.rejected))
    for column, value in state.items():
        mask &= np.array([file.axis(column).same(own, value) for own in sheet.values(column).tolist()], dtype=bool)
    return np.asarray(mask)


def curves_of(one: Drawn, sheet: Sheet) -> Curves:
    """Points, line, band and residuals of a condition."""
    rows = np.flatnonzero(one.rows)
    frequency = sheet.values(q.FREQUENCY.head)
    rows = rows[np.argsort(frequency[rows], kind="stable")]
    frequency = frequency[rows]
    (real, real_std), (imag, imag_std) = (
        (value[rows], std[rows]) for value, std in (sheet.shown(quantity) for quantity in (q.STORAGE, q.LOSS))
    )
    low, high = one.band
    grid = np.geomspace(low, high, _GRID_WIDE) if high > _DECADE * low else np.linspace(low, high, _GRID)
    moved = None if one.amplitude is None else np.full(grid.size, one.amplitude)
    line, line_covariance = response(one.entry, one.at, grid, moved)
    own = None if one.amplitude is None else amplitudes_of(sheet.table)[rows]
    predicted, covariance = response(one.entry, one.at, frequency, own)
    correlation = np.nan_to_num(sheet.values(q.CORR_K.head)[rows])
    off = np.stack([real - predicted.real / q.STORAGE.scale, imag - predicted.imag / q.STORAGE.scale], axis=1)
    residuals = whitened(off, covariance / q.STORAGE.scale**2 + _data_covariance(real_std, imag_std, correlation))
    half = NORMAL_95 / q.STORAGE.scale * np.sqrt(np.diagonal(line_covariance, axis1=1, axis2=2))
    return Curves(
        frequency=frequency,
        values=(real, imag),
        stds=(real_std, imag_std),
        residuals=(residuals[:, 0], residuals[:, 1]),
        grid=grid,
        line=(line.real / q.STORAGE.scale, line.imag / q.STORAGE.scale),
        half=(half[:, 0], half[:, 1]),
    )


def _data_covariance(first: FloatArray, second: FloatArray, correlation: FloatArray) -> FloatArray:
    """Covariance (N, 2, 2) of K' and K''; zero for uncertainties that are not stated."""
    a, b = np.nan_to_num(first), np.nan_to_num(second)
    cross = correlation * a * b
    return np.stack([np.stack([a**2, cross], -1), np.stack([cross, b**2], -1)], -2)


def whitened(off: FloatArray, covariance: FloatArray) -> FloatArray:
    """Pairs (N, 2) divided by the symmetric square root of their correlation: uncorrelated, in standard uncertainties.

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


def steep_limits(extent: Extent) -> tuple[tuple[float, float], bool]:
    """Limits, and whether the axis is logarithmic because the ratio of the largest to the smallest value is large."""
    values = np.concatenate(extent.values) if extent.values else np.zeros(0)
    if values.size and values.min() > 0 and values.max() > _STEEP * values.min():
        room = (values.max() / values.min()) ** 0.06
        return (float(values.min() / room), float(values.max() * room)), True
    return extent.limits(), False


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
    return max(one.band[1] for one in found) > _DECADE * min(one.band[0] for one in found)


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


def numbered(ax: Axes, which: str, most: int) -> None:
    """Numbers on a logarithmic axis, "x" or "y": at 1, 2 and 5 over less than two decades, otherwise at 1.

    They are powers of ten where plain numbers would be long.
    """
    axis = ax.xaxis if which == "x" else ax.yaxis
    low, high = sorted(ax.get_xlim() if which == "x" else ax.get_ylim())
    few = high < 100 * low
    axis.set_major_locator(LogLocator(10.0, subs=(1.0, 2.0, 5.0) if few else (1.0,), numticks=most + 2))
    long = not few and (high > _LONG or low < 1 / _LONG)
    axis.set_major_formatter(FuncFormatter(_power_of_ten if long else lambda value, _: f"{value:g}"))
    axis.set_minor_locator(LogLocator(10.0, subs=tuple(range(2, 10)), numticks=200))
    if high > _MANY * low:
        axis.set_minor_locator(NullLocator())
    axis.set_minor_formatter(NullFormatter())


def _power_of_ten(value: float, _: int) -> str:
    """A power of ten with a raised exponent."""
    return f"10{str(round(np.log10(value))).translate(_RAISED)}"


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
