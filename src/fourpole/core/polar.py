"""Modulus and loss angle of the dynamic stiffness, with their derivatives."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from fourpole.core.arrays import FloatArray


def polar(stiffness: ArrayLike) -> tuple[FloatArray, FloatArray]:
    r"""Modulus and loss angle of K*, and their derivatives by its real and imaginary part.

    .. math:: d|K^*| = \frac{K'\,dK' + K''\,dK''}{|K^*|}, \qquad d\delta = \frac{K'\,dK'' - K''\,dK'}{|K^*|^2}

    Parameters
    ----------
    stiffness : (...,) complex array [N/m]
        K* = K' + jK'', not zero.

    Returns
    -------
    values : (..., 2) float array [N/m], [rad]
        Modulus and loss angle.
    slopes : (..., 2, 2) float array [1], [rad m/N]
        Their derivatives: a row for each value, a column for K' and for K''. Not-a-number where K* is zero.

    Examples
    --------
    >>> polar_values, derivatives = polar(3.0 + 4.0j)
    >>> polar_values.tolist(), derivatives.tolist()
    ([5.0, 0.92729522], [[0.6, 0.8], [-0.16, 0.12]])
    """
    k = np.asarray(stiffness, dtype=complex)
    size = np.abs(k)
    with np.errstate(divide="ignore", invalid="ignore"):
        along, across = (np.stack([z.real, z.imag], axis=-1) / size[..., None] for z in (k, 1j * k))
        slopes = np.stack([along, across / size[..., None]], axis=-2)
    return np.stack([size, np.angle(k)], axis=-1), slopes
