"""A fixture between V1 and the specimen: stated, it is taken out; not stated, rigid blocks ask for it."""

from dataclasses import replace

import numpy as np
import pytest

from fourpole.core.channelerrors import ChannelUncertainty
from fourpole.core.identify import identify
from fourpole.core.joint import solve_joint
from fourpole.core.joint.outputs import identification
from fourpole.core.phasor import Phasors
from fourpole.core.rig import Rig, given_way, without_fixture
from fourpole.core.sources import Kind, Source

MASS, SPRING, INPUT, FIXTURE = 15.0, 12440.0, 0.8, 2e7
RIG = Rig(moving_mass=MASS, preload_stiffness=SPRING, input_mass=INPUT, std={"moving_mass": 0.03})
HERTZ = np.tile([8.0, 11.0, 14.0, 18.0, 23.0], 3)
ADDED, BLOCK = np.repeat([0.0, 10.0, 0.0], 5), np.repeat([False, False, True], 5)


def stiffness(w):
    return 2e5 * (1j * w / 60) ** 0.06


def made(noise=0.0, seed=0, fixture=FIXTURE):
    """Specimens and blocks by forces alone: the fixture gives way beneath the sensor of V1."""
    w = 2 * np.pi * HERTZ
    held = SPRING - w**2 * (MASS + ADDED)  # force over motion of the far side
    x2 = np.full(w.size, 1e-3, dtype=complex)
    force = held * x2
    contact = x2 + np.where(BLOCK, 0.0, force / stiffness(w))
    x1 = contact + force / fixture
    amplitudes = np.stack([force - w**2 * INPUT * x1, 1j * w * x1, 1j * w * x2], axis=1)
    std = noise * np.abs(amplitudes)
    rng = np.random.default_rng(seed)
    amplitudes = amplitudes + std * (rng.normal(size=std.shape) + 1j * rng.normal(size=std.shape))
    covariance = np.zeros((w.size, 6, 6))
    covariance[:, range(6), range(6)] = np.repeat(std**2, 2, axis=1)
    none = np.zeros(w.size)
    return Phasors(HERTZ, amplitudes, covariance, none, none + np.inf)


def test_a_stated_fixture_is_taken_out_exactly():
    taken = without_fixture(made(), np.full(HERTZ.size, 1 / FIXTURE), np.full(HERTZ.size, INPUT))
    for route in ("relative", "mobility", "transmissibility"):
        found = identify(taken.part(~BLOCK), RIG, route=route, added_mass=ADDED[~BLOCK]).stiffness
        np.testing.assert_allclose(found, stiffness(2 * np.pi * HERTZ[~BLOCK]), rtol=1e-11)


def test_its_uncertainty_reaches_the_stiffness():
    taken = without_fixture(made(), np.full(HERTZ.size, 1 / FIXTURE), np.full(HERTZ.size, INPUT)).part(~BLOCK)
    fixture, size = given_way(taken, INPUT, np.zeros(10, dtype=bool))
    u = 0.1 / FIXTURE  # of its compliance
    channels = ChannelUncertainty(fixture=fixture, fixture_std=u / size)
    found = identify(taken, RIG, route="relative", channels=channels)
    np.testing.assert_allclose(np.sqrt(found.stiffness_covariance[:, 0, 0]), u * (found.stiffness**2).real, rtol=0.1)


def test_without_an_input_mass_it_is_exactly_that_of_a_spring_in_series():
    exact = replace(made(), amplitudes=made().amplitudes + np.array([1.0, 0, 0]) * (2 * np.pi * HERTZ[:, None]) ** 2
                    * INPUT * made().amplitudes[:, 1:2] / (2j * np.pi * HERTZ[:, None]))  # fmt: skip
    taken = without_fixture(exact, np.full(HERTZ.size, 1 / FIXTURE), np.zeros(HERTZ.size)).part(~BLOCK)
    fixture, size = given_way(taken, 0.0, np.zeros(10, dtype=bool))
    channels = ChannelUncertainty(fixture=fixture, fixture_std=0.1 / FIXTURE / size)
    found = identify(taken, replace(RIG, input_mass=0.0), route="relative", channels=channels)
    u = np.sqrt(found.stiffness_covariance[:, 0, 0])
    np.testing.assert_allclose(u, 0.1 / FIXTURE * (found.stiffness**2).real, rtol=1e-9)


def solved(phasors, of_blocks=slice(None)):
    phasors = phasors.part(of_blocks)
    fixture, _ = given_way(phasors, INPUT, BLOCK[of_blocks])
    channels = ChannelUncertainty(np.full(3, 1e-3), np.full(3, 1e-3), fixture=fixture)
    family = np.where(BLOCK, -1, 0)[of_blocks]
    joint = solve_joint(
        phasors, RIG, 1.8e5, family=family, added_mass=ADDED[of_blocks], added_mass_std=1e-3, channels=channels
    )
    return joint, identification(joint, phasors, 1.8e5, 0.0)


@pytest.mark.thorough
@pytest.mark.sampled(12)
def test_rigid_blocks_ask_for_a_fixture_and_say_how_stiff_it_is():
    joint, found = solved(made(2e-5))
    assert Source(Kind.FIXTURE, "V1") in joint.misfit.added
    assert joint.misfit.candidates[0].form == "fixture"
    assert not joint.misfit.fits
    softest = np.median(np.abs(found.stiffness[~BLOCK]))
    assert joint.misfit.candidates[0].value == pytest.approx(softest / FIXTURE, rel=0.1)


def test_blocks_on_a_rigid_fixture_ask_for_none():
    assert solved(made(2e-5, fixture=np.inf))[0].misfit.fits


def test_without_blocks_no_test_asks_for_it():
    assert not solved(made(2e-5), ~BLOCK)[0].misfit.added
