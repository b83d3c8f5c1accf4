"""The twelve conclusions of the 1982 paper, and the numbers by which a campaign of its two tyres decides on each."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from enum import Enum
from functools import cached_property
from itertools import product
from typing import ClassVar

import numpy as np

from fourpole.findings import Finding, FindingConditions, Holds, Topic
from fourpole.findings.facts import Curve, Estimate, Facts, Key, Values, common
from fourpole.findings.resonances import peak
from fourpole.findings.trends import Effect, Lines, Trend, between, differences, lines_along, mean_effect
from fourpole.quantities import K1, K2, NONLINEARITY, TR, C, Quantity

#: Roles of the paper's two tyres.
CROSS, RADIAL = "cross-ply", "radial-ply"
_WORDS = (re.compile(r"cross[- ]?ply|bias[- ]?ply|diagonal", re.I), re.compile(r"radial", re.I))
#: Relative tolerance of a frequency at the edge of a band of claim 8.
_EDGE = 1e-6
#: Band of claim 6 [Hz], 10 to 24 Hz with the tolerance of one frequency.
_RISE = (10.0 * 0.98, 24.0 * 1.02)
#: Claim 3: the stated pressure of the maximum, and the largest distance of the maximum from it [Pa].
_OPTIMUM, _NEAR = 168e3, 12e3
#: Claim 11: the pressures of the paper's figure [Pa], the stated crossing, and the least distance from it at which TR
#: is compared [Hz].
_TR_PRESSURES, _TR_CROSSING, _TR_CLEAR = (100e3, 168e3), 18.0, 1.2
#: Claim 5: at the highest pressure C under the low load exceeds C under the high load by more than the first constant.
#: At the lowest pressure this difference is less than the second constant times that at the highest.
_SPREAD, _NEGLIGIBLE = 0.03, 1.0 / 3.0
#: Claim 8: the largest slope in the middle band is below this fraction of the mean slope outside it.
_FLAT = 0.5
#: Claim 8: bands of frequency [Hz] in which K2 falls, hardly changes and rises with pressure.
_BANDS: tuple[Callable[[float], bool], ...] = (
    lambda f: f <= 16.0 * (1.0 + _EDGE),
    lambda f: 16.5 * (1.0 - _EDGE) <= f <= 18.5 * (1.0 + _EDGE),
    lambda f: f > 19.0 * (1.0 + _EDGE),
)
#: Claim 2: the cross-ply departs from a straight line more than this many times as much as the radial-ply.
_TIMES = 3.0


#: The measurements that a campaign may lack, by the names of their sentences in words.toml.
Need = Enum(
    "Need", "BOTH CURVES THREE_PRESSURES THREE_FREQUENCIES OPTIMUM LOADS CORNERS BANDS SIDES PEAKS", module=__name__
)


@dataclass(frozen=True)
class Lack:
    """The measurements that a campaign lacks, their quantity, and the role of the tyre that lacks them."""

    need: Need
    quantity: Quantity | None = None
    tyre: str = ""


class LackError(Exception):
    """A claim cannot be examined; `lack` says which measurements the campaign lacks."""

    def __init__(self, need: Need, quantity: Quantity | None = None, tyre: str = "") -> None:
        super().__init__(need)
        self.lack = Lack(need, quantity, tyre)


@dataclass(frozen=True)
class Ply:
    """One of the two tyres: its role in the paper, its name, and its values by condition."""

    role: str
    name: str
    facts: Facts

    def values(self, quantity: Quantity) -> Values:
        """A quantity of the tyre by nominal condition, in SI."""
        return self.facts.by_tyre(quantity).get(self.name, {})

    @cached_property
    def curves(self) -> Mapping[Key, Curve]:
        """TR by (pressure, load), of the first set-up."""
        return next((lines for (tyre, _), lines in self.facts.curves.items() if tyre == self.name), {})

    @cached_property
    def tr(self) -> Values:
        """TR by (pressure, load, frequency)."""
        nominal = self.facts.nominal["frequency"]
        return {
            (*key, nominal.get(f, f)): Estimate(tr, std)
            for key, curve in self.curves.items()
            for f, tr, std in zip(curve.frequency, curve.tr, curve.std, strict=True)
        }


@dataclass(frozen=True)
class Above:
    """Relative difference of one tyre less the other, by condition."""

    axes: tuple[str, ...]
    effects: Mapping[Key, Effect]

    @property
    def against(self) -> list[Key]:
        """Conditions at which the first tyre is not above the second."""
        return [key for key, effect in self.effects.items() if effect.value <= 0.0]


@dataclass(frozen=True)
class Nonlinear:
    """Departure from a straight line of both tyres, relative to the load span, at the pressures in common."""

    cross: tuple[float, ...]
    radial: tuple[float, ...]

    @property
    def ratios(self) -> list[float]:
        """Departure of the cross-ply over that of the radial-ply."""
        return [a / b for a, b in zip(self.cross, self.radial, strict=True)]


@dataclass(frozen=True)
class OptimumAt:
    """Under one load [N]: the pressure of the largest C [Pa], and the relative drop of C at each end of pressures."""

    load: float
    pressure: float
    drops: Mapping[float, float]


@dataclass(frozen=True)
class ApartAt:
    """Relative difference of C under the lowest load less the highest, at the lowest and the highest pressure."""

    tyre: str
    loads: tuple[float, float]
    pressures: tuple[float, float]
    low: Effect
    high: Effect


@dataclass(frozen=True)
class TurningAt:
    """Under one load [N]: the change of K2 with pressure in the low, the middle and the high band, by frequency.

    `flatness` is the largest slope in the middle band over the mean slope outside it.
    """

    load: float
    bands: tuple[tuple[Effect, ...], ...]
    flatness: float

    @property
    def turns(self) -> bool:
        """Whether K2 falls in the low band, rises in the high one and hardly changes between."""
        low, _, high = self.bands
        falls, rises = max(e.value for e in low) < 0.0, min(e.value for e in high) > 0.0
        return falls and rises and self.flatness < _FLAT

    @property
    def sure(self) -> bool:
        """Whether the mean fall and the mean rise exceed their uncertainty."""
        low, _, high = self.bands
        return mean_effect(low).sign == -1 and mean_effect(high).sign == 1


@dataclass(frozen=True)
class Turning:
    """The change of K2 from the lowest to the highest pressure [Pa], by load."""

    ends: tuple[float, float]
    loads: tuple[TurningAt, ...]


@dataclass(frozen=True)
class Likewise:
    """K2 of the cross-ply: whether it turns, its trend with frequency, and how far it is above K2 of the radial-ply."""

    turns: bool
    rising: Evidence
    above: Evidence


@dataclass(frozen=True)
class Isolation:
    """TR of the radial-ply relative to the cross-ply below the crossing, and the reverse beyond it."""

    pressures: tuple[float, ...]
    below: tuple[Effect, ...]
    beyond: tuple[Effect, ...]


@dataclass(frozen=True)
class Order:
    """Frequencies of the largest measured TR [Hz] at the conditions in common, and the nominal gaps between them."""

    cross: tuple[float, ...]
    radial: tuple[float, ...]
    gaps: tuple[float, ...]


Evidence = (
    Above | Nonlinear | Trend | tuple[OptimumAt, ...] | tuple[ApartAt, ...] | Turning | Likewise | Isolation | Order
)


@dataclass(frozen=True)
class Reading:
    """The evidence of a campaign on one claim.

    Attributes
    ----------
    holds, sure : bool
        Whether the claim holds; whether the deciding differences exceed their uncertainty.
    evidence : Evidence
        The numbers that decide.
    effect, std : float, float or None
        Size of the effect and its standard uncertainty, as in findings.csv.
    unit : str
    """

    holds: bool
    sure: bool
    evidence: Evidence
    effect: float
    std: float | None = None
    unit: str = "1"


def _all_up(evidence: Evidence, effects: Iterable[Effect]) -> Reading:
    """The claim that all effects are positive."""
    effects = list(effects)
    holds, sure = all(effect.value > 0.0 for effect in effects), all(effect.claimed() for effect in effects)
    return Reading(holds, sure, evidence, *_mean(effects))


def _mean(effects: Iterable[Effect]) -> tuple[float, float]:
    """Mean of effects and its standard uncertainty."""
    mean = mean_effect(list(effects))
    return mean.value, mean.std


def above(quantity: Quantity, upper: Ply, lower: Ply) -> Reading:
    """Whether a quantity of the upper tyre is above that of the lower at every condition in common."""
    effects = differences(lower.values(quantity), upper.values(quantity))
    if not effects:
        raise LackError(Need.BOTH, quantity)
    return _all_up(Above(quantity.over, effects), effects.values())


def nonlinear(cross: Ply, radial: Ply) -> Reading:
    """Whether the cross-ply departs from a straight line more than three times as much as the radial-ply."""
    values = cross.values(NONLINEARITY), radial.values(NONLINEARITY)
    keys = common(*values)
    if not keys:
        raise LackError(Need.CURVES)
    evidence = Nonlinear(*(tuple(departures[key].value for key in keys) for departures in values))
    return Reading(min(evidence.ratios) > _TIMES, True, evidence, min(evidence.ratios))


def _lines(quantity: Quantity, tyre: str, values: Values, axis: str) -> Lines:
    """Lines of three points or more."""
    lines = lines_along(values, quantity.over, axis)
    if lines is None or not lines.is_line:
        need = Need.THREE_PRESSURES if axis == "pressure" else Need.THREE_FREQUENCIES
        raise LackError(need, quantity, tyre)
    return lines


def rising(quantity: Quantity, values: Values, axis: str, tyre: str = "") -> Reading:
    """Whether a quantity rises along an axis on every line."""
    trend = _lines(quantity, tyre, values, axis).trend()
    return _all_up(trend, trend.effects.values())


def in_band(values: Values) -> Values:
    """Values at the frequencies of claim 6."""
    return {key: values[key] for key in values if _RISE[0] <= key[2] <= _RISE[1]}


def _means(values: Values) -> dict[tuple[float, float], Estimate]:
    """Mean by pressure and load over the frequencies that all of them have."""
    tested: dict[tuple[float, float], set[float]] = {}
    for p, load, f in values:
        tested.setdefault((p, load), set()).add(f)
    shared = set.intersection(*tested.values()) if tested else set()
    alike = {key: [values[*key, f] for f in shared] for key in sorted(tested) if shared}
    return {
        key: Estimate(float(np.mean([m.value for m in members])), float(np.mean([m.std for m in members])))
        for key, members in alike.items()
    }


def optimum(cross: Ply) -> Reading:
    """Whether C of the cross-ply, averaged over frequency, has its maximum near 1.68 bar."""
    values = cross.values(C)
    means = _means(values)
    pressures = sorted({p for p, _ in means})
    if len(pressures) < 3 or pressures[0] > _OPTIMUM - _NEAR or pressures[-1] < _OPTIMUM + _NEAR:
        raise LackError(Need.OPTIMUM, C, cross.role)
    tops, inside = [], []
    for load in sorted({load for _, load in means}):
        line = {p: means[p, load].value for p in pressures if (p, load) in means}
        ends, best = (min(line), max(line)), max(line, key=lambda p: line[p])
        inside.append(best not in ends)
        tops.append(OptimumAt(load, best, {p: 1 - line[p] / line[best] for p in ends if p != best}))
    holds = all(inside) and all(abs(top.pressure - _OPTIMUM) <= _NEAR for top in tops)
    sure = all(_has_maximum(values, top.load) for top in tops)
    return Reading(holds, sure, tuple(tops), float(np.mean([top.pressure for top in tops])), unit="Pa")


def _has_maximum(values: Values, load: float) -> bool:
    """Whether C under one load has a maximum against pressure beyond the scatter."""
    lines = lines_along({key: values[key] for key in values if key[1] == load}, C.over, "pressure")
    extremum = lines.extremum() if lines is not None else None
    return extremum is not None and extremum.holds is Holds.MAXIMUM


def loads_apart(cross: Ply, radial: Ply) -> Reading:
    """Whether the loads differ in C at the highest pressure, and hardly at the lowest."""
    parts = tuple(_apart(tyre) for tyre in (cross, radial))
    holds = all(part.high.value > _SPREAD and abs(part.low.value) < _NEGLIGIBLE * part.high.value for part in parts)
    high = [part.high for part in parts]
    return Reading(holds, all(effect.claimed() for effect in high), parts, *_mean(high))


def _apart(tyre: Ply) -> ApartAt:
    means = _means(tyre.values(C))
    pressures, loads = (sorted({key[i] for key in means}) for i in (0, 1))
    if len(pressures) < 2 or len(loads) < 2:
        raise LackError(Need.LOADS, C)
    ends, ends_of_load = (pressures[0], pressures[-1]), (loads[0], loads[-1])
    if any((p, load) not in means for p in ends for load in ends_of_load):
        raise LackError(Need.CORNERS, C)
    low, high = (between(means[p, loads[-1]].pair, means[p, loads[0]].pair) for p in ends)
    return ApartAt(tyre.role, ends_of_load, ends, low, high)


def turning(tyre: Ply) -> Reading:
    """Whether the change of K2 with pressure turns from fall to rise between 16 and 19 Hz."""
    lines = _lines(K2, tyre.role, tyre.values(K2), "pressure")
    trend = lines.trend()
    loads = tuple(_turning_at(tyre, lines, trend, load) for load in sorted({key[0] for key in trend.effects}))
    rises = _mean(effect for part in loads for effect in part.bands[2])
    holds, sure = all(part.turns for part in loads), all(part.sure for part in loads)
    return Reading(holds, sure, Turning(trend.ends, loads), *rises)


def _turning_at(tyre: Ply, lines: Lines, trend: Trend, load: float) -> TurningAt:
    effects = {key[1]: effect for key, effect in trend.effects.items() if key[0] == load}
    bands = [[f for f in effects if inside(f)] for inside in _BANDS]
    if not all(bands):
        raise LackError(Need.BANDS, K2, tyre.role)
    low, flat, high = ([abs(float(np.polyfit(*lines.lines[load, f][:2], 1)[0])) for f in band] for band in bands)
    flatness = max(flat) / float(np.mean([*low, *high]))
    return TurningAt(load, tuple(tuple(effects[f] for f in band) for band in bands), flatness)


def likewise(cross: Ply, radial: Ply) -> Reading:
    """Whether K2 of the cross-ply turns with pressure, rises with frequency, and is above that of the radial-ply."""
    turns, rises = turning(cross), rising(K2, cross.values(K2), "frequency", cross.role)
    higher = above(K2, cross, radial)
    parts = (turns, rises, higher)
    holds, sure = all(part.holds for part in parts), all(part.sure for part in parts)
    return Reading(holds, sure, Likewise(turns.holds, rises.evidence, higher.evidence), higher.effect, higher.std)


def isolation(cross: Ply, radial: Ply) -> Reading:
    """Whether TR of the cross-ply is the lower below the stated crossing, and that of the radial-ply beyond it."""
    tested = sorted({key[0] for key in cross.tr})
    near = {min(tested, key=lambda p: abs(p - wanted)) for wanted in _TR_PRESSURES} if tested else set()
    keys = [key for key in common(cross.tr, radial.tr) if key[0] in near]

    def higher(upper: Ply, lower: Ply, side: float) -> tuple[Effect, ...]:
        there = (key for key in keys if side * (key[2] - _TR_CROSSING) > _TR_CLEAR)
        return tuple(between(lower.tr[key].pair, upper.tr[key].pair) for key in there)

    evidence = Isolation(tuple(sorted(near)), higher(radial, cross, -1.0), higher(cross, radial, 1.0))
    if not (evidence.below and evidence.beyond):
        raise LackError(Need.SIDES)
    return _all_up(evidence, (*evidence.below, *evidence.beyond))


def resonance(cross: Ply, radial: Ply) -> Reading:
    """Whether the largest measured TR of the radial-ply is at a lower frequency than that of the cross-ply."""
    pairs = [(peak(cross.curves[key]), peak(radial.curves[key])) for key in common(cross.curves, radial.curves)]
    peaks = [(a, b) for a, b in pairs if a is not None and b is not None]
    if not peaks:
        raise LackError(Need.PEAKS)
    nominal = cross.facts.nominal["frequency"]
    of_cross, of_radial = (tuple(highest.frequency for highest in side) for side in zip(*peaks, strict=True))
    gaps = tuple(nominal.get(a, a) - nominal.get(b, b) for a, b in zip(of_cross, of_radial, strict=True))
    sure = all(not a.side and not b.side and a.best - b.best > a.doubt + b.doubt for a, b in peaks)
    return Reading(min(gaps) > 0.0, sure, Order(of_cross, of_radial, gaps), float(np.mean(gaps)), unit="Hz")


@dataclass(frozen=True)
class Claim:
    """One conclusion of the paper, with the evidence of a campaign for or against it.

    Attributes
    ----------
    number : int
        1 to 12, in the paper's order.
    names : (str, str)
        The campaign's names of the cross-ply and the radial-ply.
    states : (str, str)
        Suffix of each name if a tyre was tested at several temperatures, such as " at 20 °C"; else empty.
    found : Evidence or Lack
        The numbers that decide, or the measurements that the campaign lacks.
    """

    number: int
    names: tuple[str, str]
    states: tuple[str, str]
    found: Evidence | Lack

    @property
    def kind(self) -> str:
        """Name of the kind in findings.csv, with the number of the claim."""
        return f"claim {self.number}"


@dataclass(frozen=True)
class NoCommonState:
    """The paper's two tyres have no temperature, or no value of a further axis, in common; no claim is examined."""

    kind: ClassVar[str] = "claims"


