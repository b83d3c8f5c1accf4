"""Channels as laboratories leave them: whatever the unit, the gain, the sensor or the clock, the same tyre is found."""

import numpy as np
import polars as pl
import pytest

pytestmark = pytest.mark.thorough

F = 14.0
G = 9.80665


#: What [channels] says of a role, and the columns that the recording then has, from F1, V1, V2 as waves.
CASES = {
    "displacement in mm": (
        {"motion_in": '{ column = "x1", unit = "mm" }', "motion_out": '{ column = "x2", unit = "mm" }'},
        lambda t, f1, v1, v2: {"x1": 1e3 * v1(t, -1), "x2": 1e3 * v2(t, -1)},
    ),
    "acceleration in g": (
        {"motion_in": '{ column = "a1", unit = "g" }', "motion_out": '{ column = "a2", unit = "g" }'},
        lambda t, f1, v1, v2: {"a1": v1(t, 1) / G, "a2": v2(t, 1) / G},
    ),
    "one motion of each kind": (
        {"motion_in": '{ column = "x1", unit = "µm" }', "motion_out": '{ column = "a2", unit = "m/s²" }'},
        lambda t, f1, v1, v2: {"x1": 1e6 * v1(t, -1), "a2": v2(t, 1)},
    ),
    "force in kN": ({"force_in": '{ column = "F", unit = "kN" }'}, lambda t, f1, v1, v2: {"F": 1e-3 * f1(t)}),
    "gain": ({"force_in": '{ column = "F1", unit = "N", gain = 1.25 }'}, lambda t, f1, v1, v2: {"F1": f1(t) / 1.25}),
    "negative gain": (
        {"force_in": '{ column = "F1", unit = "N", gain = -2 }'},
        lambda t, f1, v1, v2: {"F1": f1(t) / -2.0},
    ),
    "offset in the column's unit": (
        {"force_in": '{ column = "F1", unit = "kN", gain = 2.0, offset = 0.4, range = 1.0 }'},
        lambda t, f1, v1, v2: {"F1": 0.5e-3 * f1(t) + 0.4},
    ),
    "offset with a unit of its own": (
        {"force_in": '{ column = "F1", unit = "kN", gain = 2.0, offset = "400 N", range = "1 kN" }'},
        lambda t, f1, v1, v2: {"F1": 0.5e-3 * f1(t) + 0.4},
    ),
    "sensitivity in mV/g, volts recorded": (
        {"motion_out": '{ column = "a2", sensitivity = "98.3 mV/g", offset = 2.5, range = 10.0 }'},
        lambda t, f1, v1, v2: {"a2": 98.3e-3 * v2(t, 1) / G + 2.5},
    ),
    "sensitivity in mV/g, millivolts recorded": (
        {"motion_out": '{ column = "a2", unit = "mV", sensitivity = "98.3 mV/g", gain = 0.1, range = "90 V" }'},
        lambda t, f1, v1, v2: {"a2": 10 * 98.3 * v2(t, 1) / G},
    ),
    "sensitivity of a force cell": (
        {"force_in": '{ column = "U", sensitivity = "4 mV/N", unit = "V", invert = true }'},
        lambda t, f1, v1, v2: {"U": -4e-3 * f1(t)},
    ),
    "sensitivity upside down": (
        {"force_in": '{ column = "U", sensitivity = "250 N/V" }'},
        lambda t, f1, v1, v2: {"U": f1(t) / 250.0},
    ),
    "inverted": ({"motion_in": '{ column = "V1", unit = "m/s", invert = true }'}, lambda t, f1, v1, v2: {"V1": -v1(t)}),
    "inverted with an offset": (
        {"motion_in": '{ column = "V1", unit = "mm/s", invert = true, offset = 30, range = 200 }'},
        lambda t, f1, v1, v2: {"V1": -1e3 * v1(t) + 30.0},
    ),
    "late": (
        {"motion_in": '{ column = "V1", unit = "m/s", delay = "3 ms" }'},
        lambda t, f1, v1, v2: {"V1": v1(t - 3e-3)},
    ),
    "early and late": (
        {
            "force_in": '{ column = "F1", unit = "N", delay = "250 us" }',
            "motion_out": '{ column = "V2", unit = "m/s", delay = "-1 ms" }',
        },
        lambda t, f1, v1, v2: {"F1": f1(t - 250e-6), "V2": v2(t + 1e-3)},
    ),
    "time in ms": ({"time": '{ column = "ms", unit = "ms" }'}, lambda t, f1, v1, v2: {"ms": 1e3 * t}),
    "time of day": ({"time": '{ column = "t", unit = "s" }'}, lambda t, f1, v1, v2: {"t": t + 45296.0}),
}


