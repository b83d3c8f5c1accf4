r"""Fits of a model to many conditions at once: Levenberg-Marquardt over the whole batch, as array work.

Bounds are kept by projection: a parameter that stands on its bound and would leave it is held there for the step.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike
from scipy import stats

from fourpole.core.arrays import BoolArray, ByValue, FloatArray
from fourpole.models.data import StiffnessData
from fourpole.models.interface import Model
from fourpole.models.problem import FitProblem, problem_of

__all__ = ["Fit", "best_fit", "fit"]

_STEPS = 200
_DAMPING, _LOWER, _RAISE, _MOST_DAMPING = 1e-3, 0.2, 5.0, 1e12
#: The search ends after a step that changes each parameter, or chi-square, by at most these fractions.
_SMALL_STEP, _SMALL_GAIN = 1e-10, 1e-11
#: The search also ends if chi-square falls by less than this plus this fraction of it, over this number of steps.
_FLAT, _FLAT_SHARE, _WINDOW = 1e-3, 1e-6, 20
#: Share of converged conditions above which the search goes on without them.
_MOST_DONE = 0.25
#: The data do not determine a parameter if multiplying it by e changes them by less than this, in standard units.
_UNSEEN = 1e-4
#: Starts whose chi-square ends within this of the best have found the same optimum.
_SAME_OPTIMUM = 1e-3


@dataclass(frozen=True, eq=False)
class Fit(ByValue):
    """A model fitted to conditions (...,), each by itself.

    Attributes
    ----------
    model : Model
    values : (..., P) float array
        Best parameters, each in its unit.
    covariance : (..., P, P) float array
        Of the parameters; 0 for fixed ones and those on a bound.
    chi2 : (...,) float array [1]
        Squared residuals in standard units, K1's included.
    dof : int
        Data less free parameters.
    residuals : (..., M) float array [1]
        In standard units: Re and Im of each frequency in turn, whitened; last K1's, where it is used.
    on_bound : (..., P) bool array
        Parameters that stand on a bound, or are so far off that the data do not see them.
    converged : (...,) bool array
    steps : int
        Steps of the slowest.
    agreed : (...,) float array [1]
        Share of the starts that came to this optimum; 1 where there was one start.
    """

    model: Model
    values: FloatArray
    covariance: FloatArray
    chi2: FloatArray
    dof: int
    residuals: FloatArray
    on_bound: BoolArray
    converged: BoolArray
    steps: int
    agreed: FloatArray

    @property
    def std(self) -> FloatArray:
        """Standard uncertainties of the parameters (..., P)."""
        return np.sqrt(np.maximum(np.diagonal(self.covariance, 0, -2, -1), 0.0))

    @property
    def correlation(self) -> FloatArray:
        """Correlation of the parameters (..., P, P); 0 where one is exact."""
        std = self.std
        scale = std[..., :, None] * std[..., None, :]
        return np.divide(self.covariance, scale, out=np.zeros_like(self.covariance), where=scale > 0)

    @property
    def lead(self) -> tuple[int, ...]:
        """The conditions (...,)."""
        return self.values.shape[:-1]

    def part(self, at: int) -> Fit:
        """One of the conditions, of a fit to (B,)."""
        names = ("values", "covariance", "chi2", "residuals", "on_bound", "converged", "agreed")
        return replace(self, **{name: getattr(self, name)[at] for name in names})

    @property
    def chance(self) -> FloatArray:
        """Probability of a chi-square as large as this, if the model were true (...,)."""
        return np.asarray(stats.chi2.sf(self.chi2, max(self.dof, 1)))


def fit(
    model: Model,
    data: StiffnessData,
    start: ArrayLike,
    *,
    fixed: Mapping[str, ArrayLike] | Sequence[str] = (),
    tied: Mapping[str, tuple[str, float]] | None = None,
    space: str = "stiffness",
) -> Fit:
    """Fit a model to each condition by itself, from a start.

    Parameters
    ----------
    model : Model
    data : StiffnessData
        Of conditions (...,).
    start : (P,) or (..., P) float array
        Where to begin; see `starts.start_of`.
    fixed : sequence of str, or mapping of str to (...,) float array
        Parameters that stay as they start, or at a value.
    tied : mapping of str to (str, float), optional
        Parameters that are a positive multiple of a free one: {"tau_2": ("tau_1", 10.0)}.
    space : {"stiffness", "compliance", "mobility"}
        What is compared; the covariance is carried along to first order.

    Returns
    -------
    Fit

    Raises
    ------
    ModelError
        If there are fewer data than free parameters, or a name is not known.

    References
    ----------
    J. J. Moré, "The Levenberg-Marquardt algorithm: implementation and theory", 1978.

    Examples
    --------
    >>> from fourpole.models.maxwell import Zener
    >>> omega = 2 * np.pi * np.arange(5.0, 25.0)
    >>> truth = Zener().stiffness([180e3, 120e3, 700.0], omega)
    >>> fit(Zener(), StiffnessData.of(omega, truth, 100.0), [150e3, 100e3, 500.0]).values.round(3)
    array([180000., 120000.,    700.])
    """
    problem = problem_of(model, data, start, fixed, tied or {}, space)
    return _fit_of(problem, data.stiffness.shape[:-1], *_search(problem, problem.place_of(problem.fixed)))


def best_fit(
    model: Model,
    data: StiffnessData,
    starts: ArrayLike,
    *,
    fixed: Mapping[str, ArrayLike] | Sequence[str] = (),
    tied: Mapping[str, tuple[str, float]] | None = None,
    space: str = "stiffness",
) -> Fit:
    """The best of the fits from several starts (S, ..., P): a guard against local minima; see `starts.starts_of`.

    Examples
    --------
    >>> from fourpole.models.maxwell import Zener
    >>> omega = 2 * np.pi * np.arange(5.0, 25.0)
    >>> data = StiffnessData.of(omega, Zener().stiffness([180e3, 120e3, 700.0], omega), 100.0)
    >>> float(best_fit(Zener(), data, [[150e3, 100e3, 500.0], [1e5, 1e5, 1e5]]).agreed)
    1.0
    """
    begins = np.asarray(starts, dtype=float)
    lead = data.stiffness.shape[:-1]
    problem = problem_of(model, data, begins[0], fixed, tied or {}, space)
    fits = []
    for begin in begins:
        whole = np.array(problem.fixed)
        free = np.broadcast_to(model.checked(begin), (*lead, begin.shape[-1])).reshape(whole.shape)[:, problem.free]
        whole[:, problem.free] = free
        one = problem.begun(whole)
        fits.append(_fit_of(one, whole.shape[:1], *_search(one, one.place_of(one.fixed))))
    chi2 = np.where([each.converged for each in fits], [each.chi2 for each in fits], np.inf)
    chi2 = np.where(np.all(np.isinf(chi2), axis=0), [each.chi2 for each in fits], chi2)
    best = np.argmin(chi2, axis=0)
    same = chi2 <= chi2.min(axis=0) * (1 + 1e-6) + _SAME_OPTIMUM
    names = ("values", "covariance", "chi2", "residuals", "on_bound", "converged")
    at = np.arange(best.size)
    chosen = {name: np.stack([getattr(each, name) for each in fits])[best, at] for name in names}
    return replace(
        fits[0],
        **{name: part.reshape((*lead, *part.shape[1:])) for name, part in chosen.items()},
        agreed=np.mean(same, axis=0).reshape(lead),
    )


def _fit_of(problem: FitProblem, lead: tuple[int, ...], place: FloatArray, steps: int, converged: BoolArray) -> Fit:
    values = problem.values_of(place)
    residuals = problem.residuals(place)
    slopes = problem.jacobian(place)
    # A logarithm that moves nothing has left for the end where its arm is as good as none.
    held = problem.held(place) | (problem.log & (np.linalg.norm(slopes, axis=1) < _UNSEEN))
    on_bound = np.zeros(values.shape, dtype=bool)
    on_bound[:, problem.free] = held
    covariance = _covariance(problem, slopes, held, values)
    size = values.shape[-1]
    order = problem.model.ordering(values) if problem.free.size == size else None
    if order is not None:  # of equal sets always the same one
        values, on_bound = (np.take_along_axis(one, order, axis=1) for one in (values, on_bound))
        covariance = np.take_along_axis(covariance, order[:, :, None], axis=1)
        covariance = np.take_along_axis(covariance, order[:, None, :], axis=2)
    return Fit(
        model=problem.model,
        values=values.reshape(*lead, size),
        covariance=covariance.reshape(*lead, size, size),
        chi2=np.sum(residuals**2, axis=1).reshape(lead),
        dof=residuals.shape[1] - problem.free.size,
        residuals=residuals.reshape(*lead, -1),
        on_bound=on_bound.reshape(*lead, size),
        converged=converged.reshape(lead),
        steps=steps,
        agreed=np.ones(lead),
    )


def _search(problem: FitProblem, place: FloatArray) -> tuple[FloatArray, int, BoolArray]:
    """Levenberg-Marquardt from places (B, F); where it ended, how many steps, which converged."""
    place = problem.clipped(place)
    residuals = problem.residuals(place)
    chi2 = np.sum(residuals**2, axis=1)
    damping = np.full(len(place), _DAMPING)
    done = np.zeros(len(place), dtype=bool)
    rows, left, before = np.arange(len(place)), problem, np.full(len(place), np.inf)
    for steps in range(1, _STEPS + 1):
        step, promised = _step(left, place[rows], residuals[rows], damping[rows])
        tried = left.clipped(place[rows] + step)
        found = left.residuals(tried)
        after = np.sum(found**2, axis=1)
        better = np.isfinite(after) & (after <= chi2[rows])
        moved = np.max(np.abs(tried - place[rows]), axis=1, initial=0.0)
        # what is promised, not what is gained: round-off hides the last gains
        small = (promised <= _SMALL_GAIN * chi2[rows]) | (better & (moved < _SMALL_STEP)) | (moved < 1e-14)
        ahead = rows[better]
        place[ahead], residuals[ahead], chi2[ahead] = tried[better], found[better], after[better]
        damping[rows] *= np.where(better, _LOWER, _RAISE)
        done[rows] = small | (damping[rows] > _MOST_DAMPING)
        if steps % _WINDOW == 0:
            done |= before - chi2 <= _FLAT + _FLAT_SHARE * chi2
            before = chi2.copy()
        if done.all():
            break
        if np.mean(done[rows]) > _MOST_DONE:
            rows = np.flatnonzero(~done)
            left = problem.part(rows)
    return problem.snapped(place), steps, done & np.isfinite(chi2)


def _step(
    problem: FitProblem, place: FloatArray, residuals: FloatArray, damping: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """The next step (B, F) and the gain it promises (B,); parameters on a bound that would leave it are held."""
    slopes = problem.jacobian(place)
    normal = np.swapaxes(slopes, 1, 2) @ slopes
    right = (np.swapaxes(slopes, 1, 2) @ residuals[..., None])[..., 0]
    low, high = problem.ends
    outward = ((place <= low) & (right < 0)) | ((place >= high) & (right > 0))
    at = np.arange(place.shape[1])
    size = np.maximum(normal[:, at, at], 1e-300)
    normal = np.where(outward[:, :, None] | outward[:, None, :], 0.0, normal)
    normal[:, at, at] = np.where(outward, size, size * (1 + damping[:, None]) + 1e-14 * size.max(axis=1)[:, None])
    scale = 1.0 / np.sqrt(normal[:, at, at])
    scaled = normal * scale[:, :, None] * scale[:, None, :]
    right = np.where(outward, 0.0, right)
    step = np.linalg.solve(scaled, (right * scale)[..., None])[..., 0] * scale
    return step, np.sum(step * right, axis=1)


def _covariance(problem: FitProblem, slopes: FloatArray, held: BoolArray, values: FloatArray) -> FloatArray:
    """Covariance (B, P, P) of all parameters, those held being exact."""
    slopes = np.where(held[:, None, :], 0.0, slopes)
    normal = np.swapaxes(slopes, 1, 2) @ slopes
    at = np.arange(slopes.shape[2])
    scale = 1.0 / np.sqrt(np.where(normal[:, at, at] > 0, normal[:, at, at], 1.0))
    inverse = np.linalg.pinv(normal * scale[:, :, None] * scale[:, None, :], rcond=1e-13, hermitian=True)
    unit = problem.unit_of(values) * scale
    free = inverse * unit[:, :, None] * unit[:, None, :]
    return np.asarray(problem.spread @ free @ problem.spread.T)
