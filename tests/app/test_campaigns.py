"""Several campaigns in one command, and the command that gathers their results."""

from __future__ import annotations

import json
import shutil

import pytest


@pytest.fixture
def several(campaign, tmp_path):
    """Three campaigns, of which the second cannot be read."""
    folders = [tmp_path / "several" / name for name in ("one", "two", "three")]
    for folder in folders:
        shutil.copytree(campaign, folder)
    (folders[1] / "tests.csv").unlink()
    return folders


def test_one_broken_campaign_does_not_stop_the_others(run, several):
    ran = run("analyse", *several, "--tables-only")
    assert ran.exit_code == 2
    assert [(folder / "results" / "study.json").exists() for folder in several] == [True, False, True]
    assert "has campaign.toml, but no tests.csv" in " ".join(ran.stderr.split())
    heads = [f"{at} of 3: {folder}" for at, folder in enumerate(several, 1)]
    assert [line for line in ran.stderr.splitlines() if line in heads] == heads
    summary = ran.stdout.split("\n\n")[1].split()
    assert (summary.count("4"), summary.count("-")) == (2, 3)  # numbers of tests by verdict


def test_the_document_for_programs_is_one(run, several):
    ran = run("analyse", *several, "--tables-only", "--json")
    rows = json.loads(ran.stdout)["campaigns"]
    assert [row["exit code"] for row in rows] == [0, 2, 0]
    assert [row["campaign"] for row in rows] == list(map(str, several))
    assert "has campaign.toml, but no tests.csv" in rows[1]["error"]
    assert rows[2]["verdicts"]["ok"] == 4


def test_a_campaign_that_is_named_twice_is_analysed_once(run, several):
    ran = run("analyse", several[0], several[0].parent / "." / "one", "--tables-only", "--out", several[0] / "here")
    assert ran.exit_code == 0
    assert "1 of 2" not in ran.stderr
    assert (several[0] / "here" / "dynamic.csv").exists()


def test_one_folder_for_the_results_of_several_is_refused(run, several):
    ran = run("analyse", *several, "--out", several[0] / "results")
    assert ran.exit_code == 2
    assert "--out is for one campaign" in " ".join(ran.stderr.split())
    assert not (several[0] / "results").exists()


def test_a_stop_ends_the_whole_command(run, several, monkeypatch):
    def stopped(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr("fourpole.app.analysis.run_analysis", stopped)
    ran = run("analyse", *several)
    assert ran.exit_code == 130
    assert "2 of 3" not in ran.stderr


@pytest.mark.sampled(2)
def test_lab_gathers_what_there_is_and_says_what_it_did(run, several):
    folder = several[0].parent
    run("analyse", *several, "--tables-only")
    first, second = run("lab", folder), run("lab", folder)
    assert (first.exit_code, second.exit_code) == (0, 0)
    assert first.stdout == f"{folder / 'lab'}: 2 campaigns, 6 rows of tests (2 read, 0 unchanged)\n"
    assert second.stdout.endswith("(0 read, 2 unchanged)\n")
    (several[2] / "results" / "study.json").write_text("[]")
    third = run("lab", folder, "--json")
    assert third.exit_code == 3
    assert json.loads(third.stdout)["campaigns"] == ["one"]
    assert "three: not taken: study.json is not one that fourpole wrote" in " ".join(third.stderr.split())


def test_lab_of_a_folder_without_results_is_exit_2(run, tmp_path):
    ran = run("lab", tmp_path)
    assert (ran.exit_code, ran.stdout) == (2, "")
    assert "no results below it: run fourpole analyse" in " ".join(ran.stderr.split())
