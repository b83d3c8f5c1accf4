"""Numbers and texts beyond all use, in files that people edit: one message with its place, and no fault of Fourpole."""

import json
import re
import shutil

import polars as pl
import pytest
from tests.unlisted import unlisted
from typer.testing import CliRunner

from fourpole.app.cli import app


@pytest.fixture(scope="module")
def analysed(run, small_campaign, tmp_path_factory):
    """The small campaign with its results, which list no files: they are read as somebody left them."""
    folder = shutil.copytree(small_campaign, tmp_path_factory.mktemp("extreme") / "campaign")
    assert run("analyse", folder, "--tables-only").exit_code == 0
    unlisted(folder / "results")
    return folder


@pytest.fixture
def folder(analysed, tmp_path):
    return shutil.copytree(analysed, tmp_path / "campaign")


def with_cell(path, column, value, row=0):
    table = pl.read_csv(path, infer_schema=False)
    if column not in table.columns:
        table = table.with_columns(pl.lit(None, pl.String).alias(column))
    table[row, column] = value
    table.write_csv(path)


def message(ran):
    """The errors that a command gave, which ended with a message to the user."""
    assert ran.exit_code in (0, 2, 3), ran.output
    assert "fault in Fourpole" not in ran.output
    assert "Traceback" not in ran.output
    return ran.output


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('std_gain = "0.02 %"', 'std_gain = "1e300 %"', "force_in.*std_gain"),
        ('std_gain = "0.02 %"', f"std_gain = {'9' * 5000}", r"campaign\.toml.*integer"),
        ("gain = 1.02", "gain = 1e300", "force_in.*gain"),
        ('column = "t", unit = "s"', 'sample_rate = "1e-300 Hz"', "time.*sample_rate"),
        ("value = 15.0, unit", "value = 1e300, unit", "moving_mass"),
        ("value = 15.0, unit", "value = nan, unit", "moving_mass"),
    ],
)
@pytest.mark.parametrize("command", ["check", "analyse"])
def test_a_number_of_the_statement_beyond_use_is_named(run, folder, command, old, new, said):
    path = folder / "campaign.toml"
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new, 1), encoding="utf-8")
    ran = run(command, folder)
    assert re.search(said, message(ran), re.DOTALL)
    assert ran.exit_code == 2


@pytest.mark.usefixtures("without_figures")
@pytest.mark.parametrize("command", ["check", "analyse"])
@pytest.mark.parametrize(
    ("column", "value", "said"),
    [
        ("K1 [N/m]", "1e300", "K1"),
        ("u(K1) [N/m]", "1e300", "u(K1)"),
        ("preload [N]", "9" * 5000, "preload"),
        ("note", "n" * 140_000, "131072"),
    ],
)
@pytest.mark.sampled(4)
def test_a_cell_of_tests_csv_beyond_use_is_named(run, folder, command, column, value, said):
    with_cell(folder / "tests.csv", column, value)
    ran = run(command, folder)
    assert said in message(ran)
    assert re.search(r"row 2|row: 2|D\d", ran.output)


