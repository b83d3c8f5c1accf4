"""One figure as an entry of the catalogue, and the bytes that it is written as."""

from __future__ import annotations

import io
import re
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from matplotlib.figure import Figure

from fourpole.errors import CampaignError
from fourpole.plot.data import FigureData
from fourpole.plot.drawn import figure_of
from fourpole.plot.links import with_titles
from fourpole.plot.style import Style, drawing
from fourpole.study.results import Results

#: File formats of a figure.
FORMATS = ("svg", "png", "pdf")
_DIGITS = re.compile(rb"(\d\.\d\d)\d+")
#: A line with text, or as many lines without as follow each other.
_OF_TEXT = re.compile(rb"([^\n]*(?:<text|title>)[^\n]*\n?)|(?:(?![^\n]*(?:<text|title>))[^\n]*\n)+|[^\n]+")
_GROUP_NAME = re.compile(rb'<g id="[^"]*"')


@dataclass(frozen=True)
class FigureSpec:
    """One figure: its key, its title, its caption, and the function that makes its data or draws it.

    `data` makes the figure of results as data; `draw` draws a figure that has none. Either returns None if the results
    hold nothing that the figure shows. `apart`: whether specimens at several temperatures have a colour each.
    """

    key: str
    title: str
    caption: str
    draw: Callable[[Results, Style], Figure | None] | None = None
    data: Callable[[Results], FigureData | None] | None = None
    apart: bool = False

    def drawn(self, results: Results, style: Style) -> Figure | None:
        """The figure; None if the results hold nothing that it shows."""
        if self.draw is not None:
            return self.draw(results, style)
        data = self.data(results) if self.data is not None else None
        return None if data is None else figure_of(data, style)


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
    return part[0] if part[1] else _GROUP_NAME.sub(b"<g", _DIGITS.sub(rb"\1", part[0]))
