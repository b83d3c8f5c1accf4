"""A blocking mass in place of a force cell: K* of two motions, with auxiliary springs that nobody stated."""

import numpy as np
import pytest

from fourpole.core import blocking
from fourpole.core.alone import Alone
from fourpole.core.blocking import blocking_checks, least_springs, shown_springs, steep_checks, with_unstated_springs
from fourpole.core.channelerrors import ChannelUncertainty
from fourpole.core.checks import Difficulty, Steep, Verdict
from fourpole.core.identify import identify, variance_by_source
from fourpole.core.phasor import Phasors
from fourpole.core.recording import Channel, Recording
from fourpole.core.rig import Rig
from fourpole.core.spectra.random import random_amplitudes
from fourpole.core.spectra.sweep import sweep_amplitudes
from fourpole.words import remark_of

MASS = 12.5
STIFFNESS = 180e3 * (1 + 0.15j)
RESONANCE = np.sqrt(180e3 / MASS) / (2 * np.pi)


def motions(frequency, spring=0.0, damper=0.0):
    """V2 over V1 of the mass on the specimen and on its springs, by Newton's law."""
    omega = 2 * np.pi * np.asarray(frequency)
    ratio = STIFFNESS / (STIFFNESS + spring + 1j * omega * damper - MASS * omega**2)
    amplitudes = np.stack([np.full(omega.shape, np.nan), np.ones(omega.shape), ratio], axis=1)
    count = omega.size
    return Phasors(np.asarray(frequency), amplitudes, np.zeros((count, 6, 6)), np.zeros(count), np.zeros(count))


def judged(frequency, rig=None, gain=0.0, **true):
    """K* relative to the true one, its relative u, and the checks, with springs that nobody stated."""
    phasors = motions(np.asarray(frequency, dtype=float), **true)
    if rig is None:
        same = np.zeros(phasors.frequency.size, dtype=int)
        rig = with_unstated_springs(Rig(moving_mass=MASS), phasors, 0.0 * same, same)
    stated = {"route": "transmissibility", "channels": ChannelUncertainty(gain=np.array([0.0, gain, gain]))}
    found = identify(phasors, rig, **stated)
    u = np.sqrt(np.trace(found.stiffness_covariance, axis1=1, axis2=2)) / np.abs(found.stiffness)
    variance = variance_by_source(phasors, rig, **stated)
    added, family = np.zeros(u.size), np.zeros(u.size, dtype=int)
    return found.stiffness / STIFFNESS, u, blocking_checks(phasors, rig, found, variance, added, family)


def test_u_of_unstated_springs_is_that_of_a_spring_as_stiff_as_the_specimen():
    frequency = RESONANCE * np.array([3.0, 6.0, 12.0])
    off, u, _ = judged(frequency)
    assert off == pytest.approx(1.0, rel=1e-9)
    size = abs(STIFFNESS) / (MASS * (2 * np.pi * frequency) ** 2)
    damper = 0.02 * 2 * np.sqrt(abs(STIFFNESS) / np.sqrt(3) * MASS) / (MASS * 2 * np.pi * frequency)
    assert u == pytest.approx(np.sqrt(size**2 / 3 + damper**2), rel=1e-6)


@pytest.mark.parametrize("share", [0.0, 0.05, 0.3, 0.6, 1.0, 2.0, 5.0])
def test_no_verdict_is_ok_where_springs_change_k_by_more_than_a_decibel_or_by_more_than_u(share):
    frequency = RESONANCE * np.geomspace(0.1, 20.0, 60)
    off, u, checks = judged(frequency, spring=share * 180e3, damper=20.0)
    ok = np.array([check.verdict is Verdict.OK for check in checks])
    assert np.abs(off[ok] - 1.0).max() < 0.122
    assert np.all(np.abs(off[ok] - 1.0) < 2 * u[ok])
    assert share > 1.0 or ok[frequency > 6 * RESONANCE].all()


