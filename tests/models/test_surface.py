"""Surfaces and the hull of what was measured."""

import numpy as np
import pytest

from fourpole.errors import ModelError
from fourpole.models.surface import Axes, design, term_sets, value_surface

NAMES = ["pressure [Pa]", "preload [N]"]
GRID = [[p, load] for p in (1.0e5, 1.7e5, 2.4e5) for load in (1e3, 2e3)]


def test_axes_that_do_not_vary_are_set_apart():
    axes = Axes.of(NAMES, [[1.0e5, 1000.0], [2.0e5, 1000.0], [1.5e5, 1000.01]])
    assert axes.names == ("pressure [Pa]",)
    assert axes.levels == (3,)
    assert axes.constant["preload [N]"] == pytest.approx(1000.0, abs=0.01)
    assert axes.scaled([[1.0e5], [1.5e5], [2.0e5]]).ravel().tolist() == [-1.0, 0.0, 1.0]


def test_the_hull_is_that_of_the_points_not_of_their_limits():
    """A triangle: the fourth corner of its box is half a diagonal away, sqrt(2) half spans."""
    axes = Axes.of(NAMES, [[1e5, 1e3], [2e5, 1e3], [1e5, 2e3]])
    assert axes.outside([1.4e5, 1.4e3])[0] == 0
    far, nearest = axes.outside([2e5, 2e3])
    assert far == pytest.approx(np.sqrt(2), rel=1e-5)
    np.testing.assert_allclose(nearest, [1.5e5, 1.5e3], rtol=1e-5)


@pytest.mark.parametrize("seed", range(5))
def test_every_mean_of_points_is_inside_and_what_is_beyond_a_limit_is_not(seed):
    rng = np.random.default_rng(seed)
    points = rng.uniform([1e5, 1e3, -20.0], [2.4e5, 5e3, 60.0], (12, 3))
    axes = Axes.of([*NAMES, "temperature [degC]"], points)
    for weights in rng.dirichlet(np.full(12, 0.3), 20):
        assert axes.outside(weights @ points)[0] == 0
    for at in range(3):
        beyond = points.mean(axis=0)
        beyond[at] = points[:, at].max() + 0.1 * np.ptp(points[:, at])
        assert axes.outside(beyond)[0] >= 0.2 - 1e-6


def test_terms_rise_from_a_constant_and_leave_conditions_to_judge_by():
    axes = Axes.of(NAMES, GRID)
    sets = term_sets(axes.levels, len(GRID))
    assert sets[0] == ((0, 0),)
    assert ((0, 0), (1, 0), (0, 1), (1, 1)) in sets
    assert max(map(len, sets)) <= 4  # three quarters of six
    assert all(one[1] <= 1 for terms in sets for one in terms)  # two preloads bear a line, no curve
    assert design(((0, 0), (1, 1)), axes.scaled(GRID))[:, 1].tolist() == [1.0, -1.0, 0.0, 0.0, -1.0, 1.0]


def test_fewer_than_two_conditions_for_each_term_have_the_linear_surface_alone():
    linear = ((0, 0), (1, 0), (0, 1))
    assert term_sets([2, 2], 5) == [linear]
    assert len(term_sets([3, 2], 6)) > 1


def test_one_condition_has_no_axes():
    axes = Axes.of(NAMES, [[1e5, 1e3]])
    assert axes.names == ()
    assert axes.outside(np.zeros(0))[0] == 0
    assert term_sets(axes.levels, 1) == [((),)]
    with pytest.raises(ModelError):
        design((), np.zeros((1, 0)))


def test_a_value_that_conditions_have_is_interpolated_with_its_common_uncertainty():
    """exp of a plane over the axes is met exactly; 2 % that all have in common stays 2 %, however many there are."""
    axes = Axes.of(NAMES, GRID)
    truth = 180e3 * np.exp(0.1 * axes.scaled(GRID) @ [1.0, 0.2])
    found = value_surface(axes, truth, 0.02 * truth)
    assert len(found.terms) == 3
    value, std = found.at(axes.scaled([[1.2e5, 1.7e3]]))
    wanted = 180e3 * np.exp(0.1 * axes.scaled([[1.2e5, 1.7e3]])[0] @ [1.0, 0.2])
    assert value[0] == pytest.approx(wanted, rel=1e-9)
    assert std[0] / value[0] == pytest.approx(0.02, rel=1e-6)


def test_scatter_of_a_value_is_told():
    """Scatter of 1 % about a constant, 12 conditions: found within some 20 %, four times for the mean of 20 draws."""
    rng = np.random.default_rng(0)
    points = rng.uniform([1e5, 1e3], [2.4e5, 2e3], (12, 2))
    axes = Axes.of(NAMES, points)
    sizes = [
        value_surface(axes, 180e3 * np.exp(0.01 * rng.standard_normal(12)), np.zeros(12)).scatter for _ in range(20)
    ]
    assert np.mean(sizes) == pytest.approx(0.01, rel=0.2)
