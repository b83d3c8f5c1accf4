"""Figures 1 to 4: the two models and the two rigs of the paper, as line art."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Circle, FancyArrowPatch, Patch, Polygon, Rectangle

from fourpole.core.rig import Rig
from fourpole.plot.figure import FigureSpec
from fourpole.plot.layout import WIDTH, new_figure
from fourpole.plot.stiffness import rig_stated
from fourpole.plot.style import Style
from fourpole.study.results import Results, section

#: Scale of the line art: units of the drawing per width of the figure.
_UNITS = 10.0


class Pen:
    """Draws parts of a rig on a sheet that is 10 units wide; coordinates are in these units."""

    def __init__(self, height: float, style: Style) -> None:
        """A sheet without axes; height in the same units."""
        self.style = style
        self.figure = new_figure(WIDTH, WIDTH * height / _UNITS)
        self.ax = self.figure.add_axes((0.0, 0.0, 1.0, 1.0))
        self.ax.set(xlim=(0.0, _UNITS), ylim=(0.0, height), aspect="equal", facecolor=style.look.paper)
        self.ax.set_axis_off()

    def line(self, x: Sequence[float], y: Sequence[float], width: float = 1.3) -> None:
        """A line through points."""
        self.ax.plot(x, y, color=self.style.look.ink, linewidth=width, solid_capstyle="round", solid_joinstyle="round")

    def wire(self, x: Sequence[float], y: Sequence[float]) -> None:
        """A dashed line of a signal."""
        self.ax.plot(x, y, color=self.style.look.muted, linewidth=0.8, linestyle=(0, (3, 2)))

    def fill(self, shape: type[Patch], *where: Any, face: str = "", width: float = 1.2, **how: Any) -> None:
        """A closed shape in ink, filled with a colour or with paper."""
        look = self.style.look
        self.ax.add_patch(shape(*where, facecolor=face or look.paper, edgecolor=look.ink, linewidth=width, **how))

    def box(self, x: float, y: float, wide: float, high: float, face: str = "") -> None:
        """A rectangle by its lower left corner."""
        self.fill(Rectangle, (x, y), wide, high, face=face)

    def mass(self, x: float, y: float, wide: float, high: float) -> None:
        """A rigid mass by its lower left corner."""
        self.box(x, y, wide, high, self.style.look.grid)

    def text(self, x: float, y: float, text: str, *, ha: str = "left", size: float = 9.0) -> None:
        """A text at half its height."""
        self.ax.text(x, y, text, ha=ha, va="center", fontsize=size)  # type: ignore[arg-type]

    def spring(self, x: float, low: float, high: float, wide: float = 0.2) -> None:
        """A coil spring along a vertical line."""
        lead = 0.14 * (high - low)
        turns = np.linspace(low + lead, high - lead, 13)
        zigzag = x + wide * np.array([0, *([1, -1] * 5), 1, 0])
        zigzag[-2] = x - wide if zigzag[-3] > x else x + wide
        self.line([x, *zigzag.tolist(), x], [low, *turns.tolist(), high])

    def damper(self, x: float, low: float, high: float, wide: float = 0.2) -> None:
        """A dashpot along a vertical line: the pot below, the piston from above."""
        span = high - low
        pot_low, pot_high, piston = low + 0.3 * span, low + 0.68 * span, low + 0.5 * span
        self.line([x, x], [low, pot_low])
        self.line([x - wide, x - wide, x + wide, x + wide], [pot_high, pot_low, pot_low, pot_high])
        self.line([x - 0.8 * wide, x + 0.8 * wide], [piston, piston], 2.0)
        self.line([x, x], [piston, high])

    def ground(self, low: float, high: float, y: float, *, up: bool = False) -> None:
        """A fixed foundation: a line with strokes below it, or with `up` above it."""
        self.line([low, high], [y, y])
        sign = 1 if up else -1
        for x in np.arange(low + 0.08, high, 0.2):
            self.line([x, x + 0.13 * sign], [y, y + 0.16 * sign], 0.7)

    def arrow(self, start: tuple[float, float], end: tuple[float, float], size: float = 9, **how: Any) -> None:
        """An arrow; `how` has further properties of matplotlib's arrow."""
        look = {"arrowstyle": "-|>", "mutation_scale": size, "color": self.style.look.ink, "linewidth": 1.0, **how}
        self.ax.add_patch(FancyArrowPatch(start, end, **look))

    def up(self, x: float, low: float, high: float) -> None:
        """An arrow upwards."""
        self.arrow((x, low), (x, high), shrinkA=0, shrinkB=0)

    def pair(self, x: float, y: float, force: str, velocity: str) -> None:
        """Force and velocity at a point of the chain, both positive upwards."""
        self.ax.plot([x], [y], marker="o", markersize=3.5, color=self.style.look.ink)
        self.up(x + 1.55, y - 0.22, y + 0.22)
        self.line([x, x + 1.75], [y, y], 0.6)
        self.text(x + 1.85, y, f"{force}, {velocity}")

    def leader(self, x: float, y: float, at_x: float, at_y: float, text: str, ha: str = "left") -> None:
        """Draw a thin line from a part to its name."""
        self.ax.plot([x, at_x], [y, at_y], color=self.style.look.muted, linewidth=0.7)
        self.text(at_x + (0.08 if ha == "left" else -0.08), at_y, text, ha=ha, size=8.0)

    def tyre_element(self, x: float, low: float, high: float) -> None:
        """Draw the tyre: K1 parallel to the arm of K2 and C."""
        left, right, middle = x - 0.8, x + 0.8, 0.5 * (low + high)
        self.line([left, right], [low + 0.15, low + 0.15])
        self.line([left, right], [high - 0.15, high - 0.15])
        self.line([x, x], [low, low + 0.15])
        self.line([x, x], [high - 0.15, high])
        self.spring(left, low + 0.15, high - 0.15)
        self.spring(right, middle, high - 0.15)
        self.damper(right, low + 0.15, middle)
        self.text(left - 0.35, middle, "K1", ha="right")
        self.text(right + 0.35, 0.5 * (middle + high - 0.15), "K2")
        self.text(right + 0.35, 0.5 * (low + 0.15 + middle), "C")

    def tyre(self, x: float, y: float, radius: float) -> None:
        """A tyre in side view, flat at the contact."""
        angle = np.linspace(-0.5 * np.pi, 1.5 * np.pi, 181)
        outer = np.column_stack([radius * np.cos(angle), np.maximum(radius * np.sin(angle), -0.955 * radius)])
        self.fill(Polygon, outer + np.array([x, y]), face=self.style.look.grid, width=1.3)
        self.fill(Circle, (x, y), 0.62 * radius, width=1.0)
        self.fill(Circle, (x, y), 0.16 * radius)

    def frame(self, left: float, right: float, low: float, high: float) -> None:
        """A portal frame on the ground."""
        wide = 0.24
        self.box(left, low, wide, high - low)
        self.box(right - wide, low, wide, high - low)
        self.box(left, high, right - left, 0.3)
        self.ground(left - 0.3, right + 0.3, low)


