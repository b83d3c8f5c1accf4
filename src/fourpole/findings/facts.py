"""The tables of results by specimen and nominal condition: the numbers that findings are computed from."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from math import isfinite, sqrt
from typing import Any

import numpy as np
import polars as pl

from fourpole import quantities as q
from fourpole.core.condition import FREQUENCY, PRELOAD, PRESSURE, Axis
from fourpole.findings.finding import UNSTATED, Key, Setup
from fourpole.quantities import Quantity
from fourpole.study.results import Results

__all__ = ["Curve", "Facts", "Measured", "common", "natural", "tests_of"]

_AXES = {"pressure": PRESSURE, "load": PRELOAD, "frequency": FREQUENCY}
#: A value without a stated uncertainty is taken to be known to this.
_UNSTATED_STD = 0.02


@dataclass(frozen=True)
class Measured:
    """A value with its standard uncertainty; repeats are averaged, at no gain in certainty."""

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
        """Lowest and highest frequency."""
        return self.frequency[0], self.frequency[-1]


Values = Mapping[Key, Measured]


@dataclass(frozen=True)
class Facts:
    """Results with nominal conditions; `used` leaves out the rejected tests.

    Attributes
    ----------
    results : Results
    nominal : dict
        By axis, the value that stands for each value of the tables.
    """

    results: Results
    nominal: Mapping[str, Mapping[float, float]] = field(default_factory=dict)

    @classmethod
    def of(cls, results: Results) -> Facts:
        """With specimens named apart by temperature and the campaign's own axes of a condition."""
        results = results.apart()
        nominal = {
            name: _clustered([v for table in (results.static, results.dynamic) for v in _column(table, axis)], axis)
            for name, axis in _AXES.items()
        }
        return cls(results, {**nominal, "frequency": {f: _snapped(n) for f, n in nominal["frequency"].items()}})

    @cached_property
    def tyres(self) -> tuple[str, ...]:
        """All tyres that were tested, in the order of their names."""
        names = {name for table in (self.results.static, self.results.dynamic) for name in table["tyre"].to_list()}
        return tuple(sorted(names, key=natural))

    @cached_property
    def constructions(self) -> dict[str, str]:
        """What the campaign calls each tyre's construction."""
        rows = pl.concat([table.select("tyre", "construction") for table in self.tables]).unique().sort("construction")
        return {tyre: text or "" for tyre, text in rows.rows()}

    @property
    def tables(self) -> tuple[pl.DataFrame, pl.DataFrame]:
        """Static and dynamic rows, rejected ones included."""
        return self.results.static, self.results.dynamic

    @cached_property
    def used_static(self) -> list[dict[str, Any]]:
        """Rows of static tests that were not rejected."""
        return self._used(self.results.static)

    @cached_property
    def used_dynamic(self) -> list[dict[str, Any]]:
        """Rows of dynamic tests that were not rejected."""
        return self._used(self.results.dynamic)

    def _used(self, table: pl.DataFrame) -> list[dict[str, Any]]:
        rows = table.filter(pl.col("verdict") != "rejected").rows(named=True)
        return sorted(rows, key=lambda row: natural(row["test"]))

    def key(self, row: Mapping[str, Any], axes: Iterable[str]) -> Key:
        """Nominal condition of a row."""
        return tuple(self.nominal[axis].get(_number(row.get(_AXES[axis].column)), UNSTATED) for axis in axes)

    def values(self, quantity: Quantity, tyre: str) -> dict[Key, Measured]:
        """A quantity of a tyre by nominal condition; blanks, and what is not positive, are left out."""
        static = "frequency" not in quantity.over
        groups: dict[Key, list[tuple[float, float, str]]] = {}
        for row in self.used_static if static else self.used_dynamic:
            value = _number(row.get(quantity.head))
            if row["tyre"] == tyre and value > 0.0:
                std = _number(row.get(quantity.u_head))
                known = value, std if std >= 0.0 else _UNSTATED_STD * value, row["test"]
                groups.setdefault(self.key(row, quantity.over), []).append(known)
        return {key: _averaged(groups[key]) for key in sorted(groups)}

    @cached_property
    def curves(self) -> dict[tuple[str, Setup], dict[Key, Curve]]:
        """Measured transmissibility by (tyre, set-up) and (pressure, load)."""
        points: dict[tuple[str, Setup], dict[Key, dict[float, list[tuple[float, float, float]]]]] = {}
        tests: dict[tuple[str, Setup, Key], list[str]] = {}
        for row in self.used_dynamic:
            tr, std, frequency = (
                _number(row.get(name)) for name in (q.TR_MEASURED.head, q.TR.u_head, q.FREQUENCY.head)
            )
            if tr > 0.0 and frequency > 0.0:
                who, key = (row["tyre"], _setup(row)), self.key(row, ("pressure", "load"))
                line = points.setdefault(who, {}).setdefault(key, {})
                tests.setdefault((*who, key), []).append(row["test"])
                point = frequency, tr, std if std >= 0.0 else _UNSTATED_STD * tr
                line.setdefault(self.nominal["frequency"][frequency], []).append(point)
        return {
            who: {key: _curve(lines[key], tests[*who, key]) for key in sorted(lines)}
            for who, lines in sorted(points.items())
        }


