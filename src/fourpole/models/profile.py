r"""Profile-likelihood intervals of parameters; they hold for nonlinear models and for one-sided intervals, too.

The profile of a parameter is the least chi-square over all other parameters, as a function of its value. The interval
of probability :math:`P(\chi^2_1 < q)` ends where the profile is :math:`q` above its minimum.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from fourpole.core import stats
from fourpole.core.arrays import BoolArray, FloatArray
from fourpole.core.confidence import COVERAGE, NORMAL_95
from fourpole.errors import ModelError
from fourpole.models.choice import STOPPED
from fourpole.models.data import StiffnessData, stacked
from fourpole.models.fit import Fit, linear_problem, searches
from fourpole.models.nonnegative import NonNegative, whitened_conditions
from fourpole.models.problem import free_places, problem_of, starts_of

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
#: Largest product of the cube of the free parameters and the frequencies for intervals by profile likelihood.
_MOST_WORK = 600_000
#: Largest product of conditions, the square of the free parameters and the frequencies of profiles in one batch.
_TOGETHER = 20_000
_INSTEAD = "their intervals are from the covariance"


def profile_intervals(
    found: Fit, data: StiffnessData, level: float = COVERAGE, *, fixed: Mapping[str, float] | Sequence[str] = ()
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
    fixed
        The fixed parameters of the fit.

    Returns
    -------
    (P, 2) float array
        Ends of the intervals in the units of the parameters: the bound of the parameter where the data set no end, the
        value twice for a fixed parameter.

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
    >>> from fourpole.models.fit import fit
    >>> from fourpole.models.springs import Spring
    >>> data = StiffnessData.of([60.0, 90.0], [180e3 + 0j, 180e3 + 0j], 1e3)
    >>> profile_intervals(fit(Spring(), data, [180e3]), data).round(-1).tolist()
    [[178610.0, 181390.0]]
    """
    if found.values.ndim > 1:
        raise ModelError("profile intervals are for one condition at a time: choose one")
    return profiles_together([found], [data], level, fixed=fixed)[0]


def profiles_together(
    fits: Sequence[Fit],
    data: Sequence[StiffnessData],
    level: float = COVERAGE,
    *,
    fixed: Mapping[str, float] | Sequence[str] = (),
) -> list[FloatArray]:
    """Profile-likelihood intervals (P, 2) of the fits of one model to several conditions, in their order.

    The values of `profile_intervals` for each, but the profiles of all conditions, parameters and sides are searched
    side by side.
    """
    rise = float(np.sqrt(stats.chi2.ppf(level, 1)))
    if fits[0].model.linear:
        return [_nonnegative_intervals(one, row, rise, fixed) for one, row in zip(fits, data, strict=True)]
    ends = [np.stack([one.values, one.values], axis=1) for one in fits]
    plain = [replace(one, relative=None, reference=None, recorded=None) for one in data]
    for places, group in stacked(plain):
        for (which, at, side), end in _ends_of(_Profiles([fits[one] for one in places], group, fixed), rise):
            ends[places[which]][at, side] = end
    return ends


def intervals(
    fits: Sequence[Fit],
    data: Sequence[StiffnessData],
    fixed: Sequence[str],
    step: Callable[[], None],
    *,
    shared: bool,
    stopped: bool,
) -> tuple[tuple[FloatArray, ...], list[str], bool]:
    """95 % intervals (P, 2) of each condition; sentences say which of them are not by profile likelihood, and why.

    Also whether the user stopped them, or `stopped` the fits before.

    Intervals of fits that share parameters, and those after a stop, are from the covariance.
    """
    model, why = fits[0].model, []
    free = len(model.parameters) - len(fixed)
    ends = [normal_ends(one) for one in fits]
    long = [not model.linear and free**3 * row.count > _MOST_WORK for row in data]
    if any(long) and not (shared or stopped):
        why = [f"{free} free parameters are too many for profile likelihood: {_INSTEAD}"]
    wanted = [] if shared else [at for at, one in enumerate(long) if not one]
    try:
        for at, one in _profiled(fits, data, fixed, [] if stopped else wanted):
            ends[at] = one
            step()
    except KeyboardInterrupt:
        stopped = True
    for _ in range(len(fits) - len(wanted)):
        step()
    if stopped:
        why.append(f"Profile likelihood was {STOPPED}: intervals that it lacks are from the covariance")
    return tuple(ends), why, stopped


