"""Rows of tables of K*: the key (test, point), the condition and the values of the tyre in each row.

A row of a dynamic test is identified by its test and its point, since one recording may give several frequencies. The
column `point` is written only if a test has more than one point. Columns of words of no known kind that distinguish
rows of one condition and frequency become part of the specimen's name.
"""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import polars as pl

from fourpole import quantities as q
from fourpole.core.arrays import BoolArray, FloatArray
from fourpole.core.checks import VERDICTS
from fourpole.core.condition import AMPLITUDE, AXES, Axis, Condition, Sameness, Value, axis_of
from fourpole.core.condition import FREQUENCY as BY_FREQUENCY
from fourpole.core.specimen import Form, Specimen
from fourpole.errors import ModelError, TableError, UnitError
from fourpole.io.documents import GREATEST
from fourpole.quantities import Quantity
from fourpole.units import column_unit, shown, to_si
from fourpole.words import first_of
from fourpole.words.heads import head_and_unit

if TYPE_CHECKING:
    from fourpole.core.identify import Identification
    from fourpole.models.operating import Answer

#: Heads of the columns that identify a row of a dynamic test.
KEY = (q.TEST.head, q.POINT.head)

Key = tuple[str, int]
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


def checked(table: pl.DataFrame, name: str, kinds: Mapping[str, Any] | None = None) -> pl.DataFrame:
    """A result table that another program may have changed, with its columns of the `kinds` that they should have.

    Raises
    ------
    TableError
        If a cell of a column of numbers has text, or a number that is infinite or whose square is none; or if a
        verdict is none. The message has the row as the file has it, and the column.
    """
    wanted = [(kinds or {}).get(column, dtype) for column, dtype in table.schema.items()]
    lost = table.select(
        _lost(at, column, dtype, kind).alias(str(at))
        for at, ((column, dtype), kind) in enumerate(zip(table.schema.items(), wanted, strict=True))
    )
    for at, (column, kind) in enumerate(zip(table.columns, wanted, strict=True)):
        if lost[str(at)].any():
            row = int(lost[str(at)].arg_max() or 0)
            what = "no verdict" if column == q.VERDICT.head else f"no number up to {GREATEST:g}"
            where = f"{name} row {row + 2}, column {shown(column)}: {shown(table[column][row])}"
            raise TableError(f"{where} is {what if kind != pl.String or what == 'no verdict' else 'no text'}")
    return table.select(pl.nth(at).cast(kind, strict=False) for at, kind in enumerate(wanted))


def _lost(at: int, column: str, dtype: pl.DataType, wanted: Any) -> pl.Expr:
    """Whether each cell of the column at a place is not of the wanted kind; null where it is blank."""
    given = pl.nth(at)
    cells = given if dtype == wanted else given.cast(wanted, strict=False)
    lost = cells.is_null() & given.is_not_null()
    if wanted == pl.String and dtype != wanted:
        return given.is_not_null()
    if wanted.is_float():
        return lost | ~((cells.abs() <= GREATEST) | cells.is_nan()).fill_null(True)  # not-a-number is a blank cell
    return lost | ~cells.is_in(["", *VERDICTS]) if column == q.VERDICT.head else lost


def each_once(table: pl.DataFrame, name: str) -> pl.DataFrame:
    """The table; TableError if it has a point of a test twice."""
    if q.TEST.head in table.columns:
        keys, named = keyed(table).select(KEY), table[q.TEST.head].cast(pl.String).fill_null("") != ""
        again = ~keys.to_struct().is_first_distinct() & named
        if again.any():
            test, point = keys.row(at := int(again.arg_max() or 0))
            raise TableError(f"{name} row {at + 2}: test {shown(str(test))}, point {point} stands there twice")
    return table


def keyed(table: pl.DataFrame) -> pl.DataFrame:
    """The table with a column `point`; its value is 1 if the file has none.

    Examples
    --------
    >>> keyed(pl.DataFrame({"test": ["D1", "D2"]})).rows()
    [('D1', 1), ('D2', 1)]
    """
    written = pl.col(q.POINT.head).cast(pl.Int64, strict=False) if q.POINT.head in table.columns else pl.lit(1)
    return table.with_columns(written.fill_null(1).cast(pl.Int64).alias(q.POINT.head))


def key_of(row: Mapping[str, Any]) -> Key:
    """Test and point of a row."""
    return str(row.get(q.TEST.head) or ""), int(row.get(q.POINT.head) or 1)


