"""The operating map: surfaces found again, conditions left out in their intervals, answers with their covariance."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import t
from tests.belted_rig import BeltedRig

from fourpole.core.rig import Rig
from fourpole.core.routes import maxwell_arm
from fourpole.core.specimen import Form, Specimen
from fourpole.models.choice import fit_conditions
from fourpole.models.data import StiffnessData
from fourpole.models.families import model_named
from fourpole.models.linearised import Scatter
from fourpole.models.operating import Answer, OperatingMap, make_map
from fourpole.models.surface import Axes

pytestmark = pytest.mark.thorough

OMEGA = 2 * np.pi * np.linspace(8.0, 25.0, 12)
POINTS = np.array([[p, load] for p in (1.0e5, 1.35e5, 1.7e5, 2.05e5, 2.4e5) for load in (1000.0, 1500.0, 2000.0)])
ZENER = model_named("zener")
NOISE, SCATTER = 3e-4, 2e-3


def truth(points):
    q, load = (points[:, 0] - 1.7e5) / 0.7e5, (points[:, 1] - 1500.0) / 500.0
    return np.stack(
        [180e3 * np.exp(0.15 * q + 0.02 * load), 120e3 * np.exp(0.1 * q - 0.05 * q**2), 700 + 60 * load], axis=1
    )


def measured(seed, scatter):
    """Each condition off by an error of its own, as another mounting of the tyre makes it."""
    rng = np.random.default_rng(seed)
    found = []
    for values in truth(POINTS):
        clean = ZENER.stiffness(values, OMEGA) * np.exp(scatter * complex(*rng.standard_normal(2)))
        std = NOISE * np.abs(clean)
        draw = rng.standard_normal(OMEGA.size) + 1j * rng.standard_normal(OMEGA.size)
        k1 = values[0] * (1 + np.hypot(SCATTER, 5e-3) * rng.standard_normal())
        found.append(StiffnessData.of(OMEGA, clean + std * draw, std, k1=k1, k1_std=5e-3 * values[0]))
    return found


def fitted(data):
    return np.stack([one.values for one in fit_conditions(ZENER, data)])


def map_of(seed):
    data = measured(seed, SCATTER)
    return make_map(ZENER, data, Axes.of(["p [Pa]", "l [N]"], POINTS), fitted(data))


@pytest.fixture(scope="module")
def one_map():
    return map_of(0)


@pytest.fixture(scope="module")
def maps(one_map):
    return [one_map, *map(map_of, range(1, 6))]


@pytest.mark.sampled(8)
def test_the_scatter_of_conditions_is_found(maps):
    """From 30 numbers less those of some 5 terms: known to some 15 % each, to 6 % in the mean of six; t widens it."""
    widened = t.ppf(0.975, 15 - 5 - 1) / 1.96
    assert np.mean([one.scatter.condition for one in maps]) == pytest.approx(widened * SCATTER, rel=0.3)


@pytest.mark.sampled(4)
def test_conditions_left_out_are_inside_as_often_as_said(maps):
    inside = np.mean([one.leave_one_out.inside for one in maps])
    assert 0.90 <= inside <= 0.99
    assert np.mean([one.leave_one_out.error for one in maps]) < 3 * SCATTER


@pytest.mark.sampled(4)
def test_between_the_conditions_the_truth_is_inside_its_interval(maps):
    """Of K', K'' and K1 at 40 points of 6 maps; points of one map share its surfaces, so wide limits."""
    rng = np.random.default_rng(7)
    points = rng.uniform([1e5, 1e3], [2.4e5, 2e3], (40, 2))
    frequency = rng.uniform(8.0, 25.0, 40)
    values = truth(points)
    clean = ZENER.stiffness(values, 2 * np.pi * frequency[:, None])[:, 0]
    inside, scores = [], []
    for one in maps:
        answer = one.ask(points, frequency)
        off = np.stack([answer.stiffness.real - clean.real, answer.stiffness.imag - clean.imag], axis=1)
        std = np.sqrt(np.diagonal(answer.covariance, 0, 1, 2))
        inside.append(np.abs(off) < 1.96 * std[:, :2])
        scores.append((answer.k1 - values[:, 0]) / std[:, 2])
    # the truth at a point has no scatter of its own, a further test there has: inside at least as often as said
    assert np.mean(inside) > 0.93
    assert np.mean(np.abs(scores) < 1.96) > 0.93


