"""The part of a curve that gives a tangent best."""

import numpy as np

from fourpole.core.meancurve import Points, deflection_at, fit_mean_curve, in_part, surest

X = np.linspace(0.0, 1.0, 401)


def best(load_of, at=0.5):
    points = Points(X, load_of, None)
    whole = fit_mean_curve(*points)
    load = float(np.interp(at, X, load_of))
    return whole, surest(points, whole, deflection_at(whole, load), load)


def test_a_polynomial_is_taken_whole():
    whole, found = best(1e3 * X + 200.0 * X**2)
    assert found.reach == 0.0
    assert found.curve is whole


def test_a_bend_at_the_end_is_left_out():
    """A kink that no polynomial has, far from the load: the part has the tangent to 1e-6, the whole has not."""
    whole, found = best(1e3 * X + 3e3 * np.maximum(X - 0.9, 0.0))
    assert found.reach > 0.0
    assert abs(found.slope - 1e3) < 1e-3
    assert abs(whole.tangent(0.5)[0] - 1e3) > 1.0


def test_noise_is_best_averaged_over_the_whole():
    taken = []
    for seed in range(10):
        noise = 20.0 * np.random.default_rng(seed).standard_normal(X.size)
        taken.append(best(1e3 * X + noise)[1].reach)
    assert np.mean(np.array(taken) > 0) <= 0.2


def test_a_part_of_few_points_is_none():
    points = Points(X[::40], 1e3 * X[::40], None)
    assert in_part(points, 0.5, 0.3, 500.0) is None
