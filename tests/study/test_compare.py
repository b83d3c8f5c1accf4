"""Tests held against each other: exchanged labels, a wrong pressure, copies, noise; their innocent twins stay ok."""

import csv
import shutil
from dataclasses import replace

import numpy as np
import pytest

from fourpole.campaign import folder
from fourpole.core.checks import Code
from fourpole.core.phasor import Phasors
from fourpole.study.analysis import analyse
from fourpole.study.compare import noises
from fourpole.study.points import Points
from fourpole.virtual import CROSS_PLY, RADIAL_PLY, simulate_campaign

pytestmark = pytest.mark.thorough

FREQUENCIES = [10.0, 12.0, 14.0, 17.0, 20.0]


@pytest.fixture(scope="module")
def honest(tmp_path_factory):
    """Two pressures, five frequencies, two repeats: rows S1, S2, D1 to D20 of one tyre."""
    folder = tmp_path_factory.mktemp("honest")
    simulate_campaign(
        folder, tyres=[RADIAL_PLY], pressures=[170e3, 220e3], preloads=[1000.0], frequencies=FREQUENCIES, repeats=2
    )
    return folder


@pytest.fixture
def campaign(honest, demodulated_recordings, tmp_path):
    """A copy of the campaign with changes to tests.csv: a function from its rows to nothing."""

    def make(change):
        shutil.copytree(honest, tmp_path / "copy")
        return changed(tmp_path / "copy", change, demodulated_recordings)

    return make


def changed(folder, change, cache=None):
    """The study of a campaign after changes to tests.csv: a function from its rows to nothing."""
    path = folder / "tests.csv"
    with path.open(newline="") as file:
        rows = list(csv.DictReader(file))
    change({row["test"]: row for row in rows})
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, rows[0])
        writer.writeheader()
        writer.writerows(rows)
    return analyse(folder, cache=cache)


def warned(study):
    """Remarks of the tests that are not ok."""
    return {row["test"]: row["remarks"] for row in study.dynamic.rows(named=True) if row["verdict"] != "ok"}


def exchange(rows, one, other):
    rows[one]["file"], rows[other]["file"] = rows[other]["file"], rows[one]["file"]


@pytest.mark.sampled(2)
def test_an_honest_campaign_has_no_remark(honest, demodulated_recordings):
    study = analyse(honest, cache=demodulated_recordings)
    assert warned(study) == {}
    held = study.checks.filter(study.checks["code"] == Code.OFF_CURVE.text)
    assert held["test"].to_list() == study.dynamic["test"].to_list()


@pytest.mark.sampled(2)
def test_exchanged_labels_are_named_on_both(campaign):
    found = warned(campaign(lambda rows: exchange(rows, "D3", "D8")))
    assert set(found) == {"D3", "D8"}
    assert all("the labels of D3 and D8 look exchanged" in remark for remark in found.values())


@pytest.mark.sampled(2)
def test_a_wrong_pressure_is_named_and_its_twin_is_innocent(campaign):
    def wrong(rows):
        rows["D3"]["pressure [bar]"] = rows["D8"]["pressure [bar]"]

    found = warned(campaign(wrong))
    assert set(found) == {"D3"}
    assert "on the curve of 1.7 bar" in found["D3"]


@pytest.mark.thorough
@pytest.mark.sampled(2)
def test_the_twin_of_a_wrong_pressure_keeps_its_stiffness(honest, demodulated_recordings, campaign):
    def wrong(rows):
        rows["D3"]["pressure [bar]"] = rows["D8"]["pressure [bar]"]

    tables = [study.dynamic for study in (analyse(honest, cache=demodulated_recordings), campaign(wrong))]
    (was, std), (now, _) = (
        table.filter(table["test"] == "D8").select("Re K* [N/m]", "u(Re K*) [N/m]").row(0) for table in tables
    )
    assert now == pytest.approx(was, abs=0.5 * std)


