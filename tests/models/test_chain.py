"""Models in the place of the tyre: against the cascade of four-poles, the paper's closed forms, and themselves."""

import numpy as np
import pytest

from fourpole.core.reduced import predict
from fourpole.core.rig import Rig
from fourpole.core.twoport import cascade, chain_mobility, chain_transmissibility, mass
from fourpole.core.tyre import zener_mobility, zener_transmissibility
from fourpole.errors import ModelError
from fourpole.models.chain import four_pole, in_time, mobility, transmissibility
from fourpole.models.fractional import FractionalZener, FractionalZener5
from fourpole.models.maxwell import GeneralisedMaxwell, Zener
from fourpole.models.springs import KelvinVoigt, Spring
from fourpole.paper1982.models import Gehman, Structural

OMEGA = 2 * np.pi * np.linspace(6.0, 30.0, 9)
MODELS = {
    "spring": (Spring(), [180e3]),
    "kelvin": (KelvinVoigt(), [180e3, 300.0]),
    "structural": (Structural(), [180e3, 0.1]),
    "zener": (Zener(), [180e3, 120e3, 700.0]),
    "maxwell": (GeneralisedMaxwell(3), [150e3, 40e3, 60e3, 30e3, 0.3, 0.02, 1e-3]),
    "fractional": (FractionalZener(), [150e3, 400e3, 2e-3, 0.4]),
    "fractional5": (FractionalZener5(), [150e3, 400e3, 2e-3, 0.4, 0.7]),
    "table": (Gehman([5.0, 10.0, 31.0], [90e3, 120e3, 150e3], [1e3, 700.0, 400.0]), [180e3]),
}
PAPER = Rig(moving_mass=15.0, preload_stiffness=12440.0)
ALL = Rig(
    moving_mass=15.0,
    preload_stiffness=12440.0,
    preload_damping=15.0,
    preload_loss_factor=0.02,
    tyre_mass=0.8,
    frame_stiffness=4e5,
    input_mass=0.5,
)
#: Products of five two-by-two matrices.
ROUND_OFF = 1e-12


@pytest.mark.parametrize("rig", [PAPER, ALL], ids=["the paper's", "all parts"])
@pytest.mark.parametrize("name", MODELS)
def test_on_a_rig_it_is_the_cascade_of_all_four_poles(name, rig):
    model, values = MODELS[name]
    added = np.linspace(0.0, 10.0, OMEGA.size)
    here, above = four_pole(model, values, OMEGA), rig.chain(OMEGA, added)
    np.testing.assert_allclose(OMEGA * 1j / here[:, 1, 0], model.stiffness(values, OMEGA), rtol=ROUND_OFF)
    whole = chain_mobility(cascade(mass(rig.input_mass, OMEGA), here, above))
    np.testing.assert_allclose(mobility(model, values, rig, OMEGA, added), whole, rtol=ROUND_OFF)
    moved = chain_transmissibility(here, above)
    np.testing.assert_allclose(transmissibility(model, values, rig, OMEGA, added), moved, rtol=ROUND_OFF)
    assert np.all(whole.real >= -ROUND_OFF * abs(whole))  # no part of it gives energy


def test_the_zener_model_is_the_tyre_of_the_paper():
    values, rig = (180e3, 120e3, 700.0), {"mass": 15.0, "preload_stiffness": 12440.0}
    found = transmissibility(Zener(), values, PAPER, OMEGA)
    np.testing.assert_allclose(abs(found), zener_transmissibility(*values, OMEGA, **rig), rtol=ROUND_OFF)
    np.testing.assert_allclose(
        mobility(Zener(), values, PAPER, OMEGA), zener_mobility(*values, OMEGA, **rig), rtol=ROUND_OFF
    )
    predicted = predict(OMEGA / (2 * np.pi), *values, ALL)
    np.testing.assert_allclose(mobility(Zener(), values, ALL, OMEGA), predicted.mobility, rtol=ROUND_OFF)
    np.testing.assert_allclose(abs(transmissibility(Zener(), values, ALL, OMEGA)), predicted.tr, rtol=ROUND_OFF)


