r"""The viscoelastic tyre: K1 parallel to a Maxwell arm of K2 and C (paper, eqs 5, 8-10 and 14, corrected).

The tyre is a massless Zener (standard linear) solid, whose K2 and C may differ at each frequency. It carries the moving
mass m. The preload spring K3, with a parallel damper c3, joins the mass to a fixed foundation.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from fourpole.core.arrays import ComplexArray, FloatArray


def _positive_omega(omega: ArrayLike) -> FloatArray:
    checked = np.asarray(omega, dtype=float)
    if not np.all(checked > 0):
        raise ValueError("the angular frequency must be positive everywhere [rad/s]")
    return checked


def zener_stiffness(k1: ArrayLike, k2: ArrayLike, c: ArrayLike, omega: ArrayLike) -> ComplexArray:
    r"""Dynamic stiffness of the viscoelastic tyre.

    .. math:: K^* = K_1 + \frac{j\omega C K_2}{K_2 + j\omega C}

    Parameters
    ----------
    k1, k2 : (...,) float arrays [N/m]
        Static stiffness, and the spring in series with the damper.
    c : (...,) float array [N s/m]
        The damper.
    omega : (...,) float array [rad/s]
        Angular frequency, > 0; all broadcast.

    Returns
    -------
    (...,) complex array [N/m]
        K*, e^{+jwt}.

    Raises
    ------
    ValueError
        If `omega` is not positive everywhere.

    References
    ----------
    Nosseir, El-Gindy, El-Saied, "Tyre radial properties", 1982, eq. (5).

    Examples
    --------
    >>> zener_stiffness(180e3, 120e3, 700.0, 2 * np.pi * 10).round(2)
    np.complex128(194211.27+38773.6j)
    """
    arm = 1j * _positive_omega(omega) * np.asarray(c)
    k2 = np.asarray(k2)
    return k1 + arm * k2 / (k2 + arm)


def loss_factor(stiffness: ArrayLike) -> FloatArray:
    r"""Loss factor of a dynamic stiffness, :math:`\eta = K''/K'`.

    Parameters
    ----------
    stiffness : (...,) complex array [N/m]
        K* = K' + jK''.

    Returns
    -------
    (...,) float array [1]
        K''/K'.

    References
    ----------
    ISO 4664-1:2022, clause 3 (terms); ASTM D5992, section 3; ISO 10846-1:2008, 3.8 (loss factor of a mount).

    Examples
    --------
    >>> loss_factor(200e3 + 50e3j)
    np.float64(0.25)
    """
    stiffness = np.asarray(stiffness)
    return (stiffness.imag / stiffness.real)[()]


def energy_loss(stiffness: ArrayLike, amplitude: ArrayLike) -> FloatArray:
    r"""Energy lost per cycle in the tyre, :math:`W = \pi K'' X^2`.

    Parameters
    ----------
    stiffness : (...,) complex array [N/m]
        K* of the tyre.
    amplitude : (...,) float array [m]
        0-to-peak amplitude X of the deflection across the tyre.

    Returns
    -------
    (...,) float array [J]
        Energy lost per cycle.

    References
    ----------
    ISO 4664-1:2022, clause 3 (terms of periodic deformation); ASTM D5992, section 3.

    Examples
    --------
    >>> energy_loss(200e3 + 40e3j, 1e-3).round(6)
    np.float64(0.125664)
    """
    return (np.pi * np.asarray(stiffness).imag * np.asarray(amplitude) ** 2)[()]


def _rig_stiffness(
    omega: FloatArray, mass: ArrayLike, preload_stiffness: ArrayLike, preload_damping: ArrayLike
) -> ComplexArray:
    """K3 - m w^2 + j w c3: force on the rig above the tyre over its displacement [N/m]."""
    return preload_stiffness - omega**2 * np.asarray(mass) + 1j * omega * np.asarray(preload_damping)


def mobility(
    stiffness: ArrayLike,
    omega: ArrayLike,
    *,
    mass: ArrayLike,
    preload_stiffness: ArrayLike,
    preload_damping: ArrayLike = 0.0,
) -> ComplexArray:
    r"""Mobility V1/F1 = R + jI of a massless tyre under its moving mass and preload spring.

    .. math:: M = \frac{j\omega}{K^*} + \frac{j\omega}{K_3 - \omega^2 m + j\omega c_3}

    Parameters
    ----------
    stiffness : (...,) complex array [N/m]
        Dynamic stiffness K* of the tyre.
    omega : (...,) float array [rad/s]
        Angular frequency, > 0; broadcasts with `stiffness`.
    mass, preload_stiffness, preload_damping : float [kg], [N/m], [N s/m]
        The rig above the tyre; >= 0. M is infinite at the resonance of the rig itself, m w^2 = K3 with c3 = 0.

    Returns
    -------
    (...,) complex array [m/(N s)]
        V1/F1.

    Raises
    ------
    ValueError
        If `omega` is not positive everywhere.

    Notes
    -----
    Deviation from the source: the text above eq. (8) calls F1/V1 the mobility; eq. (1) defines V/F, as here.

    References
    ----------
    Nosseir, El-Gindy, El-Saied, "Tyre radial properties", 1982, eqs (1), (8). ISO 7626-1:2011, 3.1.2.

    Examples
    --------
    >>> mobility(194211.27 + 38773.60j, 2 * np.pi * 10, mass=15.0, preload_stiffness=12440.0).round(8)
    np.complex128(6.211e-05-0.00103208j)
    """
    omega = _positive_omega(omega)
    rig = _rig_stiffness(omega, mass, preload_stiffness, preload_damping)
    return 1j * omega / np.asarray(stiffness) + 1j * omega / rig


def transmissibility(
    stiffness: ArrayLike,
    omega: ArrayLike,
    *,
    mass: ArrayLike,
    preload_stiffness: ArrayLike,
    preload_damping: ArrayLike = 0.0,
) -> ComplexArray:
    r"""Motion transmissibility V2/V1 of a massless tyre under its moving mass.

    .. math:: T = \frac{K^*}{K^* + K_3 - \omega^2 m + j\omega c_3}

    Parameters
    ----------
    stiffness : (...,) complex array [N/m]
        Dynamic stiffness K* of the tyre.
    omega : (...,) float array [rad/s]
        Angular frequency, > 0; broadcasts with `stiffness`.
    mass, preload_stiffness, preload_damping : float [kg], [N/m], [N s/m]
        The rig above the tyre; >= 0.

    Returns
    -------
    (...,) complex array [1]
        V2/V1; its modulus is the paper's TR.

    Raises
    ------
    ValueError
        If `omega` is not positive everywhere.

    References
    ----------
    Nosseir, El-Gindy, El-Saied, "Tyre radial properties", 1982, eqs (5)-(7), (14).

    Examples
    --------
    >>> abs(transmissibility(194211.27 + 38773.60j, 2 * np.pi * 10, mass=15.0, preload_stiffness=12440.0)).round(4)
    np.float64(1.2991)
    """
    omega = _positive_omega(omega)
    stiffness = np.asarray(stiffness)
    return stiffness / (stiffness + _rig_stiffness(omega, mass, preload_stiffness, preload_damping))


def zener_mobility(
    k1: ArrayLike, k2: ArrayLike, c: ArrayLike, omega: ArrayLike, *, mass: ArrayLike, preload_stiffness: ArrayLike
) -> ComplexArray:
    r"""Mobility R + jI of the viscoelastic tyre on its rig, in the paper's closed form.

    With :math:`r = \omega C/K_2`,

    .. math::
        R = \frac{\omega^2 C}{K_1^2 + r^2 (K_1 + K_2)^2}, \qquad
        I = \omega\left[\frac{K_1 + r^2 (K_1 + K_2)}{K_1^2 + r^2 (K_1 + K_2)^2}
            + \frac{1}{K_3 - \omega^2 m}\right]

    Parameters
    ----------
    k1, k2 : (...,) float arrays [N/m]
        Static stiffness, and the spring in series with the damper.
    c : (...,) float array [N s/m]
        The damper.
    omega : (...,) float array [rad/s]
        Angular frequency, > 0; all broadcast.
    mass, preload_stiffness : float [kg], [N/m]
        The rig above the tyre; the paper's has no damper (with one, use :func:`mobility`).

    Returns
    -------
    (...,) complex array [m/(N s)]
        R + jI.

    Raises
    ------
    ValueError
        If `omega` is not positive everywhere.

    Notes
    -----
    Deviation from the source: eq. (8) as printed has K1 where its denominators need K1 squared; (9), (10) are right.

    References
    ----------
    Nosseir, El-Gindy, El-Saied, "Tyre radial properties", 1982, eqs (9), (10).

    Examples
    --------
    >>> zener_mobility(180e3, 120e3, 700.0, 2 * np.pi * 10, mass=15.0, preload_stiffness=12440.0).round(8)
    np.complex128(6.211e-05-0.00103208j)
    """
    omega = _positive_omega(omega)
    k1, k2, c = np.asarray(k1), np.asarray(k2), np.asarray(c)
    r2 = (omega * c / k2) ** 2
    denominator = k1**2 + r2 * (k1 + k2) ** 2
    real = omega**2 * c / denominator
    rig = np.real(_rig_stiffness(omega, mass, preload_stiffness, 0.0))
    imag = omega * ((k1 + r2 * (k1 + k2)) / denominator + 1.0 / rig)
    return real + 1j * imag


def zener_transmissibility(
    k1: ArrayLike, k2: ArrayLike, c: ArrayLike, omega: ArrayLike, *, mass: ArrayLike, preload_stiffness: ArrayLike
) -> FloatArray:
    r"""Modulus TR of the motion transmissibility of the viscoelastic tyre, in the paper's closed form.

    With :math:`r = \omega C/K_2` and :math:`X = K_3 - \omega^2 m`,

    .. math:: TR = \sqrt{\frac{K_1^2 + r^2 (K_1 + K_2)^2}{(K_1 + X)^2 + r^2 (K_1 + K_2 + X)^2}}

    Parameters
    ----------
    k1, k2 : (...,) float arrays [N/m]
        Static stiffness, and the spring in series with the damper.
    c : (...,) float array [N s/m]
        The damper.
    omega : (...,) float array [rad/s]
        Angular frequency, > 0; all broadcast.
    mass, preload_stiffness : float [kg], [N/m]
        The rig above the tyre; the paper's has no damper (with one, use :func:`transmissibility`).

    Returns
    -------
    (...,) float array [1]
        TR = abs(V2/V1).

    Raises
    ------
    ValueError
        If `omega` is not positive everywhere.

    Notes
    -----
    Deviation from the source: eq. (14) as printed multiplies (w C K2) where (w C / K2) squared must stand.

    References
    ----------
    Nosseir, El-Gindy, El-Saied, "Tyre radial properties", 1982, eq. (14).

    Examples
    --------
    >>> zener_transmissibility(180e3, 120e3, 700.0, 2 * np.pi * 10, mass=15.0, preload_stiffness=12440.0).round(4)
    np.float64(1.2991)
    """
    omega = _positive_omega(omega)
    k1, k2, c = np.asarray(k1), np.asarray(k2), np.asarray(c)
    r2 = (omega * c / k2) ** 2
    rig = np.real(_rig_stiffness(omega, mass, preload_stiffness, 0.0))
    return np.sqrt((k1**2 + r2 * (k1 + k2) ** 2) / ((k1 + rig) ** 2 + r2 * (k1 + k2 + rig) ** 2))
