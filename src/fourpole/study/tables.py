"""The registry of result tables: one entry each, from which a table is made, written, read back and described.

The key of a row of a dynamic test is its test and its point, because one recording may give several frequencies. The
column `point` is written only where a test has more than one point.
"""

from __future__ import annotations

import io
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import polars as pl

from fourpole import quantities as q
from fourpole.core.arrays import ByValue
from fourpole.core.checks import VERDICTS, Verdict, worst_verdict
from fourpole.core.demodulation.preview import BLOCKS, POINTS
from fourpole.core.phasor import SYMBOLS
from fourpole.errors import CampaignError, TableError
from fourpole.fitting.likelihood import COVARIANCE_COLUMNS, LIKELIHOOD_COLUMNS
from fourpole.fitting.rows import KEY, checked, each_once
from fourpole.io.published import Published
from fourpole.quantities import DERIVED, QUANTITIES, Quantity
from fourpole.units import shown

_AGAIN = "run fourpole analyse again"
_TYPES = {"number": pl.Float64, "text": pl.String, "count": pl.Int64, "lists": pl.List(pl.Float64)}
_KINDS = {quantity.head: quantity.kind for quantity in QUANTITIES}
#: Columns of numbers that a table has only where there is a value; every other further column is text.
OPTIONAL = {q.POINT.head: pl.Int64, q.TEMPERATURE.head: pl.Float64}
#: Columns that results of older versions lack; they are read as blank.
LATER = (
    q.VALUES.head, q.K_OF.head, *q.ENERGY.heads, q.VERDICT_K.head, q.VERDICT_ARM.head, q.VERDICT_TR.head,
    q.QUANTITY.head,
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class TableSpec:
    """One result table.

    Attributes
    ----------
    name : str
        Name of the file without its ending, and of the attribute of `Study`.
    about : str
        The thing that a row describes.
    columns : mapping of str to polars type
        Heads in the order of the file.
    key : tuple of str
        Columns that identify a row.
    endings : tuple of str
        Endings of the files that the table is written to.
    always : bool
        Whether the file is written without rows too; another table without rows has no file.
    read : bool
        Whether `read_results` reads the table at once; another one is read when it is asked for.
    """

    name: str
    about: str
    columns: Mapping[str, Any]
    key: tuple[str, ...] = KEY
    endings: tuple[str, ...] = (".csv",)
    always: bool = False
    read: bool = True

    def frame(self, columns: Mapping[str, Any]) -> pl.DataFrame:
        """The table of columns by head, equal in length; test and point come first, and further columns last.

        A number that is not finite is a blank cell. The column `point` is left out if no test has more than one.
        """
        count = len(next(iter(columns.values()), ()))
        points = columns.get(q.POINT.head)
        several = points is not None and any(point != 1 for point in points)
        first = KEY if several else ()
        heads = [head for head in dict.fromkeys((*first, *self.columns, *columns)) if several or head != q.POINT.head]
        types = {head: self.columns.get(head, OPTIONAL.get(head, pl.String)) for head in heads}
        blank, series = [None] * count, []
        for head, kind in types.items():
            values = columns.get(head, blank)
            if kind == pl.Float64:
                numbers = np.asarray(values, dtype=float)
                known, column = np.isfinite(numbers), pl.Series(head, numbers, dtype=kind)
                series.append(column if known.all() else column.set(pl.Series(~known), None))
            elif kind in (pl.String, pl.Int64) or not isinstance(values, np.ndarray):
                series.append(pl.Series(head, list(values), dtype=kind, strict=False))
            else:
                series.append(pl.Series(head, values, dtype=kind))
        return pl.DataFrame(series)

    def of_rows(self, rows: Sequence[Mapping[str, Any]]) -> pl.DataFrame:
        """The table of rows by head; a row that lacks a head has a blank cell."""
        heads = dict.fromkeys(head for cells in rows for head in cells)
        return self.frame({head: [cells.get(head) for cells in rows] for head in heads})

    def of_parts(self, parts: Sequence[Mapping[str, Any]]) -> pl.DataFrame:
        """The table of parts by head, one after the other; a head that the table does not have is left out."""
        columns: dict[str, Any] = {}
        for head in [head for head in (*KEY, *self.columns) if parts and head in parts[0]]:
            arrays = [part[head] for part in parts]
            even = len({np.shape(array)[1:] for array in arrays}) == 1  # arrays of unequal rows become a list
            columns[head] = np.concatenate(arrays) if even else [row for array in arrays for row in array]
        return self.frame(columns)


class _Held:
    """A table as an attribute, read from its file when it is first asked for; without columns where there is none."""

    def __set_name__(self, owner: type, name: str) -> None:
        self._name = name

    def __get__(self, holder: Tables, owner: type) -> pl.DataFrame:
        return holder.table(self._name) if holder is not None else self  # type: ignore[return-value]


class Tables(ByValue):
    """Base of a class that holds result tables by name; each table of the registry is an attribute too."""

    tables: dict[str, pl.DataFrame]
    files: Published | None
    static, dynamic, checks, previews = _Held(), _Held(), _Held(), _Held()
    rig, specimens, residuals, budget, quantiles = _Held(), _Held(), _Held(), _Held(), _Held()
    corrections, lines, phasors, covariance, likelihood = _Held(), _Held(), _Held(), _Held(), _Held()

    def table(self, name: str) -> pl.DataFrame:
        """A table by the name of its file; a table without columns where there is none."""
        if name not in self.tables and self.files is not None and name in TABLES:
            self.tables[name] = read_table(self.files, TABLES[name])
        return self.tables.get(name, pl.DataFrame())


def _columns(*columns: Quantity | str) -> dict[str, Any]:
    """Heads with their types."""
    heads = [column if isinstance(column, str) else column.head for column in columns]
    return {head: _TYPES[_KINDS.get(head, "number")] for head in heads}


STATIC = TableSpec(
    "static", "a static test at a preload in use",
    _columns(
        q.TEST, q.TYRE, q.CONSTRUCTION, q.PRESSURE, q.PRELOAD, *q.K1.heads, q.K1_OF, q.K1_LOADING, q.K1_UNLOADING,
        q.GAP, q.SECANT, *q.CYCLE_LOSS.heads, q.BRANCH_TIME, q.CYCLE, q.NONLINEARITY, q.VERDICT, q.REMARKS,
    ),
    key=(q.TEST.head, q.PRELOAD.head), always=True,
)  # fmt: skip
DYNAMIC = TableSpec(
    "dynamic", "a dynamic test",
    _columns(
        q.TEST, q.RIG, q.TYRE, q.CONSTRUCTION, q.PRESSURE, q.PRELOAD, q.ADDED_MASS, q.TEMPERATURE, q.FREQUENCY,
        q.F1, q.V1, q.V2, q.PHASE_F1, q.PHASE_V2, q.DEFLECTION_AMPLITUDE, q.R, q.I, q.R.u_head, q.I.u_head, q.CORR_R_I,
        q.STORAGE, q.LOSS, q.STORAGE.u_head, q.LOSS.u_head, q.CORR_K, *q.LOSS_FACTOR.heads, *q.K1.heads,
        q.K2, q.C, q.K2.u_head, q.C.u_head, q.CORR_K2_C, q.TR_MEASURED, *q.TR_PREDICTED.heads, *q.ENERGY.heads,
        *(head for quantity in DERIVED for head in quantity.heads), q.ROUTE, q.K_OF, q.VERDICT, q.REMARKS,
        q.VERDICT_K, q.VERDICT_ARM, q.VERDICT_TR,
    ),
    endings=(".csv", ".parquet"), always=True,
)  # fmt: skip
RIG = TableSpec(
    "rig", "a value that tests share: of the rig, a channel, an added mass",
    _columns(
        q.RIG, q.VALUE, q.UNIT, *q.STATED.heads, *q.FOUND.heads, q.POSTERIOR, q.PULL, q.DETECTION_LIMIT, q.FINDING,
        q.REMARKS,
    ),
    key=(q.RIG.head, q.VALUE.head),
)  # fmt: skip
RESIDUALS = TableSpec(
    "residuals", "a dynamic test that the joint route used",
    _columns(
        q.TEST, q.RIG, q.ADDED_MASS, q.FREQUENCY, q.RESIDUAL_RE, q.RESIDUAL_IM, q.RESIDUAL_RE.u_head,
        q.RESIDUAL_IM.u_head, *q.ZR.parts, q.CHI2, q.DOF, q.OUTLIER,
    ),
)  # fmt: skip
SPECIMENS = TableSpec(
    "specimens", "a specimen at one condition without its frequency: its mass and its springs",
    _columns(
        q.TYRE, q.RIG, q.PRESSURE, q.PRELOAD, q.FORM, *q.BELT_MASS.heads, *q.BELT_FREE.heads,
        *q.BELT_HELD.heads, *q.BELT_SHARE.heads, q.BELT_EXPONENT, *q.BELT_SPREAD.heads, q.BELT_EVIDENCE,
    ),
    key=(q.TYRE.head, q.RIG.head, q.PRESSURE.head, q.PRELOAD.head),
)  # fmt: skip
QUANTILES = TableSpec(
    "quantiles", "K2 or C of a dynamic test, where value ± 1.96 u is not a 95 % interval",
    _columns(q.TEST, q.QUANTITY, q.UNIT, q.LOWER, q.MEDIAN, q.UPPER, q.NON_PASSIVE),
    key=(*KEY, q.QUANTITY.head),
)  # fmt: skip
BUDGET = TableSpec(
    "budget", "one of the ten largest sources of uncertainty of a quantity of a dynamic test, or all other sources",
    _columns(q.TEST, q.QUANTITY, q.UNIT, q.SOURCE, q.U, q.SHARE),
    key=(*KEY, q.QUANTITY.head, q.SOURCE.head),
)  # fmt: skip
CHECKS = TableSpec(
    "checks", "a check of a test, or of a condition",
    _columns(q.TEST, q.CODE, q.CHANNEL, q.STATISTIC, q.LIMIT, q.VERDICT, q.REMEDY, q.VALUES, q.QUANTITY),
    key=(*KEY, q.CODE.head, q.CHANNEL.head),
)  # fmt: skip
CORRECTIONS = TableSpec(
    "corrections", "what was undone at an amplitude of a dynamic test",
    _columns(
        q.TEST, q.FREQUENCY, q.CHANNEL, q.CORRECTION, q.GAIN, q.PHASE, q.GAIN.u_head, q.PHASE.u_head
    ),
    key=(*KEY, q.CHANNEL.head, q.CORRECTION.head), read=False,
)  # fmt: skip
LINES = TableSpec(
    "lines", "a line of a test under random excitation or a sweep: what its spectra show",
    _columns(
        q.TEST, q.FREQUENCY, q.WIDTH, q.AVERAGES, *q.COHERENCES, *q.CLOSURE_PHASE.heads,
        *(part for quantity in q.ESTIMATES for part in quantity.parts),
    ),
)  # fmt: skip
PHASORS = TableSpec(
    "phasors", "complex amplitudes of a dynamic test",
    {
        **_columns(
            q.TEST, q.RIG, *q.FREQUENCY.heads, *q.F1.parts, *q.V1.parts, *q.V2.parts, q.PHASOR_COVARIANCE, q.DOF
        ),
        q.PHASOR_COVARIANCE.head: pl.Array(pl.Float64, 36),
    },
    endings=(".parquet",), always=True, read=False,
)  # fmt: skip
COVARIANCE = TableSpec(
    "covariance", "K* of a dynamic test: what it has in common with others",
    {
        **_columns(*COVARIANCE_COLUMNS),
        q.OWN_COVARIANCE.head: pl.Array(pl.Float64, 4),
    },
    endings=(".parquet",), always=True, read=False,
)  # fmt: skip
LIKELIHOOD = TableSpec(
    "likelihood", "a dynamic test as the joint route weighed it", _columns(q.TEST, *LIKELIHOOD_COLUMNS),
    endings=(".parquet",), read=False,
)  # fmt: skip
#: The columns of a static test, the loop and its mean; what is shown of each channel of a dynamic test.
LOOP = tuple(quantity.head for quantity in (q.DEFLECTION, q.LOAD, q.MEAN_DEFLECTION, q.MEAN_LOAD))
SHOWN = ("", " fit", " residual")
#: Samples and, two for each block, extremes of the residual that a row has room for, by column of a dynamic test.
ROOM = {
    q.TIME.head: POINTS,
    q.RESIDUAL_TIME.head: 2 * BLOCKS,
    **{f"{name}{what}": 2 * BLOCKS if what == " residual" else POINTS for name in SYMBOLS.values() for what in SHOWN},
}
PREVIEWS = TableSpec(
    "previews",
    "a test: a few cycles of signal, fit and residual (not-a-number after the last), or the static loop and its mean",
    {
        q.TEST.head: pl.String,
        **dict.fromkeys(LOOP, pl.List(pl.Float32)),
        **{name: pl.Array(pl.Float32, room) for name, room in ROOM.items()},
    },
    endings=(".parquet",), always=True,
)  # fmt: skip

_ALL = (
    STATIC, DYNAMIC, CHECKS, RIG, SPECIMENS, RESIDUALS, QUANTILES, BUDGET, CORRECTIONS, LINES, PHASORS, COVARIANCE,
    LIKELIHOOD, PREVIEWS,
)  # fmt: skip
#: All result tables, by name.
TABLES = {spec.name: spec for spec in _ALL}
#: Names of the files of all result tables.
TABLE_FILES = tuple(f"{spec.name}{ending}" for spec in TABLES.values() for ending in spec.endings)


def verdict_of_lines(rows: Sequence[str]) -> Verdict:
    """Verdict of a dynamic test from those of its lines: a line of many that is rejected is a warning."""
    worst = worst_verdict(rows)
    return Verdict.WARNING if worst is Verdict.REJECTED and set(rows) != {Verdict.REJECTED} else worst


def verdict_counts(*tables: pl.DataFrame) -> dict[str, int]:
    """Number of tests by verdict; a test with several rows counts by the worst, but see `verdict_of_lines`."""
    held = [table for table in tables if q.VERDICT.head in table.columns]
    verdicts = []
    for table in held:
        rows = table.group_by(q.TEST.head, maintain_order=True).agg(q.VERDICT.head)[q.VERDICT.head].to_list()
        verdicts += list(map(verdict_of_lines if q.POINT.head in table.columns else worst_verdict, rows))
    return {verdict: verdicts.count(verdict) for verdict in VERDICTS}


def read_table(results: Published, spec: TableSpec, needed: Collection[str] | None = None) -> pl.DataFrame:
    """A table as it was written; a table without columns where an optional file is missing.

    A column of `needed`, by default any column, that the file does not have is an error.
    """
    name, ending = f"{spec.name}{spec.endings[0]}", spec.endings[0]
    if (not spec.always or ending == ".parquet") and not results.has(name):
        return pl.DataFrame()
    try:
        frame = _parsed(results.read(name), name, {**OPTIONAL, **spec.columns})
        frame = each_once(frame, name) if spec is DYNAMIC else frame
    except pl.exceptions.PolarsError as error:
        why = str(error).partition("\n")[0][:200]
        raise CampaignError(f"{name}: cannot be read ({why}): {_AGAIN}") from None
    except TableError as error:
        raise CampaignError(f"{error}: {_AGAIN}") from None
    lacking = [name for name in (spec.columns if needed is None else needed) if name not in (*frame.columns, *LATER)]
    if lacking and ending != ".parquet":
        raise CampaignError(f"{name}: has no column {lacking[0]!r}: {_AGAIN}")
    if ending == ".parquet":
        return frame
    later = (
        pl.lit("" if kind == pl.String else None, dtype=kind).alias(name)
        for name, kind in spec.columns.items()
        if name in LATER and name not in frame.columns
    )
    return frame.with_columns(*later, pl.col(pl.String).fill_null(""))


def _parsed(content: bytes, name: str, known: Mapping[str, Any]) -> pl.DataFrame:
    """The table of a CSV or Parquet file, its columns of known kinds; TableError for a cell of another kind."""
    if name.endswith(".parquet"):
        for column, kind in pl.read_parquet_schema(io.BytesIO(content)).items():  # a few bytes may hold many zeros
            if known.get(column) == pl.String and kind != pl.String:
                raise TableError(f"{name}, column {shown(column)}: is not one that fourpole wrote")
        return checked(pl.read_parquet(content), name, known)
    names = pl.read_csv(content, n_rows=0, infer_schema=False).columns
    kinds = {name: known.get(name, pl.String) for name in names}
    counts = [name for name, kind in kinds.items() if kind == pl.Int64]  # another program may write 4.0 for 4
    numbers = {**kinds, **dict.fromkeys(counts, pl.Float64)}
    try:
        frame = checked(pl.read_csv(content, schema=numbers), name)
    except pl.exceptions.PolarsError:
        checked(pl.read_csv(content, infer_schema=False), name, numbers)  # names the cell at fault
        raise
    return frame.with_columns(pl.col(counts).cast(pl.Int64, strict=False))
