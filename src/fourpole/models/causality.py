r"""Is the data itself possible: can any passive linear tyre have this K*, on just this band?

A passive linear tyre without inertia relaxes: its K* is a sum of non-negative terms,

.. math:: K^* = K_\infty + \sum_i K_i \frac{j\omega\tau_i}{1 + j\omega\tau_i} + j\omega C, \quad K_\infty, K_i, C \ge 0,

whatever lies outside the band. So the best such sum, by non-negative least squares weighted with the covariance, is
held against the noise: no extrapolation, no transform, and a narrow band is no trouble.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy import optimize, stats

from fourpole.core.arrays import ByValue, ComplexArray, FloatArray
from fourpole.errors import ModelError
from fourpole.models.data import CHANCE, StiffnessData

__all__ = ["Possible", "check_possible"]

#: Relaxation times per decade, and decades beyond the band on either side.
_PER_DECADE, _BEYOND = 12, 2.0
#: Times put between those that are used, and how often, until the data are met.
_MORE, _ROUNDS = 9, 8
#: A round that takes off less than this share of what is too much is the last.
_STUCK = 0.03
#: Where the grid of times does not do, up to so many times are moved, so often, by so much of a logarithm at once.
_MOST_MOVED, _MOVES, _FARTHEST_MOVE = 12, 6, 0.3
#: Frequencies are left out one by one, up to so many, to see which are at fault.
_MOST_NAMED = 3
#: A frequency is named where it is further off than this, in standard uncertainties.
_FAR = 3.0


@dataclass(frozen=True, eq=False)
class Possible(ByValue):
    """The verdict on K* over a band.

    Attributes
    ----------
    possible : bool
    chi2, dof, chance : float, int, float [1]
        Misfit of the best passive tyre; data less active terms; probability of as much by noise alone.
    residuals : (N,) complex array [N/m]
        K* less that tyre's.
    far : (N,) float array [1]
        How far each frequency is off, in its standard uncertainty.
    impossible : (n,) float array [Hz]
        Frequencies that no passive linear tyre can give, with the others as they are; empty where it is possible.
    without_k1 : bool
        Whether K* by itself is possible, and only K1 contradicts it.
    times, spectrum : (T,), (T,) float arrays [s], [N/m]
        Relaxation times, and the best non-negative spectrum over them.
    """

    possible: bool
    chi2: float
    dof: int
    chance: float
    residuals: ComplexArray
    far: FloatArray
    impossible: FloatArray
    without_k1: bool
    times: FloatArray
    spectrum: FloatArray


def check_possible(data: StiffnessData, enough: float = CHANCE) -> Possible:
    """Hold K* of one condition against all passive linear tyres.

    Parameters
    ----------
    data : StiffnessData
        Of one condition; with its K1, where that is known.
    enough : float [1]
        Chance at which no better spectrum is looked for between the relaxation times.

    Returns
    -------
    Possible

    Raises
    ------
    ModelError
        If there are several conditions, or the covariance says nothing.

    References
    ----------
    C. L. Lawson, R. J. Hanson, "Solving least squares problems", 1974, ch. 23; B. A. Boukamp, "A linear Kronig-Kramers
    transform test for immittance data validation", J. Electrochem. Soc. 142, 1995, which this sharpens by the sign.

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
        raise ModelError("the verdict is on one condition at a time: choose one")
    best = _best(data, enough)
    possible = best.chance > CHANCE
    far = np.sqrt(np.sum(best.left[: 2 * data.count].reshape(-1, 2) ** 2, axis=1) / 2)
    named, alone = (np.empty(0, dtype=int), False) if possible else _named(data, best, far)
    return Possible(
        possible=possible,
        chi2=best.chi2,
        dof=best.dof,
        chance=best.chance,
        residuals=data.stiffness - best.told,
        far=far,
        impossible=data.omega[named] / (2 * np.pi),
        without_k1=alone,
        times=best.times,
        spectrum=best.spectrum,
    )


@dataclass(frozen=True)
class _Best:
    """The best passive tyre: its misfit, K* (N,), what it leaves in standard units (M,), and its spectrum."""

    chi2: float
    dof: int
    chance: float
    told: ComplexArray
    left: FloatArray
    times: FloatArray
    spectrum: FloatArray


def _best(data: StiffnessData, enough: float) -> _Best:
    omega = data.omega
    decades = np.log10(omega.max() / omega.min()) + 2 * _BEYOND
    count = int(np.ceil(decades * _PER_DECADE)) + 1
    times: FloatArray = 1.0 / np.geomspace(omega.min() / 10**_BEYOND, omega.max() * 10**_BEYOND, count)[::-1]
    whiten, before = data.whitener(), np.inf
    for _ in range(_ROUNDS):
        best = _with_times(data, whiten, times)
        if best.chance > enough or before - best.chi2 < _STUCK * (best.chi2 - best.dof):
            break  # else a spectrum between the times may do better
        times, before = _finer(times, best.spectrum > 0), best.chi2
    return best if best.chance > enough else _moved(data, whiten, best)


