"""Limits of a campaign: the largest source of uncertainty of K2 and C on each rig, and its cheapest remedy."""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt
from typing import Any

import numpy as np
import polars as pl

from fourpole import quantities as q
from fourpole.core.checks import Verdict
from fourpole.core.sources import Source
from fourpole.fitting.rows import KEY, keyed
from fourpole.report.digits import known
from fourpole.report.words.phrases import counted, percent
from fourpole.report.words.sources import About, remedy, source_in_words
from fourpole.study.record import stated_blocked
from fourpole.study.rig_estimate import NoteCode
from fourpole.study.study import Study
from fourpole.words import cause_words

_BUDGET = ("test", "quantity", "source", q.SHARE.head)
#: Quantities of budget.csv for which a limit is given.
_QUANTITIES = {one.column: one for one in (q.K2, q.C, q.STORAGE, q.LOSS)}
#: A second source is named if its share of the variance is at least this.
_WORTH_NAMING = 0.1
#: A source makes most of an uncertainty if its share of the variance is at least this.
_MOST_OF_IT = 0.5


@dataclass(frozen=True)
class Limit:
    """The largest source of uncertainty of one quantity on one rig.

    Attributes
    ----------
    rig, quantity : str
        Names as in the tables.
    source : Source
        The largest source of its uncertainty.
    share : float [1]
        Median share of the variance over the tests.
    relative : float or None [1]
        Median relative uncertainty of the quantity.
    tests : int
    remedy, text : str
        The remedy alone; the limit and the remedy in sentences.
    """

    rig: str
    quantity: str
    source: Source
    share: float
    relative: float | None
    tests: int
    remedy: str
    text: str

    @property
    def symbol(self) -> str:
        """The symbol of the quantity."""
        return _QUANTITIES[self.quantity].symbol


def limits(results: Study) -> list[Limit]:
    """The limit of K2 and C for each rig, and of K* where these are unknown; empty without a budget.

    After a weighed mass it is the limit of K'', too: the ordinary errors limit it, and a key of the campaign takes off
    each of them.

    Parameters
    ----------
    results : Study

    Returns
    -------
    list of Limit
        One limit per rig and quantity, sorted by rig. Rejected tests do not count.
    """
    budget = results.budget
    if budget.is_empty() or any(name not in budget.columns for name in _BUDGET):
        return []
    tests = results.dynamic.filter(pl.col("verdict") != Verdict.REJECTED)
    tests = keyed(tests).unique(KEY, maintain_order=True)
    rows = (
        keyed(budget)
        .select(*KEY, *_BUDGET[1:])
        .with_columns(pl.col(q.SHARE.head).cast(pl.Float64, strict=False).fill_nan(None))
        .drop_nulls()
        .join(tests.select(*KEY, pl.col("rig").fill_null("")), on=KEY, how="inner")
    )
    found = []
    for name in dict.fromkeys(tests["rig"].fill_null("").to_list()):
        here, about = rows.filter(pl.col("rig") == name), _about(results, tests, name)
        for quantity in _quantities(here, calibrated=about.joint and about.massed):
            part = here.filter(pl.col("quantity") == quantity)
            found.append(_limit(name, quantity, part, tests, about))
    return found


def _quantities(rows: pl.DataFrame, *, calibrated: bool) -> list[str]:
    present = set(rows["quantity"].to_list())
    found = [name for name in ("K2", "C") if name in present]
    wanted = (q.LOSS.column,) if found and calibrated else () if found else _QUANTITIES
    return [*found, *(name for name in wanted if name in present)]


def _median_shares(rows: pl.DataFrame) -> list[tuple[str, float]]:
    """Sources by their median share over the tests, the largest first; a test without a source counts as zero."""
    tests = rows.select(KEY).n_unique()
    shares = []
    for (source,), part in rows.group_by("source", maintain_order=True):
        values = part.group_by(KEY).agg(pl.col(q.SHARE.head).sum())[q.SHARE.head].to_numpy()
        padded = np.concatenate([values, np.zeros(tests - values.size)])
        shares.append((str(source), float(np.median(padded)), float(padded.mean())))
    shares.sort(key=lambda item: item[1:], reverse=True)
    return [(source, middle) for source, middle, _ in shares]


def _about(results: Study, tests: pl.DataFrame, rig: str) -> About:
    here = tests.filter(pl.col("rig").fill_null("") == rig)
    found = results.rig_named(rig)
    return About(
        joint="joint" in here["route"].to_list(),
        massed=any((known(mass) or 0.0) > 0 for mass in here[q.ADDED_MASS.head].to_list()),
        with_v2=any(known(v2) for v2 in here[q.V2.head].to_list()),
        fits=found.fits,
        scatter=NoteCode.SCATTER in found.notes,
        candidate=cause_words(found.candidates[0]) if found.candidates else "",
        blocked=stated_blocked(results.record, rig),
    )


def _limit(rig: str, quantity: str, rows: pl.DataFrame, tests: pl.DataFrame, about: About) -> Limit:
    shares, names = _median_shares(rows), rows["test"].unique()
    (source, share), *others = ((Source.read(text, rig), share) for text, share in shares)
    of_source = rows.filter(pl.col("source") == source.text).group_by(KEY).agg(pl.col(q.SHARE.head).sum())
    here = tests.join(rows.select(KEY).unique(), on=KEY, how="semi").join(of_source, on=KEY, how="left")
    relative, left = _relative(here, quantity), _relative(here, quantity, without=True)
    symbol = _QUANTITIES[quantity].symbol
    opening = (
        f"{symbol} is known to {percent(relative)} (median of {counted(len(names), 'test')}). " if relative else ""
    )
    much = "makes most of that" if share >= _MOST_OF_IT else "is the largest part of it"
    if not relative:
        much = f"makes most of the uncertainty of {symbol}" if share >= _MOST_OF_IT else f"limits {symbol} most"
    text = f"{opening}{_capital(source_in_words(source))} {much}, with {percent(share)} of the variance"
    if relative and left:
        text += f"; without it about {percent(left)} would be left"
    if others and others[0][1] >= _WORTH_NAMING:
        text += f". Next is {source_in_words(others[0][0])} with {percent(others[0][1])}"
    what = remedy(source, about)
    return Limit(rig, quantity, source, share, relative, len(names), what, f"{text}. Cheapest remedy: {what}.")


def _relative(tests: pl.DataFrame, quantity: str, *, without: bool = False) -> float | None:
    """Median relative uncertainty over tests [1]; `without` leaves out the share in each row."""
    value, std = _QUANTITIES[quantity].heads
    found = []
    for row in tests.rows(named=True):
        x, u, share = known(row.get(value)), known(row.get(std)), known(row.get(q.SHARE.head)) or 0.0
        if x and u is not None:
            found.append(u / abs(x) * sqrt(max(1.0 - share, 0.0) if without else 1.0))
    return float(np.median(found)) if found else None


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]


def limit_rows(found: list[Limit]) -> list[dict[str, Any]]:
    """The limits as rows for programs, one per rig and quantity."""
    return [
        {
            "rig": limit.rig,
            "quantity": limit.quantity,
            "source": limit.source.text,
            q.SHARE.head: limit.share,
            "relative uncertainty [1]": limit.relative,
            "tests": limit.tests,
            "remedy": limit.remedy,
        }
        for limit in found
    ]
