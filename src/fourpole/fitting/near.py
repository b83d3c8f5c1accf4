"""Conditions that are fitted together, with their shared errors at K* of a model of all of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from fourpole import quantities as q
from fourpole.core.arrays import FloatArray
from fourpole.core.joint.around import Likelihood
from fourpole.fitting.measured import Measured
from fourpole.models.data import real_columns
from fourpole.models.interface import Model
from fourpole.models.recorded import bends, own_near


def common_likelihood(measured: Sequence[Measured]) -> Likelihood | None:
    """The likelihood of the rig on which all conditions are recorded; None if there is none, or several."""
    if any(one.recorded is None for one in measured):
        return None
    rigs = {id(one.recorded.likelihood): one.recorded.likelihood for one in measured if one.recorded is not None}
    return next(iter(rigs.values())) if len(rigs) == 1 else None


def near_model(measured: Sequence[Measured], model: Model, values: Sequence[FloatArray]) -> Sequence[Measured]:
    """The conditions linear about K* of a model with parameters for each (B, P), for one set of shared errors.

    They are returned as they are if they are not recorded on one rig, or if the shared errors are linear within the
    noise.
    """
    likelihood = common_likelihood(measured)
    if likelihood is None or not any(bends(one.own, one.shared) for one in measured):
        return measured
    recorded = [one.recorded for one in measured if one.recorded is not None]
    stiffness = [model.on(one.own).stiffness(own, one.own.omega) for one, own in zip(measured, values, strict=True)]
    places = np.concatenate([one.places for one in recorded])
    given = np.concatenate([k / one.ratio for k, one in zip(stiffness, recorded, strict=True)])
    whole = likelihood.around(places, given)
    made, at = [], 0
    for one, k in zip(measured, stiffness, strict=True):
        found = whole.part(slice(at, at := at + k.size))
        near = own_near(one.own.omega, k, found)
        own = replace(one.own, stiffness=near.stiffness, covariance=near.covariance)
        made.append(replace(one, own=own, shared=real_columns(found.relative * own.stiffness[:, None])))
    return made


def shared_effects(measured: Sequence[Measured]) -> list[FloatArray]:
    """Effect (2N, p) [N/m] of the shared errors on each condition."""
    width = max((one.shared.shape[1] for one in measured if one.shared.size), default=0)
    return [one.shared if one.shared.size else np.zeros((2 * one.own.count, width)) for one in measured]


def known_values(measured: Measured, given: Mapping[str, float]) -> dict[str, float]:
    """Values of known parameters, by symbol: those given, and the inflation pressure p of the condition."""
    pressure = measured.state.get(q.PRESSURE.head)
    return {**({"p": pressure} if pressure is not None else {}), **given}
