"""The least-squares problem of a fit: starts, residuals, derivatives, and the free and fixed parameters.

The data may be K* of one condition as the recordings of the whole rig have it near K* of a model.

The search variable of a free parameter is its logarithm if `Parameter.log` is set, otherwise its ratio to a scale.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from fourpole.core.arrays import BoolArray, ByValue, ComplexArray, FloatArray, IntArray
from fourpole.core.joint.around import Around, Likelihood
from fourpole.errors import ModelError
from fourpole.models.data import StiffnessData, complex_columns, multiplication, real_columns
from fourpole.models.interface import Model
from fourpole.models.ramp import static_derivative, static_stiffness, takes_k1

#: Largest relative difference between K* of the data and of the joint solution, as by drift.
_ALIKE = 0.5
#: Second-order effect of shared errors that is negligible, in standard uncertainties of the noise.
_NEGLIGIBLE = 0.3


def bends(own: StiffnessData, shared: FloatArray) -> bool:
    """Whether the second order of shared errors (2N, p) [N/m] is above the noise of the data."""
    if not shared.size:
        return False
    second = np.sum(np.abs(complex_columns(shared)) ** 2, axis=1) / np.abs(own.stiffness)
    noise = np.sqrt(np.linalg.eigvalsh(own.covariance)[:, 0].clip(0.0))
    return bool(np.any(second > _NEGLIGIBLE * noise))


@dataclass(frozen=True, eq=False)
class Recorded(ByValue):
    """A function of K* of a model: the data (K*, covariance, shared errors) of one condition, linear about this K*.

    Attributes
    ----------
    likelihood : Likelihood
        All tests of the rig.
    places : (N,) int array
        Number of the joint condition of each frequency.
    omega : (N,) float array [rad/s]
        Angular frequencies of the data.
    ratio : (N,) complex array [1]
        K* of the data over that of the joint condition. They differ if specimens drift over the run.
    """

    likelihood: Likelihood
    places: np.ndarray
    omega: FloatArray
    ratio: ComplexArray

    @classmethod
    def of(cls, likelihood: Likelihood, places: Sequence[int], data: StiffnessData) -> Recorded | None:
        """The function for the data of one condition; None if these are not of the likelihood's tests."""
        at = np.array(places, dtype=int)
        if not np.all((at >= 0) & (at < likelihood.stiffness.size)):
            return None
        ratio = data.stiffness / likelihood.stiffness[at]
        return cls(likelihood, at, data.omega, ratio) if np.all(np.abs(ratio - 1) < _ALIKE) else None

    def part(self, rows: np.ndarray) -> Recorded:
        """The function for some of the frequencies; K* of the others is free."""
        return replace(self, places=self.places[rows], omega=self.omega[rows], ratio=self.ratio[rows])

    def __call__(self, stiffness: ComplexArray) -> StiffnessData:
        """The data near K* = `stiffness` (N,) [N/m]; covariance and shared errors are those at this K*."""
        found = self.likelihood.around(self.places, stiffness / self.ratio)
        own = own_near(self.omega, stiffness, found)
        shared = real_columns(found.relative * stiffness[:, None])
        return replace(own.with_errors(shared), relative=found.relative, reference=stiffness)


def own_near(omega: FloatArray, stiffness: ComplexArray, found: Around) -> StiffnessData:
    """K* with the covariance for known shared errors, whose likelihood about K* = `stiffness` (N,) [N/m] is `found`."""
    by_log = multiplication(stiffness)
    own = by_log @ found.own @ np.swapaxes(by_log, 1, 2)
    covariance = 0.5 * (own + np.swapaxes(own, 1, 2))
    return StiffnessData.of(omega, stiffness * (1 + found.change @ [1, 1j]), covariance=covariance)