def record(bench, said, make, frequency=F, **state):
    """One test with some channels as `said`, the others plain."""
    f1, v1, v2 = bench.waves(frequency, **state)
    plain = {"t": bench.time, "F1": f1(bench.time), "V1": v1(bench.time), "V2": v2(bench.time)}
    bench.channels |= {
        role: text.replace(" }", ", exact = true }") if role != "time" else text for role, text in said.items()
    }
    return bench.record("D1", {**plain, **make(bench.time, f1, v1, v2)})


def is_the_tyre(bench, row, frequency=F, verdict="ok", **state):
    """Whether a row has the K2, C, TR, amplitudes and phases of the bench."""
    f1, v1, v2 = (wave.amplitude for wave in bench.waves(frequency, **state))
    assert row["verdict"] == verdict, row["remarks"]
    assert row["frequency [Hz]"] == pytest.approx(frequency, rel=1e-9)
    assert [row["F1 [N]"], row["V1 [m/s]"], row["V2 [m/s]"]] == pytest.approx([abs(f1), abs(v1), abs(v2)], rel=1e-7)
    assert row["phase F1-V1 [rad]"] == pytest.approx(np.angle(f1 / v1), abs=1e-7)
    assert row["phase V2-V1 [rad]"] == pytest.approx(np.angle(v2 / v1), abs=1e-7)
    assert [row["K2 [N/m]"], row["C [N s/m]"]] == pytest.approx([bench.k2, bench.c], rel=1e-6)
    assert row["TR measured [1]"] == pytest.approx(abs(v2 / v1), rel=1e-8)
    assert row["TR predicted [1]"] == pytest.approx(abs(v2 / v1), rel=1e-8)


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("route", ["mobility", "transmissibility"])
@pytest.mark.sampled(4)
def test_whatever_the_channels_say_the_same_tyre_is_found(bench, case, route):
    said, make = CASES[case]
    bench.row("D1", record(bench, said, make), "1000,110000")
    is_the_tyre(bench, bench.found(route=route))


@pytest.mark.parametrize("where", ["channels", "time"])
def test_a_sample_rate_takes_the_place_of_a_time_column(bench, where):
    f1, v1, v2 = bench.waves(F)
    time = np.arange(6000) / 2000.0
    del bench.channels["time"]
    rate = {"channels": ("sample_rate", '"2 kHz"'), "time": ("time", '{ sample_rate = "2000 Hz" }')}[where]
    bench.channels = dict([rate]) | bench.channels
    bench.row("D1", bench.record("D1", {"F1": f1(time), "V1": v1(time), "V2": v2(time)}), "1000,110000")
    is_the_tyre(bench, bench.found())


@pytest.mark.parametrize(
    ("said", "row"), [("2..3", 1), ("1.9..3.1", 1), ("2 s .. 3000 ms", 1), ("0..1", 2), ("0,0..1,0", 2)]
)
def test_a_window_takes_its_part_of_the_recording(bench, said, row):
    """Test 1 from 2 s on, test 2 up to 1 s, and between them a machine that is being set."""
    bench.time = np.arange(3200) / 1000.0
    f1, v1, v2 = bench.waves(F if row == 1 else 10.0)
    inside = bench.time >= 1.9 if row == 1 else bench.time <= 1.0
    rest = np.random.default_rng(1).normal(size=bench.time.size)
    columns = {name: np.where(inside, wave(bench.time), rest) for name, wave in (("F1", f1), ("V1", v1), ("V2", v2))}
    bench.columns = (*bench.columns, "window [s]")
    bench.row("D1", bench.record("D1", {"t": bench.time, **columns}), f'1000,110000,"{said}"')
    found = bench.found()
    is_the_tyre(bench, found, F if row == 1 else 10.0)
    low, _, high = found["window [s]"].partition("..")
    assert [float(low), float(high)] == {1: [1.9, 3.1] if "1.9" in said else [2.0, 3.0], 2: [0.0, 1.0]}[row]


