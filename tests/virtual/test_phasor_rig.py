"""The rig in the frequency domain: against the chain of four-poles, the routes, and the statistics it states."""

from dataclasses import replace

import numpy as np
import pytest

from fourpole.core.rig import Rig
from fourpole.core.routes import maxwell_arm, mobility_route, relative_route, transmissibility_route
from fourpole.virtual.phasor_rig import RIG_VALUES, Conditions, Laboratory, draw, simulate_phasors

FREQUENCIES = np.linspace(8.0, 24.0, 9)
TESTS = Conditions(
    FREQUENCIES,
    k1=np.linspace(100e3, 180e3, 9),
    k2=np.linspace(90e3, 200e3, 9),
    c=np.linspace(700.0, 1500.0, 9),
    added_mass=[0.0, 5.0, 10.0] * 3,
)
ALL = Laboratory(
    preload_loss_factor=(0.02, 0.0), tyre_mass=(0.8, 0.0), frame_stiffness=(4e5, 0.0), input_mass=(0.5, 0.0)
)
ROUND_OFF = 1e-12


def rng(seed=1982):
    return np.random.default_rng(seed)


def exact(laboratory):
    """The laboratory with everything as stated, and its rig in the core's terms."""
    stated = {name: getattr(laboratory, name)[0] for name in RIG_VALUES}
    settled = replace(laboratory, std_added=0.0, **{name: (value, 0.0) for name, value in stated.items()})
    return settled, Rig(**stated)


@pytest.mark.parametrize("laboratory", [Laboratory(), ALL], ids=["the paper's", "all parts"])
def test_clean_campaign_is_that_of_the_chain_and_the_routes(laboratory):
    settled, rig = exact(laboratory)
    run = simulate_phasors(settled, TESTS, rng())
    omega, added = run.phasors.omega, np.asarray(TESTS.added_mass)
    f1, v1, v2 = run.phasors.amplitudes.T
    f1 = f1 - 1j * omega * rig.input_mass * v1
    impedance = rig.impedance(omega, added)
    np.testing.assert_allclose(f1, impedance * v2, rtol=ROUND_OFF)
    np.testing.assert_allclose(relative_route(f1, v1, v2, omega), run.stiffness, rtol=ROUND_OFF)
    np.testing.assert_allclose(mobility_route(v1 / f1, 1 / impedance, omega), run.stiffness, rtol=ROUND_OFF)
    np.testing.assert_allclose(transmissibility_route(v2 / v1, impedance, omega), run.stiffness, rtol=ROUND_OFF)
    k2, c = maxwell_arm(run.stiffness, TESTS.k1, omega)
    np.testing.assert_allclose(k2, TESTS.k2, rtol=ROUND_OFF)
    np.testing.assert_allclose(c, TESTS.c, rtol=ROUND_OFF)
    np.testing.assert_allclose(run.transmissibility, abs(v2 / v1), rtol=ROUND_OFF)
    np.testing.assert_allclose(v1, 1e-3 * omega, rtol=ROUND_OFF)
    assert not run.phasors.covariance.any()
    assert not run.phasors.frequency_std.any()


def test_rigid_block_moves_as_the_contact_and_has_no_tyre_mass():
    settled, rig = exact(ALL)
    tests = Conditions(FREQUENCIES, added_mass=8.0, calibration=True, k1=np.nan, k2=np.nan, c=np.nan)
    run = simulate_phasors(settled, tests, rng())
    f1, v1, v2 = run.phasors.amplitudes.T
    np.testing.assert_array_equal(v1, v2)
    impedance = replace(rig, tyre_mass=0.0).impedance(run.phasors.omega, 8.0)
    np.testing.assert_allclose(f1, (impedance + 1j * run.phasors.omega * rig.input_mass) * v1, rtol=ROUND_OFF)
    assert np.isnan(run.stiffness).all()
    assert np.isnan([run.k2, run.c]).all()
    np.testing.assert_allclose(run.transmissibility, 1.0, rtol=ROUND_OFF)


