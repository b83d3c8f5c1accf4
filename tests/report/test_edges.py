"""Numbers that decide what a report says of the limits of a result: a case just inside each, and one just outside.

The cases have the documented limit as a literal number, so that a limit which only moves fails here.
"""

from types import SimpleNamespace
from unittest.mock import MagicMock, patch

import pytest

from fourpole import quantities as q
from fourpole.core.sources import Kind, Source
from fourpole.report import front
from fourpole.report.words import limits


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


#: Name of the number -> what it decides as a function of a case, and the cases with their decisions.
EDGES = {
    "model that is not to be trusted, 1 %": (poor, {0.0099: 0, 0.0101: 1}),
    "source of most of an uncertainty, half of its square": (
        lambda x: said(x, 0.0, "makes most of"), {0.495: False, 0.505: True},
    ),
    "second source that is named, a tenth of the square": (
        lambda x: said(0.6, x, "Next is"), {0.099: False, 0.101: True},
    ),
}  # fmt: skip


@pytest.mark.parametrize(("decided", "cases"), EDGES.values(), ids=EDGES)
def test_a_number_decides_between_two_cases(decided, cases):
    assert {case: decided(case) for case in cases} == cases
