"""What all pages have in common: the workspace, the jobs, the templates, and answers to errors."""

from __future__ import annotations

import json
import os
import threading
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from importlib import resources
from pathlib import Path
from typing import Any
from urllib.parse import quote

from jinja2 import ChoiceLoader, DictLoader, Environment, PackageLoader, pass_context
from jinja2.runtime import Context
from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import HTMLResponse, JSONResponse, RedirectResponse, Response
from starlette.routing import Route

from fourpole.errors import CampaignError, FourpoleError
from fourpole.report.html import environment, fit
from fourpole.report.page import PARTS
from fourpole.served.editing import ConflictError
from fourpole.served.guard import ASKED_BY
from fourpole.served.held import Held, Shown
from fourpole.served.jobs import Asked, Jobs
from fourpole.served.signals import Collector
from fourpole.served.workspace import NoCampaignError, Place, Uploads, Workspace, state_of
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
