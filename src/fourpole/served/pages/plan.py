"""Plan: the uncertainty to expect before testing, what to test next and what it gains, and the run sheet."""

from __future__ import annotations

import threading
from collections.abc import Mapping
from typing import Any

from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Route

from fourpole.campaign import read_campaign
from fourpole.core.plan import MASSES, advise
from fourpole.errors import CampaignError, FourpoleError
from fourpole.planning.expected import Guess
from fourpole.planning.plan import CampaignPlan, Run, plan_campaign, plan_table
from fourpole.planning.runsheet import run_sheet
from fourpole.report.page import ReportFigure
from fourpole.report.words.plan import advice_in_words, expected_tables
from fourpole.served.site import Latest, Site, attachment
from fourpole.served.workspace import Place, state_of, version_of
from fourpole.units import quantity
from fourpole.words import package_toml

#: Fields of the form: what is asked, kind of quantity, whether zero is a value, and an example.
FIELDS: dict[str, tuple[str, str, bool, str]] = package_toml("fourpole.served")["plan"]
#: Largest number of repeats of a run sheet, and of added masses.
_MOST_REPEATS, _MOST_MASSES = 100, 8
#: Number of plans that are held.
_MOST_HELD = 8


def routes(site: Site) -> list[Route]:
    """The page, what it computes, and the run sheet."""
    held: Latest[dict[str, Any]] = Latest(_MOST_HELD)
    making = threading.Lock()  # one plan is made at a time

    async def expected(request: Request) -> Response:
        place, asked = site.place(request), dict(request.query_params)

        def made() -> dict[str, Any]:
            mark = version_of(place.folder), state_of(place).analysed
            try:
                with making:
                    return held.get((place.key, *sorted(asked.items())), mark, lambda: _expected(site, place, asked))
            except FourpoleError as error:
                return {"campaign": place, "fault": str(error)}

        return await site.page("expected.html", made)

    async def sheet(request: Request) -> Response:
        place, asked = site.place(request), dict(request.query_params)
        content = await run_in_threadpool(_sheet, place, asked)
        return attachment(content, "text/csv", f"{place.key}-tests.csv")

    return [
        site.page_route("/c/{key}/plan", "plan.html", _shown),
        Route("/c/{key}/plan/expected", expected),
        Route("/c/{key}/plan/run-sheet.csv", sheet),
    ]


def _shown(_: Place, request: Request) -> dict[str, Any]:
    asked = request.query_params
    return {
        "fields": FIELDS,
        "asked": {name: asked.get(name, "") for name in (*FIELDS, "added_mass")},
        "query": str(asked),
        "masses": "; ".join(f"{mass:g} kg" for mass in MASSES),
    }


def _expected(site: Site, place: Place, asked: Mapping[str, str]) -> dict[str, Any]:
    from fourpole.plot.layout import TITLES, command_figure  # loads the library that draws, which takes a second
    from fourpole.plot.plan import draw_plan

    planned, masses = _planned(place, asked), _masses(asked)
    frame = plan_table(planned, masses or MASSES)
    wanted = _stated(asked).get("wanted")
    advice = [] if wanted is None else [advise(item.plan, wanted, masses=masses or MASSES) for item in planned.rigs]
    with site.drawing:
        svg = command_figure(draw_plan(frame, wanted=wanted), "plan").decode()
    return {
        "campaign": place,
        "fault": "",
        "notes": planned.notes,
        "advice": advice_in_words(planned, advice),
        "expected": expected_tables(frame),
        "figure": ReportFigure("plan", TITLES["plan"], "", svg),
    }


def _planned(place: Place, asked: Mapping[str, str]) -> CampaignPlan:
    stated = _stated(asked)
    run = {name: stated[name] for name in ("noise", "cycles", "eccentricity") if name in stated}
    guess = Guess(*(stated.get(name) for name in ("k1", "k2", "c", "std_k1")))
    return plan_campaign(read_campaign(place.folder), guess, Run(**run))


def _stated(asked: Mapping[str, str]) -> dict[str, float]:
    """The values that the address states, in SI."""
    found = {}
    for name, (label, kind, zero, _) in FIELDS.items():
        text = asked.get(name, "").strip()
        if not text:
            continue
        try:
            value = quantity(text, kind) if kind else _whole(label, text, 10**9)
        except FourpoleError as error:
            raise CampaignError(f"{label}: {str(error).removeprefix(f'{label}: ')}") from None
        if value < 0 or (value == 0 and not zero):
            raise CampaignError(f"{label}: {text} must be positive")
        found[name] = value
    return found


def _masses(asked: Mapping[str, str]) -> tuple[float, ...]:
    """The added masses that the address states [kg]."""
    found = [quantity(one, "mass") for one in asked.get("added_mass", "").split(";") if one.strip()]
    if len(found) > _MOST_MASSES or any(one <= 0 for one in found):
        raise CampaignError(f"added masses: at most {_MOST_MASSES} positive ones, as 5 kg; 10 kg")
    return tuple(dict.fromkeys(found))


def _sheet(place: Place, asked: Mapping[str, str]) -> bytes:
    """The run sheet as CSV."""
    repeats = _whole("repeats", asked.get("repeats", "") or "1", _MOST_REPEATS)
    seed = _whole("seed", asked.get("seed", "") or "1982", 2**32 - 1)
    table = run_sheet(_planned(place, asked), masses=_masses(asked), repeats=repeats, seed=seed)
    return table.write_csv().encode()


def _whole(name: str, text: str, most: int) -> int:
    try:
        value = int(text)
    except ValueError:
        value = 0
    if not 1 <= value <= most:
        raise CampaignError(f"{name}: state a whole number from 1 to {most}")
    return value
