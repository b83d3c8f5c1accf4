"""Least squares with weights that are not negative, of terms of K* of one condition in standard uncertainties."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy

from fourpole.core.arrays import ByValue, ComplexArray, FloatArray
from fourpole.models.data import StiffnessData, spring_and_arms

#: Steps of the search for the end of an interval, and relative tolerance of the rise of chi-square there.
_STEPS, _CLOSE = 12, 0.01
#: Singular values of the scaled rows that are smaller than this fraction of the largest count as zero.
_ROUND_OFF = 1e-12


def least_squares(rows: FloatArray, target: FloatArray) -> tuple[FloatArray, float]:
    """Weights >= 0 (k,) with the least sum of squared residuals of rows (M, k) to a target (M,), and that sum.

    Examples
    --------
    >>> weights, squares = least_squares(np.eye(2), np.array([2.0, -1.0]))
    >>> weights.tolist(), squares
    ([2.0, 0.0], 1.0)
    """
    size = np.linalg.norm(rows, axis=0)
    size = np.where(size > 0, size, 1.0)
    found, misfit = scipy.optimize.nnls(rows / size, target, maxiter=max(50 * rows.shape[1], 100))
    return found / size, float(misfit**2)


@dataclass(frozen=True, eq=False)
class NonNegative(ByValue):
    """The best weights >= 0 (k,) for rows (M, k) and a target (M,) in standard uncertainties, and their chi-square."""

    rows: FloatArray
    target: FloatArray
    weights: FloatArray
    chi2: float

    @classmethod
    def best(cls, rows: FloatArray, target: FloatArray) -> NonNegative:
        """The least-squares solution."""
        return cls(rows, target, *least_squares(rows, target))

    @property
    def residuals(self) -> FloatArray:
        """Target minus the weighted rows (M,)."""
        return self.target - self.rows @ self.weights

    @property
    def used(self) -> int:
        """Number of weights above zero: the expected degrees of freedom that they take."""
        return int(np.count_nonzero(self.weights))

    @cached_property
    def covariance(self) -> FloatArray:
        """Covariance (k, k) of the weights; 0 for those at zero."""
        active = np.flatnonzero(self.weights)
        size = np.linalg.norm(self.rows[:, active], axis=0)
        _, values, right = np.linalg.svd(self.rows[:, active] / size, full_matrices=False)
        kept = values > _ROUND_OFF * values.max(initial=0.0)
        half = right[kept].T / values[kept] / size[:, None]
        found = np.zeros((self.weights.size, self.weights.size))
        found[np.ix_(active, active)] = half @ half.T
        return found

    def profiles(self, places: np.ndarray, stds: FloatArray, rise: float) -> FloatArray:
        """Ends (n, 2) of the profiles of some of the weights, at which chi-square has risen by `rise` squared.

        The search begins at their standard uncertainties (k,).
        """
        rows, target, least = self.rows, self.target, self.chi2
        if rows.shape[0] > rows.shape[1]:  # fewer rows with the same problem, which lack a part of chi-square
            whole = float(target @ target)
            orthogonal, rows = np.linalg.qr(rows)
            target = orthogonal.T @ target
            least -= max(float(whole - target @ target), 0.0)
        ends = np.empty((len(places), 2))
        for row, at in enumerate(places.tolist()):
            term, others = rows[:, at], np.delete(rows, at, axis=1)
            step = rise * (float(stds[at]) or 1.0 / max(float(np.linalg.norm(term)), 1e-300))

            def height(value: float, term: FloatArray = term, others: FloatArray = others) -> float:
                return rise_of(others, target - value * term, least)

            ends[row] = profile_ends(height, float(self.weights[at]), step, rise)
        return ends


def rise_of(rows: FloatArray, target: FloatArray, least: float) -> float:
    """Square root of the rise of the least sum of squares above its minimum `least`."""
    chi2 = least_squares(rows, target)[1] if rows.size else 0.0
    return float(np.sqrt(max(chi2 - least, 0.0)))


def profile_ends(height: Callable[[float], float], best: float, step: float, rise: float) -> tuple[float, float]:
    """The values >= 0 below and above the best one at which the height of its profile is `rise`."""
    high = _end(height, best, step, rise)
    return max(_end(height, best, -min(step, best), rise), 0.0) if best > 0 else 0.0, high


def _end(height: Callable[[float], float], best: float, step: float, rise: float) -> float:
    """The value on the side of `step` at which the height is `rise`; zero if it is lower there.

    The height is convex in the value, so that a bracket and the secant in it find the end.
    """
    near, low = best, 0.0
    far = best + step
    high = height(far)
    for _ in range(_STEPS):
        if high >= rise or (step < 0 and far <= 0):
            break
        near, low = far, high
        far = best + 2 * (far - best) if step > 0 else max(best + 2 * (far - best), 0.0)
        high = height(far)
    if high < rise:
        return 0.0 if step < 0 else float("inf")
    for _ in range(_STEPS):
        if high - rise <= _CLOSE * rise:
            break
        middle = near + (far - near) * min(max((rise - low) / (high - low), 0.1), 0.9)
        between = height(middle)
        if between >= rise:
            far, high = middle, between
        else:
            near, low = middle, between
            if rise - low <= _CLOSE * rise:
                return middle
    return far


def two_springs(rows: FloatArray, target: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Least-squares weights >= 0 (..., 2) of two terms with rows (..., M, 2), and the sum of squared residuals."""
    turned = np.swapaxes(rows, -1, -2)
    normal, right = turned @ rows, turned @ target
    size = np.maximum(np.diagonal(normal, 0, -2, -1), 1e-300)
    normal = normal + 1e-12 * size[..., None] * np.eye(2)
    both = np.linalg.solve(normal, right[..., None])[..., 0]
    alone = np.maximum(right / size, 0.0) * np.where(both[..., ::-1] < 0, 1.0, 0.0)
    found = np.where(np.any(both < 0, axis=-1)[..., None], alone, both)
    return found, np.sum(((rows @ found[..., None])[..., 0] - target) ** 2, axis=-1)


