"""A pen for line art of rigs: springs, dampers, masses, foundations and their names."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.patches import Circle, FancyArrowPatch, Patch, Rectangle

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
