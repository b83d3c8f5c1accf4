"""What a campaign shows of each of the 1982 paper's conclusions, in numbers."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property
from typing import Any

import numpy as np

from fourpole.findings.comparisons import differences
from fourpole.findings.evidence import Effect, between, mean_effect
from fourpole.findings.facts import Curve, Facts, Measured, common
from fourpole.findings.finding import Holds, Key
from fourpole.findings.resonances import peak
from fourpole.findings.trends import Lines, Trend, lines_along
from fourpole.quantities import K1, K2, NONLINEARITY, C, Quantity

__all__ = ["LackError", "Need", "Reading", "Tyre"]

#: Relative tolerance of a frequency at the edge of a band of claim 8.
_EDGE = 1e-6
#: Band of claim 6 [Hz], 10 to 24 Hz with the tolerance of one frequency.
_RISE = (10.0 * 0.98, 24.0 * 1.02)
#: Claim 3: the stated pressure of the maximum and how far from it the maximum may lie [Pa].
_OPTIMUM, _NEAR = 168e3, 12e3
#: Claim 11: the pressures of the paper's figure [Pa], the stated crossing and how far from it TR is compared [Hz].
_TR_PRESSURES, _TR_CROSSING, _TR_CLEAR = (100e3, 168e3), 18.0, 1.2
#: Claim 5: C at the low load exceeds that at the high load by more than the first at the highest pressure; at the
#: lowest pressure the difference is less than the second, relative to that at the highest.
_SPREAD, _NEGLIGIBLE = 0.03, 1.0 / 3.0
#: Claim 8: the largest slope in the middle band over the mean slope outside it is below this.
_FLAT = 0.5
#: Claim 8: bands of frequency [Hz] in which K2 falls, hardly changes and rises with pressure.
_BANDS: tuple[Callable[[float], bool], ...] = (
    lambda f: f <= 16.0 * (1.0 + _EDGE),
    lambda f: 16.5 * (1.0 - _EDGE) <= f <= 18.5 * (1.0 + _EDGE),
    lambda f: f > 19.0 * (1.0 + _EDGE),
)
#: Claim 2: the cross-ply departs from a straight line more than this many times as much as the radial-ply.
_TIMES = 3.0
Values = Mapping[Key, Measured]


class Need(StrEnum):
    """What is missing where a claim cannot be told."""

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


class LackError(Exception):
    """A claim cannot be told: what is needed, of which quantity, of which of the two tyres."""

    def __init__(self, need: Need, quantity: Quantity | None = None, tyre: str = "") -> None:
        super().__init__(need)
        self.need, self.quantity, self.tyre = need, quantity, tyre


@dataclass(frozen=True)
class Tyre:
    """One of the two tyres: which of the paper's it is, its name, and its values by condition."""

    role: str
    name: str
    facts: Facts

    def _values(self, quantity: Quantity) -> Values:
        return self.facts.values(quantity, self.name)

    @cached_property
    def k1(self) -> Values:
        """By (pressure, load)."""
        return self._values(K1)

    @cached_property
    def k2(self) -> Values:
        """By (pressure, load, frequency)."""
        return self._values(K2)

    @cached_property
    def c(self) -> Values:
        """By (pressure, load, frequency)."""
        return self._values(C)

    @cached_property
    def nonlinearity(self) -> Values:
        """By (pressure,)."""
        return self._values(NONLINEARITY)

    @cached_property
    def curves(self) -> Mapping[Key, Curve]:
        """By (pressure, load), of the first set-up."""
        return next((lines for (tyre, _), lines in self.facts.curves.items() if tyre == self.name), {})

    @cached_property
    def tr(self) -> dict[Key, Measured]:
        """By (pressure, load, frequency)."""
        nominal = self.facts.nominal["frequency"]
        return {
            (*key, nominal.get(f, f)): Measured(tr, std)
            for key, curve in self.curves.items()
            for f, tr, std in zip(curve.frequency, curve.tr, curve.std, strict=True)
        }


