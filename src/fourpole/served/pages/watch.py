"""Watch: each recording is judged as a logger writes it, large, with the remedy."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import suppress
from functools import partial
from typing import Any

from markupsafe import Markup
from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Route

from fourpole.errors import FourpoleError
from fourpole.report.cards import embedded
from fourpole.served.jobs import Job
from fourpole.served.pages.run import job_routes
from fourpole.served.site import Site, address
from fourpole.served.workspace import Place


def routes(site: Site) -> list[Route]:
    """The page, its events, and the buttons."""

    def shown(place: Place, _: Request) -> dict[str, Any]:
        return {"data": Markup(embedded(_document(site, place, site.watches.of(place))))}

    async def start(request: Request) -> Response:
        site.watches.start(site.place(request), "watch")
        return Response(status_code=204)

    return [
        site.page_route("/c/{key}/watch", "watch.html", shown),
        Route("/c/{key}/watch", start, methods=["POST"]),
        *job_routes(site, site.watches, "watch", partial(_documents, site)),
    ]


async def _documents(site: Site, place: Place, job: Job) -> AsyncIterator[dict[str, Any]]:
    """The judgements whenever one is added."""
    async for _ in job.changes():
        yield await run_in_threadpool(_document, site, place, job)
    yield await run_in_threadpool(_document, site, place, job)


def _document(site: Site, place: Place, job: Job | None) -> dict[str, Any]:
    """The judgements, the last one first."""
    if job is None:
        return {"phase": "", "ready": False, "judged": [], "messages": []}
    named: set[str] = set()
    with suppress(FourpoleError):
        named = {test.name for test in site.held.campaign(place).tests}
    judged = [
        {
            "test": one["test"],
            "address": address(place, "tests", one["test"]) if one["test"] in named else "",
            "verdict": one["verdict"],
            "condition": one["condition"],
            "remarks": one["remarks"],
            "results": one["results"],
            "doubts": one["doubts"],
        }
        for one in reversed(job.judged)
    ]
    return {
        "phase": job.phase,
        "ready": "watching" in job.task,
        "judged": judged,
        "messages": [*job.together, *([f"error: {job.error}"] if job.error else [])],
    }
