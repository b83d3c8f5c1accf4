"""Each result table, selected from the points, the static tests and the groups of an analysis."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import polars as pl

from fourpole import quantities as q
from fourpole.campaign.folder import Campaign
from fourpole.core.alone import deflection_amplitude, deflection_std
from fourpole.core.arrays import FloatArray
from fourpole.core.checks import Asked, Check, worst_verdict
from fourpole.core.identify import OUTPUTS
from fourpole.core.joint import Joint
from fourpole.core.joint.around import Likelihood
from fourpole.core.joint.belts import Found, found_specimens
from fourpole.core.phasor import SYMBOLS
from fourpole.core.specimen import Form
from fourpole.core.tyre import energy_loss
from fourpole.fitting.likelihood import likelihood_columns
from fourpole.fitting.rows import KEY, pair_columns, tyre_columns
from fourpole.quantities import DERIVED
from fourpole.study import tables as of
from fourpole.study.identify import RigGroup, channel_uncertainty
from fourpole.study.points import Points, verdict_columns
from fourpole.study.rig_solution import residual_columns
from fourpole.study.static import StaticRow
from fourpole.words import plain_values, remark_of, said

_Columns = dict[str, Any]
#: Number of sources of a quantity that budget.csv names, and the name of all others together.
_MOST_SOURCES, _OTHERS = 10, "other sources"


def select_tables(
    campaign: Campaign,
    statics: Sequence[StaticRow],
    points: Points,
    groups: Sequence[RigGroup],
    likelihoods: Mapping[str, Likelihood],
    conditions: Sequence[tuple[str, Check]],
    route: str,
) -> dict[str, pl.DataFrame]:
    """All result tables by name.

    Parameters
    ----------
    campaign : Campaign
    statics : sequence of StaticRow
    points : Points
        The points with all columns and checks.
    groups : sequence of RigGroup
        The tests of each rig as identified together.
    likelihoods : mapping of str to Likelihood
        The tests of each rig as the joint route weighed them.
    conditions : sequence of (str, Check)
        Checks of whole conditions, by the condition in words.
    route : str
        The route of tests that are not identified.
    """
    columns = point_columns(campaign, points, groups, route)
    known = np.isfinite(points.phasors.frequency)
    lines = np.isfinite(columns.get(q.WIDTH.head, np.full(known.size, np.nan)))
    estimates = [group.estimate for group in groups if group.estimate is not None]
    joint = [(group, group.joint) for group in groups if group.joint is not None]
    made = {
        of.STATIC: of.STATIC.of_rows(_static_rows(campaign, statics)),
        of.DYNAMIC: of.DYNAMIC.frame(_dynamic_columns(campaign, points, columns)),
        of.CHECKS: of.CHECKS.frame(_check_columns(statics, points, conditions)),
        of.RIG: of.RIG.of_rows([cells for estimate in estimates for cells in estimate.rows]),
        of.SPECIMENS: of.SPECIMENS.of_rows([cells for group, _ in joint for cells in specimen_rows(points, group)]),
        of.RESIDUALS: of.RESIDUALS.of_parts(
            [
                {**_keys_of(group, range(len(group.keys))), **residual_columns(solution, group.phasors)}
                for group, solution in joint
            ]
        ),
        of.QUANTILES: of.QUANTILES.of_rows(_quantile_rows(groups)),
        of.BUDGET: of.BUDGET.of_parts([_budget(group) for group in groups]),
        of.CORRECTIONS: of.CORRECTIONS.of_rows(_correction_rows(points)),
        of.LINES: of.LINES.of_parts([{head: values[lines] for head, values in columns.items()}]),
        of.PHASORS: of.PHASORS.of_parts([{head: values[known] for head, values in columns.items()}]),
        of.COVARIANCE: of.COVARIANCE.of_parts([_covariance(group) for group in groups]),
        of.LIKELIHOOD: of.LIKELIHOOD.of_parts(
            [
                {**_keys_of(group, solution.order), **likelihood_columns(likelihoods[group.rig_name])}
                for group, solution in joint
            ]
        ),
        of.PREVIEWS: _previews(statics, points),
    }
    return {spec.name: made[spec] for spec in of.TABLES.values()}


def point_columns(campaign: Campaign, points: Points, groups: Sequence[RigGroup], route: str) -> _Columns:
    """All columns of the points by head: of the statement, the amplitudes, the spectra, the identification."""
    tests, phasors, specimens = points.tests, points.phasors, campaign.stated.all_specimens
    stated = {
        quantity.head: np.array([test.values.get(quantity.key, np.nan) for test in tests])
        for quantity in (q.PRESSURE, q.PRELOAD, q.TEMPERATURE)
    }
    f1, v1, v2 = phasors.amplitudes.T
    with np.errstate(divide="ignore", invalid="ignore"):
        phases = {q.PHASE_F1.head: np.angle(f1 / v1), q.PHASE_V2.head: np.angle(v2 / v1)}
    parts: _Columns = {}
    for quantity, amplitude in zip((q.F1, q.V1, q.V2), (f1, v1, v2), strict=True):
        parts |= {quantity.head: np.hypot(amplitude.real, amplitude.imag)}
        parts |= zip(quantity.parts, (amplitude.real, amplitude.imag), strict=True)
    texts: dict[q.Quantity, list[str]] = {
        q.TEST: [test.name for test in tests],
        q.RIG: [test.rig for test in tests],
        q.TYRE: [test.tyre for test in tests],
        q.CONSTRUCTION: [getattr(specimens.get(test.tyre), "construction", "") for test in tests],
        **verdict_columns(campaign, points),
    }
    return {
        **{quantity.head: np.array(column, dtype=object) for quantity, column in texts.items()},
        q.POINT.head: np.array([point for _, point in points.keys], int),
        **stated,
        q.ADDED_MASS.head: np.array([test.added_mass for test in tests]),
        q.FREQUENCY.head: phasors.frequency,
        q.FREQUENCY.u_head: phasors.frequency_std,
        **parts,
        **phases,
        q.PHASOR_COVARIANCE.head: phasors.covariance.reshape(-1, 36),
        q.DOF.head: phasors.dof,
        **points.columns,
        **_identified_columns(campaign, points, groups, route),
    }


def _identified_columns(campaign: Campaign, points: Points, groups: Sequence[RigGroup], route: str) -> _Columns:
    """The columns of the identification, and the amplitude of the deflection; `route` is that of other rows."""
    phasors, rigs = points.phasors, {name: rig.rig() for name, rig in campaign.stated.all_rigs.items()}
    count = len(points.tests)
    routes, input_mass, stiffness = np.full(count, route, dtype=object), np.zeros(count), np.full(count, np.nan + 0j)
    of_what, moved_std = np.full(count, "", dtype=object), np.full(count, np.nan)
    columns: _Columns = {}
    for group in groups:
        rows, result, rig = group.rows, group.result, rigs.get(group.rig_name)
        routes[rows], stiffness[rows], input_mass[rows] = group.route, result.stiffness, rig.input_mass if rig else 0.0
        moved_std[rows] = _moved_std(campaign, points, group, blocked=rig is not None and rig.blocked)
        of_what[rows] = np.where(np.isfinite(result.stiffness), group.k_of, "")
        of_group = {
            **pair_columns(q.CORR_R_I, result.mobility.real, result.mobility.imag, result.mobility_covariance),
            **tyre_columns(result),
            q.TR_MEASURED.head: result.tr_measured,
            q.TR_PREDICTED.head: result.tr_predicted,
            q.TR.u_head: result.tr_std,
        }
        for head, values in of_group.items():
            columns.setdefault(head, np.full(count, np.nan))[rows] = values
    f1, v1, v2 = phasors.amplitudes.T
    force = f1 - 1j * phasors.omega * input_mass * v1
    fixed = np.array([test.rig in rigs and rigs[test.rig].blocked for test in points.tests], dtype=bool)
    moved = deflection_amplitude(force, v1, np.where(fixed, 0.0, v2), phasors.omega, stiffness=stiffness)
    columns |= {q.ROUTE.head: routes, q.K_OF.head: of_what}
    energy, of_loss = energy_loss(stiffness, moved), columns.get(q.LOSS.u_head, np.full(count, np.nan))
    energy_std = np.hypot(np.pi * moved**2 * of_loss, 2 * energy * moved_std)
    return {
        **columns,
        q.DEFLECTION_AMPLITUDE.head: moved,
        **dict(zip(q.ENERGY.heads, (energy, energy_std), strict=True)),
    }


def _moved_std(campaign: Campaign, points: Points, group: RigGroup, *, blocked: bool) -> FloatArray:
    """Relative standard uncertainty of the deflection of a group's tests, by noise and sensors as stated.

    Where V2 is not known, that of K* is a part of it.
    """
    phasors, result = group.phasors, group.result
    channels = channel_uncertainty(
        campaign, [points.corrections[index] for index in group.rows], float(phasors.frequency.max())
    )
    seen = deflection_std(phasors.amplitudes, phasors.covariance, channels.errors(phasors.omega), blocked=blocked)
    if blocked:
        return seen
    of_k = np.sqrt(np.trace(result.stiffness_covariance, axis1=1, axis2=2) / 2) / np.abs(result.stiffness)
    return np.where(np.isnan(phasors.amplitudes[:, 2]), np.hypot(seen, of_k), seen)


def _keys_of(group: RigGroup, places: Sequence[int] | np.ndarray) -> _Columns:
    """The columns test, point and rig of some tests of a group."""
    tests, points = zip(*group.keys, strict=True) if group.keys else ((), ())
    places = np.asarray(places, int)
    return {
        q.TEST.head: np.array(tests, dtype=object)[places],
        q.POINT.head: np.array(points, int)[places],
        q.RIG.head: np.full(len(places), group.rig_name, dtype=object),
    }


def _dynamic_columns(campaign: Campaign, points: Points, columns: _Columns) -> _Columns:
    """Columns of dynamic.csv: those of the points, quantities that follow from them, and columns of tests.csv.

    A value that a row does not have counts as not-a-number. A column of tests.csv whose name a result column has gets
    the name "... (tests.csv)".
    """
    tests, taken = points.tests, of.DYNAMIC.columns
    made = {head: columns[head] for head in (*KEY, *taken) if head in columns}
    known = {head: columns.get(head, np.full(len(tests), np.nan)) for head in taken}
    for quantity in DERIVED:
        rows = ({head: values[index] for head, values in known.items()} for index in range(len(tests)))
        pairs = [quantity.from_row(cells) for cells in rows if quantity.from_row is not None]
        made |= zip(quantity.heads, np.array(pairs).reshape(len(tests), 2).T, strict=True)
    for label in campaign.extra_columns:
        made[f"{label} (tests.csv)" if label in taken else label] = [test.extra.get(label) for test in tests]
    windows = [None if test.window is None else f"{test.window[0]:g}..{test.window[1]:g}" for test in tests]
    return {**made, q.WINDOW.head: windows} if any(windows) else made


def _static_rows(campaign: Campaign, statics: Sequence[StaticRow]) -> list[_Columns]:
    """Rows of static.csv, with the temperature and the campaign's own axes where a static test states them."""
    specimens, axes = campaign.stated.all_specimens, [axis.name for axis in campaign.stated.conditions.axes]
    axes = [name for name in axes if any(static.test.extra.get(name) for static in statics)]
    warm = any(static.test.value("temperature") is not None for static in statics)
    return [
        {
            q.TEST.head: static.test.name,
            q.TYRE.head: static.test.tyre,
            q.CONSTRUCTION.head: getattr(specimens.get(static.test.tyre), "construction", ""),
            q.PRESSURE.head: static.test.value("pressure"),
            q.PRELOAD.head: static.preload,
            **static.columns,
            q.VERDICT.head: worst_verdict(check.verdict for check in static.checks),
            q.REMARKS.head: "; ".join(filter(None, map(remark_of, static.checks))),
            **({q.TEMPERATURE.head: static.test.value("temperature")} if warm else {}),
            **{name: static.test.extra.get(name) for name in axes},
        }
        for static in statics
    ]


