"""Home: the campaigns of the workspace, and files that are dropped to become one."""

from __future__ import annotations

from typing import Any

from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route

from fourpole.errors import FileError
from fourpole.served.site import Site, address, body_of
from fourpole.served.workspace import MOST_BYTES, MOST_FILES, LeftOut, state_of

#: Folder of the demo, as the command names it.
_DEMO = "fourpole-demo"


def routes(site: Site) -> list[Route]:
    """The page, the demo, and the steps of an upload."""

    async def page(_: Request) -> Response:
        return await site.page("home.html", lambda: _shown(site))

    async def begin(request: Request) -> Response:
        asked = await body_of(request)
        try:
            files = [(str(one["name"]), int(one["size"])) for one in asked["files"]]
            name = str(asked["name"])
            if not all(0 <= size < 2**63 for _, size in files):
                raise ValueError
        except (KeyError, TypeError, ValueError, OverflowError):
            raise FileError("the list of files is not whole") from None
        ticket, refused = await run_in_threadpool(site.uploads.begin, name, files)
        return JSONResponse({"ticket": ticket, "refused": refused})

    async def file(request: Request) -> Response:
        await site.uploads.take(request.path_params["ticket"], request.path_params["number"], request.stream())
        return JSONResponse({})

    async def finish(request: Request) -> Response:
        folder = await run_in_threadpool(site.uploads.finish, request.path_params["ticket"])
        place = site.workspace.place_of(folder)
        if not (folder / "campaign.toml").is_file():
            site.jobs.start(place, "init")
            return JSONResponse({"next": address(place, "run")})
        return JSONResponse({"next": address(place)})

    async def drop(request: Request) -> Response:
        await run_in_threadpool(site.uploads.drop, request.path_params["ticket"])
        return JSONResponse({})

    async def demo(_: Request) -> Response:
        place = site.workspace.place_of(site.workspace.root / _DEMO)
        if site.jobs.making(place.key):
            return JSONResponse({"next": address(place, "run")})
        if (place.folder / "campaign.toml").is_file():
            return JSONResponse({"next": address(place)})
        place = site.workspace.place_of(await run_in_threadpool(site.workspace.new_folder, _DEMO))
        site.jobs.start(place, "demo")
        return JSONResponse({"next": address(place, "run")})

    return [
        Route("/", page),
        Route("/demo", demo, methods=["POST"]),
        Route("/upload", begin, methods=["POST"]),
        Route("/upload/{ticket}/{number:int}", file, methods=["PUT"]),
        Route("/upload/{ticket}", finish, methods=["POST"]),
        Route("/upload/{ticket}", drop, methods=["DELETE"]),
    ]


def _shown(site: Site) -> dict[str, Any]:
    rows: list[Any] = []
    for place in site.workspace.listed():
        if isinstance(place, LeftOut):
            rows.append(place)
            continue
        job = site.jobs.of(place)
        try:
            state = state_of(place)
        except Exception as error:  # noqa: BLE001 - whatever one campaign is like, the others are listed
            rows.append(LeftOut(place.name, f"a fault in Fourpole itself ({type(error).__name__}): please report it"))
            continue
        rows.append({"place": place, "state": state, "job": None if job is None or job.over else job})
    return {"rows": rows, "root": str(site.workspace.root), "most_files": MOST_FILES, "most_bytes": MOST_BYTES}
