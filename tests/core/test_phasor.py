"""Phasors: signs, shapes, and the interval that their degrees of freedom allow."""

import numpy as np
import pytest

from fourpole.core.phasor import CHANNELS, Phasors


def test_a_phase_is_that_of_the_force_ahead_of_the_motion():
    phasors = Phasors.from_polar(10.0, 60.0, 0.06, 0.5, 0.09, -0.2)
    np.testing.assert_allclose(phasors.amplitudes, [60 * np.exp(0.5j), 0.06, 0.09 * np.exp(-0.2j)], rtol=1e-15)
    assert phasors.mobility == pytest.approx(1e-3 * np.exp(-0.5j))
    assert phasors.transmissibility == pytest.approx(1.5 * np.exp(-0.2j))
    assert (phasors.force_in, phasors.motion_in, phasors.motion_out) == tuple(phasors.amplitudes)
    assert CHANNELS == ("force_in", "motion_in", "motion_out")


def test_a_reduced_table_is_exact_and_may_lack_v2():
    phasors = Phasors.from_polar([10.0, 12.0], [50.0, 60.0], 0.06, 0.5)
    assert phasors.amplitudes.shape == (2, 3)
    assert phasors.covariance.shape == (2, 6, 6)
    assert not phasors.covariance.any()
    assert not phasors.std.any()
    assert np.isnan(phasors.motion_out).all()
    assert np.isnan(phasors.transmissibility).all()
    np.testing.assert_array_equal(phasors.omega, 2 * np.pi * phasors.frequency)
    # nothing was estimated, so the interval is the normal one: 1.959964 standard uncertainties
    np.testing.assert_allclose(phasors.coverage_factor(), 1.959963985, rtol=1e-9)


def test_stack_adds_an_axis():
    one, other = Phasors.from_polar(10.0, 50.0, 0.06, 0.5), Phasors.from_polar(12.0, 60.0, 0.07, 0.6)
    both = Phasors.stack([one, other])
    assert both.frequency.tolist() == [10.0, 12.0]
    np.testing.assert_array_equal(both.amplitudes, np.stack([one.amplitudes, other.amplitudes]))
    assert both.covariance.shape == (2, 6, 6)
    assert both.dof.shape == both.frequency_std.shape == (2,)


def test_std_is_the_root_of_the_diagonal():
    covariance = np.diag(np.arange(1.0, 7.0) ** 2) + 0.1
    phasors = Phasors(np.array(10.0), np.ones(3, complex), covariance, np.array(0.0), np.array(5.0))
    np.testing.assert_allclose(phasors.std, np.sqrt(np.arange(1.0, 7.0) ** 2 + 0.1), rtol=1e-15)


@pytest.mark.parametrize(("dof", "level", "factor"), [(1, 0.95, 12.706), (5, 0.95, 2.571), (10, 0.99, 3.169)])
def test_coverage_factor_is_students(dof, level, factor):
    """Values of the printed tables."""
    phasors = Phasors(np.array(10.0), np.ones(3, complex), np.eye(6), np.array(0.0), np.array(float(dof)))
    assert phasors.coverage_factor(level) == pytest.approx(factor, abs=5e-4)
