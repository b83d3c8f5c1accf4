"""Fits of a model to many conditions at once: Levenberg-Marquardt, vectorised over the conditions.

The search is projected onto the bounds: a parameter on its bound whose step would cross it is constant in that step.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike

from fourpole.core import stats
from fourpole.core.arrays import BoolArray, ByValue, ComplexArray, FloatArray, IntArray
from fourpole.errors import ModelError
from fourpole.models.data import StiffnessData
from fourpole.models.interface import Model
from fourpole.models.laws import inverse
from fourpole.models.nonnegative import NonNegative, WhitenedCondition, whitened_conditions
from fourpole.models.problem import FitProblem, begin_of, free_places, problem_of
from fourpole.models.ramp import static_derivative, static_stiffness

#: Most numbers of K* times parameters in one search from several starts, or along several profiles.
_TOGETHER = 100_000
#: Maximum number of steps; start, factors after a good and a bad step, and maximum of the damping.
_STEPS = 200
_DAMPING, _LOWER, _RAISE, _MOST_DAMPING = 1e-3, 0.2, 5.0, 1e12
#: The search ends at a step, or a reduction of chi-square, that is smaller than these fractions.
_SMALL_STEP, _SMALL_GAIN = 1e-10, 1e-11
#: The search also ends when chi-square falls, over `_WINDOW` steps, by less than `_FLAT` + `_FLAT_SHARE` x chi-square.
_FLAT, _FLAT_SHARE, _WINDOW = 1e-3, 1e-6, 20
#: When a larger fraction of the conditions has converged, the search continues without them.
_MOST_DONE = 0.25
#: A parameter has no effect on the data if a factor e changes the model by less than this, in standard uncertainties.
_NO_EFFECT = 1e-4
#: Fits from several starts have the same optimum if their chi-squares differ by less than this.
_SAME_OPTIMUM = 1e-3
#: Attributes of a fit that have a row for each condition.
_BY_CONDITION = ("values", "covariance", "chi2", "residuals", "on_bound", "converged", "agreed")


@dataclass(frozen=True, eq=False)
class Fit(ByValue):
    """The fits of one model to conditions (...,), each with parameters of its own.

    Attributes
    ----------
    model : Model
    values : (..., P) float array
        Parameters, each in its unit.
    covariance : (..., P, P) float array
        Covariance of the parameters; 0 for fixed parameters and those on a bound.
    chi2 : (...,) float array [1]
        Sum of the squared whitened residuals.
    dof : int
        Degrees of freedom: number of data minus number of free parameters.
    residuals : (..., M) float array [1]
        Whitened residuals: Re and Im of each frequency in turn, then K1 if it is used.
    on_bound : (..., P) bool array
        Whether a parameter is on a bound, or its value has no effect on the data.
    converged : (...,) bool array
    agreed : (...,) float array [1]
        Fraction of the starts that led to this optimum; 1 if there was one start.
    """

    model: Model
    values: FloatArray
    covariance: FloatArray
    chi2: FloatArray
    dof: int
    residuals: FloatArray
    on_bound: BoolArray
    converged: BoolArray
    agreed: FloatArray = field(default_factory=lambda: np.ones(()))

    @classmethod
    def shaped(cls, lead: tuple[int, ...], model: Model, dof: int, **parts: np.ndarray) -> Fit:
        """The fit whose attributes with a row for each condition (B,) have the shape of the conditions."""
        return cls(model=model, dof=dof, **{n: one.reshape((*lead, *one.shape[1:])) for n, one in parts.items()})

    @property
    def std(self) -> FloatArray:
        """Standard uncertainties of the parameters (..., P)."""
        return np.sqrt(np.maximum(np.diagonal(self.covariance, 0, -2, -1), 0.0))

    @property
    def correlation(self) -> FloatArray:
        """Correlation of the parameters (..., P, P); 0 where a parameter has no uncertainty."""
        std = self.std
        scale = std[..., :, None] * std[..., None, :]
        return np.divide(self.covariance, scale, out=np.zeros_like(self.covariance), where=scale > 0)

    def part(self, at: int) -> Fit:
        """The fit of one of the conditions (B,)."""
        return replace(self, **{name: getattr(self, name)[at] for name in _BY_CONDITION})

    @property
    def chance(self) -> FloatArray:
        """Probability (...,) of a larger chi-square if the model is true."""
        return np.asarray(stats.chi2.sf(self.chi2, max(self.dof, 1)))


def fit(
    model: Model, data: StiffnessData, start: ArrayLike, *, fixed: Mapping[str, ArrayLike] | Sequence[str] = ()
) -> Fit:
    """Fit a model to each condition, from one start.

    Parameters
    ----------
    model : Model
    data : StiffnessData
        Data of conditions (...,).
    start : (P,) or (..., P) float array
        Start values; see `starts.start_of`.
    fixed : sequence of str, or mapping of str to (...,) float array
        Parameters that keep their start value, or the value of the mapping.

    Returns
    -------
    Fit

    Raises
    ------
    ModelError
        If there are fewer data than free parameters, or a name is not a parameter.

    References
    ----------
    J. J. Moré, "The Levenberg-Marquardt algorithm: implementation and theory", 1978.

    Examples
    --------
    >>> from fourpole.models.maxwell import Zener
    >>> omega = 2 * np.pi * np.arange(5.0, 25.0)
    >>> truth = Zener().stiffness([180e3, 120e3, 700.0], omega)
    >>> fit(Zener(), StiffnessData.of(omega, truth, 100.0), [150e3, 100e3, 500.0]).values.round(3).tolist()
    [180000.0, 120000.0, 700.0]
    """
    return best_fit(model, data, np.asarray(start, dtype=float)[None], fixed=fixed)


def best_fit(
    model: Model, data: StiffnessData, starts: ArrayLike, *, fixed: Mapping[str, ArrayLike] | Sequence[str] = ()
) -> Fit:
    """The fit with the least chi-square of the fits from several starts (S, ..., P); see `starts.starts_of`.

    Examples
    --------
    >>> from fourpole.models.maxwell import Zener
    >>> omega = 2 * np.pi * np.arange(5.0, 25.0)
    >>> data = StiffnessData.of(omega, Zener().stiffness([180e3, 120e3, 700.0], omega), 100.0)
    >>> float(best_fit(Zener(), data, [[150e3, 100e3, 500.0], [1e5, 1e5, 1e5]]).agreed)
    1.0
    """
    begins = np.asarray(starts, dtype=float)
    if model.linear:
        return _fit_nonnegative(model, data, begins[0], fixed)
    lead = data.stiffness.shape[:-1]
    problem = problem_of(model, data, begins[0], fixed)
    count, size = problem.fixed.shape
    wide = np.stack([np.broadcast_to(model.checked(one), (*lead, size)) for one in begins]).reshape(-1, size)
    whole = np.tile(problem.fixed, (len(begins), 1))
    whole[:, problem.free] = wide[:, problem.free]
    fits = [_fit_of(*one) for one in searches(problem, np.tile(np.arange(count), len(begins)), whole)]
    every = {name: np.concatenate([getattr(one, name) for one in fits]) for name in _BY_CONDITION}
    parts = {name: one.reshape(len(begins), count, *one.shape[1:]) for name, one in every.items()}
    chi2 = np.where(parts["converged"], parts["chi2"], np.inf)
    chi2 = np.where(np.all(np.isinf(chi2), axis=0), parts["chi2"], chi2)
    best = np.argmin(chi2, axis=0)
    same = chi2 <= chi2.min(axis=0) * (1 + 1e-6) + _SAME_OPTIMUM
    chosen = {name: part[best, np.arange(count)] for name, part in parts.items()}
    return Fit.shaped(lead, model, fits[0].dof, **{**chosen, "agreed": np.mean(same, axis=0)})


def searches(
    problem: FitProblem, rows: np.ndarray, begins: FloatArray, pinned: BoolArray | None = None
) -> Iterator[tuple[FitProblem, FloatArray, BoolArray]]:
    """Searches from several starts, some at a time: the problem, the last place and the convergence of each.

    Parameters
    ----------
    problem : FitProblem
        A problem of B conditions.
    rows : (R,) int array
        The condition of each start.
    begins : (R, P) float array
        Starts.
    pinned : (R, F) bool array, optional
        Free parameters of the problem that keep their start value.
    """
    together = max(_TOGETHER // (problem.data.count * begins.shape[1]), 1)
    for first in range(0, len(rows), together):
        some = slice(first, first + together)
        one = replace(problem.part(rows[some]).begun(begins[some]), pinned=None if pinned is None else pinned[some])
        yield one, *_search(one, one.place_of(one.fixed))


def _fit_of(problem: FitProblem, place: FloatArray, converged: BoolArray) -> Fit:
    """The result of a search that ended at `place` (B, F)."""
    values = problem.values_of(place)
    residuals = problem.residuals(place)
    slopes = problem.jacobian(place)
    # A logarithm without effect belongs to an arm that is as good as absent.
    held = problem.held(place) | (problem.log & (np.linalg.norm(slopes, axis=1) < _NO_EFFECT))
    on_bound = np.zeros(values.shape, dtype=bool)
    on_bound[:, problem.free] = held
    covariance = _covariance(problem, slopes, held, values)
    size = values.shape[-1]
    order = problem.model.ordering(values) if problem.free.size == size else None
    if order is not None:  # sets that differ by an exchange give the same result
        values, on_bound = (np.take_along_axis(one, order, axis=1) for one in (values, on_bound))
        covariance = np.take_along_axis(covariance, order[:, :, None], axis=1)
        covariance = np.take_along_axis(covariance, order[:, None, :], axis=2)
    return Fit(
        model=problem.model, values=values, covariance=covariance, chi2=np.sum(residuals**2, axis=1),
        dof=residuals.shape[1] - problem.free.size, residuals=residuals, on_bound=on_bound, converged=converged,
        agreed=np.ones(len(values)),
    )  # fmt: skip


def _search(problem: FitProblem, place: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Levenberg-Marquardt from `place` (B, F): the last place, and which conditions converged."""
    every, ended, rows = np.clip(place, *problem.ends), np.zeros(len(place), dtype=bool), np.arange(len(place))
    left, place = problem, every
    residuals = left.residuals(place)
    chi2, damping, before = np.sum(residuals**2, axis=1), np.full(len(place), _DAMPING), np.full(len(place), np.inf)
    for steps in range(1, _STEPS + 1):
        step, predicted = _step(left, place, residuals, damping)
        low, high = left.ends
        tried = np.minimum(np.maximum(place + step, low), high)
        found = left.residuals(tried)
        after = np.sum(found**2, axis=1)
        better = np.isfinite(after) & (after <= chi2)
        moved = np.abs(tried - place).max(axis=1, initial=0.0)
        # The predicted reduction is tested, because round-off hides the last real reductions.
        done = (predicted <= _SMALL_GAIN * chi2) | (better & (moved < _SMALL_STEP)) | (moved < 1e-14)
        place, chi2 = np.where(better[:, None], tried, place), np.where(better, after, chi2)
        residuals = np.where(better[:, None], found, residuals)
        damping = damping * np.where(better, _LOWER, _RAISE)
        done |= damping > _MOST_DAMPING
        if steps % _WINDOW == 0:
            done |= before - chi2 <= _FLAT + _FLAT_SHARE * chi2
            before = chi2
        if steps == _STEPS or np.count_nonzero(done) > _MOST_DONE * done.size:
            every[rows], ended[rows] = place, done & np.isfinite(chi2)
            if steps == _STEPS or done.all():
                break
            kept = np.flatnonzero(~done)
            rows, place, residuals = rows[kept], place[kept], residuals[kept]
            chi2, damping, before, left = chi2[kept], damping[kept], before[kept], problem.part(rows)
    return problem.snapped(every), ended


