"""The bytes that a figure is written as, and the links from its points to the cards of their tests."""

from __future__ import annotations

import io
import re
import warnings
from typing import Any

from matplotlib.figure import Figure

from fourpole.errors import CampaignError
from fourpole.plot.names import plain_text
from fourpole.plot.style import Style, drawing

#: File formats of a figure.
FORMATS = ("svg", "png", "pdf")
_DIGITS = re.compile(rb"(\d\.\d\d)\d+")
#: A line with text, or as many lines without as follow each other.
_OF_TEXT = re.compile(rb"([^\n]*(?:<text|title>)[^\n]*\n?)|(?:(?![^\n]*(?:<text|title>))[^\n]*\n)+|[^\n]+")
_GROUP_NAME = re.compile(rb'<g id="[^"]*"')
#: Sign between the id of a card and the name of a test; it occurs in no name that figures show.
_MARK = "\u2063"
_LINK = re.compile(rf"""<a xlink:href=(["'])(#[-a-z0-9]+){_MARK}(.*?)\1[^>]*>""".encode())


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


def link(card: str, test: str) -> str:
    """The address of a point; `with_titles` makes a link and a tooltip of it.

    Examples
    --------
    >>> with_titles(f'<a xlink:href="{link("dynamic-3", "D3")}">'.encode())
    b'<a xlink:href="#dynamic-3"><title>D3</title>'
    """
    return f"#{card}{_MARK}{plain_text(test, 60).replace(_MARK, '')}"


def with_titles(svg: bytes) -> bytes:
    """The SVG with the name of the test as the title of each link."""
    return _LINK.sub(rb'<a xlink:href="\2"><title>\3</title>', svg)
