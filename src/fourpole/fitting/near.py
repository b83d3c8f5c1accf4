"""Conditions that are fitted together, with their shared errors at K* of models of all of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from fourpole.core.arrays import ComplexArray
from fourpole.fitting.measured import Measured
from fourpole.models.data import StiffnessData, multiplication
from fourpole.models.recorded import bends


def needs_recordings(measured: Sequence[Measured]) -> bool:
    """Whether all conditions are recorded on one rig, and the shared errors of some are not linear within the noise."""
    if any(one.recorded is None for one in measured):
        return False
    rigs = {id(one.recorded.likelihood) for one in measured if one.recorded is not None}
    return len(rigs) == 1 and any(bends(one.own, one.shared) for one in measured)


def near_models(measured: Sequence[Measured], stiffness: Sequence[ComplexArray]) -> list[Measured]:
    """The conditions linear about K* of models of all of them, for one set of shared errors; see `needs_recordings`."""
    recorded = [one.recorded for one in measured if one.recorded is not None]
    places = np.concatenate([one.places for one in recorded])
    given = np.concatenate([k / one.ratio for k, one in zip(stiffness, recorded, strict=True)])
    near = recorded[0].likelihood.around(places, given)
    parts = np.cumsum([one.places.size for one in recorded])[:-1]
    split = [np.split(values, parts) for values in (near.change, near.own, near.shared)]
    made = []
    for one, k, change, own, shared in zip(measured, stiffness, *split, strict=True):
        by_log = multiplication(k)
        covariance = by_log @ own @ np.swapaxes(by_log, 1, 2)
        data = StiffnessData.of(
            one.own.omega,
            k * (1 + change @ [1, 1j]),
            covariance=0.5 * (covariance + np.swapaxes(covariance, 1, 2)),
            k1=one.own.k1,
            k1_std=one.own.k1_std,
        )
        effect = (multiplication(data.stiffness) @ shared).reshape(2 * k.size, -1)
        made.append(replace(one, own=replace(data, amplitude=one.own.amplitude, **one.own.ramp), shared=effect))
    return made
