"""The figure of four poles: modulus and phase of k11, k12 and k22, the form held against them, and reciprocity."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from matplotlib.ticker import FuncFormatter, LogLocator, MultipleLocator, NullFormatter

from fourpole import quantities as q
from fourpole.core.allpoles import POLES
from fourpole.core.arrays import ComplexArray, FloatArray
from fourpole.core.confidence import NORMAL_95
from fourpole.core.specimen import Form
from fourpole.plot.figure import figure_bytes
from fourpole.plot.names import plain_text
from fourpole.plot.panels import power_of_ten
from fourpole.plot.style import Style, drawing
from fourpole.study.twoports import TwoPort

#: Key of the figure in its files.
KEY = "twoport"
_SIZE = (7.6, 6.4)
#: Largest number of conditions in one figure.
_MOST = 6
_POINTS = 400
#: Places of k11, k12 and k22 among the four poles.
_SHOWN = {"k11": 0, "k12": 1, "k22": 3}


def two_port_figure_bytes(found: Sequence[TwoPort], form: str, style: Style | None = None) -> bytes:
    """The content of a file of the figure, as svg, png or pdf; CampaignError for another format."""
    look = style or Style()
    with drawing(look, KEY):
        return figure_bytes(two_port_figure(found, look), KEY, "Four poles", form, look)


def two_port_figure(found: Sequence[TwoPort], style: Style) -> Figure:
    """The four poles of each condition, below each other; of many conditions those of the first ones."""
    shown = found[:_MOST]
    figure = Figure(figsize=(_SIZE[0], _SIZE[1] * len(shown)))
    parts = np.atleast_1d(np.asarray(figure.subfigures(len(shown), 1), dtype=object))
    for at, (two_port, part) in enumerate(zip(shown, parts.tolist(), strict=True)):
        left_out = f" ({len(shown)} of {len(found)} conditions)" if len(shown) < len(found) and at == 0 else ""
        _draw(part, two_port, style, left_out)
    return figure


def _draw(figure: SubFigure, two_port: TwoPort, style: Style, left_out: str) -> None:
    """Modulus and phase of three poles above the determinant."""
    upper = figure.add_gridspec(2, 3, left=0.09, right=0.985, top=0.885, bottom=0.365, hspace=0.12, wspace=0.12,
                                height_ratios=[1.4, 1.0])  # fmt: skip
    lower = figure.add_gridspec(1, 1, left=0.09, right=0.985, top=0.25, bottom=0.075)
    moduli: list[Axes] = []
    phases: list[Axes] = []
    for column, (name, at) in enumerate(_SHOWN.items()):
        moduli.append(figure.add_subplot(upper[0, column], sharey=moduli[0] if moduli else None))
        phases.append(figure.add_subplot(upper[1, column], sharex=moduli[-1], sharey=phases[0] if phases else None))
        near = _form(two_port, at, moduli[-1], phases[-1], style)
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
        _points(modulus, poles.frequency, np.abs(values) / 1e3, size / 1e3, colour, mark, label)
        _points(phase, poles.frequency, np.degrees(turned), np.degrees(angle / np.abs(values)), colour, mark, label)


def _std(along: ComplexArray, covariance: FloatArray) -> FloatArray:
    """Standard uncertainty of complex values along a direction of each."""
    direction = np.stack([along.real, along.imag], axis=1)
    return np.asarray(np.sqrt(np.einsum("ni,nij,nj->n", direction, covariance, direction)))


def _points(ax: Axes, x: FloatArray, y: FloatArray, std: FloatArray, colour: str, mark: str, label: str) -> None:
    face = colour if mark == "o" else "none"
    size = 3.4 if mark == "o" else 5.5
    ax.errorbar(
        x, y, NORMAL_95 * std, fmt=mark, ms=size, mfc=face, color=colour, capsize=1.5, lw=0.9, label=label, zorder=3
    )


def _form(two_port: TwoPort, at: int, modulus: Axes, phase: Axes, style: Style) -> FloatArray | None:
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
        _points(ax, beside, 100 * values, 100 * std[:, at], style.colour(2 * at + 2), mark, f"{part}, 95 %")
    ax.axhline(0.0, color=style.look.ink, lw=0.8)
    said = "reciprocal within the uncertainty" if two_port.reciprocal else "not reciprocal"
    ax.set_title(f"determinant k12/k21 as measured, less 1: {said}", loc="left", fontsize="medium")
    ax.set(xlabel=q.FREQUENCY.label, ylabel="k12/k21 - 1 [%]")
    ax.legend(loc="lower right", bbox_to_anchor=(1.0, 0.98), ncols=2, frameon=False)
