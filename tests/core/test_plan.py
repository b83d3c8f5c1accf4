"""The plan against 60 laboratories drawn from what it states: independent truth, the same analysis."""

import numpy as np
import pytest

from fourpole.core.channelerrors import ChannelUncertainty
from fourpole.core.identify import identify
from fourpole.core.joint import identify_joint
from fourpole.core.plan import PLAN_ROUTES, Effort, Plan, PlannedTests, advise, expect, possible_routes
from fourpole.core.plan.expect import arm_std, planned_phasors, relative_uncertainties
from fourpole.core.plan.remedies import remedies
from fourpole.core.rig import Rig
from fourpole.virtual.phasor_rig import Conditions, Laboratory, draw, simulate_phasors
from fourpole.virtual.tyres import CROSS_PLY, RADIAL_PLY

pytestmark = pytest.mark.thorough

REPEATS = 60
#: Allowed of the median over all frequencies, and of a single one. The half-width that holds 68.27 % of normal
#: deviations scatters by 0.96 over the root of their number. Errors of gains are shared by all frequencies, so their
#: median scatters as much: three times that is allowed for 32 medians, four times for all single ones.
WITHIN, FURTHEST = 3 * 0.96 / np.sqrt(REPEATS), 4 * 0.96 / np.sqrt(REPEATS)
FREQUENCIES = np.arange(10.0, 25.0, 2.0)
#: Channels F1, V1, V2 that are recorded: without V2 the advice is by the mobility route, which is much faster.
WITHOUT_V2 = (True, True, False)
#: Sensors and rig: relative uncertainty of the rig's values, of gains, of phases [rad], of K1.
LABORATORIES = {"unstated": (0.02, 0.01, np.radians(0.5), 0.0), "calibrated": (0.005, 0.002, np.radians(0.1), 0.002)}
TYRES = {"unstated": RADIAL_PLY, "calibrated": CROSS_PLY}
MASSES = {"alone": (0.0,), "with 10 kg": (0.0, 10.0)}


def planned(tyre, masses, k1_std=0.0, noise=1e-4):
    f, added = np.tile(FREQUENCIES, len(masses)), np.repeat(masses, FREQUENCIES.size)
    k1 = float(tyre.static_stiffness(170e3, 1000.0))
    k2, c = tyre.k2(f, 170e3, 1000.0), tyre.c(f, 170e3, 1000.0)
    return PlannedTests(f, k1, k2, c, k1_std=k1_std * k1, added_mass=added, added_mass_std=1e-4 * added, noise=noise)


def stated(rig_std, gain, phase):
    values = {"moving_mass": 15.0, "preload_stiffness": 12440.0, "preload_damping": 15.0}
    rig = Rig(**values, std={name: rig_std * value for name, value in values.items()})
    return rig, ChannelUncertainty(np.full(3, gain), np.full(3, phase))


def analysed(route, phasors, rig, k1, tests, channels):
    added = {"added_mass": tests.added_mass, "added_mass_std": tests.added_mass_std, "channels": channels}
    if route == "joint":
        return identify_joint(phasors, rig, k1, k1_std=tests.k1_std, **added)
    return identify(phasors, rig, k1, route=route, k1_std=tests.k1_std, **added)


