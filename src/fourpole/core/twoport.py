r"""Four-poles of mechanical elements, and the mobility and transmissibility of their chains (paper, eqs 2-7).

A four-pole relates force and velocity at its input to force and velocity at its output,

.. math:: \begin{bmatrix} F_1 \\ V_1 \end{bmatrix} =
          \begin{bmatrix} a_{11} & a_{12} \\ a_{21} & a_{22} \end{bmatrix}
          \begin{bmatrix} F_2 \\ V_2 \end{bmatrix}.

It is an array of shape (..., 2, 2). Every function broadcasts over the leading axes (frequency, test).
The time factor is e^{+jwt}.
"""

from __future__ import annotations

from functools import reduce

import numpy as np
from numpy.typing import ArrayLike

from fourpole.core.arrays import ComplexArray

__all__ = ["cascade", "chain_mobility", "chain_transmissibility", "damper", "deembed", "inverse", "mass", "spring"]


def _fourpole(a11: ArrayLike, a12: ArrayLike, a21: ArrayLike, a22: ArrayLike) -> ComplexArray:
    entries = np.broadcast_arrays(a11, a12, a21, a22)
    stacked = np.stack(entries, axis=-1).astype(np.complex128)
    return stacked.reshape(*stacked.shape[:-1], 2, 2)


def mass(value: ArrayLike, omega: ArrayLike) -> ComplexArray:
    r"""Four-pole of a rigid mass.

    .. math:: \begin{bmatrix} 1 & j\omega m \\ 0 & 1 \end{bmatrix}

    Parameters
    ----------
    value : (...,) float array [kg]
        The mass m.
    omega : (...,) float array [rad/s]
        Angular frequency; broadcasts with `value`.

    Returns
    -------
    (..., 2, 2) complex array
        Entries in 1, N s/m, m/(N s), 1.

    References
    ----------
    Nosseir, El-Gindy, El-Saied, "Tyre radial properties", 1982, eq. (4).

    Examples
    --------
    >>> mass(15.0, 10.0)[0, 1]
    np.complex128(150j)
    """
    return _fourpole(1.0, 1j * np.asarray(omega) * np.asarray(value), 0.0, 1.0)


def spring(stiffness: ArrayLike, omega: ArrayLike) -> ComplexArray:
    r"""Four-pole of a massless spring, of real or complex stiffness.

    .. math:: \begin{bmatrix} 1 & 0 \\ j\omega/K & 1 \end{bmatrix}

    Parameters
    ----------
    stiffness : (...,) float or complex array [N/m]
        K, not zero; it may depend on frequency, as the K* of a tyre does.
    omega : (...,) float array [rad/s]
        Angular frequency; broadcasts with `stiffness`.

    Returns
    -------
    (..., 2, 2) complex array
        Entries in 1, N s/m, m/(N s), 1.

    Raises
    ------
    ValueError
        If a stiffness is zero: such a spring transmits no force.

    References
    ----------
    Nosseir, El-Gindy, El-Saied, "Tyre radial properties", 1982, eqs (4) and (5).

    Examples
    --------
    >>> spring(2000.0, 10.0)[1, 0]
    np.complex128(0.005j)
    """
    if np.any(np.asarray(stiffness) == 0):
        raise ValueError("a spring of zero stiffness joins nothing: leave it out of the chain")
    return _fourpole(1.0, 0.0, 1j * np.asarray(omega) / np.asarray(stiffness), 1.0)


def damper(coefficient: ArrayLike) -> ComplexArray:
    r"""Four-pole of a massless viscous damper.

    .. math:: \begin{bmatrix} 1 & 0 \\ 1/C & 1 \end{bmatrix}

    Parameters
    ----------
    coefficient : (...,) float array [N s/m]
        C, not zero.

    Returns
    -------
    (..., 2, 2) complex array
        Entries in 1, N s/m, m/(N s), 1.

    Raises
    ------
    ValueError
        If a coefficient is zero: such a damper transmits no force.

    References
    ----------
    Nosseir, El-Gindy, El-Saied, "Tyre radial properties", 1982, eq. (4).

    Examples
    --------
    >>> damper(500.0)[1, 0]
    np.complex128(0.002+0j)
    """
    if np.any(np.asarray(coefficient) == 0):
        raise ValueError("a damper of zero coefficient joins nothing: leave it out of the chain")
    return _fourpole(1.0, 0.0, 1.0 / np.asarray(coefficient), 1.0)