def tyre_model(results: Results, style: Style) -> Figure:  # noqa: ARG001  every figure takes the results
    """Figure 1: K1 parallel to a Maxwell arm."""
    pen = Pen(4.0, style)
    x = 4.9
    pen.tyre_element(x, 0.6, 3.4)
    pen.pair(x, 0.6, "F1", "V1")
    pen.pair(x, 3.4, "F2'", "V2'")
    pen.text(3.2, 2.0, "tyre, without mass", ha="right", size=8.0)
    return pen.figure


def whole_model(results: Results, style: Style) -> Figure:
    """Figure 2: the tyre, the moving mass, the preload spring and the foundation, with the values stated."""
    rig = _only_rig(results)
    pen = Pen(6.1, style)
    x = 5.1
    pen.tyre_element(x, 0.6, 2.9)
    pen.pair(x, 0.6, "F1", "V1")
    pen.mass(x - 1.0, 2.9, 2.0, 0.8)
    pen.text(x, 3.3, "m" + (f" = {rig.moving_mass:.4g} kg" if rig else ""), ha="center")
    pen.line([x + 1.0, x + 1.55], [3.3, 3.3], 0.6)
    pen.up(x + 1.55, 3.08, 3.52)
    pen.text(x + 1.85, 3.3, "V2")
    damped = rig is not None and rig.preload_damping > 0
    at = x - 0.45 if damped else x
    pen.spring(at, 3.7, 5.5)
    pen.text(at - 0.4, 4.6, "K3" + (f" = {rig.preload_stiffness / 1e3:.4g} kN/m" if rig else ""), ha="right")
    if damped and rig is not None:
        pen.damper(x + 0.45, 3.7, 5.5)
        pen.text(x + 0.85, 4.6, f"c3 = {rig.preload_damping:.4g} N s/m")
    pen.ground(x - 1.1, x + 1.1, 5.5, up=True)
    pen.text(x + 1.85, 5.5, "F3, V3 = 0")
    for low, high, name in ((0.6, 2.85, "tyre"), (2.95, 3.65, "moving mass"), (3.75, 5.5, "preload spring")):
        pen.line([2.4, 2.3, 2.3, 2.4], [low, low, high, high], 0.7)
        pen.text(2.15, 0.5 * (low + high), name, ha="right", size=8.0)
    if rig is not None and rig.blocked:
        pen.text(x, 5.92, "the rig of this campaign is blocked beyond the specimen: V2 = 0", ha="center", size=8.0)
    return pen.figure