def _step(
    problem: FitProblem, place: FloatArray, residuals: FloatArray, damping: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """The next step (B, F), and the reduction of chi-square (B,) that the linearised model predicts for it."""
    slopes = problem.jacobian(place)
    turned = np.swapaxes(slopes, 1, 2)
    normal, right = turned @ slopes, (turned @ residuals[..., None])[..., 0]
    low, high = problem.ends
    outward = ((place <= low) & (right < 0)) | ((place >= high) & (right > 0))
    if problem.pinned is not None:
        outward |= problem.pinned
    diagonal = np.einsum("bff->bf", normal)
    size = np.maximum(diagonal, 1e-300)
    if outward.any():
        normal[outward[:, :, None] | outward[:, None, :]] = 0.0
        right[outward] = 0.0
    diagonal[:] = np.where(outward, size, size * (1 + damping[:, None]) + 1e-14 * size.max(axis=1)[:, None])
    scale = 1.0 / np.sqrt(diagonal)
    scaled = normal * scale[:, :, None] * scale[:, None, :]
    step = np.linalg.solve(scaled, (right * scale)[..., None])[..., 0] * scale
    return step, np.sum(step * right, axis=1)


def _covariance(problem: FitProblem, slopes: FloatArray, held: BoolArray, values: FloatArray) -> FloatArray:
    """Covariance (B, P, P) of all parameters; held parameters have no uncertainty."""
    # Round-off of the inverse would be large in the unit of a time that may be any.
    slopes, unit = np.where(held[:, None, :], 0.0, slopes), np.where(held, 0.0, problem.unit_of(values))
    found = np.zeros((*values.shape, values.shape[-1]))
    by_search = inverse(np.swapaxes(slopes, 1, 2) @ slopes)
    found[:, problem.free[:, None], problem.free] = by_search * unit[:, :, None] * unit[:, None, :]
    return found


def moved_by(
    model: Model, values: FloatArray, covariance: FloatArray, data: StiffnessData, changes: ComplexArray
) -> FloatArray:
    """Changes (P, k) of fitted parameters by changes (N, k) [N/m] of K* of the data: C J' V^-1 S of least squares."""
    whiten = data.whitener()
    slopes = data.whitened(whiten, model.derivative(values, data.omega))
    return np.asarray(covariance @ slopes.T @ data.whitened(whiten, changes))


def _fit_nonnegative(
    model: Model, data: StiffnessData, start: ArrayLike, fixed: Mapping[str, ArrayLike] | Sequence[str]
) -> Fit:
    """The fits of a linear model to conditions (...,), by non-negative least squares; see `fit`.

    The degrees of freedom count the parameters that are not zero: their expected number is the number of degrees of
    freedom of such a fit. Those of several conditions are counted with the largest number. The covariance is that of
    the parameters that are not zero.

    References
    ----------
    M. Meyer, M. Woodroofe, "On the degrees of freedom in shape-restricted regression", Annals of Statistics 28, 2000.
    """
    lead, size = data.stiffness.shape[:-1], len(model.parameters)
    begins, free = begin_of(model, lead, start, fixed), free_places(model, fixed)
    found = []
    for condition, values in zip(whitened_conditions(data), begins, strict=True):
        best = NonNegative.best(*linear_problem(model, condition, values, free))
        covariance, held = np.zeros((size, size)), np.zeros(size, dtype=bool)
        covariance[np.ix_(free, free)] = best.covariance
        values[free], held[free] = best.weights, best.weights == 0
        found.append((values, covariance, best.chi2, best.residuals[: condition.data.numbers], held))
    values, covariance, chi2, residuals, on_bound = (np.array(part) for part in zip(*found, strict=True))
    used = free.size - int(on_bound.sum(axis=1).min())
    if residuals.shape[1] < used:
        raise ModelError(f"{residuals.shape[1]} numbers are too few for {used} terms of the {model.name} model")
    return Fit.shaped(
        lead, model, residuals.shape[1] - used,
        values=values, covariance=covariance, chi2=chi2, residuals=residuals,
        on_bound=on_bound, converged=np.ones(len(values), dtype=bool), agreed=np.ones(len(values)),
    )  # fmt: skip


def linear_problem(
    model: Model, condition: WhitenedCondition, start: FloatArray, free: IntArray
) -> tuple[FloatArray, FloatArray]:
    """Rows (M, F) of the free parameters of a linear model, and the target (M,) without what the fixed ones give."""
    data, values = condition.data, np.array(start)
    values[free] = 0.0
    rows = condition.rows(model.derivative(values, data.omega)[:, free], static_derivative(model, values, data)[free])
    off = data.stiffness - model.stiffness(values, data.omega)
    rest = replace(data, stiffness=off, k1=data.k1 - static_stiffness(model, values, data))
    return rows, replace(condition, data=rest).target
