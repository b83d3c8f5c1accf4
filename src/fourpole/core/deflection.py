"""The amplitude of the deflection of a specimen, from the amplitudes of force and motion."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from fourpole.core.arrays import FloatArray


def deflection_amplitude(
    force: ArrayLike,
    contact: ArrayLike,
    far: ArrayLike,
    omega: ArrayLike,
    *,
    stiffness: ArrayLike = np.nan,
    blocked: bool = False,
) -> FloatArray:
    r"""Amplitude of the deflection, 0-to-peak.

    .. math:: x = |V_1 - V_2|/\omega , \quad\text{or, where V2 is not known,}\quad x = |F/K^*|

    Parameters
    ----------
    force, contact, far : (...,) complex arrays [N], [m/s]
        Force on the specimen, and the velocities of both sides; V2 is not-a-number where it is not known.
    omega : (...,) float array [rad/s]
        > 0.
    stiffness : (...,) complex array, optional [N/m]
        K*.
    blocked : bool
        Whether the far side does not move.

    Returns
    -------
    (...,) float array [m]
        Not-a-number where neither V2 nor K* is known.

    Examples
    --------
    >>> deflection_amplitude(100.0, 0.3, 0.1, 200.0), deflection_amplitude(100.0, 0.3, np.nan, 200.0, stiffness=2e5)
    (array(0.001), array(0.0005))
    """
    w, v1 = np.asarray(omega, dtype=float), np.asarray(contact, dtype=complex)
    if blocked:
        return np.asarray(np.abs(v1) / w)
    moved = np.abs(v1 - np.asarray(far, dtype=complex)) / w
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.where(np.isfinite(moved), moved, np.abs(np.asarray(force) / np.asarray(stiffness))))
