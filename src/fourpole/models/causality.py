r"""Is the data itself possible: can any passive linear tyre have this K*, on just this band?

A passive linear tyre without inertia relaxes: its K* is a sum of non-negative terms,

.. math:: K^* = K_\infty + \sum_i K_i \frac{j\omega\tau_i}{1 + j\omega\tau_i} + j\omega C, \quad K_\infty, K_i, C \ge 0,

whatever lies outside the band. So the best such sum, by non-negative least squares weighted with the covariance, is
held against the noise: no extrapolation, no transform, and a narrow band is no trouble.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import optimize, stats

from fourpole.core.arrays import ComplexArray, FloatArray
from fourpole.errors import ModelError
from fourpole.models.data import StiffnessData

__all__ = ["Possible", "check_possible"]

#: Relaxation times per decade, and decades beyond the band on either side.
_PER_DECADE, _BEYOND = 12, 2.0
#: Times put between those that are used, and how often, until the data are met.
_MORE, _ROUNDS = 9, 8
#: Chance below which no passive tyre is believed.
_CHANCE = 1e-3
#: A frequency is named where it is further off than this, in standard uncertainties.
_FAR = 3.0


@dataclass(frozen=True)
class Possible:
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
    times: FloatArray
    spectrum: FloatArray


def check_possible(data: StiffnessData, enough: float = _CHANCE) -> Possible:
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
    omega = data.omega
    decades = np.log10(omega.max() / omega.min()) + 2 * _BEYOND
    count = int(np.ceil(decades * _PER_DECADE)) + 1
    times: FloatArray = 1.0 / np.geomspace(omega.min() / 10**_BEYOND, omega.max() * 10**_BEYOND, count)[::-1]
    whiten = data.whitener()
    for _ in range(_ROUNDS):
        looked_at, terms = times, _terms(omega, times)
        rows, wanted = _rows(whiten, terms, data)
        size = np.linalg.norm(rows, axis=0)
        found, norm = optimize.nnls(rows / size, wanted, maxiter=20 * terms.shape[1])
        chi2, active = float(norm**2), found > 0
        dof = max(wanted.size - int(np.sum(active)), 1)
        chance = float(stats.chi2.sf(chi2, dof))
        if chance > enough:
            break  # else a spectrum between the times may do better
        times = _finer(times, active[1:-1])
    weights = found / size
    residuals = data.stiffness - terms @ weights
    own = wanted - rows @ weights
    far = np.sqrt(np.sum(own[: 2 * omega.size].reshape(-1, 2) ** 2, axis=1) / 2)
    possible = chance > _CHANCE
    named = np.flatnonzero(far > _FAR) if not possible else np.empty(0, dtype=int)
    return Possible(
        possible=possible,
        chi2=chi2,
        dof=dof,
        chance=chance,
        residuals=residuals,
        far=far,
        impossible=omega[named] / (2 * np.pi),
        times=looked_at,
        spectrum=weights[1:-1],
    )


def _terms(omega: FloatArray, times: FloatArray) -> ComplexArray:
    """K_inf, an arm of each relaxation time, and a damper, per unit (N, T + 2)."""
    relaxed = 1.0 - 1.0 / (1.0 + 1j * omega[:, None] * times)
    return np.concatenate([np.ones((omega.size, 1)), relaxed, 1j * omega[:, None] / omega.max()], axis=1)


def _rows(whiten: FloatArray, terms: ComplexArray, data: StiffnessData) -> tuple[FloatArray, FloatArray]:
    """Terms and data in standard units; a known K1 is one more row."""
    rows, wanted = data.whitened(whiten, terms), data.whitened(whiten, data.stiffness[:, None])[:, 0]
    if not (np.isfinite(data.k1_std) and np.isfinite(data.k1)):
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
