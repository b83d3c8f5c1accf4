"""K* of one condition as the recordings of the whole rig have it near K* of a model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from fourpole.core.arrays import ByValue, ComplexArray, FloatArray
from fourpole.core.joint.around import Around, Likelihood
from fourpole.models.data import StiffnessData, complex_columns, multiplication, real_columns

#: Largest relative difference between K* of the data and of the joint solution, as by drift.
_ALIKE = 0.5
#: Second-order effect of shared errors that is negligible, in standard uncertainties of the noise.
_NEGLIGIBLE = 0.3


def bends(own: StiffnessData, shared: FloatArray) -> bool:
    """Whether the second order of shared errors (2N, p) [N/m] is above the noise of the data."""
    if not shared.size:
        return False
    second = np.sum(np.abs(complex_columns(shared)) ** 2, axis=1) / np.abs(own.stiffness)
    noise = np.sqrt(np.linalg.eigvalsh(own.covariance)[:, 0].clip(0.0))
    return bool(np.any(second > _NEGLIGIBLE * noise))


@dataclass(frozen=True, eq=False)
class Recorded(ByValue):
    """A function of K* of a model: the data (K*, covariance, shared errors) of one condition, linear about this K*.

    Attributes
    ----------
    likelihood : Likelihood
        All tests of the rig.
    places : (N,) int array
        Number of the joint condition of each frequency.
    omega : (N,) float array [rad/s]
        Angular frequencies of the data.
    ratio : (N,) complex array [1]
        K* of the data over that of the joint condition. They differ if specimens drift over the run.
    """

    likelihood: Likelihood
    places: np.ndarray
    omega: FloatArray
    ratio: ComplexArray

    @classmethod
    def of(cls, likelihood: Likelihood, places: Sequence[int], data: StiffnessData) -> Recorded | None:
        """The function for the data of one condition; None if these are not of the likelihood's tests."""
        at = np.array(places, dtype=int)
        if not np.all((at >= 0) & (at < likelihood.stiffness.size)):
            return None
        ratio = data.stiffness / likelihood.stiffness[at]
        return cls(likelihood, at, data.omega, ratio) if np.all(np.abs(ratio - 1) < _ALIKE) else None

    def part(self, rows: np.ndarray) -> Recorded:
        """The function for some of the frequencies; K* of the others is free."""
        return replace(self, places=self.places[rows], omega=self.omega[rows], ratio=self.ratio[rows])

    def __call__(self, stiffness: ComplexArray) -> StiffnessData:
        """The data near K* = `stiffness` (N,) [N/m]; covariance and shared errors are those at this K*."""
        found = self.likelihood.around(self.places, stiffness / self.ratio)
        own = own_near(self.omega, stiffness, found)
        shared = real_columns(found.relative * stiffness[:, None])
        return replace(own.with_errors(shared), relative=found.relative, reference=stiffness)


def own_near(omega: FloatArray, stiffness: ComplexArray, found: Around) -> StiffnessData:
    """K* with the covariance for known shared errors, whose likelihood about K* = `stiffness` (N,) [N/m] is `found`."""
    by_log = multiplication(stiffness)
    own = by_log @ found.own @ np.swapaxes(by_log, 1, 2)
    covariance = 0.5 * (own + np.swapaxes(own, 1, 2))
    return StiffnessData.of(omega, stiffness * (1 + found.change @ [1, 1j]), covariance=covariance)
