"""A grid of panels with the key and the notes below, in inches, and the bytes that a figure is written as."""

from __future__ import annotations

import io
import re
import textwrap
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, TypeVar

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure, SubFigure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from fourpole.errors import CampaignError
from fourpole.plot.axis import PanelAxes
from fourpole.plot.data import Scale, plain_text
from fourpole.plot.style import Marker, Style, drawing

_T = TypeVar("_T")
#: File formats of a figure.
FORMATS = ("svg", "png", "pdf")
_DIGITS = re.compile(rb"(?<=\d\.\d\d)\d+")
#: A line with text, or as many lines without as follow each other.
_OF_TEXT = re.compile(rb"([^\n]*(?:<text|title>)[^\n]*\n?)|(?:(?![^\n]*(?:<text|title>))[^\n]*\n)+|[^\n]+")
_GROUP_NAME = re.compile(rb'<g id="[^"]*"')
#: Sign between the id of a card and the name of a test; it occurs in no name that figures show.
_MARK = "\u2063"
_LINK = re.compile(rf"""<a xlink:href=(["'])#([-a-z0-9]+{_MARK}.*?)\1[^>]*>(.*?)</a>""".encode(), re.S)
_POINT = re.compile(rb"<use[^<>]*>")


#: Titles of the figures that commands draw, by their keys; those of results are in the catalogue.
TITLES = {
    "plan": "Uncertainty to expect of K*, K2 and C",
    "ride": "Ride",
    "shift": "Master curve",
    "twoport": "Four poles",
}


def command_figure(figure: Figure, key: str, form: str = "svg", style: Style | None = None) -> bytes:
    """The content of a file of a figure of `TITLES`, as svg, png or pdf; CampaignError for another format."""
    return figure_bytes(figure, key, TITLES[key], form, style)


def figure_bytes(figure: Figure, key: str, title: str, form: str, style: Style | None = None) -> bytes:
    """The content of a file in one of `FORMATS`; the same figure gives the same bytes.

    Raises
    ------
    CampaignError
        If there is no such format.
    """
    if form not in FORMATS:
        raise CampaignError(f"no format {form!r} of a figure: choose one of {', '.join(FORMATS)}")
    metadata: dict[str, dict[str, Any]] = {
        "svg": {"Date": None, "Creator": "fourpole", "Title": title},
        "png": {"Software": None, "Title": title},
        "pdf": {"CreationDate": None, "Creator": "fourpole", "Producer": None, "Title": title},
    }
    content, style = io.BytesIO(), style or Style()
    with drawing(style, key), warnings.catch_warnings():
        # A script that the font lacks is shown as boxes in PNG; in SVG the text itself is written.
        warnings.filterwarnings("ignore", message="Glyph .* missing from", category=UserWarning)
        figure.savefig(content, format=form, dpi=style.dpi, metadata=metadata[form])
    return _lean(with_titles(content.getvalue())) if form == "svg" else content.getvalue()


def _lean(svg: bytes) -> bytes:
    """The SVG with two decimals per number, and without ids of groups.

    Two figures in one HTML page would otherwise have groups with the same id.
    """
    return _OF_TEXT.sub(_lean_part, svg)


def _lean_part(part: re.Match[bytes]) -> bytes:
    """A line with text as it is, other lines with short numbers and without ids of groups."""
    return part[0] if part[1] else _GROUP_NAME.sub(b"<g", _DIGITS.sub(b"", part[0]))


def links(cards: Sequence[str], tests: Sequence[str]) -> str:
    r"""The address of a line, from which `with_titles` makes a link and a tooltip of each of its points.

    Examples
    --------
    >>> with_titles(f'<a xlink:href="{links(["dynamic-3"], ["D3"])}"><use/></a>'.encode())
    b'<a xlink:href="#dynamic-3"><title>D3</title>\n<use/></a>'
    """
    parts = zip(cards, (plain_text(test, 60).replace(_MARK, "") for test in tests), strict=True)
    return "#" + _MARK.join(part for pair in parts for part in pair)


def with_titles(svg: bytes) -> bytes:
    """The SVG with a link of each point, which has the name of the test as its title.

    A line whose points are not as many as its links, as when its axes have been changed, has none.
    """
    return _LINK.sub(_parted, svg)


