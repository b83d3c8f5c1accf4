r"""Smooth curves of K* over frequency: which tests do not lie on the curve of their condition, and on which they lie.

For each condition :math:`\ln K^*` is a polynomial of :math:`\ln f`; the curves of a specimen share their bend. Errors
that all tests share are smooth in other variables, as :math:`1/(1 - V_2/V_1)` for gains and phases, and are fitted
along. Each test is compared with the curve of the others.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fourpole.core import stats
from fourpole.core.arrays import BoolArray, ByValue, ComplexArray, FloatArray
from fourpole.core.confidence import SEARCH_CHANCE
from fourpole.core.nested import Nested, NestedFit, nested_fit

#: Frequencies of a condition that its own slope needs, its own bend, and the bend's own slope.
_POWERS = (3, 5, 8)
#: Least excess of tests over unknowns; if it is small, the limit of the statistic is wide.
_FEWEST = 3
#: Departures below this share of K* are no fault of a test.
_LEAST = 0.01
_PASSES = 30
#: A test is judged only if at least this share of its departure remains in the fit of all tests.
_LEAST_LEFT = 1e-3
#: Residual over its median size below which a test is first taken as good.
_GOOD = 4.0
#: Relative distance of equal frequencies, and the difference of two tests there over their departure from the curve,
#: below which one repeats the other.
_SAME, _ALIKE = 0.01, 0.2
#: Relative distance beyond the measured frequencies to which a curve reaches.
_REACH = 0.03
_MEDIAN = 1.1774  # median modulus of two normal numbers of variance 1


@dataclass(frozen=True, eq=False)
class Samples(ByValue):
    """K* of N tests and what it may depend on.

    Attributes
    ----------
    stiffness : (N,) complex array [N/m]
        K* of each test by itself.
    noise : (N,) float array [1]
        Standard uncertainty of the real and of the imaginary part of ln K* from the noise.
    frequency : (N,) float array [Hz]
    family, specimen : (N,) int arrays
        Number of the condition without frequency, and of the specimen.
    shared : (N, M) complex array
        Variables in which the errors that all tests share are smooth.
    prior : (M,) float array
        Standard uncertainties of the coefficients of `shared`.
    """

    stiffness: ComplexArray
    noise: FloatArray
    frequency: FloatArray
    family: np.ndarray
    specimen: np.ndarray
    shared: ComplexArray
    prior: FloatArray


@dataclass(frozen=True, eq=False)
class Curves(ByValue):
    """The curves, and the tests that do not lie on them.

    Attributes
    ----------
    samples : Samples
    judged : (N,) bool array
        False for tests of conditions with too few frequencies, and for tests without which a curve is unknown.
    off : (N,) complex array [1]
        Departure of ln K* from the curve of the other tests of its condition.
    statistic, limit : (N,) float array, float [1]
        Squared departure over its variance, and its limit: a departure beyond it is not chance.
    strange : (N,) bool array
        True for tests beyond the limit.
    """

    samples: Samples
    judged: BoolArray
    off: ComplexArray
    statistic: FloatArray
    limit: float
    strange: BoolArray
    _design: _Design
    _solution: _Solution

    def distance(self, test: int, family: int) -> float:
        """Statistic of a strange test against the curve of another condition; infinite beyond its frequencies."""
        data = self.samples
        reached = np.log(data.frequency[(data.family == family) & ~self.strange & self.judged])
        place = np.log(data.frequency[test])
        if reached.size < _POWERS[0] or not reached.min() - _REACH <= place <= reached.max() + _REACH:
            return float("inf")
        alone = np.array([test])
        row = self._design.rows(data, alone, np.array([family]))
        off = np.log(data.stiffness[alone]) - self._solution.fit.predicted(row)
        if abs(off[0]) <= _LEAST:
            return 0.0
        return float(self._solution.distances(off, self._solution.fit.levers(row), data.noise[alone])[0])


class _Design:
    """Rows of the linear model: powers of each condition, a bend of each specimen, shared errors."""

    def __init__(self, data: Samples, used: BoolArray) -> None:
        self._middle = float(np.mean(np.log(data.frequency[used])))
        self._families = np.unique(data.family[used])
        rows = [used & (data.family == family) for family in self._families]
        frequencies = [_distinct(data.frequency[flags]) for flags in rows]
        self._powers = np.array([1 + sum(count >= fewest for fewest in _POWERS) for count in frequencies])
        specimens, self._specimen = np.unique([data.specimen[flags][0] for flags in rows], return_inverse=True)
        self._top = np.zeros(specimens.size, dtype=int)
        np.maximum.at(self._top, self._specimen, self._powers)
        self.size = int(self._powers.sum()) + specimens.size + data.prior.size

    def rows(self, data: Samples, tests: np.ndarray, family: np.ndarray) -> Nested:
        """The rows of some tests, as if they were of these conditions."""
        number = np.searchsorted(self._families, family)
        place = (np.log(data.frequency[tests]) - self._middle)[:, None]
        power = np.arange(int(self._powers.max()))
        own = np.where(power < self._powers[number][:, None], place**power, 0.0)
        bend = place[:, 0] ** self._top[self._specimen[number]]
        return Nested(own, bend, data.shared[tests], number, self._specimen)


@dataclass(frozen=True, eq=False)
class _Solution:
    """Least-squares solution with the scatter of the real and the imaginary part, and its degrees of freedom."""

    fit: NestedFit
    scale: FloatArray
    dof: float

    def distances(
        self, off: ComplexArray, lever: FloatArray, noise: FloatArray, inside: FloatArray | float = 0.0
    ) -> FloatArray:
        """Half the squared departures over their variance [1]; `inside` is the weight of each test in the fit."""
        own = noise**2 / float(np.mean(self.scale**2))
        spread = 1.0 + own + lever / np.maximum(1.0 - inside * lever, 1e-9)
        parts = np.stack([off.real, off.imag]) / self.scale[:, None]
        return np.asarray(0.5 * np.sum(parts**2, axis=0) / spread)


def curves_of(data: Samples) -> Curves | None:
    """The curves of some tests; None if there are too few."""
    used = np.isfinite(data.stiffness) & (data.stiffness != 0) & np.isfinite(data.noise)
    used &= np.isfinite(data.shared).all(axis=1)
    for family in np.unique(data.family):
        rows = used & (data.family == family)
        if _distinct(data.frequency[rows]) < _POWERS[0]:
            used[rows] = False
    if not used.any():
        return None
    design = _Design(data, used)
    if np.sum(used) < design.size - data.prior.size + _FEWEST:
        return None
    tests = np.flatnonzero(used)
    model = _Model(
        design.rows(data, tests, data.family[tests]), np.log(data.stiffness[tests]), data.noise[tests], data.prior
    )
    good, curves = _first_good(model, design.size), None
    for _ in range(_PASSES):
        solution = _solved(model, good)
        if solution is None:
            return None
        curves = _judged(data, tests, design, model, solution, good)
        still = ~curves.strange[tests]
        if np.array_equal(good, still):
            break
        good = still
    return curves


def _judged(
    data: Samples, tests: np.ndarray, design: _Design, model: _Model, solution: _Solution, good: BoolArray
) -> Curves:
    """The verdicts on all tests: each used one is held against the curve of the others."""
    rest, lever = model.logs - solution.fit.predicted(model.rows), solution.fit.levers(model.rows)
    weight = np.where(good, 1.0 / (1.0 + model.noise**2 / float(np.mean(solution.scale**2))), 0.0)
    left = 1.0 - weight * lever
    known = left >= _LEAST_LEFT  # the others give a curve
    departure = np.where(known, rest / np.where(known, left, 1.0), 0.0)
    count = data.frequency.size
    off, statistic, judged = np.zeros(count, dtype=complex), np.zeros(count), np.zeros(count, dtype=bool)
    off[tests], judged[tests] = departure, known
    statistic[tests] = np.where(known, solution.distances(departure, lever, model.noise, weight), 0.0)
    limit = float(stats.f.isf(SEARCH_CHANCE / max(int(np.sum(judged)), 1), 2, solution.dof))
    strange = judged & (statistic > limit) & (np.abs(off) > _LEAST) & ~_repeated(data, off)
    return Curves(data, judged, off, statistic, limit, strange, design, solution)


def _repeated(data: Samples, off: ComplexArray) -> BoolArray:
    """Tests that another one of the same condition and frequency repeats: the curve is not that of the specimen."""
    order = np.lexsort((data.frequency, data.family))
    first, second = order[:-1], order[1:]
    same = data.family[first] == data.family[second]
    same &= data.frequency[second] < (1 + _SAME) * data.frequency[first]
    first, second = first[same], second[same]
    alike = np.abs(off[first] - off[second]) < _ALIKE * np.minimum(np.abs(off[first]), np.abs(off[second]))
    found = np.zeros(off.size, dtype=bool)
    found[first[alike]] = found[second[alike]] = True
    return found


def _distinct(frequencies: FloatArray) -> int:
    """Number of frequencies that differ by more than 2 %."""
    return 1 + int(np.sum(np.diff(np.log(np.sort(frequencies))) > 0.02)) if frequencies.size else 0


@dataclass(frozen=True, eq=False)
class _Model:
    """The used tests: rows of the design, ln K*, its noise, and the standard uncertainties of the shared errors."""

    rows: Nested
    logs: ComplexArray
    noise: FloatArray
    prior: FloatArray

    def fit(self, weights: FloatArray, scale: float) -> NestedFit:
        """Weighted least squares with the priors of the shared errors."""
        return nested_fit(self.rows, self.logs, weights, (scale / self.prior) ** 2)


def _first_good(model: _Model, unknowns: int) -> BoolArray:
    """The tests near the curves with the least sum of absolute residuals, on which single tests have little weight."""
    count = model.logs.size
    weights, size = np.ones(count), np.ones(count)
    for _ in range(_PASSES):
        size = np.abs(model.logs - model.fit(weights, _LEAST).predicted(model.rows))
        weights = 1.0 / np.maximum(size, max(0.1 * float(np.median(size)), 1e-12))
        weights *= count / np.sum(weights)
    usual = float(np.median(size)) * np.sqrt(count / max(count - unknowns, 1)) / _MEDIAN
    return np.asarray(size < np.maximum(_GOOD * np.hypot(usual, model.noise), _LEAST))


def _solved(model: _Model, good: BoolArray) -> _Solution | None:
    """Fit of the good tests, with the scatter of the real and of the imaginary part; None if there are too few."""
    scale = np.full(2, _LEAST)
    for _ in range(_PASSES):
        size = float(np.sqrt(np.mean(scale**2)))
        weights = good / (1.0 + (model.noise / size) ** 2)
        fit = model.fit(weights, size)
        # A shared error whose prior is narrow takes up less than one degree of freedom.
        dof = float(np.sum(good) - np.sum(weights * fit.levers(model.rows)))
        if dof < _FEWEST:
            return None
        rest = model.logs - fit.predicted(model.rows)
        new = np.sqrt(np.array([np.sum(weights * part**2) for part in (rest.real, rest.imag)]) / dof)
        settled = np.allclose(new, scale, rtol=1e-3)
        scale = np.maximum(new, 1e-9)
        if settled:
            break
    return _Solution(fit, scale, dof)