def keys_of(table: pl.DataFrame) -> list[Key]:
    """Test and point of each row."""
    tests, points = (table[head].to_list() if head in table.columns else [None] * table.height for head in KEY)
    return [(str(test or ""), int(point or 1)) for test, point in zip(tests, points, strict=True)]


def tyre_columns(found: Identification | Answer) -> dict[str, FloatArray]:
    """K*, loss factor, K1, K2 and C by column, with their standard uncertainties and correlations."""
    stiffness = found.stiffness
    return {
        **pair_columns(q.CORR_K, stiffness.real, stiffness.imag, found.stiffness_covariance),
        **dict(zip(q.LOSS_FACTOR.heads, (found.loss_factor, found.loss_factor_std), strict=True)),
        **dict(zip(q.K1.heads, (found.k1, found.k1_std), strict=True)),
        **pair_columns(q.CORR_K2_C, found.k2, found.c, found.arm_covariance),
    }


def pair_columns(
    correlation: Quantity, first: FloatArray, second: FloatArray, covariance: FloatArray
) -> dict[str, FloatArray]:
    """Two quantities (N,) by column, with their standard uncertainties and their correlation."""
    (one, two), (u_one, u_two) = correlation.pair, np.sqrt(np.diagonal(covariance, 0, 1, 2)).T
    with np.errstate(invalid="ignore", divide="ignore"):
        value = np.clip(covariance[:, 0, 1] / (u_one * u_two), -1.0, 1.0)
    return {one.head: first, two.head: second, one.u_head: u_one, two.u_head: u_two, correlation.head: value}


_TOLERANCES = ("relative", "absolute")


def conditions_in(table: pl.DataFrame, rule: Sameness) -> list[Condition]:
    """The condition of each row of static.csv or dynamic.csv; an axis without a column is not stated."""
    columns = [_values(table, axis) for axis in rule.axes]
    tyres = table["tyre"].to_list() if "tyre" in table.columns else [""] * table.height
    rows = zip(*columns, strict=True) if columns else ((),) * table.height
    return [Condition(tyre or "", tuple(row)) for tyre, row in zip(tyres, rows, strict=True)]


def _values(table: pl.DataFrame, axis: Axis) -> Sequence[Value]:
    # If a column of tests.csv has the name of a result column, its head in dynamic.csv ends with "(tests.csv)".
    name = next((one for one in (f"{axis.column} (tests.csv)", axis.column) if one in table.columns), None)
    if name is None:
        return [None] * table.height
    if axis.text:
        return [text or None for text in table[name].cast(pl.String).to_list()]
    return table[name].cast(pl.Float64, strict=False).fill_nan(None).to_list()


def names_apart(tables: Sequence[Sequence[Condition]], rule: Sameness) -> list[list[str]]:
    """A name for the specimen of each row of some tables, different for each state of a specimen.

    A name is the specimen with its values on some axes: "radial at 60 °C, batch A". An axis is part of the name if the
    specimen has two values on it, or if one table states the axis for some of its rows only.
    """
    specimens = dict.fromkeys(one.specimen for table in tables for one in table)
    names = {
        name: _names([[one for one in table if one.specimen == name] for table in tables], rule) for name in specimens
    }
    return [[names[one.specimen][one] for one in table] for table in tables]


def _names(tables: Sequence[Sequence[Condition]], rule: Sameness) -> dict[Condition, str]:
    """The name of each condition of one specimen."""
    every = [one for table in tables for one in table]
    used = [at for at, axis in enumerate(rule.axes) if _differs(axis, [[one.values[at] for one in t] for t in tables])]
    axes = tuple(rule.axes[at] for at in used)
    short = [Condition(one.specimen, tuple(one.values[at] for at in used)) for one in every]
    groups = Sameness(axes).groups(short).tolist()
    members: dict[int, list[Condition]] = {}
    for one, group in zip(short, groups, strict=True):
        members.setdefault(group, []).append(one)
    names = {group: _name(axes, rows) for group, rows in members.items()}
    return {one: names[group] for one, group in zip(every, groups, strict=True)}


def _differs(axis: Axis, tables: Sequence[Sequence[Value]]) -> bool:
    stated = {value for table in tables for value in table if value is not None}
    return len(set(axis.groups(stated).tolist())) > 1 or any(None in table and {*table} != {None} for table in tables)


