"""`Identification`: the values and uncertainties of the tyre that phasors give, by any route."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from fourpole.core.arrays import ByValue, ComplexArray, FloatArray


class RigSolution(Protocol):
    """Result of the joint route besides K*; `fourpole.core.joint.Joint` has it with residuals and misfit."""

    @property
    def found(self) -> FloatArray:
        """Values of the rig, gains of the channels and added masses as found, each in its unit."""

    @property
    def found_std(self) -> FloatArray:
        """Standard uncertainties of `found`."""

    @property
    def converged(self) -> bool:
        """Whether the search for the most probable values converged."""


@dataclass(frozen=True, eq=False)
class Identification(ByValue):
    """Values and uncertainties of the tyre from the phasors of N tests.

    Every array has N rows, with not-a-number for a value that does not exist.

    Attributes
    ----------
    frequency : (N,) float array [Hz]
        Excitation frequency.
    mobility, mobility_covariance : (N,) complex [m/(N s)], (N, 2, 2) float
        V1/F1 = R + jI as measured, and the covariance of (R, I).
    stiffness, stiffness_covariance : (N,) complex [N/m], (N, 2, 2) float
        K* by the route, and the covariance of its (Re, Im).
    loss_factor, loss_factor_std : (N,) float [1]
        K''/K', and its standard uncertainty.
    k1, k1_std : (N,) float [N/m]
        Static stiffness used, and its standard uncertainty.
    k2, c : (N,) float [N/m], [N s/m]
        Spring and damper of the arm. Not-a-number if no passive values exist or K1 is unknown; `reasons` says why.
    arm_covariance : (N, 2, 2) float
        Covariance of (K2, C) to second order; see `fourpole.core.curvature`.
    tr_measured, tr_predicted, tr_std : (N,) float [1]
        abs(V2/V1) as measured; abs(V2/V1) from K* and the rig; standard uncertainty of the latter. Without a rig it is
        the uncertainty of the measured value.
    reasons : tuple of N str
        Reason why K2 and C are blank, with the likely cause; empty if they are not.
    route : str
        Name of the route.
    stiffness_shared : (N, 2, p) float [N/m]
        S, the change of (Re, Im) of K* per standard uncertainty of each of p errors that all tests share. The
        covariance of two tests of different conditions is S_i S_j^T. The rest of `stiffness_covariance` belongs to
        each condition alone, and to the test.
    condition : (N,) int
        Tests with the same number have one condition, and share the part of the uncertainty that is its own.
    condition_covariance : (N, 2, 2) float [N²/m²]
        Covariance of (Re, Im) of the mean K* of the test's condition, without the shared errors. It is the rest of
        `stiffness_covariance` if K* does not scatter from test to test.
    joint : RigSolution, optional
        Result of the joint route besides K*; None for the other routes.

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
    condition_covariance: FloatArray
    joint: RigSolution | None = None
