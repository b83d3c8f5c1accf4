"""The virtual tyres: laws that agree with each other, positive wherever they are meant."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fourpole.models import GeneralisedMaxwell
from fourpole.virtual import CROSS_PLY, RADIAL_PLY, ModelTyre

pytestmark = pytest.mark.thorough

TYRES = pytest.mark.parametrize("tyre", [CROSS_PLY, RADIAL_PLY], ids=lambda tyre: tyre.name)
PRESSURE = st.floats(100e3, 240e3)


@TYRES
@given(pressure=PRESSURE, load=st.floats(0.0, 5000.0))
def test_deflection_is_the_inverse_of_load(tyre, pressure, load):
    assert tyre.load(tyre.deflection(load, pressure), pressure) == pytest.approx(load, rel=1e-12)


@TYRES
@given(pressure=PRESSURE, preload=st.floats(500.0, 3000.0))
def test_static_stiffness_is_the_slope_of_the_law(tyre, pressure, preload):
    x, h = tyre.deflection(preload, pressure), 1e-5
    slope = (tyre.load(x + h, pressure) - tyre.load(x - h, pressure)) / (2.0 * h)
    assert tyre.static_stiffness(pressure, preload) == pytest.approx(slope, rel=1e-9)


@TYRES
@given(pressure=PRESSURE, preload=st.floats(1000.0, 2000.0), frequency=st.floats(10.0, 24.0))
def test_constants_are_those_of_a_car_tyre(tyre, pressure, preload, frequency):
    assert 100e3 < tyre.static_stiffness(pressure, preload) < 250e3
    assert 50e3 < tyre.k2(frequency, pressure, preload) < 300e3
    assert 400.0 < tyre.c(frequency, pressure, preload) < 2000.0


@TYRES
def test_laws_broadcast(tyre):
    frequency, pressure = np.linspace(10.0, 24.0, 5)[:, None], np.linspace(100e3, 240e3, 3)
    assert tyre.k2(frequency, pressure, 1000.0).shape == (5, 3)
    assert tyre.c(frequency, pressure, 1000.0)[2, 1] == tyre.c(17.0, 170e3, 1000.0)


def test_a_model_tyre_stiffens_in_proportion_to_the_pressure():
    tyre = ModelTyre("t", GeneralisedMaxwell(1), (150e3, 50e3, 0.01), stiffening=2.5e-6)
    plain = ModelTyre("t", GeneralisedMaxwell(1), (150e3, 50e3, 0.01))
    omega = np.array([60.0, 120.0])
    for pressure, factor in ((170e3, 1.0), (210e3, 1.1), (130e3, 0.9)):
        found, reference = (one.element(10.0, pressure, 3000.0).stiffness(omega) for one in (tyre, plain))
        assert found == pytest.approx(factor * reference)
        assert tyre.static_stiffness(pressure, 3000.0) == pytest.approx(factor * 150e3)
        assert tyre.load(tyre.deflection(3000.0, pressure), pressure) == pytest.approx(3000.0)
    assert tyre.static_stiffness([170e3, 210e3], 3000.0) == pytest.approx([150e3, 165e3])
    assert tyre.static_stiffness(170e3, [1000.0, 3000.0]).shape == (2,)
