"""What is dropped beside the recordings is never a module or a program of a process that Fourpole starts."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from tests.served.server import Server

from fourpole.io.child import OWN_BYTES
from fourpole.virtual import RADIAL_PLY, simulate_campaign

pytestmark = [
    pytest.mark.thorough,
    pytest.mark.skipif(sys.platform == "win32", reason="the programs that are dropped are scripts of a shell"),
]

SCRIPT = Path(sys.executable).with_name("fourpole")
MODULES = (
    "asyncio", "csv", "fourpole", "json", "matplotlib", "multiprocessing", "numpy", "pickle", "polars", "scipy",
    "sitecustomize", "struct", "typer", "usercustomize",
)  # fmt: skip
PROGRAMS = ("cc", "chromium", "gcc", "git", "python", "xdg-open")
LONG = 120.0


class Dropped:
    """A served folder whose campaign is full of modules and programs, as the folder itself is."""

    def __init__(self, folder: Path) -> None:
        self.root, self.note = folder / "root", folder / "ran"
        self.campaign = self.root / "one"
        simulate_campaign(
            self.campaign, tyres=[RADIAL_PLY], pressures=[170e3], preloads=[1000.0], frequencies=[10.0, 13.0, 16.0]
        )
        code = f"import sys\nopen({str(self.note)!r}, 'a').write(__file__ + repr(sys.argv))\nraise SystemExit(9)\n"
        for place in (self.root, self.campaign, self.campaign / "recordings"):
            for name in MODULES:
                (place / f"{name}.py").write_text(code)
                (place / name).mkdir()
                (place / name / "__init__.py").write_text(code)
            for name in PROGRAMS:
                (place / name).write_text(f"#!/bin/sh\necho {name} >> {self.note}\n")
                (place / name).chmod(0o755)

    @contextmanager
    def started(self, where: Path, *words: str) -> Iterator[subprocess.Popen[str]]:
        """The script `fourpole` in a working folder with a careless PATH, ended as Ctrl-C ends it."""
        environment = {**os.environ, "PYTHONUNBUFFERED": "1", "PATH": f":.:{os.environ['PATH']}", "NO_COLOR": "1"}
        with subprocess.Popen(
            [str(SCRIPT), *words], cwd=where, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment
        ) as process:
            try:
                yield process
            finally:
                process.send_signal(signal.SIGINT)
                process.communicate(timeout=LONG)

    def wait_for(self, path: Path) -> None:
        until = time.monotonic() + LONG
        while not path.exists() and time.monotonic() < until:
            assert not self.note.exists(), self.note.read_text()
            time.sleep(0.1)
        assert path.exists()


@pytest.fixture
def dropped(tmp_path: Path) -> Dropped:
    return Dropped(tmp_path)


@pytest.mark.parametrize("inside", [True, False])
@pytest.mark.sampled(4)
def test_no_job_of_the_app_runs_what_is_dropped(dropped: Dropped, tmp_path: Path, inside: bool) -> None:
    """The server stands in the folder that it serves, or in another one."""
    where, named = (dropped.root, ".") if inside else (tmp_path, str(dropped.root))
    with dropped.started(where, "app", named, "--no-browser") as process:
        assert process.stdout is not None
        server = Server(process.stdout.readline().removeprefix("app: ").strip(), dropped.root, tmp_path)
        page = server.ask("/")[1].decode()
        (address,) = {part.split('"')[0] for part in page.split('href="')[1:] if part.startswith("/c/")}
        assert server.ask(f"{address}/run", "POST", {"command": "analyse", "options": ["--no-models"]})[0] == 204
        dropped.wait_for(dropped.campaign / "results" / "report.html")
    assert not dropped.note.exists()


@pytest.mark.sampled(4)
def test_no_watch_runs_what_is_dropped(dropped: Dropped) -> None:
    """Neither what judges a new recording, nor the analysis of all of them."""
    tests = dropped.campaign / "tests.csv"
    text = tests.read_text()
    tests.write_text("".join(line for line in text.splitlines(keepends=True) if not line.startswith("D3,")))
    new = dropped.campaign / "recordings" / "D3.csv"
    content = new.read_bytes()
    new.unlink()
    with dropped.started(dropped.campaign, "watch", ".") as process:
        assert process.stderr is not None
        assert any("watching" in line for line in process.stderr)
        new.write_bytes(content)
        dropped.wait_for(dropped.campaign / "results" / "report.html")
    assert not dropped.note.exists()


@pytest.mark.sampled(4)
def test_no_command_runs_what_is_dropped(dropped: Dropped) -> None:
    recording = next((dropped.campaign / "recordings").glob("D*.csv"))
    head, *lines = recording.read_text().splitlines()
    large = recording.with_name("large.csv")
    text = "\n".join(lines)
    large.write_text("\n".join([head, *([text] * (OWN_BYTES // len(text) + 1))]))
    whole = dropped.campaign
    for where, words in (
        (whole / "recordings", ("info", "large.csv")),
        (whole, ("convert", recording.relative_to(whole).as_posix(), "D.parquet")),
        (whole, ("info", "D.parquet")),
        (whole, ("analyse", ".", "--workers", "2")),
        (whole, ("export", "fmu", ".")),
        (whole, ("check", ".")),
    ):
        with dropped.started(where, *words) as process:
            printed, said = process.communicate(timeout=LONG)
        assert not dropped.note.exists(), (words, dropped.note.read_text())
        assert process.returncode in (0, 2, 3), said
        assert printed or words[0] == "export", said
