r"""Profile-likelihood intervals of parameters; they hold for nonlinear models and for one-sided intervals, too.

The profile of a parameter is the least chi-square over all other parameters, as a function of its value. The interval
of probability :math:`P(\chi^2_1 < q)` ends where the profile is :math:`q` above its minimum.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from fourpole.core import stats
from fourpole.core.arrays import FloatArray
from fourpole.core.confidence import COVERAGE
from fourpole.errors import ModelError
from fourpole.models.data import StiffnessData
from fourpole.models.fit import Fit, fit
from fourpole.models.interface import Model, Parameter
from fourpole.models.nonnegative import nonnegative_intervals
from fourpole.models.ramp import static_stiffness, takes_k1
from fourpole.models.starts import starts_of

#: Distances from the best value, in standard uncertainties, at which the profile is evaluated: first near, then far.
_NEAR = np.array([1.0, 1.6, 1.9, 2.2, 2.6, 3.2, 4.0])
_FAR = np.array([6.0, 10.0, 20.0, 50.0, 200.0])
#: Least number of free parameters with which the profile needs more than one start.
_FROM_SEVERAL = 3
#: Relative uncertainty of a logarithmic parameter above which fresh starts are added, and their number.
_UNCERTAIN, _FRESH = 0.5, 3
#: Fractions of the distance to a near bound; rise between two points above which points are added; their number.
_SHARES, _COARSE, _BETWEEN = np.array([0.05, 0.12, 0.22, 0.35, 0.5, 0.7, 0.88]), 1.0, 4
#: Largest distance from the best value, in ln of a logarithmic parameter.
_FARTHEST = 12.0


def profile_intervals(
    found: Fit,
    data: StiffnessData,
    level: float = COVERAGE,
    *,
    fixed: Mapping[str, float] | Sequence[str] = (),
    tied: Mapping[str, tuple[str, float]] | None = None,
) -> FloatArray:
    """Profile-likelihood intervals (P, 2) of the parameters of a fit to one condition.

    Parameters
    ----------
    found : Fit
        Fit to one condition.
    data : StiffnessData
        Data of the fit.
    level : float [1]
        Coverage probability.
    fixed, tied
        The fixed and tied parameters of the fit.

    Returns
    -------
    (P, 2) float array
        Ends of the intervals in the units of the parameters: the bound of the parameter where the data set no end, the
        value twice for a fixed parameter, the multiple of its partner's for a tied one.

    Raises
    ------
    ModelError
        If the fit is of several conditions.

    References
    ----------
    D. J. Venzon, S. H. Moolgavkar, "A method for computing profile-likelihood-based confidence intervals", Applied
    Statistics 37, 1988.

    Examples
    --------
    >>> from fourpole.models.springs import Spring
    >>> data = StiffnessData.of([60.0, 90.0], [180e3 + 0j, 180e3 + 0j], 1e3)
    >>> profile_intervals(fit(Spring(), data, [180e3]), data).round(-1)
    array([[178610., 181390.]])
    """
    if found.lead:
        raise ModelError("profile intervals are for one condition at a time: choose one")
    tied = tied or {}
    rise = float(np.sqrt(stats.chi2.ppf(level, 1)))
    if found.model.linear and not tied:
        return nonnegative_intervals(found, data, rise, [*fixed])
    ends = np.stack([found.values, found.values], axis=1)
    symbols = found.model.symbols
    profile = _Profile(found, data, fixed, tied)
    for at, symbol in enumerate(symbols):
        if symbol not in fixed and symbol not in tied:
            ends[at] = [profile.end(at, side, rise) for side in (-1.0, 1.0)]
    for symbol, (partner, factor) in tied.items():
        ends[symbols.index(symbol)] = factor * ends[symbols.index(partner)]
    return ends


@dataclass(frozen=True)
class _Profile:
    """A fit with its data, from which the profile of each parameter is computed.

    A place is a value of a parameter, or its logarithm if `Parameter.log` is set. A height is the square root of the
    rise of the profile above its minimum.
    """

    found: Fit
    data: StiffnessData
    fixed: Mapping[str, float] | Sequence[str]
    tied: Mapping[str, tuple[str, float]]

    def end(self, at: int, side: float, rise: float) -> float:
        """The value of a parameter on one side at which the height of the profile is `rise`."""
        parameter = self.found.model.parameters[at]
        places: FloatArray = np.array([self._place(at, self.found.values[at])])
        heights: FloatArray = np.zeros(1)
        for distances in (_NEAR, _FAR):
            values = self._values(at, side, distances)
            if not values.size:
                continue
            places, heights = self._extended(at, values, places, heights)
            if heights[-1] >= rise:
                break
        else:
            return parameter.low if side < 0 else parameter.high
        to = int(np.flatnonzero(heights >= rise)[0])
        if heights[to] - heights[to - 1] > _COARSE:
            between = np.linspace(places[to - 1], places[to], _BETWEEN + 2)[1:]
            places, heights = self._extended(at, self._value(at, between), places[:to], heights[:to])
            to = int(np.flatnonzero(heights >= rise)[0]) if heights[-1] >= rise else heights.size - 1
        share = (rise - heights[to - 1]) / max(heights[to] - heights[to - 1], 1e-300)
        return float(self._value(at, places[to - 1] + min(share, 1.0) * (places[to] - places[to - 1])))

    def _extended(
        self, at: int, values: FloatArray, places: FloatArray, heights: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Places and heights with those of further values; no height exceeds one beyond it, as in a local minimum."""
        found = np.sqrt(np.maximum(self._chi2(at, values) - self.found.chi2, 0.0))
        every = np.append(heights, found)
        return np.append(places, self._place(at, values)), np.minimum.accumulate(every[::-1])[::-1]

    def _value(self, at: int, place: ArrayLike) -> FloatArray:
        """Values of a parameter, from its places."""
        array = np.asarray(place, dtype=float)
        return np.exp(array) if self.found.model.parameters[at].log else array

    def _place(self, at: int, values: ArrayLike) -> FloatArray:
        """Places of a parameter, from its values."""
        array = np.asarray(values, dtype=float)
        return np.log(np.maximum(array, 1e-300)) if self.found.model.parameters[at].log else array

    def _values(self, at: int, side: float, distances: FloatArray) -> FloatArray:
        """Values within the bounds at which the profile is evaluated, the nearest first."""
        parameter, best = self.found.model.parameters[at], float(self.found.values[at])
        std = float(self.found.std[at])
        values = _at_distances(parameter, best, std, side, distances)
        bound = parameter.low if side < 0 else parameter.high
        if not parameter.log and np.isfinite(bound) and abs(bound - best) < distances[-1] * std:
            values = best + (bound - best) * _SHARES
        inside = values[(values > parameter.low) & (values < parameter.high)]
        if inside.size < values.size and np.isfinite(bound) and best != bound and not parameter.log:
            inside = np.append(inside, bound)
        order = np.unique(inside)
        return order if side > 0 else order[::-1]

    def _chi2(self, at: int, values: FloatArray) -> FloatArray:
        """Least chi-square for each value (T,) of one parameter, over all other parameters."""
        model, best, symbols = self.found.model, self.found.values, self.found.model.symbols
        starts = self._gaussian_starts(at, values)
        follows = {name: factor for name, (partner, factor) in self.tied.items() if partner == symbols[at]}
        starts[:, at] = values
        for name, factor in follows.items():
            starts[:, symbols.index(name)] = factor * values
        for name in self.fixed:
            starts[:, symbols.index(name)] = best[symbols.index(name)]
        held = [*self.fixed, symbols[at], *follows]
        tied = {name: tie for name, tie in self.tied.items() if name not in follows}
        if len(held) + len(tied) == len(symbols):  # no parameter is free
            return _misfit(model, _repeated(self.data, (values.size,)), starts)
        places = [symbols.index(name) for name in held]

        def fitted(begins: Sequence[FloatArray]) -> Fit:
            """Fits (S, T) from several starts; one batch costs hardly more than one start."""
            begun = np.array([np.broadcast_to(begin, starts.shape) for begin in begins])
            begun[..., places] = starts[:, places]
            return fit(model, _repeated(self.data, begun.shape[:-1]), begun, fixed=held, tied=tied)

        if len(symbols) - len(held) - len(tied) < _FROM_SEVERAL:
            return np.asarray(fitted([starts]).chi2[0])
        first = fitted([starts, *self._fresh_starts])
        lowest = first.values[np.argmin(first.chi2, axis=0), np.arange(values.size)]
        neighbours = np.concatenate([best[None], lowest[:-1]])
        return np.asarray(np.min([*first.chi2, *fitted([neighbours]).chi2], axis=0))

    def _gaussian_starts(self, at: int, values: FloatArray) -> FloatArray:
        """Starts (T, P): conditional means of a normal distribution of the parameters, given values of one of them."""
        best, covariance = self.found.values, self.found.covariance
        low, high = self.found.model.bounds
        slope = covariance[:, at] / covariance[at, at] if covariance[at, at] > 0 else np.zeros(best.size)
        means = best + np.outer(values - best[at], slope)
        starts = np.clip(means, np.maximum(low, 0.2 * best), np.minimum(high, 5 * best))
        return np.where((slope == 0) | (best <= 0), best, starts)

    @cached_property
    def _fresh_starts(self) -> FloatArray:
        """Starts (S, P) that do not depend on the best values; none unless these are uncertain."""
        if not self._is_uncertain:
            return np.zeros((0, self.found.values.size))
        return starts_of(self.found.model, self.data, _FRESH)

    @property
    def _is_uncertain(self) -> bool:
        """Whether a parameter is on a bound, or a logarithmic one has a large relative uncertainty."""
        logs = np.array([one.log for one in self.found.model.parameters])
        relative = np.divide(self.found.std, self.found.values, out=np.zeros(logs.size), where=self.found.values != 0)
        return bool(np.any(self.found.on_bound) or np.any(relative[logs] > _UNCERTAIN))