def cascade(*parts: ComplexArray) -> ComplexArray:
    """Four-pole of parts in series, from the input to the output.

    Parameters
    ----------
    *parts : (..., 2, 2) complex arrays
        Four-poles of the parts, at least one; leading axes broadcast.

    Returns
    -------
    (..., 2, 2) complex array
        The product of the parts in the order given.

    Raises
    ------
    ValueError
        If no part is given.

    References
    ----------
    Nosseir, El-Gindy, El-Saied, "Tyre radial properties", 1982, eqs (5)-(7).

    Examples
    --------
    A mass on a spring, held at the far end, resonates where a11 is zero:

    >>> omega = np.sqrt(2000.0 / 20.0)
    >>> bool(abs(cascade(mass(20.0, omega), spring(2000.0, omega))[0, 0]) < 1e-12)
    True
    """
    if not parts:
        raise ValueError("a cascade needs at least one four-pole")
    return reduce(np.matmul, parts)


def inverse(part: ComplexArray) -> ComplexArray:
    """Inverse of a four-pole: the cascade of both is the identity.

    Parameters
    ----------
    part : (..., 2, 2) complex array
        A four-pole that is not singular. The determinant of a reciprocal element is 1.

    Returns
    -------
    (..., 2, 2) complex array
        The inverse matrix.

    Examples
    --------
    >>> np.allclose(cascade(mass(3.0, 5.0), inverse(mass(3.0, 5.0))), np.eye(2))
    True
    """
    part = np.asarray(part)
    a11, a12, a21, a22 = part[..., 0, 0], part[..., 0, 1], part[..., 1, 0], part[..., 1, 1]
    determinant = a11 * a22 - a12 * a21
    return _fourpole(a22, -a12, -a21, a11) / determinant[..., None, None]


def deembed(
    chain: ComplexArray, *, before: ComplexArray | None = None, after: ComplexArray | None = None
) -> ComplexArray:
    """De-embed: remove known parts from a measured chain.

    Parameters
    ----------
    chain : (..., 2, 2) complex array
        The whole chain, ``before · inner · after``.
    before, after : (..., 2, 2) complex arrays, optional
        The known parts on the input and the output side.

    Returns
    -------
    (..., 2, 2) complex array
        The inner four-pole.

    Examples
    --------
    >>> tyre, rig = spring(200e3 + 40e3j, 60.0), mass(15.0, 60.0)
    >>> np.allclose(deembed(cascade(tyre, rig), after=rig), tyre)
    True
    """
    inner = np.asarray(chain)
    if before is not None:
        inner = inverse(before) @ inner
    if after is not None:
        inner = inner @ inverse(after)
    return inner


def chain_mobility(chain: ComplexArray) -> ComplexArray:
    r"""Driving-point mobility V1/F1 of a chain that ends on a fixed foundation.

    With no motion at the output, :math:`M = a_{21}/a_{11}`.

    Parameters
    ----------
    chain : (..., 2, 2) complex array
        The chain from the driving point to the foundation.

    Returns
    -------
    (...,) complex array [m/(N s)]
        V1/F1.

    References
    ----------
    Nosseir, El-Gindy, El-Saied, "Tyre radial properties", 1982, eqs (1) and (5)-(8).

    Examples
    --------
    >>> chain_mobility(spring(1000.0, 10.0))
    np.complex128(0.01j)
    """
    return np.asarray(chain[..., 1, 0] / chain[..., 0, 0])[()]


def chain_transmissibility(before: ComplexArray, after: ComplexArray) -> ComplexArray:
    r"""Motion at a junction of a chain over the motion at its input, foundation fixed.

    With :math:`a` the cascade of both parts and :math:`b` the part after the junction,
    :math:`V_2/V_1 = b_{21}/a_{21}`.

    Parameters
    ----------
    before, after : (..., 2, 2) complex arrays
        The chain before and after the junction; `after` ends on the foundation.

    Returns
    -------
    (...,) complex array [1]
        V2/V1.

    References
    ----------
    Nosseir, El-Gindy, El-Saied, "Tyre radial properties", 1982, eqs (5)-(7), (14).

    Examples
    --------
    Two equal springs halve the motion between them:

    >>> chain_transmissibility(spring(1000.0, 10.0), spring(1000.0, 10.0))
    np.complex128(0.5+0j)
    """
    whole = cascade(before, after)
    return np.asarray(after[..., 1, 0] / whole[..., 1, 0])[()]
