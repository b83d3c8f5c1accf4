"""All four poles from rigid blocks and two loads, against a rig of nodes that shares no formula with them."""

from dataclasses import replace

import numpy as np
import pytest
from tests.belted_rig import BeltedRig

from fourpole.core.allpoles import all_poles, reciprocal
from fourpole.core.arrays import real_matrix
from fourpole.core.channelerrors import ChannelUncertainty
from fourpole.errors import RigError

FREQUENCIES = np.arange(10.0, 101.0, 5.0)


def off(poles, rig, frequencies=FREQUENCIES):
    """Errors (F, 4) over the size of each pole, or over that of k12 where the pole itself is nearly zero."""
    truth = rig.truth(frequencies)
    return np.abs((poles.stiffness - truth) / np.maximum(np.abs(truth), np.abs(truth[:, :1, 1:]))).reshape(-1, 4)


def deviations(poles, rig):
    """Errors (F, 4, 2) over their standard uncertainties."""
    left = (poles.stiffness - rig.truth(FREQUENCIES)).reshape(-1, 4)
    return np.stack([left.real, left.imag], axis=2) / poles.std


@pytest.mark.parametrize("rig", [BeltedRig(), BeltedRig(belt=0.0), BeltedRig(active=0.2)])
def test_without_noise_the_poles_come_back_to_round_off_with_sensors_5_percent_and_3_degrees_off(rig):
    poles = all_poles(*rig.recorded(FREQUENCIES))
    assert off(poles, rig).max() < 1e-9
    np.testing.assert_allclose(poles.dof, 2)


def test_the_rig_and_the_ratios_of_the_channels_come_with_them():
    rig, omega = BeltedRig(), 2 * np.pi * FREQUENCIES
    poles = all_poles(*rig.recorded(FREQUENCIES))
    np.testing.assert_allclose(poles.rig, 12.44e3 - omega**2 * 22.0 + 45j * omega, rtol=1e-9)
    f1, v1, v2 = rig.gains
    np.testing.assert_allclose(poles.ratios[:, 0], f1 / v2 * np.exp(-1e-4j * omega), rtol=1e-9)
    np.testing.assert_allclose(poles.ratios[:, 1], v1 / v2 * np.exp(1e-4j * omega), rtol=1e-9)


@pytest.mark.sampled(2)
def test_a_car_tyre_to_100_hz_comes_back_within_1_percent_at_laboratory_noise():
    rig, masses = BeltedRig(), {"blocks": (6.0, 20.0), "loads": (0.0, 20.0), "noise": 1e-4}
    errors = [off(reciprocal(all_poles(*rig.recorded(FREQUENCIES, **masses, seed=n)))[0], rig) for n in range(10)]
    assert np.max(errors) < 0.01
    assert np.median(errors) < 1e-3


@pytest.mark.sampled(4)
def test_the_uncertainty_is_that_of_the_errors_and_the_misfit_has_its_degrees_of_freedom():
    """The mean square of 19 x 8 deviations over their u, in 20 laboratories, is 1."""
    rig, plain, equal, misfit, chances = BeltedRig(), [], [], [], []
    for seed in range(20):
        poles = all_poles(*rig.recorded(FREQUENCIES, noise=2e-4, seed=seed))
        same, chance = reciprocal(poles)
        plain.append(deviations(poles, rig))
        equal.append(deviations(same, rig))
        misfit.append(poles.misfit)
        chances.append(chance)
    for squares in (np.square(plain), np.square(equal)):
        assert np.mean(squares) == pytest.approx(1.0, abs=0.15)
    assert np.mean(misfit) == pytest.approx(2.0, abs=4 * np.sqrt(4 / (20 * FREQUENCIES.size)))
    assert np.min(chances) > 1e-4
    assert np.median(chances) == pytest.approx(0.5, abs=0.35)


