"""Smooth curves of K*: a test that lies on another condition's curve is found, and honest ones are left alone."""

import numpy as np
import pytest

from fourpole.core.curves import Samples, curves_of

RISE = (1.0, 1.15, 1.4)  # the level of three conditions; the last is of another specimen
HERTZ = np.array([10.0, 11.5, 13.0, 14.5, 16.0, 18.0, 20.0, 22.0, 24.0])


def campaign(seed=0, scatter=0.002, repeats=2, hertz=HERTZ, shared=0.0):
    """K* of a Zener body under two conditions and of another body, with an error of the gain of V1 in all tests."""
    rng = np.random.default_rng(seed)
    family = np.repeat(np.arange(3), hertz.size * repeats)
    frequency = np.tile(hertz, 3 * repeats) * (1 + 0.003 * rng.normal(size=family.size))
    tau = np.where(family == 2, 0.012, 0.008) * 2j * np.pi * frequency
    stiffness = 1e5 * np.array(RISE)[family] * (1 + 0.9 * tau / (1 + tau))
    lever = 1 / (1 - 2 / (1 - (frequency / 21) ** 2 + 0.3j))
    stiffness *= 1 + scatter * (rng.normal(size=family.size) + 1j * rng.normal(size=family.size)) + shared * lever
    return Samples(
        stiffness=stiffness,
        noise=np.full(family.size, 1e-4),
        frequency=frequency,
        family=family,
        specimen=(family == 2).astype(int),
        shared=lever[:, None],
        prior=np.array([0.03]),
    )


def strange(curves):
    return np.flatnonzero(curves.strange).tolist()


@pytest.mark.parametrize("scatter", [1e-6, 0.002, 0.01])
@pytest.mark.parametrize("shared", [0.0, 0.02j])
@pytest.mark.sampled(2)
def test_honest_tests_lie_on_their_curves(scatter, shared):
    for seed in range(5):
        assert strange(curves_of(campaign(seed, scatter, shared=shared))) == []


@pytest.mark.statistical
@pytest.mark.sampled(4)
def test_few_honest_campaigns_have_a_strange_test():
    """The probability is 1 % for all tests of a campaign together; 6 of 120 have one once in 700 times."""
    assert sum(bool(strange(curves_of(campaign(seed)))) for seed in range(120)) <= 5


@pytest.mark.parametrize("repeats", [1, 2])
def test_exchanged_tests_lie_on_each_others_curves(repeats):
    data = campaign(repeats=repeats)
    one, other = 4, 4 + HERTZ.size * repeats  # the same frequency under the next condition
    data.stiffness[[one, other]] = data.stiffness[[other, one]]
    data.frequency[[one, other]] = data.frequency[[other, one]]
    curves = curves_of(data)
    assert strange(curves) == [one, other]
    assert curves.distance(one, 1) < curves.limit < curves.distance(one, 2)
    assert curves.distance(other, 0) < curves.limit


def test_six_of_fifty_four_are_found():
    data = campaign()
    rows = np.array([2, 7, 14])
    pairs = np.concatenate([rows, rows + 18])
    data.stiffness[pairs] = data.stiffness[np.roll(pairs, 3)]
    assert strange(curves_of(data)) == sorted(pairs.tolist())


def test_a_test_of_no_curve_is_strange_by_its_own_distance():
    data = campaign()
    data.stiffness[30] *= 0.9
    curves = curves_of(data)
    assert strange(curves) == [30]
    assert np.expm1(curves.off[30].real) == pytest.approx(-0.1, abs=0.01)
    assert min(curves.distance(30, family) for family in (0, 2)) > curves.limit


def test_the_scatter_of_the_others_is_the_measure():
    data = campaign(scatter=0.02)
    data.stiffness[30] *= 0.97
    assert strange(curves_of(data)) == []


def test_departures_below_one_percent_are_no_fault():
    data = campaign(scatter=1e-5)
    data.stiffness[30] *= 1.005
    assert strange(curves_of(data)) == []


def test_too_few_frequencies_have_no_curve():
    assert curves_of(campaign(hertz=HERTZ[:2], repeats=3)) is None
    assert curves_of(campaign(hertz=HERTZ[:3], repeats=1)) is None


def test_another_curve_does_not_reach_beyond_its_frequencies():
    data = campaign()
    data.frequency[8] = 40.0
    assert curves_of(data).distance(8, 1) == np.inf


def test_a_test_without_a_lever_is_left_out():
    data = campaign()
    data.shared[4] = np.nan
    curves = curves_of(data)
    assert not curves.judged[4]
    assert curves.judged.sum() == data.frequency.size - 1
