"""Rides of several tyres under one vehicle: measures, differences from the first, and their uncertainties."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fourpole.core.arrays import ByValue, FloatArray
from fourpole.errors import ModelError
from fourpole.models.interface import StateSpace
from fourpole.ride.contact import ContactRide, LoadDeflection, ride_with_contact
from fourpole.ride.response import POINTS, Condensed, Ride, frequencies_of, names, ride
from fourpole.ride.road import ClassRoad
from fourpole.ride.time import TimeRide, ride_in_time
from fourpole.ride.uncertainty import (
    Effects,
    Tyre,
    constant_damper,
    effects,
    relative_difference,
    spectrum_std,
    standard,
)
from fourpole.ride.vehicle import Body

#: Relative change of a parameter for a difference.
_CHANGE = 1e-3
#: Factors of the usual number of frequencies, tried until the rides are resolved, and the largest `Ride.unresolved`.
_FINER, _RESOLVED = (1, 8, 32), 1e-2
#: Measures that a ride in time has besides those of a spectrum.
IN_TIME = ("crest", "vdv", "mtvv")


@dataclass(frozen=True, eq=False)
class Compared(ByValue):
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


def compare_on_class(
    body: Body, tyres: Sequence[Tyre], road: ClassRoad, speed: float, matched: Sequence[float]
) -> Compared:
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
) -> tuple[Compared, Ride]:
    """The comparison at a number of frequencies, and the ride that these resolve least."""
    omega = 2 * np.pi * frequencies_of(road, speed, count)
    vehicle = Condensed.of(body, omega)
    every: list[Ride] = []

    def ridden(tyre: Tyre) -> Ride:
        every.append(ride(body, tyre.stiffness(omega), road, speed, vehicle=vehicle))
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
) -> Compared:
    """Rides over a road in time; uncertainties are by differences.

    Parameters
    ----------
    body : Body
    tyres : sequence of R Tyre
        Models with a state space.
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
        If a model has no state space, the step is too long, or the static load is not on the curve.
    """
    if not np.ptp(heights):
        raise ModelError("the road is level: nothing moves, and there is nothing to compare")
    nonlinear = lift or curve is not None
    contact: list[ContactRide] = []

    def ridden(space: StateSpace, kept: list[ContactRide] | None = None) -> TimeRide:
        if not nonlinear:
            return ride_in_time(body, space, heights, step)
        found = ride_with_contact(body, space, heights, step, curve)
        if kept is not None:
            kept.append(found)
        return found.ride

    series, of = [], []
    for at, tyre in enumerate(tyres):
        if progress is not None:
            progress(at, len(tyres))
        series.append(ridden(_space(tyre), contact))
        of.append(_by_differences(tyre, lambda space: _measures(ridden(space)), _measures(series[-1])))
    values = [_measures(one) for one in series]
    measures = (*names(body.wheels), *IN_TIME)
    found = _compared(measures, values, of, tyres, matched, lambda one: _measures(ridden(_space(one))))
    return replace(found, series=tuple(series), contact=tuple(contact))


def _measures(of: TimeRide) -> FloatArray:
    """The measures of a ride in time."""
    comfort = of.comfort
    return np.append(of.values, [comfort.crest, comfort.vdv, comfort.mtvv])


def _space(tyre: Tyre) -> StateSpace:
    """The state space of a tyre; ModelError with the remedy if its model has none."""
    try:
        return tyre.model.state_space(tyre.values)
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
        above, below = (measured(tyre.model.state_space(one)) for one in ends)
        slopes[at] = (above - below) / (ends[0] - ends[1])[at]
    found: dict[str, FloatArray] = {source: one.T @ slopes for source, one in tyre.errors.items()}
    if tyre.discrepancy[0]:
        space = _space(tyre)
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
) -> Compared:
    """The comparison, without the rides themselves."""
    apart = [relative_difference((values[0], of[0]), pair) for pair in zip(values, of, strict=True)]
    dampers = [constant_damper(tyre, frequency) for tyre, frequency in zip(tyres, matched, strict=True)]
    wrong = [relative_difference((value, {}), (ridden(one), {})) for one, value in zip(dampers, values, strict=True)]
    return Compared(
        names=measures,
        values=np.stack(values),
        std=np.stack([standard(one, len(measures)) for one in of]),
        difference=np.stack([one for one, _ in apart]),
        difference_std=np.stack([std for _, std in apart]),
        damper=np.stack([one.values for one in dampers]),
        with_damper=np.stack([one for one, _ in wrong]),
    )