def _check_columns(statics: Sequence[StaticRow], points: Points, conditions: Sequence[tuple[str, Check]]) -> _Columns:
    """Columns of checks.csv; a check of a static test has one row, and one of a condition stands under its words."""
    of_statics = dict.fromkeys(
        ((static.test.name, 1), check, Asked.K1) for static in statics for check in static.checks
    )
    rows_of_points = zip(points.keys, points.checks, strict=True)
    of_points = [(key, check, check.code.quantity) for key, rows in rows_of_points for check in rows]
    of_conditions = [((name, 1), check, check.code.quantity) for name, check in conditions]
    every = [*of_statics, *of_points, *of_conditions]
    checks, values = [check for _, check, _ in every], [plain_values(check) for _, check, _ in every]
    return {
        **{head: [key[place] for key, _, _ in every] for place, head in enumerate(KEY)},
        q.CODE.head: [check.code.text for check in checks],
        q.CHANNEL.head: [check.channel for check in checks],
        q.STATISTIC.head: [check.statistic for check in checks],
        q.LIMIT.head: [check.limit for check in checks],
        q.VERDICT.head: [check.verdict for check in checks],
        q.REMEDY.head: [said(check).remedy for check in checks],
        q.VALUES.head: [json.dumps(plain, ensure_ascii=False) if plain else "" for plain in values],
        q.QUANTITY.head: [quantity for _, _, quantity in every],
    }