def scatter(laboratory, masses):
    """Errors (repeats, tests, 4) of Re K*, Im K*, K2, C by each route, and the uncertainties planned (tests, 4)."""
    rig_std, gain, phase, k1_std = LABORATORIES[laboratory]
    rig, channels = stated(rig_std, gain, phase)
    tests = planned(TYRES[laboratory], MASSES[masses], k1_std)
    lab = Laboratory(
        moving_mass=(15.0, rig_std * 15.0),
        preload_stiffness=(12440.0, rig_std * 12440.0),
        preload_damping=(15.0, rig_std * 15.0),
        std_gain=(gain,) * 3,
        std_phase=(phase,) * 3,
        noise=1e-4,
    )
    run = Conditions(frequency=tests.frequency, k1=tests.k1, k2=tests.k2, c=tests.c, added_mass=tests.added_mass)
    rng = np.random.default_rng(1982)
    errors = {route: [] for route in PLAN_ROUTES}
    for _ in range(REPEATS):
        seen = simulate_phasors(lab, run, rng)
        k1 = tests.k1 + tests.k1_std[0] * rng.standard_normal()
        for route in PLAN_ROUTES:
            found = analysed(route, seen.phasors, rig, k1, tests, channels)
            off = found.stiffness - seen.stiffness
            errors[route].append(np.column_stack([off.real, off.imag, found.k2 - seen.k2, found.c - seen.c]))
    expected = {}
    for route in PLAN_ROUTES:
        found = expect(tests, rig, route, channels=channels)
        both = [np.diagonal(x, 0, 1, 2) for x in (found.stiffness_covariance, found.arm_covariance)]
        expected[route] = np.sqrt(np.hstack(both))
    return {route: np.array(rows) for route, rows in errors.items()}, expected, tests


def half_width(errors):
    """Half-width that holds 68.27 % of the errors: the standard deviation of normal ones, blind to far tails."""
    return np.nanquantile(np.abs(errors), 0.6827, axis=0)


@pytest.mark.statistical
@pytest.mark.parametrize("laboratory", LABORATORIES)
@pytest.mark.sampled(12)
def test_the_plan_predicts_the_scatter_of_repeats_and_the_gain_of_an_added_mass(laboratory):
    """One test for all routes and masses, as the draws of a laboratory are the dear part of it."""
    alone, with_mass = (scatter(laboratory, masses) for masses in MASSES)
    for errors, expected, tests in (alone, with_mass):
        for route in PLAN_ROUTES:
            ratio = half_width(errors[route]) / expected[route]
            # K* is linear enough everywhere; K2 and C only where they are known to some 10 %
            linear = np.ones_like(ratio, dtype=bool)
            linear[:, 2:] = expected[route][:, 2:] < 0.1 * np.stack([tests.k2, tests.c], axis=1)
            assert np.all(np.abs(ratio[linear] - 1) < FURTHEST), route
            assert np.all(np.abs(np.nanmedian(ratio, axis=0) - 1) < WITHIN), route
    count = FREQUENCIES.size
    seen = half_width(alone[0]["joint"]) / half_width(with_mass[0]["joint"])[:count]
    planned_gain = alone[1]["joint"] / with_mass[1]["joint"][:count]
    # the ratio of two half-widths scatters by the square root of two as much as one of them
    np.testing.assert_allclose(np.median(seen / planned_gain, axis=0), 1.0, atol=np.sqrt(2) * WITHIN)
    np.testing.assert_allclose((seen / planned_gain)[:, :2], 1.0, atol=np.sqrt(2) * FURTHEST)
    assert np.median(planned_gain[:, 0]) > 3


def test_the_planned_phasors_are_those_of_the_virtual_rig():
    rig = Rig(15.0, 12440.0, 15.0, 0.02, 0.8, 5e6, 0.3)
    tests = planned(RADIAL_PLY, (0.0, 10.0))
    lab = Laboratory(
        (15.0, 0.0), (12440.0, 0.0), (15.0, 0.0), (0.02, 0.0), (0.8, 0.0), (5e6, 0.0), (0.3, 0.0), std_added=0.0
    )
    run = Conditions(frequency=tests.frequency, k1=tests.k1, k2=tests.k2, c=tests.c, added_mass=tests.added_mass)
    seen = simulate_phasors(
        lab, run, np.random.default_rng(0), truth=draw(lab, np.random.default_rng(0), added_masses=[10.0])
    )
    turned = planned_phasors(tests, rig).amplitudes / 1j  # there V1 is real
    np.testing.assert_allclose(turned, seen.phasors.amplitudes, rtol=1e-10)


