"""The tables of results by specimen and nominal condition: the numbers from which findings are computed."""

from __future__ import annotations

import re
from collections.abc import Hashable, Iterable, Mapping, Sequence, Set
from dataclasses import dataclass, field
from functools import cached_property
from itertools import combinations
from math import isfinite, sqrt
from typing import Any, TypeVar

import numpy as np
import polars as pl

from fourpole import quantities as q
from fourpole.core.checks import Verdict
from fourpole.core.condition import FREQUENCY, PRELOAD, PRESSURE, Axis, Condition, Sameness, Value
from fourpole.findings.finding import UNSTATED, Detail, Finding, FindingConditions, Holds, Key, Setup, Topic
from fourpole.fitting.rows import conditions_in, rule_in
from fourpole.quantities import Quantity
from fourpole.study.study import Study

_AXES = {"pressure": PRESSURE, "load": PRELOAD, "frequency": FREQUENCY}
Name = TypeVar("Name", bound=Hashable)
#: Relative standard uncertainty of a value for which the tables have none.
_UNSTATED_STD = 0.02
#: Largest number of specimens of which every pair is compared; of more, only those with the lowest and the highest
#: mean are.
_MOST_PAIRED = 3


@dataclass(frozen=True)
class Measured:
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

    @property
    def ends(self) -> tuple[float, float]:
        """Lowest and highest frequency [Hz]."""
        return self.frequency[0], self.frequency[-1]


Values = Mapping[Key, Measured]


@dataclass(frozen=True)
class Facts:
    """Results with nominal conditions.

    Attributes
    ----------
    results : Study
        Specimens have names of their own for each temperature: "radial at 60 °C".
    stated : mapping of str to str
        The campaign's name of each specimen: "radial".
    nominal : mapping
        Nominal value of each value in the tables, by axis: the median of all values that are the same.
    """

    results: Study
    stated: Mapping[str, str] = field(default_factory=dict)
    nominal: Mapping[str, Mapping[float, float]] = field(default_factory=dict)

    @classmethod
    def of(cls, results: Study) -> Facts:
        """The facts of results, made once; temperature and the campaign's own axes distinguish specimens."""
        if cls not in results.derived:
            results.derived[cls] = cls._made(results)
        found: Facts = results.derived[cls]
        return found

    @classmethod
    def _made(cls, stated: Study) -> Facts:
        results = stated.apart()
        pairs = zip((stated.static, stated.dynamic), (results.static, results.dynamic), strict=True)
        names = {
            new: old or "" for before, after in pairs for new, old in zip(after["tyre"], before["tyre"], strict=True)
        }
        every = (results.static, results.dynamic)
        nominal = {
            name: _nominal([v for table in every for v in _column(table, axis)], axis, _used_values(every, axis))
            for name, axis in _AXES.items()
        }
        return cls(results, names, {**nominal, "frequency": {f: _snapped(n) for f, n in nominal["frequency"].items()}})

    @cached_property
    def tyres(self) -> tuple[str, ...]:
        """Names of all tyres that were tested, sorted."""
        names = {name for table in self.tables for name in table["tyre"].to_list()}
        return tuple(sorted(names, key=natural))

    @cached_property
    def inflated(self) -> frozenset[str]:
        """Names of the tyres of which a test states an inflation pressure."""
        stated = [table.filter(pl.col(q.PRESSURE.head).is_finite())["tyre"] for table in self.tables]
        return frozenset(name for each in stated for name in each)

    @cached_property
    def constructions(self) -> dict[str, str]:
        """The construction of each tyre as the campaign states it."""
        rows = pl.concat([table.select("tyre", "construction") for table in self.tables]).unique().sort("construction")
        return {tyre: text or "" for tyre, text in rows.rows()}

    @cached_property
    def _states(self) -> dict[str, Condition]:
        """Each specimen's value on each axis but pressure and preload: a median, or a text."""
        rule = self._rule
        rows: dict[str, list[Condition]] = {}
        for table in self.tables:
            for tyre, one in zip(table["tyre"], conditions_in(table, rule), strict=True):
                rows.setdefault(tyre, []).append(one)
        columns = {tyre: zip(*(one.values for one in found), strict=True) for tyre, found in rows.items()}
        return {tyre: Condition("", tuple(map(_middle, each))) for tyre, each in columns.items()}

    @cached_property
    def _rule(self) -> Sameness:
        return rule_in(self.results.record).without(PRESSURE.name, PRELOAD.name)

    def warmer(self, one: str, other: str) -> float | None:
        """Absolute difference in temperature of two specimens [K], 0 if not stated; None if their states differ."""
        first, second = self._states[one], self._states[other]
        if not self._rule.same(first, second):
            return None
        at = [axis.column for axis in self._rule.axes].index(q.TEMPERATURE.head)
        a, b = first.values[at], second.values[at]
        return abs(a - b) if isinstance(a, float) and isinstance(b, float) else 0.0

    @property
    def tables(self) -> tuple[pl.DataFrame, pl.DataFrame]:
        """Static table and dynamic table, with the rows of rejected tests."""
        return self.results.static, self.results.dynamic

    @cached_property
    def used_static(self) -> list[dict[str, Any]]:
        """Rows of static tests that were not rejected."""
        return _used(self.results.static)

    @cached_property
    def used_dynamic(self) -> list[dict[str, Any]]:
        """Rows of dynamic tests that were not rejected."""
        return _used(self.results.dynamic)

    def used(self, quantity: Quantity) -> list[dict[str, Any]]:
        """Rows of tests that were not rejected, from the table that has the column of the quantity."""
        return self.used_dynamic if "frequency" in quantity.over else self.used_static

    def key(self, row: Mapping[str, Any], axes: Iterable[str]) -> Key:
        """Nominal condition of a row: its value on each axis, in SI."""
        return tuple(self.nominal[axis].get(_number(row.get(_AXES[axis].column)), UNSTATED) for axis in axes)

    def values(self, quantity: Quantity, tyre: str) -> dict[Key, Measured]:
        """A quantity of a tyre by nominal condition; values that are blank or not positive are left out."""
        groups: dict[Key, list[tuple[float, float, str]]] = {}
        for row in self.used(quantity):
            if row["tyre"] == tyre and (found := known(row, quantity)):
                groups.setdefault(self.key(row, quantity.over), []).append((*found, row["test"]))
        return {key: averaged(groups[key]) for key in sorted(groups)}

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
        means = sorted(np.mean(each, axis=0).tolist() for each in repeats.values())
        at, heights, stds = zip(*means, strict=True)
        return Curve(at, heights, stds, tuple(test for *_, test in points))


