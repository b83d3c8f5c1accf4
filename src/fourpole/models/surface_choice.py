r"""The choice of the surfaces of a map: the terms of each parameter, their fit, and the scatter of the conditions.

Candidates are compared about one fit, by linear algebra: by the log predictive density of each condition, as measured,
under the fit of the others.

The scatter of conditions about laws is by restricted maximum likelihood. With the covariance V of all data given the
shared errors, and the normal matrix N of the coefficients and of the shared errors with their prior, the variances
minimise

.. math:: -2 \log L = \log|V| + \log|N| + r^T V^{-1} r ,

r being the residuals of the fit. What the shared errors can explain within their stated uncertainty is therefore no
scatter, and the coefficients cost as many degrees of freedom as they have.

Few conditions hardly show how much they scatter. That of conditions therefore has a prior: it is none with a chance of
one half; else log s is normal about the logarithm of what tyres show that are mounted again and again.

References
----------
H. D. Patterson, R. Thompson, "Recovery of inter-block information when block sizes are unequal", Biometrika 58, 1971;
D. A. Harville, "Maximum likelihood approaches to variance component estimation", J. Am. Stat. Assoc. 72, 1977.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
import scipy

from fourpole.core import stats
from fourpole.core.arrays import BoolArray, ByValue, FloatArray
from fourpole.core.confidence import CHANCE, LEVELS, NORMAL_95
from fourpole.models.interface import Model
from fourpole.models.laws import Laws
from fourpole.models.linearised import (
    LEAST_COMMON,
    LEAST_CONDITION,
    PRIOR,
    PRIOR_WIDTH,
    Conditions,
    Rows,
    Scatter,
    Weights,
)
from fourpole.models.surface import Terms
from fourpole.models.together import Together, assembled, density_without_each, search

#: Maximum number of steps, and of halvings of one; the search ends at a smaller change of -2 log L.
_STEPS, _HALVINGS, _SMALL_SCATTER = 40, 12, 1e-3
#: A variance is zero unless it reduces -2 log L by more than this: a chance of 10 %, as a variance is not negative.
_NEEDED = 1.642
#: Least and largest variances.
_LEAST_SCATTER, _MOST = np.array([LEAST_CONDITION**2] * 2 + [0.0] * 3 + [LEAST_COMMON] * 2), 1.0
#: Relative scatters of conditions over which their posterior is summed, and factors of the most probable one for more.
_GRID, _NEAR_SCATTER = np.geomspace(LEAST_CONDITION, 0.5, 25), np.exp(np.linspace(-0.4, 0.4, 17))


def scatter_of(found: Together, free: Sequence[bool] = (True,) * 7, *, roughly: bool = False) -> Scatter:
    """The scatter that a fit shows, to first order about it.

    Parameters
    ----------
    found : Together
    free : sequence of bool
        Which of the seven variances are unknown; the others are zero.
    roughly : bool
        Keep variances that might as well be zero.
    """
    likelihood = _Likelihood(found)
    conditions = found.conditions
    static, common = any(one.static is not None for one in found.rows), conditions.nodes.size > 0
    unknown = np.array(free) & np.array([True, True, True, True, static, common, common])
    best = likelihood.least(np.where(unknown, found.scatter.variances, 0.0), unknown)
    for at in () if roughly else np.flatnonzero(unknown):
        others = unknown & (np.arange(unknown.size) != at)
        without = likelihood.least(np.where(others, best.variances, 0.0), others)
        if without.value < best.value + _NEEDED:
            best, unknown = without, others
    return Scatter.of(np.where(unknown, best.variances, 0.0))


def widened(found: Together) -> Scatter:
    """The scatter of a fit with that of its conditions as wide as its posterior asks of a 95 % interval.

    The errors of further conditions are a mixture of normal ones over the posterior of their scatter. The scatter that
    is returned has the same 95 % interval.
    """
    likelihood, scatter = _Likelihood(found), []
    for at, best in enumerate(found.scatter.condition):
        unknown = np.arange(7) == at
        grid = np.unique(np.append(_GRID, best * _NEAR_SCATTER if best > LEAST_CONDITION else []))
        chance = np.append(1.0, np.gradient(np.log(grid)) / (PRIOR_WIDTH * np.sqrt(2 * np.pi)))
        each = np.append(0.0, grid)
        variances = np.tile(found.scatter.variances, (each.size, 1))
        variances[:, at] = each**2
        values = np.array([likelihood.at(one, unknown & (one > 0)).value for one in variances])
        scatter.append(_mixed(chance * np.exp(-0.5 * (values - values.min())), each))
    return replace(found.scatter, condition=(scatter[0], scatter[1]))


def _mixed(weights: FloatArray, each: FloatArray) -> float:
    """The normal standard deviation with the 95 % interval of a mixture of normal errors, the first of them zero."""
    inside = (LEVELS[-1] - LEVELS[0]) * weights.sum() - weights[0]

    def lacking(limit: float) -> float:
        return float(weights[1:] @ scipy.special.erf(limit / each[1:] / np.sqrt(2.0)) - inside)

    return float(scipy.optimize.brentq(lacking, 0.0, 10.0 * each[-1]) / NORMAL_95) if inside > 0 else 0.0


@dataclass(frozen=True, eq=False)
class _State:
    """-2 log L at some variances (7,), minus its slope, and its expected curvature."""

    variances: FloatArray
    value: float
    downhill: FloatArray
    curvature: FloatArray


@dataclass(frozen=True, eq=False)
class _Likelihood:
    """-2 log L about a fit."""

    found: Together

    def least(self, variances: FloatArray, unknown: BoolArray) -> _State:
        """The least -2 log L over the unknown variances, none of which is negative."""
        now = self.at(variances, unknown)
        for _ in range(_STEPS if unknown.any() else 0):
            step = _step(now, unknown)
            for halving in range(_HALVINGS):
                tried = np.clip(now.variances + step * 0.5**halving, _least(unknown), _MOST)
                if abs((tried - now.variances) @ now.downhill) < _SMALL_SCATTER:
                    return now
                then = self.at(tried, unknown)
                if then.value < now.value:
                    now = then
                    break
            else:
                return now
        return now

    def at(self, variances: FloatArray, unknown: BoolArray) -> _State:
        """The likelihood at some variances, with the prior of those of conditions that are unknown."""
        variances = np.maximum(variances, _least(unknown))
        rows, unknowns, conditions = self.found.rows, self.found.unknowns, self.found.conditions
        laws = replace(self.found.laws, error_precision=conditions.precision(variances))
        weights = [Weights.of(one, variances) for one in rows]
        normal = assembled(rows, weights, laws, unknowns)
        covariance, step, local = normal.solved()
        spread = normal.local_covariance(covariance)
        value = sum(float(np.sum(one.logdet)) for one in weights) - float(np.linalg.slogdet(covariance)[1])
        value += sum(float(np.sum(one.chi2(each.off))) for one, each in zip(weights, rows, strict=True))
        value += laws.prior_chi2(unknowns) - normal.reduction(step, local)
        value -= float(np.sum(np.log(conditions.precision(variances))))
        scattered = np.flatnonzero(unknown[:2])
        off = np.log(np.sqrt(variances[scattered]) / PRIOR) / PRIOR_WIDTH
        value += float(off @ off)
        downhill, curvature = np.zeros(7), np.zeros((7, 7))
        for one, weight in zip(rows, weights, strict=True):
            slope, bend = _slopes(one, weight, local[one.places], spread[one.places])
            downhill[:5] += slope
            curvature[:5, :5] += bend
        downhill[scattered] -= off / (PRIOR_WIDTH * variances[scattered])
        curvature[scattered, scattered] += 0.5 / (PRIOR_WIDTH * variances[scattered]) ** 2
        size = laws.coefficients
        for at, part in enumerate(conditions.errors_of_model, start=5):
            error, own = (unknowns + step)[size:][part], covariance[size:, size:][part, part]
            taken = (np.eye(error.size) - own / variances[at]) / variances[at]
            downhill[at] = error @ error / variances[at] ** 2 - np.trace(taken)
            curvature[at, at] = np.sum(taken**2)
        return _State(variances, value, downhill, curvature)


def _least(unknown: BoolArray) -> FloatArray:
    """The least variances (7,): that of conditions is zero where it is known."""
    return np.where(unknown | (np.arange(7) > 1), _LEAST_SCATTER, 0.0)


def _step(now: _State, unknown: BoolArray) -> FloatArray:
    """The step (7,) of Fisher's scoring; a variance of zero stays if it would become negative."""
    moved = unknown.copy()
    step = np.zeros(7)
    for _ in range(7):
        at = np.flatnonzero(moved)
        step[:] = 0.0
        if not at.size:
            break
        step[at] = np.linalg.solve(now.curvature[np.ix_(at, at)], now.downhill[at])
        stuck = moved & (now.variances <= _LEAST_SCATTER) & (step <= 0)
        if not stuck.any():
            break
        moved &= ~stuck
    return step


