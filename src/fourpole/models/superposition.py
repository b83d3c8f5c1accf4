r"""Time-temperature superposition: isotherms of K* become one master curve by shift factors.

.. math:: K^*(\omega, T) = K^*_{ref}(\omega a_T) / b_T
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from fourpole.core import stats
from fourpole.core.arrays import BoolArray, ByValue, ComplexArray, FloatArray
from fourpole.core.confidence import CHANCE
from fourpole.errors import ModelError
from fourpole.models.common_curve import (
    Isotherm,
    SpectraFit,
    by_spectra,
    errors_of_misfit,
    fit_spectra,
    relative_errors,
    shift_rows,
    slopes,
    stated_errors,
    terms,
)
from fourpole.models.data import DECADE

#: Relaxation times per decade of the common curve.
_DENSITY = 4
#: Relaxation times per decade, and step [decades], of the search for the distance of two isotherms.
_COARSE, _STEP = 2, 0.125
#: Relative errors of K' and of K'' from which fits start: alike, and nearly without K''. Where K' and K'' contradict
#: each other, the likelihood has an optimum for each.
_STARTS = ((0.03, 0.03), (0.005, 0.5))
_MOST_STEPS, _HALVINGS, _ROUNDS = 60, 12, 6
#: A step is small below this share of each standard uncertainty; errors are stable if they change by less than this.
_SMALL, _STABLE = 0.01, 0.02
#: The search ends if chi-square falls by less than this.
_FLAT = 1e-3
#: Isotherms overlap if each has at least this number of points in the common range of reduced frequency.
FEWEST_POINTS = 2
#: Standard uncertainty of the distance of two isotherms above which their overlap links nothing: a quarter of a decade.
_VAGUE = 0.25 * np.log(10.0)
#: Difference of BIC above which the isotherms need vertical shifts.
_NEEDED = 10.0
#: Relative tolerance of the ends of an overlap.
_EDGE = 1e-9


@dataclass(frozen=True, eq=False)
class Superposition(ByValue):
    """Isotherms that are shifted onto one master curve, rising in temperature.

    Attributes
    ----------
    isotherms : tuple of Isotherm
    reference : int
        Index of the isotherm whose shift factors are 1.
    log_a, log_b : (n,) float arrays [1]
        Natural logarithms of the horizontal and vertical shift factors.
    covariance, vertical_covariance : (n, n) float arrays [1]
        Covariance of `log_a` and of `log_b`; 0 for the reference, and of `log_b` without vertical shifts.
    vertical : bool
        Whether vertical shifts were fitted.
    needs_vertical : bool
        Whether the isotherms superpose only with vertical shifts, which were not fitted. `covariance` then includes the
        difference of `log_a` from the shifts beside vertical ones.
    times : (k,) float array [s]
        Relaxation times of the common curve; an infinite one is a spring in parallel.
    springs : (2, k) float array [N/m]
        Stiffnesses at these times, for K' and for K''.
    errors : (n,) tuple of (N_i, 2) float arrays [N/m]
        Standard uncertainties of Re and Im K* that the fit used: as stated, or as the misfit shows them.
    chi2, dof : float [1]
        Chi-square of all isotherms about the common curve, and its degrees of freedom.
    stated : bool
        Whether the uncertainty of K* is stated. If it is not, chi-square equals its degrees of freedom.
    converged : bool
    """

    isotherms: tuple[Isotherm, ...]
    reference: int
    log_a: FloatArray
    log_b: FloatArray
    covariance: FloatArray
    vertical_covariance: FloatArray
    vertical: bool
    times: FloatArray
    springs: FloatArray
    errors: tuple[FloatArray, ...]
    chi2: float
    dof: float
    stated: bool
    converged: bool
    needs_vertical: bool = False

    @property
    def temperatures(self) -> FloatArray:
        """Temperatures (n,) [degC]."""
        return np.array([one.temperature for one in self.isotherms])

    @property
    def std(self) -> FloatArray:
        """Standard uncertainties (n,) of `log_a` [1]."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def vertical_std(self) -> FloatArray:
        """Standard uncertainties (n,) of `log_b` [1]."""
        return np.sqrt(np.diag(self.vertical_covariance))

    @property
    def fits(self) -> bool:
        """Whether chance explains the misfit of the common curve; true where no uncertainty is stated."""
        return not self.stated or bool(stats.chi2.sf(self.chi2, max(self.dof, 1)) > CHANCE)

    @property
    def loss(self) -> float:
        """Minus twice the logarithm of the likelihood, but for a constant [1]."""
        size = 0.0 if self.stated else 2.0 * float(sum(np.sum(np.log(one)) for one in self.errors))
        return self.chi2 + size

    def curve(self, omega: FloatArray) -> ComplexArray:
        """K* (N,) [N/m] of the common curve at reduced angular frequencies (N,) [rad/s]."""
        return by_spectra(terms(omega, self.times), self.springs)

    def slope(self, omega: FloatArray) -> ComplexArray:
        """Derivative (N,) of `curve` by the logarithm of the frequency [N/m]."""
        return by_spectra(slopes(omega, self.times), self.springs)

    def reduced(self, at: int) -> tuple[FloatArray, ComplexArray]:
        """Reduced angular frequencies (N,) [rad/s] and reduced K* (N,) [N/m] of one isotherm."""
        one = self.isotherms[at]
        return one.omega * np.exp(self.log_a[at]), one.stiffness * np.exp(self.log_b[at])


