"""The viscoelastic tyre: limits of its formulas, their agreement, and what they refuse."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fourpole.core.tyre import (
    energy_loss,
    loss_factor,
    mobility,
    transmissibility,
    zener_mobility,
    zener_stiffness,
    zener_transmissibility,
)

RIG = {"mass": 15.0, "preload_stiffness": 12440.0}
OMEGA = 2 * np.pi * np.linspace(1.0, 50.0, 99)


def test_limits_of_the_zener_solid():
    k1, k2, c = 180e3, 120e3, 700.0
    slow, fast = zener_stiffness(k1, k2, c, [1e-6, 1e9])
    # r = w C/K2 is 6e-9 and 6e6 there; K' departs from its limits by r² and 1/r², K'' by r and 1/r
    assert slow.real == pytest.approx(k1, rel=1e-15)
    assert slow.imag == pytest.approx(1e-6 * c, rel=1e-12)
    assert fast.real == pytest.approx(k1 + k2, rel=1e-12)
    assert fast.imag == pytest.approx(k2**2 / (1e9 * c), rel=1e-12)


def test_largest_loss_is_half_the_arm_at_its_relaxation_frequency():
    k1, k2, c = 180e3, 120e3, 700.0
    peak = k2 / c
    assert zener_stiffness(k1, k2, c, peak).imag == pytest.approx(0.5 * k2, rel=1e-15)
    around = zener_stiffness(k1, k2, c, peak * np.array([0.99, 1.01]))
    assert (around.imag < 0.5 * k2).all()


@given(st.floats(1e4, 1e6), st.floats(1e4, 1e6), st.floats(10.0, 1e4), st.floats(0.1, 1e3))
def test_passive_and_rising_with_frequency(k1, k2, c, omega):
    here, above = zener_stiffness(k1, k2, c, np.array([omega, 1.1 * omega]))
    assert here.imag > 0
    assert here.real * (1 - 1e-15) <= above.real <= (k1 + k2) * (1 + 1e-15)


@given(st.floats(1e4, 1e6), st.floats(1e4, 1e6), st.floats(10.0, 1e4))
def test_closed_forms_agree_with_the_dynamic_stiffness(k1, k2, c):
    omega = OMEGA[np.abs(RIG["preload_stiffness"] - RIG["mass"] * OMEGA**2) > 100.0]
    stiffness = zener_stiffness(k1, k2, c, omega)
    closed, by_stiffness = (zener_mobility(k1, k2, c, omega, **RIG), mobility(stiffness, omega, **RIG))
    # Im M may be 0: its round-off is that of its two terms
    scale = np.abs(omega / stiffness) + np.abs(omega / (RIG["preload_stiffness"] - RIG["mass"] * omega**2))
    assert (np.abs(closed - by_stiffness) <= 1e-14 * scale).all()
    # the denominator of TR may all but vanish at resonance: round-off grows by TR and by the terms over K*
    tr = zener_transmissibility(k1, k2, c, omega, **RIG)
    grows = 1 + tr * (1 + RIG["mass"] * omega**2 / np.abs(stiffness))
    other = np.abs(transmissibility(stiffness, omega, **RIG))
    assert (np.abs(tr - other) <= 1e-14 * tr * grows**2).all()


def test_a_damper_beside_the_preload_spring_is_a_complex_spring():
    stiffness, c3 = 2e5 + 4e4j, 300.0
    with_damper = mobility(stiffness, OMEGA, **RIG, preload_damping=c3)
    rig = RIG["preload_stiffness"] + 1j * OMEGA * c3 - RIG["mass"] * OMEGA**2
    np.testing.assert_allclose(with_damper, 1j * OMEGA * (1 / stiffness + 1 / rig), rtol=1e-14)
    np.testing.assert_allclose(
        transmissibility(stiffness, OMEGA, **RIG, preload_damping=c3), stiffness / (stiffness + rig), rtol=1e-14
    )


def test_at_the_rigs_own_resonance_the_rig_follows_the_contact():
    at = np.sqrt(RIG["preload_stiffness"] / RIG["mass"])
    assert transmissibility(2e5 + 4e4j, at, **RIG) == pytest.approx(1.0, abs=1e-13)


def test_loss_factor_and_energy_loss():
    assert loss_factor(200e3 + 50e3j) == 0.25
    stiffness, amplitude = 200e3 + 40e3j, 1e-3
    turn = 2 * np.pi * np.arange(400) / 400
    force, speed = (stiffness * amplitude * np.exp(1j * turn)).real, (1j * amplitude * np.exp(1j * turn)).real
    assert energy_loss(stiffness, amplitude) == pytest.approx(np.mean(force * speed) * 2 * np.pi, rel=1e-12)


def test_everything_broadcasts():
    k1 = np.array([[1.2e5], [1.8e5]])
    stiffness = zener_stiffness(k1, 1e5, 600.0, OMEGA)
    assert stiffness.shape == (2, OMEGA.size)
    assert zener_mobility(k1, 1e5, 600.0, OMEGA, **RIG).shape == stiffness.shape
    assert zener_transmissibility(k1, 1e5, 600.0, OMEGA, **RIG).shape == stiffness.shape
    assert mobility(stiffness, OMEGA, mass=k1 / 1e4, preload_stiffness=12440.0).shape == stiffness.shape
    np.testing.assert_array_equal(stiffness[1], zener_stiffness(1.8e5, 1e5, 600.0, OMEGA))


@pytest.mark.parametrize("omega", [0.0, -1.0, np.nan, [10.0, 0.0]])
@pytest.mark.parametrize(
    "function",
    [
        lambda w: zener_stiffness(1e5, 1e5, 500.0, w),
        lambda w: mobility(1e5 + 1e4j, w, **RIG),
        lambda w: transmissibility(1e5 + 1e4j, w, **RIG),
        lambda w: zener_mobility(1e5, 1e5, 500.0, w, **RIG),
        lambda w: zener_transmissibility(1e5, 1e5, 500.0, w, **RIG),
    ],
)
def test_frequencies_must_be_positive(function, omega):
    with pytest.raises(ValueError, match="must be positive"):
        function(omega)