def _parted(found: re.Match[bytes]) -> bytes:
    """The points of a line, each in its own link."""
    parts = found[2].split(_MARK.encode())
    cards, tests, drawn = parts[::2], parts[1::2], found[3]
    points = [drawn] if len(cards) == 1 else _POINT.findall(drawn)
    if len(points) != len(cards):
        return drawn
    return b"\n".join(
        b'<a xlink:href="#%b"><title>%b</title>\n%b</a>' % each for each in zip(cards, tests, points, strict=True)
    )


#: Width of a figure in a report [in].
WIDTH = 7.0
_TOP = 0.3
_NOTE_LINE, _KEY_LINE = 0.135, 0.172
#: Width of a letter of the key [in].
_LETTER = 0.062
#: Number of letters of the notes in an inch of width, and of colours of a scale.
_LETTERS, _SHADES = 116 / WIDTH, 24
#: Height of a colour scale with its numbers [in].
_SCALE_HEIGHT = 0.42
#: Label of the axes that hold a colour scale.
COLOUR_SCALE = "_colour scale"


def new_figure(width: float = WIDTH, height: float = 3.0) -> Figure:
    """A figure that is not registered with pyplot; width and height in inches."""
    figure = Figure(figsize=(width, height))
    FigureCanvasAgg(figure)
    return figure


def parts_of(
    found: Sequence[_T], most: int, size: tuple[float, float], what: str
) -> tuple[Figure, list[tuple[_T, SubFigure]], str]:
    """A figure with a part for each of the first `most`, of this size [in]; the note that these are not all."""
    shown = found[:most]
    figure = Figure(figsize=(size[0], size[1] * len(shown)))
    parts = np.atleast_1d(np.asarray(figure.subfigures(len(shown), 1), dtype=object)).tolist()
    left_out = f" ({len(shown)} of {len(found)} {what})" if len(shown) < len(found) else ""
    return figure, list(zip(shown, parts, strict=True)), left_out


