"""The verdict on data: passive tyres pass on a narrow band, what none can give does not, and the frequency is named."""

import numpy as np
import pytest

from fourpole.errors import ModelError
from fourpole.models.causality import check_possible
from fourpole.models.data import StiffnessData
from fourpole.models.fractional import FractionalZener
from fourpole.models.maxwell import GeneralisedMaxwell, Zener
from fourpole.models.springs import KelvinVoigt, Spring, Structural

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
