"""The command as users run it: as a process where the process matters, else in this one."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from click.testing import Result
from tests.kept import kept
from typer.testing import CliRunner

from fourpole.app.cli import app
from fourpole.virtual import RADIAL_PLY, simulate_campaign

#: The command as it was installed beside this Python.
FOURPOLE = shutil.which("fourpole", path=str(Path(sys.executable).parent)) or "fourpole"
ENVIRONMENT = {
    **{name: value for name, value in os.environ.items() if not name.startswith(("FOURPOLE_", "COV_"))},
    "OPENBLAS_NUM_THREADS": "1",
    "PYTHONIOENCODING": "utf-8",
    "NO_COLOR": "1",
}


@pytest.fixture(scope="session")
def start() -> Callable[..., subprocess.Popen[str]]:
    """Start the installed command and do not wait for it."""

    def starting(*arguments: object, cwd: Path | None = None) -> subprocess.Popen[str]:
        return subprocess.Popen(
            [FOURPOLE, *map(str, arguments)],
            cwd=cwd,
            env=ENVIRONMENT,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            encoding="utf-8",
        )

    return starting


@pytest.fixture(scope="session")
def fourpole(start: Callable[..., subprocess.Popen[str]]) -> Callable[..., subprocess.CompletedProcess[str]]:
    """Run the installed command to its end."""

    def running(*arguments: object, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
        process = start(*arguments, cwd=cwd)
        try:
            out, err = process.communicate(timeout=600)
        except BaseException:
            process.kill()
            raise
        return subprocess.CompletedProcess(arguments, process.returncode, out, err)

    return running


@pytest.fixture(scope="session")
def run() -> Callable[..., Result]:
    """Run the command in this process."""

    def running(*arguments: object) -> Result:
        ran = CliRunner().invoke(app, [*map(str, arguments)])
        assert ran.exception is None or isinstance(ran.exception, SystemExit), ran.exception
        return ran

    return running


@pytest.fixture(scope="session")
def terminal() -> Callable[..., str]:
    """Run the command in a terminal of some columns, and give what it shows, standard error included."""
    pty = pytest.importorskip("pty")

    def showing(columns: int, *arguments: object) -> str:
        process, screen = pty.fork()
        if process == 0:
            os.environ["COLUMNS"] = str(columns)
            os.execv(sys.executable, [sys.executable, "-m", "fourpole", *map(str, arguments)])
        shown = b""
        while part := _read(screen):
            shown += part
        os.waitpid(process, 0)
        os.close(screen)
        text = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", shown.decode())
        return "\n".join(line.rpartition("\r")[2] for line in text.replace("\r\n", "\n").split("\n"))

    return showing


def _read(screen: int) -> bytes:
    try:
        return os.read(screen, 65536)
    except OSError:  # Linux ends so
        return b""


@pytest.fixture(scope="session")
def small_campaign(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One static test and three dynamic ones of one tyre."""
    return simulate_campaign(
        tmp_path_factory.mktemp("small"),
        tyres=[RADIAL_PLY],
        pressures=[170e3],
        preloads=[1000.0],
        frequencies=[10.0, 17.0, 24.0],
    ).folder


@pytest.fixture
def without_figures(monkeypatch: pytest.MonkeyPatch) -> None:
    """A report is written without figures: drawing takes most of its time, and tests of figures draw them."""
    monkeypatch.setattr("fourpole.app.report.save_figures", lambda *_, **__: {})


@pytest.fixture
def campaign(small_campaign: Path, tmp_path: Path) -> Path:
    """A copy of the small campaign to change."""
    return shutil.copytree(small_campaign, tmp_path / "campaign")


@pytest.fixture(scope="session")
def demonstration(
    fourpole: Callable[..., subprocess.CompletedProcess[str]],
) -> tuple[Path, subprocess.CompletedProcess[str]]:
    """The folder that `fourpole demo` leaves, and what it printed; tests change nothing there."""

    def make(place: Path) -> None:
        place.mkdir()
        ran = fourpole("demo", cwd=place)
        (place / "ran.json").write_text(json.dumps([ran.returncode, ran.stdout, ran.stderr]))

    place = kept("demonstration", make)
    return place / "fourpole-demo", subprocess.CompletedProcess("demo", *json.loads((place / "ran.json").read_text()))
