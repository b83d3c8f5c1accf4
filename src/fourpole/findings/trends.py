"""Effects with their uncertainty: levels of a quantity, two specimens compared, trends; when an effect may be claimed.

The tables give each value y its standard uncertainty u(y). Tests have most of it in common (rig, gains, K1). A common
error does not average out over tests, and it acts only in part on their differences. Hence three rules:

- **A line of three points or more**, as K2 against frequency: the random part of each test is the scatter about the
  straight line, and counts with Student's factor. The scatter includes the bend of the curve. The shared part is u(y),
  as an error of one sign that varies along the line as u(y) does. With fewer than three degrees of freedom u(y) counts
  in full as each test's own, unless the scatter is larger. The larger scatter then counts with the factor of three
  degrees of freedom: it is mostly the bend of the curve, and the factor of one degree, 12.7 or more, hides any effect.
- **Two single values**, as of two tyres or two loads: both u count in full.
- **A mean over conditions** has the uncertainty of one of them.

An effect is claimed if it exceeds two standard uncertainties, a chance of 4.6 %; if they come from scatter, Student's
factor of the same chance takes the place of two. If several effects are searched for any claim, the chance of a false
one is 1 % in all. The rule misses an error that follows the pressure or the frequency and is not in u(y) as such. An
example is a hysteresis that biases K1 more at one end of the pressures than at the other.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import pairwise
from math import hypot, inf, log, sqrt
from typing import ClassVar

import numpy as np

from fourpole.core import stats
from fourpole.core.arrays import FloatArray
from fourpole.core.confidence import CLAIM_CHANCE, SEARCH_CHANCE
from fourpole.findings.facts import Estimate, Facts, Finding, Holds, Key, Values, common, finding_on
from fourpole.quantities import CYCLE_LOSS, NONLINEARITY, Quantity

#: No relative effect below this is claimed, because it may be round-off.
_ROUND_OFF = 1e-9
#: Below this many degrees of freedom Student's factor is too large to be of use.
_FEW = 3.0


@dataclass(frozen=True)
class Effect:
    """A relative difference with its uncertainty.

    Attributes
    ----------
    value : float [1]
    own, shared : float [1]
        Standard uncertainty from errors of each test, and from errors that tests share.
    dof : float
        Degrees of freedom of `own`.
    """

    value: float
    own: float
    shared: float = 0.0
    dof: float = inf

    @property
    def std(self) -> float:
        """Standard uncertainty [1]."""
        return hypot(self.own, self.shared)

    def reach(self, searched: int = 1) -> float:
        """The value that an effect must exceed to be claimed [1], if `searched` effects are searched for any claim."""
        return max(hypot(factor(self.dof, searched) * self.own, factor(inf, searched) * self.shared), _ROUND_OFF)

    def claimed(self, searched: int = 1) -> bool:
        """Whether the value exceeds its uncertainty, if `searched` effects are searched for any claim."""
        return abs(self.value) > self.reach(searched)

    @property
    def sign(self) -> int:
        """1 or -1 for a claimed effect, else 0."""
        return int(np.sign(self.value)) if self.claimed() else 0


@lru_cache(maxsize=1000)
def factor(dof: float = inf, searched: int = 1) -> float:
    """Coverage factor [1] that a claim must exceed, of Student's distribution with `dof` degrees of freedom."""
    chance = 0.5 * (CLAIM_CHANCE if searched == 1 else SEARCH_CHANCE / searched)
    return float(stats.norm.isf(chance) if dof == inf else stats.t.isf(chance, dof))


def along(x: FloatArray, y: FloatArray, u: FloatArray, variance: float, dof: float) -> Effect:
    """Relative change of the straight line over the range of x; `variance` is that of the relative residuals."""
    level = float(np.mean(y))
    offset = x - x.mean()
    weights = offset / float(offset @ offset) * float(np.ptp(x)) / level
    own, shared = sqrt(variance) * level * float(np.sqrt(weights @ weights)), abs(float(weights @ u))
    stated = max(float(np.linalg.norm(weights * u)), shared)
    if dof < _FEW and own <= stated:
        return Effect(float(weights @ y), stated)
    return Effect(float(weights @ y), own, shared, max(dof, _FEW))


def residual_squares(x: FloatArray, y: FloatArray, order: int = 1) -> float:
    """Sum of the squared residuals about a polynomial, relative to the mean."""
    x = (x - x.mean()) / float(np.ptp(x))
    basis = np.vander(x, order + 1)
    relative = y / float(np.mean(y))
    left = relative - basis @ np.linalg.lstsq(basis, relative, rcond=None)[0]
    return float(left @ left)


def between(first: tuple[float, float], second: tuple[float, float]) -> Effect:
    """Second value less the first, relative to the first; each is a pair of value and standard uncertainty."""
    (a, u_a), (b, u_b) = first, second
    return Effect(b / a - 1.0, b / a * hypot(u_a / a, u_b / b))


