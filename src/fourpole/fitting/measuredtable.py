"""Reading of a table of measured K*: its cells, the numbers of a column, and the stated covariance of K*."""

from __future__ import annotations

import io
from collections.abc import Mapping

import numpy as np
import polars as pl

from fourpole import quantities as q
from fourpole.core.arrays import BoolArray, FloatArray
from fourpole.errors import ModelError, TableError, UnitError
from fourpole.fitting.amplitude import COLUMN
from fourpole.fitting.rows import each_once
from fourpole.io.documents import GREATEST
from fourpole.units import column_unit, shown, to_si

FREQUENCY, RE, IM = q.FREQUENCY.head, q.STORAGE.head, q.LOSS.head
STD = (q.STORAGE.u_head, q.LOSS.u_head, q.CORR_K.head)
#: Kinds of the columns whose unit may be another than that of dynamic.csv.
_KINDS = {
    FREQUENCY: "frequency", RE: "stiffness", IM: "stiffness", STD[0]: "stiffness", STD[1]: "stiffness",
    q.K1.head: "stiffness", q.K1.u_head: "stiffness", q.PRESSURE.head: "pressure", q.PRELOAD.head: "force",
    q.TEMPERATURE.head: "temperature",
}  # fmt: skip
#: Bounds of a frequency [Hz]: a product of two of them, or of one and its reciprocal, is a number.
_LOWEST, _HIGHEST = 1e-100, 1e100
#: Upper bound of a stiffness [N/m].
_LARGEST = 1e25


def covariances(numbers: dict[str, FloatArray]) -> FloatArray:
    """Covariance (N, 2, 2) [N²/m²] from the columns of uncertainty and correlation."""
    first, second = numbers[STD[0]], numbers[STD[1]]
    correlation = np.nan_to_num(numbers.get(STD[2], np.zeros(first.size)))
    impossible = {
        STD[0]: ~(first >= 0), STD[1]: ~(second >= 0), STD[2]: np.abs(correlation) > 1,
    }  # fmt: skip
    for head, rows in impossible.items():
        if np.any(rows):
            at = int(np.argmax(rows))
            raise ModelError(
                f"{shown(head)} at {numbers[FREQUENCY][at]:.6g} Hz is {numbers[head][at]:g}, which is no covariance: "
                "an uncertainty is not negative, a correlation lies between -1 and 1. Correct the cell or state --std"
            )
    cross = correlation * first * second
    return np.stack([np.stack([first**2, cross], axis=-1), np.stack([cross, second**2], axis=-1)], axis=-2)


def as_frame(name: str, content: bytes) -> pl.DataFrame:
    """A table of results, all cells of a CSV file as text; TableError if it is none."""
    try:
        if name.endswith(".parquet"):
            return pl.read_parquet(io.BytesIO(content))
        return each_once(pl.read_csv(content, infer_schema=False, comment_prefix="#"), name)
    except pl.exceptions.PolarsError as error:
        raise TableError(f"{name}: is no table of results ({str(error).splitlines()[0]})") from None


def in_si(frame: pl.DataFrame, name: str) -> pl.DataFrame:
    """The table with the usual columns in SI, where they stand in another unit: "pressure [bar]", "Re K* [kN/m]".

    Raises
    ------
    TableError
        If the unit of such a column is none of its quantity.
    """
    for head, kind in _KINDS.items():
        usual = column_unit(head)[0]
        other = next((one for one in frame.columns if column_unit(one)[0] == usual and column_unit(one)[1]), None)
        if head in frame.columns or other is None:
            continue
        values = numbers_of(frame, other, name, np.ones(frame.height, dtype=bool))
        try:
            frame = frame.with_columns(pl.Series(head, to_si(values, column_unit(other)[1] or "", kind)))
        except UnitError as error:
            raise TableError(f"{name}: column {shown(other)}: {error}") from None
    return frame


def numbers_of(frame: pl.DataFrame, column: str, name: str, used: BoolArray) -> FloatArray:
    """A column as numbers; TableError where a row that is used has other text."""
    series = frame[column]
    if series.dtype == pl.String:
        stripped = series.str.strip_chars()
        found = stripped.cast(pl.Float64, strict=False)
        lost = found.is_null() & stripped.is_not_null() & (stripped != "") & pl.Series(used)
        if lost.any():
            at = int(lost.arg_max() or 0)
            raise TableError(f"{name}: row {at + 2}, column {shown(column)}: {shown(str(series[at]))} is no number")
        series = found
    numbers = np.asarray(series.cast(pl.Float64).fill_null(np.nan).to_numpy(), dtype=float)
    beyond = used & (np.abs(numbers) > GREATEST)
    if np.any(beyond):
        at = int(np.argmax(beyond))
        raise TableError(
            f"{name}: row {at + 2}, column {shown(column)}: {numbers[at]:g} is no number up to {GREATEST:g}"
        )
    return numbers


def usable(
    numbers: Mapping[str, FloatArray], name: str, *, stated: bool, by_amplitude: bool
) -> tuple[BoolArray, list[str]]:
    """Flags of the rows used, and notes on the others; if some rows state an uncertainty, rows without are not used."""
    frequency, real, imag = (numbers[head] for head in (FREQUENCY, RE, IM))
    good = np.isfinite(frequency) & np.isfinite(real) & np.isfinite(imag) & (frequency > 0)
    notes = [] if good.all() else [f"{int(np.sum(~good))} of {good.size} rows of {name} have no K* and were left out"]

    def only(wanted: BoolArray, said: str) -> BoolArray:
        """The rows used that are wanted; a note on the others."""
        if np.any(good & ~wanted):
            notes.append(f"{int(np.sum(good & ~wanted))} rows of {name} {said} and were left out")
        return good & wanted

    inside = (frequency >= _LOWEST) & (frequency <= _HIGHEST)
    good = only(inside, f"have a frequency beyond {_LOWEST:g} to {_HIGHEST:g} Hz")
    size = np.hypot(np.nan_to_num(real), np.nan_to_num(imag))
    good = only((size > 0) & (size < _LARGEST), f"have a K* that is zero, or beyond {_LARGEST:g} N/m,")
    if stated and all(column in numbers for column in STD[:2]):
        sure = np.isfinite(numbers[STD[0]]) & np.isfinite(numbers[STD[1]])
        good = only(sure, "state no uncertainty of K*") if np.any(sure & good) else good
    if by_amplitude:
        known = np.isfinite(numbers[COLUMN]) & (np.nan_to_num(numbers[COLUMN]) > 0)
        good = only(known, f"have no {shown(COLUMN)}")
    return good, notes
