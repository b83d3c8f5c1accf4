"""Figures from result tables: each is data, which matplotlib draws without pyplot.

Each name is loaded when it is first used, so that figures as data need no matplotlib.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from fourpole.plot.fonts import list_fonts

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
    from fourpole.plot.figure import FORMATS
    from fourpole.plot.spec import FigureSpec
    from fourpole.plot.style import SIZES, THEMES, Size, Style

_CATALOGUE = ("FIGURES", "PAPER", "draw", "figure_data", "figures_of", "render", "save_figures", "write_figure")
_HOME = {
    **dict.fromkeys(_CATALOGUE, "catalogue"),
    "FORMATS": "figure",
    "FigureSpec": "spec",
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

list_fonts()  # before any module of this room loads matplotlib


def __getattr__(name: str) -> Any:
    if name in _HOME:
        return getattr(import_module(f"fourpole.plot.{_HOME[name]}"), name)
    raise AttributeError(f"module 'fourpole.plot' has no attribute {name!r}")
