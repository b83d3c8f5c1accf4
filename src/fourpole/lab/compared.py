"""Two campaigns compared: the difference of each quantity at the conditions that both have, and its uncertainty."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from fourpole import quantities as q
from fourpole.core.arrays import FloatArray
from fourpole.errors import CampaignError
from fourpole.lab.layout import ROLE, scan

#: Roles of the errors that two campaigns share if they used the same sensors, with one calibration, on the same rig.
_COMMON = ("channel", "rig", "mass", "ratio")
#: The errors of K1 that come from the sensors of load and deflection.
_COMMON_STATIC = "K1 gains"
#: Two tests have the same condition if these differ by less: relative, or in kelvin.
_NEAR = {q.PRESSURE.head: 0.02, q.PRELOAD.head: 0.01, q.FREQUENCY.head: 0.01}
_KELVIN = 5.0
_VALUES = (q.STORAGE, q.LOSS, q.LOSS_FACTOR, q.K2, q.C)
#: Frequencies of the second campaign within this distance of a test, in ln f, give the slope there.
_REACH = 0.7
#: Frequencies that are nearer to each other than this, in ln f, count as one.
_APART = 0.02
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
    condition and added mass.
    """
    tests = scan(folder).filter(pl.col("campaign").is_in([first, second])).collect()
    for name in (first, second):
        if name not in tests["campaign"]:
            raise CampaignError(f"{folder}: has no campaign {name!r}: choose one of {', '.join(_campaigns(folder))}")
    budget = scan(folder, "budget").filter(pl.col("campaign").is_in([first, second])).collect()
    pairs = _pairs(*(_usable(tests.filter(pl.col("campaign") == name)) for name in (first, second)))
    one, two = (_long(pairs, budget, name, end) for name, end in ((first, ""), (second, "_right")))
    key = (_ROW, q.QUANTITY.head)
    both = one.join(two, on=[*key, q.SOURCE.head], how="full", coalesce=True, suffix=" 2")
    common = (pl.coalesce(ROLE, f"{ROLE} 2").is_in(_COMMON)) | (pl.col(q.SOURCE.head) == _COMMON_STATIC)
    u1, u2 = pl.col("u").fill_null(0.0), pl.col("u 2").fill_null(0.0)
    found = both.group_by(key).agg(
        (u1**2 + u2**2).sum().alias("u independent"),
        pl.when(common).then((u1 - u2) ** 2).otherwise(u1**2 + u2**2).sum().alias("u same sensors"),
    )
    return _shown(pairs, found, _brought(pairs, _usable(tests.filter(pl.col("campaign") == second))))


def _campaigns(folder: str | Path) -> list[str]:
    """Names of the campaigns of a data set, in alphabetical order."""
    names: list[str] = scan(folder).select("campaign").unique().collect()["campaign"].sort().to_list()
    return names


def _usable(tests: pl.DataFrame) -> pl.DataFrame:
    """The tests with K* that were not rejected."""
    return tests.filter((pl.col(q.VERDICT.head) != "rejected") & pl.col(q.STORAGE.head).is_not_null())


def _pairs(one: pl.DataFrame, two: pl.DataFrame) -> pl.DataFrame:
    """Tests of the first with the nearest one of the second; columns of the second end in "_right"."""
    temperature = q.TEMPERATURE.head
    other = pl.col(f"{temperature}_right")
    near = [(pl.col(temperature) - other).abs().fill_null(0.0) <= _KELVIN]
    for head, limit in _NEAR.items():
        a, b = pl.col(head), pl.col(f"{head}_right")
        near.append(((a - b).abs() <= limit * pl.max_horizontal(a.abs(), b.abs())) | (a.is_null() & b.is_null()))
    apart = (pl.col(q.FREQUENCY.head) - pl.col(f"{q.FREQUENCY.head}_right")).abs()
    found = one.with_row_index(_ROW).join(two, on=_SAME, nulls_equal=True).filter(*near)
    return found.sort(_ROW, apart).unique(_ROW, keep="first", maintain_order=True)


def _long(pairs: pl.DataFrame, budget: pl.DataFrame, campaign: str, end: str) -> pl.DataFrame:
    """The budget of one side of each pair: row, quantity, source, role and u."""
    key = [q.TEST.head, q.POINT.head]
    side = pairs.select(_ROW, *(pl.col(f"{head}{end}").alias(head) for head in key))
    part = budget.filter(pl.col("campaign") == campaign)
    return side.join(part, on=key).select(_ROW, q.QUANTITY.head, q.SOURCE.head, ROLE, "u")


