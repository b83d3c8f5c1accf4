"""Tyres for a ride: models at operating points, their errors, and those that they share."""

import dataclasses
import json

import numpy as np
import polars as pl
import pytest

from fourpole.errors import CampaignError, ModelError
from fourpole.fitting.measured import read_measured
from fourpole.fitting.modelfile import read_model_file
from fourpole.fitting.modelling import fit_tyres, map_tyres, model_file
from fourpole.fitting.ridetyres import _by_shared_errors, tyres_for_ride
from fourpole.models import Zener
from fourpole.models.discrepancy import with_error
from fourpole.models.fit import fit
from fourpole.virtual import RUBBER_MOUNT, simulate_campaign

FREQUENCY = np.geomspace(1.0, 50.0, 12)
PRESSURE = "pressure [Pa]"


def table(path, pressures=(1.7e5, 2.0e5, 2.4e5), noise=1e-3, seed=3):
    """K* of a Zener tyre whose springs rise with the pressure."""
    rng, rows = np.random.default_rng(seed), []
    for p in pressures:
        k = Zener().stiffness(
            np.array([180e3, 120e3, 700.0]) * np.array([p / 2e5, p / 2e5, 1.0]), 2 * np.pi * FREQUENCY
        )
        k = k + noise * np.abs(k) * (rng.normal(size=k.size) + 1j * rng.normal(size=k.size))
        rows += [
            {"tyre": "a", PRESSURE: p, "frequency [Hz]": f, "Re K* [N/m]": one.real, "Im K* [N/m]": one.imag}
            for f, one in zip(FREQUENCY, k, strict=True)
        ]
    pl.DataFrame(rows).write_csv(path)
    return path


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """A file of fits and a map of the same tests."""
    folder = tmp_path_factory.mktemp("tyres")
    measured = read_measured(table(folder / "k.csv"), std=1e-3)
    model_file(measured, fit_tyres(measured, "zener")).write(folder / "model.json")
    model_file(measured, maps=map_tyres(measured, "zener")).write(folder / "map.json")
    return folder


def test_a_file_of_fits_gives_all_its_conditions(files):
    found = tyres_for_ride(files / "model.json")
    assert [one.state[PRESSURE] for one in found] == [1.7e5, 2.0e5, 2.4e5]
    assert found[0].label == "a, 1.7 bar"
    entry = read_model_file(files / "model.json").models[0]
    for one, condition in zip(found, entry.conditions, strict=True):
        assert one.tyre.values == pytest.approx(condition.values)
        (errors,) = one.tyre.errors.values()
        assert errors @ errors.T == pytest.approx(np.array(condition.covariance), rel=1e-9, abs=1e-12)
        assert one.band == pytest.approx((1.0, 50.0))
    (second,) = tyres_for_ride(files / "model.json", [{PRESSURE: 2.0e5}])
    assert second.tyre.values == pytest.approx(found[1].tyre.values)


def test_points_of_a_map_share_its_errors(files):
    one, two = tyres_for_ride(files / "map.json", [{PRESSURE: 1.9e5}, {PRESSURE: 1.95e5}])
    assert list(one.tyre.errors) == list(two.tyre.errors)
    (a,), (b,) = one.tyre.errors.values(), two.tyre.errors.values()
    rho = np.diag(a @ b.T) / np.sqrt(np.diag(a @ a.T) * np.diag(b @ b.T))
    assert np.all(rho > 0.9)  # near points of one surface
    assert one.tyre.values == pytest.approx([180e3 * 0.95, 120e3 * 0.95, 700.0], rel=0.01)


def test_what_is_refused_says_what_to_do(files):
    with pytest.raises(ModelError, match=r'map over pressure: state the operating point, --at "pressure=\.\.\."'):
        tyres_for_ride(files / "map.json")
    with pytest.raises(ModelError, match=r"3 bar is outside what was measured"):
        tyres_for_ride(files / "map.json", [{PRESSURE: 3e5}])
    assert tyres_for_ride(files / "map.json", [{PRESSURE: 2.5e5}], beyond=True)[0].remarks
    with pytest.raises(ModelError, match=r"fits at 1\.7 bar; 2 bar; 2\.4 bar"):
        tyres_for_ride(files / "model.json", [{PRESSURE: 3e5}])
    with pytest.raises(ModelError, match="is of 'a', not of 'b'"):
        tyres_for_ride(files / "model.json", specimen="b")
    with pytest.raises(CampaignError, match="holds neither results nor a campaign"):
        tyres_for_ride(files.parent)  # a folder without results


