"""A page that is one file: its template, its style sheet and its pictures."""

from __future__ import annotations

import base64
import re
from collections.abc import Callable, Mapping
from importlib import resources
from typing import Any

from jinja2 import BaseLoader, DictLoader, Environment, StrictUndefined

#: Characters that a page must not contain: control characters and lone surrogates.
_UNFIT = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\ud800-\udfff\ufffe\uffff]")


def packaged(name: str, package: str = "fourpole.report") -> str:
    """The text of a file of the package: a template, a style sheet or a script."""
    return resources.files(package).joinpath(name).read_text(encoding="utf-8")


def on_page(card: str, test: str) -> str:  # noqa: ARG001 - pages that lead elsewhere need the name
    """Address of the card of a test on the page itself."""
    return f"#{card}"


def rendered(templates: Mapping[str, str], *, place: Callable[[str, str], str] = on_page, **shown: Any) -> str:
    """The template named "page", filled in; texts are escaped, and characters that a page must not contain replaced.

    Each template may import "head", the head of a page with the policy that lets it load nothing from elsewhere.
    `place` gives the address to which the name of a test leads, from the key of its card and its name.
    """
    made = environment(DictLoader({"head": packaged("head.html"), **templates}))
    made.globals["place"] = place
    return fit(made.get_template("page").render(**shown))


def environment(loader: BaseLoader) -> Environment:
    """Where templates become pages: texts are escaped, and a name that is not there is an error."""
    return Environment(loader=loader, autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)


def fit(page: str) -> str:
    """A page without the characters that it must not contain."""
    return _UNFIT.sub("\ufffd", page)


def svg_address(svg: bytes) -> str:
    """A drawing as a data: URL."""
    return f"data:image/svg+xml;base64,{base64.b64encode(svg).decode()}"