def finding_on(
    quantity: Quantity,
    values: Mapping[str, Mapping[Key, Measured] | Mapping[Key, Curve]],
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
    tests = tuple(sorted({test for each in values.values() for key in keys for test in each[key].tests}, key=natural))
    about = FindingConditions(quantity.over[: len(keys[0])], keys, setup or Setup())
    topic = Topic(topic or quantity.topic)
    return Finding(topic, quantity, tuple(values), holds, detail, about, effect, std, unit, tests)


def known(row: Mapping[str, Any], quantity: Quantity) -> tuple[float, float] | None:
    """Value and standard uncertainty of a row; None where the value is blank or not positive."""
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


def natural(name: str) -> tuple[Any, ...]:
    """A key that sorts D2 before D10."""
    parts = re.split(r"([0-9]+)", name)
    return tuple(
        (0, len(part.lstrip("0")), part.lstrip("0")) if part.isdecimal() else (1, 0, part) for part in parts
    ), name


def _used(table: pl.DataFrame) -> list[dict[str, Any]]:
    rows = table.filter(pl.col("verdict") != Verdict.REJECTED).rows(named=True)
    return sorted(rows, key=lambda row: natural(row["test"]))


def _setup(row: Mapping[str, Any]) -> Setup:
    mass = _number(row.get(q.ADDED_MASS.head))
    return Setup(row.get("rig") or "", mass if mass > 0.0 else 0.0)


def averaged(repeats: Sequence[tuple[float, float, str]]) -> Measured:
    """Mean of repeats; its uncertainty is that of their scatter or the mean stated one, whichever is larger."""
    values = np.array([value for value, _, _ in repeats])
    stated = float(np.mean([std for _, std, _ in repeats]))
    scatter = float(values.std(ddof=1)) / sqrt(values.size) if values.size > 1 else 0.0
    return Measured(float(values.mean()), max(stated, scatter), tuple(test for _, _, test in repeats))


def _column(table: pl.DataFrame, axis: Axis) -> list[float]:
    values = table[axis.column].to_list() if axis.column in table else []
    return [v for v in values if v is not None and isfinite(v) and v > 0.0]


def _middle(values: Iterable[Value]) -> Value:
    """The middle one of the stated values; None if there is none."""
    stated = sorted((value for value in values if value is not None), key=lambda value: (isinstance(value, str), value))
    return stated[len(stated) // 2] if stated else None


def _number(value: Any) -> float:
    return float(value) if isinstance(value, (int, float)) else float("nan")


def _used_values(tables: Iterable[pl.DataFrame], axis: Axis) -> set[float]:
    """The values on an axis of the tests that are not rejected."""
    return {value for table in tables for value in _column(table.filter(pl.col("verdict") != Verdict.REJECTED), axis)}


def _nominal(values: Sequence[float], axis: Axis, used: Set[float]) -> dict[float, float]:
    """Each value with the median of those that are the same on an axis and of which a test is used."""
    groups: dict[int, list[float]] = {}
    for value, group in zip(values, axis.groups(values).tolist(), strict=True):
        groups.setdefault(group, []).append(value)
    shown = {number: [value for value in group if value in used] or group for number, group in groups.items()}
    return {value: float(np.median(shown[number])) for number, group in groups.items() for value in group}


def _snapped(frequency: float) -> float:
    """The nearest half hertz if it is within 0.6 % of the frequency, else the frequency."""
    nearest = round(2.0 * frequency) / 2.0
    return nearest if abs(frequency - nearest) <= 0.006 * nearest else frequency
