"""The result tables: one entry each, from which they are made, written, read back and described.

A row of a dynamic test is known by its test and its point: one recording may give several frequencies. The column
`point` is written only where a test has more than one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray

from fourpole import quantities as q
from fourpole.campaign.folder import Campaign, Test
from fourpole.core.arrays import ByValue
from fourpole.core.checks import Check
from fourpole.core.demodulation.preview import Preview
from fourpole.core.identification import Identification
from fourpole.core.identify import OUTPUTS
from fourpole.core.loadcurve import LoadCurve
from fourpole.core.phasor import SYMBOLS, Phasors
from fourpole.fitting.measured import COVARIANCE_COLUMNS
from fourpole.fitting.rows import KEY
from fourpole.quantities import DERIVED, QUANTITIES, Quantity
from fourpole.study.identified import Group, Identified, budget_columns
from fourpole.study.outcome import Point, point_keys
from fourpole.study.rig_solution import residual_rows
from fourpole.study.static import StaticTest

__all__ = [
    "TABLES",
    "TEXT_COLUMNS",
    "Analysed",
    "TableSpec",
    "Tables",
    "amplitude_cells",
    "covariance_cells",
    "tyre_cells",
]

_TYPES = {"number": pl.Float64, "text": pl.String, "count": pl.Int64, "lists": pl.List(pl.Float64)}
_KINDS = {one.head: one.kind for one in QUANTITIES}
#: Columns of text, of all tables.
TEXT_COLUMNS = {head for head, kind in _KINDS.items() if kind == "text"}


@dataclass(frozen=True, eq=False)
class Analysed:
    """What an analysis came to, from which the tables are made.

    Attributes
    ----------
    campaign : Campaign
    statics : sequence of StaticTest
    tests : sequence of Test
        The dynamic tests, each as often as it has points.
    points, checks, cells : sequences
        What the reduction gave for each of `tests`, all its checks, and its cells of dynamic.csv.
    found : mapping of int to Identified
        By the place in `tests`.
    """

    campaign: Campaign
    statics: Sequence[StaticTest]
    tests: Sequence[Test]
    points: Sequence[Point]
    checks: Sequence[Sequence[Check]]
    cells: Sequence[dict[str, Any]]
    found: Mapping[int, Identified]

    @cached_property
    def keys(self) -> list[dict[str, Any]]:
        """Test and point of each of `tests`, as cells."""
        return [dict(zip(KEY, key, strict=True)) for key in point_keys(test.name for test in self.tests)]

    @cached_property
    def groups(self) -> list[tuple[Group, list[dict[str, Any]]]]:
        """The tests of each rig that were identified together, and their keys."""
        places: dict[int, tuple[Group, dict[int, dict[str, Any]]]] = {}
        for place, one in self.found.items():
            places.setdefault(id(one.group), (one.group, {}))[1][one.at] = self.keys[place]
        return [(group, [keys[at] for at in sorted(keys)]) for group, keys in places.values()]

    @property
    def measured(self) -> list[tuple[Test, dict[str, Any], Point, Phasors]]:
        """The tests with amplitudes, and their keys."""
        rows = zip(self.tests, self.keys, self.points, strict=True)
        return [(test, key, one, one.phasors) for test, key, one in rows if one.phasors is not None]

    def construction(self, test: Test) -> str:
        """What the campaign says the specimen is."""
        specimen = self.campaign.stated.all_specimens.get(test.tyre)
        return specimen.construction if specimen is not None else ""


@dataclass(frozen=True, eq=False)
class TableSpec:
    """One result table.

    Attributes
    ----------
    name : str
        Of the file without its ending, and of the attribute of `Study` and `Results`.
    about : str
        What it has a row of.
    columns : mapping of str to polars type
        Heads in the order of the file.
    make : callable
        The table of an analysis; it may have columns of text besides.
    key : tuple of str
        What tells its rows apart.
    endings : tuple of str
        Files that it is written to.
    always : bool
        Written without rows too; another table without rows has no file.
    read : bool
        Held by `Results`.
    """

    name: str
    about: str
    columns: Mapping[str, Any]
    make: Callable[[Analysed], pl.DataFrame]
    key: tuple[str, ...] = KEY
    endings: tuple[str, ...] = (".csv",)
    always: bool = False
    read: bool = True

    def of(self, analysed: Analysed) -> pl.DataFrame:
        """The table, with the column `point` where a test has more than one."""
        table = self.make(analysed)
        single = q.POINT.head in table.columns and (table[q.POINT.head] == 1).all()
        return table.drop(q.POINT.head) if single else table


class _Held:
    """A table of the mapping as an attribute; one without columns where there is none."""

    def __set_name__(self, owner: type, name: str) -> None:
        self._name = name

    def __get__(self, holder: Tables, owner: type) -> pl.DataFrame:
        return holder.tables.get(self._name, pl.DataFrame()) if holder is not None else self  # type: ignore[return-value]


class Tables(ByValue):
    """Who holds result tables, by name; those of the registry are attributes too."""

    tables: Mapping[str, pl.DataFrame]
    static, dynamic, checks, previews = _Held(), _Held(), _Held(), _Held()
    rig, residuals, budget, quantiles = _Held(), _Held(), _Held(), _Held()
    corrections, phasors, covariance = _Held(), _Held(), _Held()


def _columns(*columns: Quantity | str) -> dict[str, Any]:
    """Heads with their types."""
    heads = [one if isinstance(one, str) else one.head for one in columns]
    return {head: _TYPES[_KINDS.get(head, "number")] for head in heads}


def _frame(rows: Iterable[Mapping[str, Any]], columns: Mapping[str, Any], more: Sequence[str] = ()) -> pl.DataFrame:
    rows, pointed = list(rows), q.POINT.head not in columns and q.TEST.head in columns
    types = {**columns, **dict.fromkeys(more, pl.String)}
    if pointed and any(q.POINT.head in row for row in rows):
        types = {q.TEST.head: pl.String, q.POINT.head: pl.Int64, **types}
    series = {name: [_plain(row.get(name)) for row in rows] for name in types}
    return pl.DataFrame(series, schema=types, strict=False)


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return value.tolist()
    return None if isinstance(value, float) and not np.isfinite(value) else value


def _static_table(analysed: Analysed) -> pl.DataFrame:
    """With the temperature, and the campaign's own axes of a condition, where a static test states them."""
    tests = [one.test for one in analysed.statics]
    own = [axis.name for axis in analysed.campaign.stated.conditions.axes]
    axes = [name for name in own if any(test.extra.get(name) for test in tests)]
    warm = (q.TEMPERATURE,) if any(test.value("temperature") is not None for test in tests) else ()
    rows = [row for one in analysed.statics for row in one.rows]
    return _frame(
        (
            {
                q.TEST.head: row.test.name,
                q.TYRE.head: row.test.tyre,
                q.CONSTRUCTION.head: analysed.construction(row.test),
                q.PRESSURE.head: row.test.value("pressure"),
                q.PRELOAD.head: row.preload,
                q.K1.head: row.stiffness,
                q.K1.u_head: row.std,
                q.SECANT.head: row.secant,
                q.CYCLE_LOSS.head: row.loss,
                q.NONLINEARITY.head: row.nonlinearity,
                q.VERDICT.head: row.verdict,
                q.REMARKS.head: "; ".join(row.remarks),
                q.TEMPERATURE.head: row.test.value("temperature"),
                **{name: row.test.extra.get(name) for name in axes},
            }
            for row in rows
        ),
        {**STATIC.columns, **_columns(*warm)},
        axes,
    )


