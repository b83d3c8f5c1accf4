"""Figures 1 to 4: the two models and the two rigs of the paper, as line art."""

from __future__ import annotations

from functools import partial
from importlib import resources

from matplotlib.figure import Figure

from fourpole.io.documents import toml_of
from fourpole.plot.pen import Pen
from fourpole.plot.stiffness import rig_stated
from fourpole.plot.style import Style
from fourpole.study.record import section
from fourpole.study.study import Study


def from_strokes(results: Study, style: Style, *, key: str) -> Figure:  # noqa: ARG001  every figure takes the results
    """Figures 1, 3 and 4, whose strokes are in schemes.toml."""
    text = resources.files("fourpole.plot").joinpath("schemes.toml").read_text(encoding="utf-8")
    scheme = toml_of(text, "schemes.toml")[key]
    pen = Pen(scheme["height"], style)
    for stroke, *arguments in scheme["strokes"]:
        getattr(pen, stroke)(*arguments)
    return pen.figure


def whole_model(results: Study, style: Style) -> Figure:
    """Figure 2: the tyre, the moving mass, the preload spring and the foundation, with the values stated."""
    rigs = section(results.record, "stated", "rigs")
    rig = rig_stated(next(iter(rigs.values()))) if len(rigs) == 1 else None
    pen = Pen(6.1, style)
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
FIGURES = {
    "fig01": partial(from_strokes, key="fig01"),
    "fig02": whole_model,
    "fig03": partial(from_strokes, key="fig03"),
    "fig04": partial(from_strokes, key="fig04"),
}
