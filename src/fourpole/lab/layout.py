"""The tables of a data set: their columns, which are the same in each file, and where the files stand."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import polars as pl

from fourpole import quantities as q
from fourpole.errors import CampaignError
from fourpole.study import tables as of_study
from fourpole.study.tables import TableSpec

#: Version of the data set. A change of a column's name or meaning, or of the files' places, raises it.
SCHEMA = 1
#: The index of a data set, the keys of a campaign's rule of one condition and of its rig and sensors in it, and its
#: largest size [byte].
INDEX, CONDITIONS, STATED, MOST_BYTES = "lab.json", "conditions", "stated", 1_000_000_000
#: Columns that stand first in each table and say where a row is from.
ORIGIN: dict[str, Any] = {
    "schema": pl.Int64,
    "campaign": pl.String,
    "laboratory": pl.String,
    "title": pl.String,
    "date": pl.Date,
    "fourpole": pl.String,
    "sha256": pl.String,
}
#: Columns of tests.csv that the results have no column for: a JSON object, head -> text.
FURTHER = "further"
#: Column of `budget`: the object to which the error belongs, as "channel" or "rig".
ROLE = "role"


@dataclass(frozen=True)
class LabTable:
    """One table of the data set.

    Attributes
    ----------
    spec : TableSpec
        The result table whose rows it has.
    columns : mapping of str to polars type
        All its columns.
    needed : tuple of str
        Columns without which results are not taken; another column that results lack is left empty.
    """

    spec: TableSpec
    columns: Mapping[str, Any]
    needed: tuple[str, ...]


def _table(spec: TableSpec, *needed: q.Quantity, further: Mapping[str, Any], keyed: bool = True) -> LabTable:
    first = {q.TEST.head: pl.String, q.POINT.head: pl.Int64} if keyed else {}
    # a list in place of an array of fixed length, which not every reader knows
    plain = {head: pl.List(pl.Float64) if isinstance(kind, pl.Array) else kind for head, kind in spec.columns.items()}
    return LabTable(spec, {**ORIGIN, **first, **plain, **further}, tuple(quantity.head for quantity in needed))


#: Tables of the data set by name.
TABLES: dict[str, LabTable] = {
    "tests": _table(
        of_study.DYNAMIC,
        *(q.TEST, q.TYRE, q.FREQUENCY, q.STORAGE, q.LOSS),
        further={"time": pl.String, FURTHER: pl.String},
    ),
    "static": _table(
        of_study.STATIC,
        *(q.TEST, q.TYRE, q.PRELOAD, q.K1),
        further={q.TEMPERATURE.head: pl.Float64, FURTHER: pl.String},
        keyed=False,
    ),
    "rig": _table(of_study.RIG, q.VALUE, q.UNIT, further={}, keyed=False),
    "budget": _table(of_study.BUDGET, q.TEST, q.QUANTITY, q.SOURCE, q.U, further={ROLE: pl.String}),
    "covariance": _table(of_study.COVARIANCE, q.TEST, q.OWN_COVARIANCE, further={}),
}


def scan(folder: str | Path, table: str = "tests") -> pl.LazyFrame:
    """A table of a data set, which is read when it is collected.

    Parameters
    ----------
    folder : path
        A data set that `gather` or `fourpole lab` wrote.
    table : str
        One of `TABLES`.

    Raises
    ------
    CampaignError
        If there is no such table, or the folder holds no data set.
    """
    if table not in TABLES:
        raise CampaignError(f"no table {table!r}: choose one of {', '.join(TABLES)}")
    if not any(Path(folder, table).glob("*.parquet")):
        raise CampaignError(f"{folder}: there is no data set: fourpole lab FOLDER writes one")
    return pl.scan_parquet(Path(folder, table) / "*.parquet")
