"""Models without relaxation: a spring, and a spring parallel to a damper."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from fourpole.core.arrays import ComplexArray, FloatArray
from fourpole.models.data import StiffnessData
from fourpole.models.interface import Model, Parameter, StateSpace, columns, positive

_K = Parameter("K", "N/m", 0.0, np.inf, 180e3, "spring", log=True)


class Spring(Model):
    r"""A linear spring: :math:`K^* = K`.

    Examples
    --------
    >>> Spring().stiffness([180e3], [60.0]).tolist()
    [(180000+0j)]
    """

    name = "spring"
    parameters = (_K,)

    def stiffness(self, values: ArrayLike, omega: ArrayLike) -> ComplexArray:
        """K* [N/m]."""
        (k,) = columns(self.checked(values))
        return np.asarray(k + 0j * positive(omega))

    def derivative(self, values: ArrayLike, omega: ArrayLike) -> ComplexArray:
        """Derivative by K."""
        return np.ones_like(self.stiffness(values, omega))[..., None]

    def starts(self, data: StiffnessData, count: int) -> FloatArray:  # noqa: ARG002
        """K: the mean of K'."""
        return np.mean(data.stiffness.real, axis=1)[None, :, None]

    def state_space(self, values: ArrayLike) -> StateSpace:
        """State space without states."""
        (k,) = self.checked(values)
        return StateSpace(np.zeros((0, 0)), np.zeros((0, 2)), np.zeros(0), np.array([k, 0.0]))


class KelvinVoigt(Model):
    r"""A spring parallel to a viscous damper: :math:`K^* = K + j\omega C`.

    Examples
    --------
    >>> KelvinVoigt().stiffness([180e3, 700.0], [60.0]).tolist()
    [(180000+42000j)]
    """

    name = "kelvin"
    parameters = (_K, Parameter("C", "N s/m", 0.0, np.inf, 300.0, "damper beside it", log=True))
    special_cases = ("spring",)

    def stiffness(self, values: ArrayLike, omega: ArrayLike) -> ComplexArray:
        """K* [N/m]."""
        k, c = columns(self.checked(values))
        return np.asarray(k + 1j * positive(omega) * c)

    def derivative(self, values: ArrayLike, omega: ArrayLike) -> ComplexArray:
        """Derivatives by K and C."""
        by_c = 0 * self.stiffness(values, omega) + 1j * positive(omega)
        return np.stack([np.ones_like(by_c), by_c], axis=-1)

    def starts(self, data: StiffnessData, count: int) -> FloatArray:  # noqa: ARG002
        """K: the mean of K'; C: the least-squares slope of K'' over the angular frequency."""
        k, omega = data.stiffness, data.omega
        return np.stack([np.mean(k.real, 1), np.mean(k.imag * omega, 1) / np.mean(omega**2, 1)], axis=1)[None]

    def state_space(self, values: ArrayLike) -> StateSpace:
        """State space without states: the force follows from deflection and rate."""
        return StateSpace(np.zeros((0, 0)), np.zeros((0, 2)), np.zeros(0), self.checked(values))