@dataclass
class Key:
    """Entries of the key below the panels."""

    entries: list[tuple[Artist, str]] = field(default_factory=list)

    def line(self, label: str, colour: str, width: float | None = None, **look: Any) -> None:
        """Add an entry with a line; `look` has further properties of matplotlib's line."""
        self.entries.append((Line2D([], [], color=colour, linewidth=width, **look), label))

    def marker(self, label: str, marker: Marker, colour: str, face: str, **look: Any) -> None:
        """Add an entry with a marker and its fill; `look` has further properties of matplotlib's line."""
        self.line(label, colour, linestyle="none", marker=marker, markerfacecolor=face, **look)

    def band(self, style: Style) -> None:
        """Add the 95 % band of a model or a map."""
        self.entries.append((Patch(facecolor=style.look.muted, alpha=0.35, linewidth=0.0), "95 % band"))


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
        figure = new_figure(style.size.width)
        panels = [figure.add_subplot(rows, columns, at + 1, axes_class=PanelAxes) for at in range(count)]
        return cls(figure, panels, columns, panel_height, style)

    @property
    def rows(self) -> int:
        """Number of rows."""
        return -(-len(self.panels) // self.columns)

    def finish(
        self,
        *,
        key: Key,
        notes: Sequence[str],
        x_label: str,
        y_labels: Sequence[str],
        share_x: bool = True,
        share_y: bool = True,
        headings: str = "all",
        scale: Scale | None = None,
        height: float | None = None,
        left: float = 0.66,
        right: float = 0.16,
        least: float = 0.5,
    ) -> Figure:
        """Label the outer axes, put key and notes below, and size the figure; returns the figure.

        `y_labels` has one text for all rows, or one text per row. `headings` is "all" if each row of panels has
        titles, "top" if only the first row has, and "none" if no row has. A colour scale stands below the key.
        `height` [in] is that of the whole figure; without it, or one of the style, it follows from the panels, which
        are never lower than `least` [in]. `left` and `right` [in] are the room beside a panel.
        """
        self._label(x_label, y_labels, share_x, share_y)
        size, rows = self.style.size, self.rows
        unit = size.font
        between = unit * ((0.36 if headings == "all" else 0.14) + (0.0 if share_x else 0.42))
        beside = 0.16 if share_y else left * unit
        note_lines = _wrapped(notes, int(_LETTERS * size.width / unit))
        key_columns, key_rows = _key_shape([label for _, label in key.entries], size.width / unit)
        notes_height = unit * (_NOTE_LINE * len(note_lines) + (0.06 if note_lines else 0.0))
        key_height = unit * (_KEY_LINE * key_rows + (0.1 if key_rows else 0.0))
        scale_height = unit * _SCALE_HEIGHT if scale is not None else 0.0
        bottom = 0.44 * unit + key_height + scale_height + notes_height
        top = unit * (0.1 if headings == "none" else _TOP)
        height = size.height or height
        if height is not None:
            free = height - top - bottom - (rows - 1) * between
            self.panel_height = max(free / rows, least)
        height = top + rows * self.panel_height + (rows - 1) * between + bottom
        self.figure.set_size_inches(size.width, height)
        panel_width = (size.width - (left + right) * unit - (self.columns - 1) * beside) / self.columns
        self.figure.subplots_adjust(
            left=left * unit / size.width,
            right=1 - right * unit / size.width,
            top=1 - top / height,
            bottom=bottom / height,
            wspace=beside / panel_width,
            hspace=between / self.panel_height,
        )
        if key.entries:
            _draw_key(self.figure, key, key_columns, (notes_height + scale_height + 0.01) / height)
        if scale is not None:
            _draw_scale(self.figure, scale, self.style, (notes_height + 0.26 * unit) / height)
        if note_lines:
            _draw_notes(self.figure, note_lines, self.style)
        return self.figure

    def _label(self, x_label: str, y_labels: Sequence[str], share_x: bool, share_y: bool) -> None:
        """Labels of the axes; where axes are shared, of the outer ones only."""
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


def _draw_notes(figure: Figure, lines: Sequence[str], style: Style) -> None:
    """The notes at the foot of a figure that has its size."""
    width, height = figure.get_size_inches()
    x, y = 0.1 * style.size.font / width, 0.05 * style.size.font / height
    size, colour = style.font(7.0), style.look.muted
    figure.text(x, y, "\n".join(lines), va="bottom", ha="left", fontsize=size, linespacing=1.25, color=colour)


def _wrapped(lines: Sequence[str], letters: int) -> list[str]:
    """The notes as one sentence in lines of so many letters."""
    text = "; ".join(lines)
    return textwrap.wrap(f"{text[:1].upper()}{text[1:]}.", letters) if lines else []


def _key_shape(labels: Sequence[str], width: float) -> tuple[int, int]:
    """Number of columns and rows of the key in a figure of this width [in]."""
    if not labels:
        return 1, 0
    widest = max(len(label) for label in labels) * _LETTER + 0.5
    most = max(1, int((width - 0.2) / widest))
    rows = -(-len(labels) // most)
    return -(-len(labels) // rows), rows


def _draw_scale(figure: Figure, scale: Scale, style: Style, bottom: float) -> None:
    """Draw a colour scale from its lowest to its highest value."""
    width, height = figure.get_size_inches()
    place = (0.5 - 0.18, bottom, 0.36, 0.08 * style.size.font / height)
    ax = figure.add_axes(place, label=COLOUR_SCALE, axes_class=PanelAxes)
    edges = np.linspace(scale.low, scale.high if scale.high > scale.low else scale.low + 1, _SHADES + 1)
    colours = [style.frequency_colour((at + 0.5) / _SHADES) for at in range(_SHADES)]
    spans = list(zip(edges, np.diff(edges), strict=False))
    ax.broken_barh(spans, (0.0, 1.0), facecolors=colours, edgecolors=colours, linewidth=0.4)
    ax.set(xlim=(edges[0], edges[-1]), ylim=(0.0, 1.0), yticks=[])
    ax.xaxis.set_major_locator(MaxNLocator(5, steps=[1, 2, 2.5, 5, 10]))
    ax.grid(visible=False)
    for side in ax.spines.values():
        side.set_visible(False)
    figure.text(0.5 - 0.18 - 0.08 / width, bottom, f"{scale.name} [{scale.unit}]", ha="right", va="baseline",
                fontsize=style.font(7.5))  # fmt: skip


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