def test_a_mass_that_nothing_holds():
    k = KelvinVoigt().stiffness([180e3, 300.0], OMEGA)
    free = Rig(moving_mass=15.0)
    inertia = -15.0 * OMEGA**2
    np.testing.assert_allclose(
        transmissibility(KelvinVoigt(), [180e3, 300.0], free, OMEGA), k / (k + inertia), rtol=ROUND_OFF
    )
    np.testing.assert_allclose(
        mobility(KelvinVoigt(), [180e3, 300.0], free, OMEGA), 1j * OMEGA * (1 / k + 1 / inertia), rtol=ROUND_OFF
    )


def test_a_blocked_rig_moves_nowhere():
    at = Zener(), [180e3, 120e3, 700.0], Rig(blocked=True), OMEGA
    np.testing.assert_allclose(mobility(*at), 1j * OMEGA / Zener().stiffness(at[1], OMEGA), rtol=ROUND_OFF)
    assert not transmissibility(*at).any()


@pytest.mark.parametrize("name", MODELS)
def test_many_sets_and_a_row_of_frequencies_for_each(name):
    model, values = MODELS[name]
    sets = np.array(values) * [[1.0], [0.97]]
    rows = np.array([OMEGA, OMEGA[::-1]])
    for call in (mobility, transmissibility):
        together, each = call(model, sets, ALL, OMEGA), call(model, sets, ALL, rows)
        for at, one in enumerate(sets):
            np.testing.assert_allclose(together[at], call(model, one, ALL, OMEGA), rtol=ROUND_OFF)
            np.testing.assert_allclose(each[at], call(model, one, ALL, rows[at]), rtol=ROUND_OFF)


@pytest.mark.parametrize("name", ["spring", "kelvin", "zener", "maxwell"])
def test_a_finite_causal_model_is_itself_in_time(name):
    model, values = MODELS[name]
    space = in_time(model, values, (5.0, 50.0))
    assert len(space.a) == len(model.state_space(values).a)
    np.testing.assert_allclose(space.stiffness(OMEGA), model.stiffness(values, OMEGA), rtol=ROUND_OFF)


@pytest.mark.parametrize("name", ["fractional", "fractional5"])
@pytest.mark.parametrize("accuracy", [1e-3, 1e-6])
def test_a_fractional_model_is_arms_in_time_as_accurate_as_asked(name, accuracy):
    model, values = MODELS[name]
    space = in_time(model, values, (5.0, 50.0), accuracy)
    omega = 2 * np.pi * np.geomspace(5.0, 50.0, 501)
    off = abs(space.stiffness(omega) / model.stiffness(values, omega) - 1)
    assert off.max() < 1.02 * accuracy  # 12 points an arm see all but 2 % of a peak


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: mobility(*MODELS["table"], PAPER, [2 * np.pi * 40.0]), "from 5 to 31 Hz, without 40 Hz"),
        (lambda: transmissibility(*MODELS["table"], PAPER, [2 * np.pi * 4.0]), "from 5 to 31 Hz, without 4 Hz"),
        (lambda: four_pole(*MODELS["table"], [2 * np.pi * 4.0]), "without 4 Hz"),
        (lambda: four_pole(Spring(), [0.0], OMEGA), "K\\* of the spring model is zero"),
        (lambda: four_pole(Spring(), [1e5], [0.0]), "must be positive"),
        (lambda: mobility(Zener(), [-1.0, 1.0, 1.0], PAPER, OMEGA), "K1 = -1 N/m"),
        (lambda: in_time(*MODELS["structural"], (1.0, 10.0)), "structural model is not causal"),
        (lambda: in_time(*MODELS["table"], (6.0, 10.0)), "table model is not causal"),
        (lambda: in_time(Spring(), [-1.0], (6.0, 10.0)), "K = -1 N/m"),
        (lambda: in_time(*MODELS["fractional"], (10.0, 6.0)), "must rise"),
    ],
)
def test_what_cannot_be_is_told(call, said):
    with pytest.raises(ModelError, match=said):
        call()
