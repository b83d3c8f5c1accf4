"""What a test is asked for, its derivatives and its covariance."""

from dataclasses import replace

import numpy as np
import pytest

from fourpole.core.curvature import arm_covariance
from fourpole.core.joint.outputs import identification, outputs, variance_by_source
from fourpole.core.routes import maxwell_arm, mobility_route

STEP = 1e-5


@pytest.fixture(scope="module")
def solved(make, full):
    """Tests of a condition stand at the same frequency, so that nothing is carried."""
    made = make(replace(full, noise=3e-4), masses=(0.0, 10.0), frequencies=3, families=2, blocks=(8.0,), seed=2)
    joint = made.identify()
    assert joint.misfit.fits
    return made, joint, outputs(joint, made.phasors, made.k1)


def moved(made, joint, *, log_k=0.0, z=None, k1=None):
    """The outputs at values moved away from the most probable ones."""
    solution = joint.solution
    values = replace(solution, stiffness=solution.stiffness * np.exp(log_k), z=solution.z if z is None else z)
    return outputs(replace(joint, solution=values), made.phasors, made.k1 if k1 is None else k1).value


def check(found, expected, value):
    """By a difference of step 1e-5 in a logarithm: its square, a hundred for K2, which bends most, and round-off."""
    tyre = np.isfinite(expected).all(axis=1)
    size = np.abs(expected[tyre]).max(axis=0) + 1e-4  # a loss factor may not change at all
    round_off = 4 * np.finfo(float).eps * np.nanmax(np.abs(value), axis=0) / STEP
    assert np.all(np.abs(found[tyre] - expected[tyre]) < 1e-6 * size + round_off)


def test_values_are_those_of_the_closed_forms(solved):
    made, joint, found = solved
    stiffness = np.append(joint.solution.stiffness, complex(np.nan, np.nan))[joint.condition]
    k2, c = maxwell_arm(stiffness, made.k1, made.phasors.omega)
    expected = [stiffness.real, stiffness.imag, stiffness.imag / stiffness.real, k2, c]
    assert found.value[:, :5] == pytest.approx(np.stack(expected, axis=1), rel=1e-12, nan_ok=True)
    rig = joint.problem.shared.rig_at(joint.solution.z)
    added = joint.problem.shared.masses_at(joint.solution.z)
    mass = np.append(added, 0.0)[np.searchsorted(made.masses, made.added_mass)]
    mass = np.where(made.added_mass > 0, mass, 0.0)
    impedance = rig.impedance(made.phasors.omega, mass)
    with np.errstate(invalid="ignore"):  # a block has no stiffness
        ratio = stiffness / (stiffness + 1j * made.phasors.omega * impedance)
    assert found.value[:, 5] == pytest.approx(np.abs(ratio), rel=1e-12, nan_ok=True)


def test_derivatives_by_stiffness(solved):
    made, joint, found = solved
    for at, turn in enumerate((1.0, 1j)):
        above, below = (moved(made, joint, log_k=side * STEP * turn) for side in (1, -1))
        check((above - below) / (2 * STEP), found.by_own[:, :6, at], found.value)


def test_derivatives_by_shared_values(solved):
    """K* goes along with each shared value, as the tests demand."""
    made, joint, found = solved
    solution = joint.solution
    for at in range(solution.z.size):
        step = STEP * np.eye(solution.z.size)[at]
        along = -(solution.slope[:, 0, at] + 1j * solution.slope[:, 1, at])
        above, below = (moved(made, joint, log_k=side * STEP * along, z=solution.z + side * step) for side in (1, -1))
        check((above - below) / (2 * STEP), found.by_shared[:, :6, at], found.value)


def test_derivatives_by_k1(solved):
    made, joint, found = solved
    step = 1e-5 * made.k1
    # without carrying nothing else depends on K1
    above, below = (moved(made, joint, k1=made.k1 + side * step) for side in (1, -1))
    check((above - below) / (2 * step[:, None]), found.by_k1[:, :6] + 0 * found.value, 0 * found.value)


