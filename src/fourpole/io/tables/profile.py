"""A road profile from a table of any format, or from OpenCRG."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass

from fourpole.core.arrays import ByValue, FloatArray
from fourpole.io.crg import read_crg
from fourpole.io.tables.pair import read_pair


@dataclass(frozen=True, eq=False)
class ProfileTable(ByValue):
    """A road: distance [m] and height [m] of each row, not-a-number without one, how they were read, and warnings."""

    distance: FloatArray
    height: FloatArray
    understood: list[str]
    warnings: list[str]


def read_profile(
    path: str | os.PathLike[str], *, columns: Sequence[str] = (), label: str | None = None
) -> ProfileTable:
    r"""Read a road profile: a table of any format with a distance and a height, or an OpenCRG file (.crg).

    Parameters
    ----------
    path : path
        A file of any format that recordings have; or a road of OpenCRG, of which the reference line is taken. Its
        reader is PyOpenCRG, which is installed by itself.
    columns : sequence of str
        Which column is what, as the option ``--column`` has it: "height=z [mm]".
    label : str, optional
        The file's name in messages.

    Returns
    -------
    ProfileTable

    Raises
    ------
    FileError, TableError
        If the file cannot be read, a quantity has no column, two columns or no unit, or PyOpenCRG is not installed.

    Examples
    --------
    >>> import tempfile, pathlib
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = pathlib.Path(folder, "road.csv")
    ...     _ = file.write_text("distance [m],height [mm]\n0,0\n0.1,2\n0.2,\n")
    ...     print(read_profile(file).height)
    [0.    0.002   nan]
    """
    if os.fspath(path).lower().endswith(".crg"):
        distance, height, warned = read_crg(path, label)
        return ProfileTable(distance, height, ["OpenCRG: height along the reference line"], warned)
    found = read_pair(path, ("distance", "height"), "a road profile", columns=columns, label=label)
    return ProfileTable(found.first, found.second, found.understood, found.warnings)
