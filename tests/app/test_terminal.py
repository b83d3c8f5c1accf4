"""What a terminal shows: whole numbers, to the digits of their uncertainty, in the units that the campaign states."""

import json
import re
import shutil

import pytest

from fourpole.report.digits import with_u

#: A number with an exponent as a program writes it; the end of a cell that was cut.
CUT = re.compile(r"\d[eE][+-]?\d|…")
UNITS = '\n[report]\nunits = ["psi", "kgf/mm", "lbf"]\n'
POINT = ("--frequency", "17 Hz", "--preload", "1000 N")
ARM = ("--k1", "180 N/mm", "--k2", "120 kN/m", "--c", "700 N s/m", "--mass", "15 kg", "--preload-stiffness", "12 kN/m")


@pytest.fixture(scope="module")
def analysed(run, small_campaign, tmp_path_factory):
    """The small campaign in units of its own, analysed, and its last lines."""
    folder = shutil.copytree(small_campaign, tmp_path_factory.mktemp("units") / "campaign")
    with (folder / "campaign.toml").open("a", encoding="utf-8") as file:
        file.write(UNITS)
    ran = run("analyse", folder, "--tables-only")
    assert ran.exit_code == 0, ran.output
    assert run("fit", folder, "--model", "zener").exit_code == 0
    return folder, ran.stdout


@pytest.mark.sampled(2)
def test_the_table_of_an_analysis_is_in_the_units_of_the_campaign(analysed):
    _, said = analysed
    assert "K1 [kgf/mm]" in said
    assert "24.66 psi 224.8 lbf" in said
    assert "C [N s/m]" in said


def test_the_tables_on_disk_stay_in_si(analysed):
    folder, _ = analysed
    heads = (folder / "results" / "dynamic.csv").read_text(encoding="utf-8").partition("\n")[0]
    assert "pressure [Pa]" in heads
    assert "psi" not in heads
    stated = json.loads((folder / "results" / "study.json").read_text(encoding="utf-8"))["stated"]
    assert stated["report"] == {"units": {"pressure": "psi", "stiffness": "kgf/mm", "force": "lbf"}}


def test_an_answer_is_in_the_unit_of_the_question_and_otherwise_in_those_of_the_campaign(run, analysed):
    folder, _ = analysed
    said = run("query", folder, *POINT, "--pressure", "1.7 bar").stdout
    assert re.search(r"^pressure +1\.7 bar$", said, re.MULTILINE)
    assert re.search(r"^preload +1000 N$", said, re.MULTILINE)
    assert re.search(r"^K1 +[\d.]+ ± [\d.]+ kgf/mm$", said, re.MULTILINE)
    said = run("query", folder, *POINT).stdout
    assert re.search(r"^pressure +24\.656 psi$", said, re.MULTILINE)


def test_an_error_of_a_query_speaks_in_the_unit_of_the_question(run, analysed):
    folder, _ = analysed
    said = run("query", folder, *POINT, "--pressure", "3 bar").stderr
    assert "fits at 1.7 bar, 1000 N" in " ".join(said.split())


def test_programs_get_si(run, analysed):
    folder, _ = analysed
    row = json.loads(run("query", folder, *POINT, "--json").stdout)["rows"][0]
    assert row["pressure [Pa]"] == pytest.approx(170e3)
    assert run("predict", *ARM, "--frequency", "10:12:1 Hz").stdout.startswith("frequency [Hz],Re K* [N/m],")


def test_rig_and_fit_are_in_the_units_of_the_campaign(run, analysed):
    folder, _ = analysed
    assert "preload spring K3 [kgf/mm]" in run("rig", folder).stdout
    fitted = run("fit", folder, "--model", "zener").stdout
    assert "K1 [kgf/mm]" in fitted
    assert "24.66 psi, 224.8 lbf" in fitted


COMMANDS = [
    ("rig", "CAMPAIGN"),
    ("fit", "CAMPAIGN", "--model", "zener"),
    ("check", "CAMPAIGN"),
    ("causality", "CAMPAIGN"),
    ("analyse", "CAMPAIGN", "--tables-only"),
    ("query", "CAMPAIGN", "--frequency", "10:24:1 Hz"),
]


@pytest.mark.parametrize(
    ("columns", "command"),
    [*((80, one) for one in COMMANDS), (120, COMMANDS[1])],
    ids=lambda value: value[0] if isinstance(value, tuple) else str(value),
)
@pytest.mark.sampled(7)
def test_a_terminal_shows_whole_numbers(terminal, analysed, columns, command):
    shown = terminal(columns, *(analysed[0] if one == "CAMPAIGN" else one for one in command))
    assert_fits(shown, columns, str(analysed[0]))


@pytest.mark.sampled(4)
def test_a_question_in_a_terminal_is_answered_in_its_unit(terminal):
    shown = terminal(80, "predict", *ARM, "--frequency", "10:12:1 Hz")
    assert_fits(shown, 80)
    assert "194.21" in shown
    assert "[N/mm]" in shown
    assert "[kN/m]" not in shown


def assert_fits(shown, columns, path=None):
    """No error, no number that was cut, and no line that is wider than the terminal, but for those with a path."""
    lines = shown.split("\n")
    assert [line for line in lines if line.startswith("error:")] == []
    assert [line for line in lines if CUT.search(line)] == []
    assert [line for line in lines if len(line) > columns and not (path and path in line)] == []


def test_digits_follow_the_uncertainty():
    assert with_u(435012.3, 59.0, 1e3) == "435.01 ± 0.12"
    assert with_u(130021.0, 10.5) == "130021 ± 21"
    assert with_u(1105.36, 6670.0) == "1000 ± 13000"
    assert with_u(0.25, 0.0) == "0.2500"
    assert with_u(None, 1.0) == ""
