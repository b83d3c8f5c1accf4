"""A model as branches: the same K*, the same force in time, and what has none."""

from __future__ import annotations

import numpy as np
import pytest

from fourpole.errors import ModelError
from fourpole.models.families import model_named
from fourpole.models.fractional import rational
from fourpole.models.realised import realised
from fourpole.models.step import simulate
from fourpole.paper1982.shell import CROSS_PLY, RADIAL_PLY, Shell

BAND = (1.0, 200.0)
OMEGA = 2 * np.pi * np.geomspace(*BAND, 61)
#: Models with parameters, and the relative error of K* that the branches may have.
EXACT = {
    "spring": ([180e3], 1e-14),
    "kelvin": ([180e3, 300.0], 1e-14),
    "zener": ([180e3, 120e3, 700.0], 1e-13),
    "maxwell:2": ([0.0, 9e4, 3e4, 0.1, 0.002], 1e-13),
    "shell": (RADIAL_PLY, 1e-9),
}


@pytest.mark.parametrize("name", EXACT)
@pytest.mark.sampled(2)
def test_branches_and_matrices_have_the_stiffness_of_the_model(name):
    model, (values, most) = model_named(name), EXACT[name]
    found, wanted = realised(model, values, BAND), model.stiffness(values, OMEGA)
    assert np.max(np.abs(found.stiffness(OMEGA) / wanted - 1)) < most
    assert np.max(np.abs(found.space.stiffness(OMEGA) / wanted - 1)) < most
    assert found.error < most
    assert found.rest == pytest.approx(float(model.static_stiffness(values)), rel=1e-9)


@pytest.mark.parametrize("name", ["zener", "maxwell:2", "shell"])
@pytest.mark.sampled(2)
def test_the_matrices_give_the_force_of_the_model_in_time(name):
    model, (values, most) = model_named(name), EXACT[name]
    time = 1e-3 * np.arange(400)
    x, v = 1e-3 * np.sin(120 * time), 0.12 * np.cos(120 * time)
    wanted = simulate(model.state_space(values), x, v, 1e-3)
    force = simulate(realised(model, values, BAND).space, x, v, 1e-3)
    assert np.max(np.abs(force - wanted)) < 10 * most * np.max(np.abs(wanted))


@pytest.mark.parametrize("name", ["fractional", "fractional5"])
def test_a_power_of_the_frequency_is_approximated_with_its_error(name):
    model = model_named(name)
    found = realised(model, model.defaults, BAND)
    apart = np.max(np.abs(found.space.stiffness(OMEGA) / model.stiffness(model.defaults, OMEGA) - 1))
    assert 0 < apart < 1.01 * found.error < 1.01e-7  # the error is the largest on a grid of 12 frequencies per branch


def test_an_approximation_whose_iteration_does_not_end_goes_on_with_more_arms():
    model, values = model_named("fractional5"), [150e3, 400e3, 2e-3, 0.6, 0.5]
    with pytest.raises(ModelError, match=r"60 arms have an error of"):
        rational(model, values, (10.0, 24.0), 1e-12)


def test_branches_are_in_falling_order_of_their_times_and_idle_ones_are_left_out():
    found = realised(model_named("maxwell:4"), [1e5, 1e4, 0.0, 2e4, 3e4, 0.01, 0.5, 0.1, 0.0], BAND)
    assert found.times.tolist() == [0.1, 0.01]
    assert found.springs.tolist() == [2e4, 1e4]
    assert found.instantaneous == 1.3e5


@pytest.mark.sampled(4)
def test_states_are_real_branches_first_then_pairs():
    found = realised(Shell(), CROSS_PLY, BAND)
    count, a = found.springs.size, found.space.a
    assert found.pair_springs.size > 0
    assert np.all(found.pair_rates.imag > 0)
    assert np.all(np.diff(found.times) <= 0)
    blocks = np.kron(np.eye(found.pair_springs.size), np.ones((2, 2)))
    assert not np.any(a[:count, count:])
    assert not np.any(a[count:, count:][blocks == 0])


@pytest.mark.sampled(4)
def test_modes_far_above_the_band_do_not_take_digits():
    nearly_massless = [0.28, 0.11, 1e7, 10.0, 1e5, 5.4e6, 0.001, 0.005, 0.06, 0.8]
    band = (10.0, 24.0)
    omega = 2 * np.pi * np.geomspace(*band, 31)
    found, wanted = realised(Shell(), nearly_massless, band), Shell().stiffness(nearly_massless, omega)
    assert np.max(np.abs(found.space.stiffness(omega) / wanted - 1)) < 1e-9
    assert found.damper == 0.0
    assert np.all(np.diff(found.times) < 0)


@pytest.mark.parametrize("name", ["structural", "kraus", "gehman:1"])
def test_a_model_that_is_not_causal_is_refused_with_the_remedy(name):
    model = model_named(name)
    with pytest.raises(ModelError, match=r"not causal.*fourpole fit --model prony"):
        realised(model, model.defaults, BAND)


def test_a_mode_without_loss_is_refused():
    with pytest.raises(ModelError, match="state a loss above zero"):
        realised(Shell(), [*RADIAL_PLY[:7], 0.0, *RADIAL_PLY[8:]], BAND)
