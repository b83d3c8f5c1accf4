"""The amplitude of the deflection as a coordinate of K*: its column, and the conditions that tell it from frequency."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import polars as pl

from fourpole import quantities as q
from fourpole.core.alone import deflection_amplitude
from fourpole.core.arrays import FloatArray
from fourpole.core.condition import FREQUENCY, Axis, Sameness
from fourpole.errors import ModelError, UnitError
from fourpole.models.separation import LEAST_SPREAD, MOST_INFLATION, Separation, separation
from fourpole.units import column_unit, shown, unit_scale

if TYPE_CHECKING:
    from fourpole.fitting.measured import Measured
    from fourpole.models.interface import Model

#: Column of the 0-to-peak amplitude of the deflection, and its name on the command line.
COLUMN, NAME = q.DEFLECTION_AMPLITUDE.head, "amplitude"
_NAMES = (q.DEFLECTION_AMPLITUDE.name, NAME)
#: Columns from which it follows in a table without it, such as older versions wrote.
_MOTION = tuple(one.head for one in (q.FREQUENCY, q.F1, q.V1, q.V2, q.PHASE_V2, q.STORAGE, q.LOSS))
#: Amplitudes within this ratio are one level.
LEVEL = 1.05
#: Amplitudes within this ratio are one tested level of a model.
_APART = 1.2
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
        for here in _split(frequency[rows]):
            low, high = amplitude[rows[here]].min(), amplitude[rows[here]].max()
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


def _split(frequency: FloatArray) -> list[np.ndarray]:
    """Places of equal frequencies."""
    label = FREQUENCY.groups(frequency.tolist())
    return [np.flatnonzero(label == one) for one in np.unique(label)]


@dataclass(frozen=True)
class Told:
    """The separation of amplitude and frequency in one condition, in words that a message or a file states."""

    label: str
    least: float
    most: float
    found: Separation

    @property
    def measure(self) -> str:
        """The measure in words."""
        one = self.found
        factor = "infinite" if np.isinf(one.inflation) else f"{one.inflation:.3g}"
        if one.inflation <= MOST_INFLATION:
            left = f"ln x has a standard deviation of {one.spread:.2g} at a frequency (least {LEAST_SPREAD:g})"
            return f"variance inflation of the amplitude exponents {factor}, {left}"
        return (
            f"multiple correlation of ln x with frequency {one.correlation:.6g}, variance inflation of the amplitude "
            f"exponents {factor} (limit {MOST_INFLATION:g})"
        )


def told_apart(tyre: str, measured: Sequence[Measured], name: str) -> tuple[tuple[Measured, ...], str]:
    """The conditions of a tyre that tell amplitude from frequency, and the measure as a sentence.

    Raises
    ------
    ModelError
        If the amplitude is not known, or no condition tells it from the frequency.
    """
    every = [_told(one) for one in measured]
    kept = tuple(one for one, each in zip(measured, every, strict=True) if each.found.possible)
    where = f"{shown(tyre)}: " if tyre else ""
    if not kept:
        raise _cannot_tell(name, where, every)
    worst = max((one for one in every if one.found.possible), key=lambda one: one.found.inflation)
    text = f"Amplitude and frequency can be told apart: {worst.measure}"
    lost = [one.label for one in every if not one.found.possible]
    if lost:
        text += (
            f". In {len(lost)} conditions they cannot be told apart, and these are not fitted: {'; '.join(lost[:4])}"
        )
    return kept, text


def tested(measured: Sequence[Measured], model: Model) -> list[float] | None:
    """The levels of the amplitude [m], rising, with the ends that all conditions reach; None for another model."""
    known = [one.own.amplitude for one in measured if one.own.amplitude is not None]
    if not model.by_amplitude or not known:
        return None
    low, high = max(float(one.min()) for one in known), min(float(one.max()) for one in known)
    every = np.concatenate(known)
    if low >= high:
        low, high = float(every.min()), float(every.max())
    level = levels_of(every, _APART)
    inner = [float(np.exp(np.mean(np.log(every[level == one])))) for one in np.unique(level)]
    return [low, *(one for one in inner if low * _APART < one < high / _APART), high]


def _told(one: Measured) -> Told:
    """The separation of amplitude and frequency in a condition."""
    amplitude = one.own.amplitude
    if amplitude is None:
        raise ModelError(f"the table has no column {shown(COLUMN)}, on which the model depends")
    found = separation(one.frequency, amplitude)
    return Told(one.label, float(amplitude.min()), float(amplitude.max()), found)


def _cannot_tell(name: str, where: str, conditions: Sequence[Told]) -> ModelError:
    """The error that no condition tells amplitude from frequency."""
    best = min(conditions, key=lambda one: (one.found.inflation, -one.found.spread))
    many = f" in any of {len(conditions)} conditions" if len(conditions) > 1 else ""
    at = f"; the best, {best.label}," if len(conditions) > 1 and best.label else f"; {best.label or 'the tests'}"
    return ModelError(
        f"{where}amplitude and frequency cannot be told apart{many}{at} with deflections of {1e3 * best.least:.3g} to "
        f"{1e3 * best.most:.3g} mm: {best.measure}. No number of the Payne effect follows from these tests: test each "
        f"frequency at several amplitudes, or fit a model other than {name}"
    )
