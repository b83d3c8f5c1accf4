"""What a map answers: K*, K1, K2, C and TR with their covariance."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from fourpole.core.arrays import ByValue, ComplexArray, FloatArray
from fourpole.core.curvature import arm_covariance
from fourpole.core.rig import Rig
from fourpole.core.routes import maxwell_arm
from fourpole.core.specimen import Specimen
from fourpole.models.belted import MASSLESS


@dataclass(frozen=True, eq=False)
class Answer(ByValue):
    """K* and the values derived from it, by the map, at Q points.

    Attributes
    ----------
    stiffness : (Q,) complex array [N/m]
    k1 : (Q,) float array [N/m]
    covariance : (Q, 3, 3) float array [N²/m²]
        Covariance of Re K*, Im K* and K1.
    k2, c : (Q,) float arrays [N/m], [N s/m]
        K2 and C; not-a-number where K* needs an arm that is not passive.
    arm_covariance : (Q, 2, 2) float array
        Covariance of K2 and C to second order.
    """

    stiffness: ComplexArray
    k1: FloatArray
    covariance: FloatArray
    k2: FloatArray
    c: FloatArray
    arm_covariance: FloatArray

    @classmethod
    def of(cls, stiffness: ComplexArray, k1: FloatArray, covariance: FloatArray, omega: FloatArray) -> Answer:
        """The answer at angular frequencies (Q,) [rad/s], with K2 and C from K* and K1."""
        k2, c = maxwell_arm(stiffness, k1, omega)
        difference = np.array([[1.0, 0.0, -1.0], [0.0, 1.0, 0.0]])  # Re and Im of K* - K1
        arm = arm_covariance(stiffness, k1, omega, difference @ covariance @ difference.T)
        passive = (stiffness.real > k1) & (stiffness.imag > 0)
        return cls(
            stiffness=stiffness,
            k1=k1,
            covariance=covariance,
            k2=np.where(passive, k2, np.nan),
            c=np.where(passive, c, np.nan),
            arm_covariance=np.where(passive[:, None, None], arm, np.nan),
        )

    @property
    def stiffness_covariance(self) -> FloatArray:
        """Covariance (Q, 2, 2) of Re K* and Im K* [N²/m²]."""
        return self.covariance[:, :2, :2]

    @property
    def k1_std(self) -> FloatArray:
        """Standard uncertainty (Q,) of K1 [N/m]."""
        return np.sqrt(self.covariance[:, 2, 2])

    @property
    def loss_factor(self) -> FloatArray:
        """Loss factor K''/K' (Q,) [1]."""
        return self.stiffness.imag / self.stiffness.real

    @property
    def loss_factor_std(self) -> FloatArray:
        """Standard uncertainty (Q,) of the loss factor [1]."""
        by = np.stack([-self.loss_factor, np.ones(self.k1.size)], axis=1) / self.stiffness.real[:, None]
        return np.sqrt(np.einsum("qi,qij,qj->q", by, self.stiffness_covariance, by))

    def transmissibility(
        self, rig: Rig, frequency: ArrayLike, specimen: Specimen = MASSLESS
    ) -> tuple[FloatArray, FloatArray]:
        """TR (Q,) [1] on a rig at the frequencies of the points (Q,) [Hz], and its standard uncertainty.

        K* is that of the springs of `specimen`. The uncertainty includes that of the rig.
        """
        omega = 2 * np.pi * np.asarray(frequency, dtype=float)
        if rig.blocked:
            return np.zeros(omega.shape), np.zeros(omega.shape)
        ends = specimen.ends(self.stiffness, omega)
        above = 1j * omega * rig.impedance(omega) - omega**2 * ends.wheel
        whole = ends.spring + above
        ratio = ends.spring / whole
        # Derivatives of log TR by K* and by the values of the rig.
        by_stiffness = (ends.by[:, 0, 0] * above + omega**2 * ends.by[:, 0, 2]) / (self.stiffness * whole)
        by_rig = -(1j * omega / whole)[:, None] * rig.impedance_gradient(omega)[:, :-1]
        both = np.stack([by_stiffness.real, -by_stiffness.imag], axis=1)
        variance = np.einsum("qi,qij,qj->q", both, self.stiffness_covariance, both)
        variance = variance + np.sum((by_rig.real * rig.uncertainties) ** 2, axis=1)
        size = np.abs(ratio)
        return size, size * np.sqrt(variance)
