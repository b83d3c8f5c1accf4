"""Ask: any command that answers on a campaign, with its options, and its answer as the terminal has it."""

from __future__ import annotations

from collections.abc import AsyncIterator
from typing import Any

from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Route

from fourpole.served.asked import asked_named
from fourpole.served.jobs import Job
from fourpole.served.pages.run import job_routes
from fourpole.served.site import Site, body_of
from fourpole.served.workspace import Place


def routes(site: Site) -> list[Route]:
    """The page, its start, and its events."""

    def shown(place: Place, request: Request) -> dict[str, Any]:
        name = request.query_params.get("command", "")
        job = site.answers.of(place)
        return {
            "commands": site.commands,
            "asked": asked_named(site.commands, name) if name else None,
            "stated": dict(request.query_params),
            "job": job if job is not None and job.name == name else None,
        }

    async def start(request: Request) -> Response:
        place, form = site.place(request), await body_of(request)
        stated = {str(name): str(value) for name, value in form.items()} if isinstance(form, dict) else {}
        asked = asked_named(site.commands, stated.get("command", ""))
        site.answers.start(place, asked.name, *asked.words(stated))
        return Response(status_code=204)

    return [
        site.page_route("/c/{key}/ask", "ask.html", shown, of_results=True),
        Route("/c/{key}/ask", start, methods=["POST"]),
        *job_routes(site, site.answers, "ask", _documents),
    ]


async def _documents(_: Place, job: Job) -> AsyncIterator[dict[str, Any]]:
    """How far the command is, whenever it changes."""
    async for _change in job.changes():
        yield {"phase": job.phase, "task": job.task}
    yield {"phase": job.phase, "task": job.task}
