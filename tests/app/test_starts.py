"""Every process that a command starts, and every one that such a process starts, is started by the one door."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

import polars as pl
import pytest
from tests.processes import environment
from tests.served.server import Server, serving

from fourpole.errors import FileError
from fourpole.export.fmi.description import COMPILERS
from fourpole.report.html import browser
from fourpole.virtual import RADIAL_PLY, simulate_campaign

pytestmark = pytest.mark.thorough

#: A module that each Python process loads before any other: it notes each start, and the modules that lead to it.
WATCHING = """
import os, sys
def note(event, args):
    if event in ("subprocess.Popen", "os.system", "os.exec", "os.fork", "os.forkpty", "os.posix_spawn", "os.spawn",
                 "os.startfile", "pty.spawn", "_winapi.CreateProcess"):
        frame, places = sys._getframe(1), []
        while frame is not None:
            places.append(frame.f_code.co_filename)
            frame = frame.f_back
        by = any(one.endswith(os.path.join("fourpole", "io", "processes.py")) for one in places)
        with open(os.environ["FOURPOLE_NOTE"], "a") as file:
            file.write(("door " if by else "OTHER ") + repr((event, args[:2], [] if by else places[:12])) + "\\n")
sys.addaudithook(note)
"""


@pytest.fixture
def noted(tmp_path, monkeypatch):
    """What was started: lines, those by the door and others."""
    (tmp_path / "hook").mkdir()
    (tmp_path / "hook" / "sitecustomize.py").write_text(WATCHING)
    note = tmp_path / "note"
    note.touch()
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(tmp_path / "hook"), environment()["PYTHONPATH"]]))
    monkeypatch.setenv("FOURPOLE_NOTE", str(note))
    monkeypatch.setenv("MPLCONFIGDIR", str(tmp_path / "fonts"))  # the list of fonts is made anew
    return lambda: note.read_text().splitlines()


def mixed(folder):
    """A small campaign, one recording of which a library reads."""
    simulate_campaign(folder, tyres=[RADIAL_PLY], pressures=[170e3], preloads=[1000.0], frequencies=[10.0, 13.0, 16.0])
    text = folder / "recordings" / "D2.csv"
    pl.read_csv(text).write_parquet(text.with_suffix(".parquet"))
    text.unlink()
    tests = folder / "tests.csv"
    tests.write_text(tests.read_text().replace("D2.csv", "D2.parquet"))


@pytest.mark.sampled(8)
def test_no_process_is_started_but_by_the_door(noted, tmp_path):
    folder = tmp_path / "root" / "one"
    mixed(folder)
    try:
        browser()
        pdf = ["--pdf"]
    except FileError:
        pdf = []
    commands = [
        ["analyse", ".", "--workers", "2", "--tables-only"], ["info", "recordings/D2.parquet"], ["report", ".", *pdf],
        ["fit", ".", "--model", "zener", "--out", "model.json"], ["export", "model.json", "--to", "fmu"],
        ["verify", "."],
    ]  # fmt: skip
    for words in commands:
        ran = subprocess.run(
            [sys.executable, "-P", "-m", "fourpole", *words], cwd=folder, capture_output=True, text=True, check=False
        )
        assert ran.returncode in (0, 3), (words, ran.stderr)
    assert sum("fourpole.io.worker" in line for line in noted()) >= 4
    assert any("git" in line for line in noted()) or shutil.which("git") is None
    assert any("gcc" in line for line in noted()) or not any(map(shutil.which, COMPILERS))
    assert any("chromium" in line or "chrome" in line for line in noted()) or not pdf
    with serving(tmp_path / "root") as server:
        run_in(server, "fit", "--model=zener")
        wait_for(folder / "results" / "model.json")
    assert any("--json" in line for line in noted())
    assert [line for line in noted() if not line.startswith("door ")] == []


def run_in(server: Server, command: str, *options: str) -> None:
    page = server.ask("/")[1].decode()
    (address,) = {part.split('"')[0] for part in page.split('href="')[1:] if part.startswith("/c/")}
    assert server.ask(f"{address}/run", "POST", {"command": command, "options": options})[0] == 204


def wait_for(path: Path) -> None:
    until = time.monotonic() + 120
    while not path.exists():
        assert time.monotonic() < until
        time.sleep(0.1)
