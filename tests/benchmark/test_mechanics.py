"""The exact exponential and the stepper against the transfer matrix, closed forms and another integrator."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from elastomer_truth import slipping
from elastomer_truth.drawing import draw, names
from elastomer_truth.mechanics import Link, Network, steady_cycle
from elastomer_truth.recording import motions
from elastomer_truth.slipping import steady_slipping
from elastomer_truth.truth import stiffnesses
from fourpole.core.rig import Rig

pytestmark = pytest.mark.thorough


def lines_of(test, period):
    low, high = (test.frequency, test.frequency) if test.kind == "sine" else test.band
    return np.unique(np.round(np.geomspace(low, high, 20) * period).astype(int))


@pytest.mark.parametrize("name", ["H001", "H022", "H029", "F013"])
def test_motion_in_time_is_that_of_the_transfer_matrix(name):
    lab = draw(name)
    tests = {test.name: test for test in lab.tests}
    for key, motion in motions(lab).items():
        k = lines_of(tests[key], motion.period)
        if tests[key].kind == "multisine":
            k = np.unique(np.round(k / motion.period).astype(int) * round(motion.period))
        expected = lab.network(tests[key]).state_space().transfer(2 * np.pi * motion.frequency[k])
        found = motion.amplitudes[k] / motion.amplitudes[k, :1]
        assert np.all(np.abs(found - expected) <= 1e-5 * np.abs(expected).max(axis=0))


def test_a_massless_specimen_under_its_mass_has_the_closed_form():
    """At thirty campaigns' parameters: V2/V1 = K/(K + jw Zr), F1 = Zr V2 plus the inertia before the specimen."""
    seen = 0
    for name in names():
        lab = draw(name)
        kinds = {one.kind for one in lab.specimens.values()}
        test = next((test for test in lab.tests if test.kind == "sine"), None)
        plain = not {"frame stiffness", "guide friction", "cable stiffness", "base motion"} & lab.values.keys()
        if lab.blocked or test is None or not plain or not kinds <= {"massless", "hydromount"}:
            continue
        seen += 1
        omega = 2 * np.pi * np.array([test.frequency])
        stiffness, _ = stiffnesses(lab.network(test), np.array([test.frequency]))
        rig = Rig(moving_mass=lab.true("moving mass"), preload_stiffness=lab.true("preload spring"),
                  preload_damping=lab.true("preload damping"))  # fmt: skip
        impedance = np.asarray(rig.impedance(omega, np.array([0.0])))
        ratio = stiffness / (stiffness + 1j * omega * impedance)
        force = 1j * omega * impedance * ratio - omega**2 * lab.true("input mass")
        found = lab.network(test).state_space().transfer(omega)[0]
        np.testing.assert_allclose(found[1:3], [force[0], ratio[0]], rtol=1e-9)
    assert seen >= 10


def test_a_chain_has_the_four_pole_of_its_parts():
    first, second, mass, f = 2e5 + 1e4j, 7e5 + 3e4j, 5.0, 30.0
    w = 2 * np.pi * f
    links = (
        Link("contact", "specimen 1", first.real, first.imag / w),
        Link("specimen 1", "wheel", second.real, second.imag / w),
    )
    springs, blocked = stiffnesses(Network({"specimen 1": mass, "wheel": 10.0}, links), np.array([f]))
    assert springs[0] == pytest.approx(first * second / (first + second))
    assert blocked[0] == pytest.approx(first * second / (first + second - w**2 * mass))


def network(largest=1e-4):
    slip = ((5.0 / largest, largest),)
    links = (
        Link("contact", "wheel", 1.5e5, arms=((2e4, 1e-2), (1e4, 1.0))),
        Link("wheel", "ground", 1.2e4, 600.0, slip=slip),
    )
    return Network({"wheel": 15.0}, links)


def test_friction_that_hardly_slips_is_a_spring():
    # 5 N after 1 km: the element is a spring of 5 mN/m, which is nothing.
    space = network(1e3).state_space()
    out = steady_slipping([space], np.array([12.0]), np.array([1e-3]))[0]
    plain = Network(network().masses, (network().links[0], Link("wheel", "ground", 1.2e4, 600.0))).state_space()
    expected = steady_cycle(plain, np.array([12.0]), np.array([1e-3 + 0j]), 1 / 12.0, 64)
    ratio = [np.fft.rfft(x, axis=0)[1] / len(x) for x in (out, expected)]
    np.testing.assert_allclose(ratio[0], ratio[1], rtol=1e-6, atol=1e-12)


def test_friction_is_that_of_another_integrator():
    space, f, amplitude = network().state_space(), 12.0, 1e-3
    out = steady_slipping([space], np.array([f]), np.array([amplitude]))[0]
    w = 2 * np.pi * f
    (place, largest, row), *_ = space.slips

    def rate(t, z):
        drive = amplitude * np.array([np.cos(w * t), -w * np.sin(w * t), -w * w * np.cos(w * t)])
        both = np.concatenate([z, drive])
        slope = space.rates @ both
        slope[place] -= abs(row @ both) * z[place] / largest
        return slope

    times = (np.arange(256) / 256 + 8) / f
    span = (0, times[-1])
    done = solve_ivp(rate, span, np.zeros(space.size), t_eval=times, rtol=1e-8, atol=1e-12, max_step=1 / f / 200)
    drive = amplitude * np.stack([np.cos(w * times), -w * np.sin(w * times), -w * w * np.cos(w * times)])
    other = (space.outputs @ np.concatenate([done.y, drive])).T
    found, expected = (np.fft.rfft(x, axis=0)[[1, 3]] / len(x) for x in (out, other))
    np.testing.assert_allclose(found[0, :3], expected[0, :3], rtol=3e-5)
    np.testing.assert_allclose(found[1, 1:3], expected[1, 1:3], atol=3e-5 * abs(expected[0, 1]))


def test_half_of_the_step_changes_nothing():
    """Ten recordings, once more with half of the step at which the stepper stopped."""
    frequencies, amplitudes = np.geomspace(6.0, 34.0, 10), np.geomspace(1.5e-3, 3e-4, 10)
    spaces = [network(5e-4).state_space() for _ in frequencies]
    usual = steady_slipping(spaces, frequencies, amplitudes)
    batch = slipping.Batch(spaces, frequencies, amplitudes)
    scale = amplitudes[:, None] * np.maximum(1.0, batch.omega[:, None])
    state, inverse, _ = slipping._begun(batch, scale)
    _, finer = slipping._fixed_point(batch, state, inverse, 2 * usual.shape[1], scale)
    first = np.fft.rfft(usual, axis=1)[:, 1, 1:3] / usual.shape[1]
    second = np.fft.rfft(finer, axis=0)[1, :, 1:3] / finer.shape[0]
    np.testing.assert_allclose(first, second, rtol=1e-6)
