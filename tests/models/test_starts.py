"""Starts that are near, for every model and many arms, and others that are apart from the first."""

import numpy as np
import pytest

from fourpole.errors import ModelError
from fourpole.models.data import StiffnessData
from fourpole.models.fit import fit
from fourpole.models.fractional import FractionalZener, FractionalZener5
from fourpole.models.interface import Model
from fourpole.models.maxwell import GeneralisedMaxwell, Zener
from fourpole.models.problem import start_of, starts_of
from fourpole.models.springs import KelvinVoigt, Spring
from fourpole.paper1982.models import Gehman, Structural

pytestmark = pytest.mark.thorough

NARROW, WIDE = 2 * np.pi * np.linspace(5.0, 30.0, 28), 2 * np.pi * np.geomspace(0.1, 200.0, 50)
TABLE = Gehman(np.geomspace(0.05, 400.0, 9), np.linspace(90e3, 150e3, 9), np.geomspace(3e3, 80.0, 9))
#: Model, parameters, frequencies, and how far the start may be off K*: round-off of a closed form, else a grid's step.
CASES = {
    "spring": (Spring(), [180e3], NARROW, 1e-12),
    "kelvin": (KelvinVoigt(), [180e3, 300.0], NARROW, 1e-12),
    "structural": (Structural(), [180e3, 0.1], NARROW, 1e-12),
    "table": (TABLE, [180e3], NARROW, 1e-12),
    "zener": (Zener(), [180e3, 120e3, 700.0], NARROW, 1e-8),
    "fractional": (FractionalZener(), [150e3, 400e3, 2e-3, 0.43], WIDE, 0.03),
    "fractional5": (FractionalZener5(), [150e3, 400e3, 2e-3, 0.5, 0.6], WIDE, 0.03),
    "maxwell:1": (GeneralisedMaxwell(1), [150e3, 60e3, 0.02], WIDE, 0.01),
    "maxwell:3": (GeneralisedMaxwell(3), [150e3, 60e3, 80e3, 40e3, 0.2, 0.03, 4e-3], WIDE, 0.01),
}


def drawn(name, count=20):
    rng = np.random.default_rng(0)
    model, base, omega, _ = CASES[name]
    truth = np.array(base) * rng.uniform(0.9, 1.1, (count, len(base)))
    seen = model.stiffness(truth, omega)
    return model, StiffnessData.of(omega, seen, 1e-3 * np.abs(seen))


@pytest.mark.parametrize("name", CASES)
def test_the_start_is_close_to_the_data(name):
    model, data = drawn(name)
    off = model.stiffness(start_of(model, data), data.omega) / data.stiffness - 1
    assert np.sqrt(np.mean(np.abs(off) ** 2, axis=1)).max() < CASES[name][-1]


@pytest.mark.parametrize("name", CASES)
def test_others_are_apart_and_can_be_fitted(name):
    """All within the bounds, no two alike, the first that of start_of, always the same, whatever their number."""
    model, data = drawn(name, count=3)
    several = starts_of(model, data, 9)
    assert several.shape == (9, 3, len(model.parameters))
    np.testing.assert_array_equal(several[0], start_of(model, data))
    np.testing.assert_array_equal(several, starts_of(model, data, 9))
    for one, other in np.argwhere(np.triu(np.ones((9, 9)), 1)):
        assert np.abs(several[one] / several[other] - 1).max() > 1e-3
    for one in several:
        assert np.all(np.isfinite(model.stiffness(model.checked(one), data.omega)))
    logs = [parameter.log for parameter in model.parameters]
    assert np.all(several[..., logs] > 0)


@pytest.mark.parametrize("name", CASES)
def test_each_condition_has_a_start_of_its_own(name):
    """With frequencies of its own, by itself, in a block, or with its covariance written out whole."""
    model, data = drawn(name, count=4)
    together = starts_of(model, data, 3)
    size = 2 * WIDE.size if data.stiffness.shape[-1] == WIDE.size else 2 * NARROW.size
    for at in range(4):
        std = np.repeat(np.sqrt(data.covariance[at, :, 0, 0]), 2)
        whole = StiffnessData.of(data.omega, data.stiffness[at], covariance=np.eye(size) * std**2)
        own = StiffnessData(data.omega, data.stiffness[at], data.covariance[at], data.k1[at], data.k1_std[at])
        np.testing.assert_allclose(starts_of(model, own, 3), together[:, at], rtol=1e-9)
        np.testing.assert_allclose(starts_of(model, whole, 3), together[:, at], rtol=1e-6)
    two_by_two = StiffnessData(
        np.broadcast_to(data.omega, data.stiffness.shape).reshape(2, 2, -1),
        data.stiffness.reshape(2, 2, -1),
        data.covariance.reshape(2, 2, *data.covariance.shape[1:]),
        data.k1.reshape(2, 2),
        data.k1_std.reshape(2, 2),
    )
    np.testing.assert_allclose(starts_of(model, two_by_two, 3).reshape(together.shape), together, rtol=1e-9)


