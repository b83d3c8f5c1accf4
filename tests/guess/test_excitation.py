"""What the signals of a folder say: random or a sweep, the mean of F1, a far side that stands still."""

from __future__ import annotations

import numpy as np
import polars as pl
import pytest

from fourpole.campaign import read_campaign
from fourpole.errors import CampaignError
from fourpole.guess import guess_campaign
from fourpole.guess.signals import excitation_of

RATE = 500.0
T = np.arange(int(60 * RATE)) / RATE


def band_limited(low, high, power=0.0, seed=1):
    """Noise in a band; its amplitude spectrum is proportional to the frequency to a power."""
    lines = np.fft.rfft(np.random.default_rng(seed).standard_normal(T.size))
    frequency = np.fft.rfftfreq(T.size, 1 / RATE)
    inside = (frequency >= low) & (frequency <= high)
    lines *= np.where(inside, np.maximum(frequency, low) ** power, 0.0)
    noise = np.fft.irfft(lines, T.size)
    return noise / noise.std()


def swept(low, high, *, logarithmic):
    if logarithmic:
        rate = np.log(high / low) / T[-1]
        return np.sin(2 * np.pi * low / rate * (np.exp(rate * T) - 1))
    return np.sin(2 * np.pi * (low * T + 0.5 * (high - low) / T[-1] * T**2))


@pytest.mark.parametrize(
    ("signal", "derivative", "kind", "band"),
    [
        (band_limited(5, 100), 0, "random", (5, 100)),
        (band_limited(2, 40), 1, "random", (2, 40)),
        (band_limited(3, 60, power=-1), 1, "random", (3, 60)),
        (band_limited(5, 100) + 0.01 * np.random.default_rng(2).standard_normal(T.size), 0, "random", (5, 100)),
        (swept(5, 100, logarithmic=True), 0, "sweep", (5, 100)),
        (swept(4, 80, logarithmic=False), 1, "sweep", (4, 80)),
        (np.sin(2 * np.pi * 10 * T), 0, None, None),
        (np.sin(2 * np.pi * 10 * T) + np.sin(2 * np.pi * 17 * T), 0, None, None),
        (np.where((T > 20) & (T < 20.05), 1.0, 0.0), 0, None, None),
        (np.exp(-((T - 30) ** 2)) * np.sin(2 * np.pi * 20 * T), 0, None, None),
    ],
)
def test_random_and_sweep_are_told_from_the_rest(signal, derivative, kind, band):
    found = excitation_of(signal, RATE, derivative)
    assert (found and found[0]) == kind
    if band is not None:
        window = T[-1] * 2 / 33
        # two bins of the spectrum, and of a sweep what a window hardly sees: its first half
        resolved = 2 / window + (0.5 * window * (band[1] - band[0]) / T[-1] if kind == "sweep" else 0.0)
        assert found[1] == pytest.approx(band, abs=resolved)


def record(folder, name, columns):
    pl.DataFrame(columns).write_csv(folder / f"{name}.csv")


def sine(frequency, *, mean=0.0, far=0.5):
    """F1, V1 and V2 of a spring of 200 kN/m under a sinusoid."""
    t = np.arange(4000) / 1000
    v1 = 0.05 * np.cos(2 * np.pi * frequency * t)
    x = 0.05 * np.sin(2 * np.pi * frequency * t) / (2 * np.pi * frequency)
    f1 = mean + 200e3 * (1 - far) * x + 2e3 * (1 - far) * v1
    return {"t [s]": t, "F1 [N]": f1, "V1 [m/s]": v1, "V2 [m/s]": far * v1}


def test_a_random_recording_has_its_band_and_a_doubt(tmp_path):
    v1 = band_limited(5, 100)
    record(tmp_path, "mount_random", {"t [s]": T, "F1 [N]": 100 * v1, "V1 [m/s]": v1, "V2 [m/s]": 0.3 * v1})
    record(tmp_path, "mount_x", {"t [s]": T, "F1 [N]": 100 * v1, "V1 [m/s]": v1, "V2 [m/s]": 0.3 * v1})
    guess = guess_campaign(tmp_path)
    assert [row.kind for row in guess.rows] == ["random", "random"]
    doubts = {row.name: [text for about, text in row.doubts if about == "kind"] for row in guess.rows}
    assert doubts["mount_random"] == []
    assert "its signals show random excitation from 5" in doubts["mount_x"][0]
    guess.write()
    test = read_campaign(tmp_path).tests[0]
    assert test.problem == ""
    assert test.band == pytest.approx((5, 100), rel=0.1)


@pytest.mark.parametrize(
    ("head", "doubt"),
    [
        ("Sollweg [mm]", ""),
        ("Force command [kN]", ""),
        ("consigne", ""),
        ("指令 [V]", ""),
        ("Drive [V]", "known by the word drive alone: check that it is the command signal"),
    ],
)
def test_a_command_signal_is_the_drive_and_no_measured_role(tmp_path, head, doubt):
    v1 = band_limited(5, 100)
    columns = {"t [s]": T, head: 900 * v1, "F1 [N]": 100 * v1, "V1 [m/s]": v1, "V2 [m/s]": 0.3 * v1}
    for name in ("mount_random_a", "mount_random_b"):
        record(tmp_path, name, {column: values[: int(16 * RATE)] for column, values in columns.items()})
    guess = guess_campaign(tmp_path)
    roles = {role: one.column for role, one in guess.roles.items()}
    name = head.partition(" [")[0]
    assert roles == {"force_in": "F1", "motion_in": "V1", "motion_out": "V2", "drive": name}
    doubts = [one.text for one in guess.doubts if one.about == "drive"]
    assert doubts == ([f"drive, column '{name}': {doubt}"] if doubt else [])
    guess.write()
    assert read_campaign(tmp_path).stated.channels.drive.column == name


