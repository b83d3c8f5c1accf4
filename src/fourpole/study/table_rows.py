"""The rows of each result table, made from an analysis; `tables.py` defines the columns."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import polars as pl

from fourpole import quantities as q
from fourpole.campaign.folder import Campaign, Test
from fourpole.core.checks import Check
from fourpole.core.identify import OUTPUTS
from fourpole.core.phasor import SYMBOLS, Phasors
from fourpole.fitting.likelihood import likelihood_of, likelihood_rows
from fourpole.fitting.rows import KEY
from fourpole.quantities import DERIVED
from fourpole.study.identified import Group, Identified, budget_columns
from fourpole.study.outcome import Point, point_keys
from fourpole.study.rig_solution import residual_rows
from fourpole.study.static import StaticTest

Row = dict[str, Any]


@dataclass(frozen=True, eq=False)
class Analysed:
    """The outcome of an analysis, from which the tables are made.

    Attributes
    ----------
    campaign : Campaign
    statics : sequence of StaticTest
    tests : sequence of Test
        The dynamic tests; a test stands here once per point.
    points, checks, cells : sequences
        For each of `tests` its point of the reduction, all its checks, and its cells of dynamic.csv.
    found : mapping of int to Identified
        The identified tests by their place in `tests`.
    conditions : sequence of (str, Check)
        Checks of whole conditions, by the condition in words.
    """

    campaign: Campaign
    statics: Sequence[StaticTest]
    tests: Sequence[Test]
    points: Sequence[Point]
    checks: Sequence[Sequence[Check]]
    cells: Sequence[dict[str, Any]]
    found: Mapping[int, Identified]
    conditions: Sequence[tuple[str, Check]] = ()

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
        """Construction of the specimen as the campaign states it."""
        specimen = self.campaign.stated.all_specimens.get(test.tyre)
        return specimen.construction if specimen is not None else ""


def static_rows(analysed: Analysed) -> list[Row]:
    """Rows of static.csv, with the temperature and the campaign's own axes where a static test states them."""
    tests = [one.test for one in analysed.statics]
    axes = [axis.name for axis in analysed.campaign.stated.conditions.axes]
    axes = [name for name in axes if any(test.extra.get(name) for test in tests)]
    warm = any(test.value("temperature") is not None for test in tests)
    return [
        {
            q.TEST.head: row.test.name,
            q.TYRE.head: row.test.tyre,
            q.CONSTRUCTION.head: analysed.construction(row.test),
            q.PRESSURE.head: row.test.value("pressure"),
            q.PRELOAD.head: row.preload,
            q.K1.head: row.stiffness,
            q.K1.u_head: row.std,
            q.K1_OF.head: row.measured if np.isfinite(row.stiffness) else None,
            q.K1_LOADING.head: row.loading,
            q.K1_UNLOADING.head: row.unloading,
            q.GAP.head: row.gap,
            q.SECANT.head: row.secant,
            q.CYCLE_LOSS.head: row.loss,
            q.CYCLE_LOSS.u_head: row.loss_std,
            q.BRANCH_TIME.head: row.branch_time,
            q.CYCLE.head: row.cycle,
            q.NONLINEARITY.head: row.nonlinearity,
            q.VERDICT.head: row.verdict,
            q.REMARKS.head: "; ".join(row.remarks),
            **({q.TEMPERATURE.head: row.test.value("temperature")} if warm else {}),
            **{name: row.test.extra.get(name) for name in axes},
        }
        for one in analysed.statics
        for row in one.rows
    ]


def dynamic_rows(analysed: Analysed, taken: Collection[str]) -> list[Row]:
    """Rows of dynamic.csv: each test, its results, and further columns of tests.csv.

    A further column whose name is among those `taken` by the table gets the name "... (tests.csv)".
    """
    labels = analysed.campaign.extra_columns
    names = {label: f"{label} (tests.csv)" if label in taken else label for label in labels}
    if any(test.window is not None for test in analysed.tests):
        names[q.WINDOW.head] = q.WINDOW.head
    rows = []
    for test, key, found in zip(analysed.tests, analysed.keys, analysed.cells, strict=True):
        more = dict(test.extra)
        if test.window is not None:
            more[q.WINDOW.head] = f"{test.window[0]:g}..{test.window[1]:g}"
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
        }
        rows.append({**row, **_derived_cells(row, taken), **{name: more.get(label) for label, name in names.items()}})
    return rows


def _derived_cells(row: Row, heads: Iterable[str]) -> dict[str, float]:
    """Quantities that follow from others; a value that a row does not have counts as not-a-number."""
    known = {head: float("nan") if row.get(head) is None else row[head] for head in heads}
    derived = ((one.heads, one.from_row(known)) for one in DERIVED if one.from_row)
    return {head: cell for heads, cells in derived for head, cell in zip(heads, cells, strict=True)}


def rig_rows(analysed: Analysed) -> list[Row]:
    """Rows of rig.csv."""
    return [row for group, _ in analysed.groups if group.estimate is not None for row in group.estimate.rows]


