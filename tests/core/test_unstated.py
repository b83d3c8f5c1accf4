"""What nobody stated of a rig and its specimens, in the uncertainty of routes that take each test by itself."""

import numpy as np
import pytest

from fourpole.core.alone import largest_imbalance, shown_masses
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


def simulated(*, mass=0.0, added=0.0, v1=0.06, gain=1.0):
    """F1, V1, V2 of springs with a mass half of which moves with either end, on a rig to whose Zr a part is added."""
    jw = 1j * OMEGA
    beyond = np.asarray(RIG.impedance(OMEGA)) + added + 0.5 * jw * mass
    v2 = v1 * STIFFNESS / (STIFFNESS + jw * beyond)
    f1 = gain * (beyond * v2 + 0.5 * jw * mass * v1)
    amplitudes = np.stack(np.broadcast_arrays(f1, v1 + 0j, v2), axis=-1)
    return Phasors(FREQUENCY, amplitudes, np.zeros((6, 6, 6)), np.zeros(6), np.full(6, np.inf))


@pytest.mark.parametrize("route", ROUTES)
@pytest.mark.parametrize("part", ["mass", "friction", "spring", "loss"])
def test_a_small_part_moves_k_and_tr_by_its_uncertainty(route, part):
    clean, size = simulated(), 1e-4
    support = size * RIG.preload_stiffness / OMEGA
    friction = 1e-3 * sliding(OMEGA, np.abs(clean.motion_out), PRESLIDING)[0]
    added = {"mass": 0.0, "friction": friction, "spring": support, "loss": 1j * support}[part]
    moved = simulated(mass=1e-3 if part == "mass" else 0.0, added=added)
    unstated = {"mass": Unstated(specimen_mass=1e-3), "friction": Unstated(friction=1e-3)}.get(part, Unstated(size))
    source = {"mass": MASS, "friction": FRICTION}.get(part, FRAME)
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
    still, unstated = Rig(blocked=True), Unstated(0.01, 1.0, 0.0, 1.0)
    for rig in (RIG, still):
        exact = identify(simulated(), rig).stiffness_covariance
        assert (exact == 0).all()
    assert (identify(simulated(), still, unstated=unstated).stiffness_covariance == 0).all()
    assert (identify(simulated(), None, route="relative", unstated=unstated).stiffness_covariance == 0).all()
    assert (identify(simulated(), RIG, unstated=unstated).stiffness_covariance[:, 0, 0] > 0).all()


def test_the_tests_of_one_specimen_share_its_mass():
    masses = np.array([0.5, 0.5, 0.5, 0.25, 0.25, 0.25])
    found = identify(simulated(), RIG, unstated=Unstated(specimen_mass=masses))
    shared = found.stiffness_shared
    together = shared @ shared.transpose(0, 2, 1)
    assert together == pytest.approx(found.stiffness_covariance, rel=1e-9)
    between = np.einsum("kp,lp->kl", shared[0], shared[5])
    assert between == pytest.approx(np.zeros((2, 2)), abs=1e-9)
    assert abs(np.einsum("kp,lp->kl", shared[0], shared[1])[0, 0]) > 0


UNSURE = ChannelUncertainty(gain=np.array([0.01, 0.01, 0.01]))


@pytest.mark.parametrize(("mass", "low", "high"), [(0.0, 0.0, 0.3), (0.4, 0.4, 0.65), (2.0, 1.6, 2.5)])
def test_f1_against_v2_shows_the_mass_of_a_specimen(mass, low, high):
    answers = Answers(simulated(mass=mass), RIG, channels=UNSURE)
    shown = shown_masses(answers, ["a"] * 6, 7.5)
    assert np.ptp(shown) == 0
    assert low <= shown[0] <= high


def test_a_mass_is_shown_of_its_own_specimen_and_up_to_its_bound():
    phasors, heavy = simulated(), simulated(mass=2.0)
    amplitudes = np.where(np.arange(6)[:, None] < 3, phasors.amplitudes, heavy.amplitudes)
    mixed = Phasors(FREQUENCY, amplitudes, phasors.covariance, phasors.frequency_std, phasors.dof)
    shown = shown_masses(Answers(mixed, RIG, channels=UNSURE), ["b"] * 3 + ["a"] * 3, 7.5)
    assert shown[0] < 0.5 * shown[5]
    unknown = ChannelUncertainty(gain=np.full(3, 1e3), phase=np.full(3, 1e3))
    assert shown_masses(Answers(phasors, RIG, channels=unknown), ["a"] * 6, 7.5) == pytest.approx(7.5, rel=1e-3)


def test_without_v2_nothing_is_shown_and_nothing_is_in_balance():
    phasors = simulated()
    amplitudes = phasors.amplitudes.copy()
    amplitudes[:, 2] = np.nan
    answers = Answers(Phasors(FREQUENCY, amplitudes, phasors.covariance, np.zeros(6), phasors.dof), RIG)
    assert (shown_masses(answers, ["a"] * 6, 7.5) == 0).all()
    assert np.isnan(largest_imbalance(answers, np.zeros(6))).all()


def test_an_imbalance_within_the_stated_gains_is_none():
    gain = np.exp(0.02)
    limit = largest_imbalance(Answers(simulated(gain=gain), RIG, channels=UNSURE), np.zeros(6))
    # Two gains of 1 % are in F1 over V2; the chance is that of two parts.
    assert limit == pytest.approx(np.sqrt(-2 * np.log(CHANCE)) * 0.01 * np.sqrt(2), rel=1e-3)
    assert (gain - 1 < limit).all()
    exact = largest_imbalance(Answers(simulated(gain=gain), RIG), np.zeros(6))
    assert (gain - 1 > 10 * exact).all()


def test_a_mass_that_a_specimen_may_have_is_no_imbalance():
    answers = Answers(simulated(mass=1.0), RIG, channels=UNSURE)
    ratio = answers.balance()[0]
    assert (np.abs(ratio - 1) > largest_imbalance(answers, np.zeros(6))).sum() >= 2
    assert (np.abs(ratio - 1) < largest_imbalance(answers, np.ones(6))).all()


@pytest.mark.parametrize("route", ROUTES)
def test_draws_of_a_route_have_what_is_unstated(route):
    phasors, rng = simulated(), np.random.default_rng(5)
    unstated = Unstated(support=4e-3, friction=0.05, specimen_mass=np.full(6, 0.04))
    std = np.sqrt(np.diagonal(identify(phasors, RIG, route=route, unstated=unstated).stiffness_covariance, 0, 1, 2))
    for row in (2, 5):
        drawn = draw_route(
            phasors.part(row), RIG, route, ChannelUncertainty(), 20_000, rng, unstated=unstated.part(row)
        )
        assert [drawn.real.std(), drawn.imag.std()] == pytest.approx(std[row], rel=0.05)