def test_k2_and_c_are_those_of_its_k_and_k1(one_map):
    answer = one_map.ask(POINTS, np.full(len(POINTS), 14.0))
    k2, c = maxwell_arm(answer.stiffness, answer.k1, np.full(len(POINTS), 28 * np.pi))
    np.testing.assert_allclose(answer.k2, k2, rtol=1e-12)
    np.testing.assert_allclose(answer.c, c, rtol=1e-12)
    # their covariance against draws of K* and K1
    rng = np.random.default_rng(0)
    at = 4
    drawn = rng.multivariate_normal(
        [answer.stiffness[at].real, answer.stiffness[at].imag, answer.k1[at]], answer.covariance[at], 20_000
    )
    arm = np.stack(maxwell_arm(drawn[:, 0] + 1j * drawn[:, 1], drawn[:, 2], 28 * np.pi), axis=1)
    std = np.sqrt(np.diag(answer.arm_covariance[at]))
    np.testing.assert_allclose(
        np.cov(arm.T) / np.outer(std, std), answer.arm_covariance[at] / np.outer(std, std), atol=0.06
    )


def test_tr_has_the_uncertainty_of_k_and_of_the_rig(one_map):
    rig = Rig(15.0, 12440.0, 15.0, std={"moving_mass": 0.1, "preload_stiffness": 50.0, "preload_damping": 2.0})
    answer = one_map.ask(POINTS[:1], [14.0])
    value, std = answer.transmissibility(rig, [14.0])
    omega, rng = 28 * np.pi, np.random.default_rng(1)
    k = rng.multivariate_normal(
        [answer.stiffness[0].real, answer.stiffness[0].imag], answer.covariance[0, :2, :2], 20_000
    )
    m, k3, c3 = (
        mean + spread * rng.standard_normal(20_000) for mean, spread in ((15.0, 0.1), (12440.0, 50.0), (15.0, 2.0))
    )
    stiffness = k[:, 0] + 1j * k[:, 1]
    drawn = np.abs(stiffness / (stiffness + k3 - omega**2 * m + 1j * omega * c3))
    assert value[0] == pytest.approx(drawn.mean(), rel=1e-3)
    assert std[0] == pytest.approx(drawn.std(), rel=0.05)
    blocked = answer.transmissibility(Rig(blocked=True), [14.0])
    assert [float(one[0]) for one in blocked] == [0.0, 0.0]


@pytest.mark.sampled(4)
def test_k1_is_that_of_the_static_tests_whatever_the_shape_of_k():
    """K* of Zener tyres 3 % stiffer than their static tests say: K1 stays with the static tests."""
    data = [replace(one, k1=np.asarray(one.k1 / 1.03)) for one in measured(0, 0.0)]
    found = make_map(ZENER, data, Axes.of(["p [Pa]", "l [N]"], POINTS), fitted(data))
    answer = found.ask(POINTS, np.full(len(POINTS), 14.0))
    assert np.all(np.abs(answer.k1 / (truth(POINTS)[:, 0] / 1.03) - 1) < 0.01)
    assert np.all(np.sqrt(answer.covariance[:, 2, 2]) / answer.k1 > 4e-3)  # no less than each static test has
    without = [replace(one, k1=np.asarray(np.nan)) for one in data]
    own = make_map(ZENER, without, Axes.of(["p [Pa]", "l [N]"], POINTS), fitted(without))
    assert own.static is None
    assert np.all(np.abs(own.ask(POINTS, np.full(len(POINTS), 14.0)).k1 / truth(POINTS)[:, 0] - 1) < 0.02)


@pytest.mark.sampled(4)
def test_what_a_model_cannot_follow_widens_its_answers():
    """A Kelvin-Voigt model of Zener tyres: the misfit over frequency is in its intervals."""
    data = measured(0, 0.0)
    kelvin = model_named("kelvin")
    start = np.stack([[np.mean(one.stiffness.real), np.mean(one.stiffness.imag / OMEGA)] for one in data])
    found = make_map(kelvin, data, Axes.of(["p [Pa]", "l [N]"], POINTS), start)
    assert max(found.scatter.frequency) > 0.01
    assert found.leave_one_out.inside > 0.9


def test_one_axis_and_no_axis():
    line = [at for at in range(len(POINTS)) if POINTS[at, 1] == 1500.0]
    data = measured(3, SCATTER)
    one = make_map(
        ZENER, [data[at] for at in line], Axes.of(["p [Pa]", "l [N]"], POINTS[line]), fitted([data[at] for at in line])
    )
    assert one.axes.names == ("p [Pa]",)
    assert one.axes.constant == {"l [N]": 1500.0}
    alone = make_map(ZENER, data[:1], Axes.of(["p [Pa]"], POINTS[:1, :1]), fitted(data[:1]))
    assert isinstance(alone, OperatingMap)
    assert alone.axes.names == ()
    answer = alone.ask(np.zeros((1, 0)), [14.0])
    assert abs(answer.stiffness[0] / ZENER.stiffness(truth(POINTS[:1])[0], [28 * np.pi])[0] - 1) < 0.02