def test_a_window_in_milliseconds_and_without_a_time_column(bench):
    f1, v1, v2 = bench.waves(F)
    junk = np.where(bench.time < 1.0, 5.0, 0.0)
    del bench.channels["time"]
    bench.channels["sample_rate"] = '"1 kHz"'
    bench.columns = (*bench.columns, "window [ms]")
    file = bench.record("D1", {"F1": f1(bench.time) + junk, "V1": v1(bench.time), "V2": v2(bench.time)})
    bench.row("D1", file, "1000,110000,1000..2999")
    is_the_tyre(bench, bench.found())


@pytest.mark.parametrize(
    ("said", "remark"),
    [
        ("7..9", "window 7..9 s holds no samples: the recording runs 0 to 2.999 s"),
        ("2", "'2' is no window: write it as 2..12"),
        ("3..2", "'3..2' ends before it starts"),
        ("1..x", "'x' does not begin with a number"),
        ("1..1.1", "at least 3 are needed: record longer"),
    ],
)
def test_a_window_that_cannot_be_used_is_named(bench, said, remark):
    bench.columns = (*bench.columns, "frequency [Hz]", "window [s]")
    bench.dynamic("D1", f"1000,110000,14,{said}")
    found = bench.found()
    assert found["verdict"] == "rejected"
    assert remark in found["remarks"]


@pytest.mark.parametrize(
    ("header", "said", "differ"),
    [
        ("V1 [mm/s]", "m/s", True),
        ("V1 (mm/s)", "m/s", True),
        ("V1 [m/s]", "mm/s", True),
        ("V1 [m/s]", "m/s", False),
        ("V1 [m s^-1]", "m/s", False),
        ("V1 [left]", "m/s", False),
    ],
)
def test_the_unit_in_the_file_is_held_against_that_of_the_campaign(bench, header, said, differ):
    f1, v1, v2 = (wave(bench.time) for wave in bench.waves(F))
    bench.channels["motion_in"] = f'{{ column = "V1", unit = "{said}", exact = true }}'
    bench.row("D1", bench.record("D1", {"t": bench.time, "F1": f1, header: v1, "V2": v2}), "1000,110000")
    found = bench.found()
    assert (found["verdict"] == "rejected") == differ
    if differ:
        unit = header[4:-1]
        assert f"column 'V1' is in '{unit}' by the file, in '{said}' by campaign.toml" in found["remarks"]
    else:
        is_the_tyre(bench, found)


def test_a_unit_of_another_kind_in_the_file_is_no_agreement(bench):
    f1, v1, v2 = (wave(bench.time) for wave in bench.waves(F))
    bench.row("D1", bench.record("D1", {"t": bench.time, "F1 [N]": f1, "V1 [mm]": v1, "V2 [m/s]": v2}), "1000,110000")
    found = bench.found()
    assert found["verdict"] == "rejected"
    assert "'mm'" in found["remarks"]


@pytest.mark.parametrize(("header", "said"), [("t [ms]", "s"), ("t [s]", "ms")])
def test_the_unit_of_the_time_is_held_against_the_file_too(bench, header, said):
    f1, v1, v2 = (wave(bench.time) for wave in bench.waves(F))
    bench.channels["time"] = f'{{ column = "t", unit = "{said}" }}'
    bench.row("D1", bench.record("D1", {header: bench.time, "F1": f1, "V1": v1, "V2": v2}), "1000,110000")
    found = bench.found()
    assert found["verdict"] == "rejected"
    assert "column 't' is in" in found["remarks"]


