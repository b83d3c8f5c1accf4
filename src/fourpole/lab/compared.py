"""Two campaigns compared: the difference of each quantity at the conditions that both have, and its uncertainty."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import polars as pl

from fourpole import quantities as q
from fourpole.core.checks import Verdict
from fourpole.core.condition import Sameness
from fourpole.core.sources import Kind, Role, Source
from fourpole.errors import CampaignError
from fourpole.findings.common import none
from fourpole.findings.points import QUANTITIES, Common, Differences, Points, differences
from fourpole.fitting.rows import conditions_in
from fourpole.lab.layout import scan

#: Roles of the errors that two campaigns share if they used the same sensors, with one calibration, on the same rig.
_COMMON = (Role.CHANNEL, Role.RIG, Role.MASS, Role.RATIO)
#: Two tests have the same condition if these differ by less: relative, or in kelvin.
_NEAR = {q.PRESSURE.head: 0.02, q.PRELOAD.head: 0.01, q.FREQUENCY.head: 0.01}
_KELVIN = 5.0
_VALUES = (q.STORAGE, q.LOSS, q.LOSS_FACTOR, q.K2, q.C)
_SAME = (q.TYRE.head, q.ROUTE.head, q.ADDED_MASS.head)
_ROW = "row"


def difference(folder: str | Path, first: str, second: str) -> pl.DataFrame:
    r"""The second campaign less the first, for each test of the first that the second has at the same condition.

    .. math:: u^2 = \sum_s (u_{1s}^2 + u_{2s}^2 - 2 r_s u_{1s} u_{2s})

    over the sources s of the budgets. If the campaigns are independent, r = 0. If both used the same sensors, with one
    calibration, on the same rig, r = 1 for the errors of channels, rig and weighed masses, and for the gains of load
    and deflection in K1. The truth is one of the two, or lies between; the tables do not say which, so both are given.

    Parameters
    ----------
    folder : path
        A data set of `gather`.
    first, second : str
        Names of the campaigns.

    Returns
    -------
    polars.DataFrame
        A row for each quantity of each test of `first` that has a partner: the same specimen, route and added mass,
        pressure within 2 %, preload and frequency within 1 %, temperature within 5 K where both state it. The
        partner nearest in frequency is taken; its values are brought to the frequency of the first by the slope over
        the neighbouring frequencies of the second campaign. `ratio` is the difference over its uncertainty: beyond 2 or
        -2, errors do not explain it (about 5 % of all ratios are, where nothing differs).

    Raises
    ------
    CampaignError
        If there is no such data set or campaign.

    Notes
    -----
    With r = 1 an error is taken to act in the same direction in both campaigns, which holds for the same route, rig,
    condition and added mass. Where K* differs by more than 20 %, no error of the dynamic test is taken as common.
    """
    tests = scan(folder).filter(pl.col("campaign").is_in([first, second])).collect()
    for name in (first, second):
        if name not in tests["campaign"]:
            raise CampaignError(f"{folder}: has no campaign {name!r}: choose one of {', '.join(_campaigns(folder))}")
    budget = scan(folder, "budget").filter(pl.col("campaign").is_in([first, second])).collect()
    one, two = (_usable(tests.filter(pl.col("campaign") == name)) for name in (first, second))
    points = {
        name: Points.of(table, budget.filter(pl.col("campaign") == name), _groups(table))
        for name, table in ((first, one), (second, two))
    }
    pairs = _pairs(one, two)
    places = pairs[_ROW].to_numpy().astype(int), pairs[f"{_ROW}_right"].to_numpy().astype(int)
    found = {way: differences(points[first], points[second], places, common) for way, common in _WAYS.items()}
    return _shown(pairs, found)


def _campaigns(folder: str | Path) -> list[str]:
    """Names of the campaigns of a data set, in alphabetical order."""
    names: list[str] = scan(folder).select("campaign").unique().collect()["campaign"].sort().to_list()
    return names


def _usable(tests: pl.DataFrame) -> pl.DataFrame:
    """The tests with K* that were not rejected."""
    return tests.filter((pl.col(q.VERDICT.head) != Verdict.REJECTED) & pl.col(q.STORAGE.head).is_not_null())


def _pairs(one: pl.DataFrame, two: pl.DataFrame) -> pl.DataFrame:
    """Tests of the first with the nearest one of the second; columns of the second end in "_right"."""
    temperature = q.TEMPERATURE.head
    other = pl.col(f"{temperature}_right")
    near = [(pl.col(temperature) - other).abs().fill_null(0.0) <= _KELVIN]
    for head, limit in _NEAR.items():
        a, b = pl.col(head), pl.col(f"{head}_right")
        near.append(((a - b).abs() <= limit * pl.max_horizontal(a.abs(), b.abs())) | (a.is_null() & b.is_null()))
    apart = (pl.col(q.FREQUENCY.head) - pl.col(f"{q.FREQUENCY.head}_right")).abs()
    found = one.with_row_index(_ROW).join(two.with_row_index(_ROW), on=_SAME, nulls_equal=True).filter(*near)
    return found.sort(_ROW, apart).unique(_ROW, keep="first", maintain_order=True)


def _groups(table: pl.DataFrame) -> np.ndarray:
    """Number of the condition, route and added mass of each test."""
    conditions = Sameness().groups(conditions_in(table, Sameness()))
    texts = table.select(
        pl.concat_str([pl.col(head).cast(pl.String).fill_null("") for head in _SAME[1:]], separator="\n")
    )
    both = np.stack([conditions.astype(str), texts.to_series().to_numpy().astype(str)], axis=1)
    return np.asarray(np.unique(both, axis=0, return_inverse=True)[1]).ravel()


def _same_sensors(text: str) -> bool:
    """Whether the error of a source is common to campaigns with the same sensors on the same rig."""
    source = Source.read(text)
    return source.role in _COMMON or source.kind is Kind.K1_GAINS


#: What two campaigns share, by the name of the case.
_WAYS: Mapping[str, Common] = {"independent": none, "same sensors": _same_sensors}


def _shown(pairs: pl.DataFrame, found: Mapping[str, Differences]) -> pl.DataFrame:
    """A row for each pair and quantity, with values, difference, uncertainties and ratios."""
    state = [q.TYRE.head, q.PRESSURE.head, q.PRELOAD.head, q.ADDED_MASS.head, q.FREQUENCY.head]
    tables = []
    for quantity in _VALUES:
        at = QUANTITIES.index(quantity)
        any_of = next(iter(found.values()))
        first, second = any_of.first[:, at], any_of.second[:, at]
        numbers = {"first": first, "second": second, "difference": second - first}
        numbers |= {f"u {way}": each.u[:, at] for way, each in found.items()}
        with np.errstate(divide="ignore", invalid="ignore"):
            numbers |= {f"ratio {way}": (second - first) / each.u[:, at] for way, each in found.items()}
        texts = [
            pl.lit(quantity.column).alias(q.QUANTITY.head),
            pl.lit(quantity.unit).alias(q.UNIT.head),
        ]
        made = pl.DataFrame(numbers).fill_nan(None)
        tables.append(pl.concat([pairs.select(_ROW, *state, *texts), made], how="horizontal"))
    table = pl.concat(tables).filter(pl.col("difference").is_not_null())
    return table.sort(_ROW, q.QUANTITY.head).drop(_ROW)
