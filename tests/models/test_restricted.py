"""Scatter by restricted maximum likelihood: against the dense formula, and under errors that all conditions share."""

import numpy as np
import pytest

from fourpole.models.data import StiffnessData
from fourpole.models.laws import Laws
from fourpole.models.linearised import PRIOR, PRIOR_WIDTH, Conditions, Scatter
from fourpole.models.maxwell import Zener
from fourpole.models.surface_choice import _Likelihood, scatter_of
from fourpole.models.together import search

OMEGA = 2 * np.pi * np.geomspace(4.0, 40.0, 6)
X = np.linspace(-1.0, 1.0, 15)
BASIS = np.stack([np.ones(15), X], axis=1)
TRUTH = np.stack([180e3 * np.exp(0.1 * X), 140e3 * np.exp(0.2 * X), np.full(15, 800.0)], axis=1)
NOISE = 1e-3
UNKNOWN = np.ones(7, dtype=bool)


def fitted(seed, condition=0.0, along=0.0, gain=0.02, common=False, real=False):
    rng = np.random.default_rng(seed)
    error = gain * (rng.standard_normal() + 0.5j * rng.standard_normal())
    data, shared = [], []
    for values in TRUTH:
        off = condition * (rng.standard_normal() + 1j * rng.standard_normal() * (not real))
        off = off + along * rng.standard_normal(OMEGA.size)
        clean = Zener().stiffness(values, OMEGA) * np.exp(error + off)
        std = NOISE * np.abs(clean)
        draw = rng.standard_normal(OMEGA.size) + 1j * rng.standard_normal(OMEGA.size)
        data.append(StiffnessData.of(OMEGA, clean + std * draw, std))
        effects = data[-1].stiffness[:, None] * [gain, 0.5j * gain]
        shared.append(np.stack([effects.real, effects.imag], axis=1).reshape(-1, 2))
    conditions = Conditions.of(Zener(), data, shared, common=False)
    conditions = conditions.with_errors_of_model() if common else conditions
    laws = Laws((BASIS,) * 3, conditions.shared, 15)
    return search(conditions, laws, Zener().link(TRUTH), Scatter((2e-3, 2e-3), (2e-3, 2e-3)))


def dense(found, scatter):
    """-2 log of the restricted likelihood, from the matrices over all data, and of the prior."""
    (rows,) = found.rows
    groups, size = rows.off.shape
    whole = np.zeros((groups * size, groups * size))
    for at in range(groups):
        block = np.zeros((size, size))
        for n in range(size // 2):
            block[2 * n : 2 * n + 2, 2 * n : 2 * n + 2] = rows.own[at, n] + np.diag(np.square(scatter.frequency))
        part = slice(at * size, (at + 1) * size)
        whole[part, part] = block + np.tile(np.diag(np.square(scatter.condition)), (size // 2, size // 2))
    shared = rows.columns[:, :, 3:].reshape(groups * size, -1)
    variances = 1.0 / found.conditions.precision(scatter.variances)
    whole += (shared * variances) @ shared.T
    laws = np.concatenate([(rows.columns[:, :, p, None] * BASIS[:, None]).reshape(-1, 2) for p in range(3)], axis=1)
    # residuals about no shared error at all
    off = rows.off.ravel() + shared @ found.errors
    inverse = np.linalg.inv(whole)
    normal = laws.T @ inverse @ laws
    left = off - laws @ np.linalg.solve(normal, laws.T @ inverse @ off)
    likelihood = np.linalg.slogdet(whole)[1] + np.linalg.slogdet(normal)[1] + left @ inverse @ left
    return likelihood + np.sum((np.log(np.divide(scatter.condition, PRIOR)) / PRIOR_WIDTH) ** 2)


@pytest.mark.parametrize("common", [False, True])
def test_it_is_the_likelihood_of_the_whole_covariance(common):
    found = fitted(1, condition=2e-3, common=common)
    likelihood = _Likelihood(found)
    first, second = (
        Scatter((1e-3, 2e-3), (1e-3, 2e-3), common=(1e-3, 2e-3)),
        Scatter((3e-3, 5e-4), (5e-4, 1e-3), common=(2e-3, 1e-3)),
    )
    change = likelihood.at(second.variances, UNKNOWN).value - likelihood.at(first.variances, UNKNOWN).value
    assert change == pytest.approx(dense(found, second) - dense(found, first), rel=1e-6)


def test_its_slope_is_that_of_differences():
    found = fitted(1, condition=2e-3, common=True)
    likelihood = _Likelihood(found)
    here = Scatter((2e-3, 1e-3), (1e-3, 2e-3), common=(1e-3, 2e-3)).variances
    for at in (0, 1, 2, 3, 5, 6):
        step = np.zeros(7)
        step[at] = 1e-4 * here[at]
        slope = (likelihood.at(here + step, UNKNOWN).value - likelihood.at(here - step, UNKNOWN).value) / (2 * step[at])
        assert likelihood.at(here, UNKNOWN).downhill[at] == pytest.approx(-slope, rel=1e-4)


def test_the_prior_of_mountings_is_one_percent_or_a_factor_of_three():
    assert Scatter((0.01, 0.0)).log_prior == 0.0
    assert Scatter((0.03, 0.01)).log_prior == pytest.approx(-0.5)
    assert Scatter((0.01 / 9, 0.03)).log_prior == pytest.approx(-2.5)


@pytest.mark.statistical
@pytest.mark.sampled(4)
def test_gains_and_phases_are_no_scatter():
    """A chance of 10 % for each of the two variances at each frequency: 9.5 of 50 maps, at most 19 with 99.9 %."""
    shown = [scatter_of(fitted(seed)) for seed in range(50)]
    assert sum(bool(np.any(one.frequency)) for one in shown) <= 19
    assert max(max(one.condition) for one in shown) < NOISE


@pytest.mark.sampled(4)
def test_a_scatter_is_found_beside_gains_and_phases():
    """Of 15 conditions, 30 numbers less 4 of the level and slope: known to 20 % each way, in the mean of 10 to 6 %."""
    shown = [scatter_of(fitted(seed, condition=5e-3)).condition for seed in range(10)]
    assert np.sqrt(np.mean(np.square(shown), axis=0)) == pytest.approx([5e-3, 5e-3], rel=0.2)
    mountings = np.array([scatter_of(fitted(seed, condition=5e-3, real=True)).condition for seed in range(10)])
    assert np.sqrt(np.mean(mountings[:, 0] ** 2)) == pytest.approx(5e-3, rel=0.2)
    assert np.max(mountings[:, 1]) < NOISE
    along, across = np.mean([scatter_of(fitted(seed, along=5e-3)).frequency for seed in range(10)], axis=0)
    assert along == pytest.approx(5e-3, rel=0.1)
    assert across < NOISE
