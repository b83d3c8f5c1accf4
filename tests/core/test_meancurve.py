"""The mean of the branches as a polynomial: exact where the data are, and of the order that they carry."""

import numpy as np
import pytest
from numpy.polynomial import Chebyshev, Polynomial

from fourpole.core.meancurve import Pairs, deflection_at, fit_mean_curve, in_part, surest

pytestmark = pytest.mark.thorough

X = np.concatenate([np.linspace(0.0, 0.03, 150), np.linspace(0.03, 0.0, 220)])
SIDE = np.repeat([1.0, -1.0], [150, 220])
LAW = Polynomial([50.0, 1.2e5, 3e6, -4e7])


def test_value_slope_and_bend_of_a_cubic():
    curve = fit_mean_curve(X, LAW(X), None)
    at = np.linspace(0.0, 0.03, 7)
    assert curve.order == 3
    assert curve.span == (0.0, 0.03)
    # round-off of 5000 N · 1e-15, and (n²/half) and its square times that for the derivatives
    np.testing.assert_allclose(curve.value(at), LAW(at), atol=1e-10)
    np.testing.assert_allclose([curve.slope(x) for x in at], LAW.deriv()(at), rtol=1e-11)
    np.testing.assert_allclose([curve.bend(x) for x in at], LAW.deriv(2)(at), atol=1e-8 * 6e6)
    assert np.abs(curve.residual).max() < 1e-9
    assert max(curve.tangent(x)[1] for x in at) < 2e-9 * LAW.deriv()(0.03)  # round-off


@pytest.mark.parametrize("gap", [lambda u: 0 * u + 80.0, lambda u: 80 * (1 - u**2), lambda u: 80 * np.sqrt(1 - u**2)])
def test_the_gap_is_kept_out_of_the_mean(gap):
    place = np.clip(X / 0.015 - 1, -1, 1)
    curve = fit_mean_curve(X, LAW(X) + SIDE * gap(place), SIDE)
    at = np.linspace(0.001, 0.029, 15)
    np.testing.assert_allclose([curve.slope(x) for x in at], LAW.deriv()(at), rtol=1e-9)


def test_slope_gap_is_the_difference_of_the_branches_tangents():
    place = X / 0.015 - 1
    curve = fit_mean_curve(X, LAW(X) + SIDE * 80 * (1 - place**2), SIDE)
    for x in (0.005, 0.015, 0.02):
        expected = 2 * 80 * -2 * (x / 0.015 - 1) / 0.015
        assert curve.slope_gap(x) == pytest.approx(expected, abs=1e-3)  # 1e-10 N over a step of 1.5e-6 m
    ellipse = fit_mean_curve(X, LAW(X) + SIDE * 80 * np.sqrt(np.clip(1 - place**2, 0, None)), SIDE)
    expected = 2 * 80 * -0.5 / np.sqrt(0.75) / 0.015
    assert ellipse.slope_gap(0.0225) == pytest.approx(expected, rel=1e-6)
    assert fit_mean_curve(X, LAW(X), None).slope_gap(0.01) == 0.0


@pytest.mark.parametrize("order", [1, 2, 3, 4])
@pytest.mark.sampled(4)
def test_order_in_noise_is_that_of_the_law(order):
    """BIC takes a term more with a chance of about 1/sqrt(N log N), 2 % here, and none less where all are plain."""
    law = Polynomial([0.0, 1.2e5, 3e6, -4e7, 4e9][: order + 1])
    rng = np.random.default_rng(order)
    orders = [fit_mean_curve(X, law(X) + rng.standard_normal(X.size), SIDE).order for _ in range(60)]
    assert min(orders) == order
    assert np.mean(np.array(orders) == order) > 0.85


def test_few_points_carry_a_low_order():
    x = np.linspace(0.0, 0.03, 5)
    assert fit_mean_curve(x, LAW(x), None).order <= 2
    x = np.linspace(0.0, 0.03, 9)
    assert fit_mean_curve(x, LAW(x), None).order == 3


