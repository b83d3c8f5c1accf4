"""Types of arrays for annotations, and bases of dataclasses that hold arrays."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import Any, Self, TypeAlias, cast

import numpy as np
from numpy.typing import NDArray

FloatArray: TypeAlias = NDArray[np.floating[Any]]
ComplexArray: TypeAlias = NDArray[np.complexfloating[Any, Any]]
BoolArray: TypeAlias = NDArray[np.bool_]
IntArray: TypeAlias = NDArray[np.integer[Any]]


class ByValue:
    """Base of dataclasses with arrays or tables, declared with ``eq=False``: equal if all fields have equal values.

    Not-a-number equals itself. Instances have no hash.

    Examples
    --------
    >>> from fourpole import Phasors
    >>> one, other = (Phasors.from_polar(10.0, 1.0, 2e-3, angle) for angle in (1.5, 1.4))
    >>> one == Phasors.from_polar(10.0, 1.0, 2e-3, 1.5), one == other
    (True, False)
    """

    __hash__ = None  # type: ignore[assignment]

    def __eq__(self, other: object) -> bool:
        if type(other) is not type(self):
            return NotImplemented
        compared = [one.name for one in fields(cast("Any", self)) if one.compare]
        return all(same_value(getattr(self, name), getattr(other, name)) for name in compared)


class ByRows(ByValue):
    """Base of dataclasses whose fields are all arrays with one row per test."""

    def part(self, rows: Any) -> Self:
        """Some of the rows, by anything that indexes an array; a single number gives that row alone."""
        return type(self)(*(np.asarray(getattr(self, one.name))[rows] for one in fields(cast("Any", self))))


def same_value(one: Any, other: Any) -> bool:
    """Whether two values are equal; they may be or hold arrays and tables. Not-a-number equals itself."""
    if isinstance(one, np.ndarray | np.inexact | float) or isinstance(other, np.ndarray):
        one, other = np.asarray(one), np.asarray(other)
        if (one.dtype.kind in "SU") != (other.dtype.kind in "SU"):  # old versions of numpy cannot compare these
            return False
        return np.array_equal(one, other, equal_nan=one.dtype.kind in "fc" and other.dtype.kind in "fc")
    if isinstance(one, Mapping) and isinstance(other, Mapping):
        return one.keys() == other.keys() and all(same_value(one[key], other[key]) for key in one)
    if isinstance(one, tuple | list) and type(one) is type(other):
        return len(one) == len(other) and all(map(same_value, one, other))
    if hasattr(one, "equals") and type(one) is type(other):  # a table or a column of polars
        return bool(one.equals(other))
    return bool(one is other or one == other)
