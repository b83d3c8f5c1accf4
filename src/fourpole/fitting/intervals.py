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
from fourpole.models.profile import profiles_together

#: Largest product of the cube of the free parameters and the frequencies for intervals by profile likelihood.
_MOST_WORK = 600_000
#: Largest product of conditions, the square of the free parameters and the frequencies of profiles in one batch.
_TOGETHER = 20_000
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
    model, why = fits[0].model, []
    free = len(model.parameters) - len(fixed)
    ends = [normal_ends(one) for one in fits]
    long = [not model.linear and free**3 * row.count > _MOST_WORK for row in data]
    if any(long) and not (shared or stopped):
        why = [f"{free} free parameters are too many for profile likelihood: {_INSTEAD}"]
    wanted = [] if shared else [at for at, one in enumerate(long) if not one]
    together = max(_TOGETHER // (free**2 * max(row.count for row in data)), 1)
    for first in range(0, 0 if stopped else len(wanted), together):
        places = wanted[first : first + together]
        try:
            rows = [data[at].at(model.on(data[at]).stiffness(fits[at].values, data[at].omega)) for at in places]
            found = profiles_together([fits[at] for at in places], rows, fixed=fixed)
        except KeyboardInterrupt:
            stopped = True
            break
        for at, one in zip(places, found, strict=True):
            ends[at] = one
            step()
    for _ in range(len(fits) - len(wanted)):
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
