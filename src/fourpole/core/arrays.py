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


#: Largest size of an array and of a list whose values a short repr shows; longest text of a field, and of all [chars].
_FEW, _LONGEST, _MOST = 4, 80, 900


def short_repr(instance: Any) -> str:
    """A dataclass with its small values, and with the shape or the number of the large ones: below 1,000 characters.

    Examples
    --------
    >>> from fourpole import Phasors
    >>> Phasors.from_polar([10.5, 12.5], 1.0, 2e-3, 1.5)  # doctest: +ELLIPSIS
    Phasors(frequency=[10.5 12.5], amplitudes=<complex128 2×3>, covariance=<float64 2×6×6>, ...)
    """
    parts = [f"{field.name}={_brief(getattr(instance, field.name))}" for field in fields(instance) if field.repr]
    text = ", ".join(parts)
    return f"{type(instance).__name__}({text if len(text) <= _MOST else f'{text[:_MOST]}...'})"


def _brief(value: Any) -> str:
    """A value in a few words."""
    if isinstance(value, np.ndarray):
        if value.size <= _FEW and value.dtype != object:
            return np.array2string(value, precision=6).replace("\n", "")
        return f"<{value.dtype} {'×'.join(map(str, value.shape))}>"
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, str | int | complex) or value is None:
        text = repr(value)
        return text if len(text) <= _LONGEST else f"{text[: _LONGEST - 3]}..."
    if isinstance(value, Mapping):
        names = ", ".join(map(str, value))
        return f"{{{names}}}" if len(names) <= _LONGEST else f"<{len(value)} entries>"
    if isinstance(value, tuple | list | set | frozenset):
        text = f"({', '.join(map(_brief, value))})" if len(value) <= _FEW else ""
        return text if 0 < len(text) <= _LONGEST else f"<{len(value)} items>"
    text = repr(value) if not hasattr(value, "shape") else ""
    return text if 0 < len(text) <= _LONGEST else f"<{type(value).__name__}>"


class ByValue:
    """Base of dataclasses with arrays or tables, declared with ``eq=False``: equal if all fields have equal values.

    Not-a-number equals itself. Instances have no hash. Their repr is short; see `short_repr`.

    Examples
    --------
    >>> from fourpole import Phasors
    >>> one, other = (Phasors.from_polar(10.0, 1.0, 2e-3, angle) for angle in (1.5, 1.4))
    >>> one == Phasors.from_polar(10.0, 1.0, 2e-3, 1.5), one == other
    (True, False)
    """

    __hash__ = None  # type: ignore[assignment]

    def __init_subclass__(cls, **options: Any) -> None:
        """Give a subclass a short repr before its decorator gives it one that prints every value."""
        super().__init_subclass__(**options)
        if "__repr__" not in vars(cls):
            cls.__repr__ = short_repr  # type: ignore[method-assign]

    def __eq__(self, other: object) -> bool:
        if type(other) is not type(self):
            return NotImplemented
        compared = [field.name for field in fields(cast("Any", self)) if field.compare]
        return all(same_value(getattr(self, name), getattr(other, name)) for name in compared)


class ByRows(ByValue):
    """Base of dataclasses whose fields are all arrays with one row per test."""

    def part(self, rows: Any) -> Self:
        """Some of the rows, by anything that indexes an array; a single number gives that row alone."""
        return type(self)(*(np.asarray(getattr(self, field.name))[rows] for field in fields(cast("Any", self))))


def parts(values: ComplexArray, axis: int = -1) -> FloatArray:
    """Real and imaginary part of complex values, along a new axis."""
    return np.stack([values.real, values.imag], axis=axis)


def real_matrix(matrix: ComplexArray) -> FloatArray:
    """The matrix (..., 2r, 2c) on interleaved Re and Im that acts as a complex one (..., r, c).

    >>> real_matrix(np.array([[1.0 + 2.0j]])).tolist()
    [[1.0, -2.0], [2.0, 1.0]]
    """
    matrix = np.asarray(matrix, dtype=complex)
    pairs = np.stack([parts(matrix), parts(1j * matrix)], axis=-1)  # (..., r, c, 2, 2)
    *front, rows, columns = matrix.shape
    return np.ascontiguousarray(np.swapaxes(pairs, -3, -2)).reshape(*front, 2 * rows, 2 * columns)


def inverse_of_two(matrix: FloatArray) -> FloatArray:
    """Inverses of matrices (N, 2, 2), in closed form: LAPACK takes ten times as long for as many small ones.

    Examples
    --------
    >>> inverse_of_two(np.array([[[2.0, 1.0], [1.0, 1.0]]])).tolist()
    [[[1.0, -1.0], [-1.0, 2.0]]]
    """
    (a, b), (c, d) = matrix[:, 0].T, matrix[:, 1].T
    found = np.empty(matrix.shape)
    found[:, 0, 0], found[:, 0, 1], found[:, 1, 0], found[:, 1, 1] = d, -b, -c, a
    found /= (a * d - b * c)[:, None, None]
    return found


def same_value(value: Any, other: Any) -> bool:
    """Whether two values are equal; they may be or hold arrays and tables. Not-a-number equals itself."""
    if isinstance(value, np.ndarray | np.inexact | float) or isinstance(other, np.ndarray):
        value, other = np.asarray(value), np.asarray(other)
        if (value.dtype.kind in "SU") != (other.dtype.kind in "SU"):  # old versions of numpy cannot compare these
            return False
        return np.array_equal(value, other, equal_nan=value.dtype.kind in "fc" and other.dtype.kind in "fc")
    if isinstance(value, Mapping) and isinstance(other, Mapping):
        return value.keys() == other.keys() and all(same_value(value[key], other[key]) for key in value)
    if isinstance(value, tuple | list) and type(value) is type(other):
        return len(value) == len(other) and all(map(same_value, value, other))
    if hasattr(value, "equals") and type(value) is type(other):  # a table or a column of polars
        return bool(value.equals(other))
    return bool(value is other or value == other)
