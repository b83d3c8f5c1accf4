"""tests.csv as spreadsheets leave it, and the rows in it that contradict themselves."""

import csv
import io

import pytest

from fourpole.campaign import read_campaign
from fourpole.campaign.row import condition_of
from fourpole.core.condition import Axis, Sameness
from fourpole.errors import CampaignError
from fourpole.fitting.rows import axes_record, rule_in

TOML = """
[rig]
moving_mass = { value = 15.0, unit = "kg", exact = true }
preload_stiffness = { value = 12.44, unit = "kN/m", exact = true }
[channels]
time = { column = "t", unit = "s" }
force_in = { column = "F1", unit = "N" }
motion_in = { column = "V1", unit = "m/s" }
load = { column = "F", unit = "N" }
deflection = { column = "x", unit = "mm" }
[tyres.radial]
[specimens."Bügel 3"]
"""
HEADER = ["test", "file", "kind", "tyre", "pressure [bar]", "preload [N]", "frequency [Hz]", "note"]
ROWS = [
    ["S1", "S1.csv", "static", "radial", "1.7", "", "", ""],
    ["D1", "D1.csv", "dynamic", "radial", "1.7", "1000", "10.5", "first, of all"],
    ["D2", "D2.csv", "Dynamic", "Bügel 3", "", "1e3", "", 'two\nlines, "quoted"'],
]


def read(folder, tests, toml=TOML):
    (folder / "campaign.toml").write_text(toml, encoding="utf-8")
    (folder / "tests.csv").write_bytes(tests if isinstance(tests, bytes) else tests.encode())
    return read_campaign(folder)


def table(rows, **dialect):
    out = io.StringIO(newline="")
    csv.writer(out, **dialect).writerows(rows)
    return out.getvalue()


def comma(rows):
    """Numbers as a spreadsheet of a continental office writes them."""
    return [[cell.replace(".", ",") if cell[:1].isdigit() else cell for cell in row] for row in rows]


@pytest.mark.parametrize(
    "tests",
    [
        table([HEADER, *ROWS], lineterminator="\n"),
        table([HEADER, *ROWS]),
        "\ufeff" + table([HEADER, *ROWS], delimiter="\t"),
        table([HEADER, *comma(ROWS)], delimiter=";"),
        table([HEADER, *ROWS], quoting=csv.QUOTE_ALL),
        table([HEADER, *ROWS]).encode("latin-1"),
        table([HEADER, *ROWS]).encode("utf-16"),
        table([HEADER, ROWS[0], [], ROWS[1], ["", "", "", "", "", "", "", ""], ROWS[2], []]),
        table([[f" {cell} " for cell in row] for row in [HEADER, *ROWS]]),
        table([[row[3], *row[:3], *row[4:]] for row in [HEADER, *ROWS]]),
        table([[*HEADER[:3], "specimen", *HEADER[4:]], *ROWS]),
        table([[*HEADER[:4], "pressure [kPa]", "preload (kN)", "frequency [1/min]", "note"],
               [*ROWS[0][:4], "170", "", "", ""], [*ROWS[1][:4], "170", "1", "630", "first, of all"],
               [*ROWS[2][:4], "", "1", "", 'two\nlines, "quoted"']]),
        table([HEADER, ROWS[0], [*ROWS[1][:4], "170 kPa", "1 kN", "630 rpm", "first, of all"], ROWS[2]]),
    ],
)  # fmt: skip
def test_every_spelling_gives_the_same_tests(tmp_path, tests):
    campaign = read(tmp_path, tests)
    s1, d1, d2 = campaign.tests
    assert [test.problem for test in campaign.tests] == ["", "", ""]
    assert [test.name for test in campaign.of_kind("static")] == ["S1"]
    assert [test.name for test in campaign.of_kind("dynamic")] == ["D1", "D2"]
    assert (d1.file, d1.tyre, d1.kind, d2.tyre, d2.kind) == ("D1.csv", "radial", "dynamic", "Bügel 3", "dynamic")
    assert s1.values == {"pressure": pytest.approx(170e3)}
    assert d1.values == pytest.approx({"pressure": 170e3, "preload": 1000.0, "frequency": 10.5})
    assert d2.values == {"preload": 1000.0}
    assert campaign.extra_columns == ("note",)
    notes = [test.extra["note"].replace("\r\n", "\n").strip() for test in campaign.tests]
    assert notes == ["", "first, of all", 'two\nlines, "quoted"']


def test_blank_columns_that_a_spreadsheet_leaves_at_the_end_are_nothing(tmp_path):
    campaign = read(tmp_path, table([[*row, "", ""] for row in [HEADER, *ROWS]]))
    assert [test.problem for test in campaign.tests] == ["", "", ""]
    assert campaign.extra_columns == ("note",)


