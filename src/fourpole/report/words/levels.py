"""Sentences on single quantities of single specimens: their level, their linearity, what a cycle loses."""

from __future__ import annotations

from collections.abc import Sequence

from fourpole.findings.finding import Finding, Holds
from fourpole.findings.levels import CycleLoss, Departure, Level
from fourpole.report.words.phrases import condition, counted, joined, opening, percents, ranged, shown

__all__ = ["cycle_loss", "level", "linearity"]

_LINEAR = {
    Holds.NEARLY_LINEAR: "nearly linear",
    Holds.NON_LINEAR: "non-linear",
    Holds.MARKEDLY_NON_LINEAR: "markedly non-linear",
}


def level(finding: Finding, found: Level) -> str:
    """Lowest and highest value, where, and how well they are known."""
    axes, values = finding.conditions.axes, found.values
    low, high = found.lowest, found.highest
    least, most = (shown(finding.quantity, values[key].value) for key in (low, high))
    known = f"standard uncertainty of {percents([each.std / each.value for each in values.values()])}"
    if low == high:
        return f"{opening(finding)} is {least} at {condition(axes, low)}, with a {known}."
    return (
        f"{opening(finding)} lies between {least} ({condition(axes, low)}) and {most} ({condition(axes, high)}), each "
        f"with a {known}."
    )


def linearity(finding: Finding, found: Departure) -> str:
    """How far the load-deflection curves are from straight lines."""
    count = len(found.shares)
    curves = "curve departs" if count == 1 else "curves depart"
    return (
        f"Under static load {finding.specimens[0]} is {_LINEAR[finding.holds]}: its load-deflection {curves} from a "
        f"straight line by {percents(found.shares)} of the load span ({counted(count, 'pressure')})."
    )


def cycle_loss(findings: Sequence[tuple[Finding, CycleLoss]]) -> str:
    """What a static cycle of all specimens loses, in one sentence."""
    parts = (
        f"{ranged(found.losses, 'J')} in {finding.specimens[0]} ({counted(len(found.losses), 'pressure')})"
        for finding, found in findings
    )
    return f"A static cycle of loading and unloading loses {joined(parts)}."
