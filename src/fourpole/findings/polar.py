"""Values of a row of results with their uncertainty; |K*| and the loss angle from real and imaginary part."""

from __future__ import annotations

from collections.abc import Mapping
from math import atan2, hypot, isfinite, nan
from typing import Any

from fourpole import quantities as q
from fourpole.quantities import Quantity


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
