"""The least-squares problem of a fit: residuals, their derivatives, and the free, fixed and tied parameters.

The search variable of a free parameter is its logarithm if `Parameter.log` is set, otherwise its ratio to a scale.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from fourpole.core.arrays import BoolArray, ByValue, FloatArray
from fourpole.errors import ModelError
from fourpole.models.data import StiffnessData
from fourpole.models.interface import Model
from fourpole.models.ramp import static_derivative, static_stiffness, takes_k1

#: A logarithm that is farther than this from its start counts as on its bound.
_FARTHEST = 30.0
#: Distance from a bound, as a fraction of the scale, within which a parameter counts as on the bound.
_AT_BOUND = 1e-9


@dataclass(frozen=True, eq=False)
class FitProblem(ByValue):
    """The fit of a model with P parameters, of which F are free, to data of B conditions.

    Attributes
    ----------
    model : Model
    data : StiffnessData
        Data (B, N).
    whiten : float array
        Whitener of the data, one matrix for each condition, or one for all.
    free : (F,) int array
        Places of the free parameters.
    spread : (P, F) float array
        Factors of the free parameters in all parameters: 1 of a parameter in itself, or the factor of a tie.
    fixed : (B, P) float array
        Start values; parameters that are neither free nor tied keep them.
    log : (F,) bool array
        Whether the search variable is the logarithm.
    scale : (B, F) float array
        Scale of the free parameters whose search variable is a ratio.
    low, high : (F,) float arrays
        Bounds of the free parameters.
    has_k1 : bool
        Whether K1 is one more residual of each condition. The residual of a condition without K1 is zero.
    pinned : (B, F) bool array, optional
        Free parameters that keep their start value in one of the conditions, as in a profile.
    """

    model: Model
    data: StiffnessData
    whiten: FloatArray
    free: np.ndarray
    spread: FloatArray
    fixed: FloatArray
    log: BoolArray
    scale: FloatArray
    low: FloatArray
    high: FloatArray
    has_k1: bool
    pinned: BoolArray | None = None

    def begun(self, begin: FloatArray) -> FitProblem:
        """The same problem with other start values (B, P)."""
        return replace(self, fixed=self._tied(begin), scale=_scale(self.model, begin, self.free))

    def part(self, rows: np.ndarray) -> FitProblem:
        """The same problem for some of the conditions, each once or several times.

        The whitener is that of these conditions, or the one that all have. The data keep the covariance of all
        conditions, which is used for the whitener alone.
        """
        names = ("stiffness", "k1", "k1_std", *self.data.ramp)
        data = replace(self.data, **{name: getattr(self.data, name)[rows] for name in names})
        if data.omega.ndim > 1:
            data = replace(data, omega=data.omega[rows])
        if data.amplitude is not None and data.amplitude.ndim > 1:
            data = replace(data, amplitude=data.amplitude[rows])
        whiten = self.whiten if len(self.whiten) == 1 else self.whiten[rows]
        pinned = None if self.pinned is None else self.pinned[rows]
        return replace(self, data=data, whiten=whiten, fixed=self.fixed[rows], scale=self.scale[rows], pinned=pinned)

    def values_of(self, place: FloatArray) -> FloatArray:
        """All parameters (B, P), from the search variables (B, F)."""
        values = np.array(self.fixed)
        found = np.where(self.log, np.exp(np.minimum(place, 700.0)), place * self.scale)
        values[:, self.free] = np.clip(found, self.low, self.high)  # round-off may step over a bound
        return self._tied(values)

    @cached_property
    def _follows(self) -> np.ndarray:
        """Places of the parameters that are tied to a free parameter."""
        return np.flatnonzero(np.any(self.spread != 0, axis=1) & ~np.isin(np.arange(len(self.spread)), self.free))

    def _tied(self, values: FloatArray) -> FloatArray:
        """Values (B, P) in which each tied parameter follows its partner."""
        follows = self._follows
        if not follows.size:
            return values
        values = np.array(values)
        values[:, follows] = values[:, self.free] @ self.spread[follows].T
        return values

    def place_of(self, values: FloatArray) -> FloatArray:
        """Search variables (B, F): logarithms, or ratios to the scale."""
        chosen = values[:, self.free]
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(self.log, np.log(np.maximum(chosen, 1e-300)), chosen / self.scale)

    def unit_of(self, values: FloatArray) -> FloatArray:
        """Derivative (B, F) of each free parameter by its search variable."""
        return np.where(self.log, values[:, self.free], self.scale)

    def residuals(self, place: FloatArray) -> FloatArray:
        """Whitened residuals, data minus model (B, M)."""
        values = self.values_of(place)
        off = self.data.stiffness - self.model.on(self.data).stiffness(values, self.data.omega)
        rows = self.data.whitened(self.whiten, off[..., None])[..., 0]
        if not self.has_k1:
            return rows
        at_rest = (np.nan_to_num(self.data.k1) - static_stiffness(self.model, values, self.data)) / self._k1_std()
        return np.concatenate([rows, at_rest[:, None]], axis=1)

    def jacobian(self, place: FloatArray) -> FloatArray:
        """Derivatives (B, M, F) of the whitened model by the search variables."""
        values = self.values_of(place)
        model = self.model.on(self.data)
        tied = self._follows.size > 0
        omega = self.data.omega
        by = model.derivative(values, omega) @ self.spread if tied else model.derivative_by(values, omega, self.free)
        unit = self.unit_of(values)
        rows = self.data.whitened(self.whiten, by * unit[:, None, :])
        if not self.has_k1:
            return rows
        slopes = static_derivative(self.model, values, self.data, None if tied else self.free)
        at_rest = slopes @ self.spread if tied else slopes
        return np.concatenate([rows, (at_rest * unit / self._k1_std()[:, None])[:, None, :]], axis=1)

    def _k1_std(self) -> FloatArray:
        """Standard uncertainty of K1 (B,) [N/m]; infinite where K1 is not known."""
        return np.where(np.isfinite(self.data.k1_std) & np.isfinite(self.data.k1), self.data.k1_std, np.inf)

    @cached_property
    def ends(self) -> tuple[FloatArray, FloatArray]:
        """Lower and upper bounds of the search variables (B, F)."""
        with np.errstate(divide="ignore"):
            low = np.where(self.log, np.log(np.maximum(self.low, 1e-300)), self.low / self.scale)
            high = np.where(self.log, np.log(self.high), self.high / self.scale)
        begun = self.place_of(self.fixed)
        low = np.where(self.log, np.maximum(low, begun - _FARTHEST), low)
        return low, np.where(self.log, np.minimum(high, begun + _FARTHEST), high)

    def clipped(self, place: FloatArray) -> FloatArray:
        """Search variables moved into their bounds."""
        return np.clip(place, *self.ends)

    def snapped(self, place: FloatArray) -> FloatArray:
        """Search variables, those within round-off of a bound moved onto it."""
        low, high = self.ends
        return np.where(place - low <= _AT_BOUND, low, np.where(high - place <= _AT_BOUND, high, place))

    def held(self, place: FloatArray) -> BoolArray:
        """Whether each free parameter (B, F) is on a bound, or its logarithm is very far from its start."""
        values = self.values_of(place)[:, self.free]
        low = values - self.low <= _AT_BOUND * self.scale
        high = self.high - values <= _AT_BOUND * self.scale
        begun = self.place_of(self.fixed)
        return np.asarray(low | high | (self.log & (np.abs(place - begun) >= _FARTHEST)))


def problem_of(
    model: Model,
    data: StiffnessData,
    start: ArrayLike,
    fixed: Mapping[str, ArrayLike] | Sequence[str],
    tied: Mapping[str, tuple[str, float]],
) -> FitProblem:
    """The least-squares problem of `fit.fit`, checked; ModelError if it has no solution or a name is not known."""
    symbols = model.known((*fixed, *tied, *(partner for partner, _ in tied.values())))
    lead = data.stiffness.shape[:-1]
    begin = np.array(np.broadcast_to(model.checked(start), (*lead, len(symbols))).reshape(-1, len(symbols)))
    if isinstance(fixed, Mapping):
        for name, value in fixed.items():
            begin[:, symbols.index(name)] = np.broadcast_to(np.asarray(value, dtype=float), lead).reshape(-1)
        model.checked(begin)
    free = np.array([at for at, one in enumerate(symbols) if one not in fixed and one not in tied], dtype=int)
    flat = data.flat()
    has_k1 = takes_k1(model, data)
    _check_count(model, free.size, data.count, 2 * data.count + int(has_k1))
    chosen = [model.parameters[at] for at in free]
    spread, high = _spread(model, symbols, free, tied)
    problem = FitProblem(
        model=model,
        data=flat,
        whiten=flat.whitener(),
        free=free,
        spread=spread,
        fixed=begin,
        log=np.array([one.log for one in chosen]),
        scale=_scale(model, begin, free),
        low=np.array([one.low for one in chosen]),
        high=high,
        has_k1=has_k1,
    )
    return problem.begun(begin)


def _check_count(model: Model, free: int, frequencies: int, known: int) -> None:
    """ModelError unless there are free parameters, and at least as many data."""
    if free == 0:
        raise ModelError(f"all parameters of the {model.name} model are given: leave at least one free")
    if known < free:
        given = "1 frequency gives" if frequencies == 1 else f"{frequencies} frequencies give"
        raise ModelError(
            f"{given} {known} numbers, too few for {free} free parameters of the {model.name} model: fix some, take a "
            "smaller model, or measure at more frequencies"
        )


def _scale(model: Model, begin: FloatArray, free: np.ndarray) -> FloatArray:
    """Scale (B, F) of the free parameters: the modulus of the start value, or of the default where that is zero."""
    usual = np.array([abs(model.parameters[at].default) or 1.0 for at in free])
    return np.where(begin[:, free] != 0, np.abs(begin[:, free]), usual)


def _spread(
    model: Model, symbols: list[str], free: np.ndarray, tied: Mapping[str, tuple[str, float]]
) -> tuple[FloatArray, FloatArray]:
    """Factors (P, F) of the free parameters in all parameters, and upper bounds (F,) that keep tied ones in theirs."""
    spread = np.zeros((len(symbols), free.size))
    spread[free, np.arange(free.size)] = 1.0
    high = np.array([model.parameters[at].high for at in free])
    for name, (partner, factor) in tied.items():
        at = np.flatnonzero(free == symbols.index(partner))
        if not at.size:
            raise ModelError(f"{name} is tied to {partner}, which is not free: tie it to a free parameter")
        if not factor > 0:
            raise ModelError(f"{name} is tied to {factor:g} times {partner}: the factor must be positive")
        spread[symbols.index(name), at[0]] = factor
        high[at[0]] = min(high[at[0]], model.parameters[symbols.index(name)].high / factor)
    return spread, high
