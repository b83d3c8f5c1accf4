"""init: what names, headers, columns and signals say; with its doubts, and never a broken file."""

from __future__ import annotations

import csv
import re
import tomllib

import numpy as np
import polars as pl
import pytest

import fourpole as fp
from fourpole.campaign import read_campaign
from fourpole.campaign.channels import ChannelFile
from fourpole.campaign.schema import parse_campaign
from fourpole.errors import CampaignError
from fourpole.guess import guess_campaign
from fourpole.guess.conditions import Entry, read_conditions
from fourpole.guess.names import read_header, read_name
from fourpole.guess.write import campaign_toml
from fourpole.study import analyse
from fourpole.virtual import RADIAL_PLY, simulate_campaign
from fourpole.words.heads import column_of

pytestmark = pytest.mark.thorough

UNITS = {"t": "s", "F1": "N", "V1": "m/s", "V2": "m/s", "F": "N", "x": "mm"}
GERMAN = {"t": "Zeit", "F1": "Kraft", "V1": "Geschw_unten", "V2": "Geschw_oben", "F": "Radlast", "x": "Einfederung"}


@pytest.fixture(scope="module")
def origin(tmp_path_factory):
    """One tyre at one pressure and preload, three frequencies, without noise; and what an analysis finds."""
    made = simulate_campaign(
        tmp_path_factory.mktemp("origin"),
        clean=True,
        tyres=[RADIAL_PLY],
        pressures=[170e3],
        preloads=[1000.0],
        frequencies=[10.0, 14.0, 20.0],
    )
    return made.folder, analyse(made.folder, route="relative").dynamic.sort("frequency [Hz]")


def tables(origin):
    """Recordings by telling names."""
    folder, _ = origin
    for row in pl.read_csv(folder / "tests.csv").iter_rows(named=True):
        name = "radial_1.7bar_static" if row["kind"] == "static" else f"radial_1.7bar_1000N_{row['frequency [Hz]']:g}Hz"
        yield name, pl.read_csv(folder / row["file"])


def same(folder, origin, **tolerance):
    """Whether an analysis of what was guessed, without an edit, finds what that of the original did."""
    guess_campaign(folder).write()
    found = analyse(folder, route="relative").dynamic.sort("frequency [Hz]")
    assert found["verdict"].to_list() == ["ok"] * 3
    for column in ("frequency [Hz]", "Re K* [N/m]", "Im K* [N/m]", "K1 [N/m]", "K2 [N/m]", "C [N s/m]"):
        np.testing.assert_allclose(found[column], origin[1][column], **{"rtol": 1e-9, **tolerance})


def renamed(table, names, units, factors=None):
    columns = {name: table[name] * (factors or {}).get(name, 1.0) for name in table.columns}
    return pl.DataFrame({f"{names.get(name, name)} [{units[name]}]": column for name, column in columns.items()})


# --- formats and columns ---------------------------------------------------------------------------------------------


def test_decimal_commas_and_german_columns(origin, tmp_path):
    for name, table in tables(origin):
        (tmp_path / f"{name}.csv").write_text(renamed(table, GERMAN, UNITS).write_csv(separator=";").replace(".", ","))
    same(tmp_path, origin)


def test_numbered_channels_are_told_by_their_units_and_by_power(origin, tmp_path):
    for order in (("1", "2", "3"), ("3", "2", "1")):
        folder = tmp_path / order[0]
        folder.mkdir()
        names = {"F1": "Channel 4", "V1": f"Channel {order[0]}", "V2": f"Channel {order[2]}", "F": "Ch1", "x": "Ch2"}
        for name, table in tables(origin):
            renamed(table, names, UNITS).write_csv(folder / f"{name}.csv")
        same(folder, origin)
        guess = guess_campaign(folder)
        assert guess.roles["motion_in"].column == names["V1"]
        assert not any(role.invert for role in guess.roles.values())
        doubts = [doubt.text for doubt in guess.doubts if doubt.about == "motion_in"]
        assert len(doubts) == 1
        assert "through which power enters" in doubts[0]


