"""What the tests have in common, counted in its stated uncertainties."""

import numpy as np
import pytest

from fourpole.core.channelerrors import ChannelUncertainty
from fourpole.core.joint.shared import Shared
from fourpole.core.rig import Rig
from fourpole.core.sources import Role


def stated(rig=None, gain=(0.01, 0.0, 0.02), phase=(0.0, 0.003, 0.0), masses=(5.0, 10.0), std=(5e-4, 0.0)):
    rig = rig or Rig(moving_mass=15.0, preload_stiffness=12440.0, std={"moving_mass": 0.1, "preload_damping": 5.0})
    return Shared.stated(rig, errors(gain, phase), np.array(masses), np.array(std))


def errors(gain=(0.01, 0.0, 0.02), phase=(0.0, 0.003, 0.0)):
    return ChannelUncertainty(np.array(gain), np.array(phase)).errors(np.array([60.0]))


def gains_at(shared, z):
    """Of one test."""
    found = np.zeros(3, dtype=complex)
    for error, value in zip(errors(), shared.offsets(z, Role.CHANNEL, len(errors())), strict=True):
        found[error.channel] += value * error.turn[0]
    return np.exp(found)


def test_only_what_is_uncertain_is_shared():
    names = [parameter.source.text for parameter in stated().parameters]
    assert names == ["moving_mass", "preload_damping", "gain F1", "phase V1", "gain V2", "added mass 5 kg"]
    assert stated().std.tolist() == [0.1, 5.0, 0.01, 0.003, 0.02, 5e-4]


def test_a_rigid_frame_is_not_uncertain_though_a_std_is_stated():
    shared = stated(Rig(moving_mass=15.0, preload_stiffness=12440.0, std={"frame_stiffness": 1e4}))
    assert "frame_stiffness" not in [parameter.source.text for parameter in shared.parameters]


def test_at_zero_all_is_as_stated():
    shared = stated()
    zero = np.zeros(len(shared))
    assert shared.found(zero).tolist() == [15.0, 0.0, 1.0, 0.0, 1.0, 5.0]
    assert shared.rig_at(zero).impedance(60.0) == shared.rig.impedance(60.0)
    assert gains_at(shared, zero).tolist() == [1.0, 1.0, 1.0]
    assert shared.masses_at(zero).tolist() == [5.0, 10.0]


def test_each_moves_by_its_uncertainty():
    shared = stated()
    z = np.arange(1.0, 7.0)
    rig = shared.rig_at(z)
    assert (rig.moving_mass, rig.preload_damping, rig.preload_stiffness) == (15.1, 10.0, 12440.0)
    assert gains_at(shared, z) == pytest.approx([np.exp(0.03), np.exp(0.012j), np.exp(0.1)], rel=1e-15)
    assert shared.masses_at(z) == pytest.approx([5.003, 10.0], rel=1e-15)
    assert shared.found(z) == pytest.approx([15.1, 10.0, np.exp(0.03), 0.012, np.exp(0.1), 5.003], rel=1e-15)


def test_a_gain_that_is_found_is_the_gain_that_the_model_has():
    shared = stated()
    z = np.array([30.0, -2.0, 3.0, 1.0, -4.0, 0.5])  # a value set aside may be many uncertainties off
    found = dict(zip([parameter.source.text for parameter in shared.parameters], shared.found(z), strict=True))
    gains = np.abs(gains_at(shared, z))
    assert [found["gain F1"], found["gain V2"]] == pytest.approx(gains[[0, 2]], rel=1e-15)


def test_a_value_may_be_found_where_none_could_be_stated():
    shared = stated()
    assert shared.rig_at(np.array([0, -1.0, 0, 0, 0, 0])).preload_damping == -5.0


def test_all_exact_is_nothing_shared():
    shared = stated(Rig(moving_mass=15.0), (0.0,) * 3, (0.0,) * 3, (5.0,), (0.0,))
    assert len(shared) == 0
    assert shared.found(np.zeros(0)).size == 0
    assert shared.masses_at(np.zeros(0)).tolist() == [5.0]
