"""Limits of axes."""

import numpy as np
import pytest

from fourpole.plot.panels import span


@pytest.mark.parametrize("spread", [0.0, 1e-12, 4e-7])
def test_values_that_are_one_but_for_their_error_have_room_for_a_tick(spread):
    low, high = span([15.0 * (1.0 + spread * np.arange(3))])
    assert low == pytest.approx(15.0 * 0.85, rel=1e-3)
    assert high == pytest.approx(15.0 * 1.15, rel=1e-3)
