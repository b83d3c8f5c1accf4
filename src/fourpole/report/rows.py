"""The tables of results as the page shows them: columns in the units people use, rows with their cells."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import polars as pl

from fourpole.report.digits import known, number, with_std

__all__ = ["DYNAMIC", "STATIC", "VERDICTS", "Cell", "Column", "Row", "condition", "result_rows", "worst"]

VERDICTS = ("ok", "warning", "rejected")


@dataclass(frozen=True)
class Column:
    """One head: symbol, unit shown, where it is in the table, SI value per unit shown."""

    head: str
    unit: str
    source: str
    std: str = ""
    scale: float = 1.0
    digits: int = 4
    meaning: str = ""
    always: bool = True

    @property
    def si_unit(self) -> str:
        """Unit of the table itself."""
        unit = self.source.rpartition("[")[2].removesuffix("]")
        return "" if unit == "1" else unit

    def texts(self, row: Mapping[str, Any]) -> tuple[str, str]:
        """Value and uncertainty as shown."""
        value, std = known(row.get(self.source)), known(row.get(self.std))
        return with_std(
            None if value is None else value / self.scale, None if std is None else std / self.scale, self.digits
        )

    def words(self, row: Mapping[str, Any]) -> str:
        """Value, uncertainty and unit in one; blank where there is no value."""
        value, std = self.texts(row)
        text = " ".join(part for part in (value, std and f"± {std}", self.unit) if part) if value else ""
        return text.replace(" °", "°") if self.unit == "°" else text


_PRESSURE = Column("p", "bar", "pressure [Pa]", scale=1e5, digits=3, meaning="inflation pressure")
_PRELOAD = Column("preload", "N", "preload [N]", meaning="static load")
_K1 = Column("K1", "kN/m", "K1 [N/m]", "u(K1) [N/m]", 1e3, meaning="tangent stiffness at the preload")

STATIC = (
    _PRESSURE,
    _PRELOAD,
    _K1,
    Column("secant", "kN/m", "secant [N/m]", scale=1e3, meaning="load over deflection, from the point of zero load"),
    Column("loss", "J", "hysteresis loss [J]", meaning="energy lost in the last complete cycle"),
    Column("nonlinearity", "%", "nonlinearity [1]", scale=0.01, digits=3, meaning="departure from a straight line"),
)

DYNAMIC = (
    _PRESSURE,
    _PRELOAD,
    Column("added mass", "kg", "added mass [kg]", meaning="fixed to the moving mass", always=False),
    Column("T", "°C", "temperature [degC]", meaning="temperature", always=False),
    Column("f", "Hz", "frequency [Hz]", meaning="frequency, as found"),
    _K1,
    Column("K′", "kN/m", "Re K* [N/m]", "u(Re K*) [N/m]", 1e3, meaning="storage stiffness, Re K*"),
    Column("K″", "kN/m", "Im K* [N/m]", "u(Im K*) [N/m]", 1e3, meaning="loss stiffness, Im K*"),
    Column("η", "", "loss factor [1]", "u(loss factor) [1]", meaning="loss factor, K″/K′"),
    Column("K2", "kN/m", "K2 [N/m]", "u(K2) [N/m]", 1e3, meaning="spring in series with the damper"),
    Column("C", "N s/m", "C [N s/m]", "u(C) [N s/m]", meaning="damper"),
    Column("TR", "", "TR measured [1]", meaning="transmissibility V2/V1, measured"),
    Column("TR predicted", "", "TR predicted [1]", "u(TR) [1]", meaning="transmissibility V2/V1 from K* and the rig"),
    Column("R", "mm/(N s)", "R [m/(N s)]", "u(R) [m/(N s)]", 1e-3, meaning="real part of the mobility V1/F1"),
    Column("I", "mm/(N s)", "I [m/(N s)]", "u(I) [m/(N s)]", 1e-3, meaning="imaginary part of the mobility V1/F1"),
)


@dataclass(frozen=True)
class Cell:
    """One number: what it sorts by (SI, in text), what is shown."""

    key: str
    text: str
    std: str


@dataclass(frozen=True)
class Row:
    """One row of a table of results."""

    card: str
    test: str
    tyre: str
    construction: str
    rig: str
    cells: tuple[Cell, ...]
    verdict: str
    remarks: str


@dataclass(frozen=True)
class ResultTable:
    """Columns in use and their rows."""

    columns: tuple[Column, ...]
    rows: list[Row] = field(default_factory=list)
    rigs: bool = False
    remarks: bool = False


def result_rows(frame: pl.DataFrame, columns: tuple[Column, ...], cards: list[str]) -> ResultTable:
    """All rows of static.csv or dynamic.csv; `cards` has the card of each."""
    used = tuple(column for column in columns if column.always or _says_something(frame, column.source))
    rows = [_row(row, used, card) for row, card in zip(frame.rows(named=True), cards, strict=True)]
    return ResultTable(used, rows, any(row.rig for row in rows), any(row.remarks for row in rows))


def _says_something(frame: pl.DataFrame, name: str) -> bool:
    return name in frame.columns and any(known(value) for value in frame[name].to_list())


def _row(row: Mapping[str, Any], columns: tuple[Column, ...], card: str) -> Row:
    return Row(
        card=card,
        test=str(row["test"]),
        tyre=str(row["tyre"] or ""),
        construction=str(row["construction"] or ""),
        rig=str(row.get("rig") or ""),
        cells=tuple(_cell(row, column) for column in columns),
        verdict=worst([row["verdict"]]),
        remarks=str(row["remarks"] or ""),
    )


def _cell(row: Mapping[str, Any], column: Column) -> Cell:
    value = known(row.get(column.source))
    return Cell("" if value is None else repr(value), *column.texts(row))


def worst(verdicts: list[Any]) -> str:
    """The gravest of some verdicts; one that is unknown is a rejection."""
    ranks = [VERDICTS.index(verdict) if verdict in VERDICTS else 2 for verdict in verdicts]
    return VERDICTS[max(ranks, default=2)]


def condition(row: Mapping[str, Any], *, dynamic: bool) -> str:
    """What a test was done at, in short: 1.7 bar, 1000 N, 10.01 Hz."""
    parts = [
        (row.get("pressure [Pa]"), 1e5, "bar", 3),
        (row.get("preload [N]") if dynamic else None, 1.0, "N", 4),
        (row.get("frequency [Hz]"), 1.0, "Hz", 4),
        (row.get("added mass [kg]") or None, 1.0, "kg added", 4),
        (row.get("temperature [degC]"), 1.0, "°C", 3),
    ]
    said = [
        f"{number(value / scale, digits)} {unit}"
        for raw, scale, unit, digits in parts
        if (value := known(raw)) is not None
    ]
    return ", ".join(said)
