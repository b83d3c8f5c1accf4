"""Two steps of a reduction that a library in C may do: reading the decimals of a text, and fitting sines to a track.

The library is built of `kernel.c`. The core opens no file: `fourpole.io.kernel` finds and loads it. Where there is
none, and in cases that it leaves, a function here returns None; the caller then goes on with numpy, which is the oracle
of the tests. Arrays are handed over as contiguous ones of double precision, and are copied if they are others.
"""

from __future__ import annotations

import ctypes
from collections.abc import Iterator, Sequence
from functools import cache
from math import prod
from typing import Any

import numpy as np

from fourpole.core.arrays import BoolArray, FloatArray
from fourpole.face import load

#: Types of the functions: result, arguments.
_SIZE, _ARRAY, _CHAR = ctypes.c_ssize_t, ctypes.c_void_p, ctypes.c_int
_FUNCTIONS = {
    "fp_cells": (_SIZE, [ctypes.c_char_p, _SIZE, _CHAR, _CHAR, _CHAR, _SIZE, _ARRAY, _ARRAY, _SIZE]),
    "fp_fit": (_SIZE, [_ARRAY] * 3),
}
_KINDS = {"f": np.float64, "c": np.complex128, "i": np.int64, "b": np.float64}
#: What fp_fit returns if it needs moments at further frequencies.
_FAR = 1


class Structure(ctypes.Structure):
    """Arguments of the library, which keeps the arrays that it points to.

    Parameters
    ----------
    values : int, float, array or None
        The fields in their order; an array of other precision or order is copied.
    """

    def __init__(self, *values: Any) -> None:
        self.held = [_contiguous(one) if isinstance(one, np.ndarray) else one for one in values]
        super().__init__(*(_address(one) if isinstance(one, np.ndarray) else one for one in self.held))


def _contiguous(array: np.ndarray) -> np.ndarray:
    return np.ascontiguousarray(array, dtype=_KINDS[array.dtype.kind])


def _address(array: np.ndarray) -> int:
    address: int = array.__array_interface__["data"][0]  # a third of the time of `ctypes.data`
    return address


def _fields(kind: type, names: str) -> Iterator[tuple[str, Any]]:
    return ((name, kind) for name in names.split())


class Layout(Structure):
    """The rows of a fit, as `terms._Layout`."""

    _fields_ = (
        *_fields(_SIZE, "rows fitted sines"),
        *_fields(_ARRAY, "seconds frequency power kept below above rows_of of_below of_above"),
    )


class Track(Structure):
    """A track with the moments of its samples, as `sums.Blocks`."""

    _fields_ = (
        *_fields(_SIZE, "channels count bases"),
        *_fields(ctypes.c_double, "rate half length"),
        *_fields(_ARRAY, "base drift by_sine by_cosine still moments"),
    )


class _Fit(Structure):
    """A fit, with what is found of it in one array; where its parts begin is for the library alone."""

    _fields_ = (
        *_fields(_SIZE, "harmonics lines rounds free"),
        *_fields(_ARRAY, "energy informing weight found"),
        ("parts", _ARRAY * 8),
    )


@cache
def library() -> ctypes.CDLL | None:
    """The library, loaded when it is first asked for; None if numpy does all."""
    loaded: ctypes.CDLL | None = load("fourpole.io.kernel.library")()
    for name, (result, arguments) in _FUNCTIONS.items() if loaded is not None else ():
        function = getattr(loaded, name)
        function.restype, function.argtypes = result, arguments
    return loaded


def cells(text: bytes, separator: str, ending: bytes, decimal: str, wanted: Sequence[int], width: int) -> Any:
    """Columns (wanted, rows) of a table of text.

    None if a wanted cell is no plain decimal, or not surely rounded to its nearest float, or if a row is not full.

    Parameters
    ----------
    text : bytes
        Whole lines without quotes.
    separator, ending, decimal : str, bytes, str
        What ends a cell and a line, and the decimal sign; a character each.
    wanted : sequence of int
        Indices of the columns, in ascending order.
    width : int
        Number of columns of the table.
    """
    if (loaded := library()) is None:
        return None
    place = np.full(width, -1, dtype=np.int64)
    room = int(np.count_nonzero(np.frombuffer(text, dtype=np.uint8) == ending[0])) + 1
    place[list(wanted)] = np.arange(len(wanted))
    columns, signs = np.empty((len(wanted), room)), (ord(separator), ending[0], ord(decimal))
    rows = loaded.fp_cells(text, len(text), *signs, width, _address(place), _address(columns), room)
    return None if rows < 0 else columns[:, :rows]


def fit(
    layout: Layout,
    blocks: Any,
    terms: Any,
    energy: FloatArray,
    *,
    rounds: int = 0,
    free: bool = True,
    informing: BoolArray | None = None,
    weight: FloatArray | None = None,
) -> tuple[float, FloatArray, list[Any], float] | None:
    """Fundamental and lines [rad/s], the further attributes of a `SineFit` from `inner` on, and the fundamental's u.

    Parameters
    ----------
    layout, blocks, terms : Layout, sums.Blocks, terms.Terms
        Rows of the fit, samples without gaps, frequencies to begin with.
    energy : (channels,) float array
        Energy of the samples.
    rounds, free, informing, weight
        Largest number of steps, and what `refine` documents.
    """
    if (loaded := library()) is None:
        return None
    size, channels, lines = layout.fitted, energy.size, terms.lines.size
    shapes = (layout.rows, layout.rows), (size, size), (size, channels), (layout.rows - size, channels), (channels,)
    ends = np.cumsum([3 * (1 + lines), *map(prod, shapes)])
    whole = np.zeros(ends[-1])
    frequency = whole[: 1 + lines]
    found = [whole[a:b].reshape(shape) for a, b, shape in zip(ends, ends[1:], shapes, strict=False)]
    frequency[0], frequency[1:] = terms.omega, terms.lines
    made = _Fit(terms.harmonics, lines, rounds, free, energy, informing, weight, whole)
    for _ in range(2 + rounds):
        state = loaded.fp_fit(*map(ctypes.addressof, (layout, blocks.handed, made)))
        if state != _FAR:
            break
        blocks.reach(float(frequency[0]), terms.harmonics, frequency[1:])
    return None if state else (float(frequency[0]), frequency[1:], found, float(whole[2 * (1 + lines)]))
