"""Statement: channels, rig and tests as a form; a wrong entry is marked at its place, in the words of the commands."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from markupsafe import Markup
from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import JSONResponse, RedirectResponse, Response
from starlette.routing import Route

from fourpole.campaign.place import inside
from fourpole.errors import CampaignError, FourpoleError
from fourpole.io.child import read_apart
from fourpole.io.look import ChannelSummary, look_at
from fourpole.io.recordings import survey
from fourpole.io.signals import FileInfo, SignalInfo
from fourpole.report.cards import embedded
from fourpole.served.editing import KEYS, RIG, ROLES, doubts_left, problems_of, read_statement, save
from fourpole.served.signals import plotted
from fourpole.served.site import Site, address, body_of
from fourpole.served.workspace import Place, state_of

#: Largest number of columns that are shown of a recording.
_MOST_COLUMNS = 24


def routes(site: Site) -> list[Route]:
    """The form, what is wrong with it, what it saves, and the columns of a recording."""

    async def page(request: Request) -> Response:
        place = site.place(request)
        if not state_of(place).stated and not (place.folder / "tests.csv").is_file():
            return RedirectResponse(address(place, "run"), 303)  # recordings that are yet to be looked at
        return await site.page("statement.html", lambda: _shown(place), place)

    async def keep(request: Request) -> Response:
        place, form = site.place(request), await body_of(request)
        if not isinstance(form, dict):
            raise CampaignError("the form is not whole: load the page again")

        def kept() -> dict[str, Any]:
            typing = request.method == "POST"
            version = "" if typing else save(place.folder, str(form.get("version", "")), form)
            problems = problems_of(place.folder, form if typing else None)
            doubts = doubts_left(form.get("heads", ()), form.get("rows", ()))
            return {"version": version, "problems": [asdict(one) for one in problems], "doubts": doubts}

        return JSONResponse(await run_in_threadpool(kept))

    return [
        Route("/c/{key}/statement", page),
        Route("/c/{key}/statement", keep, methods=["PUT", "POST"]),
        site.document_route("/c/{key}/columns", _columns),
    ]


def _shown(place: Place) -> dict[str, Any]:
    stated = read_statement(place.folder)
    return {
        "stated": stated,
        "roles": ROLES,
        "keys": KEYS,
        "rig": RIG,
        "data": Markup(
            embedded(
                {
                    "version": stated.version,
                    "heads": stated.heads,
                    "rows": stated.rows,
                    "problems": [asdict(one) for one in problems_of(place.folder)],
                }
            )
        ),
    }


def _columns(place: Place, _: Request) -> dict[str, Any]:
    """The columns of recordings, each with an outline: of the first static test, and of the first other one."""
    stated = read_statement(place.folder)
    if not {"file", "kind"} <= {*stated.heads}:
        raise CampaignError("tests.csv has no columns file and kind")
    kind, file = stated.heads.index("kind"), stated.heads.index("file")
    files: list[str] = []
    for static in (False, True):
        files += [row[file] for row in stated.rows if row[file] and (row[kind].lower() == "static") == static][:1]
    found: list[dict[str, Any]] = []
    faults = []
    for name in dict.fromkeys(files):
        try:
            found.append(_outlines(place, name))
        except FourpoleError as error:
            faults.append(str(error))
    if faults or not found:
        raise CampaignError("; ".join(faults) or "no recording is named in tests.csv")
    return {"files": [one["file"] for one in found], "columns": [column for one in found for column in one["columns"]]}


def _outlines(place: Place, file: str) -> dict[str, Any]:
    path = inside(place.folder, file)
    found = read_apart(survey, path, classes=(FileInfo, SignalInfo))
    group = file.rpartition("#")[2] if "#" in file else ""
    chosen = [at for at, one in enumerate(found.signals) if group in ("", one.group)][:_MOST_COLUMNS]
    seen = read_apart(look_at, path, found, chosen, classes=(ChannelSummary,), progress=lambda *_: None)
    return {
        "file": file,
        "columns": [
            {"name": found.signals[at].name, "unit": found.signals[at].unit or "", **_outline(seen[at])}
            for at in chosen
        ],
    }


def _outline(one: ChannelSummary | str) -> dict[str, Any]:
    if isinstance(one, str):
        return {"why": one}
    return {
        "least": one.least,
        "greatest": one.greatest,
        "frequency": one.frequency,
        "low": plotted(one.outline[:, 0]),
        "high": plotted(one.outline[:, 1]),
    }