def test_an_error_of_a_weighed_mass_is_within_the_shared_uncertainty():
    """All tests of a mass have its error: the deviation is what the shared columns say, at each frequency."""
    rig = BeltedRig()
    phasors, setups = rig.recorded(FREQUENCIES, masses_off={12.0: 2.4e-3})  # one standard uncertainty
    poles = all_poles(phasors, setups)
    left = (poles.stiffness - rig.truth(FREQUENCIES)).reshape(-1, 4)
    column = np.flatnonzero(np.unique(setups.mass[setups.mass > 0]) == 12.0)[0]
    change = poles.shared[:, :, column].reshape(-1, 4, 2)
    # The true mass is larger than the stated one by one u: the estimate is off by what an error of -1 u makes of it.
    np.testing.assert_allclose(left, -(change[..., 0] + 1j * change[..., 1]), rtol=2e-3, atol=2.0)


def test_input_mass_and_wheel_mass_are_taken_off_and_carry_their_uncertainty():
    rig = BeltedRig(input_mass=1.5, wheel_mass=9.0)
    poles = all_poles(*rig.recorded(FREQUENCIES), input_mass=(1.5, 0.01), wheel_mass=(9.0, 0.02))
    assert off(poles, rig).max() < 1e-9
    square = (2 * np.pi * FREQUENCIES) ** 2
    off_input = all_poles(*rig.recorded(FREQUENCIES), input_mass=(1.51, 0.0), wheel_mass=(9.0, 0.0)).stiffness
    np.testing.assert_allclose(off_input[:, 0, 0] - poles.stiffness[:, 0, 0], 0.01 * square, rtol=1e-6)
    np.testing.assert_allclose(off_input[:, 1, 1] - poles.stiffness[:, 1, 1], -0.01 * square, rtol=1e-6)
    np.testing.assert_allclose(poles.shared[:, 0, 3], 0.01 * square, rtol=1e-6)
    np.testing.assert_allclose(poles.shared[:, 6, -1], 0.02 * square, rtol=1e-9)


def test_a_sensor_that_is_mounted_anew_is_seen_by_reciprocity_and_corrected():
    """V1's gain is 0.5 % higher with the specimen than with the blocks: k12 = k21 gives it back."""
    rig = BeltedRig()
    phasors, setups = rig.recorded(FREQUENCIES, noise=1e-4)
    amplitudes = phasors.amplitudes * np.where(setups.rigid[:, None], 1.0, [1.0, 1.005, 1.0])
    phasors = replace(phasors, amplitudes=amplitudes)
    unsure = ChannelUncertainty(gain=np.array([0.0, 0.01, 0.0]), mounting=np.array([0, 5e-3 + 5e-3j, 0]))
    errors = tuple(unsure.errors(phasors.omega, [setups.rigid.astype(int)])[1:])
    assert len(errors) == 4
    known, chance = reciprocal(all_poles(phasors, setups, errors=errors))
    plain, told = reciprocal(all_poles(phasors, setups))
    assert told < 1e-6
    assert chance > 1e-3
    assert np.median(off(known, rig)) < 0.5 * np.median(off(plain, rig))
    assert np.mean(np.square(deviations(known, rig))) == pytest.approx(1.0, abs=0.6)


def test_a_specimen_that_changes_between_loads_is_within_the_shared_uncertainty():
    """A massless specimen is 0.3 % stiffer with the added mass: the deviation is one standard uncertainty."""
    rig, stiffer = BeltedRig(belt=0.0), BeltedRig(belt=0.0, k_contact=348e3 * 1.003, k_rim=1740e3 * 1.003)
    phasors, setups = rig.recorded(FREQUENCIES)
    changed, _ = stiffer.recorded(FREQUENCIES)
    which = ~setups.rigid & (setups.mass > 0)
    phasors = replace(phasors, amplitudes=np.where(which[:, None], changed.amplitudes, phasors.amplitudes))
    poles = all_poles(phasors, setups, change=3e-3 + 1e-3j)
    left = (poles.stiffness - rig.truth(FREQUENCIES)).reshape(-1, 4)
    change = poles.shared[:, :, -3].reshape(-1, 4, 2)
    np.testing.assert_allclose(left, change[..., 0] + 1j * change[..., 1], rtol=0.02, atol=30.0)
    np.testing.assert_allclose(poles.shared[:, ::2, -2] * 3, -poles.shared[:, 1::2, -3], rtol=1e-4, atol=0.01)


