"""A specimen that does not repeat: K* of each test by itself, a drift over the run, one bad test among fifteen."""

from dataclasses import replace

import numpy as np
import pytest
from tests.core.joint.conftest import USUAL

from fourpole.core.channelerrors import ChannelUncertainty
from fourpole.core.joint import solve_joint
from fourpole.core.joint.outputs import identification
from fourpole.core.phasor import Phasors
from fourpole.core.rig import Rig
from fourpole.core.sources import Kind

THREE = (0.0, 0.0, 0.0)


@pytest.mark.statistical
@pytest.mark.parametrize("scatter", [3e-4, 3e-3, 1e-2])
@pytest.mark.sampled(6)
def test_a_tyre_that_repeats_badly_is_no_error_of_the_rig(make, scatter):
    """One mass, three repeats at speeds 0.3 % apart: their slope over frequency looks like any error of a channel.

    K' is off by what the same campaign without scatter is off: by the gains, which one mass does not show.
    """
    squares, worst, told = [], [], 0
    for seed in range(4):
        made = make(USUAL, masses=THREE, spread=3e-3, families=2, scatter=scatter, within=2.0, seed=seed)
        joint = made.identify()
        told += not joint.misfit.fits
        assert joint.misfit.scatter == pytest.approx(scatter, rel=0.5)
        off, relative = made.errors_of(joint)
        steady = make(USUAL, masses=THREE, spread=3e-3, families=2, within=2.0, seed=seed)
        squares.append(np.mean(off**2))
        worst.append(np.abs(relative - steady.errors_of(steady.identify())[1]).max())
    assert told <= 1
    assert max(worst) < 0.01
    # Gains within two uncertainties are common to all tests of a campaign: as if it had two numbers.
    assert np.mean(squares) < 1 + 4 * np.sqrt(2 / 8)


@pytest.mark.statistical
@pytest.mark.sampled(6)
def test_k_of_each_test_is_its_own(make):
    """With exact channels nothing is left but its own noise; the scatter itself is in no uncertainty."""
    exact = replace(USUAL, std_gain=(1e-5,) * 3, std_phase=(1e-5,) * 3)
    squares = []
    for seed in range(5):
        made = make(exact, masses=THREE, spread=3e-3, families=2, scatter=5e-3, within=2.0, seed=seed)
        joint = made.identify()
        off, relative = made.errors_of(joint)
        squares.append(np.mean(off**2))
        # The noise of 2e-4 and what the resonance makes of it; K* of the condition would be off by 5e-3.
        assert np.median(np.abs(relative)) < 1.5e-3
    # 60 numbers in each of 5 campaigns
    assert np.mean(squares) == pytest.approx(1.0, abs=4 * np.sqrt(2 / 300))


@pytest.mark.parametrize("drift", [0.01, 0.05, -0.05, 0.02 + 0.02j])
@pytest.mark.sampled(4)
def test_a_drift_is_found_and_k_is_that_of_its_own_place(make, drift):
    made = make(USUAL, masses=THREE, spread=3e-3, families=1, frequencies=8, drift=drift, scatter=5e-4, within=2.0)
    joint = made.identify(specimen=["radial"] * made.family.size)
    assert joint.misfit.fits
    assert [source.of for source in joint.misfit.specimens] == ["radial"] * 2
    at = {one.source.kind: i for i, one in enumerate(joint.stated.parameters)}
    for kind, true in ((Kind.DRIFT, np.real(drift)), (Kind.ANGLE_DRIFT, np.imag(drift))):
        off = joint.found[at[kind]] - true
        assert abs(off) < 4 * joint.found_std[at[kind]]
        assert joint.found_std[at[kind]] < 1e-3
    off, relative = made.errors_of(joint)
    # Gains of 0.5 % each are left, which one mass does not show; near the resonance they count several times.
    assert np.median(np.abs(relative)) < 0.02
    assert np.abs(off).max() < 4
    found = identification(joint, made.phasors, made.k1, 0.0).stiffness
    first, last = (np.flatnonzero(made.time == end)[0] for end in (made.time.min(), 16))
    true = made.campaign.stiffness
    assert found[last] / found[first] == pytest.approx(true[last] / true[first], rel=3e-3)


