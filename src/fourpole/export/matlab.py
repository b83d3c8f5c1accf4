"""MATLAB file: a struct of columns for each table; K* and phasors are complex, with their covariances."""

from __future__ import annotations

import io
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray

from fourpole import quantities as q
from fourpole.core.arrays import FloatArray
from fourpole.export.source import SIGNS, ExportTables, field_names, unit_of
from fourpole.io.write import write_bytes
from fourpole.plot.sheet import floats
from fourpole.quantities import Quantity

#: Length of the text at the beginning of the file [byte].
_HEAD = 116
#: Fields of complex values of the dynamic tests, with the correlation of real and imaginary part.
_COMPLEX = {"K": q.CORR_K, "mobility": q.CORR_R_I}
_OWN = ("units", "names", "K", "K_covariance", "mobility", "mobility_covariance", "K2_C_covariance")
_COVARIANCE = q.PHASOR_COVARIANCE.head


def write(source: ExportTables, path: Path) -> tuple[str, ...]:
    """Write the MAT-file of level 5; returns no notes, as nothing is left out."""
    from scipy.io import savemat

    content: dict[str, Any] = {"study": _study(source)}
    for name, table in source.tables.items():
        content[name] = _struct(table)
    content["dynamic"] |= _complex_fields(source.dynamic)
    if _COVARIANCE in source.phasors.columns:
        content["phasors"] = _phasors(source.phasors)
    content = {name: _described(value) for name, value in content.items()}
    buffer = io.BytesIO()
    savemat(buffer, content, long_field_names=True, do_compression=True, oned_as="column")
    # The head of the library has the time of day; with another one, the same results give the same bytes.
    head = f"MATLAB 5.0 MAT-file, results of {source.version}, {source.made:%Y-%m-%d %H:%M:%S} UTC"
    write_bytes(path, head.encode("ascii", "replace")[:_HEAD].ljust(_HEAD) + buffer.getvalue()[_HEAD:])
    return ()


def _described(struct: dict[str, Any]) -> dict[str, Any]:
    """The struct with its fields `units` and `names`, which describe the others, at the end."""
    return {name: struct[name] for name in sorted(struct, key=lambda name: name in ("units", "names"))}


def _struct(table: pl.DataFrame) -> dict[str, Any]:
    """A table: a field per column, and structs `units` and `names` with the unit and the head of each column."""
    fields = field_names(table.columns, taken=_OWN)
    struct: dict[str, Any] = {field: _column(table, name) for name, field in fields.items()}
    struct["units"] = {field: unit_of(name) for name, field in fields.items()}
    struct["names"] = {field: name for name, field in fields.items()}
    return struct


def _column(table: pl.DataFrame, name: str) -> NDArray[Any]:
    """A column as a cell array of texts or as numbers (n, 1)."""
    if table.schema[name] == pl.String:
        return _cell(table[name].to_list())
    return floats(table, name).reshape(-1, 1)


def _cell(texts: list[Any]) -> NDArray[np.object_]:
    """A column of a cell array."""
    cell = np.empty((len(texts), 1), dtype=object)
    cell[:, 0] = [str(text or "") for text in texts]
    return cell


def _covariance(table: pl.DataFrame, correlation: Quantity) -> FloatArray:
    """Covariance (2, 2, n) of the two quantities of a correlation."""
    first, second = (floats(table, one.u_head) for one in correlation.pair)
    cross = floats(table, correlation.head) * first * second
    return np.array([[first**2, cross], [cross, second**2]])


def _complex(real: FloatArray, imag: FloatArray) -> NDArray[np.complex128]:
    """A complex column (n, 1); a part that is not-a-number leaves the other part as it is."""
    whole = np.empty((real.size, 1), dtype=np.complex128)
    whole.real[:, 0], whole.imag[:, 0] = real, imag
    return whole


def _complex_fields(table: pl.DataFrame) -> dict[str, Any]:
    """K* and V1/F1 as complex numbers, with the covariances of their parts and that of K2 and C."""
    base = _struct(table)
    fields: dict[str, Any] = {}
    units, names = base["units"], base["names"]
    for field, correlation in _COMPLEX.items():
        parts, unit = [one.head for one in correlation.pair], correlation.pair[0].unit
        fields[field] = _complex(*(floats(table, part) for part in parts))
        fields[f"{field}_covariance"] = _covariance(table, correlation)
        units |= {field: unit, f"{field}_covariance": f"({unit})^2"}
        names |= {field: f"{parts[0]} + j {parts[1]}", f"{field}_covariance": "of (Re, Im), 2 x 2 x test"}
    fields["K2_C_covariance"] = _covariance(table, q.CORR_K2_C)
    units["K2_C_covariance"] = "(N/m)^2, (N/m)(N s/m), (N s/m)^2"
    names["K2_C_covariance"] = "of (K2, C), 2 x 2 x test"
    return {**fields, "units": units, "names": names}


def _phasors(table: pl.DataFrame) -> dict[str, Any]:
    """Complex amplitudes with the covariance of all six parts, (6, 6, n)."""
    plain = table.select(name for name in table.columns if name != _COVARIANCE and name[:3] not in ("Re ", "Im "))
    struct = _struct(plain)
    for one in (q.F1, q.V1, q.V2):
        name, (real, imag) = one.name, one.parts
        struct[name] = _complex(floats(table, real), floats(table, imag))
        struct["units"][name], struct["names"][name] = one.unit, f"{real} + j {imag}"
    listed = table[_COVARIANCE].to_numpy().astype(float).reshape(-1, 6, 6)
    struct["covariance"] = np.moveaxis(listed, 0, -1)
    struct["units"]["covariance"] = "of the products of N, N, m/s, m/s, m/s, m/s"
    struct["names"]["covariance"] = "of (Re F1, Im F1, Re V1, Im V1, Re V2, Im V2), 6 x 6 x test"
    return struct


def _study(source: ExportTables) -> dict[str, Any]:
    """Title, settings and versions of the analysis; `json` is the content of study.json."""
    return {
        "title": source.title,
        "analysed": f"{source.made:%Y-%m-%d %H:%M:%S} UTC",
        "signs": SIGNS,
        "settings": _plain(source.section("settings")),
        "versions": _plain(source.section("versions")),
        "verdicts": _plain(source.section("verdicts")),
        "assumptions": _cell(list(source.listed("assumptions"))),
        "json": source.json,
    }


def _plain(section: Mapping[str, Any]) -> dict[str, Any]:
    """The texts and numbers of a table of study.json."""
    held = {key: value for key, value in section.items() if isinstance(value, str | int | float)}
    fields = field_names(held)
    return {fields[key]: float(value) if isinstance(value, int | float) else value for key, value in held.items()}
