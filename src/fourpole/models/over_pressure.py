r"""One set of parameters for several inflation pressures: the fit of a model that has the pressure as a parameter.

The model at condition c and frequency f is

.. math:: K^*_c(f) = K^*(f;\ p_c, \theta)\, e^{\sum_k h_{ck}(f)\,\epsilon_k}

with one theta for all pressures p_c. The errors epsilon that all tests share, such as gains of sensors, are parameters
with their stated uncertainty; they act on the model, not on the measured K*. If the pressures do not agree on theta,
the logarithm of each parameter has a scatter from pressure to pressure: theta is then the mean of fits to one pressure
each, weighted with their covariance and the scatter. Their uncertainty is then that of one pressure, by Student's t.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from fourpole.core import stats
from fourpole.core.arrays import ByValue, ComplexArray, FloatArray
from fourpole.core.confidence import CHANCE, NORMAL_95
from fourpole.errors import ModelError
from fourpole.models.data import StiffnessData, complex_columns
from fourpole.models.fit import Fit
from fourpole.models.interface import Model
from fourpole.models.problem import free_places

#: A logarithm is sought within this distance from its start.
_FARTHEST = 30.0
#: A parameter within this distance of a bound, in its logarithm, counts as on the bound.
_AT_BOUND = 1e-6
#: Damping of the search: start, factors after a good and a bad step, largest; smallest relative gain; most steps.
_DAMPING, _LOWER, _RAISE, _MOST_DAMPING = 1e-3, 0.2, 5.0, 1e10
_SMALL_GAIN, _MOST_STEPS = 1e-9, 100
#: Unit of the trend: the residual changes by this much of log K* per bar [Pa].
_BAR = 1e5


@dataclass(frozen=True, eq=False)
class PressureFit(ByValue):
    """A model with one set of parameters, fitted to conditions at B pressures.

    Attributes
    ----------
    fits : tuple of Fit
        One fit per condition; they differ in the pressure only.
    pressures : (B,) float array [Pa]
    shared : tuple of str
        Symbols of the parameters that were fitted.
    chi2, dof : float, int
        Of the fit without scatter.
    separate_chi2, separate_dof : float, int
        Of fits with parameters of their own for each pressure.
    scatter : (F,) float array [1]
        Relative scatter of each shared parameter from pressure to pressure, which is part of its covariance; 0 if the
        effect of the pressure agrees.
    trend, trend_std : float [1/bar]
        Relative change of measured K* with pressure beyond that of the model, and its standard uncertainty.
    left_out, own_error : (B,) float arrays [1]
        Relative error of K*, root mean square over frequencies, at each pressure: from a fit to the other pressures,
        and from a fit to this pressure alone.
    """

    fits: tuple[Fit, ...]
    pressures: FloatArray
    shared: tuple[str, ...]
    chi2: float
    dof: int
    separate_chi2: float
    separate_dof: int
    scatter: FloatArray
    trend: float
    trend_std: float
    left_out: FloatArray
    own_error: FloatArray

    @property
    def chance(self) -> float:
        """Probability that separate parameters reduce chi-square as much by noise alone."""
        more = self.dof - self.separate_dof
        return float(stats.chi2.sf(max(self.chi2 - self.separate_chi2, 0.0), max(more, 1)))

    @property
    def agrees(self) -> bool:
        """Whether the effect of the pressure agrees with the data."""
        return self.chance > CHANCE


def fit_over_pressures(
    model: Model,
    conditions: Sequence[StiffnessData],
    pressures: Sequence[float],
    start: FloatArray,
    fixed: Sequence[str],
    shared: Sequence[FloatArray] | None = None,
) -> PressureFit:
    """Fit one set of parameters to conditions that differ in their pressure.

    Parameters
    ----------
    model : Model
        A model whose attribute `pressure` names its parameter of the pressure.
    conditions : sequence of B StiffnessData
        Data of one condition each, without covariance between frequencies.
    pressures : sequence of B float [Pa]
    start : (B, P) float array
        Start values, one set per condition; fixed parameters keep theirs.
    fixed : sequence of str
        Symbols of the parameters that are not fitted, that of the pressure among them.
    shared : sequence of B (2N, p) float arrays [N/m], optional
        Changes of Re K* and Im K* of each frequency in turn when one of p errors that all conditions share is one
        standard uncertainty.

    Raises
    ------
    ModelError
        If there are fewer than two pressures, or fewer data than parameters.

    Examples
    --------
    >>> from fourpole.models.tyre_shell import RADIAL_PLY, Shell
    >>> omega, pressures, sets = 2 * np.pi * np.arange(10.0, 25.0, 4.0), [1e5, 2.2e5], []
    >>> shell = Shell(around=12, across=1, moving=(5, 1))
    >>> for p in pressures:
    ...     sets.append([*RADIAL_PLY[:4], p, *RADIAL_PLY[5:]])
    >>> data = [StiffnessData.of(omega, shell.stiffness(one, omega), 50.0) for one in sets]
    >>> begun = np.array(sets) * [1, 1, 1, 1, 1, 1.2, 0.8, 1.1, 1, 1]
    >>> found = fit_over_pressures(shell, data, pressures, begun, ["R", "B", "S", "D", "p", "l", "beta"])
    >>> found.fits[0].values[5:8].round(6), found.agrees
    (array([8.0e+06, 1.6e+01, 6.0e-04]), True)
    """
    problem = _problem(model, conditions, pressures, start, fixed, shared)
    joint = problem.solved()
    apart = replace(problem, sets=tuple(range(len(conditions))))
    separate = apart.solved()
    if len(set(problem.pressures)) < 2:
        raise ModelError("the effect of the pressure needs conditions at two pressures at least")
    mean, inverse, scatter = _mean(problem, joint, separate)
    bent = replace(problem, bends=True).solved(joint)
    place = problem.free.size
    return PressureFit(
        fits=tuple(problem.fit(at, mean, inverse, joint) for at in range(len(conditions))),
        pressures=np.asarray(problem.pressures, dtype=float),
        shared=tuple(model.symbols[at] for at in problem.free),
        chi2=joint.chi2,
        dof=joint.dof,
        separate_chi2=separate.chi2,
        separate_dof=separate.dof,
        scatter=scatter,
        trend=float(bent.unknowns[place]),
        trend_std=float(np.sqrt(bent.inverse[place, place])),
        left_out=np.array([_left_out(problem, joint, at) for at in range(len(conditions))]),
        own_error=np.array([apart.error(apart.values(separate.unknowns, at), at) for at in range(len(conditions))]),
    )


def _mean(problem: _Problem, joint: _Solved, separate: _Solved) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Logarithms of the shared parameters (F,), their covariance at one pressure, and their scatter (F,)."""
    count, many = problem.free.size, len(problem.conditions)
    more = joint.dof - separate.dof
    whole, nothing = joint.inverse[:count, :count], np.zeros(count)
    if stats.chi2.sf(max(joint.chi2 - separate.chi2, 0.0), max(more, 1)) > CHANCE:
        return joint.unknowns[:count], whole, nothing
    own = separate.unknowns[: many * count].reshape(many, count)
    spread = separate.inverse[: many * count, : many * count].reshape(many, count, many, count)
    told = np.array([np.all(np.diagonal(spread[:, at, :, at]) > 0) for at in range(count)])  # on no bound anywhere
    if not told.any():
        return joint.unknowns[:count], whole, nothing
    scatter = np.array([_beyond(own[:, at], spread[:, at, :, at]) if told[at] else 0.0 for at in range(count)])
    size = int(told.sum())
    covariance = spread[:, told][:, :, :, told].reshape(many * size, many * size)
    covariance = covariance + np.kron(np.eye(many), np.diag(scatter[told] ** 2))
    design = np.tile(np.eye(size), (many, 1))
    weighted = np.linalg.solve(covariance, design)
    inverse = np.linalg.inv(design.T @ weighted)
    mean, whole = np.array(joint.unknowns[:count]), np.zeros((count, count))
    mean[told] = inverse @ weighted.T @ own[:, told].ravel()
    # A scatter from few pressures is itself uncertain: 1.96 of these standard uncertainties cover 95 %.
    wider = np.where(scatter[told] > 0, stats.t.ppf(0.975, many - 1) / NORMAL_95, 1.0)
    whole[np.ix_(told, told)] = (inverse + np.diag(scatter[told] ** 2)) * np.outer(wider, wider)
    return mean, whole, scatter


