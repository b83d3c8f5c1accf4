"""Line art: drawings of the package, as SVG files, placed on a sheet with names and values filled in.

A drawing has paths of M, L, C and Z with absolute coordinates, and texts. Its unit is a point of a report, in which
figures are 504 points wide. Its colours are those of the theme "light"; another theme has its own in their place.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from importlib import resources
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np
from matplotlib.patches import PathPatch
from matplotlib.path import Path

from fourpole.plot.layout import new_figure
from fourpole.plot.style import THEMES, Style

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
