"""The face of the joint route: what goes in, in any order, and what comes out with right uncertainties."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from fourpole.core.identify import identify
from fourpole.core.joint import identify_joint
from fourpole.core.joint.outputs import identification
from fourpole.core.rig import Rig
from fourpole.core.sources import Role
from fourpole.errors import RigError
from fourpole.virtual.phasor_rig import Laboratory

pytestmark = pytest.mark.thorough

WIDE = Laboratory(
    moving_mass=(15.0, 0.3),
    preload_stiffness=(12440.0, 250.0),
    preload_damping=(15.0, 5.0),
    std_gain=(0.01,) * 3,
    std_phase=(0.005,) * 3,
    noise=1e-4,
)
EXACT = Laboratory(moving_mass=(15.0, 0.0), preload_stiffness=(12440.0, 0.0), preload_damping=(15.0, 0.0), noise=1e-4)


@pytest.mark.statistical
@pytest.mark.parametrize(("masses", "gain"), [((0.0,), 3e-4), ((0.0, 10.0), 1e-2)])
@pytest.mark.sampled(4)
def test_errors_are_as_large_as_stated(make, masses, gain):
    """Over 60 campaigns: squared errors in the whole covariance, which are chi-squares if it is right.

    With one mass the gains are as well known as stated, and K* bends with them: at 1 % by more than the noise.
    """
    lab = replace(WIDE, std_gain=(gain,) * 3, std_phase=(gain / 2,) * 3)
    shared, tyre, dof_shared, dof_tyre = 0.0, 0.0, 0, 0
    for seed in range(60):
        made = make(lab, masses=masses, frequencies=4, families=2, spread=0.001, seed=seed)
        joint = made.identify()
        if joint.misfit.conflicts:
            continue  # about one in fifty; z is then counted in another unit
        solution = joint.solution
        off = solution.z - made.true_z(joint.problem.shared)
        shared += off @ np.linalg.solve(solution.covariance, off)
        dof_shared += off.size
        # K* of each condition for the shared values as they are
        true = made.campaign.stiffness / joint.problem.conditions.carried(
            joint.problem.conditions.mean(made.campaign.stiffness)
        )
        true = joint.problem.conditions.mean(true)
        log_k = np.log(solution.stiffness / true)
        epsilon = np.stack([log_k.real, log_k.imag], axis=1) + solution.slope @ off
        tyre += np.einsum("ci,cij,cj->", epsilon, np.linalg.inv(solution.own), epsilon)
        dof_tyre += epsilon.size
    assert dof_shared > 480
    for square, dof in ((shared, dof_shared), (tyre, dof_tyre)):
        low, high = stats.chi2.ppf([5e-4, 1 - 5e-4], dof)
        # what is not linear is below 1e-2 of an uncertainty squared
        assert 0.98 * low < square < 1.02 * high


@settings(max_examples=10)
@given(st.integers(0, 2**31))
@pytest.mark.sampled(4)
def test_a_permuted_table_gives_permuted_results(make, full, seed):
    made = make(full, masses=(0.0, 10.0), frequencies=3, families=2, blocks=(8.0,), spread=0.002)
    order = np.random.default_rng(seed).permutation(made.family.size)
    other = made.part(order)
    one, two = made.identify(), other.identify()
    assert two.solution.z == pytest.approx(one.solution.z, abs=1e-6)
    assert np.array_equal(two.condition, one.condition[order])
    assert np.array_equal(two.outlier, one.outlier[order])
    a = identification(one, made.phasors, made.k1, 0.0)
    b = identification(two, other.phasors, other.k1, 0.0)
    # tests reach the end of the search by other roundings: far below an uncertainty of some 1e-3
    assert b.mobility == pytest.approx(a.mobility[order], rel=1e-8)
    for name in ("stiffness", "stiffness_covariance", "k2", "c", "tr_predicted", "tr_std"):
        found, expected = getattr(b, name), getattr(a, name)[order]
        assert found == pytest.approx(expected, rel=1e-6, abs=1e-6 * np.nanmax(np.abs(expected)), nan_ok=True), name
    impedance = one.residuals.impedance[order]
    assert two.residuals.impedance == pytest.approx(impedance, abs=1e-5 * np.abs(impedance).max(), nan_ok=True)


def test_families_may_have_any_numbers(make):
    made = make(WIDE, masses=(0.0, 10.0), frequencies=3, families=3)
    other = made.identify(family=np.array([40, 7, 12])[made.family])
    here = made.identify()
    assert other.solution.z == pytest.approx(here.solution.z, abs=1e-6)


def test_one_test_alone(make):
    made = make(WIDE, frequencies=1, families=1)
    joint = made.identify()
    found = identification(joint, made.phasors, made.k1, 0.0)
    assert joint.solution.converged
    assert joint.misfit.fits
    error = found.stiffness - made.campaign.stiffness
    square = np.array([error.real[0], error.imag[0]])
    assert square @ np.linalg.solve(found.stiffness_covariance[0], square) < 14  # chi-square of 2: once in a thousand


def test_one_test_without_v2_is_the_mobility_route(make):
    made = make(EXACT, frequencies=1, families=1).without(2, [0])
    joint = made.identify()
    mobility = made.phasors.motion_in / made.phasors.force_in
    omega = made.phasors.omega
    expected = 1j * omega / (mobility - 1 / made.rig.impedance(omega))
    assert joint.solution.stiffness == pytest.approx(expected, rel=1e-9)
    assert joint.misfit.dof == 0
    assert joint.misfit.fits


def test_one_frequency_only(make):
    made = make(WIDE, masses=(0.0, 10.0), frequencies=1, families=4, spread=0.002)
    joint = made.identify()
    assert joint.solution.converged
    assert joint.solution.stiffness.shape == (4,)
    assert joint.misfit.fits


def test_all_exact_leaves_nothing_to_share(make):
    made = make(EXACT, masses=(0.0, 10.0), frequencies=3, families=2)
    joint = made.identify(added_mass_std=0.0)
    assert joint.solution.z.size == 0
    assert joint.found.size == 0
    assert joint.found_std.size == 0
    assert joint.solution.covariance.shape == (0, 0)
    assert joint.misfit.fits
    found = identification(joint, made.phasors, made.k1, 0.0)
    assert np.all(np.isfinite(found.stiffness_covariance))
    off = np.abs(found.stiffness / made.campaign.stiffness - 1)
    assert off.max() < 100 * 1e-4  # the noise, and what the resonance makes of it


def test_k1_unknown_everywhere(make):
    made = make(WIDE, masses=(0.0, 10.0), frequencies=6, families=2)
    known, unknown = made.identify(), made.identify(k1=np.nan)
    # at equal frequencies nothing is carried, so that K1 does not matter
    assert unknown.solution.z == pytest.approx(known.solution.z, abs=1e-6)
    assert np.abs(unknown.solution.stiffness / known.solution.stiffness - 1).max() < 1e-8


def test_amplitudes_without_any_noise_have_the_floor(make):
    """A table of amplitudes: no covariance, single precision is what is granted; nothing breaks."""
    made = make(replace(EXACT, noise=0.0), masses=(0.0, 10.0), frequencies=4, families=2)
    assert not made.phasors.covariance.any()
    joint = made.identify(added_mass_std=1e-4 * made.added_mass)
    assert joint.solution.converged
    assert np.abs(joint.solution.stiffness / made.campaign.stiffness[::2] - 1).max() < 1e-3


def test_one_channel_without_noise(make):
    made = make(WIDE, masses=(0.0, 10.0), frequencies=4, families=2)
    covariance = made.phasors.covariance.copy()
    covariance[:, 2:4], covariance[:, :, 2:4] = 0.0, 0.0
    amplitudes = made.phasors.amplitudes.copy()
    amplitudes[:, 1] = made.campaign.true_amplitudes[:, 1] * (
        (1 + made.campaign.truth.gain[1]) * np.exp(1j * made.campaign.truth.phase[1])
    )
    joint = replace(made, phasors=replace(made.phasors, amplitudes=amplitudes, covariance=covariance)).identify()
    assert joint.solution.converged
    assert joint.misfit.fits


def test_calibration_blocks_alone(make):
    made = make(WIDE, frequencies=1, families=1, blocks=(4.0, 8.0, 16.0))
    joint = made.part(made.family < 0).identify()
    assert joint.solution.converged
    assert joint.solution.stiffness.size == 0
    assert joint.condition.tolist() == [-1] * 6
    assert joint.misfit.fits


def test_each_mass_has_the_largest_error_that_is_said_of_it(make):
    made = make(WIDE, masses=(0.0, 10.0), frequencies=2, families=1, blocks=(4.0,))
    std = np.where(made.added_mass == 10.0, 2e-3, 0.0)
    std[np.flatnonzero(std)[0]] = 3e-3
    joint = made.identify(added_mass_std=std)
    masses = [(one.source.mass, one.std) for one in joint.stated.parameters if one.source.role is Role.MASS]
    assert masses == [(10.0, 3e-3)]  # that of the block is exact


def test_what_is_found_is_told_in_units(make):
    made = make(WIDE, masses=(0.0, 10.0), frequencies=5, families=3)
    joint = made.identify()
    found = dict(zip([one.source.text for one in joint.stated.parameters], joint.found, strict=True))
    std = dict(zip([one.source.text for one in joint.stated.parameters], joint.found_std, strict=True))
    truth = made.campaign.truth
    assert abs(found["moving_mass"] - truth.moving_mass) < 4 * std["moving_mass"]
    assert abs(found["gain V1"] - 1 - truth.gain[1]) < 4 * std["gain V1"]
    assert std["moving_mass"] < 0.1 * WIDE.moving_mass[1]  # two masses calibrate the rig


def test_the_answer_has_the_form_of_every_route(make):
    made = make(WIDE, masses=(0.0, 10.0))
    given = {"k1_std": 0.01 * made.k1, "added_mass": made.added_mass, "channels": made.channels}
    alone = identify(made.phasors, made.rig, made.k1, route="relative", **given)
    found = identify_joint(made.phasors, made.rig, made.k1, family=made.family, **given)
    assert type(found) is type(alone)
    assert (alone.joint, found.route) == (None, "joint")
    np.testing.assert_array_equal(found.k1_std, alone.k1_std)
    assert found.joint.found.shape == found.joint.found_std.shape
    exact = identify_joint(made.phasors, made.rig, made.k1, family=made.family, **(given | {"k1_std": 0.0}))
    np.testing.assert_array_equal(exact.stiffness, found.stiffness)
    assert np.all(found.arm_covariance[:, 0, 0] > exact.arm_covariance[:, 0, 0])


def test_a_blocked_rig_has_nothing_to_join(make):
    made = make(WIDE, frequencies=1, families=1)
    with pytest.raises(RigError, match="blocked"):
        identify_joint(made.phasors, Rig(blocked=True))


@pytest.mark.sampled(4)
def test_a_large_campaign_costs_as_its_tests(make):
    """No array grows with the square of the tests: 4,000 of them are a matter of a second."""
    made = make(WIDE, masses=(0.0, 10.0), frequencies=10, families=200)
    joint = made.identify()
    assert joint.solution.converged
    assert joint.solution.slope.shape == (2000, 2, 10)