def test_other_units_are_those_of_the_file(origin, tmp_path):
    units = {**UNITS, "t": "ms", "F1": "kN", "V1": "mm/s", "V2": "in/s", "F": "lbf", "x": "in"}
    factors = {"t": 1e3, "F1": 1e-3, "V1": 1e3, "V2": 1 / 0.0254, "F": 1 / 4.4482216152605, "x": 1 / 25.4}
    for name, table in tables(origin):
        renamed(table, {}, units, factors).write_csv(tmp_path / f"{name}.csv")
    same(tmp_path, origin)


@pytest.mark.parametrize("turned", ["F1", "V2", "F"])
def test_a_sensor_the_wrong_way_round_is_turned_and_doubted(origin, tmp_path, turned):
    for name, table in tables(origin):
        both = {"F": -1.0, "x": -1.0} if turned == "F" else {turned: -1.0}
        renamed(table, GERMAN, UNITS, both).write_csv(tmp_path / f"{name}.csv")
    same(tmp_path, origin)
    role = {"F1": "force_in", "V2": "motion_out", "F": "load"}[turned]
    guess = guess_campaign(tmp_path)
    assert guess.roles[role].invert
    assert any("its sign is turned" in doubt.text for doubt in guess.doubts if doubt.about == role)


def test_a_force_of_unstated_unit_is_held_against_the_static_curve(origin, tmp_path):
    for name, table in tables(origin):
        if "F1" in table.columns:
            small = table.with_columns(pl.col("F1") * 1e-3, pl.col("V1") * 1e3, pl.col("V2") * 1e3)
            small.rename({"V1": "V1 [mm/s]", "V2": "V2 [mm/s]"}).write_csv(tmp_path / f"{name}.csv")
        else:
            table.write_csv(tmp_path / f"{name}.csv")
    guess = guess_campaign(tmp_path)
    assert guess.roles["force_in"].unit == "kN"
    assert any("kN, " in doubt.text and "static stiffness" in doubt.text for doubt in guess.doubts)
    same(tmp_path, origin)


@pytest.mark.parametrize("role", ["motion_in", "motion_out"])
def test_an_inverted_sensor_leaves_the_ratio_to_the_static_stiffness_as_it_is(origin, tmp_path, role):
    symbol = {"motion_in": "V1", "motion_out": "V2"}[role]
    ratios = []
    for sign in (1.0, -1.0):
        folder = tmp_path / f"{sign:g}"
        folder.mkdir()
        for name, table in tables(origin):  # F1 has no unit, so the doubt on F1 states K* over the static stiffness
            renamed(table, {}, {**UNITS, "F1": "-"}, {symbol: sign}).write_csv(folder / f"{name}.csv")
        guess = guess_campaign(folder)
        assert guess.roles[role].invert == (sign < 0)
        texts = [doubt.text for doubt in guess.doubts if doubt.about == "force_in"]
        ratios.append([re.search(r"K\* is (\S+) times the static stiffness", text) for text in texts])
    first, second = ([match[1] for match in found if match] for found in ratios)
    assert len(first) == 1
    assert first == second


def test_groups_of_one_file_are_tests(origin, tmp_path):
    nptdms = pytest.importorskip("nptdms")
    with nptdms.TdmsWriter(tmp_path / "radial_1.7bar.tdms") as file:
        for name, table in tables(origin):
            step = float(table["t"][1] - table["t"][0])
            group = name.rpartition("bar_")[2]
            file.write_segment(
                [
                    nptdms.ChannelObject(
                        group, one, table[one].to_numpy(), {"wf_increment": step, "unit_string": UNITS[one]}
                    )
                    for one in table.columns
                    if one != "t"
                ]
            )
    same(tmp_path, origin)
    assert {row.file for row in guess_campaign(tmp_path).rows} >= {
        "radial_1.7bar.tdms#1000N_10Hz",
        "radial_1.7bar.tdms#static",
    }


def test_properties_of_a_file_are_read(origin, tmp_path):
    nptdms = pytest.importorskip("nptdms")
    for at, (name, table) in enumerate(tables(origin)):
        says = {"Tyre": "205/55 R16", "Pressure": "1.7 bar", **({} if "static" in name else {"Preload": "1 kN"})}
        step = float(table["t"][1] - table["t"][0])
        with nptdms.TdmsWriter(tmp_path / f"log{at}.tdms") as file:
            channels = [
                nptdms.ChannelObject("a", one, table[one].to_numpy(), {"wf_increment": step, "unit_string": UNITS[one]})
                for one in table.columns
                if one != "t"
            ]
            file.write_segment([nptdms.RootObject(says), *channels])
    same(tmp_path, origin)
    assert {row.tyre for row in guess_campaign(tmp_path).rows} == {"205/55 R16"}


