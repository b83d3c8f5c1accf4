"""Models of relaxation: the paper's Zener model, and the generalised Maxwell model with several arms."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from fourpole.core.arrays import ComplexArray, FloatArray
from fourpole.errors import ModelError
from fourpole.models.data import StiffnessData, relaxation
from fourpole.models.interface import Arms, Model, Parameter, StateSpace, columns, positive
from fourpole.models.spectrum import WhitenedCondition, arms_at, two_springs, whitened_conditions

_MOST_ARMS = 60
#: Least stiffness of a start as a fraction of |K*|, and least relaxation time as a fraction of 1/omega.
_LEAST_SPRING, _LEAST_TIME = 0.01, 1e-6


class Zener(Model):
    r"""The paper's tyre model with constant K2 and C: :math:`K^* = K_1 + j\omega C K_2 / (K_2 + j\omega C)`.

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

    def _arm(self, values: ArrayLike, omega: ArrayLike) -> tuple[FloatArray, FloatArray, ComplexArray]:
        """K1, K2, and the deflection of the spring of the arm as a fraction of that of the arm."""
        k1, k2, c = columns(self.checked(values))
        damper = 1j * positive(omega) * c
        whole = k2 + damper
        share = np.divide(damper, whole, out=np.zeros_like(whole), where=whole != 0)
        return k1, k2, share

    def stiffness(self, values: ArrayLike, omega: ArrayLike) -> ComplexArray:
        """K* [N/m]."""
        k1, k2, share = self._arm(values, omega)
        return np.asarray(k1 + k2 * share)

    def derivative(self, values: ArrayLike, omega: ArrayLike) -> ComplexArray:
        """Derivatives by K1, K2 and C."""
        _, _, share = self._arm(values, omega)
        return np.stack([np.ones_like(share), share**2, 1j * positive(omega) * (1 - share) ** 2], axis=-1)

    def starts(self, data: StiffnessData, count: int) -> FloatArray:
        """A closed-form least-squares solution, then arms with relaxation times over the band."""
        first = _zener(data.stiffness, data.omega)[None]
        if count == 1:
            return first
        others = [_over_band(one, count - 1) for one in whitened_conditions(data)]
        return np.concatenate([first, np.stack(others, axis=1)])

    def prony(self, values: ArrayLike) -> Arms:
        """The one arm of one set of parameters."""
        k1, k2, c = self.checked(values).tolist()
        return Arms(k1, np.array([k2]), np.array([c / k2 if k2 else 0.0]))

    def state_space(self, values: ArrayLike) -> StateSpace:
        """State space with one state, the deflection of the damper."""
        k1, k2, c = self.checked(values)
        if c == 0 or k2 == 0:
            return StateSpace(np.zeros((0, 0)), np.zeros((0, 2)), np.zeros(0), np.array([k1, 0.0]))
        rate = k2 / c
        return StateSpace(np.array([[-rate]]), np.array([[rate, 0.0]]), np.array([-k2]), np.array([k1 + k2, 0.0]))