def test_a_lone_quote_does_not_swallow_the_rows_below(tmp_path):
    rows = [f"D{i},{chr(34) if i == 2 else ''}D{i}.csv,dynamic,radial" for i in range(1, 5)]
    try:
        names = [test.name for test in read(tmp_path, "\n".join(["test,file,kind,tyre", *rows, ""])).tests]
    except CampaignError as error:
        names = ["D1", "D2", "D3", "D4"] if "row 3" in str(error) else []
    assert names == ["D1", "D2", "D3", "D4"]


def test_a_problem_names_the_line_of_the_file(tmp_path):
    rows = [["S1", "S1.csv", "static", "radial", "one\ntwo"], [], ["D1", "D1.csv", "dynamic", "radail", ""]]
    campaign = read(tmp_path, table([["test", "file", "kind", "tyre", "note"], *rows], lineterminator="\n"))
    assert campaign.tests[1].problem.startswith("tests.csv row 5: tyre 'radail'")
    assert campaign.tests[1].row == 5


def test_all_that_is_wrong_with_a_row_is_said_at_once(tmp_path):
    campaign = read(tmp_path, "test,file,kind,tyre,pressure [bar],preload [N]\nD1,,dinamic,radail,low,-5\n")
    (test,) = campaign.tests
    parts = ["pressure", "preload: -5 N must be positive", "'dynamic'", "'radial'", "no recording is named"]
    assert [part for part in parts if part not in test.problem] == []


@pytest.mark.parametrize(
    ("label", "value", "remark"),
    [
        ("pressure [bar]", "-0.1", "must be zero or positive"),
        ("preload [N]", "0", "must be positive"),
        ("frequency [Hz]", "0", "must be positive"),
        ("K1 [N/m]", "-1", "must be positive"),
        ("u(K1) [N/m]", "-1", "must be zero or positive"),
        ("added_mass [kg]", "-1", "must be zero or positive"),
        ("added_mass [kg]", "1 N", "'N' is a force; a mass is needed"),
        ("preload [N]", "inf", "number"),
        ("preload [N]", "1,000", "1,000"),
        ("preload [N]", "1000 Nm", "a force is needed"),
        ("temperature [degC]", "warm", "'warm'"),
    ],
)
def test_a_number_out_of_its_range_is_named_with_its_column(tmp_path, label, value, remark):
    campaign = read(
        tmp_path, table([["test", "file", "kind", "tyre", label], ["D1", "D1.csv", "dynamic", "radial", value]])
    )
    (test,) = campaign.tests
    assert test.problem.startswith(f"tests.csv row 2: {label.partition(' [')[0]}: ")
    assert remark in test.problem


def test_numbers_that_are_zero_where_zero_is_allowed(tmp_path):
    header = "test,file,kind,tyre,pressure [bar],added_mass [kg],u(K1) [N/m],temperature [degC]"
    (test,) = read(tmp_path, f"{header}\nD1,D1.csv,dynamic,radial,0,0,0,-40\n").tests
    assert test.problem == ""
    assert test.values == {"pressure": 0.0, "added_mass": 0.0, "u(K1)": 0.0, "temperature": -40.0}


@pytest.mark.parametrize(
    ("tests", "said"),
    [
        ("test,file,kind\nD1,D1.csv,dynamic\n", "tests.csv row 1: column 'tyre' is missing"),
        ("tset,file,kind,tyre\nD1,D1.csv,dynamic,radial\n", "column 'test' is missing; did you mean 'tset'?"),
        ("test,file,kind,tyre,specimen\nD1,D1.csv,dynamic,radial,radial\n", "column 'tyre' stands twice"),
        ("test,file,kind,tyre,preload [N],preload [kN]\nD1,D1.csv,dynamic,radial,1,1\n", "'preload' stands twice"),
        ("test,file,kind,tyre,note,note\nD1,D1.csv,dynamic,radial,1,1\n", "two further columns have the same name"),
        ("test,file,kind,tyre,u(K1)\nD1,D1.csv,dynamic,radial,1\n", "'u(K1)' has no unit: write 'u(K1) [N/m]'"),
        ("test,file,kind,tyre,window [Hz]\nD1,D1.csv,dynamic,radial,1\n", "'Hz' is a frequency; a time is needed"),
    ],
)
def test_a_table_that_cannot_be_read_is_one_message(tmp_path, tests, said):
    with pytest.raises(CampaignError) as caught:
        read(tmp_path, tests)
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