def test_a_rigid_block_helps_the_joint_route_and_has_no_answer_of_its_own():
    rig, channels = stated(0.02, 0.01, 0.01)
    tests = planned(RADIAL_PLY, (0.0,))
    block = PlannedTests([10.0, 24.0], 1.0, 1.0, 1.0, family=-1, added_mass=10.0, added_mass_std=1e-3)
    both = tests.followed_by(block)
    alone, helped = (expect(x, rig, channels=channels).arm_covariance for x in (tests, both))
    assert np.all(helped[: len(tests), 1, 1] < 0.5 * alone[:, 1, 1])
    for route in PLAN_ROUTES:
        found = relative_uncertainties(expect(both, rig, route, channels=channels))
        assert np.all(np.isnan(found[-2:]))
        assert np.all(np.isfinite(found[:-2, :3]))


@pytest.mark.parametrize(
    ("rig", "present", "routes"),
    [
        (Rig(15.0, 12440.0), (True, True, True), PLAN_ROUTES),
        (Rig(15.0, 12440.0), (False, True, True), ("transmissibility",)),
        (Rig(blocked=True), (True, True, True), ("mobility",)),
        (Rig(15.0, 12440.0), (False, True, False), ()),
    ],
)
def test_routes_follow_rig_and_channels(rig, present, routes):
    assert possible_routes(rig, present) == routes


def test_a_blocked_rig_can_be_planned():
    tests = planned(RADIAL_PLY, (0.0,))
    found = expect(tests, Rig(blocked=True), "mobility", channels=stated(0, 0.01, 0.01)[1])
    np.testing.assert_allclose(found.stiffness, tests.stiffness, rtol=1e-12)
    # gain of F1 and of V1, each 1 % in modulus and 0.01 in phase, and the noise of both
    np.testing.assert_allclose(relative_uncertainties(found)[:, 0], 0.02, rtol=1e-3)


def test_more_cycles_and_repeats_are_the_same_to_white_noise():
    rig, _ = stated(0.0, 0.0, 0.0)
    one = planned(RADIAL_PLY, (0.0,), noise=1e-3)
    twice = one.followed_by(one)
    longer = planned(RADIAL_PLY, (0.0,), noise=1e-3 / np.sqrt(2))
    again, once = (relative_uncertainties(expect(tests, rig))[: len(one)] for tests in (twice, longer))
    np.testing.assert_allclose(again, once, rtol=1e-6)


@pytest.mark.parametrize("bad", [{"k1": 0.0}, {"frequency": -1.0}, {"noise": np.nan}, {"added_mass": -1.0}])
def test_what_cannot_be_is_refused(bad):
    values = {"frequency": 10.0, "k1": 1e5, "k2": 1e5, "c": 800.0} | bad
    with pytest.raises(ValueError, match="planned test must be"):
        PlannedTests(**values)


def plan(k1_std=0.0, families=1, present=(True, True, True)):
    rig, channels = stated(0.02, 0.01, np.radians(0.5))
    family = np.repeat(np.arange(families), FREQUENCIES.size)
    one = planned(RADIAL_PLY, (0.0,), k1_std)
    tests = one.part(np.tile(np.arange(len(one)), families))
    return Plan(
        PlannedTests(**{**tests.__dict__, "family": family, "present": present}), rig, channels, statics=families
    )


def effect(base, outcome):
    """Medians of u(K2)/K2 and u(C)/C after the remedies, by a plan that is changed and expected anew."""
    changed = base
    for remedy in outcome.remedies:
        changed = remedy.change(changed)
    level = min((remedy.k1 for remedy in outcome.remedies), default=np.inf)
    tests = changed.tests
    tests = PlannedTests(**{**tests.__dict__, "k1_std": np.minimum(tests.k1_std, level * tests.k1)})
    found = expect(tests, changed.rig, "joint", channels=changed.channels)
    return np.median(relative_uncertainties(found)[: len(base.tests), 1:3], axis=0)


