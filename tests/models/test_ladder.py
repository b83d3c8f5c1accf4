"""The ladder of verdicts: relaxing, with a mass, with resonances, none of these; errors of a laboratory beside it.

The specimens are made by forces and motions of their parts, not by the terms that the ladder adds up.
"""

import numpy as np
import pytest

from fourpole.models.data import StiffnessData
from fourpole.models.ladder import Rung, verdict_of, without_inertia

NOISE = 0.003


def zener(w):
    return 180e3 + 1j * w * 700 * 120e3 / (120e3 + 1j * w * 700)


def fractional(w):
    return 2e5 * (1j * w / 60) ** 0.06


def hydromount(w, fluid=60.0, loss=250.0, bulge=1.5e5):
    """Rubber beside a chamber whose fluid swings in an inertia track."""
    track = -(w**2) * fluid + 1j * w * loss
    return fractional(w) + bulge * track / (bulge + track)


def belted(w, belt=7.0):
    """A belt between the springs of rim and contact, driven at the contact with the rim held."""
    return 1 / (1 / (6 * fractional(w)) + 1 / (1.75 * fractional(w) - w**2 * belt))


def viscous(w, belt=7.0):
    return 1 / (1 / (1.2e6 + 60j * w) + 1 / (3.5e5 + 60j * w - w**2 * belt))


def drawn(specimen, low, high, count, seed, noise=NOISE):
    w = 2 * np.pi * np.linspace(low, high, count)
    rng = np.random.default_rng([9, seed])
    true = specimen(w)
    std = noise * np.abs(true)
    return StiffnessData.of(w, true + std * (rng.normal(size=count) + 1j * rng.normal(size=count)), std)


@pytest.mark.parametrize("specimen", [zener, fractional])
@pytest.mark.sampled(2)
def test_a_relaxing_specimen_is_told_of_nothing_else(specimen):
    """400 draws of each in a trial: none told of a mass, a resonance or more; 50 here, of which one may be (3 %)."""
    found = [verdict_of(drawn(specimen, 8, 24, 12, seed)).holds for seed in range(50)]
    assert sum(one is not Rung.RELAXING for one in found) <= 1


@pytest.mark.parametrize("mass", [1.0, 2.0])
@pytest.mark.sampled(2)
def test_a_plate_that_nobody_stated_is_named_with_its_mass(mass):
    found = [verdict_of(drawn(lambda w: zener(w) - w**2 * mass, 8, 24, 12, seed)) for seed in range(20)]
    named = [one for one in found if one.holds is Rung.MASS]
    assert len(named) >= 18
    off = np.array([(one.mass - mass) / one.mass_std for one in named])
    assert np.sum(np.abs(off) > 1.96) <= 4  # 99.7 % of trials with 5 % outside


@pytest.mark.parametrize(
    ("specimen", "high", "count", "hertz"),
    [(hydromount, 30, 25, np.sqrt(1.5e5 / 60) / 2 / np.pi), (belted, 120, 30, 75.0), (viscous, 120, 30, 75.0)],
)
@pytest.mark.sampled(6)
def test_a_resonance_is_named_with_its_frequency(specimen, high, count, hertz):
    found = [verdict_of(drawn(specimen, 1 if specimen is hydromount else 5, high, count, seed)) for seed in range(5)]
    assert [one.holds for one in found].count(Rung.RESONANT) >= 4
    nearest = [np.min(np.abs(one.resonances - hertz)) for one in found if one.holds is Rung.RESONANT]
    assert max(nearest) < 0.05 * hertz


@pytest.mark.parametrize("noise", [0.001, 0.005])
@pytest.mark.sampled(2)
def test_two_resonances_are_named_however_small_the_noise(noise):
    """With one of them, chi-square is a thousand degrees of freedom or more."""

    def twice(w):
        return hydromount(w, fluid=47.0, loss=800.0) + hydromount(w, fluid=4.2, loss=250.0, bulge=1.2e5)

    found = verdict_of(drawn(twice, 2, 50, 30, 3, noise))
    assert found.holds is Rung.RESONANT
    np.testing.assert_allclose(np.sort(found.resonances), np.sqrt([1.5e5 / 47, 1.2e5 / 4.2]) / 2 / np.pi, rtol=0.02)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.sampled(3)
def test_one_wrong_row_is_no_resonance_and_is_named(seed):
    """Ten standard uncertainties at one frequency, which a sharp resonance would explain."""
    data = drawn(fractional, 8, 24, 12, seed)
    k = data.stiffness.copy()
    k[5] *= 1 + 10 * NOISE
    found = verdict_of(StiffnessData.of(data.omega, k, NOISE * np.abs(k)))
    assert found.holds is Rung.NONE
    np.testing.assert_allclose(found.relaxing.impossible, data.omega[5] / 2 / np.pi)


def test_a_sharp_resonance_in_a_few_rows_is_one():
    sharp = drawn(lambda w: hydromount(w, loss=120.0), 5, 15, 25, 0)
    found = verdict_of(sharp)
    assert found.holds is Rung.RESONANT
    np.testing.assert_allclose(found.resonances, np.sqrt(1.5e5 / 60) / 2 / np.pi, rtol=0.01)


@pytest.mark.parametrize("late", [-1e-3, -2e-3])
@pytest.mark.sampled(2)
def test_an_early_v1_is_no_inertia_and_is_named(late):
    for seed in range(5):
        found = verdict_of(drawn(lambda w: fractional(w) * np.exp(1j * w * late), 8, 24, 12, seed))
        assert found.holds is Rung.NONE
        assert found.lies[0].name == "delay"
        assert 1.1 * late < found.lies[0].size < 0.3 * late  # the smallest that is enough


def test_a_specimen_that_gives_energy_is_none_of_these():
    found = verdict_of(drawn(lambda w: zener(w).conj(), 8, 24, 12, 0))
    assert found.holds is Rung.NONE
    assert not found.possible


def test_a_few_frequencies_are_offered_no_resonance():
    assert verdict_of(drawn(hydromount, 1, 30, 9, 0)).holds is not Rung.RESONANT


def test_a_mass_is_taken_off_with_its_uncertainty_in_common():
    data = drawn(lambda w: fractional(w) - w**2, 8, 24, 12, 1)
    found = verdict_of(data)
    rest = without_inertia(data, found)
    np.testing.assert_allclose(rest.stiffness, data.stiffness + data.omega**2 * found.mass)
    more = rest.covariance[::2, ::2] - np.diag(data.covariance[:, 0, 0])
    np.testing.assert_allclose(more, np.outer(data.omega, data.omega) ** 2 * found.mass_std**2, rtol=1e-6)
    assert verdict_of(rest).holds is Rung.RELAXING
