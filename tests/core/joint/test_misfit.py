"""What a fit leaves, how far statements are drawn, and which unstated part would explain it."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from fourpole.core.channelerrors import ChannelUncertainty
from fourpole.core.joint.joint import closed_form_start, solve_joint
from fourpole.core.joint.misfit import is_unlikely, pulls, residuals
from fourpole.core.joint.solve import Solution, solve
from fourpole.core.phasor import Phasors
from fourpole.core.rig import Rig
from fourpole.core.sources import Kind, Source
from fourpole.virtual.phasor_rig import Laboratory

GOOD = Laboratory(
    moving_mass=(15.0, 0.1),
    preload_stiffness=(12440.0, 60.0),
    preload_damping=(15.0, 2.0),
    std_gain=(2e-4,) * 3,
    std_phase=(2e-4,) * 3,
    noise=1e-4,
)


def solved(made):
    problem = made.problem()
    start = closed_form_start(problem.observed, problem.conditions, problem.shared, made.channels)
    return problem, solve(problem, start)


@pytest.fixture(scope="module")
def clean(make):
    made = make(GOOD, masses=(0.0, 10.0), frequencies=8, families=4)
    return made, *solved(made)


def test_the_two_parts_of_a_residual_are_the_whole(clean):
    _made, problem, solution = clean
    left = residuals(problem, solution)
    total = np.sum(problem.columns("residual", solution.z, solution.stiffness) ** 2)
    assert left.whole.sum() == pytest.approx(total, rel=1e-9)
    assert left.whole.sum() + solution.z @ solution.z == pytest.approx(solution.objective, rel=1e-9)


def test_residuals_of_a_clean_campaign_are_chance(clean):
    made, problem, solution = clean
    left = residuals(problem, solution)
    dof = left.rig_dof.sum()
    assert dof == 2 * made.family.size  # six numbers, a drive and a K* of two each
    p = stats.chi2.sf(left.rig.sum() + solution.z @ solution.z, dof)
    assert 1e-3 < p < 1 - 1e-3
    p = stats.chi2.sf(left.tyre.sum(), 2 * (made.family.size - problem.conditions.count))
    assert 1e-3 < p < 1 - 1e-3


def test_the_impedance_left_is_that_of_the_closed_form(clean):
    """F1/V2 corrected for the gains, less Zr: as K* is free, nothing else says anything of Zr."""
    made, problem, solution = clean
    left = residuals(problem, solution)
    gains, rig = problem.observed.gains(problem.shared, solution.z)[0], problem.shared.rig_at(solution.z)
    f1, _, v2 = (made.phasors.amplitudes / gains).T
    mass = np.where(made.added_mass > 0, problem.shared.masses_at(solution.z)[0], 0.0)
    expected = f1 / v2 - rig.impedance(made.phasors.omega, mass)
    u = np.sqrt(np.trace(left.impedance_covariance, axis1=1, axis2=2))
    # K* of a condition is not quite that of one test: its linear share of the residual, and the square of the noise
    assert np.abs(left.impedance - expected).max() < 1e-3 * u.max()
    # noise of 1e-4 in F1 and V2, in each part
    assert u == pytest.approx(2e-4 * np.abs(f1 / v2), rel=0.01)


def test_without_f1_or_v2_nothing_is_said_of_the_impedance(make):
    made = make(GOOD, frequencies=3, families=2).without(0, [0]).without(2, [1])
    left = residuals(*solved(made))
    assert np.isnan(left.impedance).tolist() == [True, True, False, False, False, False]
    assert left.rig_dof.tolist() == [0, 0, 2, 2, 2, 2]
    assert np.abs(left.rig[:2]).max() < 1e-9


def test_a_rigid_block_has_no_stiffness_to_take_up_anything(make):
    made = make(GOOD, frequencies=2, families=1, blocks=(8.0,))
    left = residuals(*solved(made))
    assert left.rig_dof.tolist() == [4, 4, 2, 2]
    assert not left.tyre[:2].any()


def solution_with(z, covariance):
    none = np.zeros((0, 2, 2))
    return Solution(np.array(z), np.zeros(0, complex), np.diag(covariance), none, none, 0.0, 1, True)


def test_a_pull_is_counted_in_the_uncertainty_of_the_distance():
    found = pulls(solution_with([3.0, 3.0, 3.0, 0.0], [0.0, 0.75, 1.0, 1.0 - 1e-6]))
    assert found[:2] == pytest.approx([3.0, 6.0])  # prior and posterior share what is known
    assert np.isnan(found[2:]).all()  # nothing was learned


@pytest.mark.statistical
def test_pulls_are_standard_normal(make):
    """Over seeds: rms of each within four of its standard uncertainties of 1."""
    found = []
    for seed in range(60):
        made = make(GOOD, masses=(0.0, 10.0), frequencies=3, families=2, seed=seed)
        found.append(pulls(solved(made)[1]))
    found = np.array(found)
    seen = np.isfinite(found).all(axis=0)
    assert seen.sum() >= 3
    square = np.mean(found[:, seen] ** 2, axis=0)
    assert np.all(np.abs(square - 1) < 4 * np.sqrt(2 / 60))


@pytest.mark.parametrize(("chi2", "dof", "expected"), [(10.0, 10.0, False), (40.0, 10.0, True), (1e9, 0.0, False)])
def test_unlikely_is_less_than_once_in_a_thousand(chi2, dof, expected):
    assert is_unlikely(chi2, dof) is expected


@pytest.mark.parametrize(
    ("undeclared", "name", "unit", "size"),
    [
        ({"tyre_mass": 1.0}, "tyre mass", "kg", 1.0),
        ({"moving_mass": 14.0}, "moving mass", "kg", -1.0),
        ({"frame_stiffness": 2e5}, "frame", "N/m", 2e5),
        ({"preload_stiffness": 13400.0}, "preload stiffness", "N/m", 960.0),
        ({"preload_loss_factor": 0.08}, "leaf friction", "1", 0.08),
        ({"leaf_friction": 2.0}, "leaf friction", "N", 2.0),
        ({"gain V2": 0.01}, "sensor V2", "1", 0.01),
        ({"phase F1": 0.01}, "sensor F1", "rad", 0.01),
    ],
)
@pytest.mark.sampled(8)
def test_what_is_missing_is_named_with_its_size(make, undeclared, name, unit, size):
    made = make(replace(GOOD, undeclared=undeclared), masses=(0.0, 10.0), frequencies=6, families=2, within=1.0)
    joint = made.identify()
    tied = joint.misfit.candidates[: joint.misfit.tied]
    best = next(each for each in tied if (each.name, each.unit) == (name, unit))
    assert abs(best.value - size) < 4 * best.std
    assert best.explains > 50


@pytest.mark.sampled(6)
def test_a_delay_is_told_from_a_phase(make):
    made = make(GOOD, masses=(0.0, 10.0), frequencies=6, families=2)
    late = made.phasors.amplitudes * np.stack([np.exp(-2e-4j * made.phasors.omega), np.ones(24), np.ones(24)], axis=1)
    joint = made.recorded(late).identify()
    tied = joint.misfit.candidates[: joint.misfit.tied]
    best = next(each for each in tied if each.source == Source(Kind.DELAY, "F1"))
    assert not any(each.source.kind is Kind.PHASE for each in tied)
    assert best.value == pytest.approx(2e-4, rel=0.1)
    assert best.form == "late"


@pytest.mark.sampled(2)
def test_a_phase_that_nothing_could_tell_is_no_cause(make):
    """With one mass V1 turned is K* turned: its share after all is fitted out is round-off."""
    made = make(replace(GOOD, undeclared={"frame_stiffness": 1e5}), frequencies=6, families=2)
    assert not [each for each in made.identify().misfit.candidates if each.name == "sensor V1"]


@pytest.mark.parametrize(("gained", "said"), [(0.99e-3, False), (1.01e-3, True)])
def test_a_pull_needs_a_thousandth_of_what_is_stated(gained, said):
    """A value of which the tests say less than that is not drawn at all."""
    solution = solution_with([0.01], [1.0 - gained])
    assert np.isfinite(pulls(solution)[0]) == said


def with_gain(stiffness, gain):
    """The joint solution of a laboratory whose V1 is wrong by a gain, from F1, V1 and V2 by Newton's law alone."""
    rng, frequency = np.random.default_rng(7), np.repeat([4.6, 6.1, 8.0, 10.6, 14.0, 18.5, 24.5, 32.4], 2)
    jw = 2j * np.pi * frequency
    mass, spring, damper = 79.4, 26120.0, 19.8
    v2 = 1e-2 * np.ones_like(jw)
    force = (jw * mass + damper + spring / jw) * v2
    v1 = v2 + jw * force / stiffness(jw)
    true = np.stack([force, v1, v2], axis=1)
    noise = 2e-4 * np.abs(true) * (rng.standard_normal((len(true), 3)) + 1j * rng.standard_normal((len(true), 3)))
    values = (true + noise) * np.array([1.0, 1 + gain, 1.0])
    covariance = np.einsum("ni,ij->nij", np.repeat(2e-4 * np.abs(true), 2, axis=1) ** 2, np.eye(6))
    phasors = Phasors(frequency, values, covariance, np.zeros_like(frequency), np.full(frequency.shape, 1e4))
    rig = Rig(mass, spring, damper, std={"moving_mass": 0.16, "preload_stiffness": 400.0, "preload_damping": 2.0})
    channels = ChannelUncertainty(np.array([0.009, 0.0065, 0.0085]), np.array([0.0025, 0.0012, 0.0017]))
    return solve_joint(phasors, rig, channels=channels)


def rubber(jw):
    return 6e5 * (1 + 0.1 * (jw / 60) ** 0.3)


def fluid(jw):
    """A mount with a track of fluid, resonant at 12 Hz: its K* is not smooth."""
    return 1.2e5 + 1.2e5 * (0.12 * jw / 75 + (jw / 75) ** 2) / (1 + 0.3 * jw / 75 + (jw / 75) ** 2)


@pytest.mark.parametrize(("stiffness", "gain", "named"), [(rubber, 0.06, True), (rubber, 0.0, False),
                                                          (rubber, 0.008, False), (fluid, 0.0, False)])  # fmt: skip
def test_a_gain_that_bends_k_over_frequency_is_named(stiffness, gain, named):
    """K* of each frequency is free, so that chi-square sees no gain of V1; its neighbours do."""
    joint = with_gain(stiffness, gain)
    assert joint.misfit.chi2 < 2 * joint.misfit.dof + 10
    assert joint.misfit.fits is not named
    if named:
        assert joint.misfit.candidates[0].source == Source(Kind.GAIN, "V1")
        assert joint.misfit.candidates[0].size > 0
