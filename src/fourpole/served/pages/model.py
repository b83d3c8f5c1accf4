"""Model: what was fitted and why, the map with sliders, and all exports; fitting and mapping run as jobs."""

from __future__ import annotations

import json
import shutil
import tempfile
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any, get_args
from urllib.parse import quote

from markupsafe import Markup
from starlette.background import BackgroundTask
from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import FileResponse, Response
from starlette.routing import Route

from fourpole.errors import CampaignError, FourpoleError, UnitError
from fourpole.export.kinds import KINDS, ExportKind, Takes, export_results
from fourpole.fitting.placed import operating_point
from fourpole.models.families import FAMILIES
from fourpole.models.operating import Purpose
from fourpole.models.shape import shape_of
from fourpole.report.cards import embedded
from fourpole.report.html import print_page
from fourpole.served.answers import Source, answer, sources
from fourpole.served.figures import LinkedFigure, figure_of
from fourpole.served.held import Shown
from fourpole.served.site import Site
from fourpole.served.workspace import Place
from fourpole.units import quantity
from fourpole.units import shown as shown_text

#: Figures of models and maps, in the order of the page.
_FIGURES = ("storage-loss", "model-choice", "spectrum", "amplitude", "map")
#: What the address may state of a shape.
_SHAPE = ("mode", "height", "area", "poisson", "bonded", "bulk")
_PDF = "pdf"


def routes(site: Site) -> list[Route]:
    """The page, the answer at a point, and files for other programs."""

    async def export(request: Request) -> Response:
        place, kind = site.place(request), request.path_params["kind"]
        folder = Path(tempfile.mkdtemp(prefix="fourpole-export-"))
        cleaning = BackgroundTask(shutil.rmtree, folder, ignore_errors=True)
        try:
            path, notes = await run_in_threadpool(_exported, site, place, kind, dict(request.query_params), folder)
        except BaseException:
            await cleaning()
            raise
        headers = {"X-Notes": quote(json.dumps(notes))}
        return FileResponse(path, filename=f"{place.key}-{path.name}", headers=headers, background=cleaning)

    return [
        site.page_route("/c/{key}/model", "model.html", partial(_shown, site), of_results=True),
        site.document_route("/c/{key}/model/answer", partial(_answer, site)),
        Route("/c/{key}/export/{kind}", export),
    ]


def _shown(site: Site, place: Place, request: Request) -> dict[str, Any]:
    asked = request.query_params
    shown = site.results(place)
    results = shown.results
    known = sources(results)
    source = known.get(asked.get("tyre", "")) or next(iter(known.values()), None)
    found = None if source is None else _answered(shown, source, asked)
    return {
        **shown.parts,
        "opened": "models",
        "specimens": list(known),
        "source": source,
        "asked": {} if source is None else _asked(source, asked),
        "condition": "" if source is None else _condition(source, asked),
        "beyond": "beyond" in asked,
        "purposes": get_args(Purpose),
        "purpose": _purpose(asked),
        "answer": found,
        "data": Markup(embedded(found["curves"] if found else None)),
        "pictures": _figures(site, shown),
        "fitted": results.models is not None,
        "mapped": results.maps is not None,
        "families": [one.removesuffix("[:N]") for one in FAMILIES],
        "exports": _exports(shown),
    }


def _figures(site: Site, shown: Shown) -> list[LinkedFigure]:
    """The figures of models and maps: those of the report, or drawn where it has none."""
    results = shown.results
    if results.models is None and results.maps is None:
        return []
    figures = {figure.key: figure for _, figure in shown.parts["figures"]}
    made = []
    for key in _FIGURES:
        if key in figures:
            made.append(LinkedFigure(figures[key], shown))
        elif (one := figure_of(site, shown, results, key)) is not None:
            made.append(one)
    return made


def _asked(source: Source, asked: Mapping[str, str]) -> dict[str, str]:
    """The numbers that the form shows, in the units of the fields."""
    found = {}
    for one in source.fields:
        number = asked.get(one.name, "").removesuffix(one.unit).strip()
        found[one.name] = number or f"{one.value:.10g}"
    return found


def _condition(source: Source, asked: Mapping[str, str]) -> str:
    """The condition that the address states, in words."""
    known = source.conditions.items()
    return next((text for text, one in known if all(asked.get(name) == value for name, value in one.items())), "")


