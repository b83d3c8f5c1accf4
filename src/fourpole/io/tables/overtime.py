"""Tables of relaxation K(t) and creep J(t), or of their moduli, become time and values in SI."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import polars as pl

from fourpole.core.arrays import ByValue, FloatArray
from fourpole.errors import TableError
from fourpole.io.formats import uff
from fourpole.io.recordings import format_of
from fourpole.io.signals import MAX_FILE_BYTES
from fourpole.io.source import AnyPath
from fourpole.io.tables.cells import Cells, tables_in
from fourpole.io.tables.columns import Statement, Taken, bad_cells, check_units, chosen, said_of, statements, taken
from fourpole.io.tables.forms import Form
from fourpole.io.tables.kstar import NO_SHAPE, TableOptions, factor_of, further_of
from fourpole.io.tables.labels import measured
from fourpole.io.tables.vocabulary import ROLES

_QUANTITIES = ("relaxation", "compliance")
_STD = {one: f"u({one})" for one in _QUANTITIES}
_ROLES = ("frequency", "time", *_QUANTITIES, *_STD.values(), "temperature", "pressure", "preload", "tyre")


@dataclass(frozen=True, eq=False)
class TimeTable(ByValue):
    """A table of relaxation or creep.

    Attributes
    ----------
    time : (N,) float [s]
    values : (N,) float [N/m] or [m/N]
        K(t), or J(t) if `creep`.
    std : (N,) float or None
        Their standard uncertainty; None if no column states it.
    creep : bool
    understood, warnings : list of str
        Sentences on how the columns were read, and on what cannot be used.
    further : polars.DataFrame
        Conditions in SI by the heads of result tables, and the columns of no known role.
    """

    time: FloatArray
    values: FloatArray
    std: FloatArray | None
    creep: bool
    understood: list[str]
    warnings: list[str]
    further: pl.DataFrame = field(default_factory=pl.DataFrame)


def read_over_time(path: AnyPath, options: TableOptions | None = None) -> TimeTable | None:
    r"""Read a table of relaxation or creep of any format; None for a table that is none.

    Such a table has a column of time, one of K(t), E(t), G(t) or J(t), and none of frequency.

    Parameters
    ----------
    path : path
        A file of any format that recordings have.
    options : TableOptions, optional
        What the file does not say, as for a table of K*.

    Raises
    ------
    FileError, TableError
        If there is no such file, a column has no unit, two columns differ, or a modulus has no shape.

    Examples
    --------
    >>> import tempfile, pathlib
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = pathlib.Path(folder, "relaxation.csv")
    ...     _ = file.write_text("time [s],K(t) [N/mm]\n1,200\n10,180\n")
    ...     print(read_over_time(file).values.tolist())
    [200000.0, 180000.0]
    """
    options = TableOptions() if options is None else options
    stated = statements(options.columns)
    if any(one.role not in _ROLES for one in stated):
        return None
    try:
        tables = [] if _is_uff(path) else tables_in(Path(path), group=options.group)
    except TableError:  # whoever reads it as a table of K* says what is wrong
        return None
    for cells in map(measured, tables):
        found = taken(cells, stated, _ROLES)
        roles = {one.role for one in found}
        if "frequency" not in roles and "time" in roles and roles & set(_QUANTITIES):
            return _understood(cells, found, stated, options)
    return None


def _is_uff(path: AnyPath) -> bool:
    return format_of(Path(path), max_bytes=MAX_FILE_BYTES, label=None) is uff.FORMAT


def _understood(cells: Cells, found: list[Taken], stated: list[Statement], options: TableOptions) -> TimeTable:
    both = [role for role in _QUANTITIES if any(one.role == role for one in found)]
    named = [role for role in both if any(one.role == role for one in stated)]
    if len(named or both) > 1:
        raise TableError(f'{cells.where}: holds relaxation and creep; name one, as in --column "relaxation=E(t)"')
    role = (named or both)[0]
    column, time = (chosen(cells, [one for one in found if one.role == wanted]) for wanted in (role, "time"))
    spread = [one for one in found if one.role == _STD[role]]
    used = [time, column, *([chosen(cells, spread)] if spread else [])]
    check_units(cells, used)
    said, factor = said_of(cells, used), 1.0
    if column.kind in ("pressure", "compliance"):
        form = Form({role: column}, column.letter or "M")
        if options.factor is None and options.shape is None:
            raise TableError(f"{cells.where}: {ROLES[role].says} is of the material: {NO_SHAPE}")
        factor, text = factor_of(cells, form, options)
        said.append(text)
    factor = 1 / factor if role == "compliance" else factor
    further, kept, notes = further_of(cells, [one for one in found if one.role != "time"], used, factor)
    return TimeTable(
        time=time.si,
        values=factor * column.si,
        std=factor * used[2].si if spread else None,
        creep=role == "compliance",
        understood=[*said, *map(str, kept)],
        warnings=[*cells.remarks, *bad_cells(cells, used), *notes],
        further=further,
    )