def common(first: Mapping[Key, Any], second: Mapping[Key, Any]) -> list[Key]:
    """Conditions that both have, in order."""
    return sorted(set(first) & set(second))


def tests_of(*values: Iterable[Measured | Curve]) -> tuple[str, ...]:
    """All tests that some values rest on, each once, sorted."""
    return tuple(sorted({test for some in values for each in some for test in each.tests}, key=natural))


def natural(name: str) -> tuple[Any, ...]:
    """Sorts D2 before D10."""
    parts = re.split(r"([0-9]+)", name)
    return tuple(
        (0, len(part.lstrip("0")), part.lstrip("0")) if part.isdecimal() else (1, 0, part) for part in parts
    ), name


def _curve(line: Mapping[float, Sequence[tuple[float, float, float]]], tests: Sequence[str]) -> Curve:
    points = sorted(tuple(np.mean(repeats, axis=0).tolist()) for repeats in line.values())
    frequency, tr, std = zip(*points, strict=True)
    return Curve(frequency, tr, std, tuple(tests))


def _setup(row: Mapping[str, Any]) -> Setup:
    mass = _number(row.get(q.ADDED_MASS.head))
    return Setup(row.get("rig") or "", mass if mass > 0.0 else 0.0)


def _averaged(repeats: Sequence[tuple[float, float, str]]) -> Measured:
    """Mean of repeats: their scatter, or the stated uncertainty, whichever is larger."""
    values = np.array([value for value, _, _ in repeats])
    stated = float(np.mean([std for _, std, _ in repeats]))
    scatter = float(values.std(ddof=1)) / sqrt(values.size) if values.size > 1 else 0.0
    return Measured(float(values.mean()), max(stated, scatter), tuple(test for _, _, test in repeats))


def _column(table: pl.DataFrame, axis: Axis) -> list[float]:
    values = table[axis.column].to_list() if axis.column in table else []
    return [v for v in values if v is not None and isfinite(v) and v > 0.0]


def _number(value: Any) -> float:
    return float(value) if isinstance(value, (int, float)) else float("nan")


def _clustered(values: Sequence[float], axis: Axis) -> dict[float, float]:
    """Value -> median of those that are the same on an axis."""
    groups: dict[int, list[float]] = {}
    for value, group in zip(values, axis.groups(values).tolist(), strict=True):
        groups.setdefault(group, []).append(value)
    return {value: float(np.median(group)) for group in groups.values() for value in group}


def _snapped(frequency: float) -> float:
    """The nearest half hertz, where it is near enough to be what was meant."""
    nearest = round(2.0 * frequency) / 2.0
    return nearest if abs(frequency - nearest) <= 0.006 * nearest else frequency
