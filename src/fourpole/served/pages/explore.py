"""Results, figures and comparisons: components of the report, any quantity over any axis, two campaigns compared."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import partial
from typing import Any

import numpy as np
import polars as pl
from starlette.concurrency import run_in_threadpool
from starlette.datastructures import QueryParams
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Route

from fourpole import plot
from fourpole import quantities as q
from fourpole.core.condition import AXES, Axis
from fourpole.errors import CampaignError, FourpoleError
from fourpole.export.kinds import KINDS, OPTIONS, Takes
from fourpole.findings.compared import compare
from fourpole.io.published import published_beside
from fourpole.plot.over import ORDER, OVER, SHOWN, key_over
from fourpole.plot.part import Selection, select
from fourpole.plot.sheet import floats
from fourpole.plot.states import place_text
from fourpole.report.compared import compared_parts
from fourpole.served.site import LinkedFigure, Shown, Site, attachment, drawn, figure_of, spec_of, values_of
from fourpole.served.workspace import Place
from fourpole.study.study import Study
from fourpole.units import quantity

#: The commands that the section Exports starts.
_FOR_FILES = ("export", "report")
#: Files of the results that a page offers, with their kinds.
_FILES = {"report.html": "text/html", "report.pdf": "application/pdf"}
#: The axes by which tests are selected, with the kind of quantity of their values.
_SELECTED = dict(zip(("pressure", "preload", "temperature"), ("pressure", "force", "temperature"), strict=True))
_KINDS = {"svg": "image/svg+xml", "png": "image/png", "pdf": "application/pdf"}
_NAMES = {"amplitude": "deflection amplitude", ORDER: "order of the tests"}


def explore_routes(site: Site) -> list[Route]:
    """Both pages, the files of the report, and a figure as a file."""

    async def report(request: Request) -> Response:
        place, name = site.place(request), request.path_params["name"]

        def read() -> bytes:
            if name in _FILES and (files := published_beside(place.results / name)).has(name):
                return files.read(name)
            raise CampaignError("there is no such file yet: run the analysis")

        content = await run_in_threadpool(read)
        return attachment(content, _FILES[name], f"{place.key}-{name}")

    async def file(request: Request) -> Response:
        place, form = site.place(request), request.path_params["form"]
        if form not in plot.FORMATS:
            raise CampaignError(f"a figure is {', '.join(plot.FORMATS)}")
        key, content = await run_in_threadpool(_file, site, place, request.query_params, form)
        return attachment(content, _KINDS[form], f"{place.key}-{key}.{form}")

    return [
        site.page_route("/c/{key}", "results.html", partial(_shown_results, site), of_results=True),
        Route("/c/{key}/files/{name}", report),
        site.page_route("/c/{key}/explore", "explore.html", partial(_shown, site), of_results=True),
        Route("/c/{key}/figure.{form}", file),
    ]


def _shown_results(site: Site, place: Place, _: Request) -> dict[str, Any]:
    shown, job = site.results(place), site.answers.of(place)
    return {
        "exports": list(_exports(site, shown)),
        "job": job if job is not None and job.name in _FOR_FILES else None,
        "fitted": shown.results.models is not None,
        **shown.parts,
        "front_figures": [LinkedFigure(one, shown) for one in shown.parts["front_figures"]],
        "figures": [(heading, LinkedFigure(one, shown)) for heading, one in shown.parts["figures"]],
    }


def _exports(site: Site, shown: Shown) -> Iterator[dict[str, Any]]:
    """The files that the commands can make of these results: what the form states, and the options that it asks for."""
    results, asked = shown.results, {one.name: one.options for one in site.commands}
    if not {*_FOR_FILES} <= {*asked}:
        return
    has = results.files.has if results.files is not None else lambda _: False
    kept = {"png": has("figures/storage-loss.png"), "paper": any(has(f"figures/{key}.svg") for key in plot.PAPER)}
    stated = {"command": "report", "pdf": "1", **{name: "1" for name, there in kept.items() if there}}
    yield {
        "file": "report.pdf",
        "about": "the report, printed by a browser of the server",
        "stated": stated,
        "options": (),
    }
    made = {"model": results.models, "map": results.maps}
    sources = {Takes.MODEL: ["model"], Takes.MAP: ["map"], Takes.EITHER: ["model", "map"]}
    for name, kind in KINDS.items():
        flags = {flag for one in kind.options for flag in OPTIONS[one][1]}
        options = [one for one in asked["export"] if one.name in flags]
        for source in sources.get(kind.takes, [""]):
            if source and made[source] is None:
                continue
            about = kind.about.replace("of a model or a map", f"of the {source}") if source else kind.about
            stated = {"command": "export", "to": name, "of": source}
            yield {"file": kind.file, "about": about, "stated": stated, "options": options}


def _file(site: Site, place: Place, asked: QueryParams, form: str) -> tuple[str, bytes]:
    results = site.results(place).results
    key = _key(asked)
    content = drawn(site, _part(results, asked), key, form)
    if content is None:
        raise CampaignError(f"the results hold nothing that this figure shows: {spec_of(key).title}")
    return key, content


def _shown(site: Site, place: Place, request: Request) -> dict[str, Any]:
    asked = request.query_params
    shown = site.results(place)
    results = shown.results
    made: dict[str, Any] = {
        "figure": None,
        "values": [],
        "fault": "",
        "query": str(asked),
        "asked": _choices(asked),
        "quantities": _known(results),
        "axes": {name: _NAMES.get(name, name) for name in OVER if name == ORDER or _is_stated(results, OVER[name])},
        "questions": {key: plot.FIGURES[key].title for key in plot.figures_of(results) if not key.startswith("first-")},
        "paper": {key: spec.title for key, spec in plot.PAPER.items()},
        "selects": _selects(results),
    }
    try:
        key, part = _key(asked), _part(results, asked)
        made["figure"] = figure_of(site, shown, part, key)
        made["values"] = values_of(part, key)
        if made["figure"] is None:
            made["fault"] = f"The results hold nothing that this figure shows: {spec_of(key).title}."
    except FourpoleError as error:
        made["fault"] = str(error)
    return made


def _choices(asked: QueryParams) -> dict[str, str]:
    """What the form shows as chosen."""
    chosen = {name: asked.get(name, "") for name in ("figure", "quantity", "over", "specimen", *_SELECTED)}
    return {**chosen, "quantity": chosen["quantity"] or q.STORAGE.key, "over": chosen["over"] or "frequency"}


def _key(asked: QueryParams) -> str:
    """Key of the figure that is asked for."""
    chosen = _choices(asked)
    return spec_of(chosen["figure"]).key if chosen["figure"] else key_over(chosen["quantity"], chosen["over"])


def _part(results: Study, asked: QueryParams) -> Study:
    """The tests that are asked for."""
    values = {
        name: tuple(quantity(one, kind) for one in asked.getlist(name) if one) for name, kind in _SELECTED.items()
    }
    selection = Selection(
        specimens=tuple(one for one in asked.getlist("specimen") if one),
        pressures=values["pressure"],
        preloads=values["preload"],
        temperatures=values["temperature"],
    )
    return results if selection == Selection() else select(results, selection)


def _known(results: Study) -> dict[str, str]:
    """The quantities that some test has, by key: name and symbol."""
    derived = {q.MODULUS: q.STORAGE, q.LOSS_ANGLE: q.STORAGE}
    tables = (results.dynamic, results.static)
    known = {
        key: one
        for key, one in SHOWN.items()
        if any(np.isfinite(floats(table, derived.get(one, one).head)).any() for table in tables)
    }
    return {key: one.column if one.column == one.name else f"{one.name}, {one.column}" for key, one in known.items()}


def _is_stated(results: Study, axis: Axis | None) -> bool:
    tables = (results.dynamic, results.static)
    return axis is not None and any(np.isfinite(floats(table, axis.column)).any() for table in tables)


def _selects(results: Study) -> Mapping[str, list[str]]:
    """The values of specimen, pressure, preload and temperature that tests have, where they are several."""
    tables = (results.dynamic, results.static)
    found = {"specimen": list(dict.fromkeys(n for t in tables if "tyre" in t.columns for n in t["tyre"] if n))}
    for axis in AXES:
        values = np.concatenate([floats(table, axis.column) for table in tables])
        _, middles = axis.middles(values[np.isfinite(values)])
        found[axis.name] = list(dict.fromkeys(place_text(results, axis.column, one) for one in middles))
    return {name: values for name, values in found.items() if len(values) > 1}


def compare_routes(site: Site) -> list[Route]:
    """The page."""

    async def page(request: Request) -> Response:
        asked = dict(request.query_params)
        return await site.page("compare.html", lambda: _shown_compared(site, asked))

    return [Route("/compare", page)]


def _shown_compared(site: Site, asked: Mapping[str, str]) -> dict[str, Any]:
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
