"""Vehicles: a quarter car and a half car, as the matrices of what is above the tyres."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import TypeAlias

import numpy as np

from fourpole.core.arrays import ByValue, FloatArray
from fourpole.errors import ModelError

#: Standard acceleration of gravity [m/s²].
GRAVITY = 9.80665


@dataclass(frozen=True, eq=False)
class Body(ByValue):
    r"""A vehicle without its tyres: :math:`M \ddot q + C \dot q + K q` is the forces of the tyres on the wheels.

    Heights are positive upwards, from the rest under the vehicle's weight. The last coordinates are the wheels.

    Attributes
    ----------
    mass, damping, stiffness : (n, n) float arrays
        M, C and K for coordinates in [m] and [rad].
    seat : (n,) float array
        Height of the place where the comfort is judged, as a sum of coordinates.
    travel : (W, n) float array
        Travel of each suspension, positive in compression.
    behind : (W,) float array [m]
        Distance of each axle behind the first.
    loads : (W,) float array [N]
        Static load of each tyre.
    """

    mass: FloatArray
    damping: FloatArray
    stiffness: FloatArray
    seat: FloatArray
    travel: FloatArray
    behind: FloatArray
    loads: FloatArray

    @property
    def wheels(self) -> int:
        """Number W of wheels."""
        return len(self.loads)

    def without(self, mass: float) -> Body:
        """The vehicle without a mass at each wheel [kg] that its tyre has as a belt; the static loads stay.

        Raises
        ------
        ModelError
            If nothing is left of the mass of a wheel.

        Examples
        --------
        >>> QuarterCar(250.0, 37.5, 15825.0, 1500.0).body.without(7.0).mass.diagonal().tolist()
        [250.0, 30.5]
        """
        if not mass:
            return self
        left = np.array(self.mass, dtype=float)
        at = np.arange(len(left) - self.wheels, len(left))
        left[at, at] -= mass
        if least := [one for one in left[at, at].tolist() if one <= 0]:
            raise ModelError(
                f"the belt of {mass:.4g} kg is a part of the unsprung mass of {least[0] + mass:.4g} kg, and leaves no "
                "wheel: state the mass of wheel, tyre and axle together, or another belt"
            )
        return replace(self, mass=left)


@dataclass(frozen=True)
class QuarterCar:
    """One wheel with its suspension and its share of the body.

    Attributes
    ----------
    sprung_mass, unsprung_mass : float [kg]
        Body above the suspension, and wheel with tyre and its share of the axle; > 0.
    suspension_stiffness : float [N/m]
        At the wheel, > 0.
    suspension_damping : float [N s/m]
        At the wheel, >= 0.

    Raises
    ------
    ModelError
        If a value is not possible.

    Examples
    --------
    >>> QuarterCar(250.0, 37.5, 15825.0, 1500.0).body.loads.round(1)
    array([2819.4])
    """

    sprung_mass: float
    unsprung_mass: float
    suspension_stiffness: float
    suspension_damping: float

    def __post_init__(self) -> None:
        """Refuse impossible values."""
        _check(self)

    @property
    def body(self) -> Body:
        """The matrices; coordinates are body and wheel."""
        k, c = self.suspension_stiffness, self.suspension_damping
        apart = np.array([[1.0, -1.0], [-1.0, 1.0]])
        return Body(
            mass=np.diag([self.sprung_mass, self.unsprung_mass]),
            damping=c * apart,
            stiffness=k * apart,
            seat=np.array([1.0, 0.0]),
            travel=np.array([[-1.0, 1.0]]),
            behind=np.zeros(1),
            loads=np.array([(self.sprung_mass + self.unsprung_mass) * GRAVITY]),
        )


@dataclass(frozen=True)
class HalfCar:
    """One side of a vehicle: half its body, which heaves and pitches, on a front and a rear wheel.

    Attributes
    ----------
    sprung_mass : float [kg]
        Half the mass of the body, > 0.
    pitch_inertia : float [kg m²]
        Half the body's moment of inertia about its centre of mass, > 0.
    front_distance, rear_distance : float [m]
        Distance of each axle from the centre of mass, > 0.
    front_unsprung_mass, rear_unsprung_mass : float [kg]
        Wheel with tyre and its share of the axle, > 0.
    front_suspension_stiffness, rear_suspension_stiffness : float [N/m]
        At the wheel, > 0.
    front_suspension_damping, rear_suspension_damping : float [N s/m]
        At the wheel, >= 0.
    seat_ahead : float [m]
        Distance of the place where the comfort is judged ahead of the centre of mass; negative behind it.

    Raises
    ------
    ModelError
        If a value is not possible.
    """

    sprung_mass: float
    pitch_inertia: float
    front_distance: float
    rear_distance: float
    front_unsprung_mass: float
    rear_unsprung_mass: float
    front_suspension_stiffness: float
    rear_suspension_stiffness: float
    front_suspension_damping: float
    rear_suspension_damping: float
    seat_ahead: float = 0.0

    def __post_init__(self) -> None:
        """Refuse impossible values."""
        _check(self)

    @property
    def body(self) -> Body:
        """The matrices; coordinates are heave, pitch (nose up), front wheel and rear wheel."""
        a, b = self.front_distance, self.rear_distance
        travel = np.array([[-1.0, -a, 1.0, 0.0], [-1.0, b, 0.0, 1.0]])
        springs = np.array([self.front_suspension_stiffness, self.rear_suspension_stiffness])
        dampers = np.array([self.front_suspension_damping, self.rear_suspension_damping])
        unsprung = np.array([self.front_unsprung_mass, self.rear_unsprung_mass])
        carried = self.sprung_mass * np.array([b, a]) / (a + b)
        return Body(
            mass=np.diag([self.sprung_mass, self.pitch_inertia, *unsprung]),
            damping=travel.T @ (dampers[:, None] * travel),
            stiffness=travel.T @ (springs[:, None] * travel),
            seat=np.array([1.0, self.seat_ahead, 0.0, 0.0]),
            travel=travel,
            behind=np.array([0.0, a + b]),
            loads=(carried + unsprung) * GRAVITY,
        )


Vehicle: TypeAlias = QuarterCar | HalfCar
#: Values that may be zero, and one that may have either sign.
_NOT_NEGATIVE, _ANY = "damping", "seat_ahead"
#: Unit of a value by the last word of its name.
UNITS = {"mass": "kg", "inertia": "kg m²", "distance": "m", "stiffness": "N/m", "damping": "N s/m", "ahead": "m"}


def _check(vehicle: Vehicle) -> None:
    """ModelError that names the first value of a vehicle that is not possible."""
    for field in fields(vehicle):
        value = getattr(vehicle, field.name)
        last = field.name.rpartition("_")[2]
        may_be_zero = last == _NOT_NEGATIVE
        if not np.isfinite(value) or (field.name != _ANY and (value < 0 or (value == 0 and not may_be_zero))):
            wanted = "zero or positive" if may_be_zero else "finite" if field.name == _ANY else "positive"
            raise ModelError(f"{field.name}: {value:g} {UNITS[last]} is not possible: state a value that is {wanted}")
