"""Relaxation spectra for starts: whitened conditions, non-negative springs on given times, layouts of the times."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice

import numpy as np
from scipy import optimize

from fourpole.core.arrays import BoolArray, ByValue, ComplexArray, FloatArray
from fourpole.models.data import StiffnessData

__all__ = ["WhitenedCondition", "arms_at", "two_springs", "whitened_conditions"]

#: Relaxation times per decade of the spectrum's grid, and decades beyond the band on either side.
_FINE, _BEYOND = 8, 1.0
#: Distance to the neighbour [1, logarithm of time] that is assumed for the first and the last arm.
_ALONE = 2.0
#: Powers of an arm's weight by which times are shared out, the best first.
_SHARES = (0.5, 0.25, 1.0)
#: Ends of times that are spread evenly, as multiples of the band's.
_SPREADS = (1.6, 0.3, 3.0)
#: Stiffness of an arm that the spectrum leaves without any, as a share of the misfit: a logarithm cannot leave zero.
_IDLE = 0.03
#: Number of layouts of a Maxwell model that are compared before the best start is chosen.
_LOOKED_AT = 3


@dataclass(frozen=True, eq=False)
class WhitenedCondition(ByValue):
    """K* of one condition, and what brings it to standard units."""

    omega: FloatArray
    stiffness: ComplexArray
    whiten: FloatArray
    k1: float
    k1_std: float

    def rows(self, terms: ComplexArray) -> FloatArray:
        """Terms (..., N, k) in standard units; the first is the stiffness at rest, and a known K1 is one more row."""
        flat = (*terms.shape[:-2], 2 * self.omega.size, terms.shape[-1])
        if self.whiten.ndim == 2:
            whole = self.whiten @ np.stack([terms.real, terms.imag], axis=-2).reshape(flat)
        else:
            by_real, by_imag = self.whiten[:, :, None, 0], self.whiten[:, :, None, 1]
            whole = by_real * terms.real[..., None, :] + by_imag * terms.imag[..., None, :]
        at_rest = np.zeros((*terms.shape[:-2], 1, terms.shape[-1]))
        at_rest[..., 0] = 1.0 / self.k1_std
        return np.concatenate([whole.reshape(flat), at_rest], axis=-2)

    @property
    def wanted(self) -> FloatArray:
        """K*, and K1, in standard units."""
        seen = self.rows(self.stiffness[:, None])[:, 0]
        seen[-1] = self.k1 / self.k1_std
        return np.asarray(seen)

    def relaxing(self, times: FloatArray) -> FloatArray:
        """A spring, and an arm of each relaxation time, per unit, in standard units (2N + 1, T + 1)."""
        relaxed = 1.0 - 1.0 / (1.0 + 1j * self.omega[:, None] * times)
        return self.rows(np.concatenate([np.ones((self.omega.size, 1)), relaxed], axis=1))


def whitened_conditions(data: StiffnessData) -> list[WhitenedCondition]:
    """Each of conditions (B, N) by itself; where K1 is not known, it weighs nothing."""
    whiten = data.whitener()
    known = np.isfinite(data.k1) & np.isfinite(data.k1_std)
    k1, std = np.where(known, data.k1, 0.0), np.where(known, data.k1_std, np.inf)
    rows = zip(data.omega, data.stiffness, whiten, k1.tolist(), std.tolist(), strict=True)
    return [WhitenedCondition(*row) for row in rows]


def two_springs(rows: FloatArray, wanted: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The best two weights >= 0 (..., 2) of rows (..., M, 2), and their squared misfit."""
    turned = np.swapaxes(rows, -1, -2)
    normal, right = turned @ rows, turned @ wanted
    size = np.maximum(np.diagonal(normal, 0, -2, -1), 1e-300)
    normal = normal + 1e-12 * size[..., None] * np.eye(2)
    both = np.linalg.solve(normal, right[..., None])[..., 0]
    alone = np.maximum(right / size, 0.0) * np.where(both[..., ::-1] < 0, 1.0, 0.0)
    found = np.where(np.any(both < 0, axis=-1)[..., None], alone, both)
    return found, np.sum(((rows @ found[..., None])[..., 0] - wanted) ** 2, axis=-1)


def _non_negative(rows: FloatArray, wanted: FloatArray) -> tuple[FloatArray, float, FloatArray]:
    """Non-negative least squares: weights (k,), misfit, and the size of each column."""
    size = np.maximum(np.linalg.norm(rows, axis=0), 1e-300)
    found, misfit = optimize.nnls(rows / size, wanted, maxiter=20 * rows.shape[1])
    return found / size, float(misfit), size


def arms_at(seen: WhitenedCondition, arms: int, count: int) -> FloatArray:
    """Non-negative springs on several layouts of the relaxation times (count or fewer, P), the best first."""
    layouts = islice(_layouts(seen, arms), max(count, _LOOKED_AT))
    tried = [_springs_at(seen, np.exp(np.sort(logs)[::-1])) for logs in layouts]  # the slowest first
    first = sorted(tried[:_LOOKED_AT], key=lambda one: one[1])
    return np.array([start for start, _ in [*first, *tried[_LOOKED_AT:]]])[:count]


