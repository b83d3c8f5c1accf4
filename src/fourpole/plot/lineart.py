"""Line art: drawings of the package, placed on a sheet, and the user's own rig as campaign.toml states it."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from importlib import resources
from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree as ET

import numpy as np
from matplotlib.patches import PathPatch
from matplotlib.path import Path

from fourpole import quantities as q
from fourpole.core.confidence import COVERAGE_FACTOR
from fourpole.core.phasor import SYMBOLS
from fourpole.core.rig import PARAMETERS
from fourpole.plot.data import plain_text
from fourpole.plot.layout import new_figure
from fourpole.plot.sheet import Sheet, floats, read_sheet
from fourpole.plot.style import THEMES, Style
from fourpole.quantities import RIG_VALUES, Quantity, ShownUnits
from fourpole.study.record import section
from fourpole.study.study import Study

if TYPE_CHECKING:
    from matplotlib.figure import Figure


#: Width of a sheet [pt].
WIDE = 504.0
_CODES = {"M": Path.MOVETO, "L": Path.LINETO, "C": Path.CURVE4, "Z": Path.CLOSEPOLY}
#: Names of the colours of a theme by what stands for them in a drawing.
_COLOURS = {getattr(THEMES["light"], name): name for name in ("paper", "ink", "muted", "grid")} | {"none": "none"}
_ALIGNED = {"start": "left", "middle": "center", "end": "right"}


def drawing_of(room: str, file: str, group: str = "") -> ET.Element:
    """A drawing of a room of the package, or a group of it by its id."""
    root = ET.fromstring(resources.files(room).joinpath(file).read_text(encoding="utf-8"))
    found = root.find(f".//*[@id='{group}']") if group else root
    assert found is not None, f"{file} has no group {group}"
    return found


class Canvas:
    """A sheet without axes, whose points (x, y) count from its upper left corner; its height is in points."""

    def __init__(self, height: float, style: Style) -> None:
        self.style = style
        self.figure = new_figure(style.width, style.width * height / WIDE)
        self.ax = self.figure.add_axes((0.0, 0.0, 1.0, 1.0))
        self.ax.set(xlim=(0.0, WIDE), ylim=(height, 0.0), aspect="equal", facecolor=style.look.paper)
        self.ax.set_axis_off()

    def place(
        self, drawing: ET.Element, x: float = 0.0, y: float = 0.0, values: Mapping[str, str] | None = None
    ) -> None:
        """Draw a drawing with its origin at (x, y); a value stands in place of its name in braces in a text."""
        for one in drawing.iter():
            kind, how = one.tag.rpartition("}")[2], one.attrib
            if kind == "path":
                self._path(how, np.array([x, y]))
            elif kind == "text":
                text, size = (one.text or "").format_map(values or {}), float(how["font-size"])
                self.text(x + float(how["x"]), y + float(how["y"]), text, _ALIGNED[how["text-anchor"]], size)

    def _path(self, how: dict[str, str], origin: np.ndarray) -> None:
        """Draw a path with the colours of the theme."""
        vertices, codes = [np.zeros((0, 2))], list[Any]()
        for letter, numbers in re.findall(r"([MLCZ])([^MLCZ]*)", how["d"]):
            points = np.array(numbers.split() or [0.0, 0.0], dtype=float).reshape(-1, 2)
            vertices.append(points + origin)
            codes += [_CODES[letter]] * len(points)
        width, dashes = float(how["stroke-width"]), how.get("stroke-dasharray", "").split()
        fill, stroke = (getattr(self.style.look, _COLOURS[how[name]], "none") for name in ("fill", "stroke"))
        line = (0.0, [float(length) / width for length in dashes]) if dashes else "solid"
        caps = {"capstyle": "butt" if dashes else "round", "joinstyle": "round"}
        shape = Path(np.concatenate(vertices), codes)
        self.ax.add_patch(PathPatch(shape, facecolor=fill, edgecolor=stroke, linewidth=width, linestyle=line, **caps))

    def text(self, x: float, y: float, text: str, ha: str = "left", size: float = 8.0) -> None:
        """A text at half its height; its size is that of a report [pt]."""
        self.ax.text(x, y, text, ha=ha, va="center", fontsize=size * self.style.width / 7.0)  # type: ignore[arg-type]


_MOST_RIGS, _MOST_NAMES = 2, 3
#: What the sensors measure, by their roles in campaign.toml.
_SENSORS = {**SYMBOLS, "load": "load", "deflection": "deflection"}


class Kind(StrEnum):
    """What a link of the chain is."""

    SENSOR = "sensor"
    MASS = "mass"
    SPECIMEN = "specimen"
    SPRING = "spring"
    FIXED = "fixed"


@dataclass(frozen=True)
class Link:
    """One link of the chain: what it is, its name in the drawing, and what is stated of it, line by line."""

    kind: Kind
    name: str
    stated: tuple[str, ...] = ()
    damped: bool = False


def chains(results: Study) -> dict[str, tuple[Link, ...]]:
    """The links of each rig by its name, from the contact upwards.

    Examples
    --------
    >>> import polars as pl
    >>> none, rig = pl.DataFrame(), {"output": "blocked"}
    >>> chains(Study(none, none, none, {"stated": {"rigs": {"": rig}}}))[""][-1]
    Link(kind=<Kind.FIXED: 'fixed'>, name='blocked: V2 = 0', stated=(), damped=False)
    """
    stated = section(results.record, "stated", "rigs")
    if not stated:
        return {}
    sheet = read_sheet(results, texts_only=True)
    channels = section(results.record, "stated", "channels")
    return {name: _chain(name, section(rig), channels, sheet, results.shown) for name, rig in stated.items()}


def _chain(
    name: str, rig: Mapping[str, Any], channels: Mapping[str, Any], sheet: Sheet, units: ShownUnits
) -> tuple[Link, ...]:
    values = {key: _value(units.of(RIG_VALUES[key]), rig[key]) for key in PARAMETERS if _stated(rig.get(key))}
    blocked = rig.get("output") == "blocked"
    own = np.array([one == name for one in sheet.rigs], dtype=bool)
    links = [_sensor("motion_in", channels), _sensor("force_in", channels)]
    links += [_mass("input mass", values, "input_mass")]
    links += [Link(Kind.SPECIMEN, "K*", (_specimens(sheet, own),))]
    links += [_mass("", values, "tyre_mass")]
    links += [] if blocked else [_sensor("motion_out", channels)]
    links += [_mass("m", values, "moving_mass", *_added(sheet, own))]
    links += [Link(Kind.FIXED, "blocked: V2 = 0")] if blocked else []
    spring = [values[key] for key in ("preload_stiffness", "preload_damping", "preload_loss_factor") if key in values]
    frame = "frame_stiffness" in values
    if spring and not blocked:
        links += [Link(Kind.SPRING, "K3", tuple(spring), damped="preload_damping" in values)]
        links += [Link(Kind.SPRING, "", (values["frame_stiffness"],))] if frame else []
        links += [Link(Kind.FIXED, "foundation")]
    return tuple(one for one in links if one is not None)


def _stated(value: object) -> bool:
    """Whether a value is stated and is not zero; a part with the value zero is absent."""
    found = value.get("value") if isinstance(value, dict) else None
    return isinstance(found, int | float) and bool(np.isfinite(found)) and found != 0


def _value(known: Quantity, stated: Mapping[str, Any]) -> str:
    """A value with its U in the shown unit."""
    std = stated.get("std")
    unit = f" {known.suffix}" if known.suffix else ""
    text = f"{known.name} = {stated['value'] / known.scale:.6g}"
    if not isinstance(std, int | float) or not std > 0:
        return f"{text}{unit}"
    return f"{text} ± {COVERAGE_FACTOR * std / known.scale:.2g}{unit}" + (
        " (assumed)" if stated.get("assumed") is True else ""
    )


def _mass(name: str, values: Mapping[str, str], key: str, *more: str) -> Link | None:
    return Link(Kind.MASS, name, (values[key], *more)) if key in values else None


def _sensor(role: str, channels: Mapping[str, Any]) -> Link | None:
    """The sensor of a channel: what it measures, and its column with its unit."""
    stated = section(channels, role)
    if not stated:
        return None
    column, unit = (plain_text(str(stated[key])) if stated.get(key) else "" for key in ("column", "unit"))
    named = " ".join(part for part in (column, f"[{unit}]" if unit else "") if part)
    words = {"force": "force", "displacement": "displacement", "velocity": "velocity", "acceleration": "acceleration"}
    quantity = words.get(str(stated.get("quantity", "")), "force" if role in ("force_in", "load") else "motion")
    return Link(Kind.SENSOR, _SENSORS[role], (f"{quantity}: column {named}" if named else quantity,))


def _specimens(sheet: Sheet, own: np.ndarray) -> str:
    names = [sheet.labels[at] for at in np.unique(sheet.tyre[own]) if sheet.names[at]]
    if len(names) > _MOST_NAMES:
        return f"{len(names)} specimens"
    return ", ".join(names) or "specimen"


def _added(sheet: Sheet, own: np.ndarray) -> tuple[str, ...]:
    masses = sorted({float(f"{mass:.4g}") for mass in floats(sheet.table, q.ADDED_MASS.head)[own] if mass > 0})
    shown = ", ".join(f"{mass:g}" for mass in masses[:6])
    return (f"in some tests {shown} kg added",) if masses else ()


#: Height of each kind of link in links.svg [pt], and of a spring with a damper.
_HEIGHTS = {Kind.SENSOR: 21.17, Kind.MASS: 37.8, Kind.SPECIMEN: 50.4, Kind.SPRING: 57.96, Kind.FIXED: 15.12}
#: Distance of what is stated of a link from the middle of the chain, and of two lines of it [pt].
_BESIDE, _LINE = 68.0, 13.1


def own_rig(results: Study, style: Style) -> Figure | None:
    """The chains of the rigs beside each other, from the contact at the bottom to the foundation at the top."""
    found = list(chains(results).items())
    if not found:
        return None
    shown = found[:_MOST_RIGS]
    heads = 25.2 if len(shown) > 1 else 0.0
    high = heads + 17.6 + max(sum(_HEIGHTS[link.kind] for link in links) for _, links in shown)
    canvas = Canvas(high + 25.2, style)
    for at, (name, links) in enumerate(shown):
        x, y = (0.36 * WIDE if len(shown) == 1 else (0.15 + 0.5 * at) * WIDE), high - 2.5
        for link in links:
            _draw(canvas, x, y, link)
            y -= _HEIGHTS[link.kind]
        if heads:
            canvas.text(x, 22.7, f"rig {plain_text(name)}" if name else "rig", "center", 9.0)
    more = f"; {_MOST_RIGS} of {len(found)} rigs shown" if len(found) > _MOST_RIGS else ""
    canvas.text(7.6, high + 17.6, f"As campaign.toml states it{more}.", size=7.0)
    return canvas.figure


def _draw(canvas: Canvas, x: float, y: float, link: Link) -> None:
    """One link from the height y upwards, with what is stated of it on its right."""
    group = "damped" if link.damped else link.kind.value
    canvas.place(drawing_of("fourpole.plot", "links.svg", group), x, y, {"name": link.name})
    middle = y - 0.5 * _HEIGHTS[link.kind] - 0.5 * _LINE * (len(link.stated) - 1)
    for row, text in enumerate(link.stated):
        canvas.text(x + _BESIDE, middle + _LINE * row, plain_text(text, 60))


#: The figures of this module by their keys in catalogue.toml.
FIGURES = {"rig": own_rig}
