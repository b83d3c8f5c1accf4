"""Two campaigns of a data set compared, as `fourpole compare` does with two folders of results."""

from __future__ import annotations

from pathlib import Path

import polars as pl

from fourpole import quantities as q
from fourpole.core.checks import Verdict
from fourpole.errors import CampaignError
from fourpole.findings.compared import RATIO, compared_by
from fourpole.findings.points import MOUNTING, none, of_two_campaigns
from fourpole.fitting.rows import rule_in
from fourpole.io.documents import json_of
from fourpole.io.door import read_bytes
from fourpole.lab.layout import CONDITIONS, FURTHER, INDEX, MOST_BYTES, STATED, TABLES, scan
from fourpole.study.study import Study

#: Cases of what two campaigns share.
_WAYS = ("independent", "same sensors")
_VALUES = (q.STORAGE, q.LOSS, q.LOSS_FACTOR, q.K2, q.C)


def difference(folder: str | Path, first: str, second: str) -> pl.DataFrame:
    r"""The second campaign less the first, at each condition and frequency that both have.

    .. math:: u^2 = \sum_s (u_{1s}^2 + u_{2s}^2 - 2 r_s u_{1s} u_{2s})

    over the sources s of the budgets. Two cases are given. If the campaigns are independent, r = 0. For "same sensors",
    r is by the rule of `fourpole.compare`: 1 for the errors of sensors with one serial number in both, of a rig that
    both state alike, and of weighed masses of one size, and for the gains of load and deflection in K1.

    Parameters
    ----------
    folder : path
        A data set of `gather`.
    first, second : str
        Names of the campaigns.

    Returns
    -------
    polars.DataFrame
        A row for each of K', K'', the loss factor, K2 and C at each condition and frequency of `first` that `second`
        has too, by the rule of one condition of both campaigns; repeats are averaged. Values of the second are brought
        to the frequency of the first by the slope over the neighbouring frequencies. `ratio` is the difference over its
        uncertainty: beyond 2 or -2, errors do not explain it (about 5 % of all ratios are, where nothing differs).

    Raises
    ------
    CampaignError
        If there is no such data set or campaign.

    Notes
    -----
    With r = 1 an error is taken to act in the same direction in both campaigns, which holds for the same route, rig and
    condition. Where K* differs by more than 20 %, no error of the dynamic test is taken as common, and none at all if
    the campaigns found K* by different routes. It is the computation of `fourpole.compare`.
    """
    names = scan(folder).select("campaign").unique().collect()["campaign"].sort().to_list()
    for name in (first, second):
        if name not in names:
            raise CampaignError(f"{folder}: has no campaign {name!r}: choose one of {', '.join(names)}")
    was, now = (_study(Path(folder), name) for name in (first, second))
    used = pl.col(q.VERDICT.head) != Verdict.REJECTED
    routes = [set(study.dynamic.filter(used)[q.ROUTE.head]) for study in (was, now)]
    common = of_two_campaigns(was, now)[0] if routes[0] == routes[1] else none
    tables = [compared_by(was, now, errors, _VALUES) for errors in (none, common)]
    shown = tables[0].select(
        pl.col("specimen").alias(q.TYRE.head),
        *(quantity.head for quantity in (q.PRESSURE, q.PRELOAD, q.TEMPERATURE, q.FREQUENCY)),
        *("quantity", "unit", "first", "second", "difference"),
    )
    return shown.with_columns(
        *(table["u(difference)"].alias(f"u {way}") for way, table in zip(_WAYS, tables, strict=True)),
        *(table[RATIO].alias(f"ratio {way}") for way, table in zip(_WAYS, tables, strict=True)),
    )


def _study(folder: Path, campaign: str) -> Study:
    """The results of one campaign of a data set, with its rule of one condition."""
    content = read_bytes(folder / INDEX, max_bytes=MOST_BYTES, within=folder)
    entry = json_of(content, INDEX)["campaigns"].get(campaign, {})
    record = {name: entry.get(name) for name in (CONDITIONS, STATED)}
    tables = {name: scan(folder, name).filter(pl.col("campaign") == campaign).collect() for name in TABLES}
    further = [json_of(text, FURTHER) if text else {} for text in tables["tests"][FURTHER].to_list()]
    heads = dict.fromkeys(head for row in further for head in row)
    axes = {MOUNTING, *(axis.column for axis in rule_in(record).further)}
    columns = [
        pl.Series(head, [row.get(head) for row in further], dtype=pl.String)
        for head in heads
        if head.removesuffix(" (tests.csv)") in axes
    ]
    return Study(tables={**tables, "dynamic": tables["tests"].with_columns(columns)}, record=record)
