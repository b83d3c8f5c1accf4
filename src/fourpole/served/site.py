"""What all pages have in common: workspace, jobs, results that are held, templates, figures, errors."""

from __future__ import annotations

import json
import os
import re
import threading
from collections import OrderedDict
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property
from importlib import resources
from itertools import zip_longest
from pathlib import Path
from typing import Any, Generic, TypeVar
from urllib.parse import quote

from jinja2 import ChoiceLoader, DictLoader, Environment, PackageLoader, pass_context
from jinja2.runtime import Context
from markupsafe import Markup
from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import HTMLResponse, JSONResponse, RedirectResponse, Response
from starlette.routing import Route

from fourpole import plot
from fourpole import quantities as q
from fourpole.campaign import Campaign, read_campaign
from fourpole.campaign.folder import LIMITS
from fourpole.core.digits import number
from fourpole.errors import CampaignError, FourpoleError
from fourpole.findings import by_size, findings
from fourpole.plot.cards import dynamic_cards, static_cards
from fourpole.plot.data import Panel, Role, Series
from fourpole.plot.sheet import texts
from fourpole.report.digits import with_u
from fourpole.report.html import environment, fit
from fourpole.report.page import PARTS, ReportFigure, page_parts
from fourpole.report.words.sentence import sentences
from fourpole.served.editing import ConflictError
from fourpole.served.guard import ASKED_BY
from fourpole.served.jobs import Asked, Jobs
from fourpole.served.signals import Collector
from fourpole.served.workspace import NoCampaignError, Place, Uploads, Workspace, state_of
from fourpole.study.results import read_results
from fourpole.study.study import Study
from fourpole.units import shown
from fourpole.version import VERSION

#: Scripts of the app: what its pages share, and that of each page that has one.
_SCRIPTS = ("app", "home", "run", "recording", "statement", "watch", "explore", "model", "plan", "ask")
#: Files that pages load, with the package that has them and their kind.
STATIC = {
    "page.css": ("fourpole.report", "text/css"),
    "tables.js": ("fourpole.report", "text/javascript"),
    "draw.js": ("fourpole.report", "text/javascript"),
    "app.css": ("fourpole.served.static", "text/css"),
    **dict.fromkeys((f"{name}.js" for name in _SCRIPTS), ("fourpole.served.static", "text/javascript")),
}
#: Largest number of folders that are watched at a time.
MOST_WATCHES = 8
#: Largest body of a form or of a list of files [byte].
MOST_BODY = 20_000_000
#: Number of campaigns whose results are held.
_MOST = 6
#: Largest figure that is shown [byte].
_MOST_BYTES = 20_000_000
Made = TypeVar("Made")


@dataclass(eq=False)
class Shown:
    """The results of a campaign, and what the report shows of them."""

    place: Place
    results: Study
    _lock: threading.Lock = field(default_factory=threading.Lock, repr=False)

    @cached_property
    def parts(self) -> dict[str, Any]:
        """What the templates of the report show."""
        files, figures = self.results.files, {}
        for key, spec in plot.FIGURES.items():
            if files is not None and files.has(name := f"figures/{key}.svg"):
                drawing = files.read(name, max_bytes=_MOST_BYTES).decode(errors="replace")
                figures[key] = ReportFigure(key, spec.title, spec.caption, drawing, spec.number)
        found = sentences(by_size(findings(self.results)), self.results.shown)
        parts = page_parts(self.results, findings=found, figures=figures)
        return {**parts, "lacks_models": False}  # the page Model says so, and fits them

    @cached_property
    def cards(self) -> dict[str, Any]:
        """The card of each test, by the name of the test, in their order."""
        return {card.test: card for card in self.parts["cards"]}


class Latest(Generic[Made]):
    """What was asked for last, by keys, while the mark of its inputs stays the same."""

    def __init__(self, most: int) -> None:
        self._most, self._lock = most, threading.Lock()
        self._made: OrderedDict[Any, tuple[Any, Made]] = OrderedDict()

    def get(self, key: Any, mark: Any, make: Callable[[], Made]) -> Made:
        """What is held of a key with this mark, or else is made now."""
        with self._lock:
            held = self._made.get(key)
            if held is not None and held[0] == mark:
                self._made.move_to_end(key)
                return held[1]
        made = make()
        with self._lock:
            self._made[key] = (mark, made)
            self._made.move_to_end(key)
            while len(self._made) > self._most:
                self._made.popitem(last=False)
        return made


class Held:
    """The results and statements that were asked for last."""

    def __init__(self) -> None:
        self._campaigns: Latest[Campaign] = Latest(_MOST)
        self._shown: Latest[Shown] = Latest(_MOST)

    def of(self, place: Place) -> Shown | None:
        """The results of a campaign; None if it has none yet."""
        mark = _marks(place.results, "study.json", "model.json", "map.json")
        if mark[0] is None:
            return None
        return self._shown.get(place.key, mark, lambda: Shown(place, read_results(place.results)))

    def campaign(self, place: Place) -> Campaign:
        """The statement of a campaign, read again when its files change; CampaignError if it cannot be used."""
        mark = _marks(place.folder, "campaign.toml", "tests.csv", LIMITS)
        return self._campaigns.get(place.key, mark, lambda: read_campaign(place.folder))