def superpose(
    isotherms: Sequence[Isotherm], reference: float | None = None, *, vertical: bool = False
) -> tuple[Superposition, tuple[Isotherm, ...]]:
    """Shift isotherms onto one master curve, first neighbour by neighbour, then all together.

    Parameters
    ----------
    isotherms : sequence of Isotherm
        At least two, at different temperatures, with three frequencies or more each.
    reference : float, optional [degC]
        Temperature of one of the isotherms; by default the one nearest to the middle.
    vertical : bool
        Whether the isotherms also have vertical shift factors.

    Returns
    -------
    Superposition
        Of the isotherms that overlaps of neighbours link to the reference.
    tuple of Isotherm
        The other isotherms: no shift factor is known of them.

    Raises
    ------
    ModelError
        If there are too few isotherms or frequencies, no isotherm has the reference temperature, or none overlaps it.

    Notes
    -----
    If the uncertainty of K* is not stated, the errors are taken as proportional to K' and to K'', or both to the
    modulus of K*, whichever is more likely; the misfit gives their sizes. If it is stated and chance does not explain
    the misfit, the covariance of the shift factors is multiplied by chi-square per degree of freedom.

    References
    ----------
    J. D. Ferry, Viscoelastic Properties of Polymers, 3rd ed., 1980, chapter 11; J. Dealy, D. Plazek, "Time-temperature
    superposition - a users guide", Rheology Bulletin 78(2), 2009; K. Lennon, G. McKinley, J. Swan, "A data-driven
    method for automated data superposition", Data-Centric Engineering 4, 2023; ISO 18437-6:2017, 3.5.

    Examples
    --------
    >>> omega = np.geomspace(1, 100, 9)
    >>> cold, hot = (1e5 + 2e5 * 1j * omega * t / (1 + 1j * omega * t) for t in (0.1, 0.01))
    >>> found, rest = superpose([Isotherm(20.0, omega, cold), Isotherm(40.0, omega, hot)], 20.0)
    >>> (found.log_a / np.log(10)).round(2).tolist()
    [0.0, -1.0]
    """
    ordered = sorted(isotherms, key=lambda one: one.temperature)
    _check(ordered)
    at = _reference(ordered, reference)
    warm, cold = ordered[1:], ordered[:-1]
    starts = []
    for size in _STARTS:
        steps = [-_distance(*pair, size) for pair in zip(warm, cold, strict=True)]
        starts.append(np.cumsum([0.0, *steps]))
    found, kept = _linked_fit(ordered, at, starts)
    found = _with_vertical(found) if vertical else _with_doubt(found)
    return found, tuple(one for i, one in enumerate(ordered) if i not in kept)


def _check(isotherms: Sequence[Isotherm]) -> None:
    if len(isotherms) < 2:
        raise ModelError("one temperature only: a master curve needs isotherms at two temperatures or more")
    for one in isotherms:
        if one.omega.size < 3:
            raise ModelError(
                f"the isotherm at {one.temperature:.5g} degC has {one.omega.size} frequencies: measure three or more, "
                "or leave it out"
            )


