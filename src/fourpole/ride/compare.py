"""Rides of several tyres under one vehicle: measures, differences from the first, and their uncertainties.

Errors of the model of a tyre are carried to each measure, and cancel in differences if tyres share them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from fourpole.core.arrays import ByValue, ComplexArray, FloatArray
from fourpole.core.specimen import Specimen
from fourpole.errors import ModelError
from fourpole.models.interface import Model, StateSpace
from fourpole.models.realised import MASSLESS, realised
from fourpole.models.springs import KelvinVoigt
from fourpole.ride.contact import ContactRide, LoadDeflection, ride_with_contact
from fourpole.ride.response import POINTS, Condensed, Ride, frequencies_of, names, ride
from fourpole.ride.road import ClassRoad
from fourpole.ride.time import TimeRide, ride_in_time
from fourpole.ride.vehicle import Body

#: Relative change of a parameter for a difference.
_CHANGE = 1e-3
#: Factors of the usual number of frequencies, tried until the rides are resolved, and the largest `Ride.unresolved`.
_FINER, _RESOLVED = (1, 8, 32), 1e-2
#: Frequencies of a ride in time [Hz], in which a model without a state space is approximated.
REALISED = (0.1, 200.0)
#: Measures that a ride in time has besides those of a spectrum.
IN_TIME = ("crest", "vdv", "mtvv")


@dataclass(frozen=True, eq=False)
class Tyre(ByValue):
    """A model at its operating point, with the errors of its parameters.

    Attributes
    ----------
    model : Model
        A causal model.
    values : (P,) float array
        Its parameters.
    errors : mapping of str to (P, E) float array
        Changes of the parameters by one standard uncertainty of each of E independent errors, by their source. Tyres
        with the same source have the same errors.
    discrepancy : (float, float) [1]
        Relative standard uncertainties of K* that the parameters do not have, in modulus and in phase: errors that are
        the same at all frequencies.
    name : str
        The tyre and its operating point in words.
    origin : str
        What the tyre is from, such as its file: tyres of the same name and origin have the same discrepancy.
    belt : Specimen
        The belt of the tyre, a part of the unsprung mass of the vehicle; massless for none.

    Raises
    ------
    ModelError
        If the model is not causal.
    """

    model: Model
    values: FloatArray
    errors: Mapping[str, FloatArray] = field(default_factory=dict)
    discrepancy: tuple[float, float] = (0.0, 0.0)
    name: str = "the tyre"
    origin: str = ""
    belt: Specimen = MASSLESS

    def __post_init__(self) -> None:
        """Refuse a model that is not causal."""
        if not self.model.causal:
            raise ModelError(
                f"the {self.model.name} model of {self.name} is not causal: its force begins before its deflection, "
                "and no vehicle drives on it; fit a causal one, as with fourpole fit --model prony or map --model zener"
            )
        self.model.checked(self.values)

    @property
    def source_of_discrepancy(self) -> str:
        """The source of the errors that the parameters do not have."""
        return f"{self.origin}: discrepancy of {self.name}"

    def stiffness(self, omega: FloatArray) -> ComplexArray:
        """K* (N,) [N/m] at angular frequencies (N,) [rad/s]."""
        return self.model.stiffness(self.values, omega)

    def changes(self, omega: FloatArray) -> dict[str, ComplexArray]:
        """Changes (E, N) of K* by one standard uncertainty of each error, by their source."""
        by = self.model.derivative(self.values, omega)
        found: dict[str, ComplexArray] = {
            source: (by @ effect).T for source, effect in self.errors.items() if effect.size
        }
        if any(self.discrepancy):
            k, (along, across) = self.stiffness(omega), self.discrepancy
            found[self.source_of_discrepancy] = np.stack([along * k, 1j * across * k])
        return found


def constant_damper(tyre: Tyre, frequency: float) -> Tyre:
    """A spring and a constant damper, without errors, that have the K* of a tyre at one frequency [Hz].

    Examples
    --------
    >>> from fourpole.models import Zener
    >>> found = constant_damper(Tyre(Zener(), np.array([180e3, 120e3, 700.0])), 10.0)
    >>> found.values.round(1)
    array([194211.3,    617.1])
    """
    omega = 2 * np.pi * frequency
    (k,) = tyre.stiffness(np.array([omega])).tolist()
    return Tyre(
        KelvinVoigt(),
        np.array([k.real, max(k.imag, 0.0) / omega]),
        name=f"{tyre.name}, constant damper",
        belt=tyre.belt,
    )


#: Changes (E, M) of M measures by one standard uncertainty of each error, by their source.
Effects = Mapping[str, FloatArray]


def effects(found: Ride, tyre: Tyre) -> dict[str, FloatArray]:
    """Changes (E, M) of the measures of a ride by one standard uncertainty of each error of its tyre, by source."""
    omega = 2 * np.pi * found.frequency
    return {source: np.real(one @ found.by_stiffness.T) for source, one in tyre.changes(omega).items()}


def standard(of: Effects, count: int) -> FloatArray:
    """Standard uncertainties (M,) of `count` measures.

    Examples
    --------
    >>> standard({"a": np.array([[3.0, 0.0]]), "b": np.array([[4.0, 1.0]])}, 2).tolist()
    [5.0, 1.0]
    """
    return np.sqrt(sum((np.sum(one**2, axis=0) for one in of.values()), np.zeros(count)))


def spectrum_std(found: Ride, tyre: Tyre) -> FloatArray:
    """Standard uncertainty (N,) [m²/s³] of the spectrum of the acceleration."""
    rows = tyre.changes(2 * np.pi * found.frequency).values()
    squares = (np.sum(np.real(one * found.spectrum_by) ** 2, axis=0) for one in rows)
    return np.sqrt(sum(squares, np.zeros(found.frequency.size)))


def relative_difference(
    first: tuple[FloatArray, Effects], second: tuple[FloatArray, Effects]
) -> tuple[FloatArray, FloatArray]:
    """Relative differences (M,) [1] of the second ride from the first, and their standard uncertainties.

    Each ride is its values (M,) and their effects. Errors of the same source act on both. A measure that is zero in the
    first ride has no relative difference: not-a-number.

    Examples
    --------
    >>> one, two = np.array([1.0]), np.array([1.1])
    >>> apart, std = relative_difference((one, {"gain": np.array([[0.1]])}), (two, {"gain": np.array([[0.11]])}))
    >>> apart.round(6).tolist(), std.round(6).tolist()
    ([0.100000], [0.000000])
    """
    (a, of_a), (b, of_b) = first, second
    a, none = np.where(a == 0, np.nan, a), np.zeros(a.size)
    joint = {one: (of_b.get(one, none) - of_a.get(one, none) * (b / a)) / a for one in {**of_a, **of_b}}
    return b / a - 1.0, standard({source: np.atleast_2d(one) for source, one in joint.items()}, a.size)


@dataclass(frozen=True, eq=False)
class RideComparison(ByValue):
    """Rides of R tyres.

    Attributes
    ----------
    names : tuple of str
        The M measures.
    values, std : (R, M) float arrays
        Measures and their standard uncertainties.
    difference, difference_std : (R, M) float arrays [1]
        Relative differences from the first tyre, where errors in common cancel.
    damper : (R, 2) float array [N/m], [N s/m]
        Spring and constant damper with K* of each tyre at one frequency.
    with_damper : (R, M) float array [1]
        Relative error of each measure if these replace the model.
    spectra : tuple of (Ride, (N,) float array)
        Of a road of a known spectrum: the rides, each with the standard uncertainty of its spectrum.
    series : tuple of TimeRide
        Of a road over time: the rides.
    contact : tuple of ContactRide
        The same, if lift-off was asked for.
    approximated : tuple of float [1]
        Of a road over time: the largest relative error of K* of each tyre from 0.1 to 200 Hz; 0 of a model that has a
        state space.
    """

    names: tuple[str, ...]
    values: FloatArray
    std: FloatArray
    difference: FloatArray
    difference_std: FloatArray
    damper: FloatArray
    with_damper: FloatArray
    spectra: tuple[tuple[Ride, FloatArray], ...] = ()
    series: tuple[TimeRide, ...] = ()
    contact: tuple[ContactRide, ...] = ()
    approximated: tuple[float, ...] = ()


def compare_on_class(
    body: Body, tyres: Sequence[Tyre], road: ClassRoad, speed: float, matched: Sequence[float]
) -> RideComparison:
    """Rides on a road of a known spectrum.

    Parameters
    ----------
    body : Body
    tyres : sequence of R Tyre
    road : ClassRoad
    speed : float [m/s]
    matched : sequence of R float [Hz]
        Frequencies at which a constant damper has K* of each tyre.

    Raises
    ------
    ModelError
        If the speed is not positive, or a resonance has too little damping for a sum over frequencies.
    """
    for finer in _FINER:
        found, worst = _on_class(body, tyres, road, speed, matched, finer * (POINTS - 1) + 1)
        if worst.unresolved <= _RESOLVED:
            return found
    raise ModelError(
        f"the vehicle resonates at {worst.frequency[np.argmax(worst.spectrum)]:.3g} Hz almost without damping, so that "
        "its ride on a spectrum is not known: state a suspension damping, or a ride in time"
    )


def _on_class(
    body: Body, tyres: Sequence[Tyre], road: ClassRoad, speed: float, matched: Sequence[float], count: int
) -> tuple[RideComparison, Ride]:
    """The comparison at a number of frequencies, and the ride that these resolve least."""
    omega = 2 * np.pi * frequencies_of(road, speed, count)
    vehicles = {mass: Condensed.of(body.without(mass), omega) for mass in {one.belt.mass for one in tyres}}
    every: list[Ride] = []

    def ridden(tyre: Tyre) -> Ride:
        vehicle = vehicles[tyre.belt.mass]
        every.append(ride(body, tyre.stiffness(omega), road, speed, vehicle=vehicle, belt=tyre.belt))
        return every[-1]

    rides = [ridden(one) for one in tyres]
    of = [effects(one, tyre) for one, tyre in zip(rides, tyres, strict=True)]
    found = _compared(names(body.wheels), [one.values for one in rides], of, tyres, matched, lambda t: ridden(t).values)
    spectra = tuple((one, spectrum_std(one, tyre)) for one, tyre in zip(rides, tyres, strict=True))
    return replace(found, spectra=spectra), max(every, key=lambda one: float(one.unresolved))


def compare_in_time(
    body: Body,
    tyres: Sequence[Tyre],
    heights: FloatArray,
    step: float,
    matched: Sequence[float],
    *,
    lift: bool = False,
    curve: LoadDeflection | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> RideComparison:
    """Rides over a road in time; uncertainties are by differences.

    Parameters
    ----------
    body : Body
    tyres : sequence of R Tyre
        A model without a state space is ridden as the Maxwell arms that `realised` makes of it, from 0.1 to 200 Hz.
    heights : (W, N) float array [m]
        Road under each wheel.
    step : float [s]
    matched : sequence of R float [Hz]
        Frequencies at which a constant damper has K* of each tyre.
    lift : bool
        Whether wheels may leave the road.
    curve : LoadDeflection, optional
        Static load over deflection, in place of a straight line; wheels may leave the road then.
    progress : callable, optional
        Called with the number of tyres that are done, and of all.

    Raises
    ------
    ModelError
        If a model can have no state space, the step is too long, the static load is not on the curve, or there are both
        a curve and a tyre with a belt.
    """
    if not np.ptp(heights):
        raise ModelError("the road is level: nothing moves, and there is nothing to compare")
    nonlinear = lift or curve is not None
    contact: list[ContactRide] = []

    def ridden(space: StateSpace, belt: Specimen, kept: list[ContactRide] | None = None) -> TimeRide:
        if not nonlinear:
            return ride_in_time(body, space, heights, step, belt)
        found = ride_with_contact(body, space, heights, step, curve, belt)
        if kept is not None:
            kept.append(found)
        return found.ride

    series, of, errors = [], [], []
    for at, tyre in enumerate(tyres):
        if progress is not None:
            progress(at, len(tyres))
        space, error = _space(tyre, tyre.values)
        errors.append(error)
        series.append(ridden(space, tyre.belt, contact))
        measured = partial(lambda belt, space: _measures(ridden(space, belt)), tyre.belt)
        of.append(_by_differences(tyre, measured, _measures(series[-1])))
    values = [_measures(one) for one in series]
    measures = (*names(body.wheels), *IN_TIME)
    found = _compared(
        measures, values, of, tyres, matched, lambda one: _measures(ridden(_space(one, one.values)[0], one.belt))
    )
    return replace(found, series=tuple(series), contact=tuple(contact), approximated=tuple(errors))


def _measures(of: TimeRide) -> FloatArray:
    """The measures of a ride in time."""
    comfort = of.comfort
    return np.append(of.values, [comfort.crest, comfort.vdv, comfort.mtvv])


def _space(tyre: Tyre, values: FloatArray) -> tuple[StateSpace, float]:
    """The state space of a tyre with parameters (P,), and the largest relative error of its K* [1].

    ModelError with the remedy if its model can have none.
    """
    with suppress(ModelError):  # a power of the frequency
        return tyre.model.state_space(values), 0.0
    try:
        found = realised(tyre.model, values, REALISED)
        return found.space, found.error
    except ModelError as error:
        raise ModelError(f"{tyre.name}: {error}; fit one that can, as with fourpole fit --model prony") from None


def _by_differences(
    tyre: Tyre, measured: Callable[[StateSpace], FloatArray], here: FloatArray
) -> dict[str, FloatArray]:
    """Changes (E, M) of measures by one standard uncertainty of each error.

    A discrepancy in phase, the same at all frequencies, has no state space and is left out.
    """
    slopes = np.zeros((tyre.values.size, here.size))
    moved = sum((np.sum(one**2, axis=1) for one in tyre.errors.values()), np.zeros(tyre.values.size))
    for at in np.flatnonzero(moved > 0).tolist():
        change = np.zeros(tyre.values.size)
        change[at] = _CHANGE * (abs(tyre.values[at]) or tyre.model.parameters[at].default)
        ends = [np.clip(tyre.values + side * change, *tyre.model.bounds) for side in (1.0, -1.0)]
        above, below = (measured(_space(tyre, one)[0]) for one in ends)
        slopes[at] = (above - below) / (ends[0] - ends[1])[at]
    found: dict[str, FloatArray] = {source: one.T @ slopes for source, one in tyre.errors.items()}
    if tyre.discrepancy[0]:
        space, _ = _space(tyre, tyre.values)
        stiffer = measured(StateSpace(space.a, space.b, (1 + _CHANGE) * space.c, (1 + _CHANGE) * space.d))
        found[tyre.source_of_discrepancy] = tyre.discrepancy[0] * (stiffer - here)[None] / _CHANGE
    return found


def _compared(
    measures: tuple[str, ...],
    values: Sequence[FloatArray],
    of: Sequence[Effects],
    tyres: Sequence[Tyre],
    matched: Sequence[float],
    ridden: Callable[[Tyre], FloatArray],
) -> RideComparison:
    """The comparison, without the rides themselves."""
    apart = [relative_difference((values[0], of[0]), pair) for pair in zip(values, of, strict=True)]
    dampers = [constant_damper(tyre, frequency) for tyre, frequency in zip(tyres, matched, strict=True)]
    wrong = [relative_difference((value, {}), (ridden(one), {})) for one, value in zip(dampers, values, strict=True)]
    return RideComparison(
        names=measures,
        values=np.stack(values),
        std=np.stack([standard(one, len(measures)) for one in of]),
        difference=np.stack([one for one, _ in apart]),
        difference_std=np.stack([std for _, std in apart]),
        damper=np.stack([one.values for one in dampers]),
        with_damper=np.stack([one for one, _ in wrong]),
    )
