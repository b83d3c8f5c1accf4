r"""Scatter of conditions about laws, by restricted maximum likelihood.

With the covariance V of all data given the shared errors, and the normal matrix N of the coefficients and of the shared
errors with their prior, the variances minimise

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

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import optimize, special

from fourpole.core.arrays import BoolArray, FloatArray
from fourpole.core.confidence import LEVELS, NORMAL_95
from fourpole.models.linearised import LEAST_COMMON, LEAST_CONDITION, PRIOR, PRIOR_WIDTH, Rows, Scatter, Weights
from fourpole.models.together import Together, assembled

#: Maximum number of steps, and of halvings of one; the search ends at a smaller change of -2 log L.
_STEPS, _HALVINGS, _SMALL = 40, 12, 1e-3
#: A variance is zero unless it reduces -2 log L by more than this: a chance of 10 %, as a variance is not negative.
_NEEDED = 1.642
#: Least and largest variances.
_LEAST, _MOST = np.array([LEAST_CONDITION**2] * 2 + [0.0] * 3 + [LEAST_COMMON] * 2), 1.0
#: Relative scatters of conditions over which their posterior is summed, and factors of the most probable one for more.
_GRID, _NEAR = np.geomspace(LEAST_CONDITION, 0.5, 25), np.exp(np.linspace(-0.4, 0.4, 17))


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
        grid = np.unique(np.append(_GRID, best * _NEAR if best > LEAST_CONDITION else []))
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
        return float(weights[1:] @ special.erf(limit / each[1:] / np.sqrt(2.0)) - inside)

    return float(optimize.brentq(lacking, 0.0, 10.0 * each[-1]) / NORMAL_95) if inside > 0 else 0.0


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
                if abs((tried - now.variances) @ now.downhill) < _SMALL:
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
    return np.where(unknown | (np.arange(7) > 1), _LEAST, 0.0)


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
        stuck = moved & (now.variances <= _LEAST) & (step <= 0)
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
