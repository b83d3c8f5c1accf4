"""One hurt test per run: it is its own row with a verdict and a remark that helps, and the other rows do not change."""

from __future__ import annotations

import csv
import os
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import polars as pl
import pytest
from typer.testing import CliRunner

from fourpole.app.cli import app
from fourpole.study import analyse

pytestmark = pytest.mark.thorough

RESULTS = ["R [m/(N s)]", "Re K* [N/m]", "K2 [N/m]", "C [N s/m]", "TR predicted [1]"]


@dataclass(frozen=True)
class Hurt:
    """What is done to test D2 (14 Hz, 1000 N), and what its row must then say."""

    verdict: str
    remarks: tuple[str, ...]
    make: Callable[[Any], object]


def with_column(name: str, make: Callable[[pl.Expr], pl.Expr]) -> Callable[[Any], None]:
    return lambda folder: folder.change("D2", lambda table: table.with_columns(make(pl.col(name)).alias(name)))


def in_row(old: str, new: str) -> Callable[[Any], None]:
    """Exchange a passage of the row of D2 in tests.csv."""
    row = "D2,recordings/D2.csv,dynamic,radial-ply,1.7,1000,14"
    assert old in row
    return lambda folder: folder.edit("tests.csv", row, row.replace(old, new))


def cells(column: int, rows: slice, value: str) -> Callable[[Any], None]:
    return lambda folder: folder.cells("D2", rows, column, value)


def clipped(name: str, *, stated: bool) -> Callable[[Any], None]:
    """Cut the peaks of a channel, at its stated full scale or at some level that nobody states."""
    full = {"F1": 1.0, "V1": 0.25, "V2": 0.5}[name]

    def make(folder: Any) -> None:
        def cut(table: pl.DataFrame) -> pl.DataFrame:
            peak = float(table[name].abs().max())
            level = full if stated else 0.8 * peak
            gain = 1.25 * full / peak if stated else 1.0
            return table.with_columns((gain * pl.col(name)).clip(-level, level).alias(name))

        if not stated:
            said = {"F1": ' range = "1 kN",', "V1": ' range = "0.25 m/s",', "V2": ' range = "0.5 m/s",'}[name]
            folder.edit("campaign.toml", said, "")
        folder.change("D2", cut)

    return make


def with_time(make: Callable[[np.ndarray], np.ndarray]) -> Callable[[Any], None]:
    return lambda folder: folder.change(
        "D2", lambda table: table.with_columns(pl.Series("t", make(table["t"].to_numpy())))
    )


def twice(folder: Any) -> None:
    lines = folder.lines("D2")
    folder.write_lines("D2", [*lines[:100], lines[99], *lines[100:]])


def elsewhere(name: str) -> Callable[[Any], None]:
    """A good recording beside the campaign, and a row that leads to it."""

    def make(folder: Any) -> None:
        outside = folder.path.parent / "outside.csv"
        shutil.copy(folder.recording("D2"), outside)
        if name == "link":
            folder.recording("D2").unlink()
            folder.recording("D2").symlink_to(outside)
        else:
            file = {"dots": "recordings/../../outside.csv", "absolute": str(outside)}[name]
            in_row("recordings/D2.csv", file)(folder)

    return make


def fifo(folder: Any) -> None:
    folder.recording("D2").unlink()
    os.mkfifo(folder.recording("D2"))


def at_its_own_resonance(folder: Any) -> None:
    """D2 on a rig of its own, whose spring and mass resonate at 14 Hz."""
    folder.add_column("rig", {"D2": "resonant"}, default="plain")
    spring = 15.0 * (2 * np.pi * 14.0) ** 2
    rig = f'[rigs.resonant]\nmoving_mass = "15 kg"\npreload_stiffness = "{spring:.8g} N/m"\n'
    folder.edit("campaign.toml", "[rig]", f"{rig}[rigs.plain]")


def not_steady(folder: Any) -> None:
    """Noise in place of the motion at the contact."""
    noise = 0.05 * np.random.default_rng(2).normal(size=4096)
    with_column("V1", lambda _: pl.Series("V1", noise))(folder)


