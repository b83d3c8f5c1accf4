"""A ride in the frequency domain: exact for a linear vehicle on a road of a known spectrum.

The vehicle is condensed to its wheels once. Then the tyres, of any K*, are small algebra at each frequency, and so are
the derivatives of all results by K*.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fourpole.core.arrays import ByValue, ComplexArray, FloatArray
from fourpole.core.specimen import Form, Specimen
from fourpole.errors import ModelError
from fourpole.models.realised import MASSLESS, gain, weight
from fourpole.ride.comfort import weighting
from fourpole.ride.road import ClassRoad, check_speed
from fourpole.ride.vehicle import Body

#: Number of frequencies of a ride, even in their logarithm.
POINTS = 2049


@dataclass(frozen=True, eq=False)
class Condensed(ByValue):
    """A vehicle at some frequencies, as its wheels feel it.

    Attributes
    ----------
    omega : (N,) float array [rad/s]
    wheel : (N, W, W) complex array [N/m]
        Forces on the wheels per motion of the wheels.
    acceleration : (N, W) complex array [1/s²]
        Acceleration at the seat per motion of each wheel.
    travel : (N, W, W) complex array [1]
        Travel of each suspension per motion of each wheel.
    """

    omega: FloatArray
    wheel: ComplexArray
    acceleration: ComplexArray
    travel: ComplexArray

    @classmethod
    def of(cls, body: Body, omega: FloatArray) -> Condensed:
        """The vehicle at angular frequencies (N,) [rad/s], > 0.

        Examples
        --------
        >>> from fourpole.ride.vehicle import QuarterCar
        >>> found = Condensed.of(QuarterCar(250.0, 40.0, 16e3, 0.0).body, np.array([0.08, 1e4]))
        >>> found.acceleration[:, 0].real.round(4)  # body resonance: 8 rad/s
        array([-6.4e-03,  6.4e+01])
        """
        n = len(body.mass) - body.wheels
        w = omega[:, None, None]
        whole = np.asarray(body.stiffness + 1j * w * body.damping - w**2 * body.mass, dtype=complex)
        above, across = whole[:, :n, :n], whole[:, :n, n:]
        follows = -np.linalg.solve(above, across)
        motion = np.concatenate([follows, np.broadcast_to(np.eye(body.wheels), (omega.size, *(body.wheels,) * 2))], 1)
        return cls(
            omega=omega,
            wheel=np.asarray(whole[:, n:, n:] + whole[:, n:, :n] @ follows, dtype=complex),
            acceleration=-(omega[:, None] ** 2) * (body.seat @ motion),
            travel=body.travel @ motion,
        )


@dataclass(frozen=True, eq=False)
class Transfers(ByValue):
    """Responses per height of the road under the first axle, or their derivatives by K* [m/N].

    Attributes
    ----------
    acceleration : (..., N) complex array [1/s²]
    load : (..., N, W) complex array [N/m]
    travel : (..., N, W) complex array [1]
    deflection : (..., N, W) or, with a belt, (..., N, 2W) complex array [1]
        Of the springs of each tyre, by which K* loses power; those that a belt adds are the last.
    """

    acceleration: ComplexArray
    load: ComplexArray
    travel: ComplexArray
    deflection: ComplexArray

    @classmethod
    def of(cls, vehicle: Condensed, wheels: ComplexArray, load: ComplexArray, deflection: ComplexArray) -> Transfers:
        """The responses with this motion of the wheels (..., N, W)."""
        acceleration = np.sum(vehicle.acceleration * wheels, axis=-1)
        return cls(acceleration, load, _times(vehicle.travel, wheels), deflection)


def transfers(
    vehicle: Condensed, stiffness: ComplexArray, lags: FloatArray, belt: Specimen = MASSLESS
) -> tuple[Transfers, Transfers]:
    r"""Responses of a vehicle on tyres of K* to a road that each axle meets later, and their derivatives by K*.

    With the road r and the wheels' forces D per motion, the wheels move by :math:`z = (D + K^*)^{-1} K^* r` and the
    tyres are compressed by :math:`x = r - z = (D + K^*)^{-1} D r`; so :math:`dz/dK^* = (D + K^*)^{-1} x`.

    Parameters
    ----------
    vehicle : Condensed
    stiffness : (..., N) complex array [N/m]
        K* of each tyre at the frequencies of the vehicle.
    lags : (W,) float array [s]
        Time after which each axle meets what the first one met.
    belt : Specimen
        The belt of each tyre, which is no part of the mass of the vehicle's wheels.
    """
    w = vehicle.omega
    road = np.exp(-1j * w[:, None] * lags)
    k = np.asarray(stiffness, dtype=complex)[..., None]
    if belt.form is Form.BELT:
        return _with_belt(vehicle, k, road, belt)
    inverse = _inverse(vehicle.wheel + k[..., None] * np.eye(lags.size))
    x = _times(inverse, _times(vehicle.wheel, road))
    by = _times(inverse, x)
    return Transfers.of(vehicle, road - x, k * x, x), Transfers.of(vehicle, by, x - k * by, -by)


def _with_belt(vehicle: Condensed, k: ComplexArray, road: ComplexArray, belt: Specimen) -> tuple[Transfers, Transfers]:
    """The same with a belt, by the two-port of `models.realised`: both ends feel the force Q = q y on the belt.

    With y = u r + (1 - u) z it is Q = -w² m y/(1 - a). Springs lose power by the deflection r - z, and by that of the
    belt from y, times the root of its gain.
    """
    u, minus = weight(belt), -(vehicle.omega[:, None] ** 2)
    h = 1.0 / (1.0 + minus * belt.mass / (gain(belt) * k))
    q, h_by = minus * belt.mass * h, h * (1.0 - h) / k
    q_by = minus * belt.mass * h_by
    near, far = k + (1 - u) ** 2 * q, k - u * (1 - u) * q
    near_by, far_by = 1.0 + (1 - u) ** 2 * q_by, 1.0 - u * (1 - u) * q_by
    inverse = _inverse(vehicle.wheel + near[..., None] * np.eye(road.shape[-1]))
    z = _times(inverse, far * road)
    z_by = _times(inverse, far_by * road - near_by * z)
    y, y_by, root = u * road + (1 - u) * z, (1 - u) * z_by, np.sqrt(gain(belt))
    load, load_by = k * (road - z) + u * q * y, road - z - k * z_by + u * (q_by * y + q * y_by)
    moved = np.concatenate([road - z, root * (h - 1) * y], axis=-1)
    moved_by = np.concatenate([-z_by, root * (h_by * y + (h - 1) * y_by)], axis=-1)
    return Transfers.of(vehicle, z, load, moved), Transfers.of(vehicle, z_by, load_by, moved_by)


def _times(matrix: ComplexArray, vector: ComplexArray) -> ComplexArray:
    return np.asarray((matrix @ vector[..., None])[..., 0])


def _inverse(matrix: ComplexArray) -> ComplexArray:
    """Inverse of matrices (..., W, W); of one and two wheels without a call for each frequency."""
    if matrix.shape[-1] == 1:
        return np.asarray(1.0 / matrix)
    if matrix.shape[-1] > 2:
        return np.asarray(np.linalg.inv(matrix))
    (a, b), (c, d) = np.moveaxis(matrix, (-2, -1), (0, 1))
    whole = np.stack([np.stack([d, -b], axis=-1), np.stack([-c, a], axis=-1)], axis=-2)
    return np.asarray(whole / (a * d - b * c)[..., None, None])


@dataclass(frozen=True, eq=False)
class Ride(ByValue):
    """The ride of a vehicle on a road of a known spectrum, for one set of tyres or for many.

    Attributes
    ----------
    frequency : (N,) float array [Hz]
    values : (..., M) float array
        The measures of `names`: root mean squares of the weighted acceleration and of the acceleration [m/s²], of the
        dynamic load of each wheel [N] and of the travel of each suspension [m], and the power lost in all tyres [W].
    by_stiffness : (..., M, N) complex array
        Change of each measure by K*: the real part of the sum of this times the change of K* over the frequencies.
    spectrum, spectrum_by : (..., N) arrays
        One-sided spectrum of the acceleration [m²/s³], and its change by K* at the same frequency, likewise.
    unresolved : (...,) float array [1]
        Largest relative change of a mean square or of the power if every second frequency is left out. Below 1 % the
        error of the measures is below 1e-4, because a sum over a smooth peak converges with the square.
    """

    frequency: FloatArray
    values: FloatArray
    by_stiffness: ComplexArray
    spectrum: FloatArray
    spectrum_by: ComplexArray
    unresolved: FloatArray

    @property
    def weighted_spectrum(self) -> FloatArray:
        """One-sided spectrum of the weighted acceleration (..., N) [m²/s³]."""
        return self.spectrum * np.abs(weighting(self.frequency)) ** 2

    def share_outside(self, low: float, high: float) -> FloatArray:
        """Share (...,) [1] of the mean square of the weighted acceleration below and above two frequencies [Hz]."""
        parts = self.weighted_spectrum * _widths(self.frequency)
        outside = (self.frequency < low) | (self.frequency > high)
        return np.asarray(np.sum(parts * outside, axis=-1) / np.sum(parts, axis=-1))


def names(wheels: int) -> tuple[str, ...]:
    """Names of the measures of a ride: load and travel of each wheel between acceleration and power."""
    places = ("",) if wheels == 1 else (" front", " rear")
    loads, travels = ([f"{what}{one}" for one in places] for what in ("wheel load", "travel"))
    return ("comfort", "acceleration", *loads, *travels, "power")


def frequencies_of(road: ClassRoad, speed: float, count: int = POINTS) -> FloatArray:
    """Frequencies (N,) [Hz] of a ride: those of the road at a speed [m/s], even in their logarithm."""
    check_speed(speed)
    return np.geomspace(*road.band(speed), count)


def _widths(frequency: FloatArray) -> FloatArray:
    """Weights (N,) [Hz] of an integral over frequencies that are even in their logarithm, by the trapezoidal rule."""
    widths = frequency * np.log(frequency[-1] / frequency[0]) / (frequency.size - 1)
    widths[[0, -1]] *= 0.5
    return widths


def ride(
    body: Body,
    stiffness: ComplexArray,
    road: ClassRoad,
    speed: float,
    *,
    vehicle: Condensed | None = None,
    belt: Specimen = MASSLESS,
) -> Ride:
    """The ride of a vehicle on a road of a known spectrum.

    Parameters
    ----------
    body : Body
    stiffness : (..., N) complex array [N/m]
        K* of each tyre at `frequencies_of(road, speed)`, or at as many frequencies between the same ends.
    road : ClassRoad
    speed : float [m/s]
    vehicle : Condensed, optional
        The vehicle at these frequencies without belts, if it is known already, for many rides.
    belt : Specimen
        The belt of each tyre, a part of the unsprung mass of the vehicle.

    Returns
    -------
    Ride
        Exact but for the sum over frequencies; `unresolved` says whether they are close enough.

    Raises
    ------
    ModelError
        If the speed is not positive, K* is no number or zero, or a belt leaves no mass of a wheel.

    Examples
    --------
    >>> from fourpole.models import Zener
    >>> from fourpole.ride.vehicle import QuarterCar
    >>> road = ClassRoad.of("C")
    >>> omega = 2 * np.pi * frequencies_of(road, speed=80 / 3.6)
    >>> car = QuarterCar(250.0, 37.5, 15825.0, 1500.0).body
    >>> found = ride(car, Zener().stiffness([180e3, 120e3, 700.0], omega), road, 80 / 3.6)
    >>> dict(zip(names(1), found.values.round(4).tolist()))
    {'comfort': 1.3396, 'acceleration': 1.5846, 'wheel load': 778.1374, 'travel': 0.0101, 'power': 62.6548}
    """
    stiffness = np.asarray(stiffness, dtype=complex)
    frequency = frequencies_of(road, speed, stiffness.shape[-1])
    if not np.all(np.isfinite(stiffness)):
        raise ModelError("K* is no number at some frequency of the ride")
    if not np.all(np.any(stiffness, axis=-1)):
        raise ModelError("K* is zero at all frequencies: such a tyre carries no vehicle")
    omega = 2 * np.pi * frequency
    vehicle = Condensed.of(body.without(belt.mass), omega) if vehicle is None else vehicle
    found, slope = transfers(vehicle, stiffness, body.behind / speed, belt)
    height = road.spectrum_in_time(frequency, speed)
    weight = height * _widths(frequency)
    comfort = weight * np.abs(weighting(frequency)) ** 2
    load, load_by, travel, travel_by = (
        np.moveaxis(one, -1, -2) for one in (found.load, slope.load, found.travel, slope.travel)
    )
    size, change = np.abs(found.acceleration) ** 2, _change(found.acceleration, slope.acceleration)
    parts = np.concatenate([
        (size * comfort)[..., None, :], (size * weight)[..., None, :],
        np.abs(load) ** 2 * weight, np.abs(travel) ** 2 * weight,
    ], axis=-2)  # fmt: skip
    by = np.concatenate([
        (comfort * change)[..., None, :], (weight * change)[..., None, :],
        weight * _change(load, load_by), weight * _change(travel, travel_by),
    ], axis=-2)  # fmt: skip
    roots = np.sqrt(np.sum(parts, axis=-1))
    power, power_by = _power(found.deflection, slope.deflection, stiffness, omega * weight)
    return Ride(
        frequency=frequency,
        values=np.concatenate([roots, np.sum(power, axis=-1, keepdims=True)], axis=-1),
        by_stiffness=np.concatenate([by / (2.0 * roots[..., None]), power_by[..., None, :]], axis=-2),
        spectrum=size * height,
        spectrum_by=change * height,
        unresolved=np.max(_thinning(np.concatenate([parts, power[..., None, :]], axis=-2)), axis=-1),
    )


def _thinning(parts: FloatArray) -> FloatArray:
    """Relative change (...,) of a sum by the trapezoidal rule of parts (..., N) if every second one is left out."""
    last = parts.shape[-1] - (parts.shape[-1] + 1) % 2
    used = parts[..., :last]
    whole, thin = np.sum(used, axis=-1), 2.0 * np.sum(used[..., ::2], axis=-1)
    # both ends have half a weight already: that of the thinned rule
    return np.abs(np.divide(thin, whole, out=np.ones_like(whole), where=whole != 0) - 1.0)


def _change(response: ComplexArray, by: ComplexArray) -> ComplexArray:
    """Derivative of a squared modulus: its change is the real part of this times the change of K*."""
    return 2.0 * np.conj(response) * by


def _power(
    deflection: ComplexArray, deflection_by: ComplexArray, stiffness: ComplexArray, weight: FloatArray
) -> tuple[FloatArray, ComplexArray]:
    """Parts (..., N) [W] of the mean power lost in all tyres, and the derivative (..., N) by K* of their sum."""
    size = np.sum(np.abs(deflection) ** 2, axis=-1)
    change = np.sum(_change(deflection, deflection_by), axis=-1)
    power = stiffness.imag * size * weight
    return np.asarray(power), np.asarray(weight * (stiffness.imag * change - 1j * size))
