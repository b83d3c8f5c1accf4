"""Watch: each recording is judged as a logger writes it, large, with the remedy."""

from __future__ import annotations

import json
from collections.abc import AsyncIterator
from contextlib import suppress
from typing import Any

from markupsafe import Markup
from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import RedirectResponse, Response, StreamingResponse
from starlette.routing import Route

from fourpole.errors import FourpoleError
from fourpole.report.cards import embedded
from fourpole.served.jobs import Job
from fourpole.served.site import Site, address
from fourpole.served.workspace import Place, state_of


def routes(site: Site) -> list[Route]:
    """The page, its events, and the buttons."""

    async def page(request: Request) -> Response:
        place = site.place(request)
        job = site.watches.of(place)
        return await site.page(
            "watch.html",
            lambda: {
                "campaign": place,
                "state": state_of(place),
                "data": Markup(embedded(_document(site, place, job))),
            },
        )

    async def start(request: Request) -> Response:
        site.watches.start(site.place(request), "watch")
        return Response(status_code=204)

    async def stop(request: Request) -> Response:
        job = site.watches.of(site.place(request))
        if job is not None:
            job.stop()
            await job.tell()
        return Response(status_code=204)

    async def events(request: Request) -> Response:
        place = site.place(request)
        job = site.watches.of(place)
        if job is None:
            return RedirectResponse(address(place, "watch"))
        return StreamingResponse(
            _events(site, place, job), media_type="text/event-stream", headers={"Cache-Control": "no-store"}
        )

    return [
        Route("/c/{key}/watch", page),
        Route("/c/{key}/watch", start, methods=["POST"]),
        Route("/c/{key}/watch", stop, methods=["DELETE"]),
        Route("/c/{key}/watch/events", events),
    ]


async def _events(site: Site, place: Place, job: Job) -> AsyncIterator[str]:
    async for _ in job.changes():
        yield f"data: {json.dumps(await run_in_threadpool(_document, site, place, job))}\n\n"
    yield f"data: {json.dumps(await run_in_threadpool(_document, site, place, job))}\n\n"


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
        "messages": [text for text in job.messages if text.startswith("error") or "together" in text],
    }
