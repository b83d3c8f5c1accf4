"""An operating map on a grid, as an xarray Dataset."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from fourpole import quantities as q
from fourpole.core.arrays import FloatArray
from fourpole.core.rig import Rig
from fourpole.errors import CampaignError, ModelError
from fourpole.models.operating import OperatingMap

if TYPE_CHECKING:
    from xarray import Dataset

#: Variables by name: unit and long name.
_VARIABLES = {
    "K_storage": ("N/m", "storage stiffness K', real part of K*"),
    "K_loss": ("N/m", "loss stiffness K'', imaginary part of K*"),
    "loss_factor": ("1", "loss factor K''/K'"),
    "K1": ("N/m", "static stiffness"),
    "K2": ("N/m", "stiffness of the spring in series with C"),
    "C": ("N s/m", "damping of the damper in series with K2"),
    "TR": ("1", "transmissibility on the rig of the tests"),
}


def grid_of(
    maps: Mapping[str, OperatingMap],
    rig: Rig | None = None,
    at: Mapping[str, ArrayLike] | None = None,
    *,
    points: int = 21,
    frequencies: int = 31,
) -> Dataset:
    """K*, K1, K2, C and TR of each tyre over the axes and frequency, with their standard uncertainties u_NAME.

    Parameters
    ----------
    maps : mapping of str to OperatingMap
        Maps by tyre, with the same axes.
    rig : Rig, optional
        Rig of TR; without it there is no TR.
    at : mapping of str to (n,) float array, optional
        SI coordinates by the name of an axis, such as pressure or frequency; by default evenly over the tests.
    points, frequencies : int
        Number of coordinates of each axis, and of frequency, that `at` does not have.

    Returns
    -------
    xarray.Dataset
        Dimensions tyre, the names of the axes and frequency; not-a-number outside the tests of a tyre.

    Raises
    ------
    ModelError
        If the tyres have different axes, or `at` names another axis.
    CampaignError
        If xarray is not installed.
    """
    try:
        import xarray
    except ImportError:
        raise CampaignError("a map on a grid needs xarray: pip install 'fourpole[maps]'") from None
    columns = next(iter(maps.values())).axes.names
    if any(one.axes.names != columns for one in maps.values()):
        raise ModelError("the tyres were tested over different axes: state one tyre")
    names = [column.partition(" [")[0] for column in columns]
    sides = _sides(maps, names, at or {}, points, frequencies)
    axes, frequency = sides[:-1], sides[-1]
    mesh = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(axes)) if axes else np.zeros((1, 0))
    shape = tuple(side.size for side in sides)
    every, times = np.repeat(mesh, frequency.size, axis=0), np.tile(frequency, len(mesh))
    found: dict[str, list[FloatArray]] = {}
    for one in maps.values():
        inside = np.repeat([one.axes.outside(point)[0] == 0 for point in mesh], frequency.size)
        inside &= one.octaves_beyond(times) == 0
        for name, column in _values(one, rig, every, times).items():
            found.setdefault(name, []).append(np.where(inside, column, np.nan).reshape(shape))
    data: dict[str, Any] = {}
    for name, parts in found.items():
        base = name.removeprefix("u_")
        unit, long = _VARIABLES[base]
        whole = long if base == name else f"standard uncertainty of {long}"
        data[name] = (["tyre", *names, "frequency"], np.stack(parts), {"units": unit, "long_name": whole})
    coordinates: dict[str, Any] = {
        name: ((name,), side, {"units": column.partition(" [")[2].removesuffix("]")})
        for name, column, side in zip(names, columns, axes, strict=True)
    }
    coordinates["frequency"] = (("frequency",), frequency, {"units": "Hz"})
    coordinates["tyre"] = (("tyre",), list(maps))
    return xarray.Dataset(data, coordinates, _attributes(maps))


def _sides(
    maps: Mapping[str, OperatingMap], names: Sequence[str], at: Mapping[str, ArrayLike], points: int, frequencies: int
) -> list[FloatArray]:
    """Coordinates of each axis, then of frequency."""
    unknown = [name for name in at if name not in (*names, "frequency")]
    if unknown:
        raise ModelError(f"the map has no axis {unknown[0]!r}: it goes over {', '.join((*names, 'frequency'))}")
    sides = []
    for place, name in enumerate(names):
        every = np.concatenate([one.axes.points[:, place] for one in maps.values()])
        even = np.linspace(every.min(), every.max(), points)
        sides.append(np.atleast_1d(np.asarray(at.get(name, even), dtype=float)))
    low, high = min(one.band[0] for one in maps.values()), max(one.band[1] for one in maps.values())
    even = np.linspace(low, high, frequencies)
    return [*sides, np.atleast_1d(np.asarray(at.get("frequency", even), dtype=float))]


def _values(found: OperatingMap, rig: Rig | None, points: FloatArray, frequency: FloatArray) -> dict[str, FloatArray]:
    """Variables (Q,) of one map at points and frequencies, by name."""
    answer = found.ask(points, frequency)
    std, arm = answer.std, np.sqrt(np.diagonal(answer.arm_covariance, 0, 1, 2))
    loss, u_loss = answer.loss_factor
    values = {
        "K_storage": answer.stiffness.real,
        "u_K_storage": std[:, 0],
        "K_loss": answer.stiffness.imag,
        "u_K_loss": std[:, 1],
        "loss_factor": loss,
        "u_loss_factor": u_loss,
        "K1": answer.k1,
        "u_K1": std[:, 2],
        "K2": answer.k2,
        "u_K2": arm[:, 0],
        "C": answer.c,
        "u_C": arm[:, 1],
    }
    if rig is not None:
        values["TR"], values["u_TR"] = answer.transmissibility(rig, frequency)
    return values


def _attributes(maps: Mapping[str, OperatingMap]) -> dict[str, Any]:
    """Attributes of the Dataset: model, leave-one-out error and constant axes of each tyre."""
    found: dict[str, Any] = {}
    for tyre, one in maps.items():
        mark = f"{tyre}: " if tyre else ""
        found[f"{mark}model"] = one.model.name
        found[f"{mark}{q.LEFT_OUT.head}"] = one.leave_one_out.error
        found |= {f"{mark}{column} held at": value for column, value in one.axes.constant.items()}
    return found