def _name(axes: Sequence[Axis], rows: Sequence[Condition]) -> str:
    """The specimen's name with its value on each axis; the value of a numeric axis is the median of the rows."""
    parts = [rows[0].specimen]
    for at, axis in enumerate(axes):
        values = [one.values[at] for one in rows]
        name, unit = column_unit(axis.column)
        if axis.text or values[0] is None:
            parts += [f", {name} {values[0]}"] if values[0] is not None else []
        elif unit == "degC":
            parts.append(f" at {np.median(np.array(values, dtype=float)):.4g} °C")
        else:
            parts.append(f", {name} {np.median(np.array(values, dtype=float)):.4g} {unit or ''}".rstrip())
    return "".join(parts)


def axes_record(rule: Sameness) -> list[dict[str, Any]]:
    """The axes of a rule, as study.json holds them."""
    tolerances = [{name: value for name in _TOLERANCES if (value := getattr(axis, name))} for axis in rule.axes]
    pairs = zip(rule.axes, tolerances, strict=True)
    return [{"column": axis.column, **({"text": True} if axis.text else own)} for axis, own in pairs]


def rule_in(record: Mapping[str, Any]) -> Sameness:
    """The rule in a record of study.json; a record without a rule gives the axes that every campaign has."""
    conditions = record.get("conditions")
    axes = conditions.get("axes") if isinstance(conditions, dict) else None
    found = [_axis(one) for one in axes if isinstance(one, dict)] if isinstance(axes, list) else []
    known = {axis.column for axis in AXES}
    return Sameness((*AXES, *(axis for axis in found if axis.name and axis.column not in known)))


def _axis(one: Mapping[str, Any]) -> Axis:
    relative, absolute = (float(x) if isinstance(x := one.get(name), int | float) else 0.0 for name in _TOLERANCES)
    return Axis(str(one.get("column") or ""), "", relative, absolute, one.get("text") is True)


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


def known_numbers(frame: pl.DataFrame, name: str, rule: Sameness, needed: Sequence[str]) -> dict[str, FloatArray]:
    """The columns of numbers that are known; ModelError if a needed one is not there."""
    for column in (FREQUENCY, RE, IM, *needed):
        if column not in frame.columns:
            there = ", ".join(map(shown, frame.columns[:40]))
            raise ModelError(f"{name}: has no column {shown(column)}: it has {there}")
    found = {column: numbers_of(frame, column, name, np.ones(frame.height, dtype=bool)) for column in (RE, IM)}
    measured = np.isfinite(found[RE]) & np.isfinite(found[IM])
    known = {
        FREQUENCY,
        *STD,
        *q.K1.heads,
        q.DEFLECTION_AMPLITUDE.head,
        *(axis.column for axis in rule.axes if not axis.text),
    } - {RE, IM}
    others = [column for column in frame.columns if column in known]
    return found | {column: numbers_of(frame, column, name, measured) for column in others}


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
        moved = numbers[q.DEFLECTION_AMPLITUDE.head]
        known = np.isfinite(moved) & (np.nan_to_num(moved) > 0)
        good = only(known, f"have no {shown(q.DEFLECTION_AMPLITUDE.head)}")
    return good, notes


def lacking_std(numbers: Mapping[str, FloatArray]) -> str:
    """Why columns do not give the uncertainty of K*, as a sentence; empty if they do."""
    without = [column for column in STD[:2] if column not in numbers or not np.all(np.isfinite(numbers[column]))]
    if without:
        return (
            f"{shown(without[0])} has no value in some row, and so the other part's is not used: state both, or --std"
        )
    if not any(np.any(numbers[column]) for column in STD[:2]):
        return f"{shown(STD[0])} and {shown(STD[1])} are zero in every row, as no measurement is: they are not used"
    return ""


