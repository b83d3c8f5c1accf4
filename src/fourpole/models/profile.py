r"""Intervals of parameters by the profile of the likelihood: right where the valley is bent, or open to one side.

A parameter is held at a value and all others are fitted anew; where chi-square has risen by :math:`q` above its least,
the interval of probability :math:`P(\chi^2_1 < q)` ends.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy import stats

from fourpole.core.arrays import FloatArray
from fourpole.errors import ModelError
from fourpole.models.data import StiffnessData
from fourpole.models.fit import Fit, fit
from fourpole.models.interface import Model, Parameter
from fourpole.models.starts import starts_of

__all__ = ["profile_intervals"]

#: Where the profile is looked at, in standard uncertainties: first near, then, where it has not risen, far.
_NEAR = np.array([1.0, 1.6, 1.9, 2.2, 2.6, 3.2, 4.0])
_FAR = np.array([6.0, 10.0, 20.0, 50.0, 200.0])
#: Free parameters from which on valleys are bent.
_BENT = 3
#: Relative uncertainty of a logarithm with which a best value is astray, and how many fresh starts then help.
_UNSURE, _FRESH = 0.5, 3
#: Shares of the way to a bound that is near; looks between two heights that differ by more than this.
_SHARES, _COARSE, _BETWEEN = np.array([0.05, 0.12, 0.22, 0.35, 0.5, 0.7, 0.88]), 1.0, 4
#: A logarithm is looked at no farther than this from its best.
_FARTHEST = 12.0


def profile_intervals(
    found: Fit,
    data: StiffnessData,
    level: float = 0.95,
    *,
    fixed: Mapping[str, float] | Sequence[str] = (),
    tied: Mapping[str, tuple[str, float]] | None = None,
) -> FloatArray:
    """Intervals (P, 2) of a fit's parameters by the profile of their likelihood, for one condition.

    Parameters
    ----------
    found : Fit
        Of one condition.
    data : StiffnessData
        What it was fitted to.
    level : float [1]
        Probability that an interval has the truth.
    fixed, tied
        As in the fit.

    Returns
    -------
    (P, 2) float array
        Each in its parameter's unit; the parameter's bound, or infinite, where the data set no end; the value itself
        for fixed ones; a tied one's is that of its partner.

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
        raise ModelError("the profile is of one condition at a time: choose one")
    tied = tied or {}
    rise = float(np.sqrt(stats.chi2.ppf(level, 1)))
    ends = np.stack([found.values, found.values], axis=1)
    symbols = [parameter.symbol for parameter in found.model.parameters]
    valley = _Valley(found, data, fixed, tied)
    for at, symbol in enumerate(symbols):
        if symbol not in fixed and symbol not in tied:
            ends[at] = [valley.end(at, side, rise) for side in (-1.0, 1.0)]
    for symbol, (partner, factor) in tied.items():
        ends[symbols.index(symbol)] = factor * ends[symbols.index(partner)]
    return ends


