"""`fourpole init`: a bare folder becomes a campaign that runs."""

from __future__ import annotations

import json
import shutil

import pytest

from fourpole.campaign import read_campaign
from fourpole.campaign.report import Equipment, ReportFile
from fourpole.campaign.schema import parse_campaign
from fourpole.core.specimen import Body


@pytest.fixture
def bare(small_campaign, tmp_path):
    """Recordings of the small campaign under telling names, and nothing else."""
    folder = tmp_path / "bare"
    folder.mkdir()
    names = {"S1": "radial_1.7bar_static", "D1": "radial_1.7bar_1000N_10Hz", "D2": "radial_1.7bar_1000N_17Hz",
             "D3": "radial_1.7bar_1000N_24Hz"}  # fmt: skip
    for source, name in names.items():
        shutil.copy(small_campaign / "recordings" / f"{source}.csv", folder / f"{name}.csv")
    return folder


def following(stdout):
    """The command that init says is next."""
    return stdout.splitlines()[-1].removeprefix("next: fourpole ").split()


def test_what_it_says_next_runs_without_an_edit(run, bare):
    ran = run("init", bare)
    assert (ran.exit_code, ran.stderr) == (0, "")
    then = run(*following(ran.stdout), "--tables-only")
    assert then.exit_code == 0
    assert "4 tests, 4 ok, 0 with a warning, 0 rejected" in then.stdout


def test_it_shows_what_it_took_and_numbers_its_doubts(run, bare):
    lines = run("init", bare).stdout.splitlines()
    assert any(line.split() == ["dynamic", "radial", "1.7", "1000", "3", "9.98", "17", "24"] or
               line.split()[:5] == ["dynamic", "radial", "1.7", "1000", "3"] for line in lines)  # fmt: skip
    assert any(line.split()[:3] == ["V2", "V2", "m/s"] and line.split()[-1] == "inverted" for line in lines)
    numbers = [int(line.split(".")[0]) for line in lines if line.strip()[:1].isdigit() and ". " in line[:6]]
    assert numbers == list(range(1, len(numbers) + 1))
    assert sum(line.startswith("     -> ") for line in lines) == len(numbers)
    assert f"{len(numbers)} doubts, also written beside what they concern:" in lines


def test_it_asks_for_the_weight_and_the_answer_is_read(run, bare):
    stdout = run("init", bare).stdout
    assert "question: what does each specimen weigh? It may stay open." in stdout
    path = bare / "campaign.toml"
    text = path.read_text().replace('# specimen_mass = "9 kg"', 'specimen_mass = "9 kg"')
    path.write_text(text if "specimen_mass" in text else f'{text}[tyres.radial]\nspecimen_mass = "9 kg"\n')
    assert read_campaign(bare).stated.bodies["radial"] == Body.weighed(9.0)


def test_it_refuses_to_write_over_what_is_there(run, bare):
    run("init", bare)
    before = (bare / "tests.csv").read_bytes()
    (bare / "radial_1.7bar_static.csv").unlink()
    ran = run("init", bare)
    assert (ran.exit_code, ran.stdout) == (2, "")
    assert "a campaign.toml and a tests.csv already" in ran.stderr
    assert "--force" in ran.stderr
    assert (bare / "tests.csv").read_bytes() == before
    assert run("init", bare, "--force").exit_code == 0
    assert (bare / "tests.csv").read_bytes() != before


def test_it_ends_with_what_check_says(run, bare):
    said = run("init", bare).stdout
    checked = run("check", bare).stdout.replace("; nothing was analysed or written", "")
    assert "no std_gain stated" in checked
    assert said.splitlines()[:-1] == [*said.partition("fourpole check says")[0].splitlines(),
                                      "fourpole check says of them:", *checked.splitlines()]  # fmt: skip


def test_each_key_of_the_report_stands_there_and_is_taken_without_its_sign(run, bare):
    run("init", bare)
    _, mark, text = (bare / "campaign.toml").read_text().partition("# [report]\n")
    stated = parse_campaign("[channels]\n[report]\n" + text.replace("# ", "", 1).replace("\n# ", "\n")).report
    assert mark
    assert stated.model_fields_set == set(ReportFile.model_fields)
    assert stated.equipment[0].model_fields_set == set(Equipment.model_fields)


def test_it_asks_for_what_makes_k_star_more_certain(run, bare):
    said = run("init", bare).stdout
    assert "With both (2 % is enough) TR is predicted" in said
    assert "question: can some tests be run once more with a weighed mass" in said
    lines = (bare / "campaign.toml").read_text().splitlines()
    assert max(len(line) for line in lines if line.startswith(("# doubt", "# question", "#   "))) <= 80


def test_for_programs_it_is_one_document(run, bare):
    found = json.loads(run("init", bare, "--json").stdout)
    assert [test["kind"] for test in found["tests"]].count("dynamic") == 3
    assert found["channels"]["motion_out"]["invert"] is True
    assert {doubt["about"] for doubt in found["doubts"]} >= {"rig", "force_in"}
    assert found["next"].startswith("next: fourpole analyse")
    assert found["check"]["verdicts"] == {"ok": 4, "warning": 0, "rejected": 0}
    assert list(found["questions"]) == ["added_mass", "specimen_mass"]


def test_what_keeps_it_from_running_is_said(run, bare):
    for path in bare.glob("*Hz.csv"):
        path.write_text(path.read_text().replace("V1,V2", "c1,c2", 1))
    ran = run("init", bare)
    assert ran.exit_code == 0
    assert ran.stdout.splitlines()[-1].startswith("not ready yet: campaign.toml: [channels] motion_in is missing")


def test_control_characters_in_a_name_are_shown_harmlessly(run, bare):
    (bare / "radial_1.7bar_static.csv").rename(bare / "radial\x1b[31m.csv")
    ran = run("init", bare)
    assert "\x1b" not in ran.stdout + ran.stderr
    assert "rename it" in ran.stdout


@pytest.mark.parametrize("name", ["", "none"])
def test_nothing_to_look_at_is_one_message(run, tmp_path, name):
    ran = run("init", tmp_path / name)
    assert (ran.exit_code, ran.stdout) == (2, "")
    assert len(ran.stderr.splitlines()) == 1


def test_a_doubt_goes_when_its_cell_is_corrected(run, bare):
    run("init", bare)
    table = bare / "tests.csv"
    head, *rows = table.read_text().splitlines()
    table.write_text("\n".join([f"{head},doubts", *(f"{row},preload [1000]: taken as N" for row in rows)]) + "\n")
    assert "doubts of fourpole init on preload (3)" in run("check", bare).stdout
    table.write_text(table.read_text().replace(",1000,", ",1001,"))
    said = run("check", bare).stdout
    assert "doubts of fourpole init" not in said
    assert "columns of your own" not in said


def test_a_pattern_is_taken_and_a_wrong_one_changes_nothing(run, bare):
    ran = run("init", bare, "--pattern", "{tire}_{pressure}bar")
    assert (ran.exit_code, ran.stdout) == (2, "")
    assert "there is no field '{tire}'; possible are {specimen}" in ran.stderr
    assert not (bare / "tests.csv").exists()
    ran = run(
        "init",
        bare,
        "--pattern",
        "{specimen}_{pressure}bar_{preload}N_{}",
        "--pattern",
        "{specimen}_{pressure}bar_{kind}",
    )
    assert ran.exit_code == 0
    assert "do not match the pattern" not in ran.stdout
