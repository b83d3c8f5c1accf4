"""Figures of rides, of two results compared, and of a master curve."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import polars as pl
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

from fourpole import quantities as q
from fourpole.core.arrays import ComplexArray, FloatArray
from fourpole.core.confidence import COVERAGE_FACTOR, NORMAL_95
from fourpole.fitting.shifting import TyreShift
from fourpole.plot.data import AxisData, FigureData, Panel, Role, Series, plain_text
from fourpole.plot.drawn import figure_of
from fourpole.plot.layout import WIDTH, new_figure, parts_of
from fourpole.plot.panels import power_of_ten
from fourpole.plot.style import Style, drawing
from fourpole.quantities import Quantity
from fourpole.ride.comfort import weighting
from fourpole.ride.compare import RideComparison

#: Largest number of tyres that are drawn, of points of a curve, and range of spectra that is shown.
_MOST, _POINTS, _DECADES = 6, 5000, 1e-3
#: Length of a ride that is shown whole, and of the part that is shown of a longer one [s].
_WHOLE, _PART = 6.0, 3.0
#: Share of the largest weighted acceleration until which a short ride is shown.
_LEFT = 0.005
_FREQUENCY = AxisData("frequency", "Hz", log=True)
_TIME = AxisData("time", "s")


def ride_figure(found: RideComparison, labels: Sequence[str], notes: Sequence[str] = ()) -> FigureData:
    """The rides as data: of spectra where the road has one, otherwise over time."""
    shown = list(range(min(len(labels), _MOST)))
    left_out = [f"{len(shown)} of {len(labels)} tyres shown"] if len(shown) < len(labels) else []
    part, said = (slice(None), "") if found.spectra else _shown_part(found)
    left_out += filter(None, [said])
    panels = _spectra(found, shown) if found.spectra else _series(found, shown, part)
    return FigureData(
        panels=panels, columns=1 if found.series else 2, names=tuple(labels), keyed=tuple(shown),
        notes=(*notes, *left_out), panel_height=2.0 if found.series else 3.0, shared=False,
    )  # fmt: skip


def _spectra(found: RideComparison, shown: Sequence[int]) -> tuple[Panel, ...]:
    """Spectra of the acceleration, as it is and weighted, with the bands that the model's uncertainty gives them."""
    plain: list[Series] = []
    weighted: list[Series] = []
    for at in shown:
        one, std = found.spectra[at]
        weight = np.abs(weighting(one.frequency)) ** 2
        for series, factor in ((plain, np.ones(weight.size)), (weighted, weight)):
            y = one.spectrum * factor
            there = y > _DECADES * y.max()
            series.append(
                Series(Role.MODEL, one.frequency[there], y[there], NORMAL_95 * (std * factor)[there], tyre=at)
            )
    names = (("acceleration at the seat", plain), ("weighted by Wk", weighted))
    ordinate = AxisData("spectrum", "m²/s³", log=True)
    return tuple(Panel(_FREQUENCY, ordinate, tuple(series), title=name) for name, series in names)


def _shown_part(found: RideComparison) -> tuple[slice, str]:
    """The samples to show, and what is said of those left out.

    Of a short ride all until hardly any acceleration is left; of a longer one those about the largest acceleration.
    """
    one = found.series[0]
    count, wanted = one.weighted.size, round(_PART / one.step)
    if count * one.step <= _WHOLE:
        moves = np.max([np.abs(each.weighted) for each in found.series], axis=0)
        end = 1 + int(np.flatnonzero(moves >= _LEFT * moves.max())[-1])
        return slice(0, end), f"until {100 * _LEFT:g} % of the largest is left" if end < count else ""
    first = int(np.argmax(np.abs(one.weighted))) - wanted // 2
    first = min(max(first, 0), count - wanted)
    return slice(first, first + wanted), f"the {_PART:g} s about the largest weighted acceleration of the first tyre"


def _series(found: RideComparison, shown: Sequence[int], part: slice) -> tuple[Panel, ...]:
    """Weighted acceleration and dynamic load of the first wheel over time."""
    acceleration, load = [], []
    for at in shown:
        one = found.series[at]
        time = one.step * np.arange(one.weighted.size)
        time, weighted, force = (_thinned(each[part]) for each in (time, one.weighted, one.load[0]))
        acceleration.append(Series(Role.LINE, time, weighted, tyre=at))
        load.append(Series(Role.LINE, time, force / 1e3, tyre=at))
    return (
        Panel(_TIME, AxisData("weighted acceleration", "m/s²", signed=True), tuple(acceleration)),
        Panel(_TIME, AxisData("dynamic wheel load", "kN", signed=True), tuple(load)),
    )


