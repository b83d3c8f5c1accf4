"""How a quantity goes with pressure, load and frequency."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import groupby, pairwise

import numpy as np

from fourpole.report.words.evidence import Effect, FloatArray, along, between, mean_effect, residual_squares
from fourpole.report.words.facts import Measured
from fourpole.report.words.phrases import (
    Key,
    Quantity,
    condition,
    counted,
    joined,
    percent,
    percents,
    setting,
    stretches,
)

__all__ = ["K1", "K2", "LOSS", "QUANTITIES", "STORAGE", "C", "Trend", "level", "trend", "trend_sentence"]

_STATIC, _DYNAMIC = ("pressure", "load"), ("pressure", "load", "frequency")
K1 = Quantity("K1", "K1 [N/m]", "u(K1) [N/m]", "static stiffness", _STATIC, 1e3, "kN/m", "is the stiffer")
K2 = Quantity("K2", "K2 [N/m]", "u(K2) [N/m]", "dynamic stiffness", _DYNAMIC, 1e3, "kN/m", "is dynamically the stiffer")
C = Quantity("C", "C [N s/m]", "u(C) [N s/m]", "damping", _DYNAMIC, 1.0, "N s/m", "is the more damped")
LOSS = Quantity(
    "loss factor",
    "loss factor [1]",
    "u(loss factor) [1]",
    "loss",
    _DYNAMIC,
    more="has the larger loss",
    start="The loss factor",
)
STORAGE = Quantity(
    "Re K*", "Re K* [N/m]", "u(Re K*) [N/m]", "dynamic stiffness", _DYNAMIC, 1e3, "kN/m", "is dynamically the stiffer"
)
QUANTITIES = (K1, K2, STORAGE, C, LOSS)

#: Along which axis a trend may differ, and is then told stretch by stretch.
_TOLD_BY = {"pressure": ("frequency", "load"), "load": ("pressure", "frequency"), "frequency": ("pressure", "load")}
_PLURAL = {"pressure": "pressures", "load": "loads", "frequency": "frequencies"}
Line = tuple[FloatArray, FloatArray, FloatArray]


@dataclass(frozen=True)
class Trend:
    """Lines of a quantity along one axis, each at fixed values of the others, and their relative change.

    Attributes
    ----------
    axis : str
    rest : tuple of str
        The other axes.
    lines : mapping
        x, y and u(y) by the values of the other axes; three points or more, or two each.
    """

    axis: str
    rest: tuple[str, ...]
    lines: Mapping[Key, Line]

    @cached_property
    def effects(self) -> dict[Key, Effect]:
        """Relative change from the first to the last point of each line."""
        if not self.is_line:
            return {k: between((y[0], u[0]), (y[1], u[1])) for k, (_, y, u) in self.lines.items()}
        variance, dof = self.scatter(1)
        return {key: along(*line, variance, dof) for key, line in self.lines.items()}

    def scatter(self, order: int) -> tuple[float, float]:
        """Relative variance about polynomials, and its degrees of freedom: lines at several frequencies share a K1."""
        free = {key: max(line[0].size - order - 1, 0) for key, line in self.lines.items()}
        squares = sum(residual_squares(line[0], line[1], order) for key, line in self.lines.items() if free[key])
        own: dict[Key, int] = {}
        for key, count in free.items():
            group = tuple(v for v, axis in zip(key, self.rest, strict=True) if axis != "frequency")
            own[group] = max(own.get(group, 0), count)
        return squares / max(sum(free.values()), 1), float(max(sum(own.values()), 1))

    @property
    def is_line(self) -> bool:
        """Three points or more."""
        return next(iter(self.lines.values()))[0].size > 2

    @property
    def ends(self) -> tuple[float, float]:
        """Lowest and highest value on the axis."""
        return min(float(line[0][0]) for line in self.lines.values()), max(
            float(x[-1]) for x, _, _ in self.lines.values()
        )

    def span(self, word: str = "to") -> str:
        """'1.00 to 2.40 bar'."""
        low, high = (setting(self.axis, end) for end in self.ends)
        return f"{low.rpartition(' ')[0]} {word} {high}"

    @property
    def mean(self) -> Effect:
        """Mean over all lines."""
        return mean_effect(list(self.effects.values()))

    @cached_property
    def told_by(self) -> str | None:
        """The axis of the others on which the trend is looked at value by value."""
        for axis in _TOLD_BY[self.axis]:
            if axis in self.rest and len({key[self.rest.index(axis)] for key in self.lines}) > 1:
                return axis
        return None

    def by(self, axis: str) -> dict[float, Effect]:
        """Mean over the lines at each value of another axis."""
        at = self.rest.index(axis)
        order = sorted(self.effects.items(), key=lambda item: item[0][at])
        return {v: mean_effect([e for _, e in group]) for v, group in groupby(order, key=lambda item: item[0][at])}

    def extremum(self) -> tuple[str, float, Effect, Effect] | None:
        """Maximum or minimum between the ends of the mean curve: which, where, and how far the two ends are off it."""
        full = max((x.size for x, _, _ in self.lines.values()), default=0)
        lines = [line for line in self.lines.values() if line[0].size == full and line[0].tolist() == self.grid(full)]
        if full < 4 or not lines:
            return None
        curve = np.mean([y / y.mean() for _, y, _ in lines], axis=0)
        u = np.mean([u / y.mean() for _, y, u in lines], axis=0)
        variance, dof = self.scatter(2)
        for name, sign in (("maximum", 1.0), ("minimum", -1.0)):
            top = int(np.argmax(sign * curve))
            drops = [
                Effect(curve[end] / curve[top] - 1.0, (2 * variance) ** 0.5, abs(u[end] - u[top]), dof)
                for end in (0, -1)
            ]
            if 0 < top < full - 1 and all(drop.claimed(full) and drop.value * sign < 0 for drop in drops):
                return name, self.grid(full)[top], drops[0], drops[1]
        return None

    def grid(self, size: int) -> list[float]:
        """Points of the first line that has all of them."""
        grid: list[float] = next(x.tolist() for x, _, _ in self.lines.values() if x.size == size)
        return grid


def trend(values: Mapping[Key, Measured], axes: Sequence[str], axis: str) -> Trend | None:
    """Lines of three points or more along an axis; where there are none, those of two; else None."""
    at = list(axes).index(axis)
    points: dict[Key, list[tuple[float, float, float]]] = {}
    for key, found in sorted(values.items()):
        if key[at] > 0:
            points.setdefault((*key[:at], *key[at + 1 :]), []).append((key[at], *found.pair))
    most = max((len(line) for line in points.values()), default=0)
    if most < 2:
        return None
    kept = {key: line for key, line in points.items() if len(line) >= min(most, 3)}
    rest = tuple(name for name in axes if name != axis)
    return Trend(axis, rest, {key: tuple(np.array(line).T) for key, line in kept.items()})  # type: ignore[misc]


def level(quantity: Quantity, tyre: str, values: Mapping[Key, Measured]) -> str:
    """Lowest and highest value, where, and how well they are known."""
    low, high = (pick(values, key=lambda k: (values[k].value, k)) for pick in (min, max))
    known = f"standard uncertainty of {percents([found.std / found.value for found in values.values()])}"
    at = {key: condition(quantity.axes, key) for key in (low, high)}
    if low == high:
        return f"{quantity.of(tyre)} is {quantity.shown(values[low].value)} at {at[low]}, with a {known}."
    return (
        f"{quantity.of(tyre)} lies between {quantity.shown(values[low].value)} ({at[low]}) and "
        f"{quantity.shown(values[high].value)} ({at[high]}), each with a {known}."
    )


def trend_sentence(quantity: Quantity, tyre: str, found: Trend) -> str:
    """One sentence on a trend, or that there is none to be seen."""
    name = quantity.of(tyre)
    extremum = found.extremum()
    if extremum is not None:
        what, where, first, last = extremum
        off = "below" if what == "maximum" else "above"
        return (
            f"{name} has its {what} against {found.axis} at {setting(found.axis, where)}{_over(found)}: it is "
            f"{percent(abs(first.value))} {off} it at {setting(found.axis, found.ends[0])} and "
            f"{percent(abs(last.value))} {off} it at {setting(found.axis, found.ends[1])}."
        )
    parts = found.by(found.told_by) if found.told_by else {0.0: found.mean}
    standing = any(effect.claimed(len(parts)) for effect in parts.values())
    if not standing and not found.mean.claimed():
        mean = found.mean
        if found.is_line:
            vary = f"vary measurably with {found.axis}: from {found.span()} it changes"
        else:
            vary = f"differ measurably between {found.span('and')}: it changes"
        return (
            f"{name} does not {vary} by {_signed(mean.value)}{_over(found)}, no more than twice the standard "
            f"uncertainty of {percent(mean.std)}."
        )
    signs = {effect.sign for effect in parts.values()}
    if signs == {1, -1} or signs == {1, -1, 0} or (standing and not found.mean.claimed()):
        return f"{name}, between {found.span('and')}, {_piecewise(found, parts)}."
    return f"{name} {_uniform(found, parts)}."


def _uniform(found: Trend, parts: Mapping[float, Effect]) -> str:
    up = found.mean.value > 0
    low, high = (setting(found.axis, end) for end in found.ends)
    text = f"{'rises' if up else 'falls'} with {found.axis} from {found.span()}"
    if not found.is_line:
        text = f"is {'higher' if up else 'lower'} at {high} than at {low}"
    text += f", by {percent(abs(found.mean.value))}{_over(found)}"
    changes = [effect.value if up else -effect.value for effect in found.effects.values()]
    if len(changes) > 1:
        text += f" ({percents(changes)})" if percents(changes) != percent(abs(found.mean.value)) else ""
    silent = [value for value, effect in parts.items() if not effect.sign]
    if silent and found.told_by and len(silent) < len(parts):
        text += f"; at {stretches(found.told_by, silent, list(parts))} the change is within its uncertainty"
    return text


def _piecewise(found: Trend, parts: Mapping[float, Effect]) -> str:
    axis = found.told_by or found.axis
    goes, last = f" with {found.axis}", setting(found.axis, found.ends[1])
    verbs = {1: f"rises{goes}", -1: f"falls{goes}", 0: f"does not vary measurably{goes}"}
    if not found.is_line:
        verbs = {1: f"is higher at {last}", -1: f"is lower at {last}", 0: "does not differ measurably"}
    said = []
    for sign in dict.fromkeys(effect.sign for effect in parts.values()):
        chosen = {value: abs(effect.value) for value, effect in parts.items() if effect.sign == sign}
        top = max(chosen, key=lambda value: chosen[value])
        much = f", by up to {percent(chosen[top])} at {setting(axis, top)}" if sign else ""
        said.append(f"{verbs[sign]} at {stretches(axis, list(chosen), list(parts))}{much}")
    text = joined(said) if len(said) < 3 else f"{'; '.join(said[:-1])}; and {said[-1]}"
    crossing = _sign_change(parts)
    if crossing is None:
        return text
    return f"{text}; the change with {found.axis} crosses zero at about {setting(axis, crossing)}"


def _sign_change(parts: Mapping[float, Effect]) -> float | None:
    """Where the effect passes zero between values at which it is claimed either way; None if not once."""
    order = sorted(parts)
    turns = [(a, b) for a, b in pairwise(order) if parts[a].value * parts[b].value < 0.0]
    claimed = [parts[value].sign for value in order if parts[value].sign]
    if len(turns) != 1 or len(set(claimed)) != 2:
        return None
    (a, b), (e_a, e_b) = turns[0], (parts[turns[0][0]].value, parts[turns[0][1]].value)
    return a - e_a * (b - a) / (e_b - e_a)


def _over(found: Trend) -> str:
    """Over what a mean was taken."""
    if len(found.lines) == 1:
        (key,) = found.lines
        return f" at {condition(found.rest, key)}" if any(value > 0 for value in key) else ""
    return f" on average over {combinations(found.rest, list(found.lines))}"


def combinations(axes: Sequence[str], keys: Sequence[Key]) -> str:
    """'5 pressures', '20 combinations of load and frequency'."""
    varied = [axis for i, axis in enumerate(axes) if len({key[i] for key in keys}) > 1]
    if len(varied) == 1:
        return counted(len(keys), varied[0], _PLURAL[varied[0]])
    return f"{counted(len(keys), 'combination')} of {joined(varied)}" if varied else counted(len(keys), "condition")


def _signed(value: float) -> str:
    return percent(value) if value < 0 else f"+{percent(value)}"
