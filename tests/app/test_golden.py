"""The wording of each command on one small campaign: one golden file for each, with a sign in place of numbers.

    FOURPOLE_GOLDEN=write python -m pytest tests/app/test_golden.py

writes the files anew; read what changed before it is kept. Numbers and widths may differ between machines, and have
tests of their own.
"""

import os
import re
import shutil
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from tests.app.conftest import ENVIRONMENT
from tests.fitting.test_shifting import table as isotherms
from tests.kept import kept
from typer.main import get_command

from fourpole import __main__ as main
from fourpole.app.cli import app
from fourpole.app.group import groups_of
from fourpole.virtual import RADIAL_PLY, simulate_campaign

pytestmark = pytest.mark.usefixtures("without_figures")

GOLDEN = Path(__file__).parent / "golden"
AT = ("--pressure", "2.2 bar", "--preload", "1 kN")
RIG = ("--mass", "15 kg", "--preload-stiffness", "12.44 kN/m")
TYRE = ("--k1", "110 kN/m", "--k2", "100 kN/m", "--c", "800 N s/m")
#: The commands and their arguments; `lab` is the campaign and `later` another of the same specimen.
COMMANDS = {
    "init": ("raw",),
    "analyse": ("lab",),
    "report": ("lab",),
    "plot": ("lab", "K2", "--over", "frequency", "--out", "k2.svg"),
    "rig": ("lab",),
    "compare": ("lab", "later"),
    "export": ("lab", "--to", "prony", "--out", "prony.csv"),
    "lab": (".",),
    "fit": ("lab", "--model", "zener"),
    "map": ("lab", "--model", "zener"),
    "query": ("lab", *AT, "--frequency", "15 Hz"),
    "ride": ("lab", "--road", "C", "--speed", "80 km/h"),
    "causality": ("lab",),
    "shift": ("isotherms.csv", "--reference", "20 degC"),
    "verify": ("lab",),
    "check": ("lab",),
    "plan": (*RIG, *TYRE, "--frequency", "10:24:7 Hz", "--added-mass", "10 kg", "--out", "plan"),
    "static": ("lab/recordings/S1.csv", "--load", "1 kN", "--column", "deflection=x [mm]", "--column", "load=F [N]"),
    "stiffness": ("bench.csv",),
    "identify": ("lab/results/dynamic.csv", "--k1", "110 kN/m"),
    "predict": (*RIG, *TYRE, "--frequency", "10, 16, 24 Hz"),
    "info": ("lab/recordings/D1.csv",),
    "convert": ("lab/recordings/D1.csv", "D1.parquet"),
    "twoport": ("lab",),
}
#: Commands with a process, a browser or a wait of their own, whose tests stand elsewhere.
ELSEWHERE = {"app", "demo", "open", "selftest", "simulate", "watch"}


def bench(path):
    """An actuator's sines of 1, 5 and 20 Hz on a spring with a damper."""
    parts = []
    for f in (1.0, 5.0, 20.0):
        wave = np.exp(2j * np.pi * f * np.arange(20_000) / 2000.0)
        parts += [np.zeros(1000), wave]
    wave = np.concatenate(parts)
    noise = np.random.default_rng(3).standard_normal((2, wave.size))
    force = (wave * (200 + 30j)).imag + 0.01 * noise[0]
    table = {"t [s]": np.arange(wave.size) / 2000.0, "Kraft [N]": force, "Weg [mm]": wave.imag + 1e-5 * noise[1]}
    pl.DataFrame(table).write_csv(path)


def campaign(folder, seed):
    simulate_campaign(
        folder, seed=seed, tyres=[RADIAL_PLY], pressures=[1.7e5, 2.2e5], preloads=[1000.0],
        frequencies=[10.0, 16.0, 24.0], added_masses=(0.0, 10.0),
        added_mass_at=("radial-ply", 1.7e5, 1000.0),
    )  # fmt: skip


@pytest.fixture(scope="module")
def place(run):
    """Folder with two analysed campaigns of one specimen, the recordings of one of them, and isotherms."""

    def make(folder):
        for name, seed in (("lab", 5), ("later", 6)):
            campaign(folder / name, seed)
            assert run("analyse", folder / name, "--tables-only").exit_code == 0
        for command in ("fit", "map"):
            assert run(command, folder / "lab", "--model", "zener").exit_code == 0
        shutil.copytree(folder / "lab" / "recordings", folder / "raw")
        isotherms(folder / "isotherms.csv")
        bench(folder / "bench.csv")

    return kept("golden", make)


def plain(text):
    """Words and layout alone: numbers as a sign, blanks and rules as one of them."""
    text = re.sub(r" \(commit [^)]*\)", "", re.sub(r"[⠀-⣿]+", "~", text))
    text = re.sub(r"(?<![A-Za-z0-9])[−-]?[0-9][0-9.,]*(?:e[-+]?[0-9]+)?", "#", text)
    lines = (re.sub(r"([ ─━═·-])[ ─━═·-]+", r"\1", line).rstrip() for line in text.splitlines())
    return "".join(f"{line}\n" for line in lines)


def test_each_command_has_its_words_here_or_its_tests_elsewhere():
    names = get_command(app).list_commands(None)
    assert sorted(names) == sorted({*COMMANDS, *ELSEWHERE})
    assert groups_of(names)
    assert {path.stem for path in GOLDEN.glob("*.txt")} == {*COMMANDS}


@pytest.mark.parametrize("command", COMMANDS)
def test_a_command_says_what_it_said(run, place, tmp_path, monkeypatch, command):
    folder = shutil.copytree(place, tmp_path / "of")
    monkeypatch.chdir(folder)
    ran = run(command, *COMMANDS[command])
    said = f"{plain(ran.stdout)}--- exit code {ran.exit_code}, standard error\n{plain(ran.stderr)}"
    golden = GOLDEN / f"{command}.txt"
    if os.environ.get("FOURPOLE_GOLDEN") == "write":
        golden.write_text(said, encoding="utf-8")
    assert said == golden.read_text(encoding="utf-8")


def test_the_help_that_is_kept_is_that_of_the_command_line():
    kept_help = Path(main.__file__).with_name("help.txt")
    code = "import sys; sys.argv = ['fourpole', '--help']; from fourpole.app.cli import main; main()"
    ran = subprocess.run(
        [sys.executable, "-c", code], env={**ENVIRONMENT, "COLUMNS": "80"}, capture_output=True, check=True
    )
    if os.environ.get("FOURPOLE_GOLDEN") == "write":
        kept_help.write_bytes(ran.stdout)
    assert kept_help.read_bytes() == ran.stdout


@pytest.mark.parametrize(("columns", "kept"), [("", True), ("80", True), ("200", True), ("60", False), ("x", True)])
def test_a_narrow_terminal_has_a_help_of_its_own(monkeypatch, capsys, columns, kept):
    monkeypatch.setenv("COLUMNS", columns)
    monkeypatch.setattr("sys.argv", ["fourpole", "--help"])
    with suppress(SystemExit):
        main.main()
    said = capsys.readouterr().out
    assert (said == Path(main.__file__).with_name("help.txt").read_text(encoding="utf-8")) == kept
