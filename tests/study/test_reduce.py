"""The reduction's jobs: small, run by any executor, and nothing after them asks how amplitudes were found."""

import multiprocessing
import pickle
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from fourpole.campaign import read_campaign
from fourpole.core.checks import worst_verdict
from fourpole.study import analyse, analysis
from fourpole.study.points import Points
from fourpole.study.reduce import jobs_of
from fourpole.study.results import read_results
from fourpole.study.workers import reduce_tests
from fourpole.virtual import RADIAL_PLY, simulate_campaign

_MOST_PICKLED = 10_000
TABLES = ("dynamic", "phasors", "previews", "corrections", "rig", "budget")


def jobs(folder):
    campaign = read_campaign(folder)
    return jobs_of(campaign, campaign.of_kind("dynamic"), "joint")


def test_a_job_is_small_whatever_the_campaign_holds(noisy):
    """The campaign has the channels and the rig of the demo; its other tests are no part of a job."""
    assert max(len(pickle.dumps(job)) for job in jobs(noisy.path)) < _MOST_PICKLED


@pytest.mark.sampled(4)
def test_threads_and_spawned_processes_give_the_same(noisy):
    made = jobs(noisy.path)
    with ThreadPoolExecutor(2) as pool:
        threads = reduce_tests(made, executor=pool)
    with ProcessPoolExecutor(2, mp_context=multiprocessing.get_context("spawn")) as pool:
        processes = reduce_tests(made, executor=pool)
    assert pickle.dumps(threads) == pickle.dumps(reduce_tests(made))
    assert threads == processes


def test_an_analysis_takes_the_executor_that_is_given(noisy):
    with ThreadPoolExecutor(1) as pool:
        given = analyse(noisy.path, executor=pool)
    own = analyse(noisy.path)
    assert all(getattr(given, name).equals(getattr(own, name)) for name in TABLES)


@pytest.mark.parametrize("file", ["", "recordings/none.csv", "../D1.csv"])
def test_a_job_that_fails_rejects_its_own_test(noisy, file):
    first, *_ = jobs(noisy.path)
    points = reduce_tests([replace(first, test=replace(first.test, file=file))])
    assert not np.isfinite(points.phasors.frequency).any()
    assert worst_verdict(row.verdict for row in points.checks[0]) == "rejected"


def test_a_recording_with_two_points_has_two_rows(noisy, monkeypatch):
    """Every stage after the reduction takes each point by itself."""
    whole = analyse(noisy.path, route="mobility")

    def twice(made, **options):
        parts = [reduce_tests([job], **options) for job in made for _ in range(2)]
        return Points.joined(parts)

    monkeypatch.setattr(analysis, "reduce_tests", twice)
    both = analyse(noisy.path, route="mobility")
    for name in ("dynamic", "phasors", "previews"):
        table = getattr(whole, name).filter(~getattr(whole, name)["test"].str.starts_with("S"))
        found = getattr(both, name).filter(~getattr(both, name)["test"].str.starts_with("S"))
        assert "point" not in table.columns
        assert found["point"].to_list() == [1, 2] * table.height
        found = found.drop("point")
        assert found.gather_every(2).equals(table)
        assert found.gather_every(2, 1).equals(table)


@pytest.mark.sampled(4)
def test_points_of_one_recording_are_what_tests_of_their_own_are_on_the_joint_route(tmp_path, monkeypatch):
    """The frequencies of a recording are conditions of their own, whatever frequency its row states.

    Their K* may scatter together, which weighs the tests a little differently.
    """
    whole = simulate_campaign(
        tmp_path, tyres=[RADIAL_PLY], pressures=[170e3], preloads=[1000.0], frequencies=[10.0, 14.0, 18.0],
        added_masses=[0.0, 10.0], sensors=(0.03, 0.02), seed=5,
    ).folder  # fmt: skip
    separate = analyse(whole)
    reduced = reduce_tests(jobs(whole))
    by_mass = separate.dynamic["added mass [kg]"].to_numpy()
    groups = [np.flatnonzero(by_mass == mass).tolist() for mass in (0.0, 10.0)]
    merged = Points.joined([
        replace(reduce_tests([jobs(whole)[at]]), tests=(reduced.tests[rows[0]],)) for rows in groups for at in rows
    ])  # fmt: skip
    rows = (whole / "tests.csv").read_text().splitlines()
    kept = [separate.dynamic["test"][int(np.flatnonzero(by_mass == mass)[0])] for mass in (0.0, 10.0)]
    rows = [row for row in rows if not row.startswith("D") or row.split(",")[0] in kept]
    (whole / "tests.csv").write_text("\n".join(rows) + "\n")
    monkeypatch.setattr(analysis, "reduce_tests", lambda made, **options: merged)
    found = analyse(whole)
    assert list(zip(found.dynamic["test"], found.dynamic["point"], strict=True)) == [
        (test, point) for test in kept for point in (1, 2, 3)
    ]
    order = ["added mass [kg]", "frequency [Hz]"]
    both = [table.dynamic.sort(order) for table in (found, separate)]
    for name, unit, u in (("Re K*", "N/m", "Re K*"), ("C", "N s/m", "C"), ("TR predicted", "1", "TR")):
        joined, apart = (table[f"{name} [{unit}]"].to_numpy() for table in both)
        std = [table[f"u({u}) [{unit}]"].to_numpy() for table in both]
        assert (np.abs(joined - apart) < std[1]).all(), name
        assert ((std[0] / std[1] > 0.8) & (std[0] / std[1] < np.sqrt(3.0))).all(), name
    assert found.residuals["point"].to_list() == [1, 2, 3] * 2
    assert found.rigs[0].conditions == 3
    assert read_results(found.write(tmp_path / "results")).rigs == found.rigs
    assert found.budget.select(pl.struct("test", "point").n_unique()).item() == 6