@dataclass(frozen=True, eq=False)
class WhitenedCondition(ByValue):
    """Data of one condition with their whitener: terms of K* become rows of a real least-squares problem.

    The last row is that of K1. It has no weight if K1 is not known.
    """

    data: StiffnessData
    whiten: FloatArray

    def rows(self, terms: ComplexArray, static: FloatArray | None = None) -> FloatArray:
        """Terms of K* (..., N, k) as rows (..., 2N + 1, k); `static` (k,) is their K1, by default that of the first."""
        k1 = np.zeros((*terms.shape[:-2], 1, terms.shape[-1]))
        if self.data.has_k1:
            k1 += (np.eye(1, terms.shape[-1])[0] if static is None else static) / self.data.k1_std
        return np.concatenate([self.data.whitened(self.whiten, terms), k1], axis=-2)

    @cached_property
    def target(self) -> FloatArray:
        """K* and K1 in standard uncertainties (2N + 1,)."""
        k1 = self.data.k1 / self.data.k1_std if self.data.has_k1 else 0.0
        return np.append(self.data.whitened(self.whiten, self.data.stiffness[:, None])[:, 0], k1)

    def arms(self, times: FloatArray) -> FloatArray:
        """Rows (2N + 1, T + 1) of a unit spring and of unit arms with relaxation times (T,) [s]."""
        return self.rows(spring_and_arms(self.data.omega, times), np.append(1.0, self.data.static_share(times)))


def whitened_conditions(data: StiffnessData) -> list[WhitenedCondition]:
    """Each of the conditions (...,) with its whitener."""
    flat = data.flat()
    whole = replace(flat, omega=np.broadcast_to(flat.omega, flat.stiffness.shape))
    return [
        WhitenedCondition(replace(whole.conditions(at), covariance=flat.covariance[at]), whiten)
        for at, whiten in enumerate(flat.whitener())
    ]
