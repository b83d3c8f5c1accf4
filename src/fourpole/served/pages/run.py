"""Run, Ask and Watch: commands on a campaign, with their events while they are at work, and the ways to stop them."""

from __future__ import annotations

import io
import json
import re
import zipfile
from collections.abc import AsyncIterator, Callable
from contextlib import suppress
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, TypeAlias

from markupsafe import Markup
from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import RedirectResponse, Response, StreamingResponse
from starlette.routing import Route

from fourpole.errors import CampaignError, FourpoleError
from fourpole.export.kinds import KINDS
from fourpole.io.door import read_bytes
from fourpole.io.signals import MAX_FILE_BYTES
from fourpole.report.cards import embedded
from fourpole.served.jobs import Job, Jobs, Phase, asked_named
from fourpole.served.site import Site, address, attachment, body_of
from fourpole.served.workspace import Place
from fourpole.units import shown
from fourpole.words import package_toml

#: What a page shows of a job, whenever it changes, without the tests that it has already, by their number.
Document: TypeAlias = Callable[[Place, Job, int], dict[str, Any]]


def job_routes(site: Site, jobs: Jobs, page: str, document: Document) -> list[Route]:
    """The events of the job of a page, and the way to stop it."""

    async def stop(request: Request) -> Response:
        job = jobs.of(site.place(request))
        if job is not None:
            job.stop()
            await job.tell()
        return Response(status_code=204)

    async def events(request: Request) -> Response:
        place = site.place(request)
        job = jobs.of(place)
        if job is None:
            return RedirectResponse(address(place, page))
        return StreamingResponse(
            _as_events(place, job, document), media_type="text/event-stream", headers={"Cache-Control": "no-store"}
        )

    return [Route(f"/c/{{key}}/{page}", stop, methods=["DELETE"]), Route(f"/c/{{key}}/{page}/events", events)]


async def _as_events(place: Place, job: Job, document: Document) -> AsyncIterator[str]:
    told = 0
    async for _ in job.changes():
        shown = await run_in_threadpool(document, place, job, told)
        told += len(shown.get("tests", ()))
        yield f"data: {json.dumps(shown)}\n\n"


#: The commands that the page Run may start: pattern of their options, what each is called while it runs, the page that
#: shows what it made, and what the button to that page says.
COMMANDS: dict[str, tuple[str, str, list[str], str]] = package_toml("fourpole.served")["run"]


def run_routes(site: Site) -> list[Route]:
    """The page, its events, and the buttons."""

    def shown_of(place: Place, _: Request) -> dict[str, Any]:
        job = site.jobs.of(place)
        return {
            "job": job,
            "doing": COMMANDS[job.name][1] if job else "",
            "document": Markup(embedded(_document(site, place, job))) if job else "",
        }

    async def start(request: Request) -> Response:
        place, form = site.place(request), await body_of(request)
        command = str(form.get("command")) if isinstance(form, dict) else ""
        options = form.get("options", []) if isinstance(form, dict) else []
        known = command in COMMANDS and command != "demo" and isinstance(options, list)  # that makes a new campaign
        if not known or not all(re.fullmatch(COMMANDS[command][0], str(one)) for one in options):
            raise CampaignError(f"no command {shown(command)} with these options can be started here")
        site.jobs.start(place, command, *map(str, options))
        return Response(status_code=204)

    return [
        site.page_route("/c/{key}/run", "run.html", shown_of),
        Route("/c/{key}/run", start, methods=["POST"]),
        *job_routes(site, site.jobs, "run", partial(_document, site)),
    ]


def _document(site: Site, place: Place, job: Job, told: int = 0) -> dict[str, Any]:
    """What the page shows of a job, with the tests that it does not have yet."""
    tests = list(job.tests.items())[told:]
    done = job.phase is Phase.DONE
    _, _, following, called = COMMANDS[job.name]
    return {
        "phase": job.phase,
        "before": site.jobs.before(job) if job.phase is Phase.WAITING else 0,
        "task": job.task,
        "tests": [{"test": name, **said, "address": address(place, "tests", name)} for name, said in tests],
        "messages": list(job.messages),
        "next": address(place, *following) if done else "",
        "command": job.name,
        "called": called,
    }