def _at_distances(parameter: Parameter, best: float, std: float, side: float, distances: FloatArray) -> FloatArray:
    """Values at distances in standard uncertainties to one side; those of a logarithmic parameter are in ln."""
    if parameter.log and best > 0:
        step = min(std / best, 1.0) if std > 0 else 1.0
        return np.asarray(best * np.exp(side * np.minimum(distances * step, _FARTHEST)))
    return best + side * distances * (std if std > 0 else 0.1 * (abs(best) or parameter.default or 1.0))


def _misfit(model: Model, data: StiffnessData, values: FloatArray) -> FloatArray:
    """Chi-square (B,) of given parameters (B, P) on conditions (B,)."""
    off = data.stiffness - model.on(data).stiffness(values, data.omega)
    chi2 = np.sum(data.whitened(data.whitener(), off[..., None])[..., 0] ** 2, axis=-1)
    if not takes_k1(model, data):
        return np.asarray(chi2)
    k1 = (data.k1 - static_stiffness(model, values, data)) / data.k1_std
    return np.asarray(chi2 + np.nan_to_num(k1) ** 2)


def _repeated(data: StiffnessData, shape: tuple[int, ...]) -> StiffnessData:
    """The data of one condition as those of an array of equal conditions."""
    parts: list[Any] = [data.stiffness, data.covariance, data.k1, data.k1_std]
    many = [np.broadcast_to(one, (*shape, *one.shape)) for one in parts]
    return replace(StiffnessData(data.omega, *many), amplitude=data.amplitude, **data.ramp)