def test_a_unit_row_and_a_german_export_are_read(bench):
    f1, v1, v2 = (wave(bench.time) for wave in bench.waves(F))
    body = "\r\n".join(
        ";".join(repr(float(x)).replace(".", ",") for x in row) for row in np.stack([bench.time, f1, v1, v2], axis=1)
    )
    (bench.path / "recordings").mkdir()
    text = f"Prüfstand 2, Öl 20 °C\r\n\r\nt;F1;V1;V2\r\ns;N;m/s;m/s\r\n{body}\r\n"
    (bench.path / "recordings" / "D1.txt").write_bytes(text.encode("latin-1"))
    bench.row("D1", "recordings/D1.txt", "1000,110000")
    is_the_tyre(bench, bench.found())


def test_each_test_is_reduced_with_the_rig_that_its_row_names(bench):
    heavy = bench.rig.replace("[rig]", "[rigs.heavy]").replace("value = 15,", "value = 25,", 1)
    bench.rig = bench.rig.replace("[rig]", "[rigs.light]") + heavy
    bench.columns = (*bench.columns, "rig")
    bench.dynamic("D1", "1000,110000,light", mass=15.0)
    bench.dynamic("D2", "1000,110000,heavy", mass=25.0)
    bench.dynamic("D3", "1000,110000,light", mass=15.0, frequency=10.0)
    study = bench.analyse()
    assert study.dynamic["rig"].to_list() == ["light", "heavy", "light"]
    for row, mass, frequency in zip(study.dynamic.rows(named=True), (15.0, 25.0, 15.0), (F, F, 10.0), strict=True):
        is_the_tyre(bench, row, frequency, mass=mass)


def test_the_only_rig_need_not_be_named(bench):
    bench.rig = bench.rig.replace("[rig]", "[rigs.north]")
    bench.dynamic("D1")
    found = bench.found()
    assert found["rig"] == "north"
    is_the_tyre(bench, found)


def test_without_a_rig_the_default_route_is_the_relative_one_and_said(bench):
    bench.rig = ""
    bench.dynamic("D1")
    study = bench.analyse()
    assert study.route == "relative"
    assert any("no rig is stated" in note for note in study.notes)
    assert study.dynamic["K2 [N/m]"][0] == pytest.approx(bench.k2, rel=1e-8)


def test_the_relative_route_needs_no_rig_and_predicts_no_transmissibility(bench):
    bench.rig = ""
    bench.dynamic("D1")
    found = bench.found(route="relative")
    assert found["verdict"] == "ok"
    assert [found["K2 [N/m]"], found["C [N s/m]"]] == pytest.approx([bench.k2, bench.c], rel=1e-6)
    assert found["TR measured [1]"] == pytest.approx(bench.transmissibility(F), rel=1e-8)
    assert found["TR predicted [1]"] is None


@pytest.mark.parametrize(
    ("rig", "remark"),
    [
        ("haevy", "tests.csv row 2: rig 'haevy' is not in campaign.toml"),
        ("", "tests.csv row 2: several rigs are stated: name one of them in the column 'rig'"),
    ],
)
def test_a_test_on_no_rig_of_several_is_rejected(bench, rig, remark):
    bench.rig = bench.rig.replace("[rig]", "[rigs.light]") + bench.rig.replace("[rig]", "[rigs.heavy]")
    bench.columns = (*bench.columns, "rig")
    bench.dynamic("D1", f"1000,110000,{rig}")
    found = bench.found()
    assert found["verdict"] == "rejected"
    assert remark in found["remarks"]


def test_a_static_test_belongs_to_no_rig(bench):
    bench.rig = bench.rig.replace("[rig]", "[rigs.light]") + bench.rig.replace("[rig]", "[rigs.heavy]")
    bench.channels |= {
        "load": '{ column = "F", unit = "N", exact = true }',
        "deflection": '{ column = "x", unit = "m", exact = true }',
    }
    travel = np.linspace(0.0, 0.03, 200)
    bench.row("S1", bench.record("S1", {"x": travel, "F": 110e3 * travel}), ",,", kind="static")
    bench.columns = (*bench.columns, "rig")
    bench.dynamic("D1", "1000,,light")
    is_the_tyre(bench, bench.found(), verdict="warning")  # of one branch