def _beyond(values: FloatArray, covariance: FloatArray) -> float:
    """Standard deviation of values beyond that which their covariance explains."""
    many = values.size
    expected = (np.trace(covariance) - covariance.sum() / many) / (many - 1)
    return float(np.sqrt(max(np.var(values, ddof=1) - expected, 0.0)))


def _left_out(problem: _Problem, joint: _Solved, at: int) -> float:
    """Relative error of K* at one pressure, from a fit to the others."""
    rest = [one for one in range(len(problem.conditions)) if one != at]
    found = problem.part(rest).solved(joint)
    values = problem.values(found.unknowns, 0)
    values[problem.model.symbols.index(problem.model.pressure)] = problem.pressures[at]
    return problem.error(values, at)


@dataclass(frozen=True, eq=False)
class _Solved:
    """Unknowns of a solution, their covariance, and chi-square with that of the known errors."""

    unknowns: FloatArray
    inverse: FloatArray
    chi2: float
    dof: int
    converged: bool


@dataclass(frozen=True, eq=False)
class _Problem:
    """The least-squares problem. Unknowns: logarithms of the free parameters, set by set; trend; errors.

    `sets` says which set of parameters each condition has; `effects` (B)(N, p) are changes of log K* by shared errors.
    """

    model: Model
    conditions: tuple[StiffnessData, ...]
    pressures: tuple[float, ...]
    start: FloatArray
    free: np.ndarray
    effects: tuple[ComplexArray, ...]
    sets: tuple[int, ...]
    bends: bool = False

    def part(self, chosen: Sequence[int]) -> _Problem:
        """The same problem for some of the conditions."""
        rows = {name: getattr(self, name) for name in ("conditions", "pressures", "effects", "sets")}
        some: dict[str, Any] = {name: tuple(values[at] for at in chosen) for name, values in rows.items()}
        return replace(self, start=self.start[list(chosen)], **some)

    @cached_property
    def whiteners(self) -> tuple[FloatArray, ...]:
        """The whitener of each condition's own errors."""
        return tuple(one.whitener() for one in self.conditions)

    @property
    def size(self) -> int:
        """Number of unknown parameters, the trend included."""
        return self.free.size * (max(self.sets) + 1) + int(self.bends)

    @property
    def priors(self) -> int:
        """Number of errors with a known standard deviation."""
        return self.effects[0].shape[1]

    def values(self, unknowns: FloatArray, at: int) -> FloatArray:
        """Parameters (P,) of a condition."""
        found, first = np.array(self.start[at]), self.sets[at] * self.free.size
        low, high = self.model.bounds
        found[self.free] = np.clip(np.exp(unknowns[first : first + self.free.size]), low[self.free], high[self.free])
        return found

    def error(self, values: FloatArray, at: int) -> float:
        """Relative error of K* (root mean square over frequencies) of parameters (P,) at a condition."""
        data = self.conditions[at]
        off = self.model.stiffness(values, data.omega) / data.stiffness - 1
        return float(np.sqrt(np.mean(np.abs(off) ** 2)))

    def by_log(self, at: int) -> ComplexArray:
        """Derivatives (N, size + priors) of log K* of a condition by trend and errors; zero by the parameters."""
        data = self.conditions[at]
        found = np.zeros((data.count, self.size + self.priors), dtype=complex)
        if self.bends:
            found[:, self.size - 1] = (self.pressures[at] - np.mean(self.pressures)) / _BAR
        found[:, self.size :] = self.effects[at]
        return found

    def linearised(self, unknowns: FloatArray, at: int) -> tuple[FloatArray, FloatArray]:
        """Whitened residuals (M,), data minus model, of a condition, and derivatives (M, U) of the whitened model."""
        data, values, by_log = self.conditions[at], self.values(unknowns, at), self.by_log(at)
        factor = np.exp(by_log @ unknowns)
        shown = self.model.stiffness(values, data.omega) * factor
        by = shown[:, None] * by_log
        first = self.sets[at] * self.free.size
        mine = slice(first, first + self.free.size)
        by[:, mine] = self.model.derivative(values, data.omega)[:, self.free] * values[self.free] * factor[:, None]
        whitener = self.whiteners[at]
        residuals, rows = data.whitened(whitener, (data.stiffness - shown)[:, None])[:, 0], data.whitened(whitener, by)
        if not (data.has_k1 and self.model.rests):
            return residuals, rows
        by_trend = np.array(by_log[0].real)
        by_trend[self.size :] = 0.0  # the trend acts on K1, errors of the dynamic test do not
        grown, std = np.exp(by_trend @ unknowns), float(data.k1_std)
        k1 = float(self.model.static_stiffness(values)) * float(grown)
        by_rest = k1 * by_trend
        by_rest[mine] = self.model.static_derivative(values)[self.free] * values[self.free] * grown
        return np.append(residuals, (float(data.k1) - k1) / std), np.vstack([rows, by_rest / std])

    def solved(self, near: _Solved | None = None) -> _Solved:
        """The least-squares solution, from the start values or from the parameters of another solution."""
        count = self.free.size
        begin = np.zeros(self.size + self.priors)
        for at, one in enumerate(self.sets):
            own = np.log(np.maximum(self.start[at][self.free], 1e-300))
            begin[one * count : (one + 1) * count] = own if near is None else near.unknowns[:count]

        low, high = self._ends(begin)
        found, held, residuals, slopes, converged = self._searched(np.clip(begin, low, high), low, high)
        slopes[:, held] = 0.0
        scale = 1.0 / np.maximum(np.linalg.norm(slopes, axis=0), 1e-300)
        inverse = np.linalg.pinv((slopes * scale).T @ (slopes * scale), rcond=1e-13, hermitian=True)
        scale = np.where(held, 0.0, scale)
        known = residuals.size - self.priors
        if known < self.size:
            raise ModelError(f"{known} numbers are too few for {self.size} parameters of the {self.model.name} model")
        chi2 = float(residuals @ residuals)
        return _Solved(found, inverse * np.outer(scale, scale), chi2, known - self.size, converged)

    def _searched(
        self, u: FloatArray, low: FloatArray, high: FloatArray
    ) -> tuple[FloatArray, np.ndarray, FloatArray, FloatArray, bool]:
        """Levenberg-Marquardt, projected onto the bounds: unknowns, which are held, residuals, slopes, success."""
        damping, (residuals, slopes) = _DAMPING, self.whole(u)
        for _ in range(_MOST_STEPS):
            right = slopes.T @ residuals
            held = ((u <= low + _AT_BOUND) & (right < 0)) | ((u >= high - _AT_BOUND) & (right > 0))
            free = ~held
            size = np.maximum(np.sum(slopes[:, free] ** 2, axis=0), 1e-300)
            scaled = slopes[:, free] / np.sqrt(size)
            normal = scaled.T @ scaled + damping * np.eye(int(free.sum()))
            step = np.zeros(u.size)
            step[free] = np.linalg.solve(normal, scaled.T @ residuals) / np.sqrt(size)
            tried = np.clip(u + step, low, high)
            after = self.whole(tried)
            gain, chi2 = float(residuals @ residuals - after[0] @ after[0]), float(residuals @ residuals)
            if gain >= 0:
                u, (residuals, slopes) = tried, after
                damping *= _LOWER
            else:
                damping *= _RAISE
            if float(right @ step) <= _SMALL_GAIN * chi2 or damping > _MOST_DAMPING:
                return u, held, residuals, slopes, True
        return u, held, residuals, slopes, False

    def whole(self, u: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Whitened residuals, data minus model, of all conditions and of the known errors, and slopes of the model."""
        parts = [self.linearised(u, at) for at in range(len(self.conditions))]
        residuals = np.concatenate([*(one for one, _ in parts), -u[self.size :]])
        return residuals, np.concatenate([*(rows for _, rows in parts), np.eye(u.size)[self.size :]])

    def _ends(self, begin: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Bounds of the unknowns: those of the parameters, as logarithms, and none for trend and errors."""
        low, high = np.full(begin.size, -np.inf), np.full(begin.size, np.inf)
        count = self.size - int(self.bends)
        many = count // self.free.size
        with np.errstate(divide="ignore"):
            ends = [np.tile(np.log(one[self.free]), many) for one in self.model.bounds]
        low[:count] = np.maximum(ends[0], begin[:count] - _FARTHEST)
        high[:count] = np.minimum(ends[1], begin[:count] + _FARTHEST)
        return low, high

    def fit(self, at: int, logarithms: FloatArray, inverse: FloatArray, joint: _Solved) -> Fit:
        """The fit of one condition from the logarithms of the shared parameters (F,) and their covariance.

        Shared errors are at their estimates in the joint solution. Chi-square counts the scatter from pressure to
        pressure in.
        """
        place = np.concatenate([logarithms, joint.unknowns[self.size :]])
        size, count = len(self.model.parameters), self.free.size
        values = self.values(place, at)
        residuals, slopes = self.linearised(place, at)
        spread = np.zeros((size, count))
        spread[self.free, np.arange(count)] = values[self.free]
        more = slopes[:, :count] @ inverse @ slopes[:, :count].T
        on_bound = np.zeros(size, dtype=bool)
        on_bound[self.free] = np.diag(inverse) == 0
        return Fit(
            model=self.model,
            values=values,
            covariance=spread @ inverse @ spread.T,
            chi2=np.asarray(residuals @ np.linalg.solve(np.eye(residuals.size) + more, residuals)),
            dof=round(joint.dof / len(self.conditions)),
            residuals=residuals,
            on_bound=on_bound,
            converged=np.asarray(joint.converged),
        )


def _problem(
    model: Model,
    conditions: Sequence[StiffnessData],
    pressures: Sequence[float],
    start: FloatArray,
    fixed: Sequence[str],
    shared: Sequence[FloatArray] | None,
) -> _Problem:
    """The problem of `fit_over_pressures`, checked."""
    if not model.pressure or model.pressure not in fixed:
        raise ModelError(f"the {model.name} model has no known parameter of the pressure")
    begin = np.array(model.checked(start))
    begin[:, model.symbols.index(model.pressure)] = pressures
    free = free_places(model, fixed)
    columns = shared if shared is not None else [np.zeros((2 * one.count, 0)) for one in conditions]
    effects = tuple(
        complex_columns(np.asarray(one)) / data.stiffness[:, None]
        for one, data in zip(columns, conditions, strict=True)
    )
    sets = (0,) * len(conditions)
    return _Problem(model, tuple(conditions), tuple(map(float, pressures)), model.checked(begin), free, effects, sets)