def _correction_rows(points: Points) -> list[_Columns]:
    """Rows of corrections.csv: effects of the measurement chain that were removed from the amplitudes."""
    every = zip(points.keys, points.phasors.frequency.tolist(), points.corrections, strict=True)
    return [
        {
            **dict(zip(KEY, key, strict=True)),
            q.FREQUENCY.head: frequency,
            q.CHANNEL.head: SYMBOLS[removed.channel],
            q.CORRECTION.head: removed.name,
            q.GAIN.head: removed.gain,
            q.PHASE.head: removed.phase,
            q.GAIN.u_head: removed.gain_std,
            q.PHASE.u_head: removed.phase_std,
        }
        for key, frequency, corrections in every
        for removed in corrections
    ]


def _quantile_rows(groups: Sequence[RigGroup]) -> list[_Columns]:
    """Rows of quantiles.csv: intervals of K2 and C by Monte Carlo, where value ± 1.96 u is none."""
    return [
        {
            **dict(zip(KEY, group.keys[place], strict=True)),
            q.QUANTITY.head: quantity.column,
            q.UNIT.head: quantity.unit,
            **dict(zip((q.LOWER.head, q.MEDIAN.head, q.UPPER.head), drawn.quantiles.tolist(), strict=True)),
            q.NON_PASSIVE.head: drawn.non_passive_share,
        }
        for group in groups
        for place, pair in group.intervals.items()
        for quantity, drawn in zip((q.K2, q.C), pair, strict=True)
    ]


