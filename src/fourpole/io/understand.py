"""Tables of results and load-deflection curves: the quantity of each column, by usual names and units."""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fourpole import units
from fourpole.core.arrays import ByValue, ComplexArray, FloatArray
from fourpole.core.phasor import Phasors
from fourpole.core.recording import DERIVATIVES
from fourpole.errors import TableError, UnitError
from fourpole.io.text import TextTable, read_table

_MOTIONS = ("velocity", "displacement", "acceleration")


@dataclass(frozen=True)
class _Role:
    """A quantity: its name in messages, usual names of its column (as `_plain` writes them), and its kinds of unit."""

    says: str
    names: str
    kinds: tuple[str, ...]


_ROLES = {
    "frequency": _Role("frequency", "frequency freq f frequenz fréquence omega ω w", ("frequency",)),
    "R": _Role("R = Re(V1/F1)", "r rem re(m) remobility re(v1f1) mobilityre", ("mobility",)),
    "I": _Role("I = Im(V1/F1)", "i imm im(m) immobility im(v1f1) mobilityim", ("mobility",)),
    "Re K*": _Role("Re K*", "rek* rek re(k*) re(k) k' kprime storagestiffness", ("stiffness",)),
    "Im K*": _Role("Im K*", "imk* imk im(k*) im(k) k'' k\" kdoubleprime lossstiffness", ("stiffness",)),
    "force": _Role("force amplitude F1", "f1 f force forceamplitude fin forcein kraft", ("force",)),
    "motion": _Role(
        "motion amplitude",
        "v1 v velocity velocityamplitude x1 x displacement displacementamplitude amplitude deflection s s1 u1 weg "
        "a1 a acceleration accelerationamplitude",
        _MOTIONS,
    ),
    "phase": _Role(
        "phase of the force ahead of the motion",
        "phase phi φ ϕ alpha α delta δ phaseangle angle phasef1v1 phasef1x1 phasefv phasefx lossangle phasenwinkel",
        ("angle",),
    ),
    "load": _Role("load", "load force f fz f1 kraft last radialload verticalload", ("force",)),
    "deflection": _Role(
        "deflection", "deflection displacement x x1 z d s travel weg δ einfederung compression", ("displacement",)
    ),
}
#: Kind of a motion whose column has no unit, by the first letter of its name.
_BY_LETTER = {"v": "velocity", "x": "displacement", "d": "displacement", "s": "displacement", "u": "displacement",
              "w": "displacement", "a": "acceleration"}  # fmt: skip

_FORMS = (("R", "I"), ("force", "motion", "phase"), ("Re K*", "Im K*"))


@dataclass(frozen=True)
class _Column:
    role: str
    name: str
    index: int
    kind: str
    unit: str
    assumed: bool

    def __str__(self) -> str:
        taken = ", no unit given: taken as SI" if self.assumed else ""
        return f"{_ROLES[self.role].says}: column {units.shown(self.name)} [{self.unit}]{taken}"


@dataclass(frozen=True, eq=False)
class ReducedTable(ByValue):
    """A table of mobility or dynamic stiffness over frequency; one of both is None.

    Attributes
    ----------
    frequency : (N,) float [Hz]
    mobility : (N,) complex [m/(N s)], or None
        V1/F1 of everything between the force cell and the foundation.
    stiffness : (N,) complex [N/m], or None
        K* of the specimen alone.
    lines : list of int
        Line of each row in the file.
    understood : list of str
        Sentences on how each column was read.
    warnings : list of str
        Sentences on lines that are no data and cells that are no numbers.
    """

    frequency: FloatArray
    mobility: ComplexArray | None
    stiffness: ComplexArray | None
    lines: list[int]
    understood: list[str]
    warnings: list[str]


@dataclass(frozen=True, eq=False)
class CurveTable(ByValue):
    """A load-deflection table: deflection [m] and load [N] of each row, how they were read, and warnings."""

    deflection: FloatArray
    load: FloatArray
    understood: list[str]
    warnings: list[str]


def read_reduced(path: str | os.PathLike[str], *, label: str | None = None) -> ReducedTable:
    r"""Read a table with a frequency and one of (R, I), (F1, V1, phase), (F1, x1, phase), (Re K*, Im K*).

    Parameters
    ----------
    path : path
        A text table; see `read_table`.
    label : str, optional
        The file's name in messages.

    Returns
    -------
    ReducedTable
        The table in SI units.

    Raises
    ------
    FileError, TableError
        If the file cannot be read, or a quantity has no recognisable column.

    Examples
    --------
    >>> import tempfile, pathlib
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = pathlib.Path(folder, "bench.csv")
    ...     _ = file.write_text("f [Hz],F [N],x [mm],phase [deg]\n10,200,1,0\n")
    ...     print(read_reduced(file).mobility.round(9))
    [0.+0.00031416j]
    """
    table = read_table(path, label=label)
    columns = _matched(table, ("frequency", *(role for form in _FORMS for role in form)))
    if "frequency" not in columns:
        raise TableError(f"{table.label}: {_lacking(table, 'frequency')}")
    form = next((form for form in _FORMS if all(role in columns for role in form)), None)
    if form is None:
        raise TableError(f"{table.label}: {_lacking_form(columns)}")
    used = [columns["frequency"], *(columns[role] for role in form)]
    frequency = _si(table, columns["frequency"])
    values = [_si(table, columns[role]) for role in form]
    mobility = stiffness = None
    if form[0] == "force":
        _check_phase(table, columns["phase"], values[2])
        mobility = _mobility(frequency, values[0], values[1], values[2], columns["motion"].kind)
    elif form[0] == "R":
        mobility = values[0] + 1j * values[1]
    else:
        stiffness = values[0] + 1j * values[1]
    understood = [str(column) for column in used]
    return ReducedTable(frequency, mobility, stiffness, table.lines, understood, _warnings(table, used))


