"""A page that is one file: its template, style sheet, pictures, and drawings as parts of it; and the page as PDF."""

from __future__ import annotations

import base64
import os
import re
import shutil
import tempfile
from collections.abc import Mapping
from functools import cache
from importlib import resources
from itertools import chain
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

from jinja2 import BaseLoader, DictLoader, Environment, StrictUndefined, Template
from markupsafe import Markup

from fourpole.errors import FileError
from fourpole.io.processes import output_of, program_path

#: Characters that a page must not contain: control characters and lone surrogates.
_UNFIT = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\ud800-\udfff\ufffe\uffff]")


def packaged(name: str, package: str = "fourpole.report") -> str:
    """The text of a file of the package: a template, a style sheet or a script."""
    return resources.files(package).joinpath(name).read_text(encoding="utf-8")


def rendered(templates: Mapping[str, str], **shown: Any) -> str:
    """The template named "page", filled in; texts are escaped, and characters that a page must not contain replaced.

    Each template may import "head", the head of a page with the policy that lets it load nothing from elsewhere.
    The name of a test leads to its card on the page.
    """
    return fit(_page(tuple(templates.items())).render(**shown))


@cache
def _page(templates: tuple[tuple[str, str], ...]) -> Template:
    """The template named "page" of some; to compile it takes longer than to fill it in."""
    made = environment(DictLoader({"head": packaged("head.html"), **dict(templates)}))
    made.globals["place"] = lambda card, _: f"#{card}"
    return made.get_template("page")


def environment(loader: BaseLoader) -> Environment:
    """Where templates become pages: texts are escaped, and a name that is not there is an error."""
    return Environment(
        loader=loader, autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True, optimized=False
    )


def fit(page: str) -> str:
    """A page without the characters that it must not contain."""
    return _UNFIT.sub("\ufffd", page)


def svg_address(svg: bytes) -> str:
    """A drawing as a data: URL."""
    return f"data:image/svg+xml;base64,{base64.b64encode(svg).decode()}"


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
    if not _is_harmless(root):
        return None
    named = Markup('<svg role="group" aria-label="{}"').format(title)
    body = _STYLE_SHEET.sub("", svg).replace("<a ", '<a tabindex="-1" ')
    return named + Markup(body[len("<svg") :])


def _is_harmless(root: ET.Element) -> bool:
    tags, names, values, links = set[str](), set[str](), list[str](), set[str]()
    for element in root.iter():
        tags.add(element.tag.removeprefix(_SVG))
        names.update(element.attrib)
        values += element.attrib.values()
        links.update(element.attrib[name] for name in (_LINK,) if name in element.attrib)
    addresses = {*re.findall(r"url\(\s*['\"]?([^)'\"]*)", " ".join(values))}
    return tags <= _ELEMENTS and names <= _ATTRIBUTES and all(map(_HARMLESS.fullmatch, links | addresses))


#: Names of browsers that print without a window, on the path, and their places on macOS and Windows.
_NAMES = (
    "chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome", "microsoft-edge",
    "microsoft-edge-stable", "msedge",
)  # fmt: skip
_MAC = (
    "/Applications/Google Chrome.app/Contents/MacOS/Google Chrome",
    "/Applications/Chromium.app/Contents/MacOS/Chromium",
    "/Applications/Microsoft Edge.app/Contents/MacOS/Microsoft Edge",
)
_WINDOWS = (r"Google\Chrome\Application\chrome.exe", r"Microsoft\Edge\Application\msedge.exe")
_WINDOWS_ROOTS = ("PROGRAMFILES", "PROGRAMFILES(X86)", "LOCALAPPDATA")
#: Time after which printing is given up [s].
_SECONDS = 180


def browser() -> str:
    """The path of a Chromium, Chrome or Edge of this machine.

    Raises
    ------
    FileError
        If there is none.
    """
    roots = [root for name in _WINDOWS_ROOTS if (root := os.environ.get(name))]
    places = (*_MAC, *(f"{root}\\{rest}" for root in roots for rest in _WINDOWS))
    for place in chain(map(program_path, _NAMES), (place for place in places if Path(place).is_file())):
        if place:
            return place
    raise FileError(
        "no Chromium, Chrome or Edge is on this machine, which --pdf needs: install one, or open report.html in your "
        "browser and print it to a file"
    )


def print_page(page: Path, path: Path) -> None:
    """Print a page that opens offline into a PDF; what is folded on the page is open in print.

    Parameters
    ----------
    page : Path
        The HTML file.
    path : Path
        The PDF file; it is there only if the whole of it could be written.

    Raises
    ------
    FileError
        If there is no browser, or it did not print the page.
    """
    program = browser()
    # Chromium cannot set up its sandbox for the root user; the page has no script of others.
    root = hasattr(os, "geteuid") and os.geteuid() == 0
    with tempfile.TemporaryDirectory(prefix="fourpole-") as folder:
        printed = Path(folder, "report.pdf")
        command = [
            program, "--headless", "--disable-gpu", "--no-first-run", "--disable-extensions", "--no-pdf-header-footer",
            "--disable-background-networking", "--disable-sync", f"--user-data-dir={Path(folder, 'profile')}",
            *(["--no-sandbox"] if root else []), f"--print-to-pdf={printed}", page.resolve().as_uri(),
        ]  # fmt: skip
        try:
            code, _, said = output_of(command, seconds=_SECONDS)
        except TimeoutError:
            raise FileError(f"{program} did not print {page.name} within {_SECONDS} s") from None
        except OSError as error:
            raise FileError(f"{program} cannot be started: {error.strerror or error}") from None
        if not printed.is_file() or not printed.read_bytes().startswith(b"%PDF"):
            lines = said.decode(errors="replace").strip().splitlines()
            why = f": {lines[-1][:200]}" if lines else f", exit code {code}"
            raise FileError(f"{program} did not print {page.name}{why}")
        shutil.copyfile(printed, path)
