"""UFF 58: the mobility V1/F1 and the dynamic stiffness K* of each condition as functions of frequency.

The four poles of specimens are dynamic stiffnesses between two nodes, for substructuring.
"""

from __future__ import annotations

import contextlib
import io
from collections.abc import Iterator, Sequence
from datetime import UTC, datetime
from itertools import chain
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from fourpole import quantities as q
from fourpole.core.allpoles import POLES
from fourpole.core.arrays import ComplexArray, FloatArray
from fourpole.errors import TableError
from fourpole.export.source import ExportTables, SheetRow, ascii_line, need, some
from fourpole.io.write import beside
from fourpole.plot.data import counted
from fourpole.plot.sheet import floats
from fourpole.quantities import Quantity
from fourpole.study.twoports import TwoPort
from fourpole.version import VERSION

_LINE = 80
_RESPONSE_FUNCTION = 4
_UP = 3  # +Z translation
DISPLACEMENT, FORCE = 8, 13
_FREQUENCY, _VELOCITY = 18, 11
_CONTACT = 1


class _Kind(NamedTuple):
    """A response function: name, real and imaginary part; data type, label and unit of numerator and denominator."""

    name: str
    parts: tuple[Quantity, ...]
    above: tuple[int, str, str]
    below: tuple[int, str, str]

    def values(self, source: ExportTables) -> ComplexArray:
        """The complex values of all tests."""
        real, imag = (floats(source.dynamic, one.head) for one in self.parts)
        return real + 1j * imag


_KINDS = (
    _Kind("Mobility V1/F1 at the contact", q.CORR_R_I.pair, (_VELOCITY, "V1", q.V1.unit), (FORCE, "F1", q.F1.unit)),
    _Kind(
        "Dynamic stiffness K*, force over deflection",
        q.CORR_K.pair,
        (FORCE, "Force on the tyre", "N"),
        (DISPLACEMENT, "Deflection", "m"),
    ),
)


def write(source: ExportTables, path: Path) -> tuple[str, ...]:
    """Write the functions; returns notes on what is left out."""
    functions = [one for kind in _KINDS for one in _functions(source, kind)]
    if not functions:
        raise TableError(f"{path.name}: no test has V1/F1 or K*: there is no function of frequency to export")
    write_functions(path, functions, source.title, source.version, source.made)
    return (*source.left_out(), *_without(source))


def write_functions(path: Path, functions: list[dict[str, Any]], title: str, version: str, made: datetime) -> None:
    """Write numbered response functions, with the header of the file and its units; FileError without the library."""
    pyuff = need("pyuff", "formats")
    for number, one in enumerate(functions, start=1):
        one["func_id"] = number
    with beside(path) as new, contextlib.redirect_stdout(io.StringIO()):  # the library prints to the terminal
        pyuff.UFF(str(new)).write_sets([*_heads(path.name, title, version, made), *functions], mode="overwrite")


def _without(source: ExportTables) -> Iterator[str]:
    """Notes on the tests that lack a value."""
    names = source.texts("test")
    for kind in _KINDS:
        rows = [row for one in source.conditions for row in one.rows]
        absent = sorted(set(rows) - set(_known(source, rows, kind)))
        if absent:
            has = "has" if len(absent) == 1 else "have"
            listed = some([names[row] for row in absent])
            yield f"{counted(len(absent), 'test')} {has} no {kind.name.partition(',')[0]}: {listed}"


def _known(source: ExportTables, rows: Sequence[int], kind: _Kind) -> list[int]:
    """Rows with a finite value of this kind; the format has no missing values."""
    values = kind.values(source)
    return [row for row in rows if np.isfinite(values[row])]


def _heads(name: str, title: str, version: str, made: datetime) -> list[dict[str, Any]]:
    """Data sets with the header of the file and its units, SI."""
    date, clock = _date(made)
    dates = {f"{what}_{when}": date if what == "date" else clock for what in ("date", "time") for when in _WHEN}
    program = _ascii(version)
    header = {"type": 151, "model_name": _ascii(name), "description": _ascii(title), "db_app": program}
    factors = {"length": 1.0, "force": 1.0, "temp": 1.0, "temp_offset": 273.15}
    units = {"type": 164, "units_code": 1, "units_description": "SI: Meter (newton)", "temp_mode": 2}
    return [{**header, "program": program, **dates}, {**units, **factors}]


_WHEN = ("db_created", "db_saved", "file_written")
_MONTHS = ("Jan", "Feb", "Mar", "Apr", "May", "Jun", "Jul", "Aug", "Sep", "Oct", "Nov", "Dec")


