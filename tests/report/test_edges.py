"""Numbers that decide what a report says of the limits of a result: a case just inside each, and one just outside.

The cases have the documented limit as a literal number, so that a limit which only moves fails here.
"""

from types import SimpleNamespace
from unittest.mock import MagicMock, patch

import pytest

from fourpole import quantities as q
from fourpole.core.sources import Kind, Source
from fourpole.report import front
from fourpole.report import standards as measures
from fourpole.report.digits import decimals_of, with_u
from fourpole.report.words import limits, plan, rig


def poor(discrepancy):
    """Number of sentences on models that are not to be trusted."""
    model = SimpleNamespace(tyre="a", discrepancy=discrepancy, conditions=[SimpleNamespace(verdict=None)])
    return len(front._misfits(SimpleNamespace(models=SimpleNamespace(models=[model])), scattered=False))


def said(first, second, words):
    """Whether words are said of a limit, by the shares of the two largest sources of the variance."""
    shares = {Source(Kind.RIG_VALUE, "moving_mass").text: first, Source(Kind.GAIN, "F1").text: second}
    found = {"_median_shares": lambda rows: list(shares.items()), "_relative": lambda *given, **how: None}
    with patch.multiple(limits, **found, remedy=lambda *given: "more"):
        return words in limits._limit("", q.K2.column, MagicMock(), MagicMock(), MagicMock()).text


def hidden(limit, unit, stated=0.0, std=1.0):
    """Whether the tests would show no plausible error of a value, by the smallest that they show."""
    value = SimpleNamespace(finding="", detection_limit=limit, unit=unit, stated=stated, stated_std=std)
    return rig.ShownValue.hidden.fget(value)


def mark(left):
    """What is said of a remedy that leaves this share of the uncertainty."""
    found = SimpleNamespace(wanted=0.1, now=SimpleNamespace(worst=1.0))
    with patch.multiple(plan, _duration=lambda minutes: "", _leaves=lambda outcome: ""):
        return plan._way(SimpleNamespace(worst=left, minutes=1.0, text=""), found).mark


def levels(decibel):
    """Number of changes of force over deflection between two levels that are apart by this."""
    rows = [
        {q.F1.head: 1.0, q.DEFLECTION_AMPLITUDE.head: size, q.TYRE.head: "a"} for size in (1.0, 10 ** (decibel / 20))
    ]
    facts = SimpleNamespace(used_dynamic=rows, key=lambda row, axes: ())
    with patch.object(measures, "Facts", SimpleNamespace(of=lambda results: facts)):
        return len(measures._linearity(None))


#: Name of the number -> what it decides as a function of a case, and the cases with their decisions.
EDGES = {
    "model that is not to be trusted, 1 %": (poor, {0.0099: 0, 0.0101: 1}),
    "source of most of an uncertainty, half of its square": (
        lambda x: said(x, 0.0, "makes most of"), {0.495: False, 0.505: True},
    ),
    "second source that is named, a tenth of the square": (
        lambda x: said(0.6, x, "Next is"), {0.099: False, 0.101: True},
    ),
    "largest error that is plausible, 100 %": (lambda x: hidden(x, "%"), {99.0: False, 101.0: True}),
    "largest error that is plausible, 90°": (lambda x: hidden(x, "°"), {89.1: False, 90.9: True}),
    "largest error that is plausible, 6 u": (
        lambda x: hidden(x, "kg", 0.1, 1.0), {5.94: False, 6.06: True},
    ),
    "remedy without a gain, 98 %": (mark, {0.975: "not enough", 0.985: "no gain"}),
    "levels that show whether a specimen is linear, 10 dB": (levels, {9.9: 0, 10.1: 1}),
    "uncertainty that is shown, 1e-8": (lambda x: "±" in with_u(1.0, x), {0.98e-8: False, 1.02e-8: True}),
    "number without a power of ten, 1e7": (
        lambda x: decimals_of(x) is not None, {0.99e7: True, 1.01e7: False},
    ),
}  # fmt: skip


@pytest.mark.parametrize(("decided", "cases"), EDGES.values(), ids=EDGES)
def test_a_number_decides_between_two_cases(decided, cases):
    assert {case: decided(case) for case in cases} == cases
