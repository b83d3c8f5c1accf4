"""A load-deflection curve from a table of any format."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fourpole.core.arrays import ByValue, FloatArray
from fourpole.errors import TableError
from fourpole.io.tables.cells import Cells, tables_in
from fourpole.io.tables.columns import Statement, check_units, chosen, in_si, statements, taken, unread, where_of
from fourpole.io.tables.vocabulary import ROLES
from fourpole.units import shown

_ROLES = ("deflection", "load")


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
    stated = statements(columns)
    wrong = [one.role for one in stated if one.role not in _ROLES]
    if wrong:
        raise TableError(f"--column: a static curve has the roles load and deflection, not {', '.join(wrong)}")
    good, errors = [], []
    tables = tables_in(Path(path), group=group, label=label)
    for one in tables:
        try:
            good.append((one, _understood(one, stated)))
        except TableError as error:
            errors.append(error)
    if not good:
        raise errors[0]
    if len(good) > 1:
        names = ", ".join(shown(one.group) for one, _ in good[:12])
        raise TableError(
            f"{tables[0].label}: {len(good)} sheets or groups hold a curve: {names}; name one with --group"
        )
    return good[0][1]


def _understood(cells: Cells, stated: Sequence[Statement]) -> CurveTable:
    found = taken(cells, stated, _ROLES)
    used = []
    for role in _ROLES:
        some = [one for one in found if one.role == role]
        if not some:
            heads = ", ".join(shown(one.head)[1:-1] for one in cells.columns[:20])
            one = ROLES[role]
            raise TableError(
                f"{where_of(cells)}: no column is understood as the {role} among {heads}: name it "
                f"'{one.symbol} [{one.unit}]', or state --column \"{role}=NAME [{one.unit}]\"{unread(cells)}"
            )
        used.append(chosen(cells, some))
    check_units(cells, used)
    deflection, load = map(in_si, used)
    bad = [
        f"row {cells.lines[at]}, column {shown(one.column.name)}: {shown(text)} is no number: the row cannot be used"
        for one in used
        for at, text in one.column.bad
    ]
    said = [*([f"sheet or group {shown(cells.group)}"] if cells.group else []), *map(str, used)]
    if not np.isfinite(deflection + load).any():
        raise TableError(f"{where_of(cells)}: no row has a load and a deflection")
    return CurveTable(deflection, load, said, [*cells.remarks, *bad])
