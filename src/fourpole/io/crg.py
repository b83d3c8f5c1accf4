"""Roads of OpenCRG, by PyOpenCRG where it is installed."""

from __future__ import annotations

import os
import warnings
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from fourpole.core.arrays import FloatArray
from fourpole.errors import FileError, TableError
from fourpole.io.child import Died, answer_of
from fourpole.io.door import open_regular
from fourpole.io.packed import pack, unpack
from fourpole.io.source import AnyPath, name_of

#: Largest file [byte], and largest number of points along a road.
_LARGEST, _MOST_POINTS = 2_000_000_000, 20_000_000
#: Most warnings of the reader that are passed on.
_MOST_WARNINGS = 5


def read_crg(path: AnyPath, label: str | None = None) -> tuple[FloatArray, FloatArray, list[str]]:
    """Distance and height (N,) [m] along the reference line of a road, and what its reader warns of.

    A height is not-a-number where the road has a hole.

    The file is read in a worker process, as every file that a library reads.
    """
    name = name_of(path, label)
    open_regular(path, max_bytes=_LARGEST, label=label).close()
    if find_spec("pyopencrg") is None:
        raise FileError(
            f"{name}: OpenCRG is read by PyOpenCRG: pip install PyOpenCRG, or write the road as a table with the "
            "columns 'distance [m]' and 'height [m]'"
        )
    place = Path(path).absolute()
    try:
        answer = answer_of(along_line, place, name, size=place.stat().st_size)
    except Died as death:
        raise FileError(f"{name} {death}; {death.remedy}") from None
    distance, height, warned = unpack(bytearray(answer))
    return distance, height, warned


def along_line(path: Path, name: str) -> bytes:
    """The packed distance and height along the reference line of a road, and what its reader warns of."""
    import pyopencrg

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            road = pyopencrg.read(os.fspath(path), check=False)  # a ride refuses holes itself, with their place
        grid, across = np.asarray(road.z, dtype=float), np.asarray(road.v, dtype=float)
        distance = np.asarray(road.u, dtype=float)
        line = np.asarray(road.zr, dtype=float) if road.zr is not None else np.zeros(distance.size)
        damage = [str(one) for one in road.read_errors]
        warned = [f"{name}: {one}" for one in road.read_warnings[:_MOST_WARNINGS]]
    except Exception as error:  # noqa: BLE001 - whatever a library of others raises about a file is the file's fault
        said = str(error).removeprefix(f"{path}: ")
        raise TableError(f"{name}: is no road of OpenCRG that can be read ({type(error).__name__}: {said})") from None
    if damage:
        raise TableError(f"{name}: is damaged ({damage[0]}): copy or export it again")
    if distance.ndim != 1 or grid.shape != (distance.size, across.size) or not 2 <= distance.size <= _MOST_POINTS:
        raise TableError(f"{name}: has a grid of {grid.shape} heights for {distance.size} distances")
    return pack((distance, _at_zero(across, grid) + line, warned))


def _at_zero(across: FloatArray, grid: FloatArray) -> FloatArray:
    """Heights (N,) [m] at the reference line from those (N, V) at lateral positions (V,) [m]."""
    if across.size == 1:
        return grid[:, 0]
    right = int(np.clip(np.searchsorted(across, 0.0), 1, across.size - 1))
    left = right - 1
    part = float(np.clip(-across[left] / (across[right] - across[left]), 0.0, 1.0))
    if part in (0.0, 1.0):  # a hole beside the line is none of the line
        return grid[:, right if part else left]
    return np.asarray((1 - part) * grid[:, left] + part * grid[:, right])
