r"""Fits of a model to many conditions at once: Levenberg-Marquardt over the whole batch, as array work.

Parameters that are known by their order of magnitude are moved by their logarithm; the others, and bounds, by
projection: one that stands on its bound and would leave it is held there for the step.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy import stats

from fourpole.core.arrays import BoolArray, ComplexArray, FloatArray
from fourpole.errors import ModelError
from fourpole.models.data import SPACES, StiffnessData
from fourpole.models.interface import Model

__all__ = ["Fit", "fit"]

_STEPS = 200
_DAMPING, _LOWER, _RAISE, _MOST_DAMPING = 1e-3, 0.2, 5.0, 1e12
#: A step that moves no parameter by more than this share of it, or the misfit by this, ends the search.
_SMALL_STEP, _SMALL_GAIN = 1e-10, 1e-13
#: Logarithms beyond which a parameter has left for its bound.
_FARTHEST = 30.0
#: A parameter is on its bound within this share of its scale.
_AT_BOUND = 1e-9


@dataclass(frozen=True)
class Fit:
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
    converged : (...,) bool array
    steps : int
        Steps of the slowest.
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
    def chance(self) -> FloatArray:
        """Probability of a chi-square as large as this, if the model were true (...,)."""
        return np.asarray(stats.chi2.sf(self.chi2, max(self.dof, 1)))


@dataclass(frozen=True)
class Problem:
    """Data, model and what is free, with the parameters scaled for the search."""

    model: Model
    data: StiffnessData
    whiten: FloatArray
    space: str
    free: np.ndarray
    fixed: FloatArray
    log: BoolArray
    scale: FloatArray
    low: FloatArray
    high: FloatArray

    def values_of(self, place: FloatArray) -> FloatArray:
        """All parameters (B, P) of the free ones' places (B, F)."""
        values = np.array(self.fixed)
        values[:, self.free] = np.where(self.log, np.exp(np.minimum(place, 700.0)), place * self.scale)
        return values

    def place_of(self, values: FloatArray) -> FloatArray:
        """Places (B, F) of the free parameters: logarithms, or shares of their scale."""
        chosen = values[:, self.free]
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(self.log, np.log(np.maximum(chosen, 1e-300)), chosen / self.scale)

    def residuals(self, place: FloatArray) -> FloatArray:
        """Whitened data less model (B, M)."""
        values = self.values_of(place)
        off = self._seen(self.data.stiffness) - self._seen(self.model.stiffness(values, self.data.omega))
        return self._with_k1(self.data.whitened(self.whiten, off[..., None])[..., 0], values)

    def jacobian(self, place: FloatArray) -> FloatArray:
        """Derivatives (B, M, F) of the model's whitened values by the places."""
        values = self.values_of(place)
        slope = self._slope(self.model.stiffness(values, self.data.omega))[..., None]
        by = self.model.derivative(values, self.data.omega)[..., self.free] * slope
        unit = np.where(self.log, values[:, self.free], self.scale)
        rows = self.data.whitened(self.whiten, by * unit[:, None, :])
        if not np.any(np.isfinite(self.data.k1_std)):
            return rows
        at_rest = self._by_static(values) * unit / self._k1_std()[:, None]
        return np.concatenate([rows, at_rest[:, None, :]], axis=1)

    def _by_static(self, values: FloatArray) -> FloatArray:
        """Derivatives (B, F) of the static stiffness: it is linear in one parameter in every model."""
        step = 1e-6 * np.where(values != 0, np.abs(values), 1.0)
        moved = values[:, None, :] + np.eye(values.shape[1]) * step[:, None, :]
        by = (self.model.static_stiffness(moved) - self.model.static_stiffness(values)[:, None]) / step
        return np.asarray(by[:, self.free])

    def _k1_std(self) -> FloatArray:
        return np.where(np.isfinite(self.data.k1_std) & np.isfinite(self.data.k1), self.data.k1_std, np.inf)

    def _with_k1(self, rows: FloatArray, values: FloatArray) -> FloatArray:
        if not np.any(np.isfinite(self.data.k1_std)):
            return rows
        off = (np.nan_to_num(self.data.k1) - self.model.static_stiffness(values)) / self._k1_std()
        return np.concatenate([rows, off[:, None]], axis=1)

    def _seen(self, stiffness: ComplexArray) -> ComplexArray:
        if self.space == "stiffness":
            return stiffness
        return (1.0 if self.space == "compliance" else 1j * self.data.omega) / stiffness

    def _slope(self, stiffness: ComplexArray) -> ComplexArray:
        if self.space == "stiffness":
            return np.ones_like(stiffness)
        return -self._seen(stiffness) / stiffness


