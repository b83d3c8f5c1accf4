r"""Formulas from phasors to the tyre: K* by three routes, then K2 and C (paper, eqs 11-13, corrected).

====================  ==================================  ==============  ==========
route                 K*                                  needs           blind to
====================  ==================================  ==============  ==========
``mobility``          :math:`j\omega/(V_1/F_1 - 1/Z_r)`   F1, V1, rig     V2
``relative``          :math:`j\omega F_1/(V_1 - V_2)`     F1, V1, V2      the rig
``transmissibility``  :math:`j\omega Z_r T/(1 - T)`       V1, V2, rig     the force
====================  ==================================  ==============  ==========
"""

from __future__ import annotations

from collections.abc import Sequence
from enum import Enum

import numpy as np
from numpy.typing import ArrayLike

from fourpole.core.arrays import ComplexArray, FloatArray

#: Routes that identify each test by itself.
ROUTES = ("mobility", "relative", "transmissibility")


def mobility_route(mobility: ArrayLike, rig_mobility: ArrayLike, omega: ArrayLike) -> ComplexArray:
    r"""K* from the mobility of tyre and rig, the paper's route.

    .. math:: K^* = \frac{j\omega}{M - 1/Z_r}

    Parameters
    ----------
    mobility, rig_mobility : (...,) complex arrays [m/(N s)]
        V1/F1 as measured, and 1/Zr of the rig beyond the tyre (0 for a blocked rig).
    omega : (...,) float array [rad/s]
        Angular frequency.

    Returns
    -------
    (...,) complex array [N/m]
        K* of the tyre.

    References
    ----------
    Nosseir, El-Gindy, El-Saied, "Tyre radial properties", 1982, eq. (8) solved for the tyre.

    Examples
    --------
    >>> mobility_route(0.002j, 0.001j, 100.0)
    np.complex128(100000+0j)
    """
    return 1j * np.asarray(omega) / (np.asarray(mobility) - np.asarray(rig_mobility))


def relative_route(f1: ArrayLike, v1: ArrayLike, v2: ArrayLike, omega: ArrayLike) -> ComplexArray:
    r"""K* from the force and the motion across the tyre; needs no rig.

    .. math:: K^* = \frac{j\omega F_1}{V_1 - V_2}

    Parameters
    ----------
    f1 : (...,) complex array [N]
        Force at the contact.
    v1, v2 : (...,) complex arrays [m/s]
        Velocity at the contact and beyond the tyre.
    omega : (...,) float array [rad/s]
        Angular frequency.

    Returns
    -------
    (...,) complex array [N/m]
        K* of the tyre.

    References
    ----------
    ISO 10846-1:2008, 3.7: with a blocked output, V2 = 0, this is the dynamic transfer stiffness of a specimen without
    inertia, whose force is the same at both ends.

    Examples
    --------
    >>> relative_route(100.0, 0.1j, 0.0, 100.0)
    np.complex128(100000+0j)
    """
    return 1j * np.asarray(omega) * np.asarray(f1) / (np.asarray(v1) - np.asarray(v2))


def transmissibility_route(transmissibility: ArrayLike, rig_impedance: ArrayLike, omega: ArrayLike) -> ComplexArray:
    r"""K* from the motion ratio and the rig; needs no force.

    .. math:: K^* = \frac{j\omega Z_r T}{1 - T}

    Parameters
    ----------
    transmissibility : (...,) complex array [1]
        T = V2/V1.
    rig_impedance : (...,) complex array [N s/m]
        Zr of the rig beyond the tyre.
    omega : (...,) float array [rad/s]
        Angular frequency.

    Returns
    -------
    (...,) complex array [N/m]
        K* of the tyre.

    Examples
    --------
    >>> transmissibility_route(2.0, 500j, 100.0)
    np.complex128(100000-0j)
    """
    t = np.asarray(transmissibility)
    return 1j * np.asarray(omega) * np.asarray(rig_impedance) * t / (1 - t)


def stiffness_by(
    route: str, amplitudes: Sequence[ComplexArray], rig_impedance: ArrayLike, omega: ArrayLike
) -> ComplexArray:
    """K* [N/m] by one of `ROUTES`, from the amplitudes (F1, V1, V2) at the tyre and the rig's impedance [N s/m]."""
    f1, v1, v2 = amplitudes
    if route == "relative":
        return relative_route(f1, v1, v2, omega)
    if route == "mobility":
        return mobility_route(v1 / f1, 1 / np.asarray(rig_impedance), omega)
    return transmissibility_route(v2 / v1, rig_impedance, omega)


