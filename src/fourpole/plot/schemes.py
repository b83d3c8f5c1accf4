"""Figures 1 to 4: the two models and the two rigs of the paper, as line art."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from fourpole.core.rig import Rig
from fourpole.plot.pen import Pen
from fourpole.plot.spec import FigureSpec
from fourpole.plot.stiffness import rig_stated
from fourpole.plot.style import Style
from fourpole.study.record import section
from fourpole.study.study import Study


def tyre_model(results: Study, style: Style) -> Figure:  # noqa: ARG001  every figure takes the results
    """Figure 1: K1 parallel to a Maxwell arm."""
    pen = Pen(4.0, style)
    x = 4.9
    pen.tyre_element(x, 0.6, 3.4)
    pen.pair(x, 0.6, "F1", "V1")
    pen.pair(x, 3.4, "F2'", "V2'")
    pen.text(3.2, 2.0, "tyre, without mass", ha="right", size=8.0)
    return pen.figure


def whole_model(results: Study, style: Style) -> Figure:
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


def static_rig(results: Study, style: Style) -> Figure:  # noqa: ARG001
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


def dynamic_rig(results: Study, style: Style) -> Figure:  # noqa: ARG001
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


def _only_rig(results: Study) -> Rig | None:
    """The rig of the campaign, if it has one and no more."""
    rigs = section(results.record, "stated", "rigs")
    return rig_stated(next(iter(rigs.values()))) if len(rigs) == 1 else None


#: Figures of this module, in the order of a report.
FIGURES = (
    FigureSpec(
        "fig01",
        "viscoelastic tyre model",
        "The spring K1 beside a spring K2 in series with a damper C.",
        tyre_model,
        number=1,
    ),
    FigureSpec(
        "fig02",
        "model of the test arrangement",
        "The tyre under the moving mass m and the preload spring K3, which ends on a fixed foundation.",
        whole_model,
        number=2,
    ),
    FigureSpec(
        "fig03",
        "static rig",
        "A screw loads the tyre; force and deflection are recorded together.",
        static_rig,
        number=3,
    ),
    FigureSpec(
        "fig04",
        "dynamic rig",
        "A cam with 1 mm eccentricity shakes the contact; the tyre carries the moving mass under a leaf spring.",
        dynamic_rig,
        number=4,
    ),
)