def test_blocks_that_move_differently_do_not_agree():
    phasors, setups = BeltedRig().recorded(FREQUENCIES, noise=1e-4)
    assert all_poles(phasors, setups).agreement > 1e-3
    bent = np.where((setups.rigid & (setups.mass == 20.0))[:, None], [1.0, 1.0, 1.002], 1.0)
    assert all_poles(replace(phasors, amplitudes=phasors.amplitudes * bent), setups).agreement < 1e-6


def test_an_active_specimen_is_told_by_its_determinant():
    poles = all_poles(*BeltedRig(active=0.05).recorded(FREQUENCIES, noise=2e-4))
    assert reciprocal(poles)[1] < 1e-6
    assert np.all(np.abs(poles.determinant - 1 / 1.05) < 4 * np.hypot(*poles.determinant_std.T))


@pytest.mark.parametrize("jitter", [1e-3, 5e-3])
def test_tests_of_slightly_different_frequency_are_brought_to_one(jitter):
    """The chain of a specimen and the stiffness of a rig are smooth also at resonances; 5 Hz between frequencies."""
    rig = BeltedRig()
    poles = all_poles(*rig.recorded(FREQUENCIES, jitter=jitter))
    assert off(poles, rig, poles.frequency).max() < 30 * jitter**2


def test_more_blocks_loads_and_repeats_reduce_the_uncertainty():
    few = all_poles(*BeltedRig().recorded(FREQUENCIES, noise=1e-4))
    many = all_poles(*BeltedRig().recorded(FREQUENCIES, blocks=(6, 13, 20), loads=(0, 6, 12), repeats=3, noise=1e-4))
    variance = [np.trace(poles.noise, axis1=1, axis2=2) for poles in (many, few)]
    assert np.all(variance[0] < 0.5 * variance[1])
    assert np.mean(many.misfit) == pytest.approx(4 * 18 - 14, rel=0.15)


def test_an_uncertain_frequency_is_part_of_the_noise():
    phasors, setups = BeltedRig().recorded(FREQUENCIES, noise=1e-5)
    unsure = replace(phasors, frequency_std=1e-3 * phasors.frequency)
    assert np.all(all_poles(unsure, setups).noise[:, 6, 6] > 2 * all_poles(phasors, setups).noise[:, 6, 6])


@pytest.mark.parametrize(
    ("blocks", "loads", "lack"),
    [
        ((6.0,), (0.0, 12.0), "1 of 2 rigid blocks: add tests of kind = calibration"),
        ((6.0, 20.0), (12.0,), "1 of 2 loads: add tests of the specimen with another weighed mass"),
        ((6.0, 6.0), (0.0, 0.0), "1 of 2 rigid blocks.*1 of 2 loads"),
    ],
)
def test_a_missing_block_or_load_is_an_error_that_says_what_to_add(blocks, loads, lack):
    with pytest.raises(RigError, match=f"10 Hz has {lack}"):
        all_poles(*BeltedRig().recorded([10.0, 20.0], blocks=blocks, loads=loads))


def test_a_complex_matrix_acts_on_interleaved_parts():
    rng = np.random.default_rng(1)
    matrix = rng.standard_normal((3, 4)) + 1j * rng.standard_normal((3, 4))
    vector = rng.standard_normal(4) + 1j * rng.standard_normal(4)
    flat = np.stack([vector.real, vector.imag], axis=1).ravel()
    moved = real_matrix(matrix) @ flat
    np.testing.assert_allclose(moved[::2] + 1j * moved[1::2], matrix @ vector, rtol=1e-12)
