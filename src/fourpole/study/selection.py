"""Each result table, selected from the points, the static tests and the groups of an analysis."""

from __future__ import annotations

import json
from collections.abc import Callable, Collection, Iterable, Sequence
from typing import Any

import numpy as np
import polars as pl

from fourpole import quantities as q
from fourpole.campaign.folder import Campaign
from fourpole.campaign.row import Test
from fourpole.core.checks import Check, worst_verdict
from fourpole.core.deflection import deflection_amplitude
from fourpole.core.identify import OUTPUTS
from fourpole.core.phasor import SYMBOLS
from fourpole.fitting.likelihood import likelihood_columns, likelihood_of
from fourpole.fitting.rows import KEY, Key
from fourpole.quantities import DERIVED
from fourpole.study import tables as of
from fourpole.study.identify import Group
from fourpole.study.points import Points
from fourpole.study.rig_solution import residual_columns
from fourpole.study.static import StaticTest
from fourpole.words import plain_values, remark_of, said

_Columns = dict[str, Any]


def select_tables(
    campaign: Campaign,
    statics: Sequence[StaticTest],
    points: Points,
    groups: Sequence[Group],
    conditions: Sequence[tuple[str, Check]],
    route: str,
) -> dict[str, pl.DataFrame]:
    """All result tables by name.

    Parameters
    ----------
    campaign : Campaign
    statics : sequence of StaticTest
    points : Points
        The points with all columns and checks.
    groups : sequence of Group
        The tests of each rig as identified together.
    conditions : sequence of (str, Check)
        Checks of whole conditions, by the condition in words.
    route : str
        The route of tests that are not identified.
    """
    columns = point_columns(campaign, points, groups, route)
    more = _further(campaign, points.tests, taken=of.DYNAMIC.columns)
    lines = np.isfinite(columns[q.WIDTH.head]) if q.WIDTH.head in columns else np.zeros(len(points), dtype=bool)
    made = {
        of.STATIC: of.STATIC.of_rows(_static_rows(campaign, statics)),
        of.DYNAMIC: of.DYNAMIC.frame({**_some(columns, of.DYNAMIC), **_derived(columns, len(points)), **more}),
        of.CHECKS: of.CHECKS.of_rows(_check_rows(statics, points, conditions)),
        of.RIG: of.RIG.of_rows([row for group in groups if group.estimate is not None for row in group.estimate.rows]),
        of.RESIDUALS: _of_groups(of.RESIDUALS, groups, _residuals),
        of.QUANTILES: of.QUANTILES.of_rows(_quantile_rows(groups)),
        of.BUDGET: _of_groups(of.BUDGET, groups, _budget),
        of.CORRECTIONS: of.CORRECTIONS.of_rows(_correction_rows(points)),
        of.LINES: of.LINES.frame(_some(columns, of.LINES, lines)),
        of.PHASORS: of.PHASORS.frame(_some(columns, of.PHASORS, points.known)),
        of.COVARIANCE: _of_groups(of.COVARIANCE, groups, _covariance),
        of.LIKELIHOOD: _of_groups(of.LIKELIHOOD, groups, _likelihood),
        of.PREVIEWS: _previews(statics, points),
    }
    return {spec.name: made[spec] for spec in of.TABLES.values()}


