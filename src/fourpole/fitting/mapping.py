"""The operating map of one model for one tyre, and the map in words; conditions that are fitted together.

With one mass an error of V1 acts in every test as another tyre would, so the joint route cannot see it. The models can,
if they are right: `hint_of` says what one error of V1's channel would explain.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from fourpole import quantities as q
from fourpole.core.arrays import FloatArray
from fourpole.core.joint.around import Likelihood
from fourpole.core.joint.shared import SharedParameter
from fourpole.core.joint.solve import solve
from fourpole.core.sources import Kind, Source
from fourpole.errors import ModelError
from fourpole.fitting.amplitude import COLUMN
from fourpole.fitting.measured import Measured
from fourpole.fitting.modelparts import split_column
from fourpole.models.causality import check_possible
from fourpole.models.choice import fit_conditions
from fourpole.models.data import real_columns
from fourpole.models.discrepancy import with_error
from fourpole.models.families import model_named
from fourpole.models.interface import Link, Model
from fourpole.models.ladder import Verdict
from fourpole.models.operating import LINKS, OperatingMap, make_map, simplest
from fourpole.models.problem import bends, own_near
from fourpole.models.surface import Axes

#: Relative error that is added to each condition before the fits that start a map, so that none dominates.
_EVEN = 0.01
#: Largest number of conditions that are fitted for the start of a map.
_MOST_STARTS = 24


def map_axes(tyre: str, measured: Sequence[Measured], over: Sequence[str]) -> Axes:
    """The axes on which all conditions of a tyre have a value."""
    everywhere = [column for column in measured[0].state if all(column in one.state for one in measured)]
    lacking = [column for column in over if column not in everywhere]
    if lacking:
        raise ModelError(
            f"{lacking[0]} is not known of every condition of the specimen {tyre!r}: a map cannot go over it"
        )
    points = [[one.state[column] for column in everywhere] for one in measured]
    positive = all(one.state.get(COLUMN, 1.0) > 0 for one in measured)
    axes = Axes.of(everywhere, points, [COLUMN] if positive else [])
    if not axes.names and len(measured) > 1:
        raise ModelError(f"the {len(measured)} conditions of the specimen {tyre!r} have the same values on all axes")
    return axes


def map_of_model(name: str, measured: Sequence[Measured], axes: Axes, *, alone: bool) -> OperatingMap:
    """The map of one model, which starts from fits to each condition, or to some of very many.

    One of several models must have no more parameters than frequencies: it would fit the noise.
    """
    model, few = model_named(name), min(one.own.count for one in measured)
    if model.linear:
        raise ModelError(f"the terms of {name} are no smooth functions of the condition: take zener or fractional")
    if not alone and len(model.parameters) > few:
        raise ModelError(f"its {len(model.parameters)} parameters are too many for {few} frequencies")
    order = np.random.default_rng(0).permutation(len(measured))
    some = np.sort(order[:_MOST_STARTS]).tolist()
    even = [with_error(measured[at].data, _EVEN) for at in some]
    fits = fit_conditions(model, even, [known_values(measured[at], {}) for at in some])
    start = np.full((len(measured), len(model.parameters)), np.nan)
    start[some] = [one.values for one in fits]

    def made(rows: Sequence[Measured], links: Sequence[Link]) -> OperatingMap:
        return make_map(model, [one.own for one in rows], axes, start, shared_effects(rows), links=links)

    found = made(measured, LINKS)
    values = found.parameters(axes.points if axes.names else np.zeros((len(measured), 0)))
    near = near_model(measured, model, list(values))
    return found if near is measured else made(near, [found.link])


def common_likelihood(measured: Sequence[Measured]) -> Likelihood | None:
    """The likelihood of the rig on which all conditions are recorded; None if there is none, or several."""
    if any(one.recorded is None for one in measured):
        return None
    rigs = {id(one.recorded.likelihood): one.recorded.likelihood for one in measured if one.recorded is not None}
    return next(iter(rigs.values())) if len(rigs) == 1 else None


def near_model(measured: Sequence[Measured], model: Model, values: Sequence[FloatArray]) -> Sequence[Measured]:
    """The conditions linear about K* of a model with parameters for each (B, P), for one set of shared errors.

    They are returned as they are if they are not recorded on one rig, or if the shared errors are linear within the
    noise.
    """
    likelihood = common_likelihood(measured)
    if likelihood is None or not any(bends(one.own, one.shared) for one in measured):
        return measured
    recorded = [one.recorded for one in measured if one.recorded is not None]
    stiffness = [model.on(one.own).stiffness(own, one.own.omega) for one, own in zip(measured, values, strict=True)]
    places = np.concatenate([one.places for one in recorded])
    given = np.concatenate([k / one.ratio for k, one in zip(stiffness, recorded, strict=True)])
    whole = likelihood.around(places, given)
    made, at = [], 0
    for one, k in zip(measured, stiffness, strict=True):
        found = whole.part(slice(at, at := at + k.size))
        near = own_near(one.own.omega, k, found)
        own = replace(one.own, stiffness=near.stiffness, covariance=near.covariance)
        made.append(replace(one, own=own, shared=real_columns(found.relative * own.stiffness[:, None])))
    return made


def shared_effects(measured: Sequence[Measured]) -> list[FloatArray]:
    """Effect (2N, p) [N/m] of the shared errors on each condition."""
    width = max((one.shared.shape[1] for one in measured if one.shared.size), default=0)
    return [one.shared if one.shared.size else np.zeros((2 * one.own.count, width)) for one in measured]


def known_values(measured: Measured, given: Mapping[str, float]) -> dict[str, float]:
    """Values of known parameters, by symbol: those given, and the inflation pressure p of the condition."""
    pressure = measured.state.get(q.PRESSURE.head)
    return {**({"p": pressure} if pressure is not None else {}), **given}


def best_map(maps: Sequence[OperatingMap]) -> OperatingMap:
    """The simplest map by the log predictive density; that with the least u(K*) if no condition can be omitted."""
    if any(np.isfinite(one.leave_one_out.density) for one in maps):
        return simplest(maps)
    return min(maps, key=_mean_uncertainty)


def _mean_uncertainty(found: OperatingMap) -> float:
    """Mean relative uncertainty of K* over the conditions, at the middle of the band."""
    points = found.axes.points if found.axes.names else np.zeros((1, 0))
    answer = found.ask(points, np.full(len(points), float(np.sqrt(found.band[0] * found.band[1]))))
    variance = answer.covariance[:, 0, 0] + answer.covariance[:, 1, 1]
    return float(np.mean(np.sqrt(variance) / np.abs(answer.stiffness)))


def map_text(best: OperatingMap) -> str:
    """The model of a map, its surfaces and its leave-one-out error."""
    over = ", ".join(split_column(name)[0] for name in best.axes.names) or "one condition"
    many = f"at most {len(best.terms)} terms" if len(best.terms) > 1 else "one value"
    parts = [f"{best.model.name} over {over}, {many} for each parameter"]
    if len(best.terms) > 1:
        what = "stiffness and damping are" if best.link == "identity" else "the logarithms of stiffness and damping are"
        parts.append(f"{what} polynomials")
    errors = best.leave_one_out
    if np.isfinite(errors.error):
        inside = f"{100 * errors.inside:.0f} % of K' and K'' inside their 95 % intervals"
        parts.append(f"leave-one-out error {100 * errors.error:.2g} %, {inside}")
    elif len(best.axes.points) > 1:
        parts.append("linear between the conditions, which are too few for a leave-one-out error or a scatter")
    for axis in best.axes.straight:
        name = split_column(best.axes.names[axis])[0]
        parts.append(f"the uncertainty between the two tested values of {name} includes a bend")
    return "; ".join(parts) + ("" if best.model.causal else ". It is not causal")


#: Errors that are tried: the logarithm of a gain, or the phase [rad] by a delay at the highest frequency; and their
#: standard uncertainty then, which leaves the error to the tests.
_TRIED = (0.0, 0.06, -0.06, 0.12, -0.12, 0.18, -0.18, 0.24, -0.24)
_WIDE = 0.05
#: The same for an error that is one value for all conditions, as a share of the value.
_ONE_VALUE = 0.05


def channel_hint(measured: Sequence[Measured], verdicts: Sequence[Verdict]) -> str:
    """An error of V1's gain or delay with which all conditions are possible, as a sentence; empty if there is none.

    It is looked for if some condition is impossible and all conditions are from one rig with one mass.
    """
    likelihood = None if all(one.possible for one in verdicts) else common_likelihood(measured)
    if likelihood is None or likelihood.problem.shared.masses.size:
        return ""
    for kind in (Kind.GAIN, Kind.DELAY):
        value = _common_error(measured, likelihood, Source(kind, "V1"))
        if value is not None:
            size = f"{100 * np.expm1(value):+.2g} %" if kind is Kind.GAIN else f"{1e6 * value:+.0f} µs"
            return (
                f"hint: K* of all conditions would be possible with an error of {size} of the {kind.text.strip()} of "
                "V1. One mass cannot show it: weigh a mass and add it, or calibrate V1"
            )
    return ""


def _common_error(measured: Sequence[Measured], likelihood: Likelihood, source: Source) -> float | None:
    """The error, in its unit, with which every condition is possible; None if there is no such error."""
    if source not in likelihood.problem.errors:
        return None
    unit = 1.0 if source.kind is Kind.GAIN else 1.0 / float(likelihood.problem.observed.omega.max())
    for tried in _TRIED:
        near = _without_error(likelihood, source, tried * unit, _WIDE * unit)
        found = [tried * unit + moved for one in measured if (moved := _error_of(one, near)) is not None]
        if len(found) == len(measured):
            value = float(np.median(found))
            single = _without_error(likelihood, source, value, _ONE_VALUE * abs(value))
            return value if all(_error_of(one, single) is not None for one in measured) else None
    return None


def _error_of(one: Measured, likelihood: Likelihood) -> float | None:
    """The last of the shared values with which a passive tyre can have K* of a condition; None if none can."""
    assert one.recorded is not None
    recorded = replace(one.recorded, likelihood=likelihood)
    data = recorded(recorded.ratio * likelihood.stiffness[recorded.places])
    known = {"k1": one.own.k1, "k1_std": one.own.k1_std, "recorded": np.array(recorded, dtype=object)}
    verdict = check_possible(replace(data, reference=None, **known))
    if not verdict.possible:
        return None
    z = likelihood.around(recorded.places, verdict.best / recorded.ratio).z
    return float(z[-1] * likelihood.problem.shared.std[-1])


def _without_error(likelihood: Likelihood, source: Source, value: float, std: float) -> Likelihood:
    """The likelihood of the amplitudes without an error, which then is uncertain by `std`; its place is the last."""
    problem, shared, error = likelihood.problem, likelihood.problem.shared, likelihood.problem.errors.index(source)
    kept = tuple(one for one in shared.parameters if one.source != source)
    shared = replace(shared, parameters=(*kept, SharedParameter(source, "1", error, 0.0, std)))
    observed = problem.observed
    true = observed.amplitudes * np.exp(-observed.turns_of_all[:, :, error] * value)
    problem = replace(problem, observed=replace(observed, amplitudes=true), shared=shared)
    found = solve(problem, likelihood.stiffness)
    return Likelihood(problem, found.z, found.stiffness)
