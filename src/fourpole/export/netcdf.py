"""NetCDF: the results as a grid of tyre, pressure, preload and frequency, with attributes by the CF conventions.

Several tests in one cell differ in two further dimensions: `setting`, which is a rig with an added mass, and `repeat`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray

from fourpole import quantities as q
from fourpole.core.checks import Verdict
from fourpole.core.condition import PRELOAD, PRESSURE, Axis
from fourpole.errors import TableError
from fourpole.export.source import SIGNS, ExportTables, field_names, need, some, typed, unit_of
from fourpole.io.write import beside
from fourpole.plot.data import counted
from fourpole.plot.sheet import Groups, floats
from fourpole.quantities import QUANTITIES, meaning_of

_DIMENSIONS = ("tyre", "pressure", "preload", "frequency", "setting", "repeat")
#: Largest number of cells of a grid; a larger grid is so sparse that a list of tests is better.
_MOST_CELLS = 2_000_000
_VERDICTS = (Verdict.OK, Verdict.WARNING)
_PLACED = {"tyre", q.PRESSURE.head, q.PRELOAD.head, "construction", "verdict"}
#: Names of variables that do not come from columns.
_TAKEN = {*_DIMENSIONS, "verdict", "study_json", "construction", "static_test", "frequency_found"}

Variable = tuple[Sequence[str], NDArray[Any], dict[str, Any]]


@dataclass(frozen=True, eq=False)
class _Grid:
    """Arrays over dimensions: names and shape of these, and the cell of each row of a table that is used."""

    dimensions: tuple[str, ...]
    shape: tuple[int, ...]
    index: tuple[NDArray[np.int64], ...]
    rows: NDArray[np.int64]

    def placed(self, values: NDArray[Any], empty: Any) -> NDArray[Any]:
        """A column on the grid, with `empty` in empty cells."""
        whole = np.full(self.shape, empty, dtype=values.dtype)
        whole[self.index] = values[self.rows]
        return whole


def write(source: ExportTables, path: Path) -> tuple[str, ...]:
    """Write the grid; returns notes on what is left out."""
    xarray = need("xarray", "maps")
    need("h5netcdf", "maps")
    grid = _dynamic_grid(source, path.name)
    static, said = _static_grid(source)
    variables = {**_dynamic(source, grid), **_static(source, static)}
    variables["study_json"] = ((), np.array(source.json, dtype=object), {"long_name": "settings and statements, JSON"})
    dataset = xarray.Dataset(variables, coords=_coordinates(source), attrs=_attributes(source))
    packed = {name: {"zlib": True} for name, (_, data, _) in variables.items() if data.dtype.kind in "fi"}
    with beside(path) as new:
        dataset.to_netcdf(new, engine="h5netcdf", encoding=packed)
    return (*source.left_out(), *said)


def _dynamic_grid(source: ExportTables, name: str) -> _Grid:
    """The grid of the dynamic tests; TableError if no test is used, or the grid is too sparse."""
    sheet, repeats = source.sheet, np.array(source.repeats, dtype=np.int64)
    rows = np.flatnonzero(repeats >= 0)
    if not rows.size:
        raise TableError(f"{name}: no test is used: there is no grid to export")
    sizes = (len(sheet.names), len(sheet.pressures), len(sheet.loads), len(sheet.frequencies))
    shape = (*sizes, max(len(sheet.settings), 1), int(repeats.max()) + 1)
    if math.prod(shape) > _MOST_CELLS:
        raise TableError(
            f"{name}: a grid of {' x '.join(map(str, shape))} ({', '.join(_DIMENSIONS)}) for {rows.size} tests is too "
            f"sparse; export as mat or xlsx, which hold a row per test"
        )
    places = (sheet.tyre, sheet.pressure, sheet.load, sheet.frequency, sheet.setting, repeats)
    return _Grid(_DIMENSIONS, shape, tuple(place[rows] for place in places), rows)


def _static_grid(source: ExportTables) -> tuple[_Grid, tuple[str, ...]]:
    """The grid of the static tests, and a note on those left out; repeats extend along `static_test`."""
    sheet, static = source.sheet, source.sheet.static
    names, verdicts = static["test"].to_list(), static["verdict"].to_list()
    pressure, load = floats(static, q.PRESSURE.head), floats(static, q.PRELOAD.head)
    found: list[tuple[int, ...]] = []
    rows: list[int] = []
    out: list[str] = []
    for row, tyre in enumerate(static["tyre"].to_list()):
        at = (_place(sheet.pressures, PRESSURE, pressure[row]), _place(sheet.loads, PRELOAD, load[row]))
        if verdicts[row] == Verdict.REJECTED or min(at) < 0:
            out.append(str(names[row]))
            continue
        cell = (sheet.names.index(tyre or ""), *at)
        found.append((*cell, sum(one[:3] == cell for one in found)))
        rows.append(row)
    index = np.array(found, dtype=np.int64).reshape(-1, 4)
    deep = int(index[:, 3].max()) + 1 if rows else 0
    shape = (len(sheet.names), len(sheet.pressures), len(sheet.loads), deep)
    left = f"{counted(len(out), 'row')} of static tests, rejected or without a preload, left out: {some(out)}"
    said = (left,) if out else ()
    return _Grid((*_DIMENSIONS[:3], "static_test"), shape, tuple(index.T), np.array(rows, dtype=np.int64)), said


def _place(groups: Groups, axis: Axis, value: float) -> int:
    """The group of a value, -1 if it has none; a blank belongs to the group of tests that state no value."""
    if math.isnan(value):
        return next((at for at, own in enumerate(groups.values) if math.isnan(own)), -1)
    at = groups.nearest(value) if groups.stated() else -1
    return at if at >= 0 and axis.same(groups.values[at], value) else -1


def _dynamic(source: ExportTables, grid: _Grid) -> dict[str, Variable]:
    """A variable per column of dynamic.csv."""
    table = typed(source.dynamic)
    columns = [name for name in table.columns if name not in _PLACED]
    # the frequency found in a recording is not the nominal frequency of the grid
    fields = {**field_names(columns, taken=_TAKEN), q.FREQUENCY.head: "frequency_found"}
    held = _ancillary(columns, fields)
    variables = {field: _variable(table, column, grid, held.get(column, "")) for column, field in fields.items()}
    values = np.arange(len(_VERDICTS), dtype=np.int8)
    attributes = {"flag_values": values, "flag_meanings": " ".join(_VERDICTS), "_FillValue": np.int8(-1)}
    flags = [_VERDICTS.index(verdict) if verdict in _VERDICTS else -1 for verdict in source.texts("verdict")]
    placed = grid.placed(np.array(flags, dtype=np.int8), -1)
    variables["verdict"] = (grid.dimensions, placed, {"long_name": "verdict on the test", **attributes})
    return variables


def _ancillary(columns: Sequence[str], fields: Mapping[str, str]) -> dict[str, str]:
    """Names of the variables with uncertainties, correlations and the verdict of a column, by the CF conventions."""
    held: dict[str, list[str]] = {}
    for one in QUANTITIES:
        held.setdefault(one.head, []).extend(fields[head] for head in (one.u_head,) if head in fields)
        for other in one.pair if one.head in fields else ():
            held.setdefault(other.head, []).append(fields[one.head])
    return {column: " ".join([*held[column], "verdict"]) for column in columns if held.get(column)}


def _variable(table: pl.DataFrame, column: str, grid: _Grid, ancillary: str = "") -> Variable:
    """A column on the grid, with its unit and its meaning."""
    attributes: dict[str, Any] = {"long_name": meaning_of(column)}
    if table.schema[column] == pl.String:
        texts = np.array([text or "" for text in table[column].to_list()], dtype=object)
        return grid.dimensions, grid.placed(texts, ""), attributes
    attributes["units"] = unit_of(column) or "1"
    if ancillary:
        attributes["ancillary_variables"] = ancillary
    return grid.dimensions, grid.placed(floats(table, column), np.nan), attributes


def _static(source: ExportTables, grid: _Grid) -> dict[str, Variable]:
    """A variable per column of static.csv; each name begins with `static_`."""
    if not grid.rows.size:
        return {}
    table = source.results.static
    columns = [name for name in table.columns if name not in _PLACED]
    fields = {column: f"static_{field}" for column, field in field_names(columns).items()}
    fields["test"] = "static_test_name"
    held = {column: f"static_{field}" for column, field in ((q.K1.head, "u_K1"),)}
    return {field: _variable(table, column, grid, held.get(column, "")) for column, field in fields.items()}


def _coordinates(source: ExportTables) -> dict[str, Variable]:
    """Values of the dimensions; CF allows no gap in a coordinate, so an axis with a blank value has another name."""
    sheet = source.sheet
    coordinates: dict[str, Variable] = {"tyre": _words("tyre", sheet.names, "name of the tyre")}
    constructions = _constructions(source)
    if any(constructions):
        coordinates["construction"] = _words("tyre", constructions, "construction of the tyre")
    for one, groups, words in (
        (q.PRESSURE, sheet.pressures, q.PRESSURE.meaning),
        (q.PRELOAD, sheet.loads, q.PRELOAD.meaning),
        (q.FREQUENCY, sheet.frequencies, "nominal frequency, the median of the tests"),
    ):
        held = one.key if groups.stated() == len(groups) else f"{one.key}_stated"
        coordinates[held] = ((one.key,), np.array(groups.values, dtype=float), {"units": one.unit, "long_name": words})
    labels = sheet.settings or ("all",)
    coordinates["setting"] = _words("setting", labels, "rig and added mass")
    repeats = np.arange(max(source.repeats) + 1, dtype=np.int32)
    coordinates["repeat"] = (("repeat",), repeats, {"units": "1", "long_name": "further tests of the same cell"})
    return coordinates


def _words(dimension: str, texts: Sequence[str], long_name: str) -> Variable:
    return (dimension,), np.array([*texts], dtype=object), {"long_name": long_name}


def _constructions(source: ExportTables) -> list[str]:
    """Construction of each tyre; empty if it is not stated."""
    found: dict[str, str] = {}
    for table in (source.sheet.table, source.sheet.static):
        found |= {tyre or "": text or "" for tyre, text in table.select("tyre", "construction").iter_rows()}
    return [found.get(name, "") for name in source.sheet.names]


def _attributes(source: ExportTables) -> dict[str, Any]:
    """Attributes of the file."""
    versions = ", ".join(f"{name} {version}" for name, version in source.section("versions").items())
    return {
        "title": source.title,
        "Conventions": "CF-1.11",
        "source": f"{source.version}, route {source.route}",
        "history": f"{source.made:%Y-%m-%dT%H:%M:%SZ}: analysed with {versions}",
        "comment": SIGNS,
    }
