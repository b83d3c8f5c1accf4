"""Transmissibility: resonances, where the curves of two tyres cross, measured against predicted."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations, pairwise
from math import hypot, isfinite, sqrt

import numpy as np
from scipy.interpolate import PchipInterpolator

from fourpole.report.words.evidence import FloatArray, factor
from fourpole.report.words.facts import Curve, Facts, Finding, common, natural
from fourpole.report.words.phrases import (
    Key,
    bar,
    condition,
    counted,
    hertz,
    joined,
    newton,
    number,
    percent,
    ranged,
    some,
)

__all__ = ["Crossing", "Peak", "crossings", "peak", "transmissibility"]

_AXES = ("pressure", "load")
_MOST_NAMED = 8
_MOST_PAIRED = 3
_SAME, _FINE = 0.02, 0.15  # relative distance of frequencies that are one, and of neighbours that show a crossing
_HALF_POWER = sqrt(0.5)
Who = tuple[str, str]  # tyre, and rig with added mass where there are several


@dataclass(frozen=True)
class Peak:
    """The largest transmissibility of a curve.

    Attributes
    ----------
    frequency, tr : float [Hz], [1]
        Of the largest measured value.
    low, high : float [Hz]
        Between these the resonance lies; equal to `frequency` at an end of the tested range.
    at : float or None [Hz]
        Where a parabola has its top, if the three points round the largest resolve it.
    side : {-1, 0, 1}
        The largest value stands at the lowest (-1) or highest (1) tested frequency.
    """

    frequency: float
    tr: float
    low: float
    high: float
    at: float | None = None
    side: int = 0

    @property
    def best(self) -> float:
        """The frequency to compare."""
        return self.frequency if self.at is None else self.at

    @property
    def doubt(self) -> float:
        """How far the resonance may lie from `best`: a tenth of the step where a parabola found it."""
        width = 0.5 * (self.high - self.low)
        return 0.1 * width if self.at is not None else width


@dataclass(frozen=True)
class Crossing:
    """Where two curves cross: about there, surely between two tested frequencies, and who is higher below."""

    at: float
    low: float
    high: float
    sign: int

    @property
    def resolved(self) -> bool:
        """Whether the tested frequencies are near enough to say where."""
        return self.high <= (1.0 + _FINE) * self.low

    @property
    def text(self) -> str:
        """'18.2 Hz', or the tested frequencies on either side."""
        return f"{number(self.at)} Hz" if self.resolved else f"{number(self.low)} to {number(self.high)} Hz"


def peak(curve: Curve) -> Peak | None:
    """Resonance of a curve of three points or more."""
    f, tr = np.array(curve.frequency), np.array(curve.tr)
    if f.size < 3:
        return None
    top = int(np.argmax(tr))
    here, height = float(f[top]), float(tr[top])
    if top in (0, f.size - 1):
        return Peak(here, height, here, here, side=1 if top else -1)
    around = slice(top - 1, top + 2)
    low, high = float(f[top - 1]), float(f[top + 1])
    return Peak(here, height, low, high, _vertex(f[around], tr[around]))


def _vertex(f: FloatArray, tr: FloatArray) -> float | None:
    """Lowest point of 1/TR², which for a spring under a mass is a parabola in f²; None unless within half power."""
    if min(tr) < _HALF_POWER * max(tr):
        return None
    a, b, _ = np.polyfit(f**2 - f[1] ** 2, 1.0 / tr**2, 2)
    square = f[1] ** 2 - 0.5 * b / a if a > 0 else 0.0
    return float(np.sqrt(square)) if f[0] ** 2 < square < f[2] ** 2 else None


def transmissibility(facts: Facts) -> list[Finding]:
    """All sentences on the transmissibility."""
    peaks = {
        who: {key: found for key, curve in lines.items() if (found := peak(curve)) is not None}
        for who, lines in sorted(facts.curves.items(), key=lambda item: (natural(item[0][0]), item[0][1]))
    }
    pairs = _pairs(peaks)
    findings = [Finding("resonance", text) for a, b in pairs if (text := _compared(peaks, a, b))]
    for who, each in peaks.items():
        findings += [Finding("resonance", text) for text in (*_inside(who, each), *_at_an_end(who, each))]
    texts = [text for a, b in pairs if (text := _crossing_sentence(facts, a, b))]
    return [*findings, *(Finding("transmissibility", text) for text in texts), *_measured_against_predicted(facts)]


def _named(who: Who) -> str:
    return f"{who[0]} ({who[1]})" if who[1] else who[0]


def _pairs(peaks: Mapping[Who, Mapping[Key, Peak]]) -> list[tuple[Who, Who]]:
    """Pairs of tyres in the same set-up; of many, those with the lowest and the highest resonance on average."""
    pairs: list[tuple[Who, Who]] = []
    for setup in sorted({who[1] for who in peaks}):
        order = [who for who in peaks if who[1] == setup and peaks[who]]
        if len(order) > _MOST_PAIRED:
            order.sort(key=lambda who: float(np.mean([found.best for found in peaks[who].values()])))
            order = [order[0], order[-1]]
        pairs += combinations(order, 2)
    return pairs


def _inside(who: Who, peaks: Mapping[Key, Peak]) -> list[str]:
    """One sentence per load on the resonances of a tyre between the ends of the tested frequencies."""
    texts = []
    inside = {key: found for key, found in peaks.items() if not found.side}
    for load in sorted({key[1] for key in inside}):
        each = {key: found for key, found in inside.items() if key[1] == load}
        name = f"{_named(who)}{f' at {newton(load)}' if load > 0 else ''} resonates"
        f, tr = [found.best for found in each.values()], [found.tr for found in each.values()]
        where = [f" ({bar(key[0])})" if key[0] > 0 else "" for key in each]
        heights = joined(f"{number(height)}{at}" for height, at in zip(tr, where, strict=True))
        largest = f"the largest measured TR is {heights}"
        if len(each) > _MOST_NAMED:
            said = f"at {ranged(f, 'Hz')} over {len(each)} pressures; the largest TR is {ranged(tr)}"
        elif all(found.at is not None for found in each.values()):
            said = f"at about {joined(f'{number(v)} Hz{at}' for v, at in zip(f, where, strict=True))}; {largest}"
        else:
            said = f"{joined(f'{_at(p)}{at}' for p, at in zip(each.values(), where, strict=True))}; {largest}"
        texts.append(f"{name} {said}.")
    return texts


def _at_an_end(who: Who, peaks: Mapping[Key, Peak]) -> list[str]:
    """Curves whose largest value stands at an end of the tested frequencies."""
    texts = []
    for side, word in ((-1, "lowest"), (1, "highest")):
        said = [
            f"{number(found.tr)} at {hertz(found.frequency)} ({condition(_AXES, key)})"
            for key, found in peaks.items()
            if found.side == side
        ]
        if said:
            texts.append(
                f"The largest TR of {_named(who)} stands at the {word} tested frequency, beyond which the resonance "
                f"may lie: {some(said, _MOST_NAMED)}."
            )
    return texts


def _at(found: Peak) -> str:
    if found.at is not None:
        return f"at about {number(found.at)} Hz"
    return f"between the tested frequencies {number(found.low)} and {number(found.high)} Hz"


def _compared(peaks: Mapping[Who, Mapping[Key, Peak]], first: Who, second: Who) -> str | None:
    """Whose resonance lies lower."""
    keys = [k for k in common(peaks[first], peaks[second]) if not (peaks[first][k].side or peaks[second][k].side)]
    if not keys:
        return None
    gaps = np.array([peaks[second][key].best - peaks[first][key].best for key in keys])
    doubts = np.array([hypot(peaks[first][key].doubt, peaks[second][key].doubt) for key in keys])
    lower, upper = (first, second) if gaps.mean() > 0 else (second, first)
    gaps = np.abs(gaps) * np.sign(gaps) * np.sign(gaps.mean())
    clear, against = int(np.sum(gaps > doubts)), int(np.sum(-gaps > doubts))
    said = counted(len(keys), "condition")
    if clear == len(keys):
        return (
            f"The resonance of {_named(lower)} lies below that of {_named(upper)} at {_each(said)} in common, by "
            f"{ranged(gaps.tolist(), 'Hz', 2)}."
        )
    if not clear and not against:
        return (
            f"The resonances of {_named(first)} and {_named(second)} cannot be told apart at {_each(said)} in common: "
            f"the tested frequencies resolve them to {number(float(doubts.max()), 2)} Hz."
        )
    return (
        f"The resonance of {_named(lower)} lies below that of {_named(upper)} at {clear} of {said} in common, above it "
        f"at {against or 'none'}, and cannot be told from it at {len(keys) - clear - against or 'none'}."
    )


def _each(said: str) -> str:
    return "the only condition" if said.startswith("1 ") else f"each of {said}"


def crossings(first: Curve, second: Curve) -> list[Crossing]:
    """Where the curves change places between tested frequencies at which they differ beyond their uncertainty."""
    order = np.array(first.frequency)
    tested = np.array([f for f in order if np.min(np.abs(np.array(second.frequency) / f - 1.0)) < _SAME])
    if tested.size < 3:
        return []
    found = []
    gap, std = _gap(first, second, tested)
    clear = [i for i in range(tested.size) if abs(gap[i]) > 2.0 * std[i]]
    for a, b in pairwise(clear):
        if gap[a] * gap[b] < 0.0:
            f = np.linspace(tested[a], tested[b], 501)
            left = np.flatnonzero(_gap(first, second, f)[0] * gap[a] <= 0.0)
            at = float(f[left[0]] if left.size else f[-1])
            found.append(Crossing(at, float(tested[a]), float(tested[b]), int(np.sign(gap[a]))))
    return found


def _gap(first: Curve, second: Curve, f: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Second less first, and its uncertainty."""
    (y_1, u_1), (y_2, u_2) = (_between(curve, np.clip(f, *curve.ends)) for curve in (first, second))
    return y_2 - y_1, np.hypot(u_1, u_2)


