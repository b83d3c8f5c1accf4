"""Sentences on one quantity of one specimen: its level, its linearity, the energy loss of a static cycle."""

from __future__ import annotations

from collections.abc import Sequence

from fourpole.findings.finding import UNSTATED, Finding, Holds
from fourpole.findings.levels import CycleLoss, Departure, Level
from fourpole.report.words.phrases import condition, counted, joined, opening, percents, ranged, shown

_LINEAR = {
    Holds.NEARLY_LINEAR: "nearly linear",
    Holds.NON_LINEAR: "non-linear",
    Holds.MARKEDLY_NON_LINEAR: "markedly non-linear",
}


def level(finding: Finding, found: Level) -> str:
    """The lowest and the highest value, their conditions and their standard uncertainty, as a sentence."""
    axes, values = finding.conditions.axes, found.values
    low, high = (pick(values, key=lambda key: (values[key].value, key)) for pick in (min, max))
    least, most = (shown(finding.quantity, values[key].value) for key in (low, high))
    known = f"standard uncertainty of {percents([each.std / each.value for each in values.values()])}"
    if low == high:
        return f"{opening(finding)} is {least} at {condition(axes, low)}, with a {known}."
    return (
        f"{opening(finding)} lies between {least} ({condition(axes, low)}) and {most} ({condition(axes, high)}), each "
        f"with a {known}."
    )


def linearity(finding: Finding, found: Departure) -> str:
    """The departure of the load-deflection curves from straight lines, as a sentence."""
    count = len(found.values)
    curves = "curve departs" if count == 1 else "curves depart"
    return (
        f"Under static load {finding.specimens[0]} is {_LINEAR[finding.holds]}: its load-deflection {curves} from a "
        f"straight line by {percents(found.numbers)} of the load span{_pressures(found)}."
    )


def cycle_loss(findings: Sequence[Finding]) -> str:
    """The energy that a static cycle of each specimen loses, as one sentence."""
    parts = (
        f"{ranged(found.detail.numbers, 'J')} in {found.specimens[0]}{_pressures(found.detail)}"
        for found in findings
        if isinstance(found.detail, CycleLoss)
    )
    return f"A static cycle of loading and unloading loses {joined(parts)}."


def _pressures(found: Level) -> str:
    """The number of pressures in brackets; empty for a specimen without inflation."""
    stated = [key for key in found.values if UNSTATED not in key]
    return f" ({counted(len(found.values), 'pressure')})" if stated else ""