def test_the_folder_may_be_a_link_and_the_file_below_it_too(noisy):
    real = noisy.path.rename(noisy.path.with_name("real"))
    noisy.path.symlink_to(real)
    noisy.recording("D2").rename(real / "kept.csv")
    noisy.recording("D2").symlink_to(real / "kept.csv")
    assert noisy.analyse().counts == {"ok": 5, "warning": 0, "rejected": 0}


def with_axes(folder, axes, cells=("", "0.5", "0.51"), column="amplitude [mm]"):
    rows = [[*row, cell] for row, cell in zip([HEADER, *ROWS], (column, *cells), strict=True)]
    return read(folder, table(rows), f"{TOML}[conditions]\naxes = {axes}\n")


@pytest.mark.parametrize(
    ("axes", "expected"),
    [
        ('["amplitude [mm]"]', Axis("amplitude [mm]", relative=0.01)),
        ('["note"]', Axis("note", text=True)),
        ('[{ column = "amplitude [mm]", relative = 0.05 }]', Axis("amplitude [mm]", relative=0.05)),
        ('[{ column = "amplitude [mm]", relative = "5 %" }]', Axis("amplitude [mm]", relative=0.05)),
        ('[{ column = "amplitude [mm]", absolute = 0.1 }]', Axis("amplitude [mm]", absolute=0.1)),
        ("[]", None),
    ],
)
def test_a_campaign_names_axes_of_its_own(tmp_path, axes, expected):
    campaign = with_axes(tmp_path, axes)
    rule = campaign.stated.sameness
    assert rule.further == (() if expected is None else (expected,))
    first, second = (condition_of(test, rule) for test in campaign.tests[1:])
    if expected is not None and not expected.text:
        assert (first.values[3], second.values[3]) == (0.5, 0.51)
    assert rule_in({"conditions": {"axes": axes_record(rule)}}) == rule
    assert rule_in({}) == Sameness()


@pytest.mark.parametrize(
    ("axes", "problem"),
    [
        ('["amplitud [mm]"]', r"'amplitud \[mm\]' is no further column of tests.csv; did you mean 'amplitude \[mm\]'"),
        ('["pressure [bar]"]', "pressure is an axis of every campaign: leave it out"),
        ('["preload"]', "preload is an axis of every campaign"),
        ('["note", "note"]', "'note' stands twice"),
        ('"note"', "must be a list"),
        ("[3]", "name a column of tests.csv"),
        ('[{ colum = "note" }]', "name a column of tests.csv"),
        ('[{ column = "note", relativ = 0.1 }]', "unknown key 'relativ'; did you mean 'relative'"),
        ('[{ column = "amplitude [mm]", relative = -0.1 }]', "a tolerance is negative"),
        ('[{ column = "amplitude [mm]", relative = "2 mm" }]', "amplitude"),
    ],
)
def test_axes_that_cannot_be_used(tmp_path, axes, problem):
    with pytest.raises(CampaignError, match=problem):
        with_axes(tmp_path, axes)


def test_unknown_keys_of_conditions_name_the_nearest(tmp_path):
    with pytest.raises(CampaignError, match=r"\[conditions\] axis: unknown key; did you mean 'axes'"):
        read(tmp_path, table([HEADER, *ROWS]), TOML + '[conditions]\naxis = ["note"]\n')


@pytest.mark.parametrize(
    ("label", "cell", "seconds"),
    [
        ("time", "2024-05-03T14:20", 1714746000.0),
        ("time", "2024-05-03 14:20:30", 1714746030.0),
        ("time", "2024-05-03T14:20+02:00", 1714738800.0),
        ("time", "14:20", 51600.0),
        ("time", "14:20:05", 51605.0),
        ("time [min]", "10", 600.0),  # ten o'clock, if the clock were asked first
        ("time [min]", "5", 300.0),
        ("time [s]", "20240503", 20240503.0),
        ("time", "1.5 h", 5400.0),
        ("time", "", None),
        ("time", "after lunch", None),
    ],
)
def test_the_time_of_a_test_is_a_date_a_clock_or_a_number(tmp_path, label, cell, seconds):
    """Another text passes through as any column does."""
    tests = table([[*HEADER[:-1], label], [*ROWS[1][:-1], cell]])
    (test,) = read(tmp_path, tests).tests
    assert test.values.get("time") == (None if seconds is None else pytest.approx(seconds))
    assert test.extra[label] == cell


def test_a_cell_on_a_numeric_axis_must_be_a_number(tmp_path):
    campaign = with_axes(tmp_path, '["amplitude [mm]"]', ("", "small", "0,51"))
    assert "tests.csv row 3: amplitude [mm]: 'small' is no number" in campaign.tests[1].problem
    assert campaign.tests[2].problem == ""
    assert campaign.tests[2].value("amplitude [mm]") == 0.51
    assert campaign.tests[2].extra["amplitude [mm]"] == "0.51"