def _profiled(
    fits: Sequence[Fit], data: Sequence[StiffnessData], fixed: Sequence[str], wanted: Sequence[int]
) -> Iterator[tuple[int, FloatArray]]:
    """The places of the wanted conditions, each with its intervals by profile likelihood, batch by batch."""
    model = fits[0].model
    free = len(model.parameters) - len(fixed)
    together = max(_TOGETHER // (free**2 * max(row.count for row in data)), 1)
    for first in range(0, len(wanted), together):
        places = wanted[first : first + together]
        rows = [data[at].at(model.on(data[at]).stiffness(fits[at].values, data[at].omega)) for at in places]
        yield from zip(places, profiles_together([fits[at] for at in places], rows, fixed=fixed), strict=True)


def normal_ends(found: Fit) -> FloatArray:
    """95 % intervals (P, 2) for a normal distribution of the linked parameters; of a linear model, of its own."""
    if found.model.linear:
        half = NORMAL_95 * found.std
        return np.stack([np.maximum(found.values - half, 0.0), found.values + half], axis=-1)
    linked = found.model.link(found.values)
    _, slopes = found.model.unlink(linked)
    half = np.divide(NORMAL_95 * found.std, slopes, out=np.zeros_like(linked), where=slopes > 0)
    ends = np.stack([found.model.unlink(linked + side * half)[0] for side in (-1, 1)], axis=-1)
    return np.where(found.on_bound[:, None], np.stack(found.model.bounds, axis=-1), ends)


def _nonnegative_intervals(found: Fit, data: StiffnessData, rise: float, fixed: Collection[str]) -> FloatArray:
    """Profile-likelihood intervals (P, 2) of the parameters of a linear model fitted to one condition.

    The interval of a parameter at zero is one-sided: from zero to the value at which chi-square has risen by `rise`
    squared, all other parameters fitted anew.
    """
    free, (condition,) = free_places(found.model, fixed), whitened_conditions(data)
    rows, target = linear_problem(found.model, condition, found.values, free)
    ends = np.stack([found.values, found.values], axis=1)
    best = NonNegative(rows, target, found.values[free], float(found.chi2))
    ends[free] = best.profiles(np.arange(free.size), found.std[free], rise)
    return ends


#: Places of a condition, a parameter and a side.
_Key = tuple[int, int, int]


def _ends_of(profiles: _Profiles, rise: float) -> Iterator[tuple[_Key, float]]:
    """The ends of all intervals, each with the places of its condition, parameter and side."""
    every = {
        (which, at, side): _Profile(one, at, 2 * side - 1)
        for which, one in enumerate(profiles.fits)
        for at in profiles.at_free
        for side in (0, 1)
    }

    def evaluate(wanted: Mapping[_Key, FloatArray]) -> None:
        for key, heights in profiles.heights({key: one for key, one in wanted.items() if one.size}, rise).items():
            every[key].extend(wanted[key], heights)

    for distances in (_NEAR, _FAR):
        evaluate({key: one.values(distances) for key, one in every.items() if one.heights[-1] < rise})
    ended = {key: one for key, one in every.items() if one.heights[-1] >= rise}
    evaluate({key: one.between(rise) for key, one in ended.items()})
    for key, one in every.items():
        yield key, one.crossing(rise) if key in ended else one.bound


class _Profile:
    """The profile of one parameter of a fit to one side of its best value, as far as it is known.

    A place is a value of the parameter, or its logarithm if `Parameter.log` is set. A height is the square root of the
    rise of the profile above its minimum.
    """

    def __init__(self, found: Fit, at: int, side: int) -> None:
        self.parameter, self.side = found.model.parameters[at], side
        self.best, self.std = float(found.values[at]), float(found.std[at])
        self.places, self.heights = np.atleast_1d(self._place(self.best)), np.zeros(1)

    @property
    def bound(self) -> float:
        """The bound of the parameter on this side."""
        return self.parameter.low if self.side < 0 else self.parameter.high

    def extend(self, values: FloatArray, heights: FloatArray) -> None:
        """Take the heights at further values; no height exceeds one beyond it, as in a local minimum."""
        every = np.append(self.heights, heights)
        self.places = np.append(self.places, self._place(values))
        self.heights = np.minimum.accumulate(every[::-1])[::-1]

    def between(self, rise: float) -> FloatArray:
        """Values up to the first at which the profile has risen; none if the last step was small."""
        to = int(np.flatnonzero(self.heights >= rise)[0])
        if self.heights[to] - self.heights[to - 1] <= _COARSE:
            return np.empty(0)
        found = self._value(np.linspace(self.places[to - 1], self.places[to], _BETWEEN + 2)[1:])
        self.places, self.heights = self.places[:to], self.heights[:to]
        return found

    def crossing(self, rise: float) -> float:
        """The value at which the height of the profile is `rise`."""
        above = np.flatnonzero(self.heights >= rise)
        to = int(above[0]) if above.size else self.heights.size - 1
        share = (rise - self.heights[to - 1]) / max(self.heights[to] - self.heights[to - 1], 1e-300)
        before = self.places[to - 1]
        return float(self._value(before + min(share, 1.0) * (self.places[to] - before)))

    def _value(self, place: ArrayLike) -> FloatArray:
        """Values of the parameter, from its places."""
        array = np.asarray(place, dtype=float)
        return np.exp(array) if self.parameter.log else array

    def _place(self, values: ArrayLike) -> FloatArray:
        """Places of the parameter, from its values."""
        array = np.asarray(values, dtype=float)
        return np.log(np.maximum(array, 1e-300)) if self.parameter.log else array

    def values(self, distances: FloatArray) -> FloatArray:
        """Values within the bounds at distances from the best one in standard uncertainties, the nearest first.

        The distances of a logarithmic parameter are in ln.
        """
        parameter, best, std = self.parameter, self.best, self.std
        if parameter.log and best > 0:
            step = min(std / best, 1.0) if std > 0 else 1.0
            values = best * np.exp(self.side * np.minimum(distances * step, _FARTHEST))
        else:
            usual = 0.1 * (abs(best) or parameter.default or 1.0)
            values = best + self.side * distances * (std if std > 0 else usual)
        if not parameter.log and np.isfinite(self.bound) and abs(self.bound - best) < distances[-1] * std:
            values = best + (self.bound - best) * _SHARES
        inside = values[(values > parameter.low) & (values < parameter.high)]
        if inside.size < values.size and np.isfinite(self.bound) and best != self.bound and not parameter.log:
            inside = np.append(inside, self.bound)
        order = np.unique(inside)
        return order if self.side > 0 else order[::-1]


class _Profiles:
    """Fits of one model to conditions (C, N), whose profiles are searched in one batch."""

    def __init__(self, fits: Sequence[Fit], data: StiffnessData, fixed: Collection[str]) -> None:
        self.fits, self.data, self.model = fits, data, fits[0].model
        self.best = np.stack([one.values for one in fits])
        self.least = np.array([float(one.chi2) for one in fits])
        self.problem = problem_of(self.model, data, self.best, [*fixed])
        self.at_free = self.problem.free.tolist()

    def heights(self, wanted: Mapping[_Key, FloatArray], rise: float) -> dict[_Key, FloatArray]:
        """Heights (T,) of the profiles at the wanted values (T,) of their parameters, to find where one is `rise`."""
        if not wanted:
            return {}
        sizes = np.array([values.size for values in wanted.values()])
        rows = np.repeat([which for which, _, _ in wanted], sizes)
        found = np.sqrt(np.maximum(self._chi2(wanted, rows, sizes, rise) - self.least[rows], 0.0))
        return dict(zip(wanted, np.split(found, np.cumsum(sizes)[:-1]), strict=True))

    def _chi2(self, wanted: Mapping[_Key, FloatArray], rows: np.ndarray, sizes: np.ndarray, rise: float) -> FloatArray:
        """Least chi-square (R,) for each of the wanted values, over all other parameters.

        Where the height is below `rise` at the next value too, one start is enough.
        """
        starts = np.concatenate([self._gaussian_starts(which, at, values) for (which, at, _), values in wanted.items()])
        at = np.repeat([at for _, at, _ in wanted], sizes)
        pinned = self.problem.free == at[:, None]
        held = ~np.isin(np.arange(starts.shape[1]), self.problem.free)

        def least(some: np.ndarray, begins: FloatArray) -> tuple[FloatArray, FloatArray]:
            """Values and chi-square of some of the rows, from these starts with the wanted parameters."""
            begins = np.where(held, self.best[rows[some]], begins)
            begins[np.arange(some.size), at[some]] = starts[some, at[some]]
            found = [
                (one.values_of(place), np.sum(one.residuals(place) ** 2, axis=1))
                for one, place, _ in searches(self.problem, rows[some], begins, pinned[some])
            ]
            return np.concatenate([values for values, _ in found]), np.concatenate([squares for _, squares in found])

        lowest, chi2 = least(np.arange(rows.size), starts)
        if len(self.at_free) - 1 < _FROM_SEVERAL:
            return chi2
        below, ends = chi2 < self.least[rows] + rise**2, np.cumsum(sizes)
        needed = ~(below & np.roll(below, -1))  # the interval ends beyond the next value
        needed[ends - 1] = True
        kept, some = np.flatnonzero(needed), np.flatnonzero(needed & self._uncertain[rows])
        if some.size:
            fresh = least(np.tile(some, _FRESH), np.concatenate(self._fresh_starts[:, rows[some]]))
            for values, tried in zip(*(np.split(one, _FRESH) for one in fresh), strict=True):
                better = tried < chi2[some]
                chi2[some[better]], lowest[some[better]] = tried[better], values[better]
        neighbours = np.roll(lowest, 1, axis=0)
        neighbours[ends - sizes] = self.best[rows[ends - sizes]]
        chi2[kept] = np.minimum(chi2[kept], least(kept, neighbours[kept])[1])
        return chi2

    def _gaussian_starts(self, which: int, at: int, values: FloatArray) -> FloatArray:
        """Starts (T, P): conditional means of a normal distribution of the parameters, given values of one of them."""
        found = self.fits[which]
        best, covariance = found.values, found.covariance
        low, high = self.model.bounds
        slope = covariance[:, at] / covariance[at, at] if covariance[at, at] > 0 else np.zeros(best.size)
        means = best + np.outer(values - best[at], slope)
        starts = np.clip(means, np.maximum(low, 0.2 * best), np.minimum(high, 5 * best))
        starts = np.where((slope == 0) | (best <= 0), best, starts)
        starts[:, at] = values
        return starts

    @cached_property
    def _fresh_starts(self) -> FloatArray:
        """Starts (S, C, P) that do not depend on the best values."""
        return starts_of(self.model, self.data, _FRESH)

    @cached_property
    def _uncertain(self) -> BoolArray:
        """Whether a parameter is on a bound, or a logarithmic one has a large relative uncertainty, by condition."""
        logs = np.array([one.log for one in self.model.parameters])
        std = np.stack([one.std for one in self.fits])
        relative = np.divide(std, self.best, out=np.zeros(std.shape), where=self.best != 0)
        on_bound = np.stack([one.on_bound for one in self.fits]).any(axis=1)
        return np.asarray(on_bound | np.any(relative[:, logs] > _UNCERTAIN, axis=1))
