"""The order in which a reader sees findings, and which ones are too small."""

import pytest
from tests.findings.designed import Tables, Tyre

from fourpole.findings import by_size, findings
from fourpole.findings.facts import in_order
from fourpole.findings.trends import Comparison, Level, Trend
from fourpole.quantities import K2


@pytest.mark.parametrize("u", [0.0001, 0.01])
def test_the_largest_effects_come_first_and_small_ones_only_if_sure(u):
    second = Tyre(k1=lambda p, load: 98e3 + 1e-2 * p + load, k2=80.3e3, c=lambda p, load, f: 700.0 + 1e-3 * p + 9 * f)
    every = findings(Tables({"A": Tyre(), "B": second}, u=u).results())
    shown = by_size(every)
    assert {id(one) for one in shown} <= {id(one) for one in every}
    for topic in dict.fromkeys(one.topic for one in shown):
        sizes = [abs(one.effect) for one in shown if one.topic == topic and isinstance(one.detail, Comparison | Trend)]
        assert sizes == sorted(sizes, reverse=True)
    left = [one for one in every if one not in shown]
    compared = [one.quantity.key for one in left if isinstance(one.detail, Comparison)]
    assert (K2.key in compared) == (u == 0.01)  # 0.4 %
    assert all(isinstance(one.detail, Comparison | Trend) for one in left)
    assert all(abs(one.effect) < 0.01 and abs(one.effect) <= 3 * one.std for one in left)
    kinds = [type(one.detail) for one in shown if one.topic == "damping"]
    assert Level not in kinds[: kinds.index(Trend)]


def test_names_are_sorted_by_their_numbers_decimals_too_but_the_parts_of_a_date_one_by_one():
    names = ("2026.9.1", "2026.10.1", "D2", "D10", "a_1bar", "a_1.35bar", "a_1.7bar")
    assert in_order(reversed(names)) == names