LOOK = "the sensor was off, unplugged, or another column is meant"
AMPLIFIER = "set a larger range on the amplifier and repeat the test"
OUTSIDE = "lies outside the campaign folder: copy it into the folder and name it from there"

HURTS = {
    # the file
    "missing": Hurt(
        "rejected", ("recordings/D2.csv: there is no such file; check its name",), lambda f: f.recording("D2").unlink()
    ),
    "empty": Hurt("rejected", ("recordings/D2.csv: is empty",), lambda f: f.recording("D2").write_bytes(b"")),
    "header only": Hurt(
        "rejected",
        ("recordings/D2.csv: has a header (line 1) but no row below it",),
        lambda f: f.recording("D2").write_text("t,F1,V1,V2\n"),
    ),
    "folder": Hurt(
        "rejected", ("recordings: is a folder; name a file in it",), in_row("recordings/D2.csv", "recordings")
    ),
    "pipe": Hurt("rejected", ("recordings/D2.csv: is a pipe or device; copy what it gives into a file",), fifo),
    "binary": Hurt(
        "rejected",
        ("recordings/D2.csv: is binary, not text; export it as CSV",),
        lambda f: f.recording("D2").write_bytes(b"\x7fELF\x0e\x00\x00\x00" * 500),
    ),
    "dots": Hurt("rejected", (OUTSIDE, "'recordings/../../outside.csv'"), elsewhere("dots")),
    "absolute": Hurt("rejected", (OUTSIDE,), elsewhere("absolute")),
    "link": Hurt("rejected", (OUTSIDE, "'recordings/D2.csv'"), elsewhere("link")),
    "endless name": Hurt("rejected", ("cannot be", "name too long"), in_row("recordings/D2.csv", "D" * 900)),
    # its cells
    "no force": Hurt(
        "rejected",
        ("recordings/D2.csv: there is no column 'F1'",),
        lambda f: f.change("D2", lambda table: table.drop("F1")),
    ),
    "no motion beyond": Hurt(
        "warning",
        ("V2 was left out: recordings/D2.csv: there is no column 'V2'",),
        lambda f: f.change("D2", lambda table: table.drop("V2")),
    ),
    "text in F1": Hurt(
        "rejected",
        ("recordings/D2.csv row 102, column 'F1': 'over' is no number; mend it",),
        cells(1, slice(100, 101), "over"),
    ),
    "text in t": Hurt("rejected", ("recordings/D2.csv row 12, column 't': '1.2.3'",), cells(0, slice(10, 11), "1.2.3")),
    "text in V2": Hurt(
        "warning",
        ("V2 was left out", "recordings/D2.csv row 4097, column 'V2': '#REF!'"),
        cells(3, slice(4095, 4096), "#REF!"),
    ),
    "ragged recording": Hurt(
        "rejected",
        ("recordings/D2.csv row 4097: has 2 cells ('4.095,0.01') where the header has 4",),
        lambda f: f.write_lines("D2", [*f.lines("D2")[:-1], "4.095,0.01"]),
    ),
    "some gaps": Hurt("warning", ("1.2 % of the samples are missing",), cells(1, slice(500, 550), "NaN")),
    "many gaps": Hurt(
        "rejected", ("F1", "29", "of the samples are missing", "record the test again"), cells(1, slice(500, 1700), "")
    ),
    "many gaps of V2": Hurt(
        "warning", ("V2 was left out", "29", "of the samples are missing"), cells(3, slice(500, 1700), "")
    ),
    "no time at one sample": Hurt("rejected", ("time is missing at sample 8",), cells(0, slice(7, 8), "")),
    "constant F1": Hurt("rejected", ("F1", "is constant (102 in SI units)", LOOK), cells(1, slice(0, 4096), "0.1")),
    "constant V1": Hurt("rejected", ("V1", "is constant (0 in SI units)", LOOK), cells(2, slice(0, 4096), "0")),
    "constant V2": Hurt("warning", ("V2 was left out", "is constant (0.1 ", LOOK), cells(3, slice(0, 4096), "0.1")),
    # its length and its clock
    "two samples": Hurt(
        "rejected",
        ("recordings/D2.csv has 2 samples, at least 16 are needed: record three cycles or more",),
        lambda f: f.write_lines("D2", f.lines("D2")[:3]),
    ),
    "one sample": Hurt("rejected", ("1 samples are too few",), lambda f: f.write_lines("D2", f.lines("D2")[:2])),
    "less than three cycles": Hurt(
        "rejected",
        ("cycles of 1", "at least 3 are needed: record longer"),
        lambda f: f.write_lines("D2", f.lines("D2")[:182]),
    ),
    "jitter": Hurt(
        "warning",
        ("time stamps are up to 2", "taken as clock jitter", "state sample_rate in campaign.toml, if not, resample"),
        with_time(lambda t: np.round(t + np.random.default_rng(0).uniform(-2e-4, 2e-4, t.size), 6)),
    ),
    "jump": Hurt(
        "rejected",
        (
            "time is not uniform: the interval after sample 1000 (at 0.999 s) is 0.101 s",
            "resample, cut with window [s]",
        ),
        lambda f: f.write_lines("D2", f.lines("D2")[:1001] + f.lines("D2")[1101:]),
    ),
    "another rate": Hurt(
        "rejected", ("time is not uniform", "the rate changed"), with_time(lambda t: np.where(t > 2, 2 * t - 2, t))
    ),
    "reversed": Hurt("rejected", ("time runs backwards", "in order of time"), with_time(lambda t: t[::-1])),
    "twice": Hurt("rejected", ("time does not increase at sample 100 (from 0.098 s", "without repeated stamps"), twice),
    # its frequency
    "stated 3 % off": Hurt(
        "warning",
        ("the recording turns at 14.02 Hz, 14.42 Hz is stated (2.8% off): correct the frequency",),
        in_row("14", "14.42"),
    ),
    "stated 20 % off": Hurt(
        "rejected",
        ("the recording turns at 14.02 Hz, 16.8 Hz is stated (16.5% off)", "the right file"),
        in_row("14", "16.8"),
    ),
    "no frequency stated": Hurt("ok", (), in_row(",14", ",")),
    "noise for V1": Hurt("rejected", ("V1",), not_steady),
    "at the rig's resonance": Hurt(
        "rejected",
        ("14.02 Hz is the rig's own resonance", "K* is poorly determined; test at another frequency, or with another"),
        at_its_own_resonance,
    ),
    # the channels and the tyre
    **{
        f"{name} clipped, range {'stated' if stated else 'unknown'}": Hurt(
            "warning" if name == "V2" else "rejected",
            (f"{name} is clipped: " if name != "V2" else "V2 was left out: V2 is clipped: ", AMPLIFIER),
            clipped(name, stated=stated),
        )
        for name in ("F1", "V1", "V2")
        for stated in (True, False)
    },
    "lift-off": Hurt(
        "rejected",
        (
            "the dynamic force reaches 260.9 N, 104% of the preload of 250 N",
            "the specimen lifts off; test with a higher preload or a smaller excitation",
        ),
        in_row("1000", "250"),
    ),
    "near lift-off": Hurt(
        "warning", ("95% of the preload of 275 N: the specimen is close to lifting off",), in_row("1000", "275")
    ),
    "inverted F1": Hurt("rejected", ("inverted",), with_column("F1", lambda one: -one)),
    "half of F1": Hurt("warning", ("F1 is 0.5 times", "wrongly scaled F1"), with_column("F1", lambda one: 0.5 * one)),
    "K' below K1": Hurt(
        "warning",
        ("no passive K2 exists: K' = ", "is not above the static K1 = 200 kN/m", "a K1 taken at another load"),
        lambda f: f.add_column("K1 [N/m]", {"D2": "200000"}),
    ),
    # the row of tests.csv
    "unknown tyre": Hurt(
        "rejected",
        ("tests.csv row 4: tyre 'radail-ply' is not in campaign.toml; did you mean 'radial-ply'?",),
        in_row("radial", "radail"),
    ),
    "unheard-of tyre": Hurt(
        "rejected",
        ("tests.csv row 4: tyre 'slick' is not in campaign.toml; add [tyres.slick]",),
        in_row("radial-ply", "slick"),
    ),
    "no tyre": Hurt(
        "rejected", ("tests.csv row 4: the specimen is not named: fill in the column 'tyre'",), in_row("radial-ply", "")
    ),
    "no file": Hurt(
        "rejected",
        ("tests.csv row 4: no recording is named: fill in the column 'file'",),
        in_row("recordings/D2.csv", ""),
    ),
    "unknown kind": Hurt(
        "rejected",
        ("tests.csv row 4: kind 'dinamic' is not known; did you mean 'dynamic'?",),
        in_row("dynamic", "dinamic"),
    ),
    "no kind": Hurt(
        "rejected", ("tests.csv row 4: kind '' is not known; it must be static or dynamic",), in_row("dynamic", "")
    ),
    "row too short": Hurt(
        "rejected", ("tests.csv row 4: has 6 cells, 7 columns are named: check its commas",), in_row(",14", "")
    ),
    "decimal comma": Hurt(
        "rejected", ("tests.csv row 4: has 8 cells, 7 columns are named: check its commas",), in_row("1.7", "1,7")
    ),
    "word for a number": Hurt(
        "rejected", ("tests.csv row 4: preload: 'lots' does not begin with a number",), in_row("1000", "lots")
    ),
    "negative preload": Hurt(
        "rejected",
        ("tests.csv row 4: preload: -1000 N must be positive for a specimen that only stands on the rig",),
        in_row("1000", "-1000"),
    ),
    "unit of another kind": Hurt(
        "rejected", ("tests.csv row 4: preload: ", "'mm' is a length; a force is needed"), in_row("1000", "10 mm")
    ),
    "much text": Hurt("rejected", ("tests.csv row 4: 'preload' has 5000 characters",), in_row("1000", "1" * 5000)),
}


