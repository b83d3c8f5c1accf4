"""Tests of one condition at different temperatures share K* only as far as the stated sensitivity allows."""

import numpy as np
import pytest

from fourpole import Phasors, Rig
from fourpole.core.joint.outputs import identify_joint

NOISE, PER_KELVIN = 1e-4, 0.01


def phasors_at(temperature, omega=2 * np.pi * 12.0, seed=0, moves=PER_KELVIN):
    """Phasors of a specimen whose |K*| falls by `moves` per kelvin; independent of the model of the joint route."""
    rng = np.random.default_rng(seed)
    temperature = np.asarray(temperature, dtype=float)
    k = (2e5 + 4e4j) * np.exp(-moves * (temperature - 20.0))
    above = 1j * omega * 15.0 + 12440.0 / (1j * omega)  # F1 / V2 of mass and spring
    ratio = k / (k + 1j * omega * above)
    amplitudes = 0.06 * np.stack([above * ratio, np.ones(k.size), ratio], axis=1)
    std = NOISE * np.abs(amplitudes)
    noise = std * (rng.standard_normal(std.shape) + 1j * rng.standard_normal(std.shape))
    covariance = np.zeros((k.size, 6, 6))
    covariance[:, np.arange(6), np.arange(6)] = np.repeat(std, 2, axis=1) ** 2
    zero = np.zeros(k.size)
    return Phasors(zero + omega / (2 * np.pi), amplitudes + noise, covariance, zero, zero + np.inf), k


def found_at(temperature, seed=0, apart=None, **more):
    phasors, k = phasors_at(temperature, seed=seed, **more)
    temperature = np.asarray(temperature, dtype=float)
    apart = PER_KELVIN * np.abs(temperature - temperature.mean()) if apart is None else apart
    return identify_joint(phasors, Rig(15.0, 12440.0), apart=apart), k


@pytest.mark.thorough
@pytest.mark.sampled(4)
def test_each_test_keeps_the_stiffness_of_its_own_temperature():
    off = []
    for seed in range(60):
        found, k = found_at([20.0, 24.9], seed)
        std = np.sqrt(np.diagonal(found.stiffness_covariance, 0, 1, 2))
        off.append(np.stack([(found.stiffness - k).real, (found.stiffness - k).imag], axis=1) / std)
    # 240 normalised errors: three standard errors of their mean square, sqrt(2/240), and of a share of 95 %.
    assert np.mean(np.square(off)) == pytest.approx(1.0, abs=3 * np.sqrt(2 / 240))
    assert np.mean(np.abs(off) < 1.96) > 0.95 - 3 * np.sqrt(0.95 * 0.05 / 240)


def test_the_condition_is_as_uncertain_as_its_temperatures_differ():
    found, _ = found_at([20.0, 24.0], moves=0.0)
    relative = np.sqrt(found.condition_covariance[0, 0, 0]) / abs(found.stiffness[0])
    # Two tests, each 2 K from the mean: 2 % each, 2 %/sqrt(2) for their mean, along K*.
    assert relative == pytest.approx(0.02 / np.sqrt(2) * np.abs(np.exp(0j)), rel=0.01)


def test_one_temperature_changes_nothing():
    phasors, _ = phasors_at([20.0, 20.0, 20.0])
    plain = identify_joint(phasors, Rig(15.0, 12440.0))
    same = identify_joint(phasors, Rig(15.0, 12440.0), apart=np.zeros(3))
    assert np.array_equal(plain.stiffness, same.stiffness)
    assert np.array_equal(plain.stiffness_covariance, same.stiffness_covariance)


def test_without_the_sensitivity_the_difference_of_temperature_would_be_hidden():
    """Two tests 4.9 K apart: sharing one K*, both rows would be off by 2.4 % at a hundredth of that uncertainty."""
    apart, k = found_at([20.0, 24.9])
    assert np.max(np.abs(apart.stiffness / k - 1)) < 10 * NOISE
