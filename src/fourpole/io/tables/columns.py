"""Which column of a table is what: by its head and unit, or as the user states it."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from fourpole import units
from fourpole.core.arrays import ByValue, FloatArray
from fourpole.errors import TableError, UnitError
from fourpole.io.layout import is_missing
from fourpole.io.names import listed, named
from fourpole.io.tables.cells import Cells, Column
from fourpole.io.tables.vocabulary import (
    ALIASES,
    FORCE_PER_MOTION,
    ROLES,
    TURNING,
    UNCLEAR,
    amplitude_of,
    channel_roles,
    plain,
    readings,
)
from fourpole.units import shown
from fourpole.words.heads import likelihood

#: Columns of one quantity are the same if all rows agree to this relative difference.
_SAME = 2e-3
_UNIT = re.compile(r"(?P<name>.*\S)\s*\[(?P<unit>[^\[\]]*)\]\s*")
#: Units of a frequency that are rad/s for an angular frequency.
_PER_SECOND = re.compile(r"1\s*/\s*s|s\s*+\^?\s*[-−]1|s⁻¹|1/sec")
#: Roles whose columns are amplitudes.
_AMPLITUDES = ("force", "motion", "amplitude")
#: Kind of a motion without a unit, by the first letter of the column's name; else a displacement.
_MOTIONS = {"v": "velocity", "a": "acceleration"}


@dataclass(frozen=True)
class Statement:
    """What a user states of a column: role, the name or number of the column, its unit, and whether it is reversed."""

    role: str
    name: str
    unit: str | None
    whole: str
    sign: float = 1.0


@dataclass(frozen=True, eq=False)
class Taken(ByValue):
    """A column in its role.

    Attributes
    ----------
    role : str
    column : Column
    kind : str
        Kind of its unit; empty for words.
    unit : str or None
        None if it is not stated.
    letter : str
        K for a stiffness, G, E or M (either) for a modulus; otherwise empty.
    stated : bool
        Whether the user stated the role.
    sign : float [1]
        -1 if the user stated that the sign of the column is reversed.
    """

    role: str
    column: Column
    kind: str
    unit: str | None
    letter: str
    stated: bool
    sign: float = 1.0

    def __str__(self) -> str:
        unit = "" if self.unit is None else f" [{self.unit}]"
        sign = ", reversed" if self.sign < 0 else ""
        return f"{ROLES[self.role].says}: column {shown(self.column.name)}{unit}{sign}"

    @property
    def si(self) -> FloatArray:
        """The values of the column in SI; an amplitude from 0 to its peak."""
        size = amplitude_of(self.column.head)[1] if self.role in _AMPLITUDES else 1.0
        return units.to_si(self.sign * size * self.column.values, self.unit or "", self.kind)

    @property
    def option(self) -> str:
        """The option that states the unit of the column, with a usual unit."""
        unit = "MPa" if self.kind == "pressure" and self.role != "pressure" else ROLES[self.role].unit
        return f'--column "{self.role}={self.column.name} [{unit}]"'


def statements(texts: Iterable[str]) -> list[Statement]:
    """The statements of the option --column, each role=name, with a unit in brackets if need be.

    Examples
    --------
    >>> statements(["storage=G' [kPa]", "phase=3 [deg]"])[1]
    Statement(role='angle', name='3', unit='deg', whole='3 [deg]', sign=1.0)
    """
    found = []
    for text in texts:
        role, mark, name = (part.strip() for part in text.partition("="))
        role = ALIASES.get(role, role)
        if not mark or not name or role not in ROLES:
            known = ", ".join(ROLES)
            raise TableError(
                f'--column: {shown(text)} is not a role and a column, as in --column "storage=G\' [kPa]"; the roles '
                f"are {known}"
            )
        parted = _UNIT.fullmatch(name)
        bare, unit = (parted["name"], parted["unit"].strip() or "1") if parted else (name, None)
        found.append(Statement(role, bare, "1" if unit in ("-", "–") else unit, name))
    roles = [one.role for one in found]
    for role in roles:
        if roles.count(role) > 1:
            raise TableError(f"--column: {role} is stated twice; keep one")
    return found


def taken(cells: Cells, stated: Sequence[Statement], roles: Sequence[str]) -> list[Taken]:
    """The columns in the roles that they may have; a role that is stated has the stated column alone.

    Raises
    ------
    TableError
        If a stated column is missing or ambiguous, or its unit is of another kind.
    """
    found = [_stated(cells, one) for one in stated if one.role in roles]
    fixed = {one.role for one in found}
    used = {id(one.column) for one in found}
    for column in cells.columns:
        if id(column) in used:
            continue
        for role, letter in readings(column.name):
            if role in roles and role not in fixed:
                one = _fitting(column, role, letter)
                found += [] if one is None else [one]
    used |= {id(one.column) for one in found}
    free = [column for column in cells.columns if id(column) not in used]
    for role in [role for role in roles if role not in {one.role for one in found}]:
        named = [_fitting(column, role, "") for column in free if role in channel_roles(column.name)]
        ranked = [(likelihood(one.column.name), one) for one in named if one is not None]
        found += [one for likely, one in ranked if likely == max(ranked, key=lambda pair: pair[0])[0]]
    return found


def _stated(cells: Cells, one: Statement) -> Taken:
    if one.name.startswith("-") and not any(column.head.startswith("-") for column in cells.columns):
        one = replace(one, name=one.name[1:].strip(), whole=one.whole[1:].strip(), sign=-1.0)
    column = _named(cells, one)
    where = f"{cells.label}: --column {one.role}={one.whole}"
    if one.role == "tyre":
        return Taken(one.role, column, "", None, "", stated=True)
    unit = column.unit if one.unit is None else one.unit
    kinds = ROLES[one.role].kinds
    letter = next((letter for role, letter in readings(column.name) if role == one.role), "M")
    unit = _turning(column, one.role, unit) or ROLES[one.role].bare or None
    if unit is None:
        raise _units_lacking(cells, [Taken(one.role, column, kinds[0], None, "", stated=True)])
    try:
        kind, scale = scale_of(unit, kinds)
        written = column.unit if one.unit is not None and column.unit and units.is_unit(column.unit) else unit
        if scale_of(written, kinds) != (kind, scale):
            raise TableError(f"{where}: the column is in {shown(written)} by the file; leave out the unit")
    except UnitError as error:
        raise TableError(f"{where}: {error}") from None
    return Taken(one.role, column, kind, unit, _letter(kind, letter), stated=True, sign=one.sign)


def _named(cells: Cells, one: Statement) -> Column:
    """The column that a statement names, by its head, its name, or else its number from 1 on."""
    places = [("", column.head) for column in cells.columns]
    for wanted in dict.fromkeys((one.whole, one.name)):
        found = named(places, range(len(places)), wanted) or [
            at for at, column in enumerate(cells.columns) if plain(column.name) == plain(wanted)
        ]
        if len(found) == 1:
            return cells.columns[found[0]]
        if found:
            numbers = ", ".join(str(at + 1) for at in found)
            raise TableError(f"{cells.label}: columns {numbers} are called {shown(wanted)}; state the number of one")
    if one.name.isdecimal() and 0 < int(one.name) <= len(cells.columns):
        return cells.columns[int(one.name) - 1]
    names = [column.name for column in cells.columns]
    raise TableError(f"{cells.label}: there is no column {shown(one.name)}{listed(names, one.name)}")


def _fitting(column: Column, role: str, letter: str) -> Taken | None:
    """The column in a role; None if its unit, its words, or the case of the letter f, contradicts the role."""
    if role == "tyre":
        return Taken(role, column, "", None, "", stated=False) if column.words else None
    if column.words or not np.isfinite(column.values).any():
        return None
    if column.unit is None:
        other = {"f": ("force", "load"), "F": ("frequency",), "T": ("time",)}
        if role in other.get(column.name, ()):
            return None
        return Taken(
            role,
            column,
            _kind(column, role, letter),
            _turning(column, role, None) or ROLES[role].bare or None,
            letter,
            stated=False,
        )
    try:
        kind, _ = scale_of(column.unit, ROLES[role].kinds)
    except UnitError:
        return None
    if letter and (kind == "stiffness") != (letter == "K"):
        return None
    return Taken(role, column, kind, _turning(column, role, column.unit), letter, stated=False)


def _kind(column: Column, role: str, letter: str) -> str:
    """The kind of a column without a unit, by its role and its letters."""
    if letter not in ("", "K"):
        return "pressure"
    return ROLES[role].kinds[0] if role != "motion" else _MOTIONS.get(column.name[:1].casefold(), "displacement")


def scale_of(unit: str, kinds: tuple[str, ...]) -> tuple[str, float]:
    """The kind of a unit and the SI value of one of it; of a temperature, of its difference from 0 °C.

    g is 9.80665 m/s² over a force, and a gram below one.
    """
    if kinds == ("temperature",):
        return kinds[0], float(units.to_si(1.0, unit, "temperature"))
    if "mass" in kinds and "acceleration" not in kinds:
        with suppress(UnitError):
            return units.channel_scale(unit, tuple(kind for kind in kinds if kind not in FORCE_PER_MOTION))
        return units.channel_scale(unit, tuple(kind for kind in kinds if kind in FORCE_PER_MOTION))
    return units.channel_scale(unit, kinds)


def _letter(kind: str, letter: str) -> str:
    if kind not in ("stiffness", "pressure"):
        return ""
    return "K" if kind == "stiffness" else (letter if letter in ("G", "E") else "M")


def _turning(column: Column, role: str, unit: str | None) -> str | None:
    """The unit of a column; rad/s for an angular frequency without one, or in 1/s."""
    if role == "frequency" and plain(column.name) in TURNING and (unit is None or _PER_SECOND.fullmatch(unit.strip())):
        return "rad/s"
    return unit


def check_units(cells: Cells, used: Iterable[Taken]) -> None:
    """TableError if columns state no unit, which says how to state all of them."""
    used = list(used)
    lacking = [one for one in used if one.unit is None]
    if lacking:
        raise _units_lacking(cells, lacking)
    for one in used:
        turning = one.kind == "frequency" and plain(one.column.name) in TURNING
        if turning and not one.stated and "hz" in str(one.unit).lower():
            name = shown(one.column.name)
            raise TableError(
                f"{cells.where}: {name} is an angular frequency by its head, and in {one.unit} by its unit: rename "
                f'it, or state --column "frequency={one.column.name} [{one.unit}]"'
            )


def _units_lacking(cells: Cells, lacking: Sequence[Taken]) -> TableError:
    names = ", ".join(shown(one.column.name) for one in lacking)
    what = f"{names} {'states' if len(lacking) == 1 else 'state'} no unit"
    return TableError(f"{cells.where}: {what}: state it, as in {' '.join(one.option for one in lacking)}")


def said_of(cells: Cells, used: Iterable[Taken]) -> list[str]:
    """Sentences on how the columns of a table were read."""
    return [*([f"sheet or group {shown(cells.group)}"] if cells.group else []), *map(str, used)]


def bad_cells(cells: Cells, used: Iterable[Taken]) -> list[str]:
    """Remarks on words among the numbers of columns."""
    return [
        f"row {cells.lines[row]}, column {shown(one.column.name)}: {shown(text)} is no number: the row cannot be used"
        for one in used
        for row, text in one.column.bad
    ]


def chosen(cells: Cells, candidates: Sequence[Taken]) -> Taken:
    """The one of several columns in the same role; the first, if all agree in all rows.

    Raises
    ------
    TableError
        If they differ.
    """
    known = [one for one in candidates if one.unit is not None]
    first = (known or list(candidates))[0]
    values = first.si if known else first.column.values
    for other in known[1:]:
        both = np.isfinite(values) & np.isfinite(other.si)
        if not np.allclose(values[both], other.si[both], rtol=_SAME, atol=0.0) or not both.any():
            names = f"{shown(first.column.head)} and {shown(other.column.head)}"
            number = [id(one) for one in cells.columns].index(id(first.column)) + 1
            raise TableError(
                f"{cells.where}: {names} could both be the {ROLES[first.role].says}, and differ: say which, as in "
                f'--column "{first.role}={first.column.head}", or by its number, --column {first.role}={number}'
            )
    return first


def unread(cells: Cells) -> str:
    """What to do about columns that are known by their heads but hold words, such as 1.234,5; empty without any."""
    lost = [one for one in cells.columns if one.words and {role for role, _ in readings(one.name)} - {"tyre", "time"}]
    if not lost:
        return ""
    cell = next(one for one in lost[0].words if not is_missing(one))
    heads = ", ".join(shown(one.head) for one in lost[:5])
    numbers = "write numbers with one decimal sign, and without a separator of thousands"
    return f"; no numbers, but cells as {shown(cell)}, are in {heads}: {numbers}"


def unclear(cells: Cells) -> list[str]:
    """Heads that may mean more than one quantity, such as K or modulus."""
    return [column.head for column in cells.columns if plain(column.name) in UNCLEAR and not column.words]