def static_rig(results: Results, style: Style) -> Figure:  # noqa: ARG001
    """Figure 3: screw, force transducer, tyre, deflection transducer, pen recorder."""
    pen = Pen(5.4, style)
    pen.frame(2.4, 6.4, 0.5, 4.7)
    x, y, radius = 4.4, 1.66, 1.0
    pen.box(3.2, 0.5, 2.4, 0.2, style.look.grid)
    pen.tyre(x, y, radius)
    # Yoke from the hub to the screw.
    pen.line([x - 0.35, x - 0.35, x + 0.35, x + 0.35], [y, 2.95, 2.95, y], 2.0)
    pen.box(x - 0.3, 2.95, 0.6, 0.45)
    pen.box(x - 0.1, 3.4, 0.2, 1.75)
    for thread in np.arange(3.5, 4.65, 0.12):
        pen.line([x - 0.1, x + 0.1], [thread, thread + 0.06], 0.6)
    pen.line([x - 0.55, x + 0.55], [5.15, 5.15], 2.4)
    # Variable resistance between yoke and frame.
    pen.line([x + 0.35, 5.72], [2.72, 2.72], 0.9)
    pen.box(5.66, 2.1, 0.16, 1.2)
    pen.line([5.82, 6.16], [2.7, 2.7], 0.9)
    # Recorder with both signals.
    pen.box(7.5, 1.3, 1.9, 1.0)
    pen.text(8.45, 1.8, "pen recorder", ha="center", size=8.0)
    pen.wire([x + 0.3, 5.2, 5.2, 8.8, 8.8], [3.17, 3.17, 3.75, 3.75, 2.3])
    pen.wire([5.74, 5.74, 8.1, 8.1], [3.3, 3.5, 3.5, 2.3])
    pen.text(8.9, 3.0, "load F", size=8.0)
    pen.text(8.0, 3.0, "deflection x", ha="right", size=8.0)
    pen.leader(x - 0.1, 4.2, 1.9, 4.2, "loading screw", "right")
    pen.leader(x - 0.3, 3.17, 1.9, 3.17, "force transducer", "right")
    pen.leader(x - 0.8, 1.9, 1.9, 1.9, "tyre", "right")
    pen.leader(3.4, 0.6, 1.9, 0.85, "plate", "right")
    pen.leader(5.8, 2.3, 7.3, 0.8, "variable resistance")
    return pen.figure


