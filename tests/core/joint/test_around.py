"""The likelihood of K* about that of a model, against a minimisation without derivatives of its own."""

import numpy as np
import pytest
from scipy.optimize import least_squares
from tests.core.joint.conftest import USUAL
from tests.core.joint.inertia import Lab

from fourpole.core.joint import solve_joint
from fourpole.core.joint.around import Likelihood
from fourpole.core.specimen import Body


@pytest.fixture(scope="module")
def solved(make):
    joint = make(USUAL, frequencies=4, families=2, seed=3).identify()
    return joint.solution, Likelihood(joint.problem, joint.solution.z, joint.solution.stiffness)


@pytest.fixture(scope="module")
def likelihood(solved) -> Likelihood:
    return solved[1]


def test_about_the_solution_it_is_the_solution(solved):
    solution, likelihood = solved
    every = np.arange(solution.stiffness.size)
    near = likelihood.around(every, solution.stiffness)
    std = np.sqrt(np.diagonal(solution.own, 0, 1, 2))
    assert np.all(np.abs(near.change) < 1e-2 * std)
    assert near.own == pytest.approx(solution.own, rel=1e-3)
    shared = solution.slope @ solution.covariance @ np.swapaxes(solution.slope, 1, 2)
    assert near.shared @ np.swapaxes(near.shared, 1, 2) == pytest.approx(shared, rel=1e-2, abs=1e-3 * shared.max())


def test_the_shared_values_are_the_best_for_a_given_stiffness(likelihood):
    """All K* raised by 2 %: the gains that explain it are found by another solver too."""
    problem, every = likelihood.problem, np.arange(likelihood.stiffness.size)
    given = 1.02 * likelihood.stiffness

    def off(z):
        return np.concatenate([z, problem.columns("residual", z, given).ravel()])

    best = least_squares(off, likelihood.z, xtol=1e-12, ftol=1e-12).x
    near = likelihood.around(every, given)
    assert near.z == pytest.approx(best, abs=2e-3)


def test_k_of_other_conditions_is_free(likelihood):
    """Where one condition is given, the others follow the shared values: the objective is lower than with K* held."""
    problem = likelihood.problem
    one = np.array([0])
    near = likelihood.around(one, 1.02 * likelihood.stiffness[one])
    held = likelihood.stiffness.copy()
    held[0] *= 1.02

    def objective(z, stiffness):
        return z @ z + np.sum(problem.columns("residual", z, stiffness) ** 2)

    _, stiffness, _ = likelihood._start(one)
    assert stiffness[0] == held[0]
    assert objective(near.z, stiffness) <= objective(near.z, held)


@pytest.mark.sampled(4)
def test_about_a_model_that_is_far_from_the_tests_it_is_linear_about_the_solution():
    """A belt makes the search of the shared values long: it never comes back from a K* a third off."""
    phasors, rig, keywords, *_ = Lab(conditions=2, noise=1e-5).draw(3)
    joint = solve_joint(phasors, rig, np.nan, **keywords, bodies={"": Body.weighed(9.0)})
    far = Likelihood(joint.problem, joint.solution.z, joint.solution.stiffness)
    here, given = far.stiffness, np.arange(4)
    straight = far.around(given, here[given])
    std = np.sqrt(np.sum(straight.shared**2, axis=(1, 2)) + np.trace(straight.own, axis1=1, axis2=2))
    for size in (1e-3, 0.3):
        value = here[given] * (1 + size * np.array([1, -1, 1j, -1j]))
        near = far.around(given, value)
        off = value * (1 + near.change @ [1, 1j]) / here[given] - 1
        assert np.all(np.abs(off) < 3 * std)
