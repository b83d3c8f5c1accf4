"""Rests of stepped records, and records that flow."""

import numpy as np
import pytest

from fourpole.core.branches import means, passes_levels, ranks, rests

LEVELS = np.array([220.0, 440.0, 660.0, 880.0, 1100.0])
STIFFNESS = 1e5


def stepped(order, *, each=40, hold="deflection", rng=None):
    """Load [N] and deflection [m] at levels in this order; what is not held wanders by a tenth of the span."""
    rng = np.random.default_rng(2) if rng is None else rng
    load = np.repeat(LEVELS[list(order)], each) + 5.0 * rng.standard_normal(each * len(order))
    wander = 90.0 * np.sin(np.arange(load.size) / 20.0)
    if hold == "load":
        return (load + wander) / STIFFNESS, load
    return np.repeat(LEVELS[list(order)], each) / STIFFNESS, load + wander


@pytest.mark.parametrize("hold", ["deflection", "load"])
def test_either_quantity_may_be_held(hold):
    order = [4, 2, 0, 3, 1, 4, 0]
    deflection, load = stepped(order, each=400, hold=hold)
    number = rests(deflection, load)
    assert number is not None
    assert np.mean(number >= 0) > 0.95
    assert ranks(number, deflection, load).tolist() == order
    held = means(number, load) if hold == "load" else STIFFNESS * means(number, deflection)
    np.testing.assert_allclose(held, LEVELS[order], atol=10.0)  # the block of a step may have samples of both levels


def trapezoid(hold, cycles=4):
    one = np.concatenate([np.linspace(0, 1, 40), np.ones(hold), np.linspace(1, 0, 40), np.zeros(hold)])
    return np.tile(one, cycles)


FLOWING = {
    "triangle": np.abs((np.linspace(0, 6, 1200) % 2) - 1),
    "sine": 0.5 - 0.5 * np.cos(np.linspace(0, 8 * np.pi, 2000)),
    "ripple": np.linspace(0, 1, 3000) + 0.004 * np.sin(np.arange(3000) / 3),
    "exponential approach": np.tile(1 - np.exp(-np.linspace(0, 6, 300)), 3),
    "long holds at both ends": trapezoid(400),
    "random times": np.abs((np.sort(np.random.default_rng(3).uniform(0, 4, 400)) % 2) - 1),
    "dense in the middle": np.tile(np.append(np.linspace(-1, 1, 500) ** 3, np.linspace(1, -1, 500) ** 3), 2),
    "resolution": np.round(np.linspace(0, 1, 5000) * 400) / 400,
}


@pytest.mark.parametrize("name", FLOWING)
def test_a_record_that_flows_has_none(name):
    x = FLOWING[name]
    load = 1e5 * x + 1e3 * np.random.default_rng(0).standard_normal(x.size)
    for part in (slice(None), slice(x.size // 2, None), slice(7 * x.size // 8, None)):
        assert rests(x[part], load[part]) is None


@pytest.mark.parametrize(
    ("order", "passes"),
    [
        (range(5), True),
        ([0, 1, 2, 3, 4, 3, 2, 1, 0], True),
        ([0, 1, 3, 4, 3, 2, 1, 0], True),  # one level is left out once
        ([0, 1, 2, 3, 4] * 3, False),  # it falls over three levels between the rises
        ([4, 3, 2, 0, 4, 1], False),
    ],
)
def test_an_order_passes_the_levels_or_does_not(order, passes):
    deflection, load = stepped(order)
    number = rests(deflection, load)
    assert number is not None
    assert passes_levels(ranks(number, deflection, load)) == passes