def _with_times(data: StiffnessData, whiten: FloatArray, times: FloatArray) -> _Best:
    """The best tyre of given relaxation times."""
    known = bool(np.isfinite(data.k1_std) and np.isfinite(data.k1))
    terms = _terms(data.omega, times, known)
    rows, wanted = _rows(whiten, terms, data, known)
    size = np.linalg.norm(rows, axis=0)
    found, norm = optimize.nnls(rows / size, wanted, maxiter=20 * terms.shape[1])
    chi2, weights = float(norm**2), found / size
    dof = max(wanted.size - int(np.sum(found > 0)), 1)
    chance = float(stats.chi2.sf(chi2, dof))
    return _Best(chi2, dof, chance, terms @ weights, wanted - rows @ weights, times, weights[-times.size - 1 : -1])


def _moved(data: StiffnessData, whiten: FloatArray, best: _Best) -> _Best:
    """The same with few relaxation times, those close together made one, moved to where they fit best."""
    used = best.spectrum > 0
    logs, weights = np.log(best.times[used]), best.spectrum[used]
    if not logs.size:
        return best
    cluster = np.cumsum(np.diff(logs, prepend=logs[0]) > np.log(10.0) / _PER_DECADE * 1.5)
    total = np.bincount(cluster, weights)
    place = np.bincount(cluster, weights * logs) / total
    if place.size > _MOST_MOVED:
        return best
    for _ in range(_MOVES):
        tried = _with_times(data, whiten, np.exp(place))
        if tried.chi2 < best.chi2 * (1 - 1e-9):
            best = tried
        if best.chance > CHANCE:
            break
        lag = 1j * data.omega[:, None] * np.exp(place)
        slopes = data.whitened(whiten, tried.spectrum * lag / (1 + lag) ** 2)
        flat = data.whitened(whiten, _terms(data.omega, np.exp(place), False))
        step = np.linalg.lstsq(np.concatenate([slopes, flat], axis=1), tried.left[: 2 * data.count], rcond=1e-12)[0]
        place = place + np.clip(step[: place.size], -_FARTHEST_MOVE, _FARTHEST_MOVE)
    return best


def _named(data: StiffnessData, best: _Best, far: FloatArray) -> tuple[np.ndarray, bool]:
    """The fewest frequencies without which the rest is possible, or all that are far off; whether K1 alone is at fault.

    The one that is farthest off is left out first, then of what remains; K1 too, where it is the farthest.
    """
    if best.left.size > 2 * data.count and _best(replace(data, k1=np.asarray(np.nan)), CHANCE).chance > CHANCE:
        return np.empty(0, dtype=int), True
    kept, worst = np.arange(data.count), far
    for _ in range(min(_MOST_NAMED, data.count - 2)):
        kept = np.delete(kept, int(np.argmax(worst)))
        rest = _best(data.part(kept), CHANCE)
        if rest.chance > CHANCE:
            return np.setdiff1d(np.arange(data.count), kept), False
        worst = np.sqrt(np.sum(rest.left[: 2 * kept.size].reshape(-1, 2) ** 2, axis=1))
    return np.flatnonzero(far > _FAR), False


def _terms(omega: FloatArray, times: FloatArray, known: bool) -> ComplexArray:
    """Per unit (N, ...): K_inf; with K1 known, what relaxes too slowly to be seen; arms by their times; a damper."""
    relaxed = 1.0 - 1.0 / (1.0 + 1j * omega[:, None] * times)
    one = np.ones((omega.size, 2 if known else 1))
    return np.concatenate([one, relaxed, 1j * omega[:, None] / omega.max()], axis=1)


def _rows(whiten: FloatArray, terms: ComplexArray, data: StiffnessData, known: bool) -> tuple[FloatArray, FloatArray]:
    """Terms and data in standard units; a known K1 is one more row."""
    rows, wanted = data.whitened(whiten, terms), data.whitened(whiten, data.stiffness[:, None])[:, 0]
    if not known:
        return rows, wanted
    at_rest = np.zeros(terms.shape[1])
    at_rest[0] = 1.0 / float(data.k1_std)
    return np.vstack([rows, at_rest]), np.append(wanted, float(data.k1 / data.k1_std))


def _finer(times: FloatArray, active: np.ndarray) -> FloatArray:
    """The times with more of them around those that are used."""
    logs = np.log(times)
    near = np.flatnonzero(active)
    ends = [(max(int(i) - 1, 0), min(int(i) + 1, logs.size - 1)) for i in near.tolist()]
    more = [np.linspace(logs[low], logs[high], _MORE) for low, high in ends]
    return np.exp(np.unique(np.concatenate([logs, *more])))
