"""95 % intervals of the parameters of fits: by profile likelihood, or from the covariance where that takes too long."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from fourpole.core.arrays import FloatArray
from fourpole.core.confidence import NORMAL_95
from fourpole.models.choice import STOPPED
from fourpole.models.data import StiffnessData
from fourpole.models.fit import Fit
from fourpole.models.links import link_all, unlink_all
from fourpole.models.profile import profile_intervals

#: Largest product of the cube of the free parameters and the frequencies for intervals by profile likelihood.
_MOST_WORK = 600_000
_INSTEAD = "their intervals are from the covariance"


def intervals(
    fits: Sequence[Fit],
    data: Sequence[StiffnessData],
    fixed: Sequence[str],
    step: Callable[[], None],
    *,
    shared: bool,
    stopped: bool,
) -> tuple[tuple[FloatArray, ...], list[str], bool]:
    """95 % intervals (P, 2) of each condition; sentences say which of them are not by profile likelihood, and why.

    Also whether the user stopped them, or `stopped` the fits before.

    Intervals of fits that share parameters, and those after a stop, are from the covariance.
    """
    ends: list[FloatArray] = []
    why: list[str] = []
    for one, row in zip(fits, data, strict=True):
        free = len(one.model.parameters) - len(fixed)
        long = not one.model.linear and free**3 * row.count > _MOST_WORK
        if long and not (shared or stopped or why):
            why = [f"{free} free parameters are too many for profile likelihood: {_INSTEAD}"]
        try:
            if shared or long or stopped:
                ends.append(normal_ends(one))
            else:
                here = row.at(one.model.on(row).stiffness(one.values, row.omega))
                ends.append(profile_intervals(one, here, fixed=fixed))
        except KeyboardInterrupt:
            stopped = True
            ends.append(normal_ends(one))
        step()
    if stopped:
        why.append(f"Profile likelihood was {STOPPED}: intervals that it lacks are from the covariance")
    return tuple(ends), why, stopped


def normal_ends(found: Fit) -> FloatArray:
    """95 % intervals (P, 2) for a normal distribution of the linked parameters; of a linear model, of its own."""
    if found.model.linear:
        half = NORMAL_95 * found.std
        return np.stack([np.maximum(found.values - half, 0.0), found.values + half], axis=-1)
    linked = link_all(found.model, found.values)
    _, slopes = unlink_all(found.model, linked)
    half = np.divide(NORMAL_95 * found.std, slopes, out=np.zeros_like(linked), where=slopes > 0)
    ends = np.stack([unlink_all(found.model, linked + side * half)[0] for side in (-1, 1)], axis=-1)
    return np.where(found.on_bound[:, None], np.stack(found.model.bounds, axis=-1), ends)