def joint_residual_rows(analysed: Analysed) -> list[Row]:
    """Rows of residuals.csv."""
    return [
        {q.RIG.head: group.setup.rig_name, **row, **key}
        for group, keys in analysed.groups
        if group.joint is not None
        for row, key in zip(residual_rows(group.joint, group.phasors), keys, strict=True)
    ]


def budget_table(analysed: Analysed, columns: Mapping[str, Any]) -> pl.DataFrame:
    """budget.csv, made by columns because it has a row for every test, quantity and source."""
    types = {q.TEST.head: pl.String, q.POINT.head: pl.Int64, **columns}
    frames = [pl.DataFrame(schema=types)]
    for group, keys in analysed.groups:
        budget = budget_columns(group)
        made = {
            **{head: pl.Series([key[head] for key in keys], dtype=types[head]).gather(budget["test"]) for head in KEY},
            q.QUANTITY.head: pl.Series(list(OUTPUTS)).gather(budget["quantity"]),
            q.UNIT.head: pl.Series(list(OUTPUTS.values())).gather(budget["quantity"]),
            q.SOURCE.head: pl.Series([source.text for source in group.variance]).gather(budget["source"]),
        }
        frames.append(pl.DataFrame({**made, q.U.head: budget["u"], q.SHARE.head: budget["share"]}, schema=types))
    return pl.concat(frames)


def quantile_rows(analysed: Analysed) -> list[Row]:
    """Rows of quantiles.csv: intervals of K2 and C by Monte Carlo, where value ± 1.96 u is none."""
    return [
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


def check_rows(analysed: Analysed) -> list[Row]:
    """Rows of checks.csv; a check of a static test has one row, and one of a condition stands under its words."""
    statics = [
        (dict(zip(KEY, (item.test.name, 1), strict=True)), check)
        for item in analysed.statics
        for check in dict.fromkeys(check for row in item.rows for check in row.checks)
    ]
    dynamic = zip(analysed.keys, analysed.checks, strict=True)
    together = [(dict(zip(KEY, (name, 1), strict=True)), check) for name, check in analysed.conditions]
    return [
        {
            **key,
            q.CODE.head: check.code.text,
            q.CHANNEL.head: check.channel,
            q.STATISTIC.head: check.statistic,
            q.LIMIT.head: check.limit,
            q.VERDICT.head: check.verdict,
            q.REMEDY.head: check.remedy,
        }
        for key, check in [*statics, *((key, check) for key, checks in dynamic for check in checks), *together]
    ]


def correction_rows(analysed: Analysed) -> list[Row]:
    """Rows of corrections.csv: effects of the measurement chain that were removed from the amplitudes."""
    return [
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


def line_rows(analysed: Analysed) -> list[Row]:
    """Rows of lines.csv: what the averaged spectra show of each line beside its amplitudes."""
    rows = []
    for _, key, point, phasors in analysed.measured:
        if (line := point.line) is None:
            continue
        row = {
            **key,
            q.FREQUENCY.head: float(phasors.frequency),
            q.WIDTH.head: line.width,
            q.AVERAGES.head: line.averages,
        }
        row |= zip((one.head for one in q.COHERENCES), line.coherence, strict=True)
        row |= {q.CLOSURE_PHASE.head: line.closure, q.CLOSURE_PHASE.u_head: line.closure_std}
        for one, value in zip(q.ESTIMATES, line.estimates, strict=True):
            row |= zip(one.parts, (value.real, value.imag), strict=True)
        rows.append(row)
    return rows


def phasor_rows(analysed: Analysed) -> list[Row]:
    """Rows of phasors.parquet: complex amplitudes with their covariance."""
    rows = []
    for test, key, _, phasors in analysed.measured:
        row = {**key, q.RIG.head: test.rig, q.FREQUENCY.head: float(phasors.frequency)}
        row[q.FREQUENCY.u_head] = float(phasors.frequency_std)
        for one, amplitude in zip((q.F1, q.V1, q.V2), phasors.amplitudes, strict=True):
            row |= zip(one.parts, (float(amplitude.real), float(amplitude.imag)), strict=True)
        rows.append({**row, q.PHASOR_COVARIANCE.head: phasors.covariance.ravel(), q.DOF.head: float(phasors.dof)})
    return rows


def covariance_rows(analysed: Analysed) -> list[Row]:
    """Rows of covariance.parquet: the covariance of K*, as the condition's own part and the part of shared errors.

    Two tests of a rig have the covariance shared_i · shared_j, summed over the shared errors. Two tests of one
    condition have the own part of this condition in common, too.
    """
    rows = []
    for group, keys in analysed.groups:
        shared, condition = group.result.stiffness_shared, group.result.condition
        own = group.result.condition_covariance
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
    return rows


def likelihood_table_rows(analysed: Analysed) -> list[Row]:
    """Rows of likelihood.parquet: the tests of the joint route with their weights, in its order."""
    rows = []
    for group, keys in analysed.groups:
        if group.joint is not None:
            found = zip(group.joint.order.tolist(), likelihood_rows(likelihood_of(group.joint)), strict=True)
            rows += [{**keys[at], q.RIG.head: group.setup.rig_name, **row} for at, row in found]
    return rows
