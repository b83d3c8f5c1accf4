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
        row = self._design.row(data, test, family)
        off = complex(np.log(data.stiffness[test]) - row @ self._solution.coefficients)
        return self._solution.distance(off, row, data.noise[test]) if abs(off) > _LEAST else 0.0


class _Design:
    """Columns of the linear model: powers of each condition, a bend of each specimen, shared errors."""

    def __init__(self, data: Samples, used: BoolArray) -> None:
        self._middle = float(np.mean(np.log(data.frequency[used])))
        self._columns: list[tuple[str, int, int]] = []
        top: dict[int, int] = {}
        for family in np.unique(data.family[used]).tolist():
            rows = used & (data.family == family)
            powers = 1 + sum(_distinct(data.frequency[rows]) >= fewest for fewest in _POWERS)
            self._columns += [("family", family, power) for power in range(powers)]
            specimen = int(data.specimen[rows][0])
            top[specimen] = max(top.get(specimen, 0), powers)
        self._columns += [("specimen", specimen, power) for specimen, power in top.items()]
        self.size = len(self._columns)

    def row(self, data: Samples, test: int, family: int) -> ComplexArray:
        """The columns of one test, as if it were of a condition."""
        place = np.log(data.frequency[test]) - self._middle
        specimen = int(data.specimen[np.flatnonzero(data.family == family)[0]])
        own = {"family": family, "specimen": specimen}
        values = [place**power if own[kind] == number else 0.0 for kind, number, power in self._columns]
        return np.concatenate([np.array(values, dtype=complex), data.shared[test]])

    def matrix(self, data: Samples) -> ComplexArray:
        """The columns of all tests; zeros for tests of other conditions."""
        return np.stack([self.row(data, i, int(data.family[i])) for i in range(data.frequency.size)])


@dataclass(frozen=True, eq=False)
class _Solution:
    """Least-squares solution: coefficients, their covariance in units of the scatter, the scatter and its dof."""

    coefficients: ComplexArray
    inverse: ComplexArray
    scale: FloatArray
    dof: float

    def distance(self, off: complex, row: ComplexArray, noise: float, *, inside: float = 0.0) -> float:
        """Half the squared departure over its variance [1]; `inside` is the weight that the test had in the fit."""
        lever = float(np.real(row @ self.inverse @ row.conj()))
        own = noise**2 / float(np.mean(self.scale**2))
        spread = 1.0 + own + (lever if inside == 0.0 else lever / max(1.0 - inside * lever, 1e-9))
        parts = np.array([off.real, off.imag]) / self.scale
        return float(0.5 * parts @ parts / spread)


def curves_of(data: Samples) -> Curves | None:
    """The curves of some tests; None if there are too few."""
    used = np.isfinite(data.stiffness) & (data.stiffness != 0) & np.isfinite(data.noise)
    for family in np.unique(data.family):
        rows = used & (data.family == family)
        if _distinct(data.frequency[rows]) < _POWERS[0]:
            used[rows] = False
    if not used.any():
        return None
    design = _Design(data, used)
    if np.sum(used) < design.size + _FEWEST:
        return None
    matrix, logs = design.matrix(data), np.log(np.where(used, data.stiffness, 1.0))
    good, found = _first_good(matrix, logs, used, data), None
    for _ in range(_PASSES):
        solution = _solved(matrix, logs, good, data)
        if solution is None:
            return None
        off, statistic, judged = _departures(matrix, logs, good, used, data, solution)
        limit = float(stats.f.isf(SEARCH_CHANCE / max(int(np.sum(judged)), 1), 2, solution.dof))
        strange = judged & (statistic > limit) & (np.abs(off) > _LEAST)
        found = Curves(data, judged, off, statistic, limit, strange, design, solution)
        if np.array_equal(good, used & ~strange):
            break
        good = used & ~strange
    return found


