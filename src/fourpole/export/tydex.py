"""TYDEX 1.3: a folder with a file for each condition, which has its tests in rising order of frequency.

IDENTITY, TESTRIG, INFLPRES, FZW and MEASNUMB are names of the standard. The standard has no names for a dynamic
stiffness; the other names are defined here, and their descriptions stand in the file.
"""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import numpy as np

from fourpole import quantities as q
from fourpole.errors import FileError, FourpoleError, TableError
from fourpole.export.source import SIGNS, ExportTables, SheetRow, ascii_line, unit_of
from fourpole.io.door import open_regular
from fourpole.io.formats.tydex_file import TydexChannel, TydexEntry, TydexFile, write_tydex
from fourpole.io.signals import MAX_FILE_BYTES
from fourpole.io.write import beside
from fourpole.plot.data import distinct
from fourpole.plot.sheet import floats
from fourpole.quantities import DERIVED

#: Head of the column, name and description of each channel; its unit is that of the column.
_CHANNELS = (
    (q.FREQUENCY.head, "FREQUENC", "Excitation frequency"),
    (q.STORAGE.head, "KDYN_RE", "Dynamic stiffness, real part"),
    (q.LOSS.head, "KDYN_IM", "Dynamic stiffness, imag part"),
    (q.STORAGE.u_head, "U_KDYNRE", "Std uncertainty of KDYN_RE"),
    (q.LOSS.u_head, "U_KDYNIM", "Std uncertainty of KDYN_IM"),
    (q.CORR_K.head, "RHO_KDYN", "Correlation KDYN_RE, KDYN_IM"),
    (q.LOSS_FACTOR.head, "LOSSFACT", "Loss factor KDYN_IM/KDYN_RE"),
    (q.LOSS_FACTOR.u_head, "U_LOSSF", "Std uncertainty of LOSSFACT"),
    (q.K1.head, "K1", "Static stiffness at the load"),
    (q.K1.u_head, "U_K1", "Std uncertainty of K1"),
    (q.K2.head, "K2", "Spring in series with C"),
    (q.C.head, "C", "Damper in series with K2"),
    (q.K2.u_head, "U_K2", "Std uncertainty of K2"),
    (q.C.u_head, "U_C", "Std uncertainty of C"),
    (q.CORR_K2_C.head, "RHO_K2C", "Correlation of K2 and C"),
    (q.TR_MEASURED.head, "TR_MEAS", "Transmissibility, measured"),
    (q.TR_PREDICTED.head, "TR_PRED", "Transmissibility, predicted"),
    (q.TR.u_head, "U_TR", "Std uncertainty of TR_PRED"),
    (q.R.head, "MOB_RE", "Mobility V1/F1, real part"),
    (q.I.head, "MOB_IM", "Mobility V1/F1, imag part"),
    (q.R.u_head, "U_MOBRE", "Std uncertainty of MOB_RE"),
    (q.I.u_head, "U_MOBIM", "Std uncertainty of MOB_IM"),
    (q.CORR_R_I.head, "RHO_MOB", "Correlation MOB_RE, MOB_IM"),
    (q.F1.head, "F1AMPL", "Force at contact, 0-peak"),
    (q.V1.head, "V1AMPL", "Velocity at contact, 0-peak"),
    (q.V2.head, "V2AMPL", "Velocity of mass, 0-peak"),
    (q.PHASE_F1.head, "PHASEFV1", "Phase of F1 ahead of V1"),
    (q.PHASE_V2.head, "PHASEV21", "Phase of V2 ahead of V1"),
    (q.TEMPERATURE.head, "TESTTEMP", "Temperature of the test"),
    *((one.head, one.key.upper()[:8], one.meaning[:30]) for one in DERIVED),
)
_UNITS = {"1": "-", "degC": "deg C"}
_SUPPLIER = TydexEntry("SUPPLIER", "fourpole", "", "Data supplier")
_LONGEST = 30
_OURS = re.compile(rb"^SUPPLIER .* fourpole\s*$", re.MULTILINE)


def write(source: ExportTables, path: Path) -> tuple[str, ...]:
    """Write the folder in one step; returns notes on what is left out, which the files have as well."""
    if not source.conditions:
        raise TableError(f"{path.name}: no test is used: there is nothing to export")
    _check_place(path)
    with beside(path, label=str(path)) as new:
        new.mkdir()
        for file, condition in zip(_file_names(source), source.conditions, strict=True):
            write_tydex(new / file, _tydex(source, condition))
    return source.left_out()


def _check_place(path: Path) -> None:
    """FileError unless the folder is new, empty, or of an earlier export, so that no file of the user is replaced."""
    if not path.exists():
        return
    if not path.is_dir() or path.is_symlink():
        raise FileError(f"{path}: is no folder; TYDEX is written as a folder of files: name a new one with --out")
    for file in path.iterdir():
        if file.suffix != ".tdx" or not file.is_file() or not _is_ours(file):
            raise FileError(f"{path}: holds {file.name}, which fourpole did not write: name a new folder with --out")


