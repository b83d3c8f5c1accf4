"""Figures from result tables: axes in, axes out."""

from fourpole.plot.catalogue import FIGURES, draw, render, save_figures, write_figure
from fourpole.plot.figure import FORMATS, FigureSpec
from fourpole.plot.style import THEMES, Style

__all__ = ["FIGURES", "FORMATS", "THEMES", "FigureSpec", "Style", "draw", "render", "save_figures", "write_figure"]
