"""UFF 58: of each condition the mobility V1/F1 and the dynamic stiffness K* as functions of frequency."""

from __future__ import annotations

import contextlib
import io
import unicodedata
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from fourpole import quantities as q
from fourpole.core.arrays import ComplexArray, FloatArray
from fourpole.errors import TableError
from fourpole.export.source import Condition, ExportTables, counted, need, some
from fourpole.io.write import beside
from fourpole.plot.sheet import floats
from fourpole.quantities import Quantity

__all__ = ["write"]

_LINE = 80
_RESPONSE_FUNCTION = 4
_UP = 3  # +Z translation
_FREQUENCY, _DISPLACEMENT, _VELOCITY, _FORCE = 18, 8, 11, 13
_CONTACT = 1


class _Kind(NamedTuple):
    """A function: its name, its parts, and what stands above and below in data type, label and unit."""

    name: str
    parts: tuple[Quantity, ...]
    above: tuple[int, str, str]
    below: tuple[int, str, str]

    def values(self, source: ExportTables) -> ComplexArray:
        """The complex values of all tests."""
        real, imag = (floats(source.dynamic, one.head) for one in self.parts)
        return real + 1j * imag


_KINDS = (
    _Kind(
        "Mobility V1/F1 at the contact",
        q.CORR_R_I.pair,
        (_VELOCITY, "V1", "m/s"),
        (_FORCE, "F1", "N"),
    ),
    _Kind(
        "Dynamic stiffness K*, force over deflection",
        q.CORR_K.pair,
        (_FORCE, "Force on the tyre", "N"),
        (_DISPLACEMENT, "Deflection", "m"),
    ),
)


def write(source: ExportTables, path: Path) -> tuple[str, ...]:
    """Write the functions; what is left out is said."""
    pyuff = need("pyuff", "formats")
    functions = [one for kind in _KINDS for one in _functions(source, kind)]
    if not functions:
        raise TableError(f"{path.name}: no test has V1/F1 or K*: there is no function of frequency to export")
    for number, one in enumerate(functions, start=1):
        one["func_id"] = number

    with beside(path) as new, contextlib.redirect_stdout(io.StringIO()):  # the library prints
        pyuff.UFF(str(new)).write_sets([*_heads(source, path.name), *functions], mode="overwrite")
    return (*source.left_out(), *_without(source))


def _without(source: ExportTables) -> Iterator[str]:
    names = source.texts("test")
    for kind in _KINDS:
        rows = [row for one in source.conditions for row in one.rows]
        absent = sorted(set(rows) - set(_known(source, rows, kind)))
        if absent:
            has = "has" if len(absent) == 1 else "have"
            listed = some([names[row] for row in absent])
            yield f"{counted(len(absent), 'test')} {has} no {kind.name.partition(',')[0]}: {listed}"


def _known(source: ExportTables, rows: Sequence[int], kind: _Kind) -> list[int]:
    """Those rows that have the value: the format knows no missing ones."""
    values = kind.values(source)
    return [row for row in rows if np.isfinite(values[row])]


def _heads(source: ExportTables, name: str) -> list[dict[str, Any]]:
    """The file's header and its units, SI."""
    date, clock = _date(source)
    dates = {f"{what}_{when}": date if what == "date" else clock for what in ("date", "time") for when in _WHEN}
    program = _ascii(source.version)
    header = {"type": 151, "model_name": _ascii(name), "description": _ascii(source.title), "db_app": program}
    factors = {"length": 1.0, "force": 1.0, "temp": 1.0, "temp_offset": 273.15}
    units = {"type": 164, "units_code": 1, "units_description": "SI: Meter (newton)", "temp_mode": 2}
    return [{**header, "program": program, **dates}, {**units, **factors}]


_WHEN = ("db_created", "db_saved", "file_written")
_MONTHS = ("Jan", "Feb", "Mar", "Apr", "May", "Jun", "Jul", "Aug", "Sep", "Oct", "Nov", "Dec")


def _date(source: ExportTables) -> tuple[str, str]:
    """DD-MMM-YY, whatever the language of the machine, and the time."""
    made = source.made
    return f"{made.day:02d}-{_MONTHS[made.month - 1]}-{made.year % 100:02d}", f"{made:%H:%M:%S}"


def _ascii(text: str) -> str:
    """A line of up to 80 plain characters."""
    plain = unicodedata.normalize("NFKD", " ".join(text.split()))
    plain = "".join(sign for sign in plain if not unicodedata.combining(sign))
    return plain.encode("ascii", "replace").decode()[:_LINE] or "NONE"


def _functions(source: ExportTables, kind: _Kind) -> Iterator[dict[str, Any]]:
    table = source.dynamic
    frequency = floats(table, q.FREQUENCY.head)
    values = kind.values(source)
    for condition in source.conditions:
        rows = _known(source, condition.rows, kind)
        if rows:
            yield _function(source, kind, condition, rows, frequency[rows], values[rows])


def _function(
    source: ExportTables, kind: _Kind, condition: Condition, rows: Sequence[int], frequency: FloatArray, values: Any
) -> dict[str, Any]:
    single = len(rows) == 1  # the library asks for a step: one value is written as evenly spaced
    return {
        "type": 58,
        "func_type": _RESPONSE_FUNCTION,
        "ver_num": condition.repeat,
        "id1": _ascii(kind.name),
        "id2": _ascii(source.name_of(condition)),
        "id3": " ".join(_date(source)),
        "id4": _ascii(f"{source.version}, route {source.route}; {source.title}"),
        "id5": _ascii(_uncertainty(source, kind, rows)),
        "rsp_node": _CONTACT,
        "rsp_dir": _UP,
        "ref_node": _CONTACT,
        "ref_dir": _UP,
        "x": np.array([frequency[0], frequency[0] + 1.0]) if single else frequency,
        "data": values,
        "abscissa_spacing": int(single),
        "abscissa_spec_data_type": _FREQUENCY,
        "abscissa_axis_lab": "Frequency",
        "abscissa_axis_units_lab": "Hz",
        **_axis("ordinate", *kind.above),
        **_axis("orddenom", *kind.below),
    }


def _axis(which: str, data_type: int, label: str, unit: str) -> dict[str, Any]:
    return {f"{which}_spec_data_type": data_type, f"{which}_axis_lab": label, f"{which}_axis_units_lab": unit}


def _uncertainty(source: ExportTables, kind: _Kind, rows: Sequence[int]) -> str:
    """The format has no place for uncertainties: their largest in a line of text."""
    largest = []
    for one in kind.parts:
        values = floats(source.dynamic, one.u_head)[rows]
        largest.append(f"{np.nanmax(values):.3g}" if np.isfinite(values).any() else "unknown")
    return f"e^(+jwt); standard uncertainty up to {largest[0]} (Re), {largest[1]} (Im) {kind.parts[0].unit}"
