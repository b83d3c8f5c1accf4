"""Model: what was fitted and why, and the map with sliders; fitting and mapping run as jobs."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any, get_args

from markupsafe import Markup
from starlette.requests import Request
from starlette.routing import Route

from fourpole.errors import CampaignError
from fourpole.models.families import FAMILIES
from fourpole.models.operating import Purpose
from fourpole.report.cards import embedded
from fourpole.served.answers import Source, answer, sources
from fourpole.served.site import LinkedFigure, Shown, Site, figure_of
from fourpole.served.workspace import Place

#: Figures of models and maps, in the order of the page.
_FIGURES = ("storage-loss", "model-choice", "spectrum", "amplitude", "map")


def routes(site: Site) -> list[Route]:
    """The page, and the answer at a point."""
    return [
        site.page_route("/c/{key}/model", "model.html", partial(_shown, site), of_results=True),
        site.document_route("/c/{key}/model/answer", partial(_answer, site)),
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
