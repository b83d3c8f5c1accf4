r"""Laws of the shift factors over temperature: WLF and Arrhenius, fitted with their uncertainty, and the choice of one.

Overlaps of neighbouring isotherms: how long they are, and whether both isotherms follow one curve there.

.. math:: \log_{10} a_T = \frac{-C_1 (T - T_{ref})}{C_2 + T - T_{ref}}, \qquad
    \ln a_T = \frac{E}{R} \left(\frac{1}{T} - \frac{1}{T_{ref}}\right)
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any

import numpy as np
import scipy

from fourpole.core import stats
from fourpole.core.arrays import ByValue, ComplexArray, FloatArray
from fourpole.core.confidence import CHANCE, SEARCH_CHANCE
from fourpole.errors import ModelError
from fourpole.models.data import DECADE
from fourpole.models.superposition import FEWEST_POINTS, Superposition, common_range, inside

#: Molar gas constant [J/(mol K)], exact in the SI since 2019.
GAS_CONSTANT = 8.31446261815324
#: Zero of the Celsius scale [K].
ZERO_CELSIUS = 273.15
#: Difference of BIC below which two laws are equally good.
UNDECIDED = 2.0
#: Least variance of a shift factor besides that of the overlap: a temperature is seldom known better than this [K].
_LEAST_KELVIN = 1e-4
#: Ends of the search for an interval, in standard uncertainties.
_WIDEST = 60.0
_LEVEL = 0.95
#: Symbols and units of the constants of each law.
CONSTANTS = {"WLF": (("C1", "1"), ("C2", "K")), "Arrhenius": (("E", "J/mol"),)}


@dataclass(frozen=True, eq=False)
class ShiftLaw(ByValue):
    """A law of the horizontal shift factors.

    Attributes
    ----------
    name : str
        WLF or Arrhenius.
    reference : float [degC]
        Temperature at which the shift factor is 1.
    values : (k,) float array
        C1 [1] and C2 [K], or the activation energy [J/mol].
    covariance : (k, k) float array
        Their covariance; it includes the misfit of the law.
    intervals : (k, 2) float array
        Their 95 % intervals by profile likelihood; infinite where the data set no end.
    chi2, dof : float, int
        Chi-square of the shift factors about the law, and its degrees of freedom.
    bic : float
        Bayes information criterion; the smaller, the better.

    References
    ----------
    M. L. Williams, R. F. Landel, J. D. Ferry, J. Am. Chem. Soc. 77 (1955), 3701; ISO 18437-6:2017.

    Examples
    --------
    >>> law = ShiftLaw("WLF", 20.0, np.array([8.86, 101.6]), np.zeros((2, 2)))
    >>> round(float(law.log_a(40.0)[0] / np.log(10)), 3)
    -1.457
    """

    name: str
    reference: float
    values: FloatArray
    covariance: FloatArray
    intervals: FloatArray | None = None
    chi2: float = 0.0
    dof: int = 0
    bic: float = 0.0

    @property
    def std(self) -> FloatArray:
        """Standard uncertainties (k,) of the constants."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def fits(self) -> bool:
        """Whether chance explains the misfit of the law."""
        return self.dof == 0 or bool(stats.chi2.sf(self.chi2, self.dof) > CHANCE)

    def log_a(self, temperature: FloatArray | float) -> FloatArray:
        """Natural logarithm (N,) of the shift factor at temperatures (N,) [degC]."""
        return _law(self.name, self.values, self.reference, np.atleast_1d(np.asarray(temperature, dtype=float)))

    def log_a_std(self, temperature: FloatArray | float) -> FloatArray:
        """Standard uncertainty (N,) of `log_a`."""
        slopes = _slopes(self.name, self.values, self.reference, np.atleast_1d(np.asarray(temperature, dtype=float)))
        return np.sqrt(np.maximum(np.einsum("ni,ij,nj->n", slopes, self.covariance, slopes), 0.0))

    def at_reference(self, temperature: float) -> ShiftLaw:
        """The same law with another reference temperature [degC], with the covariance of its constants.

        Raises
        ------
        ModelError
            If the temperature is not above the one where the WLF law ends, the reference less C2.

        Examples
        --------
        >>> law = ShiftLaw("WLF", 20.0, np.array([8.86, 101.6]), np.zeros((2, 2)))
        >>> law.at_reference(-20.0).values.round(2)
        array([14.61, 61.6 ])
        """
        if self.name != "WLF":
            return ShiftLaw(self.name, temperature, self.values, self.covariance, self.intervals)
        c1, c2 = self.values
        moved = c2 + temperature - self.reference
        if moved <= 0:
            raise ModelError(
                f"the WLF law ends at {self.reference - c2:.4g} degC: a reference temperature must be above it"
            )
        turn = np.array([[c2 / moved, c1 / moved - c1 * c2 / moved**2], [0.0, 1.0]])
        return ShiftLaw("WLF", temperature, np.array([c1 * c2 / moved, moved]), turn @ self.covariance @ turn.T)


