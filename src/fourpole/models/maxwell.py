"""Relaxing tyres: the paper's Zener, and the generalised Maxwell model with any number of arms."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from fourpole.core.arrays import ComplexArray, FloatArray
from fourpole.errors import ModelError
from fourpole.models.data import StiffnessData
from fourpole.models.interface import Model, Parameter, StateSpace, columns, positive
from fourpole.models.spectrum import WhitenedCondition, arms_at, two_springs, whitened_conditions

__all__ = ["GeneralisedMaxwell", "Zener"]

_MOST_ARMS = 60
#: Least stiffness of the arm and least relaxation time of a start, as shares of |K*| and of 1/omega.
_LEAST_SPRING, _LEAST_TIME = 0.01, 1e-6


class Zener(Model):
    r"""The paper's tyre with constant K2 and C: :math:`K^* = K_1 + j\omega C K_2 / (K_2 + j\omega C)`.

    References
    ----------
    Nosseir, El-Gindy, El-Saied, "Tyre radial properties", 1982, eq. (5).

    Examples
    --------
    >>> Zener().stiffness([180e3, 120e3, 700.0], [20 * np.pi]).round(2)
    array([194211.27+38773.6j])
    """

    name = "zener"
    parameters = (
        Parameter("K1", "N/m", 0.0, np.inf, 180e3, "static stiffness", log=True),
        Parameter("K2", "N/m", 0.0, np.inf, 120e3, "spring of the arm", log=True),
        Parameter("C", "N s/m", 0.0, np.inf, 700.0, "damper of the arm", log=True),
    )
    special_cases = ("spring",)
    for_maps = ("zener",)

    def _arm(self, values: ArrayLike, omega: ArrayLike) -> tuple[FloatArray, FloatArray, ComplexArray, ComplexArray]:
        """K1, K2, jwC, and the share of the arm's deflection that its spring has."""
        k1, k2, c = columns(self.checked(values))
        damper = 1j * positive(omega) * c
        whole = k2 + damper
        share = np.divide(damper, whole, out=np.zeros_like(whole), where=whole != 0)
        return k1, k2, damper, share

    def stiffness(self, values: ArrayLike, omega: ArrayLike) -> ComplexArray:
        """K* [N/m]."""
        k1, k2, _, share = self._arm(values, omega)
        return np.asarray(k1 + k2 * share)

    def derivative(self, values: ArrayLike, omega: ArrayLike) -> ComplexArray:
        """Derivatives of K* by K1, K2 and C."""
        _, _, _, share = self._arm(values, omega)
        return np.stack([np.ones_like(share), share**2, 1j * positive(omega) * (1 - share) ** 2], axis=-1)

    def starts(self, data: StiffnessData, count: int) -> FloatArray:
        """The closed form of least squares, then arms that relax at frequencies over the band."""
        first = _zener(data.stiffness, data.omega)[None]
        if count == 1:
            return first
        others = [_relaxing(one, count - 1) for one in whitened_conditions(data)]
        return np.concatenate([first, np.stack(others, axis=1)])

    def state_space(self, values: ArrayLike) -> StateSpace:
        """One state: the deflection of the damper."""
        k1, k2, c = self.checked(values)
        if c == 0 or k2 == 0:
            return StateSpace(np.zeros((0, 0)), np.zeros((0, 2)), np.zeros(0), np.array([k1, 0.0]))
        rate = k2 / c
        return StateSpace(np.array([[-rate]]), np.array([[rate, 0.0]]), np.array([-k2]), np.array([k1 + k2, 0.0]))


