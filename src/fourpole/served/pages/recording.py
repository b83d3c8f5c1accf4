"""Recording: one test with its whole signals to zoom into, the fit, the checks, and what was made of it."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial
from typing import Any

import polars as pl
from markupsafe import Markup
from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route

from fourpole import quantities as q
from fourpole.campaign import Test
from fourpole.campaign.place import at_hand, group_of
from fourpole.core.checks import Code, Verdict
from fourpole.core.digits import number
from fourpole.core.phasor import CHANNELS, SYMBOLS
from fourpole.core.recording import UNITS
from fourpole.errors import CampaignError, FourpoleError
from fourpole.io.remote import is_elsewhere
from fourpole.report.cards import embedded
from fourpole.served.editing import EXCLUDED, exclude, read_statement
from fourpole.served.signals import Kept, Wanted, part_of
from fourpole.served.site import Shown, Site, body_of
from fourpole.served.workspace import Place, state_of
from fourpole.study.recording import read_recording, residual_spectrum
from fourpole.words import template

#: Least and largest number of steps of a picture.
_WIDTHS = (100, 4000)
#: Longest reason why a test is left out.
_LONGEST = 300


def routes(site: Site) -> list[Route]:
    """The list of tests, a test, and parts of its signals."""

    async def leave_out(request: Request) -> Response:
        place, form = site.place(request), await body_of(request)
        reason = form.get("reason") if isinstance(form, dict) else None
        if not isinstance(reason, str) or len(reason) > _LONGEST:
            raise CampaignError(f"the reason must be a text of at most {_LONGEST} characters")
        await run_in_threadpool(exclude, place.folder, request.path_params["test"], reason)
        return JSONResponse({})

    return [
        site.page_route("/c/{key}/tests", "tests.html", partial(_every, site)),
        # The name of a test may have a slash.
        site.document_route("/c/{key}/tests/{test:path}/residual", partial(_residual, site)),
        Route("/c/{key}/tests/{test:path}/excluded", leave_out, methods=["PUT"]),
        site.document_route("/c/{key}/tests/{test:path}/signals", partial(_part, site)),
        site.page_route("/c/{key}/tests/{test:path}", "recording.html", partial(_shown, site)),
    ]


def _every(site: Site, place: Place, _: Request) -> dict[str, Any]:
    """The tests in the order of tests.csv, each with its cards; those of the results where the statement is broken."""
    state, shown = state_of(place), site.held.of(place)
    cards: dict[str, list[Any]] = {}
    for card in [] if shown is None else shown.parts["cards"]:
        cards.setdefault(card.test, []).append(card)
    names, fault = {name: some[0].tyre for name, some in cards.items()}, ""
    try:
        stated = site.held.campaign(place).tests
        names = {test.name: test.tyre for test in stated}
        site.collector.expect(test.file for test in stated)
    except FourpoleError as error:
        fault = "" if state.fault else str(error)  # that of campaign.toml stands on every page
    tests = [(name, tyre, cards.get(name, [])) for name, tyre in names.items()]
    return {"fault": fault, "tests": tests, "analysed": shown is not None}


def _shown(site: Site, place: Place, request: Request) -> dict[str, Any]:
    name = request.path_params["test"]
    campaign = site.held.campaign(place)
    names = [test.name for test in campaign.tests]
    if name not in names:
        raise CampaignError("there is no such test in tests.csv: it was renamed or removed")
    at, shown = names.index(name), site.held.of(place)
    site.collector.expect([campaign.tests[at].file])
    card = None if shown is None else shown.cards.get(name)
    return {
        "test": campaign.tests[at],
        "at": at + 1,
        "count": len(names),
        "before": names[at - 1] if at else None,
        "after": names[at + 1] if at + 1 < len(names) else None,
        "reason": _reason(place, name),
        "card": card,
        "fundamental": _fundamental(shown, campaign.tests[at]),
        "data": Markup(embedded(card.body)) if card is not None else "",
        "checks": [] if shown is None else _checks(shown, name),
    }


def _reason(place: Place, name: str) -> str:
    """Why a test is left out; empty if it is not."""
    stated = read_statement(place.folder)
    if not {"test", EXCLUDED} <= {*stated.heads}:
        return ""
    test, column = stated.heads.index("test"), stated.heads.index(EXCLUDED)
    return next((row[column] for row in stated.rows if row[test] == name), "")


def _checks(shown: Shown, name: str) -> list[dict[str, Any]]:
    """The rows of checks.csv of a test, the worst first."""
    table = shown.results.checks
    if table.is_empty():
        return []
    rows = [row for row in table.rows(named=True) if row[q.TEST.head] == name]
    return [_check(row) for row in sorted(rows, key=lambda row: -Verdict.read(row[q.VERDICT.head]).rank)]


def _check(row: dict[str, Any]) -> dict[str, Any]:
    """A row of checks.csv with its numbers as text, the side of the limit, and what the check compares."""
    code = Code.read(row["code"])
    found, limit = (
        "" if row[name] is None or row[name] != row[name] else number(row[name], 3) for name in ("statistic", "limit")
    )
    side = "≥" if code is not None and code.limit_is_least else "≤"
    return {
        **row,
        "about": "" if code is None else template(code, "about"),
        "statistic": found,
        "limit": f"{side} {limit}" if limit else "",
    }


def _part(site: Site, place: Place, request: Request) -> dict[str, Any]:
    """A part of all channels of a test; the whole without ends [s]; or how much of a long recording is read."""
    asked = request.query_params
    try:
        first, last = (float(asked[end]) if end in asked else None for end in ("from", "to"))
        width = min(max(int(asked.get("width", 800)), _WIDTHS[0]), _WIDTHS[1])
        if not all(end is None or math.isfinite(end) for end in (first, last)):
            raise ValueError
    except ValueError:
        raise CampaignError("the part of the recording is not stated in numbers") from None
    kept = _kept(site, place, request.path_params["test"])
    if isinstance(kept, float):
        return {"read": kept}
    starts = [one["start"] for one in kept.channels]
    ends = [one["start"] + (one["count"] - 1) / one["rate"] for one in kept.channels]
    low = min(starts) if first is None else first
    high = max(ends) if last is None else last
    if not high > low:
        raise CampaignError("the part of the recording is empty")
    return {
        "from": low,
        "to": high,
        "whole": [min(starts), max(ends)],
        "timed": all(one["even"] for one in kept.channels),
        "channels": [
            {"name": one["name"], "unit": one["unit"], **part_of(kept, number, low, high, width)}
            for number, one in enumerate(kept.channels)
        ],
    }


def _kept(site: Site, place: Place, name: str) -> Kept | float:
    """The samples of a test, collected once for each state of its file."""
    campaign = site.held.campaign(place)
    test = next((one for one in campaign.tests if one.name == name), None)
    if test is None or not test.file:
        raise CampaignError("this test names no recording")
    if is_elsewhere(test.file):
        raise CampaignError("this recording lies elsewhere: its samples are not shown, only what was made of it")
    roles = ("load", "deflection") if test.kind == "static" else CHANNELS
    stated = [one for role in roles if (one := campaign.stated.channels.named(role)) is not None]
    units = {one.column: one.unit for one in stated if one.unit}
    columns = tuple(one.column for one in stated)
    with at_hand(place.folder, test.file) as path:
        kept = site.collector.get(Wanted(path, group_of(path, test.file), columns))
    if isinstance(kept, float):
        return kept
    return replace(kept, channels=[{**one, "unit": one["unit"] or units.get(one["name"], "")} for one in kept.channels])


def _fundamental(shown: Shown | None, test: Test) -> float | None:
    """The frequency that was found in a test of a single sine [Hz]; None for any other, or one that was not reduced."""
    if shown is None or test.band is not None:
        return None
    rows = shown.results.dynamic.filter(pl.col(q.TEST.head) == test.name)
    return None if rows.is_empty() else rows[q.FREQUENCY.head][0]


def _residual(site: Site, place: Place, request: Request) -> dict[str, Any]:
    """The spectra of what a dynamic test holds beside its fundamental."""
    campaign = site.held.campaign(place)
    test = next((test for test in campaign.tests if test.name == request.path_params["test"]), None)
    fundamental = None if test is None else _fundamental(site.held.of(place), test)
    if test is None or fundamental is None:
        raise CampaignError("this test has no fundamental")
    recording = read_recording(test.file, campaign)
    found = {role: residual_spectrum(recording, fundamental, role) for role in recording.channels}
    return {
        "fundamental": fundamental,
        "channels": [
            {
                "name": SYMBOLS.get(role, role),
                "unit": UNITS.get(recording.channels[role].quantity, ""),
                "frequency": one.frequency.tolist(),
                "amplitude": one.amplitude.tolist(),
            }
            for role, one in found.items()
        ],
    }
