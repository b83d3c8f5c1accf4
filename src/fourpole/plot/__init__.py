"""Figures from result tables; each function draws into given matplotlib axes and returns them."""

from fourpole.plot.catalogue import FIGURES, draw, render, save_figures, write_figure
from fourpole.plot.figure import FORMATS, FigureSpec
from fourpole.plot.style import THEMES, Style

__all__ = ["FIGURES", "FORMATS", "THEMES", "FigureSpec", "Style", "draw", "render", "save_figures", "write_figure"]
