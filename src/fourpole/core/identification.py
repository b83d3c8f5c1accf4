"""`Identification`: what phasors say of the tyre, by whichever route."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from fourpole.core.arrays import ByValue, ComplexArray, FloatArray

if TYPE_CHECKING:
    from fourpole.core.joint.joint import Joint

__all__ = ["Identification"]


@dataclass(frozen=True, eq=False)
class Identification(ByValue):
    """What the phasors of N tests say of the tyre; every array has N rows, not-a-number where a value does not exist.

    Attributes
    ----------
    frequency : (N,) float array [Hz]
        Excitation frequency.
    mobility, mobility_covariance : (N,) complex [m/(N s)], (N, 2, 2) float
        V1/F1 as measured, R + jI; covariance of (R, I).
    stiffness, stiffness_covariance : (N,) complex [N/m], (N, 2, 2) float
        K* by the route; covariance of (Re, Im).
    loss_factor, loss_factor_std : (N,) float [1]
        K''/K'.
    k1, k1_std : (N,) float [N/m]
        Static stiffness used.
    k2, c : (N,) float [N/m], [N s/m]
        The arm; not-a-number where no passive answer exists or K1 is unknown, with a reason in `reasons`.
    arm_covariance : (N, 2, 2) float
        Covariance of (K2, C).
    tr_measured, tr_predicted, tr_std : (N,) float [1]
        abs(V2/V1); the same from K* and the rig; uncertainty of the latter (of the former, where there is no rig).
    reasons : tuple of N str
        Why K2 and C are blank, with the likely cause; empty where they are not.
    route : str
        How K* was found.
    stiffness_shared : (N, 2, p) float [N/m]
        What p errors that all tests share, of one standard uncertainty each, do to (Re, Im) of K*: S. The covariance
        of two tests is S_i S_j^T; what is left of `stiffness_covariance` is each condition's own.
    condition : (N,) int
        Tests of one number have one K* between them, and its own part of the uncertainty in common.
    joint : Joint, optional
        By the joint route: the rig's values and the channels' gains as found, residuals, what does not fit.

    Examples
    --------
    >>> from fourpole import Phasors, Rig, identify
    >>> phasors = Phasors.from_polar(10.0, 1.0, abs(6.2114469e-5 - 1.0320808256e-3j), 1.5106868)
    >>> found = identify(phasors, Rig(moving_mass=15.0, preload_stiffness=12440.0))
    >>> found.stiffness.round(-2), found.reasons
    (array([194200.+38800.j]), ('no static stiffness K1 is known, so K2 and C are left blank',))
    """

    frequency: FloatArray
    mobility: ComplexArray
    mobility_covariance: FloatArray
    stiffness: ComplexArray
    stiffness_covariance: FloatArray
    loss_factor: FloatArray
    loss_factor_std: FloatArray
    k1: FloatArray
    k1_std: FloatArray
    k2: FloatArray
    c: FloatArray
    arm_covariance: FloatArray
    tr_measured: FloatArray
    tr_predicted: FloatArray
    tr_std: FloatArray
    reasons: tuple[str, ...]
    route: str
    stiffness_shared: FloatArray
    condition: np.ndarray
    joint: Joint | None = None
