"""Static tests as data of a fit: the loop of each condition, from static.csv and previews.parquet of the results."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import polars as pl
import polars.selectors as cs
from pydantic import Field

from fourpole import quantities as q
from fourpole.core.arrays import FloatArray
from fourpole.core.checks import Verdict
from fourpole.core.condition import AXES
from fourpole.errors import ModelError, TableError
from fourpole.fitting.likelihood import MOST_BYTES
from fourpole.fitting.measured import Measured, MeasuredSet
from fourpole.fitting.modelparts import Grown
from fourpole.fitting.ranges import IN_RANGE, RangeFile
from fourpole.fitting.rows import checked
from fourpole.io.published import published_beside
from fourpole.models.data import StiffnessData
from fourpole.models.fit import Fit
from fourpole.models.ramp import Loop, Ramp, static_derivative, static_stiffness
from fourpole.units import shown

#: Standard uncertainty of the factor of the static amplitude where none is stated [1].
FACTOR_STD = 0.05
#: Tables that hold the static tests, and their loops.
STATIC, LOOPS = "static.csv", "previews.parquet"
#: Relative difference of K1 in the two tables that is round-off.
_SAME_K1 = 1e-6
#: Repeats of a static test are one ramp if the times of their branches differ by no more than this share.
_SAME_TIME = 0.1
#: Frequency times the duration of a branch at which K' is about the tangent in the middle of a branch.
_NEAR = 0.4
#: Lowest frequency of the range of K*, over that of the ramp.
_LOWEST = 0.25


class StaticFile(Grown):
    """The static test of a condition, joined as a ramp."""

    later: ClassVar = ("passive",)
    branch_time: float = Field(gt=0, description="Duration of a branch [s].")
    cycle: int = Field(ge=1, description="Number of the cycle.")
    place: float = Field(ge=0, le=1, description="Deflection of the tangent as a share of the branch [1].")
    k1: float = Field(description="Measured tangent [N/m].")
    k1_std: float = Field(ge=0, description="Its standard uncertainty [N/m].")
    prior_std: float = Field(ge=0, description="Standard uncertainty of the factor 1 before the fit [1].")
    factor: float = Field(description="Measured tangent over that of the model at small amplitude [1].")
    factor_std: float = Field(ge=0, description="Its standard uncertainty after the fit [1].")
    passive: list[RangeFile] = Field(
        default_factory=list,
        max_length=200,
        description="Range of K* below the band, as files before `ranges` have it.",
    )

    @classmethod
    def of(cls, loop: Loop | None, found: Fit, data: StiffnessData) -> StaticFile | None:
        """The record of a loop with the factor that a fit found; None without one, or if the model takes K1 at rest."""
        if loop is None or not found.model.relaxing:
            return None
        slopes: FloatArray = static_derivative(found.model, found.values, data)
        tangent = float(static_stiffness(found.model, found.values, data))
        factor, std = loop.factor(tangent, float(np.sqrt(max(float(slopes @ found.covariance @ slopes), 0.0))))
        ramp = loop.ramp
        return cls(
            branch_time=ramp.time,
            cycle=ramp.cycle,
            place=ramp.place,
            k1=loop.k1,
            k1_std=loop.k1_std,
            prior_std=loop.factor_std,
            factor=factor,
            factor_std=std,
        )

    def remark(self, frequency: float) -> str:
        """What K* at a frequency [Hz] below the measured band rests on."""
        near = _NEAR / self.branch_time
        joined = f"the static test ({self.branch_time:.3g} s per branch, as K' near {near:.2g} Hz)"
        text = f"below the measured band K* rests on {joined} and on the form of the model"
        if frequency < _LOWEST * near:
            return f"{text}; slower than that test nothing was measured, and u is that at {_LOWEST * near:.2g} Hz"
        return f"{text}; {IN_RANGE}"


def join_static(measured: MeasuredSet, path: Path, factor_std: float = FACTOR_STD) -> MeasuredSet:
    """The conditions with K1 as the tangent of the ramp of their static tests.

    Parameters
    ----------
    measured : MeasuredSet
    path : path
        Results folder, or a table in it.
    factor_std : float [1]
        Standard uncertainty of the factor between the tangent and that at the amplitude of the dynamic tests.

    Raises
    ------
    ModelError
        If a table, a column or the time of a loop is missing, or K1 of a condition is not that of its static tests.
    """
    tests = _StaticTests.read(path if path.is_dir() else path.parent)
    if not any(one.own.has_k1 for one in measured.conditions):
        raise ModelError(f"{measured.source}: no condition has K1: --static ramp needs static tests")
    conditions, notes = [], list(measured.notes)
    for one in measured.conditions:
        if not one.own.has_k1:
            notes.append(f"{one.label or one.tyre}: has no K1, so that no static test is joined")
            conditions.append(one)
            continue
        loop = Loop(tests.ramp(one), float(one.own.k1), float(one.own.k1_std), factor_std)
        conditions.append(replace(one, own=loop.joined(one.own), loop=loop))
    return replace(measured, conditions=tuple(conditions), notes=tuple(notes))


def slowest(loop: Loop | None) -> float:
    """Lowest frequency [Hz] of which the static test of a condition says something; infinite without one."""
    return np.inf if loop is None else _LOWEST * _NEAR / loop.ramp.time


@dataclass(frozen=True)
class _StaticTests:
    """Rows of static.csv, and deflection and load along the mean of each loop and its ends."""

    rows: Sequence[Mapping[str, Any]]
    loops: Mapping[str, Mapping[str, Any]]

    @classmethod
    def read(cls, folder: Path) -> _StaticTests:
        """The static tests of a results folder; ModelError if a table or a column is missing."""
        results = published_beside(folder / STATIC)
        for name in (STATIC, LOOPS):
            if not results.has(name):
                raise ModelError(
                    f"{folder}: has no {name}: --static ramp needs the results folder of fourpole analyse, with the "
                    "time and the loop of each static test; or state --static rest"
                )
        try:
            static = pl.read_csv(results.read(STATIC, max_bytes=MOST_BYTES), infer_schema=False)
            static = checked(static, STATIC, _NUMBERS).with_columns(cs.float().fill_nan(None))
            loops = pl.read_parquet(results.read(LOOPS, max_bytes=MOST_BYTES))
        except pl.exceptions.PolarsError as error:
            raise TableError(f"{folder}: {STATIC} or {LOOPS} is no table ({str(error).splitlines()[0]})") from None
        needed = {STATIC: (static, _COLUMNS), LOOPS: (loops, (q.TEST.head, *_MEAN, _DEFLECTION))}
        for name, (table, columns) in needed.items():
            lacking = [column for column in columns if column not in table.columns]
            if lacking:
                raise ModelError(f"{folder / name}: has no column {shown(lacking[0])}, which --static ramp needs")
        return cls(static.rows(named=True), {row[q.TEST.head]: row for row in loops.rows(named=True)})

    def ramp(self, one: Measured) -> Ramp:
        """The ramp of the static tests of a condition; ModelError if it is not known."""
        where = " at ".join(filter(None, (one.tyre, one.label)))
        rows = [row for row in self.rows if _is_of(row, one)]
        k1 = float(one.own.k1)
        if not rows or abs(np.mean([row[q.K1.head] for row in rows]) - k1) > _SAME_K1 * k1:
            there = f"is not that of the static tests {', '.join(str(row[q.TEST.head]) for row in rows)}"
            raise ModelError(
                f"{where}: K1 {there if rows else 'is of no static test of this condition'}: the time of its ramp is "
                "not known; state --static rest, or add a static test at this pressure and preload"
            )
        times = [_branch_time(where, row) for row in rows]
        if max(times) > (1 + _SAME_TIME) * min(times):
            raise ModelError(
                f"{where}: its static tests took {min(times):.3g} to {max(times):.3g} s per branch: --static ramp "
                "takes repeats of one duration"
            )
        cycle = min(int(row[q.CYCLE.head] or 1) for row in rows)
        try:
            return Ramp(float(np.mean(times)), cycle, float(np.mean([self._place(row) for row in rows])))
        except ModelError as error:
            raise ModelError(f"{where}: {error}") from None

    def _place(self, row: Mapping[str, Any]) -> float:
        """Deflection at the preload of a static test as a share of its branch [1]."""
        loop = self.loops.get(row[q.TEST.head], {})
        parts = [np.array(loop.get(column) or [], dtype=float) for column in (*_MEAN, _DEFLECTION)]
        if not all(part.size for part in parts):
            raise ModelError(f"{LOOPS} has no loop of static test {shown(str(row[q.TEST.head]))}")
        mean_x, mean_f, x = parts
        order = np.argsort(mean_f)
        place: FloatArray = np.interp(float(row[q.PRELOAD.head]), mean_f[order], mean_x[order])
        return float((place - x.min()) / (x.max() - x.min()))


_MEAN, _DEFLECTION = (q.MEAN_DEFLECTION.head, q.MEAN_LOAD.head), q.DEFLECTION.head
_COLUMNS = (
    q.TEST.head, q.TYRE.head, q.PRELOAD.head, q.K1.head, q.K1_OF.head, q.BRANCH_TIME.head, q.CYCLE.head, q.VERDICT.head
)  # fmt: skip
_NUMBERS = dict.fromkeys((*(axis.column for axis in AXES), q.K1.head, q.BRANCH_TIME.head, q.CYCLE.head), pl.Float64)


def _branch_time(where: str, row: Mapping[str, Any]) -> float:
    """The duration of a branch [s] of a static test; ModelError if it is no closed loop, or not stated."""
    name = shown(str(row[q.TEST.head]))
    if row[q.K1_OF.head] != "mean":
        raise ModelError(f"{where}: static test {name} is no closed loop: record loading and unloading")
    if not row[q.BRANCH_TIME.head]:
        raise ModelError(
            f"{where}: static test {name} states no time per branch: record its time, and name the channel `time` in "
            "campaign.toml; or state --static rest"
        )
    return float(row[q.BRANCH_TIME.head])


def _is_of(row: Mapping[str, Any], one: Measured) -> bool:
    """Whether a row of static.csv is used for a condition: of its tyre, pressure and preload, and not rejected."""
    tyre, k1 = str(row[q.TYRE.head] or ""), row[q.K1.head]
    if row[q.VERDICT.head] == Verdict.REJECTED or k1 is None:
        return False
    if one.tyre != tyre and not one.tyre.startswith((f"{tyre}, ", f"{tyre} at ")):
        return False
    own = {axis: one.state.get(axis.column) for axis in AXES}
    return all(axis.same(row.get(axis.column), value, blank=True) for axis, value in own.items())


def factor_sentence(fits: Sequence[Fit], loops: Sequence[Loop | None], data: Sequence[StiffnessData]) -> list[str]:
    """A sentence on the static tests that were joined and the factors found; none if no ramp was asked for."""
    model = fits[0].model
    if any(loops) and not model.relaxing:
        return [f"{model.name} is no sum of relaxing arms: K1 is at zero frequency, with the factor's uncertainty"]
    files = [one for row in zip(loops, fits, data, strict=True) if (one := StaticFile.of(*row)) is not None]
    if not files:
        return []
    times = sorted({f"{one.branch_time:.3g}" for one in files}, key=float)
    low, high = min(files, key=lambda one: one.factor), max(files, key=lambda one: one.factor)
    shown_factor = f"{low.factor:.4g} ± {low.factor_std:.2g}"
    if len(files) > 1:
        shown_factor += f" to {high.factor:.4g} ± {high.factor_std:.2g}"
    text = (
        f"The static test is joined as a ramp of {' to '.join(dict.fromkeys((times[0], times[-1])))} s per branch; its "
        f"tangent is {shown_factor} times that of the model (before the fit: 1 ± {low.prior_std:.2g})"
    )
    far = [one for one in files if one.prior_std and abs(one.factor - 1) > 2 * one.prior_std]
    if far:
        text += (
            ". This factor is beyond twice its stated uncertainty: the amplitude changes K1 by more than was stated, "
            "or the model does not hold at the rate of the static test"
        )
    return [text]
