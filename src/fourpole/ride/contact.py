"""A ride in time with what is not linear in a tyre: the load-deflection curve of the static test, and lift-off.

The road pushes and never pulls. At the end of each step either the tyre touches the road and its force is positive, or
its force is zero and it springs back freely. One equation per wheel decides, so that no lift-off is missed.
"""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass

import numpy as np

from fourpole.core.arrays import ByValue, FloatArray
from fourpole.core.recursion import step_matrices
from fourpole.core.specimen import Form, Specimen
from fourpole.errors import ModelError
from fourpole.models.interface import StateSpace
from fourpole.models.realised import MASSLESS
from fourpole.ride.comfort import check_step, weighted
from fourpole.ride.time import TimeRide, work_on
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
    body: Body,
    tyre: StateSpace,
    heights: FloatArray,
    step: float,
    curve: LoadDeflection | None = None,
    belt: Specimen = MASSLESS,
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
        A quarter of a millisecond leaves errors below 0.1 % of a_w on a road without edges, and half of that on
        cleats and potholes; 2 % there for a constant damper alone, whose load jumps as the wheel touches the road.
    curve : LoadDeflection, optional
    belt : Specimen
        The belt of each tyre, a part of the unsprung mass of the body; it touches the road by its own spring.

    Raises
    ------
    ModelError
        If the step is too long, the static load of a wheel is not on the curve, or there are both a belt and a curve.
    """
    if curve is not None and belt.form is Form.BELT:
        raise ModelError(
            "a load-deflection curve is of the whole tyre, and does not say how its springs at contact and rim "
            'share it: leave out the curve, or state that the belt has no mass, --belt-mass "0 kg"'
        )
    check_step(step)
    heights = np.asarray(heights, dtype=float)
    if heights.ndim != 2 or len(heights) != body.wheels or not np.all(np.isfinite(heights)):
        raise ModelError(f"heights of shape {heights.shape} are no road under {body.wheels} wheels without gaps")
    body, moving = body.without(belt.mass), _Moving.of(body.without(belt.mass), tyre, belt)
    n, wheels, count = len(body.mass), body.wheels, heights.shape[1]
    stepper = _Stepper.of(body, moving, step, curve)
    history = np.zeros((count, stepper.size))
    roads = (heights - heights[:, :1]).T.tolist()
    for at in range(1, count):
        history[at] = stepper.after(history[at - 1], roads[at])
    parts = np.split(history, np.cumsum([len(moving.a), wheels, wheels]), axis=1)[:3]
    motion, loads, deflections = (part.T for part in parts)
    forces, rim = np.zeros((n, count)), loads if moving.rim is None else moving.rim @ motion
    forces[n - wheels :] = rim
    q, speed = motion[:n], motion[n : 2 * n]
    acceleration = body.seat @ np.linalg.solve(body.mass, forces - body.stiffness @ q - body.damping @ speed)
    whole, carried = deflections, work_on(loads - rim, q[n - wheels :])
    if moving.rim is not None:
        whole = heights - heights[:, :1] - q[n - wheels :]
    found = TimeRide(
        *(step, acceleration, weighted(acceleration, step), loads, body.travel @ q),
        *(whole, np.zeros(loads.shape), carried),
    )
    ends = np.array([one.x[-1] if curve is not None else np.inf for one in stepper.static])[:, None]
    air = loads <= -body.loads[:, None] * (1 - 1e-12)
    return ContactRide(found, np.mean(air, axis=1), np.mean(deflections > ends, axis=1))


@dataclass(frozen=True, eq=False)
class _Moving:
    """What moves above the springs that touch the road: the vehicle, and belts with their springs at the rim.

    Attributes
    ----------
    a, b : (M, M), (M, W) float arrays
        Change of the motion by itself, and by the load at each contact. The motion begins with that of the vehicle.
    touching : slice
        Places of the heights in the motion that are above the contacts.
    tyre : StateSpace
        The spring between road and what touches it.
    rim : (W, M) float array, or None
        Forces of the springs at the rim on the wheels; None without belts.
    """

    a: FloatArray
    b: FloatArray
    touching: slice
    tyre: StateSpace
    rim: FloatArray | None = None

    @classmethod
    def of(cls, body: Body, tyre: StateSpace, belt: Specimen) -> _Moving:
        """A vehicle without the belts of its tyres, and these."""
        n, wheels, own = len(body.mass), body.wheels, len(tyre.a)
        inverse, onto = np.linalg.inv(body.mass), np.eye(n)[:, n - wheels :]
        a = np.block([[np.zeros((n, n)), np.eye(n)], [-inverse @ body.stiffness, -inverse @ body.damping]])
        if belt.form is not Form.BELT:
            return cls(a, np.vstack([np.zeros((n, wheels)), inverse @ onto]), slice(n - wheels, n), tyre)
        # The motion: that of the vehicle, heights of the belts, their rates, states of the springs at the rim.
        size, each, share = 2 * n + wheels * (2 + own), np.eye(wheels), abs(belt.share)
        unit = np.eye(size)
        height, speed, arms = np.split(unit[2 * n :], np.cumsum([wheels, wheels]))
        x, v = height - unit[n - wheels : n], speed - unit[2 * n - wheels : 2 * n]
        rim = tyre.d[0] * x + tyre.d[1] * v + np.kron(each, tyre.c[None]) @ arms
        rim *= (1 + share) / share
        whole = np.zeros((size, size))
        whole[: 2 * n, : 2 * n] = a
        whole[n : 2 * n] += inverse @ onto @ rim
        whole[2 * n : 2 * n + wheels], whole[2 * n + wheels : 2 * (n + wheels)] = speed, -rim / belt.mass
        whole[2 * (n + wheels) :] = np.kron(each, tyre.a) @ arms
        whole[2 * (n + wheels) :] += np.kron(each, tyre.b[:, :1]) @ x + np.kron(each, tyre.b[:, 1:]) @ v
        contact = StateSpace(tyre.a, tyre.b, (1 + share) * tyre.c, (1 + share) * tyre.d)
        return cls(whole, speed.T / belt.mass, slice(2 * n, 2 * n + wheels), contact, rim)


@dataclass(frozen=True, eq=False)
class _Stepper:
    """The step of a vehicle and its tyres from one sample of the road to the next.

    A state has the motion of the vehicle, the load of each wheel, the deflection of each tyre now and one step before,
    and the states of each tyre. The new state is `whole` times the old one, plus `by_load` and `by_deflection` times
    the new loads and deflections. The last rows of `whole` are the height of each wheel without the new load, and the
    force that each model has beyond its static stiffness without the new deflection, `stiff` of which is to be added.
    """

    static: list[_Static]
    weight: list[float]
    whole: FloatArray
    by_load: FloatArray
    by_deflection: FloatArray
    gain: list[list[float]]
    stiff: float
    loads: slice
    deflections: slice

    @property
    def size(self) -> int:
        """Length of a state."""
        return len(self.by_load)

    @classmethod
    def of(cls, body: Body, moving: _Moving, step: float, curve: LoadDeflection | None) -> _Stepper:
        """The step of a length [s]."""
        tyre, touching = moving.tyre, moving.touching
        n, wheels, own = len(moving.a), body.wheels, len(tyre.a)
        rest = float(tyre.stiffness(0.0).real)
        turn, hold, slope = step_matrices(moving.a, moving.b, np.zeros((n, wheels)), step)
        relax, kept, moved = step_matrices(tyre.a, tyre.b[:, :1], tyre.b[:, 1:], step)
        rate = float(tyre.d[1]) / step  # of a backward difference of second order
        motion, load, now, before, arms = np.split(np.arange(n + wheels * (3 + own)), np.cumsum([n, *[wheels] * 3]))
        size, each = n + wheels * (3 + own), np.eye(wheels)
        whole = np.zeros((size + 2 * wheels, size))
        whole[np.ix_(motion, motion)], whole[np.ix_(motion, load)] = turn, hold - slope
        whole[np.ix_(before, now)] = each
        whole[np.ix_(arms, arms)], whole[np.ix_(arms, now)] = np.kron(each, relax), np.kron(each, kept - moved)
        whole[size : size + wheels] = whole[motion[touching]]
        whole[size + wheels :] = np.kron(each, tyre.c[None]) @ whole[arms]
        whole[size + wheels :, now] -= 2.0 * rate * each
        whole[size + wheels :, before] += 0.5 * rate * each
        by_load, by_deflection = np.zeros((size, wheels)), np.zeros((size, wheels))
        by_load[motion], by_load[load], by_deflection[now] = slope, each, each
        by_deflection[arms] = np.kron(each, moved)
        return cls(
            static=[_Static.of(curve, rest, weight) for weight in body.loads.tolist()],
            weight=body.loads.tolist(),
            whole=whole,
            by_load=by_load,
            by_deflection=by_deflection,
            gain=slope[touching].tolist(),
            stiff=float(tyre.c @ moved[:, 0]) + float(tyre.d[0]) - rest + 1.5 * rate,
            loads=slice(n, n + wheels),
            deflections=slice(n + wheels, n + 2 * wheels),
        )

    def after(self, state: FloatArray, road: list[float]) -> FloatArray:
        """The state after one step, on these heights of the road."""
        known = self.whole @ state
        wheels = len(road)
        height, beyond = known[-2 * wheels : -wheels].tolist(), known[-wheels:].tolist()
        load, x = state[self.loads].tolist(), state[self.deflections].tolist()
        for _ in range(1 if wheels == 1 else _ROUNDS):
            for at, static in enumerate(self.static):
                gains = self.gain[at]
                others = sum(gains[k] * load[k] for k in range(wheels) if k != at)
                right = (road[at] - height[at] - others) / gains[at] + self.weight[at] - beyond[at]
                x[at] = static.solved(self.stiff + 1.0 / gains[at], right, x[at])
                total = static.at(x[at])[0] + beyond[at] + self.stiff * x[at]
                if total < 0:  # the road does not pull: the tyre springs back until its force is zero
                    x[at] = static.solved(self.stiff, -beyond[at], x[at])
                    total = 0.0
                load[at] = total - self.weight[at]
        return np.asarray(known[: self.size] + self.by_load @ load + self.by_deflection @ x)
