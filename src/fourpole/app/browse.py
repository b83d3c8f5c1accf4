"""The commands open and app: the report in the browser, the server of the app, and the commands that it may start."""

from __future__ import annotations

import atexit
import html
import os
import secrets
import shlex
import shutil
import socket
import sys
import tempfile
import threading
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from types import UnionType
from typing import Any, get_args
from urllib.parse import urlsplit

from typer.models import OptionInfo

from fourpole.answer import Answer
from fourpole.app.console import say
from fourpole.app.group import BROWSER, about, signature_of
from fourpole.errors import CampaignError
from fourpole.io.folders import results_in
from fourpole.io.processes import DEVNULL, OF_SCREEN, open_by_system, program_path, start
from fourpole.served.jobs import Asked, AskedOption

#: Options that are for the terminal, or that the app states itself.
_LEFT_OUT = {"as_json", "remote", "workers", "force"}


def catalogue() -> tuple[Asked, ...]:
    """The commands that take a campaign's folder and may be started from a browser."""
    return tuple(Asked(name, about(name), tuple(_options(name))) for name in BROWSER)


def _options(name: str) -> Iterator[AskedOption]:
    """The options of a command that are no path."""
    for one in signature_of(name).parameters.values():
        kind, option = one.annotation, one.default
        if not isinstance(option, OptionInfo) or Path in _kinds(kind) or one.name in _LEFT_OUT:
            continue
        long = next((each for each in option.param_decls or () if each.startswith("--")), f"--{one.name}")
        name, needed = long.partition("/")[0].replace("_", "-"), option.default is ...
        yield AskedOption(name, option.help or "", flag=bool in _kinds(kind), needed=needed)


def _kinds(kind: Any) -> tuple[Any, ...]:
    """The types of which a value may be."""
    return get_args(kind) if isinstance(kind, UnionType) else (kind,)


#: Time that a program has to say that it cannot show a page [s].
_REFUSES = 1.0
#: Time after which the page that leads to an address is deleted [s]: the browser may have to start.
_LEADS = 30.0
#: Programs of a desktop that show a page in the browser that the user chose, and browsers.
_PROGRAMS = ("xdg-open", "gio open", "x-www-browser", "firefox", "chromium", "google-chrome")
_PAGE = (
    '<!DOCTYPE html><meta charset="utf-8"><meta name="referrer" content="no-referrer"><title>Fourpole</title>'
    '<meta http-equiv="refresh" content="0;url={0}"><a href="{0}">Fourpole</a>\n'
)


def run_open(folder: Path) -> Answer:
    """Show report.html of a results folder in the browser, and print its path."""
    folder = results_in(folder)
    page = folder / "report.html"
    if not folder.is_dir():
        raise CampaignError(f"{folder}: there is no such folder; name a campaign or its results")
    if not page.is_file():
        raise CampaignError(f"{folder}: has no report yet: run fourpole report {folder}")

    def then() -> Iterator[Answer]:
        if not shown_in_browser(page.resolve().as_uri()):
            say("no browser could be started: open this file in one")
        yield from ()

    return Answer(files=[("report", page)], then=then)


def shown_in_browser(address: str) -> bool:
    """Whether a browser was started; without a screen none is, for one in the terminal would take it over.

    An address with a query, which may have a token, is no part of a command, which other accounts can read: the browser
    is given a page that leads there.
    """
    screen = sys.platform in ("win32", "darwin") or os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    if not (screen or os.environ.get("BROWSER")):
        return False
    try:
        if urlsplit(address).query:
            address = _leading_to(address).as_uri()
        return any(_starts(command) for command in _commands(address)) or open_by_system(address)
    except (OSError, ValueError):
        return False


def _commands(address: str) -> Iterator[list[str]]:
    """Commands that show an address: those that BROWSER lists, where %s stands for it, then those of the desktop."""
    for stated in filter(None, os.environ.get("BROWSER", "").split(os.pathsep)):
        words = [stated] if program_path(stated) else shlex.split(stated.rstrip("& "), posix=sys.platform != "win32")
        if "%s" not in stated:
            words.append("%s")
        yield [word.replace("%s", address) for word in words]
    if sys.platform == "darwin":
        yield ["/usr/bin/open", address]
    elif sys.platform != "win32":
        yield from ([*words.split(), address] for words in _PROGRAMS)


