"""The demonstration, end to end: made, analysed, summed up, and the paper's twelve claims read on its tables."""

import json
import re
from pathlib import Path

import polars as pl
import pytest


def test_it_says_in_a_few_lines_what_it_did_and_found(demonstration):
    folder, ran = demonstration
    assert ran.returncode == 0
    progress = re.compile(r"[a-z ]+: \d+ of \d+, about \d+ \w+ left")  # a slow machine has a line now and then
    said = [line for line in ran.stderr.splitlines() if not progress.fullmatch(line)]
    assert said
    assert all(": Put back: " in line and not line.startswith("warning") for line in said)
    first, title, heads, *rows, words, report = ran.stdout.splitlines()
    assert first == (
        "Virtual campaign in fourpole-demo (seed 1982): 137 tests, 137 ok, 0 with a warning, 0 rejected; "
        "rig and sensors fit their statement."
    )
    assert title == "At 14 Hz; ± is U (k = 2):"
    assert re.split(" {2,}", heads.strip()) == ["K1 [kN/m]", "|K*| [kN/m]", "δ [°]", "K2 [kN/m]", "C [N s/m]"]
    assert max(map(len, rows)) <= 80
    assert rows[0] == "car-tyre"
    assert all(row.count("±") == 5 for row in rows[1:4])
    assert "a belt of" in rows[4]
    assert "hold by design" in words
    assert report.startswith(f"report: {Path('fourpole-demo') / 'results' / 'report.html'}")
    assert report.endswith("fourpole open fourpole-demo")
    assert {path.name for path in folder.iterdir()} >= {
        "campaign.toml",
        "tests.csv",
        "recordings",
        "truth.csv",
        "results",
    }
    assert {"static.csv", "dynamic.csv"} <= {path.name for path in (folder / "results").iterdir()}


def test_its_statement_is_as_a_laboratory_writes_it(demonstration):
    folder, _ = demonstration
    page = (folder / "results" / "report.html").read_text()
    assert all(text in page for text in ("Prüfstand 2 (virtual), Köln", "J. Müller", "2026-11-02"))
    assert (folder / "recordings" / "Köln_car-tyre_2.1bar_2000N_14Hz_10kg.csv").is_file()


def test_an_analysis_straight_after_it_finds_its_results_standing(demonstration, fourpole):
    folder, _ = demonstration
    ran = fourpole("analyse", folder)
    assert ran.returncode == 0
    assert "nothing has changed since the last analysis" in ran.stderr


def test_every_test_is_ok(demonstration):
    folder, _ = demonstration
    static, dynamic = (pl.read_csv(folder / "results" / name) for name in ("static.csv", "dynamic.csv"))
    assert (static.height, dynamic.height) == (15, 128)
    assert {*static["verdict"], *dynamic["verdict"]} == {"ok"}
    assert {*static["remarks"], *dynamic["remarks"]} <= {"", None}


def test_the_twelve_claims_of_the_paper_hold_on_its_tables(demonstration, evaluate_claims):
    folder, _ = demonstration
    found = evaluate_claims(*(pl.read_csv(folder / "results" / name) for name in ("static.csv", "dynamic.csv")))
    assert [number for number, _, _ in found] == list(range(1, 13))
    assert [claim for claim in found if not claim[1]] == []


def test_the_tables_agree_with_the_truth_beside_them(demonstration):
    folder, _ = demonstration
    truth = pl.read_csv(folder / "truth.csv", infer_schema_length=None)
    table = pl.read_csv(folder / "results" / "dynamic.csv").join(truth, on="test", suffix=" true")
    assert table.height == 128
    for name, most in (("K1 [N/m]", 1e-3), ("Re K* [N/m]", 1e-2), ("K2 [N/m]", 3e-2), ("C [N s/m]", 3e-2)):
        assert (table[name] / table[f"{name} true"] - 1.0).abs().max() < most, name
    for name, std in (("Re K* [N/m]", "u(Re K*) [N/m]"), ("Im K* [N/m]", "u(Im K*) [N/m]")):
        error = (table[name] - table[f"{name} true"]) / table[std]
        assert error.abs().max() < 4.0


def test_the_springs_of_the_car_tyre_relax_its_model_fits_and_the_report_says_why_those_of_the_others_cannot(
    demonstration,
):
    folder, _ = demonstration
    models = {one["tyre"]: one for one in json.loads((folder / "results" / "model.json").read_text())["models"]}
    car = models["car-tyre"]
    assert [one["verdict"]["possible"] for one in car["conditions"]] == [True] * 3
    for tyre in ("cross-ply", "radial-ply"):
        assert not any(one["verdict"]["possible"] for one in models[tyre]["conditions"])
    page = (folder / "results" / "report.html").read_text()
    assert page.count("has a C that rises with frequency") == 2


@pytest.mark.sampled(4)
def test_an_earlier_demonstration_is_replaced(run, tmp_path, monkeypatch):
    """With the summary for programs, and of a small campaign without a report, so that it is quick."""
    from fourpole.app import analysis
    from fourpole.virtual import simulate_campaign
    from fourpole.virtual.simulate import demo_settings

    def small(folder, **settings):
        kept = [test for test in settings.pop("tests", ()) if "1.8bar" in test.name]
        return simulate_campaign(
            folder, pressures=[170e3], preloads=[1000.0], frequencies=[10.0, 24.0], tests=kept, **settings
        )

    monkeypatch.setattr("fourpole.virtual.simulate_campaign", small)
    monkeypatch.setattr(analysis, "_modelled", lambda study, *_: study)
    monkeypatch.setattr("fourpole.app.report.make_report", lambda study, new, png: new / "report.html")
    small(tmp_path / "demo", seed=8)
    (tmp_path / "demo" / "results").mkdir()
    (tmp_path / "demo" / "results" / "dynamic.csv").write_text("old")
    ran = run("demo", tmp_path / "demo", "--seed", 7, "--json")
    said = json.loads(ran.stdout)
    assert (ran.exit_code, ran.stderr) == (0, "")
    assert said["verdicts"] == {"ok": 9, "warning": 0, "rejected": 0}
    assert said["rejected"] == []
    assert said["found"]
    assert all(isinstance(sentence, str) for sentence in said["found"])
    assert pl.read_csv(tmp_path / "demo" / "results" / "dynamic.csv")["verdict"].to_list() == ["ok"] * 8
    fresh = small(tmp_path / "fresh", seed=7, **demo_settings()).folder
    for name in ("campaign.toml", "recordings/Köln_car-tyre_1.8bar_2000N_10Hz.csv"):
        assert (tmp_path / "demo" / name).read_bytes() == (fresh / name).read_bytes()


@pytest.mark.parametrize("command", ["demo", "simulate"])
def test_a_folder_of_somebody_else_is_refused_and_untouched(run, tmp_path, command):
    (tmp_path / "thesis.txt").write_text("years")
    ran = run(command, tmp_path)
    assert (ran.exit_code, ran.stdout) == (2, "")
    assert "is not empty and holds no truth.csv of a virtual campaign" in ran.stderr
    assert len(ran.stderr.splitlines()) == 1
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.txt"]


@pytest.mark.parametrize("command", ["demo", "simulate"])
def test_a_file_in_place_of_the_folder_is_refused(run, tmp_path, command):
    (tmp_path / "file").write_text("x")
    for place in (tmp_path / "file", tmp_path / "file" / "below"):
        ran = run(command, place)
        assert ran.exit_code == 2
        assert "choose another folder" in ran.stderr or "name a new or empty folder" in ran.stderr
