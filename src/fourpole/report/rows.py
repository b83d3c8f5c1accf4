"""The tables of results as the page shows them: columns in the units people use, rows with their cells."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import polars as pl

from fourpole import quantities as q
from fourpole.core.checks import worst_verdict
from fourpole.quantities import DERIVED, Quantity
from fourpole.report.digits import known, number, shown_as, with_std

STATIC = (q.PRESSURE, q.PRELOAD, q.K1, q.SECANT, q.CYCLE_LOSS, q.NONLINEARITY)
DYNAMIC = (
    q.PRESSURE, q.PRELOAD, q.ADDED_MASS, q.TEMPERATURE, q.FREQUENCY, q.K1, q.STORAGE, q.LOSS, q.LOSS_FACTOR, q.K2, q.C,
    q.TR_MEASURED, q.TR_PREDICTED, q.R, q.I, *DERIVED,
)  # fmt: skip
#: Columns that are shown only if a test has a value that is neither zero nor blank.
_SELDOM = (q.ADDED_MASS, q.TEMPERATURE)
#: A ratio below this is round-off.
_ROUND_OFF = 1e-9


def texts(quantity: Quantity, row: Mapping[str, Any]) -> tuple[str, str]:
    """Value and uncertainty of a row in the unit shown; the measured TR has no uncertainty in the table."""
    value = known(row.get(quantity.head))
    if value is not None and quantity is q.NONLINEARITY and abs(value) < _ROUND_OFF:
        value = 0.0
    std = known(row.get(quantity.u_head)) if quantity.key != q.TR_MEASURED.key else None
    scale = shown_as(quantity).scale
    shown, about = (None if one is None else one / scale for one in (value, std))
    return with_std(shown, about, quantity.digits)


def words(quantity: Quantity, row: Mapping[str, Any]) -> str:
    """Value, uncertainty and unit in one; blank where there is no value."""
    quantity, (value, std) = shown_as(quantity), texts(quantity, row)
    text = " ".join(part for part in (value, std and f"± {std}", quantity.suffix) if part) if value else ""
    return text.replace(" °", "°") if quantity.suffix == "°" else text


@dataclass(frozen=True)
class ResultTable:
    """Columns in use and their rows."""

    columns: tuple[Quantity, ...]
    rows: list[SimpleNamespace] = field(default_factory=list)
    rigs: bool = False
    remarks: bool = False


def result_rows(frame: pl.DataFrame, columns: tuple[Quantity, ...], cards: list[str]) -> ResultTable:
    """All rows of static.csv or dynamic.csv; `cards` has the card of each."""
    used = tuple(column for column in columns if column not in _SELDOM or _has_value(frame, column.head))
    rows = [_row(row, used, card) for row, card in zip(frame.rows(named=True), cards, strict=True)]
    return ResultTable(tuple(map(shown_as, used)), rows, any(row.rig for row in rows), any(row.remarks for row in rows))


def _has_value(frame: pl.DataFrame, name: str) -> bool:
    return name in frame.columns and any(known(value) for value in frame[name].to_list())


def _row(row: Mapping[str, Any], columns: tuple[Quantity, ...], card: str) -> SimpleNamespace:
    """One row of a table of results."""
    return SimpleNamespace(
        card=card,
        test=str(row["test"]),
        tyre=str(row["tyre"] or ""),
        construction=str(row["construction"] or ""),
        rig=str(row.get("rig") or ""),
        cells=tuple(_cell(row, column) for column in columns),
        verdict=worst_verdict([row["verdict"]]),
        remarks=str(row["remarks"] or ""),
    )


def _cell(row: Mapping[str, Any], column: Quantity) -> SimpleNamespace:
    """One number: the SI value as text, by which rows are sorted, and the value and uncertainty shown."""
    value = known(row.get(column.head))
    text, std = texts(column, row)
    return SimpleNamespace(key="" if value is None else repr(value), text=text, std=std)


def condition(row: Mapping[str, Any], *, dynamic: bool) -> str:
    """The condition of a test in short: 1.7 bar, 1000 N, 10.01 Hz."""
    stood = (q.PRESSURE, *((q.PRELOAD,) if dynamic else ()), q.FREQUENCY, q.ADDED_MASS, q.TEMPERATURE)
    said = []
    for one in map(shown_as, stood):
        value = known(row.get(one.head))
        if value is not None and (value or one.key != q.ADDED_MASS.key):
            added = " added" if one.key == q.ADDED_MASS.key else ""
            said.append(f"{number(value / one.scale, one.digits)} {one.shown}{added}")
    return ", ".join(said)
