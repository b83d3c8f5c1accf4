"""Friction and filled rubber: a stepper of fourth order for all recordings at once, its step halved until 1e-6.

A slipping element has the deflection z with z' = v - |v| z / z_max, and the force k z: friction of k z_max that begins
with the stiffness k. Several of them make a stiffness that falls with the amplitude.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from elastomer_truth.mechanics import Array, StateSpace

#: A step is small enough when half of it changes the harmonics by less than this share of the fundamental.
CLOSE = 1e-6
_FEWEST, _MOST = 256, 16384
#: Relative change of a state by which the map of one period is linearised.
_NUDGE = 1e-6


class Batch:
    """The state spaces of several recordings with equal structure, stepped together."""

    def __init__(self, spaces: Sequence[StateSpace], frequencies: Array, amplitudes: Array) -> None:
        self.size = spaces[0].size
        self.outputs = np.array([space.outputs for space in spaces])
        self.places = np.array([place for place, _, _ in spaces[0].slips])
        self.largest = np.array([[largest for _, largest, _ in space.slips] for space in spaces])[:, None, :]
        # The velocities of the slipping elements are found together with the rates of all states.
        rows = np.array([[*space.rates, *(row for _, _, row in space.slips)] for space in spaces])
        self.by_state, self.by_drive = rows[:, :, : self.size].transpose(0, 2, 1), rows[:, :, self.size :]
        self.omega = 2 * np.pi * np.asarray(frequencies)
        self.amplitude = np.asarray(amplitudes)

    def drive(self, turn: float) -> Array:
        """x1, v1 and a1 (R, 3) at this share of a period."""
        cos, sin = np.cos(2 * np.pi * turn), np.sin(2 * np.pi * turn)
        a, w = self.amplitude, self.omega
        return np.stack([a * cos, -a * w * sin, -a * w * w * cos], axis=1)

    def slope(self, state: Array, drive: Array) -> Array:
        """Derivative of states (R, P, n) by time."""
        both = state @ self.by_state + (self.by_drive @ drive[:, :, None]).transpose(0, 2, 1)
        rate, speed = both[:, :, : self.size], both[:, :, self.size :]
        rate[:, :, self.places] -= np.abs(speed) * state[:, :, self.places] / self.largest
        return rate

    def cycle(self, state: Array, count: int, keep: bool = False) -> tuple[Array, Array | None]:
        """States (R, P, n) after one period of `count` steps, and the outputs (count, R, 4) of the first of P."""
        step = (2 * np.pi / self.omega / count)[:, None, None]
        kept = np.empty((count, len(state), 4)) if keep else None
        after = self.drive(0.0)
        for at in range(count):
            before, middle, after = after, self.drive((at + 0.5) / count), self.drive((at + 1) / count)
            if kept is not None:
                both = np.concatenate([state[:, 0], before], axis=1)
                kept[at] = np.einsum("rij,rj->ri", self.outputs, both)
            k1 = self.slope(state, before)
            k2 = self.slope(state + step / 2 * k1, middle)
            k3 = self.slope(state + step / 2 * k2, middle)
            k4 = self.slope(state + step * k3, after)
            state = state + step / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        return state, kept


def steady_slipping(spaces: Sequence[StateSpace], frequencies: Array, amplitudes: Array) -> Array:
    """Outputs (R, N, 4) over one steady period of each recording under x1 = a cos wt.

    The steady state is the fixed point of the map of one period, by Newton's method; the step is then halved.
    """
    batch = Batch(spaces, frequencies, amplitudes)
    scale = np.abs(amplitudes)[:, None] * np.maximum(1.0, batch.omega[:, None])
    state, inverse, count = _begun(batch, scale)
    last = None
    while count <= _MOST:
        state, outputs = _fixed_point(batch, state, inverse, count, scale)
        harmonics = np.fft.rfft(outputs, axis=0)[:8] / count
        if last is not None and np.all(np.abs(harmonics - last) <= CLOSE * np.abs(harmonics[1])):
            return outputs.transpose(1, 0, 2)
        last, count = harmonics, 2 * count
    raise ValueError(f"steps of 1/{_MOST} of a period still change the harmonics")


def _begun(batch: Batch, scale: Array) -> tuple[Array, Array, int]:
    """A state (R, n) that is nearly periodic, the inverse of 1 - its derivative after a period, and the steps."""
    count = _FEWEST
    while count <= _MOST:
        state = np.zeros((len(scale), batch.size))
        for _ in range(20):
            with np.errstate(all="ignore"):
                gap, inverse = _derivative(batch, state, count, scale)
            if not np.all(np.isfinite(gap)) or np.abs(gap).max() > 1e3 * scale.max():
                break
            state = state + (inverse @ gap[:, :, None])[:, :, 0]
            if np.all(np.abs(gap) < 1e-3 * scale):
                return state, inverse, count
        count *= 2  # too few steps: they are not stable
    raise ValueError("no steady state of a recording with friction was found")


def _derivative(batch: Batch, state: Array, count: int, scale: Array) -> tuple[Array, Array]:
    """Change of a state after a period (R, n), and the inverse of 1 - the derivative after it (R, n, n)."""
    nudge = _NUDGE * scale[:, :, None]
    nudges = np.concatenate([np.zeros((1, batch.size)), np.eye(batch.size)])[None] * nudge
    after, _ = batch.cycle(state[:, None, :] + nudges, count)
    by_state = (after[:, 1:] - after[:, :1]).transpose(0, 2, 1) / nudge
    whole = np.where(np.isfinite(by_state), np.eye(batch.size) - by_state, np.eye(batch.size))
    return after[:, 0] - state, np.linalg.inv(whole)


def _fixed_point(batch: Batch, state: Array, inverse: Array, count: int, scale: Array) -> tuple[Array, Array]:
    """The periodic state (R, n) and the outputs (count, R, 4) of its period, by Newton's method."""
    last = np.inf
    for _ in range(60):
        after, kept = batch.cycle(state[:, None, :], count, keep=True)
        gap = after[:, 0] - state
        size = float((np.abs(gap) / scale).max())
        if size < 1e-9 and kept is not None:
            return state, kept
        if size > 0.3 * last:
            gap, inverse = _derivative(batch, state, count, scale)
        state, last = state + (inverse @ gap[:, :, None])[:, :, 0], size
    raise ValueError("a recording with friction does not become steady")