def test_a_model_that_is_not_causal_is_refused(tmp_path):
    measured = read_measured(table(tmp_path / "k.csv", (2e5,)), std=0.2)
    model_file(measured, fit_tyres(measured, "structural")).write(tmp_path / "model.json")
    with pytest.raises(ModelError, match=r"structural model of a, 2 bar is not causal.*fourpole fit --model prony"):
        tyres_for_ride(tmp_path / "model.json")


@pytest.mark.sampled(2)
def test_too_many_conditions_are_refused(files, tmp_path):
    many = table(tmp_path / "many.csv", tuple(np.geomspace(1e5, 4e5, 42)))
    measured = read_measured(many, std=1e-3)
    model_file(measured, fit_tyres(measured, "zener")).write(tmp_path / "many.json")
    with pytest.raises(ModelError, match="42 tyres and conditions: state --at"):
        tyres_for_ride(tmp_path / "many.json")


@pytest.fixture(scope="module")
def campaign(tmp_path_factory):
    """Two preloads of one mount on one rig, analysed, with a model beside the results."""
    from fourpole import analyse

    made = simulate_campaign(
        tmp_path_factory.mktemp("two"), tyres=[RUBBER_MOUNT], pressures=[170e3],
        preloads=[800.0, 1000.0], frequencies=[10.0, 13.0, 17.0, 20.0, 24.0],
    )  # fmt: skip
    results = analyse(made.folder, monte_carlo=0).write(made.folder / "results")
    measured = read_measured(results)
    model_file(measured, fit_tyres(measured, "maxwell:2")).write(results / "model.json")
    return results


def test_fits_of_one_campaign_share_the_errors_of_its_sensors(campaign):
    one, two = (each.tyre for each in tyres_for_ride(campaign))
    common = [source for source in one.errors if source in two.errors]
    assert [source.rpartition(": ")[2] for source in common] == ["sensors and rig"]
    entry = read_model_file(campaign / "model.json").models[0]
    for tyre, condition in zip((one, two), entry.conditions, strict=True):
        whole = sum(each @ each.T for each in tyre.errors.values())
        assert np.diag(whole) == pytest.approx(np.diag(condition.covariance), rel=1e-6)
        shared = tyre.errors[common[0]]
        share = np.diag(shared @ shared.T) / np.diag(whole)
        assert np.all(share <= 1.0 + 1e-9)
        assert np.all(share[1:] > 0.05)  # the first parameter is mostly K1 of the static test


def test_a_shared_error_moves_the_parameters_as_a_fit_to_moved_data(campaign):
    entry = read_model_file(campaign / "model.json").models[0]
    measured = read_measured(campaign).of(entry.tyre)[0]
    tyre = tyres_for_ride(campaign)[0].tyre
    effects = _by_shared_errors(entry, entry.conditions[0], tyre, measured)
    k = tyre.stiffness(measured.own.omega)
    data = dataclasses.replace(with_error(measured.data, entry.discrepancy).at(k), recorded=None)
    fixed = dataclasses.replace(data, relative=None, reference=None)  # the covariance stays that of the first fit
    first = fit(tyre.model, fixed, tyre.values)
    for at in np.argsort(-np.abs(effects[1]))[:3]:
        moved = dataclasses.replace(fixed, stiffness=fixed.stiffness + 1e-2 * data.relative[:, at] * k)
        change = (fit(tyre.model, moved, first.values).values - first.values) / 1e-2
        # the covariance of the file is that of the recordings near the model, which these data leave out
        assert change == pytest.approx(effects[:, at], rel=0.1, abs=0.02 * np.abs(effects[:, at]).max())


def test_a_file_that_lies_elsewhere_has_no_errors_in_common(campaign, tmp_path):
    copy = tmp_path / "model.json"
    copy.write_text(json.dumps(json.loads((campaign / "model.json").read_text())))
    one, two = (each.tyre for each in tyres_for_ride(copy))
    assert not set(one.errors) & set(two.errors)
