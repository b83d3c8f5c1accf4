"""The results in a table that fits on a page: each condition at one frequency, or each specimen over its conditions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import atan2, cos, hypot, inf, isfinite, sin
from typing import Any

import polars as pl

from fourpole import quantities as q
from fourpole.findings.facts import Facts, Measured, averaged, natural
from fourpole.findings.finding import UNSTATED, Key
from fourpole.quantities import LOSS_ANGLE, MODULUS, Quantity
from fourpole.study.results import Results, section

#: The quantities of the table, in its order.
SUMMARISED = (q.K1, MODULUS, LOSS_ANGLE, q.STORAGE, q.LOSS, q.K2, q.C)
#: The frequency that people compare first [Hz].
USUAL_FREQUENCY = 15.0
#: Conditions that a table shows one by one; of more, each specimen has one row.
MOST_CONDITIONS = 12
#: Lowest and highest value; None where there is none.
Range = tuple[float, float] | None
#: Rows of dynamic.csv by (specimen, (pressure, preload)), then by frequency [Hz].
Conditions = dict[tuple[str, Key], dict[float, list[dict[str, Any]]]]


@dataclass(frozen=True)
class SummaryRow:
    """One condition of a specimen, or all its conditions.

    Attributes
    ----------
    specimen : str
    pressure, preload, temperature, amplitude : (float, float) or None
        Lowest and highest [Pa], [N], [degC], and of the deflection, 0-to-peak [m]; None where none is stated or known.
    frequency : (float, float)
        Lowest and highest [Hz].
    tests : tuple of str
        The tests behind the row.
    values : mapping of str to (Measured, Measured)
        The lowest and the highest value of each quantity by its key, in SI; the same twice for one condition.
    largest : mapping of str to float
        The largest standard uncertainty of each quantity by its key, in SI.
    intervals : mapping of str to (float, float)
        95 % interval of K2 or C by its key, in SI, where the value with twice its uncertainty is none; infinite without
        an upper limit.
    """

    specimen: str
    pressure: Range
    preload: Range
    temperature: Range
    amplitude: Range
    frequency: tuple[float, float]
    tests: tuple[str, ...]
    values: Mapping[str, tuple[Measured, Measured]]
    largest: Mapping[str, float]
    intervals: Mapping[str, tuple[float, float]] = field(default_factory=dict)


def summary(results: Results, *, frequency: float | None = None, most: int = MOST_CONDITIONS) -> tuple[SummaryRow, ...]:
    """A row for each condition at the tested frequency nearest to a wanted one, of those that all conditions share.

    Where they share none, each has its own nearest one. Tests of one condition and frequency are averaged; the
    uncertainty of a mean is the mean one, or that of the scatter if it is larger. Of more conditions than `most`, each
    specimen has one row at each preload with its lowest and its highest values, or one row if that is still too much.

    Parameters
    ----------
    results : Results
        Tables of an analysed campaign.
    frequency : float, optional [Hz]
        The wanted frequency; by default that which [report] of campaign.toml states, else 15 Hz.
    most : int
        Conditions that have a row each.

    Returns
    -------
    tuple of SummaryRow
        Sorted by specimen, pressure and preload; empty without a dynamic test in use.
    """
    at = conditions_of(Facts.of(results))
    if not at:
        return ()
    if frequency is None:
        frequency = wanted_frequency(results)
    shared = set.intersection(*(set(each) for each in at.values()))
    rows = []
    for (specimen, condition), tested in at.items():
        chosen = min(shared or tested, key=lambda one: (abs(one - frequency), one))
        made = _row(specimen, condition, chosen, tested[chosen])
        rows.append(replace(made, intervals=intervals_of(results, made.tests)))
    if len(rows) <= most:
        return tuple(rows)
    groups: dict[tuple[str, Range], list[SummaryRow]] = {}
    for row in rows:
        groups.setdefault((row.specimen, row.preload), []).append(row)
    if len(groups) > most:
        names = dict.fromkeys(row.specimen for row in rows)
        return tuple(_joined([row for row in rows if row.specimen == name]) for name in names)
    return tuple(map(_joined, groups.values()))


def wanted_frequency(results: Results) -> float:
    """The frequency [Hz] near which results are summarised: that of [report] in campaign.toml, else 15 Hz."""
    stated = section(results.record, "stated", "report").get(q.FREQUENCY.head)
    return float(stated) if isinstance(stated, int | float) and stated > 0 else USUAL_FREQUENCY


def conditions_of(facts: Facts) -> Conditions:
    """The dynamic tests in use by nominal condition and frequency, the conditions in order."""
    found: Conditions = {}
    for row in facts.used_dynamic:
        pressure, load, place = facts.key(row, ("pressure", "load", "frequency"))
        if place != UNSTATED:
            found.setdefault((row["tyre"], (pressure, load)), {}).setdefault(place, []).append(row)

    def rank(at: tuple[str, Key]) -> tuple[Any, ...]:
        specimen, key = at
        warm = (row.get(q.TEMPERATURE.head) for rows in found[at].values() for row in rows)
        lowest = min((value for value in warm if value is not None), default=-inf)
        return natural(facts.stated.get(specimen, specimen)), lowest, natural(specimen), key

    return {at: found[at] for at in sorted(found, key=rank)}


def mean_of(quantity: Quantity, tests: Sequence[Mapping[str, Any]]) -> Measured | None:
    """A quantity averaged over the rows of some tests; None where none of them has it."""
    found = [(*pair, str(row["test"])) for row in tests if (pair := _value(quantity, row)) is not None]
    return averaged(found) if found else None


def _row(specimen: str, condition: Key, frequency: float, tests: Sequence[Mapping[str, Any]]) -> SummaryRow:
    pressure, preload = (None if value == UNSTATED else (value, value) for value in condition)
    means = {quantity.key: mean for quantity in SUMMARISED if (mean := mean_of(quantity, tests)) is not None}
    values = {key: (mean, mean) for key, mean in means.items()}
    names = tuple(str(row["test"]) for row in tests)
    temperature, amplitude = (_middle(tests, one) for one in (q.TEMPERATURE, q.DEFLECTION_AMPLITUDE))
    stds = {key: mean.std for key, mean in means.items()}
    return SummaryRow(specimen, pressure, preload, temperature, amplitude, (frequency, frequency), names, values, stds)


def _middle(tests: Sequence[Mapping[str, Any]], quantity: Quantity) -> Range:
    """Mean of a column over some tests, twice."""
    stated = [value for row in tests if (value := row.get(quantity.head)) is not None and isfinite(value)]
    return (sum(stated) / len(stated),) * 2 if stated else None


def intervals_of(results: Results, tests: Sequence[str]) -> dict[str, tuple[float, float]]:
    """The widest of the skewed intervals that some tests have, by quantity."""
    table = results.quantiles
    if table.is_empty():
        return {}
    found: dict[str, tuple[float, float]] = {}
    for row in table.filter(pl.col(q.TEST.head).is_in(tests)).rows(named=True):
        key = {q.K2.symbol: q.K2.key, q.C.symbol: q.C.key}.get(row[q.QUANTITY.head])
        low, high = row[q.LOWER.head], row[q.UPPER.head]
        if key is not None and low is not None:
            before = found.get(key, (inf, -inf))
            found[key] = (min(before[0], low), max(before[1], inf if high is None else high))
    return found


def _value(quantity: Quantity, row: Mapping[str, Any]) -> tuple[float, float] | None:
    """Value and standard uncertainty of a row; None where it has no value."""
    if quantity in (MODULUS, LOSS_ANGLE):
        return _polar(quantity, row)
    value, std = (row.get(head) for head in quantity.heads)
    if value is None or not isfinite(value):
        return None
    return float(value), float(std) if std is not None and isfinite(std) else 0.0


def _polar(quantity: Quantity, row: Mapping[str, Any]) -> tuple[float, float] | None:
    """|K*| or the loss angle with its standard uncertainty, from real and imaginary part to first order."""
    storage, loss = _value(q.STORAGE, row), _value(q.LOSS, row)
    if storage is None or loss is None:
        return None
    (re, u_re), (im, u_im), corr = storage, loss, row.get(q.CORR_K.head) or 0.0
    size, angle = hypot(re, im), atan2(im, re)
    along, across = (cos(angle), sin(angle)), (-sin(angle), cos(angle))
    first, second = along if quantity is MODULUS else across
    variance = (first * u_re) ** 2 + (second * u_im) ** 2 + 2 * corr * first * second * u_re * u_im
    std = max(variance, 0.0) ** 0.5
    return (size, std) if quantity is MODULUS else (angle, std / size)


def _joined(rows: Sequence[SummaryRow]) -> SummaryRow:
    """One row of several conditions of a specimen."""
    values, largest = {}, {}
    for quantity in SUMMARISED:
        found = [row.values[quantity.key][0] for row in rows if quantity.key in row.values]
        if found:
            values[quantity.key] = (min(found, key=_size), max(found, key=_size))
            largest[quantity.key] = max(one.std for one in found)
    ranges = [
        (min(one[0] for one in stated), max(one[1] for one in stated)) if stated else None
        for stated in ([one for one in each if one is not None] for each in zip(*map(_axes, rows), strict=True))
    ]
    pressure, preload, temperature, amplitude, frequency = ranges
    assert frequency is not None
    tests = tuple(test for row in rows for test in row.tests)
    return SummaryRow(rows[0].specimen, pressure, preload, temperature, amplitude, frequency, tests, values, largest)


def _axes(row: SummaryRow) -> tuple[Range, ...]:
    return row.pressure, row.preload, row.temperature, row.amplitude, row.frequency


def _size(measured: Measured) -> float:
    return measured.value
