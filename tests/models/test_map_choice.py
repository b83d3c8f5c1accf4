"""Maps of a fractional tyre whose stiffness is linear in pressure: choice, accuracy and what intervals are for."""

import numpy as np
import pytest

from fourpole.models.data import StiffnessData
from fourpole.models.families import for_maps, model_named
from fourpole.models.operating import make_map, simplest
from fourpole.models.surface import Axes

FREQUENCY = np.geomspace(5.0, 50.0, 8)
POINTS = np.array([[p, load] for p in (1.0e5, 1.7e5, 2.4e5) for load in (1000.0, 2000.0, 3000.0)])
AXES = Axes.of(["pressure [Pa]", "preload [N]"], POINTS)
NOISE = 3e-3
_PRESSURES = np.linspace(1e5, 2.4e5, 6)
INSIDE = np.array([[p, load, 1.1 * f] for p in _PRESSURES for load in (1000.0, 2500.0) for f in FREQUENCY[:-1]])


def truth(pressure, frequency):
    """A tyre by closed formula: 1 + 0.25 (p - 1.7 bar) times a fractional Zener element."""
    power = (2j * np.pi * frequency * 2e-3) ** 0.4
    return (1 + 0.25 * (pressure / 1e5 - 1.7)) * (150e3 + 250e3 * power / (1 + power))


def measured(seed, *, bad=0, scatter=0.0):
    """K* of each condition under one error of its mounting, and as measured; `bad` rows have ten times the u."""
    rng = np.random.default_rng(seed)
    noise = np.full((len(POINTS), FREQUENCY.size), NOISE)
    noise.ravel()[rng.choice(noise.size, bad, replace=False)] *= 10
    clean = [truth(p, FREQUENCY) * (1 + scatter * rng.standard_normal()) for p, _ in POINTS]
    data = []
    for k, size in zip(clean, noise, strict=True):
        draw = rng.standard_normal(FREQUENCY.size) + 1j * rng.standard_normal(FREQUENCY.size)
        data.append(StiffnessData.of(2 * np.pi * FREQUENCY, k + size * np.abs(k) * draw, size * np.abs(k)))
    return clean, data


START = {
    "zener": [180e3, 100e3, 800.0],
    "maxwell:2": [160e3, 60e3, 60e3, 2e-2, 2e-3],
    "fractional": [150e3, 400e3, 2e-3, 0.4],
}


def mapped(data, name="fractional"):
    return make_map(model_named(name), data, AXES, np.tile(START[name], (len(POINTS), 1)))


def scores(found, points, frequency, wanted, purpose):
    """Errors of Re K* and Im K* in standard uncertainties (Q, 2), and relative errors of K* (Q,)."""
    answer = found.ask(points, frequency, purpose)
    off, std = answer.stiffness - wanted, np.sqrt(np.diagonal(answer.stiffness_covariance, 0, 1, 2))
    return np.stack([off.real, off.imag], axis=1) / std, np.abs(off / wanted)


@pytest.mark.statistical
@pytest.mark.parametrize(("bad", "most"), [(0, 0.8e-3), (10, 1.0e-3)])
@pytest.mark.sampled(6)
def test_a_stiffness_linear_in_pressure_is_found_again(bad, most):
    """With 6 coefficients and 144 numbers K* is known to some 0.07 %; noisy rows weigh by their u."""
    every, errors, links = [], [], []
    for seed in range(12):
        found = mapped(measured(seed, bad=bad)[1])
        z, error = scores(found, INSIDE[:, :2], INSIDE[:, 2], truth(INSIDE[:, 0], INSIDE[:, 2]), "mean")
        every.append(z)
        errors.append(np.sqrt(np.mean(error**2)))
        links.append(found.link)
    assert np.mean(errors) < most
    assert links.count("identity") >= 10
    assert abs(np.mean(every)) < 0.6  # 0.2 from draw to draw in the mean of 12, times 3
    assert np.mean(np.abs(every) < 1.96) > 0.9


