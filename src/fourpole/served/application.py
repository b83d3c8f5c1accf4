"""The application: its pages, its guard, and its end."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

from starlette.applications import Starlette
from starlette.exceptions import HTTPException
from starlette.middleware import Middleware
from starlette.routing import Route

from fourpole.errors import FourpoleError
from fourpole.served.guard import Guard
from fourpole.served.jobs import Asked, Jobs
from fourpole.served.pages import explore, home, model, plan, recording, run, statement
from fourpole.served.site import Site, static
from fourpole.served.workspace import Uploads, Workspace
from fourpole.study.workers import processors

#: Functions that give the routes of a page.
_PAGES = (
    home.routes, run.run_routes, recording.routes, statement.routes, explore.explore_routes, model.routes, plan.routes,
    run.ask_routes, explore.compare_routes, run.watch_routes,
)  # fmt: skip


def application(root: Path, *, host: str = "127.0.0.1", token: str = "", commands: tuple[Asked, ...] = ()) -> Starlette:
    """The application for the campaigns below a folder.

    Parameters
    ----------
    root : Path
        The folder.
    host : str
        The address that the server listens at.
    token : str
        What a caller must show; empty for none.
    commands : tuple of Asked
        Commands that the page Ask may start.
    """
    workspace = Workspace(root)
    site = Site(workspace, Jobs(processors()), Uploads(workspace), commands)

    @asynccontextmanager
    async def life(_: Starlette) -> AsyncIterator[None]:
        yield
        site.uploads.close()
        site.collector.close()
        await site.watches.close()
        await site.answers.close()
        await site.jobs.close()

    return Starlette(
        routes=[Route("/static/{name}", static), *(route for routes in _PAGES for route in routes(site))],
        middleware=[Middleware(Guard, host=host, token=token)],
        exception_handlers=dict.fromkeys((FourpoleError, OSError, MemoryError, HTTPException, Exception), site.fault),
        lifespan=life,
    )
