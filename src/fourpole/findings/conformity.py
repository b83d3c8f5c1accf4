"""Statements of conformity: which results meet the limits of limits.toml, beyond their uncertainty."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from math import inf, isfinite
from typing import Any

import polars as pl

from fourpole import quantities as q
from fourpole.core.checks import Verdict
from fourpole.core.condition import AXES, FREQUENCY
from fourpole.core.stats import share_within
from fourpole.findings.facts import Facts, Measured
from fourpole.findings.finding import UNSTATED, Key
from fourpole.findings.summary import conditions_of, ends_of, intervals_of, k1_of, mean_of, scatters_of
from fourpole.quantities import LOSS_ANGLE, MODULUS, Quantity
from fourpole.study.record import section
from fourpole.study.study import Study

#: The quantities that limits may be stated for, by their keys.
LIMITED: dict[str, Quantity] = {
    one.key: one for one in (q.K1, MODULUS, LOSS_ANGLE, q.STORAGE, q.LOSS, q.LOSS_FACTOR, q.K2, q.C)
}
_AXES = {axis.name: axis for axis in (*AXES, FREQUENCY)}


class Conformity(StrEnum):
    """The outcome for one result or for all, the worst last."""

    PASS = "pass"
    UNDECIDED = "undecided"
    FAIL = "fail"


@dataclass(frozen=True)
class Judged:
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
    value : Measured or None
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
    value: Measured | None
    interval: tuple[float, float] | None
    outcome: Conformity
    probability: float | None
    warned: tuple[str, ...] = ()


def judged(results: Study) -> tuple[Judged, ...]:
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
    limits = [one for one in stated if isinstance(one, dict)] if isinstance(stated, list) else []
    if not limits:
        return ()
    known, warned = list(_known(results)), _warned(results)
    found = (one for at, limit in enumerate(limits, start=1) for one in _held(at, limit, known))
    return tuple(
        replace(one, warned=tuple(test for test in dict.fromkeys(one.value.tests) if test in warned))
        if one.value
        else one
        for one in found
    )


def _warned(results: Study) -> set[str]:
    """The tests that have a warning."""
    return {
        str(test)
        for table in (results.static, results.dynamic)
        for test in table.filter(pl.col(q.VERDICT.head) == Verdict.WARNING)[q.TEST.head]
    }


def outcome_of(found: Sequence[Judged]) -> Conformity:
    """The outcome of all results together: the worst one; pass without any."""
    order = list(Conformity)
    return max((one.outcome for one in found), key=order.index, default=Conformity.PASS)


def conformity_rows(found: Sequence[Judged]) -> list[dict[str, Any]]:
    """The results held against limits as rows for programs, in SI; a value that is not there is None."""
    return [
        {
            "limit": one.limit,
            "quantity": one.quantity.column,
            "unit": one.quantity.unit,
            "specimen": one.specimen,
            **{_AXES[name].column: value for name, value in one.condition.items()},
            "low": one.low,
            "high": one.high,
            "value": one.value.value if one.value else None,
            "interval": list(one.interval) if one.interval and all(map(isfinite, one.interval)) else None,
            "outcome": one.outcome.value,
            "probability": one.probability,
            "tests with a warning": list(one.warned),
        }
        for one in found
    ]


@dataclass(frozen=True)
class _Known:
    """A result: its quantity, specimen with and without its temperature, condition, value and skewed interval."""

    quantity: Quantity
    specimen: str
    stated: str
    condition: Mapping[str, float]
    value: Measured
    skewed: tuple[float, float] | None


def _known(results: Study) -> Iterator[_Known]:
    """Every quantity of every specimen at each condition and frequency."""
    facts = Facts.of(results)
    warm = _temperatures(facts)
    for specimen in facts.tyres:
        for key, value in k1_of(facts, specimen).items():
            yield _Known(q.K1, specimen, facts.stated.get(specimen, specimen), _place(key, specimen, warm), value, None)
    conditions = conditions_of(facts)
    scatters = scatters_of(conditions)
    for (specimen, key), tested in conditions.items():
        pooled = scatters[specimen]
        for frequency, rows in sorted(tested.items()):
            skewed = intervals_of(results, rows, pooled)
            place = {**_place(key, specimen, warm), "frequency": frequency}
            for one in LIMITED.values():
                if one is not q.K1 and (mean := mean_of(one, rows, pooled)) is not None:
                    yield _Known(one, specimen, facts.stated.get(specimen, specimen), place, mean, skewed.get(one.key))


def _temperatures(facts: Facts) -> dict[str, float]:
    """Mean temperature [degC] of each specimen whose tests state it."""
    found: dict[str, list[float]] = {}
    for row in (*facts.used_static, *facts.used_dynamic):
        value = row.get(q.TEMPERATURE.head)
        if value is not None and isfinite(value):
            found.setdefault(row["tyre"], []).append(value)
    return {name: sum(values) / len(values) for name, values in found.items()}


def _place(key: Key, specimen: str, warm: Mapping[str, float]) -> dict[str, float]:
    place = {name: value for name, value in zip(("pressure", "preload"), key, strict=True) if value != UNSTATED}
    return {**place, **({"temperature": warm[specimen]} if specimen in warm else {})}


def _held(at: int, limit: Mapping[str, Any], known: Sequence[_Known]) -> Iterator[Judged]:
    """One limit against each result that it applies to."""
    quantity = LIMITED[limit["quantity"]]
    low, high = limit.get("low"), limit.get("high")
    wanted = {name: limit[name] for name in _AXES if name in limit}
    if quantity is q.K1:
        wanted.pop("frequency", None)
    name = limit.get("specimen", "")
    found = [
        one
        for one in known
        if one.quantity is quantity and name in ("", one.stated, one.specimen) and _fits(one.condition, wanted)
    ]
    if not found:
        yield Judged(at, quantity, name, wanted, low, high, None, None, Conformity.UNDECIDED, None)
    for one in found:
        interval = one.skewed or ends_of(one.value)
        least, most = -inf if low is None else low, inf if high is None else high
        probability = None if one.skewed else share_within(one.value.value, one.value.std, least, most)
        outcome = _outcome(interval, least, most)
        yield Judged(at, quantity, one.specimen, one.condition, low, high, one.value, interval, outcome, probability)


def _fits(condition: Mapping[str, float], wanted: Mapping[str, float]) -> bool:
    return all(_AXES[name].same(condition.get(name), value) for name, value in wanted.items())


def _outcome(interval: tuple[float, float], low: float, high: float) -> Conformity:
    if low <= interval[0] and interval[1] <= high:
        return Conformity.PASS
    return Conformity.FAIL if interval[1] < low or interval[0] > high else Conformity.UNDECIDED
