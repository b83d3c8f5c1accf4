"""A pen for line art of rigs: springs, dampers, masses, foundations and their names."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.patches import Circle, FancyArrowPatch, Patch, Polygon, Rectangle

from fourpole.plot.layout import new_figure
from fourpole.plot.style import Style

#: Scale of the line art: units of the drawing per width of the figure.
_UNITS = 10.0


class Pen:
    """Draws parts of a rig on a sheet that is 10 units wide; coordinates are in these units."""

    def __init__(self, height: float, style: Style) -> None:
        """A sheet without axes; height in the same units."""
        self.style = style
        self.figure = new_figure(style.width, style.width * height / _UNITS)
        self.ax = self.figure.add_axes((0.0, 0.0, 1.0, 1.0))
        self.ax.set(xlim=(0.0, _UNITS), ylim=(0.0, height), aspect="equal", facecolor=style.look.paper)
        self.ax.set_axis_off()

    def line(self, x: Sequence[float], y: Sequence[float], width: float = 1.3) -> None:
        """A line through points."""
        self.ax.plot(x, y, color=self.style.look.ink, linewidth=width, solid_capstyle="round", solid_joinstyle="round")

    def wire(self, x: Sequence[float], y: Sequence[float]) -> None:
        """A dashed line of a signal."""
        self.ax.plot(x, y, color=self.style.look.muted, linewidth=0.8, linestyle=(0, (3, 2)))

    def fill(self, shape: type[Patch], *where: Any, face: str = "paper", width: float = 1.2) -> None:
        """A closed shape in ink, filled with a colour of the theme."""
        look = self.style.look
        self.ax.add_patch(shape(*where, facecolor=getattr(look, face), edgecolor=look.ink, linewidth=width))

    def box(self, x: float, y: float, wide: float, high: float, face: str = "paper") -> None:
        """A rectangle by its lower left corner."""
        self.fill(Rectangle, (x, y), wide, high, face=face)

    def disc(self, x: float, y: float, radius: float, face: str = "paper", width: float = 1.2) -> None:
        """A disc about its centre."""
        self.fill(Circle, (x, y), radius, face=face, width=width)

    def mass(self, x: float, y: float, wide: float, high: float) -> None:
        """A rigid mass by its lower left corner."""
        self.box(x, y, wide, high, "grid")

    def mark(self, x: float, y: float, marker: str = "o", size: float = 3.5, face: str = "ink") -> None:
        """A marker at a point."""
        look = self.style.look
        self.ax.plot([x], [y], marker=marker, markersize=size, color=look.ink, markerfacecolor=getattr(look, face))

    def text(self, x: float, y: float, text: str, ha: str = "left", size: float = 9.0) -> None:
        """A text at half its height."""
        self.ax.text(x, y, text, ha=ha, va="center", fontsize=size * self.style.width / 7.0)  # type: ignore[arg-type]

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

    def arrow(self, start: Sequence[float], end: Sequence[float], size: float = 9, **how: Any) -> None:
        """An arrow; `how` has further properties of matplotlib's arrow."""
        look = {"arrowstyle": "-|>", "mutation_scale": size, "color": self.style.look.ink, "linewidth": 1.0, **how}
        self.ax.add_patch(FancyArrowPatch((start[0], start[1]), (end[0], end[1]), **look))

    def up(self, x: float, low: float, high: float) -> None:
        """An arrow upwards."""
        self.arrow((x, low), (x, high), shrinkA=0, shrinkB=0)

    def turn(self, start: Sequence[float], end: Sequence[float]) -> None:
        """An arrow along an arc, for the direction in which a shaft turns."""
        self.arrow(start, end, 8, connectionstyle="arc3,rad=0.35")

    def shaft(self, left: float, right: float, y: float) -> None:
        """The centre line of a shaft."""
        self.ax.plot([left, right], [y, y], color=self.style.look.ink, linewidth=1.0, linestyle=(0, (6, 2, 1, 2)))

    def leaf(self, x: float, eye: float, reach: float) -> None:
        """A leaf of a semi-elliptical spring: its lowest point is at x, its ends as far to both sides as it reaches."""
        across = np.linspace(-reach, reach, 61)
        along = eye - 0.42 * np.sqrt(1 - (across / 1.7) ** 2)
        self.ax.plot(x + across, along, color=self.style.look.ink, linewidth=1.6)

    def pair(self, x: float, y: float, force: str, velocity: str) -> None:
        """Force and velocity at a point of the chain, both positive upwards."""
        self.mark(x, y)
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
        self.fill(Polygon, outer + np.array([x, y]), face="grid", width=1.3)
        self.disc(x, y, 0.62 * radius, width=1.0)
        self.disc(x, y, 0.16 * radius)

    def frame(self, left: float, right: float, low: float, high: float) -> None:
        """A portal frame on the ground."""
        wide = 0.24
        self.box(left, low, wide, high - low)
        self.box(right - wide, low, wide, high - low)
        self.box(left, high, right - left, 0.3)
        self.ground(left - 0.3, right + 0.3, low)
