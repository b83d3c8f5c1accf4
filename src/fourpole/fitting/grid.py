"""An operating map on a grid, as an xarray Dataset."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from fourpole import quantities as q
from fourpole.core.arrays import FloatArray
from fourpole.core.rig import Rig
from fourpole.core.specimen import Specimen
from fourpole.errors import CampaignError, ModelError
from fourpole.fitting.rows import tyre_columns
from fourpole.models.operating import OperatingMap
from fourpole.models.realised import MASSLESS

if TYPE_CHECKING:
    from xarray import Dataset

#: Quantity of each variable.
_VARIABLES = {
    "K_storage": q.STORAGE,
    "K_loss": q.LOSS,
    "loss_factor": q.LOSS_FACTOR,
    "K1": q.K1,
    "K2": q.K2,
    "C": q.C,
    "TR": q.TR,
}


def grid_of(
    maps: Mapping[str, OperatingMap],
    rig: Rig | None = None,
    at: Mapping[str, ArrayLike] | None = None,
    *,
    points: int = 21,
    frequencies: int = 31,
    specimens: Mapping[str, Specimen] | None = None,
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
    specimens : mapping of str to Specimen, optional
        Belts of the tyres, for TR; without one a tyre is massless.

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
        raise ModelError("the specimens were tested over different axes: state one specimen")
    names = [column.partition(" [")[0] for column in columns]
    sides = _sides(maps, names, at or {}, points, frequencies)
    axes, frequency = sides[:-1], sides[-1]
    mesh = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(axes)) if axes else np.zeros((1, 0))
    shape = tuple(side.size for side in sides)
    found: dict[str, list[FloatArray]] = {}
    for tyre, one in maps.items():
        specimen = (specimens or {}).get(tyre, MASSLESS)
        for head, column in _columns(one, rig, mesh, frequency, specimen).items():
            found.setdefault(head, []).append(column.reshape(shape))
    data: dict[str, Any] = {}
    for name, quantity in _VARIABLES.items():
        for variable, head in zip((name, f"u_{name}"), quantity.heads, strict=True):
            if head in found:
                attributes = {"units": quantity.unit, "long_name": q.meaning_of(head)}
                data[variable] = (["tyre", *names, "frequency"], np.stack(found[head]), attributes)
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


def _columns(
    found: OperatingMap, rig: Rig | None, points: FloatArray, frequency: FloatArray, specimen: Specimen
) -> dict[str, FloatArray]:
    """Values of one map at each point and frequency in turn, by column; not-a-number outside its tests."""
    every, times = np.repeat(points, frequency.size, axis=0), np.tile(frequency, len(points))
    answer = found.ask(every, times)
    tr = () if rig is None else zip(q.TR.heads, answer.transmissibility(rig, times, specimen), strict=True)
    inside = np.repeat([found.axes.outside(point)[0] == 0 for point in points], frequency.size)
    inside &= found.octaves_beyond(times) == 0
    return {head: np.where(inside, column, np.nan) for head, column in (*tyre_columns(answer).items(), *tr)}


def _attributes(maps: Mapping[str, OperatingMap]) -> dict[str, Any]:
    """Attributes of the Dataset: model, leave-one-out error and constant axes of each tyre."""
    found: dict[str, Any] = {}
    for tyre, one in maps.items():
        mark = f"{tyre}: " if tyre else ""
        found[f"{mark}model"] = one.model.name
        found[f"{mark}{q.LEFT_OUT.head}"] = one.leave_one_out.error
        found |= {f"{mark}{column} held at": value for column, value in one.axes.constant.items()}
    return found