def interpolated(
    temperatures: FloatArray, values: FloatArray, errors: FloatArray, at: float
) -> tuple[float, FloatArray, float]:
    """A shift factor's logarithm between isotherms, its changes with those of the isotherms, and its own error.

    Monotone cubic interpolation over the reciprocal of the absolute temperature, where an Arrhenius law is straight.

    Parameters
    ----------
    temperatures, values : (n,) float arrays [degC], [1]
        Temperatures, rising, and logarithms of the factors.
    errors : (n, m) float array [1]
        Changes of the values with m independent errors of one standard uncertainty.
    at : float [degC]
        A temperature from the lowest to the highest one.

    Returns
    -------
    value : float [1]
    changes : (m,) float array [1]
        Its changes with these errors.
    error : float [1]
        Standard uncertainty of the interpolation: midway a quarter of what it misses an isotherm by that is left out,
        at an isotherm 0.

    References
    ----------
    F. N. Fritsch, R. E. Carlson, "Monotone piecewise cubic interpolation", SIAM J. Numer. Anal. 17, 1980.

    Examples
    --------
    >>> value, changes, error = interpolated(np.array([0.0, 20.0]), np.array([2.0, 0.0]), np.eye(2), 10.0)
    >>> round(value, 3), round(float(np.linalg.norm(changes)), 3), error
    (0.965, 0.708, 0.0)
    """
    x, here = -1.0 / (temperatures + ZERO_CELSIUS), -1.0 / (at + ZERO_CELSIUS)
    curve = scipy.interpolate.PchipInterpolator
    found = curve(x, np.column_stack([values, values[:, None] + errors, values[:, None] - errors]))(here)
    count, many = errors.shape
    spread = (found[1 : 1 + many] - found[1 + many :]) / 2
    left_out = np.zeros(count)
    for one in range(1, count - 1):
        others = np.arange(count) != one
        left_out[one] = abs(float(curve(x[others], values[others])(x[one])) - values[one])
    low = int(np.clip(np.searchsorted(x, here) - 1, 0, count - 2))
    share = (here - x[low]) / (x[low + 1] - x[low])
    between = float(share * (1 - share) * np.max(left_out[low : low + 2]))
    return float(found[0]), spread, between


def worst_miss(
    law: ShiftLaw, temperatures: FloatArray, log_a: FloatArray, std: FloatArray
) -> tuple[float, float, float]:
    """Where a law misses its own shift factors most, in their u: temperature [degC], miss and u of ln a_T."""
    miss = np.abs(law.log_a(temperatures) - log_a)
    at = int(np.argmax(np.divide(miss, std, out=np.zeros_like(miss), where=std > 0)))
    return float(temperatures[at]), float(miss[at]), float(std[at])


@dataclass(frozen=True)
class LawChoice:
    """The laws that were fitted, the best first.

    Attributes
    ----------
    laws : tuple of ShiftLaw
    decided : bool
        Whether the data prefer the first law.
    """

    laws: tuple[ShiftLaw, ...]
    decided: bool

    @property
    def best(self) -> ShiftLaw:
        """The law with the smallest BIC."""
        return self.laws[0]