def _reference(isotherms: Sequence[Isotherm], temperature: float | None) -> int:
    """Index of the isotherm of the reference temperature."""
    every = np.array([one.temperature for one in isotherms])
    wanted = 0.5 * (every[0] + every[-1]) if temperature is None else temperature
    at = int(np.argmin(np.abs(every - wanted)))
    if temperature is not None and abs(every[at] - wanted) > 0.5 * float(np.min(np.diff(every))):
        there = ", ".join(f"{one:.4g}" for one in every)
        raise ModelError(
            f"no isotherm at the reference temperature {wanted:.4g} degC: there are {there} degC. State one of these"
        )
    return at


# ---------------------------------------------------------------------------------------------- overlaps


def common_range(one: Isotherm, other: Isotherm, log_a: float, other_log_a: float) -> tuple[float, float]:
    """Lowest and highest reduced angular frequency [rad/s] that two isotherms have in common; low > high for none."""
    low = max(one.omega[0] * np.exp(log_a), other.omega[0] * np.exp(other_log_a))
    high = min(one.omega[-1] * np.exp(log_a), other.omega[-1] * np.exp(other_log_a))
    return float(low), float(high)


def inside(one: Isotherm, log_a: float, ends: tuple[float, float]) -> BoolArray:
    """Flags (N,) of the points of an isotherm within a range of reduced angular frequency."""
    reduced = one.omega * np.exp(log_a)
    return np.asarray((reduced >= ends[0] * (1 - _EDGE)) & (reduced <= ends[1] * (1 + _EDGE)))


def common_points(one: Isotherm, other: Isotherm, log_a: float, other_log_a: float) -> int:
    """Least number of points of one of two isotherms within their common range of reduced frequency."""
    ends = common_range(one, other, log_a, other_log_a)
    return int(min(inside(one, log_a, ends).sum(), inside(other, other_log_a, ends).sum()))


def _linked(
    isotherms: Sequence[Isotherm], log_a: FloatArray, reference: int, covariance: FloatArray | None = None
) -> list[int]:
    """Indices of the isotherms that overlaps of neighbours link to the reference, at distances that are known."""
    kept = [reference]
    count = len(isotherms)
    whole = np.zeros((count, count)) if covariance is None else covariance
    for step in (-1, 1):
        at = reference
        while 0 <= at + step < len(isotherms):
            one, other = sorted((at, at + step))
            if common_points(isotherms[one], isotherms[other], log_a[one], log_a[other]) < FEWEST_POINTS:
                break
            if whole[one, one] + whole[other, other] - 2 * whole[one, other] > _VAGUE**2:
                break
            at += step
            kept.append(at)
    return sorted(kept)


def _lonely(isotherms: Sequence[Isotherm], at: int) -> str:
    one = isotherms[at]
    near = [f"{isotherms[i].temperature:.4g}" for i in (at - 1, at + 1) if 0 <= i < len(isotherms)]
    return (
        f"no isotherm overlaps that at {one.temperature:.4g} degC: measure at temperatures between it and "
        f"{' or '.join(near)} degC, or over more decades of frequency"
    )


# --------------------------------------------------------------------------------------------- neighbours


def _distance(warm: Isotherm, cold: Isotherm, size: tuple[float, float]) -> float:
    """Distance ln(a_cold / a_warm) of two neighbours, by a search for the best common curve of both."""
    if cold.stiffness.real.min() > warm.stiffness.real.max():
        # K' of a passive material does not fall with frequency: the cold isotherm lies beyond the warm one.
        return float(np.log(warm.omega[-1] / cold.omega[0])) + 2 * _EDGE
    decades = max(np.log10(one.omega[-1] / one.omega[0]) for one in (warm, cold))
    pair = (cold, warm)
    errors = [relative_errors(one.stiffness, size) for one in pair]
    best, least = 0.0, np.inf
    for step in np.arange(-1.0, decades, _STEP) * DECADE:
        if common_points(cold, warm, 0.0, -step) >= FEWEST_POINTS:
            chi2 = fit_spectra(pair, np.array([[0.0, -step], [0.0, 0.0]]), errors, _COARSE).chi2
            best, least = (float(step), chi2) if chi2 < least else (best, least)
    return best


