"""Figures 1 to 4 of the paper as line art: the two models and the two rigs."""

from __future__ import annotations

from functools import partial

from matplotlib.figure import Figure

from fourpole.plot.lineart import Canvas, drawing_of
from fourpole.plot.sheet import rig_stated
from fourpole.plot.style import Style
from fourpole.study.record import section
from fourpole.study.study import Study


def drawn(results: Study, style: Style, *, file: str) -> Figure:  # noqa: ARG001  every figure takes the results
    """Figures 1, 3 and 4, which have nothing of a campaign."""
    return _figure(file, style)


def whole_model(results: Study, style: Style) -> Figure:
    """Figure 2: the tyre, the moving mass, the preload spring and the foundation, with the values stated."""
    rigs = section(results.record, "stated", "rigs")
    rig = rig_stated(next(iter(rigs.values()))) if len(rigs) == 1 else None
    if rig is None:
        return _figure("fig02.svg", style, m="m", K3="K3", blocked="")
    return _figure(
        "fig02-damped.svg" if rig.preload_damping > 0 else "fig02.svg", style,
        m=f"m = {rig.moving_mass:.4g} kg",
        K3=f"K3 = {rig.preload_stiffness / 1e3:.4g} kN/m",
        c3=f"c3 = {rig.preload_damping:.4g} N s/m",
        blocked="the rig of this campaign is blocked beyond the specimen: V2 = 0" if rig.blocked else "",
    )  # fmt: skip


def _figure(file: str, style: Style, **values: str) -> Figure:
    """A drawing of this room as a figure of its size."""
    drawing = drawing_of("fourpole.paper1982", file)
    canvas = Canvas(float(drawing.attrib["viewBox"].split()[3]), style)
    canvas.place(drawing, values=values)
    return canvas.figure


#: The figures of this module by their keys in catalogue.toml.
FIGURES = {"fig02": whole_model, **{key: partial(drawn, file=f"{key}.svg") for key in ("fig01", "fig03", "fig04")}}