def _marks(folder: Path, *names: str) -> list[tuple[int, ...] | None]:
    """Time of change, size and inode of files of a folder; None for one that is missing."""
    marks: list[tuple[int, ...] | None] = [None] * len(names)
    for at, name in enumerate(names):
        with suppress(OSError):
            stat = (folder / name).stat()
            marks[at] = stat.st_mtime_ns, stat.st_size, stat.st_ino
    return marks


@dataclass(eq=False)
class Site:
    """The state of a server; no page keeps anything of its own."""

    workspace: Workspace
    jobs: Jobs
    uploads: Uploads
    #: Commands that the page Ask may start.
    commands: tuple[Asked, ...] = ()
    held: Held = field(default_factory=Held)
    collector: Collector = field(default_factory=Collector)
    #: Watches, which run beside the other jobs.
    watches: Jobs = field(default_factory=lambda: Jobs(MOST_WATCHES))
    #: Questions, which run beside the other jobs, one at a time.
    answers: Jobs = field(default_factory=lambda: Jobs(1, "answer"))
    #: Figures are drawn one at a time: their style is a setting of matplotlib.
    drawing: threading.Lock = field(default_factory=threading.Lock)

    def __post_init__(self) -> None:
        loader = ChoiceLoader([PackageLoader("fourpole.served", "templates"), DictLoader(PARTS)])
        self._templates: Environment = environment(loader)
        self._templates.globals |= {"place": _place, "address": address, "version": VERSION}

    def place(self, request: Request) -> Place:
        """The campaign that the address names, also one that is being made."""
        key = str(request.path_params["key"])
        return self.jobs.making(key) or self.workspace.find(key)

    def results(self, place: Place) -> Shown:
        """The results of a campaign that has been analysed; CampaignError if they are gone."""
        shown = self.held.of(place)
        if shown is None:
            raise CampaignError("the results were deleted a moment ago: run the analysis again")
        return shown

    async def page(
        self, template: str, make: Callable[[], dict[str, Any]], of: Place | None = None, status: int = 200
    ) -> Response:
        """A page of a campaign, or of none; its content is made in a thread, so that other pages answer meanwhile."""

        def filled() -> str:
            campaign = {"campaign": of} if of is None else {"campaign": of, "state": state_of(of)}
            return fit(self._templates.get_template(template).render(**{**campaign, **make()}))

        return HTMLResponse(await run_in_threadpool(filled), status)

    def page_route(
        self, path: str, template: str, make: Callable[[Place, Request], dict[str, Any]], *, of_results: bool = False
    ) -> Route:
        """The route of a page of a campaign; one of results leads to the page Run while there are none."""

        async def page(request: Request) -> Response:
            place = self.place(request)
            if of_results and not place.analysed:
                return RedirectResponse(address(place, "run"), 303)
            return await self.page(template, lambda: make(place, request), place)

        return Route(path, page)

    def document_route(self, path: str, make: Callable[[Place, Request], Any]) -> Route:
        """The route of a JSON document on a campaign, for the script of a page."""

        async def document(request: Request) -> Response:
            return JSONResponse(await run_in_threadpool(make, self.place(request), request))

        return Route(path, document)

    async def fault(self, request: Request, error: Exception) -> Response:
        """The answer to what goes wrong: a page, or a document for a script."""
        status, text = _told(error)
        if ASKED_BY in request.headers:
            # A browser writes every other status into its console, as if the page had a fault.
            return JSONResponse({"error": text}, status if status == 500 else 200)
        if "text/html" not in request.headers.get("accept", ""):
            return JSONResponse({"error": text}, status)
        return await self.page("fault.html", lambda: {"text": text, "campaign": self._known(request)}, status=status)

    def _known(self, request: Request) -> Place | None:
        """The campaign that an address names, if there is one."""
        with suppress(FourpoleError, KeyError):
            return self.place(request)
        return None


def _told(error: Exception) -> tuple[int, str]:
    """The status of an error, and its words."""
    if isinstance(error, HTTPException):
        known = error.status_code != 404
        return error.status_code, error.detail if known else "there is no such page: the address may not be whole"
    if isinstance(error, FourpoleError):
        status = 404 if isinstance(error, NoCampaignError) else 409 if isinstance(error, ConflictError) else 400
        return status, str(error)
    if isinstance(error, MemoryError):
        return 400, "not enough memory to show this: close other programs, or make the campaign smaller"
    if isinstance(error, OSError):
        name = "a file" if error.filename is None else shown(Path(os.fsdecode(error.filename)).name)
        return 400, f"{name} cannot be read or written: {error.strerror or error}"
    return 500, f"a fault in Fourpole itself ({type(error).__name__}: {error}); please report it"


