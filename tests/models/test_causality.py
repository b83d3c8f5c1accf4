"""The verdict on data: passive tyres pass on a narrow band, what none can give does not, and the frequency is named."""

import numpy as np
import pytest
from scipy import stats

from fourpole.errors import ModelError
from fourpole.models.causality import check_possible
from fourpole.models.data import StiffnessData
from fourpole.models.fractional import FractionalZener
from fourpole.models.maxwell import GeneralisedMaxwell, Zener
from fourpole.models.springs import KelvinVoigt, Spring
from fourpole.paper1982.models import Structural

pytestmark = pytest.mark.thorough

BAND = 2 * np.pi * np.linspace(10.0, 24.0, 60)
TYRES = {
    "spring": (Spring(), [180e3]),
    "kelvin": (KelvinVoigt(), [180e3, 300.0]),
    "zener": (Zener(), [180e3, 120e3, 700.0]),
    "maxwell": (GeneralisedMaxwell(3), [150e3, 40e3, 60e3, 30e3, 0.3, 0.02, 1e-3]),
    "fractional": (FractionalZener(), [150e3, 400e3, 2e-3, 0.4]),
}


def seen(model, values, omega, noise, rng):
    clean = model.stiffness(values, omega)
    std = noise * np.abs(clean)
    return clean + std * (rng.standard_normal(omega.size) + 1j * rng.standard_normal(omega.size)), std


@pytest.mark.parametrize("noise", [1e-2, 1e-3, 1e-4])
@pytest.mark.parametrize("name", TYRES)
@pytest.mark.sampled(2)
def test_a_passive_tyre_passes_on_a_narrow_band(name, noise):
    """One in a thousand may fail by chance: of 100, three would be one chance in 10^4."""
    rng = np.random.default_rng(1)
    model, values = TYRES[name]
    verdicts = []
    for _ in range(100):
        scaled = np.array(values) * rng.uniform(0.7, 1.4, len(values))
        stiffness, std = seen(model, scaled, BAND, noise, rng)
        verdicts.append(check_possible(StiffnessData.of(BAND, stiffness, std)).possible)
    assert sum(verdicts) >= 98


def test_one_frequency_off_is_named():
    rng = np.random.default_rng(2)
    for _ in range(50):
        stiffness, std = seen(*TYRES["zener"], BAND, 1e-3, rng)
        at = int(rng.integers(60))
        stiffness[at] *= 1.02
        found = check_possible(StiffnessData.of(BAND, stiffness, std))
        assert not found.possible
        assert BAND[at] / (2 * np.pi) in found.impossible


def test_negative_loss_and_a_falling_stiffness_are_impossible():
    stiffness = Zener().stiffness([180e3, 120e3, 700.0], BAND)
    for wrong in (stiffness.conj(), 2 * stiffness[0].real - stiffness.real + 1j * stiffness.imag):
        found = check_possible(StiffnessData.of(BAND, wrong, 100.0))
        assert not found.possible
        assert found.impossible.size > 0


def test_structural_damping_over_decades_is_what_a_passive_tyre_only_nearly_gives():
    """A constant loss factor needs K' to rise: flat over three decades it cannot be, over a few hertz it might."""
    wide = 2 * np.pi * np.geomspace(0.1, 100.0, 60)
    rng = np.random.default_rng(3)
    stiffness, std = seen(Structural(), [180e3, 0.1], wide, 1e-3, rng)
    assert not check_possible(StiffnessData.of(wide, stiffness, std)).possible
    stiffness, std = seen(Structural(), [180e3, 0.05], BAND[:10], 0.02, rng)
    assert check_possible(StiffnessData.of(BAND[:10], stiffness, std)).possible


def test_a_k1_above_the_dynamic_stiffness_is_impossible():
    stiffness, std = seen(*TYRES["zener"], BAND, 1e-3, np.random.default_rng(4))
    for k1, possible in ((180e3, True), (230e3, False)):
        data = StiffnessData.of(BAND, stiffness, std, k1=k1, k1_std=500.0)
        assert check_possible(data).possible is possible


def test_one_condition_at_a_time():
    stiffness = Zener().stiffness([[180e3, 120e3, 700.0]] * 2, BAND)
    with pytest.raises(ModelError, match="one condition at a time"):
        check_possible(StiffnessData.of(BAND, stiffness, 100.0))


