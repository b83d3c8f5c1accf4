"""Transmissibility: resonances, where the curves of two specimens cross, measured against predicted."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations, pairwise
from math import hypot, isfinite, sqrt
from typing import ClassVar

import numpy as np
from scipy.interpolate import PchipInterpolator

from fourpole import quantities as q
from fourpole.core.condition import FREQUENCY
from fourpole.findings.evidence import FloatArray, factor
from fourpole.findings.facts import Curve, Facts, common, natural, tests_of
from fourpole.findings.finding import Finding, Holds, Key, Setup, Topic, conditions
from fourpole.quantities import TR

__all__ = [
    "Crossing",
    "Crossings",
    "Peak",
    "Prediction",
    "Resonance",
    "ResonanceAtEnd",
    "ResonanceOrder",
    "Who",
    "crossings",
    "peak",
    "transmissibility",
]

_AXES = ("pressure", "load")
#: With more specimens than these only those with the lowest and the highest resonance are compared.
_MOST_PAIRED = 3
#: Relative distance of neighbouring tested frequencies up to which a crossing between them counts as resolved.
_FINE = 0.15
#: A parabola finds the resonance where the three highest points lie within half power of the largest.
_HALF_POWER = sqrt(0.5)
#: A resonance or a crossing needs this many tested frequencies.
_FEWEST_POINTS = 3
#: A test whose TR or predicted TR has no uncertainty is taken to be known to this, relative.
_UNSTATED_STD = 0.02
Who = tuple[str, Setup]


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


@dataclass(frozen=True)
class Resonance:
    """Resonances of one specimen under one load, by (pressure, load), between the ends of the tested frequencies."""

    kind: ClassVar[str] = "resonance"
    who: Who
    load: float
    peaks: Mapping[Key, Peak]


@dataclass(frozen=True)
class ResonanceAtEnd:
    """Curves of one specimen whose largest value stands at the same end of the tested frequencies."""

    kind: ClassVar[str] = "resonance"
    who: Who
    peaks: Mapping[Key, Peak]


@dataclass(frozen=True)
class ResonanceOrder:
    """Whose resonance lies lower.

    Attributes
    ----------
    first, second : Who
    gaps : mapping
        Resonance of the second less that of the first [Hz], by condition.
    doubts : mapping
        How far each gap may be off [Hz].
    """

    kind: ClassVar[str] = "order of resonances"
    first: Who
    second: Who
    gaps: Mapping[Key, float]
    doubts: Mapping[Key, float]

    @property
    def mean(self) -> float:
        """Mean gap [Hz]."""
        return float(np.mean(list(self.gaps.values())))

    @property
    def lower_upper(self) -> tuple[Who, Who]:
        """The one with the lower resonance on average, then the other."""
        return (self.first, self.second) if self.mean > 0 else (self.second, self.first)

    @property
    def counts(self) -> tuple[int, int]:
        """Conditions at which the gap is beyond its doubt: in the direction of the mean, and against it."""
        sign = 1.0 if self.mean > 0 else -1.0
        clear = [sign * gap for key, gap in self.gaps.items() if abs(gap) > self.doubts[key]]
        return sum(gap > 0 for gap in clear), sum(gap < 0 for gap in clear)

    @property
    def holds(self) -> Holds:
        """ABOVE or BELOW where the first is above or below the second at every condition."""
        clear, against = self.counts
        if clear == len(self.gaps):
            return Holds.BELOW if self.mean > 0 else Holds.ABOVE
        return Holds.MIXED if clear or against else Holds.NO_DIFFERENCE


@dataclass(frozen=True)
class Crossings:
    """Where the TR curves of two specimens cross, by condition; none where the list is empty."""

    kind: ClassVar[str] = "crossing"
    first: Who
    second: Who
    at: Mapping[Key, tuple[Crossing, ...]]

    @property
    def single(self) -> dict[Key, Crossing]:
        """The conditions with exactly one crossing."""
        return {key: found[0] for key, found in self.at.items() if len(found) == 1}

    @property
    def several(self) -> dict[Key, tuple[Crossing, ...]]:
        """The conditions with more than one crossing."""
        return {key: found for key, found in self.at.items() if len(found) > 1}

    @property
    def holds(self) -> Holds:
        """Whether there is none, at most one at each condition, or more."""
        if self.several:
            return Holds.SEVERAL_CROSSINGS
        return Holds.ONE_CROSSING if self.single else Holds.NO_CROSSING


@dataclass(frozen=True)
class Prediction:
    """Measured TR against that predicted from K* and the rig.

    Attributes
    ----------
    off : mapping
        Measured over predicted less 1, by test.
    beyond : tuple of str
        The tests in which this is beyond the uncertainty, chance held to 1 % over all of them.
    """

    kind: ClassVar[str] = "prediction"
    off: Mapping[str, float]
    beyond: tuple[str, ...]

    @property
    def mean(self) -> float:
        """Mean over the tests."""
        return float(np.mean(list(self.off.values())))

    @property
    def worst(self) -> str:
        """The test with the largest departure."""
        return max(self.off, key=lambda test: (abs(self.off[test]), natural(test)))


def peak(curve: Curve) -> Peak | None:
    """Resonance of a curve of three points or more."""
    f, tr = np.array(curve.frequency), np.array(curve.tr)
    if f.size < _FEWEST_POINTS:
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
    """All findings on the transmissibility."""
    peaks = {
        who: {key: found for key, curve in lines.items() if (found := peak(curve)) is not None}
        for who, lines in sorted(facts.curves.items(), key=lambda item: (natural(item[0][0]), item[0][1]))
    }
    pairs = _pairs(peaks)
    orders = (_order(facts, peaks, a, b) for a, b in pairs)
    findings = [found for found in orders if found is not None]
    for who, each in peaks.items():
        findings += [*_inside(facts, who, each), *_at_an_end(facts, who, each)]
    crossed = (_crossings(facts, a, b) for a, b in pairs)
    findings += [found for found in crossed if found is not None]
    return findings + _measured_against_predicted(facts)


def _pairs(peaks: Mapping[Who, Mapping[Key, Peak]]) -> list[tuple[Who, Who]]:
    """Pairs of specimens in the same set-up; of many, those with the lowest and the highest resonance on average."""
    pairs: list[tuple[Who, Who]] = []
    for setup in sorted({who[1] for who in peaks}):
        order = [who for who in peaks if who[1] == setup and peaks[who]]
        if len(order) > _MOST_PAIRED:
            order.sort(key=lambda who: float(np.mean([found.best for found in peaks[who].values()])))
            order = [order[0], order[-1]]
        pairs += combinations(order, 2)
    return pairs


def _tests(facts: Facts, keys: Sequence[Key], *who: Who) -> tuple[str, ...]:
    return tests_of(*([facts.curves[each][key] for key in keys] for each in who))


def _inside(facts: Facts, who: Who, peaks: Mapping[Key, Peak]) -> list[Finding]:
    """One finding per load on the resonances between the ends of the tested frequencies; the effect is their mean."""
    inside = {key: found for key, found in peaks.items() if not found.side}
    findings = []
    for load in sorted({key[1] for key in inside}):
        each = {key: found for key, found in inside.items() if key[1] == load}
        best, doubt = (float(np.mean(x)) for x in zip(*((p.best, p.doubt) for p in each.values()), strict=True))
        about, tests = conditions(_AXES, each, who[1]), _tests(facts, list(each), who)
        detail = Resonance(who, load, each)
        findings.append(Finding(Topic.RESONANCE, TR, (who[0],), Holds.INSIDE, detail, about, best, doubt, "Hz", tests))
    return findings


def _at_an_end(facts: Facts, who: Who, peaks: Mapping[Key, Peak]) -> list[Finding]:
    """Curves whose largest value stands at an end of the tested frequencies; the effect is that end."""
    findings = []
    for side, holds in ((-1, Holds.AT_LOWEST), (1, Holds.AT_HIGHEST)):
        each = {key: found for key, found in peaks.items() if found.side == side}
        if each:
            end = float(np.mean([found.frequency for found in each.values()]))
            about, tests = conditions(_AXES, each, who[1]), _tests(facts, list(each), who)
            detail = ResonanceAtEnd(who, each)
            findings.append(Finding(Topic.RESONANCE, TR, (who[0],), holds, detail, about, end, None, "Hz", tests))
    return findings


def _order(facts: Facts, peaks: Mapping[Who, Mapping[Key, Peak]], first: Who, second: Who) -> Finding | None:
    """Whose resonance lies lower, where both lie inside the tested frequencies; the effect is first less second."""
    a, b = peaks[first], peaks[second]
    keys = [key for key in common(a, b) if not (a[key].side or b[key].side)]
    if not keys:
        return None
    found = ResonanceOrder(
        first,
        second,
        {key: b[key].best - a[key].best for key in keys},
        {key: hypot(a[key].doubt, b[key].doubt) for key in keys},
    )
    names, doubt = (first[0], second[0]), max(found.doubts.values())
    about, tests = conditions(_AXES, keys, first[1]), _tests(facts, keys, first, second)
    return Finding(Topic.RESONANCE, TR, names, found.holds, found, about, -found.mean, doubt, "Hz", tests)


def crossings(first: Curve, second: Curve) -> list[Crossing]:
    """Where the curves change places between tested frequencies at which they differ beyond their uncertainty."""
    order = np.array(first.frequency)
    tested = np.array([f for f in order if np.min(np.abs(np.array(second.frequency) / f - 1.0)) < FREQUENCY.relative])
    if tested.size < _FEWEST_POINTS:
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


def _crossings(facts: Facts, first: Who, second: Who) -> Finding | None:
    """Where two curves cross; the effect is the mean frequency of the single crossings."""
    a, b = facts.curves[first], facts.curves[second]
    keys = [key for key in common(a, b) if min(len(a[key].frequency), len(b[key].frequency)) >= _FEWEST_POINTS]
    if not keys:
        return None
    found = Crossings(first, second, {key: tuple(crossings(a[key], b[key])) for key in keys})
    at = [one.at for one in found.single.values()]
    mean = float(np.mean(at)) if at else None
    names, about, tests = (first[0], second[0]), conditions(_AXES, keys, first[1]), _tests(facts, keys, first, second)
    return Finding(Topic.TRANSMISSIBILITY, TR, names, found.holds, found, about, mean, None, "Hz", tests)


def _measured_against_predicted(facts: Facts) -> list[Finding]:
    """How far the measured TR is from the predicted one; the effect is the mean departure."""
    columns = (q.TR_MEASURED.head, q.TR_PREDICTED.head, q.TR.u_head)
    rows = [(row["test"], *(row[name] for name in columns)) for row in facts.used_dynamic]
    known = [row for row in rows if all(v is not None and isfinite(v) and v > 0 for v in row[1:3])]
    if not known:
        return []
    reach = factor(looks=len(known))
    off = {test: tr / predicted - 1.0 for test, tr, predicted, _ in known}
    limits = {test: reach * (_UNSTATED_STD if u is None else u / predicted) for test, _, predicted, u in known}
    beyond = tuple(sorted((test for test in off if abs(off[test]) > limits[test]), key=natural))
    found = Prediction(off, beyond)
    holds, tests = Holds.BEYOND if beyond else Holds.WITHIN, tuple(sorted(off, key=natural))
    names = facts.tyres
    return [Finding(Topic.TRANSMISSIBILITY, TR, names, holds, found, effect=found.mean, unit="1", tests=tests)]