def test_the_covariance_is_that_of_the_dense_problem(dense):
    made, reference, joint = dense
    found = outputs(joint, made.phasors, made.k1)
    tyre = made.family >= 0
    expected = reference.output_covariance()[tyre]
    assert found.value[tyre] == pytest.approx(reference.outputs(reference.x)[tyre], rel=1e-6)
    covariance = found.covariance_of(slice(0, 6), np.zeros(made.k1.size))[tyre]
    std = np.sqrt(np.diagonal(expected, axis1=1, axis2=2))
    # derivatives by differences of 1e-5 of an uncertainty: round-off over the step
    assert np.abs((covariance - expected) / std[:, :, None] / std[:, None, :]).max() < 1e-5


def test_rigid_blocks_have_no_outputs(solved):
    made, joint, found = solved
    blocks = made.family < 0
    assert np.isnan(found.value[blocks]).all()
    answer = identification(joint, made.phasors, made.k1, np.zeros(made.k1.size))
    assert np.isnan(answer.stiffness[blocks]).all()
    assert np.isnan(answer.k2[blocks]).all()
    assert np.isfinite(answer.k2[~blocks]).all()
    assert [bool(reason) for reason in answer.reasons] == [False] * made.family.size
    assert answer.route == "joint"


@pytest.mark.statistical
@pytest.mark.sampled(8)
def test_the_mobility_is_freed_of_the_gains_with_its_uncertainty(make, full):
    """Over seeds: errors of R and I in their covariance, chi-square of two degrees, one test of each campaign."""
    square, count = 0.0, 40
    for seed in range(count):
        made = make(full, masses=(0.0, 10.0), frequencies=2, families=2, seed=seed)
        joint = made.identify()
        found = identification(joint, made.phasors, made.k1, 0.0)
        force, motion, _ = made.campaign.true_amplitudes[seed % made.k1.size]
        off = found.mobility[seed % made.k1.size] - motion / force
        parts = np.array([off.real, off.imag])
        square += parts @ np.linalg.solve(found.mobility_covariance[seed % made.k1.size], parts)
    assert square == pytest.approx(2 * count, abs=4 * np.sqrt(4 * count))


def test_k1_s_uncertainty_is_in_k2_and_c_alone(solved):
    made, joint, found = solved
    tyre = made.family >= 0
    without, with_it = (
        identification(joint, made.phasors, made.k1, std * np.nan_to_num(made.k1)) for std in (0.0, 0.01)
    )
    assert np.array_equal(without.stiffness_covariance[tyre], with_it.stiffness_covariance[tyre])
    assert np.array_equal(without.tr_std[tyre], with_it.tr_std[tyre])
    std = 0.01 * np.nan_to_num(made.k1)
    first = [found.covariance_of(slice(3, 5), each) for each in (0 * std, std)]
    more = first[1] - first[0]
    by = found.by_k1[:, 3:5] * (0.01 * made.k1)[:, None]
    assert more[tyre] == pytest.approx((by[:, :, None] * by[:, None, :])[tyre], rel=1e-6)
    for order_two, order_one in zip((without, with_it), first, strict=True):
        second = np.diagonal(order_two.arm_covariance - order_one, 0, 1, 2)
        assert np.all(second[tyre] > 0)


def test_k2_and_c_are_of_second_order_and_the_budget_adds_up(solved):
    """The covariance of K2 and C is that of K* and K1 to second order: the joint route knows nothing else of them."""
    made, joint, found = solved
    tyre = made.family >= 0
    std = 0.02 * np.nan_to_num(made.k1)
    answer = identification(joint, made.phasors, made.k1, std, found)
    covariance = answer.stiffness_covariance.copy()
    covariance[:, 0, 0] += std**2
    expected = arm_covariance(answer.stiffness, made.k1, made.phasors.omega, covariance)
    assert answer.arm_covariance[tyre] == pytest.approx(expected[tyre], rel=1e-9)
    whole = np.sum(list(variance_by_source(joint, found, std).values()), axis=0)
    assert whole[tyre, 3:5] == pytest.approx(np.diagonal(answer.arm_covariance, 0, 1, 2)[tyre], rel=1e-9)