@pass_context
def _place(context: Context, card: str, test: str) -> str:  # noqa: ARG001 - the report leads to the card
    """Where the name of a test leads: to its recording."""
    return address(context["campaign"], "tests", test)


def address(place: Place, *parts: str) -> str:
    """The address of a page of a campaign."""
    return "/".join(["/c", quote(place.key, safe=""), *(quote(part, safe="") for part in parts)])


def attachment(content: bytes, kind: str, name: str) -> Response:
    """A file to be kept, by its content, kind and name."""
    return Response(content, media_type=kind, headers={"Content-Disposition": f'attachment; filename="{name}"'})


async def body_of(request: Request) -> Any:
    """The JSON document that a script sent; FourpoleError if there is none, or it is too long."""
    content = bytearray()
    async for part in request.stream():
        content += part
        if len(content) > MOST_BODY:
            raise FourpoleError("the request is too long")
    try:
        return json.loads(content)
    except (ValueError, RecursionError):
        raise FourpoleError("the request is no JSON document") from None


def static(request: Request) -> Response:
    """A style sheet or a script."""
    name = str(request.path_params["name"])
    if name not in STATIC:
        raise HTTPException(404)
    package, kind = STATIC[name]
    content = resources.files(package).joinpath(name).read_bytes()
    return Response(content, media_type=kind, headers={"Cache-Control": "no-cache"})


#: A link in a figure to the card of a test.
_CARD = re.compile(r'xlink:href="#([\w-]+)"')
#: Largest number of rows of the tables below a figure.
_MOST_ROWS = 2000


class LinkedFigure:
    """A figure of the report whose points lead to the recordings of their tests."""

    def __init__(self, figure: ReportFigure, shown: Shown) -> None:
        self.title, self.caption, self.address, self.size = figure.title, figure.caption, figure.address, figure.size
        drawing = figure.inline
        self.inline = None if drawing is None else linked(drawing, shown)


def linked(drawing: Markup, shown: Shown) -> Markup:
    """A drawing whose links to cards of tests are links to their recordings."""
    results = shown.results
    tests = {card: test for test, card in static_cards(results).items()}
    tests |= dict(zip(dynamic_cards(results), texts(results.dynamic, q.TEST.head), strict=True))

    def place_of(found: re.Match[str]) -> str:
        test = tests.get(found[1])
        return found[0] if test is None else f'xlink:href="{address(shown.place, "tests", test)}"'

    return Markup(_CARD.sub(place_of, drawing))


def spec_of(key: str) -> plot.FigureSpec:
    """A figure of the catalogue, which is loaded with the library that draws it when the first page shows a figure."""
    from fourpole.plot import catalogue

    return catalogue.spec_of(key)


def drawn(site: Site, results: Study, key: str, form: str = "svg") -> bytes | None:
    """A figure of the catalogue as a file; None if the results hold nothing that it shows."""
    with site.drawing:
        figure = plot.draw(results, key)
        return None if figure is None else plot.render(figure, key, form)


def figure_of(site: Site, shown: Shown, results: Study, key: str) -> LinkedFigure | None:
    """A figure of the catalogue for a page; `results` are those of `shown`, or a part of them."""
    svg = drawn(site, results, key)
    if svg is None:
        return None
    spec = spec_of(key)
    return LinkedFigure(ReportFigure(key, spec.title, spec.caption, svg.decode(), spec.number), shown)


@dataclass(frozen=True)
class Values:
    """The tests of one panel of a figure: name and unit of both axes, and a row for each test."""

    title: str
    x: str
    y: str
    rows: list[tuple[str, str, str, str]]


def values_of(results: Study, key: str) -> list[Values]:
    """The tests that a figure shows, panel by panel; none for line art, which has no axes."""
    if key in plot.FIGURES and plot.FIGURES[key].data is None:
        return []
    data = plot.figure_data(results, key)
    found, left = [], _MOST_ROWS
    for panel in () if data is None else data.panels:
        rows = list(_rows(panel))[:left]
        left -= len(rows)
        if rows:
            found.append(
                Values(", ".join(filter(None, (panel.title, panel.right))), panel.x.label, panel.y.label, rows)
            )
    return found


def _rows(panel: Panel) -> Iterator[tuple[str, str, str, str]]:
    """Name of the test, verdict if it is rejected, and both values as text."""
    for one in panel.series:
        if one.role in (Role.POINTS, Role.REJECTED) and one.tests and not panel.names:
            verdict = "rejected" if one.role is Role.REJECTED else ""
            yield from zip(one.tests, [verdict] * len(one.tests), *_texts(one), strict=True)


def _texts(one: Series) -> Iterator[list[str]]:
    """The texts of x and of y, with U where it is known."""
    for values, stds in ((one.x, one.across), (one.y, one.spread)):
        pairs = zip_longest(values.tolist(), [] if stds is None else stds.tolist())
        yield [with_u(value, std) if std is not None and std > 0 else number(value, 5) for value, std in pairs]
