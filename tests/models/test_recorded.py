"""Models held against recordings of a rig with one mass, whose errors are large and shared by all tests."""

import numpy as np
import pytest
from tests.models.one_mass import as_recorded, broad, impossible, solved, zener

from fourpole.models.causality import check_possible
from fourpole.models.choice import fit_conditions
from fourpole.models.families import model_named

SEEDS = range(12)


@pytest.mark.parametrize("std", [0.03, 0.01])
@pytest.mark.sampled(2)
def test_linear_tyres_are_possible_however_small_the_noise(std):
    """Linear in the gains, the data of most of these seeds would be impossible at noise of 1e-4."""
    told = [
        not check_possible(one).possible
        for seed in SEEDS
        for one in as_recorded(solved(seed, (zener, broad), std, count=15, band=(2.0, 80.0))[0], 2)
    ]
    assert sum(told) <= 3  # at a chance of 1 % each, more than 3 of 24 have a probability of 1e-4


@pytest.mark.sampled(4)
def test_the_same_data_linear_in_the_gains_are_called_impossible():
    told = 0
    for seed in SEEDS:
        (one,) = as_recorded(solved(seed, (broad,), 0.03, count=15, band=(2.0, 80.0))[0], 1)
        plain = type(one)(**{name: getattr(one, name) for name in ("omega", "stiffness", "covariance", "k1", "k1_std")})
        told += not check_possible(plain).possible
    assert told > 3


@pytest.mark.parametrize("std", [0.03, 0.01])
@pytest.mark.sampled(2)
def test_a_tyre_that_is_not_possible_is_found_with_one_mass(std):
    for seed in SEEDS:
        odd, good = as_recorded(solved(seed, (impossible, zener), std, noise=1e-3)[0], 2)
        assert not check_possible(odd).possible
        assert check_possible(good).possible


@pytest.mark.statistical
@pytest.mark.sampled(4)
def test_intervals_of_a_fit_hold_the_truth():
    inside, model = [], model_named("zener")
    for seed in range(30):
        joint, _ = solved(seed, (zener,), 0.03)
        rng = np.random.default_rng(seed)
        truth = np.array([180e3 * rng.uniform(0.8, 1.2), 60e3 * rng.uniform(0.5, 2), 700 * rng.uniform(0.5, 2)])
        (found,) = fit_conditions(model, as_recorded(joint, 1))
        inside.append(np.abs(found.values - truth) < 1.96 * found.std)
    assert np.all(np.mean(inside, axis=0) > 0.8)  # 24 of 30: of 95 % intervals fewer hold it with a chance of 1e-3


def test_a_model_that_no_error_can_explain_is_not_followed():
    (data,) = as_recorded(solved(0, (zener,), 0.03)[0], 1)
    near = data.at(data.stiffness)
    assert near.at(10 * data.stiffness) is near