def _slopes(rows: Rows, weight: Weights, local: FloatArray, spread: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Minus the slope (5,) of -2 log L of a block, and its expected curvature (5, 5).

    P is V^-1 less what the free unknowns take; entries of P between conditions are left out of the curvature.
    """
    groups, count = len(rows.off), rows.own.shape[1]
    weighted = weight.times(rows.columns)
    off = weight.times((rows.off - (rows.columns @ local[..., None])[..., 0])[..., None])[..., 0]
    taken = weighted @ spread
    lost = np.sum(taken * weighted, axis=2)
    diagonal = (weight.diagonal - lost[:, : 2 * count]).reshape(groups, count, 2)
    each = off[:, : 2 * count].reshape(groups, count, 2)
    # One error of a condition acts on all its frequencies: sums over these.
    summed = np.sum(weighted[:, : 2 * count].reshape(groups, count, 2, -1), axis=1)
    error = np.zeros((groups, weighted.shape[1], 2))
    error[:, : 2 * count] = np.tile(np.eye(2), (count, 1))
    across = (weight.times(error) - taken @ np.swapaxes(summed, 1, 2))[:, : 2 * count].reshape(groups, count, 2, 2)
    inner = np.sum(across, axis=1)
    slope, curvature = np.zeros(5), np.zeros((5, 5))
    slope[:2] = np.sum(np.sum(each, axis=1) ** 2 - np.diagonal(inner, 0, 1, 2), axis=0)
    slope[2:4] = np.sum(each**2, axis=(0, 1)) - np.sum(diagonal, axis=(0, 1))
    curvature[:2, :2] = np.sum(inner**2, axis=0)
    curvature[2, 2], curvature[3, 3] = np.sum(diagonal**2, axis=(0, 1))
    curvature[2:4, :2] = np.sum(across**2, axis=(0, 1))
    curvature[:2, 2:4] = curvature[2:4, :2].T
    if weight.static is not None:
        static = weight.static - lost[:, -1]
        slope[4] = np.sum(off[:, -1] ** 2) - np.sum(static)
        curvature[4, 4] = np.sum(static**2)
    return slope, curvature


#: Terms of each parameter.
Plan: TypeAlias = tuple[Terms, ...]
#: Relative scatter of conditions in the comparison of surfaces.
_SCATTER = 1e-2
#: Further scatters of conditions in the comparison: factors along and across K*, of that which a fit shows or of the
#: least.
_FACTORS, _LEAST = ((0.3, 1.0), (1.0, 0.3), (0.1, 0.1), (0.01, 0.01), (3.0, 3.0)), 1e-3
#: Scatter of the first fit, and its number of terms, as a fraction of the number of conditions.
_FIRST_SCATTER, _FIRST = Scatter((_SCATTER, _SCATTER), (_SCATTER, _SCATTER), _SCATTER), 1.0 / 3.0
#: Standard deviations of the weak prior of coefficients: of a level about the median of the starts, and of a change
#: over half the span of an axis, in units of the link: 1 is a factor of 2.7, or the median itself without a logarithm.
#: Times change more: by decades over the temperature.
_LEVEL, _CHANGE, _CHANGE_OF_TIMES = 10.0, 0.5, 2.0
#: Starts are limited to this distance from their median, in units of the link.
_NEAR = 3.0
#: Largest number of terms; maximum number of fits with a scatter.
MOST_TERMS, _ROUNDS = 64, 8
#: Variances of the scatter are final when they change by less than this fraction, or this standard deviation.
_CLOSE, _SMALL = 0.01, 1e-7
#: Chi-square that fits may leave: those about which surfaces are compared, and those of the map.
_ROUGHLY, _CLOSE_FIT = 0.1, 1e-6
#: Number of the best surfaces in which each parameter in turn is given fewer terms.
_LESSENED = 3
#: A larger surface is chosen only if its log predictive density exceeds that of a smaller one by this; twice that is 6,
#: which the ladder of single fits asks of BIC.
BETTER = 3.0


def place_of_simplest(densities: Sequence[float], sizes: Sequence[int]) -> int:
    """Place of the smallest candidate with hardly less than the greatest density; of several, that with most."""
    least = max(densities) - BETTER
    good = [at for at, density in enumerate(densities) if density >= least]
    return min(good, key=lambda at: (sizes[at], -densities[at]))


@dataclass(frozen=True, eq=False)
class SurfaceChoice(ByValue):
    """The search for the terms of a map and for the scatter of its conditions.

    Attributes
    ----------
    conditions : Conditions
    bases : dict of Terms to (B, K) float array
        Basis functions of each candidate.
    linked : (B, P) float array
        Linked parameters of a fit to each condition, none far from the median.
    middle, units : (P,) float arrays
        Their medians, and the units of their priors.
    spare : bool
        Whether there are more conditions than terms, so that they show their scatter. The uncertainty of K1 is then one
        error of all conditions.
    """

    conditions: Conditions
    bases: dict[Terms, FloatArray]
    linked: FloatArray
    middle: FloatArray
    units: FloatArray
    spare: bool

    def made(self) -> ChosenSurfaces:
        """The terms with hardly less than the greatest log predictive density, and their fit.

        The candidates are compared about one fit, by linear algebra. The fit of the best is the next one about which
        they are compared, until the best stays. Then each parameter loses the terms that it does not need.
        """
        axes = len(next(iter(self.bases))[0])
        most = max(min((axes + 1) * (axes + 2) / 2, self.conditions.count * _FIRST), axes + 1)
        few = [one for one in self.bases if len(one) <= most] or [next(iter(self.bases))]
        # Without a term of an axis, K* would be far from the fit about which the candidates are linear.
        first = max(few, key=lambda one: (np.count_nonzero(np.max(one, axis=0)), len(one)))
        plan = (first,) * self.middle.size
        found = self.fitted(plan, self.linked, _FIRST_SCATTER, None, close=_ROUGHLY)
        density, seen = -np.inf, set()
        while self.spare and plan not in seen:
            seen.add(plan)
            plan, trial, density = self._best(found, self._scatter(found, roughly=True))
            if plan not in seen:
                found = self.fitted(plan, found.linked, trial, found.errors, close=_ROUGHLY)
        return ChosenSurfaces(self, plan, found, density)

    def _laws(self, plan: Plan) -> Laws:
        """The laws of all parameters, with a weak prior of their coefficients."""
        expected, precision = [], []
        for terms, middle, unit, one in zip(
            plan, self.middle, self.units, self.conditions.model.parameters, strict=True
        ):
            constant = np.array([not any(powers) for powers in terms])
            change = _CHANGE_OF_TIMES if one.unit == "s" else _CHANGE
            expected.append(np.where(constant, middle, 0.0))
            precision.append((unit * np.where(constant, _LEVEL, change)) ** -2.0)
        few, designs = self.conditions, tuple(self.bases[terms] for terms in plan)
        return Laws(designs, few.shared, few.count, np.concatenate(expected), np.concatenate(precision))

    def fitted(
        self, plan: Plan, linked: FloatArray, scatter: Scatter, errors: FloatArray | None, close: float = _CLOSE_FIT
    ) -> Together:
        """The fit of a plan from linked parameters (B, P), with a scatter."""
        return search(self.conditions, self._laws(plan), linked, scatter, errors, close=close)

    def _scatter(self, found: Together, *, roughly: bool = False) -> Scatter:
        """The scatter that a fit shows."""
        if not found.dof:
            return Scatter()
        return scatter_of(found, (*(self.spare,) * 2, True, True, self.spare, True, True), roughly=roughly)

    def _best(self, found: Together, scatter: Scatter) -> tuple[Plan, Scatter, float]:
        """The terms with hardly less than the greatest log predictive density about a fit; their scatter and density.

        Each candidate has the scatter of conditions with which its density is greatest: lack of a term must not pass
        for scatter in the comparison with those that have it.
        """
        rows = [one.about_zero(found.linked) for one in found.rows]
        condition = np.maximum(scatter.condition, _LEAST)
        more = [replace(scatter, condition=tuple((condition * one).tolist())) for one in _FACTORS if self.spare]
        every = [scatter, *more]
        densities = [self._density(rows, found, one) for one in every]
        plans: list[Plan] = [(one,) * self.middle.size for one in self.bases]
        each = np.array([[density(plan) for density in densities] for plan in plans])
        best = each.argmax(axis=1).tolist()
        tried = [(plan, at, float(row[at])) for plan, row, at in zip(plans, each, best, strict=True)]
        for place in np.argsort(-each.max(axis=1))[:_LESSENED].tolist():
            plan, at, _ = tried[place]
            plan = self._lessened(plan, densities[at])
            tried.append((plan, at, densities[at](plan)))
        plan, at, density = tried[place_of_simplest([one[2] for one in tried], [len(sum(one[0], ())) for one in tried])]
        return plan, every[at], density

    def _lessened(self, plan: Plan, density: Callable[[Plan], float]) -> Plan:
        """The plan in which each parameter in turn has the fewest terms that the density of the whole plan needs."""
        greatest = density(plan)
        for place in range(len(plan)):
            inner = [(*plan[:place], one, *plan[place + 1 :]) for one in self.bases if set(one) <= set(plan[place])]
            each = [density(one) for one in inner]
            greatest = max(greatest, *each)
            good = [one for one, own in zip(inner, each, strict=True) if own >= greatest - BETTER] or [plan]
            plan = min(good, key=lambda one: len(one[place]))
        return plan

    def _density(self, rows: Sequence[Rows], found: Together, scatter: Scatter) -> Callable[[Plan], float]:
        """The log predictive density of a plan about a fit, whose rows are about zero, with a scatter."""
        weights = [Weights.of(one, scatter.variances) for one in rows]
        normal = assembled(rows, weights, found.laws, found.unknowns)
        pairs = zip(rows, weights, strict=True)
        rest = sum(float(np.sum(weight.log_density(one.off, one.scale))) for one, weight in pairs)
        rest += scatter.log_prior if self.spare else 0.0

        def density(plan: Plan) -> float:
            laws = self._laws(plan)
            zero = np.append(np.zeros(laws.coefficients), found.errors)
            return rest + density_without_each(replace(normal, laws=laws, unknowns=zero))

        return density

    def calibrated(self, plan: Plan, found: Together) -> Together:
        """The fit with the scatter that it shows.

        If the model does not fit, its error may be the same in all conditions. It must not pass for shared errors, so
        that it becomes an unknown beside these.
        """
        found = self.widened(plan, self.with_scatter(plan, found))
        moved = float(found.errors @ found.errors)
        surprising = bool(moved > stats.chi2.isf(CHANCE, max(found.errors.size, 1)))
        if not found.dof or not (surprising or any(found.scatter.frequency)):
            return found
        wider = replace(self, conditions=self.conditions.with_errors_of_model())
        last = found.errors.size - int(wider.conditions.common)
        errors = np.insert(found.errors, last, np.zeros(2 * wider.conditions.nodes.size))
        begin = replace(found.scatter, common=found.scatter.frequency)
        return wider.widened(plan, wider.with_scatter(plan, wider.fitted(plan, found.linked, begin, errors)))

    def widened(self, plan: Plan, found: Together) -> Together:
        """The fit with the scatter of conditions as wide as few conditions leave it."""
        if not self.spare:
            return found
        return self.fitted(plan, found.linked, widened(found), found.errors)

    def with_scatter(self, plan: Plan, found: Together) -> Together:
        """The fit with the scatter that it shows."""
        for _ in range(_ROUNDS):
            before, scatter = found.scatter.variances, self._scatter(found)
            found = self.fitted(plan, found.linked, scatter, found.errors)
            if np.all(np.abs(scatter.variances - before) <= _CLOSE * before + _SMALL**2):
                break
        return found


@dataclass(frozen=True, eq=False)
class ChosenSurfaces(ByValue):
    """The terms of each parameter, their fit and its log predictive density; how they were chosen."""

    choice: SurfaceChoice
    plan: Plan
    found: Together
    density: float

    @property
    def on_floor(self) -> bool:
        """Whether a stiffness or damping itself is at its lowest value at some condition."""
        return not np.all(self.found.model.unlink(self.found.linked)[1])


def started(model: Model, start: FloatArray, scaled: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Linked parameters (B, P) of all conditions, from fits to some; their medians (P,), and units of their priors."""
    known = np.flatnonzero(np.all(np.isfinite(start), axis=1))
    linked = model.link(start[known])
    middle = np.median(linked, axis=0)
    straight = np.array([one.straight for one in model.parameters])
    units = np.where(straight, np.maximum(np.abs(middle), np.mean(np.abs(linked), axis=0)), 1.0)
    linked = np.clip(linked, middle - _NEAR * units, middle + _NEAR * units)
    if len(known) < len(start):
        basis = np.insert(scaled, 0, 1.0, axis=1)
        linked = basis @ np.linalg.lstsq(basis[known], linked, rcond=None)[0]
    return linked, middle, units