def _dynamic_table(analysed: Analysed) -> pl.DataFrame:
    """Identity of each test, what was found of it, and what tests.csv had more."""
    tests, taken, window = analysed.tests, DYNAMIC.columns, q.WINDOW.head
    names = {
        label: label if label not in taken else f"{label} (tests.csv)" for label in analysed.campaign.extra_columns
    }
    if any(test.window is not None for test in tests):
        names[window] = window
    rows = []
    for test, key, found in zip(tests, analysed.keys, analysed.cells, strict=True):
        more = dict(test.extra)
        if test.window is not None:
            more[window] = f"{test.window[0]:g}..{test.window[1]:g}"
        row = {
            **key,
            q.RIG.head: test.rig,
            q.TYRE.head: test.tyre,
            q.CONSTRUCTION.head: analysed.construction(test),
            q.PRESSURE.head: test.value("pressure"),
            q.PRELOAD.head: test.value("preload"),
            q.ADDED_MASS.head: test.value("added_mass") or 0.0,
            q.TEMPERATURE.head: test.value("temperature"),
            **found,
            **{name: more.get(label) for label, name in names.items()},
        }
        rows.append(row | _derived_cells(row))
    return _frame(rows, taken, tuple(names.values()))


def _derived_cells(row: Mapping[str, Any]) -> dict[str, float]:
    """Quantities that follow from others; what a row does not have is not-a-number."""
    known = {head: float("nan") if row.get(head) is None else row[head] for head in DYNAMIC.columns}
    return {head: cell for one in DERIVED if one.of for head, cell in zip(one.heads, one.of(known), strict=True)}