def _answered(shown: Shown, source: Source, asked: Mapping[str, str]) -> dict[str, Any]:
    units = {one.name: one.unit for one in source.fields}
    # A form without script sends bare numbers, which are in the unit beside the field.
    stated = {
        name: f"{text} {units[name]}" if _is_bare(text) and name in units else text for name, text in asked.items()
    }
    return answer(shown.results, source, stated, beyond="beyond" in asked, purpose=_purpose(asked))


def _purpose(asked: Mapping[str, str]) -> Purpose | None:
    """What the intervals are for; None for the usual one."""
    return next((one for one in get_args(Purpose) if one == asked.get("for")), None)


def _is_bare(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _answer(site: Site, place: Place, request: Request) -> dict[str, Any]:
    asked = request.query_params
    shown = site.results(place)
    known = sources(shown.results)
    if asked.get("tyre", "") not in known:
        raise CampaignError("there is no model of this specimen: it was fitted again a moment ago; load the page again")
    return _answered(shown, known[asked["tyre"]], asked)


def _exports(shown: Shown) -> list[dict[str, Any]]:
    """The kinds of file that these results have what they need for."""
    has = {
        Takes.RESULTS: True,
        Takes.MODEL: shown.results.models is not None,
        Takes.MAP: shown.results.maps is not None,
        Takes.EITHER: shown.results.models is not None or shown.results.maps is not None,
    }
    return [
        {"kind": name, "about": kind.about, "file": kind.file, "form": _form(kind)}
        for name, kind in KINDS.items()
        if has.get(kind.takes)
    ]


def _form(kind: ExportKind) -> str:
    """Name of the form of the page that has what a kind of export needs."""
    return "shape" if "shape" in kind.options else "vehicle" if "specimen" in kind.options else ""


def _stated(kind: ExportKind, asked: Mapping[str, str]) -> dict[str, Any]:
    """What the forms state for a kind of export."""
    found: dict[str, Any] = {}
    if "shape" in kind.options:
        found["shape"] = shape_of({name: asked[name] for name in _SHAPE if asked.get(name)})
    if "specimen" in kind.options and asked.get("specimen"):
        found["specimen"] = asked["specimen"]
    if "points" in kind.options and asked.get("at"):
        found["points"] = (operating_point(asked["at"]),)
    for name, what in (("frequency", "frequency"), ("radius", "displacement")):
        if name in kind.options and asked.get(name):
            found[name] = quantity(asked[name], what)
            if found[name] <= 0:
                raise UnitError(f"{name}: {shown_text(asked[name])} must be positive")
    return found


def _exported(site: Site, place: Place, kind: str, asked: Mapping[str, str], folder: Path) -> tuple[Path, list[str]]:
    """A file for another program in a temporary folder, and what it leaves out."""
    if not place.analysed:
        raise CampaignError("nothing is analysed yet: run the analysis first")
    if kind == _PDF:
        return _printed(site, place, folder), []
    if kind not in KINDS:
        raise CampaignError("there is no such kind of file: load the page again")
    chosen = KINDS[kind]
    source = place.results
    if chosen.takes is Takes.EITHER and asked.get("of") == "map" and (source / "map.json").is_file():
        source /= "map.json"
    made = export_results(source, kind, folder / chosen.file, **_stated(chosen, asked))
    if not made.path.is_dir():
        return made.path, list(made.notes)
    return Path(shutil.make_archive(str(folder / made.path.name), "zip", made.path)), list(made.notes)


def _printed(site: Site, place: Place, folder: Path) -> Path:
    """The report as PDF: that of the results if it is not older than the page, else printed now."""
    page, path = place.results / "report.html", place.results / "report.pdf"
    try:
        if path.is_file() and path.stat().st_mtime_ns >= page.stat().st_mtime_ns:
            return Path(shutil.copy(path, folder / path.name))
    except OSError:
        pass
    if not page.is_file():
        raise CampaignError("these results have no report: fourpole report makes one")
    try:
        with site.printing:
            print_page(page, folder / path.name)
    except FourpoleError as error:
        raise CampaignError(str(error).replace(", which --pdf needs", "")) from None
    return folder / path.name
