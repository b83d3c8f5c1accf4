"""Sentences on quantities: levels, comparisons and changes, and the transmissibility."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from fourpole.core.confidence import COVERAGE_FACTOR
from fourpole.findings.facts import UNSTATED, Finding, Holds, Key
from fourpole.findings.resonances import Crossing, Crossings, Peak, Prediction, Resonance, ResonanceOrder
from fourpole.findings.trends import Comparison, CycleLoss, Departure, Effect, Extremum, Level, Trend
from fourpole.quantities import ShownUnits
from fourpole.report.digits import (
    bar,
    combinations,
    condition,
    counted,
    each_of,
    hertz,
    joined,
    newton,
    opening,
    percent,
    percents,
    plain_number,
    ranged,
    setting,
    shown,
    some,
    stretches,
)


def level(finding: Finding, found: Level, units: ShownUnits) -> str:
    """The lowest and the highest value, their conditions and their U, as a sentence."""
    axes, values = finding.conditions.axes, found.values
    low, high = (pick(values, key=lambda key: (values[key].value, key)) for pick in (min, max))
    least, most = (shown(finding.quantity, values[key].value, units) for key in (low, high))
    known = f"U of {percents([COVERAGE_FACTOR * each.std / each.value for each in values.values()])}"
    if low == high:
        return f"{opening(finding)} is {least} at {condition(axes, low, units)}, with {known} (k = 2)."
    return (
        f"{opening(finding)} lies between {least} ({condition(axes, low, units)}) and {most} "
        f"({condition(axes, high, units)}), each with {known} (k = 2)."
    )


def linearity(finding: Finding, found: Departure, _: ShownUnits) -> str:
    """The departure of the load-deflection curves from straight lines, as a sentence."""
    count = len(found.values)
    curves = "curve departs" if count == 1 else "curves depart"
    return (
        f"Under static load {finding.specimens[0]} is {finding.holds}: its load-deflection {curves} from a "
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


#: Largest number of conditions that a sentence lists; of more it gives their number.
_MOST_NAMED = 6
Effects = Mapping[Key, Effect]
Axes = tuple[str, ...]


def comparison(finding: Finding, found: Comparison, units: ShownUnits) -> str:
    """The specimen that has more, by how much and where; or that no difference exceeds the uncertainty."""
    said, axes, mean = finding.quantity, finding.conditions.axes, found.mean
    assert said is not None
    each = all(effect.sign == 1 for effect in found.effects.values())
    where = _where_in_common(axes, list(found.effects), units, each=each)
    if finding.holds is Holds.NO_DIFFERENCE:
        return (
            f"{opening(finding)} and {finding.specimens[1]} shows no difference beyond the uncertainty "
            f"{where}: that of {found.upper} is {percent(mean.value)} higher"
            f"{' on average' if len(found.effects) > 1 else ''}, no more than the expanded uncertainty (95 %) of "
            f"{percent(mean.reach())}."
        )
    if finding.holds is Holds.MIXED:
        return _mixed(said.column, axes, found, units)
    return (
        f"{found.upper} {said.more}: its {said.column} is above that of {found.lower} {where}"
        f"{_by(axes, found.effects, mean, units)}{_exceptions(axes, found.effects, units)}."
    )


def _where_in_common(axes: Axes, keys: list[Key], units: ShownUnits, *, each: bool) -> str:
    if len(keys) == 1:
        return f"at {condition(axes, keys[0], units)}, the only condition in common"
    return f"at {'each of ' if each else ''}the {combinations(axes, keys)} in common"


def _by(axes: Axes, found: Effects, mean: Effect, units: ShownUnits) -> str:
    if len(found) == 1:
        return f", by {percent(mean.value)} (U {percent(mean.reach())})"
    low, high = (pick(found, key=lambda key: (found[key].value, key)) for pick in (min, max))
    return (
        f", by {percent(mean.value)} on average, from {percent(found[low].value)} "
        f"({condition(axes, low, units)}) to {percent(found[high].value)} ({condition(axes, high, units)})"
    )


def _exceptions(axes: Axes, found: Effects, units: ShownUnits) -> str:
    silent = [key for key, effect in found.items() if effect.sign == 0]
    if not silent or len(silent) == len(found):
        return ""
    return f"; no difference beyond the uncertainty at {_listed(axes, silent, len(found), units)}"


def _mixed(symbol: str, axes: Axes, found: Comparison, units: ShownUnits) -> str:
    parts = []
    for name, sign in ((found.upper, 1), (found.lower, -1), ("", 0)):
        keys = [key for key, effect in found.effects.items() if effect.sign == sign]
        if keys and sign:
            most = percent(max(abs(found.effects[key].value) for key in keys))
            much = f"by {'up to ' if len(keys) > 1 else ''}{most} at {_listed(axes, keys, len(found.effects), units)}"
            parts.append(f"{name} has the higher {symbol}, {much}")
        elif keys:
            where = _listed(axes, keys, len(found.effects), units)
            parts.append(f"there is no difference beyond the uncertainty at {where}")
    return f"{'; '.join(parts)}."


def _listed(axes: Axes, keys: list[Key], of: int, units: ShownUnits) -> str:
    """'3 of 10 conditions in common (1.00 bar, 1000 N; ...)'."""
    named = some([f"({condition(axes, key, units)})" for key in keys], _MOST_NAMED)
    return f"{len(keys)} of {of} conditions in common{f': {named}' if len(keys) <= _MOST_NAMED else ''}"


def trend(finding: Finding, found: Trend, units: ShownUnits) -> str:
    """One sentence on a trend, or that no change exceeds the uncertainty."""
    name = opening(finding)
    if found.extremum is not None:
        return f"{name} has its {_extremum(found, found.extremum, units)}."
    if finding.holds is Holds.NO_CHANGE:
        return f"{name} does not {_no_change(found, units)}."
    if finding.holds is Holds.MIXED:
        return f"{name}, between {span(found, units, 'and')}, {_piecewise(found, units)}."
    return f"{name} {_uniform(found, units)}."


def span(found: Trend, units: ShownUnits, word: str = "to") -> str:
    """'1.00 to 2.40 bar'."""
    low, high = (setting(found.axis, end, units) for end in found.ends)
    return f"{low.rpartition(' ')[0]} {word} {high}"


def over(found: Trend) -> str:
    """The number of conditions over which the mean is taken, in words."""
    return combinations(found.rest, list(found.effects))


def _extremum(found: Trend, extremum: Extremum, units: ShownUnits) -> str:
    what, off = ("maximum", "below") if extremum.holds is Holds.MAXIMUM else ("minimum", "above")
    return (
        f"{what} against {found.axis} at {setting(found.axis, extremum.place, units)}{_where(found, units)}: it is "
        f"{percent(abs(extremum.first.value))} {off} it at {setting(found.axis, found.ends[0], units)} and "
        f"{percent(abs(extremum.last.value))} {off} it at {setting(found.axis, found.ends[1], units)}"
    )


def _no_change(found: Trend, units: ShownUnits) -> str:
    mean = found.mean
    vary = f"differ measurably between {span(found, units, 'and')}: it changes"
    if found.is_line:
        vary = f"vary measurably with {found.axis}: from {span(found, units)} it changes"
    signed = percent(mean.value) if mean.value < 0 else f"+{percent(mean.value)}"
    where = _where(found, units)
    return f"{vary} by {signed}{where}, no more than the expanded uncertainty (95 %) of {percent(mean.reach())}"


def _uniform(found: Trend, units: ShownUnits) -> str:
    up = found.holds is Holds.RISES
    low, high = (setting(found.axis, end, units) for end in found.ends)
    text = f"{'rises' if up else 'falls'} with {found.axis} from {span(found, units)}"
    if not found.is_line:
        text = f"is {'higher' if up else 'lower'} at {high} than at {low}"
    text += f", by {percent(abs(found.mean.value))}{_where(found, units)}"
    changes = [effect.value if up else -effect.value for effect in found.effects.values()]
    if len(changes) > 1:
        text += f" ({percents(changes)})" if percents(changes) != percent(abs(found.mean.value)) else ""
    silent = [value for value, effect in found.parts.items() if not effect.sign]
    if silent and found.split_by and len(silent) < len(found.parts):
        where = stretches(found.split_by, silent, list(found.parts), units)
        text += f"; at {where} the change is within its uncertainty"
    return text


def _piecewise(found: Trend, units: ShownUnits) -> str:
    axis, parts = found.split_by or found.axis, found.parts
    goes, last = f" with {found.axis}", setting(found.axis, found.ends[1], units)
    verbs = {1: f"rises{goes}", -1: f"falls{goes}", 0: f"does not vary measurably{goes}"}
    if not found.is_line:
        verbs = {1: f"is higher at {last}", -1: f"is lower at {last}", 0: "does not differ measurably"}
    said = []
    for sign in dict.fromkeys(effect.sign for effect in parts.values()):
        chosen = {value: abs(effect.value) for value, effect in parts.items() if effect.sign == sign}
        top = max(chosen, key=lambda value: chosen[value])
        much = f", by up to {percent(chosen[top])} at {setting(axis, top, units)}" if sign else ""
        said.append(f"{verbs[sign]} at {stretches(axis, list(chosen), list(parts), units)}{much}")
    text = joined(said) if len(said) < 3 else f"{'; '.join(said[:-1])}; and {said[-1]}"
    if found.zero is None:
        return text
    return f"{text}; the change with {found.axis} crosses zero at about {setting(axis, found.zero, units)}"


def _where(found: Trend, units: ShownUnits) -> str:
    """The condition of a single change, or the number of conditions of a mean, in words."""
    if len(found.effects) == 1:
        (key,) = found.effects
        return f" at {condition(found.rest, key, units)}" if any(value != UNSTATED for value in key) else ""
    return f" on average over {over(found)}"


_AXES = ("pressure", "load")
#: Largest number of resonances or conditions that are listed; of more, the range or the number is given.
_MOST_LISTED = 8


def _names(finding: Finding) -> list[str]:
    """The specimens, each with its rig and added mass where there are any."""
    setup = finding.conditions.setup
    parts = [f"rig {setup.rig}"] if setup.rig else []
    if setup.added_mass > 0.0:
        parts.append(f"{setup.added_mass:g} kg added")
    about = f" ({' and '.join(parts)})" if parts else ""
    return [f"{name}{about}" for name in finding.specimens]


def resonance(finding: Finding, found: Resonance, units: ShownUnits) -> str:
    """The largest TR of a specimen: as resonances under one load, or at an end of the tested frequencies."""
    if finding.holds is Holds.INSIDE:
        return _inside(finding, found, units)
    at = [
        f"{plain_number(one.tr)} at {hertz(one.frequency)} ({condition(_AXES, key, units)})"
        for key, one in found.peaks.items()
    ]
    return (
        f"The largest TR of {_names(finding)[0]} stands at the "
        f"{'lowest' if finding.holds is Holds.AT_LOWEST else 'highest'} tested frequency, beyond which the resonance "
        f"may lie: {some(at, _MOST_LISTED)}."
    )


def _inside(finding: Finding, found: Resonance, units: ShownUnits) -> str:
    """The resonances of a specimen under one load, pressure by pressure."""
    peaks = found.peaks.values()
    load = next(iter(found.peaks))[1]
    name = f"{_names(finding)[0]}{f' at {newton(load, units)}' if load > 0 else ''} resonates"
    if len(peaks) > _MOST_LISTED:
        span = ranged([each.best for each in peaks], "Hz")
        heights = ranged([each.tr for each in peaks])
        return f"{name} at {span} over {len(peaks)} pressures; the largest TR is {heights}."
    where = [f" ({bar(key[0], units)})" if key[0] > 0 else "" for key in found.peaks]
    if all(each.top is not None for each in peaks):
        at = f"at about {joined(f'{plain_number(each.best)} Hz{p}' for each, p in zip(peaks, where, strict=True))}"
    else:
        at = joined(f"{_at(each)}{p}" for each, p in zip(peaks, where, strict=True))
    heights = joined(f"{plain_number(each.tr)}{p}" for each, p in zip(peaks, where, strict=True))
    return f"{name} {at}; the largest measured TR is {heights}."


def _at(found: Peak) -> str:
    if found.top is not None:
        return f"at about {plain_number(found.top)} Hz"
    return f"between the tested frequencies {plain_number(found.low)} and {plain_number(found.high)} Hz"


def order(finding: Finding, found: ResonanceOrder, _: ShownUnits) -> str:
    """Sentence that names the specimen with the lower resonance, of two specimens."""
    first, second = _names(finding)
    lower, upper = (first, second) if found.mean > 0 else (second, first)
    count, (clear, against) = len(found.gaps), found.counts
    if finding.holds in (Holds.ABOVE, Holds.BELOW):
        gaps = [abs(gap) for gap in found.gaps.values()]
        return (
            f"The resonance of {lower} lies below that of {upper} at {each_of(count)} in common, by "
            f"{ranged(gaps, 'Hz', 2)}."
        )
    if finding.holds is Holds.NO_DIFFERENCE:
        return (
            f"The resonances of {first} and {second} cannot be distinguished at "
            f"{each_of(count)} in common: the tested frequencies resolve them to "
            f"{plain_number(max(found.doubts.values()), 2)} Hz."
        )
    return (
        f"The resonance of {lower} lies below that of {upper} at {clear} of {counted(count, 'condition')} in common, "
        f"above it at {against or 'none'}, and cannot be distinguished from it at {count - clear - against or 'none'}."
    )


def crossings(finding: Finding, found: Crossings, units: ShownUnits) -> str:
    """The frequencies at which the TR curves of two specimens cross, and which curve is lower on either side."""
    first, second = _names(finding)
    names = f"The TR curves of {first} and {second}"
    if finding.holds is Holds.NO_CROSSING:
        return f"{names} do not cross beyond their uncertainty at {each_of(len(found.crossings))} in common."
    texts = []
    if found.single:
        at = each_of(len(found.crossings))
        if len(found.single) < len(found.crossings):
            at = f"{len(found.single)} of {counted(len(found.crossings), 'condition')}"
        texts.append(f"cross once at {at} in common, {_crossed(found.single, units)}{_below(found, first, second)}")
    if found.several:
        listed = [f"{joined(map(_crossing, at))} ({condition(_AXES, key, units)})" for key, at in found.several.items()]
        texts.append(f"cross more than once, at {some(listed, _MOST_LISTED)}")
    return f"{names} {' and '.join(texts)}."


def _crossing(found: Crossing) -> str:
    """The frequency, as '18.2 Hz', if the crossing is resolved; else the tested frequencies on either side."""
    return (
        f"{plain_number(found.frequency)} Hz"
        if found.resolved
        else f"{plain_number(found.low)} to {plain_number(found.high)} Hz"
    )


def _crossed(single: Mapping[Key, Crossing], units: ShownUnits) -> str:
    found = list(single.values())
    if not all(one.resolved for one in found):
        low, high = min(one.low for one in found), max(one.high for one in found)
        return f"between the tested frequencies {plain_number(low)} and {plain_number(high)} Hz"
    if len(found) == 1:
        return f"at about {_crossing(found[0])}"
    first, last = (pick(single, key=lambda key: (single[key].frequency, key)) for pick in (min, max))
    mean = plain_number(float(np.mean([one.frequency for one in found])))
    return (
        f"between {_crossing(single[first])} ({condition(_AXES, first, units)}) and {_crossing(single[last])} "
        f"({condition(_AXES, last, units)}), at {mean} Hz on average"
    )


def _below(found: Crossings, first: str, second: str) -> str:
    """Words on which curve is lower below and above the crossing; empty if that depends on the condition."""
    signs = {one.sign for one in found.single.values()}
    if len(signs) > 1:
        return ""
    lower, upper = (first, second) if signs == {1} else (second, first)
    return f"; below it {lower} has the lower TR, above it {upper}"


def prediction(_: Finding, found: Prediction, __: ShownUnits) -> str:
    """The departure of the measured TR from the predicted one, as a sentence."""
    mean, count, worst = percent(found.mean), len(found.off), found.worst
    opening = f"The measured TR of test {worst} differs from the predicted one by {mean}"
    if count > 1:
        opening = (
            f"The measured TR differs from the one predicted from K* and the rig by {mean} on average over "
            f"{counted(count, 'test')} and by {percent(found.off[worst])} at most (test {worst})"
        )
    beyond = f"beyond the uncertainty in {some(found.beyond)}" if found.beyond else "within the uncertainty"
    return f"{opening}, which is {beyond}."
