"""A server of the app in a process of its own, as a user starts it, and plain requests to it."""

from __future__ import annotations

import http.client
import json
import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit


@dataclass(frozen=True)
class Server:
    """The address that a server printed, the folder that it serves, and the one in which it makes files for a while."""

    address: str
    root: Path
    temporary: Path
    pid: int = 0

    @property
    def host(self) -> str:
        return urlsplit(self.address).netloc

    @property
    def token(self) -> str:
        return urlsplit(self.address).query.removeprefix("token=")

    @property
    def cookie(self) -> tuple[str, str]:
        """Name and value of the cookie of a browser that has opened the address."""
        return f"fourpole-{urlsplit(self.address).port}", self.token

    @property
    def cache(self) -> Path:
        """The cache folder of the user who started it."""
        return self.temporary / "cache"

    def ask(
        self,
        path: str,
        method: str = "GET",
        body: Any = None,
        *,
        headers: dict[str, str] | None = None,
        own: bool = True,
        known: bool = True,
    ) -> tuple[int, bytes, dict[str, str]]:
        """Status, body and headers of an answer; `own`: as a page of this server asks; `known`: with the token."""
        there = urlsplit(self.address)
        sent = {"Accept": "text/html" if method == "GET" else "application/json"}
        if own:
            sent |= {"Origin": f"http://{there.netloc}", "Sec-Fetch-Site": "same-origin"}
        if known:
            sent["Cookie"] = "=".join(self.cookie)
        sent |= headers or {}
        content = body if body is None or isinstance(body, bytes) else json.dumps(body).encode()
        connection = http.client.HTTPConnection(there.hostname or "", there.port, timeout=60)
        try:
            connection.request(method, path, content, sent)
            answer = connection.getresponse()
            return answer.status, answer.read(), {name.lower(): value for name, value in answer.getheaders()}
        finally:
            connection.close()

    def document(self, path: str, method: str = "GET", body: Any = None) -> Any:
        """The JSON document of an answer that must be good."""
        status, content, _ = self.ask(path, method, body, headers={"Accept": "application/json"})
        assert status < 300, content
        return json.loads(content) if content else None


@contextmanager
def serving(root: Path, *options: str) -> Iterator[Server]:
    """`fourpole app` on a folder, ended as Ctrl-C ends it."""
    command = [sys.executable, "-m", "fourpole", "app", str(root), "--no-browser", *options]
    with tempfile.TemporaryDirectory() as temporary:
        environment = {**os.environ, "PYTHONUNBUFFERED": "1", "TMPDIR": temporary}
        environment["XDG_CACHE_HOME"] = str(Path(temporary, "cache"))
        process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment)
        assert process.stdout is not None
        try:
            line = process.stdout.readline()
            assert line.startswith("app: http://"), line
            yield Server(line.removeprefix("app: ").strip(), root, Path(temporary), process.pid)
        finally:
            process.send_signal(signal.SIGINT)
            code = process.wait(30)
            process.stdout.close()
            assert code == 0
