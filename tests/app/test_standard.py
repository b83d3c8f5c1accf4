"""The command that holds results against a standard."""

import json

import pytest

from fourpole import analyse


@pytest.fixture
def analysed(campaign):
    analyse(campaign, monte_carlo=0).write(campaign / "results")
    return campaign


def test_the_table_and_the_page(run, analysed):
    ran = run("report", analysed, "--standard", "sae-j1085")
    assert (ran.exit_code, ran.stderr) == (0, "")
    lines = ran.stdout.splitlines()
    assert lines[0] == "SAE J1085, Testing dynamic properties of elastomeric isolators"
    assert lines[-1] == f"page: {analysed / 'results' / 'report-sae-j1085.html'}"
    assert "It is not C" in ran.stdout
    assert "not read" in ran.stdout
    assert "<h1>SAE J1085" in (analysed / "results" / "report-sae-j1085.html").read_text()
    assert not (analysed / "results" / "report.html").exists()


def test_json_has_each_requirement(run, analysed):
    said = json.loads(run("report", analysed / "results", "--standard", "iso-10846-2", "--json").stdout)
    assert said["standard"] == "iso-10846-2"
    assert {one["answer"] for one in said["requirements"]} == {"met", "not met", "not stated"}
    assert not any(one["read"] for one in said["requirements"])
    assert said["values"][0]["specimen"] == "radial-ply"


@pytest.mark.sampled(2)
def test_the_page_of_former_tables_does_not_stay(run, analysed):
    assert run("report", analysed, "--standard", "iso-7626-2").exit_code == 0
    stated = analysed / "campaign.toml"
    stated.write_text(stated.read_text().replace("value = 15.0", "value = 15.01"))
    assert run("analyse", analysed, "--tables-only").exit_code == 0
    assert not list((analysed / "results").glob("report*"))


def test_an_unknown_standard_is_said_before_anything_is_written(run, analysed):
    ran = run("report", analysed, "--standard", "din 53513")
    assert (ran.exit_code, ran.stdout) == (2, "")
    assert "choose one of sae-j1085, iso-7626-2, iso-10846-2" in ran.stderr
    assert not list((analysed / "results").glob("report*"))