def test_where_recordings_know_their_rate_no_time_is_stated(origin, tmp_path):
    for name, table in tables(origin):
        text = renamed(table.drop("t"), {}, UNITS).write_csv()
        (tmp_path / f"{name}.csv").write_text(text if "static" in name else f"Sampling rate: 1000 Hz\n{text}")
    same(tmp_path, origin)
    assert read_campaign(tmp_path).stated.channels.time is None


def test_recordings_without_any_time_are_doubted(origin, tmp_path):
    for name, table in tables(origin):
        renamed(table.drop("t"), {}, UNITS).write_csv(tmp_path / f"{name}.csv")
    guess = guess_campaign(tmp_path)
    guess.write()
    assert [doubt.remedy for doubt in guess.doubts if doubt.about == "time"] == [
        "state sample_rate in [channels] of campaign.toml"
    ]
    assert [row.kind for row in guess.rows].count("static") == 1
    text = (tmp_path / "campaign.toml").read_text()
    (tmp_path / "campaign.toml").write_text(text.replace("# sample_rate", "sample_rate"))
    found = analyse(tmp_path, route="relative").dynamic.sort("frequency [Hz]")
    np.testing.assert_allclose(found["Re K* [N/m]"], origin[1]["Re K* [N/m]"], rtol=1e-9)


def test_recorded_pressure_and_temperature_are_conditions(origin, tmp_path):
    for name, table in tables(origin):
        wide = renamed(table, {}, UNITS).with_columns(pl.lit(1.702).alias("p [bar]"), pl.lit(23.4).alias("T [°C]"))
        wide.write_csv(tmp_path / f"{name.replace('_1.7bar', '')}.csv")
    rows = guess_campaign(tmp_path).rows
    assert {(row.values["pressure"], row.values["temperature"]) for row in rows} == {(170e3, 23.4)}


def test_a_tacho_is_found_and_its_pulses_counted(origin, tmp_path):
    for name, table in tables(origin):
        frequency = 1.0 if "static" in name else float(name.rpartition("_")[2].removesuffix("Hz"))
        pulses = (np.sin(2 * np.pi * 4 * frequency * table["t"].to_numpy() + 0.1) > 0) * 5.0
        renamed(table.with_columns(pl.Series("Tacho", pulses)), {}, {**UNITS, "Tacho": "V"}).write_csv(
            tmp_path / f"{name}.csv"
        )
    guess = guess_campaign(tmp_path)
    assert guess.reference == ("Tacho", "V", 4)
    assert guess.roles["force_in"].column == "F1"


def test_of_three_forces_the_vertical_one_is_taken_and_doubted(origin, tmp_path):
    for name, table in tables(origin):
        force = "F" if "static" in name else "F1"
        wide = table.with_columns((pl.col(force) * 0.1).alias("Fx"), (pl.col(force) * 0.05).alias("Fy"))
        units = {**UNITS, "Fx": "N", "Fy": "N"}
        renamed(wide, {"F1": "Fz"}, units).write_csv(tmp_path / f"{name}.csv")
    guess = guess_campaign(tmp_path)
    assert guess.roles["force_in"].column == "Fz"
    assert ["'Fx', 'Fy' could be it too" in doubt.text for doubt in guess.doubts if doubt.about == "force_in"] == [True]


def test_volts_are_left_for_a_sensitivity(origin, tmp_path):
    for name, table in tables(origin):
        renamed(table, {"V1": "acc_in", "V2": "acc_out"}, {**UNITS, "V1": "V", "V2": "V"}).write_csv(
            tmp_path / f"{name}.csv"
        )
    guess = guess_campaign(tmp_path)
    guess.write()
    text = (tmp_path / "campaign.toml").read_text()
    assert '# motion_in  = { column = "acc_in", unit = "V", sensitivity = "..." }' in text
    with pytest.raises(CampaignError, match="motion_in is missing"):
        read_campaign(tmp_path)


