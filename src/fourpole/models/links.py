"""Links of parameters: functions of them that are free of bounds, so that laws over conditions can be linear."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from fourpole.core.arrays import FloatArray
from fourpole.models.interface import Model, Parameter

#: Largest modulus of a linked value: logit between two bounds, logarithm above one bound.
_MOST_LOGIT, _MOST_LOG = 12.0, 300.0


def link(parameter: Parameter, values: ArrayLike) -> FloatArray:
    """The link g of a parameter: logit between two bounds, logarithm above a lower bound, or the value itself."""
    array = np.asarray(values, dtype=float)
    low, high = parameter.low, parameter.high
    with np.errstate(divide="ignore", invalid="ignore"):
        if np.isfinite(high) and np.isfinite(low):
            return np.clip(np.log((array - low) / (high - array)), -_MOST_LOGIT, _MOST_LOGIT)
        if np.isfinite(low):
            return np.clip(np.log(array - low), -_MOST_LOG, _MOST_LOG)
    return array


def unlink(parameter: Parameter, linked: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """The parameter of a linked value, and its derivative by the linked value."""
    array = np.asarray(linked, dtype=float)
    low, high = parameter.low, parameter.high
    if np.isfinite(high) and np.isfinite(low):
        share = 1.0 / (1.0 + np.exp(-np.clip(array, -_MOST_LOGIT, _MOST_LOGIT)))
        return low + (high - low) * share, (high - low) * share * (1 - share)
    if np.isfinite(low):
        size = np.exp(np.clip(array, -_MOST_LOG, _MOST_LOG))
        return low + size, size
    return array, np.ones_like(array)


def link_all(model: Model, values: FloatArray) -> FloatArray:
    """The links (..., P) of all parameters (..., P) of a model."""
    return np.stack([link(one, values[..., at]) for at, one in enumerate(model.parameters)], axis=-1)


def unlink_all(model: Model, linked: FloatArray) -> tuple[FloatArray, FloatArray]:
    """All parameters (..., P) of linked values (..., P), and their derivatives by the linked values."""
    both = [unlink(one, linked[..., at]) for at, one in enumerate(model.parameters)]
    return np.stack([one for one, _ in both], axis=-1), np.stack([slope for _, slope in both], axis=-1)
