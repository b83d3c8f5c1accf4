"""The tables of results by specimen and nominal condition, and one finding of them as data."""

from __future__ import annotations

import re
from collections.abc import Hashable, Iterable, Mapping, Sequence, Set
from dataclasses import dataclass, field, replace
from enum import StrEnum
from functools import cached_property, lru_cache
from itertools import combinations
from math import inf, isfinite, sqrt
from typing import Any, Protocol, TypeVar

import numpy as np
import polars as pl

from fourpole import quantities as q
from fourpole.core.checks import Verdict
from fourpole.core.condition import FREQUENCY, PRELOAD, PRESSURE, Axis, Condition, Sameness, Value
from fourpole.core.polar import value_of
from fourpole.fitting.rows import conditions_in, names_apart, rule_in
from fourpole.quantities import Quantity
from fourpole.study.study import Study

#: The value of a pressure, load or frequency that the campaign does not state.
UNSTATED = -1.0
Key = tuple[float, ...]
#: Heads of findings.csv, each with its meaning.
FINDING_COLUMNS = {
    "kind": "level, comparison, trend with an axis, resonance, claim with its number, or another kind of finding",
    "quantity": "name of the quantity; blank where the finding is about tests",
    "specimens": "names of the specimens",
    "condition": "lowest to highest pressure, load and frequency, the rig, and the added mass",
    "effect": "size of the effect",
    "u(effect)": "its standard uncertainty; of a mean over conditions, that of one condition; blank where it has none",
    "unit": "unit of the effect, 1 for a relative one",
    "holds": "the outcome",
    "tests": "names of the tests that the finding uses",
}
_UNITS = {"pressure": "Pa", "load": "N", "frequency": "Hz"}


class Topic(StrEnum):
    """The headings of findings, in the order of the report."""

    TRUST = "trust"
    INERTIA = "inertia"
    STATIC = "static stiffness"
    NONLINEARITY = "nonlinearity"
    DYNAMIC = "dynamic stiffness"
    DAMPING = "damping"
    LOSS = "loss"
    RESONANCE = "resonance"
    TRANSMISSIBILITY = "transmissibility"
    CLAIMS = "claims"


class Holds(StrEnum):
    """The outcome of a finding, in the words of findings.csv."""

    ALL_USED = "all used"
    SOME_USED = "some used"
    NONE_USED = "none used"
    NO_TESTS = "no tests"
    REJECTED = "rejected"
    WARNING = "warning"
    MEASURED = "measured"
    NEARLY_LINEAR = "nearly linear"
    NON_LINEAR = "non-linear"
    MARKEDLY_NON_LINEAR = "markedly non-linear"
    ABOVE = "first above second"
    BELOW = "first below second"
    NO_DIFFERENCE = "no difference"
    MIXED = "depends on the condition"
    RISES = "rises"
    FALLS = "falls"
    NO_CHANGE = "no change"
    MAXIMUM = "maximum"
    MINIMUM = "minimum"
    INSIDE = "inside the tested frequencies"
    AT_LOWEST = "at the lowest tested frequency"
    AT_HIGHEST = "at the highest tested frequency"
    NO_CROSSING = "no crossing"
    ONE_CROSSING = "one crossing"
    SEVERAL_CROSSINGS = "several crossings"
    WITHIN = "within the uncertainty"
    BEYOND = "beyond the uncertainty"
    TRUE = "holds"
    TRUE_UNSURE = "holds, not beyond the uncertainty"
    FALSE = "does not hold"
    NOT_EXAMINED = "cannot be examined"


@dataclass(frozen=True, order=True)
class Setup:
    """The rig and the added mass [kg]: a transmissibility curve depends on both besides the specimen."""

    rig: str = ""
    added_mass: float = 0.0