def _budget(group: RigGroup) -> _Columns:
    """The largest sources of uncertainty of each quantity that is known, and all others as one; none that is zero."""
    result, variance = group.result, np.stack(list(group.variance.values()))
    stiffness, arm = np.isfinite(result.stiffness), np.isfinite(result.k2)
    known = np.stack([stiffness, stiffness, stiffness, arm, arm, np.isfinite(result.tr_std)], axis=1)
    total = variance.sum(axis=0)
    variance, names = np.where(known & (total > 0), variance, 0.0), [source.text for source in group.variance]
    if len(names) > _MOST_SOURCES:
        least = np.partition(variance, -_MOST_SOURCES, axis=0)[-_MOST_SOURCES]
        largest = np.where(variance >= least, variance, 0.0)
        variance = np.concatenate([largest, [(variance - largest).sum(axis=0)]])
        names.append(_OTHERS)
    source, place, quantity = np.nonzero(variance > 0)
    of_source = variance[source, place, quantity]
    return {
        **_keys_of(group, place),
        q.QUANTITY.head: np.array(list(OUTPUTS), dtype=object)[quantity],
        q.UNIT.head: np.array(list(OUTPUTS.values()), dtype=object)[quantity],
        q.SOURCE.head: np.array(names, dtype=object)[source],
        q.U.head: np.sqrt(of_source),
        q.SHARE.head: of_source / total[place, quantity],
    }


