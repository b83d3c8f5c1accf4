"""Axes of panels that draw their grid, ticks and numbers with one tick."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.axis import Axis, Tick, XAxis, YAxis
from matplotlib.backend_bases import RendererBase
from matplotlib.lines import Line2D
from matplotlib.ticker import NullLocator
from matplotlib.transforms import Bbox, Transform

from fourpole.core.arrays import FloatArray

#: An end of the axis counts as inside it up to this share of its length.
_CLOSE = 1e-10


class _OneTick(Axis):
    """An axis on the left or below; matplotlib's own makes five objects for each tick, which is most of its time.

    What the figures of this package do not have, such as numbers on both sides, is left to matplotlib.
    """

    axis_name: str

    def draw(self, renderer: RendererBase) -> None:
        """Draw grid, ticks and numbers, and the label beside them."""
        if not self.get_visible():
            return
        tick, places = self.get_major_ticks(1)[0], self.get_majorticklocs()
        texts = self.get_major_formatter().format_ticks(list(places))
        if not self._is_usual(tick):
            super().set_clip_path(self.axes.patch)
            super().draw(renderer)
            return
        boxes = self._draw_ticks(renderer, tick, places, texts)
        if not isinstance(self.get_minor_locator(), NullLocator):
            places = self.get_minorticklocs()
            texts = self.get_minor_formatter().format_ticks(list(places))
            boxes += self._draw_ticks(renderer, self.get_minor_ticks(1)[0], places, texts) if len(places) else []
        if self.label.get_text():
            self._place_label(Bbox.union([*boxes, self.axes.bbox]))
            self.label.draw(renderer)
        self.stale = False

    def set_clip_path(self, path: Any, transform: Transform | None = None) -> None:
        """Clip the axis, not its ticks, which would all be made for it; a grid is clipped when it is drawn."""
        Artist.set_clip_path(self, path, transform)

    def _is_usual(self, tick: Tick) -> bool:
        """Whether the axis has what this class draws: level numbers on the left or below, and a label beside them."""
        return bool(
            self.get_label_position() in ("bottom", "left")
            and getattr(self, "_autolabelpos", True)
            and not tick.label2.get_visible()
            and not tick.label1.get_rotation()
            and (tick.label1.get_visible() or not self.label.get_text())
            and not self.get_major_formatter().get_offset()
        )

    def _draw_ticks(self, renderer: RendererBase, tick: Tick, places: FloatArray, texts: list[str]) -> list[Bbox]:
        """Draw the ticks within the ends of the axis; returns the boxes of their numbers if these move the label."""
        scale = self.get_transform()
        low, high = np.sort(scale.transform(np.asarray(self.get_view_interval(), dtype=float)))
        at, slack = scale.transform(np.asarray(places, dtype=float)), _CLOSE * (high - low)
        inside = np.flatnonzero((at >= low - slack) & (at <= high + slack))
        at = np.asarray(places, dtype=float)[inside]
        ends, gaps = np.tile([0.0, 1.0, np.nan], at.size), np.repeat(at, 3)
        tick.gridline.set_clip_path(self.axes.patch)
        self._draw_line(renderer, tick.gridline, gaps, ends)
        for line, side in ((tick.tick1line, 0.0), (tick.tick2line, 1.0)):
            self._draw_line(renderer, line, at, np.full(at.size, side))
        boxes = []
        if tick.label1.get_visible():
            for place, text in zip(at.tolist(), (texts[index] for index in inside), strict=True):
                tick.update_position(place)
                tick.label1.set_text(text)
                tick.label1.draw(renderer)
                if text and self.label.get_text():
                    boxes.append(tick.label1.get_window_extent(renderer))
        return boxes

    def _draw_line(self, renderer: RendererBase, line: Line2D, along: FloatArray, across: FloatArray) -> None:
        """Draw a line of the tick at all places at once."""
        if line.get_visible():
            kept = line.get_data()
            line.set_data(*((along, across) if self.axis_name == "x" else (across, along)))
            line.draw(renderer)
            line.set_data(*kept)

    def _place_label(self, numbers: Bbox) -> None:
        """Put the label of the axis beside its numbers."""
        x, y = self.label.get_position()
        pad = self.labelpad * self.axes.figure.dpi / 72
        self.label.set_position((x, numbers.y0 - pad) if self.axis_name == "x" else (numbers.x0 - pad, y))


class _Below(_OneTick, XAxis):
    """An abscissa."""


class _Left(_OneTick, YAxis):
    """An ordinate."""


class PanelAxes(Axes):
    """Axes that are drawn with one tick each."""

    def _init_axis(self) -> None:
        """Make the axes, as projections of matplotlib do; should it ask for them otherwise, they are its own."""
        super()._init_axis()  # type: ignore[misc]
        self.xaxis.__class__, self.yaxis.__class__ = _Below, _Left
