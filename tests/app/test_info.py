"""`fourpole info`: what a file holds, or one clear message."""

from __future__ import annotations

import json
import os
import subprocess
import sys

import numpy as np
import polars as pl
import pytest

from fourpole.app.info import line, picture
from fourpole.io import stream as streaming
from fourpole.io.look import look_at
from fourpole.io.recordings import survey

RATE, COUNT = 1000.0, 4000


@pytest.fixture
def logged(tmp_path):
    nptdms = pytest.importorskip("nptdms")
    path = tmp_path / "log.bin"
    with nptdms.TdmsWriter(path) as file:
        data = {"wf_increment": 0.001, "unit_string": "N"}
        file.write_segment([nptdms.ChannelObject("warm", "F1\x1b[31m", np.zeros(500), data)])
        file.write_segment([nptdms.ChannelObject("test", "F1", np.arange(2000.0), data)])
    return path


@pytest.fixture
def table(tmp_path):
    """A force of 12.3 Hz that is missing in places, a slow load, and a time that jumps once."""
    time = np.arange(COUNT) / RATE
    time[3000:] += 0.5
    force = 3.0 + 50 * np.sin(2 * np.pi * 12.3 * np.arange(COUNT) / RATE)
    force[[10, 700, 701, 702]] = np.nan
    path = tmp_path / "D1.csv"
    columns = {"t [ms]": 1e3 * time, "F1 [N]": force, "load [kN]": np.linspace(0, 2, COUNT)}
    pl.DataFrame(columns).fill_nan(None).write_csv(path)
    return path


def test_it_lists_groups_channels_units_and_rates(run, logged):
    ran = run("info", logged)
    assert (ran.exit_code, ran.stderr) == (0, "")
    lines = ran.stdout.splitlines()
    assert lines[0].startswith("log.bin: NI TDMS")
    assert "test: 2000 samples at 1000 Hz, 0 to 1.999 s" in lines
    assert any(line.split()[:5] == ["F1", "N", "0", "1999", "577.35"] for line in lines)
    assert "\x1b" not in ran.stdout


def test_it_shows_ranges_gaps_lines_and_times(run, table):
    text = run("info", table).stdout
    lines = text.splitlines()
    assert "4000 samples at 1000 Hz, 0 to 4.499 s, times from t" in lines
    assert "  ! the time jumps once; the longest step is 0.501 s" in lines
    assert "    ! 4 of 4000 samples are missing, at most 3 in a row" in lines
    (force,) = (line.split() for line in lines if line.startswith("  F1 "))
    assert force[1] == "N"
    np.testing.assert_allclose([float(one) for one in force[2:6]], [-47, 53, 50 / np.sqrt(2), 12.3], rtol=1e-3)
    assert set(force[6]) <= {chr(code) for code in range(0x2800, 0x2900)}


def test_for_programs_it_is_one_document(run, table, logged):
    found = json.loads(run("info", logged, "--json").stdout)
    assert found["file"] == "log.bin"
    assert [(signal["group"], signal["count"], signal["rate"]) for signal in found["signals"]] == [
        ("warm", 500, 1000.0),
        ("test", 2000, 1000.0),
    ]
    _, force, load = json.loads(run("info", table, "--json").stdout)["signals"]
    assert force["clock"] == "t"
    assert (force["missing"], force["longest_gap"], force["jumps"], force["stops"]) == (4, 3, 1, 0)
    assert force["frequency"] == pytest.approx(12.3, rel=1e-4)
    assert (load["least"], load["greatest"], load["mean"], load["frequency"]) == (0, 2, pytest.approx(1), None)
    assert load["duration"] == pytest.approx(4.499)


def test_quick_reads_no_samples(run, table, monkeypatch):
    monkeypatch.setattr("fourpole.app.info.look_at", None)
    ran = run("info", table, "--quick")
    assert ran.exit_code == 0
    assert ran.stdout.splitlines()[-5:] == [
        "4000 samples",
        "  channel  unit",
        "  t        ms",
        "  F1       N",
        "  load     kN",
    ]
    assert "greatest" not in json.loads(run("info", table, "--quick", "--json").stdout)["signals"][0]


def test_without_a_plot_there_are_numbers_only(run, table):
    assert run("info", table, "--no-plot").stdout.isascii()


def test_one_channel_is_drawn_large(run, table):
    lines = run("info", table, "--channel", "LOAD").stdout.splitlines()
    drawn = [line for line in lines if "│" in line]
    assert len(drawn) == 10
    assert drawn[0].split()[:2] == ["2", "kN"]
    assert drawn[-1].split()[:2] == ["0", "kN"]
    assert max(map(len, drawn)) <= 150
    assert lines[-1].split() == ["0", "s", "4.499", "s"]
    assert not any("F1" in line for line in lines)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--channel", "F2"], "there is no channel 'F2'; did you mean 'F1'?"),
        (["--group", "tests"], "there is no group 'tests'; did you mean 'test'?"),
    ],
)
def test_what_is_not_there_is_told(run, logged, options, said):
    ran = run("info", logged, *options)
    assert (ran.exit_code, ran.stdout) == (2, "")
    assert said in " ".join(ran.stderr.split())


