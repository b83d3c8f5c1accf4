"""A plan in words: the uncertainty to expect as tables of text, and the remedies that reach a wanted uncertainty."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import polars as pl

from fourpole import quantities as q
from fourpole.core.confidence import COVERAGE_FACTOR
from fourpole.core.curvature import NOT_LINEAR
from fourpole.core.plan import PLAN_ROUTES, Advice, Outcome
from fourpole.planning.plan import AS_STATED, CampaignPlan

_SHORT = {"mobility": "mobility", "relative": "relative", "transmissibility": "transmiss.", "joint": "joint"}
#: Percent of U for one of u.
_PERCENT = 100 * COVERAGE_FACTOR
_MOST_FREQUENCIES = 16
_MOST_WAYS = 5
#: A remedy that leaves more than this share of the uncertainty is shown as no gain.
_NO_GAIN = 0.98


@dataclass(frozen=True)
class Expected:
    """The relative U to expect of one quantity: a row per frequency, a column per route and mass."""

    heads: tuple[str, ...]
    rows: list[tuple[str, ...]]


@dataclass(frozen=True)
class ExpectedTables:
    """Tables of K*, K2 and C, with the sentences before and after them."""

    heading: str
    tables: tuple[Expected, ...]
    notes: tuple[str, ...]


def expected_tables(frame: pl.DataFrame) -> ExpectedTables:
    """The table of a plan in words, in %; `frame` is what `plan_table` returned."""
    columns = _columns(frame)
    every = sorted(frame[q.FREQUENCY.head].unique().to_list())
    kept = every
    if len(every) > _MOST_FREQUENCIES:
        kept = [every[round(at * (len(every) - 1) / (_MOST_FREQUENCIES - 1))] for at in range(_MOST_FREQUENCIES)]
    tests = frame.select("rig", "test").n_unique()
    tables = []
    for quantity in (q.K_STAR, q.K2, q.C):
        median = pl.col(quantity.relative_head).median()
        found = [dict(one.group_by(q.FREQUENCY.head).agg(median).iter_rows()) for one in columns.values()]
        rows = [(f"{one:.4g} Hz", *(_percent(each.get(one)) for each in found)) for one in kept]
        tables.append(Expected((f"U({quantity.symbol}) [%]", *columns), rows))
    notes = []
    if len(kept) < len(every):
        notes.append(f"({len(kept)} of {len(every)} frequencies shown; plan.csv has all)")
    high = frame.filter(pl.col("plan") == AS_STATED)[q.K2.relative_head].max()
    if isinstance(high, float) and high > NOT_LINEAR:
        notes.append("(above some 60 % the true scatter has tails that no U describes)")
    heading = f"Relative U (k = 2) to expect, in %: {tests} tests, median over those of one frequency"
    return ExpectedTables(heading, tuple(tables), tuple(notes))


def _columns(frame: pl.DataFrame) -> dict[str, pl.DataFrame]:
    """Rows of the plan by the head of their column: each route as stated, then the joint route with each mass."""
    found = {}
    for (plan, route), rows in frame.group_by("plan", "route", maintain_order=True):
        if plan == AS_STATED:
            found[_SHORT[str(route)]] = rows
        elif route == "joint":
            found[f"joint+{str(plan).removeprefix('with ')}"] = rows
    order = [_SHORT[route] for route in PLAN_ROUTES]
    return dict(sorted(found.items(), key=lambda item: order.index(item[0]) if item[0] in order else len(order)))


def _percent(value: float | None) -> str:
    return "-" if value is None else f"{_PERCENT * value:.3g}"


@dataclass(frozen=True)
class Way:
    """A remedy or a combination: whether it reaches the goal, what it costs, what it leaves, and what to do."""

    mark: str
    duration: str
    leaves: str
    text: str

    @property
    def line(self) -> str:
        """The way in one line."""
        return f"{self.duration:>7}  {self.leaves}  {self.text}"


@dataclass(frozen=True)
class AdviceInWords:
    """What a plan reaches, and what would reach the wanted uncertainty.

    Attributes
    ----------
    goal : str
        What is wanted, and what the plan as it is gives.
    remarks : tuple of str
        That nothing more is needed, or what no dynamic test can mend.
    alone : tuple of Way
        Each remedy alone; empty if nothing more is needed.
    reaching : tuple of Way
        Remedies that reach the goal, least effort first.
    nearest : Way or None
        What comes nearest if nothing reaches it.
    """

    goal: str
    remarks: tuple[str, ...] = ()
    alone: tuple[Way, ...] = ()
    reaching: tuple[Way, ...] = ()
    nearest: Way | None = None


def advice_in_words(planned: CampaignPlan, advice: Sequence[Advice]) -> list[AdviceInWords]:
    """The advice on each rig of a plan."""
    several = len(planned.rigs) > 1
    return [
        _in_words(found, f"rig {item.name}: " if several else "")
        for item, found in zip(planned.rigs, advice, strict=False)
    ]


def _in_words(found: Advice, where: str) -> AdviceInWords:
    wanted = f"U of {_PERCENT * found.wanted:g} % (u of {100 * found.wanted:g} %)"
    goal = f"{wanted} of K2 and C (median over the tests, {found.route} route)"
    goal = f"{where}wanted {goal}; the plan as it is: {_leaves(found.now)}"
    if found.reached:
        return AdviceInWords(goal, ("reached: nothing more is needed",))
    remarks = []
    if found.of_k1 > found.wanted:
        remarks.append(
            f"K1 alone leaves U of {_PERCENT * found.of_k1:.2g} %, however good the dynamic tests are: "
            "every remedy needs better static tests"
        )
    return AdviceInWords(
        goal,
        tuple(remarks),
        tuple(_way(one, found) for one in found.alone),
        tuple(_way(one, found) for one in found.reaching[:_MOST_WAYS]),
        None if found.reaching else _way(found.nearest, found),
    )


def _way(outcome: Outcome, found: Advice) -> Way:
    mark = "reaches it" if outcome.worst <= found.wanted else "not enough"
    mark = "no gain" if outcome.worst > _NO_GAIN * found.now.worst else mark
    return Way(mark, _duration(outcome.minutes), _leaves(outcome), outcome.text)


def _duration(minutes: float) -> str:
    return f"{minutes:.0f} min" if minutes < 100 else f"{minutes / 60:.1f} h"


def _leaves(outcome: Outcome) -> str:
    return f"K2 {_PERCENT * outcome.k2:.2g} %, C {_PERCENT * outcome.c:.2g} %"