def fit(
    model: Model,
    data: StiffnessData,
    start: ArrayLike,
    *,
    fixed: Mapping[str, float] | Sequence[str] = (),
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
    fixed : sequence of str, or mapping of str to float
        Parameters that stay as they start, or at a value.
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
    problem, lead, begin = _problem(model, data, start, fixed, space)
    place, damping_steps, converged = _search(problem, problem.place_of(begin))
    values = problem.values_of(place)
    residuals = problem.residuals(place)
    held = _held(problem, place)
    covariance = _covariance(problem, place, held, values)
    on_bound = np.zeros(values.shape, dtype=bool)
    on_bound[:, problem.free] = held
    size = values.shape[-1]
    return Fit(
        model=model,
        values=values.reshape(*lead, size),
        covariance=covariance.reshape(*lead, size, size),
        chi2=np.sum(residuals**2, axis=1).reshape(lead),
        dof=residuals.shape[1] - problem.free.size,
        residuals=residuals.reshape(*lead, -1),
        on_bound=on_bound.reshape(*lead, size),
        converged=converged.reshape(lead),
        steps=damping_steps,
    )


def _problem(
    model: Model, data: StiffnessData, start: ArrayLike, fixed: Mapping[str, float] | Sequence[str], space: str
) -> tuple[Problem, tuple[int, ...], FloatArray]:
    if space not in SPACES:
        raise ModelError(f"no space {space!r}: choose one of {', '.join(SPACES)}")
    symbols = [parameter.symbol for parameter in model.parameters]
    for name in fixed:
        if name not in symbols:
            raise ModelError(f"the {model.name} model has no parameter {name!r}: it has {', '.join(symbols)}")
    lead = data.stiffness.shape[:-1]
    flat = _flat(data)
    begin = np.array(np.broadcast_to(model.checked(start), (*lead, len(symbols))).reshape(-1, len(symbols)))
    if isinstance(fixed, Mapping):
        for name, value in fixed.items():
            begin[:, symbols.index(name)] = value
    free = np.array([at for at, symbol in enumerate(symbols) if symbol not in fixed], dtype=int)
    known = 2 * data.omega.size + int(np.any(np.isfinite(data.k1_std)))
    if free.size == 0 or known < free.size:
        raise ModelError(
            f"{data.omega.size} frequencies give {known} numbers, too few for {free.size} free parameters of the "
            f"{model.name} model: fix some, take a smaller model, or measure at more frequencies"
        )
    chosen = [model.parameters[at] for at in free]
    problem = Problem(
        model=model,
        data=flat,
        whiten=_in_space(flat, space),
        space=space,
        free=free,
        fixed=begin,
        log=np.array([one.log for one in chosen]),
        scale=np.where(
            begin[:, free] != 0, np.abs(begin[:, free]), np.array([abs(one.default) or 1.0 for one in chosen])
        ),
        low=np.array([one.low for one in chosen]),
        high=np.array([one.high for one in chosen]),
    )
    return problem, lead, begin


def _flat(data: StiffnessData) -> StiffnessData:
    """The same conditions along one axis."""
    count = data.omega.size
    tail = data.covariance.shape[-2:] if data.full else (count, 2, 2)
    return StiffnessData(
        data.omega,
        data.stiffness.reshape(-1, count),
        np.broadcast_to(data.covariance, (*data.stiffness.shape[:-1], *tail)).reshape(-1, *tail),
        data.k1.reshape(-1),
        data.k1_std.reshape(-1),
    )


def _in_space(data: StiffnessData, space: str) -> FloatArray:
    """The whitener of what is compared."""
    whiten = data.whitener()
    if space == "stiffness":
        return whiten
    over = 1.0 if space == "compliance" else 1j * data.omega
    back = -(data.stiffness**2) / over  # dK*/dq
    turn = np.stack([np.stack([back.real, -back.imag], -1), np.stack([back.imag, back.real], -1)], -2)
    if not data.full:
        return np.asarray(whiten @ turn)
    count = data.omega.size
    wide = np.zeros(whiten.shape)
    for at in range(count):
        wide[:, 2 * at : 2 * at + 2, 2 * at : 2 * at + 2] = turn[:, at]
    return np.asarray(whiten @ wide)


def _clipped(problem: Problem, place: FloatArray) -> FloatArray:
    """Places within the bounds."""
    with np.errstate(divide="ignore"):
        low = np.where(problem.log, np.log(np.maximum(problem.low, 1e-300)), problem.low / problem.scale)
        high = np.where(problem.log, np.log(problem.high), problem.high / problem.scale)
    begun = problem.place_of(problem.fixed)
    low = np.where(problem.log, np.maximum(low, begun - _FARTHEST), low)
    high = np.where(problem.log, np.minimum(high, begun + _FARTHEST), high)
    return np.clip(place, low, high)


def _held(problem: Problem, place: FloatArray) -> BoolArray:
    """Which of the free parameters (B, F) stand on a bound, or have left for one that their logarithm never reaches."""
    values = problem.values_of(place)[:, problem.free]
    low = values - problem.low <= _AT_BOUND * problem.scale
    high = problem.high - values <= _AT_BOUND * problem.scale
    begun = problem.place_of(problem.fixed)
    return np.asarray(low | high | (problem.log & (np.abs(place - begun) >= _FARTHEST)))


def _search(problem: Problem, place: FloatArray) -> tuple[FloatArray, int, BoolArray]:
    """Levenberg-Marquardt from places (B, F); where it ended, how many steps, which converged."""
    place = _clipped(problem, place)
    residuals = problem.residuals(place)
    chi2 = np.sum(residuals**2, axis=1)
    damping = np.full(len(place), _DAMPING)
    done = np.zeros(len(place), dtype=bool)
    steps = 0
    for _ in range(_STEPS):
        steps += 1
        step = _step(problem, place, residuals, damping)
        tried = _clipped(problem, place + step)
        found = problem.residuals(tried)
        after = np.sum(found**2, axis=1)
        better = np.isfinite(after) & (after <= chi2) & ~done
        gain = np.where(better, chi2 - after, 0.0)
        moved = np.max(np.abs(tried - place), axis=1, initial=0.0)
        place = np.where(better[:, None], tried, place)
        residuals = np.where(better[:, None], found, residuals)
        small = better & ((moved < _SMALL_STEP) | (gain <= _SMALL_GAIN * np.maximum(chi2, 1e-30)))
        chi2 = np.where(better, after, chi2)
        damping = np.where(better, damping * _LOWER, damping * _RAISE)
        done |= small | (damping > _MOST_DAMPING) | (moved < 1e-14)
        if done.all():
            break
    return place, steps, done & np.isfinite(chi2)


def _step(problem: Problem, place: FloatArray, residuals: FloatArray, damping: FloatArray) -> FloatArray:
    """The next step (B, F); parameters on a bound that would leave it are held."""
    slopes = problem.jacobian(place)
    normal = np.swapaxes(slopes, 1, 2) @ slopes
    right = (np.swapaxes(slopes, 1, 2) @ residuals[..., None])[..., 0]
    outward = (place <= _clipped(problem, place - 1.0)) & (right < 0)
    outward |= (place >= _clipped(problem, place + 1.0)) & (right > 0)
    at = np.arange(place.shape[1])
    size = np.maximum(normal[:, at, at], 1e-300)
    normal = np.where(outward[:, :, None] | outward[:, None, :], 0.0, normal)
    normal[:, at, at] = np.where(outward, size, size * (1 + damping[:, None]) + 1e-14 * size.max(axis=1)[:, None])
    scale = 1.0 / np.sqrt(normal[:, at, at])
    scaled = normal * scale[:, :, None] * scale[:, None, :]
    return np.asarray(np.linalg.solve(scaled, (np.where(outward, 0.0, right) * scale)[..., None])[..., 0] * scale)


def _covariance(problem: Problem, place: FloatArray, held: BoolArray, values: FloatArray) -> FloatArray:
    """Covariance (B, P, P) of all parameters, those held being exact."""
    slopes = problem.jacobian(place)
    slopes = np.where(held[:, None, :], 0.0, slopes)
    normal = np.swapaxes(slopes, 1, 2) @ slopes
    at = np.arange(place.shape[1])
    scale = 1.0 / np.sqrt(np.where(normal[:, at, at] > 0, normal[:, at, at], 1.0))
    inverse = np.linalg.pinv(normal * scale[:, :, None] * scale[:, None, :], rcond=1e-13, hermitian=True)
    unit = np.where(problem.log, values[:, problem.free], problem.scale) * scale
    whole = np.zeros((*values.shape, values.shape[-1]))
    whole[:, problem.free[:, None], problem.free] = inverse * unit[:, :, None] * unit[:, None, :]
    return whole
