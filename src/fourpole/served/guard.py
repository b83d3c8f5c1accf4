"""Who may call: hosts, origins and the token are checked before any page is made, and each answer has its policy."""

from __future__ import annotations

import hmac
import ipaddress
import socket
from urllib.parse import urlsplit

from starlette.datastructures import URL, Headers, MutableHeaders
from starlette.requests import Request
from starlette.responses import PlainTextResponse, RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

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
_COOKIE = "fourpole"
_READS = frozenset(("GET", "HEAD"))
#: Where a browser says that a request comes from: this server, or the address bar.
_OWN_SITES = frozenset(("same-origin", "none"))
_LOOPBACK = frozenset(("localhost", "127.0.0.1", "::1"))


class Guard:
    """Lets a request through if its host, its origin and its token are right.

    Parameters
    ----------
    app : ASGI application
    host : str
        The address that the server listens at. On loopback only names of loopback are hosts; otherwise also this
        machine's name, and any address in numbers, which no foreign name server can point here.
    token : str
        What a caller must show, once in the address and then as a cookie; empty for none.
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
        if self._token and not hmac.compare_digest(request.cookies.get(_COOKIE, "").encode(), self._token.encode()):
            return self._entrance(request)
        return None

    def _is_host(self, host: str) -> bool:
        try:
            name = (urlsplit(f"//{host}").hostname or "").lower()
        except ValueError:
            return False
        return "@" not in host and (name in self._names or (self._numbers and _is_number(name)))

    def _entrance(self, request: Request) -> Response:
        """The first call with the token, which becomes a cookie; or a refusal."""
        shown = request.query_params.get("token", "")
        if request.method not in _READS or not hmac.compare_digest(shown.encode(), self._token.encode()):
            return _refused("a token is needed: open the address that fourpole app printed, with its token", 401)
        target = URL(str(request.url)).remove_query_params("token")
        answer = RedirectResponse(f"{target.path}?{target.query}" if target.query else target.path, 303)
        answer.set_cookie(_COOKIE, self._token, httponly=True, samesite="strict")
        return answer


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