@pytest.mark.parametrize(
    ("name", "unit", "quantity", "side"),
    [
        ("F1", "kN", "force", "in"),
        ("Kraft", None, "force", ""),
        ("load cell", None, "force", ""),
        ("Beschl_unten", "m/s2", "acceleration", "in"),
        ("AccTop", "g", "acceleration", "out"),
        ("Beschleunigung Felge", None, "acceleration", "out"),
        ("LVDT", None, "displacement", ""),
        ("Wheel displacement", "mm", "displacement", "out"),
        ("Channel 2", "m/s", "velocity", ""),
        ("Schwinggeschwindigkeit", None, "velocity", ""),
        ("position command", "mm", "drive", ""),
        ("Sollweg", "mm", "drive", ""),
        ("posCmd", "V", "drive", ""),
        ("Führungsgröße", "kN", "drive", ""),
        ("Consigne_F", "N", "drive", ""),
        ("変位指令", "mm", "drive", ""),
        ("目標値", None, "drive", ""),
        ("COLA", "V", "drive", ""),
        ("Drive", "V", "drive", "in"),
        ("Drive force", None, "force", "in"),
        ("Sollicitation", "N", "force", ""),
        ("Temperature setpoint", "degC", "temperature", ""),
        ("Temp", None, "temperature", ""),
        ("Zeit", None, "time", ""),
        ("Ch1", None, "", ""),
    ],
)
def test_a_column_by_name_and_unit(name, unit, quantity, side):
    found = column_of(name, unit)
    assert (found.quantity, found.side) == (quantity, side)


# --- names -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("1.7bar 1000N 10Hz", {"pressure": 170e3, "preload": 1000.0, "frequency": 10.0}),
        ("1,7bar_1p5kN_600rpm", {"pressure": 170e3, "preload": 1500.0, "frequency": 10.0}),
        ("P170KPA Fz1kN 10p5Hz", {"pressure": 170e3, "preload": 1000.0, "frequency": 10.5}),
        ("m10kg 23C", {"added_mass": 10.0, "temperature": 23.0}),
        ("+2.5kg -5C", {"added_mass": 2.5, "temperature": -5.0}),
        ("radial-1.7bar", {"pressure": 170e3}),
        ("1,000N", {"preload": 1000.0}),
        ("20240312_143055_v2.1_SN0815_rev3", {}),
        ("205-55R16", {}),
        ("2kHz 10s", {}),
        ("3,9kN/s 5mm_min 0.5 bar/min 200 N/mm", {}),
        ("5kN_A 600U/min", {"preload": 5000.0, "frequency": 10.0}),
        ("9f0012c3a1b", {}),
        ("name", {}),
    ],
)
def test_values_in_a_name(name, values):
    found = {
        token.what: token.value for token in read_name(name) if token.what not in ("word", "repeat", "kind", "mark")
    }
    assert found == pytest.approx(values)


@pytest.mark.parametrize(
    ("line", "found"),
    [
        ("Pressure: 1.7 bar", ("pressure", 170e3)),
        ("Luftdruck [bar];1,7", ("pressure", 170e3)),
        ('"Vorlast [kN]","1.5"', ("preload", 1500.0)),
        ("moving mass = 15 kg", ("moving_mass", 15.0)),
        ("K3 = 12.44 kN/m", ("preload_stiffness", 12440.0)),
        ("preload_N: 1000", ("preload", 1000.0)),
        ("# crossply tyre, 1.7 bar", ("pressure", 170e3)),
        ("Sampling rate: 1000 Hz", None),
        ("Filter 200 Hz", None),
        ("Ambient pressure: 1013 mbar", None),
        ("Operator: 3 N", None),
        ("Sensor range; 5 kN", None),
        ("Vorlastrate: 3,9 kN/s", None),
        ("Preload [kN/s];3.9", None),
        ("Belastungsgeschwindigkeit: 3,9", None),
    ],
)
def test_a_line_of_a_header(line, found):
    assert [(token.what, token.value) for token in read_header([line])] == ([found] if found else [])


def test_a_number_that_goes_with_the_frequencies_needs_no_doubt(origin, tmp_path):
    for name, table in tables(origin):
        table.write_csv(tmp_path / f"{name.replace('bar', '').replace('N', '').replace('Hz', '')}.csv")
    guess = guess_campaign(tmp_path)
    doubted = {doubt.about for doubt in guess.doubts}
    assert "frequency" not in doubted
    assert {"pressure", "preload"} <= doubted
    same(tmp_path, origin)


