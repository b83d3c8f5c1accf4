"""Conditions: the state in which a specimen is tested, and the rule by which two tests have the same condition.

A condition is a specimen with a value on each axis: pressure, preload, temperature, and the columns of tests.csv that a
campaign names. The amplitude of the deflection and the added mass are not axes: an added mass changes the amplitude,
but not the state of the specimen.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from fourpole import quantities as q
from fourpole.core.arrays import FloatArray

#: A number in the unit of its column, a text, or None where nothing is stated.
Value = float | str | None


@dataclass(frozen=True)
class Axis:
    """One axis of a condition, with the tolerance within which two values on it are the same.

    Attributes
    ----------
    name : str
    head : str
        Head of its column in the result tables; empty if the head is the name.
    relative : float [1]
        Tolerance as a fraction of the larger value.
    absolute : float, in the unit of the column
        Tolerance that is added to the relative one.
    text : bool
        True if the values are texts, which are the same only if they are equal.
    """

    name: str
    head: str = ""
    relative: float = 0.0
    absolute: float = 0.0
    text: bool = False

    @property
    def column(self) -> str:
        """The head of its column in the result tables."""
        return self.head or self.name

    def same(self, value: Value, other: Value, *, blank: bool = False) -> bool:
        """Whether two values are the same; with `blank`, a value that is not stated equals every other value.

        >>> pressure = AXES[0]
        >>> pressure.same(1.70e5, 1.73e5), pressure.same(1.70e5, 1.74e5), pressure.same(1.70e5, None)
        (True, False, False)
        """
        if value is None or other is None:
            return blank or value is other
        if isinstance(value, str) or isinstance(other, str):
            return value == other
        return abs(value - other) <= self.relative * max(abs(value), abs(other)) + self.absolute

    def groups(self, values: Iterable[Value]) -> np.ndarray:
        """Number of the group of each value, from 0 in rising order; values that are not stated form the last group."""
        return Sameness((self,)).groups([Condition("", (value,)) for value in values])

    def middles(self, values: FloatArray) -> tuple[np.ndarray, list[float]]:
        """Number of the group of each value, as `groups`, and the median of each group.

        Values that are not stated are not-a-number, and so is the median of their group.

        >>> numbers, medians = AXES[0].middles(np.array([2.0e5, 1.0e5, np.nan, 2.02e5]))
        >>> numbers.tolist(), medians
        ([1, 0, 2, 1], [100000.0, 201000.0, nan])
        """
        groups = self.groups(value if np.isfinite(value) else None for value in values.tolist())
        return groups, [float(np.median(values[groups == at])) for at in range(int(groups.max(initial=-1)) + 1)]


#: The axes that every campaign has.
PRESSURE = Axis("pressure", q.PRESSURE.head, relative=0.02)
PRELOAD = Axis("preload", q.PRELOAD.head, relative=0.01)
AXES = (PRESSURE, PRELOAD, Axis("temperature", q.TEMPERATURE.head, absolute=5.0))
#: The amplitude of the deflection, 0-to-peak: a coordinate of K* like the frequency, and no part of a condition.
AMPLITUDE = Axis("amplitude", q.DEFLECTION_AMPLITUDE.head, relative=0.05)
#: Relative change of K* per kelvin [1/K] that is assumed where none is stated: that of tread rubber.
TEMPERATURE_SENSITIVITY = 0.01
#: Relative tolerance within which two tests have the same frequency, which is no part of a condition.
SAME_FREQUENCY = 0.01
#: Frequencies that figures, words and exports show as one: each may be at an end of the tolerance.
FREQUENCY = Axis("frequency", q.FREQUENCY.head, relative=2 * SAME_FREQUENCY)
#: Relative tolerance of a numeric axis for which none is stated.
_OWN = 0.01


def axis_of(column: str) -> Axis:
    """The axis of a column of the result tables; one without a tolerance of its own has a relative one of 1 %."""
    return next((axis for axis in (*AXES, AMPLITUDE) if axis.column == column), Axis(column, relative=_OWN))


def temperature_std(temperature: FloatArray, group: np.ndarray, sensitivity: float) -> FloatArray:
    """Standard uncertainty (N,) [1] of log K* of each test, for its temperature apart from the mean of its group.

    Parameters
    ----------
    temperature : (N,) float array [degC]
        Not-a-number where it is not stated, which gives 0.
    group : (N,) int array
        Tests of equal number have one condition; a negative number gives 0.
    sensitivity : float [1/K]
        Relative change of K* per kelvin.

    Examples
    --------
    >>> temperature_std(np.array([20.0, 24.0, 30.0]), np.array([0, 0, 1]), 0.01).round(9).tolist()
    [0.02, 0.02, 0.0]
    """
    known = np.isfinite(temperature) & (group >= 0)
    result = np.zeros(temperature.size)
    for number in np.unique(group[known]):
        rows = known & (group == number)
        result[rows] = sensitivity * np.abs(temperature[rows] - temperature[rows].mean())
    return result


@dataclass(frozen=True)
class Condition:
    """A specimen and its value on each axis of a `Sameness`."""

    specimen: str
    values: tuple[Value, ...]


@dataclass(frozen=True)
class Sameness:
    """The rule of the same condition: equal specimens, and values on each of these axes within their tolerances."""

    axes: tuple[Axis, ...] = AXES

    @property
    def further(self) -> tuple[Axis, ...]:
        """The axes that the campaign itself names."""
        return tuple(axis for axis in self.axes if axis not in AXES)

    def without(self, *names: str) -> Sameness:
        """The same rule on fewer axes."""
        return Sameness(tuple(axis for axis in self.axes if axis.name not in names))

    def over(self, columns: Iterable[str]) -> Sameness:
        """The same rule with the axes of further columns."""
        known = {axis.column for axis in self.axes}
        return Sameness((*self.axes, *(axis_of(column) for column in dict.fromkeys(columns) if column not in known)))

    def same(self, condition: Condition, other: Condition, *, blank: bool = False) -> bool:
        """Whether two conditions are the same; with `blank`, a value that is not stated equals every other value."""
        pairs = zip(self.axes, condition.values, other.values, strict=True)
        return condition.specimen == other.specimen and all(axis.same(a, b, blank=blank) for axis, a, b in pairs)

    def groups(self, conditions: Sequence[Condition]) -> np.ndarray:
        """Number of the group of each condition, from 0.

        Any two conditions of a group are the same. Conditions are taken in rising order, and each joins the first group
        with whose members it agrees; the order of `conditions` has therefore no influence.

        >>> bar = [Condition("a", (p, None, None)) for p in (2.0e5, 1.7e5, 1.702e5)]
        >>> Sameness().groups([*bar, Condition("b", (1.7e5, None, None))]).tolist()
        [1, 0, 0, 2]
        """
        number: dict[Condition, int] = {}
        # Lowest and highest value on each axis of each group: a condition that is like both is like all members.
        ends: list[tuple[Condition, Condition]] = []
        first = 0
        for condition in sorted(set(conditions), key=_place):
            # Conditions rise on the first axis: a group too far below this condition is too far below all later ones.
            while first < len(ends) and not self._near(ends[first][0], condition):
                first += 1
            fits = (place for place in range(first, len(ends)) if all(self.same(condition, end) for end in ends[place]))
            place = next(fits, len(ends))
            if place == len(ends):
                ends.append((condition, condition))
            low, high = ends[place]
            ends[place] = _end(low, condition, lowest=True), _end(high, condition, lowest=False)
            number[condition] = place
        return np.array([number[condition] for condition in conditions], dtype=np.int64)

    def _near(self, condition: Condition, other: Condition) -> bool:
        """Whether the specimens are the same and the values on the first axis are within its tolerance."""
        return condition.specimen == other.specimen and all(
            axis.same(a, b) for axis, a, b in zip(self.axes[:1], condition.values, other.values, strict=False)
        )


def _place(condition: Condition) -> tuple[str, list[tuple[bool, float | str]]]:
    """Sort key of a condition: specimen, then the value on each axis; a value that is not stated comes last."""
    return condition.specimen, [(value is None, 0.0 if value is None else value) for value in condition.values]


def _end(end: Condition, condition: Condition, *, lowest: bool) -> Condition:
    """Condition with the lower, or the higher, value of two conditions on each axis."""
    pairs = zip(end.values, condition.values, strict=True)
    return Condition(end.specimen, tuple(a if a is None or b is None or (a < b) == lowest else b for a, b in pairs))  # type: ignore[operator]
