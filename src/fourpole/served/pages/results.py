"""Results: the components of the report, whose tests lead to their recordings; the report as a file."""

from __future__ import annotations

from functools import partial
from typing import Any

from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Route

from fourpole.errors import CampaignError
from fourpole.io.published import published_beside
from fourpole.served.figures import LinkedFigure
from fourpole.served.site import Site, attachment
from fourpole.served.workspace import Place

#: Files of the results that a page offers, with their kinds.
_FILES = {"report.html": "text/html", "report.pdf": "application/pdf"}


def routes(site: Site) -> list[Route]:
    """The page, and the files of the report."""

    async def file(request: Request) -> Response:
        place, name = site.place(request), request.path_params["name"]

        def read() -> bytes:
            if name in _FILES and (files := published_beside(place.results / name)).has(name):
                return files.read(name)
            raise CampaignError("there is no such file yet: run the analysis")

        content = await run_in_threadpool(read)
        return attachment(content, _FILES[name], f"{place.key}-{name}")

    return [
        site.page_route("/c/{key}", "results.html", partial(_shown, site), of_results=True),
        Route("/c/{key}/files/{name}", file),
    ]


def _shown(site: Site, place: Place, _: Request) -> dict[str, Any]:
    shown = site.results(place)
    return {
        **shown.parts,
        "front_figures": [LinkedFigure(one, shown) for one in shown.parts["front_figures"]],
        "figures": [(heading, LinkedFigure(one, shown)) for heading, one in shown.parts["figures"]],
    }
