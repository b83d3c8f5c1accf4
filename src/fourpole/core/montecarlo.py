"""Coverage intervals of K2 and C by Monte Carlo, for use where value ± 1.96 u is not a 95 % interval."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fourpole.core.arrays import ByValue, ComplexArray, FloatArray
from fourpole.core.channelerrors import ChannelUncertainty
from fourpole.core.confidence import LEVELS
from fourpole.core.phasor import Phasors
from fourpole.core.rig import Rig
from fourpole.core.routes import stiffness_by


@dataclass(frozen=True, eq=False)
class Interval(ByValue):
    """Quantiles of K2 or C at `LEVELS`; infinite if there is no upper limit.

    Attributes
    ----------
    quantiles : (3,) float array [N/m] or [N s/m]
    non_passive_share : float [1]
        Share of the draws whose K2 or C is not passive.
    """

    quantiles: FloatArray
    non_passive_share: float


def draw_around(stiffness: complex, covariance: FloatArray, draws: int, rng: np.random.Generator) -> ComplexArray:
    """Draws (draws,) of K* [N/m], normal in log K*, from the covariance (2, 2) of Re and Im of K*."""
    turn = np.array([[stiffness.real, stiffness.imag], [-stiffness.imag, stiffness.real]]) / abs(stiffness) ** 2
    parts = _normal(turn @ covariance @ turn.T, draws, rng)
    return np.asarray(stiffness * np.exp(parts[:, 0] + 1j * parts[:, 1]))


def draw_route(
    phasors: Phasors,
    rig: Rig | None,
    route: str,
    channels: ChannelUncertainty,
    draws: int,
    rng: np.random.Generator,
    *,
    added_mass: float = 0.0,
    added_mass_std: float = 0.0,
) -> ComplexArray:
    """Draws of K* of one test by a route, with all inputs drawn from normal distributions.

    Parameters
    ----------
    phasors : Phasors
        Phasors of one test.
    rig, route, channels : Rig or None, str, ChannelUncertainty
        The same as for `identify`.
    draws : int
        Number of draws.
    rng : numpy.random.Generator
    added_mass, added_mass_std : float [kg]
        Mass fixed to the moving mass, and its standard uncertainty.

    Returns
    -------
    (draws,) complex array [N/m]
        K*.

    References
    ----------
    JCGM 101:2008, 6.4.7, 6.4.8, 7.3 and 7.4.
    """
    omega = float(phasors.omega)
    noise = _normal(np.nan_to_num(phasors.covariance), draws, rng)
    off = np.zeros((draws, 3), dtype=complex)
    for error in channels.errors(np.array([omega])):
        off[:, error.channel] += rng.standard_normal(draws) * error.std * error.turn[0]
    gains = np.exp(off)
    f1, v1, v2 = ((phasors.amplitudes + noise[:, ::2] + 1j * noise[:, 1::2]) * gains).T
    impedance: complex | ComplexArray = np.inf
    if rig is not None:
        spread = np.append(rig.uncertainties, added_mass_std) * rng.standard_normal((draws, rig.uncertainties.size + 1))
        if not rig.blocked:
            impedance = rig.impedance(omega, added_mass) + spread @ rig.impedance_gradient(omega, added_mass)
        f1 = f1 - 1j * omega * (rig.input_mass + spread[:, -2]) * v1
    with np.errstate(divide="ignore", invalid="ignore"):
        return stiffness_by(route, (f1, v1, v2), impedance, omega)


def _normal(covariance: FloatArray, draws: int, rng: np.random.Generator) -> FloatArray:
    """Draws (draws, k) of a normal distribution with mean 0 and a covariance (k, k)."""
    values, vectors = np.linalg.eigh(covariance)
    return (rng.standard_normal((draws, values.size)) * np.sqrt(np.maximum(values, 0.0))) @ vectors.T


def arm_intervals(stiffness: ComplexArray, k1: FloatArray, omega: float) -> tuple[Interval, Interval]:
    """Quantiles of K2 and of C over draws of K* and K1.

    The quantiles are those of 1/K2 and 1/C, which are continuous at the pole. If a quantile of 1/K2 or 1/C is zero or
    negative, K2 or C has no upper limit.

    Parameters
    ----------
    stiffness, k1 : (draws,) complex and float arrays [N/m]
        Draws of K* and of K1.
    omega : float [rad/s]

    Notes
    -----
    Deviation from the source: the number of draws is fixed, without the adaptive procedure of JCGM 101, 7.9.

    References
    ----------
    JCGM 101:2008, 7.5 to 7.7; the interval is probabilistically symmetric.

    Examples
    --------
    >>> k2, c = arm_intervals(np.full(100, 194211.265309173 + 38773.596369347j), np.full(100, 180e3), 20 * np.pi)
    >>> k2.quantiles.round(1).tolist(), c.quantiles.round(3).tolist()
    ([120000.0, 120000.0, 120000.0], [700.0, 700.0, 700.0])
    """
    compliance = 1.0 / (stiffness - k1)
    return _interval(compliance.real), _interval(-omega * compliance.imag)


def _interval(inverse: FloatArray) -> Interval:
    """Quantiles of a quantity from draws of its inverse."""
    low = np.quantile(inverse[np.isfinite(inverse)], [1 - level for level in LEVELS])
    with np.errstate(divide="ignore"):
        return Interval(np.where(low > 0, 1.0 / low, np.inf), float(np.mean(~(inverse > 0))))
