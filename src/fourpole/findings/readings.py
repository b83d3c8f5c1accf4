"""The numbers by which a campaign supports or contradicts each conclusion of the 1982 paper."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property

import numpy as np

from fourpole.findings.comparisons import differences
from fourpole.findings.evidence import Effect, between, mean_effect
from fourpole.findings.facts import Curve, Facts, Measured, Values, common
from fourpole.findings.finding import Holds, Key
from fourpole.findings.resonances import peak
from fourpole.findings.trends import Lines, Trend, lines_along
from fourpole.quantities import K2, NONLINEARITY, C, Quantity

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


class Need(StrEnum):
    """The measurements that a campaign lacks where a claim cannot be examined."""

    BOTH = "values of both tyres at a condition in common"
    CURVES = "load-deflection curves of both tyres at a pressure in common"
    THREE_PRESSURES = "three pressures or more"
    THREE_FREQUENCIES = "three frequencies or more"
    OPTIMUM = "three pressures or more on both sides of the optimum"
    LOADS = "two loads and two pressures or more"
    CORNERS = "the lowest and highest load at the lowest and highest pressure"
    BANDS = "frequencies in all three bands"
    SIDES = "TR of both tyres on both sides of the crossing"
    PEAKS = "TR of both tyres at three frequencies or more"


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
class Tyre:
    """One of the two tyres: its role in the paper, its name, and its values by condition."""

    role: str
    name: str
    facts: Facts

    def values(self, quantity: Quantity) -> Values:
        """A quantity of the tyre by nominal condition, in SI."""
        return self.facts.values(quantity, self.name)

    @cached_property
    def curves(self) -> Mapping[Key, Curve]:
        """TR by (pressure, load), of the first set-up."""
        return next((lines for (tyre, _), lines in self.facts.curves.items() if tyre == self.name), {})

    @cached_property
    def tr(self) -> Values:
        """TR by (pressure, load, frequency)."""
        nominal = self.facts.nominal["frequency"]
        return {
            (*key, nominal.get(f, f)): Measured(tr, std)
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
    return Reading(all(effect.value > 0.0 for effect in effects), _sure(effects), evidence, *_mean(effects))


def _sure(effects: Iterable[Effect]) -> bool:
    return all(effect.claimed() for effect in effects)


def _mean(effects: Iterable[Effect]) -> tuple[float, float]:
    """Mean of effects and its standard uncertainty."""
    mean = mean_effect(list(effects))
    return mean.value, mean.std


def above(quantity: Quantity, upper: Tyre, lower: Tyre) -> Reading:
    """Whether a quantity of the upper tyre is above that of the lower at every condition in common."""
    effects = differences(lower.values(quantity), upper.values(quantity))
    if not effects:
        raise LackError(Need.BOTH, quantity)
    return _all_up(Above(quantity.over, effects), effects.values())


def nonlinear(cross: Tyre, radial: Tyre) -> Reading:
    """Whether the cross-ply departs from a straight line more than three times as much as the radial-ply."""
    values = cross.values(NONLINEARITY), radial.values(NONLINEARITY)
    keys = common(*values)
    if not keys:
        raise LackError(Need.CURVES)
    found = Nonlinear(*(tuple(each[key].value for key in keys) for each in values))
    return Reading(min(found.ratios) > _TIMES, True, found, min(found.ratios))


def _lines(quantity: Quantity, tyre: str, values: Values, axis: str) -> Lines:
    """Lines of three points or more."""
    found = lines_along(values, quantity.over, axis)
    if found is None or not found.is_line:
        need = Need.THREE_PRESSURES if axis == "pressure" else Need.THREE_FREQUENCIES
        raise LackError(need, quantity, tyre)
    return found


def rising(quantity: Quantity, values: Values, axis: str, tyre: str = "") -> Reading:
    """Whether a quantity rises along an axis on every line."""
    found = _lines(quantity, tyre, values, axis).trend()
    return _all_up(found, found.effects.values())


def in_band(values: Values) -> Values:
    """Values at the frequencies of claim 6."""
    return {key: found for key, found in values.items() if _RISE[0] <= key[2] <= _RISE[1]}


def _means(values: Values) -> dict[tuple[float, float], Measured]:
    """Mean by pressure and load over the frequencies that all of them have."""
    tested: dict[tuple[float, float], set[float]] = {}
    for p, load, f in values:
        tested.setdefault((p, load), set()).add(f)
    shared = set.intersection(*tested.values()) if tested else set()
    found = {at: zip(*(values[*at, f].pair for f in shared), strict=True) for at in sorted(tested) if shared}
    means = {at: [float(np.mean(part)) for part in parts] for at, parts in found.items()}
    return {at: Measured(value, std) for at, (value, std) in means.items()}


def optimum(cross: Tyre) -> Reading:
    """Whether C of the cross-ply, averaged over frequency, has its maximum near 1.68 bar."""
    values = cross.values(C)
    means = _means(values)
    pressures = sorted({p for p, _ in means})
    if len(pressures) < 3 or pressures[0] > _OPTIMUM - _NEAR or pressures[-1] < _OPTIMUM + _NEAR:
        raise LackError(Need.OPTIMUM, C, cross.role)
    tops, inside = [], []
    for load in sorted({load for _, load in means}):
        line = {p: means[p, load].value for p in pressures if (p, load) in means}
        ends, top = (min(line), max(line)), max(line, key=lambda p: line[p])
        inside.append(top not in ends)
        tops.append(OptimumAt(load, top, {p: 1 - line[p] / line[top] for p in ends if p != top}))
    holds = all(inside) and all(abs(at.pressure - _OPTIMUM) <= _NEAR for at in tops)
    sure = all(_has_maximum(values, at.load) for at in tops)
    return Reading(holds, sure, tuple(tops), float(np.mean([at.pressure for at in tops])), unit="Pa")


def _has_maximum(values: Values, load: float) -> bool:
    """Whether C under one load has a maximum against pressure beyond the scatter."""
    lines = lines_along({key: found for key, found in values.items() if key[1] == load}, C.over, "pressure")
    extremum = lines.extremum() if lines is not None else None
    return extremum is not None and extremum.holds is Holds.MAXIMUM


def loads_apart(cross: Tyre, radial: Tyre) -> Reading:
    """Whether the loads differ in C at the highest pressure, and hardly at the lowest."""
    parts = tuple(_apart(tyre) for tyre in (cross, radial))
    holds = all(at.high.value > _SPREAD and abs(at.low.value) < _NEGLIGIBLE * at.high.value for at in parts)
    high = [at.high for at in parts]
    return Reading(holds, _sure(high), parts, *_mean(high))


def _apart(tyre: Tyre) -> ApartAt:
    means = _means(tyre.values(C))
    pressures, loads = ([*dict.fromkeys(sorted(key[i] for key in means))] for i in (0, 1))
    if len(pressures) < 2 or len(loads) < 2:
        raise LackError(Need.LOADS, C)
    ends, ends_of_load = (pressures[0], pressures[-1]), (loads[0], loads[-1])
    if any((p, load) not in means for p in ends for load in ends_of_load):
        raise LackError(Need.CORNERS, C)
    low, high = (between(means[p, loads[-1]].pair, means[p, loads[0]].pair) for p in ends)
    return ApartAt(tyre.role, ends_of_load, ends, low, high)


def turning(tyre: Tyre) -> Reading:
    """Whether the change of K2 with pressure turns from fall to rise between 16 and 19 Hz."""
    lines = _lines(K2, tyre.role, tyre.values(K2), "pressure")
    trend = lines.trend()
    loads = tuple(_turning_at(tyre, lines, trend, load) for load in sorted({key[0] for key in trend.effects}))
    rises = _mean(effect for at in loads for effect in at.bands[2])
    return Reading(all(at.turns for at in loads), all(at.sure for at in loads), Turning(trend.ends, loads), *rises)


def _turning_at(tyre: Tyre, lines: Lines, trend: Trend, load: float) -> TurningAt:
    effects = {key[1]: effect for key, effect in trend.effects.items() if key[0] == load}
    bands = [[f for f in effects if inside(f)] for inside in _BANDS]
    if not all(bands):
        raise LackError(Need.BANDS, K2, tyre.role)
    low, flat, high = ([abs(float(np.polyfit(*lines.lines[load, f][:2], 1)[0])) for f in band] for band in bands)
    flatness = max(flat) / float(np.mean([*low, *high]))
    return TurningAt(load, tuple(tuple(effects[f] for f in band) for band in bands), flatness)


def likewise(cross: Tyre, radial: Tyre) -> Reading:
    """Whether K2 of the cross-ply turns with pressure, rises with frequency, and is above that of the radial-ply."""
    turns, rises = turning(cross), rising(K2, cross.values(K2), "frequency", cross.role)
    higher = above(K2, cross, radial)
    parts = (turns, rises, higher)
    holds, sure = all(part.holds for part in parts), all(part.sure for part in parts)
    return Reading(holds, sure, Likewise(turns.holds, rises.evidence, higher.evidence), higher.effect, higher.std)


def isolation(cross: Tyre, radial: Tyre) -> Reading:
    """Whether TR of the cross-ply is the lower below the stated crossing, and that of the radial-ply beyond it."""
    tested = sorted({key[0] for key in cross.tr})
    near = {min(tested, key=lambda p: abs(p - wanted)) for wanted in _TR_PRESSURES} if tested else set()
    keys = [key for key in common(cross.tr, radial.tr) if key[0] in near]

    def higher(upper: Tyre, lower: Tyre, side: float) -> tuple[Effect, ...]:
        there = (key for key in keys if side * (key[2] - _TR_CROSSING) > _TR_CLEAR)
        return tuple(between(lower.tr[key].pair, upper.tr[key].pair) for key in there)

    found = Isolation(tuple(sorted(near)), higher(radial, cross, -1.0), higher(cross, radial, 1.0))
    if not (found.below and found.beyond):
        raise LackError(Need.SIDES)
    return _all_up(found, (*found.below, *found.beyond))


def resonance(cross: Tyre, radial: Tyre) -> Reading:
    """Whether the largest measured TR of the radial-ply is at a lower frequency than that of the cross-ply."""
    pairs = [(peak(cross.curves[key]), peak(radial.curves[key])) for key in common(cross.curves, radial.curves)]
    peaks = [(a, b) for a, b in pairs if a is not None and b is not None]
    if not peaks:
        raise LackError(Need.PEAKS)
    nominal = cross.facts.nominal["frequency"]
    at = [tuple(found.frequency for found in side) for side in zip(*peaks, strict=True)]
    gaps = tuple(nominal.get(a, a) - nominal.get(b, b) for a, b in zip(*at, strict=True))
    sure = all(not a.side and not b.side and a.best - b.best > a.doubt + b.doubt for a, b in peaks)
    return Reading(min(gaps) > 0.0, sure, Order(at[0], at[1], gaps), float(np.mean(gaps)), unit="Hz")