# ------------------------------------------------------------------------------------------ all together


def _linked_fit(ordered: Sequence[Isotherm], at: int, starts: Sequence[FloatArray]) -> tuple[Superposition, list[int]]:
    """The fit that keeps most isotherms linked to the reference, or else the likeliest; and their indices."""
    kept = max((_linked(ordered, start, at) for start in starts), key=len)
    chosen, begins = tuple(ordered[i] for i in kept), [start[kept] - start[at] for start in starts]
    errors = [[relative_errors(one.stiffness, size) for one in chosen] for size in _STARTS]
    while len(kept) > 1:
        here = kept.index(at)
        fits = [_joint(chosen, here, *both, vertical=False) for both in zip(begins, errors, strict=True)]
        links = [_linked(chosen, found.log_a, here, found.covariance) for found in fits]
        best, still = min(zip(fits, links, strict=True), key=lambda one: (-len(one[1]), one[0].loss))
        if len(still) == len(kept):
            return best, kept
        # K* hardly depends on frequency there, or K' and K'' contradict each other at every overlap.
        kept, chosen = [kept[i] for i in still], tuple(chosen[i] for i in still)
        begins, errors = [one.log_a[still] for one in fits], [[one.errors[i] for i in still] for one in fits]
    raise ModelError(_lonely(ordered, at))


def _with_vertical(found: Superposition) -> Superposition:
    """Horizontal and vertical shifts, from the horizontal ones: the fit that keeps most overlaps, or the likeliest."""
    isotherms, at = found.isotherms, found.reference
    errors = [found.errors, *([relative_errors(one.stiffness, size) for one in isotherms] for size in _STARTS)]
    fits = [_joint(isotherms, at, found.log_a, some, vertical=True) for some in errors]
    return min(fits, key=lambda one: (-len(_linked(isotherms, one.log_a, at)), one.loss))


def _with_doubt(found: Superposition) -> Superposition:
    """The horizontal shifts; where the data need vertical ones, with the difference as part of the uncertainty."""
    count = len(found.isotherms)
    other = _joint(found.isotherms, found.reference, found.log_a, found.errors, vertical=True)
    points = sum(2 * one.omega.size for one in found.isotherms)
    gain = found.loss - other.loss - (count - 1) * np.log(points)
    if found.stated and not found.fits:
        gain /= found.chi2 / found.dof
    if gain < _NEEDED or len(_linked(other.isotherms, other.log_a, other.reference)) < count:
        return found
    apart = other.log_a - found.log_a
    return replace(found, covariance=found.covariance + np.outer(apart, apart), needs_vertical=True)


def _joint(
    isotherms: tuple[Isotherm, ...], reference: int, start: FloatArray, begin: Sequence[FloatArray], *, vertical: bool
) -> Superposition:
    """All shifts together; where no uncertainty is stated, in turn with the errors, which `begin` as stated there."""
    free = np.array([i for i in range(len(isotherms)) if i != reference])
    stated = all(one.covariance is not None for one in isotherms)
    errors = [stated_errors(one) for one in isotherms] if stated else begin
    search, shifts = _Search(isotherms, errors, free, vertical), np.stack([start, np.zeros(len(isotherms))])
    for _ in range(1 if stated else _ROUNDS):
        shifts, fit, converged = search.from_start(shifts)
        if stated:
            break
        before, search = search, replace(search, errors=errors_of_misfit(isotherms, fit, search.dof(fit)))
        change = [np.max(np.abs(new / old - 1)) for new, old in zip(search.errors, before.errors, strict=True)]
        if max(change) < _STABLE:
            break
    fit = search.fit(shifts)
    dof = search.dof(fit)
    covariance: FloatArray = np.asarray(np.linalg.inv(search.normal(shifts, fit, loose=True)[0]))
    if not stated or stats.chi2.sf(fit.chi2, dof) < CHANCE:
        covariance = covariance * fit.chi2 / dof
    whole = np.zeros((2, len(isotherms), len(isotherms)))
    for at in range(search.kinds):
        block = slice(at * free.size, (at + 1) * free.size)
        whole[at][np.ix_(free, free)] = covariance[block, block]
    return Superposition(
        isotherms, reference, shifts[0], shifts[1], whole[0], whole[1], vertical, fit.times, fit.springs,
        tuple(search.errors), fit.chi2, float(dof), stated, converged,
    )  # fmt: skip


