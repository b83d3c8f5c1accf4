"""Turns of a deflection record, complete cycles, the travel before contact, and the rests of a stepped record."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fourpole.core.branches import in_contact, means, passes_levels, ranks, rests, split_branches


def sweep(*turns, points=50):
    """Straight ways from turn to turn, each turn once."""
    ways = [np.linspace(a, b, points)[:-1] for a, b in pairwise(turns)]
    return np.concatenate([*ways, [turns[-1]]])


def turning_places(x):
    found = split_branches(x)
    return [x[first] for first, _ in found.ends] + [x[found.ends[-1][1]]]


@pytest.mark.parametrize(
    ("turns", "rising", "cycles"),
    [
        ((0, 1), (True,), ()),
        ((1, 0), (False,), ()),
        ((0, 1, 0), (True, False), ((0, 1),)),
        ((0, 1, 0, 1, 0), (True, False, True, False), ((0, 1), (2, 3))),
        ((0, 1, 0, 1), (True, False, True), ((0, 1),)),  # the last loading has no unloading
        ((1, 0, 1), (False, True), ((0, 1),)),  # starts loaded: the other way round
        ((1, 0, 1, 0), (False, True, False), ((1, 2),)),  # ... unless there is a pair the right way
        ((0.5, 1, 0, 1, 0), (True, False, True, False), ((2, 3),)),  # starts half way: not complete
        ((0, 1, 0, 0.5, 0), (True, False, True, False), ((0, 1),)),  # a small last cycle
        ((0, 0.95, 0.02, 1, 0), (True, False, True, False), ((0, 1), (2, 3))),  # all within a tenth
        ((0, 0.8, 0, 1, 0), (True, False, True, False), ((2, 3),)),
    ],
)
def test_branches_and_cycles(turns, rising, cycles):
    x = sweep(*turns)
    found = split_branches(x)
    assert turning_places(x) == pytest.approx(turns)
    assert found.rising == rising
    assert found.cycles == cycles


def test_ends_are_shared_by_neighbours():
    x = sweep(0, 1, 0, 1, 0, points=11)
    assert split_branches(x).ends == ((0, 10), (10, 20), (20, 30), (30, 40))


@given(
    st.lists(st.floats(0.55, 1.0), min_size=1, max_size=5),
    st.floats(-10.0, 10.0),
    st.floats(1e-4, 10.0),
    st.integers(4, 60),
)
def test_turns_are_found_at_any_scale_and_zero(peaks, zero, scale, points):
    turns = [0.0]
    for peak in peaks:
        turns += [peak, 0.0]
    x = zero + scale * sweep(*turns, points=points)
    assert turning_places(x) == pytest.approx([zero + scale * t for t in turns], abs=1e-9 * scale)


def test_noise_makes_no_turns():
    rng = np.random.default_rng(0)
    x = sweep(0, 1, 0, 1, 0, points=500)
    noisy = x + 0.02 * rng.standard_normal(x.size)  # peak to peak 0.15 of the range: below the 0.3 of a turn
    assert split_branches(noisy).rising == (True, False, True, False)
    assert split_branches(noisy).cycles == ((0, 1), (2, 3))


def test_a_dwell_belongs_to_a_branch():
    x = np.concatenate([sweep(0, 1), np.ones(40), sweep(1, 0), np.zeros(30), sweep(0, 1, 0)])
    found = split_branches(x)
    assert found.cycles == ((0, 1), (2, 3))
    assert turning_places(x) == pytest.approx([0, 1, 0, 1, 0])


def test_points_in_no_order_are_one_branch():
    x = np.random.default_rng(1).uniform(0, 1, 200)
    found = split_branches(x)
    assert found.ends == ((0, 199),)
    assert found.cycles == ()


STEPS = np.random.default_rng(5)


def stepped(*levels, each=30, scatter=0.01):
    """Rests at levels, each with scatter and a way of three samples before the next one."""
    rests = [level + scatter * STEPS.standard_normal(each) for level in levels]
    ways = [np.linspace(a, b, 5)[1:-1] for a, b in pairwise(levels)] + [np.empty(0)]
    return np.concatenate([part for pair in zip(rests, ways, strict=True) for part in pair])


@pytest.mark.parametrize(
    ("levels", "measured"),
    [
        ((0, 1, 2, 3, 4, 5, 6), "loading"),
        ((6, 5, 4, 3, 2, 1, 0), "unloading"),
        ((0, 1, 2, 3, 4, 5, 6, 5, 4, 3, 2, 1, 0), "mean"),
        ((3, 1, 6, 2, 5, 0, 4), "points"),
        ((0, 6, 3, 5, 1, 4, 2, 6, 0, 3), "points"),
    ],
)
def test_steps_are_what_their_order_makes_of_them(levels, measured):
    x = stepped(*levels)
    assert split_branches(x).measured == measured
    number = rests(x)
    assert len({*number.tolist()} - {-1}) == len(levels)
    assert np.median(x[number == 1]) == pytest.approx(levels[1], abs=0.02)


def test_the_step_back_to_the_start_is_no_branch():
    x = np.append(stepped(0, 1, 2, 3, 4, 5), [0.0, 0.0])
    assert split_branches(x).measured == "loading"


def test_a_record_that_flows_has_no_rests():
    held = np.concatenate([sweep(0, 1), np.ones(400), sweep(1, 0), np.zeros(300)])
    for x in (sweep(0, 1, 0, points=400), 0.5 - 0.5 * np.cos(np.linspace(0, 20, 900)), held, np.ones(100)):
        assert rests(x) is None


def test_the_rest_before_the_first_turn_belongs_to_the_branch():
    x = stepped(0, 1, 2, 3, 4)
    ((first, last),) = split_branches(x).ends
    assert (first, last) == (0, x.size - 1)


def test_of_cycle():
    x = sweep(0, 1, 0, 1, 0, points=11)
    load = np.arange(x.size, dtype=float)
    found = split_branches(x)
    part, force, side = found.of_cycle(-1, x, load)
    np.testing.assert_array_equal(part, np.concatenate([x[20:31], x[30:41]]))  # the turn belongs to both
    np.testing.assert_array_equal(force, np.concatenate([load[20:31], load[30:41]]))
    np.testing.assert_array_equal(side, np.repeat([1.0, -1.0], 11))
    np.testing.assert_array_equal(found.of_cycle(0, x, load)[1][:11], load[:11])


def test_of_cycle_without_cycle_is_the_longest_branch():
    x = sweep(0.4, 0, 1, points=11)
    part, force, side = split_branches(x).of_cycle(-1, x, 2 * x)
    assert side is None
    assert part[[0, -1]].tolist() == [0.0, 1.0]
    np.testing.assert_array_equal(force, 2 * part)


def test_free_travel_is_left_out():
    x = np.linspace(0.0, 1.0, 101)
    load = np.where(x < 0.205, 0.0, 1000 * (x - 0.2))
    held = in_contact(x, load)
    assert not held[:20].any()
    assert held[25:].all()


@pytest.mark.parametrize(
    "load",
    [
        lambda x: 1000 * x,  # no travel at all
        lambda x: 1000 * x**2,  # soft at first, but not flat enough for that
        lambda x: 300 + 1000 * x,  # starts loaded
        lambda x: np.where(x < 0.03, 0.0, x - 0.03),  # over 3 % of the deflection: not worth it
    ],
)
def test_a_curve_that_starts_in_contact_is_left_whole(load):
    x = np.linspace(0.0, 1.0, 101)
    assert in_contact(x, load(x)).all()


LEVELS = np.array([220.0, 440.0, 660.0, 880.0, 1100.0])
STIFFNESS = 1e5


def held_at(order, *, each=40, hold="deflection", rng=None):
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
    deflection, load = held_at(order, each=400, hold=hold)
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
    deflection, load = held_at(order)
    number = rests(deflection, load)
    assert number is not None
    assert passes_levels(ranks(number, deflection, load)) == passes