def _rig_table(analysed: Analysed) -> pl.DataFrame:
    estimates = (group.estimate for group, _ in analysed.groups if group.estimate is not None)
    return _frame((row for estimate in estimates for row in estimate.rows), RIG.columns)


def _residual_table(analysed: Analysed) -> pl.DataFrame:
    rows = [
        {q.RIG.head: group.setup.rig_name, **row, **key}
        for group, keys in analysed.groups
        if group.joint is not None
        for row, key in zip(residual_rows(group.joint, group.phasors), keys, strict=True)
    ]
    return _frame(rows, RESIDUALS.columns)


def _budget_table(analysed: Analysed) -> pl.DataFrame:
    """By columns: it has a row for every test, quantity and source."""
    types = {q.TEST.head: pl.String, q.POINT.head: pl.Int64, **BUDGET.columns}
    frames = [pl.DataFrame(schema=types)]
    for group, keys in analysed.groups:
        columns = {name: np.concatenate(parts) for name, parts in budget_columns(group).items()}
        made = {
            **{head: pl.Series([key[head] for key in keys], dtype=types[head]).gather(columns["test"]) for head in KEY},
            q.QUANTITY.head: pl.Series(list(OUTPUTS)).gather(columns["quantity"]),
            q.UNIT.head: pl.Series(list(OUTPUTS.values())).gather(columns["quantity"]),
            q.SOURCE.head: pl.Series([source.text for source in group.variance]).gather(columns["source"]),
        }
        frames.append(pl.DataFrame({**made, q.U.head: columns["u"], q.SHARE.head: columns["share"]}, schema=types))
    return pl.concat(frames)


def _quantile_table(analysed: Analysed) -> pl.DataFrame:
    """Drawn intervals of K2 and C, where linear propagation fails."""
    rows = [
        {
            **keys[at],
            q.QUANTITY.head: one.column,
            q.UNIT.head: one.unit,
            **dict(zip((q.LOWER.head, q.MEDIAN.head, q.UPPER.head), drawn.quantiles.tolist(), strict=True)),
            q.NON_PASSIVE.head: drawn.non_passive_share,
        }
        for group, keys in analysed.groups
        for at, pair in group.intervals.items()
        for one, drawn in zip((q.K2, q.C), pair, strict=True)
    ]
    return _frame(rows, QUANTILES.columns)


def _check_table(analysed: Analysed) -> pl.DataFrame:
    """All checks; those of a static test once, not once per preload."""
    statics = [
        (dict(zip(KEY, (item.test.name, 1), strict=True)), check)
        for item in analysed.statics
        for check in dict.fromkeys(check for row in item.rows for check in row.checks)
    ]
    dynamic = zip(analysed.keys, analysed.checks, strict=True)
    rows = [
        {
            **key,
            q.CODE.head: check.code.text,
            q.CHANNEL.head: check.channel,
            q.STATISTIC.head: check.statistic,
            q.LIMIT.head: check.limit,
            q.VERDICT.head: check.verdict,
            q.REMEDY.head: check.remedy,
        }
        for key, check in [*statics, *((key, check) for key, checks in dynamic for check in checks)]
    ]
    return _frame(rows, CHECKS.columns)


