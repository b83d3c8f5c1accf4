"""The command that serves the app on this machine."""

from __future__ import annotations

import secrets
import socket
from contextlib import suppress
from pathlib import Path

import typer

from fourpole.app.browse import shown_in_browser
from fourpole.app.console import say
from fourpole.errors import CampaignError

_LOOPBACK = ("127.0.0.1", "localhost", "::1")
#: Time that open pages are given when the server ends [s].
_FAREWELL = 2
#: Connections at a time; further ones are refused.
_MOST_CONNECTIONS = 300


def run_app(folder: Path, host: str, port: int, *, no_browser: bool, no_token: bool) -> None:
    """Serve the campaigns below a folder until Ctrl-C."""
    if not folder.is_dir():
        raise CampaignError(f"{folder}: there is no such folder; name the one that has your campaigns")
    try:
        import uvicorn

        from fourpole.served.application import application
        from fourpole.served.patience import PatientProtocol
    except ImportError as error:
        raise CampaignError(f"the app needs {error.name}: pip install 'fourpole[app]'") from None
    token = "" if no_token else secrets.token_urlsafe(24)
    listening = _listening(host, port)
    address = f"http://{_name(host, listening)}:{listening.getsockname()[1]}/{f'?token={token}' if token else ''}"
    typer.echo(f"app: {address}")  # never folded: it is copied
    say(_known_to(host, token))
    say("Ctrl-C ends it; what is saved stays")
    if not no_browser and not shown_in_browser(address):
        say("no browser could be started: open this address in one")
    settings = uvicorn.Config(
        application(folder, host=host, token=token), http=PatientProtocol, limit_concurrency=_MOST_CONNECTIONS,
        log_level="warning", timeout_graceful_shutdown=_FAREWELL, server_header=False, date_header=False,
    )  # fmt: skip
    with suppress(KeyboardInterrupt):
        uvicorn.Server(settings).run(sockets=[listening])


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
