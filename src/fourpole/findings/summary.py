"""The results in a table that fits on a page: each condition at one frequency, or each specimen over its conditions."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import hypot, inf, isfinite, nan, sqrt
from operator import attrgetter
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy

from fourpole import quantities as q
from fourpole.core.arrays import FloatArray
from fourpole.core.confidence import COVERAGE_FACTOR
from fourpole.core.polar import value_of
from fourpole.findings.facts import UNSTATED, Estimate, Facts, Key, known, natural
from fourpole.fitting.rows import key_of
from fourpole.quantities import LOSS_ANGLE, MODULUS, Quantity
from fourpole.study.record import section
from fourpole.study.study import Study

if TYPE_CHECKING:
    from fourpole.fitting.modelfile import ModelEntry

#: The quantities of the table, in its order.
SUMMARISED = (q.K1, MODULUS, LOSS_ANGLE, q.STORAGE, q.LOSS, q.K2, q.C)
#: The frequency that people compare first [Hz].
USUAL_FREQUENCY = 15.0
#: Conditions that a table shows one by one; of more, each specimen has one row.
MOST_CONDITIONS = 12
#: Scatter of repeats, and departure of a model from the data, that matter, as shares of |K*|.
POOR = 0.01
#: Probability below value + 2 u of a normal distribution.
_BELOW_TWO = 0.97725
#: The attributes of a row that are ranges.
_RANGES = ("pressure", "preload", "temperature", "amplitude", "frequency")
#: Lowest and highest value; None where there is none.
Range = tuple[float, float] | None
#: Rows of dynamic.csv by (specimen, (pressure, preload)), then by frequency [Hz].
Conditions = dict[tuple[str, Key], dict[float, list[dict[str, Any]]]]


@dataclass(frozen=True)
class Repeats:
    """How far repeats of one quantity of a specimen scatter: relative standard deviation [1], degrees of freedom."""

    relative: float = 0.0
    dof: int = 0


@dataclass(frozen=True)
class SummaryRow:
    """One condition of a specimen, or all its conditions.

    Attributes
    ----------
    specimen : str
    pressure, preload, temperature, amplitude : (float, float) or None
        Lowest and highest [Pa], [N], [degC], and of the deflection, 0-to-peak [m]; None where none is stated or known.
    frequency : (float, float) or None
        Lowest and highest [Hz]; None of static tests alone.
    tests : tuple of str
        The tests behind the row.
    values : mapping of str to (Measured, Measured)
        The lowest and the highest value of each quantity by its key, in SI; the same twice for one condition.
    largest : mapping of str to float
        The largest standard uncertainty of each quantity by its key, in SI.
    intervals : mapping of str to (float, float)
        95 % interval of K2 or C by its key, in SI, where the value with twice its uncertainty is none; infinite without
        an upper limit. Of several conditions, the lowest and the highest end of all of them.
    scatter, single : float [1]
        Relative standard deviation of |K*| of repeats, the largest one, 0 without repeats; relative standard
        uncertainty of |K*| of one of them.
    """

    specimen: str
    pressure: Range
    preload: Range
    temperature: Range
    amplitude: Range
    frequency: Range
    tests: tuple[str, ...]
    values: Mapping[str, tuple[Estimate, Estimate]]
    largest: Mapping[str, float]
    intervals: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    scatter: float = 0.0
    single: float = 0.0

    @property
    def scatters(self) -> bool:
        """Whether repeats scatter more than their uncertainties explain, and enough to matter."""
        return self.scatter >= POOR and self.scatter > 2.0 * self.single

    @property
    def at(self) -> float:
        """The lowest frequency [Hz]; not-a-number of static tests alone."""
        return self.frequency[0] if self.frequency else nan


def summary(
    results: Study, *, frequency: float | None = None, most: int | None = MOST_CONDITIONS
) -> tuple[SummaryRow, ...]:
    """A row for each condition at the tested frequency nearest to a wanted one, of those that all conditions share.

    Where they share none, each has its own nearest one. Tests of one condition and frequency are averaged, with the
    uncertainty of `mean_of_repeats`. More conditions than `most` are joined, see `bounded`.

    Parameters
    ----------
    results : Study
        Tables of an analysed campaign.
    frequency : float, optional [Hz]
        The wanted frequency; by default that which [report] of campaign.toml states, else 15 Hz.
    most : int or None
        Conditions that have a row each; None for all.

    Returns
    -------
    tuple of SummaryRow
        Sorted by specimen, pressure and preload. Without a dynamic test in use, K1 of the static ones.
    """
    facts = Facts.of(results)
    conditions = conditions_of(facts)
    if not conditions:
        return bounded(_static_rows(facts), most)
    wanted = wanted_frequency(results) if frequency is None else frequency
    shared = set.intersection(*map(set, conditions.values()))
    rows, scatters = [], scatters_of(conditions)
    for (specimen, condition), tested in conditions.items():
        chosen = min(shared or tested, key=lambda f: (abs(f - wanted), f))
        row = _row(specimen, condition, chosen, tested[chosen], scatters[specimen])
        rows.append(replace(row, intervals=intervals_of(results, tested[chosen], scatters[specimen])))
    return bounded(rows, most)


def _static_rows(facts: Facts) -> list[SummaryRow]:
    """K1 of each specimen, pressure and preload, where there is no dynamic test in use."""
    rows = []
    for specimen in facts.tyres:
        for (pressure, preload), k1 in k1_of(facts, specimen).items():
            tests = [row for row in facts.used_static if row["test"] in k1.tests]
            where = _twice(pressure), _twice(preload), _middle(tests, q.TEMPERATURE), None, None
            rows.append(SummaryRow(specimen, *where, k1.tests, {q.K1.key: (k1, k1)}, {q.K1.key: k1.std}))
    return rows


def bounded(rows: Sequence[SummaryRow], most: int | None) -> tuple[SummaryRow, ...]:
    """The rows of a summary, or if they are more than `most` one for each specimen and preload, or else specimen.

    A row of several conditions has the lowest and the highest of their values.
    """
    if most is None or len(rows) <= most:
        return tuple(rows)
    groups: dict[tuple[str, Range], list[SummaryRow]] = {}
    for row in rows:
        groups.setdefault((row.specimen, row.preload), []).append(row)
    if len(groups) > most:
        names = dict.fromkeys(row.specimen for row in rows)
        return tuple(_joined([row for row in rows if row.specimen == name]) for name in names)
    return tuple(map(_joined, groups.values()))


def departing(results: Study) -> list[ModelEntry]:
    """The models that depart from the data by so much that they are not to be trusted."""
    return [one for one in (results.models.models if results.models else ()) if one.discrepancy >= POOR]


def wanted_frequency(results: Study) -> float:
    """The frequency [Hz] near which results are summarised: that of [report] in campaign.toml, else 15 Hz."""
    stated = section(results.record, "stated", "report").get(q.FREQUENCY.head)
    return float(stated) if isinstance(stated, int | float) and stated > 0 else USUAL_FREQUENCY


def conditions_of(facts: Facts) -> Conditions:
    """The dynamic tests in use by nominal condition and frequency, the conditions in order."""
    conditions: Conditions = {}
    for row in facts.used_dynamic:
        pressure, load, frequency = facts.key(row, ("pressure", "load", "frequency"))
        if frequency != UNSTATED:
            conditions.setdefault((row["tyre"], (pressure, load)), {}).setdefault(frequency, []).append(row)

    def rank(condition: tuple[str, Key]) -> tuple[Any, ...]:
        specimen, key = condition
        warm = (row.get(q.TEMPERATURE.head) for rows in conditions[condition].values() for row in rows)
        lowest = min((value for value in warm if value is not None), default=-inf)
        return natural(facts.stated(specimen)), lowest, natural(specimen), key

    return {condition: conditions[condition] for condition in sorted(conditions, key=rank)}


def mean_of(
    quantity: Quantity, tests: Sequence[Mapping[str, Any]], pooled: Mapping[str, Repeats] | None = None
) -> Estimate | None:
    """A quantity averaged over the rows of some tests; None where none of them has it. `pooled` as of `scatters_of`."""
    repeats = [(*pair, str(row["test"])) for row in tests if (pair := value_of(quantity, row)) is not None]
    return mean_of_repeats(repeats, (pooled or {}).get(quantity.key)) if repeats else None


def scatters_of(conditions: Conditions) -> dict[str, dict[str, Repeats]]:
    """The scatter of repeats of each specimen, pooled over its conditions, by the key of the quantity."""
    groups: dict[str, list[list[dict[str, Any]]]] = {}
    for (specimen, _), tested in conditions.items():
        groups.setdefault(specimen, []).extend(rows for rows in tested.values() if len(rows) > 1)
    return {
        specimen: {
            quantity.key: scatter_in(
                [[pair[0] for row in rows if (pair := value_of(quantity, row))] for rows in repeats]
            )
            for quantity in (*SUMMARISED, q.LOSS_FACTOR)
        }
        for specimen, repeats in groups.items()
    }


def k1_of(facts: Facts, specimen: str) -> dict[Key, Estimate]:
    """K1 of a specimen by nominal pressure and preload: of its static tests, else as its dynamic tests state it."""
    for rows in (facts.used_static, facts.used_dynamic):
        groups: dict[Key, list[tuple[float, float, str]]] = {}
        for row in rows:
            if row["tyre"] == specimen and (k1 := known(row, q.K1)):
                groups.setdefault(facts.key(row, q.K1.over), []).append((*k1, str(row["test"])))
        if groups:
            return {key: mean_of_repeats(groups[key]) for key in sorted(groups)}
    return {}


def _row(
    specimen: str, condition: Key, frequency: float, tests: Sequence[Mapping[str, Any]], pooled: Mapping[str, Repeats]
) -> SummaryRow:
    pressure, preload = map(_twice, condition)
    means = {quantity.key: mean for quantity in SUMMARISED if (mean := mean_of(quantity, tests, pooled)) is not None}
    values = {key: (mean, mean) for key, mean in means.items()}
    names = tuple(str(row["test"]) for row in tests)
    temperature, amplitude = (_middle(tests, quantity) for quantity in (q.TEMPERATURE, q.DEFLECTION_AMPLITUDE))
    where = pressure, preload, temperature, amplitude, (frequency, frequency)
    stds = {key: mean.std for key, mean in means.items()}
    scatter, single = _scatter(tests)
    return SummaryRow(specimen, *where, names, values, stds, scatter=scatter, single=single)


def _twice(value: float) -> Range:
    """A nominal value as a range; None if it is not stated."""
    return None if value == UNSTATED else (value, value)


def _scatter(tests: Sequence[Mapping[str, Any]]) -> tuple[float, float]:
    """Relative standard deviation of |K*| of repeats, 0 for one; relative standard uncertainty of one of them."""
    known = np.array([pair for row in tests if (pair := value_of(MODULUS, row)) is not None])
    if len(known) < 2:
        return 0.0, 0.0
    size, std = known.mean(axis=0)
    return float(known[:, 0].std(ddof=1) / size), float(std / size)


def _middle(tests: Sequence[Mapping[str, Any]], quantity: Quantity) -> Range:
    """Mean of a column over some tests, twice."""
    stated = [value for row in tests if (value := row.get(quantity.head)) is not None and isfinite(value)]
    return (sum(stated) / len(stated),) * 2 if stated else None


def intervals_of(
    results: Study, rows: Sequence[Mapping[str, Any]], pooled: Mapping[str, Repeats] | None = None
) -> dict[str, tuple[float, float]]:
    """The 95 % intervals of K2 and C over the repeats in some rows, where that of one of them is skewed.

    About the mean it reaches as far as those of the repeats do on average, and their scatter is added in squares.
    """
    skewed, intervals = skewed_intervals(results), {}
    for quantity in (q.K2, q.C):
        ends = [skewed.get((key_of(row), quantity.symbol)) for row in rows]
        values = [value_of(quantity, row) for row in rows]
        repeats = [(value, end) for value, end in zip(values, ends, strict=True) if value]
        if repeats and any(ends):
            intervals[quantity.key] = _about_mean(repeats, (pooled or {}).get(quantity.key))
    return intervals


def skewed_intervals(results: Study) -> dict[tuple[Any, str], tuple[float, float | None]]:
    """The ends of the intervals in quantiles.csv by point and symbol of the quantity; read once for some results."""
    if "skewed" not in results.derived:
        results.derived["skewed"] = {
            (key_of(row), row[q.QUANTITY.head]): (row[q.LOWER.head], row[q.UPPER.head])
            for row in results.quantiles.rows(named=True)
            if row[q.LOWER.head] is not None
        }
    skewed: dict[tuple[Any, str], tuple[float, float | None]] = results.derived["skewed"]
    return skewed


def _about_mean(
    repeats: Sequence[tuple[tuple[float, float], tuple[float, float | None] | None]], pooled: Repeats | None
) -> tuple[float, float]:
    """The interval about the mean of repeats, each a value with its uncertainty, and its interval if it is skewed."""
    ((_, only), *others) = repeats
    if only is not None and not others:
        return only[0], inf if only[1] is None else only[1]
    values = np.array([value for (value, _), _ in repeats])
    mean, scatter = float(values.mean()), reach_of_scatter(values, pooled)
    ends = [end or (value - COVERAGE_FACTOR * std, value + COVERAGE_FACTOR * std) for (value, std), end in repeats]
    below = float(np.mean([value - low for value, (low, _) in zip(values, ends, strict=True)]))
    above = float(
        np.mean([inf if high is None else high - value for value, (_, high) in zip(values, ends, strict=True)])
    )
    return mean - hypot(max(below, 0.0), scatter), mean + hypot(max(above, 0.0), scatter)


def _joined(rows: Sequence[SummaryRow]) -> SummaryRow:
    """One row of several conditions of a specimen."""
    values, largest, intervals = {}, {}, {}
    for key in (quantity.key for quantity in SUMMARISED):
        measured = [row.values[key][0] for row in rows if key in row.values]
        if measured:
            values[key] = (min(measured, key=_size), max(measured, key=_size))
            largest[key] = max(value.std for value in measured)
        if (interval := _interval(rows, key)) is not None:
            intervals[key] = interval
    pressure, preload, temperature, amplitude, frequency = (_whole(map(attrgetter(name), rows)) for name in _RANGES)
    where = pressure, preload, temperature, amplitude, frequency
    tests = tuple(test for row in rows for test in row.tests)
    worst = max(rows, key=lambda row: row.scatter)
    return SummaryRow(rows[0].specimen, *where, tests, values, largest, intervals, worst.scatter, worst.single)


def _interval(rows: Sequence[SummaryRow], key: str) -> Range:
    """The ends of the intervals of a quantity over some rows; None unless one of them is skewed."""
    if not any(key in row.intervals for row in rows):
        return None
    return _whole(row.intervals.get(key) or ends_of(row.values[key][0]) for row in rows if key in row.values)


def _whole(ranges: Iterable[Range]) -> Range:
    """The range over some ranges; None if all of them are."""
    ends = [end for stated in ranges if stated is not None for end in stated]
    return (min(ends), max(ends)) if ends else None


def ends_of(measured: Estimate) -> tuple[float, float]:
    """Value ± U, with k = 2."""
    return measured.value - COVERAGE_FACTOR * measured.std, measured.value + COVERAGE_FACTOR * measured.std


def _size(measured: Estimate) -> float:
    return measured.value


# ---- repeats


def scatter_in(groups: Iterable[Sequence[float]]) -> Repeats:
    r"""The scatter of repeats within groups, pooled over the groups.

    .. math:: s^2 = \sum_i (n_i - 1) (s_i/\bar x_i)^2 / \sum_i (n_i - 1)

    Source: JCGM 100:2008, 4.2.4, here of relative standard deviations.

    >>> scatter_in([[1.0, 1.2], [2.0], [3.0, 3.6]]).dof
    2
    """
    squares, dof = 0.0, 0
    for values in (np.asarray(group) for group in groups if len(group) > 1):
        if mean := float(values.mean()):
            squares += float(((values / mean - 1) ** 2).sum())
            dof += values.size - 1
    return Repeats(sqrt(squares / dof) if dof else 0.0, dof)


def mean_of_repeats(repeats: Sequence[tuple[float, float, str]], pooled: Repeats | None = None) -> Estimate:
    r"""Mean of values with their standard uncertainties and tests, such that twice its u is a 95 % interval.

    .. math:: u^2 = \bar u^2 + (t/2)^2 s^2/n

    with the mean u of the n repeats, which their common errors make, the standard deviation s of the repeats, and
    Student's t: few repeats do not tell how far their mean is off. Where other conditions of the specimen have repeats,
    too, s is that of all of them, at least that of these. Source of t: JCGM 100:2008, G.3.2.

    >>> mean_of_repeats([(2.0, 0.1, "D1"), (2.0, 0.1, "D2")]).pair
    (2.0, 0.1)
    """
    values = np.array([value for value, _, _ in repeats])
    stated = float(np.mean([std for _, std, _ in repeats]))
    std = hypot(stated, 0.5 * reach_of_scatter(values, pooled))
    return Estimate(float(values.mean()), std, tuple(test for *_, test in repeats))


def reach_of_scatter(values: FloatArray, pooled: Repeats | None = None) -> float:
    """Half the 95 % interval of a mean by the scatter of repeats alone; 0 for one value."""
    if values.size < 2:
        return 0.0
    of_these = float(values.std(ddof=1))
    scatter, dof = of_these, values.size - 1
    if pooled is not None and pooled.dof > dof:
        scatter, dof = pooled.relative * abs(float(values.mean())), pooled.dof
    t = float(scipy.special.stdtrit(dof, _BELOW_TWO))
    return max(t * scatter, 2.0 * of_these) / sqrt(values.size)