def mean_effect(effects: Sequence[Effect]) -> Effect:
    """Mean over conditions, with the uncertainty of one of them."""
    value = float(np.mean([effect.value for effect in effects]))
    own = sqrt(float(np.mean([effect.own**2 for effect in effects])))
    return Effect(value, own, float(np.mean([effect.shared for effect in effects])), min(e.dof for e in effects))


#: A curve whose departure from a straight line, relative to the load span, is below this is nearly linear.
_NEARLY = 0.01
#: A curve whose departure from a straight line is above this is markedly non-linear.
_MARKEDLY = 0.03


@dataclass(frozen=True)
class Level:
    """Values with their uncertainties by condition, in SI."""

    kind: ClassVar[str] = "level"
    values: Mapping[Key, Estimate]

    @property
    def numbers(self) -> list[float]:
        """The values alone, in SI."""
        return [measured.value for measured in self.values.values()]


@dataclass(frozen=True)
class Departure(Level):
    """Departure of the load-deflection curves from a straight line, relative to the load span, by pressure."""

    kind: ClassVar[str] = "linearity"


@dataclass(frozen=True)
class CycleLoss(Level):
    """Energy lost in a static cycle of loading and unloading [J], by pressure."""

    kind: ClassVar[str] = "cycle loss"


def level_of(quantity: Quantity, tyre: str, values: Values) -> Finding:
    """The values of a quantity of one specimen; the effect is their mean, with the mean of their uncertainties."""
    mean, std = (float(np.mean(part)) for part in zip(*(measured.pair for measured in values.values()), strict=True))
    return finding_on(quantity, {tyre: values}, values, Holds.MEASURED, Level(values), mean, std, unit=quantity.unit)


def linearity(facts: Facts) -> list[Finding]:
    """Departure of each specimen's load-deflection curves from a straight line; the effect is the largest."""
    findings = []
    for tyre, values in facts.by_tyre(NONLINEARITY).items():
        detail, holds = Departure(values), Holds.NON_LINEAR
        if max(detail.numbers) < _NEARLY:
            holds = Holds.NEARLY_LINEAR
        elif min(detail.numbers) > _MARKEDLY:
            holds = Holds.MARKEDLY_NON_LINEAR
        findings.append(finding_on(NONLINEARITY, {tyre: values}, values, holds, detail, max(detail.numbers)))
    return findings


def cycle_losses(facts: Facts) -> list[Finding]:
    """Energy that a static cycle of each specimen loses; the effect is the mean [J]."""
    findings = []
    for tyre, values in facts.by_tyre(CYCLE_LOSS).items():
        loss, unit = CycleLoss(values), CYCLE_LOSS.unit
        mean = float(np.mean(loss.numbers))
        findings.append(finding_on(CYCLE_LOSS, {tyre: values}, values, Holds.MEASURED, loss, mean, unit=unit))
    return findings


@dataclass(frozen=True)
class Comparison:
    """A quantity of one specimen against that of another.

    Attributes
    ----------
    upper, lower : str
        The specimen with the larger and with the smaller values, by the mean of their logarithms.
    effects : mapping
        Difference of upper less lower, relative to the lower, by condition.
    """

    kind: ClassVar[str] = "comparison"
    upper: str
    lower: str
    effects: Mapping[Key, Effect]

    @property
    def mean(self) -> Effect:
        """Mean difference over the conditions."""
        return mean_effect(list(self.effects.values()))

    @property
    def holds(self) -> Holds:
        """ABOVE: the upper exceeds the lower; MIXED: the order depends on the condition; or NO_DIFFERENCE."""
        searched, claimed = len(self.effects), self.mean.claimed()
        if not claimed and not any(effect.claimed(searched) for effect in self.effects.values()):
            return Holds.NO_DIFFERENCE
        opposed = any(effect.sign == -1 for effect in self.effects.values())
        return Holds.MIXED if opposed or not claimed else Holds.ABOVE


def differences(first: Values, second: Values) -> dict[Key, Effect]:
    """Second less first, relative to the first, at each condition in common."""
    return {key: between(first[key].pair, second[key].pair) for key in common(first, second)}


def compare(quantity: Quantity, names: tuple[str, str], values: tuple[Values, Values]) -> Finding | None:
    """The comparison of two specimens; None where they have no condition in common.

    The effect is first less second, relative to the second; the effects of the detail are relative to the lower.
    """
    first, second = values
    keys = common(first, second)
    if not keys:
        return None
    more = float(np.mean([log(second[key].value / first[key].value) for key in keys])) > 0.0
    upper, lower = (1, 0) if more else (0, 1)
    comparison = Comparison(names[upper], names[lower], differences(values[lower], values[upper]))
    holds = Holds.BELOW if comparison.holds is Holds.ABOVE and more else comparison.holds
    effect = mean_effect(list(differences(second, first).values()))
    both = dict(zip(names, values, strict=True))
    return finding_on(quantity, both, keys, holds, comparison, effect.value, effect.std)


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