def _role(facts: Facts, tyre: str) -> int | None:
    """0 for a cross-ply, 1 for a radial-ply, None for a construction that names neither or both."""
    kinds = [bool(word.search(facts.constructions.get(tyre, ""))) for word in _WORDS]
    return kinds.index(True) if sum(kinds) == 1 else None


def claims(facts: Facts) -> list[Finding]:
    """All twelve claims, in the paper's order.

    There is none unless the campaign has a cross-ply, a radial-ply and no other tyre. A specimen of another
    construction without inflation pressure is no tyre, and takes no part. Of tyres that were tested in several states,
    those of the same state with the nearest temperatures are examined.
    """
    kinds = [[tyre for tyre in facts.tyres if _role(facts, tyre) == role] for role in (0, 1)]
    stated = [set(map(facts.stated, names)) for names in kinds]
    others = set(facts.tyres).difference(*kinds)
    if [*map(len, stated)] != [1, 1] or others & facts.inflated:
        return []
    warmer = {pair: kelvin for pair in product(*kinds) if (kelvin := facts.warmer(*pair)) is not None}
    if not warmer:
        both = tuple(name for names in stated for name in names)
        return [Finding(Topic.CLAIMS, None, both, Holds.NOT_EXAMINED, NoCommonState())]
    nearest = min(warmer, key=lambda pair: warmer[pair])
    cross, radial = (Ply(role, name, facts) for role, name in zip((CROSS, RADIAL), nearest, strict=True))
    return [_claim(cross, radial, number, *each) for number, each in enumerate(_readings(cross, radial), start=1)]