def fit_laws(temperatures: FloatArray, log_a: FloatArray, covariance: FloatArray, reference: int) -> LawChoice:
    """Fit both laws to shift factors, and choose one by BIC.

    Parameters
    ----------
    temperatures, log_a : (n,) float arrays [degC], [1]
        Temperatures, and natural logarithms of the shift factors.
    covariance : (n, n) float array [1]
        Covariance of `log_a`; 0 for the reference.
    reference : int
        Index of the reference.

    Returns
    -------
    LawChoice
        Without WLF if there are fewer than three temperatures.

    Notes
    -----
    If chance does not explain the misfit of a law, the covariance of its constants is multiplied by chi-square per
    degree of freedom, and the intervals follow Student's distribution.
    """
    others = np.arange(temperatures.size) != reference
    problem = _Problem(
        float(temperatures[reference]), temperatures[others], log_a[others], covariance[np.ix_(others, others)]
    )
    names = ["Arrhenius"] if temperatures.size < 3 else ["WLF", "Arrhenius"]
    laws = [found for name in names if (found := problem.fitted(name)) is not None]
    scale = 1.0 if any(law.fits for law in laws) else min(law.chi2 / max(law.dof, 1) for law in laws)

    def bic(law: ShiftLaw) -> float:
        return float(law.chi2 / scale + law.values.size * np.log(problem.t.size))

    ranked = sorted(laws, key=bic)
    return LawChoice(tuple(ranked), len(ranked) < 2 or bic(ranked[1]) - bic(ranked[0]) > UNDECIDED)


def _law(name: str, values: FloatArray, reference: float, t: FloatArray) -> FloatArray:
    """The logarithm ln a_T (N,) at temperatures (N,) [degC]; each law is linear in its first constant."""
    return np.asarray(values[0] * _shape(name, values, reference, t))


def _shape(name: str, values: FloatArray, reference: float, t: FloatArray) -> FloatArray:
    """The logarithm ln a_T (N,) per unit of the first constant."""
    if name == "WLF":
        x = t - reference
        return np.asarray(-DECADE * x / (values[1] + x))
    return np.asarray((1 / (t + ZERO_CELSIUS) - 1 / (reference + ZERO_CELSIUS)) / GAS_CONSTANT)


def _slopes(name: str, values: FloatArray, reference: float, t: FloatArray) -> FloatArray:
    """Derivatives (N, k) of ln a_T by the constants."""
    shape = _shape(name, values, reference, t)
    if name == "WLF":
        return np.stack([shape, -values[0] * shape / (values[1] + t - reference)], axis=1)
    return shape[:, None]


@dataclass(frozen=True, eq=False)
class _Problem:
    """Shift factors to be described by a law: temperatures `t` other than the reference, and ln a_T with covariance."""

    reference: float
    t: FloatArray
    log_a: FloatArray
    covariance: FloatArray

    @cached_property
    def whiten(self) -> FloatArray:
        """W with W S W^T = 1 for the covariance S."""
        slope = np.max(np.abs(self.log_a / self.x))
        least = (slope * _LEAST_KELVIN) ** 2 + 1e-16
        return np.asarray(np.linalg.inv(np.linalg.cholesky(self.covariance + least * np.eye(self.t.size))))

    @cached_property
    def target(self) -> FloatArray:
        """The shift factors in standard uncertainties."""
        return self.whiten @ self.log_a

    @property
    def x(self) -> FloatArray:
        """Temperatures above the reference [K]."""
        return self.t - self.reference

    @property
    def least(self) -> float:
        """Least C2 [K] with which the WLF law holds at all temperatures."""
        return max(0.0, -float(self.x.min()))

    def fitted(self, name: str) -> ShiftLaw | None:
        """The law with the least chi-square; None if WLF has no bend that the data show."""
        if name == "Arrhenius":
            return self._judged(name, np.array([self._first(name)[0]]))
        # The law is linear in C1, so that C2 alone is searched.
        grid = np.linspace(np.log(0.05), np.log(1e5), 120)
        at, found = _minimum(lambda log_c2: self._first(name, self.least + float(np.exp(log_c2)))[1], grid)
        if at == grid.size - 1:
            return None  # a straight line in temperature is as good as any bend
        c2 = self.least + float(np.exp(found.x))
        return self._judged(name, np.array([self._first(name, c2)[0], c2]))

    def _first(self, name: str, second: float = 0.0) -> tuple[float, float]:
        """The first constant that fits best for a given second one, and chi-square."""
        column = self.whiten @ _shape(name, np.array([1.0, second]), self.reference, self.t)
        first = float(column @ self.target / (column @ column))
        return first, float(np.sum((self.target - first * column) ** 2))

    def _chi2(self, name: str, *values: float) -> float:
        """Chi-square of a law with these constants."""
        law = _law(name, np.array(values), self.reference, self.t)
        return float(np.sum((self.target - self.whiten @ law) ** 2))

    def _judged(self, name: str, values: FloatArray) -> ShiftLaw:
        """A law with covariance, intervals and BIC."""
        rows = self.whiten @ _slopes(name, values, self.reference, self.t)
        residual = self.whiten @ (self.log_a - _law(name, values, self.reference, self.t))
        chi2, dof = float(residual @ residual), self.t.size - values.size
        covariance = np.linalg.inv(rows.T @ rows)
        wide = dof > 0 and stats.chi2.sf(chi2, dof) < CHANCE
        scale = chi2 / dof if wide else 1.0
        limit = float(stats.f.ppf(_LEVEL, 1, dof)) if wide else float(stats.chi2.ppf(_LEVEL, 1))
        stds = np.sqrt(scale * np.diag(covariance))
        ends = [
            _interval(partial(self._profile, name, at), value, stds[at], chi2 + scale * limit)
            for at, value in enumerate(values)
        ]
        bic = chi2 + values.size * float(np.log(self.t.size))
        return ShiftLaw(name, self.reference, values, scale * covariance, np.array(ends), chi2, dof, bic)

    def _profile(self, name: str, at: int, value: float) -> float:
        """Least chi-square for a fixed constant."""
        if at == 1:
            return self._first(name, value)[1] if value > self.least * (1 + 1e-9) else np.inf
        if name == "Arrhenius":
            return self._chi2(name, value)
        # ln a_T at small differences fixes C1/C2, so that the best C2 is near value C2/C1.
        grid = np.linspace(np.log(0.05), np.log(1e6), 60)
        return float(_minimum(lambda log_c2: self._chi2(name, value, self.least + np.exp(log_c2)), grid)[1].fun)


