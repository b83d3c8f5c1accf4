"""The amplitude of the deflection as a coordinate of K*: its column and its levels in tables."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
import polars as pl

from fourpole import quantities as q
from fourpole.core.alone import deflection_amplitude
from fourpole.core.arrays import FloatArray
from fourpole.core.condition import FREQUENCY, Axis, Sameness
from fourpole.errors import UnitError
from fourpole.units import column_unit, unit_scale

#: Column of the 0-to-peak amplitude of the deflection, and its name on the command line.
COLUMN, NAME = q.DEFLECTION_AMPLITUDE.head, "amplitude"
_NAMES = (q.DEFLECTION_AMPLITUDE.name, NAME)
#: Columns from which it follows in a table without it, such as older versions wrote.
_MOTION = tuple(one.head for one in (q.FREQUENCY, q.F1, q.V1, q.V2, q.PHASE_V2, q.STORAGE, q.LOSS))
#: Amplitudes within this ratio are one level.
LEVEL = 1.05
#: Largest over smallest amplitude of tests of one condition and frequency without a note.
_MIXED = 2.0


def unit_of(column: str) -> float | None:
    """SI value of the unit of a column of the amplitude of the deflection; None for another column.

    Examples
    --------
    >>> unit_of("amplitude [mm]"), unit_of("deflection amplitude [m]"), unit_of("preload [N]")
    (0.001, 1.0, None)
    """
    name, unit = column_unit(column)
    if name not in _NAMES or unit is None:
        return None
    try:
        return unit_scale(unit, "displacement")
    except UnitError:
        return None


def with_amplitude(frame: pl.DataFrame) -> pl.DataFrame:
    """The table with the amplitude of the deflection in SI, if it has it under another name or in another unit."""
    if COLUMN in frame.columns:
        return frame
    for column in frame.columns:
        if scale := unit_of(column):
            return frame.with_columns(pl.Series(COLUMN, scale * _floats(frame[column])))
    return frame.with_columns(pl.Series(COLUMN, _computed(frame))) if set(_MOTION) <= set(frame.columns) else frame


def _computed(frame: pl.DataFrame) -> FloatArray:
    """The amplitude (N,) [m] from the velocities of both sides, or from force and K* where there is no V2."""
    f, f1, v1, v2, turn, real, imag = (_floats(frame[name]) for name in _MOTION)
    omega = 2 * np.pi * np.where(f > 0, f, np.nan)
    return deflection_amplitude(f1, v1, v2 * np.exp(1j * turn), omega, stiffness=real + 1j * imag)


def _floats(column: pl.Series) -> FloatArray:
    numbers = column if column.dtype.is_numeric() else column.cast(pl.String).str.strip_chars()
    return np.asarray(numbers.cast(pl.Float64, strict=False).fill_null(np.nan).to_numpy(), dtype=float)


def without_amplitude(axes: Iterable[Axis]) -> tuple[Axis, ...]:
    """The axes that are no amplitude of the deflection."""
    return tuple(axis for axis in axes if axis.text or unit_of(axis.column) is None)


def columns_of(over: Sequence[str]) -> list[str]:
    """Columns of `--over`: the amplitude by its name, or in another unit, is the column of dynamic.csv."""
    return [COLUMN if one.strip() == NAME or unit_of(one) else one for one in over]


def amplitudes_of(table: pl.DataFrame) -> FloatArray:
    """The amplitude of the deflection (N,) [m] of each row of a table of results; not-a-number if it is not known."""
    found = with_amplitude(table)
    return _floats(found[COLUMN]) if COLUMN in found.columns else np.full(table.height, np.nan)


def levels_of(amplitude: FloatArray, ratio: float = LEVEL) -> np.ndarray:
    """Number of the level of each amplitude (N,), from 0 in rising order; a level is as wide as `ratio`.

    Examples
    --------
    >>> levels_of(np.array([1e-3, 1e-4, 1.02e-3])).tolist()
    [1, 0, 1]
    """
    order = np.argsort(amplitude, kind="stable")
    rising = np.log(amplitude[order])
    found = np.zeros(amplitude.size, dtype=int)
    first, level = -np.inf, -1
    for at, value in zip(order.tolist(), rising.tolist(), strict=True):
        if value > first + np.log(ratio):
            first, level = value, level + 1
        found[at] = level
    return found


def mixed(label: np.ndarray, frequency: FloatArray, amplitude: FloatArray | None, rule: Sameness) -> list[str]:
    """A note that tests of one condition and frequency have different amplitudes, where these are no axis of the rule.

    Parameters
    ----------
    label : (N,) int array
        Number of the condition of each test.
    frequency, amplitude : (N,) float arrays [Hz], [m]
    rule : Sameness
    """
    if amplitude is None or len(without_amplitude(rule.axes)) < len(rule.axes):
        return []
    worst, ends = _MIXED, None
    for one in np.unique(label):
        rows = np.flatnonzero((label == one) & np.isfinite(amplitude) & (np.nan_to_num(amplitude) > 0))
        same = FREQUENCY.groups(frequency[rows].tolist())
        for level in np.unique(same):
            low, high = amplitude[rows[same == level]].min(), amplitude[rows[same == level]].max()
            if high > worst * low:
                worst, ends = high / low, (low, high)
    if ends is None:
        return []
    low, high = (f"{1e3 * one:.3g}" for one in ends)
    text = (
        f"tests of one condition and frequency have amplitudes of {low} to {high} mm: K* "
        "counts as the same at all of them, and what it differs as an error of the model; fit kraus, or state --over "
        "amplitude"
    )
    return [text]