def point_columns(campaign: Campaign, points: Points, groups: Sequence[Group], route: str) -> _Columns:
    """All columns of the points by head: of the statement, the amplitudes, the spectra, the identification."""
    tests, phasors = points.tests, points.phasors
    routes, input_mass = np.full(len(points), route, dtype=object), np.zeros(len(points))
    stiffness = np.full(len(points), complex(np.nan))
    for group in groups:
        routes[group.rows], stiffness[group.rows] = group.route, group.result.stiffness
        input_mass[group.rows] = group.setup.rig.input_mass if group.setup.rig is not None else 0.0
    stated = {
        quantity.head: np.array([test.values.get(quantity.key, np.nan) for test in tests])
        for quantity in (q.PRESSURE, q.PRELOAD, q.TEMPERATURE)
    }
    f1, v1, v2 = phasors.amplitudes.T
    blocked = {name for name, rig in campaign.stated.all_rigs.items() if rig.output == "blocked"}
    force = f1 - 1j * phasors.omega * input_mass * v1
    sides = zip(force, v1, v2, phasors.omega, stiffness, [test.rig in blocked for test in tests], strict=True)
    deflection = [deflection_amplitude(*of_row, stiffness=k, blocked=fixed) for *of_row, k, fixed in sides]
    with np.errstate(divide="ignore", invalid="ignore"):
        phases = {q.PHASE_F1.head: np.angle(f1 / v1), q.PHASE_V2.head: np.angle(v2 / v1)}
    parts: _Columns = {}
    for quantity, amplitude in zip((q.F1, q.V1, q.V2), (f1, v1, v2), strict=True):
        parts |= {quantity.head: np.hypot(amplitude.real, amplitude.imag)}
        parts |= zip(quantity.parts, (amplitude.real, amplitude.imag), strict=True)
    return {
        **_key_columns(points.keys),
        q.RIG.head: _texts(test.rig for test in tests),
        q.TYRE.head: _texts(test.tyre for test in tests),
        q.CONSTRUCTION.head: _texts(_construction(campaign, test) for test in tests),
        **stated,
        q.ADDED_MASS.head: np.array([test.added_mass for test in tests]),
        q.FREQUENCY.head: phasors.frequency,
        q.FREQUENCY.u_head: phasors.frequency_std,
        **parts,
        **phases,
        q.DEFLECTION_AMPLITUDE.head: np.array(deflection, dtype=float),
        q.PHASOR_COVARIANCE.head: phasors.covariance.reshape(-1, 36),
        q.DOF.head: phasors.dof,
        **points.columns,
        q.ROUTE.head: routes,
        q.VERDICT.head: _texts(worst_verdict(check.verdict for check in rows) for rows in points.checks),
        q.REMARKS.head: _texts(_remarks(rows) for rows in points.checks),
    }


def _texts(texts: Iterable[str]) -> np.ndarray:
    """A column of texts."""
    return np.array([*texts, None], dtype=object)[:-1]


def _remarks(checks: Iterable[Check]) -> str:
    """The sentences of some checks."""
    return "; ".join(remark for check in checks if (remark := remark_of(check)))


def _construction(campaign: Campaign, test: Test) -> str:
    """Construction of the specimen as the campaign states it."""
    specimen = campaign.stated.all_specimens.get(test.tyre)
    return specimen.construction if specimen is not None else ""


def _key_columns(keys: Sequence[Key]) -> _Columns:
    """The columns test and point."""
    return dict(zip(KEY, (_texts(test for test, _ in keys), np.array([point for _, point in keys], int)), strict=True))


def _some(columns: _Columns, spec: of.TableSpec, rows: Any = slice(None)) -> _Columns:
    """The columns of a table among all columns of the points, for some rows."""
    return {head: columns[head][rows] for head in (*KEY, *spec.columns) if head in columns}


def _derived(columns: _Columns, count: int) -> _Columns:
    """Quantities that follow from others of their row; a value that a row does not have counts as not-a-number."""
    known = {head: columns.get(head, np.full(count, np.nan)) for head in of.DYNAMIC.columns} if DERIVED else {}
    rows = [{head: values[row] for head, values in known.items()} for row in range(count)]
    derived: _Columns = {}
    for quantity in DERIVED:
        cells = [quantity.from_row(row) for row in rows if quantity.from_row is not None]
        derived |= zip(quantity.heads, np.array(cells).reshape(count, 2).T, strict=True)
    return derived


def _further(campaign: Campaign, tests: Sequence[Test], taken: Collection[str]) -> _Columns:
    """Columns of tests.csv that pass through; one whose name a result column has gets the name "... (tests.csv)"."""
    more = {
        f"{label} (tests.csv)" if label in taken else label: [test.extra.get(label) for test in tests]
        for label in campaign.extra_columns
    }
    windows = [None if test.window is None else f"{test.window[0]:g}..{test.window[1]:g}" for test in tests]
    return {**more, q.WINDOW.head: windows} if any(windows) else more


