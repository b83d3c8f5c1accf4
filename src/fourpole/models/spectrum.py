"""Start values of Maxwell models: non-negative stiffnesses of arms, and sets of relaxation times."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import islice

import numpy as np
import scipy
from numpy.typing import ArrayLike

from fourpole.core.arrays import BoolArray, ByValue, ComplexArray, FloatArray
from fourpole.models.data import StiffnessData, relaxation

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


@dataclass(frozen=True, eq=False)
class WhitenedCondition(ByValue):
    """Data of one condition with their whitener: terms of K* become rows of a real least-squares problem.

    The last row is that of K1. It has no weight if K1 is not known.
    """

    data: StiffnessData
    whiten: FloatArray

    @property
    def omega(self) -> FloatArray:
        """Angular frequencies (N,) [rad/s]."""
        return self.data.omega

    @property
    def stiffness(self) -> ComplexArray:
        """K* (N,) [N/m]."""
        return self.data.stiffness

    def rows(self, terms: ComplexArray, static: ArrayLike = 0.0) -> FloatArray:
        """Terms of K* (..., N, k) as rows (..., 2N + 1, k); the first term is the stiffness at zero frequency.

        `static` is the share of the other terms in K1 [1].
        """
        k1 = np.zeros((*terms.shape[:-2], 1, terms.shape[-1]))
        if self.data.has_k1:
            k1[..., 0] = 1.0 / self.data.k1_std
            k1[..., 1:] = np.asarray(static) / self.data.k1_std
        return np.concatenate([self.data.whitened(self.whiten, terms), k1], axis=-2)

    @property
    def target(self) -> FloatArray:
        """K* and K1 in standard uncertainties (2N + 1,)."""
        k1 = self.data.k1 / self.data.k1_std if self.data.has_k1 else 0.0
        return np.append(self.data.whitened(self.whiten, self.stiffness[:, None])[:, 0], k1)

    def arms(self, times: FloatArray) -> FloatArray:
        """Rows (2N + 1, T + 1) of a unit spring and of unit arms with relaxation times (T,) [s]."""
        terms = np.concatenate([np.ones((self.omega.size, 1)), relaxation(self.omega, times)], axis=1)
        return self.rows(terms, self.data.static_share(times))


def whitened_conditions(data: StiffnessData) -> list[WhitenedCondition]:
    """Each of the conditions (B, N), whose frequencies are (B, N) as well, with its whitener."""
    parts = (data.omega, data.stiffness, data.covariance, data.k1, data.k1_std)
    ramps = [{name: one[at] for name, one in data.ramp.items()} for at in range(len(data.stiffness))]
    rows = zip(*parts, data.whitener(), ramps, strict=True)
    return [WhitenedCondition(StiffnessData(*row, **ramp), whiten) for *row, whiten, ramp in rows]


def each_whitened(data: StiffnessData) -> list[WhitenedCondition]:
    """Each of the conditions (...,) with its whitener."""
    flat = data.flat()
    return whitened_conditions(replace(flat, omega=np.broadcast_to(flat.omega, flat.stiffness.shape)))


def two_springs(rows: FloatArray, target: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Least-squares weights >= 0 (..., 2) of two terms with rows (..., M, 2), and the sum of squared residuals."""
    turned = np.swapaxes(rows, -1, -2)
    normal, right = turned @ rows, turned @ target
    size = np.maximum(np.diagonal(normal, 0, -2, -1), 1e-300)
    normal = normal + 1e-12 * size[..., None] * np.eye(2)
    both = np.linalg.solve(normal, right[..., None])[..., 0]
    alone = np.maximum(right / size, 0.0) * np.where(both[..., ::-1] < 0, 1.0, 0.0)
    found = np.where(np.any(both < 0, axis=-1)[..., None], alone, both)
    return found, np.sum(((rows @ found[..., None])[..., 0] - target) ** 2, axis=-1)


def _non_negative(rows: FloatArray, target: FloatArray) -> tuple[FloatArray, float, FloatArray]:
    """Non-negative least squares: weights (k,), norm of the residuals, and the norm of each column."""
    size = np.maximum(np.linalg.norm(rows, axis=0), 1e-300)
    found, misfit = scipy.optimize.nnls(rows / size, target, maxiter=20 * rows.shape[1])
    return found / size, float(misfit), size


def arms_at(condition: WhitenedCondition, arms: int, count: int) -> FloatArray:
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
    found, misfit, size = _non_negative(condition.arms(times), condition.target)
    idle = _IDLE * (misfit + 1.0) / size / np.sqrt(times.size)
    return np.concatenate([np.maximum(found, idle), times]), misfit


def _spread(condition: WhitenedCondition, arms: int, beyond: float) -> FloatArray:
    """Logarithms of times, evenly spread over the band and beyond it by a factor; a single time is within the band."""
    low, high = -np.log(condition.omega.max()), -np.log(condition.data.lowest)
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
    decades = np.log10(condition.omega.max() / condition.data.lowest) + 2 * _BEYOND
    low = -np.log(condition.omega.max()) - _BEYOND * np.log(10.0)
    grid = np.linspace(low, low + decades * np.log(10.0), int(np.ceil(decades * _FINE)) + 1)
    rows = condition.arms(np.exp(grid))
    springs = _non_negative(rows, condition.target)[0][1:]
    inner = np.linalg.norm(np.diff(rows[:, 1:], 2, axis=1), axis=0) / (grid[1] - grid[0]) ** 2
    used: BoolArray = springs > 0
    return _Spectrum(grid[used], springs[used], grid, np.concatenate([inner[:1], inner, inner[-1:]]), condition)
