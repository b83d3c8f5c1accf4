"""The sentence that compares two specimens."""

from __future__ import annotations

from collections.abc import Mapping

from fourpole.findings.comparisons import Comparison
from fourpole.findings.evidence import Effect
from fourpole.findings.finding import Finding, Holds, Key
from fourpole.report.words.phrases import combinations, condition, opening, percent, some

#: Largest number of conditions that a sentence lists; of more it gives their number.
_MOST_NAMED = 6
Effects = Mapping[Key, Effect]
Axes = tuple[str, ...]


def comparison(finding: Finding, found: Comparison) -> str:
    """The specimen that has more, by how much and where; or that no difference exceeds the uncertainty."""
    said, axes, mean = finding.quantity, finding.conditions.axes, found.mean
    assert said is not None
    where = _where(axes, list(found.effects), each=all(effect.sign == 1 for effect in found.effects.values()))
    if finding.holds is Holds.NO_DIFFERENCE:
        return (
            f"{opening(finding)} and {finding.specimens[1]} shows no difference beyond the uncertainty "
            f"{where}: that of {found.upper} is {percent(mean.value)} higher"
            f"{' on average' if len(found.effects) > 1 else ''}, no more than the expanded uncertainty (95 %) of "
            f"{percent(mean.reach())}."
        )
    if finding.holds is Holds.MIXED:
        return _mixed(said.column, axes, found)
    return (
        f"{found.upper} {said.more}: its {said.column} is above that of {found.lower} {where}"
        f"{_by(axes, found.effects, mean)}{_exceptions(axes, found.effects)}."
    )


def _where(axes: Axes, keys: list[Key], *, each: bool) -> str:
    if len(keys) == 1:
        return f"at {condition(axes, keys[0])}, the only condition in common"
    return f"at {'each of ' if each else ''}the {combinations(axes, keys)} in common"


def _by(axes: Axes, found: Effects, mean: Effect) -> str:
    if len(found) == 1:
        return f", by {percent(mean.value)} (standard uncertainty {percent(mean.std)})"
    low, high = (pick(found, key=lambda key: (found[key].value, key)) for pick in (min, max))
    return (
        f", by {percent(mean.value)} on average, from {percent(found[low].value)} "
        f"({condition(axes, low)}) to {percent(found[high].value)} ({condition(axes, high)})"
    )


def _exceptions(axes: Axes, found: Effects) -> str:
    silent = [key for key, effect in found.items() if effect.sign == 0]
    if not silent or len(silent) == len(found):
        return ""
    return f"; no difference beyond the uncertainty at {_listed(axes, silent, len(found))}"


def _mixed(symbol: str, axes: Axes, found: Comparison) -> str:
    parts = []
    for name, sign in ((found.upper, 1), (found.lower, -1), ("", 0)):
        keys = [key for key, effect in found.effects.items() if effect.sign == sign]
        if keys and sign:
            most = percent(max(abs(found.effects[key].value) for key in keys))
            much = f"by {'up to ' if len(keys) > 1 else ''}{most} at {_listed(axes, keys, len(found.effects))}"
            parts.append(f"{name} has the higher {symbol}, {much}")
        elif keys:
            where = _listed(axes, keys, len(found.effects))
            parts.append(f"there is no difference beyond the uncertainty at {where}")
    return f"{'; '.join(parts)}."


def _listed(axes: Axes, keys: list[Key], of: int) -> str:
    """'3 of 10 conditions in common (1.00 bar, 1000 N; ...)'."""
    named = some([f"({condition(axes, key)})" for key in keys], _MOST_NAMED)
    return f"{len(keys)} of {of} conditions in common{f': {named}' if len(keys) <= _MOST_NAMED else ''}"