def test_a_number_that_looks_like_a_pressure_is_none_where_the_recordings_turn_at_it():
    """5.5 and 8 could be bar; at 5.5 and 8 Hz they are frequencies, at others they are not."""
    turning = [Entry("dynamic", f, tuple(read_name(f"radial_{f:g}"))) for f in (5.5, 8.0)]
    assert [one.values for one in read_conditions(turning, ("a", "b"))] == [{"frequency": 5.5}, {"frequency": 8.0}]
    others = [Entry("dynamic", 20.0, entry.name) for entry in turning]
    assert [one.values for one in read_conditions(others, ("a", "b"))] == [{"pressure": 550e3}, {"pressure": 800e3}]
    assert all("taken as bar" in one.doubts[0][1] for one in read_conditions(others, ("a", "b")))


def test_a_frequency_that_the_recording_does_not_show_is_not_taken(origin, tmp_path):
    for name, table in tables(origin):
        table.write_csv(tmp_path / f"{name.replace('14Hz', '17Hz')}.csv")
    guess = guess_campaign(tmp_path)
    (wrong,) = [row for row in guess.rows if "17Hz" in row.file]
    assert wrong.values["frequency"] == pytest.approx(14.0)
    assert wrong.doubts == (("frequency", "17 Hz is stated, the recording shows 14 Hz, which is taken"),)


def test_the_signals_go_before_the_name_in_what_kind_a_test_is(origin, tmp_path):
    for name, table in tables(origin):
        table.write_csv(tmp_path / f"{name.replace('static', 'dynamic')}.csv")
    rows = {row.file: row for row in guess_campaign(tmp_path).rows}
    assert rows["radial_1.7bar_dynamic.csv"].kind == "static"
    assert "its name says dynamic" in rows["radial_1.7bar_dynamic.csv"].doubts[0][1]


def test_two_statements_that_differ_are_told(origin, tmp_path):
    for name, table in tables(origin):
        (tmp_path / f"{name}.csv").write_text("Pressure: 2.0 bar\n" + table.write_csv())
    guess = guess_campaign(tmp_path)
    assert {row.values["pressure"] for row in guess.rows} == {170e3}
    assert any("1.7 bar is taken, its header also says" in doubt.text for doubt in guess.doubts)


def test_a_calibration_and_its_mass(origin, tmp_path):
    for at, (name, table) in enumerate(tables(origin)):
        table.write_csv(tmp_path / ("radial_1.7bar_static.csv" if "static" in name else f"cal_rigid_m20kg_{at}.csv"))
    rows = [row for row in guess_campaign(tmp_path).rows if row.kind == "calibration"]
    assert [(row.tyre, row.values["added_mass"]) for row in rows] == [("", 20.0)] * 3


# --- rig and the files -----------------------------------------------------------------------------------------------


def test_a_rig_in_a_readme_is_used(origin, tmp_path):
    for name, table in tables(origin):
        table.write_csv(tmp_path / f"{name}.csv")
    (tmp_path / "README.txt").write_text("Moving mass: 15 kg\nK3 = 12.44 kN/m\n")
    guess_campaign(tmp_path).write()
    rig = read_campaign(tmp_path).stated.rig
    assert rig is not None
    assert {name: one.value for name, one in rig.values.items()} == {"moving_mass": 15.0, "preload_stiffness": 12440.0}


def test_without_a_rig_there_is_an_example_and_a_doubt(origin, tmp_path):
    for name, table in tables(origin):
        table.write_csv(tmp_path / f"{name}.csv")
    guess = guess_campaign(tmp_path)
    guess.write()
    text = (tmp_path / "campaign.toml").read_text()
    assert "# doubt: rig: " in text
    assert '# moving_mass       = "15 kg"    # an example, not yours' in text
    assert read_campaign(tmp_path).stated.all_rigs == {}


