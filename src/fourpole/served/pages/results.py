"""Results: the components of the report, whose tests lead to their recordings; the report as a file."""

from __future__ import annotations

import re
from typing import Any

from markupsafe import Markup
from starlette.requests import Request
from starlette.responses import FileResponse, RedirectResponse, Response
from starlette.routing import Route

from fourpole.errors import CampaignError
from fourpole.report.page import ReportFigure
from fourpole.served.held import Shown
from fourpole.served.site import Site, address
from fourpole.served.workspace import state_of

#: Files of the results that a page offers, with their kinds.
_FILES = {"report.html": "text/html", "report.pdf": "application/pdf"}
#: A link in a figure to the card of a test.
_CARD = re.compile(r'xlink:href="#([\w-]+)"')


def routes(site: Site) -> list[Route]:
    """The page, and the files of the report."""

    async def page(request: Request) -> Response:
        place = site.place(request)
        if not (place.results / "study.json").is_file():
            return RedirectResponse(address(place, "run"), 303)

        def made() -> dict[str, Any]:
            shown = site.held.of(place)
            if shown is None:
                raise CampaignError("the results were deleted a moment ago: run the analysis again")
            return {**shown.parts, **_linked(shown), "campaign": place, "state": state_of(place)}

        return await site.page("results.html", made)

    async def file(request: Request) -> Response:
        place, name = site.place(request), request.path_params["name"]
        path = place.results / name
        if name not in _FILES or not path.is_file():
            raise CampaignError("there is no such file yet: run the analysis")
        return FileResponse(path, media_type=_FILES[name], filename=f"{place.key}-{name}")

    return [Route("/c/{key}", page), Route("/c/{key}/files/{name}", file)]


class _LinkedFigure:
    """A figure of the report whose points lead to the recordings of their tests."""

    def __init__(self, figure: ReportFigure, shown: Shown) -> None:
        self.title, self.caption, self.address, self.size = figure.title, figure.caption, figure.address, figure.size
        drawing = figure.inline
        self.inline = None if drawing is None else linked(drawing, shown)


def linked(drawing: Markup, shown: Shown) -> Markup:
    """A drawing whose links to cards of tests are links to their recordings."""
    tests = {card.key: card.test for card in shown.cards.values()}

    def place_of(found: re.Match[str]) -> str:
        test = tests.get(found[1])
        return found[0] if test is None else f'xlink:href="{address(shown.place, "tests", test)}"'

    return Markup(_CARD.sub(place_of, drawing))


def _linked(shown: Shown) -> dict[str, Any]:
    return {
        "front_figures": [_LinkedFigure(one, shown) for one in shown.parts["front_figures"]],
        "figures": [(heading, _LinkedFigure(one, shown)) for heading, one in shown.parts["figures"]],
    }