@pytest.mark.sampled(2)
def test_a_copy_is_named_on_the_test_that_it_is_not_of(campaign):
    """The recording of D8 also stands for D3, which is of another pressure."""

    def copied(rows):
        rows["D3"]["file"] = rows["D8"]["file"]

    found = warned(campaign(copied))
    assert set(found) == {"D3"}
    assert found["D3"].startswith("the recording is that of D8, too")


@pytest.mark.parametrize(("times", "found"), [(5.0, []), (20.0, [(3, "V2")])])
@pytest.mark.parametrize(("amplitude", "matters"), [(1.0, True), (100.0, False)])
def test_noise_that_matters_stands_out_from_that_of_the_others(times, found, amplitude, matters):
    std = np.full((6, 6), 1e-3)
    std[3, 4:] *= times
    phasors = Phasors.from_polar(np.full(6, 10.0), amplitude, amplitude, 0.0, amplitude)
    phasors = replace(phasors, covariance=std[:, :, None] ** 2 * np.eye(6))
    none = ((),) * 6
    tests = tuple(folder.Test(f"D{at}", at) for at in range(6))
    points = Points(tests, phasors, none, none, (None,) * 6, np.full(6, np.nan), ("",) * 6)
    rows = list(noises(points, np.ones(6, dtype=bool)))
    assert len(rows) == 18
    assert [(at, row.channel) for at, row in rows if row.verdict == "warning"] == (found if matters else [])


@pytest.mark.sampled(2)
def test_a_k1_far_below_the_dynamic_stiffness_is_named(campaign):
    """K1 is stated 100 times too small, in place of that of the static test."""

    def wrong(rows):
        for row in rows.values():
            row["K1 [N/m]"] = "" if row["kind"] == "static" else "1100"

    study = campaign(wrong)
    assert all("K1 looks too small" in remark for remark in study.dynamic["remarks"])


@pytest.mark.sampled(2)
def test_static_tests_of_exchanged_tyres_are_named(tmp_path):
    simulate_campaign(
        tmp_path, tyres=[CROSS_PLY, RADIAL_PLY], pressures=[170e3], preloads=[1000.0], frequencies=FREQUENCIES
    )
    cache = tmp_path / "cache"
    assert warned(analyse(tmp_path, cache=cache)) == {}
    remarks = changed(tmp_path, lambda rows: exchange(rows, "S1", "S2"), cache).dynamic["remarks"].to_list()
    assert all("K1 of cross-ply at 1.7 bar and radial-ply at 1.7 bar looks exchanged" in remark for remark in remarks)


def test_a_k1_above_the_dynamic_stiffness_is_named_on_the_tests_that_have_it(tmp_path):
    """K1 of one tyre of two is stated twice too large; a K1 of one row alone would be a fault of its test."""
    simulate_campaign(
        tmp_path, tyres=[CROSS_PLY, RADIAL_PLY], pressures=[170e3], preloads=[1000.0], frequencies=FREQUENCIES
    )

    def wrong(rows):
        for row in rows.values():
            row["K1 [N/m]"] = "4e5" if row["kind"] == "dynamic" and row["tyre"] == "cross-ply" else ""

    study = changed(tmp_path, wrong)
    large = study.checks.filter(study.checks["code"] == Code.K1_LARGE.text)["test"].to_list()
    assert large == study.dynamic.filter(study.dynamic["tyre"] == "cross-ply")["test"].to_list()


@pytest.mark.sampled(2)
def test_a_copy_under_another_frequency_is_named(campaign):
    """The search for the frequency begins elsewhere, so the amplitudes differ in their last digits."""

    def copy(rows):
        rows["D3"]["file"] = rows["D1"]["file"]

    remarks = warned(campaign(copy))
    assert set(remarks) == {"D3"}
    assert "the recording is that of D1" in remarks["D3"]


@pytest.mark.sampled(2)
def test_static_tests_of_exchanged_pressures_are_named(campaign):
    remarks = warned(campaign(lambda rows: exchange(rows, "S1", "S2")))
    assert len(remarks) == 20
    assert all(
        "K1 of radial-ply at 1.7 bar and radial-ply at 2.2 bar looks exchanged" in one for one in remarks.values()
    )