def by_labels(frame: pl.DataFrame, labels: Sequence[str], rule: Sameness) -> tuple[pl.DataFrame, list[str]]:
    """The table with the labels that tell equal rows apart in the names of its specimens, and remarks on them.

    Rows are equal if they have one condition, amplitude and frequency.

    Examples
    --------
    >>> frame = pl.DataFrame({"frequency [Hz]": [5.0, 5.0], "way": ["axial", "radial"]})
    >>> found, remarks = by_labels(frame, ["way"], Sameness())
    >>> found["tyre"].to_list()
    ['axial', 'radial']
    """
    remarks, comments = [], {head for head, kind in frame.schema.items() if kind == pl.String} - {"tyre", *labels}
    whole = Sameness((*rule.axes, *(axis for axis in (AMPLITUDE, BY_FREQUENCY) if axis not in rule.axes)))
    for head in labels:
        words = _words(frame[head])
        equal = whole.groups(conditions_in(frame, whole)).tolist()
        if len({pair for pair in zip(equal, words, strict=True) if pair[1]}) == len(set(equal)):
            continue
        names = frame["tyre"].to_list() if "tyre" in frame.columns else [""] * len(words)
        both = [", ".join(filter(None, pair)) for pair in zip(names, words, strict=True)]
        frame = frame.with_columns(pl.Series("tyre", both))
        known = first_of([*dict.fromkeys(filter(None, words))], 4)
        remarks.append(f"column {shown(head)} tells rows of one condition and frequency apart: specimens {known}")
    equal = whole.groups(conditions_in(frame, whole)).tolist() if comments else []
    for head in sorted(comments):
        words = frame[head].fill_null("").to_list()
        if len({*zip(equal, words, strict=True)}) > len({*equal}):
            remarks.append(
                f"rows of one condition and frequency differ in column {shown(head)} "
                f"({first_of([*dict.fromkeys(filter(None, words))], 3)}): they count as repeats"
            )
    return frame, remarks


def _words(column: pl.Series) -> list[str]:
    """The cells of a column as labels; a number with its name and unit."""
    if column.dtype == pl.String:
        return column.fill_null("").to_list()
    name, unit = head_and_unit(column.name)
    return ["" if one is None or one != one else f"{name} {one:g} {unit or ''}".strip() for one in column.to_list()]


#: Time of a choice for few rows [s], and for each further row [s], on one core of a present machine.
_LEAST, _EACH = 0.5, 0.02


def seconds_of_fits(rows: int) -> float:
    """About how long the choice of a model for each tyre takes [s], with K* in this number of rows.

    Examples
    --------
    >>> seconds_of_fits(1000)
    20.5
    """
    return _LEAST + _EACH * rows


@dataclass(frozen=True)
class FoundBody:
    """A row of specimens.csv that has a mass: `row` by the heads of its columns, in SI."""

    row: Mapping[str, Any]

    @property
    def tyre(self) -> str:
        """Name of the specimen."""
        return str(self.row[q.TYRE.head])

    @property
    def form(self) -> Form:
        """A belt or a rod."""
        return Form(self.row[q.FORM.head])

    @property
    def place(self) -> dict[str, float]:
        """The stated values of its condition by the columns of the axes."""
        return {one.column: value for one in AXES if (value := self.row.get(one.column)) is not None}

    def pair(self, quantity: Quantity) -> tuple[float, float]:
        """Value and standard uncertainty; a blank value is not-a-number, a blank uncertainty 0."""
        value, std = (self.row.get(head) for head in quantity.heads)
        return np.nan if value is None else float(value), float(std or 0.0)

    def is_at(self, tyre: str, place: Mapping[str, float]) -> bool:
        """Whether a specimen and its condition without the frequency are those of this row."""
        axes = (axis_of(column) for column in place if column in self.row)
        return tyre == self.tyre and all(
            axis.same(None if np.isnan(place[axis.column]) else place[axis.column], self.row[axis.column], blank=True)
            for axis in axes
        )

    def specimen(self, stiffness: complex) -> Specimen:
        """The specimen, the share of which is that of the row where K* is `stiffness` [N/m]."""
        (mass, _), (share, _) = self.pair(q.BELT_MASS), self.pair(q.BELT_SHARE)
        exponent, (spread, _) = float(self.row[q.BELT_EXPONENT.head] or 0.0), self.pair(q.BELT_SPREAD)
        share, spread = 1.0 if np.isnan(share) else share, 1.0 if np.isnan(spread) else spread
        return Specimen(self.form, mass, share, exponent, stiffness, spread)


def bodies_in(tables: Mapping[str, pl.DataFrame]) -> list[FoundBody]:
    """The specimens with a mass that the joint route found, at each condition without its frequency."""
    rows = tables["specimens"].to_dicts() if "specimens" in tables else []
    return [FoundBody(row) for row in rows if row[q.FORM.head] != Form.MASSLESS.value]
