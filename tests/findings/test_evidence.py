"""When a difference or a slope is claimed, at the edges of the rule."""

from math import inf, nextafter

import numpy as np
import pytest
from scipy import stats

from fourpole.findings.trends import Effect, along, between, factor, mean_effect, residual_squares

X = np.array([1.0, 2.0, 3.0, 4.0])


def test_chance_of_one_effect_is_that_outside_of_two_standard_uncertainties():
    assert factor() == pytest.approx(2.0, abs=1e-4)
    assert 2 * stats.norm.sf(factor()) == pytest.approx(0.0455, rel=1e-9)


def test_chance_of_any_of_several_effects_is_one_per_cent():
    assert 5 * 2 * stats.norm.sf(factor(searched=5)) == pytest.approx(0.01, rel=1e-9)
    assert 2 * stats.t.sf(factor(3.0, 4), 3.0) * 4 == pytest.approx(0.01, rel=1e-9)


def test_scatter_counts_with_students_factor():
    assert factor(3.0) == pytest.approx(stats.t.isf(0.5 * 0.0455, 3.0))
    assert Effect(1.0, 0.1, dof=3.0).reach() == pytest.approx(factor(3.0) * 0.1)
    assert Effect(1.0, 0.03, 0.04, dof=3.0).std == pytest.approx(0.05)


@pytest.mark.parametrize("effect", [Effect(0.0, 0.01), Effect(0.0, 0.0, 0.01), Effect(0.0, 0.006, 0.008)])
def test_an_effect_is_claimed_beyond_two_standard_uncertainties_and_not_at_them(effect):
    limit = effect.reach()
    assert limit == pytest.approx(2 * 0.01, rel=1e-4)
    at = Effect(limit, effect.own, effect.shared)
    above = Effect(nextafter(limit, inf), effect.own, effect.shared)
    below = Effect(-nextafter(limit, inf), effect.own, effect.shared)
    assert (at.claimed(), at.sign) == (False, 0)
    assert (above.sign, below.sign) == (1, -1)


def test_a_shared_uncertainty_counts_even_where_nothing_scatters():
    # With the shared part left out, any slope on a smooth line would be claimed.
    line = 100.0 + X
    u = 5.0 * (X - 2.0)
    effect = along(X, line, u, variance=0.0, dof=10.0)
    assert effect.shared > effect.value / 2
    assert not effect.claimed()
    assert along(X, line, 0 * u, variance=0.0, dof=10.0).claimed()


def test_what_tests_share_is_an_error_of_one_sign():
    # A u that is the same all along shifts the line and leaves its slope.
    constant = along(X, 100.0 + X, np.full(4, 5.0), variance=1e-6, dof=10.0)
    assert constant.shared == pytest.approx(0.0, abs=1e-12)
    growing = along(X, 100.0 + X, 5.0 * X, variance=1e-6, dof=10.0)
    assert growing.shared == pytest.approx(15.0 / 102.5)


@pytest.mark.parametrize(("dof", "full"), [(nextafter(3.0, 0.0), True), (3.0, False)])
def test_below_three_degrees_of_freedom_u_counts_in_full(dof, full):
    effect = along(X, 100.0 + X, np.full(4, 5.0), variance=1e-6, dof=dof)
    assert (effect.dof == inf) is full
    # Larger scatter still counts by itself, with the factor of three degrees of freedom at the most.
    for few in (1.0, dof):
        assert along(X, 100.0 + X, np.full(4, 5.0), variance=1.0, dof=few).dof == 3.0


def test_between_two_values_both_uncertainties_count_in_full():
    effect = between((100.0, 3.0), (110.0, 4.4))
    assert effect.value == pytest.approx(0.1)
    assert effect.own == pytest.approx(1.1 * 0.05)
    assert effect.shared == 0.0


def test_a_mean_is_no_surer_than_one_of_its_parts():
    one = Effect(0.1, 0.03, 0.02, 5.0)
    assert mean_effect([one] * 100) == Effect(pytest.approx(0.1), pytest.approx(0.03), pytest.approx(0.02), 5.0)
    mixed = mean_effect([one, Effect(0.3, 0.03, 0.04, 2.0)])
    assert (mixed.value, mixed.shared, mixed.dof) == (pytest.approx(0.2), pytest.approx(0.03), 2.0)


def test_round_off_is_no_effect():
    assert not Effect(1e-10, 0.0).claimed()
    assert Effect(1e-8, 0.0).claimed()


def test_residuals_are_relative_to_the_mean():
    assert residual_squares(X, 3.0 + 2.0 * X) == pytest.approx(0.0, abs=1e-24)
    assert residual_squares(X, 10.0 * np.array([1.0, 1.1, 0.9, 1.0])) == residual_squares(
        X, 7.0 * np.array([1.0, 1.1, 0.9, 1.0])
    )
