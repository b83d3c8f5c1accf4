r"""The tangent of a slow static loop, as a datum on K*: a weighted sum of K* at a few frequencies.

In a static test the deflection is a triangle: each branch takes the time T. A spring parallel to an arm of stiffness
:math:`K_i` and relaxation time :math:`\tau_i` has, on the branch of number m, the tangent

.. math:: \frac{dF}{dx} = K_\infty + K_i\,g, \qquad
    g = (-1)^m \left( e^{-t/\tau_i} + 2 \sum_{k=1}^{m} (-1)^k e^{-(t - kT)/\tau_i} \right)

with t the time since the start from rest, so that earlier branches are counted. The tangent is linear in the
stiffnesses. With weights :math:`c_j` for which

.. math:: \mathrm{Re} \sum_j c_j \frac{j\omega_j\tau}{1 + j\omega_j\tau} = g \quad \text{for every } \tau,

the tangent is :math:`\mathrm{Re} \sum_j c_j K^*(\omega_j)` for each model that is a sum of arms, a fractional one too.
The same method converts a dynamic modulus into a relaxation modulus.

References
----------
F. R. Schwarzl, "Numerical calculation of storage and loss modulus from stress relaxation data for linear viscoelastic
materials", Rheol. Acta 10, 1971; here for the deflection of a static loop.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from fourpole.core.arrays import FloatArray
from fourpole.errors import ModelError
from fourpole.models.data import StiffnessData, relaxation
from fourpole.models.interface import Model

#: Ends of the angular frequencies of the weighted sum, times the duration of a branch, and their number.
_ENDS, _COUNT = (0.03, 100.0), 15
#: Ends and number of the relaxation times, over the duration of a branch, at which the sum is fitted.
_TIMES, _MANY = (1e-4, 1e4), 800
#: Weight of the exact conditions, those of a spring and of a damper, and of the size of the weights.
_EXACT, _RIDGE = 1e3, 1e-5
#: Largest number of cycles that are counted: later ones are as good as periodic.
_MOST_CYCLES = 50
#: Shares of a branch beyond which its ends are too near: the tangent there is that of the turn.
_INNER = (0.05, 0.95)


@dataclass(frozen=True)
class Ramp:
    """One loop of a static test.

    Parameters
    ----------
    time : float [s]
        Duration of a branch.
    cycle : int
        Number of the cycle whose tangent is taken, from 1; before the first the specimen was at rest.
    place : float [1]
        Deflection of the tangent as a share of the branch, from the lower end.

    Raises
    ------
    ModelError
        If the duration or the cycle is not positive, or the place is at an end of the branch.
    """

    time: float
    cycle: int
    place: float

    def __post_init__(self) -> None:
        if not (np.isfinite(self.time) and self.time > 0 and self.cycle >= 1):
            raise ModelError("a static loop has a positive time per branch and a cycle of number 1 or more")
        if not _INNER[0] <= self.place <= _INNER[1]:
            raise ModelError(
                f"the preload is at {100 * self.place:.3g} % of the branch, where the motion turns: the tangent of a "
                "ramp is used from 5 to 95 %; repeat the static test over a wider range, or state --static rest"
            )

    def share(self, times: ArrayLike) -> FloatArray:
        """Share g (...,) [1] of the stiffness of arms with relaxation times (...,) [s] in the mean of both tangents.

        Examples
        --------
        >>> Ramp(20.0, 3, 0.5).share([0.1, 20.0, 1e6]).round(6).tolist()
        [0.0, 0.885196, 1.0]
        """
        tau = np.asarray(times, dtype=float)[..., None] / self.time
        cycle = min(self.cycle, _MOST_CYCLES)
        found = np.zeros(tau.shape[:-1])
        for branch, since in ((2 * cycle - 2, self.place), (2 * cycle - 1, 1.0 - self.place)):
            turns = np.arange(branch + 1)
            jumps = np.where(turns == 0, 1.0, 2.0 * (-1.0) ** turns)
            sign = (-1.0) ** branch
            found = found + 0.5 * sign * np.sum(jumps * np.exp(-(branch + since - turns) / tau), axis=-1)
        return np.asarray(found)

    def weights(self) -> tuple[FloatArray, np.ndarray]:
        """Angular frequencies (J,) [rad/s] and complex weights (J,) [1] of K* in the tangent.

        The error of the sum is below 2e-4 of the stiffness of an arm of any relaxation time.
        """
        weights = _weights(min(self.cycle, _MOST_CYCLES), self.place)
        return np.geomspace(*_ENDS, _COUNT) / self.time, weights


@lru_cache(maxsize=256)
def _weights(cycle: int, place: float) -> np.ndarray:
    """Weights (J,) by least squares over relaxation times, exact for a spring and for a damper."""
    omega, times = np.geomspace(*_ENDS, _COUNT), np.geomspace(*_TIMES, _MANY)
    arms = relaxation(omega, times).T
    spring = np.concatenate([np.ones(_COUNT), np.zeros(_COUNT)])
    damper = np.concatenate([np.zeros(_COUNT), omega / omega[-1]])
    ridge = _RIDGE * np.sqrt(_MANY) * np.eye(2 * _COUNT)
    rows = np.vstack([np.hstack([arms.real, -arms.imag]), _EXACT * spring, _EXACT * damper, ridge])
    target = np.concatenate([Ramp(1.0, cycle, place).share(times), [_EXACT, 0.0], np.zeros(2 * _COUNT)])
    found = np.linalg.lstsq(rows, target, rcond=None)[0]
    return np.asarray(found[:_COUNT] + 1j * found[_COUNT:])


@dataclass(frozen=True)
class Loop:
    """The ramp of a static test, with its K1 and the factor between its tangent and that at small amplitude.

    Attributes
    ----------
    ramp : Ramp
    k1, k1_std : float [N/m]
        Measured tangent and its standard uncertainty.
    factor_std : float [1]
        Standard uncertainty of the factor, which is 1 as far as is known before the fit.
    """

    ramp: Ramp
    k1: float
    k1_std: float
    factor_std: float

    def joined(self, data: StiffnessData) -> StiffnessData:
        """The data of one condition with K1 as the tangent of the ramp.

        The measured tangent is that of the model times the factor: the amplitude of a static test is larger, and rubber
        is softer at larger amplitudes. The factor is integrated out, which adds its share to the uncertainty of K1.
        """
        omega, weights = self.ramp.weights()
        wider = np.asarray(np.hypot(self.k1_std, self.factor_std * self.k1))
        return replace(data, k1=np.asarray(self.k1), k1_std=wider, static_omega=omega, static_weights=weights)

    def factor(self, tangent: float, tangent_std: float) -> tuple[float, float]:
        """The factor and its standard uncertainty [1], from the tangent of the fitted model [N/m].

        Examples
        --------
        >>> Loop(Ramp(20.0, 3, 0.5), 206e3, 0.0, 0.05).factor(200e3, 2e3)
        (1.03, 0.01)
        """
        free = (self.factor_std * self.k1) ** 2
        share = free / (free + self.k1_std**2) if free else 0.0
        found = 1.0 + share * (self.k1 - tangent) / tangent
        return found, float(np.hypot(self.factor_std * np.sqrt(1.0 - share), share * tangent_std / tangent))


def takes_k1(model: Model, data: StiffnessData) -> bool:
    """Whether K1 is a datum of the fit of a model: it rests at K1, or the tangent of the ramp is known."""
    return data.has_k1 and (model.rests or _ramped(model, data))


def _ramped(model: Model, data: StiffnessData) -> bool:
    """Whether K1 is the tangent of a ramp; the sum holds for models that are sums of arms."""
    return data.static_omega is not None and model.relaxing


def static_stiffness(model: Model, values: FloatArray, data: StiffnessData) -> FloatArray:
    """K1 (...,) [N/m] of parameters (..., P) as the static test of the data has it: at rest, or as a ramp's tangent."""
    if not _ramped(model, data):
        return model.static_stiffness(values)
    weights, omega = data.ramp["static_weights"], data.ramp["static_omega"]
    return np.asarray(np.sum((weights * model.stiffness(values, omega)).real, axis=-1))


def static_derivative(model: Model, values: FloatArray, data: StiffnessData) -> FloatArray:
    """Derivatives (..., P) of `static_stiffness` by each parameter."""
    if not _ramped(model, data):
        return model.static_derivative(values)
    slopes = data.ramp["static_weights"][..., None] * model.derivative(values, data.ramp["static_omega"])
    return np.asarray(np.sum(slopes.real, axis=-2))