def _readings(cross: Ply, radial: Ply) -> tuple[tuple[Quantity, tuple[Ply, ...], Callable[[], Reading]], ...]:
    """The quantity of each claim, the tyres it concerns, and the function that examines it."""
    both = cross, radial
    return (
        (K1, both, lambda: above(K1, *both)),
        (NONLINEARITY, both, lambda: nonlinear(*both)),
        (C, (cross,), lambda: optimum(cross)),
        (C, (radial,), lambda: rising(C, radial.values(C), "pressure")),
        (C, both, lambda: loads_apart(*both)),
        (C, (radial,), lambda: rising(C, in_band(radial.values(C)), "frequency")),
        (C, both, lambda: above(C, *both)),
        (K2, (radial,), lambda: turning(radial)),
        (K2, (radial,), lambda: rising(K2, radial.values(K2), "frequency")),
        (K2, both, lambda: likewise(*both)),
        (TR, both, lambda: isolation(*both)),
        (TR, both, lambda: resonance(*both)),
    )


def _claim(
    cross: Ply, radial: Ply, number: int, quantity: Quantity, tyres: tuple[Ply, ...], read: Callable[[], Reading]
) -> Finding:
    facts, about = cross.facts, tuple(tyre.name for tyre in tyres)
    tests = tuple(dict.fromkeys(row["test"] for row in facts.used(quantity) if row["tyre"] in about))
    stated = (facts.stated(cross.name), facts.stated(radial.name))
    states = (cross.name.removeprefix(stated[0]), radial.name.removeprefix(stated[1]))
    try:
        reading = read()
    except LackError as error:
        detail = Claim(number, stated, states, error.lack)
        return Finding(Topic.CLAIMS, quantity, about, Holds.NOT_EXAMINED, detail, tests=tests)
    holds = Holds.FALSE if not reading.holds else Holds.TRUE if reading.sure else Holds.TRUE_UNSURE
    detail, size = Claim(number, stated, states, reading.evidence), (reading.effect, reading.std, reading.unit)
    return Finding(Topic.CLAIMS, quantity, about, holds, detail, FindingConditions(), *size, tests)