def test_the_choice_of_the_order_is_part_of_the_uncertainty():
    """A law that the noise leaves open between orders: their spread is counted beside the scatter of the points."""
    rng = np.random.default_rng(8)
    curve = fit_mean_curve(X, LAW(X) + 4 * rng.standard_normal(X.size), SIDE)
    assert len(curve.weights) == len(curve.fits) == len(curve.covariances)
    assert len({fit.size for fit in curve.fits}) > 1  # or nothing would be shown here
    assert curve.weights.sum() == pytest.approx(1.0, abs=1e-12)
    best, follow = curve.slope(0.018), curve.bend(0.018) / curve.slope(0.018)
    variance = 0.0
    for weight, fit, both in zip(curve.weights, curve.fits, curve.covariances, strict=True):
        basis = [Chebyshev.basis(k) for k in range(fit.size)]
        by = np.array([one.deriv()(0.2) / 0.015 - follow * one(0.2) for one in basis])  # 18 mm is 0.2 of the half
        slope = float(Chebyshev(fit).deriv()(0.2)) / 0.015
        variance += weight * (max(by @ one @ by for one in both) + (slope - best) ** 2)
    assert curve.tangent(0.018) == pytest.approx((best, np.sqrt(variance)), rel=1e-9)


@pytest.mark.parametrize(("correlation", "samples"), [(0.0, 370), (0.9, 2000)])
@pytest.mark.sampled(2)
def test_slope_uncertainty_is_honest(correlation, samples):
    """White noise, and noise correlated over ten samples, of a known law."""
    rng = np.random.default_rng(7)
    x = np.concatenate([np.linspace(0.0, 0.03, samples // 2), np.linspace(0.03, 0.0, samples // 2)])
    side = np.repeat([1.0, -1.0], samples // 2)
    white = 10 * rng.standard_normal((40, samples + 100))
    noise = np.zeros_like(white)
    for i in range(1, white.shape[1]):
        noise[:, i] = correlation * noise[:, i - 1] + np.sqrt(1 - correlation**2) * white[:, i]
    errors = []
    for row in noise[:, 100:]:
        curve = fit_mean_curve(x, LAW(x) + row, side)
        slope, std = curve.tangent(0.018)
        errors.append((slope - LAW.deriv()(0.018)) / std)
    # 40 errors: 1 ± 0.11; a wrong order now and then, and the uncertainty for it, make it 0.35 to 1.4
    assert 0.35 < np.sqrt(np.mean(np.square(errors))) < 1.4
    assert abs(np.mean(errors)) < 4 * np.std(errors) / np.sqrt(40)


WAY = np.linspace(0.0, 1.0, 401)


def best(load_of, at=0.5):
    points = Pairs(WAY, load_of, None)
    whole = fit_mean_curve(*points)
    load = float(np.interp(at, WAY, load_of))
    return whole, surest(points, whole, deflection_at(whole, load), load)


def test_a_polynomial_is_taken_whole():
    whole, found = best(1e3 * WAY + 200.0 * WAY**2)
    assert found.reach == 0.0
    assert found.curve is whole


def test_a_bend_at_the_end_is_left_out():
    """A kink that no polynomial has, far from the load: the part has the tangent to 1e-6, the whole has not."""
    whole, found = best(1e3 * WAY + 3e3 * np.maximum(WAY - 0.9, 0.0))
    assert found.reach > 0.0
    assert abs(found.slope - 1e3) < 1e-3
    assert abs(whole.tangent(0.5)[0] - 1e3) > 1.0


def test_noise_is_best_averaged_over_the_whole():
    taken = []
    for seed in range(10):
        noise = 20.0 * np.random.default_rng(seed).standard_normal(WAY.size)
        taken.append(best(1e3 * WAY + noise)[1].reach)
    assert np.mean(np.array(taken) > 0) <= 0.2


def test_a_part_of_few_points_is_none():
    points = Pairs(WAY[::40], 1e3 * WAY[::40], None)
    assert in_part(points, 0.5, 0.3, 500.0) is None