def test_what_is_there_stays_unless_forced(origin, tmp_path):
    for name, table in tables(origin):
        table.write_csv(tmp_path / f"{name}.csv")
    (tmp_path / "tests.csv").write_text("mine")
    with pytest.raises(CampaignError, match=r"a tests\.csv already"):
        guess_campaign(tmp_path).write()
    assert not (tmp_path / "campaign.toml").exists()
    assert (tmp_path / "tests.csv").read_text() == "mine"
    guess_campaign(tmp_path).write(force=True)
    assert len(read_campaign(tmp_path).tests) == 4


HOSTILE = [
    "<script>alert(1)<_script>.csv",
    "\"quoted\" 'x' \\back.csv",
    "=cmd|calc.csv",
    "tyre] [x.csv",
    "[tyres.a].csv",
    "#1 # 2.csv",
    "-.csv",
    "a,b;c.csv",
    'dyn"""x = "".csv',
    "ünï_𝕏.csv",
    "x" * 200 + ".csv",
]
BARRED = [
    "a\nb.csv",
    " lead.csv",
    "\x1b[31mred.csv",
    "tab\there.csv",
    b"bad\xff.csv".decode("utf-8", "surrogateescape"),
]


def test_hostile_names_give_valid_files(origin, tmp_path):
    (_, table), *_ = tables(origin)
    for name in (*HOSTILE, *BARRED):
        try:
            table.write_csv(tmp_path / "spare.tmp")
            (tmp_path / "spare.tmp").rename(tmp_path / name)
        except (OSError, UnicodeError):
            pytest.skip(f"the file system has no {name!r}")
    guess = guess_campaign(tmp_path)
    guess.write()
    assert [row.file for row in guess.rows if row.file not in HOSTILE] == []
    assert len(guess.left_out) == len(BARRED)
    assert {test.file for test in read_campaign(tmp_path).tests} == set(HOSTILE)
    assert not any(test.problem for test in read_campaign(tmp_path).tests)
    tomllib.loads((tmp_path / "campaign.toml").read_text())
    with (tmp_path / "tests.csv").open(newline="") as file:
        assert len({len(row) for row in csv.reader(file)}) == 1


def test_hostile_columns_and_headers_give_valid_toml(origin, tmp_path):
    for name, table in tables(origin):
        strange = table.rename({"t": 't"]\\'} if "static" not in name else {})
        (tmp_path / f"{name}.csv").write_text("Tyre: a\"]\\b = 'c'\n" + strange.write_csv())
    guess_campaign(tmp_path).write()
    assert tomllib.loads((tmp_path / "campaign.toml").read_text())["tyres"]


def test_a_link_out_of_the_folder_is_left_out(origin, tmp_path):
    folder = tmp_path / "folder"
    folder.mkdir()
    for name, table in tables(origin):
        table.write_csv(folder / f"{name}.csv")
    (tmp_path / "secret.csv").write_text("t,F1\n0,1\n")
    (folder / "link.csv").symlink_to(tmp_path / "secret.csv")
    guess = guess_campaign(folder)
    assert len(guess.rows) == 4
    assert guess.left_out == (("link.csv", "is a link to a place outside the folder: copy it into the folder"),)


@pytest.mark.parametrize("content", [b"", b"\x00\x01" * 500, b"t,F1,V1,V2\n1,2\nfoo\n"])
def test_what_is_no_recording_is_left_out_and_told(origin, tmp_path, content):
    for name, table in tables(origin):
        table.write_csv(tmp_path / f"{name}.csv")
    (tmp_path / "broken.csv").write_bytes(content)
    guess = guess_campaign(tmp_path)
    assert [name for name, _ in guess.left_out] == ["broken.csv"]
    assert any("broken.csv was left out" in doubt.text for doubt in guess.doubts)
    assert "# doubt: broken.csv was left out: " in campaign_toml(guess)


def test_the_keys_of_ordinary_errors_stand_as_comments(origin, tmp_path):
    """Nothing is taken as zero; each key that a comment names is one that the statement knows."""
    for name, table in tables(origin):
        table.write_csv(tmp_path / f"{name}.csv")
    text = campaign_toml(guess_campaign(tmp_path))
    assert "[unstated]" not in text
    plain = parse_campaign(text)
    assert (plain.ordinary.counted, plain.ordinary.simultaneous) == (True, False)
    asked = text.replace("# [logger]\n# simultaneous", "[logger]\nsimultaneous")
    assert parse_campaign(asked).ordinary.simultaneous
    for key in ("coupling", "std_delay", "mounted"):
        assert f"{key} = " in text
        assert key in ChannelFile.model_fields
    for path in tmp_path.iterdir():
        if "static" not in path.name:
            path.unlink()
    assert "[logger]" not in campaign_toml(guess_campaign(tmp_path))