def _check_phase(table: TextTable, column: _Column, phase: FloatArray) -> None:
    """TableError if a phase without a unit is larger than a full turn in radians."""
    if column.assumed and np.nanmax(np.abs(phase), initial=0.0) > 2 * np.pi:
        what = f"column {units.shown(column.name)} has no unit and is too large for radians"
        raise TableError(f"{table.label}: {what}: name it 'phase [deg]'")


def read_curve(
    path: str | os.PathLike[str],
    *,
    load_column: str | None = None,
    deflection_column: str | None = None,
    label: str | None = None,
) -> CurveTable:
    r"""Read a load-deflection table.

    Parameters
    ----------
    path : path
        A text table; see `read_table`.
    load_column, deflection_column : str, optional
        Names of the columns, if they are not usual ones.
    label : str, optional
        The file's name in messages.

    Returns
    -------
    CurveTable
        The curve in SI units.

    Raises
    ------
    FileError, TableError
        If the file cannot be read, or a quantity has no recognisable column.

    Examples
    --------
    >>> import tempfile, pathlib
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = pathlib.Path(folder, "curve.csv")
    ...     _ = file.write_text("deflection [mm],load [kN]\n0,0\n10,1.5\n")
    ...     print(read_curve(file).load)
    [   0. 1500.]
    """
    table = read_table(path, label=label)
    columns = _matched(table, ("load", "deflection"))
    for role, name in (("load", load_column), ("deflection", deflection_column)):
        if name is not None:
            try:
                columns[role] = _column(table, table.index(name), role)
            except UnitError as error:
                raise TableError(f"{table.label}, column {units.shown(name)}: {error}") from None
        if role not in columns:
            raise TableError(f"{table.label}: {_lacking(table, role)}, or name it with --{role}-column")
    used = [columns["deflection"], columns["load"]]
    deflection, load = (_si(table, column) for column in used)
    return CurveTable(deflection, load, [str(column) for column in used], _warnings(table, used))


def _plain(name: str) -> str:
    """A column's name in small letters, without blanks and punctuation."""
    return re.sub(r"[\s_\-.,:/]+", "", name.strip().casefold())


def _matched(table: TextTable, roles: Sequence[str]) -> dict[str, _Column]:
    """The column of each role that the table has; TableError if two columns have the same role."""
    found: dict[str, _Column] = {}
    for index in range(len(table.names)):
        for role in roles:
            if _plain(table.names[index]) not in _ROLES[role].names.split():
                continue
            column = _column_or_none(table, index, role)
            if column is None:
                continue
            if role in found:
                both = f"{units.shown(found[role].name)} and {units.shown(column.name)}"
                raise TableError(f"{table.label}: {both} could both be the {_ROLES[role].says}: rename one of them")
            found[role] = column
            break
    return found


def _column_or_none(table: TextTable, index: int, role: str) -> _Column | None:
    """The column in this role; None if its unit, or the case of the letter f, contradicts the role."""
    name, unit = table.names[index], table.units[index]
    if unit is None and name == "f" and role in ("force", "load"):
        return None
    if unit is None and name == "F" and role == "frequency":
        return None
    try:
        return _column(table, index, role)
    except UnitError:
        return None


def _column(table: TextTable, index: int, role: str) -> _Column:
    name, unit = table.names[index], table.units[index]
    kinds = _ROLES[role].kinds
    if unit is not None:
        kind, _ = units.channel_scale(unit, kinds)
        return _Column(role, name, index, kind, unit, assumed=False)
    kind = _BY_LETTER.get(name[:1].casefold(), kinds[0]) if role == "motion" else kinds[0]
    turning = role == "frequency" and _plain(name) in ("omega", "ω", "w")
    return _Column(role, name, index, kind, "rad/s" if turning else units.si_unit(kind), assumed=True)


def _si(table: TextTable, column: _Column) -> FloatArray:
    return units.to_si(table.column(table.headers[column.index]), column.unit, column.kind)


def _mobility(
    frequency: FloatArray, force: FloatArray, motion: FloatArray, phase: FloatArray, kind: str
) -> ComplexArray:
    """V1/F1 from the amplitudes of the force and of any motion; the force leads that motion by `phase` [rad]."""
    turns = DERIVATIVES[kind]
    with np.errstate(divide="ignore", invalid="ignore"):  # a zero leaves its row without a value
        velocity = motion * (2 * np.pi * frequency) ** turns
        return Phasors.from_polar(frequency, force, velocity, phase - turns * np.pi / 2).mobility


def _lacking(table: TextTable, role: str) -> str:
    wanted = _ROLES[role]
    example = f"{wanted.names.split()[0]} [{units.si_unit(wanted.kinds[0])}]"
    has = ", ".join(units.shown(name)[1:-1] for name in table.headers[:20])
    return f"no column is understood as the {wanted.says} among {has}: name it '{example}'"


def _lacking_form(columns: dict[str, _Column]) -> str:
    known = ", ".join(str(column) for column in columns.values())
    return (
        "beside the frequency one of (R, I), (F1, V1, phase), (F1, x1, phase) or (Re K*, Im K*) is needed; "
        f"understood were {known}"
    )


def _warnings(table: TextTable, used: Sequence[_Column]) -> list[str]:
    names = {column.name for column in used}
    assumed = [f"column {units.shown(c.name)} has no unit: taken as {c.unit}" for c in used if c.assumed]
    left = [f"line {line} is not data and was left out: {text}" for line, text in table.skipped]
    return assumed + left + [f"{bad}: the row cannot be used" for bad in table.bad if bad.column in names]
