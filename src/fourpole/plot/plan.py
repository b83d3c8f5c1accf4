"""Figures of a plan and of four poles."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import polars as pl
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from matplotlib.ticker import FuncFormatter, LogLocator, MultipleLocator, NullFormatter

from fourpole import quantities as q
from fourpole.core.allpoles import POLES
from fourpole.core.arrays import ComplexArray, FloatArray
from fourpole.core.confidence import COVERAGE_FACTOR, NORMAL_95
from fourpole.core.plan import PLAN_ROUTES
from fourpole.core.specimen import Form
from fourpole.plot.data import plain_text
from fourpole.plot.layout import Grid, Key, parts_of
from fourpole.plot.panels import numbered, power_of_ten
from fourpole.plot.style import Dashes, Style, drawing, mixed
from fourpole.study.twoports import TwoPort

_COLUMNS = ((q.K_STAR.relative_head, "K*"), (q.K2.relative_head, "K2"), (q.C.relative_head, "C"))
#: Heads of the uncertainty that K1 contributes, and of the value that it is divided by.
_OF_K1 = {"K2": (q.K2.u_head_from(q.K1), q.K2.head), "C": (q.C.u_head_from(q.K1), q.C.head)}
_K1_LINE: Dashes = (0.0, (6.0, 1.5, 1.5, 1.5))
_WANTED: Dashes = (0.0, (1.5, 1.5))
#: Colour of the palette, marker and dashes of each route as stated.
_LOOKS: dict[str, tuple[int, str, Dashes]] = {
    "mobility": (1, "o", (0.0, (4.0, 1.6))),
    "relative": (2, "^", (0.0, (5.0, 1.4, 1.0, 1.4))),
    "transmissibility": (3, "s", (0.0, (1.0, 1.3))),
    "joint": (0, "D", "solid"),
}
_MASS_MARKERS = ("v", "P", "X", "*", "<", ">")


#: Percent of U for one of u.
_PERCENT = 100 * COVERAGE_FACTOR


@dataclass(frozen=True, eq=False)
class _Curve:
    """Rows of the plan that make one curve, with its label in the key and its look."""

    frame: pl.DataFrame
    label: str
    colour: str
    marker: str
    dashes: Dashes


def draw_plan(frame: pl.DataFrame, *, wanted: float | None = None, style: Style | None = None) -> Figure:
    """Draw the table of a plan.

    Parameters
    ----------
    frame : polars.DataFrame
        A table that `plan_table` returned.
    wanted : float [1], optional
        Relative standard uncertainty at which a line is drawn.
    style : Style, optional
        Theme and limits.

    Returns
    -------
    Figure
        A panel each for K*, K2 and C. Curves are medians if there are several conditions; a band shows the range over
        the conditions for the joint route with the rig as stated.
    """
    style = style or Style()
    with drawing(style, "plan"):
        grid = Grid.of(len(_COLUMNS), len(_COLUMNS), panel_height=2.9, style=style)
        key, notes = Key(), list[str]()
        curves = list(_curves(frame, style))
        one_condition = ["plan", "rig", "route", q.FREQUENCY.head, q.ADDED_MASS.head]
        several = bool(frame.select(one_condition).is_duplicated().any())
        left_by_k1 = bool(frame[q.K1.u_head].max())
        for ax, (column, name) in zip(grid.panels, _COLUMNS, strict=True):
            for curve in curves:
                _draw_curve(ax, curve, column, several=several, style=style)
            if left_by_k1 and name in _OF_K1:
                _draw_k1(ax, frame, name, style)
            if wanted is not None:
                ax.axhline(_PERCENT * wanted, color=style.look.ink, linewidth=0.9, linestyle=_WANTED, zorder=1.5)
            ax.set_yscale("log")
            ax.set_title(f"U({name}) over {name}")
        _same_limits(grid.panels, style)
        for curve in curves:
            key.line(curve.label, curve.colour, marker=curve.marker, linestyle=curve.dashes)
        if left_by_k1:
            key.line("left by K1 alone", style.look.muted, 1.0, linestyle=_K1_LINE)
        if wanted is not None:
            key.line(f"wanted: {_PERCENT * wanted:g} %", style.look.ink, 0.9, linestyle=_WANTED)
        if several:
            notes.append("curves are medians over the conditions of the tyres, the band their range by the joint route")
        labels = ["U (k = 2) to expect (%)"]
        return grid.finish(key=key, notes=notes, x_label="frequency (Hz)", y_labels=labels)


def _curves(frame: pl.DataFrame, style: Style) -> Iterator[_Curve]:
    """A curve per route with the rig as stated, and one of the joint route per further plan."""
    plans = frame["plan"].unique(maintain_order=True).to_list()
    stated = frame.filter(pl.col("plan") == plans[0])
    routes = stated["route"].unique().to_list()
    for route in PLAN_ROUTES:
        if route in routes:
            colour, marker, dashes = _LOOKS[route]
            yield _Curve(stated.filter(pl.col("route") == route), route, style.colour(colour), marker, dashes)
    for rank, plan in enumerate(plans[1:]):
        bare = pl.col(q.ADDED_MASS.head) == 0  # K* of the tyre itself, which the mass serves
        added = frame.filter((pl.col("plan") == plan) & (pl.col("route") == "joint") & bare)
        if added.height:
            part = 0.2 + 0.55 * rank / max(len(plans) - 2, 1)
            colour_of_mass = mixed(style.colour(0), style.look.ink, part)
            marker = _MASS_MARKERS[rank % len(_MASS_MARKERS)]
            yield _Curve(added, f"joint, {plan} as well", colour_of_mass, marker, "solid")


def _draw_curve(ax: Axes, curve: _Curve, column: str, *, several: bool, style: Style) -> None:
    """Draw the median over the conditions at each frequency; of the joint route as stated, the range, too."""
    percent = _PERCENT * pl.col(column)
    rows = curve.frame.drop_nulls(column).group_by(q.FREQUENCY.head)
    by = rows.agg(middle=percent.median(), low=percent.min(), high=percent.max()).sort(q.FREQUENCY.head)
    x, middle, low, high = by.to_numpy().T
    ax.plot(x, middle, color=curve.colour, marker=curve.marker, linestyle=curve.dashes,
            markerfacecolor=style.look.paper, label="_curve")  # fmt: skip
    if several and curve.label == "joint":
        ax.fill_between(x, low, high, color=curve.colour, alpha=0.09, linewidth=0)


def _draw_k1(ax: Axes, frame: pl.DataFrame, name: str, style: Style) -> None:
    """Draw the relative uncertainty that K1 alone contributes."""
    over, under = _OF_K1[name]
    stated = frame.filter(pl.col("plan") == frame["plan"][0])
    by = stated.group_by(q.FREQUENCY.head).agg((pl.col(over) / pl.col(under)).median()).sort(q.FREQUENCY.head)
    ax.plot(
        by[q.FREQUENCY.head].to_numpy(), _PERCENT * by[over].to_numpy(), color=style.look.muted, linewidth=1.0,
        linestyle=_K1_LINE, label="_k1", zorder=1.8,
    )  # fmt: skip


def _same_limits(panels: list[Axes], style: Style) -> None:
    """Give all panels the same ordinate."""
    seen = np.concatenate([np.asarray(line.get_ydata(), dtype=float) for ax in panels for line in ax.get_lines()])
    seen = seen[np.isfinite(seen) & (seen > 0)]
    if not seen.size:
        return
    low, high = style.ylim or (seen.min() / 1.4, seen.max() * 1.4)
    for ax in panels:
        ax.set(xlim=style.xlim or ax.get_xlim(), ylim=(low, high))
        numbered(ax, "y", most=5)


_SIZE = (7.6, 6.4)
#: Largest number of conditions in one figure.
_MOST = 6
_POINTS = 400
#: Places of k11, k12 and k22 among the four poles.
_SHOWN = {"k11": 0, "k12": 1, "k22": 3}


def two_port_figure(found: Sequence[TwoPort], style: Style | None = None) -> Figure:
    """The four poles of each condition, below each other; of many conditions those of the first ones."""
    style = style or Style()
    with drawing(style, "twoport"):
        figure, parts, left_out = parts_of(found, _MOST, _SIZE, "conditions")
        for at, (two_port, part) in enumerate(parts):
            _draw_poles(part, two_port, style, "" if at else left_out)
    return figure


def _draw_poles(figure: SubFigure, two_port: TwoPort, style: Style, left_out: str) -> None:
    """Modulus and phase of three poles above the determinant."""
    upper = figure.add_gridspec(2, 3, left=0.09, right=0.985, top=0.885, bottom=0.365, hspace=0.12, wspace=0.12,
                                height_ratios=[1.4, 1.0])  # fmt: skip
    lower = figure.add_gridspec(1, 1, left=0.09, right=0.985, top=0.25, bottom=0.075)
    moduli: list[Axes] = []
    phases: list[Axes] = []
    for column, (name, at) in enumerate(_SHOWN.items()):
        moduli.append(figure.add_subplot(upper[0, column], sharey=moduli[0] if moduli else None))
        phases.append(figure.add_subplot(upper[1, column], sharex=moduli[-1], sharey=phases[0] if phases else None))
        near = _form_curve(two_port, at, moduli[-1], phases[-1], style)
        _measured(two_port, at, moduli[-1], phases[-1], style, near)
        moduli[-1].set_title("-k12" if at == 1 else name, loc="left", fontsize="medium")
        moduli[-1].set_yscale("log")
        moduli[-1].yaxis.set_major_locator(LogLocator(numticks=8))
        moduli[-1].yaxis.set_major_formatter(FuncFormatter(power_of_ten))
        moduli[-1].yaxis.set_minor_formatter(NullFormatter())
        phases[-1].yaxis.set_major_locator(MultipleLocator(90))
        phases[-1].set_xlabel(q.FREQUENCY.label)
        moduli[-1].tick_params(labelbottom=False, labelleft=column == 0)
        phases[-1].tick_params(labelleft=column == 0)
    moduli[0].set_ylabel("|k| [kN/m]")
    phases[0].set_ylabel("phase [deg]")
    _determinant(figure.add_subplot(lower[0, 0]), two_port, style)
    handles, labels = moduli[1].get_legend_handles_labels()
    figure.legend(handles, labels, loc="upper left", bbox_to_anchor=(0.08, 0.965), ncols=4, frameon=False)
    figure.text(0.09, 0.975, f"{plain_text(two_port.name, 60)}{left_out}", ha="left", va="center")


def _measured(two_port: TwoPort, at: int, modulus: Axes, phase: Axes, style: Style, near: FloatArray | None) -> None:
    """A pole with 95 % intervals, its phase on the branch that is `near`; k21 beside k12 where the two differ."""
    poles = two_port.poles
    for place, mark in ((at, "o"), *([(2, "s")] if at == 1 and two_port.form is None else [])):
        values = poles.stiffness.reshape(-1, 4)[:, place] * (-1 if at == 1 else 1)
        covariance = poles.covariance[:, 2 * place : 2 * place + 2, 2 * place : 2 * place + 2]
        along = values / np.abs(values)
        size, angle = (_std(turn, covariance) for turn in (along, 1j * along))
        turned = np.unwrap(np.angle(values)) if near is None else near + np.angle(along * np.exp(-1j * near))
        label = "measured, 95 %" if place == at else f"{POLES[place]} measured, 95 %"
        colour = style.colour(0 if place == at else 4)
        _pole_points(modulus, poles.frequency, np.abs(values) / 1e3, size / 1e3, colour, mark, label)
        _pole_points(
            phase, poles.frequency, np.degrees(turned), np.degrees(angle / np.abs(values)), colour, mark, label
        )


def _std(along: ComplexArray, covariance: FloatArray) -> FloatArray:
    """Standard uncertainty of complex values along a direction of each."""
    direction = np.stack([along.real, along.imag], axis=1)
    return np.asarray(np.sqrt(np.einsum("ni,nij,nj->n", direction, covariance, direction)))


def _pole_points(ax: Axes, x: FloatArray, y: FloatArray, std: FloatArray, colour: str, mark: str, label: str) -> None:
    face = colour if mark == "o" else "none"
    size = 3.4 if mark == "o" else 5.5
    ax.errorbar(
        x, y, NORMAL_95 * std, fmt=mark, ms=size, mfc=face, color=colour, capsize=1.5, lw=0.9, label=label, zorder=3
    )


def _form_curve(two_port: TwoPort, at: int, modulus: Axes, phase: Axes, style: Style) -> FloatArray | None:
    """A pole of the form that describes all best, with K* of its springs; its phase [rad] where it was measured."""
    fit, frequency = two_port.form, two_port.poles.frequency
    if fit is None:
        return None
    fine = np.union1d(np.linspace(frequency[0], frequency[-1], _POINTS), frequency)
    log_k = np.log(fit.stiffness)
    stiffness = np.exp(np.interp(fine, frequency, log_k.real) + 1j * np.interp(fine, frequency, log_k.imag))
    pole = fit.specimen.dynamic_stiffness(stiffness, 2 * np.pi * fine).reshape(-1, 4)[:, at] * (-1 if at == 1 else 1)
    angle = np.unwrap(np.angle(pole))
    massless = fit.specimen.form is Form.MASSLESS
    label = "massless spring" if massless else f"{fit.specimen.form.value} of {fit.specimen.mass:.3g} kg"
    label = label if two_port.form_fits else f"{label}, which does not fit"
    modulus.plot(fine, np.abs(pole) / 1e3, color=style.look.ink, lw=1.0, label=label, zorder=2)
    phase.plot(fine, np.degrees(angle), color=style.look.ink, lw=1.0, zorder=2)
    if not massless:
        springs: dict[str, Any] = {"color": style.look.muted, "lw": 1.0, "ls": (0, (4, 2)), "zorder": 1}
        modulus.plot(fine, np.abs(stiffness) / 1e3, label="K* of its springs", **springs)
        phase.plot(fine, np.degrees(np.angle(stiffness)), **springs)
    return np.asarray(np.interp(frequency, fine, angle))


def _determinant(ax: Axes, two_port: TwoPort, style: Style) -> None:
    """Departure of k12/k21 as measured from 1, with 95 % intervals."""
    measured = two_port.measured
    off, std = measured.determinant - 1, measured.determinant_std
    reach = max(float(np.ptp(measured.frequency)), 1.0)
    for at, (part, values, mark) in enumerate((("Re", off.real, "o"), ("Im", off.imag, "s"))):
        beside = measured.frequency + (0.006 * at - 0.003) * reach
        _pole_points(ax, beside, 100 * values, 100 * std[:, at], style.colour(2 * at + 2), mark, f"{part}, 95 %")
    ax.axhline(0.0, color=style.look.ink, lw=0.8)
    said = "reciprocal within the uncertainty" if two_port.reciprocal else "not reciprocal"
    ax.set_title(f"determinant k12/k21 as measured, less 1: {said}", loc="left", fontsize="medium")
    ax.set(xlabel=q.FREQUENCY.label, ylabel="k12/k21 - 1 [%]")
    ax.legend(loc="lower right", bbox_to_anchor=(1.0, 0.98), ncols=2, frameon=False)
