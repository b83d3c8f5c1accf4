"""Compare: two campaigns, or two specimens of one, as `fourpole compare` does."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import polars as pl
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Route

from fourpole import quantities as q
from fourpole.errors import FourpoleError
from fourpole.findings.compared import compare
from fourpole.report.compared import compared_parts
from fourpole.served.site import Site
from fourpole.served.workspace import Place


def routes(site: Site) -> list[Route]:
    """The page."""

    async def page(request: Request) -> Response:
        asked = dict(request.query_params)
        return await site.page("compare.html", lambda: _shown(site, asked))

    return [Route("/compare", page)]


def _shown(site: Site, asked: Mapping[str, str]) -> dict[str, Any]:
    analysed = [one for one in site.workspace.campaigns() if one.analysed]
    made: dict[str, Any] = {
        "analysed": analysed,
        "asked": {name: asked.get(name, "") for name in ("a", "b", "first", "second", "independent")},
        "specimens": ([], []),
        "compared": None,
        "fault": "",
    }
    if not asked.get("a"):
        return made
    try:
        places = [site.workspace.find(asked["a"]), site.workspace.find(asked["b"]) if asked.get("b") else None]
        made["specimens"] = _specimens(site, places)
        made["compared"] = _compared(site, places, made["asked"], made["specimens"])
    except FourpoleError as error:
        made["fault"] = str(error)
    return made


def _specimens(site: Site, places: list[Place | None]) -> tuple[list[str], list[str]]:
    """The specimens of both campaigns; of the same campaign twice the same ones."""
    first, second = places
    names = _names(site, first)
    return names, names if second is None or second == first else _names(site, second)


def _names(site: Site, place: Place | None) -> list[str]:
    shown = None if place is None else site.held.of(place)
    if shown is None:
        return []
    tables: list[pl.DataFrame] = [shown.results.static, shown.results.dynamic]
    return list(dict.fromkeys(one for table in tables if q.TYRE.head in table.columns for one in table[q.TYRE.head]))


def _compared(
    site: Site, places: list[Place | None], asked: Mapping[str, str], names: tuple[list[str], list[str]]
) -> dict[str, Any] | None:
    """What the page shows of the comparison; None while less than two things are chosen."""
    first, second = places
    assert first is not None
    second = None if second == first else second
    pair = (asked["first"], asked["second"])
    if second is None and not all(pair):
        return None
    # A specimen of another campaign may be left over in the address from a choice before.
    stated = all(one in there for one, there in zip(pair, names, strict=True))
    found = compare(
        first.folder,
        None if second is None else second.folder,
        specimens=pair if stated or second is None else None,
        independent=bool(asked["independent"]),
    )
    with site.drawing:
        return compared_parts(found)