def test_k1_unknown_leaves_k2_and_c_blank_and_all_else_as_it_is(solved):
    made, joint, _ = solved
    known = identification(joint, made.phasors, made.k1, 0.0)
    blank = identification(joint, made.phasors, np.nan, np.nan)
    tyre = made.family >= 0
    assert np.isnan(blank.k2).all()
    assert np.isnan(blank.c).all()
    assert all("K1" in reason for reason in np.array(blank.reasons)[tyre])
    for name in ("stiffness", "stiffness_covariance", "loss_factor_std", "tr_predicted", "tr_std"):
        assert np.array_equal(getattr(blank, name)[tyre], getattr(known, name)[tyre]), name


def test_the_uncertainty_of_the_frequency_has_its_share(make, full):
    """Where nothing but K* can take it up, without V2, it moves K* as it moves the closed form."""
    made = make(replace(full, noise=1e-5), frequencies=3, families=2).without(2, slice(None))
    share = 1e-3
    blurred = replace(made, phasors=replace(made.phasors, frequency_std=share * made.phasors.frequency))
    joint = blurred.identify()
    found = outputs(joint, blurred.phasors, blurred.k1)
    gains, rig = (
        joint.problem.observed.gains(joint.problem.shared, joint.solution.z)[0],
        joint.problem.shared.rig_at(joint.solution.z),
    )
    f1, v1, _ = (made.phasors.amplitudes / gains).T

    def stiffness(omega):
        mobility = v1 / (f1 - 1j * omega * rig.input_mass * v1)
        return mobility_route(mobility, 1 / rig.impedance(omega), omega)

    step = 1e-5
    by = np.log(stiffness(made.phasors.omega * (1 + step)) / stiffness(made.phasors.omega * (1 - step))) / (2 * step)
    parts = share * np.stack([by.real, by.imag], axis=1)
    expected = parts[:, :, None] * parts[:, None, :]
    # the weights were made at the start, with m, K3 and gains as stated: to a few times their 1 %
    assert np.abs(found.frequency - expected).max() < 0.1 * np.abs(expected).max()
    noise = found.own - found.frequency
    assert np.linalg.eigvalsh(noise).min() > 0
    assert np.abs(noise).max() < (100 * 1e-5) ** 2  # and the noise has the rest
    sharp = made.identify()
    assert not outputs(sharp, made.phasors, made.k1).frequency.any()


def test_the_error_of_the_rig_is_in_the_transmissibility(solved):
    """Twice TR = |K*/(K* + jw Zr)|: as stated, and at Zr moved by a share of its largest part the worst way."""
    made, joint, _ = solved
    share = 1e-4
    doubted = replace(joint, misfit=replace(joint.misfit, rig_error=share))
    stated, doubted = (identification(each, made.phasors, made.k1, 0.0) for each in (joint, doubted))
    tyre = joint.condition >= 0
    added = np.where(made.added_mass > 0, made.added_mass, 0.0)[tyre]
    omega, stiffness = made.phasors.omega[tyre], stated.stiffness[tyre]
    rig = joint.problem.shared.rig_at(joint.solution.z)
    impedance = rig.impedance(omega, added)
    spring = rig.preload_stiffness / omega
    largest = np.maximum(np.abs(impedance + 1j * spring), spring)

    turn = np.exp(1j * np.linspace(0, 2 * np.pi, 721))[:, None]
    tr = np.abs(stiffness / (stiffness + 1j * omega * (impedance + share * largest * turn)))
    moved = np.max(np.abs(tr - np.abs(stiffness / (stiffness + 1j * omega * impedance))), axis=0)
    added_variance = doubted.tr_std[tyre] ** 2 - stated.tr_std[tyre] ** 2
    assert np.sqrt(added_variance) == pytest.approx(
        moved, rel=2e-3
    )  # the square of the step, and of the masses' errors
    assert doubted.stiffness_covariance[tyre] == pytest.approx(stated.stiffness_covariance[tyre])
