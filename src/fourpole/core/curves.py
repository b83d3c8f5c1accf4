r"""Smooth curves of K* over frequency: which tests do not lie on the curve of their condition, and on which they lie.

For each condition :math:`\ln K^*` is a polynomial of :math:`\ln f`; the curves of a specimen share their bend. Errors
that all tests share are smooth in other variables, as :math:`1/(1 - V_2/V_1)` for gains and phases, and are fitted
along. Each test is compared with the curve of the others.

The fit is least squares with nested unknowns: of each family (:math:`\alpha_f`), of each specimen that has families
(:math:`\beta_s`), and of all rows (:math:`\gamma`):

.. math:: y_i = x_i^\top \alpha_f + b_i \beta_s + z_i^\top \gamma

The unknowns of a family are eliminated first, then that of its specimen, so that the cost is linear in the number of
rows, and no matrix is larger than the unknowns of one family or of all rows.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fourpole.core import stats
from fourpole.core.arrays import BoolArray, ByValue, ComplexArray, FloatArray
from fourpole.core.confidence import SEARCH_CHANCE

#: Directions with less than this fraction of the largest weight are not determined; their unknowns are zero.
_UNDETERMINED = 1e-12


@dataclass(frozen=True, eq=False)
class Nested(ByValue):
    """Rows of a linear model with nested unknowns.

    Attributes
    ----------
    own : (N, P) float array
        Columns of the family; zero where a family has fewer unknowns.
    bend : (N,) float array
        Column of the specimen.
    common : (N, M) complex array
        Columns of all rows.
    family : (N,) int array
        Number of the family, from 0.
    specimen : (F,) int array
        Number of the specimen of each family, from 0.
    """

    own: FloatArray
    bend: FloatArray
    common: ComplexArray
    family: np.ndarray
    specimen: np.ndarray

    @cached_property
    def _order(self) -> tuple[np.ndarray, np.ndarray]:
        """Order of the rows by family, and the first row of each family in that order; each family has rows."""
        order = np.argsort(self.family, kind="stable")
        return order, np.searchsorted(self.family[order], np.arange(self.specimen.size))

    def of_families(self, values: np.ndarray) -> np.ndarray:
        """Sums of values (N, ...) over the rows of each family (F, ...)."""
        order, first = self._order
        return np.asarray(np.add.reduceat(values[order], first, axis=0))

    def of_specimens(self, values: np.ndarray) -> np.ndarray:
        """Sums of values (F, ...) over the families of each specimen (S, ...)."""
        order = np.argsort(self.specimen, kind="stable")
        first = np.searchsorted(self.specimen[order], np.arange(int(self.specimen.max()) + 1))
        return np.asarray(np.add.reduceat(values[order], first, axis=0))


@dataclass(frozen=True, eq=False)
class NestedFit(ByValue):
    """Weighted least-squares solution.

    Attributes
    ----------
    alpha, beta, gamma : (F, P), (S,), (M,) complex arrays
        Unknowns of the families, of the specimens and of all rows.
    inverse : (F, P, P) float array
        Inverse of the normal matrix of each family.
    by_bend, by_common : (F, P) float array, (F, P, M) complex array
        Change of `alpha` per unit of `beta` and of `gamma`, with opposite sign.
    of_bend, of_common : (S,) float array, (M, M) complex array
        Inverses of the normal matrices of `beta`, without the families, and of `gamma`, without both.
    bend_by_common : (S, M) complex array
        Change of `beta` per unit of `gamma`, with opposite sign.
    """

    alpha: ComplexArray
    beta: ComplexArray
    gamma: ComplexArray
    inverse: FloatArray
    by_bend: FloatArray
    by_common: ComplexArray
    of_bend: FloatArray
    of_common: ComplexArray
    bend_by_common: ComplexArray

    def predicted(self, rows: Nested) -> ComplexArray:
        """Values (N,) of the model."""
        alpha, beta = self.alpha[rows.family], self.beta[rows.specimen[rows.family]]
        return np.asarray(np.sum(rows.own * alpha, axis=1) + rows.bend * beta + rows.common @ self.gamma)

    def levers(self, rows: Nested) -> FloatArray:
        """Variance (N,) of `predicted` for data of unit variance over their weight."""
        family = rows.family
        specimen = rows.specimen[family]
        bend = rows.bend - np.sum(rows.own * self.by_bend[family], axis=1)
        common = rows.common - np.einsum("ip,ipm->im", rows.own, self.by_common[family])
        common = common - bend[:, None] * self.bend_by_common[specimen]
        of_family = np.einsum("ip,ipq,iq->i", rows.own, self.inverse[family], rows.own)
        of_all = np.sum((common @ self.of_common) * common.conj(), axis=1).real
        return np.asarray(of_family + bend**2 * self.of_bend[specimen] + of_all)


def nested_fit(rows: Nested, values: ComplexArray, weights: FloatArray, prior: FloatArray) -> NestedFit:
    """The unknowns with the least weighted sum of squares; `prior` (M,) is added to the normal matrix of `gamma`.

    Examples
    --------
    >>> rows = Nested(
    ...     np.ones((4, 1)), np.array([0.0, 1, 0, 1]), np.zeros((4, 1)), np.array([0, 0, 1, 1]), np.zeros(2, int)
    ... )
    >>> found = nested_fit(rows, np.array([1.0, 2, 5, 6]), np.ones(4), np.ones(1))
    >>> found.alpha[:, 0].round(9).real.tolist(), found.beta.round(9).real.tolist()
    ([1.0, 5.0], [1.0])
    """
    weighted = weights[:, None] * rows.own
    inverse = np.linalg.pinv(
        rows.of_families(weighted[:, :, None] * rows.own[:, None, :]), rcond=_UNDETERMINED, hermitian=True
    )
    bend = rows.of_families(weighted * rows.bend[:, None])
    common = rows.of_families(weighted[:, :, None] * rows.common[:, None, :])
    by_value = np.einsum("fpq,fq->fp", inverse, rows.of_families(weighted * values[:, None]))
    by_bend, by_common = np.einsum("fpq,fq->fp", inverse, bend), inverse @ common

    here = weights * rows.bend
    whole = rows.of_families(here * rows.bend)
    left = rows.of_specimens(whole - np.sum(bend * by_bend, axis=1))
    known = left > _UNDETERMINED * rows.of_specimens(whole)
    of_bend = np.divide(1.0, left, out=np.zeros(left.size), where=known)
    across = rows.of_families(here[:, None] * rows.common) - np.einsum("fp,fpm->fm", bend, by_common)
    across = rows.of_specimens(across)
    right = rows.of_specimens(rows.of_families(here * values) - np.sum(bend * by_value, axis=1))

    turned = rows.common.conj().T
    normal = turned @ (weights[:, None] * rows.common) + np.diag(prior)
    normal = normal - np.einsum("fpm,fpn->mn", common.conj(), by_common)
    normal = normal - across.conj().T @ (of_bend[:, None] * across)
    target = turned @ (weights * values) - np.einsum("fpm,fp->m", common.conj(), by_value)
    target = target - across.conj().T @ (of_bend * right)
    of_common = np.linalg.pinv(normal, rcond=_UNDETERMINED, hermitian=True)
    gamma = of_common @ target
    beta = of_bend * (right - across @ gamma)
    alpha = by_value - by_bend * beta[rows.specimen][:, None] - by_common @ gamma
    bend_by_common = of_bend[:, None] * across
    return NestedFit(alpha, beta, gamma, inverse, by_bend, by_common, of_bend, of_common, bend_by_common)


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
