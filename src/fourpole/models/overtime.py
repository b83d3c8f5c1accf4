r"""Relaxation and creep over time as a Prony series, by the non-negative measure of relaxation that K* has.

.. math::

    K(t) = K_\infty + \sum_i K_i e^{-t/\tau_i}, \qquad
    J(t) = J_0 + \sum_i J_i \left(1 - e^{-t/\lambda_i}\right) + \varphi t, \qquad K_\infty, K_i, J_0, J_i, \varphi \ge 0

K(t) is the force after a step of the deflection over the step, J(t) the deflection after a step of the force over that.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from fourpole.core import stats
from fourpole.core.arrays import ByValue, FloatArray
from fourpole.core.confidence import CHANCE, COVERAGE, NORMAL_95
from fourpole.errors import ModelError
from fourpole.models.data import MASTER_DECADES
from fourpole.models.discrepancy import LEAST_DOF, student_factor
from fourpole.models.interface import Arms
from fourpole.models.nonnegative import NonNegative

#: Times per decade of the grid: a single relaxation is met within 0.1 %. Those of a master curve, which has many.
_FINE, _COARSE = 12, 4
#: Decades of the grid below and above the times of the data. Of a faster arm only e^(-t/tau) is left at the first time,
#: so that noise there would become a large stiffness.
_BELOW, _ABOVE = 0.25, 0.5
#: Share of the least compliance that is instantaneous at least: a specimen has an instantaneous stiffness.
_SUDDEN = 1e-3
#: A part of the compliance that is a smaller share of the largest one is round-off.
_ROUND_OFF = 1e-9
#: Halvings by which a root between two poles is found.
_HALVINGS = 100
#: Ends of the search for a relative error.
_LEAST_ERROR, _MOST_ERROR = 1e-7, 10.0


@dataclass(frozen=True, eq=False)
class TimeFit(ByValue):
    """A Prony series fitted to relaxation or creep.

    Attributes
    ----------
    arms : Arms
        The stiffness at rest and the arms, all above zero, in falling order of the relaxation time.
    covariance : (2n + 1, 2n + 1) float array
        Covariance of K_inf, K_1 ... K_n, tau_1 ... tau_n; 0 for times of the grid.
    intervals : (2n + 1, 2) float array
        Their 95 % intervals.
    error : float [1]
        Relative error of the data that was added to the stated uncertainty, or stands in place of it.
    chi2, dof : float, int
    """

    arms: Arms
    covariance: FloatArray
    intervals: FloatArray
    error: float
    chi2: float
    dof: int


def fit_relaxation(
    time: FloatArray, stiffness: FloatArray, std: FloatArray | None = None, *, per_decade: int | None = None
) -> TimeFit:
    """Fit K(t) of a relaxation test.

    Parameters
    ----------
    time : (N,) float array [s]
        Times after the step, >= 0.
    stiffness : (N,) float array [N/m]
        Force over deflection, > 0; or a modulus [Pa].
    std : (N,) float array, optional [N/m]
        Standard uncertainties. Without them the residuals give one relative uncertainty, with Student's t.
    per_decade : int, optional
        Relaxation times per decade of the grid; by default those of `density`.

    Returns
    -------
    TimeFit

    Raises
    ------
    ModelError
        If there are too few data.

    References
    ----------
    N. W. Tschoegl, "The phenomenological theory of linear viscoelastic behavior", 1989, ch. 4.

    Examples
    --------
    >>> time = np.geomspace(0.01, 10.0, 40)
    >>> found = fit_relaxation(time, 1e5 + 5e4 * np.exp(-time / 0.5), np.full(40, 10.0))
    >>> round(found.arms.rest, -2), round(found.arms.instantaneous, -2)
    (100000.0, 150000.0)
    """
    times = _grid(time, per_decade)
    rows = np.concatenate([np.ones((time.size, 1)), np.exp(-time[:, None] / times)], axis=1)
    found, error, dof = _fitted(rows, stiffness, stiffness, std)
    arms = np.flatnonzero(found.weights[1:] > 0)
    kept, none = np.append(0, 1 + arms), np.zeros((arms.size, arms.size))
    values = np.concatenate([found.weights[kept], times[arms]])
    covariance = scipy.linalg.block_diag(found.covariance[np.ix_(kept, kept)], none)
    ends = np.stack([values, values], axis=1)
    stds = np.sqrt(np.diag(found.covariance))
    ends[: kept.size] = found.profiles(kept, stds, float(np.sqrt(stats.chi2.ppf(COVERAGE, 1))))
    arms_of = Arms(float(values[0]), values[1 : kept.size], values[kept.size :])
    return TimeFit(arms_of, covariance, ends, error, found.chi2, dof)


def fit_creep(
    time: FloatArray, compliance: FloatArray, std: FloatArray | None = None, *, per_decade: int | None = None
) -> TimeFit:
    """Fit J(t) of a creep test (N,) [m/N], and convert it to the stiffness exactly; see `fit_relaxation`.

    Examples
    --------
    >>> time = np.geomspace(0.01, 10.0, 40)
    >>> found = fit_creep(time, 1e-5 - 5e-6 * np.exp(-time / 0.5), np.full(40, 1e-9))
    >>> round(found.arms.rest, -2), round(found.arms.instantaneous, -3)
    (100000.0, 200000.0)
    """
    times = _grid(time, per_decade)
    delayed = -np.expm1(-time[:, None] / times)
    rows = np.concatenate([np.ones((time.size, 1)), delayed, time[:, None] / time.max()], axis=1)
    sudden = _SUDDEN * float(compliance.min())
    found, error, dof = _fitted(rows, compliance - sudden, compliance, std)
    weights = found.weights + np.append(sudden, np.zeros(times.size + 1))
    weights = np.where(weights > _ROUND_OFF * weights.max(), weights, 0.0)
    used = np.flatnonzero(weights[1:-1])
    scale = np.append(np.ones(1 + used.size), 1 / time.max())
    kept = np.concatenate([[0], 1 + used, [times.size + 1]])
    arms, slopes = stiffness_of(weights[0], weights[1 + used], times[used], float(weights[-1] / time.max()))
    slopes = slopes * scale
    covariance = slopes @ found.covariance[np.ix_(kept, kept)] @ slopes.T
    values = np.concatenate([[arms.rest], arms.springs, arms.times])
    half = NORMAL_95 * np.sqrt(np.maximum(np.diag(covariance), 0.0))
    ends = np.stack([np.maximum(values - half, 0.0), values + half], axis=1)
    return TimeFit(arms, covariance, ends, error, found.chi2, dof)


def stiffness_of(
    sudden: float, compliances: FloatArray, times: FloatArray, fluidity: float = 0.0
) -> tuple[Arms, FloatArray]:
    r"""The Prony series of the stiffness of a creep compliance, exactly, and its derivatives.

    The relaxation times are at the zeros of :math:`J^*(s) = J_0 + \sum_i J_i/(1 + s\lambda_i) + \varphi/s`, of which
    one lies between each two of its poles, and :math:`K_k = -1/(r_k J^{*\prime}(-r_k))` with :math:`r_k = 1/\tau_k`.

    Parameters
    ----------
    sudden : float [m/N]
        J_0, > 0.
    compliances, times : (n,) float arrays [m/N], [s]
        J_i > 0 and retardation times.
    fluidity : float [m/(N s)]
        Creep rate at the end over the force; 0 for a specimen that rests.

    Returns
    -------
    Arms
    (2m + 1, n + 2) float array
        Derivatives of K_inf, K_1 ... K_m, tau_1 ... tau_m by J_0, J_1 ... J_n and the fluidity.

    References
    ----------
    B. Gross, "Mathematical structure of the theories of viscoelasticity", 1953 (zeros and poles alternate).

    Examples
    --------
    A spring of 100 kN/m parallel to an arm of 50 kN/m and 0.2 s:

    >>> arms, _ = stiffness_of(1 / 150e3, np.array([1 / 100e3 - 1 / 150e3]), np.array([0.2 * 150e3 / 100e3]))
    >>> round(arms.rest), arms.springs.round(3).tolist(), arms.times.round(6).tolist()
    (100000, [50000.0], [0.2])
    """
    order = np.argsort(-times)
    slow, part = times[order], compliances[order]
    whole, poles = sudden + float(compliances.sum()), 1.0 / slow
    top = (float(poles[-1]) if poles.size else 0.0) * (2 + 2 * whole / sudden) + 4 * fluidity / sudden
    ends = np.append(poles, top)
    if fluidity > 0:
        ends = np.append(min(0.5 * ends[0], 0.5 * fluidity / (2 * whole)), ends)
    low, high = np.log(ends[:-1]), np.log(ends[1:])
    with np.errstate(divide="ignore"):  # a root that round-off moves onto a pole
        for _ in range(_HALVINGS):
            middle = 0.5 * (low + high)
            rate = np.exp(middle)[:, None]
            above = sudden + np.sum(part / (1 - rate * slow), axis=1) - fluidity / rate[:, 0] > 0
            low, high = np.where(above, low, middle), np.where(above, middle, high)
    rates = np.exp(0.5 * (low + high))
    share = 1 / (1 - rates[:, None] * slow)
    rise = np.sum(part * slow * share**2, axis=1) + fluidity / rates**2
    springs = 1 / (rates * rise)
    by = np.concatenate([np.ones((rates.size, 1)), share, -1 / rates[:, None]], axis=1)
    moved = -by / rise[:, None]
    bend = np.sum(2 * part * slow**2 * share**3, axis=1) - 2 * fluidity / rates**3
    rise_by = np.concatenate([np.zeros((rates.size, 1)), slow * share**2, 1 / rates[:, None] ** 2], axis=1)
    rise_by = rise_by + bend[:, None] * moved
    springs_by = -springs[:, None] * (moved / rates[:, None] + rise_by / rise[:, None])
    rests = float(fluidity == 0)
    rest_by = np.append(np.full(1 + slow.size, -1 / whole**2), 0.0) * rests
    slopes = np.concatenate([rest_by[None], springs_by, -moved / rates[:, None] ** 2])
    back = np.concatenate([[0], 1 + np.argsort(order), [slow.size + 1]])
    return Arms(float(rests / whole), springs, 1 / rates), slopes[:, back]


def density(time: FloatArray) -> int:
    """Usual number of relaxation times per decade for data at times (N,) [s]; ModelError for fewer than two above 0."""
    positive = time[time > 0]
    if np.unique(positive).size < 2:
        raise ModelError("too few times: relaxation or creep needs two times above zero, and more")
    return _FINE if positive.max() < 10.0**MASTER_DECADES * positive.min() else _COARSE


def _grid(time: FloatArray, per_decade: int | None) -> FloatArray:
    """Times (k,) [s] over the data, rising."""
    per_decade, positive = per_decade or density(time), time[time > 0]
    low, high = np.log10(positive.min()) - _BELOW, np.log10(positive.max()) + _ABOVE
    return np.logspace(low, high, int(np.ceil((high - low) * per_decade)) + 1)


def _fitted(
    rows: FloatArray, target: FloatArray, values: FloatArray, std: FloatArray | None
) -> tuple[NonNegative, float, int]:
    """The best weights, the relative error of the data and the degrees of freedom; the error is one of `values`."""

    def at(error: float) -> tuple[NonNegative, int]:
        size = np.hypot(0.0 if std is None else std, error * values)
        found = NonNegative.best(rows / size[:, None], target / size)
        return found, target.size - found.used

    def excess(log: float) -> float:
        found, dof = at(float(np.exp(log)))
        return float(np.log(max(found.chi2, 1e-300) / max(dof, 1)))

    found, dof = at(1.0 if std is None else 0.0)
    error = 0.0
    if std is None:
        if dof < LEAST_DOF:
            raise ModelError(
                f"no uncertainty is stated, and it cannot be found from {target.size} rows: state --std, as --std '1 %'"
            )
        error = max(float(np.sqrt(found.chi2 / dof)), _LEAST_ERROR) * student_factor(dof)
    elif stats.chi2.sf(found.chi2, max(dof, 1)) < CHANCE:
        error = float(np.exp(scipy.optimize.brentq(excess, np.log(_LEAST_ERROR), np.log(_MOST_ERROR), xtol=1e-3)))
    found, dof = at(error)
    if dof < 0:
        raise ModelError(f"{target.size} rows are too few for {target.size - dof} terms")
    return found, error, dof