def _date(made: datetime) -> tuple[str, str]:
    """Date as DD-MMM-YY in English, and time, of the analysis."""
    return f"{made.day:02d}-{_MONTHS[made.month - 1]}-{made.year % 100:02d}", f"{made:%H:%M:%S}"


def _ascii(text: str) -> str:
    """A line of at most 80 ASCII characters; NONE, as the format has it, for an empty text."""
    return ascii_line(text)[:_LINE] or "NONE"


def _functions(source: ExportTables, kind: _Kind) -> Iterator[dict[str, Any]]:
    """A data set per condition that has values."""
    table = source.dynamic
    frequency = floats(table, q.FREQUENCY.head)
    values = kind.values(source)
    for condition in source.conditions:
        rows = _known(source, condition.rows, kind)
        if rows:
            yield _function(source, kind, condition, rows, frequency[rows], values[rows])


def _function(
    source: ExportTables, kind: _Kind, condition: SheetRow, rows: Sequence[int], frequency: FloatArray, values: Any
) -> dict[str, Any]:
    return {
        "ver_num": condition.repeat,
        "id2": _ascii(source.name_of(condition)),
        "id3": " ".join(_date(source.made)),
        "id4": _ascii(f"{source.version}, route {source.route}; {source.title}"),
        "id5": _ascii(_uncertainty(source, kind, rows)),
        **response(kind.name, (_CONTACT, _CONTACT), frequency, values, kind.above, kind.below),
    }


def response(
    name: str,
    nodes: tuple[int, int],
    frequency: FloatArray,
    values: ComplexArray,
    above: tuple[int, str, str],
    below: tuple[int, str, str],
) -> dict[str, Any]:
    """A response function between two nodes, response first, each in +Z; `above` and `below` are as in `_Kind`."""
    single = frequency.size == 1  # a single value is written as evenly spaced, for which the library needs a step
    return {
        "type": 58,
        "func_type": _RESPONSE_FUNCTION,
        "id1": _ascii(name),
        "rsp_node": nodes[0],
        "rsp_dir": _UP,
        "ref_node": nodes[1],
        "ref_dir": _UP,
        "x": np.array([frequency[0], frequency[0] + 1.0]) if single else frequency,
        "data": values,
        "abscissa_spacing": int(single),
        "abscissa_spec_data_type": _FREQUENCY,
        "abscissa_axis_lab": "Frequency",
        "abscissa_axis_units_lab": "Hz",
        **_axis("ordinate", *above),
        **_axis("orddenom", *below),
    }


def _axis(which: str, data_type: int, label: str, unit: str) -> dict[str, Any]:
    return {f"{which}_spec_data_type": data_type, f"{which}_axis_lab": label, f"{which}_axis_units_lab": unit}


def _uncertainty(source: ExportTables, kind: _Kind, rows: Sequence[int]) -> str:
    """A line of text with the largest standard uncertainties, for which the format has no field."""
    largest = []
    for one in kind.parts:
        values = floats(source.dynamic, one.u_head)[rows]
        largest.append(f"{np.nanmax(values):.3g}" if np.isfinite(values).any() else "unknown")
    return f"e^(+jwt); standard uncertainty up to {largest[0]} (Re), {largest[1]} (Im) {kind.parts[0].unit}"


def write_two_ports(found: Sequence[TwoPort], title: str, path: Path) -> None:
    """Write k11, k12, k21 and k22 of each specimen and condition; node 1 is the contact, node 2 the wheel.

    Each is the force on the specimen at its response node over the displacement of its reference node, both in +Z, in
    N/m, while the other node is held.

    Raises
    ------
    FileError
        If pyuff is not installed, or the file cannot be written.
    """
    made = datetime.now(UTC).replace(microsecond=0)
    write_functions(path, list(chain.from_iterable(map(_four_functions, found))), title, f"fourpole {VERSION}", made)


def _four_functions(two_port: TwoPort) -> list[dict[str, Any]]:
    poles, functions = two_port.poles, []
    reciprocal = "k12 = k21" if two_port.form is not None else "k12 and k21 differ: not reciprocal"
    for at, pole in enumerate(POLES):
        row, column = divmod(at, 2)
        std = poles.std[:, at].max(axis=0)
        functions.append(
            {
                "id2": ascii_line(two_port.name)[:80],
                "id3": reciprocal,
                "id5": f"e^(+jwt); standard uncertainty up to {std[0]:.3g} (Re), {std[1]:.3g} (Im) N/m",
                **response(
                    f"Dynamic stiffness {pole}, force on the specimen over displacement",
                    (row + 1, column + 1),
                    poles.frequency,
                    poles.stiffness[:, row, column],
                    (FORCE, f"Force on node {row + 1}", "N"),
                    (DISPLACEMENT, f"Motion of node {column + 1}", "m"),
                ),
            }
        )
    return functions
