"""Modulus and loss angle: their derivatives are those that small steps give."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fourpole.core.polar import polar


@given(st.floats(1e2, 1e8), st.floats(-3.0, 3.0))
def test_the_derivatives_are_those_of_small_steps(size, angle):
    k = size * np.exp(1j * angle)
    values, slopes = polar(k)
    assert values == pytest.approx([size, angle], rel=1e-12, abs=1e-12)
    step = 1e-5 * size  # truncation 1e-10, round-off 1e-16/1e-5, both relative
    steps = [(polar(k + way)[0] - polar(k - way)[0]) / (2 * step) for way in (step, 1j * step)]
    np.testing.assert_allclose(slopes * [[1.0], [size]], np.transpose(steps) * [[1.0], [size]], atol=1e-8)


def test_an_array_keeps_its_shape_and_zero_has_no_derivative():
    values, slopes = polar([[1.0 + 1.0j, 0.0]])
    assert (values.shape, slopes.shape) == ((1, 2, 2), (1, 2, 2, 2))
    assert values[0, 1, 0] == 0.0
    assert not np.isfinite(slopes[0, 1]).any()