@pytest.mark.statistical
@pytest.mark.sampled(4)
def test_honest_campaigns_have_neither_scatter_nor_drift(make):
    """Each asks once in a thousand times: of 20 campaigns one may."""
    scatter, drifts = 0, 0
    for seed in range(20):
        misfit = (
            make(USUAL, masses=THREE, spread=3e-3, families=2, frequencies=4, seed=seed, drift=1e-12).identify().misfit
        )
        scatter += misfit.scatter > 0
        drifts += bool(misfit.specimens)
    assert scatter <= 1
    assert drifts <= 1


@pytest.mark.parametrize("channel", [0, 1, 2])
@pytest.mark.sampled(3)
def test_one_test_in_fifteen_whose_gain_is_far_off_is_found(make, channel):
    made = make(USUAL, masses=THREE, spread=3e-3, families=1, frequencies=5, within=2.0)
    amplitudes = made.phasors.amplitudes.copy()
    amplitudes[7, channel] *= 1.3
    bad = made.recorded(amplitudes)
    joint = bad.identify()
    assert np.flatnonzero(joint.outlier > 1).tolist() == [7]
    assert joint.misfit.fits
    others = np.arange(made.family.size) != 7
    clean = identification(made.identify(), made.phasors, made.k1, 0.0)
    found = identification(joint, bad.phasors, bad.k1, 0.0)
    # The others hardly feel it: their u is not larger by more than one repeat of three.
    ratio = found.stiffness_covariance[others, 0, 0] / clean.stiffness_covariance[others, 0, 0]
    assert np.all(ratio < 1.6)
    assert np.abs(bad.errors_of(joint)[0][others]).max() < 4


def _recordings(seed, *, count=6, lines=16, scatter=0.01):
    """Recordings with and without 10 kg, with many lines each; K' and K'' of all lines of one are off together."""
    rng = np.random.default_rng(seed)
    frequency = np.tile(np.geomspace(8.0, 60.0, lines), count)
    added = np.repeat(np.where(np.arange(count) % 2, 10.0, 0.0), lines)
    omega = 2 * np.pi * frequency
    off = np.repeat(scatter * (rng.normal(size=count) + 1j * rng.normal(size=count)), lines)
    stiffness = (120e3 + 1j * omega * 800 * 90e3 / (90e3 + 1j * omega * 800)) * np.exp(off)
    impedance = Rig(moving_mass=15.0, preload_stiffness=12440.0).impedance(omega, added)
    ratio = stiffness / (stiffness + 1j * omega * impedance)
    noise = 1e-3 * (rng.normal(size=(omega.size, 6)) @ np.kron(np.eye(3), [[1], [1j]]))
    clean = 0.06 * np.stack([impedance * ratio, np.ones(omega.size), ratio], axis=1)
    variance = np.repeat(1e-3 * np.abs(clean), 2, axis=1) ** 2
    nothing = np.zeros(omega.size)
    gains = np.array([1.02, 0.98, 1.01])
    return added, Phasors(
        frequency, gains * clean * (1 + noise), variance[:, :, None] * np.eye(6), nothing, nothing + np.inf
    )


@pytest.mark.statistical
@pytest.mark.sampled(8)
def test_the_scatter_of_recordings_with_many_lines_is_that_of_few_values():
    """The lines of a recording do not average a scatter that they share: the gain keeps its uncertainty."""
    rig = Rig(moving_mass=15.0, preload_stiffness=12440.0, std={"moving_mass": 0.01, "preload_stiffness": 10.0})
    channels = ChannelUncertainty(np.full(3, 0.03), np.full(3, 0.02))
    pulls = []
    for seed in range(8):
        added, phasors = _recordings(seed)
        given = {"added_mass": added, "added_mass_std": 1e-4 * added, "channels": channels}
        joint = solve_joint(phasors, rig, 120e3, **given, lines=16)
        names = [(one.source.kind, one.source.of) for one in joint.stated.parameters]
        turn = np.zeros(len(names))
        turn[[names.index((Kind.GAIN, "F1")), names.index((Kind.GAIN, "V1"))]] = 1.0, -1.0
        turn *= joint.problem.shared.std
        found = turn @ joint.solution.z - np.log(1.02 / 0.98)
        pulls.append(found / np.sqrt(turn @ joint.solution.covariance @ turn))
    # four standard deviations of the root mean square of 8 numbers; lines that averaged their scatter would make it 4
    assert np.sqrt(np.mean(np.square(pulls))) < 1.0 + 4.0 / np.sqrt(2 * 8)
