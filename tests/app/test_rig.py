"""`fourpole rig`: the rig as found, on a terminal and for programs."""

import json
from dataclasses import replace

import polars as pl
import pytest
from tests.plot.conftest import results_of
from tests.plot.rig_found import MISFIT, VALUES, rig_table, with_rig_found

from fourpole.report.words.limits import limits
from fourpole.report.words.rig import rigs_in_words


@pytest.fixture(scope="module")
def rig_results():
    crossed = {
        "component": "cross-talk V2 in V1", "unit": "1", "size": 0.098, "result": "TR", "shift": 165.5,
        "words": "cross-talk of V2 in V1, +9.8 % of its size", "key": "std_crosstalk",
    }  # fmt: skip
    return with_rig_found(results_of(pressures=(170e3,), preloads=(1000.0,)), unseen=[crossed])


@pytest.fixture
def folder(tmp_path):
    """Write results as an analysis does."""

    def written(results):
        for name in ("static", "dynamic", "rig", "residuals", "budget"):
            table = getattr(results, name)
            if table.width:
                table.write_csv(tmp_path / f"{name}.csv")
        (tmp_path / "study.json").write_text(json.dumps(results.record), encoding="utf-8")
        return tmp_path

    return written


def test_values_fit_unseen_and_limits_are_shown(run, folder, rig_results):
    ran = run("rig", folder(rig_results))
    assert (ran.exit_code, ran.stderr) == (0, "")
    said = " ".join(ran.stdout.split())
    (found,) = rigs_in_words(rig_results)
    for text in (
        "moving mass m [kg] 15.00 ± 0.20 15.020 ± 0.020 +0.20 0.31 found from your data",
        "preload spring K3 [kN/m] 12.440 ± 0.040 12.451 ± 0.012",
        "± is U (k = 2)",
        f"{found.fit} {found.summary} {found.gain}",
        f"What these data cannot show: - {' - '.join(found.unseen)}",
        f"What limits me: - {limits(rig_results)[0].text}",
    ):
        assert text in said, text
    assert "does not fit" not in said


def test_a_misfit_is_told_with_its_candidates(run, folder, rig_results):
    results = with_rig_found(rig_results, **MISFIT)
    rows = results.residuals.with_columns(
        pl.when(pl.col("test") == "D3").then(60.0).otherwise(1.0).alias("outlier [1]")
    )
    said = " ".join(run("rig", folder(replace(results, residuals=rows))).stdout.split())
    (found,) = rigs_in_words(results)
    assert f"The rig as stated does not fit: - {' - '.join(found.misfit)}" in said
    assert f"the best first: - {' - '.join(found.candidates)}" in said
    assert "Tests that do not agree with the others: - D3 (variance enlarged 60 times)" in said


def test_programs_get_one_document_in_si(run, folder, rig_results):
    ran = run("rig", folder(rig_results), "--json")
    said = json.loads(ran.stdout)
    assert (ran.exit_code, ran.stderr) == (0, "")
    (rig,) = said["rigs"]
    assert (rig["rig"], rig["fits"], rig["chi2"], rig["dof"]) == ("", True, 250.0, 240.0)
    by = {row["value"]: row for row in rig["values"]}
    assert list(by) == list(VALUES)
    assert by["preload_stiffness"]["found"] == 12451.0
    assert by["phase V1"]["seen from"] is None
    assert by["gain V1"]["finding"] == "not determined"
    assert rig["unseen"]
    assert [(limit["quantity"], limit["source"], limit["share [1]"]) for limit in said["limits"]] == [
        ("Re K*", "K1 branch gap", 0.5),
        ("Im K*", "K1 branch gap", 0.5),
        ("K2", "K1 branch gap", 0.5),
        ("C", "K1 branch gap", 0.5),
    ]


def test_another_route_is_exit_2_and_says_how_to_get_it(run, folder):
    results = results_of(pressures=(170e3,), preloads=(1000.0,))
    record = {"settings": {"route": "mobility"}, "title": "x"}
    nothing = pl.DataFrame()
    ran = run("rig", folder(replace(results, record=record, rig=nothing, residuals=nothing)))
    assert (ran.exit_code, ran.stdout) == (2, "")
    said = " ".join(ran.stderr.split())
    assert "holds no rig.csv, for it was made by the mobility route" in said
    assert "fourpole analyse CAMPAIGN --route joint" in said
    assert "Traceback" not in said


def test_a_folder_that_is_none_is_exit_2(run, tmp_path):
    ran = run("rig", tmp_path / "nowhere")
    assert (ran.exit_code, ran.stdout) == (2, "")
    assert "no such folder of results" in ran.stderr


def test_texts_of_files_steer_no_terminal_and_are_no_markup(run, folder, rig_results):
    hostile = "[bold]\x1b]0;owned\x07[/nothing]"
    values = {hostile: VALUES["gain V1"], **VALUES}
    rig = rig_table(values, hostile).with_columns(pl.lit(hostile).alias("remarks"))
    record = {**rig_results.record, "joint": {hostile: {**MISFIT, "notes": [hostile]}}}
    ran = run("rig", folder(replace(rig_results, rig=rig, record=record)))
    assert ran.exit_code == 0
    assert "\x1b" not in ran.stdout
    assert "\x07" not in ran.stdout
    assert "[bold]\ufffd]0;owned\ufffd[/nothing]" in ran.stdout


def test_two_rigs_are_told_apart(run, folder, rig_results):
    rigs = pl.when(pl.col("test") == "D1").then(pl.lit("old")).otherwise(pl.lit("new")).alias("rig")
    both = with_rig_found(replace(rig_results, dynamic=rig_results.dynamic.with_columns(rigs)))
    said = run("rig", folder(both)).stdout
    assert "Rig old" in said
    assert "Rig new" in said
    assert "rig new: U of K2 " in said