@dataclass(frozen=True)
class FindingConditions:
    """Nominal conditions: each key has the values of `axes`, which are pressure [Pa], load [N] and frequency [Hz]."""

    axes: tuple[str, ...] = ()
    keys: tuple[Key, ...] = ()
    setup: Setup = Setup()

    def values(self, axis: str) -> list[float]:
        """Distinct stated values of one axis in SI, rising."""
        place = self.axes.index(axis)
        return sorted({key[place] for key in self.keys if key[place] != UNSTATED})

    def __str__(self) -> str:
        """Lowest to highest setting of each axis in SI, and the set-up."""
        parts = []
        for axis in self.axes:
            if values := self.values(axis):
                span = f"{values[0]:.6g}" if len(values) == 1 else f"{values[0]:.6g} to {values[-1]:.6g}"
                parts.append(f"{axis} {span} {_UNITS[axis]}")
        if self.setup.rig:
            parts.append(f"rig {self.setup.rig}")
        if self.setup.added_mass:
            parts.append(f"added mass {self.setup.added_mass:.6g} kg")
        return "; ".join(parts)


class Detail(Protocol):
    """The numbers that only one kind of finding has; frozen and free of arrays, so that findings compare."""

    @property
    def kind(self) -> str:
        """Name of the kind in findings.csv: comparison, trend with pressure, claim 3."""


@dataclass(frozen=True)
class Finding:
    """One result that a campaign shows.

    Attributes
    ----------
    topic : Topic
    quantity : Quantity or None
        The quantity that the finding is about; None if it is about tests.
    specimens : tuple of str
        Names as in the campaign.
    holds : Holds
        The outcome.
    detail : Detail
        The numbers of this kind of finding; `detail.kind` names the kind.
    conditions : FindingConditions
        The conditions at which the quantity was measured.
    effect, std : float or None
        Size of the effect and its standard uncertainty, in `unit`. A mean over conditions has that of one condition.
    unit : str
        SI unit; "1" for a relative effect.
    tests : tuple of str
        Names of the tests that the finding uses, sorted.
    """

    topic: Topic
    quantity: Quantity | None
    specimens: tuple[str, ...]
    holds: Holds
    detail: Detail
    conditions: FindingConditions = field(default_factory=FindingConditions)
    effect: float | None = None
    std: float | None = None
    unit: str = ""
    tests: tuple[str, ...] = ()

    @property
    def kind(self) -> str:
        """Name of its kind: comparison, trend with pressure, claim 3."""
        return self.detail.kind


def findings_table(findings: Sequence[Finding]) -> pl.DataFrame:
    """Findings as the rows of findings.csv.

    Parameters
    ----------
    findings : sequence of Finding

    Returns
    -------
    polars.DataFrame
        `effect` and `u(effect)` are in `unit`, not-a-number is blank; several specimens, settings or tests are
        separated by "; ".
    """
    rows = [
        (
            finding.kind,
            finding.quantity.column if finding.quantity else "",
            "; ".join(finding.specimens),
            str(finding.conditions),
            finding.effect,
            finding.std,
            finding.unit,
            str(finding.holds),
            "; ".join(finding.tests),
        )
        for finding in findings
    ]
    numbers = ("effect", "u(effect)")
    schema = {name: pl.Float64 if name in numbers else pl.String for name in FINDING_COLUMNS}
    return pl.DataFrame(rows, schema=schema, orient="row")


_AXES = {"pressure": PRESSURE, "load": PRELOAD, "frequency": FREQUENCY}
Name = TypeVar("Name", bound=Hashable)
#: Relative standard uncertainty of a value for which the tables have none.
_UNSTATED_STD = 0.02
#: Largest number of specimens of which every pair is compared; of more, only those with the lowest and the highest
#: mean are.
_MOST_PAIRED = 3


@dataclass(frozen=True)
class Estimate:
    """A value, the mean of repeats, with its standard uncertainty and the names of its tests."""

    value: float
    std: float
    tests: tuple[str, ...] = ()

    @property
    def pair(self) -> tuple[float, float]:
        """Value and standard uncertainty."""
        return self.value, self.std


@dataclass(frozen=True)
class Curve:
    """Transmissibility of one tyre at one condition, by rising frequency as recorded."""

    frequency: tuple[float, ...]
    tr: tuple[float, ...]
    std: tuple[float, ...]
    tests: tuple[str, ...] = ()