@pytest.mark.parametrize("laboratory", [Laboratory(), ALL], ids=["the paper's", "all parts"])
@pytest.mark.parametrize("calibration", [False, True])
def test_friction_is_its_describing_function_at_the_motion_that_results(laboratory, calibration):
    settled, rig = exact(replace(laboratory, undeclared={"leaf_friction": 5.0}))
    tests = replace(TESTS, calibration=calibration)
    run = simulate_phasors(settled, tests, rng())
    omega = run.phasors.omega
    f1, v1, v2 = run.phasors.amplitudes.T
    rig = replace(rig, tyre_mass=0.0) if calibration else rig
    impedance = rig.impedance(omega, np.asarray(TESTS.added_mass)) + 4.0 * 5.0 / (np.pi * abs(v2))
    f1 = f1 - 1j * omega * rig.input_mass * v1
    np.testing.assert_allclose(f1, impedance * v2, rtol=ROUND_OFF)
    if not calibration:
        np.testing.assert_allclose(relative_route(f1, v1, v2, omega), run.stiffness, rtol=ROUND_OFF)


def test_friction_that_holds_the_mass_is_refused():
    # the tyre pushes a held mass with |K*| e, of which 4/pi Ff is the share that must not exceed it
    push = abs(180e3 + 90e3) * 1e-3
    laboratory = Laboratory(undeclared={"leaf_friction": push})
    with pytest.raises(ValueError, match="leaf_friction of 270 N holds the mass"):
        simulate_phasors(laboratory, Conditions(10.0, k1=180e3, k2=90e3, c=800.0), rng())
    calibration = Conditions(10.0, added_mass=5.0, calibration=True)
    assert simulate_phasors(laboratory, calibration, rng()).transmissibility == pytest.approx(1.0)


def test_channels_err_by_their_gain_and_phase():
    hidden = {"gain F1": 0.03, "gain V1": -0.02, "phase V2": 0.01}
    run = simulate_phasors(Laboratory(std_gain=(0.1,) * 3, undeclared=hidden), TESTS, rng())
    ratio = run.phasors.amplitudes / run.true_amplitudes
    np.testing.assert_allclose(ratio[:, 0], 1.03, rtol=ROUND_OFF)
    np.testing.assert_allclose(ratio[:, 1], 0.98, rtol=ROUND_OFF)
    np.testing.assert_allclose(ratio[:, 2], (1.0 + run.truth.gain[2]) * np.exp(0.01j), rtol=ROUND_OFF)
    assert run.truth.gain[2] != 0.0


def test_noise_has_the_covariance_that_comes_with_it():
    count, noise = 20000, 3e-3
    tests = Conditions(np.full(count, 12.0), k1=120e3, k2=90e3, c=800.0)
    run = simulate_phasors(Laboratory(noise=noise), tests, rng())
    difference = run.phasors.amplitudes - run.true_amplitudes * (1 + run.truth.gain) * np.exp(1j * run.truth.phase)
    parts = np.stack([difference.real, difference.imag], axis=-1).reshape(count, 6)
    whitened = parts / run.phasors.std
    # a variance of n numbers is uncertain by sqrt(2/n), a correlation by 1/sqrt(n); 21 of them, 5 sigma
    np.testing.assert_allclose(whitened.T @ whitened / count, np.eye(6), atol=5.0 * np.sqrt(2.0 / count))
    np.testing.assert_allclose(whitened.mean(axis=0), 0.0, atol=5.0 / np.sqrt(count))
    np.testing.assert_allclose(run.phasors.std[:, ::2], noise * abs(run.true_amplitudes), rtol=ROUND_OFF)
    off_diagonal = run.phasors.covariance[0] - np.diag(np.diagonal(run.phasors.covariance[0]))
    assert not off_diagonal.any()


