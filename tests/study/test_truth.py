"""What an analysis finds of tyres whose truth is known, by each route, and how far it says it may be off."""

import numpy as np
import polars as pl
import pytest

from fourpole.virtual import CROSS_PLY, RADIAL_PLY, simulate_campaign

pytestmark = pytest.mark.thorough

ROUTES = ("mobility", "relative", "transmissibility")


def beside_truth(study, truth):
    """dynamic.csv with the true values beside those found."""
    return study.dynamic.join(truth, on="test", suffix=" true", maintain_order="left")


def off(table, name):
    return (table[name] / table[f"{name} true"] - 1.0).abs().max()


@pytest.mark.parametrize("route", ROUTES)
@pytest.mark.sampled(3)
def test_without_noise_the_truth_is_found(clean, route):
    study = clean.analyse(route=route)
    assert study.counts == {"ok": 14, "warning": 0, "rejected": 0}
    table = beside_truth(study, clean.truth())
    assert off(table, "frequency [Hz]") < 1e-10
    assert max(off(table, name) for name in ("K1 [N/m]", "Re K* [N/m]", "Im K* [N/m]")) < 1e-7
    assert max(off(table, name) for name in ("K2 [N/m]", "C [N s/m]")) < 1e-6
    for name in ("TR measured [1]", "TR predicted [1]"):
        assert (table[name] / table["TR [1]"] - 1.0).abs().max() < 1e-8
    loss = table["Im K* [N/m] true"] / table["Re K* [N/m] true"]
    assert (table["loss factor [1]"] / loss - 1.0).abs().max() < 1e-6


def test_r_and_i_are_the_mobility_of_tyre_and_rig(clean):
    for row in beside_truth(clean.analyse(), clean.truth()).rows(named=True):
        jw = 2j * np.pi * row["frequency [Hz] true"]
        stiffness = row["Re K* [N/m] true"] + 1j * row["Im K* [N/m] true"]
        mobility = jw / stiffness + 1.0 / (15.0 * jw + 15.0 + 12440.0 / jw)
        assert row["R [m/(N s)]"] + 1j * row["I [m/(N s)]"] == pytest.approx(mobility, rel=1e-8)
        # R + jI is V1/F1, so the force is ahead of the motion by the negative of its angle
        assert row["phase F1-V1 [rad]"] == pytest.approx(-np.angle(mobility), abs=1e-8)


@pytest.fixture(scope="module")
def laboratory(tmp_path_factory):
    """Two tyres at two preloads as the demonstration records them, analysed by each route."""
    from fourpole import analyse

    folder = simulate_campaign(
        tmp_path_factory.mktemp("laboratory"),
        tyres=[CROSS_PLY, RADIAL_PLY],
        pressures=[240e3],
        preloads=[1000.0, 2000.0],
        frequencies=[10.0, 16.0, 18.0, 24.0],
    ).folder
    truth = pl.read_csv(folder / "truth.csv", infer_schema_length=None)
    return {route: beside_truth(analyse(folder, route=route, cache=folder / "cache"), truth) for route in ROUTES}


def errors(table, name, true=None, std=None):
    """Errors of a column over the uncertainty that is stated for it."""
    symbol, _, unit = name.partition(" [")
    std = std or f"u({symbol}) [{unit}"
    return ((table[name] - table[true or f"{name} true"]) / table[std]).to_numpy()


@pytest.mark.statistical
@pytest.mark.parametrize("route", ROUTES)
@pytest.mark.sampled(4)
def test_errors_agree_with_the_stated_uncertainties(laboratory, route):
    table = laboratory[route]
    assert set(table["verdict"]) == {"ok"}
    # Gains, phases and rig values are off by 2 std at most, and the same in all tests, so that the errors move
    # together: their root mean square is of the order of 1 but cannot average to it.
    found = {name: errors(table, name) for name in ("Re K* [N/m]", "Im K* [N/m]", "K1 [N/m]", "K2 [N/m]", "C [N s/m]")}
    found["TR"] = errors(table, "TR predicted [1]", "TR [1]", "u(TR) [1]")
    assert {name: error for name, error in found.items() if abs(error).max() > 4.0} == {}
    for name in ("Re K* [N/m]", "Im K* [N/m]", "TR"):
        assert 0.1 < np.sqrt(np.mean(found[name] ** 2)) < 2.5, name


@pytest.mark.parametrize("route", ROUTES)
@pytest.mark.sampled(3)
def test_laboratory_noise_leaves_what_the_sensors_allow(laboratory, route):
    """Gains to 0.02 %, phases to 0.01 degrees: K* to 1 %, K2 and C to 3 %, the amplitudes' ratio to 0.1 %."""
    table = laboratory[route]
    assert off(table, "frequency [Hz]") < 3e-5
    assert off(table, "K1 [N/m]") < 1e-3
    true = (table["Re K* [N/m] true"] ** 2 + table["Im K* [N/m] true"] ** 2).sqrt()
    for name in ("Re K* [N/m]", "Im K* [N/m]"):
        assert ((table[name] - table[f"{name} true"]) / true).abs().max() < 1e-2
    for name in ("K2 [N/m]", "C [N s/m]"):
        assert off(table, name) < 3e-2
        assert (table[name] / table[f"{name} true"] - 1.0).abs().median() < 5e-3
    # two gains, 2 std each, and the noise
    assert (table["TR measured [1]"] / table["TR [1]"] - 1.0).abs().max() < 2 * 2 * 2e-4 + 2e-4


@pytest.mark.parametrize(
    ("route", "blind_to"), [("mobility", "V2"), ("relative", "the rig"), ("transmissibility", "F1")]
)
@pytest.mark.sampled(3)
def test_a_route_does_not_look_at_what_it_is_said_to_be_blind_to(clean, route, blind_to):
    columns = ["Re K* [N/m]", "Im K* [N/m]", "K2 [N/m]", "C [N s/m]"]
    before = clean.analyse(route=route).dynamic.select(columns)
    if blind_to == "the rig":
        clean.edit("campaign.toml", 'value = 15.0, unit = "kg"', 'value = 15.3, unit = "kg"')
        clean.edit("campaign.toml", "value = 12.44,", "value = 12.2,")
    else:
        for test in (f"D{i}" for i in range(1, 13)):
            clean.change(test, lambda table: table.with_columns((1.1 * pl.col(blind_to)).alias(blind_to)))
    blind = clean.analyse(route=route).dynamic.select(columns)
    # the other channels share the estimate of the frequency, and that only
    assert max((blind[name] / before[name] - 1.0).abs().max() for name in columns) < 1e-9
    others = [clean.analyse(route=other).dynamic for other in ROUTES if other != route]
    assert all((other["Re K* [N/m]"] / before["Re K* [N/m]"] - 1.0).abs().max() > 1e-3 for other in others)


def test_a_rig_misstated_by_two_percent_costs_the_mobility_route_percents_and_the_relative_route_nothing(clean):
    clean.edit("campaign.toml", 'value = 15.0, unit = "kg"', 'value = 15.3, unit = "kg"')
    clean.edit("campaign.toml", "value = 12.44,", "value = 12.1912,")
    mobility, relative = (beside_truth(clean.analyse(route=route), clean.truth()) for route in ("mobility", "relative"))
    for name, least in (("K2 [N/m]", 0.01), ("C [N s/m]", 0.02)):
        assert (mobility[name] / mobility[f"{name} true"] - 1.0).abs().median() > least
        assert off(relative, name) < 1e-6
