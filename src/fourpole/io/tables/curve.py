"""A load-deflection curve from a table of any format."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass

from fourpole.core.arrays import ByValue, FloatArray
from fourpole.io.tables.pair import read_pair


@dataclass(frozen=True, eq=False)
class CurveTable(ByValue):
    """A load-deflection table: deflection [m] and load [N] of each row, how they were read, and warnings."""

    deflection: FloatArray
    load: FloatArray
    understood: list[str]
    warnings: list[str]


def read_curve(
    path: str | os.PathLike[str], *, columns: Sequence[str] = (), group: str = "", label: str | None = None
) -> CurveTable:
    r"""Read a load-deflection table of any format.

    Parameters
    ----------
    path : path
        A file of any format that recordings have.
    columns : sequence of str
        Which column is what, as the option ``--column`` has it: "load=ch7 [kN]".
    group : str
        The sheet or group; empty if only one holds a curve.
    label : str, optional
        The file's name in messages.

    Returns
    -------
    CurveTable
        The curve in SI units.

    Raises
    ------
    FileError, TableError
        If the file cannot be read, or a quantity has no column, two columns or no unit.

    Examples
    --------
    >>> import tempfile, pathlib
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = pathlib.Path(folder, "curve.csv")
    ...     _ = file.write_text("deflection [mm],load [kN]\n0,0\n10,1.5\n")
    ...     print(read_curve(file).load)
    [   0. 1500.]
    """
    found = read_pair(path, ("deflection", "load"), "a static curve", columns=columns, group=group, label=label)
    return CurveTable(found.first, found.second, found.understood, found.warnings)