def test_a_group_by_itself(run, logged):
    found = json.loads(run("info", logged, "--group", "warm", "--json").stdout)["signals"]
    assert [one["count"] for one in found] == [500]


@pytest.mark.sampled(4)
def test_a_terminal_without_braille_gets_plain_signs(table):
    done = subprocess.run(
        [sys.executable, "-c", "from fourpole.app.cli import main; main()", "info", str(table)],
        env={**os.environ, "PYTHONIOENCODING": "ascii", "PYTHONUTF8": "0", "NO_COLOR": "1"},
        capture_output=True,
        check=True,
    )
    (load,) = (line for line in done.stdout.decode("ascii").splitlines() if line.startswith("  load "))
    assert set(load.split()[-1]) <= set("_,-'\"|")
    assert load.split()[-1].startswith("____")
    assert load.split()[-1].endswith('"""')


def test_an_outline_is_where_the_values_are():
    rise = np.stack([np.linspace(0, 1, 8)] * 2, axis=1)
    assert line(rise, 8, dots=False) == '___--"""'
    assert picture(rise, 8, 2, dots=False) == ["    ####", "####"]
    assert line(rise, 4, dots=True) == "⣀⠤⠒⠉"
    whole = np.array([[-1.0, 1.0]] * 4)
    assert line(whole, 4, dots=True) == "⣿⣿⣿⣿"
    assert line(np.array([[0.0, 1.0], [np.nan, np.nan]]), 2, dots=False) == "|"
    assert line(np.full((3, 2), np.nan), 2, dots=False) == ""
    assert line(np.full((3, 2), 7.0), 2, dots=False) == "--"


def test_of_many_channels_the_first_are_read(run, tmp_path):
    path = tmp_path / "many.csv"
    pl.DataFrame({"t": np.arange(30) / 100} | {f"c{at} [V]": np.full(30, at + 0.5) for at in range(99)}).write_csv(path)
    ran = run("info", path)
    assert ran.stdout.splitlines()[-1] == (
        "only the first 64 of 100 channels were read; name others with --group or --channel"
    )
    assert "98.5" in run("info", path, "--channel", "c98").stdout


def test_a_channel_that_cannot_be_read_does_not_harm_the_others(run, tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("t [s],F1 [N],V1\n" + "".join(f"{k / 100},{k},{'x' if k == 70 else k}\n" for k in range(90)))
    lines = run("info", path).stdout.splitlines()
    assert any(line.split()[:4] == ["F1", "N", "0", "89"] for line in lines)
    assert any("not read" in line and "'x'" in line for line in lines)


@pytest.mark.parametrize("column", ["time [ms]", "Zeit (ms)", "stamp [ms]", "X_Value"])
def test_a_table_is_found_its_times(run, tmp_path, column):
    scale = 1000.0 if "ms" in column else 1.0
    path = tmp_path / "a.csv"
    pl.DataFrame({column: scale * np.arange(300) / 200, "F1 [N]": np.ones(300)}).write_csv(path)
    assert "300 samples at 200 Hz, 0 to 1.495 s, times from" in run("info", path).stdout


def test_row_numbers_are_no_times(run, tmp_path):
    path = tmp_path / "a.csv"
    pl.DataFrame({"n": np.arange(300), "F1 [N]": np.ones(300)}).write_csv(path)
    said = "300 samples, without times: state sample_rate or a column of times in campaign.toml"
    assert said in run("info", path).stdout.splitlines()


def test_pieces_show_what_the_whole_shows(table, monkeypatch):
    found = survey(table)
    whole = look_at(table, found, range(3))
    monkeypatch.setattr(streaming, "_AT_ONCE", 1)
    monkeypatch.setattr(streaming, "_LEAST_ROWS", 701)  # a gap of three goes over the edge of the first piece
    pieces = look_at(table, found, range(3))
    for at in range(3):
        for name, value in vars(whole[at]).items():
            if isinstance(value, float | np.ndarray):
                np.testing.assert_allclose(getattr(pieces[at], name), value, rtol=1e-12)
            else:
                assert getattr(pieces[at], name) == value, name


def test_the_outline_holds_every_peak(tmp_path):
    samples = np.zeros(100_000)
    samples[[7, 50_001, 99_999]] = 5.0, -3.0, 2.0
    path = tmp_path / "a.csv"
    pl.DataFrame({"t": np.arange(100_000) / 1e4, "F": samples}).write_csv(path)
    outline = look_at(path, survey(path), [1])[1].outline
    assert [outline[0, 1], outline[512, 0], outline[-1, 1]] == [5.0, -3.0, 2.0]
    assert np.count_nonzero(outline) == 3


@pytest.mark.parametrize(
    ("content", "said"),
    [(None, "there is no such file"), (b"", "is empty"), (b"\x00\x01\x02" * 99, "is binary, not text")],
)
def test_what_cannot_be_read_is_one_message(run, tmp_path, content, said):
    path = tmp_path / "file"
    if content is not None:
        path.write_bytes(content)
    ran = run("info", path)
    assert (ran.exit_code, ran.stdout) == (2, "")
    assert said in ran.stderr
    assert len(ran.stderr.splitlines()) == 1