Values = Mapping[Key, Estimate]


Row = dict[str, Any]


@dataclass(frozen=True)
class Facts:
    """Results with nominal conditions; the campaign's rule of one condition distinguishes the states of a specimen."""

    results: Study

    @classmethod
    def of(cls, results: Study) -> Facts:
        """The facts of results, made once."""
        facts: Facts = results.derived.setdefault(cls, cls(results))
        return facts

    @cached_property
    def _rule(self) -> Sameness:
        """The axes on which a specimen has a state: all but pressure and preload."""
        return rule_in(self.results.record).without(PRESSURE.name, PRELOAD.name)

    @cached_property
    def _conditions(self) -> list[list[Condition]]:
        return [conditions_in(table, self._rule) for table in (self.results.static, self.results.dynamic)]

    @cached_property
    def rows(self) -> list[list[Row]]:
        """Rows of the static and of the dynamic table; "tyre" names a specimen in one state, as "radial at 60 °C"."""
        tables = [table.rows(named=True) for table in (self.results.static, self.results.dynamic)]
        for rows, names in zip(tables, names_apart(self._conditions, self._rule), strict=True):
            for row, name in zip(rows, names, strict=True):
                row["tyre"] = name
        return tables

    @cached_property
    def _states(self) -> dict[str, Condition]:
        """The campaign's specimen of each tyre, with its middle value on each axis of the rule."""
        members: dict[str, list[Condition]] = {}
        for rows, conditions in zip(self.rows, self._conditions, strict=True):
            for row, condition in zip(rows, conditions, strict=True):
                members.setdefault(row["tyre"], []).append(condition)
        return {
            tyre: Condition(states[0].specimen, tuple(map(_middle, zip(*(s.values for s in states), strict=True))))
            for tyre, states in members.items()
        }

    def stated(self, tyre: str) -> str:
        """The campaign's name of a tyre in one state: "radial" of "radial at 60 °C"."""
        return self._states[tyre].specimen

    def warmer(self, first: str, second: str) -> float | None:
        """Absolute difference in temperature of two tyres [K], 0 if not stated; None if their states differ."""
        state, other = self._states[first], self._states[second]
        if not self._rule.same(state, replace(other, specimen=state.specimen)):
            return None
        place = [axis.column for axis in self._rule.axes].index(q.TEMPERATURE.head)
        a, b = state.values[place], other.values[place]
        return abs(a - b) if isinstance(a, float) and isinstance(b, float) else 0.0

    @cached_property
    def tyres(self) -> tuple[str, ...]:
        """Names of all tyres that were tested, sorted."""
        return in_order(self._states)

    @cached_property
    def inflated(self) -> frozenset[str]:
        """Names of the tyres of which a test states an inflation pressure."""
        rows = (row for rows in self.rows for row in rows)
        return frozenset(row["tyre"] for row in rows if isfinite(_number(row.get(q.PRESSURE.head))))

    @cached_property
    def constructions(self) -> dict[str, str]:
        """The construction of each tyre as the campaign states it."""
        constructions = dict.fromkeys(self.tyres, "")
        for row in (row for rows in self.rows for row in rows):
            constructions[row["tyre"]] = max(constructions[row["tyre"]], row["construction"] or "")
        return constructions

    @cached_property
    def nominal(self) -> dict[str, dict[float, float]]:
        """Nominal value of each value in the tables, by axis: the median of all values that are the same."""
        nominal = {
            name: _nominal(
                _values_on(axis, self.rows), axis, {*_values_on(axis, (self.used_static, self.used_dynamic))}
            )
            for name, axis in _AXES.items()
        }
        return {**nominal, "frequency": {f: _snapped(value) for f, value in nominal["frequency"].items()}}

    @cached_property
    def used_static(self) -> list[Row]:
        """Rows of static tests that were not rejected."""
        return _used(self.rows[0])

    @cached_property
    def used_dynamic(self) -> list[Row]:
        """Rows of dynamic tests that were not rejected."""
        return _used(self.rows[1])

    def used(self, quantity: Quantity) -> list[Row]:
        """Rows of tests that were not rejected, from the table that has the column of the quantity."""
        return self.used_dynamic if "frequency" in quantity.over else self.used_static

    def key(self, row: Mapping[str, Any], axes: Iterable[str]) -> Key:
        """Nominal condition of a row: its value on each axis, in SI."""
        return tuple(self.nominal[axis].get(_number(row.get(_AXES[axis].column)), UNSTATED) for axis in axes)

    def by_tyre(self, quantity: Quantity) -> dict[str, dict[Key, Estimate]]:
        """A quantity of each tyre by nominal condition; values that are blank or not positive are left out."""
        place = (*quantity.heads, *quantity.over)
        if place not in self._by_tyre:
            groups: dict[str, dict[Key, list[tuple[float, float, str]]]] = {tyre: {} for tyre in self.tyres}
            for row in self.used(quantity):
                if measured := known(row, quantity):
                    key = self.key(row, quantity.over)
                    groups[row["tyre"]].setdefault(key, []).append((*measured, row["test"]))
            made = {tyre: {key: averaged(of[key]) for key in sorted(of)} for tyre, of in groups.items() if of}
            self._by_tyre[place] = made
        return self._by_tyre[place]

    @cached_property
    def _by_tyre(self) -> dict[tuple[str, ...], dict[str, dict[Key, Estimate]]]:
        return {}

    @cached_property
    def curves(self) -> dict[tuple[str, Setup], dict[Key, Curve]]:
        """Measured transmissibility by (tyre, set-up) and (pressure, load)."""
        points: dict[tuple[str, Setup], dict[Key, list[tuple[float, float, float, str]]]] = {}
        for row in self.used_dynamic:
            frequency, tr = _number(row.get(q.FREQUENCY.head)), known(row, q.TR_MEASURED)
            if tr and frequency > 0.0:
                lines = points.setdefault((row["tyre"], _setup(row)), {})
                key = self.key(row, ("pressure", "load"))
                lines.setdefault(key, []).append((frequency, *tr, row["test"]))
        return {who: {key: self._curve(lines[key]) for key in sorted(lines)} for who, lines in sorted(points.items())}

    def _curve(self, points: Sequence[tuple[float, float, float, str]]) -> Curve:
        """A curve of points (frequency, TR, uncertainty, test); those of one nominal frequency are averaged."""
        repeats: dict[float, list[tuple[float, ...]]] = {}
        for frequency, tr, std, _ in points:
            repeats.setdefault(self.nominal["frequency"][frequency], []).append((frequency, tr, std))
        means = sorted(np.mean(members, axis=0).tolist() for members in repeats.values())
        frequencies, heights, stds = zip(*means, strict=True)
        return Curve(frequencies, heights, stds, tuple(test for *_, test in points))


