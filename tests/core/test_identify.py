"""Identification inverts the model by every route, and its uncertainties are those of a Monte Carlo."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from fourpole.core.channelerrors import ChannelUncertainty, error_covariance
from fourpole.core.identify import identify, variance_by_source
from fourpole.core.phasor import Phasors
from fourpole.core.rig import PARAMETERS, Rig
from fourpole.core.routes import ROUTES
from fourpole.core.sources import Kind, Source
from fourpole.errors import RigError

pytestmark = pytest.mark.thorough

EPS = np.finfo(float).eps
DRAWS = 40_000

TYRE = {"k1": 180e3, "k2": 120e3, "c": 700.0}
RIG = {
    "moving_mass": 15.0,
    "preload_stiffness": 12440.0,
    "preload_damping": 20.0,
    "preload_loss_factor": 0.03,
    "tyre_mass": 1.2,
    "frame_stiffness": 2e6,
    "input_mass": 0.9,
}


def rig_impedance(omega, added, values):
    """Zr by hand; every value may be an array."""
    jw = 1j * omega
    leaf = values["preload_stiffness"] * (1 + 1j * values["preload_loss_factor"]) + jw * values["preload_damping"]
    compliance = jw / leaf + jw / values["frame_stiffness"]
    return jw * (values["moving_mass"] + values["tyre_mass"] + added) + 1 / compliance


def measure(frequency, stiffness, rig, *, added=0.0, v1=0.06):
    """What the sensors of a rig would give, (..., 3): F1 at the cell, V1, V2."""
    omega = 2 * np.pi * np.asarray(frequency)
    impedance = rig_impedance(omega, added, rig)
    v2 = v1 * stiffness / (stiffness + 1j * omega * impedance)
    f1 = impedance * v2 + 1j * omega * rig["input_mass"] * v1
    return np.stack(np.broadcast_arrays(f1, v1 + 0j, v2), axis=-1)


def zener(omega, k1, k2, c):
    return k1 + 1 / (1 / k2 + 1 / (1j * omega * c))


def phasors_of(frequency, amplitudes, covariance=None):
    frequency = np.asarray(frequency, dtype=float)
    if covariance is None:
        covariance = np.zeros((*frequency.shape, 6, 6))
    return Phasors(frequency, amplitudes, covariance, np.zeros(frequency.shape), np.full(frequency.shape, np.inf))


def reals(amplitudes):
    """Re F1, Im F1, Re V1 ... of (..., 3) amplitudes."""
    return np.stack([amplitudes.real, amplitudes.imag], axis=-1).reshape(*amplitudes.shape[:-1], 6)


@given(
    frequency=st.floats(2.0, 60.0),
    k1=st.floats(3e4, 1e6),
    k2=st.floats(1e4, 1e6),
    c=st.floats(50.0, 5e3),
    m=st.floats(5.0, 100.0),
    k3=st.floats(1e3, 1e5),
    input_mass=st.floats(0.0, 5.0),
    added=st.floats(0.0, 20.0),
    route=st.sampled_from(ROUTES),
)
def test_identify_inverts_the_model(frequency, k1, k2, c, m, k3, input_mass, added, route):
    omega = 2 * np.pi * frequency
    stiffness = zener(omega, k1, k2, c)
    stated = {**RIG, "moving_mass": m, "preload_stiffness": k3, "input_mass": input_mass}
    amplitudes = measure(frequency, stiffness, stated, added=added)
    found = identify(phasors_of([frequency], amplitudes[None]), Rig(**stated), k1, route=route, added_mass=added)

    # Round-off grows by what cancels: inertia against springs in Zr, Zr's force against the input mass in F1,
    # tyre against rig in the mobility, K* against K1 in the arm, and each part of 1/arm against the other.
    impedance = rig_impedance(omega, added, stated)
    _, v1, v2 = amplitudes
    grows = 1 + (omega * (m + added) + k3 / omega) / abs(impedance)
    grows *= 1 + omega * input_mass * abs(v1) / abs(impedance * v2)
    grows *= 1 + (abs(v1) + abs(v2)) / abs(v1 - v2)
    arm = stiffness - k1
    lost = 64 * EPS * grows
    in_arm = lost * (1 + abs(stiffness / arm))
    assume(in_arm < 1e-6)
    assert found.stiffness[0] == pytest.approx(stiffness, rel=lost)
    assert found.k2[0] == pytest.approx(k2, rel=in_arm * k2 / abs(arm))
    assert found.c[0] == pytest.approx(c, rel=in_arm * omega * c / abs(arm))
    assert found.loss_factor[0] == pytest.approx(
        stiffness.imag / stiffness.real, rel=2 * lost * abs(stiffness / stiffness.imag)
    )
    assert found.tr_measured[0] == pytest.approx(abs(v2 / v1), rel=1e-14)
    assert found.tr_predicted[0] == pytest.approx(abs(v2 / v1), rel=2 * lost * (1 + abs(v2 / v1)))
    assert found.reasons == ("",)


@pytest.fixture(scope="module")
def campaign():
    """Forty tests of several tyres, frequencies and added masses."""
    rng = np.random.default_rng(0)
    frequency = rng.uniform(8.0, 25.0, 40)
    k1, k2, c = rng.uniform([[1.2e5], [5e4], [200.0]], [[2.5e5], [2e5], [1500.0]], (3, 40))
    added = rng.choice([0.0, 5.0, 10.0], 40)
    stiffness = zener(2 * np.pi * frequency, k1, k2, c)
    amplitudes = measure(frequency, stiffness, RIG, added=added)
    spread = rng.standard_normal((40, 6, 6)) * 1e-4
    scale = np.repeat(np.abs(amplitudes), 2, axis=1)
    covariance = spread @ np.swapaxes(spread, -1, -2) * scale[:, :, None] * scale[:, None, :]
    return {
        "phasors": phasors_of(frequency, amplitudes, covariance),
        "k1": k1,
        "added": added,
        "truth": {"stiffness": stiffness, "k2": k2, "c": c},
    }


def run(tests, at=slice(None), **kwargs):
    chosen = Phasors(*(getattr(tests["phasors"], name)[at] for name in vars(tests["phasors"])))
    return identify(
        chosen,
        Rig(**RIG, std={"moving_mass": 0.1, "preload_stiffness": 100.0, "input_mass": 0.05}),
        tests["k1"][at],
        k1_std=0.01 * tests["k1"][at],
        added_mass=tests["added"][at],
        added_mass_std=1e-4 * tests["added"][at],
        channels=ChannelUncertainty(np.array([0.01, 0.02, 0.03]), np.array([0.001, 0.002, 0.003])),
        **kwargs,
    )


@pytest.mark.parametrize("route", ROUTES)
def test_a_whole_campaign_at_once(campaign, route):
    found = run(campaign, route=route)
    for name, truth in campaign["truth"].items():
        np.testing.assert_allclose(getattr(found, name), truth, rtol=1e-10)  # nothing here grows beyond 1e5 round-offs
    assert found.route == route
    assert found.stiffness_covariance.shape == found.arm_covariance.shape == (40, 2, 2)
    assert set(found.reasons) == {""}
    np.testing.assert_array_equal(found.frequency, campaign["phasors"].frequency)


@pytest.mark.parametrize("route", ROUTES)
def test_permuted_tests_give_permuted_results(campaign, route):
    order = np.random.default_rng(1).permutation(40)
    found, permuted = run(campaign, route=route), run(campaign, order, route=route)
    for name, value in vars(found).items():
        if name in ("route", "joint"):
            continue
        if name == "condition":  # numbers that only tell tests apart
            assert np.unique(permuted.condition).size == 40
        elif name == "reasons":
            assert permuted.reasons == tuple(value[i] for i in order)
        else:  # vectorised loops may round the last bit differently
            np.testing.assert_allclose(getattr(permuted, name), value[order], rtol=1e-12)


@pytest.mark.parametrize("route", ROUTES)
def test_a_test_alone_gives_what_it_gives_among_others(campaign, route):
    found, alone = run(campaign, route=route), run(campaign, slice(7, 8), route=route)
    np.testing.assert_allclose(alone.k2, found.k2[7:8], rtol=1e-12)
    np.testing.assert_allclose(alone.arm_covariance, found.arm_covariance[7:8], rtol=1e-12)


# Monte Carlo ----------------------------------------------------------------------------------------------------

NOTHING = {"noise": 0.0, "gain": np.zeros(3), "phase": np.zeros(3), "rig": {}, "added": 0.0, "k1": 0.0}
# small enough that the second order, of relative size 10 to 100 times the first, is below the scatter of the draws
SOURCES = {
    "noise": {"noise": 1e-4},
    "gains": {"gain": np.array([2e-4, 1e-4, 3e-4])},
    "phases": {"phase": np.array([1e-4, 3e-4, 2e-4])},
    "moving mass": {"rig": {"moving_mass": 1e-3}},
    "preload spring": {"rig": {"preload_stiffness": 2.0, "preload_loss_factor": 1e-4, "preload_damping": 0.05}},
    "other parts": {"rig": {"tyre_mass": 1e-3, "frame_stiffness": 1e3, "input_mass": 5e-4}},
    "added mass": {"added": 1e-3},
    "K1": {"k1": 30.0},
    "everything": {
        "noise": 1e-4,
        "gain": np.array([2e-4, 1e-4, 3e-4]),
        "phase": np.array([1e-4, 3e-4, 2e-4]),
        "rig": {name: 1e-4 * value for name, value in RIG.items()},
        "added": 5e-4,
        "k1": 30.0,
    },
}


def noise_covariance(amplitudes, level):
    """A full covariance with correlations between all six parts."""
    spread = np.random.default_rng(5).standard_normal((6, 6)) * level * np.repeat(np.abs(amplitudes), 2)[:, None]
    return spread @ spread.T


def monte_carlo(route, amplitudes, omega, added, sources):
    """Outputs (draws, 8) of the formulas by hand, with every input drawn."""
    rng = np.random.default_rng(11)
    values = {name: value + sources["rig"].get(name, 0.0) * rng.standard_normal(DRAWS) for name, value in RIG.items()}
    added = added + sources["added"] * rng.standard_normal(DRAWS)
    k1 = TYRE["k1"] + sources["k1"] * rng.standard_normal(DRAWS)
    noise = rng.multivariate_normal(np.zeros(6), noise_covariance(amplitudes, sources["noise"]), DRAWS)
    gains = 1 + sources["gain"] * rng.standard_normal((DRAWS, 3))
    turns = np.exp(1j * sources["phase"] * rng.standard_normal((DRAWS, 3)))
    cell, v1, v2 = (amplitudes * gains * turns + noise[:, 0::2] + 1j * noise[:, 1::2]).T
    jw = 1j * omega
    f1 = cell - jw * values["input_mass"] * v1
    zr = rig_impedance(omega, added, values)
    if route == "mobility":
        stiffness = jw / (v1 / f1 - 1 / zr)
    elif route == "relative":
        stiffness = jw * f1 / (v1 - v2)
    else:
        stiffness = jw * zr * v2 / (v1 - v2)
    compliance = 1 / (stiffness - k1)
    mobility = v1 / cell
    return np.stack(
        [
            mobility.real,
            mobility.imag,
            stiffness.real,
            stiffness.imag,
            1 / compliance.real,
            -1 / (omega * compliance.imag),
            stiffness.imag / stiffness.real,
            np.abs(stiffness / (stiffness + jw * zr)),
        ],
        axis=1,
    )


@pytest.mark.parametrize("route", ROUTES)
@pytest.mark.parametrize("source", SOURCES)
@pytest.mark.sampled(3)
def test_covariances_are_those_of_a_monte_carlo(route, source):
    sources = {**NOTHING, **SOURCES[source]}
    frequency, added = 13.0, 4.0
    omega = 2 * np.pi * frequency
    stiffness = zener(omega, **TYRE)
    amplitudes = measure(frequency, stiffness, RIG, added=added) * np.exp(0.7j)
    found = identify(
        phasors_of([frequency], amplitudes[None], noise_covariance(amplitudes, sources["noise"])[None]),
        Rig(**RIG, std=sources["rig"]),
        TYRE["k1"],
        k1_std=sources["k1"],
        route=route,
        added_mass=added,
        added_mass_std=sources["added"],
        channels=ChannelUncertainty(sources["gain"], sources["phase"]),
    )
    draws = monte_carlo(route, amplitudes, omega, added, sources)
    drawn = np.cov(draws.T)

    stated = np.full((8, 8), np.nan)
    stated[:2, :2] = found.mobility_covariance[0]
    stated[2:4, 2:4] = found.stiffness_covariance[0]
    stated[4:6, 4:6] = found.arm_covariance[0]
    stated[6, 6] = found.loss_factor_std[0] ** 2
    stated[7, 7] = found.tr_std[0] ** 2
    # The variance of a sample covariance of normal draws is (S_ii S_jj + S_ij²)/n; five of its roots. What does not
    # depend on the source scatters by the round-off of its own formula only, and where two effects cancel there is
    # left the round-off of their variances, (3e-4)² · 1e-15.
    size = np.array([1e-3, 1e-3, 2e5, 2e5, 1e5, 1e3, 0.2, 2.0])
    variance = np.diag(drawn)
    allowed = 5 * np.sqrt((np.outer(variance, variance) + drawn**2) / DRAWS) + np.outer(size, size) * 1e-22
    there = np.isfinite(stated)
    assert there.sum() == 14
    assert (np.abs(stated - drawn) <= allowed)[there].all(), (stated - drawn)[there] / allowed[there]


@pytest.mark.parametrize("route", ROUTES)
def test_a_route_is_blind_to_what_it_does_not_use(route):
    frequency = 13.0
    amplitudes = measure(frequency, zener(2 * np.pi * frequency, **TYRE), RIG)[None]
    blind = {"mobility": 2, "relative": None, "transmissibility": 0}[route]
    if blind is None:
        found = identify(phasors_of([frequency], amplitudes), Rig(**RIG, std={"moving_mass": 1.0}), 180e3, route=route)
        np.testing.assert_array_equal(found.stiffness_covariance, 0.0)
        return
    amplitudes[:, blind] = np.nan
    channels = ChannelUncertainty(np.full(3, 0.01), np.full(3, 0.01))
    found = identify(phasors_of([frequency], amplitudes), Rig(**RIG), 180e3, route=route, channels=channels)
    assert found.k2[0] == pytest.approx(TYRE["k2"], rel=1e-11)
    assert np.isfinite(found.arm_covariance).all()
    assert np.isfinite(found.tr_predicted).all()
    assert np.isfinite(found.tr_std).all()
    if route == "mobility":
        assert np.isnan(found.tr_measured).all()
    else:
        assert np.isnan(found.mobility).all()
        assert np.isnan(found.mobility_covariance).any()


def test_without_v2_the_relative_route_finds_nothing_and_says_so():
    amplitudes = measure(13.0, zener(2 * np.pi * 13.0, **TYRE), RIG)[None]
    amplitudes[:, 2] = np.nan
    found = identify(phasors_of([13.0], amplitudes), None, 180e3, route="relative")
    assert np.isnan(found.stiffness[0])
    assert found.reasons == ("K* could not be found, so neither can K2 and C",)


def test_an_unknown_k1_leaves_k2_and_c_blank_and_nothing_else(campaign):
    tests = {**campaign, "k1": np.where(np.arange(40) % 3 == 0, np.nan, campaign["k1"])}
    found, whole = run(tests), run(campaign)
    blank = np.arange(40) % 3 == 0
    np.testing.assert_array_equal(np.isnan(found.k2), blank)
    np.testing.assert_array_equal(np.isnan(found.c), blank)
    np.testing.assert_array_equal(np.isnan(found.arm_covariance[:, 0, 0]), blank)
    for i, reason in enumerate(found.reasons):
        assert reason == ("no static stiffness K1 is known, so K2 and C are left blank" if blank[i] else "")
    np.testing.assert_array_equal(found.stiffness, whole.stiffness)
    np.testing.assert_array_equal(found.stiffness_covariance, whole.stiffness_covariance)
    np.testing.assert_array_equal(found.tr_predicted, whole.tr_predicted)
    np.testing.assert_array_equal(found.k2[~blank], whole.k2[~blank])


def test_k1_alone_moves_only_the_arm():
    amplitudes = measure(13.0, zener(2 * np.pi * 13.0, **TYRE), RIG)[None]
    found = identify(phasors_of([13.0], amplitudes), Rig(**RIG), TYRE["k1"], k1_std=0.1)
    assert not found.stiffness_covariance.any()
    assert not found.tr_std.any()
    (k2, cross), (_, c) = found.arm_covariance[0]
    # one cause: K2 and C are fully correlated, here against one another, but for the square of 0.1 N/m over K* - K1
    assert abs(cross) == pytest.approx(np.sqrt(k2 * c), rel=1e-9)


@pytest.mark.parametrize(
    ("stiffness", "says"),
    [
        (-2e5 + 3e4j, "no passive K2, C exist: K' = -200 kN/m is not positive; look for an inverted"),
        (2e5 - 3e4j, "no passive C exists: K'' = -30 kN/m is not positive, the specimen would give energy"),
        (1.7e5 + 3e4j, "no passive K2 exists: K' = 170 kN/m is not above the static K1 = 180 kN/m"),
    ],
)
@pytest.mark.parametrize("route", ROUTES)
def test_a_tyre_without_passive_arm_keeps_the_rest(route, stiffness, says):
    amplitudes = measure([13.0], stiffness, RIG)
    covariance = 1e-8 * np.eye(6) * np.repeat(np.abs(amplitudes[0]), 2) ** 2
    found = identify(phasors_of([13.0], amplitudes, covariance[None]), Rig(**RIG), 180e3, k1_std=1e3, route=route)
    assert found.stiffness[0] == pytest.approx(stiffness, rel=1e-12)
    assert (np.diagonal(found.stiffness_covariance[0]) > 0).all()
    assert np.isnan([found.k2[0], found.c[0]]).all()
    assert np.isnan(found.arm_covariance).all()
    assert found.tr_predicted[0] == pytest.approx(found.tr_measured[0], rel=1e-11)
    assert found.loss_factor[0] == pytest.approx(stiffness.imag / stiffness.real, rel=1e-11)
    with pytest.raises(AssertionError, match=says):
        raise AssertionError(found.reasons[0])


def test_a_blocked_bench():
    stiffness = zener(2 * np.pi * 13.0, **TYRE)
    amplitudes = np.array([[stiffness / (2j * np.pi * 13.0) * 0.06, 0.06, np.nan]])
    channels = ChannelUncertainty(np.array([0.01, 0.0, 0.0]), np.zeros(3))
    found = identify(phasors_of([13.0], amplitudes), Rig(blocked=True), 180e3, channels=channels)
    assert found.stiffness[0] == pytest.approx(stiffness, rel=1e-13)
    assert found.k2[0] == pytest.approx(TYRE["k2"], rel=1e-11)
    assert np.isnan(found.tr_predicted[0])
    # the gain of the force is that of K*: both its parts move together by 1 %
    along = np.array([stiffness.real, stiffness.imag]) * 0.01
    np.testing.assert_allclose(found.stiffness_covariance[0], np.outer(along, along), rtol=1e-12)


def test_a_blocked_bench_has_an_input_mass_too():
    omega = 2 * np.pi * 13.0
    stiffness = zener(omega, **TYRE)
    amplitudes = np.array([[(stiffness / (1j * omega) + 1j * omega * 0.9) * 0.06, 0.06, np.nan]])
    rig = Rig(blocked=True, input_mass=0.9, std={"input_mass": 0.01})
    found = identify(phasors_of([13.0], amplitudes), rig, 180e3)
    assert found.stiffness[0] == pytest.approx(stiffness, rel=1e-12)
    # K* = jw F/V1 with F less jw m_i V1: dK*/dm_i = w², all of it real
    np.testing.assert_allclose(
        found.stiffness_covariance[0], [[(omega**2 * 0.01) ** 2, 0], [0, 0]], rtol=1e-11, atol=1e-9
    )


def test_without_a_rig_the_relative_route_gives_the_measured_tr_an_uncertainty():
    amplitudes = measure([13.0], zener(2 * np.pi * 13.0, **TYRE), {**RIG, "input_mass": 0.0})
    channels = ChannelUncertainty(np.array([0.0, 0.01, 0.02]), np.zeros(3))
    found = identify(phasors_of([13.0], amplitudes), None, 180e3, route="relative", channels=channels)
    assert np.isnan(found.tr_predicted[0])
    assert found.tr_std[0] == pytest.approx(found.tr_measured[0] * np.hypot(0.01, 0.02), rel=1e-12)
    assert found.k2[0] == pytest.approx(TYRE["k2"], rel=1e-11)


def test_channel_uncertainty_stands_along_and_across_the_amplitude():
    amplitude, omega = np.array([[3.0 + 4.0j, 2.0j, 1.0]]), np.array([60.0])
    known = ChannelUncertainty(np.array([0.1, 0.0, 0.0]), np.array([0.0, 0.2, 0.3]))
    covariance = sum(error_covariance(error, amplitude) for error in known.errors(omega))[0]
    np.testing.assert_allclose(covariance[:2, :2], 0.01 * np.array([[9, 12], [12, 16]]), rtol=1e-15)
    np.testing.assert_allclose(covariance[2:4, 2:4], [[0.16, 0], [0, 0]], atol=1e-17)
    np.testing.assert_allclose(covariance[4:, 4:], [[0, 0], [0, 0.09]], atol=1e-17)
    assert not covariance[:2, 2:].any()
    assert not ChannelUncertainty().errors(omega)


@pytest.mark.parametrize("route", ROUTES)
def test_only_what_no_mounting_changes_is_shared_by_tests_of_two_mountings(route):
    """Of a gain of V1 known to 1 %, 0.6 % is another error in each mounting; u of each test stays as it was."""
    stiffness, part, gain = zener(2 * np.pi * 14.0, **TYRE), 6e-3, np.array([0.0, 1e-2, 0.0])
    phasors = phasors_of([14.0, 14.0], np.tile(measure(14.0, stiffness, RIG), (2, 1)))
    channels = ChannelUncertainty(gain, mounting=np.array([0.0, part, 0.0]))
    known = {"route": route, "channels": channels}
    one, two = (identify(phasors, Rig(**RIG), mounting=labels, **known) for labels in (["a", "a"], ["a", "b"]))
    np.testing.assert_allclose(two.stiffness_covariance, one.stiffness_covariance, rtol=1e-12)
    common = [np.trace(found.stiffness_shared[0] @ found.stiffness_shared[1].T) for found in (one, two)]
    assert common[1] == pytest.approx(common[0] * (1 - (part / gain[1]) ** 2), rel=1e-9)
    (by_one, by_two) = (
        variance_by_source(phasors, Rig(**RIG), mounting=labels, **known) for labels in (["a", "a"], ["a", "b"])
    )
    total = sum(by_one.values())[:, :2]
    np.testing.assert_allclose(sum(by_two.values())[:, :2], total, rtol=1e-9)
    np.testing.assert_allclose(
        by_two[Source(Kind.MOUNTING_GAIN, "V1")][:, :2], total * (part / gain[1]) ** 2, rtol=1e-9
    )


@settings(max_examples=30)
@given(st.sampled_from(list(PARAMETERS)), st.sampled_from(ROUTES))
def test_more_doubt_never_makes_less_uncertainty(name, route):
    amplitudes = measure([13.0], zener(2 * np.pi * 13.0, **TYRE), RIG)
    phasors = phasors_of([13.0], amplitudes, noise_covariance(amplitudes[0], 1e-4)[None])
    rig = Rig(**RIG)
    known = identify(phasors, rig, 180e3, route=route)
    doubted = identify(phasors, replace(rig, std={name: 0.02 * RIG[name]}), 180e3, route=route)
    for covariance in ("stiffness_covariance", "arm_covariance"):
        more = getattr(doubted, covariance)[0] - getattr(known, covariance)[0]
        scale = np.sqrt(np.diagonal(getattr(doubted, covariance)[0]))
        assert np.linalg.eigvalsh(more / np.outer(scale, scale)).min() > -1e-12


def test_routes_that_do_not_exist_or_lack_what_they_need():
    phasors = phasors_of([13.0], measure([13.0], 2e5 + 3e4j, RIG))
    with pytest.raises(ValueError, match="no route 'papers': choose one of mobility, relative, transmissibility"):
        identify(phasors, Rig(**RIG), 180e3, route="papers")
    for route in ("mobility", "transmissibility"):
        with pytest.raises(RigError, match=f"the {route} route needs the rig: state it, or use the relative route"):
            identify(phasors, None, 180e3, route=route)
    with pytest.raises(RigError, match="a blocked rig has no motion beyond the specimen: use the mobility route"):
        identify(phasors, Rig(blocked=True), 180e3, route="transmissibility")


def test_one_test_without_an_axis_is_one_row():
    one = phasors_of(13.0, measure(13.0, zener(2 * np.pi * 13.0, **TYRE), RIG))
    found = identify(one, Rig(**RIG), TYRE["k1"])
    assert found.k2.shape == (1,)
    assert found.k2[0] == pytest.approx(TYRE["k2"], rel=1e-11)


def test_what_cancels_leaves_no_uncertainty_and_no_nonsense(campaign):
    """By its own route abs(V2/V1) does not know of phases: a variance of 0, to round-off of either sign."""
    channels = ChannelUncertainty(np.zeros(3), np.array([0.0, 0.01, 0.02]))
    phasors = phasors_of(campaign["phasors"].frequency, campaign["phasors"].amplitudes)
    rig = Rig(**RIG)
    found = identify(phasors, rig, 180e3, route="transmissibility", added_mass=campaign["added"], channels=channels)
    assert (found.tr_std < 1e-8 * found.tr_predicted).all()
