"""Sentences on the transmissibility: resonances, crossings, measured against predicted."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from fourpole.findings.finding import Finding, Holds, Key, Setup
from fourpole.findings.resonances import (
    Crossing,
    Crossings,
    Peak,
    Prediction,
    Resonance,
    ResonanceAtEnd,
    ResonanceOrder,
    Who,
)
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

__all__ = ["at_an_end", "crossings", "inside", "order", "prediction"]

_AXES = ("pressure", "load")
_MOST_NAMED = 8


def _named(who: Who) -> str:
    tyre, setup = who
    return tyre if setup == Setup() else f"{tyre} ({_setup(setup)})"


def _setup(setup: Setup) -> str:
    parts = [f"rig {setup.rig}"] if setup.rig else []
    return " and ".join([*parts, *([f"{setup.added_mass:g} kg added"] if setup.added_mass > 0.0 else [])])


def inside(_: Finding, found: Resonance) -> str:
    """The resonances of a specimen under one load, pressure by pressure."""
    peaks = found.peaks.values()
    name = f"{_named(found.who)}{f' at {newton(found.load)}' if found.load > 0 else ''} resonates"
    f, tr = [each.best for each in peaks], [each.tr for each in peaks]
    where = [f" ({bar(key[0])})" if key[0] > 0 else "" for key in found.peaks]
    heights = joined(f"{number(height)}{at}" for height, at in zip(tr, where, strict=True))
    largest = f"the largest measured TR is {heights}"
    if len(f) > _MOST_NAMED:
        said = f"at {ranged(f, 'Hz')} over {len(f)} pressures; the largest TR is {ranged(tr)}"
    elif all(each.at is not None for each in peaks):
        said = f"at about {joined(f'{number(v)} Hz{at}' for v, at in zip(f, where, strict=True))}; {largest}"
    else:
        said = f"{joined(f'{_at(each)}{at}' for each, at in zip(peaks, where, strict=True))}; {largest}"
    return f"{name} {said}."


def _at(found: Peak) -> str:
    if found.at is not None:
        return f"at about {number(found.at)} Hz"
    return f"between the tested frequencies {number(found.low)} and {number(found.high)} Hz"


def at_an_end(finding: Finding, found: ResonanceAtEnd) -> str:
    """The curves whose largest value stands at an end of the tested frequencies."""
    said = [
        f"{number(each.tr)} at {hertz(each.frequency)} ({condition(_AXES, key)})" for key, each in found.peaks.items()
    ]
    return (
        f"The largest TR of {_named(found.who)} stands at the "
        f"{'lowest' if finding.holds is Holds.AT_LOWEST else 'highest'} tested frequency, beyond which the resonance "
        f"may lie: {some(said, _MOST_NAMED)}."
    )


def order(finding: Finding, found: ResonanceOrder) -> str:
    """Whose resonance lies lower."""
    lower, upper = (_named(who) for who in found.lower_upper)
    count, (clear, against) = len(found.gaps), found.counts
    if finding.holds in (Holds.ABOVE, Holds.BELOW):
        gaps = [abs(gap) for gap in found.gaps.values()]
        return (
            f"The resonance of {lower} lies below that of {upper} at {each_of(count)} in common, by "
            f"{ranged(gaps, 'Hz', 2)}."
        )
    if finding.holds is Holds.NO_DIFFERENCE:
        return (
            f"The resonances of {_named(found.first)} and {_named(found.second)} cannot be told apart at "
            f"{each_of(count)} in common: the tested frequencies resolve them to "
            f"{number(max(found.doubts.values()), 2)} Hz."
        )
    return (
        f"The resonance of {lower} lies below that of {upper} at {clear} of {counted(count, 'condition')} in common, "
        f"above it at {against or 'none'}, and cannot be told from it at {count - clear - against or 'none'}."
    )


def crossings(finding: Finding, found: Crossings) -> str:
    """Where the curves of two specimens cross, and who is lower below."""
    names = f"The TR curves of {_named(found.first)} and {_named(found.second)}"
    if finding.holds is Holds.NO_CROSSING:
        return f"{names} do not cross beyond their uncertainty at {each_of(len(found.at))} in common."
    texts = []
    if found.single:
        at = each_of(len(found.at))
        if len(found.single) < len(found.at):
            at = f"{len(found.single)} of {counted(len(found.at), 'condition')}"
        texts.append(f"cross once at {at} in common, {_crossed(found.single)}{_below(found)}")
    if found.several:
        listed = [f"{joined(map(_crossing, at))} ({condition(_AXES, key)})" for key, at in found.several.items()]
        texts.append(f"cross more than once, at {some(listed, _MOST_NAMED)}")
    return f"{names} {' and '.join(texts)}."


def _crossing(found: Crossing) -> str:
    """'18.2 Hz', or the tested frequencies on either side."""
    return f"{number(found.at)} Hz" if found.resolved else f"{number(found.low)} to {number(found.high)} Hz"


def _crossed(single: Mapping[Key, Crossing]) -> str:
    found = list(single.values())
    if not all(one.resolved for one in found):
        low, high = min(one.low for one in found), max(one.high for one in found)
        return f"between the tested frequencies {number(low)} and {number(high)} Hz"
    if len(found) == 1:
        return f"at about {_crossing(found[0])}"
    first, last = (pick(single, key=lambda key: (single[key].at, key)) for pick in (min, max))
    return (
        f"between {_crossing(single[first])} ({condition(_AXES, first)}) and {_crossing(single[last])} "
        f"({condition(_AXES, last)}), at {number(float(np.mean([one.at for one in found])))} Hz on average"
    )


def _below(found: Crossings) -> str:
    signs = {one.sign for one in found.single.values()}
    if len(signs) > 1:
        return ""
    lower, upper = (found.first, found.second) if signs == {1} else (found.second, found.first)
    return f"; below it {_named(lower)} has the lower TR, above it {_named(upper)}"


def prediction(_: Finding, found: Prediction) -> str:
    """How far the measured TR is from the predicted one."""
    mean, count, worst = percent(found.mean), len(found.off), found.worst
    opening = f"The measured TR of test {worst} differs from the predicted one by {mean}"
    if count > 1:
        opening = (
            f"The measured TR differs from the one predicted from K* and the rig by {mean} on average over "
            f"{counted(count, 'test')} and by {percent(found.off[worst])} at most (test {worst})"
        )
    beyond = f"beyond the uncertainty in {some(found.beyond)}" if found.beyond else "within the uncertainty"
    return f"{opening}, which is {beyond}."
