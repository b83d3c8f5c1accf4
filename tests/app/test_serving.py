"""What `fourpole app` says: an address that can be copied, and who can use it."""

from __future__ import annotations

import json
import os
import re
import signal
import socket
import subprocess
import sys
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from http.client import HTTPConnection
from pathlib import Path
from urllib.parse import urlsplit

import pytest


@contextmanager
def running(root: Path, *options: str, **settings: object) -> Iterator[subprocess.Popen[str]]:
    command = [sys.executable, "-m", "fourpole", "app", str(root), "--no-browser", *options]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, **settings}
    with subprocess.Popen(command, text=True, **pipes) as process:
        try:
            yield process
        finally:
            process.send_signal(signal.SIGINT)
            assert process.wait(30) in (0, 130)  # by Ctrl-C, also while it starts


@pytest.mark.skipif(sys.platform == "win32", reason="terminals of Unix")
@pytest.mark.sampled(4)
def test_the_address_is_one_line_of_a_narrow_terminal(tmp_path: Path) -> None:
    import pty

    shown, terminal = pty.openpty()
    with running(tmp_path, stdout=terminal, env={**os.environ, "COLUMNS": "20", "TERM": "xterm"}):
        with os.fdopen(os.dup(shown), errors="replace") as screen:
            line = screen.readline().rstrip()
        assert re.fullmatch(r"app: http://127\.0\.0\.1:\d+/\?token=[\w-]{32}", line)
    for descriptor in (shown, terminal):
        os.close(descriptor)


@pytest.mark.sampled(4)
def test_a_token_is_not_written_down(tmp_path: Path) -> None:
    with running(tmp_path) as process:
        assert process.stdout is not None
        address = process.stdout.readline().removeprefix("app: ").strip()
        token, there = urlsplit(address).query.removeprefix("token="), urlsplit(address)
        opener = urllib.request.build_opener(urllib.request.HTTPCookieProcessor())
        with opener.open(address) as page:
            assert token not in page.url
            assert token not in page.read().decode()
        with opener.open(address.partition("?")[0]) as page:
            assert page.status == 200
        strange = HTTPConnection(there.hostname or "", there.port)
        strange.putrequest("GET", f"/nowhere?token={token}", skip_host=True)
        strange.endheaders()
        assert strange.getresponse().status in (400, 421)
        strange.close()
        with socket.create_connection((there.hostname, there.port)) as half:
            half.sendall(f"GET /?token={token} NOTHING\r\n\r\n".encode())
            assert token.encode() not in half.recv(10_000)
        process.send_signal(signal.SIGINT)
        printed, said = process.communicate(timeout=30)
    assert token not in f"{printed}{said}"
    assert not any(token in str(path) for path in tmp_path.rglob("*"))


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ([], "everyone who has this address, with its token, can read and change"),
        (["--no-token"], "without a token, every account of this machine can read and change"),
        (["--no-token", "--host", "0.0.0.0"], "everyone who reaches this machine by the network can read and change"),
    ],
)
@pytest.mark.sampled(3)
def test_it_says_who_can_use_it(tmp_path: Path, options: list[str], said: str) -> None:
    with running(tmp_path, *options) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        assert ("?token=" in process.stdout.readline()) == (not options)
        assert said in process.stderr.readline()


@pytest.mark.sampled(4)
def test_a_program_gets_the_address_on_a_line(tmp_path: Path) -> None:
    with running(tmp_path, "--json") as process:
        assert process.stdout is not None
        address = json.loads(process.stdout.readline())["app"]
        assert re.fullmatch(r"http://127\.0\.0\.1:\d+/\?token=[\w-]{32}", address)


@pytest.mark.skipif(not socket.has_ipv6, reason="no IPv6")
@pytest.mark.sampled(4)
def test_an_address_of_ipv6_can_be_opened(tmp_path: Path) -> None:
    try:
        socket.create_server(("::1", 0), family=socket.AF_INET6).close()
    except OSError:
        pytest.skip("no IPv6")
    with running(tmp_path, "--host", "::1") as process:
        assert process.stdout is not None
        address = process.stdout.readline().removeprefix("app: ").strip()
        assert address.startswith("http://[::1]:")
        opener = urllib.request.build_opener(urllib.request.HTTPCookieProcessor())
        with opener.open(address) as page:
            assert page.status == 200