GRID = np.array([[p, load] for p in (1.0e5, 1.5e5, 2.0e5, 2.4e5) for load in (1000.0, 1500.0, 2000.0)])
FEW = 2 * np.pi * np.geomspace(5.0, 40.0, 6)


def with_common_errors(seed, gain, law=truth, shape=ZENER.stiffness, points=GRID, scatter=0.0):
    """Conditions under one gain and one phase; the phase [rad] is a third of the gain [1]."""
    rng = np.random.default_rng(seed)
    error = gain * (rng.standard_normal() + 1j / 3 * rng.standard_normal())
    data, shared = [], []
    for values in law(points):
        own = scatter * complex(*rng.standard_normal(2))
        clean = shape(values, FEW) * np.exp(error + own)
        std = 1e-3 * np.abs(clean)
        draw = rng.standard_normal(FEW.size) + 1j * rng.standard_normal(FEW.size)
        data.append(StiffnessData.of(FEW, clean + std * draw, std))
        effects = data[-1].stiffness[:, None] * [gain, 1j / 3 * gain]
        shared.append(np.stack([effects.real, effects.imag], axis=1).reshape(-1, 2))
    return data, shared


def mapped(data, shared, points=GRID):
    return make_map(ZENER, data, Axes.of(["p [Pa]", "l [N]"], points), fitted(data), shared)


NEW = np.array([[1.2e5, 1300.0], [1.75e5, 1100.0], [2.2e5, 1900.0], [1.6e5, 1700.0]])
AT = np.array([6.0, 12.0, 20.0, 35.0])


@pytest.mark.statistical
@pytest.mark.sampled(12)
def test_intervals_of_maps_with_common_errors_hold():
    """24 maps whose points share a gain of 3 %: with 95 % each, fewer than 19 inside happen once in 1000 times."""
    scores, parameters = [], []
    for seed in range(24):
        found = mapped(*with_common_errors(seed, 0.03))
        answer, values = found.ask(NEW, AT), truth(NEW)
        off = answer.stiffness - ZENER.stiffness(values, 2 * np.pi * AT[:, None])[:, 0]
        std = np.sqrt(np.diagonal(answer.stiffness_covariance, 0, 1, 2))
        scores.append(np.stack([off.real, off.imag], axis=1) / std)
        by = found._parameters(NEW)[1]
        std = np.sqrt(np.diagonal(by @ found.covariance @ np.swapaxes(by, 1, 2), 0, 1, 2))
        parameters.append((found.parameters(NEW) - values) / std)
        assert max(found.scatter.frequency) < 1e-3  # gains and phases are no misfit of the model
    for z in (np.array(scores), np.array(parameters)):
        assert np.all(np.sum(np.abs(z) < 1.96, axis=0) >= 19)
        assert np.all(np.abs(np.mean(z, axis=0)) < 3.3 / np.sqrt(24))


@pytest.mark.sampled(2)
def test_an_error_of_the_model_does_not_pass_for_a_phase_of_the_sensors():
    """A fractional tyre, whose loss a Zener tyre cannot have: u covers that, though a phase could explain a part."""

    def fractional(values, omega):
        part = (1j * omega * 0.01) ** 0.45
        return values[0] + values[1] * part / (1 + part)

    found = mapped(*with_common_errors(0, 0.01, shape=fractional))
    answer, values = found.ask(NEW, AT), truth(NEW)
    clean = np.array([fractional(one, 2 * np.pi * at) for one, at in zip(values, AT, strict=True)])
    off = answer.stiffness - clean
    std = np.sqrt(np.diagonal(answer.stiffness_covariance, 0, 1, 2))
    assert np.all(np.abs(np.stack([off.real, off.imag], axis=1)) < 3 * std)
    assert 0.005 < found.scatter.frequency[1] < 0.1