def test_a_parameter_has_only_the_terms_that_it_needs():
    """K0 and K_inf rise with the pressure; the time and the order change with nothing."""
    found = mapped(measured(1)[1])
    used = np.diag(found.covariance).reshape(len(found.coefficients), -1) > 0
    assert found.terms == ((0, 0), (1, 0))
    assert used.tolist() == [[True, True], [True, True], [True, False], [True, False]]
    assert np.all(found.coefficients[~used] == 0.0)


@pytest.mark.sampled(4)
def test_an_automatic_map_is_of_the_right_causal_model():
    assert for_maps()
    assert all(model_named(name).causal for name in for_maps())
    _, data = measured(3, bad=10)
    assert simplest([mapped(data, name) for name in START]).model.name == "fractional"


@pytest.mark.statistical
@pytest.mark.sampled(8)
def test_an_interval_holds_what_it_is_for():
    """1 % from mounting to mounting: 24 maps, of which each has one set of 9 mountings; 95 % within 5 % or so."""
    inside = {"next": [], "specimen": []}
    for seed in range(24):
        clean, data = measured(seed, scatter=0.01)
        rng, found = np.random.default_rng(100 + seed), mapped(data)
        pressure, load, f = rng.uniform([1e5, 1e3, 5.0], [2.4e5, 3e3, 50.0], (40, 3)).T
        wanted = truth(pressure, f) * (1 + 0.01 * rng.standard_normal(40))
        z, _ = scores(found, np.stack([pressure, load], axis=1), f, wanted, "next")
        inside["next"].append(np.abs(z) < 1.96)
        points = np.repeat(POINTS, FREQUENCY.size, axis=0)
        z, _ = scores(found, points, np.tile(FREQUENCY, len(POINTS)), np.concatenate(clean), "specimen")
        inside["specimen"].append(np.abs(z) < 1.96)
    for purpose, found in inside.items():
        assert 0.88 < np.mean(found) < 0.99, purpose


def test_the_specimen_is_known_better_than_the_next_mounting_and_only_where_it_was_tested():
    _, data = measured(1, scatter=0.01)
    found = mapped(data)
    std = {
        one: found.ask(POINTS[:1], [20.0], one).stiffness_covariance[0, 0, 0] for one in ("mean", "next", "specimen")
    }
    assert std["specimen"] < std["mean"] < std["next"]
    with pytest.raises(ValueError, match="known at its tested conditions only"):
        found.ask([[1.2e5, 1500.0]], [20.0], "specimen")


FEW = {"four corners": POINTS[[0, 2, 6, 8]], "three pressures": POINTS[[0, 3, 6]]}


@pytest.mark.statistical
@pytest.mark.parametrize("where", FEW)
@pytest.mark.parametrize("scatter", [0.0, 0.01])
@pytest.mark.sampled(4)
def test_few_conditions_say_what_they_can(where, scatter):
    """Their scatter is that of a prior and of one number in excess: intervals hold, and none is too wide to use."""
    points, inside, widest = FEW[where], [], []
    names = AXES.names if where == "four corners" else AXES.names[:1]
    columns = len(names)
    for seed in range(12):
        rng = np.random.default_rng(seed)
        data = []
        for pressure, _ in points:
            draw = rng.standard_normal(FREQUENCY.size) + 1j * rng.standard_normal(FREQUENCY.size)
            k = truth(pressure, FREQUENCY) * (1 + scatter * rng.standard_normal())
            data.append(StiffnessData.of(2 * np.pi * FREQUENCY, k * (1 + NOISE * draw), NOISE * np.abs(k)))
        axes = Axes.of(names, points[:, :columns])
        start = np.tile(START["fractional"], (len(points), 1))
        found = make_map(model_named("fractional"), data, axes, start)
        asked = np.tile([[1.5e5, 2200.0][:columns]], (10, 1))
        middle = np.full(10, FREQUENCY[4])
        wanted = truth(1.5e5, middle) * (1 + scatter * rng.standard_normal(10))
        z, _ = scores(found, asked, middle, wanted, "next")
        inside.append(np.abs(z) < 1.96)
        answer = found.ask(asked[:1], middle[:1])
        widest.append(np.sqrt(answer.covariance[0, 0, 0]) / np.abs(answer.stiffness[0]))
    assert np.mean(inside) > 0.85
    assert max(widest) < 0.1