class GeneralisedMaxwell(Model):
    r"""A spring beside n arms of spring and damper in series, by their relaxation times.

    .. math:: K^* = K_\infty + \sum_i K_i \frac{j\omega\tau_i}{1 + j\omega\tau_i}, \qquad K_\infty, K_i \ge 0

    Causal and passive by construction. Values: K_inf, K_1 ... K_n, tau_1 ... tau_n; a fit has the slowest arm first.

    Parameters
    ----------
    arms : int
        n, from 1 to 60.

    References
    ----------
    J. D. Ferry, "Viscoelastic properties of polymers", 3rd ed., 1980, ch. 3.

    Examples
    --------
    >>> GeneralisedMaxwell(1).stiffness([180e3, 120e3, 700 / 120e3], [20 * np.pi]).round(2)
    array([194211.27+38773.6j])
    """

    special_cases = ("zener",)
    sizes = range(2, 21)  # one arm is a Zener
    for_maps = ("maxwell:2",)

    def __init__(self, arms: int) -> None:
        if not 1 <= arms <= _MOST_ARMS:
            raise ModelError(f"a Maxwell model has 1 to {_MOST_ARMS} arms, not {arms}")
        self.arms = arms
        self.name = f"maxwell:{arms}"

    @cached_property
    def parameters(self) -> tuple[Parameter, ...]:  # type: ignore[override]
        """K_inf, the arms' stiffnesses, their relaxation times."""
        springs = [
            Parameter(f"K_{i}", "N/m", 0.0, np.inf, 60e3, f"spring of arm {i}", log=True)
            for i in range(1, self.arms + 1)
        ]
        times = [
            Parameter(f"tau_{i}", "s", 0.0, np.inf, 10.0 ** (-i), f"relaxation time of arm {i}", log=True)
            for i in range(1, self.arms + 1)
        ]
        return (Parameter("K_inf", "N/m", 0.0, np.inf, 180e3, "stiffness at rest", log=True), *springs, *times)

    def _parts(self, values: ArrayLike, omega: ArrayLike) -> tuple[FloatArray, FloatArray, FloatArray, ComplexArray]:
        """K_inf (..., 1); K_i and tau_i (..., 1, n); 1/(1 + jw tau) (..., N, n)."""
        checked = self.checked(values)
        springs, times = checked[..., None, 1 : 1 + self.arms], checked[..., None, 1 + self.arms :]
        relaxed = 1.0 / (1.0 + 1j * positive(omega)[..., None] * times)
        return checked[..., 0, None], springs, times, relaxed

    def stiffness(self, values: ArrayLike, omega: ArrayLike) -> ComplexArray:
        """K* [N/m]."""
        rest, springs, _, relaxed = self._parts(values, omega)
        return np.asarray(rest + np.sum(springs * (1 - relaxed), axis=-1))

    def derivative(self, values: ArrayLike, omega: ArrayLike) -> ComplexArray:
        """Derivatives of K* by K_inf, all K_i and all tau_i."""
        _, springs, _, relaxed = self._parts(values, omega)
        one = np.ones_like(relaxed[..., :1])
        by_time = springs * 1j * positive(omega)[..., None] * relaxed**2
        return np.concatenate([one, 1 - relaxed, by_time], axis=-1)

    def ordering(self, values: FloatArray) -> np.ndarray:
        """The slowest arm first."""
        arms = 1 + np.argsort(-values[..., 1 + self.arms :], axis=-1, kind="stable")
        first = np.zeros((*values.shape[:-1], 1), dtype=int)
        return np.concatenate([first, arms, arms + self.arms], axis=-1)

    def starts(self, data: StiffnessData, count: int) -> FloatArray:
        """Non-negative springs on several layouts of the relaxation times."""
        return np.stack([arms_at(one, self.arms, count) for one in whitened_conditions(data)], axis=1)

    def state_space(self, values: ArrayLike) -> StateSpace:
        """A state per arm: the deflection of its damper."""
        checked = self.checked(values)
        springs, times = checked[1 : 1 + self.arms], checked[1 + self.arms :]
        stiff = times > 0
        rates = 1.0 / times[stiff]
        inputs = np.stack([rates, np.zeros_like(rates)], axis=1)
        direct = np.array([checked[0] + springs[stiff].sum(), 0.0])
        return StateSpace(-np.diag(rates), inputs, -springs[stiff], direct)


def _zener(k: ComplexArray, omega: FloatArray) -> FloatArray:
    """K* (1 + jw tau) = K1 + jw tau (K1 + K2) is linear in K1, tau (K1 + K2) and tau: least squares of each row."""
    scale, middle = np.mean(np.abs(k), axis=1)[:, None], np.mean(omega, axis=1)[:, None]
    w, y = omega / middle, k / scale
    terms = np.stack([np.ones_like(y), 1j * w, -1j * w * y], axis=-1) / (1 + w[..., None])
    rows = np.concatenate([terms.real, terms.imag], axis=1)
    right = np.concatenate([y.real / (1 + w), y.imag / (1 + w)], axis=1)
    turned = np.swapaxes(rows, 1, 2)
    ridge = 1e-12 * np.eye(3)
    first, second, tau = np.linalg.solve(turned @ rows + ridge, (turned @ right[..., None]))[..., 0].T
    tau = np.maximum(tau, _LEAST_TIME)
    k1 = np.maximum(first, _LEAST_SPRING) * scale[:, 0]
    k2 = np.maximum(second / tau * scale[:, 0] - k1, _LEAST_SPRING * scale[:, 0])
    return np.stack([k1, k2, tau / middle[:, 0] * k2], axis=1)


def _relaxing(seen: WhitenedCondition, count: int) -> FloatArray:
    """Zener tyres (count, 3) that relax at frequencies spread over the band and a little beyond."""
    ends = np.log(1.0 / seen.omega.max() / 3.0), np.log(3.0 / seen.omega.min())
    times = np.exp(ends[0] + (ends[1] - ends[0]) * (np.arange(count) + 0.5) / count)
    relaxed = 1.0 - 1.0 / (1.0 + 1j * seen.omega[:, None] * times[:, None, None])
    terms = np.concatenate([np.ones_like(relaxed), relaxed], axis=-1)
    springs, _ = two_springs(seen.rows(terms), seen.wanted)
    springs = np.maximum(springs, _LEAST_SPRING * np.mean(np.abs(seen.stiffness)))
    return np.stack([springs[:, 0], springs[:, 1], times * springs[:, 1]], axis=1)