def _minimum(chi2: Callable[[float], float], grid: FloatArray) -> tuple[int, Any]:
    """Place of the least value on a grid, and the minimum beside it as scipy gives it."""
    at = int(np.argmin([chi2(one) for one in grid]))
    ends = grid[max(at - 1, 0)], grid[min(at + 1, grid.size - 1)]
    return at, scipy.optimize.minimize_scalar(chi2, bounds=ends, method="bounded", options={"xatol": 1e-10})


def _interval(profile: Callable[[float], float], best: float, std: float, bound: float) -> tuple[float, float]:
    """Ends at which the profile of a constant reaches a bound; infinite if it does not."""

    def end(side: float) -> float:
        far = std
        while far < _WIDEST * std:
            there = best + side * far
            if profile(there) > bound:
                inner = best + side * 0.5 * far if far > std else best
                low, high = min(inner, there), max(inner, there)
                return float(scipy.optimize.brentq(lambda x: profile(x) - bound, low, high))
            far *= 2.0
        return side * np.inf

    return end(-1.0), end(1.0)


#: Overlap [decades] below which a shift factor rests on few points.
SHORT = 0.3
#: Verdicts on an overlap: the isotherms follow one curve; their loss factors differ; only their levels differ; the
#: overlap is too short for a verdict.
ONE_CURVE, LOSS, LEVEL, TOO_SHORT = "one curve", "loss factor", "level", "short"
#: Relative difference of K', K'' or the loss factor below which isotherms count as one curve, whatever chance says:
#: an error of the temperature of a few tenths of a kelvin has this effect.
_MATERIAL = 0.03
#: Highest order of the curve through both isotherms of an overlap, in ln(frequency).
_ORDER = 3


@dataclass(frozen=True)
class Overlap:
    """The overlap of two neighbouring isotherms.

    Attributes
    ----------
    temperatures : (float, float) [degC]
    decades : float
        Length of the common range of reduced frequency.
    points : int
        Least number of points of one isotherm in it.
    chi2, dof : float, int
        Squared differences in level and slope of K' and of K'' between the isotherms, in standard uncertainties, and
        their number less the shifts fitted.
    chance : float [1]
        Probability of a larger chi-square by noise alone.
    level, loss : float [1]
        Relative difference of K', and of the loss factor, warm less cold, in the middle of the overlap.
    verdict : str
        `ONE_CURVE`, `LOSS`, `LEVEL` or `TOO_SHORT`.
    """

    temperatures: tuple[float, float]
    decades: float
    points: int
    chi2: float
    dof: int
    chance: float
    level: float
    loss: float
    verdict: str