def rows_of(path):
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


#: A route that takes each test by itself, so that the others may not change by a bit.
ALONE = ("--tables-only", "--route", "mobility")


@pytest.fixture(scope="module")
def sound(noisy_campaign, tmp_path_factory):
    """The results of the campaign before anything is hurt."""
    out = tmp_path_factory.mktemp("unhurt")
    words = ["analyse", str(noisy_campaign), "--out", str(out), *ALONE]
    assert CliRunner().invoke(app, words).exit_code == 0
    return out


@pytest.fixture(scope="module")
def unhurt(sound):
    return {row["test"]: row for row in rows_of(sound / "dynamic.csv")}


@pytest.mark.parametrize("name", HURTS)
@pytest.mark.sampled(6)
def test_a_hurt_test_is_a_row_that_says_why_and_the_others_do_not_change(noisy, sound, unhurt, name):
    """The phasors of unchanged recordings come from the cache, as in a second run after a file was replaced."""
    if name == "pipe" and not hasattr(os, "mkfifo"):
        pytest.skip("this system has no pipes among its files")
    hurt = HURTS[name]
    hurt.make(noisy)
    shutil.copytree(sound / "cache", noisy.path / "results" / "cache")
    ran = CliRunner().invoke(app, ["analyse", str(noisy.path), *ALONE])
    assert ran.exit_code == (3 if hurt.verdict == "rejected" else 0), ran.output
    assert "Traceback" not in ran.output
    rows = {row["test"]: row for row in rows_of(noisy.path / "results" / "dynamic.csv")}
    assert list(rows) == ["D1", "D2", "D3", "D4"]
    row = rows["D2"]
    assert row["verdict"] == hurt.verdict, row["remarks"]
    assert [part for part in hurt.remarks if part not in row["remarks"]] == [], row["remarks"]
    assert (row["remarks"] == "") == (hurt.verdict == "ok")
    assert str(noisy.path) not in row["remarks"]
    if hurt.verdict == "rejected" and name != "inverted F1":
        assert {row[column] for column in RESULTS} == {""}
    elif hurt.verdict != "rejected" and name != "K' below K1":
        assert "" not in {row[column] for column in RESULTS}
    if hurt.verdict != "ok":
        assert f"{hurt.verdict}: D2: " in ran.stderr
    for test in ("D1", "D3", "D4"):
        kept = {column: cell for column, cell in rows[test].items() if column in unhurt[test] and column != "rig"}
        assert kept == {column: cell for column, cell in unhurt[test].items() if column != "rig"}


