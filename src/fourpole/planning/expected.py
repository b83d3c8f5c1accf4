"""The tyre to expect in a planned test: guessed, or found by an earlier analysis."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Self

import numpy as np
import polars as pl

from fourpole import quantities as q
from fourpole.campaign import defaults
from fourpole.campaign.row import Test, condition_of
from fourpole.core.condition import Axis, Condition, Sameness, Value
from fourpole.errors import CampaignError
from fourpole.fitting.rows import conditions_in
from fourpole.study.results import read_results

#: A difference in temperature of this many tolerances counts as much as a factor of e in pressure or preload.
_TOLERANCES_PER_E = 10.0


@dataclass(frozen=True)
class Tyre:
    """The expected tyre of one test: K1 and its standard uncertainty [N/m], K2 [N/m], C [N s/m]."""

    k1: float
    k1_std: float
    k2: float
    c: float


@dataclass(frozen=True)
class Guess:
    """A guessed tyre; None where a value is not guessed.

    Attributes
    ----------
    k1, k2, c : float [N/m], [N/m], [N s/m]
    k1_std : float [1]
        Relative standard uncertainty of K1 after the static tests.
    """

    k1: float | None = None
    k2: float | None = None
    c: float | None = None
    k1_std: float | None = None

    @property
    def whole(self) -> bool:
        """Whether K1, K2 and C are all guessed."""
        return None not in (self.k1, self.k2, self.c)


def tyre_of(test: Test, guess: Guess, earlier: Earlier | None) -> Tyre:
    """The tyre to expect in a planned test: the guess comes first, then tests.csv (K1), then the earlier results."""
    known = None if earlier is None or guess.whole else earlier.nearest(test)
    k1, k1_std = (guess.k1, None) if guess.k1 is not None else (test.value("K1"), test.value("u(K1)"))
    k2, c = guess.k2, guess.c
    if known is not None:
        k1, k1_std = (known.k1, known.k1_std) if k1 is None else (k1, k1_std)
        k2, c = known.k2 if k2 is None else k2, known.c if c is None else c
    if k1 is None or k2 is None or c is None:
        missing = "K1" if k1 is None else "K2" if k2 is None else "C"
        raise CampaignError(
            f"specimen {test.tyre!r} is not known yet: guess its K1, K2 and C, {missing} at least (--k1, --k2, --c); "
            "results of an earlier analysis of the campaign serve too"
        )
    if guess.k1_std is not None:
        k1_std = guess.k1_std * k1
    return Tyre(k1, defaults.K1_STD * k1 if k1_std is None else k1_std, k2, c)


@dataclass(frozen=True)
class Earlier:
    """Tyres that an earlier analysis found: the condition and the frequency [Hz] of each test, and its tyre."""

    tests: list[tuple[Condition, float, Tyre]]
    rule: Sameness

    @classmethod
    def of(cls, folder: Path, rule: Sameness) -> Self | None:
        """The tyres in a results folder; None if there is no such folder."""
        if not (folder / "dynamic.csv").is_file():
            return None
        heads = (q.K1.head, q.K1.u_head, q.K2.head, q.C.head)
        table = read_results(folder).dynamic.drop_nulls(heads)
        table = table.filter(pl.all_horizontal(pl.col(one.head) > 0 for one in (q.K1, q.K2, q.C)))
        tyres = [Tyre(*row) for row in table.select(heads).iter_rows()]
        return cls(list(zip(conditions_in(table, rule), table[q.FREQUENCY.head], tyres, strict=True)), rule)

    def nearest(self, test: Test) -> Tyre | None:
        """The tyre of the test nearest in condition, then in frequency; None where there is none of the same tyre."""
        mine = condition_of(test, self.rule)
        frequency = test.value("frequency")
        near = [
            (
                round(sum(map(_distance, self.rule.axes, condition.values, mine.values)), 3),
                _log_ratio(measured, frequency),
                tyre,
            )
            for condition, measured, tyre in self.tests
            if condition.specimen == test.tyre
        ]
        return min(near, key=lambda distances: distances[:2])[2] if near else None


def _distance(axis: Axis, value: Value, other: Value) -> float:
    """Distance of two values on one axis: 0 if they are the same, 1 for a factor of e or where one is not stated."""
    if axis.same(value, other):
        return 0.0
    if not isinstance(value, float) or not isinstance(other, float):
        return 1.0
    if axis.absolute:
        return abs(value - other) / (_TOLERANCES_PER_E * axis.absolute)
    return _log_ratio(value, other)


def _log_ratio(value: float, other: float | None) -> float:
    """Absolute value of ln(value/other); 1 where one of them is zero or not stated."""
    return abs(float(np.log(value / other))) if value and other and value / other > 0 else 1.0