def overlaps(found: Superposition) -> tuple[Overlap, ...]:
    """The overlaps of all neighbours, rising in temperature.

    The loss factor does not change with a vertical shift, so a difference in it shows that no shifts whatever make the
    isotherms one curve: the material is not thermorheologically simple there, or the loss angle is wrong.
    """
    count = len(found.isotherms) - 1
    limit = SEARCH_CHANCE / max(count, 1)
    return tuple(_overlap(found, at, limit) for at in range(count))


def _overlap(found: Superposition, at: int, limit: float) -> Overlap:
    pair = found.isotherms[at], found.isotherms[at + 1]
    ends = common_range(*pair, found.log_a[at], found.log_a[at + 1])
    kept = [inside(one, found.log_a[at + i], ends) for i, one in enumerate(pair)]
    points = int(min(rows.sum() for rows in kept))
    decades = float(np.log10(ends[1] / ends[0])) if ends[1] > ends[0] else 0.0
    temperatures = pair[0].temperature, pair[1].temperature
    if points < FEWEST_POINTS:
        return Overlap(temperatures, decades, points, 0.0, 0, float("nan"), float("nan"), float("nan"), TOO_SHORT)
    x, side, k, errors = _joined(found, at, kept)
    middle = x - np.log(np.sqrt(ends[0] * ends[1]))
    storage = _apart(middle, side, np.log(k.real), errors[:, 0] / k.real)
    lost = _apart(middle, side, np.log(np.abs(k.imag)), errors[:, 1] / np.abs(k.imag))
    both = np.hypot(errors[:, 0] / k.real, errors[:, 1] / np.abs(k.imag))
    ratio = _apart(middle, side, np.log(np.abs(k.imag) / k.real), both)
    chi2, dof = storage.chi2 + lost.chi2, max(2 * storage.dof - (2 if found.vertical else 1), 1)
    chance = float(stats.chi2.sf(chi2, dof))
    verdict = ONE_CURVE
    if decades < SHORT:
        verdict = TOO_SHORT
    elif chance < limit and max(storage.largest, lost.largest, ratio.largest) > _MATERIAL:
        odd = stats.chi2.sf(ratio.chi2, ratio.dof) < limit and ratio.largest > _MATERIAL
        verdict = LOSS if odd else LEVEL
    return Overlap(temperatures, decades, points, chi2, dof, chance, storage.middle, ratio.middle, verdict)


def _joined(
    found: Superposition, at: int, kept: list[np.ndarray]
) -> tuple[FloatArray, FloatArray, ComplexArray, FloatArray]:
    """Points of both isotherms in their overlap: ln(reduced frequency), side (0 cold, 1 warm), K* and its errors."""
    parts = []
    for i, rows in enumerate(kept):
        omega, stiffness = found.reduced(at + i)
        errors = found.errors[at + i][rows] * np.exp(found.log_b[at + i])
        parts.append((np.log(omega[rows]), np.full(int(rows.sum()), float(i)), stiffness[rows], errors))
    x, side, k, errors = (np.concatenate(part) for part in zip(*parts, strict=True))
    return x, side, k, errors


@dataclass(frozen=True)
class _Apart:
    """Relative difference of two curves in the middle of their overlap, the largest one, chi-square and its dof."""

    middle: float
    largest: float
    chi2: float
    dof: int


def _apart(x: FloatArray, side: FloatArray, y: FloatArray, std: FloatArray) -> _Apart:
    """The difference of two curves in their overlap, in level and slope.

    One polynomial goes through both curves, and one of them has a level and a slope of its own besides.
    """
    order = int(min(_ORDER, max(1, x.size - 4)))
    common = np.vander(x, order + 1, increasing=True)
    slope = min(side.sum(), side.size - side.sum()) > FEWEST_POINTS
    own = np.stack([side, side * x], axis=1)[:, : 2 if slope else 1]
    basis = np.linalg.qr(common / std[:, None])[0]
    target, rows = y / std, own / std[:, None]
    target, rows = target - basis @ (basis.T @ target), rows - basis @ (basis.T @ rows)
    value = np.linalg.lstsq(rows, target, rcond=None)[0]
    largest = float(np.max(np.abs((own @ value)[side == 1])))
    return _Apart(float(np.expm1(value[0])), largest, float(np.sum((rows @ value) ** 2)), own.shape[1])