@pytest.mark.parametrize("name", ["missing", "inverted F1", "constant V1", "constant V2", "V1 clipped, range stated"])
@pytest.mark.sampled(5)
def test_together_too_the_others_hardly_change(noisy, noisy_campaign, name):
    """Found together, the other tests lose what the hurt one told of the rig, and no more than their uncertainty."""
    before = analyse(noisy_campaign).dynamic
    HURTS[name].make(noisy)
    after = noisy.analyse().dynamic
    assert after["route"].to_list() == ["joint"] * 4
    for i in (0, 2, 3):
        assert after["verdict"][i] == before["verdict"][i]
        for part in ("Re K*", "Im K*"):
            u = max(before[f"u({part}) [N/m]"][i], after[f"u({part}) [N/m]"][i])
            assert after[f"{part} [N/m]"][i] == pytest.approx(before[f"{part} [N/m]"][i], abs=2 * u)


@pytest.mark.parametrize("name", ["inverted F1", "K' below K1"])
def test_a_test_without_a_passive_answer_keeps_what_was_measured(noisy, unhurt, name):
    HURTS[name].make(noisy)
    row = noisy.analyse(route="mobility").dynamic.row(1, named=True)
    assert row["verdict K2 C"] == "rejected"
    assert row["K2 [N/m]"] is row["C [N s/m]"] is row["u(K2) [N/m]"] is row["corr(K2,C) [1]"] is None
    kept = ["R [m/(N s)]", "u(I) [m/(N s)]", "Re K* [N/m]", "u(Im K*) [N/m]", "loss factor [1]", "TR measured [1]"]
    assert None not in {row[column] for column in kept}


