"""Fits and queries of models whose K* depends on the amplitude of the deflection."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from fourpole.core.arrays import FloatArray
from fourpole.core.condition import AMPLITUDE
from fourpole.errors import ModelError
from fourpole.fitting.amplitude import COLUMN, levels_of, unit_of
from fourpole.fitting.measured import Measured
from fourpole.fitting.modelfile import ModelFile
from fourpole.models.families import by_amplitude
from fourpole.models.interface import Model
from fourpole.models.kraus import LEAST_SPREAD, MOST_INFLATION, Separation, separation
from fourpole.models.operating import Answer, OperatingMap, Purpose
from fourpole.models.surface import BEND
from fourpole.units import shown

#: An amplitude is inside the tested ones up to this ratio beyond their ends.
_NOMINAL_RATIO = 1.02
#: Amplitudes within this ratio are one tested level of a model.
_APART = 1.2


def told_apart(tyre: str, measured: Sequence[Measured], name: str) -> tuple[tuple[Measured, ...], str]:
    """The conditions of a tyre that tell amplitude from frequency, and the measure as a sentence.

    Raises
    ------
    ModelError
        If the amplitude is not known, or no condition tells it from the frequency.
    """
    every = [_separation(one) for one in measured]
    kept = tuple(one for one, found in zip(measured, every, strict=True) if found.possible)
    where = f"{shown(tyre)}: " if tyre else ""
    if not kept:
        raise _cannot_tell(name, where, list(zip(measured, every, strict=True)))
    worst = max((found for found in every if found.possible), key=lambda found: found.inflation)
    text = f"Amplitude and frequency can be told apart: {_measure(worst)}"
    lost = [one.label for one, found in zip(measured, every, strict=True) if not found.possible]
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


def _separation(one: Measured) -> Separation:
    """The separation of amplitude and frequency in a condition."""
    if one.own.amplitude is None:
        raise ModelError(f"the table has no column {shown(COLUMN)}, on which the model depends")
    return separation(one.frequency, one.own.amplitude)


def _measure(found: Separation) -> str:
    """The separation of amplitude and frequency in words."""
    factor = "infinite" if np.isinf(found.inflation) else f"{found.inflation:.3g}"
    if found.inflation <= MOST_INFLATION:
        left = f"ln x has a standard deviation of {found.spread:.2g} at a frequency (least {LEAST_SPREAD:g})"
        return f"variance inflation of the amplitude exponents {factor}, {left}"
    return (
        f"multiple correlation of ln x with frequency {found.correlation:.6g}, variance inflation of the amplitude "
        f"exponents {factor} (limit {MOST_INFLATION:g})"
    )


def _cannot_tell(name: str, where: str, conditions: Sequence[tuple[Measured, Separation]]) -> ModelError:
    """The error that no condition tells amplitude from frequency."""
    best, found = min(conditions, key=lambda pair: (pair[1].inflation, -pair[1].spread))
    several, amplitude = len(conditions) > 1, best.own.amplitude
    assert amplitude is not None
    many = f" in any of {len(conditions)} conditions" if several else ""
    at = f"; the best, {best.label}," if several and best.label else f"; {best.label or 'the tests'}"
    return ModelError(
        f"{where}amplitude and frequency cannot be told apart{many}{at} with deflections of "
        f"{1e3 * amplitude.min():.3g} to {1e3 * amplitude.max():.3g} mm: {_measure(found)}. No number of the Payne "
        "effect follows from these tests: test each frequency at several amplitudes, or fit a model other than "
        f"{name}"
    )


def in_own_unit(file: ModelFile, tyre: str, state: Mapping[str, float]) -> dict[str, float]:
    """The state with the amplitude in the column of the file, where the campaign has one of its own for it."""
    found = dict(state)
    if AMPLITUDE.column not in found:
        return found
    mapped, fits = file.map_entry(tyre), file.model_entry(tyre)
    held = [] if mapped is None else [axis.column for axis in (*mapped.axes, *mapped.constant)]
    held += [] if fits is None else [column for one in fits.conditions for column in one.coordinates]
    own = next((column for column in held if unit_of(column)), AMPLITUDE.column)
    found[own] = found.pop(AMPLITUDE.column) / (unit_of(own) or 1.0)
    return found


def depends_on_amplitude(file: ModelFile, tyre: str) -> bool:
    """Whether K* of a tyre's model depends on the amplitude of the deflection."""
    return any(by_amplitude(one.model) for one in (*file.maps, *file.models) if one.tyre == tyre)


def levels_of_map(file: ModelFile, tyre: str, found: OperatingMap) -> list[float]:
    """The tested amplitudes of a map, or of the condition of a map of one point [m]."""
    entry = file.map_entry(tyre) or file.condition_at(tyre, found.axes.constant)
    return [] if entry is None else entry.amplitude or []


def outside_levels(levels: Sequence[float], amplitude: float | None, *, beyond: bool) -> tuple[str, ...]:
    """Remarks on an amplitude outside the tested ones; ModelError if it is none, or is outside without `beyond`."""
    low, high = (_shown(one) for one in (levels[0], levels[-1]))
    if amplitude is None:
        raise ModelError(
            f"state --amplitude: K* depends on the amplitude of the deflection, tested from {low} to {high}"
        )
    if levels[0] / _NOMINAL_RATIO <= amplitude <= levels[-1] * _NOMINAL_RATIO:
        return ()
    remark = f"an amplitude of {_shown(amplitude)} is outside the tested ones, {low} to {high}"
    if not beyond:
        raise ModelError(f"{remark}: state one inside, or --beyond")
    return (remark,)


def answer_at(
    found: OperatingMap,
    points: FloatArray,
    frequency: FloatArray,
    amplitude: float,
    levels: Sequence[float],
    purpose: Purpose = "next",
) -> Answer:
    """K* at an amplitude [m], with an uncertainty of the law between the tested amplitudes.

    One standard deviation is `BEND` of the change of K* from the tested amplitude below to the one above, and falls to
    zero at both, as on an axis of a map with two values.
    """
    share, low, high = around(np.array([amplitude]), levels)
    here, below, above = (
        replace(found, model=found.model.at_amplitude(one)).ask(points, frequency, purpose)
        for one in (amplitude, low[0], high[0])
    )
    bend = share * (above.stiffness - below.stiffness)
    column = np.stack([bend.real, bend.imag, np.zeros(bend.size)], axis=1)
    covariance = here.covariance + column[:, :, None] * column[:, None, :]
    return Answer.of(here.stiffness, here.k1, covariance, 2 * np.pi * frequency)


def around(amplitude: FloatArray, levels: Sequence[float]) -> tuple[FloatArray, FloatArray, FloatArray]:
    """The uncertainty of the law at amplitudes (N,) [m], and the tested amplitudes below and above each of them.

    The uncertainty (N,) [1] is a fraction of the change of K* between these two.
    """
    tested = np.asarray(levels)
    at = np.clip(np.searchsorted(tested, amplitude), 1, tested.size - 1)
    low, high = tested[at - 1], tested[at]
    place = 2 * np.log(amplitude / low) / np.log(high / low) - 1
    return BEND * np.abs(1 - place**2), low, high


def _shown(amplitude: float) -> str:
    return f"{1e3 * amplitude:.4g} mm"
