"""Sentences on the transmissibility: resonances, crossings, measured against predicted."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from fourpole.findings.facts import Finding, Holds, Key
from fourpole.findings.resonances import Crossing, Crossings, Peak, Prediction, Resonance, ResonanceOrder
from fourpole.report.words.phrases import (
    bar,
    condition,
    counted,
    each_of,
    hertz,
    joined,
    newton,
    number,
    percent,
    ranged,
    some,
)

_AXES = ("pressure", "load")
#: Largest number of resonances or conditions that are listed; of more, the range or the number is given.
_MOST_NAMED = 8


def _names(finding: Finding) -> list[str]:
    """The specimens, each with its rig and added mass where there are any."""
    setup = finding.conditions.setup
    parts = [f"rig {setup.rig}"] if setup.rig else []
    if setup.added_mass > 0.0:
        parts.append(f"{setup.added_mass:g} kg added")
    about = f" ({' and '.join(parts)})" if parts else ""
    return [f"{name}{about}" for name in finding.specimens]


def resonance(finding: Finding, found: Resonance) -> str:
    """The largest TR of a specimen: as resonances under one load, or at an end of the tested frequencies."""
    if finding.holds is Holds.INSIDE:
        return _inside(finding, found)
    at = [f"{number(one.tr)} at {hertz(one.frequency)} ({condition(_AXES, key)})" for key, one in found.peaks.items()]
    return (
        f"The largest TR of {_names(finding)[0]} stands at the "
        f"{'lowest' if finding.holds is Holds.AT_LOWEST else 'highest'} tested frequency, beyond which the resonance "
        f"may lie: {some(at, _MOST_NAMED)}."
    )


def _inside(finding: Finding, found: Resonance) -> str:
    """The resonances of a specimen under one load, pressure by pressure."""
    peaks = found.peaks.values()
    load = next(iter(found.peaks))[1]
    name = f"{_names(finding)[0]}{f' at {newton(load)}' if load > 0 else ''} resonates"
    if len(peaks) > _MOST_NAMED:
        span = ranged([each.best for each in peaks], "Hz")
        heights = ranged([each.tr for each in peaks])
        return f"{name} at {span} over {len(peaks)} pressures; the largest TR is {heights}."
    where = [f" ({bar(key[0])})" if key[0] > 0 else "" for key in found.peaks]
    if all(each.top is not None for each in peaks):
        at = f"at about {joined(f'{number(each.best)} Hz{p}' for each, p in zip(peaks, where, strict=True))}"
    else:
        at = joined(f"{_at(each)}{p}" for each, p in zip(peaks, where, strict=True))
    heights = joined(f"{number(each.tr)}{p}" for each, p in zip(peaks, where, strict=True))
    return f"{name} {at}; the largest measured TR is {heights}."


def _at(found: Peak) -> str:
    if found.top is not None:
        return f"at about {number(found.top)} Hz"
    return f"between the tested frequencies {number(found.low)} and {number(found.high)} Hz"


def order(finding: Finding, found: ResonanceOrder) -> str:
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
            f"{number(max(found.doubts.values()), 2)} Hz."
        )
    return (
        f"The resonance of {lower} lies below that of {upper} at {clear} of {counted(count, 'condition')} in common, "
        f"above it at {against or 'none'}, and cannot be distinguished from it at {count - clear - against or 'none'}."
    )


def crossings(finding: Finding, found: Crossings) -> str:
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
        texts.append(f"cross once at {at} in common, {_crossed(found.single)}{_below(found, first, second)}")
    if found.several:
        listed = [f"{joined(map(_crossing, at))} ({condition(_AXES, key)})" for key, at in found.several.items()]
        texts.append(f"cross more than once, at {some(listed, _MOST_NAMED)}")
    return f"{names} {' and '.join(texts)}."


def _crossing(found: Crossing) -> str:
    """The frequency, as '18.2 Hz', if the crossing is resolved; else the tested frequencies on either side."""
    return f"{number(found.frequency)} Hz" if found.resolved else f"{number(found.low)} to {number(found.high)} Hz"


def _crossed(single: Mapping[Key, Crossing]) -> str:
    found = list(single.values())
    if not all(one.resolved for one in found):
        low, high = min(one.low for one in found), max(one.high for one in found)
        return f"between the tested frequencies {number(low)} and {number(high)} Hz"
    if len(found) == 1:
        return f"at about {_crossing(found[0])}"
    first, last = (pick(single, key=lambda key: (single[key].frequency, key)) for pick in (min, max))
    return (
        f"between {_crossing(single[first])} ({condition(_AXES, first)}) and {_crossing(single[last])} "
        f"({condition(_AXES, last)}), at {number(float(np.mean([one.frequency for one in found])))} Hz on average"
    )


def _below(found: Crossings, first: str, second: str) -> str:
    """Words on which curve is lower below and above the crossing; empty if that depends on the condition."""
    signs = {one.sign for one in found.single.values()}
    if len(signs) > 1:
        return ""
    lower, upper = (first, second) if signs == {1} else (second, first)
    return f"; below it {lower} has the lower TR, above it {upper}"


def prediction(_: Finding, found: Prediction) -> str:
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
