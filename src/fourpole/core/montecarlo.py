"""Intervals of K2 and C by Monte Carlo, where linear propagation cannot tell: near the pole of K2."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fourpole.core.arrays import ByValue, ComplexArray, FloatArray
from fourpole.core.channelerrors import ChannelUncertainty
from fourpole.core.phasor import Phasors
from fourpole.core.rig import Rig
from fourpole.core.routes import mobility_route, relative_route, transmissibility_route

__all__ = ["LEVELS", "Interval", "arm_intervals", "draw_around", "draw_route"]

#: Probabilities of the quantiles.
LEVELS = (0.025, 0.5, 0.975)


@dataclass(frozen=True, eq=False)
class Interval(ByValue):
    """Quantiles of K2 or C at `LEVELS`; infinite where no upper limit is known.

    Attributes
    ----------
    quantiles : (3,) float array [N/m] or [N s/m]
    impassive : float [1]
        Share of the draws that no passive spring or damper explains.
    """

    quantiles: FloatArray
    impassive: float


def draw_around(stiffness: complex, covariance: FloatArray, draws: int, rng: np.random.Generator) -> ComplexArray:
    """K* drawn from a normal distribution in log K*, (draws,) [N/m]; covariance of (Re, Im) K*."""
    turn = np.array([[stiffness.real, stiffness.imag], [-stiffness.imag, stiffness.real]]) / abs(stiffness) ** 2
    values, vectors = np.linalg.eigh(turn @ covariance @ turn.T)
    parts = (rng.standard_normal((draws, 2)) * np.sqrt(np.maximum(values, 0.0))) @ vectors.T
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
    """K* of one test by a route, with everything it rests on drawn from what is stated (JCGM 101); (draws,) [N/m].

    Parameters
    ----------
    phasors : Phasors
        Of one test.
    rig, route, channels : Rig or None, str, ChannelUncertainty
        As for `identify`.
    draws : int
    rng : numpy.random.Generator
    added_mass, added_mass_std : float [kg]

    Returns
    -------
    (draws,) complex array [N/m]
    """
    omega = float(phasors.omega)
    noise = _normal(phasors.covariance, draws, rng)
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
        if route == "relative":
            return relative_route(f1, v1, v2, omega)
        if route == "mobility":
            return mobility_route(v1 / f1, 1.0 / impedance, omega)
        return transmissibility_route(v2 / v1, impedance, omega)


def _normal(covariance: FloatArray, draws: int, rng: np.random.Generator) -> FloatArray:
    values, vectors = np.linalg.eigh(np.nan_to_num(covariance))
    return (rng.standard_normal((draws, values.size)) * np.sqrt(np.maximum(values, 0.0))) @ vectors.T


def arm_intervals(stiffness: ComplexArray, k1: FloatArray, omega: float) -> tuple[Interval, Interval]:
    """Quantiles of K2 and of C over draws of K* and K1.

    1/K2 and 1/C are what passes smoothly through the pole, so they are ordered; where they fall to zero or below, K2
    or C has no upper limit.

    Parameters
    ----------
    stiffness, k1 : (draws,) complex and float arrays [N/m]
    omega : float [rad/s]

    Examples
    --------
    >>> k2, c = arm_intervals(np.full(100, 194211.265309173 + 38773.596369347j), np.full(100, 180e3), 20 * np.pi)
    >>> k2.quantiles.round(1), c.quantiles.round(3)
    (array([120000., 120000., 120000.]), array([700., 700., 700.]))
    """
    compliance = 1.0 / (stiffness - k1)
    return _interval(compliance.real), _interval(-omega * compliance.imag)


def _interval(inverse: FloatArray) -> Interval:
    low = np.quantile(inverse[np.isfinite(inverse)], [1 - level for level in LEVELS])
    with np.errstate(divide="ignore"):
        return Interval(np.where(low > 0, 1.0 / low, np.inf), float(np.mean(~(inverse > 0))))