def steep(law, frequency, seen=lambda frequency: 1.0, scatter=0.0, noise=0.0, moved=1.0):
    """Tests with a warning that K' contradicts K* at lower frequencies; V2 is `seen` times that of the rigid mass."""
    omega, rng = 2 * np.pi * frequency, np.random.default_rng(4)
    phasors, count = motions(frequency), frequency.size
    stiffness = law(omega) * (1 + scatter * rng.standard_normal(count))
    ratio = stiffness / (stiffness + 8e3 + 30j * omega - MASS * omega**2) * seen(frequency)
    drive = moved * omega / np.abs(1 - ratio)
    errors = noise * (rng.standard_normal(count) + 1j * rng.standard_normal(count))
    phasors.amplitudes[:, 1], phasors.amplitudes[:, 2] = drive, drive * ratio * (1 + errors)
    phasors.covariance[:, 4, 4] = phasors.covariance[:, 5, 5] = (noise * np.abs(drive * ratio)) ** 2
    same = np.zeros(count, dtype=int)
    rig = with_unstated_springs(Rig(moving_mass=MASS, std={"moving_mass": 0.25}), phasors, 0.0 * same, same)
    sensors = ChannelUncertainty(gain=np.array([0.0, 0.01, 0.01]), phase=np.array([0.0, 0.009, 0.009]))
    return steep_checks(phasors, identify(phasors, rig, route="transmissibility", channels=sensors), same)


RELAXING = {
    "constant": lambda omega: STIFFNESS + 0 * omega,
    "fractional": lambda omega: 180e3 * (1 + 0.35 * (2e-3j * omega) ** 0.25),
    "dashpot": lambda omega: 180e3 + 120j * omega,
    "one arm": lambda omega: 120e3 + 1 / (1 / 120e3 + 1 / (700j * omega)),
}


@pytest.mark.parametrize("law", RELAXING.values(), ids=RELAXING)
@pytest.mark.parametrize("spring", [0.0, 8e3, 400e3])
def test_springs_stiffer_than_the_specimen_show_and_nothing_else_does(law, spring):
    frequency = np.geomspace(25.0, 320.0, 14)
    omega, rng = 2 * np.pi * frequency, np.random.default_rng(2)
    for scatter in (0.0, 0.01):
        stiffness = law(omega) * (1 + scatter * rng.standard_normal(omega.size))
        phasors = motions(frequency)
        phasors.amplitudes[:, 2] = 1.02 * stiffness / (stiffness + spring + 30j * omega - MASS * omega**2)
        found = shown_springs(Rig(moving_mass=MASS), phasors, np.zeros(14), np.zeros(14, dtype=int))
        if spring < 1e5:
            assert found == 0.0
        elif not scatter:
            assert 0.5 * spring < found < 1.1 * spring


@pytest.mark.parametrize("law", RELAXING.values(), ids=RELAXING)
@pytest.mark.parametrize("frequency", [np.geomspace(20.0, 350.0, 14), np.geomspace(20.0, 320.0, 5)])
def test_no_relaxing_specimen_is_steep(law, frequency):
    assert steep(law, frequency) == {}
    assert steep(law, frequency, scatter=0.005) == {}


@pytest.mark.parametrize("noise", [0.003, 0.05])
def test_noise_of_many_lines_is_no_contradiction(noise):
    assert steep(RELAXING["fractional"], np.linspace(60.0, 350.0, 400), noise=noise) == {}


@pytest.mark.parametrize("turn", [1, -1])
def test_a_mass_that_bends_is_told_from_some_1_db_on(turn):
    """A sensor beyond the bending moves more than the foot of the mass, one between them less."""
    frequency = np.geomspace(20.0, 350.0, 60)
    found = steep(RELAXING["fractional"], frequency, seen=lambda f: (1 - (f / 600.0) ** 2) ** -turn)
    assert set(found) == set(range(min(found), 60))
    first = (1 - (frequency[min(found)] / 600.0) ** 2) ** -turn
    assert 0.06 < abs(first - 1.0) < 0.25
    check = found[59]
    assert check.values["steep"] is (Steep.RISES if turn == 1 else Steep.FALLS)
    assert check.verdict is Verdict.WARNING


