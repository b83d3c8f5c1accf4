"""A grid of panels with the key and the notes below; all sizes are in inches, so that nothing overlaps."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, TypeVar

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from fourpole.core.arrays import BoolArray, FloatArray
from fourpole.plot.panels import Extent
from fourpole.plot.sheet import Groups, Sheet, spread
from fourpole.plot.style import Marker, Style, counted, load_dashes, pressure_marker

_T = TypeVar("_T")
#: Width of a figure in a report [in].
WIDTH = 7.0
_LEFT, _RIGHT, _TOP = 0.66, 0.16, 0.3
_NOTE_LINE, _KEY_LINE = 0.135, 0.172
#: Number of pressures in the key of a figure.
MOST_NAMED = 8
#: Width of a letter of the key [in].
_LETTER = 0.062


def new_figure(width: float = WIDTH, height: float = 3.0) -> Figure:
    """A figure that is not registered with pyplot; width and height in inches."""
    figure = Figure(figsize=(width, height))
    FigureCanvasAgg(figure)
    return figure


@dataclass
class Key:
    """Entries of the key below the panels."""

    entries: list[tuple[Artist, str]] = field(default_factory=list)

    def add(self, handle: Artist, label: str) -> None:
        """Add an entry."""
        self.entries.append((handle, label))

    def line(self, label: str, colour: str, width: float | None = None, **look: Any) -> None:
        """Add an entry with a line; `look` has further properties of matplotlib's line."""
        self.add(Line2D([], [], color=colour, linewidth=width, **look), label)

    def marker(self, label: str, marker: Marker, colour: str, face: str, **look: Any) -> None:
        """Add an entry with a marker and its fill; `look` has further properties of matplotlib's line."""
        self.line(label, colour, linestyle="none", marker=marker, markerfacecolor=face, **look)

    def tyres(self, sheet: Sheet, which: Sequence[int], style: Style) -> None:
        """Add the colours of tyres."""
        for tyre in which:
            self.line(sheet.labels[tyre], style.colour(tyre), 2.6)

    def pressures(self, sheet: Sheet, which: Sequence[int], style: Style) -> None:
        """Add the markers of pressures; of many pressures, some."""
        shown = [which[at] for at in spread(len(which), MOST_NAMED)]
        for rank in shown if _is_stated(sheet.pressures) else ():
            face = style.neutral_face(rank, len(sheet.pressures))
            label = _named("pressure", sheet.pressures.labels[rank])
            self.marker(label, pressure_marker(rank), style.look.muted, face)

    def loads(self, sheet: Sheet, which: Sequence[int], style: Style) -> None:
        """Add the line styles of preloads."""
        for rank in which if _is_stated(sheet.loads) else ():
            self.line(_named("preload", sheet.loads.labels[rank]), style.look.muted, linestyle=load_dashes(rank))

    def rejected(self, style: Style, rejected: BoolArray, label: str = "rejected test") -> None:
        """Add the cross of rejected tests if there are any."""
        if np.any(rejected):
            self.marker(label, "X", style.look.muted, style.look.paper, markersize=6.0)

    def band(self, style: Style) -> None:
        """Add the 95 % band of a model or a map."""
        self.add(Patch(facecolor=style.look.muted, alpha=0.35, linewidth=0.0), "95 % band")


def _is_stated(groups: Groups) -> bool:
    """False if the only group is that of the tests that state no value."""
    return len(groups) > 1 or groups.stated() > 0


def _named(name: str, label: str) -> str:
    """A label with its number, or "not stated" with the name of the axis before it."""
    return label if label[0].isdigit() else f"{name} {label}"


@dataclass
class Notes:
    """Sentences below a figure, chiefly on what it does not show."""

    lines: list[str] = field(default_factory=list)

    def say(self, text: str) -> None:
        """Add a sentence once."""
        if text and text not in self.lines:
            self.lines.append(text)

    def chosen(self, shown: int, of: int, what: str) -> None:
        """Add that only some of several conditions are drawn, if so."""
        if shown < of:
            self.say(f"{shown} of {of} {what} shown")

    def some(self, found: list[_T], most: int, what: str) -> list[_T]:
        """At most `most` of several items, evenly spaced; adds a note if not all are shown."""
        shown = [found[at] for at in spread(len(found), most)]
        self.chosen(len(shown), len(found), what)
        return shown

    def first(self, found: list[_T], most: int, what: str) -> list[_T]:
        """The first of several items, at most `most`; adds a note if not all are shown."""
        self.chosen(min(len(found), most), len(found), what)
        return found[:most]

    def tests(self, rejected: BoolArray, visible: BoolArray, what: str) -> None:
        """Add the numbers of rejected tests and of tests without a value; both masks have all tests of the figure."""
        count, hidden = int(rejected.sum()), int(np.sum(rejected & ~visible))
        if count:
            self.say(f"{counted(count, 'test')} rejected" + (f", {hidden} not shown: no value" if hidden else ""))
        lacking = int(np.sum(~rejected & ~visible))
        if lacking:
            self.say(f"{counted(lacking, 'test')} {'has' if lacking == 1 else 'have'} no {what}")

    def cut(self, extent: Extent, limits: tuple[float, float], style: Style, what: str = "uncertainty") -> None:
        """Add how many values and bars lie outside the axes."""
        values, cut = extent.outside(style.ylim or limits)
        if values:
            why = "" if style.ylim else ": they are known to no better than 100 %"
            self.say(f"{counted(values, 'value')} beyond the axes{why}")
        if cut:
            self.say(f"{counted(cut, f'{what} bar')} {'leaves' if cut == 1 else 'leave'} the axes")

    def outside(
        self, extent: Extent, limits: tuple[float, float], style: Style, rejected: FloatArray, what: str
    ) -> None:
        """Add how many values of rejected tests, and how many other values and bars, lie outside the axes."""
        low, high = sorted(style.ylim or limits)
        count = int(np.sum((rejected < low) | (rejected > high)))
        if count:
            self.say(f"{what} of {counted(count, 'rejected test')} beyond the axes")
        self.cut(extent, limits, style)