def test_a_known_k1_holds_the_first_spring():
    """Over 5 to 30 Hz the slowest arm could as well be the spring; a static test says how much it is."""
    model = GeneralisedMaxwell(2)
    seen = model.stiffness([150e3, 60e3, 80e3, 5.0, 4e-3], NARROW)
    free = start_of(model, StiffnessData.of(NARROW, seen, 1e-3 * np.abs(seen)))
    held = start_of(model, StiffnessData.of(NARROW, seen, 1e-3 * np.abs(seen), k1=150e3, k1_std=10.0))
    assert abs(free[0] / 150e3 - 1) > 0.1
    assert held[0] == pytest.approx(150e3, rel=1e-3)


def test_an_uncertain_frequency_does_not_lead_astray():
    seen = CASES["maxwell:3"][0].stiffness(CASES["maxwell:3"][1], WIDE)
    clean = seen.copy()
    seen[25] *= 3.0
    std = 1e-3 * np.abs(clean)
    std[25] = 3 * np.abs(clean[25])
    for model in (GeneralisedMaxwell(3), FractionalZener()):
        values = start_of(model, StiffnessData.of(WIDE, seen, std))
        best = start_of(model, StiffnessData.of(WIDE, clean, 1e-3 * np.abs(clean)))
        np.testing.assert_allclose(model.stiffness(values, WIDE), model.stiffness(best, WIDE), rtol=0.02)


@pytest.mark.parametrize("arms", [5, 12, 27, 60])
@pytest.mark.sampled(2)
def test_many_arms_over_many_decades(arms):
    """A polymer over 24 decades, the noise 1 %: no worse than arms spread evenly, and at 27 arms all but noise."""
    rng = np.random.default_rng(3)
    omega = 2 * np.pi * np.geomspace(1e-12, 1e12, 200)
    times = np.geomspace(1e-14, 1e14, 400)
    spectrum = 30.0 * np.exp(-(((np.log10(times) + 3) / 6) ** 2)) + 5.0 * np.exp(-(((np.log10(times) - 5) / 2) ** 2))
    clean = 20.0 + (1 - 1 / (1 + 1j * omega[:, None] * times)) @ spectrum
    std = 0.01 * np.abs(clean)
    seen = clean + std * (rng.standard_normal(200) + 1j * rng.standard_normal(200))
    data, model = StiffnessData.of(omega, seen, std), GeneralisedMaxwell(arms)
    start = start_of(model, data)
    assert np.all(np.diff(start[1 + arms :]) < 0)  # the slowest first
    even = np.concatenate([start[: 1 + arms], np.geomspace(1 / omega[0], 1 / omega[-1], arms)])
    chi2 = [float(fit(model, data, one).chi2) for one in (start, even)]
    assert chi2[0] <= chi2[1] * (1 + 1e-3)
    if arms >= 27:
        # 400 data: chi-square is 400 less what is free, give or take three times sqrt(800)
        assert chi2[0] < 400 + 3 * np.sqrt(800)


def test_a_scale_of_its_own():
    """Moduli in any unit, times of any size: the start turns with them."""
    model, data = drawn("maxwell:3", count=2)
    plain = start_of(model, data)
    scaled = StiffnessData.of(data.omega * 1e9, data.stiffness * 1e-12, 1e-15 * np.abs(data.stiffness))
    expected = np.concatenate([plain[:, :4] * 1e-12, plain[:, 4:] * 1e-9], axis=1)
    np.testing.assert_allclose(start_of(model, scaled), expected, rtol=1e-6)


class Unknown(Model):
    name = "unknown"
    parameters = Spring.parameters
    stiffness = Spring.stiffness
    derivative = Spring.derivative
    static_stiffness = Spring.static_stiffness


def test_a_model_without_a_start_is_told():
    data = StiffnessData.of(NARROW, np.full(NARROW.shape, 1e5 + 0j), 1.0)
    with pytest.raises(ModelError, match="the unknown model has no start values: state them"):
        start_of(Unknown(), data)