class RelaxingArms(Model):
    """Base of the models of a spring parallel to arms: parameters K_inf, K_1 ... K_n, tau_1 ... tau_n."""

    arms: int

    def _parts(self, values: ArrayLike, omega: ArrayLike) -> tuple[FloatArray, FloatArray, ComplexArray]:
        """K_inf (..., 1), K_i (..., 1, n), and the response of arms of unit stiffness (..., N, n)."""
        checked = self.checked(values)
        springs, times = checked[..., None, 1 : 1 + self.arms], checked[..., None, 1 + self.arms :]
        return checked[..., 0, None], springs, relaxation(positive(omega), times)

    def stiffness(self, values: ArrayLike, omega: ArrayLike) -> ComplexArray:
        """K* [N/m]."""
        rest, springs, arms = self._parts(values, omega)
        return np.asarray(rest + np.sum(springs * arms, axis=-1))

    def derivative(self, values: ArrayLike, omega: ArrayLike) -> ComplexArray:
        """Derivatives by K_inf, all K_i, all tau_i."""
        _, springs, arms = self._parts(values, omega)
        by_time = springs * 1j * positive(omega)[..., None] * (1 - arms) ** 2
        return np.concatenate([np.ones_like(arms[..., :1]), arms, by_time], axis=-1)

    def ordering(self, values: FloatArray) -> np.ndarray:
        """Places that sort the arms by falling relaxation time."""
        arms = 1 + np.argsort(-values[..., 1 + self.arms :], axis=-1, kind="stable")
        first = np.zeros((*values.shape[:-1], 1), dtype=int)
        return np.concatenate([first, arms, arms + self.arms], axis=-1)

    def prony(self, values: ArrayLike) -> Arms:
        """The arms of one set of parameters."""
        checked = self.checked(values)
        return Arms(float(checked[0]), checked[1 : 1 + self.arms], checked[1 + self.arms :])

    def state_space(self, values: ArrayLike) -> StateSpace:
        """State space with one state per arm, the deflection of its damper; an arm with tau = 0 or K = 0 has none."""
        checked = self.checked(values)
        moves = (checked[1 + self.arms :] > 0) & (checked[1 : 1 + self.arms] > 0)
        springs, rates = checked[1 : 1 + self.arms][moves], 1.0 / checked[1 + self.arms :][moves]
        inputs = np.stack([rates, np.zeros_like(rates)], axis=1)
        return StateSpace(-np.diag(rates), inputs, -springs, np.array([checked[0] + springs.sum(), 0.0]))


class GeneralisedMaxwell(RelaxingArms):
    r"""A spring parallel to n arms of spring and damper in series; an arm has a stiffness and a relaxation time.

    .. math:: K^* = K_\infty + \sum_i K_i \frac{j\omega\tau_i}{1 + j\omega\tau_i}, \qquad K_\infty, K_i \ge 0

    The model is causal and passive. Its parameters are K_inf, K_1 ... K_n, tau_1 ... tau_n; the arms of a fit are in
    falling order of the relaxation time.

    Parameters
    ----------
    arms : int
        Number n of arms, from 1 to 60.

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
        ends, numbers = (0.0, np.inf), range(1, arms + 1)
        self.parameters = (
            Parameter("K_inf", "N/m", *ends, 180e3, "stiffness at rest", log=True),
            *(Parameter(f"K_{i}", "N/m", *ends, 60e3, f"spring of arm {i}", log=True) for i in numbers),
            *(Parameter(f"tau_{i}", "s", *ends, 10.0**-i, f"relaxation time of arm {i}", log=True) for i in numbers),
        )

    def starts(self, data: StiffnessData, count: int) -> FloatArray:
        """Non-negative stiffnesses at several sets of relaxation times."""
        return np.stack([arms_at(one, self.arms, count) for one in whitened_conditions(data)], axis=1)


def _zener(k: ComplexArray, omega: FloatArray) -> FloatArray:
    """K1, K2 and C (B, 3) by linear least squares: K* (1 + jw tau) = K1 + jw tau (K1 + K2), tau = C/K2."""
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


def _over_band(condition: WhitenedCondition, count: int) -> FloatArray:
    """K1, K2 and C (count, 3) of arms whose relaxation times are spread from 1/3 to 3 times the band."""
    ends = np.log(1.0 / condition.omega.max() / 3.0), np.log(3.0 / condition.omega.min())
    times = np.exp(ends[0] + (ends[1] - ends[0]) * (np.arange(count) + 0.5) / count)
    arms = relaxation(condition.omega, times[:, None, None])
    springs, _ = two_springs(condition.rows(np.concatenate([np.ones_like(arms), arms], axis=-1)), condition.target)
    springs = np.maximum(springs, _LEAST_SPRING * np.mean(np.abs(condition.stiffness)))
    return np.stack([springs[:, 0], springs[:, 1], times * springs[:, 1]], axis=1)
