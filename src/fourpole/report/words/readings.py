"""What a campaign shows of each of the 1982 paper's conclusions, in numbers."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fourpole.report.words.compare import differences
from fourpole.report.words.evidence import Effect, between, mean_effect
from fourpole.report.words.facts import Curve, Facts, Measured, common
from fourpole.report.words.phrases import (
    Key,
    Quantity,
    bar,
    condition,
    counted,
    joined,
    newton,
    percent,
    percents,
    ranged,
)
from fourpole.report.words.resonance import peak
from fourpole.report.words.trends import K1, K2, C, Trend, combinations, trend

__all__ = [
    "Found",
    "NeededError",
    "Tyre",
    "above",
    "isolation",
    "likewise",
    "loads_apart",
    "nonlinear",
    "optimum",
    "resonance",
    "rising",
    "turning",
]

_EDGE = 1e-6
_RISE = (10.0 * 0.98, 24.0 * 1.02)  # Hz, by claim 6
_OPTIMUM, _NEAR = 168e3, 12e3  # Pa
_TR_PRESSURES, _TR_CROSSING, _TR_CLEAR = (100e3, 168e3), 18.0, 1.2
_SPREAD, _NEGLIGIBLE = 0.03, 1.0 / 3.0
_FLAT = 0.5
_BANDS: tuple[Callable[[float], bool], ...] = (  # Hz, by claim 8
    lambda f: f <= 16.0 * (1.0 + _EDGE),
    lambda f: 16.5 * (1.0 - _EDGE) <= f <= 18.5 * (1.0 + _EDGE),
    lambda f: f > 19.0 * (1.0 + _EDGE),
)
_TIMES = 3.0
_NONLINEARITY = Quantity("nonlinearity", "nonlinearity [1]", "", "nonlinearity", ("pressure",))
Values = Mapping[Key, Measured]


class NeededError(Exception):
    """What a campaign lacks to tell."""


@dataclass(frozen=True)
class Tyre:
    """One of the two tyres: its name, what the sentences call it, and its values by condition."""

    label: str
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
        return self._values(_NONLINEARITY)

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


Found = tuple[bool, bool, str]


def above(symbol: str, quantity: Quantity, upper: Values, lower: Values) -> Found:
    """Whether the upper is above the lower at every condition in common."""
    found = differences(lower, upper)
    if not found:
        raise NeededError(f"{symbol} of both tyres at a condition in common")
    against = [key for key, effect in found.items() if effect.value <= 0.0]
    said = percents([effect.value for effect in found.values()])
    text = f"the difference is {said} at {combinations(quantity.axes, list(found))} in common"
    if against and len(against) < len(found):
        text += f", and the other way round at {len(against)} of them, such as {condition(quantity.axes, against[0])}"
    return not against, all(effect.claimed() for effect in found.values()), text


def nonlinear(cross: Tyre, radial: Tyre) -> Found:
    """Departure of the load-deflection curves from a straight line."""
    keys = common(cross.nonlinearity, radial.nonlinearity)
    if not keys:
        raise NeededError("load-deflection curves of both tyres at a pressure in common")
    a, b = ([tyre.nonlinearity[key].value for key in keys] for tyre in (cross, radial))
    ratios = [x / y for x, y in zip(a, b, strict=True)]
    text = (
        f"the curve departs from a straight line by {percents(a)} of the load span for {cross.label} and by "
        f"{percents(b)} for {radial.label}, {ranged(ratios)} times as much, where more than 3 times is asked for"
    )
    return min(ratios) > _TIMES, True, text


def _trend(symbol: str, values: Values, axis: str) -> Trend:
    found = trend(values, ("pressure", "load", "frequency"), axis)
    if found is None or not found.is_line:
        raise NeededError(f"{symbol} at three {'pressures' if axis == 'pressure' else 'frequencies'} or more")
    return found


def rising(symbol: str, values: Values, axis: str) -> Found:
    """Whether a quantity rises along an axis on every line."""
    found = _trend(symbol, values, axis)
    effects = found.effects.values()
    falling = sum(effect.value <= 0.0 for effect in effects)
    text = (
        f"from {found.span()} it changes by {percents([effect.value for effect in effects])} "
        f"at {combinations(found.rest, list(found.lines))}"
    )
    if falling:
        text += f" and falls at {falling} of them"
    return not falling, all(effect.claimed() for effect in effects), text


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
        (p, load): Measured(*(float(np.mean([values[p, load, f].pair[i] for f in shared])) for i in (0, 1)))
        for p, load in sorted(tested)
        if shared
    }


def optimum(cross: Tyre) -> Found:
    """Whether C of the cross-ply, averaged over frequency, has its maximum near the stated pressure."""
    means = _means(cross.c)
    pressures = sorted({p for p, _ in means})
    if len(pressures) < 3 or pressures[0] > _OPTIMUM - _NEAR or pressures[-1] < _OPTIMUM + _NEAR:
        raise NeededError(f"C of {cross.label} at three pressures or more, from below 1.56 bar to above 1.80 bar")
    holds, sure, said = True, True, []
    for load in sorted({load for _, load in means}):
        line = {p: means[p, load].value for p in pressures if (p, load) in means}
        top = max(line, key=lambda p: line[p])
        holds &= min(line) < top < max(line) and abs(top - _OPTIMUM) <= _NEAR
        at_load = trend({k: v for k, v in cross.c.items() if k[1] == load}, C.axes, "pressure")
        seen = at_load.extremum() if at_load is not None else None
        sure &= seen is not None and seen[0] == "maximum"
        ends = [f"{percent(1 - line[p] / line[top])} below it at {bar(p)}" for p in (min(line), max(line)) if p != top]
        said.append(f"at {newton(load)} it is largest at {bar(top)} and {joined(ends)}")
    return holds, sure, f"averaged over frequency, {'; '.join(said)}"


def loads_apart(cross: Tyre, radial: Tyre) -> Found:
    """How far C under the lowest load exceeds that under the highest, at the ends of the pressures."""
    holds, sure, said = True, True, []
    for tyre in (cross, radial):
        means = _means(tyre.c)
        pressures, loads = sorted({p for p, _ in means}), sorted({load for _, load in means})
        if len(pressures) < 2 or len(loads) < 2:
            raise NeededError("C of both tyres at two loads and at two pressures or more")
        ends = pressures[0], pressures[-1]
        if any((p, load) not in means for p in ends for load in (loads[0], loads[-1])):
            raise NeededError(
                "C of both tyres under the lowest and the highest load at the lowest and highest pressure"
            )
        low, high = (between(means[p, loads[-1]].pair, means[p, loads[0]].pair) for p in ends)
        holds &= high.value > _SPREAD and abs(low.value) < _NEGLIGIBLE * high.value
        sure &= high.claimed()
        said.append(
            f"C of {tyre.label} at {newton(loads[0])} exceeds that at {newton(loads[-1])} by {percent(high.value)} at "
            f"{bar(ends[1])} (standard uncertainty {percent(high.std)}) and by {percent(low.value)} at {bar(ends[0])}"
        )
    return holds, sure, "; ".join(said)


def turning(tyre: Tyre) -> Found:
    """Change of K2 with pressure below, at and above the frequencies where it turns."""
    name = f"K2 of {tyre.label}"
    found = _trend(name, tyre.k2, "pressure")
    holds, sure, said = True, True, []
    for load in sorted({key[0] for key in found.effects}):
        effects = {key[1]: effect for key, effect in found.effects.items() if key[0] == load}
        low, flat, high = ([f for f in effects if inside(f)] for inside in _BANDS)
        if not (low and flat and high):
            raise NeededError(f"{name} at frequencies up to 16 Hz, between 16.5 and 18.5 Hz, and above 19 Hz")
        steep = {f: abs(float(np.polyfit(*found.lines[load, f][:2], 1)[0])) for f in effects}
        share = max(steep[f] for f in flat) / float(np.mean([steep[f] for f in (*low, *high)]))
        falls, rises = ([effects[f] for f in band] for band in (low, high))
        holds &= max(e.value for e in falls) < 0.0 < min(e.value for e in rises) and share < _FLAT
        sure &= mean_effect(falls).sign == -1 and mean_effect(rises).sign == 1
        changes = [percents([effects[f].value for f in band]) for band in (low, flat, high)]
        said.append(
            f"at {newton(load)} it changes by {changes[0]} up to 16 Hz, by {changes[1]} between 16.5 and 18.5 Hz, "
            f"and by {changes[2]} above 19 Hz"
        )
    return holds, sure, f"from {found.span()}, {'; '.join(said)}"


def likewise(cross: Tyre, radial: Tyre) -> Found:
    """Whether the cross-ply's K2 does what the radial-ply's is said to do, at a higher level."""
    parts = (
        turning(cross),
        rising(f"K2 of {cross.label}", cross.k2, "frequency"),
        above("K2", K2, cross.k2, radial.k2),
    )
    (turns, sure_1, _), (rises, sure_2, rise), (is_above, sure_3, difference) = parts
    text = (
        f"its change with pressure {'turns' if turns else 'does not turn'} from fall to rise between 16 and 19 Hz; "
        f"with frequency, {rise}; against {radial.label}, {difference}"
    )
    return turns and rises and is_above, sure_1 and sure_2 and sure_3, text


def isolation(cross: Tyre, radial: Tyre) -> Found:
    """Whose TR is the lower on either side of the stated crossing."""
    keys = common(cross.tr, radial.tr)
    pressures = sorted({key[0] for key in cross.tr})
    near = {min(pressures, key=lambda p: abs(p - wanted)) for wanted in _TR_PRESSURES} if pressures else set()
    found: dict[bool, list[Effect]] = {False: [], True: []}
    for key in keys:
        if key[0] in near and abs(key[2] - _TR_CROSSING) > _TR_CLEAR:
            beyond = key[2] > _TR_CROSSING
            lower, upper = (radial, cross) if beyond else (cross, radial)
            found[beyond].append(between(lower.tr[key].pair, upper.tr[key].pair))
    if not (found[False] and found[True]):
        raise NeededError("TR of both tyres at frequencies below 16.8 Hz and above 19.2 Hz in common")
    holds = all(effect.value > 0.0 for effects in found.values() for effect in effects)
    sure = all(effect.claimed() for effects in found.values() for effect in effects)
    said = [percents([effect.value for effect in found[beyond]]) for beyond in (False, True)]
    text = (
        f"at {joined(bar(p) for p in sorted(near))}, TR of {radial.label} is {said[0]} higher than that of "
        f"{cross.label} below 16.8 Hz, and that of {cross.label} {said[1]} higher above 19.2 Hz"
    )
    return holds, sure, text


def resonance(cross: Tyre, radial: Tyre) -> Found:
    """Whose largest measured TR stands at the lower frequency."""
    pairs = [(peak(cross.curves[key]), peak(radial.curves[key])) for key in common(cross.curves, radial.curves)]
    peaks = [(a, b) for a, b in pairs if a is not None and b is not None]
    if not peaks:
        raise NeededError("TR of both tyres at three frequencies or more at a condition in common")
    nominal = cross.facts.nominal["frequency"]
    gaps = [nominal.get(a.frequency, a.frequency) - nominal.get(b.frequency, b.frequency) for a, b in peaks]
    sure = all(not a.side and not b.side and a.best - b.best > a.doubt + b.doubt for a, b in peaks)
    text = (
        f"the largest measured TR of {radial.label} stands at {ranged([b.frequency for _, b in peaks], 'Hz')} and that "
        f"of {cross.label} at {ranged([a.frequency for a, _ in peaks], 'Hz')}, {ranged(gaps, 'Hz', 2)} higher, at "
        f"{counted(len(peaks), 'condition')} in common"
    )
    return min(gaps) > 0.0, sure, text