@dataclass
class Grid:
    """Panels in rows and columns, filled row by row."""

    figure: Figure
    panels: list[Axes]
    columns: int
    panel_height: float
    style: Style

    @classmethod
    def of(cls, count: int, columns: int, *, panel_height: float, style: Style) -> Grid:
        """A grid of `count` panels; `panel_height` in inches."""
        rows = -(-count // columns)
        figure = new_figure()
        panels = [figure.add_subplot(rows, columns, at + 1) for at in range(count)]
        return cls(figure, panels, columns, panel_height, style)

    @property
    def rows(self) -> int:
        """Number of rows."""
        return -(-len(self.panels) // self.columns)

    def finish(
        self,
        *,
        key: Key,
        notes: Notes,
        x_label: str,
        y_labels: Sequence[str],
        share_x: bool = True,
        share_y: bool = True,
        headings: str = "all",
    ) -> Figure:
        """Label the outer axes, put key and notes below, and size the figure; returns the figure.

        `y_labels` has one text for all rows, or one text per row. `headings` is "all" if each row of panels has
        titles, and "top" if only the first row has.
        """
        for at, ax in enumerate(self.panels):
            row, column = divmod(at, self.columns)
            below = at + self.columns < len(self.panels)
            if share_x and below:
                ax.tick_params(labelbottom=False)
            else:
                ax.set_xlabel(x_label)
            if share_y and column:
                ax.tick_params(labelleft=False)
            else:
                ax.set_ylabel(y_labels[row % len(y_labels)])
        rows = self.rows
        between = (0.36 if headings == "all" else 0.14) + (0.0 if share_x else 0.42)
        beside = 0.16 if share_y else _LEFT
        note_lines = _wrapped(notes.lines)
        key_columns, key_rows = _key_shape([label for _, label in key.entries])
        notes_height = _NOTE_LINE * len(note_lines) + (0.06 if note_lines else 0.0)
        key_height = _KEY_LINE * key_rows + (0.1 if key_rows else 0.0)
        bottom = 0.44 + key_height + notes_height
        height = _TOP + rows * self.panel_height + (rows - 1) * between + bottom
        self.figure.set_size_inches(WIDTH, height)
        panel_width = (WIDTH - _LEFT - _RIGHT - (self.columns - 1) * beside) / self.columns
        self.figure.subplots_adjust(
            left=_LEFT / WIDTH,
            right=1 - _RIGHT / WIDTH,
            top=1 - _TOP / height,
            bottom=bottom / height,
            wspace=beside / panel_width,
            hspace=between / self.panel_height,
        )
        if key.entries:
            _draw_key(self.figure, key, key_columns, (notes_height + 0.01) / height)
        if note_lines:
            self.figure.text(0.1 / WIDTH, 0.05 / height, "\n".join(note_lines), fontsize=7.0, va="bottom", ha="left",
                             linespacing=1.25, color=self.style.look.muted)  # fmt: skip
        return self.figure


def _wrapped(lines: Sequence[str]) -> list[str]:
    """The notes as one sentence in lines of the figure's width."""
    text = "; ".join(lines)
    return textwrap.wrap(f"{text[:1].upper()}{text[1:]}.", 116) if lines else []


def _key_shape(labels: Sequence[str]) -> tuple[int, int]:
    """Number of columns and rows of the key."""
    if not labels:
        return 1, 0
    widest = max(len(label) for label in labels) * _LETTER + 0.5
    most = max(1, int((WIDTH - 0.2) / widest))
    rows = -(-len(labels) // most)
    return -(-len(labels) // rows), rows


def _draw_key(figure: Figure, key: Key, columns: int, bottom: float) -> None:
    # Matplotlib fills a key column by column, but the entries are in the order of rows.
    by_column = [key.entries[at] for column in range(columns) for at in range(column, len(key.entries), columns)]
    handles, labels = zip(*by_column, strict=True)
    # Matplotlib drops labels that begin with an underscore; the name of a tyre may begin with one.
    legend = figure.legend(
        handles,
        [f"entry {at}" for at in range(len(labels))],
        loc="lower center",
        bbox_to_anchor=(0.5, bottom),
        ncols=columns,
        borderpad=0.0,
        borderaxespad=0.0,
        labelspacing=0.35,
        handlelength=2.4,
        handletextpad=0.5,
        columnspacing=1.4,
    )
    for text, label in zip(legend.get_texts(), labels, strict=True):
        text.set_text(label)
