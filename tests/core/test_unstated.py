"""What nobody stated of a rig and its specimens, in the uncertainty of routes that take each test by itself."""

import numpy as np
import pytest

from fourpole.core import alone
from fourpole.core.alone import largest_imbalance, shown_friction, shown_masses
from fourpole.core.channelerrors import ChannelUncertainty
from fourpole.core.confidence import CHANCE
from fourpole.core.curvature import draw_route
from fourpole.core.identify import Answers, identify, variance_by_source
from fourpole.core.phasor import Phasors
from fourpole.core.rig import Rig
from fourpole.core.routes import ROUTES
from fourpole.core.sources import Kind, Source
from fourpole.core.unstated import PRESLIDING, Unstated, sliding

RIG = Rig(moving_mass=15.0, preload_stiffness=12440.0, preload_damping=20.0)
FREQUENCY = np.array([6.0, 10.0, 14.0, 20.0, 28.0, 38.0])
OMEGA = 2 * np.pi * FREQUENCY
STIFFNESS = 190e3 * (1 + 0.1j) * FREQUENCY**0.06
FRAME = Source(Kind.UNSTATED, "frame")
FRICTION = Source(Kind.UNSTATED, "friction")
MASS = Source(Kind.BELT_MASS, "the specimen")
NONE = np.zeros((6, 2, 2))
SOUND = np.zeros(6, dtype=bool)
UNSURE = ChannelUncertainty(gain=np.array([0.01, 0.01, 0.01]))
ONE = ["a"] * 6


def simulated(*, near=0.0, far=0.0, added=0.0, v1=0.06, gain=1.0):
    """F1, V1, V2 of springs between two masses, on a rig to whose Zr a part is added."""
    jw = 1j * OMEGA
    beyond = np.asarray(RIG.impedance(OMEGA)) + added + jw * far
    v2 = v1 * STIFFNESS / (STIFFNESS + jw * beyond)
    f1 = gain * (beyond * v2 + jw * near * v1)
    amplitudes = np.stack(np.broadcast_arrays(f1, v1 + 0j, v2), axis=-1)
    return Phasors(FREQUENCY, amplitudes, np.zeros((6, 6, 6)), np.zeros(6), np.full(6, np.inf))


@pytest.mark.parametrize("route", ROUTES)
@pytest.mark.parametrize("part", ["near", "far", "both", "friction", "spring", "loss"])
def test_a_small_part_moves_k_and_tr_by_its_uncertainty(route, part):
    clean, size = simulated(), 1e-4
    support = size * RIG.preload_stiffness / OMEGA
    friction = 1e-3 * sliding(OMEGA, np.abs(clean.motion_out), PRESLIDING)[0]
    added = {"friction": friction, "spring": support, "loss": 1j * support}.get(part, 0.0)
    masses = 1e-3 * np.array({"near": (1, 0), "far": (0, 1), "both": (1, 1)}.get(part, (0, 0)))
    moved = simulated(near=masses[0], far=masses[1], added=added)
    of_part = {"friction": Unstated(friction=1e-3), "spring": Unstated(size), "loss": Unstated(size)}
    unstated = of_part.get(part, Unstated(masses=np.outer(masses, masses)))
    source = {"friction": FRICTION, "spring": FRAME, "loss": FRAME}.get(part, MASS)
    found = identify(moved, RIG, route=route)
    off = found.stiffness - STIFFNESS
    error = np.abs(np.stack([off.real, off.imag, found.tr_predicted - found.tr_measured], axis=1))
    known = np.sqrt(variance_by_source(clean, RIG, route=route, unstated=unstated)[source][:, [0, 1, 5]])
    least = np.array([0.2, 0.2, 1e-6])  # second order and round-off
    if source == FRAME:  # two parts, of which one is there
        assert (error <= 1.01 * known + least).all()
        assert route == "relative" or (np.linalg.norm(error[:, :2], axis=1) > 0.9 * known[:, 0] - least[0]).all()
    else:
        assert (np.abs(error - known) < 0.02 * known + least).all()


def test_nothing_is_added_where_nothing_moves_or_nothing_is_unstated():
    still, unstated = Rig(blocked=True), Unstated(0.01, 1.0, 0.0, np.eye(2))
    for rig in (RIG, still):
        assert (identify(simulated(), rig).stiffness_covariance == 0).all()
    assert (identify(simulated(), still, unstated=unstated).stiffness_covariance == 0).all()
    assert (identify(simulated(), None, route="relative", unstated=unstated).stiffness_covariance == 0).all()
    assert (identify(simulated(), RIG, unstated=unstated).stiffness_covariance[:, 0, 0] > 0).all()


def test_the_tests_of_one_specimen_share_its_masses():
    masses = np.array([[[0.2, 0.1], [0.1, 0.3]]] * 3 + [[[0.1, 0.0], [0.0, 0.1]]] * 3)
    found = identify(simulated(), RIG, unstated=Unstated(friction=0.5, masses=masses))
    shared = found.stiffness_shared
    assert shared @ shared.transpose(0, 2, 1) == pytest.approx(found.stiffness_covariance, rel=1e-9)
    of_masses = identify(simulated(), RIG, unstated=Unstated(masses=masses)).stiffness_shared
    assert of_masses[0] @ of_masses[5].T == pytest.approx(np.zeros((2, 2)), abs=1e-9)
    assert abs(of_masses[0] @ of_masses[1].T)[0, 0] > 0


