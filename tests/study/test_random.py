"""Random tests in a campaign: lines as rows, the weighed mass, and what is wrong in tests.csv."""

from __future__ import annotations

import shutil

import numpy as np
import polars as pl
import pytest
from tests import random_rig

from fourpole import analyse
from fourpole.campaign.folder import read_campaign
from fourpole.study.check import check_campaign

CHANNEL = '{{ column = "{}", unit = "{}", std_gain = "3 %", std_phase = "1 deg" }}'
STATED = f"""
[unstated]
ordinary = "zero"
[rig]
moving_mass = {{ value = 15.2, unit = "kg", std = 0.3 }}
preload_stiffness = {{ value = 12.2, unit = "kN/m", std = 0.3 }}
[channels]
time = {{ column = "t", unit = "s" }}
force_in = {CHANNEL.format("F1", "N")}
motion_in = {CHANNEL.format("V1", "m/s")}
motion_out = {CHANNEL.format("V2", "m/s")}
[specimens.mount]
"""
GAINS = (1.03, 0.97, 1.02)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Two random tests, without and with 10 kg, by sensors whose gains are off by 3 %."""
    place = tmp_path_factory.mktemp("random")
    (place / "campaign.toml").write_text(STATED)
    rows = ["test,file,kind,specimen,frequency [Hz],K1 [N/m],u(K1) [N/m],added_mass [kg],u(added_mass) [kg]"]
    for at, added in enumerate((0, 10)):
        time, *signals = random_rig.run(30 + at, coherence=0.999, added=added)
        signals = [gain * one for gain, one in zip(GAINS, signals, strict=True)]
        table = dict(zip(("t", "F1", "V1", "V2"), (time, *signals), strict=True))
        pl.DataFrame(table).write_parquet(place / f"R{at}.parquet")
        rows.append(f"R{at},R{at}.parquet,random,mount,5:200,120e3,100,{added},{0.001 if added else 0}")
    (place / "tests.csv").write_text("\n".join(rows) + "\n")
    return place


@pytest.fixture(scope="module")
def study(folder):
    return analyse(folder, monte_carlo=0)


@pytest.mark.sampled(2)
def test_a_weighed_mass_gives_the_scale_of_all_lines(study):
    table = study.dynamic.filter(pl.col("verdict") != "rejected")
    assert table.height > 300
    true = random_rig.stiffness(2 * np.pi * table["frequency [Hz]"].to_numpy())
    for part, of in (("Re", true.real), ("Im", true.imag)):
        pulls = (table[f"{part} K* [N/m]"].to_numpy() - of) / table[f"u({part} K*) [N/m]"].to_numpy()
        assert np.sqrt(np.mean(pulls**2)) < 1.4  # the errors that all lines share make one draw of the mean
    assert np.median(table["u(Re K*) [N/m]"].to_numpy() / true.real) < 0.005
    found = {row["value"]: row for row in study.rig.to_dicts()}
    for name, value in (("moving_mass", 15.0), ("preload_stiffness", 12440.0), ("gain F1/V1", GAINS[0] / GAINS[1])):
        assert abs(found[name]["found"] - value) < 4.0 * found[name]["u(found)"]


def test_each_line_is_a_row_with_its_spectra(study):
    keys = ["test", "point"]
    assert study.lines.select(keys).equals(study.dynamic.select(keys))
    assert study.lines["coherence F1-V1 [1]"].median() > 0.99
    assert study.counts["rejected"] == 0
    assert study.previews["test"].to_list() == ["R0", "R1"]
    ends = np.array(study.previews["F1 residual"][0].to_list())
    assert np.nanmax(ends) > 750.0
    assert np.nanmin(ends) < -750.0
    assert study.dynamic["deflection amplitude [m]"].round(9).n_unique() == 2


def test_a_sweep_is_a_test_of_the_campaign(folder, tmp_path):
    rows = (folder / "tests.csv").read_text().splitlines()
    (tmp_path / "campaign.toml").write_text(STATED.replace("3 %", "0.1 %").replace("1 deg", "0.1 deg"))
    (tmp_path / "tests.csv").write_text(f"{rows[0]}\nW,W.parquet,sweep,mount,5:200,120e3,100,0,0\n")
    time = np.arange(60_000) / 1000.0
    motion = np.sin(2 * np.pi * np.cumsum(4.0 + 3.6 * time) / 1000.0)
    signals = random_rig.answered(motion, 1000.0, time.size, noise=0.003, damping=0.0)
    pl.DataFrame(dict(zip(("t", "F1", "V1", "V2"), signals, strict=True))).write_parquet(tmp_path / "W.parquet")
    table = analyse(tmp_path, monte_carlo=0, route="relative").dynamic.filter(pl.col("verdict") != "rejected")
    true = random_rig.stiffness(2 * np.pi * table["frequency [Hz]"].to_numpy())
    pulls = (table["Re K* [N/m]"].to_numpy() - true.real) / table["u(Re K*) [N/m]"].to_numpy()
    assert table.height > 200
    assert np.sqrt(np.mean(pulls**2)) < 1.2


def test_the_report_and_the_check_take_random_tests(folder, study, tmp_path):
    assert check_campaign(read_campaign(folder)).problems == ()
    study.write(tmp_path)
    assert (tmp_path / "lines.csv").is_file()


@pytest.mark.parametrize(
    ("kind", "frequency", "said"),
    [
        ("random", "12", "needs the band of its excitation"),
        ("random", "", "needs the band of its excitation"),
        ("dynamic", "5:200", "a band is for kind random or sweep"),
        ("random", "200:5", "not two rising, positive frequencies"),
        ("random", "0.2:5 kHz", ""),
        ("rondom", "5:200", "did you mean 'random'"),
    ],
)
def test_a_slip_in_the_row_is_named(tmp_path, kind, frequency, said):
    (tmp_path / "campaign.toml").write_text(STATED)
    (tmp_path / "tests.csv").write_text(f"test,file,kind,specimen,frequency [Hz]\nR,r.csv,{kind},mount,{frequency}\n")
    (test,) = read_campaign(tmp_path).tests
    assert said in test.problem
    assert bool(test.problem) is bool(said)
    if not said:
        assert test.band == (200.0, 5000.0)


def test_a_clipped_force_rejects_all_lines(folder, tmp_path):
    table = pl.read_parquet(folder / "R0.parquet")
    limit = 1.5 * table["F1"].std()
    table.with_columns(pl.col("F1").clip(-limit, limit)).write_parquet(tmp_path / "R0.parquet")
    rows = (folder / "tests.csv").read_text().splitlines()
    (tmp_path / "campaign.toml").write_text(STATED)
    (tmp_path / "tests.csv").write_text("\n".join(rows[:2]) + "\n")
    found = analyse(tmp_path, monte_carlo=0)
    assert found.dynamic.height > 100
    assert set(found.dynamic["verdict"]) == {"rejected"}
    assert found.dynamic["remarks"].str.contains("clipped").all()


@pytest.mark.parametrize(("k1", "wrong"), [(120e3, False), (40e3, True)])
def test_k1_is_doubted_where_most_lines_doubt_it(folder, tmp_path, k1, wrong):
    """With noise, some lines have a small loss factor beside a large K'; a K1 of another specimen is above most."""
    signals = random_rig.run(40, coherence=0.8)
    pl.DataFrame(dict(zip(("t", "F1", "V1", "V2"), signals, strict=True))).write_parquet(tmp_path / "R0.parquet")
    row = (folder / "tests.csv").read_text().splitlines()[:2]
    (tmp_path / "campaign.toml").write_text(STATED)
    (tmp_path / "tests.csv").write_text("\n".join(row).replace("120e3", str(k1)) + "\n")
    checks = analyse(tmp_path, monte_carlo=0).checks.filter(pl.col("code") == "K1 against K'")
    assert ("warning" in checks["verdict"]) is wrong


