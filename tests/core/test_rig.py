"""The rig: its impedance in closed form, the derivatives of it, and what it refuses."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fourpole.core.rig import PARAMETERS, Rig
from fourpole.errors import FourpoleError, RigError

OMEGA = 2 * np.pi * np.array([2.0, 10.0, 17.0, 24.0])
FULL = {
    "moving_mass": 15.0,
    "preload_stiffness": 12440.0,
    "preload_damping": 25.0,
    "preload_loss_factor": 0.02,
    "tyre_mass": 1.5,
    "frame_stiffness": 3e6,
    "input_mass": 0.8,
}


def impedance(omega, added_mass=0.0, **rig):
    """Zr by hand: masses beside what holds them, leaf and frame in series."""
    values = {**dict.fromkeys(PARAMETERS, 0.0), "frame_stiffness": np.inf, **rig}
    jw = 1j * omega
    inertia = jw * (values["moving_mass"] + values["tyre_mass"] + added_mass)
    leaf = values["preload_stiffness"] * (1 + 1j * values["preload_loss_factor"]) + jw * values["preload_damping"]
    if np.all(leaf == 0):
        return inertia
    compliance = jw / leaf + (0.0 if values["frame_stiffness"] == np.inf else jw / values["frame_stiffness"])
    return inertia + 1 / compliance


@pytest.mark.parametrize(
    "stated",
    [
        {"moving_mass": 15.0, "preload_stiffness": 12440.0},
        {"moving_mass": 15.0, "preload_stiffness": 12440.0, "preload_damping": 25.0},
        {"moving_mass": 15.0, "preload_damping": 25.0},
        {"moving_mass": 15.0},
        {"moving_mass": 15.0, "frame_stiffness": 1e6},
        FULL,
    ],
)
@pytest.mark.parametrize("added", [0.0, 10.0, np.array([0.0, 1.0, 5.0, 10.0])])
def test_impedance_and_mobility(stated, added):
    rig = Rig(**stated)
    expected = impedance(OMEGA, added, **stated)
    np.testing.assert_allclose(rig.impedance(OMEGA, added), expected, rtol=1e-13)
    np.testing.assert_allclose(rig.mobility(OMEGA, added), 1 / expected, rtol=1e-13)


def test_papers_rig():
    rig = Rig(moving_mass=15.0, preload_stiffness=12440.0)
    np.testing.assert_allclose(rig.impedance(OMEGA), 1j * OMEGA * 15.0 + 12440.0 / (1j * OMEGA), rtol=1e-13)
    assert rig.resonance == pytest.approx(np.sqrt(12440.0 / 15.0) / (2 * np.pi), rel=1e-15)
    assert abs(rig.impedance(2 * np.pi * rig.resonance)) < 1e-12 * rig.resonance * 15.0
    heavier = Rig(moving_mass=13.0, tyre_mass=2.0, preload_stiffness=12440.0)
    assert heavier.resonance == pytest.approx(rig.resonance, rel=1e-15)


def test_a_free_rig_is_its_mass():
    free = Rig(moving_mass=15.0)
    np.testing.assert_allclose(free.impedance(OMEGA, 2.0), 17j * OMEGA, rtol=1e-15)
    assert free.resonance == 0.0


def test_the_chain_is_that_of_the_parts():
    chain = Rig(**FULL).chain(OMEGA, 4.0)
    assert chain.shape == (4, 2, 2)
    leaf = 12440.0 * (1 + 0.02j) + 1j * OMEGA * 25.0
    compliance = 1j * OMEGA / leaf + 1j * OMEGA / 3e6
    inertia = 1j * OMEGA * (15.0 + 1.5 + 4.0)
    np.testing.assert_allclose(chain[:, 0, 0], 1 + inertia * compliance, rtol=1e-13)
    np.testing.assert_allclose(chain[:, 0, 1], inertia, rtol=1e-13)
    np.testing.assert_allclose(chain[:, 1, 0], compliance, rtol=1e-13)
    np.testing.assert_allclose(chain[:, 1, 1], np.ones(4), rtol=1e-13)


@pytest.mark.parametrize("added", [0.0, 10.0])
@pytest.mark.parametrize("without", [(), ("frame_stiffness",), ("frame_stiffness", "preload_loss_factor", "tyre_mass")])
def test_gradient_is_that_of_the_impedance(without, added):
    """Zr is a rational function of each value: a central difference with step h is off by h² times its curvature."""
    stated = {name: value for name, value in FULL.items() if name not in without}
    gradient = Rig(**stated).impedance_gradient(OMEGA, added)
    assert gradient.shape == (4, 8)
    for i, name in enumerate([*PARAMETERS, "added_mass"]):
        if name == "frame_stiffness" and name in without:
            np.testing.assert_array_equal(gradient[:, i], 0.0)
            continue
        step = {"preload_loss_factor": 1e-4}.get(name, 1e-4 * FULL.get(name, 10.0))
        values = []
        for sign in (1, -1):
            changed = dict(stated)
            changed.pop("added_mass", None)
            now = added
            if name == "added_mass":
                now = added + sign * step
            else:
                changed[name] = stated.get(name, 0.0) + sign * step
            values.append(impedance(OMEGA, now, **changed))
        difference = (values[0] - values[1]) / (2 * step)
        # relative curvature is of order one, so 1e-8 of the slope is left, and round-off of |Zr| over the step
        atol = 4e-16 * np.abs(values[0]).max() / step
        np.testing.assert_allclose(gradient[:, i], difference, rtol=1e-6, atol=4 * atol)


def test_gradient_by_the_masses():
    """Zr is linear in the masses: its derivative is jw, to round-off."""
    gradient = Rig(**FULL).impedance_gradient(OMEGA, 3.0)
    for name in ("moving_mass", "tyre_mass"):
        np.testing.assert_allclose(gradient[:, list(PARAMETERS).index(name)], 1j * OMEGA, rtol=1e-12)
    np.testing.assert_allclose(gradient[:, -1], 1j * OMEGA, rtol=1e-12)


def test_the_input_mass_is_not_part_of_the_impedance():
    gradient = Rig(**FULL).impedance_gradient(OMEGA)
    np.testing.assert_array_equal(gradient[:, list(PARAMETERS).index("input_mass")], 0.0)
    lighter = Rig(**{**FULL, "input_mass": 0.0})
    np.testing.assert_array_equal(lighter.impedance(OMEGA), Rig(**FULL).impedance(OMEGA))


def test_gradient_of_a_free_and_of_a_blocked_rig():
    free = Rig(moving_mass=15.0).impedance_gradient(OMEGA)
    np.testing.assert_allclose(free[:, [0, 4, 7]], np.repeat(1j * OMEGA[:, None], 3, axis=1), rtol=1e-13)
    assert not Rig(blocked=True).impedance_gradient(OMEGA).any()
    assert Rig(blocked=True).impedance_gradient(OMEGA).shape == (4, 8)


def test_blocked():
    rig = Rig(blocked=True)
    assert np.isnan(rig.resonance)
    np.testing.assert_array_equal(rig.mobility(OMEGA), np.zeros(4))
    assert rig.mobility(OMEGA, np.ones((3, 1))).shape == (3, 4)
    assert np.isinf(rig.impedance(OMEGA)).all()


def test_shapes():
    rig = Rig(**FULL)
    assert np.ndim(rig.impedance(10.0)) == np.ndim(rig.mobility(10.0)) == 0
    added = np.zeros((3, 1))
    assert rig.impedance(OMEGA, added).shape == rig.mobility(OMEGA, added).shape == (3, 4)
    assert rig.impedance_gradient(OMEGA, added).shape == (3, 4, 8)
    assert rig.impedance_gradient(10.0).shape == (8,)


@given(
    st.floats(1.0, 100.0),
    st.just(0.0) | st.floats(1.0, 1e6),
    st.just(0.0) | st.floats(1.0, 1e3),
    st.floats(0.0, 0.5),
    st.floats(1.0, 1e3),
)
def test_a_passive_rig_takes_power(m, k3, c3, eta, omega):
    rig = Rig(moving_mass=m, preload_stiffness=k3, preload_damping=c3, preload_loss_factor=eta)
    z = complex(rig.impedance(omega))
    lossless = abs(omega * m) + k3 / omega
    assert z.real >= -1e-14 * lossless
    assert z.real == pytest.approx(c3 + eta * k3 / omega, abs=1e-13 * (abs(z) + lossless))


def test_uncertainties_stand_in_the_order_of_the_parameters():
    rig = Rig(moving_mass=15.0, std={"input_mass": 0.1, "moving_mass": 0.2})
    assert rig.uncertainties.tolist() == [0.2, 0, 0, 0, 0, 0, 0.1]
    assert list(PARAMETERS)[:: len(PARAMETERS) - 1] == ["moving_mass", "input_mass"]


@pytest.mark.parametrize(
    ("stated", "says"),
    [
        ({}, "moving_mass is 0 kg: it must be a finite, positive number"),
        ({"moving_mass": -1.0}, "moving_mass is -1 kg"),
        ({"moving_mass": np.nan}, "moving_mass is nan kg"),
        ({"moving_mass": np.inf}, "moving_mass is inf kg"),
        ({"moving_mass": 15.0, "preload_stiffness": -1.0}, "preload_stiffness is -1 N/m.*zero or positive"),
        ({"moving_mass": 15.0, "preload_stiffness": np.inf}, "preload_stiffness is inf N/m"),
        ({"moving_mass": 15.0, "preload_damping": -1.0}, "preload_damping is -1 N s/m"),
        ({"moving_mass": 15.0, "preload_loss_factor": -0.1}, "preload_loss_factor is -0.1 1"),
        ({"moving_mass": 15.0, "tyre_mass": -1.0}, "tyre_mass is -1 kg"),
        ({"moving_mass": 15.0, "input_mass": np.nan}, "input_mass is nan kg"),
        ({"moving_mass": 15.0, "frame_stiffness": 0.0}, "frame_stiffness is 0 N/m.*positive"),
        ({"moving_mass": 15.0, "frame_stiffness": -np.inf}, "frame_stiffness is -inf N/m"),
        ({"moving_mass": -1.0, "blocked": True}, "moving_mass is -1 kg"),
        ({"moving_mass": 15.0, "std": {"mass": 1.0}}, "no value 'mass': it has moving_mass, preload_stiffness"),
        ({"moving_mass": 15.0, "std": {"moving_mass": -1.0}}, "uncertainty of moving_mass is -1"),
        ({"moving_mass": 15.0, "std": {"moving_mass": np.nan}}, "uncertainty of moving_mass is nan"),
    ],
)
def test_impossible_rigs(stated, says):
    with pytest.raises(RigError, match=says) as caught:
        Rig(**stated)
    assert isinstance(caught.value, FourpoleError)
    assert isinstance(caught.value, ValueError)


def test_a_blocked_rig_needs_no_mass_and_a_frame_may_be_rigid():
    assert Rig(blocked=True).moving_mass == 0.0
    assert Rig(moving_mass=1.0, frame_stiffness=np.inf).frame_stiffness == np.inf
