"""Run: a command on a campaign, with its events while it is at work, and the button that stops it."""

from __future__ import annotations

import json
import re
from collections.abc import AsyncIterator, Callable
from functools import partial
from typing import Any, TypeAlias

from markupsafe import Markup
from starlette.requests import Request
from starlette.responses import RedirectResponse, Response, StreamingResponse
from starlette.routing import Route

from fourpole.errors import CampaignError
from fourpole.report.cards import embedded
from fourpole.served.jobs import Job, Jobs, Phase
from fourpole.served.site import Site, address, body_of
from fourpole.served.workspace import Place
from fourpole.units import shown

#: What a page shows of a job, whenever it changes.
Documents: TypeAlias = Callable[[Place, Job], AsyncIterator[dict[str, Any]]]


def job_routes(site: Site, jobs: Jobs, page: str, documents: Documents) -> list[Route]:
    """The events of the job of a page, and the way to stop it."""

    async def stop(request: Request) -> Response:
        job = jobs.of(site.place(request))
        if job is not None:
            job.stop()
            await job.tell()
        return Response(status_code=204)

    async def events(request: Request) -> Response:
        place = site.place(request)
        job = jobs.of(place)
        if job is None:
            return RedirectResponse(address(place, page))
        return StreamingResponse(
            _as_events(documents(place, job)), media_type="text/event-stream", headers={"Cache-Control": "no-store"}
        )

    return [Route(f"/c/{{key}}/{page}", stop, methods=["DELETE"]), Route(f"/c/{{key}}/{page}/events", events)]


async def _as_events(documents: AsyncIterator[dict[str, Any]]) -> AsyncIterator[str]:
    async for document in documents:
        yield f"data: {json.dumps(document)}\n\n"


#: The commands that a page may start, with the options that it may give, as patterns.
COMMANDS = {
    "analyse": r"--models|--no-models",
    "init": r"--force",
    "fit": r"--(model|share|static)=\w[\w:.+-]{0,39}",
    "map": r"--model=\w[\w:.+-]{0,39}",
}
#: What a command is called on the page while it runs.
_DOING = {"analyse": "Analysing", "init": "Looking at the files", "fit": "Fitting models", "map": "Fitting the map"}
#: The page that shows what a command made.
_NEXT = {"init": ("statement",), "fit": ("model",), "map": ("model",)}
#: What the button to that page says.
_CALLED = {"init": "Check the guess", "analyse": "Show the results"}


def routes(site: Site) -> list[Route]:
    """The page, its events, and the buttons."""

    def shown_of(place: Place, _: Request) -> dict[str, Any]:
        job = site.jobs.of(place)
        return {
            "job": job,
            "doing": _DOING.get(job.name, job.name) if job else "",
            "document": Markup(embedded(_document(site, place, job))) if job else "",
        }

    async def start(request: Request) -> Response:
        place, form = site.place(request), await body_of(request)
        command = str(form.get("command")) if isinstance(form, dict) else ""
        options = form.get("options", []) if isinstance(form, dict) else []
        known = command in COMMANDS and isinstance(options, list)
        if not known or not all(re.fullmatch(COMMANDS[command], str(one)) for one in options):
            raise CampaignError(f"no command {shown(command)} with these options can be started here")
        site.jobs.start(place, command, *map(str, options))
        return Response(status_code=204)

    return [
        site.page_route("/c/{key}/run", "run.html", shown_of),
        Route("/c/{key}/run", start, methods=["POST"]),
        *job_routes(site, site.jobs, "run", partial(_documents, site)),
    ]


async def _documents(site: Site, place: Place, job: Job) -> AsyncIterator[dict[str, Any]]:
    """The state of a job whenever it changes, each test once."""
    told = 0
    async for _ in job.changes():
        document = _document(site, place, job, told)
        told = len(job.tests)
        yield document
    yield _document(site, place, job, told)


def _document(site: Site, place: Place, job: Job, told: int = 0) -> dict[str, Any]:
    """What the page shows of a job, with the tests that it does not have yet."""
    tests = list(job.tests.items())[told:]
    done = job.phase is Phase.DONE
    following = address(place, *_NEXT.get(job.name, ()))
    return {
        "phase": job.phase,
        "before": site.jobs.before(job) if job.phase is Phase.WAITING else 0,
        "task": job.task,
        "tests": [{"test": name, **said, "address": address(place, "tests", name)} for name, said in tests],
        "messages": list(job.messages),
        "next": following if done else "",
        "command": job.name,
        "called": _CALLED.get(job.name, "Show the model"),
    }