@pytest.mark.parametrize(("column", "left"), [("command", ""), ("flat", "constant"), ("gone", "gone")])
@pytest.mark.sampled(3)
def test_a_drive_is_used_where_it_can_be(folder, tmp_path, column, left):
    rng = np.random.default_rng(41)
    table = pl.read_parquet(folder / "R0.parquet")
    command = table["V1"].to_numpy() + 0.01 * table["V1"].std() * rng.normal(size=table.height)
    table.with_columns(command=command, flat=pl.lit(1.0)).write_parquet(tmp_path / "R0.parquet")
    rows = (folder / "tests.csv").read_text().splitlines()[:2]
    (tmp_path / "tests.csv").write_text("\n".join(rows) + "\n")
    stated = STATED.replace("[channels]", f'[channels]\ndrive = "{column}"')
    (tmp_path / "campaign.toml").write_text(stated)
    found = analyse(tmp_path, monte_carlo=0)
    assert found.counts["rejected"] == 0
    seen = found.lines["coherence drive-V1 [1]"].is_finite()
    assert seen.all() if not left else not seen.any()
    said = " ".join(found.dynamic["remarks"].to_list())
    assert ("drive was left out" in said) is bool(left)
    assert left in said


def signals_of(what, signals, rng):
    """The signals of a random test with one channel that is wired wrong."""
    f1, v1, v2 = signals
    return {"V2 off": (f1, v1, 1e-6 * rng.normal(size=v2.size)), "V2 is V1": (f1, v1, v1)}[what]


@pytest.mark.parametrize(
    ("what", "said"), [("V2 off", "V2 (motion_out) has nothing in common"), ("V2 is V1", "have the same samples")]
)
@pytest.mark.sampled(2)
def test_a_channel_that_is_wired_wrong_is_named_and_the_other_test_goes_on(folder, tmp_path, what, said):
    table = pl.read_parquet(folder / "R0.parquet")
    table.write_parquet(tmp_path / "R0.parquet")
    wrong = signals_of(what, [table[name].to_numpy() for name in ("F1", "V1", "V2")], np.random.default_rng(5))
    table.with_columns(F1=wrong[0], V1=wrong[1], V2=wrong[2]).write_parquet(tmp_path / "R1.parquet")
    shutil.copy(folder / "tests.csv", tmp_path)
    (tmp_path / "campaign.toml").write_text(STATED)
    found = analyse(tmp_path, monte_carlo=0)
    assert found.counts["rejected"] == 1
    of = dict(zip(found.dynamic["test"], found.dynamic["remarks"], strict=True))
    assert said in of["R1"]
    assert found.dynamic.filter(pl.col("test") == "R0").height > 100
