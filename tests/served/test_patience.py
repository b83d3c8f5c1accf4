"""Half a request does not hold a connection for ever."""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Iterator
from contextlib import suppress

import pytest
import uvicorn
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import PlainTextResponse, Response
from starlette.routing import Route

from fourpole.served.guard import PatientProtocol


class Hasty(PatientProtocol):
    """The same with times that a test can wait for [s]."""

    whole_head, next_part = 0.4, 0.4


async def length(request: Request) -> Response:
    return PlainTextResponse(str(len(await request.body())))


@pytest.fixture(scope="module")
def port() -> Iterator[int]:
    listening = socket.create_server(("127.0.0.1", 0))
    application = Starlette(routes=[Route("/", length, methods=["PUT"])])
    server = uvicorn.Server(uvicorn.Config(application, http=Hasty, log_level="critical"))
    running = threading.Thread(target=server.run, args=([listening],))
    running.start()
    yield listening.getsockname()[1]
    server.should_exit = True
    running.join(10)


@pytest.mark.parametrize(
    "begun", [b"", b"PUT / HTTP/1.1\r\nHost: x\r\n", b"PUT / HTTP/1.1\r\nHost: x\r\nContent-Length: 9\r\n\r\nhalf"]
)
def test_half_a_request_is_given_up(port: int, begun: bytes) -> None:
    with socket.create_connection(("127.0.0.1", port), timeout=10) as there:
        there.sendall(begun)
        with suppress(ConnectionResetError):
            assert there.recv(100) == b""


def test_a_slow_head_is_given_up_though_it_goes_on(port: int) -> None:
    with socket.create_connection(("127.0.0.1", port), timeout=10) as there:
        until = time.monotonic() + 10
        with suppress(ConnectionError):
            while time.monotonic() < until:
                there.sendall(b"P")
                time.sleep(0.05)
        assert time.monotonic() < until


def test_a_slow_request_that_goes_on_is_answered(port: int) -> None:
    with socket.create_connection(("127.0.0.1", port), timeout=10) as there:
        for _ in range(2):
            there.sendall(b"PUT / HTTP/1.1\r\nHost: x\r\nContent-Length: 4\r\n\r\n")
            for _ in range(4):
                time.sleep(0.2)
                there.sendall(b"x")
            answer = b""
            while not answer.endswith(b"\r\n\r\n4"):
                part = there.recv(1000)
                assert part
                answer += part
