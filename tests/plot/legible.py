"""What of a drawn figure cannot be read: texts that lie on each other or are cut by the edge."""

from __future__ import annotations

from itertools import combinations

from matplotlib.axes import Axes
from matplotlib.backend_bases import RendererBase
from matplotlib.figure import Figure
from matplotlib.text import Text
from matplotlib.transforms import Bbox

#: Overlap of two boxes that is no more than the empty margin of their letters, and what may pass the edge [px].
_SLACK, _EDGE = 1.5, 1.0


def illegible(figure: Figure) -> list[str]:
    """One line for each two texts that overlap, and for each text that the edge of the figure cuts."""
    figure.draw_without_rendering()
    renderer = figure.canvas.get_renderer()
    boxes = [(text.get_text(), text.get_window_extent(renderer)) for text in _shown(figure, renderer)]
    width, height = figure.get_size_inches() * figure.dpi
    cut = [text for text, box in boxes
           if box.x0 < -_EDGE or box.y0 < -_EDGE or box.x1 > width + _EDGE or box.y1 > height + _EDGE]  # fmt: skip
    pairs = [(one, other) for (one, a), (other, b) in combinations(boxes, 2) if _overlap(a, b)]
    return [f"cut: {text!r}" for text in cut] + [f"{one!r} on {other!r}" for one, other in pairs]


def _overlap(a: Bbox, b: Bbox) -> bool:
    return min(a.x1, b.x1) - max(a.x0, b.x0) > _SLACK and min(a.y1, b.y1) - max(a.y0, b.y0) > _SLACK


def _shown(figure: Figure, renderer: RendererBase) -> list[Text]:
    """All texts that are drawn."""
    found = [*figure.texts, *(text for legend in figure.legends for text in legend.get_texts())]
    for ax in figure.axes:
        if ax.axison:
            found += [ax.title, ax._left_title, ax._right_title, ax.xaxis.label, ax.yaxis.label, *_ticks(ax)]
        found += [text for text in ax.texts if _inside(text, renderer)]
    return [text for text in found if text.get_visible() and text.get_text().strip()]


def _inside(text: Text, renderer: RendererBase) -> bool:
    """Whether an annotation is drawn: one whose point is beyond the axes is not."""
    check = getattr(text, "_check_xy", None)
    return check is None or bool(check(renderer))


def _ticks(ax: Axes) -> list[Text]:
    found = []
    for axis, limits in ((ax.xaxis, sorted(ax.get_xlim())), (ax.yaxis, sorted(ax.get_ylim()))):
        axis.get_ticklabels()  # all ticks have their texts and places then
        found += [tick.label1 for tick in axis.get_major_ticks()
                  if tick.label1.get_visible() and limits[0] <= tick.get_loc() <= limits[1]]  # fmt: skip
    return found