#: A logarithm that is farther than this from its start counts as on its bound.
_FARTHEST = 30.0
#: Distance from a bound, as a fraction of the scale, within which a parameter counts as on the bound.
_AT_BOUND = 1e-9
#: Start of a logarithmic parameter that would be zero, as a fraction of its default.
_SMALL = 1e-6
#: Further starts differ from the first by at most this factor. Their factors follow the golden-ratio sequence.
_LARGEST_FACTOR = 4.0
_GOLDEN = (np.sqrt(5.0) - 1.0) / 2.0


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
    fixed : (B, P) float array
        Start values; parameters that are not free keep them.
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
    fixed: FloatArray
    log: BoolArray
    scale: FloatArray
    low: FloatArray
    high: FloatArray
    has_k1: bool
    pinned: BoolArray | None = None

    def begun(self, begin: FloatArray) -> FitProblem:
        """The same problem with other start values (B, P)."""
        usual = np.array([abs(self.model.parameters[at].default) or 1.0 for at in self.free])
        chosen = begin[:, self.free]
        return replace(self, fixed=begin, scale=np.where(chosen != 0, np.abs(chosen), usual))

    def part(self, rows: np.ndarray) -> FitProblem:
        """The same problem for some of the conditions, each once or several times.

        The whitener is that of these conditions, or the one that all have. The covariance is used for it alone.
        """
        whiten = self.whiten if len(self.whiten) == 1 else self.whiten[rows]
        pinned = None if self.pinned is None else self.pinned[rows]
        return replace(
            self,
            data=self.data.conditions(rows),
            whiten=whiten,
            fixed=self.fixed[rows],
            scale=self.scale[rows],
            pinned=pinned,
        )

    def values_of(self, place: FloatArray) -> FloatArray:
        """All parameters (B, P), from the search variables (B, F)."""
        found = np.where(self.log, np.exp(np.minimum(place, 700.0)), place * self.scale)
        values = self.fixed.copy()
        values[:, self.free] = np.minimum(np.maximum(found, self.low), self.high)  # round-off may step over a bound
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
        k1, weight = self._k1
        at_rest = (k1 - static_stiffness(self.model, values, self.data)) * weight
        return np.concatenate([rows, at_rest[:, None]], axis=1)

    def jacobian(self, place: FloatArray) -> FloatArray:
        """Derivatives (B, M, F) of the whitened model by the search variables."""
        values = self.values_of(place)
        unit = self.unit_of(values)
        by = self.model.on(self.data).derivative(values, self.data.omega)[..., self.free]
        rows = self.data.whitened(self.whiten, by * unit[:, None, :])
        if not self.has_k1:
            return rows
        at_rest = static_derivative(self.model, values, self.data)[..., self.free]
        return np.concatenate([rows, (at_rest * unit * self._k1[1][:, None])[:, None, :]], axis=1)

    @cached_property
    def _k1(self) -> tuple[FloatArray, FloatArray]:
        """K1 (B,) [N/m] and the inverse of its standard uncertainty; zero where K1 is not known."""
        known = np.isfinite(self.data.k1_std) & np.isfinite(self.data.k1)
        k1, std = (np.where(known, one, other) for one, other in ((self.data.k1, 0.0), (self.data.k1_std, np.inf)))
        return k1, 1.0 / std

    @cached_property
    def ends(self) -> tuple[FloatArray, FloatArray]:
        """Lower and upper bounds of the search variables (B, F)."""
        with np.errstate(divide="ignore"):
            low = np.where(self.log, np.log(np.maximum(self.low, 1e-300)), self.low / self.scale)
            high = np.where(self.log, np.log(self.high), self.high / self.scale)
        begun = self.place_of(self.fixed)
        low = np.where(self.log, np.maximum(low, begun - _FARTHEST), low)
        return low, np.where(self.log, np.minimum(high, begun + _FARTHEST), high)

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
    model: Model, data: StiffnessData, start: ArrayLike, fixed: Mapping[str, ArrayLike] | Sequence[str]
) -> FitProblem:
    """The least-squares problem of `fit.fit`, checked; ModelError if it has no solution or a name is not known."""
    begin, free = begin_of(model, data.stiffness.shape[:-1], start, fixed), free_places(model, fixed)
    flat = data.flat()
    has_k1 = takes_k1(model, data)
    known = 2 * data.count + int(has_k1)
    if known < free.size:
        given = "1 frequency gives" if data.count == 1 else f"{data.count} frequencies give"
        raise ModelError(
            f"{given} {known} numbers, too few for {free.size} free parameters of the {model.name} model: fix some, "
            "take a smaller model, or measure at more frequencies"
        )
    chosen = [model.parameters[at] for at in free]
    problem = FitProblem(
        model=model,
        data=flat,
        whiten=flat.whitener(),
        free=free,
        fixed=begin,
        log=np.array([one.log for one in chosen]),
        scale=np.ones((len(begin), free.size)),
        low=np.array([one.low for one in chosen]),
        high=np.array([one.high for one in chosen]),
        has_k1=has_k1,
    )
    return problem.begun(begin)