@dataclass(frozen=True)
class Reading:
    """What a campaign shows of one claim.

    Attributes
    ----------
    holds, sure : bool
        Whether the claim holds; whether what decides it is beyond the uncertainty.
    evidence : object
        The numbers, frozen: what the function that reads the claim says.
    effect, std : float, float or None
        Size of the effect and its standard uncertainty, as in findings.csv.
    unit : str
    """

    holds: bool
    sure: bool
    evidence: Any
    effect: float
    std: float | None = None
    unit: str = "1"


def _mean(effects: Iterable[Effect]) -> tuple[float, float]:
    mean = mean_effect(list(effects))
    return mean.value, mean.std


@dataclass(frozen=True)
class Above:
    """How far one tyre is above the other, by condition."""

    axes: tuple[str, ...]
    effects: Mapping[Key, Effect]

    @property
    def against(self) -> list[Key]:
        """Conditions at which it is not above."""
        return [key for key, effect in self.effects.items() if effect.value <= 0.0]


def above(quantity: Quantity, upper: Values, lower: Values) -> Reading:
    """Whether the upper is above the lower at every condition in common: `Above`."""
    effects = differences(lower, upper)
    if not effects:
        raise LackError(Need.BOTH, quantity)
    found = Above(quantity.over, effects)
    return Reading(not found.against, _all_claimed(effects.values()), found, *_mean(effects.values()))


def _all_claimed(effects: Iterable[Effect]) -> bool:
    return all(effect.claimed() for effect in effects)


@dataclass(frozen=True)
class Nonlinear:
    """Departure from a straight line of both tyres, relative to the load span, at the pressures in common."""

    cross: tuple[float, ...]
    radial: tuple[float, ...]

    @property
    def ratios(self) -> list[float]:
        """Cross-ply over radial-ply."""
        return [a / b for a, b in zip(self.cross, self.radial, strict=True)]


def nonlinear(cross: Tyre, radial: Tyre) -> Reading:
    """Whether the cross-ply departs from a straight line several times as much as the radial-ply: `Nonlinear`."""
    keys = common(cross.nonlinearity, radial.nonlinearity)
    if not keys:
        raise LackError(Need.CURVES)
    found = Nonlinear(*(tuple(tyre.nonlinearity[key].value for key in keys) for tyre in (cross, radial)))
    return Reading(min(found.ratios) > _TIMES, True, found, min(found.ratios))


def _lines(quantity: Quantity, tyre: str, values: Values, axis: str) -> Lines:
    found = lines_along(values, quantity.over, axis)
    if found is None or not found.is_line:
        need = Need.THREE_PRESSURES if axis == "pressure" else Need.THREE_FREQUENCIES
        raise LackError(need, quantity, tyre)
    return found


def rising(quantity: Quantity, values: Values, axis: str, tyre: str = "") -> Reading:
    """Whether a quantity rises along an axis on every line: `Trend`."""
    found = _lines(quantity, tyre, values, axis).trend()
    effects = found.effects.values()
    return Reading(all(effect.value > 0.0 for effect in effects), _all_claimed(effects), found, *_mean(effects))


def in_band(values: Values) -> Values:
    """Values at the frequencies of claim 6."""
    return {key: found for key, found in values.items() if _RISE[0] <= key[2] <= _RISE[1]}


def _means(values: Values) -> dict[tuple[float, float], Measured]:
    """Mean by pressure and load over the frequencies that all of them have."""
    tested: dict[Key, set[float]] = {}
    for key in values:
        tested.setdefault(key[:2], set()).add(key[2])
    shared = set.intersection(*tested.values()) if tested else set()
    return {
        (p, load): Measured(
            float(np.mean([values[p, load, f].value for f in shared])),
            float(np.mean([values[p, load, f].std for f in shared])),
        )
        for p, load in sorted(tested)
        if shared
    }


@dataclass(frozen=True)
class OptimumAt:
    """Under one load [N]: the pressure of the largest C [Pa], and how far C at each end is below it, relative."""

    load: float
    pressure: float
    drops: Mapping[float, float]