@pytest.mark.parametrize(("k1_std", "families", "wanted"), [(0.002, 2, 0.01), (0.02, 1, 0.005)])
@pytest.mark.sampled(3)
def test_advice_keeps_its_word(k1_std, families, wanted):
    base = plan(k1_std, families)
    found = advise(base, wanted, masses=[2.0, 10.0])
    assert found.reaching
    assert not found.reached
    for outcome in (*found.reaching, *found.alone, found.nearest, found.now):
        np.testing.assert_allclose(effect(base, outcome), [outcome.k2, outcome.c], rtol=1e-4)
    assert all(outcome.worst <= wanted for outcome in found.reaching)
    minutes = [outcome.minutes for outcome in found.reaching]
    assert minutes == sorted(minutes)
    assert found.nearest.worst >= found.of_k1 * 0.05


@pytest.mark.sampled(8)
def test_a_mass_at_one_frequency_of_one_condition_is_the_cheap_way():
    cheapest = advise(plan(families=2), 0.01, masses=[2.0, 5.0]).reaching[0]
    assert [remedy.kind for remedy in cheapest.remedies] == ["mass"]
    assert cheapest.text.endswith("of one condition")
    assert cheapest.minutes < 15


def test_what_k1_leaves_is_said():
    found = advise(plan(0.02, present=WITHOUT_V2), 0.01)
    assert found.of_k1 == pytest.approx(0.044, rel=0.05)
    assert all("K1" in {remedy.kind for remedy in outcome.remedies} for outcome in found.reaching)


def test_nothing_is_promised_that_nothing_reaches():
    found = advise(plan(0.02, present=WITHOUT_V2), 1e-6)
    assert found.reaching == ()
    assert found.nearest.worst > 1e-6


def test_a_plan_that_does_needs_nothing():
    found = advise(plan(present=WITHOUT_V2), 0.5)
    assert found.reached
    assert found.reaching == ()


@pytest.mark.sampled(6)
def test_no_remedy_costs_nothing_or_harms():
    base = plan(0.02, 2)
    now = advise(base, 0.01, masses=[5.0]).now
    for listed in remedies(base, Effort(), [5.0]).values():
        for remedy in listed:
            assert remedy.minutes > 0
            changed = remedy.change(base)
            found = relative_uncertainties(changed.expect("joint"))[: len(base.tests), 1:3]
            assert np.all(np.median(found, axis=0) <= np.array([now.k2, now.c]) * 1.0001)


def test_the_part_of_k1_is_what_identification_gives_it():
    rig, _ = stated(0.0, 0.0, 0.0)
    tests = planned(CROSS_PLY, (0.0,), k1_std=0.01, noise=0.0)
    found = expect(tests, rig, "mobility")
    seen = np.sqrt(np.diagonal(found.arm_covariance, 0, 1, 2))
    np.testing.assert_allclose(arm_std(tests, 0.0, tests.k1_std), seen, rtol=1e-6)


def test_no_frequency_is_magic():
    """Where dK2/dK1 = 0, K1 to 2 % does not count as nothing: the part of K1 does not dip to zero."""
    k1, k2, c = 110e3, 40e3, 400.0
    magic = k2 / (2 * np.pi * c)
    tests = PlannedTests([magic / 1.2, magic, magic * 1.2], k1, k2, c, k1_std=0.02 * k1, noise=1e-5)
    of_k1 = arm_std(tests, 0.0, tests.k1_std)[:, 0]
    a, b = tests.stiffness[1] - k1, 0.02 * k1 * np.random.default_rng(1982).standard_normal(20_000)
    assert of_k1[1] > 0.75 * np.std(1 / (1 / (a - b)).real)
    assert of_k1.min() > 0.3 * of_k1.max()
    advice = advise(Plan(tests.part([1]), Rig(blocked=True)), 1e-3)
    assert advice.of_k1 > 0.75 * np.std(1 / (1 / (a - b)).real) / k2
    assert advice.now.worst >= advice.of_k1
