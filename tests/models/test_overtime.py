"""Relaxation and creep against the closed forms of a standard linear solid, and the conversion by its definition."""

import numpy as np
import pytest

from fourpole.errors import ModelError
from fourpole.models.overtime import fit_creep, fit_relaxation, stiffness_of

REST, SPRING, TAU = 1e5, 5e4, 0.5
TIME = np.geomspace(0.01, 100.0, 60)
OMEGA = np.geomspace(0.05, 50.0, 30)


def relaxation(time):
    return REST + SPRING * np.exp(-time / TAU)


def creep(time):
    """J(t) of the same solid: it retards with tau times the ratio of its stiffnesses at once and at rest."""
    sudden, later = 1 / (REST + SPRING), 1 / REST
    return later - (later - sudden) * np.exp(-time / (TAU * (REST + SPRING) / REST))


def dynamic(omega):
    return REST + SPRING * 1j * omega * TAU / (1 + 1j * omega * TAU)


def of_arms(arms, s):
    s = np.asarray(s)[..., None]
    return arms.rest + np.sum(arms.springs * s * arms.times / (1 + s * arms.times), axis=-1)


@pytest.mark.parametrize(("fit", "values"), [(fit_relaxation, relaxation), (fit_creep, creep)])
def test_a_standard_linear_solid_has_its_closed_form_in_frequency(fit, values):
    exact = values(TIME)
    found = fit(TIME, exact, 1e-5 * exact)
    assert np.max(np.abs(of_arms(found.arms, 1j * OMEGA) / dynamic(OMEGA) - 1)) < 2e-3


@pytest.mark.parametrize(("fit", "values"), [(fit_relaxation, relaxation), (fit_creep, creep)])
def test_the_uncertainty_of_k_star_covers_the_closed_form(fit, values):
    """By 40 draws of 0.5 % noise, stated and not, over the frequencies of the test times."""
    omega, inside = np.array([0.1, 0.5, 2.0, 10.0]), []
    for seed in range(40):
        exact = values(TIME)
        noisy = exact * (1 + 0.005 * np.random.default_rng(seed).standard_normal(TIME.size))
        found = fit(TIME, noisy, 0.005 * exact if seed % 2 else None)
        s, arms = 1j * omega[:, None], found.arms
        share = s * arms.times / (1 + s * arms.times)
        by = np.concatenate([np.ones((omega.size, 1)), share, arms.springs * s / (1 + s * arms.times) ** 2], axis=1)
        std = np.sqrt(np.maximum(np.einsum("ni,ij,nj->n", by.real, found.covariance, by.real), 0.0))
        off = (of_arms(arms, 1j * omega) - dynamic(omega)).real
        inside.append(np.abs(off) < 1.96 * std)
        assert np.max(np.abs(off) / np.abs(dynamic(omega))) < 0.02
    assert np.mean(inside) > 0.85


@pytest.mark.parametrize("fluidity", [0.0, 3e-7])
def test_the_stiffness_of_a_compliance_is_its_reciprocal(fluidity):
    sudden, parts, times = 2e-6, np.array([1e-6, 4e-6, 3e-7]), np.array([20.0, 0.1, 1e-3])
    arms, _ = stiffness_of(sudden, parts, times, fluidity)
    s = np.array([1e-3, 0.3 + 2j, 50j, 4e4 + 1e3j])
    whole = sudden + np.sum(parts / (1 + s[:, None] * times), axis=1) + fluidity / s
    assert of_arms(arms, s) * whole == pytest.approx(np.ones(4), rel=1e-9)
    assert np.all(arms.springs > 0)
    assert np.all(np.diff(arms.times) < 0)
    slow = np.sort(times)[::-1]
    assert np.all(arms.times[-3:] < slow)
    assert np.all(arms.times[-3:-1] > slow[1:])
    assert arms.rest == pytest.approx(0.0 if fluidity else 1 / (sudden + parts.sum()))


def test_the_derivatives_of_the_conversion_are_those_of_small_changes():
    values, times = np.array([2e-6, 1e-6, 4e-6, 3e-7]), np.array([0.1, 20.0, 1e-3])
    _, slopes = stiffness_of(values[0], values[1:3], times[:2], values[3])

    def every(changed):
        arms, _ = stiffness_of(changed[0], changed[1:3], times[:2], changed[3])
        return np.concatenate([[arms.rest], arms.springs, arms.times])

    for at in range(4):
        step = np.zeros(4)
        step[at] = 1e-5 * values[at]
        assert slopes[:, at] == pytest.approx((every(values + step) - every(values - step)) / (2 * step[at]), rel=1e-6)


def test_a_fluid_flows():
    """A Maxwell fluid creeps without end: J = 1/K + t/C."""
    found = fit_creep(TIME, 1e-5 + TIME * 1e-5, 1e-9 * (1 + TIME))
    assert found.arms.rest == 0.0
    assert of_arms(found.arms, 1j * OMEGA) == pytest.approx(1 / (1e-5 + 1e-5 / (1j * OMEGA)), rel=1e-3)


def test_a_stated_uncertainty_that_is_too_small_is_enlarged():
    noisy = relaxation(TIME) * (1 + 0.01 * np.random.default_rng(5).standard_normal(TIME.size))
    found = fit_relaxation(TIME, noisy, 1e-4 * noisy)
    assert found.error == pytest.approx(0.01, rel=0.3)
    assert found.chi2 == pytest.approx(found.dof, rel=0.05)


def test_too_few_rows_are_refused():
    with pytest.raises(ModelError, match="state --std"):
        fit_relaxation(TIME[:3], relaxation(TIME[:3]))
    with pytest.raises(ModelError, match="too few times"):
        fit_relaxation(np.array([0.0, 1.0]), np.array([2.0, 1.0]))
