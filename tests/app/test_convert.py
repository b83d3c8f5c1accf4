"""`fourpole convert`: what it writes and says, and that a campaign of converted recordings gives the same numbers."""

from __future__ import annotations

import re

import numpy as np
import polars as pl
import pytest

from fourpole.app.info import run_convert
from fourpole.study import analyse
from fourpole.virtual import RADIAL_PLY, simulate_campaign

COLUMNS = ("K1 [N/m]", "Re K* [N/m]", "Im K* [N/m]", "TR measured [1]", "frequency [Hz]", "K2 [N/m]", "C [N s/m]")


@pytest.fixture
def table(tmp_path):
    path = tmp_path / "D1.csv"
    time = np.arange(2000) / 1000
    wave = np.sin(2 * np.pi * 12 * time)
    pl.DataFrame({"t [s]": time, "F1 [N]": 50 * wave, "V1 [m/s]": 0.07 * wave}).write_csv(path)
    return path


def test_it_says_what_it_wrote(run, table, tmp_path):
    ran = run("convert", table, tmp_path / "D1.mf4", "--window", "0.5..1.5")
    assert (ran.exit_code, ran.stderr) == (0, "")
    assert ran.stdout.splitlines() == [f"{tmp_path / 'D1.mf4'}: ASAM MDF 4.10", "  1001 samples at 1000 Hz (F1, V1)"]
    told = run_convert(table, tmp_path / "cut.csv", window="0.5..1.5").told
    assert (told["file"], told["groups"]) == (str(tmp_path / "cut.csv"), ("1001 samples at 1000 Hz (F1, V1)",))


def test_it_warns_of_what_is_lost(run, table, tmp_path):
    table.write_text("Operator: A. Tester\n\n" + table.read_text())
    ran = run("convert", table, tmp_path / "b.csv", "--channels", "V1, F1")
    assert ran.exit_code == 0
    assert "warning: notes are not kept (1 of the file)" in " ".join(ran.stderr.split())


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (["D1.csv"], "is the file that is read"),
        (["D1.xlsx"], "its ending is none of those that are written"),
        (["D1.tdms"], "it is written by npTDMS, or LabVIEW"),
        (["out.mf4", "--channels", "F3"], "there is no channel 'F3'; did you mean 'F1'?"),
        (["out.mf4", "--group", "warm"], "has no groups"),
        (["out.mf4", "--window", "3"], "--window: '3' is not two rising values, as in '2..12'"),
        (["out.mf4", "--window", "3..5"], "no samples from 3 to 5 s"),
        (["out.mf4", "--to", "doc"], "known are csv, parquet, mf4"),
    ],
)
def test_what_cannot_be_done_is_one_message(run, table, tmp_path, more, said):
    ran = run("convert", table, tmp_path / more[0], *more[1:])
    assert (ran.exit_code, ran.stdout) == (2, "")
    assert said in " ".join(ran.stderr.split())
    assert list(tmp_path.iterdir()) == [table]


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """A clean campaign, and what its tables of text give."""
    folder = simulate_campaign(
        tmp_path_factory.mktemp("recorded"),
        tyres=[RADIAL_PLY],
        pressures=[170e3],
        preloads=[1000.0],
        frequencies=[12.0, 20.0],
        clean=True,
    ).folder
    return folder, analyse(folder).dynamic


@pytest.mark.parametrize("ending", ["csv", "parquet", "mf4"])
@pytest.mark.sampled(2)
def test_a_converted_campaign_gives_the_same_numbers(run, recorded, tmp_path, ending):
    folder, before = recorded
    (tmp_path / "campaign.toml").write_text((folder / "campaign.toml").read_text())
    (tmp_path / "recordings").mkdir()
    for path in (folder / "recordings").iterdir():
        assert run("convert", path, tmp_path / "recordings" / f"{path.stem}.{ending}").exit_code == 0
    tests = (folder / "tests.csv").read_text()
    (tmp_path / "tests.csv").write_text(re.sub(r"(recordings/\w+)\.csv", rf"\1.{ending}", tests))
    after = analyse(tmp_path).dynamic
    assert after["verdict"].to_list() == before["verdict"].to_list()
    for column in COLUMNS:
        np.testing.assert_allclose(after[column], before[column], rtol=1e-9)
