"""Who may call: hosts, origins and the token are checked before any page is made; half a request is closed in time."""

from __future__ import annotations

import asyncio
import hmac
import ipaddress
import socket
from typing import Any
from urllib.parse import urlencode, urlsplit

import h11
from starlette.datastructures import Headers, MutableHeaders
from starlette.requests import Request
from starlette.responses import HTMLResponse, JSONResponse, PlainTextResponse, RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from uvicorn.protocols.http.h11_impl import H11Protocol

from fourpole.report.html import packaged

#: A page runs the scripts of this server alone; shapes and texts of a drawing may have a style of their own.
POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; style-src-attr 'unsafe-inline'; img-src 'self' data:; "
    "connect-src 'self'; form-action 'self'; object-src 'none'; base-uri 'none'; frame-ancestors 'none'"
)
_HEADERS = {
    "Content-Security-Policy": POLICY,
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
}
#: Name of the cookie, with the port behind it: a browser sends a cookie to all ports of a host.
_COOKIE = "fourpole"
_TOKEN = "token"
_READS = frozenset(("GET", "HEAD"))
#: Where a browser says that a request comes from: this server, or the address bar.
_OWN_SITES = frozenset(("same-origin", "none"))
_LOOPBACK = frozenset(("localhost", "127.0.0.1", "::1"))
#: The header of a request of a page's script, which shows an error in the page.
ASKED_BY = "x-asked-by"
_CLOSED = (
    "this needs the whole address of the app: it stands in the terminal where fourpole app runs, behind 'app:'; open "
    "it in this browser"
)
_CLOSED_PAGE = packaged("templates/closed.html", "fourpole.served")


class Guard:
    """Lets a request through if its host, its origin and its token are right.

    Parameters
    ----------
    app : ASGI application
    host : str
        The address that the server listens at. On loopback only names of loopback are hosts; otherwise also this
        machine's name, and any address in numbers, which no foreign name server can point here.
    token : str
        What a caller must show, once in an address and then as a cookie; empty for none.
    """

    def __init__(self, app: ASGIApp, host: str, token: str = "") -> None:
        self._app, self._token = app, token
        self._names = set(_LOOPBACK)
        self._numbers = host not in _LOOPBACK
        if self._numbers:
            self._names |= {host, socket.gethostname().lower()}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request, or refuse it."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return

        async def with_policy(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                for name, value in _HEADERS.items():
                    headers.setdefault(name, value)
            await send(message)

        answer = self._refusal(Request(scope)) or self._app
        await answer(scope, receive, with_policy)

    def _refusal(self, request: Request) -> Response | None:
        headers = request.headers
        if not self._is_host(headers.get("host", "")):
            return _refused("this server does not have that name: open the address that fourpole app printed", 421)
        if not _is_own(request.method, headers):
            return _refused("the request comes from another site, which may not use this one", 403)
        if not self._token:
            return None
        if request.method in _READS and _TOKEN in request.query_params:
            return self._entrance(request)
        return None if self._is_known(request) else _closed(request)

    def _is_host(self, host: str) -> bool:
        try:
            parts = urlsplit(f"//{host}")
            name, _ = (parts.hostname or "").lower(), parts.port
        except ValueError:
            return False
        return "@" not in host and (name in self._names or (self._numbers and _is_number(name)))

    def _entrance(self, request: Request) -> Response:
        """The same page without the token in its address; who shows the right token is known by a cookie then."""
        is_right = self._is_token(request.query_params[_TOKEN])
        if not is_right and not self._is_known(request):
            return _closed(request)
        query = urlencode([(name, value) for name, value in request.query_params.multi_items() if name != _TOKEN])
        path = "/" + request.scope["raw_path"].decode("latin-1").lstrip("/\\")  # `//name` would be another host
        answer = RedirectResponse(f"{path}?{query}" if query else path, 303, {"Cache-Control": "no-store"})
        if is_right:
            # With "strict" a browser does not send it where a file or a page of another site has led to the address.
            answer.set_cookie(_cookie_of(request), self._token, httponly=True, samesite="lax")
        return answer

    def _is_known(self, request: Request) -> bool:
        """Whether one of the cookies is right: a server at another port may have set further ones of the same name."""
        cookies = (one.strip().partition("=") for line in request.headers.getlist("cookie") for one in line.split(";"))
        return any(self._is_token(value) for name, _, value in cookies if name == _cookie_of(request))

    def _is_token(self, shown: str) -> bool:
        return hmac.compare_digest(shown.encode(errors="replace"), self._token.encode())


def _cookie_of(request: Request) -> str:
    """Name of the cookie: with the port as the browser sees it, which a tunnel may have changed."""
    return f"{_COOKIE}-{urlsplit('//' + request.headers['host']).port or 80}"


def _is_own(method: str, headers: Headers) -> bool:
    """Whether a request comes from a page of this server, or reads a page that someone opens."""
    site, origin = headers.get("sec-fetch-site"), headers.get("origin")
    if method in _READS:
        opened = headers.get("sec-fetch-mode") == "navigate"
        return site is None or site in _OWN_SITES or opened
    if origin is not None:
        return urlsplit(origin).scheme in ("http", "https") and urlsplit(origin).netloc == headers.get("host")
    return site == "same-origin"


def _is_number(name: str) -> bool:
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True


def _refused(why: str, status: int) -> Response:
    return PlainTextResponse(f"{why}\n", status)


def _closed(request: Request) -> Response:
    """The refusal of a caller without the token: a page, or the same in words for a script."""
    headers = {"Cache-Control": "no-store"}
    if ASKED_BY in request.headers:
        return JSONResponse({"error": _CLOSED}, 401, headers)
    if "text/html" in request.headers.get("accept", ""):
        return HTMLResponse(_CLOSED_PAGE, 401, headers)
    return PlainTextResponse(f"{_CLOSED}\n", 401, headers)


class PatientProtocol(H11Protocol):
    """HTTP as uvicorn speaks it, with an end to the wait for the rest of a request.

    Attributes
    ----------
    whole_head, next_part : float [s]
        Time for the whole head of a request, and for each next part of its body.
    """

    whole_head, next_part = 20.0, 60.0
    _due: asyncio.TimerHandle | None = None

    def connection_made(self, transport: Any) -> None:
        """Begin to wait for the first request."""
        super().connection_made(transport)
        self._wait(self.whole_head)

    def data_received(self, data: bytes) -> None:
        """Take a part of a request, and wait for the next one if it is not whole."""
        super().data_received(data)
        if self.conn.their_state is h11.SEND_BODY:
            self._wait(self.next_part)
        elif self.conn.their_state is not h11.IDLE:
            self._rest()
        elif self._due is None:
            self._wait(self.whole_head)

    def connection_lost(self, exc: Exception | None) -> None:
        """Wait no longer."""
        self._rest()
        super().connection_lost(exc)

    def _wait(self, seconds: float) -> None:
        self._rest()
        self._due = self.loop.call_later(seconds, self._late)

    def _rest(self) -> None:
        if self._due is not None:
            self._due.cancel()
            self._due = None

    def _late(self) -> None:
        self._due = None
        if self.flow.read_paused:  # the server is behind, not the other side
            self._wait(self.next_part)
        else:
            self.transport.abort()