def optimum(cross: Tyre) -> Reading:
    """Whether C of the cross-ply, averaged over frequency, has its maximum near 1.68 bar: `OptimumAt` by load."""
    means = _means(cross.c)
    pressures = sorted({p for p, _ in means})
    if len(pressures) < 3 or pressures[0] > _OPTIMUM - _NEAR or pressures[-1] < _OPTIMUM + _NEAR:
        raise LackError(Need.OPTIMUM, C, cross.role)
    loads = sorted({load for _, load in means})
    lines = [{p: means[p, load].value for p in pressures if (p, load) in means} for load in loads]
    tops = tuple(_largest(load, line) for load, line in zip(loads, lines, strict=True))
    inside = (min(line) < at.pressure < max(line) for at, line in zip(tops, lines, strict=True))
    near = all(abs(at.pressure - _OPTIMUM) <= _NEAR for at in tops)
    sure = all(_has_maximum(cross.c, load) for load in loads)
    return Reading(all(inside) and near, sure, tops, float(np.mean([at.pressure for at in tops])), unit="Pa")


def _largest(load: float, line: Mapping[float, float]) -> OptimumAt:
    top = max(line, key=lambda p: line[p])
    return OptimumAt(load, top, {p: 1 - line[p] / line[top] for p in (min(line), max(line)) if p != top})


def _has_maximum(values: Values, load: float) -> bool:
    """Whether C under one load has a maximum against pressure beyond the scatter."""
    lines = lines_along({key: found for key, found in values.items() if key[1] == load}, C.over, "pressure")
    extremum = lines.extremum() if lines is not None else None
    return extremum is not None and extremum.holds is Holds.MAXIMUM


@dataclass(frozen=True)
class ApartAt:
    """C of one tyre under the lowest load above that under the highest, at the lowest and at the highest pressure."""

    tyre: str
    load: float
    against_load: float
    pressures: tuple[float, float]
    low: Effect
    high: Effect


def loads_apart(cross: Tyre, radial: Tyre) -> Reading:
    """How far C at the lowest load exceeds that at the highest, at the ends of the pressures: `ApartAt` by tyre."""
    parts = tuple(_apart(tyre) for tyre in (cross, radial))
    holds = all(at.high.value > _SPREAD and abs(at.low.value) < _NEGLIGIBLE * at.high.value for at in parts)
    high = [at.high for at in parts]
    return Reading(holds, _all_claimed(high), parts, *_mean(high))


def _apart(tyre: Tyre) -> ApartAt:
    means = _means(tyre.c)
    pressures, loads = sorted({p for p, _ in means}), sorted({load for _, load in means})
    if len(pressures) < 2 or len(loads) < 2:
        raise LackError(Need.LOADS, C)
    ends, first, last = (pressures[0], pressures[-1]), loads[0], loads[-1]
    if any((p, load) not in means for p in ends for load in (first, last)):
        raise LackError(Need.CORNERS, C)
    low, high = (between(means[p, last].pair, means[p, first].pair) for p in ends)
    return ApartAt(tyre.role, first, last, ends, low, high)


@dataclass(frozen=True)
class TurningAt:
    """Under one load [N]: the change of K2 with pressure in the low, the middle and the high band, by frequency."""

    load: float
    bands: tuple[tuple[Effect, ...], tuple[Effect, ...], tuple[Effect, ...]]
    flatness: float

    @property
    def turns(self) -> bool:
        """Whether K2 falls in the low band, rises in the high one and hardly changes between."""
        low, _, high = self.bands
        falls, rises = max(e.value for e in low) < 0.0, min(e.value for e in high) > 0.0
        return falls and rises and self.flatness < _FLAT

    @property
    def sure(self) -> bool:
        """Whether the mean fall and the mean rise are beyond the uncertainty."""
        low, _, high = self.bands
        return mean_effect(low).sign == -1 and mean_effect(high).sign == 1


@dataclass(frozen=True)
class Turning:
    """The change of K2 with pressure below, at and above the frequencies where it turns."""

    ends: tuple[float, float]
    loads: tuple[TurningAt, ...]


def turning(tyre: Tyre) -> Reading:
    """Whether the change of K2 with pressure turns from fall to rise between 16 and 19 Hz: `Turning`."""
    lines = _lines(K2, tyre.role, tyre.k2, "pressure")
    trend = lines.trend()
    loads = tuple(_turning_at(tyre, lines, trend, load) for load in sorted({key[0] for key in trend.effects}))
    rises = _mean(effect for at in loads for effect in at.bands[2])
    return Reading(all(at.turns for at in loads), all(at.sure for at in loads), Turning(trend.ends, loads), *rises)