@pytest.mark.parametrize("route", ["relative", "transmissibility"])
@pytest.mark.parametrize("channel", ["F1", "V1", "V2"])
@pytest.mark.sampled(2)
def test_what_a_route_can_spare_only_warns(noisy, route, channel):
    noisy.cells("D2", slice(0, 4096), ("t", "F1", "V1", "V2").index(channel), "0.1")
    row = noisy.analyse(route=route).dynamic.row(1, named=True)
    spared = route == "transmissibility" and channel == "F1"
    assert row["verdict"] == ("warning" if spared else "rejected")
    assert (f"{channel} was left out" in row["remarks"]) == spared
    assert (row["K2 [N/m]"] is not None) == spared


def test_a_spared_channel_costs_the_others_nothing(noisy, unhurt):
    """F1 and V1 say the same with V2 or without it, but for the frequency that all three share."""
    noisy.change("D2", lambda table: table.drop("V2"))
    row = noisy.analyse(route="mobility").dynamic.row(1, named=True)
    for column in RESULTS[:-1]:
        assert row[column] == pytest.approx(float(unhurt["D2"][column]), rel=1e-5)
    assert row["V2 [m/s]"] is row["TR measured [1]"] is row["phase V2-V1 [rad]"] is None


def test_gaps_cost_accuracy_within_the_stated_uncertainty(noisy, unhurt):
    noisy.cells("D2", slice(1000, 1400), 2, "")
    row = noisy.analyse(route="mobility").dynamic.row(1, named=True)
    assert row["verdict"] == "warning"
    for name, std in (("Re K* [N/m]", "u(Re K*) [N/m]"), ("Im K* [N/m]", "u(Im K*) [N/m]")):
        assert row[name] == pytest.approx(float(unhurt["D2"][name]), abs=3 * row[std])


def test_all_tests_hurt_are_all_rows(noisy):
    for path in (noisy.path / "recordings").iterdir():
        path.unlink()
    ran = CliRunner().invoke(app, ["analyse", str(noisy.path), "--tables-only"])
    assert ran.exit_code == 3
    for name, count in (("static.csv", 1), ("dynamic.csv", 4)):
        rows = rows_of(noisy.path / "results" / name)
        assert [row["verdict"] for row in rows] == ["rejected"] * count
    assert "5 tests, 0 ok, 0 with a warning, 5 rejected" in ran.stdout
