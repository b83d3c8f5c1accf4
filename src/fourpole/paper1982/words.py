"""Sentences on the twelve claims of the 1982 paper."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from fourpole.findings.facts import Finding, Holds
from fourpole.findings.trends import Effect, Trend
from fourpole.paper1982.claims import (
    CROSS,
    RADIAL,
    Above,
    ApartAt,
    Claim,
    Evidence,
    Isolation,
    Lack,
    Likewise,
    Need,
    NoCommonState,
    Nonlinear,
    OptimumAt,
    Order,
    Turning,
)
from fourpole.quantities import ShownUnits
from fourpole.report.digits import bar, combinations, condition, counted, joined, newton, percent, percents, ranged
from fourpole.report.words.levels import over, span
from fourpole.words import package_toml

_SENTENCES = package_toml("fourpole.paper1982")
#: The conclusions of the paper by number; a is its cross-ply and b its radial-ply.
STATEMENTS: dict[int, str] = {int(number): text for number, text in _SENTENCES["statements"].items()}
_NEEDS: dict[Need, str] = {Need[name]: text for name, text in _SENTENCES["needs"].items()}


@dataclass(frozen=True)
class Told:
    """How the evidence for a claim is told: the names of the tyres by their roles, and the units of the numbers."""

    labels: Mapping[str, str]
    units: ShownUnits


def claim(finding: Finding, found: Claim, units: ShownUnits) -> str:
    """One claim, whether it holds, and the numbers that decide, as a sentence."""
    roles = zip((CROSS, RADIAL), found.names, found.states, strict=True)
    labels = {role: _label(role, name, state) for role, name, state in roles}
    told = Told(labels, units)
    statement = STATEMENTS[found.number].format(a=labels[CROSS], b=labels[RADIAL])
    head = f"Claim {found.number} of the paper ({statement})"
    if isinstance(found.found, Lack):
        return f"{head} cannot be examined here: it needs {_lack(found.found, told)}."
    figures = _figures(found.found, told)
    if finding.holds is Holds.FALSE:
        return f"{head} does not hold here: {figures}."
    unsure = ", though not beyond the uncertainty" if finding.holds is Holds.TRUE_UNSURE else ""
    return f"{head} holds here{unsure}: {figures}."


def no_common_state(finding: Finding, _: NoCommonState, __: ShownUnits) -> str:
    """No claim is examined, because the two tyres were not tested in one state."""
    return (
        f"The claims of the paper cannot be examined here: {' and '.join(finding.specimens)} were not tested at a "
        "temperature in common, with the same values of further conditions."
    )


def summary(findings: Sequence[Finding]) -> str:
    """The number of the paper's claims that hold, as a sentence; empty where none was examined."""
    numbers: dict[Holds, list[str]] = {}
    for finding in findings:
        if isinstance(finding.detail, Claim):
            numbers.setdefault(finding.holds, []).append(str(finding.detail.number))
    if not numbers:
        return ""
    false, missing, unsure = (numbers.get(holds, []) for holds in (Holds.FALSE, Holds.NOT_EXAMINED, Holds.TRUE_UNSURE))
    held = len(numbers.get(Holds.TRUE, [])) + len(unsure)
    text = "All twelve claims of the 1982 paper hold here"
    if false or missing:
        text = f"Of the twelve claims of the 1982 paper {held or 'none'} {'holds' if held == 1 else 'hold'} here"
    if unsure:
        text += f" ({'claim' if len(unsure) == 1 else 'claims'} {joined(unsure)} not beyond the uncertainty)"
    if false:
        text += f", {joined(false)} {'does' if len(false) == 1 else 'do'} not"
    if missing:
        text += f"; {joined(missing)} cannot be examined"
    return text + "."


def _label(role: str, name: str, state: str) -> str:
    """The tyre by its role, with its name in the campaign if that differs, and its temperature if it had several."""
    named = role.replace("-", "") in re.sub(r"[^a-z]", "", name.lower())
    return f"the {role}{state}" if named else f"the {role} ({name}{state})"


def _lack(lack: Lack, told: Told) -> str:
    symbol = lack.quantity.column if lack.quantity else ""
    return _NEEDS[lack.need].format(of=f"{symbol} of {told.labels[lack.tyre]}" if lack.tyre else symbol)


def _changes(effects: Sequence[Effect]) -> str:
    return percents([effect.value for effect in effects])


