"""Reduced tables: there and back, with and without a rig, row by row."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fourpole.core.reduced import identify_mobility, identify_stiffness, predict, stiffness_std
from fourpole.core.rig import Rig
from fourpole.core.tyre import zener_stiffness

EPS = np.finfo(float).eps
FREQUENCY = np.array([8.0, 10.0, 13.0, 17.0, 24.0])
RIG = Rig(moving_mass=15.0, preload_stiffness=12440.0, preload_damping=20.0, tyre_mass=1.0, frame_stiffness=3e6)
K1, K2, C = 180e3, 120e3, 700.0


@given(st.floats(5e4, 1e6), st.floats(2e4, 1e6), st.floats(100.0, 5e3), st.floats(2.0, 50.0))
def test_predict_and_identify_are_each_others_inverse(k1, k2, c, frequency):
    predicted = predict([frequency], k1, k2, c, RIG)
    found = identify_mobility([frequency], predicted.mobility, k1, RIG)
    omega = 2 * np.pi * frequency
    stiffness = zener_stiffness(k1, k2, c, omega)
    arm = stiffness - k1
    # what cancels: tyre against rig in the mobility, K* against K1, the parts of 1/arm
    lost = 64 * EPS * (1 + abs(RIG.mobility(omega)) * abs(stiffness) / omega)
    in_arm = lost * (1 + abs(stiffness / arm))
    assert found.stiffness[0] == pytest.approx(stiffness, rel=lost)
    assert found.k2[0] == pytest.approx(k2, rel=in_arm * k2 / abs(arm))
    assert found.c[0] == pytest.approx(c, rel=in_arm * omega * c / abs(arm))
    assert found.tr[0] == pytest.approx(predicted.tr[0], rel=lost * (1 + predicted.tr[0]))
    assert found.d[0] == pytest.approx(predicted.d[0], rel=2 * lost)


def test_predict_is_the_model():
    found = predict(FREQUENCY, K1, K2, C, RIG)
    omega = 2 * np.pi * FREQUENCY
    stiffness = K1 + 1 / (1 / K2 + 1 / (1j * omega * C))
    rig = 1j * omega * 16.0 + 1 / (1j * omega / (12440.0 + 20j * omega) + 1j * omega / 3e6)
    np.testing.assert_allclose(found.stiffness, stiffness, rtol=1e-14)
    np.testing.assert_allclose(found.mobility, 1j * omega / stiffness + 1 / rig, rtol=1e-12)
    np.testing.assert_allclose(found.tr, np.abs(stiffness / (stiffness + 1j * omega * rig)), rtol=1e-12)
    np.testing.assert_allclose(found.loss_factor, stiffness.imag / stiffness.real, rtol=1e-14)
    np.testing.assert_allclose(found.d, (K1 / stiffness).real, rtol=1e-14)
    np.testing.assert_allclose(found.k2, np.full(5, K2), rtol=1e-12)
    np.testing.assert_allclose(found.c, np.full(5, C), rtol=1e-12)
    np.testing.assert_array_equal(found.frequency, FREQUENCY)
    assert found.reasons == ("",) * 5


def test_from_the_stiffness_to_the_mobility_and_back():
    stiffness = zener_stiffness(K1, K2, C, 2 * np.pi * FREQUENCY)
    there = identify_stiffness(FREQUENCY, stiffness, K1, RIG)
    back = identify_mobility(FREQUENCY, there.mobility, K1, RIG)
    np.testing.assert_allclose(back.stiffness, stiffness, rtol=1e-12)
    np.testing.assert_allclose(back.k2, there.k2, rtol=1e-11)


@pytest.mark.parametrize("rig", [None, Rig(blocked=True)])
def test_without_motion_on_the_far_side(rig):
    """An elastomer bench: the mobility is that of the specimen, and there is no transmissibility."""
    stiffness = zener_stiffness(K1, K2, C, 2 * np.pi * FREQUENCY)
    there = identify_stiffness(FREQUENCY, stiffness, K1, rig)
    np.testing.assert_allclose(there.mobility, 2j * np.pi * FREQUENCY / stiffness, rtol=1e-15)
    found = identify_mobility(FREQUENCY, there.mobility, K1, rig)
    np.testing.assert_allclose(found.stiffness, stiffness, rtol=1e-14)
    np.testing.assert_allclose(found.k2, np.full(5, K2), rtol=1e-12)
    assert np.isnan(found.tr).all()


def test_rows_stand_for_themselves():
    """A K1 for each row, some unknown, some too high: only those rows are blank, each with its reason."""
    stiffness = zener_stiffness(K1, K2, C, 2 * np.pi * FREQUENCY)
    k1 = np.array([K1, np.nan, 300e3, K1, K1])
    stiffness[3] = stiffness[3].conjugate()
    found = identify_stiffness(FREQUENCY, stiffness, k1, RIG)
    np.testing.assert_array_equal(np.isnan(found.k2), [False, True, True, True, False])
    np.testing.assert_array_equal(np.isnan(found.c), np.isnan(found.k2))
    assert [bool(reason) for reason in found.reasons] == [False, True, True, True, False]
    assert "no static stiffness K1" in found.reasons[1]
    assert "not above the static K1" in found.reasons[2]
    assert "would give energy" in found.reasons[3]
    assert np.isfinite(found.tr).all()
    assert np.isfinite(found.mobility).all()

    order = [3, 1, 4, 0, 2]
    permuted = identify_stiffness(FREQUENCY[order], stiffness[order], k1[order], RIG)
    np.testing.assert_array_equal(permuted.k2, found.k2[order])
    np.testing.assert_allclose(permuted.tr, found.tr[order], rtol=1e-14)
    assert permuted.reasons == tuple(found.reasons[i] for i in order)


def test_a_single_row_may_be_a_number():
    found = predict(10.0, K1, K2, C, RIG)
    assert found.tr.shape == (1,)
    again = identify_mobility(10.0, complex(found.mobility[0]), K1, RIG)
    assert again.k2[0] == pytest.approx(K2, rel=1e-11)


def test_predict_needs_positive_frequencies():
    with pytest.raises(ValueError, match="must be positive"):
        predict([10.0, 0.0], K1, K2, C, RIG)


def test_the_input_mass_is_taken_away_and_put_back():
    """A reduced table holds what the force cell saw, so its mobility has the mass between cell and contact in it."""
    rig = Rig(moving_mass=15.0, preload_stiffness=12440.0, input_mass=2.0)
    without = predict(FREQUENCY, K1, K2, C, Rig(moving_mass=15.0, preload_stiffness=12440.0)).mobility
    seen = 1 / (1 / without + 2j * np.pi * FREQUENCY * 2.0)
    np.testing.assert_allclose(predict(FREQUENCY, K1, K2, C, rig).mobility, seen, rtol=1e-12)
    np.testing.assert_allclose(identify_mobility(FREQUENCY, seen, K1, rig).k2, np.full(5, K2), rtol=1e-10)


def test_the_uncertainty_of_a_mobility_goes_through_the_rig():
    """Held against the change of K* when the mobility is changed by a small step in any direction."""
    rig = Rig(moving_mass=15.0, preload_stiffness=12440.0, input_mass=0.7)
    mobility, step = 6.2e-5 - 1.03e-3j, 1e-6
    std = stiffness_std(identify_mobility([10.0], [mobility], 180e3, rig), [step], rig)[0]
    for turn in (1.0, 1j, np.exp(0.7j)):
        moved = identify_mobility([10.0], [mobility * (1 + step * turn)], 180e3, rig).stiffness[0]
        change = abs(moved - identify_mobility([10.0], [mobility], 180e3, rig).stiffness[0])
        assert change == pytest.approx(std, rel=1e-4)  # the step squared is 1e-6 of it, round-off 1e-9