def begin_of(
    model: Model, lead: tuple[int, ...], start: ArrayLike, fixed: Mapping[str, ArrayLike] | Sequence[str]
) -> FloatArray:
    """Start values (B, P) of conditions (...,), with the values of fixed parameters; checked."""
    symbols = model.known(fixed)
    begin = np.array(np.broadcast_to(model.checked(start), (*lead, len(symbols))).reshape(-1, len(symbols)))
    if isinstance(fixed, Mapping):
        for name, value in fixed.items():
            begin[:, symbols.index(name)] = np.broadcast_to(np.asarray(value, dtype=float), lead).reshape(-1)
    return model.checked(begin)


def free_places(model: Model, held: Collection[str]) -> IntArray:
    """Places of the parameters that are not held; ModelError if there is none."""
    free = np.array([at for at, symbol in enumerate(model.symbols) if symbol not in held], dtype=int)
    if not free.size:
        raise ModelError(f"all parameters of the {model.name} model are given: leave at least one free")
    return free


def start_of(model: Model, data: StiffnessData) -> FloatArray:
    """One start (..., P) for a fit to conditions (...,), close to the best parameters.

    Raises
    ------
    ModelError
        If the model has no start values.

    Examples
    --------
    >>> from fourpole.models.maxwell import Zener
    >>> omega = 2 * np.pi * np.arange(5.0, 25.0)
    >>> truth = Zener().stiffness([180e3, 120e3, 700.0], omega)
    >>> start_of(Zener(), StiffnessData.of(omega, truth, 100.0)).round(3).tolist()
    [180000.0, 120000.0, 700.0]
    """
    return np.asarray(starts_of(model, data, 1)[0])


def starts_of(model: Model, data: StiffnessData, count: int) -> FloatArray:
    """Several starts (count, ..., P), that of `start_of` first, always the same; more starts find fewer local minima.

    Parameters
    ----------
    model : Model
    data : StiffnessData
        Data of conditions (...,).
    count : int
        >= 1.

    Raises
    ------
    ModelError
        If the model has no start values.

    Examples
    --------
    >>> from fourpole.models.maxwell import Zener
    >>> omega = 2 * np.pi * np.arange(5.0, 25.0)
    >>> truth = Zener().stiffness([180e3, 120e3, 700.0], omega)
    >>> starts_of(Zener(), StiffnessData.of(omega, truth, 100.0), 4).shape
    (4, 3)
    """
    flat = data.flat()
    flat = replace(flat, omega=np.broadcast_to(flat.omega, flat.stiffness.shape))
    inside = _inside(model, _filled(model.starts(flat, count), count))
    return inside.reshape(count, *data.stiffness.shape[:-1], len(model.parameters))


def _inside(model: Model, found: FloatArray) -> FloatArray:
    """Starts moved into the bounds; the start of a logarithmic parameter is not zero."""
    low, high = model.bounds
    logs = np.array([parameter.log for parameter in model.parameters])
    usual = np.abs(model.defaults)
    inside = np.clip(np.where(np.isfinite(found), found, usual), low, high)
    return np.where(logs & (inside <= 0), _SMALL * usual, inside)


def _filled(found: FloatArray, count: int) -> FloatArray:
    """Exactly `count` starts: those found, then copies of the first with a factor for each parameter."""
    more = np.arange(1, count - len(found) + 1)
    shares = (more[:, None] * _GOLDEN ** np.arange(1, found.shape[-1] + 1)) % 1.0
    return np.concatenate([found[:count], found[0] * _LARGEST_FACTOR ** (2 * shares - 1)[:, None, :]])