def test_a_folder_without_recordings_is_refused(tmp_path):
    with pytest.raises(CampaignError, match="holds no recording"):
        guess_campaign(tmp_path)
    with pytest.raises(CampaignError, match="there is no such folder"):
        guess_campaign(tmp_path / "none")


def test_an_impact_is_a_doubtful_test(origin, tmp_path):
    for name, table in tables(origin):
        table.write_csv(tmp_path / f"{name}.csv")
    noise = np.random.default_rng(1).normal(size=(4000, 3)) * np.exp(-np.arange(4000) / 100)[:, None]
    pl.DataFrame({"t": np.arange(4000) / 1000, **{n: noise[:, i] for i, n in enumerate(("F1", "V1", "V2"))}}).write_csv(
        tmp_path / "radial_1.7bar_1000N.csv"
    )
    (row,) = [row for row in guess_campaign(tmp_path).rows if row.file == "radial_1.7bar_1000N.csv"]
    assert row.doubts == (("kind", "its signals show no steady sinusoid and no slow curve"),)
    assert "frequency" not in row.values


@pytest.mark.parametrize("change", [3.0, 28.0], ids=["soon", "long after all rows that show a shape"])
def test_a_file_with_two_sines_one_after_the_other_is_two_tests(tmp_path, change):
    t = np.arange(300_000) / 1e4
    turns = 2 * np.pi * np.where(t < change, 12.3 * t, 12.3 * change + 55.0 * (t - change))
    pl.DataFrame({"t [s]": t, "F1 [N]": np.sin(turns), "V1 [m/s]": np.cos(turns)}).write_csv(tmp_path / "long.csv")
    guessed = guess_campaign(tmp_path)
    assert [row.values["frequency"] for row in guessed.rows] == pytest.approx([12.3, 55.0], rel=1e-3)
    assert [row.name for row in guessed.rows] == ["long_1", "long_2"]
    (_, first), (second, last) = (row.window for row in guessed.rows)
    assert first == pytest.approx(change, abs=0.1)
    assert second == pytest.approx(change, abs=0.1)
    assert last == pytest.approx(30.0, abs=0.1)
    guessed.write()
    assert "window [s]" in (tmp_path / "tests.csv").read_text()


def test_one_procedure_of_a_bench_is_eight_tests_whose_stiffness_is_right(tmp_path):
    """Rests and sines of an actuator under a Zener body, whose force follows from its transfer at each frequency."""
    rate = 2000.0
    parts: list[tuple[np.ndarray, np.ndarray]] = []
    for f in (0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 45.0, 100.0):
        t = np.arange(int(max(10 / f, 2.0) * rate)) / rate
        stiffness = 200e3 + 1.0 / (1.0 / 120e3 + 1.0 / (2j * np.pi * f * 900.0))
        wave = 0.5e-3 / f**0.5 * np.exp(2j * np.pi * f * t) * np.minimum(1.0, t * f / 1.5)
        parts += [(np.zeros(2000), np.zeros(2000)), (wave.imag, (stiffness * wave).imag)]
    motion, force = (np.concatenate(one) for one in zip(*parts, strict=True))
    rng = np.random.default_rng(2)
    table = {
        "Zeit [s]": np.arange(motion.size) / rate,
        "Kraft [N]": force + 0.05 * rng.standard_normal(force.size),
        "Weg [mm]": 1e3 * motion + 1e-5 * rng.standard_normal(force.size),
    }
    pl.DataFrame(table).write_csv(tmp_path / "Lager_A.csv")
    guess_campaign(tmp_path).write()
    found = fp.analyse(tmp_path).dynamic
    assert found.height == 8
    omega = 2j * np.pi * found["frequency [Hz]"].to_numpy()
    exact = 200e3 + 1.0 / (1.0 / 120e3 + 1.0 / (omega * 900.0))
    seen = found["Re K* [N/m]"].to_numpy() + 1j * found["Im K* [N/m]"].to_numpy()
    assert np.abs(seen / exact - 1.0).max() < 2e-3
