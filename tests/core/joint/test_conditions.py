"""Which tests see the same tyre, and how K* is carried to each test's own frequency."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fourpole.core.joint.conditions import JointConditions, group_conditions


@pytest.mark.parametrize(
    ("family", "frequency", "expected"),
    [
        ([0], [10.0], [0]),
        ([-1], [10.0], [-1]),
        ([-1, 0], [10.0, 10.0], [-1, 0]),
        ([0, 0], [10.0, 10.0], [0, 0]),
        ([0, 0], [10.0, 10.1], [0, 0]),  # 1 % apart
        ([0, 0], [10.0, 10.11], [0, 1]),  # more
        ([0, 0, 0], [10.0, 10.1, 10.2], [0, 0, 1]),  # 1 % from one to the next, but 2 % over all
        ([0, 0, 0], [10.2, 10.1, 10.0], [1, 0, 0]),  # in any order
        ([1, 0], [10.0, 24.0], [1, 0]),
        ([0, 1], [24.0, 24.0], [0, 1]),  # the same frequency of another tyre
        ([7, 3, 7], [10.0, 10.0, 10.0], [1, 0, 1]),  # families need not count from 0
    ],
)
def test_conditions_are_numbered_by_family_and_frequency(family, frequency, expected):
    assert group_conditions(np.array(family), np.array(frequency)).tolist() == expected


@given(st.lists(st.tuples(st.integers(-1, 3), st.floats(5.0, 30.0)), min_size=1, max_size=40))
def test_what_always_holds_of_conditions(tests):
    family, frequency = np.array([f for f, _ in tests]), np.array([f for _, f in tests])
    label = group_conditions(family, frequency)
    assert np.array_equal(label < 0, family < 0)
    assert sorted(set(label[label >= 0].tolist())) == list(range(int(label.max()) + 1))
    for each in range(int(label.max()) + 1):
        members = label == each
        assert np.unique(family[members]).size == 1
        assert np.ptp(frequency[members]) <= 0.0162 * frequency[members].min()
    order = np.random.default_rng(0).permutation(len(tests))
    assert np.array_equal(group_conditions(family[order], frequency[order]), label[order])


def conditions(frequency, family, k1):
    label = group_conditions(family, frequency)
    return JointConditions(label, family, frequency, k1)


def zener(frequency, k1, k2, c):
    return k1 + 1 / (1 / k2 + 1 / (2j * np.pi * frequency * c))


def power_law(frequency):
    """A tyre whose K2 and C are powers of frequency, as those of rubber nearly are."""
    return zener(frequency, 150e3, 120e3 * (frequency / 15) ** 0.8, 900.0 * (frequency / 15) ** -0.5)


def two_of_each(mean, spread=0.003):
    return np.sort(np.concatenate([mean * (1 - spread), mean * (1 + spread)]))


def test_a_tyre_whose_arm_is_powers_of_frequency_is_carried_exactly():
    frequency = two_of_each(np.array([10.0, 15.0, 24.0]))
    family = np.zeros(6, dtype=int)
    made = conditions(frequency, family, np.full(6, 150e3))
    ratio = made.carried(power_law(made.mean_frequency))
    expected = power_law(frequency) / power_law(made.mean_frequency)[made.label]
    assert np.abs(ratio - expected).max() < 1e-14
    assert np.abs(ratio - 1).min() > 1e-4  # and it is no small thing


def test_without_k1_the_logarithm_of_the_stiffness_is_carried():
    frequency = two_of_each(np.array([10.0, 11.0, 12.0, 13.0]))
    made = conditions(frequency, np.zeros(8, dtype=int), np.full(8, np.nan))
    ratio = made.carried(power_law(made.mean_frequency))
    expected = power_law(frequency) / power_law(made.mean_frequency)[made.label]
    # the slope over the neighbours, a tenth away, is off by a tenth (at an end) of itself
    assert np.abs(ratio - expected).max() < 0.15 * np.abs(expected - 1).max()


def test_across_the_pole_of_k2_the_arm_is_carried_in_proportion():
    """1/K2 goes through zero between two frequencies: K' passes K1."""
    mean = np.array([10.0, 11.0, 12.0])
    compliance = np.array([2e-7, -1e-8, -3e-7]) - 1j / (2 * np.pi * mean * 900.0)
    frequency = two_of_each(mean)
    made = conditions(frequency, np.zeros(6, dtype=int), np.full(6, 150e3))
    ratio = made.carried(150e3 + 1 / compliance)
    assert np.all(np.isfinite(ratio))
    assert np.abs(ratio - 1).max() < 0.01  # 0.3 % in frequency


