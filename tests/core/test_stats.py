"""Tails and quantiles, against `scipy.stats`."""

import numpy as np
import pytest
import scipy.stats

from fourpole.core import stats

DOF = np.array([1.0, 2.5, 7.0, 40.0, 1e4])
CHANCES = np.array([[1e-9], [1e-4], [0.05], [0.5], [0.975]])


@pytest.mark.parametrize(
    ("name", "ways", "dof"),
    [
        ("chi2", ["isf", "ppf"], [DOF]),
        ("t", ["isf", "ppf"], [DOF]),
        ("f", ["isf", "ppf"], [DOF[::-1], DOF]),
        ("norm", ["isf"], []),
    ],
)
def test_quantiles_are_those_of_scipy(name, ways, dof):
    for way in ways:
        ours, theirs = (getattr(getattr(one, name), way)(CHANCES, *dof) for one in (stats, scipy.stats))
        np.testing.assert_allclose(ours, theirs, rtol=1e-12)


def test_tails_are_those_of_scipy():
    x = np.array([[-1.0], [0.0], [0.3], [4.0], [90.0], [np.inf], [np.nan]])
    np.testing.assert_allclose(stats.chi2.sf(x, DOF), scipy.stats.chi2.sf(x, DOF), rtol=1e-12)
    finite = x[:-2]  # no statistic F is infinite
    np.testing.assert_allclose(stats.f.sf(finite, DOF[::-1], DOF), scipy.stats.f.sf(finite, DOF[::-1], DOF), rtol=1e-12)


def test_an_infinite_number_of_degrees_of_freedom_is_the_normal_distribution():
    assert stats.t.ppf(0.975, np.inf) == pytest.approx(scipy.stats.norm.ppf(0.975), rel=1e-14)