def _turning_at(tyre: Tyre, lines: Lines, trend: Trend, load: float) -> TurningAt:
    effects = {key[1]: effect for key, effect in trend.effects.items() if key[0] == load}
    low, flat, high = ([f for f in effects if inside(f)] for inside in _BANDS)
    if not (low and flat and high):
        raise LackError(Need.BANDS, K2, tyre.role)
    slopes = {f: abs(float(np.polyfit(*lines.lines[load, f][:2], 1)[0])) for f in effects}
    flatness = max(slopes[f] for f in flat) / float(np.mean([slopes[f] for f in (*low, *high)]))
    bands = tuple(tuple(effects[f] for f in band) for band in (low, flat, high))
    return TurningAt(load, bands, flatness)  # type: ignore[arg-type]


@dataclass(frozen=True)
class Likewise:
    """The cross-ply's K2: whether it turns, how it rises with frequency, how far it is above the radial-ply's."""

    turns: bool
    rising: Trend
    above: Above


def likewise(cross: Tyre, radial: Tyre) -> Reading:
    """Whether the cross-ply's K2 does what the radial-ply's is said to do, at a higher level: `Likewise`."""
    turns, rises = turning(cross), rising(K2, cross.k2, "frequency", cross.role)
    higher = above(K2, cross.k2, radial.k2)
    found = Likewise(turns.holds, rises.evidence, higher.evidence)
    parts = (turns, rises, higher)
    holds, sure = all(part.holds for part in parts), all(part.sure for part in parts)
    return Reading(holds, sure, found, higher.effect, higher.std)


@dataclass(frozen=True)
class Isolation:
    """TR of the radial-ply above that of the cross-ply below the crossing, and the reverse beyond it."""

    pressures: tuple[float, ...]
    below: tuple[Effect, ...]
    beyond: tuple[Effect, ...]


def isolation(cross: Tyre, radial: Tyre) -> Reading:
    """Whose TR is the lower on either side of the stated crossing: `Isolation`."""
    tested = sorted({key[0] for key in cross.tr})
    near = {min(tested, key=lambda p: abs(p - wanted)) for wanted in _TR_PRESSURES} if tested else set()
    keys = [key for key in common(cross.tr, radial.tr) if key[0] in near]

    def higher(upper: Tyre, lower: Tyre, side: float) -> tuple[Effect, ...]:
        there = (key for key in keys if side * (key[2] - _TR_CROSSING) > _TR_CLEAR)
        return tuple(between(lower.tr[key].pair, upper.tr[key].pair) for key in there)

    found = Isolation(tuple(sorted(near)), higher(radial, cross, -1.0), higher(cross, radial, 1.0))
    if not (found.below and found.beyond):
        raise LackError(Need.SIDES)
    effects = (*found.below, *found.beyond)
    return Reading(all(effect.value > 0.0 for effect in effects), _all_claimed(effects), found, *_mean(effects))


@dataclass(frozen=True)
class Order:
    """Frequencies of the largest measured TR [Hz] at the conditions in common, and the nominal gaps between them."""

    cross: tuple[float, ...]
    radial: tuple[float, ...]
    gaps: tuple[float, ...]


def resonance(cross: Tyre, radial: Tyre) -> Reading:
    """Whose largest measured TR stands at the lower frequency: `Order`."""
    pairs = [(peak(cross.curves[key]), peak(radial.curves[key])) for key in common(cross.curves, radial.curves)]
    peaks = [(a, b) for a, b in pairs if a is not None and b is not None]
    if not peaks:
        raise LackError(Need.PEAKS)
    nominal = cross.facts.nominal["frequency"]
    at = [tuple(found.frequency for found in side) for side in zip(*peaks, strict=True)]
    gaps = tuple(nominal.get(a, a) - nominal.get(b, b) for a, b in zip(*at, strict=True))
    sure = all(not a.side and not b.side and a.best - b.best > a.doubt + b.doubt for a, b in peaks)
    return Reading(min(gaps) > 0.0, sure, Order(at[0], at[1], gaps), float(np.mean(gaps)), unit="Hz")
