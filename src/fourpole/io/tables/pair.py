"""Two quantities from a table of any format: a curve, or a profile."""

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


@dataclass(frozen=True, eq=False)
class Pair(ByValue):
    """Two columns in SI, not-a-number where a row has no value, how they were read, and warnings."""

    first: FloatArray
    second: FloatArray
    understood: list[str]
    warnings: list[str]


def read_pair(
    path: str | os.PathLike[str],
    roles: tuple[str, str],
    noun: str,
    *,
    columns: Sequence[str] = (),
    group: str = "",
    label: str | None = None,
) -> Pair:
    """The columns of two roles from a table; `noun` is what they make in messages, as "a static curve".

    Raises
    ------
    FileError, TableError
        If the file cannot be read, or a quantity has no column, two columns or no unit.
    """
    stated = statements(columns)
    wrong = [one.role for one in stated if one.role not in roles]
    if wrong:
        raise TableError(f"--column: {noun} has the roles {roles[1]} and {roles[0]}, not {', '.join(wrong)}")
    good, errors = [], []
    tables = tables_in(Path(path), group=group, label=label)
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


def _understood(cells: Cells, roles: tuple[str, str], stated: Sequence[Statement]) -> Pair:
    found = taken(cells, stated, roles)
    used = []
    for role in roles:
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
    first, second = map(in_si, used)
    bad = [
        f"row {cells.lines[at]}, column {shown(one.column.name)}: {shown(text)} is no number: the row cannot be used"
        for one in used
        for at, text in one.column.bad
    ]
    said = [*([f"sheet or group {shown(cells.group)}"] if cells.group else []), *map(str, used)]
    if not np.isfinite(first + second).any():
        raise TableError(f"{where_of(cells)}: no row has a {roles[1]} and a {roles[0]}")
    return Pair(first, second, said, [*cells.remarks, *bad])