def test_tests_of_another_deflection_or_more_than_an_octave_apart_are_not_compared():
    bends = lambda f: 1 / (1 - (f / 500.0) ** 2)  # noqa: E731
    frequency = np.array([40.0, 79.0, 157.0, 312.0])
    assert set(steep(RELAXING["fractional"], frequency, seen=bends)) == {3}
    assert steep(RELAXING["fractional"], frequency, seen=bends, moved=np.array([1.0, 2.1, 4.5, 9.1])) == {}
    assert set(steep(RELAXING["fractional"], frequency, seen=bends, moved=np.array([1.0, 1.9, 3.6, 6.8]))) == {3}
    assert steep(RELAXING["fractional"], np.array([40.0, 79.0, 150.0, 312.0]), seen=bends) == {}


def test_springs_are_told_where_they_show():
    _, _, checks = judged(RESONANCE * np.array([3.0, 4.0, 5.0, 6.0, 8.0, 12.0]), spring=900e3)
    assert checks[3].values["difficulty"] is Difficulty.SHOWN_SPRINGS
    assert checks[3].values["spring"] == pytest.approx(900e3, rel=0.1)
    assert "kN/m of them or more" in remark_of(checks[3])


@pytest.mark.parametrize(("count", "known"), [(3, False), (4, True)])
def test_four_tests_show_springs(count, known):
    inertia = 1e6 * np.arange(1.0, count + 1)
    spring, _ = least_springs(1e5 / (1 - 5e3 / inertia), inertia, np.zeros(count, dtype=int), np.zeros(count))
    assert np.isfinite(spring) == known


@pytest.mark.parametrize(("times", "found"), [(3.9, 0.0), (4.1, 4.1)])
def test_springs_of_four_standard_uncertainties_are_told(monkeypatch, times, found):
    monkeypatch.setattr(blocking, "least_springs", lambda *given: (times, 1.0))
    assert shown_springs(Rig(moving_mass=MASS), motions([40.0]), np.zeros(1), np.zeros(1)) == found


def test_springs_are_those_of_all_specimens_of_a_rig():
    inertia = np.tile(np.geomspace(4e5, 4e6, 6), 2)
    storage = np.repeat([1e5, 2.5e5], 6) / (1 - 3e4 / inertia)
    spring, std = least_springs(storage, inertia, np.repeat([3, 8], 6), np.zeros(12))
    assert spring == pytest.approx(3e4, rel=1e-9)
    (row,) = [1 / 5e-3]  # u by least squares, by hand: of the slope over 1/(m w²) within each family
    weak = 1 / inertia.reshape(2, 6)
    ratio = 1 / storage.reshape(2, 6)
    left = weak - ratio * (np.sum(weak * ratio, axis=1) / np.sum(ratio**2, axis=1))[:, None]
    assert std == pytest.approx(1 / (row * np.linalg.norm(left)), rel=1e-6)


def test_the_limit_is_that_of_the_standard_which_asks_for_20_db():
    """The mass moves by about a tenth of the input where m w² is 9.5 |K*|: there U is 1 dB."""
    frequency = np.sqrt(abs(STIFFNESS) / np.sqrt(3) / (MASS * 0.0610)) / (2 * np.pi)
    _, _, checks = judged(frequency * np.array([0.98, 1.02]))
    assert [check.verdict for check in checks] == [Verdict.WARNING, Verdict.OK]
    assert checks[0].values["difficulty"] is Difficulty.UNSTATED_SPRINGS
    assert checks[0].values["ratio"] == pytest.approx(0.12, rel=0.05)
    assert checks[0].values["enough"] == pytest.approx(frequency, rel=0.02)


def test_at_the_resonance_and_below_it_nothing_is_ok():
    _, _, checks = judged(RESONANCE * np.array([0.1, 0.5, 1.0, 1.2, 2.0]), spring=9e3)
    assert [check.verdict for check in checks] == [*3 * [Verdict.REJECTED], *2 * [Verdict.WARNING]]