def maxwell_arm(stiffness: ArrayLike, k1: ArrayLike, omega: ArrayLike) -> tuple[FloatArray, FloatArray]:
    r"""K2 and C of the arm parallel to K1: eqs (11) and (12), corrected.

    The arm is a sum of compliances, :math:`1/(K^* - K_1) = 1/K_2 + 1/(j\omega C)`, hence

    .. math:: K_2 = \frac{1}{\mathrm{Re}\,[1/(K^*-K_1)]}, \qquad C = \frac{-1}{\omega\,\mathrm{Im}\,[1/(K^*-K_1)]}

    Parameters
    ----------
    stiffness : (...,) complex array [N/m]
        K* of the tyre.
    k1 : (...,) float array [N/m]
        Static stiffness.
    omega : (...,) float array [rad/s]
        Angular frequency, > 0.

    Returns
    -------
    k2 : (...,) float array [N/m]
        Spring of the arm. A negative value (if Re K* < K1) or an infinite one is not passive.
    c : (...,) float array [N s/m]
        Damper of the arm. A negative value (if Im K* < 0) is not passive.

    Notes
    -----
    Deviation from the source: eq. (12) as printed lacks two squares. Corrected, with d of eq. (13) and the real part R
    of the tyre's mobility, :math:`K_2 = K_1 [(K_1/\omega)^2 + ((1-d)/R)^2] / [d(1-d)/R^2 - (K_1/\omega)^2]`. Eq. (11)
    is :math:`C = R[(K_1/\omega)^2 + ((1-d)/R)^2]`. Both give the same values as here, with a larger round-off.

    References
    ----------
    Nosseir, El-Gindy, El-Saied, "Tyre radial properties", 1982, eqs (11)-(13).

    Examples
    --------
    >>> k2, c = maxwell_arm(194211.26530917299 + 38773.596369347214j, 180e3, 2 * np.pi * 10)
    >>> k2.round(3), c.round(6)
    (np.float64(120000.0), np.float64(700.0))
    """
    arm = np.asarray(stiffness) - np.asarray(k1)
    with np.errstate(divide="ignore", invalid="ignore"):
        compliance = 1.0 / arm
        return (1.0 / compliance.real)[()], (-1.0 / (np.asarray(omega) * compliance.imag))[()]


def arm_slopes(
    stiffness: ComplexArray, k1: FloatArray, arm: tuple[FloatArray, FloatArray], omega: FloatArray, by: ComplexArray
) -> FloatArray:
    """Derivatives (N, 2, k) of the `arm` (K2, C) of `maxwell_arm`, from the derivatives `by` (N, k) of K* - K1."""
    k2, c = arm
    by_compliance = -by / ((stiffness - k1) ** 2)[:, None]
    return np.stack([-(k2**2)[:, None] * by_compliance.real, (omega * c**2)[:, None] * by_compliance.imag], axis=1)


def paper_d(stiffness: ArrayLike, k1: ArrayLike) -> FloatArray:
    r"""The paper's d, eq. (13): :math:`d = K_1 (I/\omega - 1/(K_3 - m\omega^2)) = K_1\,\mathrm{Re}(1/K^*)`.

    Parameters
    ----------
    stiffness : (...,) complex array [N/m]
        K* of the tyre.
    k1 : (...,) float array [N/m]
        Static stiffness.

    Returns
    -------
    (...,) float array [1]
        d; below 1 if the arm carries a share of the load.

    References
    ----------
    Nosseir, El-Gindy, El-Saied, "Tyre radial properties", 1982, eq. (13).

    Examples
    --------
    >>> paper_d(194211.26530917299 + 38773.596369347214j, 180e3).round(6)
    np.float64(0.8913)
    """
    return (np.asarray(k1) * (1.0 / np.asarray(stiffness)).real)[()]


class NoArm(Enum):
    """Why no passive K2 and C exist, and what to look for: `Identification.reasons` has it for users of the core."""

    NO_STIFFNESS = ("K* could not be found, so neither can K2 and C", "")
    NO_STORAGE = (
        "no passive K2, C exist: K' = {storage:.5g} kN/m is not positive; ",
        "look for an inverted force or motion channel, or a wrong moving mass",
    )
    NO_LOSS = (
        "no passive C exists: K'' = {loss_modulus:.5g} kN/m is not positive, the specimen would give energy; ",
        "look for an inverted channel, an undeclared delay or phase of a channel, or a wrong rig value",
    )
    NO_K1 = ("no static stiffness K1 is known, so K2 and C are left blank", "")
    BELOW_K1 = (
        "no passive K2 exists: K' = {storage:.5g} kN/m is not above the static K1 = {k1:.5g} kN/m; ",
        "look for a K1 taken at another load, amplitude or branch, a wrong moving mass, or a gain error",
    )

    def says(self, stiffness: complex, k1: float) -> tuple[str, str]:
        """The cause and what to look for, for K* and K1 [N/m]."""
        cause, remedy = self.value
        kilo = {"storage": stiffness.real / 1e3, "loss_modulus": stiffness.imag / 1e3, "k1": k1 / 1e3}
        return cause.format(**kilo), remedy


def no_arm(stiffness: complex, k1: float, k2: float, c: float) -> NoArm | None:
    """The reason why no passive K2, C exist; None if they exist."""
    if not np.isfinite(stiffness):
        return NoArm.NO_STIFFNESS
    if k2 > 0 and c > 0 and np.isfinite(k2) and np.isfinite(c):
        return None
    if stiffness.real <= 0:
        return NoArm.NO_STORAGE
    if stiffness.imag <= 0:
        return NoArm.NO_LOSS
    return NoArm.BELOW_K1 if np.isfinite(k1) else NoArm.NO_K1


def why_no_arm(stiffness: complex, k1: float, k2: float, c: float) -> str:
    """The reason why no passive K2, C exist, with the likely cause; an empty text if they exist."""
    reason = no_arm(stiffness, k1, k2, c)
    return "".join(reason.says(stiffness, k1)) if reason is not None else ""