def ask_routes(site: Site) -> list[Route]:
    """The page, its start, and its events."""

    def shown(place: Place, request: Request) -> dict[str, Any]:
        name = request.query_params.get("command", "")
        job = site.answers.of(place)
        return {
            "commands": site.commands,
            "asked": asked_named(site.commands, name) if name else None,
            "stated": dict(request.query_params),
            "job": job if job is not None and job.name == name else None,
        }

    async def start(request: Request) -> Response:
        place, form = site.place(request), await body_of(request)
        stated = {str(name): str(value) for name, value in form.items()} if isinstance(form, dict) else {}
        asked = asked_named(site.commands, stated.get("command", ""))
        words, folder = (asked.name, *asked.words(stated)), None
        if asked.name == "export" and (kind := KINDS.get(stated.get("to", "").strip())):
            folder = TemporaryDirectory(prefix="fourpole-export-", ignore_cleanup_errors=True)
            words = (*words, f"--out={Path(folder.name, kind.file)}")
        path = place.results / "map.json" if stated.get("of") == "map" else place.folder
        job = site.answers.start(place, *words, path=path, folder=folder)
        if job.words != words:
            raise CampaignError(f"{job.name} is at work on this campaign: wait for its answer, or stop it")
        return Response(status_code=204)

    async def file(request: Request) -> Response:
        place, name = site.place(request), str(request.path_params["name"])
        job = site.answers.of(place)
        path = next((one for one in (job.files if job else ()) if one.name == name), None)
        if path is None:
            raise CampaignError("there is no such file any more: make it again")
        name, content = await run_in_threadpool(_content, path)
        return attachment(content, "application/octet-stream", f"{place.key}-{name}")

    return [
        site.page_route("/c/{key}/ask", "ask.html", shown, of_results=True),
        Route("/c/{key}/ask", start, methods=["POST"]),
        Route("/c/{key}/ask/files/{name}", file),
        *job_routes(site, site.answers, "ask", lambda _, job, __: {"phase": job.phase, "task": job.task}),
    ]


def _content(path: Path) -> tuple[str, bytes]:
    """Name and content of a file that a command made; a folder is packed."""
    if not path.is_dir():
        return path.name, read_bytes(path, max_bytes=MAX_FILE_BYTES, within=path.parent)
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        for one in sorted(path.iterdir()):
            archive.writestr(one.name, read_bytes(one, max_bytes=MAX_FILE_BYTES, within=path))
    return f"{path.name}.zip", packed.getvalue()


def watch_routes(site: Site) -> list[Route]:
    """The page, its events, and the buttons."""

    def shown(place: Place, _: Request) -> dict[str, Any]:
        return {"data": Markup(embedded(_judged(site, place, site.watches.of(place))))}

    async def start(request: Request) -> Response:
        site.watches.start(site.place(request), "watch")
        return Response(status_code=204)

    return [
        site.page_route("/c/{key}/watch", "watch.html", shown),
        Route("/c/{key}/watch", start, methods=["POST"]),
        *job_routes(site, site.watches, "watch", lambda place, job, _: _judged(site, place, job)),
    ]


def _judged(site: Site, place: Place, job: Job | None) -> dict[str, Any]:
    """The judgements, the last one first."""
    if job is None:
        return {"phase": "", "ready": False, "judged": [], "messages": []}
    named: set[str] = set()
    with suppress(FourpoleError):
        named = {test.name for test in site.held.campaign(place).tests}
    keys = ("test", "verdict", "condition", "remarks", "results", "doubts")
    judged = [
        {key: one[key] for key in keys}
        | {"address": address(place, "tests", one["test"]) if one["test"] in named else ""}
        for one in reversed(list(job.judged))
    ]
    return {
        "phase": job.phase,
        "ready": "watching" in job.task,
        "judged": judged,
        "messages": [*job.together, *([f"error: {job.error}"] if job.error else [])],
    }