def _static_rows(campaign: Campaign, statics: Sequence[StaticTest]) -> list[_Columns]:
    """Rows of static.csv, with the temperature and the campaign's own axes where a static test states them."""
    tests = [static.test for static in statics]
    axes = [axis.name for axis in campaign.stated.conditions.axes]
    axes = [name for name in axes if any(test.extra.get(name) for test in tests)]
    warm = any(test.value("temperature") is not None for test in tests)
    return [
        {
            q.TEST.head: row.test.name,
            q.TYRE.head: row.test.tyre,
            q.CONSTRUCTION.head: _construction(campaign, row.test),
            q.PRESSURE.head: row.test.value("pressure"),
            q.PRELOAD.head: row.preload,
            **row.columns,
            q.VERDICT.head: row.verdict,
            q.REMARKS.head: _remarks(row.checks),
            **({q.TEMPERATURE.head: row.test.value("temperature")} if warm else {}),
            **{name: row.test.extra.get(name) for name in axes},
        }
        for static in statics
        for row in static.rows
    ]


def _check_rows(
    statics: Sequence[StaticTest], points: Points, conditions: Sequence[tuple[str, Check]]
) -> list[_Columns]:
    """Rows of checks.csv; a check of a static test has one row, and one of a condition stands under its words."""
    of_statics = [
        ((static.test.name, 1), check)
        for static in statics
        for check in dict.fromkeys(check for row in static.rows for check in row.checks)
    ]
    of_points = [(key, check) for key, rows in zip(points.keys, points.checks, strict=True) for check in rows]
    of_conditions = [((name, 1), check) for name, check in conditions]
    return [
        {
            **dict(zip(KEY, key, strict=True)),
            q.CODE.head: check.code.text,
            q.CHANNEL.head: check.channel,
            q.STATISTIC.head: check.statistic,
            q.LIMIT.head: check.limit,
            q.VERDICT.head: check.verdict,
            q.REMEDY.head: said(check).remedy,
            q.VALUES.head: json.dumps(plain, ensure_ascii=False) if (plain := plain_values(check)) else "",
        }
        for key, check in (*of_statics, *of_points, *of_conditions)
    ]


def _correction_rows(points: Points) -> list[_Columns]:
    """Rows of corrections.csv: effects of the measurement chain that were removed from the amplitudes."""
    every = zip(points.keys, points.phasors.frequency.tolist(), points.corrections, strict=True)
    return [
        {
            **dict(zip(KEY, key, strict=True)),
            q.FREQUENCY.head: frequency,
            q.CHANNEL.head: SYMBOLS[row.channel],
            q.CORRECTION.head: row.name,
            q.GAIN.head: row.gain,
            q.PHASE.head: row.phase,
            q.GAIN.u_head: row.gain_std,
            q.PHASE.u_head: row.phase_std,
        }
        for key, frequency, corrections in every
        for row in corrections
    ]


def _quantile_rows(groups: Sequence[Group]) -> list[_Columns]:
    """Rows of quantiles.csv: intervals of K2 and C by Monte Carlo, where value ± 1.96 u is none."""
    return [
        {
            **dict(zip(KEY, group.keys[at], strict=True)),
            q.QUANTITY.head: quantity.column,
            q.UNIT.head: quantity.unit,
            **dict(zip((q.LOWER.head, q.MEDIAN.head, q.UPPER.head), drawn.quantiles.tolist(), strict=True)),
            q.NON_PASSIVE.head: drawn.non_passive_share,
        }
        for group in groups
        for at, pair in group.intervals.items()
        for quantity, drawn in zip((q.K2, q.C), pair, strict=True)
    ]


def _of_groups(
    spec: of.TableSpec, groups: Sequence[Group], make: Callable[[Group], tuple[np.ndarray, _Columns]]
) -> pl.DataFrame:
    """A table with rows of each group, from a function that gives places in the group and columns."""
    parts = []
    for group in groups:
        places, columns = make(group)
        keys = _key_columns(group.keys)
        of_group = {**{head: keys[head][places] for head in KEY}, q.RIG.head: _texts([group.rig_name] * len(places))}
        parts.append(
            {head: values for head, values in {**of_group, **columns}.items() if head in (*KEY, *spec.columns)}
        )
    return spec.frame({head: _joined([part[head] for part in parts]) for head in (parts[0] if parts else ())})


def _joined(columns: Sequence[Any]) -> Any:
    """Parts of a column, one after the other; arrays of unequal rows become a list."""
    if len(columns) == 1:
        return columns[0]
    if len({np.shape(column)[1:] for column in columns}) == 1:
        return np.concatenate(columns)
    return [value for column in columns for value in column]