def _correction_table(analysed: Analysed) -> pl.DataFrame:
    rows = [
        {
            **key,
            q.FREQUENCY.head: float(phasors.frequency),
            q.CHANNEL.head: SYMBOLS[row.channel],
            q.CORRECTION.head: row.name,
            q.GAIN.head: row.gain,
            q.PHASE.head: row.phase,
            q.GAIN.u_head: row.gain_std,
            q.PHASE.u_head: row.phase_std,
        }
        for _, key, point, phasors in analysed.measured
        for row in point.corrections
    ]
    return _frame(rows, CORRECTIONS.columns)


def _phasor_table(analysed: Analysed) -> pl.DataFrame:
    rows = []
    for test, key, _, phasors in analysed.measured:
        row = {**key, q.RIG.head: test.rig, q.FREQUENCY.head: float(phasors.frequency)}
        row[q.FREQUENCY.u_head] = float(phasors.frequency_std)
        for one, amplitude in zip((q.F1, q.V1, q.V2), phasors.amplitudes, strict=True):
            row |= zip(one.parts, (float(amplitude.real), float(amplitude.imag)), strict=True)
        rows.append({**row, q.PHASOR_COVARIANCE.head: phasors.covariance.ravel(), q.DOF.head: float(phasors.dof)})
    return _frame(rows, PHASORS.columns)


def _covariance_table(analysed: Analysed) -> pl.DataFrame:
    """Of K* across tests, as each condition's own part and what shared errors do to each test.

    Two tests of a rig have the covariance shared_i · shared_j, summed over the shared errors; those of one condition
    have their own part in common besides.
    """
    rows = []
    for group, keys in analysed.groups:
        shared, condition = group.result.stiffness_shared, group.result.condition
        own = group.result.stiffness_covariance - shared @ np.swapaxes(shared, 1, 2)
        own = (own + np.swapaxes(own, 1, 2)) / 2  # round-off
        rows += [
            {
                **keys[at],
                q.RIG.head: group.setup.rig_name,
                q.CONDITION.head: int(condition[at]),
                q.OWN_COVARIANCE.head: own[at].ravel(),
                q.SHARED_STORAGE.head: shared[at, 0],
                q.SHARED_LOSS.head: shared[at, 1],
            }
            for at in np.flatnonzero(np.isfinite(group.result.stiffness)).tolist()
        ]
    return _frame(rows, COVARIANCE.columns)


def _preview_table(analysed: Analysed) -> pl.DataFrame:
    rows = [_static_preview(one.test, one.curve) for one in analysed.statics if one.curve is not None]
    points = zip(analysed.keys, analysed.points, strict=True)
    rows += [{**key, **_dynamic_preview(one, one.preview)} for key, one in points if one.preview is not None]
    return _frame(rows, PREVIEWS.columns)


def _static_preview(test: Test, curve: LoadCurve) -> dict[str, Any]:
    (x, f), (mean_x, mean_f) = curve.loop(), curve.mean_curve()
    return {q.TEST.head: test.name, q.POINT.head: 1, **dict(zip(_LOOP, (x, f, mean_x, mean_f), strict=True))}


def _dynamic_preview(found: Point, seen: Preview) -> dict[str, Any]:
    """Signals less their mean, in the SI unit of what each channel recorded."""
    row: dict[str, Any] = {q.TIME.head: seen.time, q.RESIDUAL_TIME.head: seen.blocks}
    for role, *parts in zip(found.channels, seen.signals, seen.fit, seen.residual, strict=True):
        row |= zip((f"{SYMBOLS[role]}{what}" for what in _SEEN), parts, strict=True)
    return row