def _is_ours(file: Path) -> bool:
    """Whether an earlier export wrote the file."""
    with suppress(FourpoleError), open_regular(file, max_bytes=MAX_FILE_BYTES) as stream:
        return _OURS.search(stream.read(1000)) is not None
    return False


def _file_names(source: ExportTables) -> Iterator[str]:
    """A different name for each condition, of characters that every file system accepts."""
    lines = (ascii_line(source.name_of(condition).replace(", ", "_")) for condition in source.conditions)
    names = (re.sub(r"[^A-Za-z0-9._-]+", "", line).strip(".")[:100] or "condition" for line in lines)
    return (f"{name}.tdx" for name in distinct(names, "_", fold=True))


def _value(text: str) -> str:
    return ascii_line(text)[:_LONGEST].strip()


def _tydex(source: ExportTables, condition: SheetRow) -> TydexFile:
    table, rows = source.dynamic, list(condition.rows)
    held = [(floats(table, column)[rows], column, name, words) for column, name, words in _CHANNELS]
    held = [one for one in held if np.isfinite(one[0]).any()]
    channels = [TydexChannel("MEASNUMB", "-", "Number of the test")]
    channels += [TydexChannel(name, _unit(column), words) for _, column, name, words in held]
    numbers = np.arange(1.0, len(rows) + 1.0)
    return TydexFile(
        header=(TydexEntry("RELEASE", "1.3", "", "Release of TYDEX-Format"), _SUPPLIER),
        comments=tuple(line for text in _comments(source, condition) for line in _wrapped(text)),
        constants=tuple(_constants(source, condition)),
        channels=tuple(channels),
        data=np.column_stack([numbers, *(values for values, *_ in held)]),
    )


def _wrapped(text: str) -> list[str]:
    """Lines of 80 columns; a space separates two asterisks in a row, because these begin a section."""
    return [line.replace("**", "* *") for line in textwrap.wrap(ascii_line(text), 80, subsequent_indent="  ")]


def _unit(column: str) -> str:
    unit = unit_of(column)
    return _UNITS.get(unit, unit)


def _constants(source: ExportTables, condition: SheetRow) -> Iterator[TydexEntry]:
    """The constants of a condition: what all its tests have in common."""
    first = source.dynamic.row(condition.rows[0], named=True)
    yield TydexEntry("IDENTITY", _value(str(first["tyre"] or "")), "", "Identity of the tyre")
    for column, name, words in (
        ("construction", "CONSTRUC", "Construction of the tyre"),
        ("rig", "TESTRIG", "Test rig"),
    ):
        if first[column]:
            yield TydexEntry(name, _value(str(first[column])), "", words)
    rows = list(condition.rows)
    pressure, load = source.sheet.pressures.values[condition.pressure], source.sheet.loads.values[condition.load]
    if np.isfinite(pressure):
        yield TydexEntry("INFLPRES", f"{pressure * 1e-5:.12g}", q.PRESSURE.shown, "Inflation pressure")
    if np.isfinite(load):
        yield TydexEntry("FZW", f"{load:.12g}", q.PRELOAD.unit, "Static load on the tyre")
    temperature = floats(source.dynamic, q.TEMPERATURE.head)[rows]
    if np.isfinite(temperature).any():
        mean = float(np.nanmean(temperature))
        yield TydexEntry("MEANTEMP", f"{mean:.6g}", _UNITS[q.TEMPERATURE.unit], "Mean temperature of the tests")
    for column, name, words in (
        (q.ADDED_MASS.head, "ADDMASS", "Mass added to moving mass"),
        (q.K1.head, "K1STAT", "Static stiffness at the load"),
        (q.K1.u_head, "U_K1STAT", "Std uncertainty of K1STAT"),
    ):
        values = floats(source.dynamic, column)[rows]
        if np.all(values == values[0]):  # false for blank cells: not-a-number is not equal to itself
            yield TydexEntry(name, f"{values[0]:.13g}", _unit(column), words)
    yield TydexEntry("ROUTE", _value(source.route), "", "How KDYN was found")


def _comments(source: ExportTables, condition: SheetRow) -> Iterator[str]:
    names, verdicts, remarks = (source.texts(column) for column in ("test", "verdict", "remarks"))
    yield f"{source.title}: {source.name_of(condition)}"
    yield f"Analysed by {source.version}, {source.made:%Y-%m-%d %H:%M} UTC; route {source.route}"
    yield SIGNS
    yield "KDYN is force over deflection; KDYN = K1 + K2 jwC/(K2 + jwC). FREQUENC is the measured frequency."
    yield "MEASNUMB is the only channel with a name of the standard; the descriptions explain the names of the others."
    for number, row in enumerate(condition.rows, start=1):
        said = f": {remarks[row]}" if remarks[row] else ""
        yield f"MEASNUMB {number} is test {names[row]}, verdict {verdicts[row]}{said}"
    for row in np.flatnonzero(source.sheet.rejected).tolist():
        if source.place(row) == condition[:4]:
            yield f"Left out is test {names[row]}, rejected: {remarks[row]}"
