"""Two quantities from a table of any format: a load-deflection curve, a road profile, relaxation or creep.

Roads of OpenCRG are read by PyOpenCRG where it is installed.
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import polars as pl

from fourpole.core.arrays import ByValue, FloatArray
from fourpole.errors import FileError, TableError
from fourpole.io.child import Died, answer_of
from fourpole.io.door import open_regular
from fourpole.io.formats import uff
from fourpole.io.packed import pack, unpack
from fourpole.io.recordings import format_of
from fourpole.io.signals import MAX_FILE_BYTES
from fourpole.io.source import AnyPath, name_of
from fourpole.io.tables.cells import Cells, tables_in
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
from fourpole.io.tables.forms import Form
from fourpole.io.tables.kstar import NO_SHAPE, TableOptions, factor_of, further_of
from fourpole.io.tables.labels import labelled, measured, one_label
from fourpole.io.tables.vocabulary import ROLES
from fourpole.units import shown
from fourpole.words import vocabulary
from fourpole.words.heads import words_of

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
        kind = format_of(Path(path), max_bytes=MAX_FILE_BYTES)
        tables = [] if kind is uff.FORMAT else tables_in(Path(path), group=options.group)
    except TableError:  # whoever reads it as a table of K* says what is wrong
        return None
    for cells in map(measured, tables):
        found = taken(cells, stated, _ROLES)
        roles = {one.role for one in found}
        if "frequency" not in roles and "time" in roles and roles & set(_QUANTITIES):
            return _over_time(cells, found, stated, options)
    return None


def _over_time(cells: Cells, found: list[Taken], stated: list[Statement], options: TableOptions) -> TimeTable:
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