def _thinned(values: FloatArray) -> FloatArray:
    """Values with as many points as a figure shows."""
    return values[:: -(-values.size // _POINTS)]


def draw_ride(data: FigureData, style: Style | None = None) -> Figure:
    """A matplotlib figure of what `ride_figure` returned."""
    style = style or Style()
    with drawing(style, "ride"):
        return figure_of(data, style)


_HEIGHT, _LONGEST = 4.3, 40


def draw_compared(
    rows: pl.DataFrame, quantities: Sequence[Quantity], names: tuple[str, str], style: Style | None = None
) -> Figure:
    """Two quantities of one condition side by side.

    Parameters
    ----------
    rows : polars.DataFrame
        Rows of `fourpole.findings.compared.Compared` of one condition, by rising frequency.
    quantities : two of Quantity
        Those shown, with the unit shown.
    names : (str, str)
        Names of the first and of the second.
    style : Style, optional
        Theme and colours.
    """
    style = style or Style()
    with drawing(style, "compared"):
        figure = new_figure(WIDTH, _HEIGHT)
        grid = figure.subplots(2, 2, sharex=True, gridspec_kw={"height_ratios": (2.0, 1.0)})
        for column, quantity in enumerate(quantities):
            own = rows.filter(pl.col("quantity") == quantity.column)
            _curves(grid[0, column], own, quantity, names, style)
            _difference(grid[1, column], own, quantity, style)
            grid[1, column].set_xlabel(q.FREQUENCY.label)
        grid[0, 0].legend(loc="best", frameon=False, fontsize=8)
        figure.align_ylabels(grid)
        figure.tight_layout()
    return figure


def _curves(axes: Axes, rows: pl.DataFrame, quantity: Quantity, names: tuple[str, str], style: Style) -> None:
    """Both curves with a band of U about each."""
    frequency = rows[q.FREQUENCY.head].to_numpy()
    for at, (head, marker) in enumerate((("first", "o"), ("second", "s"))):
        value, u = (rows[one].to_numpy() / quantity.scale for one in (head, f"u({head})"))
        reach, colour = COVERAGE_FACTOR * u, style.colour(at)
        axes.fill_between(frequency, value - reach, value + reach, color=colour, alpha=0.2, linewidth=0)
        axes.plot(frequency, value, color=colour, marker=marker, markersize=4, label=plain_text(names[at], _LONGEST))
        if frequency.size == 1:  # a band has no width there
            axes.errorbar(frequency, value, yerr=reach, color=colour, capsize=3, linewidth=1)
    axes.set_ylabel(quantity.label)


def _difference(axes: Axes, rows: pl.DataFrame, quantity: Quantity, style: Style) -> None:
    """The difference with U, about the line of no difference."""
    value, u = (rows[one].to_numpy() / quantity.scale for one in ("difference", "u(difference)"))
    axes.axhline(0.0, color=style.look.muted, linewidth=0.8)
    frequency, colour, reach = rows[q.FREQUENCY.head].to_numpy(), style.look.ink, COVERAGE_FACTOR * u
    axes.errorbar(frequency, value, yerr=reach, fmt="o", color=colour, markersize=3.5, capsize=3, linewidth=1)
    axes.set_ylabel(f"difference [{quantity.shown}]")


_SIZE = (7.6, 6.2)
#: Number of isotherms beyond which the key names only some of them.
_MOST_NAMED = 8
_SHIFT_POINTS = 200
#: Largest number of specimens in one figure.
_MOST_TYRES = 6
_MARKER = 3.4


def shift_figure(found: Sequence[TyreShift], style: Style | None = None) -> Figure:
    """The master curve of each specimen, below each other; of many specimens those of the first ones."""
    style = style or Style()
    with drawing(style, "shift"):
        figure, parts, left_out = parts_of(found, _MOST_TYRES, _SIZE, "specimens")
        for at, (one, part) in enumerate(parts):
            _draw(part, one, style, "" if at else left_out)
    return figure


def _draw(figure: SubFigure, one: TyreShift, style: Style, left_out: str) -> None:
    """Isotherms, master curve, loss factor and shift factors of one specimen; one colour per temperature."""
    found = one.found
    figure.subplots_adjust(left=0.09, right=0.985, top=0.92, bottom=0.14, hspace=0.36, wspace=0.24)
    panels = figure.subplots(2, 2)
    count = len(found.isotherms)
    colours = [style.frequency_colour(at / max(count - 1, 1)) for at in range(count)]
    for at, colour in enumerate(colours):
        isotherm = found.isotherms[at]
        omega, stiffness = found.reduced(at)
        _points(panels[0, 0], isotherm.frequency, isotherm.stiffness, colour)
        _points(panels[0, 1], omega / (2 * np.pi), stiffness, colour)
        panels[1, 0].plot(omega / (2 * np.pi), stiffness.imag / stiffness.real, "o", ms=_MARKER, color=colour)
    ends = [found.reduced(at)[0][[0, -1]] for at in range(count)]
    grid = np.geomspace(np.min(ends), np.max(ends), _SHIFT_POINTS)
    curve, ink = found.curve(grid), style.look.ink
    for part in (curve.real, curve.imag):
        panels[0, 1].plot(grid / (2 * np.pi), part, color=ink, lw=0.9, zorder=0.5)
    panels[1, 0].plot(grid / (2 * np.pi), curve.imag / curve.real, color=ink, lw=0.9, zorder=0.5)
    _shift_factors(panels[1, 1], one, colours, style)
    reference = f"{found.temperatures[found.reference].round(1) + 0.0:g} °C"
    _finish(panels[0, 0], q.FREQUENCY.label, "K' (filled), K'' (open) [N/m]", "isotherms")
    _finish(panels[0, 1], f"frequency × aT [Hz], at {reference}", "K' (filled), K'' (open) [N/m]", "master curve")
    _finish(panels[1, 0], f"frequency × aT [Hz], at {reference}", q.LOSS_FACTOR.label, "loss factor")
    _key(figure, found.temperatures, colours)
    if one.tyre:
        figure.suptitle(f"{plain_text(one.tyre, 60)}{left_out}")


def _points(ax: Axes, frequency: FloatArray, stiffness: ComplexArray, colour: str) -> None:
    """K' as filled and K'' as open circles."""
    ax.plot(frequency, stiffness.real, "o", ms=_MARKER, color=colour)
    ax.plot(frequency, stiffness.imag, "o", ms=_MARKER, color=colour, mfc="none", mew=0.8)


def _finish(ax: Axes, x: str, y: str, title: str) -> None:
    ax.set(xscale="log", yscale="log", xlabel=x, ylabel=y)
    ax.set_title(title, loc="left", fontsize="medium")
    for axis in (ax.xaxis, ax.yaxis):
        axis.set_major_locator(LogLocator(numticks=6))
        axis.set_major_formatter(FuncFormatter(power_of_ten))
        axis.set_minor_locator(NullLocator())
    ax.grid(visible=True, alpha=0.5)


def _shift_factors(ax: Axes, one: TyreShift, colours: list[str], style: Style) -> None:
    """log10 aT with 95 % intervals over temperature, and the laws; the chosen one with its band."""
    found = one.found
    t, decade = found.temperatures, np.log(10)
    grid = np.linspace(t.min(), t.max(), _SHIFT_POINTS)
    for rank, law in enumerate(one.choice.laws):
        line = law.log_a(grid) / decade
        dashes = "-" if rank == 0 else (0, (4, 2))
        ax.plot(grid, line, color=style.look.ink, lw=1.1, ls=dashes, label=law.name, zorder=1)
        if rank == 0:
            half = NORMAL_95 * law.log_a_std(grid) / decade
            ax.fill_between(grid, line - half, line + half, color=style.look.muted, alpha=0.3, lw=0, label="95 %")
    half = NORMAL_95 * found.std / decade
    for at, colour in enumerate(colours):
        value = found.log_a[at] / decade
        ax.errorbar(t[at], value, half[at], fmt="o", ms=_MARKER + 1, color=colour, capsize=2, zorder=2)
    ax.set(xlabel=q.TEMPERATURE.label, ylabel="log10(aT) [1]")
    ax.set_title("shift factors, 95 %", loc="left", fontsize="medium")
    ax.grid(visible=True, alpha=0.5)
    ax.legend(frameon=False)


def _key(figure: SubFigure, temperatures: FloatArray, colours: list[str]) -> None:
    """One entry per temperature, or for some evenly chosen ones."""
    count = len(colours)
    shown = np.unique(np.linspace(0, count - 1, min(count, _MOST_NAMED)).round().astype(int))
    handles = [Line2D([], [], marker="o", ls="", ms=_MARKER + 1, color=colours[at]) for at in shown]
    names = [f"{temperatures[at].round(1) + 0.0:g} °C" for at in shown]
    figure.legend(handles, names, loc="lower center", ncols=len(shown), frameon=False)
