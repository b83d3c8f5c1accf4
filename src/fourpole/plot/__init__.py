"""Figures from result tables: each is data, which matplotlib draws without pyplot.

Each name is loaded when it is first used, so that figures as data need no matplotlib.
"""

from __future__ import annotations

import os
import sys
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fourpole.io.processes import output_of, python_command

if TYPE_CHECKING:
    from fourpole.plot.catalogue import (
        FIGURES,
        PAPER,
        draw,
        figure_data,
        figures_of,
        render,
        save_figures,
        write_figure,
    )
    from fourpole.plot.data import FigureSpec
    from fourpole.plot.layout import FORMATS
    from fourpole.plot.style import SIZES, THEMES, Size, Style

_CATALOGUE = ("FIGURES", "PAPER", "draw", "figure_data", "figures_of", "render", "save_figures", "write_figure")
_HOME = {
    **dict.fromkeys(_CATALOGUE, "catalogue"),
    "FORMATS": "layout",
    "FigureSpec": "data",
    **dict.fromkeys(("SIZES", "THEMES", "Size", "Style"), "style"),
}

__all__ = [
    "FIGURES",
    "FORMATS",
    "PAPER",
    "SIZES",
    "THEMES",
    "FigureSpec",
    "Size",
    "Style",
    "draw",
    "figure_data",
    "figures_of",
    "render",
    "save_figures",
    "write_figure",
]

#: Time that the list of fonts may take [s].
_LONGEST = 60.0


def _list_fonts() -> None:
    """Have a further process list the fonts for matplotlib, which does it once for a user by a program of PATH."""
    if "matplotlib.font_manager" in sys.modules or sys.platform == "win32":
        return
    with suppress(OSError):
        folder = _font_folder()
        if not any(folder.glob("fontlist-v*.json")):
            folder.mkdir(parents=True, exist_ok=True)  # where that fails, matplotlib keeps no list
            output_of(python_command("matplotlib.font_manager"), seconds=_LONGEST)


def _font_folder() -> Path:
    """Folder in which matplotlib keeps the list of fonts."""
    if stated := os.environ.get("MPLCONFIGDIR"):
        return Path(stated)
    if sys.platform == "darwin":
        return Path.home() / ".matplotlib"
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache", "matplotlib")


_list_fonts()  # before any module of this room loads matplotlib


def __getattr__(name: str) -> Any:
    if name in _HOME:
        return getattr(import_module(f"fourpole.plot.{_HOME[name]}"), name)
    raise AttributeError(f"module 'fourpole.plot' has no attribute {name!r}")
