"""Start values of a fit: those of the model family, moved into the bounds, and further ones around the first."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fourpole.core.arrays import FloatArray
from fourpole.models.data import StiffnessData
from fourpole.models.interface import Model

#: Start of a logarithmic parameter that would be zero, as a fraction of its default.
_SMALL = 1e-6
#: Further starts differ from the first by at most this factor. Their factors follow the golden-ratio sequence.
_LARGEST_FACTOR = 4.0
_GOLDEN = (np.sqrt(5.0) - 1.0) / 2.0


def start_of(model: Model, data: StiffnessData) -> FloatArray:
    """One start (..., P) for a fit to conditions (...,), close to the best parameters.

    Raises
    ------
    ModelError
        If the model has no start values.

    Examples
    --------
    >>> from fourpole.models.maxwell import Zener
    >>> omega = 2 * np.pi * np.arange(5.0, 25.0)
    >>> truth = Zener().stiffness([180e3, 120e3, 700.0], omega)
    >>> start_of(Zener(), StiffnessData.of(omega, truth, 100.0)).round(3)
    array([180000., 120000.,    700.])
    """
    return np.asarray(starts_of(model, data, 1)[0])


def starts_of(model: Model, data: StiffnessData, count: int) -> FloatArray:
    """Several starts (count, ..., P), that of `start_of` first, always the same; more starts find fewer local minima.

    Parameters
    ----------
    model : Model
    data : StiffnessData
        Data of conditions (...,).
    count : int
        >= 1.

    Raises
    ------
    ModelError
        If the model has no start values.

    Examples
    --------
    >>> from fourpole.models.maxwell import Zener
    >>> omega = 2 * np.pi * np.arange(5.0, 25.0)
    >>> truth = Zener().stiffness([180e3, 120e3, 700.0], omega)
    >>> starts_of(Zener(), StiffnessData.of(omega, truth, 100.0), 4).shape
    (4, 3)
    """
    flat = data.flat()
    flat = replace(flat, omega=np.broadcast_to(flat.omega, flat.stiffness.shape))
    inside = _inside(model, _filled(model.starts(flat, count), count))
    return inside.reshape(count, *data.stiffness.shape[:-1], len(model.parameters))


def _inside(model: Model, found: FloatArray) -> FloatArray:
    """Starts moved into the bounds; the start of a logarithmic parameter is not zero."""
    low, high = model.bounds
    logs = np.array([parameter.log for parameter in model.parameters])
    usual = np.abs(model.defaults)
    inside = np.clip(np.where(np.isfinite(found), found, usual), low, high)
    return np.where(logs & (inside <= 0), _SMALL * usual, inside)


def _filled(found: FloatArray, count: int) -> FloatArray:
    """Exactly `count` starts: those found, then copies of the first with a factor for each parameter."""
    more = np.arange(1, count - len(found) + 1)
    shares = (more[:, None] * _GOLDEN ** np.arange(1, found.shape[-1] + 1)) % 1.0
    return np.concatenate([found[:count], found[0] * _LARGEST_FACTOR ** (2 * shares - 1)[:, None, :]])