def _brought(pairs: pl.DataFrame, two: pl.DataFrame) -> pl.DataFrame:
    """Values of the second at the frequency of the first, with the uncertainty of that step: a row per pair."""
    names = [one.head for one in _VALUES]
    f1, f2 = (pairs[f"{q.FREQUENCY.head}{end}"].to_numpy() for end in ("", "_right"))
    others, values = _numbers(two, [q.FREQUENCY.head])[:, 0], _numbers(two, names)
    state = [q.PRESSURE.head, q.PRELOAD.head, q.TEMPERATURE.head]
    at, of = _numbers(pairs, [f"{head}_right" for head in state]), _numbers(two, state)
    limit = np.array([_NEAR[q.PRESSURE.head], _NEAR[q.PRELOAD.head], 0.0]) * np.abs(at) + np.array([0.0, 0.0, _KELVIN])
    texts = [f"{head}_right" if f"{head}_right" in pairs.columns else head for head in _SAME]
    same = list(zip(*(two[head].to_list() for head in _SAME), strict=True))
    moved, u = np.empty((pairs.height, len(names))), np.empty((pairs.height, len(names)))
    for row, texts_of in enumerate(zip(*(pairs[head].to_list() for head in texts), strict=True)):
        alike = ~(np.abs(of - at[row]) > limit[row]).any(axis=1) & np.array([one == texts_of for one in same])
        x = np.log(others[alike] / f1[row])
        near = np.abs(x) <= _REACH
        moved[row], u[row] = _step(x[near], values[alike][near], float(np.log(f2[row] / f1[row])))
    value = _numbers(pairs, [f"{name}_right" for name in names])
    unknown = ~np.isfinite(moved)  # K* of a passive linear specimen changes by less than the frequency does
    ends = np.abs(value * np.log(f2 / f1)[:, None])
    moved, u = np.where(unknown, 0.0, moved), np.where(unknown, ends, u)
    return pl.DataFrame(
        {
            _ROW: np.tile(pairs[_ROW].to_numpy(), len(names)),
            q.QUANTITY.head: np.repeat([name.partition(" [")[0] for name in names], pairs.height),
            "second": (value - moved).T.ravel(),
            "u step": u.T.ravel(),
        },
        schema_overrides={_ROW: pairs.schema[_ROW]},
    ).with_columns(pl.col("second", "u step").fill_nan(None))


def _numbers(table: pl.DataFrame, heads: list[str]) -> FloatArray:
    """Columns as an array (rows, heads); not-a-number where a value is blank."""
    return table.select(pl.col(heads).cast(pl.Float64).fill_null(float("nan"))).to_numpy()


def _step(x: FloatArray, values: FloatArray, end: float) -> tuple[Any, Any]:
    """Change of each value from x = 0 to `end`, by a parabola or a line, and its uncertainty; nan without a slope.

    The uncertainty is the difference of the two, or half of the change where three points are lacking.
    """
    order = np.sort(x)
    distinct = 1 + int(np.sum(np.diff(order) > _APART)) if x.size else 0
    if distinct < 2:
        return np.nan, np.nan
    line = np.polynomial.polynomial.polyfit(x, values, 1)[1] * end
    if distinct < 3:
        return line, np.abs(line) / 2
    slope, bend = np.polynomial.polynomial.polyfit(x, values, 2)[1:]
    return slope * end + bend * end**2, np.abs(slope * end + bend * end**2 - line)


def _shown(pairs: pl.DataFrame, found: pl.DataFrame, brought: pl.DataFrame) -> pl.DataFrame:
    """A row for each pair and quantity, with values, difference, uncertainties and ratios."""
    state = [q.TYRE.head, q.PRESSURE.head, q.PRELOAD.head, q.ADDED_MASS.head, q.FREQUENCY.head]
    rows = [
        pairs.select(
            _ROW,
            *state,
            pl.lit(one.head.partition(" [")[0]).alias(q.QUANTITY.head),
            pl.lit(one.head.rpartition("[")[2].rstrip("]")).alias(q.UNIT.head),
            pl.col(one.head).alias("first"),
        )
        for one in _VALUES
    ]
    key = [_ROW, q.QUANTITY.head]
    table = pl.concat(rows).join(brought, on=key).join(found, on=key, how="left")
    table = table.with_columns((pl.col("second") - pl.col("first")).alias("difference"))
    ways = ("independent", "same sensors")
    table = table.with_columns((pl.col(f"u {how}") + pl.col("u step") ** 2).sqrt().alias(f"u {how}") for how in ways)
    table = table.with_columns((pl.col("difference") / pl.col(f"u {how}")).alias(f"ratio {how}") for how in ways)
    columns = [*state, q.QUANTITY.head, q.UNIT.head, "first", "second", "difference"]
    columns += [f"{what} {how}" for what in ("u", "ratio") for how in ways]
    return table.filter(pl.col("difference").is_not_null()).sort(key).select(columns)
