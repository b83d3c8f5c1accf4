"""Drawings inside a page, so that their points lead to the cards of their tests; only what can do nothing else."""

from __future__ import annotations

import re
from xml.etree import ElementTree as ET

from markupsafe import Markup

_SVG = "{http://www.w3.org/2000/svg}"
_LINK = "{http://www.w3.org/1999/xlink}href"
_ELEMENTS = frozenset(
    ("svg", "g", "defs", "style", "title", "path", "use", "a", "text", "tspan", "rect", "clipPath", "image")
)
_ATTRIBUTES = frozenset(
    ("id", "d", "style", "x", "y", "width", "height", "transform", "clip-path", "viewBox", "version", "type", _LINK)
)
#: What a link, and an address in a style, may be: a place of this page, or a picture inside it.
_HARMLESS = re.compile(r"#[\w-]+|data:image/png;base64,[A-Za-z0-9+/=\s]+")
_STYLE_SHEET = re.compile(r"<style\b.*?</style>", re.S)
#: Bytes of a drawing that is part of the page; a larger one is an image.
_MOST = 4_000_000


def inline(svg: str, title: str) -> Markup | None:
    """A drawing as a part of an HTML page; None for one that holds more than shapes, texts and links within the page.

    Parameters
    ----------
    svg : str
        The drawing, without prolog and metadata.
    title : str
        Its name, for those who do not see it.

    Examples
    --------
    >>> inline('<svg xmlns="http://www.w3.org/2000/svg"><script/></svg>', "x") is None
    True
    """
    if len(svg) > _MOST or "<!" in svg or "<?" in svg or not svg.startswith("<svg"):
        return None
    try:
        root = ET.fromstring(svg)
    except ET.ParseError:
        return None
    if not all(map(_is_harmless, root.iter())):
        return None
    named = Markup('<svg role="group" aria-label="{}"').format(title)
    body = _STYLE_SHEET.sub("", svg).replace("<a ", '<a tabindex="-1" ')
    return named + Markup(body[len("<svg") :])


def _is_harmless(element: ET.Element) -> bool:
    name = element.tag.removeprefix(_SVG) if isinstance(element.tag, str) else ""
    if name not in _ELEMENTS or not element.attrib.keys() <= _ATTRIBUTES:
        return False
    link = element.attrib.get(_LINK)
    addresses = re.findall(r"url\(\s*['\"]?([^)'\"]*)", " ".join(element.attrib.values()))
    return all(_HARMLESS.fullmatch(one) for one in (*addresses, *([link] if link is not None else [])))
