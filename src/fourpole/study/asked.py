"""The quantities that are asked of each test, and the verdict on each."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace

import numpy as np

from fourpole import quantities as q
from fourpole.campaign.folder import Campaign
from fourpole.core.checks import Asked, Check, Code, Verdict, worst_verdict
from fourpole.study.points import Points
from fourpole.words import remark_of

_COLUMNS = {Asked.STIFFNESS: q.VERDICT_K, Asked.ARM: q.VERDICT_ARM, Asked.TR: q.VERDICT_TR}


def asked_only(campaign: Campaign, points: Points) -> Points:
    """The points with the checks that bear on what is asked of each; a rigid block keeps all."""
    rows = zip(_asked(campaign, points), points.checks, strict=True)
    return replace(points, checks=tuple(_bearing(checks, asked) if asked else checks for asked, checks in rows))


def verdict_columns(campaign: Campaign, points: Points) -> dict[q.Quantity, list[str]]:
    """Verdict and remarks of each row, and the verdict on each quantity; blank if it is not asked.

    That no passive K2 and C exist is an answer on the specimen, and no fault of a test: it counts where K2 or C stands
    in the statement.
    """
    columns: dict[q.Quantity, list[str]] = {
        q.VERDICT: [],
        q.REMARKS: [],
        **{column: [] for column in _COLUMNS.values()},
    }
    stated = Asked.ARM in campaign.stated.analysis.quantities
    for asked, checks in zip(_asked(campaign, points), points.checks, strict=True):
        doubts = [check for check in checks if check.verdict is not Verdict.OK]
        columns[q.VERDICT].append(worst_verdict(check.verdict for check in doubts if stated or not _says_no_arm(check)))
        columns[q.REMARKS].append("; ".join(dict.fromkeys(filter(None, map(remark_of, checks)))))
        for quantity, column in _COLUMNS.items():
            verdicts = (check.verdict for check in doubts if check.code.quantity in (Asked.STIFFNESS, quantity))
            columns[column].append(worst_verdict(verdicts) if quantity in asked else "")
    return columns


def expects_k1(campaign: Campaign) -> bool:
    """Whether a test without K1 lacks it: other tests are static ones, or K2 or C is asked for."""
    return bool(campaign.of_kind("static")) or Asked.ARM in campaign.stated.analysis.quantities


def _asked(campaign: Campaign, points: Points) -> Iterator[frozenset[Asked]]:
    """What is asked of each row: as stated, else K*, K2 and C where a K1 is or should be, and TR where a mass moves."""
    moving = {name for name, rig in campaign.stated.all_rigs.items() if not rig.rig().blocked}
    expected, stated = expects_k1(campaign), campaign.stated.analysis.quantities
    for test, condition, stiffness in zip(points.tests, points.condition, points.stiffness, strict=True):
        arm = np.isfinite(stiffness.value) or (expected and stiffness.lack is not None)
        can = {Asked.STIFFNESS: True, Asked.ARM: arm, Asked.TR: test.rig in moving}
        default = frozenset(quantity for quantity, possible in can.items() if possible)
        wanted = stated - (frozenset() if can[Asked.TR] else {Asked.TR}) or default
        yield wanted if condition >= 0 else frozenset()


def _bearing(checks: Sequence[Check], quantities: Collection[Asked]) -> tuple[Check, ...]:
    """The checks that bear on some quantities; what bears on K* bears on all."""
    bearing = {Asked.STIFFNESS, *quantities}
    return tuple(check for check in checks if check.code.quantity in bearing)


def _says_no_arm(check: Check) -> bool:
    """Whether a check says that no passive K2 and C exist."""
    return check.code is Code.PASSIVE_ARM and check.verdict is Verdict.REJECTED
