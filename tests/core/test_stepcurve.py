"""The tangent of a stepped record: one observation per rest."""

import numpy as np
import pytest

from fourpole.core.loadcurve import LoadCurve
from fourpole.core.meancurve import fit_curve

pytestmark = pytest.mark.thorough

LEVELS = np.array([220.0, 440.0, 660.0, 1100.0, 1550.0])
K = 130e3


def rig_run(rng, *, order, each, noise=30.0, slip=0.02, camber=0.01):
    """A race tyre on a rig: loads held in an order, and at each a sweep of slip that changes the radius, too.

    The deflection follows the sweep by `slip`, and each rest has an error by `camber`, both relative to its level.
    """
    load = np.repeat(LEVELS[list(order)], each)
    place = np.linspace(0.0, 4.0 * np.pi, each)
    sweep = np.tile(np.sin(place) + 0.3 * np.cos(2.0 * place), len(order))
    own = np.repeat(camber * rng.standard_normal(len(order)), each)
    memory = np.zeros(load.size)
    for i in range(1, load.size):
        memory[i] = 0.9 * memory[i - 1] + np.sqrt(1 - 0.9**2) * rng.standard_normal()
    return load / K * (1.0 + slip * sweep + own), load + noise * memory


ORDERS = {
    "sweeps": [4, 2, 1, 0, 3] * 3,
    "rises": [0, 1, 2, 3, 4] * 3,
    "there and back": [0, 1, 2, 3, 4, 3, 2, 1, 0],  # its mean is that of both branches, not that of the points
    "scattered": [3, 1, 4, 0, 2, 4, 1, 3, 0, 2],
}


@pytest.mark.statistical
@pytest.mark.parametrize("each", [40, 1000])
@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.sampled(2)
def test_a_rig_run_has_the_slope_of_its_line_and_an_uncertainty_of_percents(order, each):
    """1 % per rest makes some 1 % of K1; twenty errors over u have a root mean square of 0.5 to 2."""
    errors, shares = [], []
    for seed in range(20):
        x, f = rig_run(np.random.default_rng(seed), order=ORDERS[order], each=each)
        tangent = LoadCurve(x, f).tangent(885.0)
        line = float(np.polyfit(x, f, 1)[0])
        assert order == "there and back" or abs(tangent.stiffness - line) < 2.0 * tangent.std
        errors.append((tangent.stiffness - K) / tangent.std)
        shares.append(tangent.std / tangent.stiffness)
    assert 0.5 < np.sqrt(np.mean(np.square(errors))) < 2.0
    assert 0.004 < np.median(shares) < 0.03


def test_more_samples_of_the_same_rests_tell_nothing_new():
    """Each rest has an error of its own: a hundred times the samples leave the uncertainty where it was."""
    found = []
    for each in (20, 2000):
        rng = np.random.default_rng(4)
        own = 40.0 * rng.standard_normal(15)
        x = np.repeat(LEVELS[ORDERS["sweeps"]] / K, each)
        f = K * x + np.repeat(own, each) + 1.0 * rng.standard_normal(x.size)
        found.append(LoadCurve(x, f).tangent(885.0))
    assert found[0].stiffness == pytest.approx(found[1].stiffness, abs=0.1 * found[1].std)
    assert found[0].std == pytest.approx(found[1].std, rel=0.05)


def test_repeats_of_a_level_do_not_straighten_the_curve():
    """A knee between five levels, which carry no more than a line: ten rounds leave half of its uncertainty."""
    found = []
    for rounds in (1, 10):
        level = np.tile(np.linspace(0.002, 0.03, 5), rounds)
        x = np.repeat(level, 40)
        f = 1.2e5 * x + 300.0 * np.tanh((x - 0.012) / 0.004)
        found.append(LoadCurve(x, f + np.random.default_rng(2).standard_normal(x.size)).tangent(2000.0).std)
    assert found[1] > 0.5 * found[0]


@pytest.mark.parametrize("count", [6, 8, 12])
def test_levels_carry_the_order_that_shows(count):
    """A law of third order at quiet levels, up and down with friction: the tangent within 3 u, and u below 1 %."""
    level = np.linspace(0.002, 0.03, count)
    place = np.repeat(np.concatenate([level, level[-2::-1]]), 40)
    side = np.repeat([1.0, -1.0], [40 * count, 40 * (count - 1)])
    law = np.polynomial.Polynomial([0.0, 1.2e5, 2e6, 1e7])
    rng = np.random.default_rng(1)
    load = law(place) + 60.0 * side + 2.0 * rng.standard_normal(place.size)
    tangent = LoadCurve(place, load).tangent(float(law(0.016)))
    assert abs(tangent.stiffness - law.deriv()(0.016)) < 3.0 * tangent.std
    assert tangent.std < 0.01 * tangent.stiffness
    assert tangent.gap == pytest.approx(120.0, abs=5.0)


def test_exact_rests_are_met_exactly():
    place = np.repeat(np.linspace(0.0, 0.03, 9), 20)
    law = np.polynomial.Polynomial([0.0, 1.2e5, 2e6])
    curve = fit_curve(place, law(place), None)
    assert curve.stepped
    assert curve.order == 2
    assert curve.slope(0.02) == pytest.approx(law.deriv()(0.02), rel=1e-9)