@pytest.mark.parametrize("tau", [2.0, 60.0, 1e4])
def test_what_relaxes_too_slowly_to_be_seen_is_no_contradiction_of_k1(tau):
    """An arm of seconds to hours stiffens every frequency of the band by as much, and is gone at rest."""
    omega = 2 * np.pi * np.linspace(10.0, 24.0, 15)
    slow = 60e3 * 1j * omega * tau / (1 + 1j * omega * tau)
    clean = Zener().stiffness([120e3, 120e3, 700.0], omega) + slow
    rng = np.random.default_rng(0)
    for noise in (1e-3, 1e-4):
        std = noise * np.abs(clean)
        seen = clean + std * (rng.standard_normal(15) + 1j * rng.standard_normal(15))
        assert check_possible(StiffnessData.of(omega, seen, std, k1=120e3, k1_std=600.0)).possible


@pytest.mark.parametrize("std", [1e-5, 1e-6, 1e-7])
def test_data_without_noise_are_possible_however_sure_they_are(std):
    """Relaxation times off every grid: they are moved until chi-square is that of round-off."""
    rng = np.random.default_rng(1)
    for low, high, count in ((10.0, 24.0, 10), (1.0, 1000.0, 60)):
        omega = 2 * np.pi * np.geomspace(low, high, count)
        for _ in range(10):
            k2, corner = rng.uniform(5e4, 3e5), 2 * np.pi * np.exp(rng.uniform(np.log(low), np.log(high)))
            clean = Zener().stiffness([180e3, k2, k2 / corner], omega)
            assert check_possible(StiffnessData.of(omega, clean, std * np.abs(clean))).possible


@pytest.mark.parametrize(("at", "wrong"), [(0, 1.02), (14, 0.97), (7, 1.02), (7, np.exp(0.05j))])
def test_the_one_that_is_wrong_is_named_and_no_other(at, wrong):
    omega = 2 * np.pi * np.arange(10.0, 25.0)
    clean = Zener().stiffness([180e3, 120e3, 700.0], omega)
    rng = np.random.default_rng(4)
    std = 1e-3 * np.abs(clean)
    seen = clean + std * (rng.standard_normal(15) + 1j * rng.standard_normal(15))
    seen[at] *= wrong
    found = check_possible(StiffnessData.of(omega, seen, std))
    assert not found.possible
    assert found.impossible.round(6).tolist() == [10.0 + at]


def test_a_k1_that_contradicts_is_told_apart_from_frequencies():
    omega = 2 * np.pi * np.arange(10.0, 25.0)
    clean = Zener().stiffness([180e3, 120e3, 700.0], omega)
    found = check_possible(StiffnessData.of(omega, clean, 1e-3 * np.abs(clean), k1=250e3, k1_std=1e3))
    assert not found.possible
    assert found.without_k1
    assert not found.impossible.size


def gaining(parts):
    """A spring with a negative loss, in standard uncertainties at each frequency: no passive tyre has it."""
    parts = np.asarray(parts, dtype=float)
    omega = 2 * np.pi * np.arange(10.0, 10.0 + parts.size)
    return StiffnessData.of(omega, 180e3 - 100j * parts, 100.0)


@pytest.mark.parametrize(("factor", "possible"), [(0.999, True), (1.001, False)])
def test_the_verdict_turns_at_a_chance_of_one_in_a_thousand(factor, possible):
    """A spring is the best passive tyre then: one term of 40 numbers."""
    limit = float(stats.chi2.isf(1e-3, 39))
    found = check_possible(gaining(np.full(20, np.sqrt(factor * limit / 20))))
    assert found.dof == 39
    assert found.chi2 == pytest.approx(factor * limit, rel=1e-6)
    assert found.possible is possible


def test_of_many_at_fault_those_beyond_three_standard_uncertainties_are_named():
    parts = np.zeros(20)
    parts[:5], parts[5:10] = 3.05 * np.sqrt(2), 2.95 * np.sqrt(2)  # Re is met: half of the squares
    found = check_possible(gaining(parts))
    assert found.far[:10] == pytest.approx([3.05] * 5 + [2.95] * 5, rel=1e-6)
    assert found.impossible.round(6).tolist() == [10.0, 11.0, 12.0, 13.0, 14.0]


@pytest.mark.parametrize(("wrong", "named"), [(3, 3), (4, 5)])
def test_up_to_three_are_named_as_the_fewest_that_are_at_fault(wrong, named):
    """One more is off by 3.2 standard uncertainties: without the worst three it is within chance, beside four not."""
    parts = np.zeros(20)
    parts[:wrong], parts[wrong] = 30.0, 3.2 * np.sqrt(2)
    assert check_possible(gaining(parts)).impossible.size == named