@dataclass(frozen=True, eq=False)
class _Search:
    """The search for the shifts of `free` isotherms with the least chi-square.

    Shifts are ln a_T and ln b_T (2, n). Neighbours were chosen to overlap: the distance of two is half the longer of
    them, give or take as much. This matters only where K* hardly depends on frequency: the data set no distance there.
    """

    isotherms: tuple[Isotherm, ...]
    errors: Sequence[FloatArray]
    free: np.ndarray
    vertical: bool

    @property
    def kinds(self) -> int:
        """Number of kinds of shifts: horizontal ones, and vertical ones if wanted."""
        return 2 if self.vertical else 1

    def fit(self, shifts: FloatArray) -> SpectraFit:
        """The best common curve at given shifts."""
        return fit_spectra(self.isotherms, shifts, self.errors, _DENSITY)

    def dof(self, fit: SpectraFit) -> int:
        """Degrees of freedom of a fit."""
        return max(fit.residual.size - fit.used - self.free.size * self.kinds, 1)

    @property
    def _half(self) -> FloatArray:
        """Half the length (n - 1,) of the longer isotherm of each pair of neighbours, in ln(frequency)."""
        length = np.array([np.log(one.omega[-1] / one.omega[0]) for one in self.isotherms])
        return np.asarray(0.5 * np.maximum(length[1:], length[:-1]))

    def _prior(self, shifts: FloatArray) -> FloatArray:
        """Departures (n - 1,) of the distances from the expected ones, in their standard uncertainties."""
        return np.asarray(-np.diff(shifts[0]) / self._half - 1.0)

    def _objective(self, shifts: FloatArray, fit: SpectraFit) -> float:
        return fit.chi2 + float(np.sum(self._prior(shifts) ** 2))

    def normal(self, shifts: FloatArray, fit: SpectraFit, *, loose: bool = False) -> tuple[FloatArray, FloatArray]:
        """Normal matrix (p, p) of the free shifts, and the right side (p,) of the step, which `loose` does not have."""
        columns = shift_rows(
            self.isotherms, shifts, fit, self.errors, self.free, self.vertical, loose=_DENSITY if loose else 0
        )
        distances = -np.diff(np.eye(len(self.isotherms)), axis=0) / self._half[:, None]
        expected = np.zeros((len(distances), columns.shape[1]))
        expected[:, : self.free.size] = distances[:, self.free]
        normal = columns.T @ columns + expected.T @ expected
        normal[np.diag_indices_from(normal)] += 1e-10 * np.trace(normal) / len(normal)
        if loose:
            return normal, np.zeros(len(normal))
        return normal, columns.T @ fit.residual - expected.T @ self._prior(shifts)

    def from_start(self, shifts: FloatArray) -> tuple[FloatArray, SpectraFit, bool]:
        """Gauss-Newton iteration with the spectra projected out; a step that does not help is halved."""
        fit = self.fit(shifts)
        for _ in range(_MOST_STEPS):
            step, size = self._step(shifts, fit)
            now, better = self._objective(shifts, fit), None
            for share in 0.5 ** np.arange(_HALVINGS):
                tried = shifts.copy()
                tried[: self.kinds, self.free] += (share * step).reshape(self.kinds, -1)
                trial = self.fit(tried)
                if self._objective(tried, trial) < now:
                    better = tried, trial
                    break
                if share * size < _SMALL:
                    break
            if better is None:
                return shifts, fit, True
            shifts, fit = better
            if share * size < _SMALL or now - self._objective(shifts, fit) < _FLAT:
                return shifts, fit, True
        return shifts, fit, False

    def _step(self, shifts: FloatArray, fit: SpectraFit) -> tuple[FloatArray, float]:
        """The step of the free shifts, at most a decade long, and its largest part in standard uncertainties."""
        normal, right = self.normal(shifts, fit)
        covariance = np.linalg.inv(normal)
        step = covariance @ right
        size = float(np.max(np.abs(step) / np.sqrt(np.diag(covariance))))
        return step * min(1.0, DECADE / max(float(np.max(np.abs(step))), 1e-300)), size