def test_draws_have_the_uncertainties_stated():
    std = {
        "moving_mass": (15.0, 0.1),
        "preload_stiffness": (12440.0, 100.0),
        "preload_damping": (15.0, 5.0),
        "preload_loss_factor": (0.02, 1e-3),
        "tyre_mass": (0.8, 0.02),
        "frame_stiffness": (4e6, 1e5),
        "input_mass": (0.5, 0.01),
    }
    laboratory = Laboratory(**std, std_gain=(0.01, 0.02, 0.03), std_phase=(1e-3, 2e-3, 3e-3), std_added=1e-3)
    generator, count = rng(), 4000
    drawn = [draw(laboratory, generator, added_masses=[10.0, 5.0, 10.0, 0.0]) for _ in range(count)]
    z = [[(getattr(one, name) - value) / u for name, (value, u) in std.items()] for one in drawn]
    z = np.column_stack(
        [
            z,
            [one.gain / laboratory.std_gain for one in drawn],
            [one.phase / laboratory.std_phase for one in drawn],
            [[(one.added_mass[mass] / mass - 1.0) / 1e-3 for mass in (5.0, 10.0)] for one in drawn],
        ]
    )
    assert all(one.added_mass[0.0] == 0.0 for one in drawn)
    np.testing.assert_allclose(z.T @ z / count, np.eye(15), atol=5.0 * np.sqrt(2.0 / count))


def test_tests_of_one_mass_share_its_error():
    tests = replace(TESTS, frequency=10.0, k1=120e3, k2=90e3, c=800.0)
    run = simulate_phasors(Laboratory(std_added=0.01), tests, rng())
    f1, _, v2 = run.phasors.amplitudes.T
    weights = ((f1 / v2).imag / (20.0 * np.pi)).reshape(3, 3)  # m + D - K3/w^2
    np.testing.assert_allclose(weights, np.broadcast_to(weights[0], (3, 3)), rtol=ROUND_OFF)
    found = weights[0, 1:] - weights[0, 0]
    np.testing.assert_allclose(found, [run.truth.added_mass[5.0], run.truth.added_mass[10.0]], rtol=1e-10)
    assert abs(found / [5.0, 10.0] - 1.0).min() > 1e-5


def test_laboratories_share_their_draws_but_for_what_is_undeclared():
    plain = draw(Laboratory(std_gain=(0.01,) * 3), rng(), added_masses=[10.0])
    hidden = draw(Laboratory(std_gain=(0.01,) * 3, undeclared={"tyre_mass": 1.0}), rng(), added_masses=[10.0])
    assert hidden.tyre_mass == 1.0
    assert plain.moving_mass == hidden.moving_mass
    assert plain.added_mass == hidden.added_mass
    np.testing.assert_array_equal(plain.gain, hidden.gain)


def test_channel_that_was_not_measured_is_absent():
    tests = replace(TESTS, has_motion_out=np.arange(9) > 3)
    run = simulate_phasors(Laboratory(noise=1e-3), tests, rng())
    assert np.isnan(run.phasors.motion_out).tolist() == [True] * 4 + [False] * 5
    assert not run.phasors.covariance[:4, 4:, :].any()
    assert np.isfinite(run.phasors.amplitudes[:, :2]).all()
    assert np.isfinite(run.transmissibility).all()


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: Laboratory(undeclared={"tire_mass": 1.0}), "'tire_mass' is unknown"),
        (lambda: Laboratory(noise=-1.0), "noise is -1"),
        (lambda: Conditions(-1.0).spread(), "must be > 0"),
        (lambda: Conditions(10.0, k2=0.0).spread(), "must be > 0"),
        (lambda: Conditions(10.0, added_mass=-1.0).spread(), "must be > 0"),
        (lambda: Conditions([[10.0]]).spread(), "one value per test"),
    ],
)
def test_impossible_statements_are_refused(make, said):
    with pytest.raises(ValueError, match=said):
        make()