@pytest.mark.parametrize(("near", "far"), [(0.0, 0.0), (0.2, 0.2), (0.0, 1.0), (1.0, 0.0), (0.5, 1.5)])
def test_f1_against_v2_shows_the_masses_of_a_specimen(near, far):
    answers, true = Answers(simulated(near=near, far=far), RIG, channels=UNSURE), np.array([near, far])
    moments = shown_masses(answers, ONE, 7.5, SOUND)
    assert np.ptp(moments, axis=0) == pytest.approx(0.0)
    assert true @ np.linalg.solve(moments[0], true) < 1.1  # within what is shown
    assert np.sqrt(np.trace(moments[0])) < 1.3 * np.linalg.norm(true) + 0.5  # and not far beyond
    assert (shown_masses(answers, ONE, 7.5, ~SOUND) == 0).all()


def test_masses_are_shown_of_their_own_specimen_and_up_to_their_bound():
    phasors, heavy = simulated(), simulated(far=2.0)
    amplitudes = np.where(np.arange(6)[:, None] < 3, phasors.amplitudes, heavy.amplitudes)
    mixed = Phasors(FREQUENCY, amplitudes, phasors.covariance, phasors.frequency_std, phasors.dof)
    shown = shown_masses(Answers(mixed, RIG, channels=UNSURE), ["b"] * 3 + ["a"] * 3, 7.5, SOUND)
    assert shown[5, 1, 1] > 3.0
    assert np.linalg.norm(shown[5] - shown[0]) > 1.0
    unknown = ChannelUncertainty(gain=np.full(3, 1e3), phase=np.full(3, 1e3))
    open_to_both = 7.5**2 * np.array([[1.0, 2 / np.pi], [2 / np.pi, 1.0]])  # of two masses that are not negative
    assert shown_masses(Answers(phasors, RIG, channels=unknown), ONE, 7.5, SOUND)[0] == pytest.approx(
        open_to_both, rel=3e-2
    )


@pytest.mark.parametrize("mean", [(0.0, 0.0), (1.0, 0.3), (-0.4, 0.5)])
@pytest.mark.parametrize("across", [0.9, -0.9, -0.9999])
def test_masses_are_not_negative(mean, across):
    """The second moments are those of draws without a negative mass."""
    rng, covariance = np.random.default_rng(3), np.array([[4.0, 2 * across], [2 * across, 1.0]])
    drawn = rng.multivariate_normal(mean, covariance, 400_000)
    kept = drawn[(drawn >= 0).all(axis=1)]
    assert alone._moments(np.array(mean), covariance) == pytest.approx(kept.T @ kept / len(kept), rel=0.1, abs=1e-3)


@pytest.mark.parametrize("true", [0.0, 0.05, 0.3, 2.0])
def test_f1_against_v2_shows_the_friction_of_the_guide(true):
    friction = true * sliding(OMEGA, np.abs(simulated().motion_out), PRESLIDING)[0]
    answers = Answers(simulated(added=friction), RIG, unstated=Unstated(friction=1.0))
    assert shown_friction(answers, 1.0) == pytest.approx(min(true, 1.0), abs=0.02)


def test_without_v2_nothing_is_shown_and_nothing_is_in_balance():
    phasors = simulated()
    amplitudes = phasors.amplitudes.copy()
    amplitudes[:, 2] = np.nan
    answers = Answers(Phasors(FREQUENCY, amplitudes, phasors.covariance, np.zeros(6), phasors.dof), RIG)
    assert (shown_masses(answers, ONE, 7.5, SOUND) == 0).all()
    assert np.isnan(largest_imbalance(answers, NONE)).all()


def test_an_imbalance_within_the_stated_gains_is_none():
    gain = np.exp(0.02)
    limit = largest_imbalance(Answers(simulated(gain=gain), RIG, channels=UNSURE), NONE)
    # Two gains of 1 % are in F1 over V2, of which that of F1 acts on more; the chance is that of two parts.
    assert limit == pytest.approx(np.sqrt(-2 * np.log(CHANCE)) * 0.01 * np.hypot(1, gain), rel=1e-3)
    assert (gain - 1 < limit).all()
    exact = largest_imbalance(Answers(simulated(gain=gain), RIG), NONE)
    assert (gain - 1 > 10 * exact).all()


def test_masses_that_a_specimen_may_have_are_no_imbalance():
    answers = Answers(simulated(near=0.5, far=0.5), RIG, channels=UNSURE)
    ratio = answers.balance()[0]
    assert (np.abs(ratio - 1) > largest_imbalance(answers, NONE)).sum() >= 2
    assert (np.abs(ratio - 1) < largest_imbalance(answers, NONE + 0.25)).all()


@pytest.mark.parametrize("route", ROUTES)
def test_draws_of_a_route_have_what_is_unstated(route):
    phasors, rng = simulated(), np.random.default_rng(5)
    unstated = Unstated(support=4e-3, friction=0.05, masses=NONE + 1e-4 * np.array([[6.0, 2.0], [2.0, 4.0]]))
    std = np.sqrt(np.diagonal(identify(phasors, RIG, route=route, unstated=unstated).stiffness_covariance, 0, 1, 2))
    for row in (2, 5):
        stated = {"unstated": unstated.part(row)}
        drawn = draw_route(phasors.part(row), RIG, route, ChannelUncertainty(), 20_000, rng, **stated)
        assert [drawn.real.std(), drawn.imag.std()] == pytest.approx(std[row], rel=0.05)