def dynamic_rig(results: Results, style: Style) -> Figure:  # noqa: ARG001
    """Figure 4: gear boxes, cam, tyre, clamped axle with the moving mass, leaf spring."""
    pen = Pen(6.7, style)
    x = 4.9
    pen.frame(2.9, 6.9, 0.4, 6.05)
    # The shaft of the cam is off the centre of the disc.
    shaft = (x - 0.13, 1.2)
    pen.fill(Circle, (x, 1.2), 0.5, face=style.look.grid, width=1.3)
    pen.fill(Circle, shaft, 0.09, face=style.look.ink, width=1.0)
    pen.ax.plot([x], [1.2], marker="+", markersize=6, color=style.look.ink)
    pen.arrow((shaft[0] - 0.62, 1.0), (shaft[0] - 0.1, 0.56), 8, connectionstyle="arc3,rad=0.35")
    pen.box(0.3, 0.9, 0.95, 0.6)
    pen.text(0.775, 1.2, "motor", ha="center", size=8.0)
    pen.box(1.5, 0.8, 0.95, 0.8)
    pen.text(1.975, 1.2, "gear\nboxes", ha="center", size=8.0)
    pen.line([1.25, 1.5], [1.2, 1.2], 2.0)
    pen.ax.plot([2.45, shaft[0]], [1.2, 1.2], color=style.look.ink, linewidth=1.0, linestyle=(0, (6, 2, 1, 2)))
    # Follower with the force transducer.
    pen.box(x - 0.12, 1.7, 0.24, 0.3)
    pen.box(x - 0.25, 2.0, 0.5, 0.26, style.look.grid)
    pen.box(x - 0.95, 2.26, 1.9, 0.14)
    pen.tyre(x, 3.28, 0.92)
    # Clamp from the hub to the moving mass.
    pen.line([x - 0.3, x - 0.3, x + 0.3, x + 0.3], [3.28, 4.3, 4.3, 3.28], 2.0)
    pen.mass(x - 0.9, 4.3, 1.8, 0.55)
    pen.text(x, 4.575, "m", ha="center")
    # Semi-elliptical leaf spring: fixed eyes on the frame, the middle on the mass.
    for leaf, reach in enumerate((1.45, 1.1, 0.75)):
        across = np.linspace(-reach, reach, 61)
        along = 5.62 - 0.42 * np.sqrt(1 - (across / 1.7) ** 2) - 0.07 * leaf
        pen.ax.plot(x + across, along, color=style.look.ink, linewidth=1.6)
    pen.box(x - 0.16, 4.85, 0.32, 0.24, style.look.grid)
    for side in (-1.45, 1.45):
        end = 5.62 - 0.42 * np.sqrt(1 - (1.45 / 1.7) ** 2)
        pen.line([x + side, x + side], [end, 6.05])
        pen.ax.plot([x + side], [end], marker="o", markersize=4, markerfacecolor=style.look.paper, color=style.look.ink)
    pen.up(x + 1.35, 2.05, 2.6)
    pen.line([x + 0.95, x + 1.35], [2.33, 2.33], 0.6)
    pen.up(x + 1.35, 4.3, 4.85)
    pen.line([x + 0.9, x + 1.35], [4.575, 4.575], 0.6)
    for at, y, text in ((1.42, 2.33, "V1"), (1.42, 4.575, "V2")):
        pen.text(x + at, y, text)
    names = (
        (x + 0.42, 1.0, 0.85, "cam: a disc with 1 mm\neccentricity (enlarged)"),
        (x + 0.25, 2.1, 1.75, "force transducer, F1"),
        (x + 0.85, 3.4, 3.4, "tyre"),
        (x + 0.3, 4.0, 4.0, "tyre clamping"),
    )
    for part_x, part_y, y, text in names:
        pen.leader(part_x, part_y, 7.15, y, text)
    pen.leader(x + 0.6, 5.22, 7.15, 5.4, "leaf spring (preload)")
    pen.text(7.23, 5.12, "K3 = 12.44 kN/m", size=8.0)
    pen.leader(6.6, 6.2, 7.15, 6.2, "frame, V3 = 0")
    return pen.figure


def _only_rig(results: Results) -> Rig | None:
    """The rig of the campaign, if it has one and no more."""
    rigs = section(results.record, "stated", "rigs")
    return rig_stated(next(iter(rigs.values()))) if len(rigs) == 1 else None


#: Figures of this module, in the order of a report.
FIGURES = (
    FigureSpec(
        "fig01",
        "Figure 1: viscoelastic tyre model",
        "The spring K1 beside a spring K2 in series with a damper C.",
        tyre_model,
    ),
    FigureSpec(
        "fig02",
        "Figure 2: model of the test arrangement",
        "The tyre under the moving mass m and the preload spring K3, which ends on a fixed foundation.",
        whole_model,
    ),
    FigureSpec(
        "fig03",
        "Figure 3: static rig",
        "A screw loads the tyre; force and deflection are recorded together.",
        static_rig,
    ),
    FigureSpec(
        "fig04",
        "Figure 4: dynamic rig",
        "A cam with 1 mm eccentricity shakes the contact; the tyre carries the moving mass under a leaf spring.",
        dynamic_rig,
    ),
)
