"""Two quantities from a table of any format: a load-deflection curve, or a road profile."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from fourpole.core.arrays import ByValue, FloatArray
from fourpole.errors import TableError
from fourpole.io.crg import read_crg
from fourpole.io.source import AnyPath
from fourpole.io.tables.cells import Cells
from fourpole.io.tables.columns import (
    Statement,
    Taken,
    bad_cells,
    check_units,
    chosen,
    said_of,
    statements,
    taken,
    unread,
)
from fourpole.io.tables.labels import labelled, measured, one_label
from fourpole.io.tables.vocabulary import ROLES
from fourpole.units import shown
from fourpole.words import vocabulary
from fourpole.words.heads import words_of

#: Roles that may stand in for another; how far its least value goes beyond its largest if a load has the other sign.
_INSTEAD, _MOSTLY = {"deflection": "radius"}, 2.0
_BRANCHES = {branch: frozenset(text.split()) for branch, text in vocabulary()["tables"]["branches"].items()}
_Pair = tuple[FloatArray, FloatArray, list[str], list[str]]
"""Two columns in SI, not-a-number where a row has no value, how they were read, and warnings."""


@dataclass(frozen=True, eq=False)
class CurveTable(ByValue):
    """A load-deflection table: deflection [m] and load [N] of each row, how they were read, and warnings."""

    deflection: FloatArray
    load: FloatArray
    understood: list[str]
    warnings: list[str]


@dataclass(frozen=True, eq=False)
class ProfileTable(ByValue):
    """A road: distance [m] and height [m] of each row, not-a-number without one, how they were read, and warnings."""

    distance: FloatArray
    height: FloatArray
    understood: list[str]
    warnings: list[str]


def read_curve(path: AnyPath, *, columns: Sequence[str] = (), group: str = "", label: str | None = None) -> CurveTable:
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
    ...     print(read_curve(file).load.tolist())
    [0.0, 1500.0]
    """
    return CurveTable(*_read(path, ("deflection", "load"), "a static curve", columns, group, label))


def read_profile(path: AnyPath, *, columns: Sequence[str] = (), label: str | None = None) -> ProfileTable:
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
    ...     print(read_profile(file).height.tolist())
    [0.0, 0.002, nan]
    """
    if os.fspath(path).lower().endswith(".crg"):
        distance, height, warned = read_crg(path, label)
        return ProfileTable(distance, height, ["OpenCRG: height along the reference line"], warned)
    return ProfileTable(*_read(path, ("distance", "height"), "a road profile", columns, "", label))


def _read(
    path: AnyPath, roles: tuple[str, str], noun: str, columns: Sequence[str], group: str, label: str | None
) -> _Pair:
    """The columns of two roles from a table; `noun` is what they make in messages, as "a static curve"."""
    stated = statements(columns)
    wrong = [one.role for one in stated if one.role not in (*roles, *map(_INSTEAD.get, roles))]
    if wrong:
        raise TableError(f"--column: {noun} has the roles {roles[1]} and {roles[0]}, not {', '.join(wrong)}")
    good, errors = [], []
    tables = labelled(Path(path), group, label)
    for one in tables:
        try:
            good.append((one, _understood(one, roles, stated)))
        except TableError as error:
            errors.append(error)
    if not good:
        raise errors[0]
    if len(good) > 1:
        names = ", ".join(shown(one.group) for one, _ in good[:12])
        kind = noun.rpartition(" ")[2]
        raise TableError(
            f"{tables[0].label}: {len(good)} sheets or groups hold a {kind}: {names}; leave one of them in the file, "
            "or name one with --group where the command has it"
        )
    return good[0][1]


def _understood(cells: Cells, roles: tuple[str, str], stated: Sequence[Statement]) -> _Pair:
    cells = measured(cells)
    remarks = one_label(cells)
    cells = _one_below_the_other(cells)
    found = taken(cells, stated, (*roles, *(_INSTEAD[role] for role in roles if role in _INSTEAD)))
    used = []
    for role in roles:
        some = [one for one in found if one.role == role] or [one for one in found if one.role == _INSTEAD.get(role)]
        if not some:
            one = ROLES[role]
            raise TableError(
                f"{cells.where}: no column is understood as the {role} among {cells.heads}: name it "
                f"'{one.symbol} [{one.unit}]', or state --column \"{role}=NAME [{one.unit}]\"{unread(cells)}"
            )
        used.append(chosen(cells, some))
    check_units(cells, used)
    first, second, turned = _oriented(*used)
    if not np.isfinite(first + second).any():
        raise TableError(f"{cells.where}: no row has a {roles[1]} and a {roles[0]}")
    return first, second, said_of(cells, used), [*cells.remarks, *bad_cells(cells, used), *turned, *remarks]


def _one_below_the_other(cells: Cells) -> Cells:
    """The table with two columns of the load, of loading and unloading side by side, as one cycle."""
    ways = [[one for one in cells.columns if {*words_of(one.name)} & words] for words in _BRANCHES.values()]
    if any(len(one) != 1 or one[0].words for one in ways) or ways[0] == ways[1]:
        return cells
    (up,), (down,) = ways
    rows = [*range(len(cells.lines)), *reversed(range(len(cells.lines)))]
    columns = [
        replace(one, values=np.concatenate([one.values, (down if one is up else one).values[::-1]]), bad=())
        for one in cells.columns
        if not one.words and one is not down
    ]
    remark = f"{shown(up.head)} and {shown(down.head)} are taken as one cycle"
    lines = [cells.lines[at] for at in rows]
    return replace(cells, columns=tuple(columns), lines=lines, remarks=(*cells.remarks, remark))


def _oriented(first: Taken, second: Taken) -> tuple[FloatArray, FloatArray, list[str]]:
    """A curve with a load that is positive in compression, from machines whose signs are otherwise, and remarks."""
    x, load, remarks = first.si, second.si, list[str]()
    if second.role != "load":
        return x, load, remarks
    if -np.nanmin(load) > _MOSTLY * np.nanmax(load) and np.nanmin(load) < 0:
        load = -load
        remarks.append(f"column {shown(second.column.name)} is negative: compression is taken as positive")
    there = np.isfinite(x + load)
    falls = there.any() and np.sum((load - load[there].mean())[there] * (x - x[there].mean())[there]) < 0
    if first.role == "radius" or falls:
        x = np.nanmax(x) - x if first.role == "radius" else -x
        remarks.append(f"column {shown(first.column.name)} falls with the load: the deflection is its fall")
    return x, load, remarks
