r"""Test of the data: whether any passive linear tyre without inertia can have this K* within its uncertainty.

K* of such a tyre is a sum of terms with non-negative coefficients,

.. math:: K^* = K_\infty + \sum_i K_i \frac{j\omega\tau_i}{1 + j\omega\tau_i} + j\omega C, \quad K_\infty, K_i, C \ge 0,

The sum with the least chi-square is found by non-negative least squares, weighted with the covariance of K*. The test
needs no values outside the band: there is no integral over frequency and no extrapolation. "Passive" stands for
"relaxing and without mass" in this file: a passive tyre with a belt, or a hydromount, has inertia and fails the test.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fourpole.core import stats
from fourpole.core.arrays import ByValue, ComplexArray, FloatArray
from fourpole.core.confidence import CHANCE, NORMAL_95
from fourpole.errors import ModelError
from fourpole.models.data import StiffnessData, relaxation, spring_and_arms
from fourpole.models.nonnegative import NonNegative, WhitenedCondition, profile_ends, rise_of, whitened_conditions

#: Relaxation times per decade of the grid, and decades of the grid beyond each end of the band.
_PER_DECADE, _BEYOND = 12, 2.0
#: Number of times that a refinement adds around each active time, and largest number of refinements.
_MORE, _ROUNDS = 9, 8
#: Refinement ends when it reduces chi-square by less than this fraction of its excess over the degrees of freedom.
_STUCK = 0.03
#: Gauss-Newton search of the times: largest number of times, number of steps, largest step in ln(tau).
_MOST_MOVED, _MOVES, _FARTHEST_MOVE = 12, 6, 0.3
#: Largest number of frequencies that are removed, one by one, to find those that are not possible.
_MOST_REMOVED = 3
#: Residual, in standard uncertainties, above which a frequency is reported if removing frequencies does not help.
_FAR = 3.0
#: Decades beyond the ends of the data, for the range of all passive tyres.
_BEYOND_RANGE = 1.0
#: Weight, in standard uncertainties per relative change of the value, by which a value is held.
_HELD = 1e5


@dataclass(frozen=True, eq=False)
class PassiveTyre(ByValue):
    """The passive tyre with the least chi-square.

    Attributes
    ----------
    chi2, dof, chance : float, int, float [1]
        Chi-square, its degrees of freedom, and the probability of a larger chi-square.
    best : (N,) complex array [N/m]
        Its K*.
    whitened : (M,) float array [1]
        Residuals in standard uncertainties, Re and Im of each frequency in turn, then K1 if it is known.
    times, spectrum : (T,), (T,) float arrays [s], [N/m]
        Relaxation times, and the stiffness K_i >= 0 of each.
    """

    chi2: float
    dof: int
    chance: float
    best: ComplexArray
    whitened: FloatArray
    times: FloatArray
    spectrum: FloatArray

    @property
    def possible(self) -> bool:
        """Whether chance explains the misfit."""
        return self.chance > CHANCE

    @property
    def far(self) -> FloatArray:
        """Residual (N,) of each frequency in standard uncertainties."""
        return np.asarray(np.sqrt(np.sum(self.whitened[: 2 * self.best.size].reshape(-1, 2) ** 2, axis=1) / 2))


@dataclass(frozen=True, eq=False)
class Possible(PassiveTyre):
    """The result of the test of K* over a band.

    Attributes
    ----------
    residuals : (N,) complex array [N/m]
        K* of the data minus that of the best passive tyre.
    impossible : (n,) float array [Hz]
        Frequencies at which K* contradicts the other frequencies; empty if K* is possible.
    without_k1 : bool
        Whether K* is possible, but not together with K1.
    """

    residuals: ComplexArray
    impossible: FloatArray
    without_k1: bool


def check_possible(data: StiffnessData, enough: float = CHANCE) -> Possible:
    """Test whether a passive linear tyre without inertia can have K* of one condition.

    Parameters
    ----------
    data : StiffnessData
        Data of one condition, with K1 if it is known.
    enough : float [1]
        Probability of a larger chi-square at which the search for a better spectrum ends.

    Returns
    -------
    Possible

    Raises
    ------
    ModelError
        If the data are of several conditions.

    References
    ----------
    C. L. Lawson, R. J. Hanson, "Solving least squares problems", 1974, ch. 23; B. A. Boukamp, "A linear Kronig-Kramers
    transform test for immittance data validation", J. Electrochem. Soc. 142, 1995; here with non-negative terms.

    Examples
    --------
    >>> omega = 2 * np.pi * np.arange(10.0, 25.0)
    >>> stiffness = 180e3 + 1j * omega * 700 * 120e3 / (120e3 + 1j * omega * 700)
    >>> check_possible(StiffnessData.of(omega, stiffness, 100.0)).possible
    True
    >>> check_possible(StiffnessData.of(omega, stiffness.conj(), 100.0)).possible
    False
    """
    if data.stiffness.ndim != 1:
        raise ModelError("the test is for one condition at a time: choose one")
    data, best = best_passive(data, enough)
    rows, without_k1 = (np.empty(0, dtype=int), False) if best.possible else _impossible(data, best.far)
    impossible = data.omega[rows] / (2 * np.pi)
    return Possible(**vars(best), residuals=data.stiffness - best.best, impossible=impossible, without_k1=without_k1)


def near_passive(data: StiffnessData) -> StiffnessData:
    """The data of one condition with their shared errors at K* of the best passive tyre; see `StiffnessData.at`."""
    return data if data.relative is None else best_passive(data, CHANCE)[0]


def best_passive(data: StiffnessData, enough: float) -> tuple[StiffnessData, PassiveTyre]:
    """The best passive tyre, and the data with their shared errors at its K*."""
    best = _best(data if data.reference is not None else data.eased(), enough)
    return data.settled(best, lambda one: one.best, lambda there, _: _best(there, enough))


def _best(data: StiffnessData, enough: float) -> PassiveTyre:
    """The best passive tyre on a grid of times that is refined, and searched, until the probability is `enough`."""
    (condition,), before, times = whitened_conditions(data), np.inf, grid_of(data)
    for _ in range(_ROUNDS):
        best, _ = _with_times(condition, times)
        if best.chance > enough or before - best.chi2 < _STUCK * (best.chi2 - best.dof):
            break
        times, before = _finer(times, best.spectrum > 0), best.chi2
    return best if best.chance > enough else _with_best_times(condition, best)


def grid_of(data: StiffnessData, beyond: float = _BEYOND) -> FloatArray:
    """Relaxation times (T,) [s] evenly over the band of the data and decades beyond it, by their logarithms."""
    low, high = data.lowest / 10**beyond, float(data.omega.max()) * 10**beyond
    return 1.0 / np.geomspace(low, high, int(np.ceil(np.log10(high / low) * _PER_DECADE)) + 1)[::-1]


def _with_times(condition: WhitenedCondition, times: FloatArray) -> tuple[PassiveTyre, FloatArray]:
    """The best passive tyre with given relaxation times, and the rows of its terms."""
    terms, static = relaxing_terms(condition.data, times)
    found = NonNegative.best(condition.rows(terms, static), condition.target)
    dof = max(condition.data.numbers - found.used, 1)
    best = PassiveTyre(
        chi2=found.chi2,
        dof=dof,
        chance=float(stats.chi2.sf(found.chi2, dof)),
        best=terms @ found.weights,
        whitened=found.residuals[: condition.data.numbers],
        times=times,
        spectrum=found.weights[-times.size - 1 : -1],
    )
    return best, found.rows


def _with_best_times(condition: WhitenedCondition, best: PassiveTyre) -> PassiveTyre:
    """The passive tyre whose times are merged where they are close together, then moved by Gauss-Newton steps."""
    data, used = condition.data, best.spectrum > 0
    logs, weights = np.log(best.times[used]), best.spectrum[used]
    if not logs.size:
        return best
    cluster = np.cumsum(np.diff(logs, prepend=logs[0]) > np.log(10.0) / _PER_DECADE * 1.5)
    total = np.bincount(cluster, weights)
    place = np.bincount(cluster, weights * logs) / total
    if place.size > _MOST_MOVED:
        return best
    for _ in range(_MOVES):
        tried, rows = _with_times(condition, np.exp(place))
        if tried.chi2 < best.chi2 * (1 - 1e-9):
            best = tried
        if best.possible:
            break
        arms = relaxation(data.omega, np.exp(place))
        slopes = data.whitened(condition.whiten, tried.spectrum * arms * (1 - arms))
        known = slice(2 * data.count)
        step = np.linalg.lstsq(np.hstack([slopes, rows[known]]), tried.whitened[known], rcond=1e-12)[0]
        place = place + np.clip(step[: place.size], -_FARTHEST_MOVE, _FARTHEST_MOVE)
    return best


def _impossible(data: StiffnessData, far: FloatArray) -> tuple[np.ndarray, bool]:
    """Places of the frequencies without which K* is possible, and whether K* is possible without K1.

    The frequency with the largest residual is removed first. If removing `_MOST_REMOVED` frequencies does not help, the
    places are those of all large residuals.
    """
    if data.has_k1 and _best(replace(data, k1=np.asarray(np.nan)), CHANCE).possible:
        return np.empty(0, dtype=int), True
    kept, worst = np.arange(data.count), far
    for _ in range(min(_MOST_REMOVED, data.count - 2)):
        kept = np.delete(kept, int(np.argmax(worst)))
        rest = _best(data.part(kept), CHANCE)
        if rest.possible:
            return np.setdiff1d(np.arange(data.count), kept), False
        worst = rest.far
    return np.flatnonzero(far > _FAR), False


def relaxing_terms(data: StiffnessData, times: FloatArray) -> tuple[ComplexArray, FloatArray]:
    """K* (N, k) and K1 (k,) of the terms of the best relaxing specimen of one condition, per unit of coefficients.

    If K1 is known at zero frequency, the first of two constants is an arm that relaxes too slowly for the band: it is
    part of K*, but not of K1.
    """
    terms, static = terms_of(data.omega, times, data.omega.max()), _static_of(data, times)
    if data.has_k1 and not data.ramp:
        terms, static = np.concatenate([terms[:, :1], terms], axis=1), np.append(0.0, static)
    return terms, static


def terms_of(omega: FloatArray, times: FloatArray, top: float) -> ComplexArray:
    """K* (F, T + 2) of a unit spring, of unit arms, and of a damper that is 1 N/m at `top` [rad/s]."""
    return np.concatenate([spring_and_arms(omega, times), 1j * omega[:, None] / top], axis=1)


def _static_of(data: StiffnessData, times: FloatArray) -> FloatArray:
    """K1 (T + 2,) of these terms."""
    return np.concatenate([[1.0], data.static_share(times), [0.0]])


def _finer(times: FloatArray, active: np.ndarray) -> FloatArray:
    """The times with further ones around the active ones."""
    logs = np.log(times)
    near = np.flatnonzero(active)
    ends = [(max(int(i) - 1, 0), min(int(i) + 1, logs.size - 1)) for i in near.tolist()]
    more = [np.linspace(logs[low], logs[high], _MORE) for low, high in ends]
    return np.exp(np.unique(np.concatenate([logs, *more])))


def passive_range(data: StiffnessData, omega: FloatArray) -> FloatArray:
    """95 % intervals (F, 2, 2) [N/m] of K' and K'' over all passive linear tyres without inertia.

    An end of an interval is the value at which the least chi-square over all non-negative relaxation spectra has risen
    by 3.84. A model has a form; here only the sign of the terms is assumed.

    Parameters
    ----------
    data : StiffnessData
        Data of one condition, with K1 as the tangent of a ramp.
    omega : (F,) float array [rad/s]
        Angular frequencies.
    """
    (condition,) = whitened_conditions(data)
    times = grid_of(data, _BEYOND_RANGE)
    rows = condition.rows(terms_of(data.omega, times, data.omega.max()), _static_of(data, times))
    best = NonNegative.best(rows, condition.target)
    ends = np.empty((omega.size, 2, 2))
    for at, answer in enumerate(terms_of(omega, times, data.omega.max())):
        step = 0.01 * float(np.abs(answer @ best.weights))
        for part, term in enumerate((answer.real, answer.imag)):

            def height(value: float, term: FloatArray = term) -> float:
                scale = _HELD / max(abs(value), float(np.max(term)) * 1e-3)
                held = np.vstack([rows, scale * term])
                return rise_of(held, np.append(condition.target, scale * value), best.chi2)

            ends[at, part] = profile_ends(height, float(term @ best.weights), step, NORMAL_95)
    return ends
