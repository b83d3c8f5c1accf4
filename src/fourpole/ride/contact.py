"""A ride in time with what is not linear in a tyre: the load-deflection curve of the static test, and lift-off.

The road pushes and never pulls. At the end of each step either the tyre touches the road and its force is positive, or
its force is zero and it springs back freely. One equation per wheel decides, so that no lift-off is missed.
"""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass

import numpy as np

from fourpole.core.arrays import ByValue, FloatArray
from fourpole.errors import ModelError
from fourpole.models.interface import StateSpace
from fourpole.ride.comfort import check_step, weighted
from fourpole.ride.linear import LinearSystem, step_matrices
from fourpole.ride.time import TimeRide
from fourpole.ride.vehicle import Body

#: Rounds in which the wheels of one body are solved together, and of the search on a curve.
_ROUNDS, _MOST_ROUNDS = 4, 60


@dataclass(frozen=True, eq=False)
class LoadDeflection(ByValue):
    """The static load of a tyre over its deflection from the first touch; straight between points and beyond the last.

    Attributes
    ----------
    deflection : (N,) float array [m]
    load : (N,) float array [N]
        Both rising, at least two points, the first with a load near zero.

    Raises
    ------
    ModelError
        If the curve does not rise.
    """

    deflection: FloatArray
    load: FloatArray

    def __post_init__(self) -> None:
        """Refuse a curve that does not rise."""
        x, f = self.deflection, self.load
        if x.shape != f.shape or x.ndim != 1 or x.size < 2 or not np.all(np.isfinite([x, f])):
            raise ModelError("a load-deflection curve needs at least two points, each of a deflection and a load")
        if not (np.all(np.diff(x) > 0) and np.all(np.diff(f) > 0)):
            raise ModelError(
                "the load-deflection curve does not rise everywhere: take its mean branch from zero load on"
            )

    def deflection_at(self, load: float) -> float:
        """Deflection [m] at a load [N]; ModelError beyond the ends of the curve."""
        if not self.load[0] <= load <= self.load[-1]:
            raise ModelError(
                f"the static load of the wheel, {load:.4g} N, is not on the load-deflection curve, which goes from "
                f"{self.load[0]:.4g} to {self.load[-1]:.4g} N: measure up to this load, or take a lighter vehicle"
            )
        return float(np.interp(load, self.load, self.deflection))

    def tangent_at(self, load: float) -> float:
        """Stiffness [N/m] at a load [N]: the slope of the part of the curve that has it."""
        at = min(max(bisect_right(self.load.tolist(), load) - 1, 0), self.load.size - 2)
        return float((self.load[at + 1] - self.load[at]) / (self.deflection[at + 1] - self.deflection[at]))


@dataclass(frozen=True)
class _Static:
    """The static load over the deflection from the rest under the vehicle's weight, as straight parts."""

    x: list[float]
    load: list[float]
    slope: list[float]

    @classmethod
    def of(cls, curve: LoadDeflection | None, stiffness: float, weight: float) -> _Static:
        if curve is None:
            return cls([0.0], [weight], [stiffness])
        x = curve.deflection - curve.deflection_at(weight)
        return cls(x.tolist(), curve.load.tolist(), [*(np.diff(curve.load) / np.diff(x)).tolist()])

    def at(self, x: float) -> tuple[float, float]:
        """Load [N] and tangent [N/m] at a deflection."""
        part = min(max(bisect_right(self.x, x) - 1, 0), len(self.slope) - 1)
        return self.load[part] + self.slope[part] * (x - self.x[part]), self.slope[part]

    def solved(self, gain: float, right: float, start: float) -> float:
        """The deflection x at which load(x) + gain x = right; the left side rises."""
        x = start
        for _ in range(_MOST_ROUNDS):
            load, slope = self.at(x)
            change = (right - load - gain * x) / (slope + gain)
            x += change
            if abs(change) <= 1e-13 * (1e-3 + abs(x)):
                break
        return x


@dataclass(frozen=True, eq=False)
class ContactRide(ByValue):
    """A ride that is not linear.

    Attributes
    ----------
    ride : TimeRide
        Loads are from the static load, so that a wheel in the air has minus its static load.
    in_air : (W,) float array [1]
        Share of the time that each wheel has no contact.
    beyond : (W,) float array [1]
        Share of the time that each tyre is deflected further than its load-deflection curve goes.
    """

    ride: TimeRide
    in_air: FloatArray
    beyond: FloatArray


