r"""Forms in which a table may give K* or V1/F1, and the complex values that each gives.

K* = K' + jK'' = \|K*\| e^{jδ}, with K'' = K' tan δ = ω C; the same for the moduli G* and E*. From amplitudes of force
and motion and the phase φ of the force ahead of it, V1/F1 is known.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fourpole.core.arrays import ByValue, ComplexArray, FloatArray
from fourpole.core.phasor import Phasors
from fourpole.core.recording import DERIVATIVES
from fourpole.errors import TableError
from fourpole.io.tables.cells import Cells
from fourpole.io.tables.columns import Taken, chosen, unclear, unread
from fourpole.io.tables.responses import as_mobility
from fourpole.io.tables.vocabulary import ROLES, amplitude_of, plain
from fourpole.units import shown
from fourpole.words import first_of

LEVELS = (("storage", "loss"), ("storage", "tan"), ("storage", "damping"), ("storage", "angle"), ("magnitude", "angle"),
          ("magnitude", "tan"), ("magnitude", "damping"))  # fmt: skip
RATIOS = (("R", "I"), ("ratio", "angle"), ("force", "motion", "angle"), ("Re(TR)", "Im(TR)"), ("TR", "angle"))
#: Roles of which K* may be made.
QUANTITIES = ("storage", "loss", "magnitude", "tan", "angle", "damping", "R", "I", "ratio", "force", "motion", "TR",
              "Re(TR)", "Im(TR)")  # fmt: skip
#: Roles one of which each form of V2/V1 has.
_ACROSS = frozenset({"TR", "Re(TR)"})
_LETTERS = ("K", "G", "E", "M")
_SHARED = ("tan", "angle", "damping")
#: Heads of a phase that name its motion, and the derivatives from this motion to a velocity.
_PHASES = {"phasef1v1": 0, "phasefv": 0, "phasef1x1": 1, "phasefx": 1}
#: Largest relative difference of two forms of one table that is not said.
_ALIKE = 0.02
#: Largest number of rows that a remark names.
_MOST_NAMED = 8
_NEEDED = (
    "one of (K', K''), (K', tan δ), (K', C), (|K*|, loss angle), (|K*|, tan δ), the same of a modulus G or E, "
    "(F1, x1, phase), or real and imaginary part or modulus and phase of V1/F1, another ratio of motion and force, or "
    "V2/V1"
)


@dataclass(frozen=True, eq=False)
class Form(ByValue):
    """The columns that together give K*, a modulus, V1/F1 or V2/V1, by their roles; `letter` is K, G, E, M or empty."""

    columns: Mapping[str, Taken]
    letter: str

    @property
    def is_mobility(self) -> bool:
        """Whether it gives V1/F1 of all that is beyond the force cell."""
        return not self.letter and not self.is_transmissibility

    @property
    def is_transmissibility(self) -> bool:
        """Whether it gives V2/V1 of the two sides of the specimen."""
        return not _ACROSS.isdisjoint(self.columns)


def forms_in(cells: Cells, found: Sequence[Taken]) -> list[Form]:
    """All complete forms, the preferred first; with stated columns, only those that have all of them.

    Raises
    ------
    TableError
        If there is none.
    """
    by_role = _by_role(found)
    stated = {one.role for one in found if one.stated and one.role in QUANTITIES}
    complete: dict[str, list[tuple[str, str]]] = {}  # other forms of a letter are compared with it by `contradictions`
    for letter in (*_LETTERS, ""):
        for roles in LEVELS if letter else RATIOS:
            places = [(role, "" if role in _SHARED else letter) for role in roles]
            key = letter or ("V2/V1" if _ACROSS & set(roles) else "")
            if stated <= set(roles) and all(place in by_role for place in places):
                complete.setdefault(key, places)
    if not complete:
        raise TableError(f"{cells.where}: {_lacking(cells, found, stated)}")
    return [
        Form({place[0]: chosen(cells, by_role[place]) for place in places}, letter if letter in _LETTERS else "")
        for letter, places in complete.items()
    ]


def _by_role(found: Sequence[Taken]) -> dict[tuple[str, str], list[Taken]]:
    """The columns by their roles and letters."""
    by_role: dict[tuple[str, str], list[Taken]] = {}
    for one in found:
        by_role.setdefault((one.role, one.letter), []).append(one)
    return by_role


def _lacking(cells: Cells, found: Sequence[Taken], stated: set[str]) -> str:
    roles = [one for one in found if one.role in QUANTITIES]
    known = ", ".join(dict.fromkeys(map(str, roles))) or "none of them"
    if stated:
        named = ", ".join(sorted(stated))
        return f"the stated columns ({named}) are not all of one form: K* needs {_NEEDED}; understood were {known}"
    text = f"beside the frequency {_NEEDED} is needed; understood were {known}"
    if heads := unclear(cells):
        head = heads[0]
        text += f'; {shown(head)} may be K\' or |K*|: state --column "storage={head}" or --column "magnitude={head}"'
    else:
        heads = [column.head for column in cells.columns if not column.words]
        text += f"; the columns are {', '.join(shown(one)[1:-1] for one in heads[:20])}: state which is what, as in "
        roles_of = {one.role for one in roles}
        likely = [one for one in ("magnitude", "storage") if one == "storage" or roles_of & {"angle", "tan"}]
        text += " or ".join(f'--column "{one}=NAME [kN/m]"' for one in likely)
    if any("db" in f"{one.unit} {one.head}".casefold().split() for one in cells.columns if not one.words):
        text += "; levels in dB are not read: write 10^(dB/20) of the reference in their place"
    return text + unread(cells)


def value(form: Form, frequency: FloatArray) -> ComplexArray:
    """K* [N/m], the modulus [Pa], or V1/F1 [m/(N s)] of each row."""
    si = {role: one.si for role, one in form.columns.items()}
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):  # such a row has no value
        if form.is_transmissibility:
            return np.asarray(
                si["Re(TR)"] + 1j * si["Im(TR)"] if "Re(TR)" in si else si["TR"] * np.exp(1j * si["angle"])
            )
        if "R" in si:
            return as_mobility(si["R"] + 1j * si["I"], form.columns["R"].kind, 2 * np.pi * frequency)
        if "ratio" in si:
            ratio = si["ratio"] * np.exp(1j * si["angle"])
            return as_mobility(ratio, form.columns["ratio"].kind, 2 * np.pi * frequency)
        if "force" in si:
            turns = DERIVATIVES[form.columns["motion"].kind]
            velocity = si["motion"] * (2 * np.pi * frequency) ** turns
            turns = _PHASES.get(plain(form.columns["angle"].column.name), turns)
            return Phasors.from_polar(frequency, si["force"], velocity, si["angle"] - turns * np.pi / 2).mobility
        if "magnitude" in si and "damping" in si:
            viscous = 2 * np.pi * frequency * si["damping"]
            return np.asarray(np.sqrt(si["magnitude"] ** 2 - viscous**2) + 1j * viscous)
        if "magnitude" in si:
            angle = si["angle"] if "angle" in si else np.arctan(si["tan"])
            return np.asarray(si["magnitude"] * np.exp(1j * angle))
        if "loss" in si:
            loss = si["loss"]
        elif "damping" in si:
            loss = 2 * np.pi * frequency * si["damping"]
        else:
            loss = si["storage"] * (si["tan"] if "tan" in si else np.tan(si["angle"]))
        return np.asarray(si["storage"] + 1j * loss)


def check(cells: Cells, form: Form, values: ComplexArray) -> list[str]:
    """Remarks on impossible values of the columns of a form.

    Raises
    ------
    TableError
        If all rows are impossible, as with an empty column or the other sign of the phase.
    """
    remarks = []
    where = cells.where
    for role, one in form.columns.items():
        si = one.si
        there = np.isfinite(si)
        named = f"{where}: column {shown(one.column.name)}"
        if not there.any():
            raise TableError(f"{named} holds no number: name another as the {ROLES[role].says}, by --column")
        if role in ("loss", "tan", "damping", "storage", "magnitude") and not np.any(si[there]):
            raise TableError(f"{named} is zero in all rows: it was not measured; name another by --column")
        if role == "angle" and np.nanmax(np.abs(si)) > 2 * np.pi * (1 + 1e-9):
            raise TableError(f"{named} [{one.unit}] goes beyond a full turn: the unit is another, or cells are wrong")
    if {"force", "motion"} <= form.columns.keys():
        _check_amplitudes(cells, form.columns["force"].column.head, form.columns["motion"].column.head)
    if form.letter:
        remarks += _signs(cells, form, values.imag)
    elif form.is_mobility:
        remarks += _signs(cells, form, values.real)
    return remarks


def _check_amplitudes(cells: Cells, force: str, motion: str) -> None:
    """TableError if one head states an amplitude from peak to peak, or an rms value, and the other one nothing."""
    kinds = [amplitude_of(head)[0] for head in (force, motion)]
    if "" in kinds and {"rms", "pp"} & {*kinds}:
        silent, says = (force, motion) if kinds[0] == "" else (motion, force)
        raise TableError(
            f"{cells.where}: {shown(says)} states how its amplitude is meant, {shown(silent)} does not: write peak, "
            "rms or p-p into its head"
        )


def _signs(cells: Cells, form: Form, loss: FloatArray) -> list[str]:
    """Remarks on rows whose loss is negative; TableError if it is in all of them."""
    rows = [cells.lines[at] for at in np.flatnonzero(loss < 0)]  # K' < 0 is inertia, and no fault
    if not rows:
        return []
    role = next(role for role in ("loss", "tan", "angle", "damping", "R") if role in form.columns)
    name = f"column {shown(form.columns[role].column.name)}"
    if len(rows) == np.isfinite(loss).sum():
        raise TableError(
            f"{cells.where}: {name} makes the loss negative in all rows: K'' of a passive specimen is positive "
            "with e^{+jωt}; a phase is of the force ahead of the motion, or of the ratio: reverse the sign "
            f'in the file, or state --column "{role}=-{form.columns[role].column.name}"'
        )
    return [f"{name}: the loss is negative in {rows_named(rows)}"]


def rows_named(rows: Sequence[int]) -> str:
    """Rows by their numbers: "row 7", "rows 3, 4 and 9 more"."""
    return f"{'row' if len(rows) == 1 else 'rows'} {first_of([str(one) for one in rows], _MOST_NAMED)}"


def contradictions(cells: Cells, found: Sequence[Taken], form: Form, values: ComplexArray) -> list[str]:
    """Remarks on columns that are not used and differ from what the form gives."""
    if not form.letter:
        return []
    with np.errstate(divide="ignore", invalid="ignore"):
        given = {"loss": values.imag, "storage": values.real, "magnitude": np.abs(values),
                 "tan": values.imag / values.real}  # fmt: skip
    remarks = []
    for one in found:
        if one.role not in given or one.unit is None or one.role in form.columns or one.letter not in ("", form.letter):
            continue
        other, own = one.si, given[one.role]
        with np.errstate(divide="ignore", invalid="ignore"):
            off = np.abs(other / own - 1)
        off[~np.isfinite(off)] = 0.0
        rows = [cells.lines[at] for at in np.flatnonzero(off > _ALIKE)]
        if rows:
            remarks.append(
                f"column {shown(one.column.head)} differs from what the columns used give by up to "
                f"{100 * float(off.max()):.2g} % ({rows_named(rows)}): check which of them is right"
            )
    return remarks