def _covariance(group: RigGroup) -> _Columns:
    """The covariance of K*, as the condition's own part and the part of shared errors.

    Two tests of a rig have the covariance shared_i · shared_j, summed over the shared errors. Two tests of one
    condition have the own part of this condition in common, too.
    """
    result = group.result
    own = (result.condition_covariance + np.swapaxes(result.condition_covariance, 1, 2)) / 2  # round-off
    places = np.flatnonzero(np.isfinite(result.stiffness))
    return {
        **_keys_of(group, places),
        q.CONDITION.head: result.condition[places],
        q.OWN_COVARIANCE.head: own[places].reshape(-1, 4),
        q.SHARED_STORAGE.head: result.stiffness_shared[places, 0],
        q.SHARED_LOSS.head: result.stiffness_shared[places, 1],
    }


def _previews(statics: Sequence[StaticRow], points: Points) -> pl.DataFrame:
    """The table previews.parquet: the static tests with a curve, then the points of the dynamic tests.

    Signals are less their mean, in the SI unit of the quantity that each channel recorded. No number becomes a Python
    object on the way, so that the memory is that of the table.
    """
    curves = {static.test.name: static.curve for static in statics if static.curve is not None}
    loops = [(*curve.loop(), *curve.mean_curve()) for curve in curves.values()]
    shown = {key: preview for key, preview in zip(points.keys, points.previews, strict=True) if preview is not None}
    keys = [*((name, 1) for name in curves), *shown]
    arrays = {name: np.full((len(keys), room), np.nan, dtype=np.float32) for name, room in of.ROOM.items()}
    for index, (roles, preview) in enumerate(shown.values(), start=len(curves)):
        values = {q.TIME.head: preview.time, q.RESIDUAL_TIME.head: preview.blocks}
        for role, *parts in zip(roles, preview.signals, preview.fit, preview.residual, strict=True):
            values |= {f"{SYMBOLS[role]}{what}": part for what, part in zip(of.SHOWN, parts, strict=True)}
        for name, signal in values.items():
            room = min(of.ROOM[name], signal.size)
            arrays[name][index, :room] = signal[:room]
    columns: _Columns = dict(zip(KEY, zip(*keys, strict=True), strict=True)) if keys else {}
    for place, name in enumerate(of.LOOP):
        columns[name] = [*(pl.Series(loop[place].astype(np.float32)) for loop in loops), *[None] * len(shown)]
    return of.PREVIEWS.frame({**columns, **arrays})


def specimen_rows(points: Points, group: RigGroup) -> Iterator[dict[str, Any]]:
    """The rows of specimens.csv of one rig: each specimen at each condition without its frequency."""
    joint = group.joint
    assert joint is not None
    for found in found_specimens(joint.problem, joint.solution):
        place = group.rows[joint.order[found.test]]
        if points.strange[place]:  # it is alone in its condition
            continue
        test = points.tests[place]
        row = {
            q.TYRE.head: test.tyre,
            q.RIG.head: group.rig_name,
            q.PRESSURE.head: test.value("pressure"),
            q.PRELOAD.head: test.value("preload"),
            **({q.TEMPERATURE.head: warm} if (warm := test.value("temperature")) is not None else {}),
            q.FORM.head: found.specimen.form.value,
        }
        yield row if found.specimen.form is Form.MASSLESS else row | _inertia(joint, found)


def _inertia(joint: Joint, found: Found) -> dict[str, Any]:
    """The cells of a specimen with a mass."""
    specimen, belt = found.specimen, found.specimen.form is Form.BELT
    free, held = specimen.frequencies(found.stiffness)[0].tolist()
    free_std, held_std, share_std = found.stds.tolist()
    return {
        q.BELT_MASS.head: specimen.mass,
        q.BELT_MASS.u_head: found.mass_std,
        q.BELT_FREE.head: free,
        q.BELT_FREE.u_head: free_std,
        q.BELT_HELD.head: held,
        q.BELT_HELD.u_head: held_std,
        q.BELT_SHARE.head: float(np.abs(specimen.share_at(np.asarray(found.stiffness)))) if belt else None,
        q.BELT_SHARE.u_head: share_std if belt else None,
        q.BELT_EXPONENT.head: specimen.exponent if belt else None,
        q.BELT_SPREAD.head: None if belt else specimen.spread,
        q.BELT_SPREAD.u_head: None if belt else found.spread_std,
        q.BELT_EVIDENCE.head: joint.misfit.belts,
    }
