"""The figure of a master curve: isotherms, the curve that they become, the loss factor and the shift factors."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

from fourpole import quantities as q
from fourpole.core.arrays import ComplexArray, FloatArray
from fourpole.core.confidence import NORMAL_95
from fourpole.fitting.shifting import TyreShift
from fourpole.plot.figure import figure_bytes
from fourpole.plot.names import plain_text
from fourpole.plot.panels import power_of_ten
from fourpole.plot.style import Style, drawing

#: Key of the figure in its files.
KEY = "shift"
_SIZE = (7.6, 6.2)
#: Number of isotherms beyond which the key names only some of them.
_MOST_NAMED = 8
_POINTS = 200
#: Largest number of specimens in one figure.
_MOST_TYRES = 6
_MARKER = 3.4


def shift_figure_bytes(found: Sequence[TyreShift], form: str, style: Style | None = None) -> bytes:
    """The content of a file of the figure, as svg, png or pdf; CampaignError for another format."""
    look = style or Style()
    with drawing(look, KEY):
        figure = shift_figure(found, look)
        return figure_bytes(figure, KEY, "Master curve", form, look)


def shift_figure(found: Sequence[TyreShift], style: Style) -> Figure:
    """The master curve of each specimen, below each other; of many specimens those of the first ones."""
    shown = found[:_MOST_TYRES]
    width, height = _SIZE
    figure = Figure(figsize=(width, height * len(shown)))
    parts = np.atleast_1d(np.asarray(figure.subfigures(len(shown), 1), dtype=object))
    for at, (one, part) in enumerate(zip(shown, parts.tolist(), strict=True)):
        left_out = f" ({len(shown)} of {len(found)} specimens)" if len(shown) < len(found) and at == 0 else ""
        _draw(part, one, style, left_out)
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
    grid = np.geomspace(np.min(ends), np.max(ends), _POINTS)
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
    grid = np.linspace(t.min(), t.max(), _POINTS)
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