def ride_with_contact(
    body: Body, tyre: StateSpace, heights: FloatArray, step: float, curve: LoadDeflection | None = None
) -> ContactRide:
    """The ride over sampled heights of the road, with lift-off, and with a load-deflection curve if there is one.

    The force of a tyre is that of its static curve, plus what the model has beyond its static stiffness. Without a
    curve the static force is linear. Loads are straight within a step, so the error falls with the square of the step.

    Parameters
    ----------
    body : Body
    tyre : StateSpace
    heights : (W, N) float array [m]
        Road under each wheel; the vehicle is at rest on the first ones. See `time.axles`.
    step : float [s]
        A quarter of a millisecond leaves errors below 0.1 % of a_w.
    curve : LoadDeflection, optional

    Raises
    ------
    ModelError
        If the step is too long, or the static load of a wheel is not on the curve.
    """
    check_step(step)
    heights = np.asarray(heights, dtype=float)
    if heights.ndim != 2 or len(heights) != body.wheels or not np.all(np.isfinite(heights)):
        raise ModelError(f"heights of shape {heights.shape} are no road under {body.wheels} wheels without gaps")
    wheels, count = body.wheels, heights.shape[1]
    stepper = _Stepper.of(body, tyre, step, curve)
    loads, deflections, motions = (np.zeros((one, count)) for one in (wheels, wheels, 2 * len(body.mass)))
    roads = (heights - heights[:, :1]).T
    for at in range(1, count):
        stepper.go(roads[at])
        loads[:, at], deflections[:, at], motions[:, at] = stepper.force, stepper.deflection, stepper.motion
    n = len(body.mass)
    q, speed = motions[:n], motions[n:]
    forces = np.zeros((n, count))
    forces[n - wheels :] = loads
    acceleration = body.seat @ np.linalg.solve(body.mass, forces - body.stiffness @ q - body.damping @ speed)
    found = TimeRide(step, acceleration, weighted(acceleration, step), loads, body.travel @ q, deflections)
    ends = np.array([one.x[-1] if curve is not None else np.inf for one in stepper.static])[:, None]
    air = loads <= -body.loads[:, None] * (1 - 1e-12)
    return ContactRide(found, np.mean(air, axis=1), np.mean(deflections > ends, axis=1))


class _Stepper:
    """The vehicle and its tyres, from one sample of the road to the next."""

    def __init__(self, body: Body, tyre: StateSpace, step: float, static: list[_Static], rest: float) -> None:
        n, wheels, size = len(body.mass), body.wheels, len(tyre.a)
        self.static, self.weight = static, body.loads
        inverse = np.linalg.inv(body.mass)
        onto = np.eye(n)[:, n - wheels :]
        a = np.block([[np.zeros((n, n)), np.eye(n)], [-inverse @ body.stiffness, -inverse @ body.damping]])
        b = np.vstack([np.zeros((n, wheels)), inverse @ onto])
        self._turn, self._hold, self._slope = step_matrices(_states(a, b, np.zeros_like(b)), step)
        self._wheel = np.hstack([onto.T, np.zeros((wheels, n))])
        self._gain = self._wheel @ self._slope
        self._relax = step_matrices(_states(tyre.a, tyre.b[:, :1], tyre.b[:, 1:]), step)
        self._c, self._rate = tyre.c, float(tyre.d[1]) / step  # the rate is a backward difference of second order
        #: Change of the force that the model has beyond its static stiffness, per deflection at the end of the step.
        self._stiff = float(tyre.c @ self._relax[2][:, 0]) + float(tyre.d[0]) - rest + 1.5 * self._rate
        self.force, self.deflection, self._before = np.zeros(wheels), np.zeros(wheels), np.zeros(wheels)
        self.motion, self._relaxed = np.zeros(2 * n), np.zeros((size, wheels))

    @classmethod
    def of(cls, body: Body, tyre: StateSpace, step: float, curve: LoadDeflection | None) -> _Stepper:
        rest = float(tyre.d[0])
        if tyre.a.size:
            rest -= float(tyre.c @ np.linalg.solve(tyre.a, tyre.b[:, 0]))
        static = [_Static.of(curve, rest, weight) for weight in body.loads.tolist()]
        return cls(body, tyre, step, static, rest)

    def go(self, road: FloatArray) -> None:
        """One step, to these heights of the road."""
        turn, hold, slope = self._relax
        coming = turn @ self._relaxed + (hold - slope) * self.deflection
        beyond = self._c @ coming - self._rate * (2.0 * self.deflection - 0.5 * self._before)
        motion = self._turn @ self.motion + (self._hold - self._slope) @ self.force
        free = road - self._wheel @ motion
        force, x = self.force.copy(), self.deflection.copy()
        for _ in range(1 if force.size == 1 else _ROUNDS):
            for at, static in enumerate(self.static):
                gain = self._gain[at, at]
                others = float(self._gain[at] @ force) - gain * force[at]
                right = (free[at] - others) / gain + self.weight[at] - beyond[at]
                x[at] = static.solved(self._stiff + 1.0 / gain, right, x[at])
                total = static.at(x[at])[0] + beyond[at] + self._stiff * x[at]
                if total < 0:  # the road does not pull: the tyre springs back until its force is zero
                    x[at] = static.solved(self._stiff, -beyond[at], x[at])
                    total = 0.0
                force[at] = total - self.weight[at]
        self._relaxed = coming + slope * x
        self.motion = motion + self._slope @ force
        self.force, self.deflection, self._before = force, x, self.deflection


def _states(a: FloatArray, b: FloatArray, e: FloatArray) -> LinearSystem:
    """A system of which only the states matter."""
    none, inputs = np.zeros((0, len(a))), np.zeros((0, b.shape[1]))
    return LinearSystem(a, b, e, none, inputs, inputs)
