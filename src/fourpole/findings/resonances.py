"""Transmissibility: resonances, crossings of the curves of two specimens, and measured against predicted TR."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import pairwise
from math import hypot, sqrt
from typing import ClassVar

import numpy as np
import scipy

from fourpole import quantities as q
from fourpole.core.arrays import FloatArray
from fourpole.core.condition import FREQUENCY
from fourpole.findings.facts import (
    Curve,
    Detail,
    Facts,
    Finding,
    Holds,
    Key,
    Setup,
    Topic,
    common,
    finding_on,
    in_order,
    known,
    natural,
    pairs,
)
from fourpole.findings.trends import factor
from fourpole.quantities import TR

#: Relative distance of neighbouring tested frequencies up to which a crossing between them counts as resolved.
_FINE = 0.15
#: A parabola locates the resonance if the three highest points are at least this fraction of the largest TR.
_HALF_POWER = sqrt(0.5)
#: A resonance or a crossing needs at least this many tested frequencies.
_FEWEST_POINTS = 3
#: Outcome by the place of a curve's largest value: inside the curve or at an end; findings follow this order.
_SIDES = {0: Holds.INSIDE, -1: Holds.AT_LOWEST, 1: Holds.AT_HIGHEST}
Who = tuple[str, Setup]


@dataclass(frozen=True)
class Peak:
    """The largest transmissibility of a curve.

    Attributes
    ----------
    frequency, tr : float [Hz], [1]
        Frequency and value of the largest measured TR.
    low, high : float [Hz]
        The interval in which the resonance lies; both are `frequency` at an end of the tested range.
    top : float or None [Hz]
        The top of a parabola, if the three points round the largest TR resolve it.
    side : {-1, 0, 1}
        -1 if the largest TR is at the lowest tested frequency, 1 if it is at the highest, else 0.
    """

    frequency: float
    tr: float
    low: float
    high: float
    top: float | None = None
    side: int = 0

    @property
    def best(self) -> float:
        """Best estimate of the resonance [Hz]: the top of the parabola, else the tested frequency of the largest TR."""
        return self.frequency if self.top is None else self.top

    @property
    def doubt(self) -> float:
        """Largest distance of the resonance from `best` [Hz]: half the interval, or a tenth of that with a parabola."""
        width = 0.5 * (self.high - self.low)
        return 0.1 * width if self.top is not None else width

    @property
    def std(self) -> float:
        """Standard uncertainty of `best` [Hz], of a uniform distribution within `doubt` (JCGM 100:2008, 4.3.7)."""
        return self.doubt / sqrt(3.0)


@dataclass(frozen=True)
class Crossing:
    """A crossing of two curves.

    Attributes
    ----------
    frequency : float [Hz]
        Interpolated frequency of the crossing.
    low, high : float [Hz]
        The tested frequencies between which it lies.
    sign : {-1, 1}
        1 if the second curve is the higher one below the crossing.
    """

    frequency: float
    low: float
    high: float
    sign: int

    @property
    def resolved(self) -> bool:
        """Whether the two tested frequencies are within 15 % of each other."""
        return self.high <= (1.0 + _FINE) * self.low


@dataclass(frozen=True)
class Resonance:
    """Largest TR of one specimen by (pressure, load): under one load inside the tested frequencies, or at one end."""

    kind: ClassVar[str] = "resonance"
    peaks: Mapping[Key, Peak]


@dataclass(frozen=True)
class ResonanceOrder:
    """The order of the resonances of two specimens.

    Attributes
    ----------
    gaps : mapping
        Resonance of the second less that of the first [Hz], by condition.
    doubts : mapping
        Error of each gap [Hz]: root of the sum of the squares of the largest errors of both resonances.
    """

    kind: ClassVar[str] = "order of resonances"
    gaps: Mapping[Key, float]
    doubts: Mapping[Key, float]

    @property
    def mean(self) -> float:
        """Mean gap [Hz]."""
        return float(np.mean(list(self.gaps.values())))

    @property
    def counts(self) -> tuple[int, int]:
        """Number of conditions at which the gap exceeds its error: in the direction of the mean gap, and against it."""
        sign = 1.0 if self.mean > 0 else -1.0
        clear = [sign * gap for key, gap in self.gaps.items() if abs(gap) > self.doubts[key]]
        return sum(gap > 0 for gap in clear), sum(gap < 0 for gap in clear)

    @property
    def holds(self) -> Holds:
        """ABOVE or BELOW if the first is above or below the second at every condition, else MIXED or NO_DIFFERENCE."""
        clear, against = self.counts
        if clear == len(self.gaps):
            return Holds.BELOW if self.mean > 0 else Holds.ABOVE
        return Holds.MIXED if clear or against else Holds.NO_DIFFERENCE


@dataclass(frozen=True)
class Crossings:
    """The crossings of the TR curves of two specimens, by condition; the tuple is empty where they do not cross."""

    kind: ClassVar[str] = "crossing"
    crossings: Mapping[Key, tuple[Crossing, ...]]

    @property
    def single(self) -> dict[Key, Crossing]:
        """The conditions with exactly one crossing."""
        return {key: several[0] for key, several in self.crossings.items() if len(several) == 1}

    @property
    def several(self) -> dict[Key, tuple[Crossing, ...]]:
        """The conditions with more than one crossing."""
        return {key: several for key, several in self.crossings.items() if len(several) > 1}

    @property
    def holds(self) -> Holds:
        """NO_CROSSING, ONE_CROSSING if no condition has more than one, or SEVERAL_CROSSINGS."""
        if self.several:
            return Holds.SEVERAL_CROSSINGS
        return Holds.ONE_CROSSING if self.single else Holds.NO_CROSSING


@dataclass(frozen=True)
class Prediction:
    """Measured TR against the TR predicted from K* and the rig.

    Attributes
    ----------
    off : mapping
        Measured over predicted less 1, by test.
    beyond : tuple of str
        The tests in which this exceeds the uncertainty; the chance of any by noise alone is 1 %.
    """

    kind: ClassVar[str] = "prediction"
    off: Mapping[str, float]
    beyond: tuple[str, ...]

    @property
    def mean(self) -> float:
        """Mean departure over the tests."""
        return float(np.mean(list(self.off.values())))

    @property
    def worst(self) -> str:
        """The test with the largest departure."""
        return max(self.off, key=lambda test: (abs(self.off[test]), natural(test)))


def peak(curve: Curve) -> Peak | None:
    """The largest TR of a curve; None for a curve of fewer than three points."""
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
    """Frequency [Hz] at which 1/TR² is lowest; it is a parabola in f² for a spring under a mass.

    None if one of the three points is below half power of the largest.
    """
    if min(tr) < _HALF_POWER * max(tr):
        return None
    a, b, _ = np.polyfit(f**2 - f[1] ** 2, 1.0 / tr**2, 2)
    square = f[1] ** 2 - 0.5 * b / a if a > 0 else 0.0
    return float(np.sqrt(square)) if f[0] ** 2 < square < f[2] ** 2 else None


def transmissibility(facts: Facts) -> list[Finding]:
    """All findings on the transmissibility."""
    peaks = {
        who: {key: highest for key, curve in facts.curves[who].items() if (highest := peak(curve)) is not None}
        for who in sorted(facts.curves, key=lambda who: (natural(who[0]), who[1]))
    }
    both = _pairs(peaks)
    orders = [finding for pair in both for finding in _order(facts, peaks, *pair)]
    inside = [finding for who in peaks for finding in _resonances(facts, who, peaks[who])]
    crossed = [finding for pair in both for finding in _crossings(facts, *pair)]
    return [*orders, *inside, *crossed, *_measured_against_predicted(facts)]


def _pairs(peaks: Mapping[Who, Mapping[Key, Peak]]) -> list[tuple[Who, Who]]:
    """Pairs of specimens in the same set-up."""
    means = {who: float(np.mean([p.best for p in peaks[who].values()])) for who in peaks if peaks[who]}
    setups = sorted({setup for _, setup in means})
    return [pair for setup in setups for pair in pairs({who: best for who, best in means.items() if who[1] == setup})]


def _resonances(facts: Facts, who: Who, peaks: Mapping[Key, Peak]) -> list[Finding]:
    """A finding per load on the resonances inside the tested frequencies; one on those at each end.

    The effect is the mean frequency; for resonances inside, its uncertainty is the mean of theirs.
    """
    groups: dict[tuple[int, float], dict[Key, Peak]] = {}
    for key, highest in peaks.items():
        groups.setdefault((list(_SIDES).index(highest.side), 0.0 if highest.side else key[1]), {})[key] = highest
    findings = []
    for _, alike in sorted(groups.items()):
        holds = _SIDES[next(iter(alike.values())).side]
        best, std = (float(np.mean([getattr(p, name) for p in alike.values()])) for name in ("best", "std"))
        size = best, std if holds is Holds.INSIDE else None
        findings.append(_on_curves(facts, (who,), alike, Topic.RESONANCE, holds, Resonance(alike), *size))
    return findings


def _on_curves(
    facts: Facts,
    whose: tuple[Who, ...],
    keys: Iterable[Key],
    topic: Topic,
    holds: Holds,
    detail: Detail,
    effect: float | None,
    std: float | None = None,
) -> Finding:
    """A finding on the TR curves of specimens in one set-up; the effect is a frequency [Hz]."""
    curves, setup = {who[0]: facts.curves[who] for who in whose}, whose[0][1]
    return finding_on(TR, curves, keys, holds, detail, effect, std, unit="Hz", topic=topic, setup=setup)


def _order(facts: Facts, peaks: Mapping[Who, Mapping[Key, Peak]], first: Who, second: Who) -> list[Finding]:
    """The order of two resonances inside the tested frequencies; the effect is first less second [Hz]."""
    a, b = peaks[first], peaks[second]
    keys = [key for key in common(a, b) if not (a[key].side or b[key].side)]
    if not keys:
        return []
    gaps = {key: b[key].best - a[key].best for key in keys}
    order = ResonanceOrder(gaps, {key: hypot(a[key].doubt, b[key].doubt) for key in keys})
    size = -order.mean, max(hypot(a[key].std, b[key].std) for key in keys)
    return [_on_curves(facts, (first, second), keys, Topic.RESONANCE, order.holds, order, *size)]


def crossings(first: Curve, second: Curve) -> list[Crossing]:
    """Crossings of two curves, between tested frequencies where they differ by more than their uncertainty allows."""
    order = np.array(first.frequency)
    tested = np.array([f for f in order if np.min(np.abs(np.array(second.frequency) / f - 1.0)) < FREQUENCY.relative])
    if tested.size < _FEWEST_POINTS:
        return []
    between = []
    gap, std = _gap(first, second, tested)
    clear = [i for i in range(tested.size) if abs(gap[i]) > factor() * std[i]]
    for a, b in pairwise(clear):
        if gap[a] * gap[b] < 0.0:
            f = np.linspace(tested[a], tested[b], 501)
            left = np.flatnonzero(_gap(first, second, f)[0] * gap[a] <= 0.0)
            place = float(f[left[0]] if left.size else f[-1])
            between.append(Crossing(place, float(tested[a]), float(tested[b]), int(np.sign(gap[a]))))
    return between


def _gap(first: Curve, second: Curve, f: FloatArray) -> tuple[FloatArray, FloatArray]:
    """TR of the second less that of the first, and its standard uncertainty."""
    (y_1, u_1), (y_2, u_2) = (_between(curve, f) for curve in (first, second))
    return y_2 - y_1, np.hypot(u_1, u_2)


def _between(curve: Curve, f: FloatArray) -> tuple[FloatArray, FloatArray]:
    """TR and its uncertainty between the tested frequencies; 1/TR² is interpolated because it is smoother than TR."""
    tested = np.array(curve.frequency)
    f = np.clip(f, tested[0], tested[-1])
    tr = 1.0 / np.sqrt(scipy.interpolate.PchipInterpolator(tested, 1.0 / np.array(curve.tr) ** 2)(f))
    return tr, np.interp(f, tested, np.array(curve.std))


def _crossings(facts: Facts, first: Who, second: Who) -> list[Finding]:
    """The crossings of the curves of two specimens; the effect is the mean frequency of the single crossings [Hz]."""
    a, b = facts.curves[first], facts.curves[second]
    keys = [key for key in common(a, b) if min(len(a[key].frequency), len(b[key].frequency)) >= _FEWEST_POINTS]
    if not keys:
        return []
    detail = Crossings({key: tuple(crossings(a[key], b[key])) for key in keys})
    single = [crossing.frequency for crossing in detail.single.values()]
    mean = float(np.mean(single)) if single else None
    return [_on_curves(facts, (first, second), keys, Topic.TRANSMISSIBILITY, detail.holds, detail, mean)]


def _measured_against_predicted(facts: Facts) -> list[Finding]:
    """The measured TR against the predicted one; the effect is the mean departure, relative to the prediction."""
    off, std = {}, {}
    for row in facts.used_dynamic:
        measured, predicted = known(row, q.TR_MEASURED), known(row, q.TR_PREDICTED)
        if measured and predicted:
            off[row["test"]] = measured[0] / predicted[0] - 1.0
            std[row["test"]] = predicted[1] / predicted[0]
    if not off:
        return []
    reach = factor(searched=len(off))
    beyond = in_order(test for test in off if abs(off[test]) > reach * std[test])
    detail, holds = Prediction(off, beyond), Holds.BEYOND if beyond else Holds.WITHIN
    about = Topic.TRANSMISSIBILITY, TR, facts.tyres, holds, detail
    return [Finding(*about, effect=detail.mean, unit="1", tests=in_order(off))]