def finding_on(
    quantity: Quantity,
    values: Mapping[str, Mapping[Key, Estimate] | Mapping[Key, Curve]],
    keys: Iterable[Key],
    holds: Holds,
    detail: Detail,
    effect: float | None = None,
    std: float | None = None,
    *,
    unit: str = "1",
    topic: str = "",
    setup: Setup | None = None,
) -> Finding:
    """A finding on a quantity of some specimens at conditions that all of them have; it names the tests used there."""
    keys = tuple(sorted(keys))
    tests = {test for measured in values.values() for key in keys for test in measured[key].tests}
    about = FindingConditions(quantity.over[: len(keys[0])], keys, setup or Setup())
    topic = Topic(topic or quantity.topic)
    return Finding(topic, quantity, tuple(values), holds, detail, about, effect, std, unit, in_order(tests))


def known(row: Mapping[str, Any], quantity: Quantity) -> tuple[float, float] | None:
    """Value and standard uncertainty of a row; None where the value is blank or not positive."""
    if quantity.key in (q.MODULUS.key, q.LOSS_ANGLE.key):
        pair = value_of(quantity, row)
        return pair if pair is not None and pair[0] > 0.0 else None
    value, std = (_number(row.get(head)) for head in quantity.heads)
    return (value, std if std >= 0.0 else _UNSTATED_STD * value) if value > 0.0 else None


