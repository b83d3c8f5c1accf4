"""Models with resonances against networks of springs, dampers and masses that are solved by hand."""

import numpy as np
import pytest

from fourpole.errors import ModelError
from fourpole.models.choice import choose
from fourpole.models.data import StiffnessData
from fourpole.models.families import model_named
from fourpole.models.realised import realised
from fourpole.models.resonant import Resonant

#: Two resonances and two arms: K_inf, springs, times; then f, zeta, C_a, C_b, E of each.
VALUES = np.array([2e5, 3e4, 5e4, 0.05, 0.004, 12.0, 0.1, 30.0, 80.0, 5e4, 40.0, 0.05, 10.0, 5.0, 2e5])
OMEGA = 2 * np.pi * np.geomspace(1.0, 100.0, 40)


def track(w, fluid=60.0, loss=250.0, bulge=1.5e5):
    """Rubber beside a chamber whose fluid swings in an inertia track."""
    inner = -(w**2) * fluid + 1j * w * loss
    return 2e5 * (1j * w / 60) ** 0.06 + bulge * inner / (bulge + inner)


def test_derivatives_are_those_of_differences():
    model = Resonant(2, arms=2)
    slopes = model.derivative(VALUES, OMEGA)
    for at, value in enumerate(VALUES):
        step = np.zeros(VALUES.size)
        step[at] = 1e-6 * value
        by = (model.stiffness(VALUES + step, OMEGA) - model.stiffness(VALUES - step, OMEGA)) / (2 * step[at])
        np.testing.assert_allclose(slopes[:, at], by, atol=1e-7 * np.abs(by).max())


def test_every_set_of_parameters_is_passive_and_the_least_middle_factor_just_so():
    rng = np.random.default_rng(4)
    model, omega = Resonant(1), np.geomspace(1e-2, 1e4, 4000)
    for _ in range(50):
        f, zeta, above, below = np.exp(rng.uniform(np.log([1, 0.005, 1, 1]), np.log([100, 2, 1e3, 1e3])))
        values = [0.0, 0.0, 1.0, f, zeta, above, below, 0.0]
        real = model.stiffness(values, omega).imag / omega
        assert real.min() > -1e-9 * max(above, below)
        assert real.min() < 0.02 * max(above, below)  # it touches zero between two of the frequencies
        assert np.all(model.stiffness([*values[:-1], 1e4], omega).imag >= 0)


def test_a_mass_between_a_spring_and_a_damper_is_one_resonance():
    s = 1j * OMEGA
    driven = 2e5 + 1 / (1 / 150e3 + 1 / (60 * s**2 + 600 * s))
    np.testing.assert_allclose(
        Resonant(1).stiffness([2e5, 0.0, 1.0, 25 / np.pi, 0.1, 0.0, 600.0, 0.0], OMEGA), driven, rtol=1e-12
    )


def test_its_state_space_and_its_separate_states_have_its_stiffness():
    model = Resonant(2, arms=2)
    exact = model.stiffness(VALUES, OMEGA)
    np.testing.assert_allclose(model.state_space(VALUES).stiffness(OMEGA), exact, rtol=1e-12)
    np.testing.assert_allclose(realised(model, VALUES, (1.0, 100.0)).stiffness(OMEGA), exact, rtol=1e-9)


def test_a_hydromount_is_fitted_within_its_noise():
    omega = 2 * np.pi * np.linspace(1.0, 30.0, 25)
    truth, rng = track(omega), np.random.default_rng(3)
    std = 0.003 * np.abs(truth)
    data = StiffnessData.of(omega, truth + std * (rng.normal(size=25) + 1j * rng.normal(size=25)), std)
    best = choose(data, ("resonant:1",)).best
    assert best.chance > 0.01
    found = dict(zip(best.fit.model.symbols, zip(best.fit.values, best.fit.std, strict=True), strict=True))
    natural, std_natural = found["f_1"]
    assert abs(natural - np.sqrt(1.5e5 / 60) / (2 * np.pi)) < 4 * std_natural < 0.05
    between = (omega[1:] + omega[:-1]) / 2
    off = best.fit.model.stiffness(best.fit.values, between) / track(between) - 1
    assert np.sqrt(np.mean(np.abs(off) ** 2)) < 0.003


def test_sizes_and_numbers_of_parameters_that_are_none_are_refused():
    assert model_named("resonant:2").with_parameters(15).name == "resonant:2"
    for count in (12, 14):
        with pytest.raises(ModelError, match=f"no {count} parameters"):
            model_named("resonant:2").with_parameters(count)
    with pytest.raises(ModelError, match="1 to 3 resonances, not 4"):
        model_named("resonant:4")