def _layouts(seen: WhitenedCondition, arms: int) -> Iterator[FloatArray]:
    """Logarithms of relaxation times, the layouts that serve best first."""
    spectrum = _spectrum(seen)
    yield spectrum.merged(arms)
    for power, beyond in zip(_SHARES, _SPREADS, strict=True):
        yield spectrum.shared(arms, power)
        yield _spread(seen, arms, beyond)


def _springs_at(seen: WhitenedCondition, times: FloatArray) -> tuple[FloatArray, float]:
    """K_inf and springs >= 0 at the times, as parameters (P,), and their misfit; none is quite without stiffness."""
    found, misfit, size = _non_negative(seen.relaxing(times), seen.wanted)
    idle = _IDLE * (misfit + 1.0) / size / np.sqrt(times.size)
    return np.concatenate([np.maximum(found, idle), times]), misfit


def _spread(seen: WhitenedCondition, arms: int, beyond: float) -> FloatArray:
    """Logarithms of times that are evenly spread over the band and somewhat beyond; a single one lies within it."""
    if arms == 1:
        low, high = -np.log(seen.omega.max()), -np.log(seen.omega.min())
        return np.array([low + (high - low) * beyond / (1.0 + beyond)])
    low, high = np.sort([-np.log(seen.omega.max() * beyond), -np.log(seen.omega.min() / beyond)])
    return np.linspace(low, high, arms)


@dataclass(frozen=True)
class _Spectrum:
    """The best non-negative spectrum on a fine grid.

    Its arms are at `logs` of time, with stiffnesses `springs`. On the `grid`, `bends` is how far a unit of stiffness
    moves K*, in standard units, as its time is smeared, by the square of the smear in logarithms. `even` is the
    condition, for a tyre that hardly relaxes.
    """

    logs: FloatArray
    springs: FloatArray
    grid: FloatArray
    bends: FloatArray
    even: WhitenedCondition

    def weights(self, logs: FloatArray, springs: FloatArray) -> FloatArray:
        """How much the data feel where an arm is."""
        return springs * np.interp(logs, self.grid, self.bends)

    def shared(self, arms: int, power: float) -> FloatArray:
        """Logarithms of times with an equal share of the weights' power between them."""
        if self.logs.size < 2:
            return _spread(self.even, arms, 1.0 + power)
        share = self.weights(self.logs, self.springs) ** power
        middle = (np.cumsum(share) - 0.5 * share) / np.sum(share)
        return np.interp((np.arange(arms) + 0.5) / arms, middle, self.logs)

    def merged(self, arms: int) -> FloatArray:
        """Logarithms of times: neighbours made one where that costs least, or the heaviest made two."""
        if self.logs.size == 0:
            return _spread(self.even, arms, _SPREADS[0])
        logs, springs = self.logs, self.springs
        while logs.size > arms:
            both = springs[1:] + springs[:-1]
            middle = (springs[1:] * logs[1:] + springs[:-1] * logs[:-1]) / both
            cost = self.weights(middle, springs[1:] * springs[:-1] / both) * np.diff(logs) ** 2
            at = int(np.argmin(cost))
            logs = np.concatenate([logs[:at], [middle[at]], logs[at + 2 :]])
            springs = np.concatenate([springs[:at], [both[at]], springs[at + 2 :]])
        while logs.size < arms:
            gaps = np.diff(logs, prepend=logs[0] - _ALONE, append=logs[-1] + _ALONE)
            room = np.minimum(gaps[1:], gaps[:-1])
            at = int(np.argmax(self.weights(logs, springs) * room**2))
            halves = logs[at] + 0.25 * room[at] * np.array([-1.0, 1.0])
            logs = np.concatenate([logs[:at], halves, logs[at + 1 :]])
            springs = np.concatenate([springs[:at], np.full(2, 0.5 * springs[at]), springs[at + 1 :]])
        return logs


def _spectrum(seen: WhitenedCondition) -> _Spectrum:
    decades = np.log10(seen.omega.max() / seen.omega.min()) + 2 * _BEYOND
    low = -np.log(seen.omega.max()) - _BEYOND * np.log(10.0)
    grid = np.linspace(low, low + decades * np.log(10.0), int(np.ceil(decades * _FINE)) + 1)
    rows = seen.relaxing(np.exp(grid))
    springs = _non_negative(rows, seen.wanted)[0][1:]
    bends = np.linalg.norm(np.diff(rows[:, 1:], 2, axis=1), axis=0) / (grid[1] - grid[0]) ** 2
    used: BoolArray = springs > 0
    return _Spectrum(grid[used], springs[used], grid, np.concatenate([bends[:1], bends, bends[-1:]]), seen)