def common(first: Mapping[Key, Any], second: Mapping[Key, Any]) -> list[Key]:
    """Conditions that both have, in order."""
    return sorted(set(first) & set(second))


def pairs(means: Mapping[Name, float]) -> list[tuple[Name, Name]]:
    """All pairs of up to `_MOST_PAIRED` specimens; of more, the pair with the lowest and the highest mean."""
    if len(means) <= _MOST_PAIRED:
        return list(combinations(means, 2))
    order = sorted(means, key=lambda name: means[name])
    return [(order[0], order[-1])]


@lru_cache(maxsize=100_000)
def natural(name: str) -> tuple[Any, ...]:
    """A key that sorts D2 before D10, 1.35bar before 1.7bar, and the date 2026.9.1 before 2026.10.1."""
    parts = re.split(r"((?<![0-9.])[0-9]+\.[0-9]+(?!\.?[0-9])|[0-9]+)", name)
    return tuple((0, float(part), "") if at % 2 else (1, 0.0, part) for at, part in enumerate(parts)), name


def in_order(names: Iterable[str]) -> tuple[str, ...]:
    """Names with D2 before D10."""
    return tuple(sorted(names, key=natural))


def _used(rows: Sequence[Row]) -> list[Row]:
    """The rows that were not rejected, by their tests."""
    return sorted((row for row in rows if row["verdict"] != Verdict.REJECTED), key=lambda row: natural(row["test"]))


def _setup(row: Mapping[str, Any]) -> Setup:
    mass = _number(row.get(q.ADDED_MASS.head))
    return Setup(row.get("rig") or "", mass if mass > 0.0 else 0.0)


def averaged(repeats: Sequence[tuple[float, float, str]]) -> Estimate:
    """Mean of repeats; its uncertainty is that of their scatter or the mean stated one, whichever is larger."""
    if len(repeats) == 1:
        ((value, std, test),) = repeats
        return Estimate(value, std, (test,))
    values = np.array([value for value, _, _ in repeats])
    stated = float(np.mean([std for _, std, _ in repeats]))
    scatter = float(values.std(ddof=1)) / sqrt(values.size)
    return Estimate(float(values.mean()), max(stated, scatter), tuple(test for _, _, test in repeats))


def _values_on(axis: Axis, tables: Iterable[Sequence[Row]]) -> list[float]:
    """The positive values of an axis in the rows of some tables."""
    values = (_number(row.get(axis.column)) for rows in tables for row in rows)
    return [value for value in values if 0.0 < value < inf]


def _middle(values: Iterable[Value]) -> Value:
    """The middle one of the stated values; None if there is none."""
    stated = sorted((value for value in values if value is not None), key=lambda value: (isinstance(value, str), value))
    return stated[len(stated) // 2] if stated else None


def _number(value: Any) -> float:
    return float(value) if isinstance(value, (int, float)) else float("nan")


def _nominal(values: Sequence[float], axis: Axis, used: Set[float]) -> dict[float, float]:
    """Each value with the median of those that are the same on an axis and of which a test is used."""
    groups: dict[int, list[float]] = {}
    for value, group in zip(values, axis.groups(values).tolist(), strict=True):
        groups.setdefault(group, []).append(value)
    shown = {number: [value for value in group if value in used] or group for number, group in groups.items()}
    medians = {number: float(np.median(group)) for number, group in shown.items()}
    return {value: medians[number] for number, group in groups.items() for value in group}


def _snapped(frequency: float) -> float:
    """The nearest half hertz if it is within 0.6 % of the frequency, else the frequency."""
    nearest = round(2.0 * frequency) / 2.0
    return nearest if abs(frequency - nearest) <= 0.006 * nearest else frequency
