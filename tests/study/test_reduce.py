"""The reduction's jobs: small, run by any executor, and nothing after them asks how amplitudes were found."""

import multiprocessing
import pickle
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from dataclasses import replace

import pytest

from fourpole.campaign import read_campaign
from fourpole.core.checks import worst_verdict
from fourpole.study import analyse, study
from fourpole.study.reduce import jobs_of, reduce_tests

_MOST_PICKLED = 10_000
TABLES = ("dynamic", "phasors", "previews", "corrections", "rig", "budget")


def jobs(folder, cache=None):
    campaign = read_campaign(folder)
    return jobs_of(campaign, campaign.of_kind("dynamic"), "joint", cache)


def test_a_job_is_small_whatever_the_campaign_holds(noisy):
    """The campaign has the channels and the rig of the demo; its other tests are no part of a job."""
    assert max(len(pickle.dumps(job)) for job in jobs(noisy.path)) < _MOST_PICKLED


def test_threads_and_spawned_processes_give_the_same(noisy):
    made = jobs(noisy.path)
    with ThreadPoolExecutor(2) as pool:
        threads = reduce_tests(made, executor=pool)
    with ProcessPoolExecutor(2, mp_context=multiprocessing.get_context("spawn")) as pool:
        processes = reduce_tests(made, executor=pool)
    assert [pickle.dumps(one) for one in threads] == [pickle.dumps(one) for one in reduce_tests(made)]
    assert [repr(one) for one in threads] == [repr(one) for one in processes]
    for one, other in zip(threads, processes, strict=True):
        assert one.points[0].phasors.covariance.tolist() == other.points[0].phasors.covariance.tolist()


def test_an_analysis_takes_the_executor_that_is_given(noisy):
    with ThreadPoolExecutor(1) as pool:
        given = analyse(noisy.path, executor=pool)
    own = analyse(noisy.path)
    assert all(getattr(given, name).equals(getattr(own, name)) for name in TABLES)


@pytest.mark.parametrize("file", ["", "recordings/none.csv", "../D1.csv"])
def test_a_job_that_fails_rejects_its_own_test(noisy, file):
    first, *_ = jobs(noisy.path)
    (point,) = replace(first, test=replace(first.test, file=file)).run().points
    assert point.phasors is None
    assert worst_verdict(row.verdict for row in point.checks) == "rejected"


def test_a_recording_with_two_points_has_two_rows(noisy, monkeypatch):
    """Every stage after the reduction takes each point by itself."""
    whole = analyse(noisy.path, route="mobility")

    def twice(made, **options):
        return [replace(one, points=one.points * 2) for one in reduce_tests(made, **options)]

    monkeypatch.setattr(study, "reduce_tests", twice)
    both = analyse(noisy.path, route="mobility")
    for name in ("dynamic", "phasors", "previews"):
        table = getattr(whole, name).filter(~getattr(whole, name)["test"].str.starts_with("S"))
        found = getattr(both, name).filter(~getattr(both, name)["test"].str.starts_with("S"))
        assert "point" not in table.columns
        assert found["point"].to_list() == [1, 2] * table.height
        found = found.drop("point")
        assert found.gather_every(2).equals(table)
        assert found.gather_every(2, 1).equals(table)
