"""Queries of models whose K* depends on the amplitude of the deflection."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from fourpole.core.arrays import FloatArray
from fourpole.core.condition import AMPLITUDE
from fourpole.errors import ModelError
from fourpole.fitting.amplitude import unit_of
from fourpole.fitting.modelfile import ModelFile
from fourpole.models.families import by_amplitude
from fourpole.models.operating import Answer, OperatingMap
from fourpole.models.surface import BEND

#: An amplitude is inside the tested ones up to this ratio beyond their ends.
_NOMINAL_RATIO = 1.02


def in_own_unit(file: ModelFile, tyre: str, state: Mapping[str, float]) -> dict[str, float]:
    """The state with the amplitude in the column of the file, where the campaign has one of its own for it."""
    held = [axis.column for one in file.maps if one.tyre == tyre for axis in (*one.axes, *one.constant)]
    held += [each.column for one in file.models if one.tyre == tyre for at in one.conditions for each in at.state]
    own = next((column for column in held if unit_of(column)), AMPLITUDE.column)
    found = dict(state)
    if AMPLITUDE.column in found:
        found[own] = found.pop(AMPLITUDE.column) / (unit_of(own) or 1.0)
    return found


def depends_on_amplitude(file: ModelFile, tyre: str) -> bool:
    """Whether K* of a tyre's model depends on the amplitude of the deflection."""
    return any(by_amplitude(one.model) for one in (*file.maps, *file.models) if one.tyre == tyre)


def levels_of_map(file: ModelFile, tyre: str, found: OperatingMap) -> list[float]:
    """The tested amplitudes of a map, or of the condition of a map of one point [m]."""
    entry = next((one for one in file.maps if one.tyre == tyre), None)
    if entry is not None:
        return entry.amplitude or []
    fits = next(one for one in file.models if one.tyre == tyre)
    states = ({each.column: each.value for each in one.state} for one in fits.conditions)
    pairs = zip(states, fits.conditions, strict=True)
    return next(one.amplitude or [] for state, one in pairs if state == found.axes.constant)


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
    found: OperatingMap, points: FloatArray, frequency: FloatArray, amplitude: float, levels: Sequence[float]
) -> Answer:
    """K* at an amplitude [m], with an uncertainty of the law between the tested amplitudes.

    One standard deviation is `BEND` of the change of K* from the tested amplitude below to the one above, and falls to
    zero at both, as on an axis of a map with two values.
    """
    share, low, high = around(np.array([amplitude]), levels)
    here, below, above = (
        replace(found, model=found.model.at_amplitude(one)).ask(points, frequency)
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
