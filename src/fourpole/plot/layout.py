"""Layout: a grid of panels with the key and the notes below them, measured in inches so that nothing overlaps."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from fourpole.core.arrays import BoolArray, FloatArray
from fourpole.plot.panels import Extent
from fourpole.plot.sheet import Sheet, spread
from fourpole.plot.style import Style, load_dashes, load_marker, pressure_marker

__all__ = ["MOST_NAMED", "WIDTH", "Grid", "Key", "Notes", "new_figure"]

#: Width of a figure in a report [in].
WIDTH = 7.0
_LEFT, _RIGHT, _TOP = 0.66, 0.16, 0.3
_NOTE_LINE, _KEY_LINE = 0.135, 0.172
MOST_NAMED = 8
_SIGN = 0.062  # width of a letter of the key


def new_figure(width: float = WIDTH, height: float = 3.0) -> Figure:
    """A figure that pyplot knows nothing of."""
    figure = Figure(figsize=(width, height))
    FigureCanvasAgg(figure)
    return figure


@dataclass
class Key:
    """Entries of the key below the panels."""

    entries: list[tuple[Artist, str]] = field(default_factory=list)

    def add(self, handle: Artist, label: str) -> None:
        """One entry."""
        self.entries.append((handle, label))

    def tyres(self, sheet: Sheet, which: Sequence[int], style: Style) -> None:
        """Colours of tyres."""
        for tyre in which:
            self.add(Line2D([], [], color=style.colour(tyre), linewidth=2.6), sheet.labels[tyre])

    def pressures(self, sheet: Sheet, which: Sequence[int], style: Style) -> None:
        """Markers of pressures."""
        for rank in (which[at] for at in spread(len(which), MOST_NAMED)):
            if np.isnan(sheet.pressures.values[rank]) and len(sheet.pressures) == 1:
                continue
            label = sheet.pressures.labels[rank]
            handle = Line2D(
                [],
                [],
                linestyle="none",
                marker=pressure_marker(rank),
                color=style.look.muted,
                markerfacecolor=style.neutral_face(rank, len(sheet.pressures)),
            )
            self.add(handle, label if label[0].isdigit() else f"pressure {label}")

    def loads(self, sheet: Sheet, which: Sequence[int], style: Style, *, markers: bool = False) -> None:
        """Line styles of loads, with their markers where those are in use."""
        for rank in which:
            if np.isnan(sheet.loads.values[rank]) and len(sheet.loads) == 1:
                continue
            label = sheet.loads.labels[rank]
            handle = Line2D(
                [],
                [],
                color=style.look.muted,
                linestyle=load_dashes(rank),
                marker=load_marker(rank) if markers else "",
            )
            self.add(handle, label if label[0].isdigit() else f"preload {label}")

    def rejected(self, style: Style) -> None:
        """The cross of rejected tests."""
        handle = Line2D([], [], linestyle="none", marker="X", markersize=6.0, markerfacecolor=style.look.paper)
        handle.set_markeredgecolor(style.look.muted)
        self.add(handle, "rejected test")


@dataclass
class Notes:
    """Sentences below a figure: what it does not show."""

    lines: list[str] = field(default_factory=list)

    def say(self, text: str) -> None:
        """Add a sentence once."""
        if text and text not in self.lines:
            self.lines.append(text)

    def chosen(self, shown: int, of: int, what: str) -> None:
        """That only some of several conditions are drawn."""
        if shown < of:
            self.say(f"{shown} of {of} {what} shown")

    def tests(self, rejected: BoolArray, visible: BoolArray, what: str) -> None:
        """Tests rejected and tests without a value, of those that a figure is about."""
        count, hidden = int(rejected.sum()), int(np.sum(rejected & ~visible))
        if count:
            tests = "test" if count == 1 else "tests"
            self.say(f"{count} {tests} rejected" + (f", {hidden} not shown: no value" if hidden else ""))
        lacking = int(np.sum(~rejected & ~visible))
        if lacking:
            self.say(f"{lacking} {'test has' if lacking == 1 else 'tests have'} no {what}")

    def beyond(self, values: FloatArray, limits: tuple[float, float], what: str) -> None:
        """Rejected tests whose values lie outside the axes."""
        count = int(np.sum((values < min(limits)) | (values > max(limits))))
        if count:
            self.say(f"{what} of {count} rejected {'test' if count == 1 else 'tests'} beyond the axes")

    def cut(self, extent: Extent, limits: tuple[float, float], style: Style, what: str = "uncertainty") -> None:
        """Values and bars that leave the axes."""
        values, cut = extent.outside(style.ylim or limits)
        if values:
            why = "" if style.ylim else ": they are known to no better than 100 %"
            self.say(f"{values} {'value' if values == 1 else 'values'} beyond the axes{why}")
        if cut:
            self.say(f"{cut} {what} {'bar leaves' if cut == 1 else 'bars leave'} the axes")


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
        """So many panels in so many columns."""
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
        """Label the outer axes, put key and notes below, and size the figure.

        `y_labels` has one text for all rows, or one per row. `headings` says which rows have a title: "all" or "top".
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
            self.figure.text(
                0.1 / WIDTH,
                0.05 / height,
                "\n".join(note_lines),
                fontsize=7.0,
                color=self.style.look.muted,
                va="bottom",
                ha="left",
                linespacing=1.25,
            )
        return self.figure


def _wrapped(lines: Sequence[str]) -> list[str]:
    text = "; ".join(lines)
    return textwrap.wrap(f"{text[:1].upper()}{text[1:]}.", 116) if lines else []


def _key_shape(labels: Sequence[str]) -> tuple[int, int]:
    if not labels:
        return 1, 0
    widest = max(len(label) for label in labels) * _SIGN + 0.5
    most = max(1, int((WIDTH - 0.2) / widest))
    rows = -(-len(labels) // most)
    return -(-len(labels) // rows), rows


def _draw_key(figure: Figure, key: Key, columns: int, bottom: float) -> None:
    # matplotlib fills a key column by column; people read row by row.
    by_column = [key.entries[at] for column in range(columns) for at in range(column, len(key.entries), columns)]
    handles, labels = zip(*by_column, strict=True)
    # matplotlib drops labels that begin with an underscore, and a tyre may be called so.
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
