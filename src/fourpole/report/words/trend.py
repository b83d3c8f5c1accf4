"""The sentence on the change of a quantity with pressure, load or frequency."""

from __future__ import annotations

from fourpole.findings.finding import UNSTATED, Finding, Holds
from fourpole.findings.trends import Extremum, Trend
from fourpole.report.words.phrases import (
    combinations,
    condition,
    joined,
    opening,
    percent,
    percents,
    setting,
    stretches,
)


def trend(finding: Finding, found: Trend) -> str:
    """One sentence on a trend, or that no change exceeds the uncertainty."""
    name = opening(finding)
    if found.extremum is not None:
        return f"{name} has its {_extremum(found, found.extremum)}."
    if finding.holds is Holds.NO_CHANGE:
        return f"{name} does not {_no_change(found)}."
    if finding.holds is Holds.MIXED:
        return f"{name}, between {span(found, 'and')}, {_piecewise(found)}."
    return f"{name} {_uniform(found)}."


def span(found: Trend, word: str = "to") -> str:
    """'1.00 to 2.40 bar'."""
    low, high = (setting(found.axis, end) for end in found.ends)
    return f"{low.rpartition(' ')[0]} {word} {high}"


def over(found: Trend) -> str:
    """The number of conditions over which the mean is taken, in words."""
    return combinations(found.rest, list(found.effects))


def _extremum(found: Trend, extremum: Extremum) -> str:
    what, off = ("maximum", "below") if extremum.holds is Holds.MAXIMUM else ("minimum", "above")
    return (
        f"{what} against {found.axis} at {setting(found.axis, extremum.at)}{_where(found)}: it is "
        f"{percent(abs(extremum.first.value))} {off} it at {setting(found.axis, found.ends[0])} and "
        f"{percent(abs(extremum.last.value))} {off} it at {setting(found.axis, found.ends[1])}"
    )


def _no_change(found: Trend) -> str:
    mean = found.mean
    vary = f"differ measurably between {span(found, 'and')}: it changes"
    if found.is_line:
        vary = f"vary measurably with {found.axis}: from {span(found)} it changes"
    signed = percent(mean.value) if mean.value < 0 else f"+{percent(mean.value)}"
    return f"{vary} by {signed}{_where(found)}, no more than the expanded uncertainty (95 %) of {percent(mean.reach())}"


def _uniform(found: Trend) -> str:
    up = found.holds is Holds.RISES
    low, high = (setting(found.axis, end) for end in found.ends)
    text = f"{'rises' if up else 'falls'} with {found.axis} from {span(found)}"
    if not found.is_line:
        text = f"is {'higher' if up else 'lower'} at {high} than at {low}"
    text += f", by {percent(abs(found.mean.value))}{_where(found)}"
    changes = [effect.value if up else -effect.value for effect in found.effects.values()]
    if len(changes) > 1:
        text += f" ({percents(changes)})" if percents(changes) != percent(abs(found.mean.value)) else ""
    silent = [value for value, effect in found.parts.items() if not effect.sign]
    if silent and found.split_by and len(silent) < len(found.parts):
        text += f"; at {stretches(found.split_by, silent, list(found.parts))} the change is within its uncertainty"
    return text


def _piecewise(found: Trend) -> str:
    axis, parts = found.split_by or found.axis, found.parts
    goes, last = f" with {found.axis}", setting(found.axis, found.ends[1])
    verbs = {1: f"rises{goes}", -1: f"falls{goes}", 0: f"does not vary measurably{goes}"}
    if not found.is_line:
        verbs = {1: f"is higher at {last}", -1: f"is lower at {last}", 0: "does not differ measurably"}
    said = []
    for sign in dict.fromkeys(effect.sign for effect in parts.values()):
        chosen = {value: abs(effect.value) for value, effect in parts.items() if effect.sign == sign}
        top = max(chosen, key=lambda value: chosen[value])
        much = f", by up to {percent(chosen[top])} at {setting(axis, top)}" if sign else ""
        said.append(f"{verbs[sign]} at {stretches(axis, list(chosen), list(parts))}{much}")
    text = joined(said) if len(said) < 3 else f"{'; '.join(said[:-1])}; and {said[-1]}"
    if found.zero is None:
        return text
    return f"{text}; the change with {found.axis} crosses zero at about {setting(axis, found.zero)}"


def _where(found: Trend) -> str:
    """The condition of a single change, or the number of conditions of a mean, in words."""
    if len(found.effects) == 1:
        (key,) = found.effects
        return f" at {condition(found.rest, key)}" if any(value != UNSTATED for value in key) else ""
    return f" on average over {over(found)}"
