"""Trends: the change of a quantity with pressure, load and frequency."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from fourpole.core.arrays import FloatArray
from fourpole.findings.evidence import Effect, along, between, mean_effect, residual_squares
from fourpole.findings.facts import Values, finding_on
from fourpole.findings.finding import Finding, Holds, Key
from fourpole.quantities import Quantity

#: For a trend along each axis: the other axes, the first of which that was varied splits the trend.
_SPLIT_BY = {"pressure": ("frequency", "load"), "load": ("pressure", "frequency"), "frequency": ("pressure", "load")}
#: An extremum needs at least this many points on a line.
_FEWEST_POINTS = 4
Line = tuple[FloatArray, FloatArray, FloatArray]


@dataclass(frozen=True)
class Extremum:
    """A maximum or minimum of the mean curve between its ends.

    Attributes
    ----------
    holds : Holds
        MAXIMUM or MINIMUM.
    place : float
        Its place on the axis, in SI.
    first, last : Effect
        The values at the two ends relative to the extremum, less 1.
    """

    holds: Holds
    place: float
    first: Effect
    last: Effect


@dataclass(frozen=True)
class Trend:
    """The change of a quantity of one specimen along one axis, at fixed values of the others.

    Attributes
    ----------
    axis : str
    rest : tuple of str
        The other axes.
    ends : (float, float)
        Lowest and highest value on the axis, in SI.
    is_line : bool
        Whether each line has three points or more; two points make a difference, not a trend.
    effects : mapping
        Relative change from the first to the last point, by the values of the other axes.
    split_by : str or None
        The other axis at whose values the change is given one by one.
    extremum : Extremum or None
    """

    axis: str
    rest: tuple[str, ...]
    ends: tuple[float, float]
    is_line: bool
    effects: Mapping[Key, Effect]
    split_by: str | None = None
    extremum: Extremum | None = None

    @property
    def kind(self) -> str:
        """Name of the kind in findings.csv, with the axis."""
        return f"trend with {self.axis}"

    @property
    def mean(self) -> Effect:
        """Mean relative change over all lines."""
        return mean_effect(list(self.effects.values()))

    @cached_property
    def parts(self) -> dict[float, Effect]:
        """Mean relative change at each value of the axis `split_by`; one mean of all lines if there is no such axis."""
        if self.split_by is None:
            return {0.0: self.mean}
        place, groups = self.rest.index(self.split_by), dict[float, list[Effect]]()
        for key in sorted(self.effects, key=lambda key: key[place]):
            groups.setdefault(key[place], []).append(self.effects[key])
        return {value: mean_effect(effects) for value, effects in groups.items()}

    @property
    def holds(self) -> Holds:
        """MAXIMUM or MINIMUM, RISES or FALLS, MIXED if the direction depends on the other axis, or NO_CHANGE."""
        if self.extremum is not None:
            return self.extremum.holds
        single = any(effect.claimed(len(self.parts)) for effect in self.parts.values())
        if not single and not self.mean.claimed():
            return Holds.NO_CHANGE
        if {1, -1} <= {effect.sign for effect in self.parts.values()} or not self.mean.claimed():
            return Holds.MIXED
        return Holds.RISES if self.mean.value > 0 else Holds.FALLS

    @property
    def zero(self) -> float | None:
        """The value of `split_by`, in SI, at which the change passes zero; None if it does not pass zero exactly once.

        The change must be claimed upwards at one value and downwards at another.
        """
        order, parts = sorted(self.parts), self.parts
        turns = [(a, b) for a, b in pairwise(order) if parts[a].value * parts[b].value < 0.0]
        claimed = {parts[value].sign for value in order if parts[value].sign}
        if len(turns) != 1 or len(claimed) != 2:
            return None
        ((a, b),) = turns
        return a - parts[a].value * (b - a) / (parts[b].value - parts[a].value)


@dataclass(frozen=True)
class Lines:
    """Lines of a quantity along one axis, each at fixed values of the others.

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

    @property
    def is_line(self) -> bool:
        """Whether the lines have three points or more."""
        return next(iter(self.lines.values()))[0].size > 2

    def effects(self) -> dict[Key, Effect]:
        """Relative change from the first to the last point of each line."""
        if not self.is_line:
            return {k: between((y[0], u[0]), (y[1], u[1])) for k, (_, y, u) in self.lines.items()}
        variance, dof = self.scatter(1)
        return {key: along(*line, variance, dof) for key, line in self.lines.items()}

    def scatter(self, order: int) -> tuple[float, float]:
        """Relative variance of the residuals about polynomials of an order, and its degrees of freedom.

        Lines at several frequencies use the same K1, so only one of them counts for the degrees of freedom.
        """
        free = {key: max(line[0].size - order - 1, 0) for key, line in self.lines.items()}
        squares = sum(residual_squares(line[0], line[1], order) for key, line in self.lines.items() if free[key])
        own: dict[Key, int] = {}
        for key, count in free.items():
            group = tuple(v for v, axis in zip(key, self.rest, strict=True) if axis != "frequency")
            own[group] = max(own.get(group, 0), count)
        return squares / max(sum(free.values()), 1), float(max(sum(own.values()), 1))

    def trend(self) -> Trend:
        """The relative change along the axis, with its extremum."""
        x = np.concatenate([line[0] for line in self.lines.values()])
        settings = zip(self.rest, zip(*self.lines, strict=True), strict=True)
        varied = {axis for axis, values in settings if len({*values}) > 1}
        split_by = next((axis for axis in _SPLIT_BY[self.axis] if axis in varied), None)
        ends = float(x.min()), float(x.max())
        return Trend(self.axis, self.rest, ends, self.is_line, self.effects(), split_by, self.extremum())

    def extremum(self) -> Extremum | None:
        """Maximum or minimum inside the mean curve; None unless both ends differ from it by more than the scatter."""
        full = max(x.size for x, _, _ in self.lines.values())
        grid = next(x for x, _, _ in self.lines.values() if x.size == full)
        lines = [line for line in self.lines.values() if np.array_equal(line[0], grid)]
        if full < _FEWEST_POINTS:
            return None
        curve = np.mean([y / y.mean() for _, y, _ in lines], axis=0)
        std = np.mean([u / y.mean() for _, y, u in lines], axis=0)
        variance, dof = self.scatter(2)
        for holds, top in ((Holds.MAXIMUM, int(np.argmax(curve))), (Holds.MINIMUM, int(np.argmin(curve)))):
            change, shared = curve / curve[top] - 1.0, np.abs(std - std[top])
            ends = [Effect(float(change[i]), (2 * variance) ** 0.5, float(shared[i]), dof) for i in (0, -1)]
            if 0 < top < full - 1 and all(end.claimed(full) for end in ends):
                return Extremum(holds, float(grid[top]), *ends)
        return None


def lines_along(values: Values, axes: tuple[str, ...], axis: str) -> Lines | None:
    """Lines of three points or more along an axis; if there are none, lines of two points; else None."""
    place = axes.index(axis)
    points: dict[Key, list[tuple[float, float, float]]] = {}
    for key in sorted(values):
        if key[place] > 0:
            points.setdefault((*key[:place], *key[place + 1 :]), []).append((key[place], *values[key].pair))
    most = max((len(line) for line in points.values()), default=0)
    if most < 2:
        return None
    kept = {key: line for key, line in points.items() if len(line) >= min(most, 3)}
    rest = tuple(name for name in axes if name != axis)
    return Lines(axis, rest, {key: tuple(np.array(line).T) for key, line in kept.items()})  # type: ignore[misc]


def trend_of(quantity: Quantity, tyre: str, values: Values, axis: str) -> Finding | None:
    """The trend of a quantity of one specimen along one axis; None if no line has two points on it."""
    lines = lines_along(values, quantity.over, axis)
    if lines is None:
        return None
    trend = lines.trend()
    return finding_on(quantity, {tyre: values}, values, trend.holds, trend, trend.mean.value, trend.mean.std)