def _between(curve: Curve, f: FloatArray) -> tuple[FloatArray, FloatArray]:
    """TR and its uncertainty between the tested frequencies; 1/TR² is the smooth one."""
    tested = np.array(curve.frequency)
    tr = 1.0 / np.sqrt(PchipInterpolator(tested, 1.0 / np.array(curve.tr) ** 2)(f))
    return tr, np.interp(f, tested, np.array(curve.std))


def _crossing_sentence(facts: Facts, first: Who, second: Who) -> str | None:
    keys = common(facts.curves[first], facts.curves[second])
    keys = [k for k in keys if min(len(facts.curves[w][k].frequency) for w in (first, second)) >= 3]
    if not keys:
        return None
    found = {key: crossings(facts.curves[first][key], facts.curves[second][key]) for key in keys}
    single = {key: at[0] for key, at in found.items() if len(at) == 1}
    names = f"The TR curves of {_named(first)} and {_named(second)}"
    if not any(found.values()):
        return f"{names} do not cross beyond their uncertainty at {_each(counted(len(keys), 'condition'))} in common."
    said = (
        f"{len(single)} of {counted(len(keys), 'condition')} in common"
        if len(single) < len(keys)
        else (_each(counted(len(keys), "condition")) + " in common")
    )
    several = {key: at for key, at in found.items() if len(at) > 1}
    texts = []
    if single:
        texts.append(
            f"cross once at {said}, {_crossed(single)}{_below({one.sign for one in single.values()}, first, second)}"
        )
    if several:
        listed = [f"{joined(one.text for one in at)} ({condition(_AXES, key)})" for key, at in several.items()]
        texts.append(f"cross more than once, at {some(listed, _MOST_NAMED)}")
    return f"{names} {' and '.join(texts)}."


