"""Every model: its derivatives, its ends, causality and passivity, and itself in time."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fourpole.core.tyre import zener_stiffness
from fourpole.errors import ModelError
from fourpole.models.fractional import FractionalZener, FractionalZener5, rational
from fourpole.models.interface import StateSpace
from fourpole.models.maxwell import GeneralisedMaxwell, Zener
from fourpole.models.springs import KelvinVoigt, Spring
from fourpole.models.step import simulate
from fourpole.paper1982.models import Gehman, Structural

OMEGA = 2 * np.pi * np.geomspace(0.1, 300.0, 25)
TABLE = Gehman(np.geomspace(0.05, 400.0, 9), np.linspace(90e3, 150e3, 9), np.geomspace(3e3, 80.0, 9))
MODELS = {
    "spring": (Spring(), [180e3]),
    "kelvin": (KelvinVoigt(), [180e3, 300.0]),
    "structural": (Structural(), [180e3, 0.1]),
    "zener": (Zener(), [180e3, 120e3, 700.0]),
    "maxwell": (GeneralisedMaxwell(3), [150e3, 40e3, 60e3, 30e3, 0.3, 0.02, 1e-3]),
    "maxwell:5": (GeneralisedMaxwell(5), [150e3, 40e3, 60e3, 30e3, 20e3, 10e3, 0.3, 0.05, 0.02, 5e-3, 1e-3]),
    "fractional": (FractionalZener(), [150e3, 400e3, 2e-3, 0.4]),
    "fractional5": (FractionalZener5(), [150e3, 400e3, 2e-3, 0.4, 0.7]),
    "table": (TABLE, [180e3]),
}


@pytest.mark.parametrize("name", MODELS)
def test_derivatives_are_those_of_the_stiffness(name):
    """Against complex steps where the model takes them, here central differences: 1e-6 steps, errors of 1e-9."""
    model, values = MODELS[name]
    found = model.derivative(values, OMEGA)
    assert found.shape == (OMEGA.size, len(values))
    for at, value in enumerate(values):
        step = 1e-5 * value
        moved = np.array([values, values])
        moved[:, at] += [step, -step]
        above, below = model.stiffness(moved, OMEGA)
        expected = (above - below) / (2 * step)
        size = np.abs(model.stiffness(values, OMEGA)) / value
        assert np.abs(found[:, at] - expected).max() < 1e-8 * size.max()


@pytest.mark.parametrize("name", MODELS)
def test_many_sets_at_once_are_each_by_itself(name):
    model, values = MODELS[name]
    scales = np.array([[0.9], [1.0], [0.95]])
    sets = np.array(values) * scales
    together = model.stiffness(sets, OMEGA)
    assert together.shape == (3, OMEGA.size)
    for row, one in zip(together, sets, strict=True):
        np.testing.assert_array_equal(row, model.stiffness(one, OMEGA))
    np.testing.assert_array_equal(model.derivative(sets, OMEGA)[1], model.derivative(values, OMEGA))
    assert model.static_stiffness(sets).shape == (3,)


@pytest.mark.parametrize("name", [name for name in MODELS if name not in ("structural", "table")])
def test_at_rest_it_is_its_static_stiffness_and_always_passive(name):
    model, values = MODELS[name]
    # the slowest of these powers of frequency, 0.28, is within 1e-4 of rest 14 decades below
    slow = model.stiffness(values, [2 * np.pi * 1e-15])
    assert slow[0].real == pytest.approx(float(model.static_stiffness(values)), rel=1e-3)
    assert np.all(model.stiffness(values, OMEGA).imag >= 0)
    assert np.all(model.energy_loss(values, OMEGA, 1e-3) >= 0)


@settings(max_examples=40)
@given(k1=st.floats(5e4, 5e5), k2=st.floats(1e4, 5e5), c=st.floats(10.0, 1e4), frequency=st.floats(0.1, 100.0))
def test_one_tyre_written_four_ways(k1, k2, c, frequency):
    omega = [2 * np.pi * frequency]
    expected = zener_stiffness(k1, k2, c, omega)
    for model, values in (
        (Zener(), [k1, k2, c]),
        (GeneralisedMaxwell(1), [k1, k2, c / k2]),
        (FractionalZener(), [k1, k1 + k2, c / k2, 1.0]),
        (FractionalZener5(), [k1, k1 + k2, c / k2, 1.0, 1.0]),
    ):
        np.testing.assert_allclose(model.stiffness(values, omega), expected, rtol=1e-12)


def stepped(name, frequency):
    """A model as it is stepped in time: of a fractional one the arms that are it around a frequency."""
    model, values = MODELS[name]
    if not name.startswith("fractional"):
        return model, values
    arms, weights, error = rational(model, values, (frequency / 2, 2 * frequency), 1e-6)
    assert error <= 1e-6
    return arms, weights


@pytest.mark.parametrize("name", [name for name, (model, _) in MODELS.items() if model.causal])
@pytest.mark.parametrize("frequency", [1.3, 14.0, 90.0])
def test_stepped_in_time_it_is_its_own_frequency_response(name, frequency):
    """A steady sine of 400 samples per cycle: (2 pi/400)^4/384 = 2e-10 of the deflection."""
    model, values = stepped(name, frequency)
    space = model.state_space(values)
    omega = 2 * np.pi * frequency
    expected = model.stiffness(values, [omega])[0]
    np.testing.assert_allclose(space.stiffness(omega), expected, rtol=1e-13)
    step = 1 / (400 * frequency)
    settle = 0 if not len(space.a) else int(np.ceil(30 / -np.linalg.eigvals(space.a).real.max() / step / 400)) * 400
    time = np.arange(settle + 400) * step
    force = simulate(space, 1e-3 * np.cos(omega * time), -1e-3 * omega * np.sin(omega * time), step)[-400:]
    found = 2 / 400 * np.sum(force * np.exp(-1j * omega * time[-400:])) / 1e-3
    assert abs(found / expected - 1) < 1e-9
    of_model = MODELS[name][0].stiffness(MODELS[name][1], [omega])[0]
    assert abs(found / of_model - 1) < (1.1e-6 if name.startswith("fractional") else 1e-9)


def test_a_coupled_state_space_is_stepped_too():
    """Two states that are not diagonal: the same as its modes."""
    turn = np.array([[1.0, 0.4], [-0.3, 1.0]])
    plain = GeneralisedMaxwell(2).state_space([150e3, 40e3, 60e3, 0.3, 0.02])
    back = np.linalg.inv(turn)
    mixed = StateSpace(turn @ plain.a @ back, turn @ plain.b, plain.c @ back, plain.d)
    rng = np.random.default_rng(0)
    x, v = rng.standard_normal((2, 300))
    np.testing.assert_allclose(simulate(mixed, x, v, 1e-3), simulate(plain, x, v, 1e-3), rtol=1e-9, atol=1e-6)


@pytest.mark.parametrize("values", [[150e3, 400e3, 1e-3, 0.4], [100e3, 900e3, 1e-6, 0.25], [150e3, 160e3, 0.1, 0.8]])
@pytest.mark.parametrize("accuracy", [1e-2, 1e-3, 1e-4])
def test_a_rational_form_keeps_its_accuracy_between_the_points_too(values, accuracy):
    maxwell, arms, error = rational(FractionalZener(), values, (0.5, 200.0), accuracy)
    assert error <= accuracy
    assert np.all(arms >= 0)
    omega = 2 * np.pi * np.geomspace(0.5, 200.0, 1777)
    off = maxwell.stiffness(arms, omega) / FractionalZener().stiffness(values, omega) - 1
    assert np.abs(off).max() < 1.02 * accuracy


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: Zener().stiffness([1.0, 2.0], OMEGA), "has the parameters K1, K2, C"),
        (lambda: Zener().stiffness([1.0, -2.0, 3.0], OMEGA), "K2 = -2 N/m of the zener model is outside 0 to inf"),
        (lambda: Zener().stiffness([1.0, np.nan, 3.0], OMEGA), "K2 = nan N/m"),
        (lambda: Zener().stiffness([1.0, 2.0, 3.0], [0.0]), "must be positive everywhere"),
        (lambda: Structural().state_space([1.0, 0.1]), "no state space of finite order"),
        (lambda: FractionalZener().state_space([1.0, 2.0, 1.0, 0.5]), "no state space of finite order"),
        (lambda: GeneralisedMaxwell(0), "1 to 60 arms, not 0"),
        (lambda: TABLE.stiffness([1e5], [2 * np.pi * 500.0]), "from 0.05 to 400 Hz, without 500 Hz"),
        (lambda: Gehman([1.0], [1.0], [1.0]), "two rows or more"),
        (lambda: Gehman([2.0, 1.0], [1.0, 1.0], [1.0, 1.0]), "must rise"),
        (lambda: simulate(Spring().state_space([1.0]), [0.0], [0.0, 1.0], 1.0), "must have the same length"),
        (lambda: rational(FractionalZener(), [1e5, 2e5, 1.0, 0.5], (10.0, 1.0)), "must rise"),
    ],
)
def test_what_cannot_be_is_told(call, said):
    with pytest.raises(ModelError, match=said):
        call()


@pytest.mark.parametrize("model", [FractionalZener(), FractionalZener5()])
def test_of_order_one_a_fractional_tyre_is_one_arm_and_little_else(model):
    """It is a Zener: with its own relaxation time among the arms it is met to round-off."""
    values = [150e3, 400e3, 2e-3, 1.0, 1.0][: len(model.parameters)]
    maxwell, _, error = rational(model, values, (2.0, 120.0), 1e-9)
    assert maxwell.arms <= 3
    assert error < 1e-9


def test_a_zener_without_a_spring_in_its_arm_is_its_k1_in_time():
    space = Zener().state_space([180e3, 0.0, 700.0])
    assert space.stiffness([60.0]) == 180e3
    assert simulate(space, [0.0, 1e-3], [0.0, 0.0], 1e-3).tolist() == [0.0, 180.0]