@dataclass(frozen=True)
class _Valley:
    """A fit and what it was fitted to."""

    found: Fit
    data: StiffnessData
    fixed: Mapping[str, float] | Sequence[str]
    tied: Mapping[str, tuple[str, float]]

    def end(self, at: int, side: float, rise: float) -> float:
        """Where the root of what chi-square has risen by reaches `rise`, towards one side."""
        parameter = self.found.model.parameters[at]
        places: FloatArray = np.array([self._place(at, self.found.values[at])])
        heights: FloatArray = np.zeros(1)
        for look in (_NEAR, _FAR):
            tried = self._tried(at, side, look)
            if not tried.size:
                continue
            places, heights = self._seen(at, tried, places, heights)
            if heights[-1] >= rise:
                break
        else:
            return parameter.low if side < 0 else parameter.high
        to = int(np.flatnonzero(heights >= rise)[0])
        if heights[to] - heights[to - 1] > _COARSE:  # look again between
            between = np.linspace(places[to - 1], places[to], _BETWEEN + 2)[1:-1]
            tried = np.exp(between) if parameter.log else between
            places, heights = self._seen(at, np.append(tried, self._value(at, places[to])), places[:to], heights[:to])
            to = int(np.flatnonzero(heights >= rise)[0]) if heights[-1] >= rise else heights.size - 1
        share = (rise - heights[to - 1]) / max(heights[to] - heights[to - 1], 1e-300)
        return float(self._value(at, places[to - 1] + min(share, 1.0) * (places[to] - places[to - 1])))

    def _seen(
        self, at: int, tried: FloatArray, places: FloatArray, heights: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Places and heights with those tried; a fit that ended too high is seen by a lower one beyond it."""
        found = np.sqrt(np.maximum(self._chi2(at, tried) - self.found.chi2, 0.0))
        every = np.append(heights, found)
        return np.append(places, self._place(at, tried)), np.minimum.accumulate(every[::-1])[::-1]

    def _value(self, at: int, place: ArrayLike) -> FloatArray:
        """Back from where a parameter is searched."""
        array = np.asarray(place, dtype=float)
        return np.exp(array) if self.found.model.parameters[at].log else array

    def _place(self, at: int, values: ArrayLike) -> FloatArray:
        """Logarithms of a parameter that is searched so."""
        array = np.asarray(values, dtype=float)
        return np.log(np.maximum(array, 1e-300)) if self.found.model.parameters[at].log else array

    def _tried(self, at: int, side: float, look: FloatArray) -> FloatArray:
        """Values at which the profile is looked at, within the bounds, nearest first."""
        parameter, best = self.found.model.parameters[at], float(self.found.values[at])
        std = float(self.found.std[at])
        tried = _looked_at(parameter, best, std, side, look)
        bound = parameter.low if side < 0 else parameter.high
        if not parameter.log and np.isfinite(bound) and abs(bound - best) < look[-1] * std:
            tried = best + (bound - best) * _SHARES  # the bound is nearer than what is to be looked at
        inside = tried[(tried > parameter.low) & (tried < parameter.high)]
        if inside.size < tried.size and np.isfinite(bound) and best != bound and not parameter.log:
            inside = np.append(inside, bound)
        order = np.unique(inside)
        return order if side > 0 else order[::-1]

    def _chi2(self, at: int, tried: FloatArray) -> FloatArray:
        """Chi-square with a parameter held and the rest fitted anew, from where a Gaussian would have it."""
        model, best, symbols = self.found.model, self.found.values, self.found.model.symbols
        starts = self._leaning(at, tried)
        follows = {name: factor for name, (partner, factor) in self.tied.items() if partner == symbols[at]}
        starts[:, at] = tried
        for name, factor in follows.items():
            starts[:, symbols.index(name)] = factor * tried
        for name in self.fixed:
            starts[:, symbols.index(name)] = best[symbols.index(name)]
        held = [*self.fixed, symbols[at], *follows]
        tied = {name: tie for name, tie in self.tied.items() if name not in follows}
        data = _repeated(self.data, tried.size)
        if len(held) + len(tied) == len(symbols):  # nothing is left to fit
            return _misfit(model, data, starts)
        first = fit(model, data, starts, fixed=held, tied=tied)
        if len(symbols) - len(held) - len(tied) < _BENT:
            return np.asarray(first.chi2)
        others = self._other_starts(first, tried.size)
        for other in others:
            for name in held:
                other[:, symbols.index(name)] = starts[:, symbols.index(name)]
        chi2 = [fit(model, data, other, fixed=held, tied=tied).chi2 for other in others]
        return np.asarray(np.min([first.chi2, *chi2], axis=0))

    def _leaning(self, at: int, tried: FloatArray) -> FloatArray:
        """Starts (T, P): the parameters where a Gaussian would have them, one of them having the values tried."""
        best, covariance = self.found.values, self.found.covariance
        low = np.array([one.low for one in self.found.model.parameters])
        high = np.array([one.high for one in self.found.model.parameters])
        lean = covariance[:, at] / covariance[at, at] if covariance[at, at] > 0 else np.zeros(best.size)
        starts = np.clip(
            best + np.outer(tried - best[at], lean), np.maximum(low, 0.2 * best), np.minimum(high, 5 * best)
        )
        return np.where((lean == 0) | (best <= 0), best, starts)

    def _other_starts(self, first: Fit, count: int) -> list[FloatArray]:
        """Starts (count, P) along a bent valley: the fit of the nearer neighbour; fresh ones if the best is astray."""
        others = [np.concatenate([self.found.values[None], first.values[:-1]])]
        if self._astray:
            fresh = starts_of(self.found.model, self.data, _FRESH)
            others += [np.repeat(one[None], count, axis=0) for one in fresh]
        return others

    @property
    def _astray(self) -> bool:
        """Whether the best lies so far out that no way leads back from it."""
        logs = np.array([one.log for one in self.found.model.parameters])
        relative = np.divide(self.found.std, self.found.values, out=np.zeros(logs.size), where=self.found.values != 0)
        return bool(np.any(self.found.on_bound) or np.any(relative[logs] > _UNSURE))


def _looked_at(parameter: Parameter, best: float, std: float, side: float, look: FloatArray) -> FloatArray:
    """Values at multiples of the standard uncertainty to one side, by the logarithm where it is searched so."""
    if parameter.log and best > 0:
        step = min(std / best, 1.0) if std > 0 else 1.0
        return np.asarray(best * np.exp(side * np.minimum(look * step, _FARTHEST)))
    return best + side * look * (std if std > 0 else 0.1 * (abs(best) or parameter.default or 1.0))


def _misfit(model: Model, data: StiffnessData, values: FloatArray) -> FloatArray:
    """Chi-square of given parameters (B, P) on conditions (B,)."""
    off = data.stiffness - model.stiffness(values, data.omega)
    chi2 = np.sum(data.whitened(data.whitener(), off[..., None])[..., 0] ** 2, axis=-1)
    if not model.rests:
        return np.asarray(chi2)
    at_rest = (data.k1 - model.static_stiffness(values)) / data.k1_std
    return np.asarray(chi2 + np.nan_to_num(at_rest) ** 2)


def _repeated(data: StiffnessData, count: int) -> StiffnessData:
    """One condition, several times."""
    return StiffnessData(
        data.omega,
        np.broadcast_to(data.stiffness, (count, *data.stiffness.shape)),
        np.broadcast_to(data.covariance, (count, *data.covariance.shape)),
        np.broadcast_to(data.k1, (count,)),
        np.broadcast_to(data.k1_std, (count,)),
    )