def _crossed(single: Mapping[Key, Crossing]) -> str:
    found = list(single.values())
    if not all(one.resolved for one in found):
        low, high = min(one.low for one in found), max(one.high for one in found)
        return f"between the tested frequencies {number(low)} and {number(high)} Hz"
    if len(found) == 1:
        return f"at about {found[0].text}"
    first, last = (pick(single, key=lambda key: (single[key].at, key)) for pick in (min, max))
    return (
        f"between {single[first].text} ({condition(_AXES, first)}) and {single[last].text} ({condition(_AXES, last)}), "
        f"at {number(float(np.mean([one.at for one in found])))} Hz on average"
    )


def _below(signs: set[int], first: Who, second: Who) -> str:
    if len(signs) > 1:
        return ""
    lower, upper = (first, second) if signs == {1} else (second, first)
    return f"; below it {_named(lower)} has the lower TR, above it {_named(upper)}"


def _measured_against_predicted(facts: Facts) -> list[Finding]:
    columns = ("TR measured [1]", "TR predicted [1]", "u(TR) [1]")
    rows = [(row["test"], *(row[name] for name in columns)) for row in facts.used_dynamic]
    known = [row for row in rows if all(v is not None and isfinite(v) and v > 0 for v in row[1:3])]
    if not known:
        return []
    off = {test: tr / predicted - 1.0 for test, tr, predicted, _ in known}
    limits = {
        test: factor(looks=len(known)) * (0.02 if u is None else u / predicted) for test, _, predicted, u in known
    }
    worst = max(off, key=lambda test: (abs(off[test]), natural(test)))
    beyond: Sequence[str] = sorted((test for test in off if abs(off[test]) > limits[test]), key=natural)
    mean = float(np.mean(list(off.values())))
    text = (
        (
            f"The measured TR differs from the one predicted from K* and the rig by {percent(mean)} on average over "
            f"{counted(len(off), 'test')} and by {percent(off[worst])} at most (test {worst}), "
        )
        if len(off) > 1
        else f"The measured TR of test {worst} differs from the predicted one by {percent(mean)}, "
    )
    if beyond:
        return [Finding("transmissibility", f"{text}which is beyond the uncertainty in {some(beyond)}.", tuple(beyond))]
    return [Finding("transmissibility", f"{text}which is within the uncertainty.")]
