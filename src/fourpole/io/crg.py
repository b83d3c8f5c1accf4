"""Roads of OpenCRG, by PyOpenCRG where it is installed."""

from __future__ import annotations

import os
import warnings

import numpy as np

from fourpole.core.arrays import FloatArray
from fourpole.errors import FileError, TableError
from fourpole.io.source import name_of, open_regular

#: Largest file [byte], and largest number of points along a road.
_LARGEST, _MOST_POINTS = 2_000_000_000, 20_000_000


def read_crg(path: str | os.PathLike[str], label: str | None = None) -> tuple[FloatArray, FloatArray]:
    """Distance and height (N,) [m] along the reference line of a road; not-a-number where the road has a hole."""
    name = name_of(path, label)
    open_regular(path, max_bytes=_LARGEST, label=label).close()
    try:
        import pyopencrg
    except ImportError:
        raise FileError(
            f"{name}: OpenCRG is read by PyOpenCRG: pip install PyOpenCRG, or write the road as a table with the "
            "columns 'distance [m]' and 'height [m]'"
        ) from None
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            road = pyopencrg.read(os.fspath(path), check=False)  # a ride refuses holes itself, with their place
        grid, across = np.asarray(road.z, dtype=float), np.asarray(road.v, dtype=float)
        distance = np.asarray(road.u, dtype=float)
        line = np.asarray(road.zr, dtype=float) if road.zr is not None else np.zeros(distance.size)
    except Exception as error:  # noqa: BLE001 - whatever a library of others raises about a file is the file's fault
        raise TableError(f"{name}: is no road of OpenCRG that can be read ({type(error).__name__}: {error})") from None
    if distance.ndim != 1 or grid.shape != (distance.size, across.size) or not 2 <= distance.size <= _MOST_POINTS:
        raise TableError(f"{name}: has a grid of {grid.shape} heights for {distance.size} distances")
    right = int(np.clip(np.searchsorted(across, 0.0), 1, max(across.size - 1, 1)))
    if across.size == 1:
        return distance, grid[:, 0] + line
    part = float(np.clip((0.0 - across[right - 1]) / (across[right] - across[right - 1]), 0.0, 1.0))
    height = grid[:, right - 1] if part == 0 else grid[:, right] if part == 1 else None
    if height is None:
        height = (1 - part) * grid[:, right - 1] + part * grid[:, right]
    return distance, height + line
