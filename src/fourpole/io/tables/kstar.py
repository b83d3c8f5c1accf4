"""Any table of K*, of a modulus or of V1/F1 becomes frequency and complex values in SI."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from fourpole import quantities as q
from fourpole.core.arrays import ByValue, ComplexArray, FloatArray
from fourpole.core.reduced import coherence_std
from fourpole.errors import TableError
from fourpole.io.formats import uff
from fourpole.io.recordings import format_of
from fourpole.io.signals import MAX_FILE_BYTES
from fourpole.io.source import AnyPath, name_of
from fourpole.io.tables.cells import BY_NUMBER, Cells, tables_in
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
from fourpole.io.tables.forms import QUANTITIES, Form, check, contradictions, forms_in, rows_named, value
from fourpole.io.tables.labels import joined, labels_in, measured
from fourpole.io.tables.responses import MeasuredResponse, read_response
from fourpole.io.tables.vocabulary import readings
from fourpole.models.shape import Shape
from fourpole.units import shown

#: Heads of the columns of conditions, and of the uncertainty of K*, by role.
_CONDITIONS = {"temperature": q.TEMPERATURE.head, "pressure": q.PRESSURE.head, "preload": q.PRELOAD.head,
               "amplitude": q.DEFLECTION_AMPLITUDE.head}  # fmt: skip
_STD = {"u(storage)": q.STORAGE.u_head, "u(loss)": q.LOSS.u_head}
_ROLES = ("frequency", *QUANTITIES, *_CONDITIONS, *_STD, "coherence", "tyre")
#: What to state where a modulus has no shape.
NO_SHAPE = (
    'state --shape-factor "0.05 m" (K* per modulus), or --mode shear --height "10 mm" --area "5 cm^2" for K = G A/h, '
    'or --mode compression for K = E A/h; --shape-factor "1 m" keeps the numbers of the modulus'
)
#: Name of a group that means all of them.
ALL = "*"
_RIG = (
    "it is of the specimen and what is behind it: state --no-rig where its far side does not move, or the rig's values "
    "to fourpole identify"
)


_ACROSS = "of specimen and rig: state the rig's values to fourpole identify"


@dataclass(frozen=True)
class TableOptions:
    """What a user states of a table of K*.

    Attributes
    ----------
    columns : sequence of str
        Which column is what, as the option ``--column`` has it: "storage=G' [kPa]".
    group : str
        The sheet or group; empty if only one holds K*; "*" for all of them together.
    factor : float, optional [m]
        K* per modulus.
    shape : Shape, optional
        In place of `factor`: mode, height and area.
    moduli : bool
        Whether a modulus [Pa] takes the place of K* [N/m] where no factor is stated.
    ratio : bool
        Whether V1/F1 may be taken: the rig is stated, or the far side of the specimen does not move.
    rig : bool
        Whether V2/V1 may be taken: the rig is stated.
    averages : float, optional [1]
        Number of independent averages of the coherence.
    """

    columns: Sequence[str] = ()
    group: str = ""
    factor: float | None = None
    shape: Shape | None = None
    moduli: bool = False
    ratio: bool = False
    rig: bool = False
    averages: float | None = None


@dataclass(frozen=True, eq=False)
class KStarTable(ByValue):
    """A table of K*, of V1/F1 or of V2/V1 over frequency; the others are None.

    Attributes
    ----------
    frequency : (N,) float [Hz]
    mobility : (N,) complex [m/(N s)], or None
        V1/F1 of everything between the force cell and the foundation.
    stiffness : (N,) complex [N/m], or None
        K* of the specimen alone.
    transmissibility : (N,) complex [1], or None
        V2/V1 of the specimen on the rig.
    lines : list of int
        Line, or number, of each row in the file.
    understood : list of str
        Sentences on how each column was read.
    warnings : list of str
        Sentences on rows that are no data, cells that are no numbers, and impossible values.
    std : (N,) float [1], or None
        Relative standard uncertainty of K* or V1/F1, the same in all directions, from the coherence.
    further : polars.DataFrame
        Conditions and uncertainties in SI by the heads of result tables, and the columns of no known role.
    labels : tuple of str
        Heads of columns of words in `further` that may tell rows apart, though no known word says so.
    """

    frequency: FloatArray
    mobility: ComplexArray | None
    stiffness: ComplexArray | None
    lines: list[int]
    understood: list[str]
    warnings: list[str]
    std: FloatArray | None = None
    further: pl.DataFrame = field(default_factory=pl.DataFrame)
    transmissibility: ComplexArray | None = None
    labels: tuple[str, ...] = ()

    def frame(self) -> pl.DataFrame:
        """The table as one of results: frequency [Hz], Re K*, Im K* and their uncertainty [N/m], conditions.

        V1/F1 gives K* = jω/(V1/F1): the far side does not move.
        """
        stiffness = self.stiffness
        if stiffness is None:
            with np.errstate(divide="ignore", invalid="ignore"):
                stiffness = np.asarray(2j * np.pi * self.frequency / np.asarray(self.mobility))
        columns = {q.FREQUENCY.head: self.frequency, q.STORAGE.head: stiffness.real, q.LOSS.head: stiffness.imag}
        if self.std is not None and not set(_STD.values()) & set(self.further.columns):
            columns |= dict.fromkeys(_STD.values(), self.std * np.abs(stiffness))
        return pl.DataFrame(columns).hstack(self.further.drop(columns, strict=False))


def read_k_star(path: AnyPath, options: TableOptions | None = None, *, label: str | None = None) -> KStarTable:
    r"""Read a table of K* of any format, known by the heads and units of its columns.

    Beside the frequency (Hz, rad/s or rpm) it has one of (K', K''), (K', tan δ), (K', C), (\|K*\|, loss angle),
    (\|K*\|, tan δ), the same of a modulus G or E, (F1, V1 or x1, phase), or a ratio of motion and force, or V2/V1, as
    real and imaginary part or modulus and phase.

    Parameters
    ----------
    path : path
        A file of any format that recordings have; of UFF 58, a frequency response.
    options : TableOptions, optional
        What the file does not say.
    label : str, optional
        The file's name in messages.

    Returns
    -------
    KStarTable
        The table in SI units.

    Raises
    ------
    FileError, TableError
        If the file cannot be read, a quantity has no column, two columns or no unit, or a modulus has no shape.

    Examples
    --------
    >>> import tempfile, pathlib
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = pathlib.Path(folder, "bench.csv")
    ...     _ = file.write_text("f [Hz],|K*| [N/mm],loss angle [deg]\n10,200,90\n", encoding="utf-8")
    ...     print(read_k_star(file).stiffness.imag.tolist())
    [200000.0]
    """
    options = TableOptions() if options is None else options
    stated = statements(options.columns)
    name = name_of(path, label)
    if format_of(Path(path), max_bytes=MAX_FILE_BYTES, label=name) is uff.FORMAT:
        return _of_response(read_response(Path(path), stated, name), options, name)
    if other := [one.role for one in stated if one.role not in _ROLES]:
        raise TableError(f"--column: {', '.join(other)} is no role of a table of K*; its roles are {', '.join(_ROLES)}")
    tables = tables_in(Path(path), group="" if options.group == ALL else options.group, label=label)
    if len(tables) == 1:
        return _understood(tables[0], stated, options)
    return _of_tables(tables, stated, options)


def _of_tables(tables: Sequence[Cells], stated: Sequence[Statement], options: TableOptions) -> KStarTable:
    """The one of several tables that is understood, or all that are, together."""
    good, errors = [], []
    for one in tables:
        try:
            good.append((one, _understood(one, stated, options)))
        except TableError as error:
            errors.append(error)
    if good and (len(good) == 1 or options.group == ALL):
        return _together([one for _, one in good], [str(error) for error in errors])
    if not good:
        first = "; ".join(str(one).removeprefix(f"{tables[0].label} ") for one in errors[:3])
        raise TableError(f"{tables[0].label}: no sheet or group is understood: {first}")
    names = ", ".join(shown(one.group) for one, _ in good[:12])
    what = f"{len(good)} sheets or groups hold K*: {names}"
    raise TableError(f'{tables[0].label}: {what}; name one with --group, or take all with --group "{ALL}"')


def _together(tables: Sequence[KStarTable], left: Sequence[str]) -> KStarTable:
    """Several tables as one, row below row; `left` are the reasons why others were left out."""
    first = tables[0]
    if len(tables) == 1:
        return first
    if any(
        (one.mobility is None, one.stiffness is None) != (first.mobility is None, first.stiffness is None)
        for one in tables
    ):
        raise TableError("some sheets or groups hold K*, others V1/F1 or V2/V1: name one with --group")

    def together(name: str) -> Any:
        parts = [getattr(one, name) for one in tables]
        return None if any(one is None for one in parts) else np.concatenate(parts)

    return KStarTable(
        frequency=together("frequency"),
        mobility=together("mobility"),
        stiffness=together("stiffness"),
        transmissibility=together("transmissibility"),
        lines=[line for one in tables for line in one.lines],
        understood=list(dict.fromkeys(text for one in tables for text in one.understood)),
        warnings=list(dict.fromkeys([*(text for one in tables for text in one.warnings), *left])),
        std=together("std"),
        labels=tuple(dict.fromkeys(label for one in tables for label in one.labels)),
        further=pl.concat([one.further for one in tables], how="diagonal_relaxed"),
    )


def _understood(cells: Cells, stated: Sequence[Statement], options: TableOptions) -> KStarTable:
    cells = measured(cells)
    found = taken(cells, stated, _ROLES)
    turns = [one for one in found if one.role == "frequency"]
    if not turns:
        raise TableError(f"{cells.where}: {_no_frequency(cells)}")
    forms = forms_in(cells, found)
    form = _preferred(cells, forms, options)
    column = chosen(cells, turns)
    used = [column, *form.columns.values()]
    check_units(cells, used)
    frequency = column.si
    values = value(form, frequency)
    remarks = [*cells.remarks, *check(cells, form, values), *contradictions(cells, found, form, values)]
    said = said_of(cells, used)
    factor = 1.0
    if form.letter in ("G", "E", "M"):
        factor, text = factor_of(cells, form, options)
        values = factor * values
        said.append(text)
    elif form.letter == "K" and (options.factor is not None or options.shape is not None):
        raise TableError(f"{cells.where}: holds a stiffness, not a modulus; leave out the shape")
    std, spoken = _std(cells, found, options)
    of_form = [one for one in found if one.letter in ("", form.letter)]
    further, kept, notes = further_of(cells, of_form, used, factor)
    remarks += [*_rows(cells, [*used, *kept], frequency, values), *spoken, *notes]
    known = {id(one.column) for one in (*used, *kept)}
    return KStarTable(
        frequency=frequency,
        mobility=values if form.is_mobility else None,
        stiffness=values if form.letter else None,
        transmissibility=values if form.is_transmissibility else None,
        lines=cells.lines,
        understood=[*said, *map(str, kept)],
        warnings=remarks,
        std=std,
        further=further,
        labels=tuple(one.head for one in labels_in(cells)[1] if id(one) not in known),
    )


def _of_response(found: MeasuredResponse, options: TableOptions, name: str) -> KStarTable:
    """The table of a frequency response."""
    if found.kind == "transmissibility" and not options.rig:
        raise TableError(f"{name}: {found.said[0]}: {_ACROSS}")
    if found.kind == "mobility" and not options.ratio:
        raise TableError(f"{name}: {found.said[0]}: {_RIG}")
    used = found.frequency > 0
    std, remarks = None, list[str]()
    if found.coherence is not None and options.averages is None:
        remarks.append("the file has its coherence: state --averages for the uncertainty that it gives")
    elif found.coherence is not None:
        std = _of_coherence(found.coherence[used], options.averages or 1.0, name)
    values = found.values[used]
    return KStarTable(
        frequency=found.frequency[used],
        mobility=values if found.kind == "mobility" else None,
        stiffness=values if found.kind == "stiffness" else None,
        transmissibility=values if found.kind == "transmissibility" else None,
        lines=(np.flatnonzero(used) + 1).tolist(),
        understood=found.said,
        warnings=[*found.remarks, *remarks],
        std=std,
    )


def _no_frequency(cells: Cells) -> str:
    numbered = [one for one in cells.remarks if one.endswith(BY_NUMBER)]
    because = "" if not numbered else f"; {numbered[0]}"
    if any(role == "time" for one in cells.columns for role, _ in readings(one.name)):
        because += "; relaxation and creep over time are for fourpole fit, with a column E(t), K(t) or J(t)"
    return (
        f"no column is understood as the frequency among {cells.heads}: name it 'frequency [Hz]', or state "
        f'--column "frequency=NAME [Hz]"{because}{unread(cells)}'
    )


def _preferred(cells: Cells, forms: Sequence[Form], options: TableOptions) -> Form:
    """The form that the options ask for: a modulus with a shape, V1/F1 with a rig, or else K*."""
    moduli = [one for one in forms if one.letter in ("G", "E", "M")]
    ratios = [one for one in forms if one.is_mobility]
    across = [one for one in forms if one.is_transmissibility]
    shaped = options.factor is not None or options.shape is not None
    if shaped and moduli:
        return _one_modulus(cells, moduli, options)
    if options.ratio and ratios:
        return ratios[0]
    if options.rig and across:
        return across[0]
    if stiffness := next((one for one in forms if one.letter == "K"), None):
        return stiffness
    if moduli and options.moduli:
        return _one_modulus(cells, moduli, options)
    raise TableError(f"{cells.where}: {_ways(moduli, ratios, across)}")


def _ways(moduli: Sequence[Form], ratios: Sequence[Form], across: Sequence[Form]) -> str:
    """What has to be stated so that a modulus or V1/F1 gives K*."""
    ways = (
        (moduli, " and ", f"a modulus, which becomes K* by the shape: {NO_SHAPE}"),
        (ratios, ", ", f"V1/F1: {_RIG}"),
        (across, ", ", f"V2/V1, {_ACROSS}"),
    )
    return "; or: ".join(
        f"{between.join(shown(one.column.name) for one in forms[0].columns.values())} give {what}"
        for forms, between, what in ways
        if forms
    )


def _one_modulus(cells: Cells, moduli: Sequence[Form], options: TableOptions) -> Form:
    mode = None if options.shape is None else options.shape.mode
    wanted = [one for one in moduli if one.letter == {"shear": "G", "compression": "E"}.get(mode or "")] or list(moduli)
    if len(wanted) > 1:
        heads = " and ".join(shown(next(iter(one.columns.values())).column.head) for one in wanted)
        raise TableError(f'{cells.where}: {heads} are different moduli; say which, as in --column "storage=..."')
    return wanted[0]


def factor_of(cells: Cells, form: Form, options: TableOptions) -> tuple[float, str]:
    """K* per modulus [m], and how it came about."""
    if options.factor is not None:
        return options.factor, f"K* = {options.factor:.6g} m times the modulus"
    if options.shape is None:
        return 1.0, "the modulus in Pa takes the place of K* in N/m"
    mode = options.shape.mode
    if (form.letter, mode) in (("G", "compression"), ("E", "shear")):
        other = "shear" if form.letter == "G" else "compression"
        raise TableError(
            f"{cells.where}: {form.letter}* is a modulus of {other}, and --mode is {mode}: state --mode {other}, "
            "or the stiffness per modulus by --shape-factor"
        )
    factor = 1.0 / options.shape.modulus
    bonded = " (1 + 2 k S²), bonded disc" if options.shape.bonded else ""
    letter = "G" if mode == "shear" else "E"
    return factor, f"K* = {letter}* A/h{bonded} = {factor:.6g} m times the modulus"


def _std(cells: Cells, found: Sequence[Taken], options: TableOptions) -> tuple[FloatArray | None, list[str]]:
    """Relative standard uncertainty of each row from the coherence, and a remark if the averages are not stated."""
    coherence = [one for one in found if one.role == "coherence"]
    if not coherence:
        return None, []
    one = chosen(cells, coherence)
    if options.averages is None:
        return None, [f"column {shown(one.column.name)}: state --averages for the uncertainty that the coherence gives"]
    return _of_coherence(one.si, options.averages, cells.where), []


def _of_coherence(coherence: FloatArray, averages: float, where: str) -> FloatArray:
    if np.any((coherence < 0) | (coherence > 1 + 1e-6)):
        raise TableError(f"{where}: a coherence lies outside 0 to 1: the column is another quantity, or in %")
    return coherence_std(np.minimum(coherence, 1.0), averages)


def further_of(
    cells: Cells, found: Sequence[Taken], used: Sequence[Taken], factor: float
) -> tuple[pl.DataFrame, list[Taken], list[str]]:
    """Conditions and uncertainties in SI and columns of no role; the columns in a role; what is left out."""
    columns: dict[str, pl.Series] = {}
    kept, notes = list[Taken](), list[str]()
    gone = {id(one.column) for one in used}
    for role, head in (_CONDITIONS | _STD).items():
        some = [one for one in found if one.role == role and id(one.column) not in gone]
        if some and all(one.unit is None for one in some):
            name = shown(some[0].column.name)
            notes.append(f"column {name} states no unit and was left out; state {some[0].option} to use it")
        elif some:
            kept.append(chosen(cells, some))
            columns[head] = pl.Series(kept[-1].si * (factor if role in _STD else 1.0))
            gone |= {id(one.column) for one in some}
    names = [one for one in found if one.role == "tyre" and id(one.column) not in gone]
    if not any(one.stated for one in names):
        known = {id(one.column) for one in names}
        names += [Taken("tyre", one, "", None, "", stated=False) for one in labels_in(cells)[0] if id(one) not in known]
    if names:
        kept += names
        columns["tyre"] = pl.Series(joined([one.column for one in names]))
        gone |= {id(one.column) for one in names}
    rest: dict[str, pl.Series] = {}
    for one in cells.columns:
        if id(one) not in gone:  # of several with the same head, the first
            rest.setdefault(one.head, pl.Series(one.words or one.values))
    return pl.DataFrame(columns | rest | columns), kept, notes  # the columns in a role come first, and stay


def _rows(cells: Cells, used: Sequence[Taken], frequency: FloatArray, values: ComplexArray) -> list[str]:
    """Remarks on rows without a value, with words among the numbers, or with an impossible frequency."""
    remarks = bad_cells(cells, used)
    blank = [cells.lines[at] for at in np.flatnonzero(~np.isfinite(frequency) | ~np.isfinite(values))]
    if blank:
        remarks.append(f"a value is missing in {rows_named(blank)}")
    below = [cells.lines[at] for at in np.flatnonzero(frequency <= 0)]
    if below:
        remarks.append(f"the frequency is not positive in {rows_named(below)}")
    return remarks
