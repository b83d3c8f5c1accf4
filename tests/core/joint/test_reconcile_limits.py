"""Each limit by which statement and tests are reconciled: just below it one decision, just above it the other."""

from types import SimpleNamespace

import numpy as np
import pytest

from fourpole.core.joint import reconcile, specimens
from fourpole.core.joint.asking import Group, Trial, gain_of, tie
from fourpole.core.joint.scatter import MEDIAN
from fourpole.core.joint.shared import SharedParameter
from fourpole.core.sources import Kind, Source

BELOW, ABOVE = 0.99, 1.01


def trial(name, gain):
    return Trial(group(name), 1.0, gain, None, None)


def group(name, largest=30.0, kind=Kind.GAIN):
    return Group(
        name,
        (SharedParameter(Source(kind, "V2 in F1" if kind is Kind.CROSSTALK else "F1"), "1", 0, 0.0, 1.0),),
        largest,
    )


def tied(*gains):
    """The gains of those that are raised together."""
    return [each.gain for each in tie([trial(str(gain), gain) for gain in gains])]


# Groups that the tests ask for.


@pytest.mark.parametrize(("gain", "raised"), [(4.99, []), (5.01, [5.01])])
def test_a_group_is_raised_from_a_gain_of_five_on(gain, raised):
    assert tied(gain) == raised


@pytest.mark.parametrize(("other", "together"), [(29.9, False), (30.1, True)])
def test_what_explains_the_tests_within_ten_of_the_best_is_raised_with_it(other, together):
    assert tied(40.0, other) == ([40.0, other] if together else [40.0])


@pytest.mark.parametrize(("other", "together"), [(4.99, False), (5.01, True)])
def test_a_group_of_a_tie_has_a_gain_of_its_own(other, together):
    assert tied(12.0, other) == ([12.0, other] if together else [12.0])


@pytest.mark.parametrize(("other", "together"), [(3.4, False), (3.6, True)])
def test_or_almost_that_of_the_best_where_this_is_small(other, together):
    assert tied(5.5, other) == ([5.5, other] if together else [5.5])


def test_the_gain_of_one_column_is_that_of_the_evidence():
    """A column of length 2 that explains 10 of a residual: the best factor, and the gain by the formula."""
    column, target = np.array([[2.0], [0.0]]), np.array([10.0, 3.0])
    gain, factor = gain_of(column, target, group("gain"))
    by_hand = [
        0.5 * 20.0**2 * t**2 / (1 + 4 * t**2) - 0.5 * np.log(1 + 4 * t**2) - 0.5 * np.log(max(t, 1.0))
        for t in np.geomspace(0.3, 30.0, 1000)
    ]
    assert gain == pytest.approx(max(by_hand), abs=0.01)
    assert 3.0 < factor < 6.0


def test_a_rare_error_needs_more_evidence():
    column, target = np.array([[2.0]]), np.array([10.0])
    rare, usual = (gain_of(column, target, group("group", kind=kind))[0] for kind in (Kind.CROSSTALK, Kind.GAIN))
    assert usual - rare == pytest.approx(3.0)


# Tests that do not go with the others.


def outliers(whole, label=None, rigid=None, before=None):
    """The tests that are flagged; None where too many would be."""
    count = len(whole)
    observed = SimpleNamespace(
        rigid=np.zeros(count, dtype=bool) if rigid is None else rigid, mass_at=np.full(count, -1)
    )
    label = np.arange(count) if label is None else np.array(label)
    conditions = SimpleNamespace(label=label, sizes=np.bincount(label))
    here = SimpleNamespace(
        problem=SimpleNamespace(observed=observed, conditions=conditions),
        outlier=np.ones(count) if before is None else before,
    )
    found, many = specimens._outliers(here, SimpleNamespace(whole=np.array(whole, dtype=float)))
    assert not (many and found.any())
    return None if many else np.flatnonzero(found).tolist()


@pytest.mark.parametrize(("usual", "limit"), [(0.5, 50.0), (MEDIAN, 50.0), (2 * MEDIAN, 100.0)])
def test_an_outlier_is_fifty_times_the_usual_residual(usual, limit):
    """The usual one is the median, but no smaller than that of chance."""
    rest = [usual] * 19
    assert outliers([*rest, BELOW * limit]) == []
    assert outliers([*rest, ABOVE * limit]) == [19]


def test_more_than_a_tenth_of_all_are_no_outliers():
    assert outliers([1.0] * 18 + [60.0] * 2) == [18, 19]
    assert outliers([1.0] * 17 + [60.0] * 3) is None


def test_most_of_a_kind_are_no_outliers():
    """More than 0.35 of the rigid blocks: 7 of 20 are that, 8 are not."""
    rigid = np.arange(100) >= 80
    assert outliers([1.0] * 93 + [60.0] * 7, rigid=rigid) == [*range(93, 100)]
    assert outliers([1.0] * 92 + [60.0] * 8, rigid=rigid) is None


def test_of_three_tests_of_a_condition_the_worst_goes_first():
    assert outliers([1.0] * 37 + [60.0, 60.0, 70.0], label=[*range(37), 37, 37, 37]) == [39]


@pytest.mark.parametrize(("share", "both"), [(0.99 * 0.5, False), (1.01 * 0.5, True)])
def test_of_two_tests_that_disagree_both_are_flagged_unless_the_data_say_which(share, both):
    """They disagree with each other alone: one residual is that of the other, but for the weights."""
    whole = [1.0] * 38 + [share * 200.0, 200.0]
    assert outliers(whole, label=[*range(38), 38, 38]) == ([38, 39] if both else [39])


def test_two_tests_have_no_outlier_and_three_may_have_one():
    assert outliers([1.0, 100.0]) == []
    assert outliers([1.0, 1.0, 100.0]) == [2]


# Noise.


@pytest.mark.parametrize(("residual", "factor"), [(2.0, 1.0), (0.0, 4 / 6), (50.0, 54 / 6)])
def test_the_noise_of_a_test_follows_that_of_all_with_four_degrees_of_freedom(residual, factor):
    left = SimpleNamespace(rig=np.array([residual]), rig_dof=np.array([2.0]))
    assert reconcile._each(left, 1.0)[0] == pytest.approx(factor)