def _residuals(group: Group) -> tuple[np.ndarray, _Columns]:
    """The tests that the joint route used."""
    if group.joint is None:
        return np.arange(0), dict.fromkeys(of.RESIDUALS.columns, np.zeros(0))
    return np.arange(len(group.keys)), residual_columns(group.joint, group.phasors)


def _likelihood(group: Group) -> tuple[np.ndarray, _Columns]:
    """The tests of the joint route with their weights, in its order."""
    if group.joint is None:
        return np.arange(0), dict.fromkeys(of.LIKELIHOOD.columns, np.zeros(0))
    return group.joint.order, likelihood_columns(likelihood_of(group.joint))


def _budget(group: Group) -> tuple[np.ndarray, _Columns]:
    """The sources of uncertainty of each quantity that is known, but for those that are zero."""
    result, variance = group.result, np.stack(list(group.variance.values()))
    stiffness, arm = np.isfinite(result.stiffness), np.isfinite(result.k2)
    known = np.stack([stiffness, stiffness, stiffness, arm, arm, np.isfinite(result.tr_std)], axis=1)
    total = variance.sum(axis=0)
    source, place, quantity = np.nonzero(known & (variance > 0) & (total > 0))
    of_source = variance[source, place, quantity]
    return place, {
        q.QUANTITY.head: _texts(OUTPUTS)[quantity],
        q.UNIT.head: _texts(OUTPUTS.values())[quantity],
        q.SOURCE.head: _texts(of_name.text for of_name in group.variance)[source],
        q.U.head: np.sqrt(of_source),
        q.SHARE.head: of_source / total[place, quantity],
    }


def _covariance(group: Group) -> tuple[np.ndarray, _Columns]:
    """The covariance of K*, as the condition's own part and the part of shared errors.

    Two tests of a rig have the covariance shared_i · shared_j, summed over the shared errors. Two tests of one
    condition have the own part of this condition in common, too.
    """
    result = group.result
    own = (result.condition_covariance + np.swapaxes(result.condition_covariance, 1, 2)) / 2  # round-off
    places = np.flatnonzero(np.isfinite(result.stiffness))
    return places, {
        q.CONDITION.head: result.condition[places],
        q.OWN_COVARIANCE.head: own[places].reshape(-1, 4),
        q.SHARED_STORAGE.head: result.stiffness_shared[places, 0],
        q.SHARED_LOSS.head: result.stiffness_shared[places, 1],
    }


def _previews(statics: Sequence[StaticTest], points: Points) -> pl.DataFrame:
    """The table previews.parquet: the static tests with a curve, then the points of the dynamic tests.

    Signals are less their mean, in the SI unit of the quantity that each channel recorded. No number becomes a Python
    object on the way, so that the memory is that of the table.
    """
    curves = [(static.test.name, static.curve) for static in statics if static.curve is not None]
    shown = [(key, preview) for key, preview in zip(points.keys, points.previews, strict=True) if preview is not None]
    count = len(curves) + len(shown)
    arrays = {name: np.full((count, room), np.nan, dtype=np.float32) for name, room in of.ROOM.items()}
    for at, (_, (roles, preview)) in enumerate(shown, start=len(curves)):
        values = {q.TIME.head: preview.time, q.RESIDUAL_TIME.head: preview.blocks}
        for role, *parts in zip(roles, preview.signals, preview.fit, preview.residual, strict=True):
            values |= {f"{SYMBOLS[role]}{what}": part for what, part in zip(of.SHOWN, parts, strict=True)}
        for name, signal in values.items():
            room = min(of.ROOM[name], signal.size)
            arrays[name][at, :room] = signal[:room]
    loops = [(*curve.loop(), *curve.mean_curve()) for _, curve in curves]
    keys = [*((name, 1) for name, _ in curves), *(key for key, _ in shown)]
    lists = {name: [pl.Series(loop[place].astype(np.float32)) for loop in loops] for place, name in enumerate(of.LOOP)}
    blank = [None] * len(shown)
    return of.PREVIEWS.frame(
        {**_key_columns(keys), **{name: [*held, *blank] for name, held in lists.items()}, **arrays}
    )
