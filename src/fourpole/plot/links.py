"""Links from the points of an SVG to the cards of their tests, with the name of the test as a tooltip."""

from __future__ import annotations

import re

from fourpole.plot.names import plain_text

#: Sign between the id of a card and the name of a test; it occurs in no name that figures show.
_MARK = "\u2063"
_LINK = re.compile(rf"""<a xlink:href=(["'])(#[-a-z0-9]+){_MARK}(.*?)\1[^>]*>""".encode())


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
