"""What an analysis makes when it is asked for: models where they take long, and figures as PNG."""

import json

import pytest

from fourpole.plot import FIGURES


def some_figures(monkeypatch):
    monkeypatch.setattr("fourpole.plot.catalogue.FIGURES", {key: FIGURES[key] for key in ("stiffness", "tr")})


@pytest.mark.usefixtures("without_figures")
@pytest.mark.sampled(4)
def test_models_are_not_part_of_an_analysis_that_they_would_make_long(run, campaign, monkeypatch):
    """The report and a note say the command; the models that it makes stand in the next report."""
    monkeypatch.setattr("fourpole.app.analysis._FEW_SECONDS", 0.1)
    results = campaign / "results"
    ran = run("analyse", campaign)
    assert ran.exit_code == 0
    assert not (results / "model.json").exists()
    assert f"no models (about 1 s): fourpole fit {results}, then fourpole report {results}" in ran.stderr
    assert "No model was fitted" in (results / "report.html").read_text(encoding="utf-8")
    assert run("fit", results, "--model", "zener").exit_code == 0
    assert run("report", results).exit_code == 0
    assert "No model was fitted" not in (results / "report.html").read_text(encoding="utf-8")


@pytest.mark.usefixtures("without_figures")
@pytest.mark.sampled(4)
def test_models_of_the_same_tables_stay_and_others_go(run, campaign):
    results = campaign / "results"
    run("analyse", campaign, "--no-models")
    run("fit", results, "--model", "zener")
    made = (results / "model.json").read_bytes()
    assert run("analyse", campaign).stderr.count("no models") == 0
    assert (results / "model.json").read_bytes() == made
    assert "zener" in (results / "report.html").read_text(encoding="utf-8")
    tests = campaign / "tests.csv"
    tests.write_text(tests.read_text().replace("1.7,1000,17", "1.7,1001,17"))
    assert "no models" in run("analyse", campaign, "--no-models").stderr
    assert not (results / "model.json").exists()


@pytest.mark.usefixtures("without_figures")
@pytest.mark.sampled(2)
def test_models_that_are_asked_for_are_fitted_anew(run, campaign, monkeypatch):
    monkeypatch.setattr("fourpole.app.analysis._FEW_SECONDS", 0.1)
    results = campaign / "results"
    run("analyse", campaign, "--models")
    chosen = json.loads((results / "model.json").read_text())["provenance"]["settings"]
    assert chosen == {"model": "auto"}


@pytest.mark.sampled(2)
def test_png_is_written_on_demand_and_goes_with_its_tables(run, campaign, monkeypatch):
    some_figures(monkeypatch)
    figures = campaign / "results" / "figures"
    run("analyse", campaign, "--no-models", "--png")
    assert {path.stem for path in figures.glob("*.png")} == {"stiffness", "tr"}
    assert {path.stem for path in figures.glob("*.svg")} == {"stiffness", "tr"}
    run("report", campaign / "results")
    assert not list(figures.glob("*.png"))
    assert list(figures.glob("*.svg"))
