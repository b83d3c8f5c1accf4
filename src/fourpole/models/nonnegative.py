"""Non-negative least squares for models that are linear in their parameters: fits and profile intervals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy
from numpy.typing import ArrayLike

from fourpole.core.arrays import ByValue, FloatArray
from fourpole.errors import ModelError
from fourpole.models.data import StiffnessData
from fourpole.models.interface import Model
from fourpole.models.ramp import static_derivative, static_stiffness, takes_k1
from fourpole.models.spectrum import WhitenedCondition, each_whitened

if TYPE_CHECKING:
    from fourpole.models.fit import Fit

#: Steps of the search for the end of an interval, and relative tolerance of the rise of chi-square there.
_STEPS, _CLOSE = 12, 0.01
#: Singular values of the scaled rows that are smaller than this fraction of the largest count as zero.
_ROUND_OFF = 1e-12


def least_squares(rows: FloatArray, target: FloatArray) -> tuple[FloatArray, float]:
    """Weights >= 0 (k,) with the least sum of squared residuals of rows (M, k) to a target (M,), and that sum.

    Examples
    --------
    >>> least_squares(np.array([[1.0, 0.0], [0.0, 1.0]]), np.array([2.0, -1.0]))
    (array([2., 0.]), 1.0)
    """
    size = np.linalg.norm(rows, axis=0)
    size = np.where(size > 0, size, 1.0)
    found, misfit = scipy.optimize.nnls(rows / size, target, maxiter=max(30 * rows.shape[1], 100))
    return found / size, float(misfit**2)


@dataclass(frozen=True, eq=False)
class _Linear(ByValue):
    """One condition of a linear model: rows (M, F) of its free parameters, target (M,), and all places and values."""

    rows: FloatArray
    target: FloatArray
    free: np.ndarray
    fixed: FloatArray


def _linear(model: Model, condition: WhitenedCondition, start: FloatArray, fixed: Sequence[str]) -> _Linear:
    """The whitened least-squares problem of one condition, with the fixed parameters taken out of the target."""
    free = np.array([at for at, one in enumerate(model.symbols) if one not in fixed], dtype=int)
    values = np.array(start)
    values[free] = 0.0
    data, whiten = condition.data, condition.whiten
    terms = model.derivative(values, data.omega)[:, free]
    rows = data.whitened(whiten, terms)
    off = data.stiffness - model.stiffness(values, data.omega)
    target = data.whitened(whiten, off[:, None])[:, 0]
    if takes_k1(model, data):
        rows = np.vstack([rows, static_derivative(model, values, data)[free] / data.k1_std])
        target = np.append(target, (data.k1 - static_stiffness(model, values, data)) / data.k1_std)
    return _Linear(rows, target, free, values)


def fit_nonnegative(
    model: Model, data: StiffnessData, start: ArrayLike, fixed: Mapping[str, ArrayLike] | Sequence[str]
) -> Fit:
    """The fits of a linear model to conditions (...,), by non-negative least squares; see `fit.fit`.

    The degrees of freedom count the parameters that are not zero: their expected number is the number of degrees of
    freedom of such a fit. Those of several conditions are counted with the largest number. The covariance is that of
    the parameters that are not zero.

    References
    ----------
    M. Meyer, M. Woodroofe, "On the degrees of freedom in shape-restricted regression", Annals of Statistics 28, 2000.
    """
    from fourpole.models.fit import Fit

    lead = data.stiffness.shape[:-1]
    size = len(model.parameters)
    begins = np.array(np.broadcast_to(np.asarray(start, dtype=float), (*lead, size))).reshape(-1, size)
    names = model.known([*fixed])
    if isinstance(fixed, Mapping):
        for name, value in fixed.items():
            begins[:, names.index(name)] = np.broadcast_to(np.asarray(value, dtype=float), lead).reshape(-1)
    found = []
    for one, begin in zip(each_whitened(data), model.checked(begins), strict=True):
        problem = _linear(model, one, begin, [*fixed])
        if not problem.free.size:
            raise ModelError(f"all parameters of the {model.name} model are given: leave at least one free")
        weights, chi2 = least_squares(problem.rows, problem.target)
        active = weights > 0
        covariance = np.zeros((size, size))
        covariance[np.ix_(problem.free[active], problem.free[active])] = _inverse_normal(problem.rows[:, active])
        values, held = np.array(problem.fixed), np.zeros(size, dtype=bool)
        values[problem.free], held[problem.free] = weights, ~active
        residuals = problem.target - problem.rows @ weights
        found.append((values, covariance, chi2, residuals, held, int(active.sum())))
    used = max(row[5] for row in found)
    residuals = np.array([row[3] for row in found])
    if residuals.shape[1] < used:
        raise ModelError(f"{residuals.shape[1]} numbers are too few for {used} terms of the {model.name} model")
    return Fit(
        model=model,
        values=np.array([row[0] for row in found]).reshape(*lead, size),
        covariance=np.array([row[1] for row in found]).reshape(*lead, size, size),
        chi2=np.array([row[2] for row in found]).reshape(lead),
        dof=residuals.shape[1] - used,
        residuals=residuals.reshape(*lead, -1),
        on_bound=np.array([row[4] for row in found]).reshape(*lead, size),
        converged=np.ones(lead, dtype=bool),
        steps=1,
        agreed=np.ones(lead),
    )


def _inverse_normal(rows: FloatArray) -> FloatArray:
    """Inverse (k, k) of the normal matrix of rows (M, k)."""
    size = np.linalg.norm(rows, axis=0)
    _, values, right = np.linalg.svd(rows / size, full_matrices=False)
    kept = values > _ROUND_OFF * values.max(initial=0.0)
    half = right[kept].T / values[kept] / size[:, None]
    return np.asarray(half @ half.T)


def nonnegative_intervals(found: Fit, data: StiffnessData, rise: float, fixed: Sequence[str]) -> FloatArray:
    """Profile-likelihood intervals (P, 2) of the parameters of a linear model fitted to one condition.

    The interval of a parameter at zero is one-sided: from zero to the value at which chi-square has risen by `rise`
    squared, all other parameters fitted anew.
    """
    (condition,) = each_whitened(data)
    problem = _linear(found.model, condition, found.values, fixed)
    ends = np.stack([found.values, found.values], axis=1)
    small, target, rest = _condensed(problem.rows, problem.target)
    least = float(found.chi2) - rest
    for at, place in enumerate(problem.free.tolist()):
        others = np.delete(small, at, axis=1)
        profile = Profile(small[:, at], others, target, least)
        best, std = float(found.values[place]), float(found.std[place])
        step = rise * (std or 1.0 / max(float(np.linalg.norm(small[:, at])), 1e-300))
        ends[place, 1] = profile.end(best, step, rise)
        ends[place, 0] = max(profile.end(best, -min(step, best), rise), 0.0) if best > 0 else 0.0
    return ends


def _condensed(rows: FloatArray, target: FloatArray) -> tuple[FloatArray, FloatArray, float]:
    """Fewer rows with the same least-squares problem, their target, and the part of chi-square that they lack."""
    if rows.shape[0] <= rows.shape[1]:
        return rows, target, 0.0
    q, r = np.linalg.qr(rows)
    short = q.T @ target
    return r, short, max(float(target @ target - short @ short), 0.0)


@dataclass(frozen=True, eq=False)
class Profile(ByValue):
    """Least chi-square over all other terms, as a function of the factor of one term."""

    term: FloatArray
    others: FloatArray
    target: FloatArray
    least: float

    def height(self, value: float) -> float:
        """Square root of the rise of chi-square above its minimum."""
        chi2 = least_squares(self.others, self.target - value * self.term)[1] if self.others.size else 0.0
        return float(np.sqrt(max(chi2 - self.least, 0.0)))

    def end(self, best: float, step: float, rise: float) -> float:
        """The value on the side of `step` at which the height is `rise`; zero if it is lower there.

        The height is convex in the value, so that a bracket and the secant in it find the end.
        """
        near, low = best, 0.0
        far = best + step
        high = self.height(far)
        for _ in range(_STEPS):
            if high >= rise or (step < 0 and far <= 0):
                break
            near, low = far, high
            far = best + 2 * (far - best) if step > 0 else max(best + 2 * (far - best), 0.0)
            high = self.height(far)
        if high < rise:
            return 0.0 if step < 0 else float("inf")
        for _ in range(_STEPS):
            if high - rise <= _CLOSE * rise:
                break
            middle = near + (far - near) * min(max((rise - low) / (high - low), 0.1), 0.9)
            height = self.height(middle)
            if height >= rise:
                far, high = middle, height
            else:
                near, low = middle, height
                if rise - low <= _CLOSE * rise:
                    return middle
        return far
