"""Figures 1 to 4 of the paper as line art: the two models and the two rigs."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from importlib import resources

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Polygon

from fourpole.io.documents import toml_of
from fourpole.plot.pen import Pen
from fourpole.plot.sheet import rig_stated
from fourpole.plot.style import Style
from fourpole.study.record import section
from fourpole.study.study import Study


class _Pen(Pen):
    """A pen that also draws the parts of the paper's rigs."""

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


def from_strokes(results: Study, style: Style, *, key: str) -> Figure:  # noqa: ARG001  every figure takes the results
    """Figures 1, 3 and 4, whose strokes are in schemes.toml."""
    text = resources.files("fourpole.paper1982").joinpath("schemes.toml").read_text(encoding="utf-8")
    scheme = toml_of(text, "schemes.toml")[key]
    pen = _Pen(scheme["height"], style)
    for stroke, *arguments in scheme["strokes"]:
        getattr(pen, stroke)(*arguments)
    return pen.figure


def whole_model(results: Study, style: Style) -> Figure:
    """Figure 2: the tyre, the moving mass, the preload spring and the foundation, with the values stated."""
    rigs = section(results.record, "stated", "rigs")
    rig = rig_stated(next(iter(rigs.values()))) if len(rigs) == 1 else None
    pen = _Pen(6.1, style)
    x = 5.1
    pen.tyre_element(x, 0.6, 2.9)
    pen.pair(x, 0.6, "F1", "V1")
    pen.mass(x - 1.0, 2.9, 2.0, 0.8)
    pen.text(x, 3.3, "m" + (f" = {rig.moving_mass:.4g} kg" if rig else ""), "center")
    pen.line([x + 1.0, x + 1.55], [3.3, 3.3], 0.6)
    pen.up(x + 1.55, 3.08, 3.52)
    pen.text(x + 1.85, 3.3, "V2")
    damped = rig is not None and rig.preload_damping > 0
    at = x - 0.45 if damped else x
    pen.spring(at, 3.7, 5.5)
    pen.text(at - 0.4, 4.6, "K3" + (f" = {rig.preload_stiffness / 1e3:.4g} kN/m" if rig else ""), "right")
    if damped and rig is not None:
        pen.damper(x + 0.45, 3.7, 5.5)
        pen.text(x + 0.85, 4.6, f"c3 = {rig.preload_damping:.4g} N s/m")
    pen.ground(x - 1.1, x + 1.1, 5.5, up=True)
    pen.text(x + 1.85, 5.5, "F3, V3 = 0")
    for low, high, name in ((0.6, 2.85, "tyre"), (2.95, 3.65, "moving mass"), (3.75, 5.5, "preload spring")):
        pen.line([2.4, 2.3, 2.3, 2.4], [low, low, high, high], 0.7)
        pen.text(2.15, 0.5 * (low + high), name, "right", 8.0)
    if rig is not None and rig.blocked:
        pen.text(x, 5.92, "the rig of this campaign is blocked beyond the specimen: V2 = 0", "center", 8.0)
    return pen.figure


#: The figures of this module by their keys in catalogue.toml.
FIGURES = {"fig02": whole_model, **{key: partial(from_strokes, key=key) for key in ("fig01", "fig03", "fig04")}}
