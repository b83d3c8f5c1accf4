"""A job on its page: its events while it is at work, and the button that stops it."""

from __future__ import annotations

import json
from collections.abc import AsyncIterator, Callable
from typing import Any, TypeAlias

from starlette.requests import Request
from starlette.responses import RedirectResponse, Response, StreamingResponse
from starlette.routing import Route

from fourpole.served.jobs import Job, Jobs
from fourpole.served.site import Site, address
from fourpole.served.workspace import Place

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