@pytest.mark.sampled(2)
def test_a_law_that_is_no_polynomial_shows_in_the_uncertainty():
    """A kink between four pressures, which a cubic would meet: u is as large as what lies between them."""

    def kinked(points):
        return truth(points) * np.exp(0.06 * np.abs((points[:, :1] - 1.55e5) / 0.7e5))

    found = mapped(*with_common_errors(0, 1e-5, law=kinked))
    values = kinked(NEW)
    off = np.abs(found.ask(NEW, AT).stiffness / ZENER.stiffness(values, 2 * np.pi * AT[:, None])[:, 0] - 1)
    assert max(found.scatter.condition) > 2e-3
    assert np.sqrt(np.mean(off**2)) < 2 * max(found.scatter.condition)


@pytest.mark.sampled(2)
def test_the_unstated_common_error_of_k1_is_not_averaged_away():
    """Static tests known to 2 %, all by the same load cell: 12 of them know K1 no better."""
    data, shared = with_common_errors(0, 0.03)
    k1 = truth(GRID)[:, 0] * 1.02
    data = [replace(one, k1=np.asarray(at), k1_std=np.asarray(0.02 * at)) for one, at in zip(data, k1, strict=True)]
    found = mapped(data, shared)
    by = found._parameters(NEW)[1]
    std = np.sqrt(np.diagonal(by @ found.covariance @ np.swapaxes(by, 1, 2), 0, 1, 2))[:, 0] / truth(NEW)[:, 0]
    assert np.all(std > 0.01)


@pytest.mark.sampled(6)
def test_many_conditions_over_three_axes_keep_their_scatter():
    points = np.array(
        [
            [p, load, t]
            for p in np.linspace(1e5, 2.4e5, 5)
            for load in np.linspace(1e3, 2e3, 8)
            for t in (10.0, 17.5, 25.0, 32.5, 40.0)
        ]
    )

    def law(points):
        return truth(points[:, :2]) * np.exp(-0.1 * (points[:, 2:] - 25.0) / 15.0)

    data, shared = with_common_errors(0, 0.01, law=law, points=points, scatter=2e-3)
    found = make_map(ZENER, data, Axes.of(["p [Pa]", "l [N]", "T [degC]"], points), law(points), shared)
    assert found.scatter.condition == pytest.approx((2e-3, 2e-3), rel=0.15)
    assert len(found.terms) < 20


def test_errors_of_the_parameters_are_those_of_an_answer_without_scatter(one_map):
    """Near one level of an axis with two, too, where the curvature between them is an error of its own."""
    two = Axes.of(["p [Pa]"], [[1.0e5], [2.0e5]])
    data = measured(3, 0.0)[:2]
    few = make_map(ZENER, data, two, fitted(data))
    # the curvature is taken as a change of the parameters, of which K* is no linear function
    for one, point, close in ((one_map, one_map.axes.middle, 1e-9), (few, np.array([1.3e5]), 0.06)):
        calm = replace(one, scatter=Scatter(), static=None)
        values, errors = calm.parameters(point[None])[0], calm.errors(point)
        slopes = ZENER.derivative(values, OMEGA) @ errors
        rows = np.stack([slopes.real, slopes.imag], axis=1)
        wanted = calm.ask(np.repeat(point[None], OMEGA.size, axis=0), OMEGA / (2 * np.pi)).stiffness_covariance
        assert rows @ np.swapaxes(rows, 1, 2) == pytest.approx(wanted, rel=close, abs=close * np.abs(wanted).max())


def test_tr_of_a_specimen_with_a_belt_is_that_of_a_rig_in_nodes():
    """Its uncertainty, too: that of Re K* alone is the slope of TR."""
    lab = BeltedRig(moving_mass=15.0, c_rig=15.0, gains=(1, 1, 1), delays=(0, 0, 0))
    rig = Rig(moving_mass=15.0, preload_stiffness=lab.k_rig, preload_damping=lab.c_rig)
    frequency = np.array([10.0, 17.0, 24.0, 60.0])
    contact, rim = lab.springs(2 * np.pi * frequency)
    belt, covariance = Specimen(Form.BELT, lab.belt, 0.2), np.zeros((4, 3, 3))
    covariance[:, 0, 0] = 100.0**2

    def tr(change):
        answer = Answer.of(1 / (1 / contact + 1 / rim) + change, np.ones(4), covariance, 2 * np.pi * frequency)
        return answer.transmissibility(rig, frequency, belt)

    whole = [lab.test(2 * np.pi * f, 0.0, rigid=False) for f in frequency]
    np.testing.assert_allclose(tr(0.0)[0], [abs(v2 / v1) for _, v1, v2 in whole], rtol=1e-9)
    np.testing.assert_allclose(tr(0.0)[1], np.abs(tr(50.0)[0] - tr(-50.0)[0]), rtol=1e-4)