def test_a_blocked_rig_has_no_motion_beyond_and_no_transmissibility(bench):
    bench.rig = '[rig]\noutput = "blocked"\n'
    del bench.channels["motion_out"]
    bench.dynamic("D1", "1000,110000", blocked=True)
    found = bench.found()
    assert found["verdict"] == "ok"
    stiffness = bench.stiffness(F)
    assert [found["Re K* [N/m]"], found["Im K* [N/m]"]] == pytest.approx([stiffness.real, stiffness.imag], rel=1e-7)
    assert [found["K2 [N/m]"], found["C [N s/m]"]] == pytest.approx([bench.k2, bench.c], rel=1e-6)
    assert {found[name] for name in found if name.startswith(("TR", "u(TR", "V2", "phase V2"))} == {None}


def test_an_added_mass_is_taken_from_the_row(bench):
    bench.columns = (*bench.columns, "added_mass [g]", "u(added_mass) [g]")
    bench.dynamic("D1", "1000,110000,,", mass=15.0)
    bench.dynamic("D2", "1000,110000,10000,", mass=25.0)
    bench.dynamic("D3", "1000,110000,10000,50", mass=25.0)
    rows = bench.analyse(route="mobility").dynamic.rows(named=True)
    assert [row["added mass [kg]"] for row in rows] == [0.0, 10.0, 10.0]
    for row, mass in zip(rows, (15.0, 25.0, 25.0), strict=True):
        is_the_tyre(bench, row, mass=mass, verdict="ok" if mass == 15.0 else "warning")  # D3 is a copy of D2
    # of an added mass nothing is unknown but 0.2 % where its row says no more; K* leans on it through the rig
    light, default, stated = (row["u(Re K*) [N/m]"] for row in rows)
    assert light < 1e-6
    assert stated == pytest.approx(2.5 * default, rel=1e-6)
    jw = 2j * np.pi * F
    stiffness, beyond = bench.stiffness(F), jw * 25.0 + bench.c3 + bench.k3 / jw
    by_mass = stiffness**2 / beyond**2 * -1.0
    assert default == pytest.approx(abs(by_mass.real) * 20e-3, rel=1e-6)


def test_the_mass_between_force_cell_and_contact_is_taken_away(bench):
    bench.rig += 'input_mass = { value = 2, unit = "kg", exact = true }\n'
    f1, v1, v2 = bench.waves(F)
    cell = f1(bench.time) + 2.0 * v1(bench.time, 1)
    file = bench.record("D1", {"t": bench.time, "F1": cell, "V1": v1(bench.time), "V2": v2(bench.time)})
    bench.row("D1", file, "1000,110000")
    found = bench.found()
    assert [found["K2 [N/m]"], found["C [N s/m]"]] == pytest.approx([bench.k2, bench.c], rel=1e-6)


def test_what_is_unstated_is_taken_as_a_default_and_noted(bench):
    for role in ("force_in", "motion_in", "motion_out"):
        bench.channels[role] = bench.channels[role].replace(", exact = true", "")
    bench.rig = '[rig]\nmoving_mass = "15 kg"\npreload_stiffness = { value = 12.44, unit = "kN/m", std = "0.1 %" }\n'
    bench.c3 = 0.0
    bench.dynamic("D1")
    study = bench.analyse(route="mobility")
    assert [note for note in study.notes if not note.startswith("[unstated]")] == [
        "[rig] moving_mass: no std stated, taken as 2 % (exact = true if it is exact)",
        "[channels] force_in, motion_in, motion_out: no std_gain stated, taken as 1 % (exact = true if exact)",
        "[channels] force_in, motion_in, motion_out: no std_phase stated, taken as 0.5 deg (exact = true if exact)",
        "tests.csv: K1 is stated without u(K1), taken as 2 %",
    ]
    (row,) = study.dynamic.rows(named=True)
    # 1 % of V1 and of F1 along M = V1/F1, half a degree of each across it
    mobility = row["R [m/(N s)]"] + 1j * row["I [m/(N s)]"]
    u_r, u_i = row["u(R) [m/(N s)]"], row["u(I) [m/(N s)]"]
    covariance = np.array([[u_r**2, row["corr(R,I) [1]"] * u_r * u_i], [row["corr(R,I) [1]"] * u_r * u_i, u_i**2]])
    turn = np.array([[mobility.real, mobility.imag], [-mobility.imag, mobility.real]]) / abs(mobility)
    polar = turn @ covariance @ turn.T / abs(mobility) ** 2
    np.testing.assert_allclose(polar, np.diag([2 * 0.01**2, 2 * np.deg2rad(0.5) ** 2]), atol=1e-10)


