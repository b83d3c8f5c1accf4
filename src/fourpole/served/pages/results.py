"""Results: the components of the report, whose tests lead to their recordings; the report as a file."""

from __future__ import annotations

from typing import Any

from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import RedirectResponse, Response
from starlette.routing import Route

from fourpole.errors import CampaignError
from fourpole.io.published import published_beside
from fourpole.served.figures import LinkedFigure
from fourpole.served.held import Shown
from fourpole.served.site import Site, address
from fourpole.served.workspace import state_of

#: Files of the results that a page offers, with their kinds.
_FILES = {"report.html": "text/html", "report.pdf": "application/pdf"}


def routes(site: Site) -> list[Route]:
    """The page, and the files of the report."""

    async def page(request: Request) -> Response:
        place = site.place(request)
        if not place.analysed:
            return RedirectResponse(address(place, "run"), 303)

        def made() -> dict[str, Any]:
            shown = site.held.of(place)
            if shown is None:
                raise CampaignError("the results were deleted a moment ago: run the analysis again")
            return {**shown.parts, **_linked(shown), "campaign": place, "state": state_of(place)}

        return await site.page("results.html", made)

    async def file(request: Request) -> Response:
        place, name = site.place(request), request.path_params["name"]

        def read() -> bytes:
            if name in _FILES and (files := published_beside(place.results / name)).has(name):
                return files.read(name)
            raise CampaignError("there is no such file yet: run the analysis")

        content = await run_in_threadpool(read)
        head = {"Content-Disposition": f'attachment; filename="{place.key}-{name}"'}
        return Response(content, media_type=_FILES[name], headers=head)

    return [Route("/c/{key}", page), Route("/c/{key}/files/{name}", file)]


def _linked(shown: Shown) -> dict[str, Any]:
    return {
        "front_figures": [LinkedFigure(one, shown) for one in shown.parts["front_figures"]],
        "figures": [(heading, LinkedFigure(one, shown)) for heading, one in shown.parts["figures"]],
    }
