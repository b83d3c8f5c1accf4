"""Modulus, loss angle and ratios of complex values, with their derivatives; the values of a row of results."""

from __future__ import annotations

from collections.abc import Mapping
from math import atan2, hypot, isfinite, nan
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from fourpole import quantities as q
from fourpole.core.arrays import ComplexArray, FloatArray, parts
from fourpole.quantities import Quantity


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
        along, across = (parts(z) / size[..., None] for z in (k, 1j * k))
        slopes = np.stack([along, across / size[..., None]], axis=-2)
    return np.stack([size, np.angle(k)], axis=-1), slopes


def ratio(
    over: ComplexArray, by_over: ComplexArray, under: ComplexArray, by_under: ComplexArray
) -> tuple[ComplexArray, ComplexArray]:
    """A ratio (N,), and its derivatives (N, inputs)."""
    value = over / under
    return value, (by_over - value[:, None] * by_under) / under[:, None]


def modulus(value: ComplexArray, by_value: ComplexArray) -> FloatArray:
    """Derivatives (N, inputs) of abs(value)."""
    return (np.conj(value)[:, None] * by_value).real / np.abs(value)[:, None]


def loss_factor_of(stiffness: ComplexArray, by_stiffness: ComplexArray) -> tuple[FloatArray, FloatArray]:
    """K''/K' (N,) [1], and its derivatives (N, inputs)."""
    value = stiffness.imag / stiffness.real
    return value, (by_stiffness.imag - value[:, None] * by_stiffness.real) / stiffness.real[:, None]


def value_of(quantity: Quantity, row: Mapping[str, Any]) -> tuple[float, float] | None:
    """Value and standard uncertainty of a row; None where it has no value."""
    if quantity.key in (q.MODULUS.key, q.LOSS_ANGLE.key):
        return _polar(quantity, row)
    value, std = (row.get(head) for head in quantity.heads)
    if value is None or not isfinite(value):
        return None
    return float(value), float(std) if std is not None and isfinite(std) else 0.0


def _polar(quantity: Quantity, row: Mapping[str, Any]) -> tuple[float, float] | None:
    """|K*| or the loss angle with its standard uncertainty, from real and imaginary part to first order."""
    storage, loss = value_of(q.STORAGE, row), value_of(q.LOSS, row)
    if storage is None or loss is None:
        return None
    (re, u_re), (im, u_im), corr = storage, loss, row.get(q.CORR_K.head) or 0.0
    size, modulus = hypot(re, im), quantity.key == q.MODULUS.key
    if not size:
        return (0.0, nan)
    by_re, by_im = (re / size, im / size) if modulus else (-im / size**2, re / size**2)  # as `core.polar` has them
    variance = (by_re * u_re) ** 2 + (by_im * u_im) ** 2 + 2 * corr * by_re * by_im * u_re * u_im
    return size if modulus else atan2(im, re), max(variance, 0.0) ** 0.5
