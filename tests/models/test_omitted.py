"""Leave-one-out in closed form, against fits without each condition."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from fourpole.models.data import StiffnessData, complex_columns
from fourpole.models.laws import Laws
from fourpole.models.linearised import Conditions, Scatter, Weights
from fourpole.models.maxwell import Zener
from fourpole.models.together import LeaveOneOut, assembled, density_without_each, search, without_each

OMEGA = 2 * np.pi * np.linspace(5.0, 30.0, 9)
X = np.linspace(-1.0, 1.0, 6)
BASIS = np.stack([np.ones(6), X], axis=1)
TRUTH = np.stack([180e3 * np.exp(0.1 * X), 140e3 * np.exp(0.2 * X), np.full(6, 800.0)], axis=1)
SCATTER = Scatter((1e-3, 2e-3), (5e-4, 3e-4))
#: Log density of these scatters of conditions: normal about log 1 % with the standard deviation log 3.
PRIOR = -0.5 * (np.log([0.1, 0.2]) / np.log(3)) @ (np.log([0.1, 0.2]) / np.log(3))


def measured(noise):
    """Conditions under a gain of 1 % and a phase of 0.5 %, and the effects of these."""
    rng = np.random.default_rng(3)
    data, shared = [], []
    for values in TRUTH:
        clean = Zener().stiffness(values, OMEGA) * np.exp(0.01 - 0.005j)
        std = noise * np.abs(clean)
        draw = rng.standard_normal(OMEGA.size) + 1j * rng.standard_normal(OMEGA.size)
        data.append(StiffnessData.of(OMEGA, clean + std * draw, std))
        effects = data[-1].stiffness[:, None] * [0.01, 0.005j]
        shared.append(np.stack([effects.real, effects.imag], axis=1).reshape(-1, 2))
    return data, shared


def fitted(data, shared, kept):
    conditions = Conditions.of(Zener(), [data[at] for at in kept], [shared[at] for at in kept], common=False)
    laws = Laws((BASIS[kept],) * 3, 2, len(kept))
    return search(conditions, laws, Zener().link(TRUTH[kept]), SCATTER)


@pytest.fixture(scope="module")
def cases():
    data, shared = measured(1e-3)
    whole = fitted(data, shared, list(range(6)))
    return data, shared, whole, [fitted(data, shared, [at for at in range(6) if at != out]) for out in range(6)]


def test_an_omitted_condition_is_predicted_as_by_a_fit_without_it(cases):
    """Coefficients move by some 1e-3: terms of second order are 1e-3 of the change."""
    _, _, whole, parts = cases
    change, covariance = without_each(whole.normal, whole.inverse)
    for at, part in enumerate(parts):
        to = np.append(np.array([BASIS[at] @ each for each in part.coefficients]), part.errors)
        by = np.append(whole.linked[at], whole.errors)
        std = np.sqrt(np.diag(covariance[at]))
        np.testing.assert_allclose(change[at] / std, (to - by) / std, atol=0.02)
        rows = np.zeros((5, part.inverse.shape[0]))
        for p in range(3):
            rows[p, part.laws.parts[p]] = BASIS[at]
        rows[3:, -2:] = np.eye(2)
        wanted = rows @ part.inverse @ rows.T
        np.testing.assert_allclose(covariance[at] / np.outer(std, std), wanted / np.outer(std, std), atol=0.02)


def test_the_leave_one_out_error_is_that_of_fits_without_each(cases):
    data, shared, whole, parts = cases
    squares = []
    for at, part in enumerate(parts):
        linked = np.array([BASIS[at] @ each for each in part.coefficients])
        effect = complex_columns(shared[at]) / data[at].stiffness[:, None]
        shown = Zener().stiffness(Zener().unlink(linked)[0], OMEGA) * np.exp(effect @ part.errors)
        squares.append(np.abs(data[at].stiffness / shown - 1) ** 2)
    found = LeaveOneOut.of(whole)
    assert found.error == pytest.approx(np.sqrt(np.mean(squares)), rel=2e-3)
    assert 0.85 < found.inside <= 1.0


def density_of(whole, at, part):
    """Log density of K* of a condition under the fit without it, from the matrices over its rows."""
    (rows,) = whole.rows
    linked = np.array([BASIS[at] @ each for each in part.coefficients])
    change = np.append(linked, part.errors) - np.append(whole.linked[at], whole.errors)
    by = np.zeros((5, part.inverse.shape[0]))
    for p in range(3):
        by[p, part.laws.parts[p]] = BASIS[at]
    by[3:, -2:] = np.eye(2)
    columns, size = rows.columns[at], rows.off.shape[1]
    covariance = columns @ by @ part.inverse @ by.T @ columns.T
    for n in range(size // 2):
        covariance[2 * n : 2 * n + 2, 2 * n : 2 * n + 2] += rows.own[at, n] + np.diag(np.square(SCATTER.frequency))
    covariance += np.tile(np.diag(np.square(SCATTER.condition)), (size // 2, size // 2))
    scale = np.repeat(np.abs(rows.scale[at]), 2)
    return multivariate_normal(columns @ change, covariance).logpdf(rows.off[at]) - np.sum(np.log(scale))


def test_the_log_density_is_that_of_each_condition_under_a_fit_of_the_others(cases):
    """Against dense covariances; of first order in changes of 1e-3, in the density of 108 numbers."""
    _, _, whole, parts = cases
    wanted = sum(density_of(whole, at, part) for at, part in enumerate(parts))
    wanted += PRIOR - 0.5 * whole.errors @ whole.errors
    found = LeaveOneOut.of(whole).density - 0.5 * 108 * np.log(2 * np.pi)
    assert found == pytest.approx(wanted, abs=0.1)


def test_candidates_are_compared_by_that_density(cases):
    """About the fit itself, the linear equations give its differences between laws; a constant lacks much."""
    _, _, whole, _ = cases
    weights = [Weights.of(one, SCATTER.variances) for one in whole.rows]
    rows = [one.about_zero(whole.linked) for one in whole.rows]
    normal = assembled(rows, weights, whole.laws, whole.unknowns)
    zero = np.append(np.zeros(whole.laws.coefficients), whole.errors)
    (one,), (weight,) = rows, weights
    rest = np.sum(weight.log_density(one.off, one.scale))
    rest += PRIOR
    found = density_without_each(replace(normal, unknowns=zero)) + rest
    assert found == pytest.approx(LeaveOneOut.of(whole).density, abs=0.1)
    constant = Laws((np.ones((6, 1)),) * 3, 2, 6)
    zero = np.append(np.zeros(3), whole.errors)
    assert density_without_each(replace(normal, laws=constant, unknowns=zero)) + rest < found - 100
