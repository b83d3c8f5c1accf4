"""A value of the reference data beside the value that the package finds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite


@dataclass(frozen=True)
class Compared:
    """One value, expected and found.

    Attributes
    ----------
    check : str
        What is checked: the heading under which values are counted.
    function : str
        Function of the package, or campaign and test.
    value, unit : str
        Name and SI unit of the value.
    expected, found : str
        As text, because a verdict is compared as well as a number, and an expected number may have 50 digits.
    difference, tolerance : float or None
        Found less expected, and the largest difference that passes, in the unit; None for texts.
    good : bool
        Whether the value passes.
    """

    check: str
    function: str
    value: str
    unit: str
    expected: str
    found: str
    difference: float | None
    tolerance: float | None
    good: bool

    @property
    def share(self) -> float:
        """Size of the difference over the tolerance [1]; infinite for one that is no number or a wrong text."""
        if self.difference is None or not isfinite(self.difference) or not self.tolerance:
            return 0.0 if self.good else float("inf")
        return abs(self.difference) / self.tolerance


def number(check: str, function: str, value: str, unit: str, expected: str, found: float, tolerance: float) -> Compared:
    """A number held against an expected one; one that is not finite never passes."""
    difference = found - float(expected)
    good = isfinite(difference) and abs(difference) <= tolerance
    return Compared(check, function, value, unit, expected, repr(float(found)), difference, tolerance, good)


def word(check: str, function: str, value: str, expected: str, found: str) -> Compared:
    """A text held against an expected one."""
    return Compared(check, function, value, "", expected, found, None, None, found == expected)


def failed(check: str, function: str, value: str, why: str) -> Compared:
    """A value that could not be computed at all."""
    return Compared(check, function, value, "", "a value", why, None, None, False)


@dataclass(frozen=True)
class Summary:
    """All values of one check.

    Attributes
    ----------
    check : str
    count, bad : int
        Number of values, and of those that do not pass.
    largest : float [1]
        Largest difference over its tolerance.
    """

    check: str
    count: int
    bad: int
    largest: float


def summaries(found: Sequence[Compared]) -> list[Summary]:
    """The checks in their order, each with its values counted."""
    groups: dict[str, list[Compared]] = {}
    for one in found:
        groups.setdefault(one.check, []).append(one)
    return [
        Summary(check, len(rows), sum(not row.good for row in rows), max(row.share for row in rows))
        for check, rows in groups.items()
    ]
