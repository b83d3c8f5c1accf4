"""The rule of one condition: at its tolerances, whatever the order, with what is not stated, on axes of one's own."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fourpole.core.condition import AXES, Axis, Condition, Sameness, axis_of

PRESSURE, PRELOAD, TEMPERATURE = AXES
STATE = (1.7e5, 1000.0, 20.0)


def condition(**changed):
    values = dict(zip((axis.name for axis in AXES), STATE, strict=True)) | changed
    return Condition("a", tuple(values.values()))


@pytest.mark.parametrize(
    ("name", "value", "same"),
    [
        ("pressure", 1.7e5 / 0.9801, True),
        ("pressure", 1.7e5 / 0.9799, False),
        ("pressure", 1.7e5 * 0.9801, True),
        ("pressure", 1.7e5 * 0.9799, False),
        ("preload", 1000.0 / 0.9901, True),
        ("preload", 1000.0 / 0.9899, False),
        ("preload", 990.1, True),
        ("preload", 989.9, False),
        ("temperature", 24.99, True),
        ("temperature", 25.01, False),
        ("temperature", 15.01, True),
        ("temperature", 14.99, False),
    ],
)
def test_just_inside_a_tolerance_is_the_same_and_just_outside_is_not(name, value, same):
    rule, one, other = Sameness(), condition(), condition(**{name: value})
    assert rule.same(one, other) is rule.same(other, one) is same
    assert len(set(rule.groups([one, other]).tolist())) == (1 if same else 2)


def test_another_specimen_is_another_condition():
    assert not Sameness().same(condition(), Condition("b", STATE))
    assert Sameness().groups([condition(), Condition("b", STATE)]).tolist() == [0, 1]


@pytest.mark.parametrize("name", [axis.name for axis in AXES])
def test_what_is_not_stated(name):
    rule, blank = Sameness(), condition(**{name: None})
    assert rule.same(blank, blank)
    assert not rule.same(blank, condition())
    assert rule.same(blank, condition(), blank=True)
    assert rule.same(condition(), blank, blank=True)
    assert rule.groups([blank, condition(), blank]).tolist() == [1, 0, 1]


@given(st.permutations(range(24)), st.integers(0, 2**32 - 1))
def test_the_order_has_no_influence_and_no_group_is_wider_than_the_tolerance(order, seed):
    rng = np.random.default_rng(seed)
    pressure, load, warmth = rng.uniform(1.6e5, 1.8e5, 24), rng.uniform(980, 1020, 24), rng.uniform(15, 30, 24)
    every = [Condition("ab"[at % 2], row) for at, row in enumerate(zip(pressure, load, warmth, strict=True))]
    groups = Sameness().groups(every)
    again = Sameness().groups([every[at] for at in order])
    assert [groups[at] for at in order] == again.tolist()
    for one, other in itertools.combinations(range(24), 2):
        if groups[one] == groups[other]:
            assert Sameness().same(every[one], every[other])


def test_two_members_on_either_side_of_a_third_are_not_one_condition():
    """The third is lowest in pressure, so that it comes first and is like both."""
    middle, cold, hot = (
        condition(pressure=1.69e5, temperature=25.0),
        condition(temperature=21.0),
        condition(temperature=29.0),
    )
    groups = Sameness().groups([hot, middle, cold]).tolist()
    assert groups[0] != groups[2]


def test_axes_of_ones_own():
    rule = Sameness((*AXES, Axis("amplitude [mm]", relative=0.05), Axis("batch", text=True)))
    rows = [Condition("a", (*STATE, x, b)) for x, b in ((1.0, "A"), (1.04, "A"), (1.06, "A"), (1.0, "B"), (1.0, None))]
    assert rule.groups(rows).tolist() == [0, 0, 3, 1, 2]
    assert rule.further == rule.axes[3:]
    assert rule.without("preload").axes == (PRESSURE, TEMPERATURE, *rule.further)
    assert axis_of("temperature [degC]") is TEMPERATURE
    assert axis_of("camber [deg]").same(1.0, 1.009)
    assert not axis_of("camber [deg]").same(1.0, 1.011)
    assert Sameness().over(["preload [N]", "camber [deg]"]).axes[3:] == (axis_of("camber [deg]"),)


def test_values_of_one_axis_are_numbered_as_they_rise():
    assert Axis("f", relative=0.02).groups([10.05, None, 12.0, 10.0]).tolist() == [0, 2, 1, 0]


def test_a_tyre_at_many_states_is_grouped_in_time():
    every = [Condition("a", (1e5 * 1.05 ** (at % 40), 1000.0, at * 1e-3)) for at in range(4000)]
    assert len(set(Sameness().groups(every).tolist())) == 40