@pytest.mark.parametrize("value", ["1e20", "1e300", "-1e308"])
def test_a_sample_beyond_use_is_a_finding_of_its_test(run, folder, value):
    path = sorted((folder / "recordings").glob("*.csv"))[0]
    table = pl.read_csv(path)
    table[table.height // 2, "V2"] = float(value)
    table.write_csv(path)
    message(run("check", folder))  # which looks at a part of each recording
    assert path.stem in message(run("analyse", folder, "--tables-only"))


@pytest.mark.usefixtures("without_figures")
@pytest.mark.parametrize(
    ("name", "column", "commands"),
    [
        ("dynamic.csv", "Re K* [N/m]", ("report --standard iso-10846-2", "fit", "map", "compare", "rig")),
        ("dynamic.csv", "u(Re K*) [N/m]", ("report", "fit", "map", "compare")),
        ("static.csv", "u(K1) [N/m]", ("compare", "report")),
        ("static.csv", "K1 [N/m]", ("compare", "fit --model zener --static ramp")),
    ],
)
@pytest.mark.parametrize("value", ["1e300", "inf", "1e5 N/m"])
@pytest.mark.sampled(2)
def test_a_cell_of_a_result_beyond_use_is_named_with_its_row(run, folder, analysed, name, column, commands, value):
    with_cell(folder / "results" / name, column, value)
    for command in commands:
        first, *rest = command.split()
        own = folder / "results"
        places = (analysed / "results", own) if first == "compare" else (own,)
        ran = run(first, *places, *rest)
        if first != "rig":
            assert ran.exit_code == 2, (command, ran.output)
            assert re.search(rf"{name}:? row 2, column '{re.escape(column)}'", message(ran)), (command, ran.output)
        message(ran)


@pytest.mark.parametrize("command", ["fit", "map", "report"])
def test_a_row_that_stands_twice_is_named(run, folder, command):
    path = folder / "results" / "dynamic.csv"
    table = pl.read_csv(path)
    pl.concat([table, table.head(1)]).write_csv(path)
    ran = run(command, folder / "results")
    assert f"dynamic.csv row {table.height + 2}: test '{table['test'][0]}'" in message(ran)
    assert ran.exit_code == 2


@pytest.mark.parametrize("command", ["rig", "verify", "report"])
def test_an_integer_of_many_digits_in_the_list_of_results_is_named(run, folder, command):
    path = folder / "results" / "study.json"
    record = {**json.loads(path.read_text(encoding="utf-8")), "seed": 0}
    path.write_text(json.dumps(record).replace('"seed": 0', '"seed": ' + "9" * 5000), encoding="utf-8")
    ran = run(command, folder if command == "verify" else folder / "results")
    assert "study.json is not one that fourpole wrote" in message(ran)
    assert ran.exit_code == 2


def test_more_axes_than_anybody_states_are_refused(run, folder):
    path = folder / "campaign.toml"
    axes = ", ".join(f'"axis {at}"' for at in range(21))
    path.write_text(path.read_text(encoding="utf-8") + f"\n[conditions]\naxes = [{axes}]\n", encoding="utf-8")
    ran = run("check", folder)
    assert "has 21 axes, at most 20 are taken" in message(ran)
    assert ran.exit_code == 2


def test_memory_that_runs_out_is_no_fault(folder, monkeypatch):
    def no_memory(*_arguments, **_options):
        raise MemoryError

    monkeypatch.setattr("fourpole.app.check.read_campaign", no_memory)
    ran = CliRunner().invoke(app, ["check", str(folder)])
    assert "not enough memory" in message(ran)
    assert ran.exit_code == 2


@pytest.mark.parametrize("number", ["0x" + "f" * 5000, "0o" + "7" * 5000, "0b" + "1" * 20_000, "inf"])
def test_an_integer_of_many_digits_of_another_base_is_named(run, folder, number):
    path = folder / "campaign.toml"
    path.write_text(f"x = {number}\n" + path.read_text(encoding="utf-8"), encoding="utf-8")
    ran = run("check", folder)
    assert "campaign.toml: x: " in message(ran)
    assert ran.exit_code == 2


@pytest.mark.parametrize("stated", ['std_gain = "1000 %"', 'std_phase = "1e4 deg"'])
@pytest.mark.sampled(2)
@pytest.mark.usefixtures("without_figures")
def test_sensors_that_are_hardly_known_give_tables_without_a_model(run, folder, stated):
    path = folder / "campaign.toml"
    text = re.sub(r'std_gain = "[^"]*", std_phase = "[^"]*"', stated, path.read_text(encoding="utf-8"))
    path.write_text(text, encoding="utf-8")
    ran = run("analyse", folder)
    assert "RuntimeWarning" not in message(ran)
    assert ran.exit_code == 3  # no K* is known to 50 %
    assert "results:" in ran.output


@pytest.mark.usefixtures("without_figures")
@pytest.mark.sampled(6)
def test_a_report_of_new_results_says_nothing_of_former_models(run, small_campaign, tmp_path):
    folder = shutil.copytree(small_campaign, tmp_path / "campaign")
    assert run("analyse", folder).exit_code == 0
    path = folder / "campaign.toml"
    path.write_text(path.read_text(encoding="utf-8").replace("value = 15.0, unit", "value = 15.2, unit"))
    assert run("analyse", folder).exit_code == 0
    assert "is of other results" not in (folder / "results" / "report.html").read_text(encoding="utf-8")
