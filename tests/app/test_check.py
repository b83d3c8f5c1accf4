"""`fourpole check`: what the analysis would reject, as a table and an exit code."""

from __future__ import annotations

import json


def test_a_sound_campaign(run, campaign, tmp_path):
    before = sorted(path for path in campaign.rglob("*"))
    ran = run("check", campaign)
    assert (ran.exit_code, ran.stderr) == (0, "")
    *notes, counted = ran.stdout.splitlines(keepends=True)
    assert [line.partition(":")[0] for line in notes] == ["note"]  # what is assumed, as analyse says it
    assert notes[0] in run("analyse", campaign, "--tables-only", "--out", tmp_path / "results").stderr
    assert counted == (
        "4 tests, 4 ok, 0 with a warning, 0 would be rejected (route: joint); nothing was analysed or written\n"
    )
    assert sorted(path for path in campaign.rglob("*")) == before


def test_problems_of_a_kind_are_one_line(run, campaign):
    for name in ("D1", "D3"):
        (campaign / "recordings" / f"{name}.csv").unlink()
    ran = run("check", campaign)
    assert ran.exit_code == 3
    (line,) = [line for line in ran.stdout.splitlines() if "there is no such file" in line]
    assert "D1, D3" in line
    assert "rejected" in line
    assert "4 tests, 2 ok, 0 with a warning, 2 would be rejected" in ran.stdout


def test_for_programs_each_problem_stands_by_itself(run, campaign):
    (campaign / "recordings" / "D2.csv").unlink()
    ran = run("check", campaign, "--json")
    found = json.loads(ran.stdout)
    assert ran.exit_code == 3
    assert found["verdicts"] == {"ok": 3, "warning": 0, "rejected": 1}
    (problem,) = found["problems"]
    assert (problem["test"], problem["file"], problem["about"], problem["verdict"]) == (
        "D2",
        "recordings/D2.csv",
        "file",
        "rejected",
    )


def test_the_same_codes_as_the_analysis(run, campaign):
    (campaign / "recordings" / "D2.csv").unlink()
    assert run("check", campaign).exit_code == run("analyse", campaign, "--tables-only").exit_code == 3
    (campaign / "tests.csv").write_text("nothing\n")
    assert run("check", campaign).exit_code == run("analyse", campaign, "--tables-only").exit_code == 2


def test_control_characters_do_not_reach_the_terminal(run, campaign):
    text = (campaign / "tests.csv").read_text()
    (campaign / "tests.csv").write_text(text.replace("recordings/D2.csv", "record\x1b[31mings/D2.csv"))
    ran = run("check", campaign)
    assert ran.exit_code == 3
    assert "\x1b" not in ran.stdout + ran.stderr