@pytest.mark.parametrize(
    ("said", "gain", "phase"),
    [('std_gain = "3 %", std_phase = "0 deg"', 0.03, 0.0), ('std_gain = 0.03, std_phase = "0.02 rad"', 0.03, 0.02)],
)
def test_a_stated_uncertainty_of_a_channel_is_used(bench, said, gain, phase):
    bench.channels["force_in"] = f'{{ column = "F1", unit = "N", {said} }}'
    bench.dynamic("D1")
    study = bench.analyse(route="mobility")
    notes = [note for note in study.notes if not note.startswith("[unstated]")]
    assert notes == ["tests.csv: K1 is stated without u(K1), taken as 2 %"]
    (row,) = study.dynamic.rows(named=True)
    mobility = row["R [m/(N s)]"] + 1j * row["I [m/(N s)]"]
    along, across = gain * mobility, phase * 1j * mobility
    expected = [np.hypot(along.real, across.real), np.hypot(along.imag, across.imag)]
    assert [row["u(R) [m/(N s)]"], row["u(I) [m/(N s)]"]] == pytest.approx(expected, rel=1e-6)
    assert row["u(TR) [1]"] == pytest.approx(gain * row["TR predicted [1]"], rel=1e-6, abs=1e-9)


def test_a_phase_error_of_the_force_alone_leaves_the_predicted_transmissibility_exact(bench):
    """TR = 1/abs(Zr V1/F1), which knows the size of F1 only."""
    bench.channels["force_in"] = '{ column = "F1", unit = "N", std_gain = 0, std_phase = "2 deg" }'
    for i in range(12):
        bench.dynamic(f"D{i}", frequency=10.0 + i)
    for row in bench.analyse(route="mobility").dynamic.rows(named=True):
        assert row["u(TR) [1]"] == pytest.approx(0.0, abs=1e-9)


def test_specimens_are_tyres_by_another_name(bench):
    bench.specimens = '[specimens.bush]\nconstruction = "filled, 60 Shore"\nsupplier = "any"\n'
    bench.dynamic("D1")
    found = bench.found()
    assert (found["tyre"], found["construction"]) == ("bush", "filled, 60 Shore")
    is_the_tyre(bench, found)


def test_a_temperature_is_carried_in_degrees_celsius(bench):
    bench.columns = (*bench.columns, "temperature [K]")
    bench.dynamic("D1", "1000,110000,293.15")
    bench.dynamic("D2", "1000,110000,")
    assert bench.analyse().dynamic["temperature [degC]"].to_list() == [pytest.approx(20.0), None]


@pytest.mark.parametrize("route", ["relative", "transmissibility"])
def test_a_route_without_its_channel_says_which(bench, route):
    lacking = {"relative": "force_in", "transmissibility": "motion_out"}[route]
    del bench.channels[lacking]
    bench.dynamic("D1")
    found = bench.found(route=route)
    assert found["verdict"] == "rejected"
    assert f"the {route} route needs {lacking}, which [channels] in campaign.toml does not state" in found["remarks"]


def test_a_recording_of_a_hundred_thousand_rows_and_more_columns_than_needed(bench):
    bench.time = np.arange(100_000) / 20_000.0
    f1, v1, v2 = (wave(bench.time) for wave in bench.waves(F))
    more = {f"T{i}": np.zeros(bench.time.size) for i in range(5)}
    bench.row("D1", bench.record("D1", {**more, "V2": v2, "V1": v1, "F1": f1, "t": bench.time}), "1000,110000")
    is_the_tyre(bench, bench.found())
    assert pl.read_csv(bench.path / "recordings" / "D1.csv").height == 100_000