def amplitude_cells(phasors: Phasors) -> dict[str, float]:
    """Frequency, amplitudes and phases of one test."""
    f1, v1, v2 = phasors.amplitudes
    return {
        q.FREQUENCY.head: float(phasors.frequency),
        q.F1.head: float(abs(f1)),
        q.V1.head: float(abs(v1)),
        q.V2.head: float(abs(v2)),
        q.PHASE_F1.head: float(np.angle(f1 / v1)),
        q.PHASE_V2.head: float(np.angle(v2 / v1)),
    }


def covariance_cells(covariance: NDArray[np.float64]) -> tuple[float, float, float]:
    """Two standard uncertainties and their correlation of a 2×2 covariance."""
    first, second = np.sqrt(np.diag(covariance))
    with np.errstate(invalid="ignore", divide="ignore"):
        correlation = covariance[0, 1] / (first * second)
    return float(first), float(second), float(np.clip(correlation, -1.0, 1.0))


def tyre_cells(found: Identification, at: int) -> dict[str, float]:
    """K*, K1, K2 and C of one test, with their uncertainties."""
    stiffness = complex(found.stiffness[at])
    return {
        **pair_cells(q.CORR_K, (stiffness.real, stiffness.imag), found.stiffness_covariance[at]),
        q.K1.head: float(found.k1[at]),
        q.K1.u_head: float(found.k1_std[at]),
        **pair_cells(q.CORR_K2_C, (float(found.k2[at]), float(found.c[at])), found.arm_covariance[at]),
    }


def pair_cells(correlation: Quantity, values: tuple[float, float], covariance: NDArray[np.float64]) -> dict[str, float]:
    """The two quantities of a correlation, their uncertainties, and it."""
    (one, two), (u_one, u_two, found) = correlation.pair, covariance_cells(covariance)
    cells = {one.head: values[0], two.head: values[1], one.u_head: u_one, two.u_head: u_two}
    return {**cells, correlation.head: found}


_LOOP = tuple(one.head for one in (q.DEFLECTION, q.LOAD, q.MEAN_DEFLECTION, q.MEAN_LOAD))
_SEEN = ("", " fit", " residual")
_SIGNALS = (q.TIME.head, q.RESIDUAL_TIME.head, *(f"{name}{what}" for name in SYMBOLS.values() for what in _SEEN))

