"""Models of relaxation: the paper's Zener model, the generalised Maxwell model, and Prony series."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import islice, product

import numpy as np
from numpy.typing import ArrayLike

from fourpole.core.arrays import BoolArray, ComplexArray, FloatArray
from fourpole.errors import ModelError
from fourpole.models.data import StiffnessData, relaxation, spring_and_arms
from fourpole.models.interface import Arms, Model, Parameter, StateSpace, columns, positive
from fourpole.models.nonnegative import WhitenedCondition, least_squares, two_springs, whitened_conditions

_MOST_ARMS = 60
#: Least stiffness of a start as a fraction of |K*|, and least relaxation time as a fraction of 1/omega.
_LEAST_SPRING, _LEAST_TIME = 0.01, 1e-6
#: Relaxation times per decade where none are stated, and largest number. K'' of a flat spectrum ripples by 5.5 % with
#: one time per decade, by 0.08 % with two, by 0.001 % with three.
USUAL, _MOST_PER_DECADE = 3, 12
#: Least and largest number of arms.
_FEWEST, _MOST_FIXED = 3, 300
#: Decades by which the times may extend beyond each end of the band; the best of all pairs is taken.
_ENDS_BEYOND = (0.0, 0.25, 0.5, 1.0)
#: Relaxation times per decade of the grid of a spectrum, and decades of the grid beyond each end of the band.
_FINE, _BEYOND = 8, 1.0
#: Assumed distance of the first and the last arm to a further neighbour, in ln(tau).
_END_GAP = 2.0
#: Exponents of the weight of an arm when times are divided into equal parts, the best first.
_SHARES = (0.5, 0.25, 1.0)
#: Factors by which evenly spread times extend beyond the band.
_SPREADS = (1.6, 0.3, 3.0)
#: Stiffness of an arm that least squares sets to zero, as a fraction of the misfit: its logarithm must be finite.
_IDLE = 0.03
#: Number of sets of times that are compared before the best start is chosen.
_COMPARED = 3


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
        return self.prony(values).space


class RelaxingArms(Model):
    """Base of the models of a spring parallel to arms: parameters K_inf, K_1 ... K_n, tau_1 ... tau_n."""

    arms: int

    def _set_arms(self, times: Sequence[float], *, log: bool, more: str = "") -> None:
        """The number of arms, and their parameters with the usual relaxation times [s]."""
        self.arms = len(times)
        ends, arms = (0.0, np.inf), list(enumerate(times, start=1))
        self.parameters = (
            Parameter("K_inf", "N/m", *ends, 180e3, "stiffness at rest", log),
            *(Parameter(f"K_{i}", "N/m", *ends, 60e3, f"spring of arm {i}", log) for i, _ in arms),
            *(Parameter(f"tau_{i}", "s", *ends, tau, f"relaxation time of arm {i}{more}", log) for i, tau in arms),
        )

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
        """State space with one state per arm, the deflection of its damper."""
        return self.prony(values).space


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
        self.name = f"maxwell:{arms}"
        self._set_arms([10.0**-i for i in range(1, arms + 1)], log=True)

    def starts(self, data: StiffnessData, count: int) -> FloatArray:
        """Non-negative stiffnesses at several sets of relaxation times."""
        return np.stack([_starts_at(one, self.arms, count) for one in whitened_conditions(data)], axis=1)


class Prony(RelaxingArms):
    r"""A spring parallel to n arms of spring and damper in series, at fixed relaxation times.

    .. math:: K^* = K_\infty + \sum_i K_i \frac{j\omega\tau_i}{1 + j\omega\tau_i}, \qquad K_\infty, K_i \ge 0

    The model is causal and passive. It is linear in its free parameters K_inf, K_1 ... K_n, so that a fit has one
    optimum, found by non-negative least squares. The times tau_1 ... tau_n are evenly spaced in their logarithm and
    fixed; they fall with their number.

    Parameters
    ----------
    per_decade : int
        Relaxation times per decade of the band, from 1 to 12.
    times : sequence of float, optional [s]
        The relaxation times, falling; without them those of 1 ms to 100 ms, until `placed` chooses others.

    References
    ----------
    C. L. Lawson, R. J. Hanson, "Solving least squares problems", 1974, ch. 23; N. W. Tschoegl, "The phenomenological
    theory of linear viscoelastic behavior", 1989, ch. 4.

    Examples
    --------
    >>> Prony(1, [0.1, 0.01]).stiffness([180e3, 60e3, 60e3, 0.1, 0.01], [20 * np.pi]).round(2)
    array([255500.32+36342.02j])
    """

    special_cases = ("spring",)
    linear = True
    #: In a narrower band the models with few parameters are compared; a spectrum has no end that the data show there.
    least_decades = 4.0

    def __init__(self, per_decade: int = USUAL, times: ArrayLike = ()) -> None:
        if not 1 <= per_decade <= _MOST_PER_DECADE:
            raise ModelError(
                f"a Prony series has 1 to {_MOST_PER_DECADE} relaxation times per decade, not {per_decade}"
            )
        self.per_decade = per_decade
        self.times = np.asarray(times, dtype=float)
        self._is_placed = self.times.size > 0
        if not self._is_placed:
            self.times = np.logspace(-1.0, -3.0, 2 * per_decade + 1)
        if self.times.size > _MOST_FIXED:
            raise ModelError(
                f"a Prony series has at most {_MOST_FIXED} arms, not {self.times.size}: state fewer per decade"
            )
        self.name = f"prony:{per_decade}"
        self._set_arms(self.times.tolist(), log=False, more=", fixed")
        self.usually_fixed = tuple(f"tau_{i}" for i in range(1, self.arms + 1))

    def placed(self, conditions: Sequence[StiffnessData]) -> Prony:
        """The model with relaxation times over the band of all conditions.

        A static test of finite duration extends the band. The number of times is that of the band and its decades.
        Each end of the times lies 0, 1/4, 1/2 or 1 decade beyond the band; of these choices the one with the least
        chi-square is taken.
        """
        if self._is_placed:
            return self
        low = min(one.lowest for one in conditions)
        high = max(float(one.omega.max()) for one in conditions)
        decades = float(np.log10(high) - np.log10(low))
        count = max(int(decades * self.per_decade + 1e-6) + 1, _FEWEST)
        if count > _MOST_FIXED:
            raise ModelError(
                f"{count} relaxation times over {decades:.3g} decades are more than {_MOST_FIXED}: state fewer per "
                f"decade, as prony:{max(int(_MOST_FIXED / decades), 1)}"
            )
        rows = [one for each in conditions for one in whitened_conditions(each)]
        best: tuple[float, FloatArray] | None = None
        for below, above in product(_ENDS_BEYOND, repeat=2):
            times = np.logspace(above - np.log10(low), -below - np.log10(high), count)
            chi2 = sum(least_squares(one.arms(times), one.target)[1] for one in rows)
            if best is None or chi2 < best[0] * (1 - 1e-9):
                best = chi2, times
        assert best is not None
        return Prony(self.per_decade, best[1])

    def with_parameters(self, count: int) -> Prony:
        """The model with this number of parameters, for values that include the relaxation times."""
        if count % 2 == 0:
            raise ModelError(f"a Prony series has an odd number of parameters, not {count}")
        return self if count == len(self.parameters) else Prony(self.per_decade, 10.0 ** -np.arange(count // 2))

    def starts(self, data: StiffnessData, count: int) -> FloatArray:  # noqa: ARG002
        """One start: the fit itself finds the optimum."""
        return np.broadcast_to(self.defaults, (1, len(data.stiffness), len(self.parameters)))


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
    ends = np.log(1.0 / condition.data.omega.max() / 3.0), np.log(3.0 / condition.data.omega.min())
    times = np.exp(ends[0] + (ends[1] - ends[0]) * (np.arange(count) + 0.5) / count)
    terms = spring_and_arms(condition.data.omega, times[:, None, None])
    springs, _ = two_springs(condition.rows(terms), condition.target)
    springs = np.maximum(springs, _LEAST_SPRING * np.mean(np.abs(condition.data.stiffness)))
    return np.stack([springs[:, 0], springs[:, 1], times * springs[:, 1]], axis=1)


def _starts_at(condition: WhitenedCondition, arms: int, count: int) -> FloatArray:
    """Starts (count or fewer, P) of a Maxwell model: non-negative stiffnesses at several sets of relaxation times."""
    sets = islice(_time_sets(condition, arms), max(count, _COMPARED))
    starts = [_springs_at(condition, np.exp(np.sort(logs)[::-1])) for logs in sets]
    best = sorted(starts[:_COMPARED], key=lambda one: one[1])
    return np.array([start for start, _ in [*best, *starts[_COMPARED:]]])[:count]


def _time_sets(condition: WhitenedCondition, arms: int) -> Iterator[FloatArray]:
    """Sets of logarithms of relaxation times (arms,), usually the best first."""
    spectrum = _spectrum(condition)
    yield spectrum.merged(arms)
    for power, beyond in zip(_SHARES, _SPREADS, strict=True):
        yield spectrum.shared(arms, power)
        yield _spread(condition, arms, beyond)


def _springs_at(condition: WhitenedCondition, times: FloatArray) -> tuple[FloatArray, float]:
    """Parameters (P,) with stiffnesses > 0 at the times, and the norm of their residuals."""
    rows = condition.arms(times)
    found, chi2 = least_squares(rows, condition.target)
    misfit = float(np.sqrt(chi2))
    idle = _IDLE * (misfit + 1.0) / np.linalg.norm(rows, axis=0) / np.sqrt(times.size)
    return np.concatenate([np.maximum(found, idle), times]), misfit


def _spread(condition: WhitenedCondition, arms: int, beyond: float) -> FloatArray:
    """Logarithms of times, evenly spread over the band and beyond it by a factor; a single time is within the band."""
    low, high = -np.log(condition.data.omega.max()), -np.log(condition.data.lowest)
    if arms == 1:
        return np.array([low + (high - low) * beyond / (1.0 + beyond)])
    low, high = np.sort([low - np.log(beyond), high + np.log(beyond)])
    return np.linspace(low, high, arms)


@dataclass(frozen=True, eq=False)
class _Spectrum:
    """The best non-negative relaxation spectrum of a condition on a fine grid of times.

    Its arms have the logarithms of time `logs` and the stiffnesses `springs`. `curvature` is, on the `grid` of ln(tau),
    the norm of the second derivative of the rows of a unit arm by ln(tau).
    """

    logs: FloatArray
    springs: FloatArray
    grid: FloatArray
    curvature: FloatArray
    condition: WhitenedCondition

    def weights(self, logs: FloatArray, springs: FloatArray) -> FloatArray:
        """Sensitivity of K* to the relaxation time of each arm, in standard uncertainties."""
        return springs * np.interp(logs, self.grid, self.curvature)

    def shared(self, arms: int, power: float) -> FloatArray:
        """Logarithms of times that divide the sum of the powers of the weights into equal parts."""
        if self.logs.size < 2:
            return _spread(self.condition, arms, 1.0 + power)
        share = self.weights(self.logs, self.springs) ** power
        middle = (np.cumsum(share) - 0.5 * share) / np.sum(share)
        return np.interp((np.arange(arms) + 0.5) / arms, middle, self.logs)

    def merged(self, arms: int) -> FloatArray:
        """Logarithms of times: neighbours merged where K* changes least, or the arm of the largest weight divided."""
        if self.logs.size == 0:
            return _spread(self.condition, arms, _SPREADS[0])
        logs, springs = self.logs, self.springs
        while logs.size > arms:
            both = springs[1:] + springs[:-1]
            middle = (springs[1:] * logs[1:] + springs[:-1] * logs[:-1]) / both
            cost = self.weights(middle, springs[1:] * springs[:-1] / both) * np.diff(logs) ** 2
            at = int(np.argmin(cost))
            logs = np.concatenate([logs[:at], [middle[at]], logs[at + 2 :]])
            springs = np.concatenate([springs[:at], [both[at]], springs[at + 2 :]])
        while logs.size < arms:
            gaps = np.diff(logs, prepend=logs[0] - _END_GAP, append=logs[-1] + _END_GAP)
            room = np.minimum(gaps[1:], gaps[:-1])
            at = int(np.argmax(self.weights(logs, springs) * room**2))
            halves = logs[at] + 0.25 * room[at] * np.array([-1.0, 1.0])
            logs = np.concatenate([logs[:at], halves, logs[at + 1 :]])
            springs = np.concatenate([springs[:at], np.full(2, 0.5 * springs[at]), springs[at + 1 :]])
        return logs


def _spectrum(condition: WhitenedCondition) -> _Spectrum:
    """The relaxation spectrum of a condition, by non-negative least squares."""
    decades = np.log10(condition.data.omega.max() / condition.data.lowest) + 2 * _BEYOND
    low = -np.log(condition.data.omega.max()) - _BEYOND * np.log(10.0)
    grid = np.linspace(low, low + decades * np.log(10.0), int(np.ceil(decades * _FINE)) + 1)
    rows = condition.arms(np.exp(grid))
    springs = least_squares(rows, condition.target)[0][1:]
    inner = np.linalg.norm(np.diff(rows[:, 1:], 2, axis=1), axis=0) / (grid[1] - grid[0]) ** 2
    used: BoolArray = springs > 0
    return _Spectrum(grid[used], springs[used], grid, np.concatenate([inner[:1], inner, inner[-1:]]), condition)
