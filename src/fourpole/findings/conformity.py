"""Decisions: results held against stated limits, and what a ride tells of its own validity."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from math import inf, isfinite
from typing import TYPE_CHECKING, Any

import numpy as np

from fourpole import quantities as q
from fourpole.core.arrays import FloatArray
from fourpole.core.checks import Verdict
from fourpole.core.condition import AXES, FREQUENCY
from fourpole.core.confidence import COVERAGE_FACTOR
from fourpole.core.stats import share_within
from fourpole.findings.facts import UNSTATED, Estimate, Facts, Key
from fourpole.findings.summary import conditions_of, ends_of, intervals_of, k1_of, mean_of, scatters_of
from fourpole.quantities import LOSS_ANGLE, MODULUS, Quantity
from fourpole.study.record import section
from fourpole.study.study import Study

if TYPE_CHECKING:
    from fourpole.ride.compare import RideComparison
    from fourpole.ride.contact import LoadDeflection

#: The quantities that limits may be stated for, by their keys.
LIMITED: dict[str, Quantity] = {
    quantity.key: quantity for quantity in (q.K1, MODULUS, LOSS_ANGLE, q.STORAGE, q.LOSS, q.LOSS_FACTOR, q.K2, q.C)
}
_AXES = {axis.name: axis for axis in (*AXES, FREQUENCY)}
_SETTINGS = ("pressure", "preload")


class Conformity(StrEnum):
    """The outcome for one result or for all, the worst last."""

    PASS = "pass"
    UNDECIDED = "undecided"
    FAIL = "fail"


@dataclass(frozen=True)
class Decision:
    """One result held against one limit.

    Attributes
    ----------
    limit : int
        Number of the limit in limits.toml, from 1.
    quantity : Quantity
    specimen : str
        Empty where no test has the condition of the limit.
    condition : mapping of str to float
        Pressure [Pa], preload [N], temperature [degC] and frequency [Hz] of the result, as far as they are stated.
    low, high : float or None
        The limits, in SI.
    value : Estimate or None
        The result; None where there is none.
    interval : (float, float) or None
        The coverage interval that is held against the limits: value ± U with k = 2, or the skewed 95 % interval.
    outcome : Conformity
    probability : float or None
        Probability that the true value is within the limits; None where the interval is skewed or there is no result.
    warned : tuple of str
        The tests behind the result that have a warning.
    """

    limit: int
    quantity: Quantity
    specimen: str
    condition: Mapping[str, float]
    low: float | None
    high: float | None
    value: Estimate | None
    interval: tuple[float, float] | None
    outcome: Conformity
    probability: float | None
    warned: tuple[str, ...] = ()


def judged(results: Study) -> tuple[Decision, ...]:
    """Each result to which a limit applies, held against it.

    A result passes if its whole coverage interval is within the limits, and fails if its whole interval is beyond one
    of them; in between it is undecided. This is a guard band of U at both sides of each limit. A limit without a
    frequency applies to every tested frequency, one without a specimen to every specimen.

    Parameters
    ----------
    results : Study
        Tables of an analysed campaign, whose record has the limits.

    Returns
    -------
    tuple of Judged
        In the order of limits.toml, and of specimen and condition within a limit; a limit that no result has the
        condition of is undecided.

    Notes
    -----
    Decision rule: ILAC-G8:09/2019, 4.2.3, with guard band w = U; its "conditional pass" and "conditional fail" are both
    undecided here. The default of ISO 14253-1:2017 is narrower, w = 0.83 U. Probability: JCGM 106:2012, clause 7, for a
    normal distribution about the measured value.
    """
    stated = section(results.record, "stated").get("limits")
    limits = [limit for limit in stated if isinstance(limit, dict)] if isinstance(stated, list) else []
    if not limits:
        return ()
    known = list(_known(results))
    return tuple(result for number, limit in enumerate(limits, start=1) for result in _held(number, limit, known))


def outcome_of(results: Sequence[Decision]) -> Conformity:
    """The outcome of all results together: the worst one; pass without any."""
    order = list(Conformity)
    return max((result.outcome for result in results), key=order.index, default=Conformity.PASS)


def conformity_rows(results: Sequence[Decision]) -> list[dict[str, Any]]:
    """The results held against limits as rows for programs, in SI; a value that is not there is None."""
    return [
        {
            "limit": result.limit,
            "quantity": result.quantity.column,
            "unit": result.quantity.unit,
            "specimen": result.specimen,
            **{_AXES[name].column: value for name, value in result.condition.items()},
            "low": result.low,
            "high": result.high,
            "value": result.value.value if result.value else None,
            "interval": list(result.interval) if result.interval and all(map(isfinite, result.interval)) else None,
            "outcome": result.outcome.value,
            "probability": result.probability,
            "tests with a warning": list(result.warned),
        }
        for result in results
    ]


@dataclass(frozen=True)
class _Known:
    """A result: its quantity, names of the specimen with and without its state, condition, value and skewed interval.

    `warned` are the tests behind it that have a warning.
    """

    quantity: Quantity
    names: tuple[str, str]
    condition: Mapping[str, float]
    value: Estimate
    skewed: tuple[float, float] | None
    warned: tuple[str, ...]


def _known(results: Study) -> Iterator[_Known]:
    """Every quantity of every specimen at each condition and frequency."""
    facts = Facts.of(results)
    warm = _temperatures(facts)
    warned = {str(row["test"]) for rows in facts.rows for row in rows if row["verdict"] == Verdict.WARNING}

    def known(
        quantity: Quantity, specimen: str, key: Key, value: Estimate, skewed: tuple[float, float] | None = None
    ) -> _Known:
        names = specimen, facts.stated(specimen)
        place = {name: setting for name, setting in zip(_SETTINGS, key, strict=False) if setting != UNSTATED}
        place |= {"temperature": warm[specimen]} if specimen in warm else {}
        place |= {"frequency": key[2]} if len(key) > 2 else {}
        tests = tuple(test for test in dict.fromkeys(value.tests) if test in warned)
        return _Known(quantity, names, place, value, skewed, tests)

    for specimen in facts.tyres:
        for key, value in k1_of(facts, specimen).items():
            yield known(q.K1, specimen, key, value)
    conditions = conditions_of(facts)
    scatters = scatters_of(conditions)
    for (specimen, key), tested in conditions.items():
        pooled = scatters[specimen]
        for frequency, rows in sorted(tested.items()):
            skewed = intervals_of(results, rows, pooled)
            for quantity in LIMITED.values():
                if quantity is not q.K1 and (mean := mean_of(quantity, rows, pooled)) is not None:
                    yield known(quantity, specimen, (*key, frequency), mean, skewed.get(quantity.key))


def _temperatures(facts: Facts) -> dict[str, float]:
    """Mean temperature [degC] of each specimen whose tests state it."""
    warm: dict[str, list[float]] = {}
    for row in (*facts.used_static, *facts.used_dynamic):
        value = row.get(q.TEMPERATURE.head)
        if value is not None and isfinite(value):
            warm.setdefault(row["tyre"], []).append(value)
    return {name: sum(values) / len(values) for name, values in warm.items()}


def _held(number: int, limit: Mapping[str, Any], known: Sequence[_Known]) -> Iterator[Decision]:
    """One limit against each result that it applies to."""
    quantity = LIMITED[limit["quantity"]]
    low, high = limit.get("low"), limit.get("high")
    wanted = {name: limit[name] for name in _AXES if name in limit}
    if quantity is q.K1:
        wanted.pop("frequency", None)
    name = limit.get("specimen", "")
    concerned = [
        result
        for result in known
        if result.quantity is quantity
        and name in ("", *result.names)
        and all(_AXES[axis].same(result.condition.get(axis), value) for axis, value in wanted.items())
    ]
    if not concerned:
        yield Decision(number, quantity, name, wanted, low, high, None, None, Conformity.UNDECIDED, None)
    least, most = -inf if low is None else low, inf if high is None else high
    for result in concerned:
        value, interval = result.value, result.skewed or ends_of(result.value)
        probability = None if result.skewed else share_within(value.value, value.std, least, most)
        decision = interval, _outcome(interval, least, most), probability, result.warned
        yield Decision(number, quantity, result.names[0], result.condition, low, high, value, *decision)


def _outcome(interval: tuple[float, float], low: float, high: float) -> Conformity:
    if low <= interval[0] and interval[1] <= high:
        return Conformity.PASS
    return Conformity.FAIL if interval[1] < low or interval[0] > high else Conformity.UNDECIDED


#: Share of the weighted mean square outside the tested frequencies above which a note says so [1].
_OUTSIDE = 0.05
#: Relative difference of the preload from the static load of a wheel, and of the curve's tangent from the model at
#: rest, above which a note says so [1].
_PRELOAD, _TANGENT = 0.1, 0.1
#: Standard deviations of a wheel load at which a linear ride on a spectrum pulls the wheel down.
_DEVIATIONS = 3.0
#: Time of one cycle of the lowest frequency of Wk [s].
_SHORTEST = 2.5


def is_told(difference: float, std: float) -> bool:
    """Whether a difference exceeds its expanded uncertainty, U with k = 2."""
    return abs(difference) > COVERAGE_FACTOR * std


def most_outside(rides: RideComparison, bands: Sequence[tuple[float, float]]) -> tuple[int, float] | None:
    """The tyre with the largest share of a_w² outside its tested frequencies [Hz], with this share; None if small."""
    shares = [float(ride.share_outside(*band)) for (ride, _), band in zip(rides.spectra, bands, strict=False)]
    if not shares or max(shares) <= _OUTSIDE:
        return None
    return int(np.argmax(shares)), max(shares)


def other_preloads(preloads: Sequence[float | None], loads: FloatArray) -> list[float]:
    """The preloads of tyres that are not the static load of each wheel [N], rising."""
    apart = {p for p in preloads if p and any(abs(p / load - 1) > _PRELOAD for load in loads.tolist())}
    return sorted(apart)


def other_tangents(curve: LoadDeflection, at_rest: float, loads: FloatArray) -> Iterator[tuple[float, float]]:
    """Static loads [N] at which the tangent of a curve [N/m] is not the stiffness of a model at rest; the tangents."""
    for load in loads.tolist():
        tangent = curve.tangent_at(load)
        if abs(tangent - at_rest) > _TANGENT * tangent:
            yield load, tangent


def is_pulled(rides: RideComparison, loads: FloatArray) -> bool:
    """Whether the road pulls a wheel down in a linear ride: at some sample, or at three standard deviations."""
    if rides.series:
        return any(bool(np.any(ride.load < -loads[:, None])) for ride in rides.series)
    wheels = [column for column, name in enumerate(rides.names) if name.startswith("wheel load")]
    return bool(np.any(_DEVIATIONS * rides.values[:, wheels] > loads))


def too_short(rides: RideComparison) -> float | None:
    """Duration [s] of rides in time that are shorter than a cycle of the lowest frequency of Wk; else None."""
    if not rides.series:
        return None
    duration = rides.series[0].step * rides.series[0].weighted.size
    return duration if duration < _SHORTEST else None
