"""The weighting Wk against the factors that ISO 2631-1 tabulates, and the values of known signals."""

import numpy as np
import pytest

from fourpole.errors import ModelError
from fourpole.ride.comfort import comfort_of, weighted, weighting, weighting_system

#: Thousandths of Wk at the third octaves from 0.1 to 100 Hz: ISO 2631-1:1997, table 3.
FACTORS = [
    31.2, 48.6, 79.0, 121, 182, 263, 352, 418, 459, 477, 482, 484, 494, 531, 631, 804, 967, 1039, 1054, 1036, 988, 902,
    768, 636, 513, 405, 314, 246, 186, 132, 88.7,
]  # fmt: skip


def test_the_weighting_is_that_of_the_table():
    """The table is for nominal frequencies or exact third octaves; the weighting lies between, or within 0.5 %."""
    nominal = [1.0, 1.25, 1.6, 2.0, 2.5, 3.15, 4.0, 5.0, 6.3, 8.0]
    at_nominal = np.abs(weighting(np.array([f * d for d in (0.1, 1.0, 10.0) for f in nominal] + [100.0])))
    exact = np.abs(weighting(10.0 ** (np.arange(-10, 21) / 10)))
    low, high = np.minimum(at_nominal, exact), np.maximum(at_nominal, exact)
    wanted = np.array(FACTORS) / 1e3
    assert np.all(wanted > low * 0.995)
    assert np.all(wanted < high * 1.005)
    assert np.abs(weighting([1.0, 6.31, 20.0])) == pytest.approx([0.482, 1.054, 0.636], abs=5e-4)


def test_the_system_has_the_weighting():
    frequency = np.geomspace(0.05, 300, 60)
    assert weighting_system().response(frequency)[:, 0, 0] == pytest.approx(weighting(frequency), rel=1e-9)


@pytest.mark.parametrize("frequency", [1.0, 6.31, 20.0])
def test_a_weighted_sine_has_the_weighting(frequency):
    step = 2.5e-4
    time = step * np.arange(round(20 / step))
    found = weighted(np.sin(2 * np.pi * frequency * time), step)[int(10 / step) :]
    assert np.sqrt(2 * np.mean(found**2)) == pytest.approx(abs(weighting(frequency)), rel=3e-4)


def test_the_values_of_a_sine_and_of_a_shock():
    step = 1e-3
    time = step * np.arange(100_000)
    sine = comfort_of(2.0 * np.sin(2 * np.pi * 10 * time), step)
    assert sine.rms == pytest.approx(np.sqrt(2))
    assert sine.crest == pytest.approx(np.sqrt(2))
    assert sine.vdv == pytest.approx((16 * 0.375 * 100) ** 0.25)
    assert sine.mtvv == pytest.approx(np.sqrt(2), rel=0.01)
    shock = np.zeros(100_000)
    shock[50_000:50_100] = 3.0
    found = comfort_of(shock, step)
    assert found.crest == pytest.approx(3.0 / np.sqrt(9.0 * 1e-3))
    assert found.vdv == pytest.approx((81 * 0.1) ** 0.25)
    assert found.mtvv == pytest.approx(np.sqrt(9.0 * (1 - np.exp(-0.1))), rel=1e-3)
    assert comfort_of(np.zeros(10), step).crest == 0.0


def test_a_step_too_long_is_refused():
    with pytest.raises(ModelError, match=r"step of 0\.003 s is too long"):
        weighted(np.zeros(10), 3e-3)
