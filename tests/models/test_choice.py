"""Which model: the family that made the data, or the word that it cannot be told."""

import numpy as np
import pytest

from fourpole.errors import ModelError
from fourpole.models.choice import AUTO, choose
from fourpole.models.data import StiffnessData
from fourpole.models.families import model_named

NARROW, WIDE = 2 * np.pi * np.linspace(5.0, 30.0, 20), 2 * np.pi * np.geomspace(0.1, 200.0, 30)
TRUTHS = {
    "spring": ([180e3], NARROW),
    "kelvin": ([180e3, 300.0], NARROW),
    "zener": ([180e3, 120e3, 700.0], NARROW),
    "fractional": ([150e3, 400e3, 2e-3, 0.4], WIDE),
    "maxwell:2": ([150e3, 60e3, 80e3, 0.2, 4e-3], WIDE),
}


@pytest.mark.statistical
@pytest.mark.parametrize("name", TRUTHS)
def test_the_true_family_is_chosen_or_said_to_be_alike(name):
    """Of 12 draws at most one may miss: BIC's odds are better than 20 to 1."""
    rng = np.random.default_rng(0)
    base, omega = TRUTHS[name]
    right = 0
    for _ in range(12):
        model = model_named(name)
        clean = model.stiffness(np.array(base) * rng.uniform(0.85, 1.15, len(base)), omega)
        std = 1e-3 * np.abs(clean)
        seen = clean + std * (rng.standard_normal(clean.shape) + 1j * rng.standard_normal(clean.shape))
        choice = choose(StiffnessData.of(omega, seen, std))
        right += choice.best.name == name or name in choice.alike
        assert choice.best.left_out < 2.0
    assert right >= 11


def test_data_too_poor_to_tell_say_so():
    """Two per cent of noise over 10 to 14 Hz: a damper beside the spring, or in series with another."""
    omega = 2 * np.pi * np.linspace(10.0, 14.0, 5)
    clean = model_named("zener").stiffness([180e3, 120e3, 700.0], omega)
    rng = np.random.default_rng(1)
    std = 0.02 * np.abs(clean)
    seen = clean + std * (rng.standard_normal(5) + 1j * rng.standard_normal(5))
    choice = choose(StiffnessData.of(omega, seen, std), [*AUTO, "maxwell:5"])
    assert choice.alike
    assert "cannot tell" in choice.text
    assert {name for name, _ in choice.passed} == {"maxwell:5"}


def test_a_special_case_is_chosen_and_what_has_it_is_not_excluded():
    """A fractional tyre of order 0.98 seen with 1 % of noise: a Zener will do, and the data cannot tell."""
    clean = model_named("fractional").stiffness([180e3, 300e3, 6e-3, 0.98], NARROW)
    rng = np.random.default_rng(2)
    std = 0.01 * np.abs(clean)
    choice = choose(
        StiffnessData.of(NARROW, clean + std * (rng.standard_normal(20) + 1j * rng.standard_normal(20)), std)
    )
    assert choice.best.name == "zener"
    assert "fractional" in choice.unneeded
    assert "cannot tell it from fractional" in choice.text
    assert "special case" in choice.text


def test_a_model_that_does_not_fit_is_not_praised():
    clean = model_named("zener").stiffness([180e3, 120e3, 700.0], NARROW)
    choice = choose(StiffnessData.of(NARROW, clean, 50.0), ["spring", "kelvin"])
    assert "does not fit" in choice.text


@pytest.mark.parametrize("name", ["maxwel", "maxwell", "maxwell:x", "maxwell:0", "maxwell:61", ""])
def test_names_that_are_none(name):
    with pytest.raises(ModelError):
        model_named(name)
