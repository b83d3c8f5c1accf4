"""A ride in time: vehicle and tyres as one linear system, stepped exactly over a road of straight lines."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fourpole.core.arrays import ByValue, FloatArray
from fourpole.core.recursion import LinearSystem, driven
from fourpole.core.specimen import Form, Specimen
from fourpole.errors import ModelError
from fourpole.models.interface import StateSpace
from fourpole.models.realised import MASSLESS, both_ends
from fourpole.ride.comfort import Comfort, check_step, comfort_of, weighting_system
from fourpole.ride.road import check_speed
from fourpole.ride.vehicle import Body


@dataclass(frozen=True, eq=False)
class TimeRide(ByValue):
    """What a vehicle does over time.

    Attributes
    ----------
    step : float [s]
    acceleration, weighted : (N,) float arrays [m/s²]
        Vertical acceleration at the seat, and the same weighted by Wk.
    load : (W, N) float array [N]
        Dynamic load of each wheel, positive above the static load.
    travel, deflection : (W, N) float arrays [m]
        Of each suspension and each tyre, positive in compression, from the rest under the vehicle's weight.
    jump : (W, N) float array [N]
        Half the jump of the load where the slope of the road changes, which a damper alone feels; the load there is
        the mean of both sides.
    carried : (N,) float array [J]
        Work done on the belts up to each time as the wheels carry them; 0 without belts.
    """

    step: float
    acceleration: FloatArray
    weighted: FloatArray
    load: FloatArray
    travel: FloatArray
    deflection: FloatArray
    jump: FloatArray
    carried: FloatArray

    @property
    def comfort(self) -> Comfort:
        """The values of the weighted acceleration."""
        return comfort_of(self.weighted, self.step)

    @property
    def energy(self) -> float:
        """Energy that the tyres took over the ride [J]; lost, if they end as they began."""
        after, before = self.load + self.jump, self.load - self.jump
        middle = 0.5 * (after[:, :-1] + before[:, 1:])
        return float(np.sum(middle * np.diff(self.deflection, axis=1))) + float(self.carried[-1] - self.carried[0])

    @property
    def values(self) -> FloatArray:
        """The measures of `response.names`: rms of acceleration, loads and travels, and mean power lost."""
        mean_square = [np.mean(one, axis=-1) for one in (self.load**2 + self.jump**2, self.travel**2)]
        acceleration = [np.mean(one**2) for one in (self.weighted, self.acceleration)]
        power = self.energy / (self.step * (self.acceleration.size - 1))
        return np.concatenate([np.sqrt([*acceleration, *mean_square[0], *mean_square[1]]), [power]])


def whole_system(body: Body, tyre: StateSpace, belt: Specimen = MASSLESS) -> LinearSystem:
    """Vehicle and tyres: from the road under each wheel to seat acceleration, loads, travels and deflections.

    With belts, which are a part of the unsprung mass of the body, the last outputs are the forces on the wheels.
    """
    body, ends = body.without(belt.mass), both_ends(tyre, belt)
    n, wheels, size = len(body.mass), body.wheels, len(ends.a)
    onto = np.zeros((n, wheels))
    onto[n - wheels :] = np.eye(wheels)
    inverse = np.linalg.inv(body.mass)
    each = np.eye(wheels)
    # The tyres: states of all wheels in turn; inputs are the height of the road, its rate, the wheel and its rate.
    a_t = np.kron(each, ends.a)
    b_h, b_r, b_x, b_v = (np.kron(each, ends.b[:, [at]]) for at in range(4))
    load, force = (
        np.hstack([d[2] * onto.T, d[3] * onto.T, np.kron(each, c)]) for c, d in zip(ends.c, ends.d, strict=True)
    )
    zero = np.zeros((n, wheels))
    motion = np.hstack([-inverse @ body.stiffness, -inverse @ body.damping, np.zeros((n, wheels * size))])
    motion += inverse @ onto @ force
    a = np.vstack([
        np.hstack([np.zeros((n, n)), np.eye(n), np.zeros((n, wheels * size))]),
        motion,
        np.hstack([b_x @ onto.T, b_v @ onto.T, a_t]),
    ])  # fmt: skip
    (d_h, d_r), (f_h, f_r) = ends.d[:, :2]
    by_height, by_rate = inverse @ onto * f_h, inverse @ onto * f_r
    still, forces = np.zeros((wheels, wheels)), belt.form is Form.BELT
    return LinearSystem(
        a=a,
        b=np.vstack([zero, by_height, b_h]),
        e=np.vstack([zero, by_rate, b_r]),
        c=np.vstack([
            body.seat @ motion,
            load,
            np.hstack([body.travel, np.zeros((wheels, n + wheels * size))]),
            np.hstack([-onto.T, np.zeros((wheels, n + wheels * size))]),
            *[force] * forces,
        ]),
        d=np.vstack([body.seat @ by_height, d_h * each, still, each, *[f_h * each] * forces]),
        f=np.vstack([body.seat @ by_rate, d_r * each, still, still, *[f_r * each] * forces]),
    )  # fmt: skip


def with_weighting(system: LinearSystem) -> LinearSystem:
    """A system whose first output is an acceleration, with the weighted acceleration as one more output, the last."""
    weight, n = weighting_system(), len(system.a)
    if np.any(system.f[0]):
        raise ModelError("the acceleration follows the slope of the road itself: its weighting has no state space")
    a = np.zeros((n + len(weight.a), n + len(weight.a)))
    a[:n, :n], a[n:, :n], a[n:, n:] = system.a, weight.b @ system.c[:1], weight.a
    last = np.concatenate([weight.d @ system.c[:1], weight.c], axis=1)
    return LinearSystem(
        a=a,
        b=np.vstack([system.b, weight.b @ system.d[:1]]),
        e=np.vstack([system.e, np.zeros((len(weight.a), system.e.shape[1]))]),
        c=np.vstack([np.hstack([system.c, np.zeros((len(system.c), len(weight.a)))]), last]),
        d=np.vstack([system.d, weight.d @ system.d[:1]]),
        f=np.vstack([system.f, np.zeros((1, system.f.shape[1]))]),
    )


def ride_in_time(body: Body, tyre: StateSpace, heights: FloatArray, step: float, belt: Specimen = MASSLESS) -> TimeRide:
    """The ride over sampled heights of the road under each wheel.

    Parameters
    ----------
    body : Body
    tyre : StateSpace
        A causal model at its operating point, for each wheel.
    heights : (W, N) float array [m]
        Road under each wheel, straight between its samples; the vehicle is at rest on the first ones. See `axles`.
    step : float [s]
        Time between samples, at most 2.5 ms for the weighting.
    belt : Specimen
        The belt of each tyre, a part of the unsprung mass of the body.

    Returns
    -------
    TimeRide
        Exact at each sample, whatever the step: the weighting is a part of the system.

    Raises
    ------
    ModelError
        If the step is too long, the heights do not fit the wheels, or a belt leaves no mass of a wheel.

    Examples
    --------
    >>> from fourpole.models import Zener
    >>> from fourpole.ride.road import cleat
    >>> from fourpole.ride.vehicle import QuarterCar
    >>> car = QuarterCar(250.0, 37.5, 15825.0, 1500.0).body
    >>> tyre = Zener().state_space([180e3, 120e3, 700.0])
    >>> road = cleat(0.01, 0.5).in_time(speed=5.0, step=1e-3, after=2.0)
    >>> ride = ride_in_time(car, tyre, road[None], 1e-3)
    >>> round(ride.comfort.rms, 3), round(float(ride.load.max()))
    (0.352, 2109)
    """
    check_step(step)
    heights = np.asarray(heights, dtype=float)
    if heights.ndim != 2 or len(heights) != body.wheels or heights.shape[1] < 2:
        raise ModelError(f"heights of shape {heights.shape} are not those of {body.wheels} wheels over time")
    if not np.all(np.isfinite(heights)):
        raise ModelError("the road has a height that is no number: a ride needs a road without gaps")
    system, w = whole_system(body, tyre, belt), body.wheels
    inputs = heights - heights[:, :1]
    found = driven(with_weighting(system), inputs, step)
    acceleration, load, travel, deflection, force, weighted = np.split(
        found, np.cumsum([1, w, w, w, len(found) - 3 * w - 2])
    )
    jump = np.zeros(inputs.shape)
    jump[:, 1:-1] = 0.5 * both_ends(tyre, belt).d[0, 1] / step * np.diff(inputs, n=2, axis=1)
    carried = work_on(load - (force if len(force) else load), inputs - deflection)
    return TimeRide(step, acceleration[0], weighted[0], load, travel, deflection, jump, carried)


def work_on(force: FloatArray, wheel: FloatArray) -> FloatArray:
    """Work (N,) [J] up to each time of forces (W, N) [N] on belts as the wheels move (W, N) [m]."""
    work = 0.5 * (force[:, 1:] + force[:, :-1]) * np.diff(wheel, axis=1)
    return np.append(0.0, np.cumsum(np.sum(work, axis=0)))


def axles(height: FloatArray, body: Body, speed: float, step: float) -> FloatArray:
    """Heights (W, N) [m] under each axle from those (N,) under the first: each comes later by its distance behind.

    Before the first sample the road is level.
    """
    check_speed(speed)
    time = step * np.arange(height.size)
    return np.stack([np.interp(time - lag, time, height) for lag in (body.behind / speed).tolist()])