def test_stated_springs_make_it_right_and_below_the_resonance_the_difference_of_the_motions_decides():
    frequency, rig = RESONANCE * np.array([0.15, 0.4, 1.0, 3.0]), Rig(moving_mass=MASS, preload_stiffness=9e3)
    off, _, checks = judged(frequency, rig, gain=0.01, spring=9e3)
    assert off == pytest.approx(1.0, rel=1e-9)
    assert [check.verdict for check in checks] == [Verdict.REJECTED, Verdict.WARNING, Verdict.OK, Verdict.OK]
    assert checks[0].values["difficulty"] is Difficulty.ALIKE


def test_an_uncertain_stated_spring_and_another_source_are_named():
    loose = Rig(moving_mass=MASS, preload_stiffness=9e3, std={"preload_stiffness": 5e3})
    (springs,) = judged([10.0], loose, spring=9e3)[2]
    assert springs.values["difficulty"] is Difficulty.SPRINGS
    for std, verdict in ((3.7, Verdict.OK), (3.8, Verdict.WARNING), (6.3, Verdict.REJECTED)):
        heavy = Rig(moving_mass=MASS, preload_stiffness=9e3, std={"moving_mass": std})
        (mass,) = judged([100.0], heavy, spring=9e3)[2]
        assert mass.verdict is verdict
    assert (mass.values["difficulty"], mass.values["source"]) == (Difficulty.SOURCE, "moving_mass")


def test_each_test_by_itself_has_k_without_a_force():
    phasors = motions([40.0, 80.0], spring=9e3)
    alone = Alone.of(phasors, 2 * [Rig(moving_mass=MASS, preload_stiffness=9e3)], np.zeros(2))
    assert alone.stiffness == pytest.approx(STIFFNESS, rel=1e-9)
    assert alone.lever == pytest.approx(1 / (1 - phasors.amplitudes[:, 2]))


@pytest.mark.parametrize(("kind", "amplitudes"), [("random", random_amplitudes), ("sweep", sweep_amplitudes)])
def test_random_excitation_and_sweeps_without_a_force(kind, amplitudes):
    """V2/V1 is that of the mass within its uncertainty, at all lines; what needs F1 is not-a-number."""
    rate, seconds, rng = 1024.0, 64.0, np.random.default_rng(5)
    size = int(rate * seconds)
    lines = np.fft.rfftfreq(size, 1 / rate)
    time = np.arange(size) / rate
    drive = rng.standard_normal(size)
    if kind == "sweep":
        drive = np.sin(2 * np.pi * (8.0 * time + 96.0 * time**2 / seconds)) * np.minimum(1.0, 0.5 * (seconds - time))
    spectrum = np.fft.rfft(drive)
    spectrum[(lines < 6.0) | (lines > 220.0)] = 0.0
    spectrum[1:] *= 1 / (2j * np.pi * lines[1:])
    moved = np.zeros(lines.size, dtype=complex)
    moved[1:] = motions(lines[1:], spring=9e3, damper=40.0).amplitudes[:, 2]
    near, far = (np.fft.irfft(part, size) for part in (spectrum, spectrum * moved))
    noisy = [part + 2e-3 * near.std() * rng.standard_normal(size) for part in (near, far)]
    channels = {
        role: Channel(samples, "velocity", rate)
        for role, samples in zip(("motion_in", "motion_out"), noisy, strict=True)
    }
    found = amplitudes(Recording(rate, channels), (12.0, 180.0))
    force, v1, v2 = found.phasors.amplitudes.T
    assert np.isnan(force).all()
    assert np.isnan(found.estimates).all()
    true = motions(found.phasors.frequency, spring=9e3, damper=40.0).amplitudes[:, 2]
    pull = np.abs(np.log(v2 / v1 / true)) / (np.sqrt(2) * found.relative[:, 1])
    assert np.isnan(found.relative[:, 0]).all()
    assert np.sqrt(np.mean(pull**2)) < 1.6
    assert np.quantile(found.relative[:, 1], 0.9) < 0.1
    inside = (lines >= 12.0) & (lines <= 180.0)
    across = np.zeros(lines.size, dtype=complex)
    across[inside] = (spectrum * (1 - moved))[inside] / (2j * np.pi * lines[inside])
    assert found.deflection == pytest.approx(np.sqrt(2) * np.fft.irfft(across, size).std(), rel=0.05)