def _above(found: Above, told: Told) -> str:
    effects, against = found.effects, found.against
    where = combinations(found.axes, list(effects))
    text = f"the difference is {_changes(list(effects.values()))} at {where} in common"
    if against and len(against) < len(effects):
        one = condition(found.axes, against[0], told.units)
        text += f", and the other way round at {len(against)} of them, such as {one}"
    return text


def _nonlinear(found: Nonlinear, told: Told) -> str:
    return (
        f"the curve departs from a straight line by {percents(found.cross)} of the load span for {told.labels[CROSS]} "
        f"and by {percents(found.radial)} for {told.labels[RADIAL]}, {ranged(found.ratios)} times as much, where more "
        "than 3 times is asked for"
    )


def _rising(found: Trend, told: Told) -> str:
    effects = list(found.effects.values())
    text = f"from {span(found, told.units)} it changes by {_changes(effects)} at {over(found)}"
    falling = sum(effect.value <= 0.0 for effect in effects)
    return f"{text} and falls at {falling} of them" if falling else text


def _optimum_at(at: OptimumAt, told: Told) -> str:
    ends = joined(f"{percent(drop)} below it at {bar(p, told.units)}" for p, drop in at.drops.items())
    return f"at {newton(at.load, told.units)} it is largest at {bar(at.pressure, told.units)} and {ends}"


def _apart(at: ApartAt, told: Told) -> str:
    low, high = (bar(p, told.units) for p in at.pressures)
    load, other = (newton(one, told.units) for one in at.loads)
    return (
        f"C of {told.labels[at.tyre]} at {load} exceeds that at {other} by {percent(at.high.value)} at {high} "
        f"(U {percent(at.high.reach())}) and by {percent(at.low.value)} at {low}"
    )


def _turning(found: Turning, told: Told) -> str:
    low, high = (bar(end, told.units) for end in found.ends)
    said = []
    for at in found.loads:
        changes = [_changes(band) for band in at.bands]
        said.append(
            f"at {newton(at.load, told.units)} it changes by {changes[0]} up to 16 Hz, by {changes[1]} between 16.5 "
            f"and 18.5 Hz, and by {changes[2]} above 19 Hz"
        )
    return f"from {low.rpartition(' ')[0]} to {high}, {'; '.join(said)}"


def _likewise(found: Likewise, told: Told) -> str:
    return (
        f"its change with pressure {'turns' if found.turns else 'does not turn'} from fall to rise between 16 and "
        f"19 Hz; with frequency, {_figures(found.rising, told)}; against {told.labels[RADIAL]}, "
        f"{_figures(found.above, told)}"
    )


def _isolation(found: Isolation, told: Told) -> str:
    radial, cross = told.labels[RADIAL], told.labels[CROSS]
    return (
        f"at {joined(bar(p, told.units) for p in found.pressures)}, TR of {radial} is {_changes(found.below)} higher "
        f"than that of {cross} below 16.8 Hz, and that of {cross} {_changes(found.beyond)} higher above 19.2 Hz"
    )


def _order(found: Order, told: Told) -> str:
    return (
        f"the largest measured TR of {told.labels[RADIAL]} stands at {ranged(found.radial, 'Hz')} and that of "
        f"{told.labels[CROSS]} at {ranged(found.cross, 'Hz')}, {ranged(found.gaps, 'Hz', 2)} higher, at "
        f"{counted(len(found.gaps), 'condition')} in common"
    )


_WORDS: dict[type, Callable[[Any, Told], str]] = {
    Above: _above,
    Nonlinear: _nonlinear,
    Trend: _rising,
    OptimumAt: _optimum_at,
    ApartAt: _apart,
    Turning: _turning,
    Likewise: _likewise,
    Isolation: _isolation,
    Order: _order,
}


def _figures(found: Evidence, told: Told) -> str:
    """The numbers that decide a claim, in words."""
    if isinstance(found, tuple):
        first = "averaged over frequency, " if isinstance(found[0], OptimumAt) else ""
        return first + "; ".join(_WORDS[type(one)](one, told) for one in found)
    return _WORDS[type(found)](found, told)


#: The sentence of each kind of finding of this room.
TEMPLATES: dict[type, Callable[[Finding, Any, ShownUnits], str]] = {Claim: claim, NoCommonState: no_common_state}