def test_a_command_signal_beside_sinusoids_is_no_drive(tmp_path):
    record(tmp_path, "mount_10Hz", {"Sollkraft [N]": 3 * sine(10.0)["F1 [N]"], **sine(10.0)})
    assert {role: one.column for role, one in guess_campaign(tmp_path).roles.items()} == {
        "force_in": "F1",
        "motion_in": "V1",
        "motion_out": "V2",
    }


def test_a_stated_band_counts_and_one_that_is_not_there_is_doubted(tmp_path):
    v1 = band_limited(5, 100)
    for name in ("a_random_4-110Hz", "a_random_50-240Hz"):
        record(tmp_path, name, {"t [s]": T, "F1 [N]": 100 * v1, "V1 [m/s]": v1, "V2 [m/s]": 0.3 * v1})
    rows = {row.name: row for row in guess_campaign(tmp_path).rows}
    assert rows["a_random_4-110Hz"].band == (4.0, 110.0)
    assert "frequency" not in dict(rows["a_random_4-110Hz"].doubts)
    assert "its spectrum shows 5" in dict(rows["a_random_50-240Hz"].doubts)["frequency"]


def test_the_mean_of_f1_is_the_preload_where_none_is_stated(tmp_path):
    for at, load in enumerate((1000.0, 1004.0, 1500.0)):
        record(tmp_path, f"radial_{'abc'[at]}", sine(10.0 + at, mean=load))
    record(tmp_path, "radial_d_700N", sine(14.0, mean=1000.0))
    record(tmp_path, "radial_e", sine(15.0))
    rows = {row.name: row for row in guess_campaign(tmp_path).rows}
    assert rows["radial_a"].values["preload"] == rows["radial_b"].values["preload"] == pytest.approx(1000, rel=0.005)
    assert rows["radial_c"].values["preload"] == pytest.approx(1500, rel=0.005)
    assert "the mean of F1" in dict(rows["radial_a"].doubts)["preload"]
    assert rows["radial_d_700N"].values["preload"] == 700.0
    assert dict(rows["radial_e"].doubts)["preload"] == "not known"


@pytest.mark.parametrize(("far", "says"), [(0.001, "V2 is 0.1 % of V1"), (None, "no V2 is recorded"), (0.5, "")])
def test_a_far_side_that_stands_still_is_asked_about(tmp_path, far, says):
    columns = sine(10.0, far=far or 0.0)
    if far is None:
        del columns["V2 [m/s]"]
    record(tmp_path, "mount_10Hz", columns)
    guess = guess_campaign(tmp_path)
    doubts = [doubt for doubt in guess.doubts if doubt.about == "far side"]
    assert [says in doubt.text for doubt in doubts] == ([True] if says else [])
    guess.write()
    text = (tmp_path / "campaign.toml").read_text()
    assert ('# output            = "blocked"' in text) == bool(says)
    if says:
        (tmp_path / "campaign.toml").write_text(text.replace("# output ", "[rig]\noutput "))
        assert read_campaign(tmp_path).stated.all_rigs[""].output == "blocked"


def test_newtons_and_metres_per_second_go_before_volts(tmp_path):
    columns = sine(10.0, mean=500.0)
    columns = {
        "t [s]": columns.pop("t [s]"),
        "Force [V]": 9.0 * columns["F1 [N]"],
        "v1 [V]": columns["V1 [m/s]"] * 50,
        **columns,
    }
    record(tmp_path, "mount_10Hz", columns)
    roles = guess_campaign(tmp_path).roles
    assert {role: (one.column, one.unit) for role, one in roles.items()} == {
        "force_in": ("F1", "N"),
        "motion_in": ("V1", "m/s"),
        "motion_out": ("V2", "m/s"),
    }


def test_a_pattern_takes_the_place_of_the_guess(tmp_path):
    for name in ("A7_2,1bar_run3_10Hz", "B7_2,1bar_run4_10Hz", "odd"):
        record(tmp_path, name, sine(10.0))
    guess = guess_campaign(tmp_path, patterns=["{specimen}_{pressure}bar_{}_{frequency}Hz"])
    rows = {row.name: row for row in guess.rows}
    assert {name: (row.tyre, row.values.get("pressure")) for name, row in rows.items()} == {
        "A7_2.1bar_run3_10Hz": ("A7", pytest.approx(210e3)),
        "B7_2.1bar_run4_10Hz": ("B7", pytest.approx(210e3)),
        "odd": ("unnamed", None),
    }
    (doubt,) = [doubt for doubt in guess.doubts if doubt.about == "names"]
    assert "'odd.csv'" in doubt.text
    with pytest.raises(CampaignError, match="matches the name of no recording; the first one is 'A7_2,1bar_run3_10Hz"):
        guess_campaign(tmp_path, patterns=["{specimen}_{pressure}psi"])


def test_tests_are_named_after_their_files(tmp_path):
    for place in ("1.7 bar", "2,4 bar"):
        (tmp_path / place).mkdir()
        record(tmp_path, f"{place}/Reifen A größer 10Hz", sine(10.0))
    assert [row.name for row in guess_campaign(tmp_path).rows] == [
        "1.7 bar Reifen A größer 10Hz",
        "2.4 bar Reifen A größer 10Hz",
    ]


@pytest.mark.parametrize(
    ("signal", "kind", "cycles"),
    [(band_limited(0.7, 100), "random", 66.0), (swept(0.6, 100, logarithmic=True), "sweep", 84.0)],
)
def test_the_band_begins_where_the_recording_is_long_enough_for_its_analysis(signal, kind, cycles):
    found = excitation_of(signal, RATE)
    assert found is not None
    assert found[0] == kind
    assert cycles < found[1][0] * 60 < 1.15 * cycles