def test_one_frequency_only_carries_the_damper_by_its_frequency_alone():
    frequency = np.array([9.97, 10.03])
    made = conditions(frequency, np.zeros(2, dtype=int), np.full(2, 150e3))
    stiffness = zener(np.array([10.0]), 150e3, 120e3, 900.0)
    assert made.carried(stiffness) == pytest.approx(zener(frequency, 150e3, 120e3, 900.0) / stiffness, rel=1e-14)


def test_at_the_same_frequency_nothing_changes():
    frequency = np.repeat([10.0, 14.0, 24.0], 3)
    made = conditions(frequency, np.zeros(9, dtype=int), np.full(9, 150e3))
    assert np.abs(made.carried(power_law(made.mean_frequency)) - 1).max() < 1e-14


def test_the_families_do_not_know_each_other():
    frequency = np.concatenate([two_of_each(np.array([10.0, 24.0]))] * 2)
    family = np.repeat([0, 1], 4)
    made = conditions(frequency, family, np.full(8, 150e3))
    alone = conditions(frequency[:4], family[:4], np.full(4, 150e3))
    stiffness = power_law(made.mean_frequency) * np.array([1.0, 1.0, 1.3, 1.4])
    assert np.array_equal(made.carried(stiffness)[:4], alone.carried(stiffness[:2]))


def test_rigid_blocks_carry_nothing_and_belong_to_nothing():
    frequency = np.array([10.0, 20.0, 9.97, 10.03])
    family = np.array([-1, -1, 0, 0])
    made = conditions(frequency, family, np.array([np.nan, np.nan, 150e3, 150e3]))
    assert (made.first, made.count, made.sizes.tolist()) == (2, 1, [2])
    assert made.carried(power_law(made.mean_frequency))[:2].tolist() == [1.0, 1.0]
    assert made.sum(np.arange(4.0)).tolist() == [5.0]
    assert made.mean(np.arange(8.0).reshape(4, 2)).tolist() == [[5.0, 6.0]]


def test_blocks_alone_make_no_condition():
    made = conditions(np.array([10.0, 20.0]), np.array([-1, -1]), np.full(2, np.nan))
    assert made.count == 0
    assert made.carried(np.zeros(0, dtype=complex)).tolist() == [1.0, 1.0]
    assert made.sum(np.ones((2, 3))).shape == (0, 3)


def test_an_arm_too_soft_to_say_is_left_alone():
    """K* = K1: neither K2 nor C exist, and log K* is carried in their place."""
    frequency = two_of_each(np.array([10.0, 11.0]))
    made = conditions(frequency, np.zeros(4, dtype=int), np.full(4, 150e3))
    assert np.abs(made.carried(np.full(2, 150e3 + 0j)) - 1).max() < 1e-14


@given(st.floats(-3.0, 3.0), st.floats(-2.0, 2.0), st.lists(st.floats(-0.004, 0.004), min_size=10, max_size=10))
def test_a_power_of_frequency_lies_on_its_curve(power, size, apart):
    """Two rigid blocks, then the repeats of five frequencies; one repeat is moved off the curve."""
    label = np.repeat([-1, 0, 1, 2, 3, 4], [2, 2, 2, 3, 2, 1])
    frequency = 10.0 * 1.15 ** np.maximum(label, 0) * np.exp([0.0, 0.0, *apart])
    frequency[2::2] = 10.0 * 1.15 ** label[2::2]  # each condition has a test at its nominal frequency
    conditions = JointConditions(label, np.minimum(label, 0), frequency, np.full(label.size, np.nan))
    values = power * np.log(frequency / 15.0)
    # The mean frequency of a condition is up to 0.4 % off that of the median, and its slope as uncertain.
    assert np.abs(conditions.off_curve(values)).max() <= 0.01 * abs(power) + 1e-12
    moved = values + size * (np.arange(label.size) == 6)
    change = conditions.off_curve(moved) - conditions.off_curve(values)
    assert change[:2] == pytest.approx(0.0)
    assert change[6] == pytest.approx(size, abs=0.01 * abs(power) + 1e-12)


def test_a_value_without_conditions_has_no_curve():
    label = np.full(2, -1)
    conditions = JointConditions(label, label, np.array([11.0, 21.0]), np.full(2, np.nan))
    assert conditions.off_curve(np.array([1.0, 2.0])).tolist() == [0.0, 0.0]


def test_lines_of_one_recording_are_no_repeats_of_each_other():
    frequency = np.array([100.0, 101.0, 102.0, 100.0, 101.0, 102.0])
    label = group_conditions(np.zeros(6, int), frequency, recording=np.array([0, 0, 0, 1, 1, 1]))
    assert label.tolist() == [0, 1, 2, 0, 1, 2]