def _distinct(frequencies: FloatArray) -> int:
    """Number of frequencies that differ by more than 2 %."""
    return 1 + int(np.sum(np.diff(np.log(np.sort(frequencies))) > 0.02)) if frequencies.size else 0


def _weighted(matrix: ComplexArray, logs: ComplexArray, weights: FloatArray, data: Samples, scale: float) -> _Solution:
    """Weighted least squares with the priors of the shared errors; scale and dof are filled in later."""
    normal = matrix.conj().T @ (weights[:, None] * matrix)
    own = matrix.shape[1] - data.prior.size
    normal[np.arange(own, matrix.shape[1]), np.arange(own, matrix.shape[1])] += (scale / data.prior) ** 2
    inverse = np.linalg.pinv(normal, rcond=1e-12, hermitian=True)
    return _Solution(inverse @ (matrix.conj().T @ (weights * logs)), inverse, np.ones(2), 1.0)


def _first_good(matrix: ComplexArray, logs: ComplexArray, used: BoolArray, data: Samples) -> BoolArray:
    """The tests near the curves with the least sum of absolute residuals, on which single tests have little weight."""
    weights = used.astype(float)
    size = np.ones(used.size)
    for _ in range(_PASSES):
        size = np.abs(logs - matrix @ _weighted(matrix, logs, weights, data, _LEAST).coefficients)
        floor = max(0.1 * float(np.median(size[used])), 1e-12)
        weights = used / np.maximum(size, floor)
        weights *= np.sum(used) / np.sum(weights)
    usual = float(np.median(size[used])) * np.sqrt(np.sum(used) / max(np.sum(used) - matrix.shape[1], 1)) / _MEDIAN
    return np.asarray(used & (size < np.maximum(_GOOD * np.hypot(usual, data.noise), _LEAST)))


def _solved(matrix: ComplexArray, logs: ComplexArray, good: BoolArray, data: Samples) -> _Solution | None:
    """Fit of the good tests, with the scatter of the real and of the imaginary part; None if there are too few."""
    noise = np.where(np.isfinite(data.noise), data.noise, 0.0)
    scale = np.full(2, _LEAST)
    for _ in range(_PASSES):
        one = float(np.sqrt(np.mean(scale**2)))
        weights = good / (1.0 + (noise / one) ** 2)
        found = _weighted(matrix, logs, weights, data, one)
        # A shared error whose prior is narrow takes up less than one degree of freedom.
        taken = np.sum(weights[:, None] * (matrix @ found.inverse) * matrix.conj()).real
        dof = float(np.sum(good) - taken)
        if dof < _FEWEST:
            return None
        rest = logs - matrix @ found.coefficients
        new = np.sqrt(np.array([np.sum(weights * part**2) for part in (rest.real, rest.imag)]) / dof)
        settled = np.allclose(new, scale, rtol=1e-3)
        scale = np.maximum(new, 1e-9)
        if settled:
            break
    return _Solution(found.coefficients, found.inverse, scale, dof)


def _departures(
    matrix: ComplexArray,
    logs: ComplexArray,
    good: BoolArray,
    used: BoolArray,
    data: Samples,
    solution: _Solution,
) -> tuple[ComplexArray, FloatArray, BoolArray]:
    """Departure of each test from the curve of the others, its statistic, and whether the others give a curve."""
    rest = logs - matrix @ solution.coefficients
    off, statistic, judged = np.zeros(used.size, dtype=complex), np.zeros(used.size), np.zeros(used.size, dtype=bool)
    mean = float(np.mean(solution.scale**2))
    for i in np.flatnonzero(used):
        weight = 1.0 / (1.0 + data.noise[i] ** 2 / mean) if good[i] else 0.0
        left = 1.0 - weight * float(np.real(matrix[i] @ solution.inverse @ matrix[i].conj()))
        if left < _LEAST_LEFT:
            continue
        judged[i], off[i] = True, rest[i] / left
        statistic[i] = solution.distance(off[i], matrix[i], data.noise[i], inside=weight)
    return off, statistic, judged
