"""Figures 1 to 4: the two models and the two rigs of the paper, as line art."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, FancyArrowPatch, Polygon, Rectangle

from fourpole.core.rig import Rig
from fourpole.plot.layout import WIDTH, new_figure
from fourpole.plot.stiffness import rig_stated
from fourpole.plot.style import Style
from fourpole.study.results import Results

__all__ = ["damper", "dynamic_rig", "ground", "mass", "spring", "static_rig", "tyre_model", "whole_model"]

#: Scale of the line art: units of the drawing per inch of figure width.
_UNITS = 10.0


def _sheet(height: float, style: Style) -> tuple[Figure, Axes]:
    """Axes without axes: 10 wide, the height in the same units."""
    figure = new_figure(WIDTH, WIDTH * height / _UNITS)
    ax = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    ax.set_xlim(0.0, _UNITS)
    ax.set_ylim(0.0, height)
    ax.set_aspect("equal")
    ax.set_axis_off()
    ax.set_facecolor(style.look.paper)
    return figure, ax


def _line(ax: Axes, x: list[float], y: list[float], style: Style, width: float = 1.3) -> None:
    ax.plot(x, y, color=style.look.ink, linewidth=width, solid_capstyle="round", solid_joinstyle="round")


def _box(ax: Axes, x: float, y: float, wide: float, high: float, style: Style, fill: str | None = None) -> None:
    ax.add_patch(
        Rectangle((x, y), wide, high, facecolor=fill or style.look.paper, edgecolor=style.look.ink, linewidth=1.2)
    )


def _text(ax: Axes, x: float, y: float, text: str, *, ha: str = "left", va: str = "center", size: float = 9.0) -> None:
    ax.text(x, y, text, ha=ha, va=va, fontsize=size)  # type: ignore[arg-type]


def spring(ax: Axes, x: float, low: float, high: float, *, style: Style, wide: float = 0.2) -> Axes:
    """A coil spring along a vertical line."""
    lead = 0.14 * (high - low)
    turns = np.linspace(low + lead, high - lead, 13)
    zigzag = x + wide * np.array([0, *([1, -1] * 5), 1, 0])
    zigzag[-2] = x - wide if zigzag[-3] > x else x + wide
    _line(ax, [x, *zigzag.tolist(), x], [low, *turns.tolist(), high], style)
    return ax


def damper(ax: Axes, x: float, low: float, high: float, *, style: Style, wide: float = 0.2) -> Axes:
    """A dashpot along a vertical line: the pot below, the piston from above."""
    span = high - low
    pot_low, pot_high, piston = low + 0.3 * span, low + 0.68 * span, low + 0.5 * span
    _line(ax, [x, x], [low, pot_low], style)
    _line(ax, [x - wide, x - wide, x + wide, x + wide], [pot_high, pot_low, pot_low, pot_high], style)
    _line(ax, [x - 0.8 * wide, x + 0.8 * wide], [piston, piston], style, 2.0)
    _line(ax, [x, x], [piston, high], style)
    return ax


def mass(ax: Axes, x: float, y: float, wide: float, high: float, *, style: Style) -> Axes:
    """A rigid mass, its lower left corner given."""
    _box(ax, x, y, wide, high, style, style.look.grid)
    return ax


def ground(ax: Axes, low: float, high: float, y: float, *, style: Style, up: bool = False) -> Axes:
    """A fixed foundation: a line with strokes on its far side."""
    _line(ax, [low, high], [y, y], style)
    side = 0.16 if up else -0.16
    for x in np.arange(low + 0.08, high, 0.2):
        _line(ax, [x, x + (0.13 if up else -0.13)], [y, y + side], style, 0.7)
    return ax


def _arrow(ax: Axes, x: float, low: float, high: float, style: Style) -> None:
    ax.add_patch(
        FancyArrowPatch(
            (x, low),
            (x, high),
            arrowstyle="-|>",
            mutation_scale=9,
            color=style.look.ink,
            linewidth=1.0,
            shrinkA=0,
            shrinkB=0,
        )
    )


def _pair(ax: Axes, x: float, y: float, force: str, velocity: str, style: Style) -> None:
    """Force and velocity at a point of the chain, both positive upwards."""
    ax.plot([x], [y], marker="o", markersize=3.5, color=style.look.ink)
    _arrow(ax, x + 1.55, y - 0.22, y + 0.22, style)
    _line(ax, [x, x + 1.75], [y, y], style, 0.6)
    _text(ax, x + 1.85, y, f"{force}, {velocity}")


def _leader(ax: Axes, x: float, y: float, at_x: float, at_y: float, text: str, style: Style, ha: str = "left") -> None:
    """A thin line from a part to its name."""
    ax.plot([x, at_x], [y, at_y], color=style.look.muted, linewidth=0.7)
    _text(ax, at_x + (0.08 if ha == "left" else -0.08), at_y, text, ha=ha, size=8.0)


def _tyre_element(ax: Axes, x: float, low: float, high: float, style: Style) -> None:
    """K1 beside the arm of K2 and C."""
    left, right, middle = x - 0.8, x + 0.8, 0.5 * (low + high)
    _line(ax, [left, right], [low + 0.15, low + 0.15], style)
    _line(ax, [left, right], [high - 0.15, high - 0.15], style)
    _line(ax, [x, x], [low, low + 0.15], style)
    _line(ax, [x, x], [high - 0.15, high], style)
    spring(ax, left, low + 0.15, high - 0.15, style=style)
    spring(ax, right, middle, high - 0.15, style=style)
    damper(ax, right, low + 0.15, middle, style=style)
    _text(ax, left - 0.35, middle, "K1", ha="right")
    _text(ax, right + 0.35, 0.5 * (middle + high - 0.15), "K2")
    _text(ax, right + 0.35, 0.5 * (low + 0.15 + middle), "C")


def tyre_model(results: Results, style: Style) -> Figure:  # noqa: ARG001  every figure takes the results
    """Figure 1: K1 beside a Maxwell arm."""
    figure, ax = _sheet(4.0, style)
    x = 4.9
    _tyre_element(ax, x, 0.6, 3.4, style)
    _pair(ax, x, 0.6, "F1", "V1", style)
    _pair(ax, x, 3.4, "F2'", "V2'", style)
    _text(ax, 3.2, 2.0, "tyre, without mass", ha="right", size=8.0)
    return figure


def whole_model(results: Results, style: Style) -> Figure:
    """Figure 2: the tyre, the moving mass, the preload spring and the foundation, with the values stated."""
    rig = _only_rig(results)
    figure, ax = _sheet(6.1, style)
    x = 5.1
    _tyre_element(ax, x, 0.6, 2.9, style)
    _pair(ax, x, 0.6, "F1", "V1", style)
    mass(ax, x - 1.0, 2.9, 2.0, 0.8, style=style)
    _text(ax, x, 3.3, "m" + (f" = {rig.moving_mass:.4g} kg" if rig else ""), ha="center")
    _line(ax, [x + 1.0, x + 1.55], [3.3, 3.3], style, 0.6)
    _arrow(ax, x + 1.55, 3.08, 3.52, style)
    _text(ax, x + 1.85, 3.3, "V2")
    damped = rig is not None and rig.preload_damping > 0
    at = x - 0.45 if damped else x
    spring(ax, at, 3.7, 5.5, style=style)
    _text(ax, at - 0.4, 4.6, "K3" + (f" = {rig.preload_stiffness / 1e3:.4g} kN/m" if rig else ""), ha="right")
    if damped and rig is not None:
        damper(ax, x + 0.45, 3.7, 5.5, style=style)
        _text(ax, x + 0.85, 4.6, f"c3 = {rig.preload_damping:.4g} N s/m")
    ground(ax, x - 1.1, x + 1.1, 5.5, style=style, up=True)
    _text(ax, x + 1.85, 5.5, "F3, V3 = 0")
    for low, high, name in ((0.6, 2.85, "tyre"), (2.95, 3.65, "moving mass"), (3.75, 5.5, "preload spring")):
        _line(ax, [2.4, 2.3, 2.3, 2.4], [low, low, high, high], style, 0.7)
        _text(ax, 2.15, 0.5 * (low + high), name, ha="right", size=8.0)
    if rig is not None and rig.blocked:
        _text(ax, x, 5.92, "the rig of this campaign is blocked beyond the specimen: V2 = 0", ha="center", size=8.0)
    return figure


def _only_rig(results: Results) -> Rig | None:
    """The rig of the campaign, if it has one and no more."""
    rigs = (results.record.get("stated") or {}).get("rigs") or {}
    return rig_stated(next(iter(rigs.values()))) if len(rigs) == 1 else None


def _tyre(ax: Axes, x: float, y: float, radius: float, style: Style) -> None:
    """A tyre seen from the side, flattened where it stands."""
    angle = np.linspace(-0.5 * np.pi, 1.5 * np.pi, 181)
    outer = np.column_stack([radius * np.cos(angle), np.maximum(radius * np.sin(angle), -0.955 * radius)])
    ax.add_patch(Polygon(outer + np.array([x, y]), facecolor=style.look.grid, edgecolor=style.look.ink, linewidth=1.3))
    ax.add_patch(Circle((x, y), 0.62 * radius, facecolor=style.look.paper, edgecolor=style.look.ink, linewidth=1.0))
    ax.add_patch(Circle((x, y), 0.16 * radius, facecolor=style.look.paper, edgecolor=style.look.ink, linewidth=1.2))


def _frame(ax: Axes, left: float, right: float, low: float, high: float, style: Style) -> None:
    """A portal frame on the ground."""
    wide = 0.24
    _box(ax, left, low, wide, high - low, style)
    _box(ax, right - wide, low, wide, high - low, style)
    _box(ax, left, high, right - left, 0.3, style)
    ground(ax, left - 0.3, right + 0.3, low, style=style)


def static_rig(results: Results, style: Style) -> Figure:  # noqa: ARG001
    """Figure 3: screw, force transducer, tyre, deflection transducer, pen recorder."""
    figure, ax = _sheet(5.4, style)
    _frame(ax, 2.4, 6.4, 0.5, 4.7, style)
    x, y, radius = 4.4, 1.66, 1.0
    _box(ax, 3.2, 0.5, 2.4, 0.2, style, style.look.grid)
    _tyre(ax, x, y, radius, style)
    # Yoke from the hub to the screw.
    _line(ax, [x - 0.35, x - 0.35, x + 0.35, x + 0.35], [y, 2.95, 2.95, y], style, 2.0)
    _box(ax, x - 0.3, 2.95, 0.6, 0.45, style)
    _box(ax, x - 0.1, 3.4, 0.2, 1.75, style)
    for thread in np.arange(3.5, 4.65, 0.12):
        _line(ax, [x - 0.1, x + 0.1], [thread, thread + 0.06], style, 0.6)
    _line(ax, [x - 0.55, x + 0.55], [5.15, 5.15], style, 2.4)
    # Variable resistance between yoke and frame.
    _line(ax, [x + 0.35, 5.72], [2.72, 2.72], style, 0.9)
    _box(ax, 5.66, 2.1, 0.16, 1.2, style)
    _line(ax, [5.82, 6.16], [2.7, 2.7], style, 0.9)
    # Recorder with both signals.
    _box(ax, 7.5, 1.3, 1.9, 1.0, style)
    _text(ax, 8.45, 1.8, "pen recorder", ha="center", size=8.0)
    _wire(ax, [x + 0.3, 5.2, 5.2, 8.8, 8.8], [3.17, 3.17, 3.75, 3.75, 2.3], style)
    _wire(ax, [5.74, 5.74, 8.1, 8.1], [3.3, 3.5, 3.5, 2.3], style)
    _text(ax, 8.9, 3.0, "load F", size=8.0)
    _text(ax, 8.0, 3.0, "deflection x", ha="right", size=8.0)
    _leader(ax, x - 0.1, 4.2, 1.9, 4.2, "loading screw", style, "right")
    _leader(ax, x - 0.3, 3.17, 1.9, 3.17, "force transducer", style, "right")
    _leader(ax, x - 0.8, 1.9, 1.9, 1.9, "tyre", style, "right")
    _leader(ax, 3.4, 0.6, 1.9, 0.85, "plate", style, "right")
    _leader(ax, 5.8, 2.3, 7.3, 0.8, "variable resistance", style)
    return figure


def _wire(ax: Axes, x: list[float], y: list[float], style: Style) -> None:
    ax.plot(x, y, color=style.look.muted, linewidth=0.8, linestyle=(0, (3, 2)))


def dynamic_rig(results: Results, style: Style) -> Figure:  # noqa: ARG001
    """Figure 4: gear boxes, cam, tyre, clamped axle with the moving mass, leaf spring."""
    figure, ax = _sheet(6.7, style)
    x = 4.9
    _frame(ax, 2.9, 6.9, 0.4, 6.05, style)
    # Cam: the shaft lies off the centre of the disc.
    shaft = (x - 0.13, 1.2)
    ax.add_patch(Circle((x, 1.2), 0.5, facecolor=style.look.grid, edgecolor=style.look.ink, linewidth=1.3))
    ax.add_patch(Circle(shaft, 0.09, facecolor=style.look.ink, edgecolor=style.look.ink))
    ax.plot([x], [1.2], marker="+", markersize=6, color=style.look.ink)
    ax.add_patch(
        FancyArrowPatch(
            (shaft[0] - 0.62, 1.0),
            (shaft[0] - 0.1, 0.56),
            connectionstyle="arc3,rad=0.35",
            arrowstyle="-|>",
            mutation_scale=8,
            color=style.look.ink,
            linewidth=1.0,
        )
    )
    _box(ax, 0.3, 0.9, 0.95, 0.6, style)
    _text(ax, 0.775, 1.2, "motor", ha="center", size=8.0)
    _box(ax, 1.5, 0.8, 0.95, 0.8, style)
    _text(ax, 1.975, 1.2, "gear\nboxes", ha="center", size=8.0)
    _line(ax, [1.25, 1.5], [1.2, 1.2], style, 2.0)
    ax.plot([2.45, shaft[0]], [1.2, 1.2], color=style.look.ink, linewidth=1.0, linestyle=(0, (6, 2, 1, 2)))
    # Follower with the force transducer.
    _box(ax, x - 0.12, 1.7, 0.24, 0.3, style)
    _box(ax, x - 0.25, 2.0, 0.5, 0.26, style, style.look.grid)
    _box(ax, x - 0.95, 2.26, 1.9, 0.14, style)
    _tyre(ax, x, 3.28, 0.92, style)
    # Clamp from the hub to the moving mass.
    _line(ax, [x - 0.3, x - 0.3, x + 0.3, x + 0.3], [3.28, 4.3, 4.3, 3.28], style, 2.0)
    mass(ax, x - 0.9, 4.3, 1.8, 0.55, style=style)
    _text(ax, x, 4.575, "m", ha="center")
    # Semi-elliptical leaf spring: fixed eyes on the frame, the middle on the mass.
    for leaf, reach in enumerate((1.45, 1.1, 0.75)):
        across = np.linspace(-reach, reach, 61)
        along = 5.62 - 0.42 * np.sqrt(1 - (across / 1.7) ** 2) - 0.07 * leaf
        ax.plot(x + across, along, color=style.look.ink, linewidth=1.6)
    _box(ax, x - 0.16, 4.85, 0.32, 0.24, style, style.look.grid)
    for side in (-1.45, 1.45):
        end = 5.62 - 0.42 * np.sqrt(1 - (1.45 / 1.7) ** 2)
        _line(ax, [x + side, x + side], [end, 6.05], style)
        ax.plot([x + side], [end], marker="o", markersize=4, markerfacecolor=style.look.paper, color=style.look.ink)
    _arrow(ax, x + 1.35, 2.05, 2.6, style)
    _line(ax, [x + 0.95, x + 1.35], [2.33, 2.33], style, 0.6)
    _arrow(ax, x + 1.35, 4.3, 4.85, style)
    _line(ax, [x + 0.9, x + 1.35], [4.575, 4.575], style, 0.6)
    for at, y, text in ((1.42, 2.33, "V1"), (1.42, 4.575, "V2")):
        _text(ax, x + at, y, text)
    names = (
        (x + 0.42, 1.0, 0.85, "cam: a disc with 1 mm\neccentricity (enlarged)"),
        (x + 0.25, 2.1, 1.75, "force transducer, F1"),
        (x + 0.85, 3.4, 3.4, "tyre"),
        (x + 0.3, 4.0, 4.0, "tyre clamping"),
    )
    for part_x, part_y, y, text in names:
        _leader(ax, part_x, part_y, 7.15, y, text, style)
    _leader(ax, x + 0.6, 5.22, 7.15, 5.4, "leaf spring (preload)", style)
    _text(ax, 7.23, 5.12, "K3 = 12.44 kN/m", size=8.0)
    _leader(ax, 6.6, 6.2, 7.15, 6.2, "frame, V3 = 0", style)
    return figure