def _starts(command: list[str]) -> bool:
    """Whether a program runs, or has ended well: one that only passes the page on ends at once."""
    program = program_path(command[0])
    if program is None:
        return False
    # It may outlive this command, and so may not stand in a folder that is deleted.
    process = start([program, *command[1:]], also=OF_SCREEN, folder=Path.home().anchor, group=True, stderr=DEVNULL)
    waiting = threading.Thread(target=process.wait, daemon=True)  # it also keeps the process object
    waiting.start()
    waiting.join(_REFUSES)
    return not process.returncode


def _leading_to(address: str) -> Path:
    """A page that leads to an address, which only this user can read, and which is deleted after some seconds."""
    folder = Path(tempfile.mkdtemp(prefix="fourpole-", dir=_private()))  # its mode is 0700
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    page = folder / "open.html"
    with os.fdopen(os.open(page, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "w", encoding="utf-8") as file:
        file.write(_PAGE.format(html.escape(address)))
    deleting = threading.Timer(_LEADS, shutil.rmtree, (folder,), {"ignore_errors": True})
    deleting.daemon = True
    deleting.start()
    return page


def _private() -> str | None:
    """A folder of the user for that page; None for the temporary folder of this machine.

    A browser that is packed as a snap can read the home folder, but neither of the others.
    """
    home, own = Path.home(), os.environ.get("XDG_RUNTIME_DIR", "")
    if (home / "snap").is_dir():
        return str(home)
    return own if Path(own).is_absolute() and Path(own).is_dir() else None


_LOOPBACK = ("127.0.0.1", "localhost", "::1")
#: Time that open pages are given when the server ends [s].
_FAREWELL = 2
#: Connections at a time; further ones are refused.
_MOST_CONNECTIONS = 300


def run_app(
    folder: Path = Path(), port: int = 0, host: str = "127.0.0.1", no_browser: bool = False, no_token: bool = False
) -> Answer:
    """Serve the campaigns below a folder until Ctrl-C."""
    if not folder.is_dir():
        raise CampaignError(f"{folder}: there is no such folder; name the one that has your campaigns")
    try:
        import uvicorn

        from fourpole.served.application import application
        from fourpole.served.guard import PatientProtocol
    except ImportError as error:
        raise CampaignError(f"the app needs {error.name}: pip install 'fourpole[app]'") from None
    token = "" if no_token else secrets.token_urlsafe(24)
    listening = _listening(host, port)
    address = f"http://{_name(host, listening)}:{listening.getsockname()[1]}/{f'?token={token}' if token else ''}"

    def serve() -> Iterator[Answer]:
        yield Answer(files=[("app", address)])
        say(_known_to(host, token))
        say("Ctrl-C ends it; what is saved stays")
        if not no_browser and not shown_in_browser(address):
            say("no browser could be started: open this address in one")
        served = application(folder, host=host, token=token, commands=catalogue())
        settings = uvicorn.Config(
            served, http=PatientProtocol, limit_concurrency=_MOST_CONNECTIONS,
            log_level="warning", timeout_graceful_shutdown=_FAREWELL, server_header=False, date_header=False,
        )  # fmt: skip
        with suppress(KeyboardInterrupt):
            uvicorn.Server(settings).run(sockets=[listening])

    return Answer(then=serve)


def _listening(host: str, port: int) -> socket.socket:
    """A socket at this port, or at the next free one where none was asked for."""
    try:
        family = socket.getaddrinfo(host, None)[0][0]
        one = socket.socket(family, socket.SOCK_STREAM)
        one.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        one.bind((host, port))
        one.listen(128)
    except OSError as error:
        why = error.strerror or error
        raise CampaignError(f"--host {host}, --port {port}: {why}; choose another, or leave --port out") from None
    return one


def _name(host: str, listening: socket.socket) -> str:
    """The name or number under which a browser reaches a server."""
    if host in _LOOPBACK:
        host = listening.getsockname()[0]
    elif host in ("0.0.0.0", "::"):
        host = socket.gethostname()
    return f"[{host}]" if ":" in host else host


def _known_to(host: str, token: str) -> str:
    """Who can use the app."""
    if token:
        return "everyone who has this address, with its token, can read and change the campaigns in it"
    who = "every account of this machine" if host in _LOOPBACK else "everyone who reaches this machine by the network"
    return f"without a token, {who} can read and change the campaigns in it"