STATIC = TableSpec(
    "static", "a static test at a preload in use",
    _columns(
        q.TEST, q.TYRE, q.CONSTRUCTION, q.PRESSURE, q.PRELOAD, *q.K1.heads, q.SECANT, q.CYCLE_LOSS, q.NONLINEARITY,
        q.VERDICT, q.REMARKS,
    ),
    _static_table, key=(q.TEST.head, q.PRELOAD.head), always=True,
)  # fmt: skip
DYNAMIC = TableSpec(
    "dynamic", "a dynamic test",
    _columns(
        q.TEST, q.RIG, q.TYRE, q.CONSTRUCTION, q.PRESSURE, q.PRELOAD, q.ADDED_MASS, q.TEMPERATURE, q.FREQUENCY,
        q.F1, q.V1, q.V2, q.PHASE_F1, q.PHASE_V2, q.R, q.I, q.R.u_head, q.I.u_head, q.CORR_R_I,
        q.STORAGE, q.LOSS, q.STORAGE.u_head, q.LOSS.u_head, q.CORR_K, *q.LOSS_FACTOR.heads, *q.K1.heads,
        q.K2, q.C, q.K2.u_head, q.C.u_head, q.CORR_K2_C, q.TR_MEASURED, *q.TR_PREDICTED.heads,
        *(head for one in DERIVED for head in one.heads), q.ROUTE, q.VERDICT, q.REMARKS,
    ),
    _dynamic_table, endings=(".csv", ".parquet"), always=True,
)  # fmt: skip
RIG = TableSpec(
    "rig", "a value that tests share: of the rig, a channel, an added mass",
    _columns(
        q.RIG, q.VALUE, q.UNIT, *q.STATED.heads, *q.FOUND.heads, q.POSTERIOR, q.PULL, q.DETECTION_LIMIT, q.FINDING,
        q.REMARKS,
    ),
    _rig_table, key=(q.RIG.head, q.VALUE.head),
)  # fmt: skip
RESIDUALS = TableSpec(
    "residuals", "a dynamic test that the joint route used",
    _columns(
        q.TEST, q.RIG, q.ADDED_MASS, q.FREQUENCY, q.RESIDUAL_RE, q.RESIDUAL_IM, q.RESIDUAL_RE.u_head,
        q.RESIDUAL_IM.u_head, *q.ZR.parts, q.CHI2, q.DOF, q.OUTLIER,
    ),
    _residual_table,
)  # fmt: skip
QUANTILES = TableSpec(
    "quantiles", "K2 or C of a dynamic test, where its distribution is not normal",
    _columns(q.TEST, q.QUANTITY, q.UNIT, q.LOWER, q.MEDIAN, q.UPPER, q.NON_PASSIVE),
    _quantile_table, key=(*KEY, q.QUANTITY.head),
)  # fmt: skip
BUDGET = TableSpec(
    "budget", "a source of uncertainty of a quantity of a dynamic test",
    _columns(q.TEST, q.QUANTITY, q.UNIT, q.SOURCE, q.U, q.SHARE),
    _budget_table, key=(*KEY, q.QUANTITY.head, q.SOURCE.head),
)  # fmt: skip
CHECKS = TableSpec(
    "checks", "a check of a test",
    _columns(q.TEST, q.CODE, q.CHANNEL, q.STATISTIC, q.LIMIT, q.VERDICT, q.REMEDY),
    _check_table, key=(*KEY, q.CODE.head, q.CHANNEL.head),
)  # fmt: skip
CORRECTIONS = TableSpec(
    "corrections", "what was undone at an amplitude of a dynamic test",
    _columns(
        q.TEST, q.FREQUENCY, q.CHANNEL, q.CORRECTION, q.GAIN, q.PHASE, q.GAIN.u_head, q.PHASE.u_head
    ),
    _correction_table, key=(*KEY, q.CHANNEL.head, q.CORRECTION.head), read=False,
)  # fmt: skip
PHASORS = TableSpec(
    "phasors", "complex amplitudes of a dynamic test",
    {
        **_columns(
            q.TEST, q.RIG, *q.FREQUENCY.heads, *q.F1.parts, *q.V1.parts, *q.V2.parts, q.PHASOR_COVARIANCE, q.DOF
        ),
        q.PHASOR_COVARIANCE.head: pl.Array(pl.Float64, 36),
    },
    _phasor_table, endings=(".parquet",), always=True, read=False,
)  # fmt: skip
COVARIANCE = TableSpec(
    "covariance", "K* of a dynamic test: what it has in common with others",
    {
        **_columns(*COVARIANCE_COLUMNS),
        q.OWN_COVARIANCE.head: pl.Array(pl.Float64, 4),
    },
    _covariance_table, endings=(".parquet",), always=True, read=False,
)  # fmt: skip
PREVIEWS = TableSpec(
    "previews", "a test: a few cycles of signal, fit and residual, or the static loop and its mean",
    {q.TEST.head: pl.String, **dict.fromkeys((*_LOOP, *_SIGNALS), pl.List(pl.Float32))},
    _preview_table, endings=(".parquet",), always=True,
)  # fmt: skip

#: All result tables, by name.
TABLES = {
    one.name: one
    for one in (STATIC, DYNAMIC, CHECKS, RIG, RESIDUALS, QUANTILES, BUDGET, CORRECTIONS, PHASORS, COVARIANCE, PREVIEWS)
}
STATIC_COLUMNS, DYNAMIC_COLUMNS = (tuple(one.columns) for one in (STATIC, DYNAMIC))
RIG_COLUMNS, RESIDUAL_COLUMNS, BUDGET_COLUMNS = (tuple(one.columns) for one in (RIG, RESIDUALS, BUDGET))
