"""The variables of an FMU: time, motions, force, operating point, states, and the parameters of each point.

The value reference of a variable is its place; sources/branches.h has the same order.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from fourpole.models.realised import Realised

#: Units with their exponents of kg, m, s and rad.
UNITS = {
    "m": (0, 1, 0, 0),
    "m/s": (0, 1, -1, 0),
    "s": (0, 0, 1, 0),
    "1/s": (0, 0, -1, 0),
    "rad/s": (0, 0, -1, 1),
    "N": (1, 1, -2, 0),
    "N/m": (1, 0, -2, 0),
    "N.s/m": (1, 0, -1, 0),
    "1": (0, 0, 0, 0),
}
#: Size of a deflection for the tolerance of an integrator [m].
NOMINAL = 1e-3
#: The least positive number, which stands for "above zero".
_ABOVE_ZERO = sys.float_info.min
_ANY = -sys.float_info.max
#: Place of the first state.
FIRST_STATE = 9
_DRAW = (
    "0: the estimate, the parameters of points; from 1 on a draw from the uncertainty of the model, to which these "
    "parameters do not apply; its static load is that of the estimate"
)


#: A system and, with a belt, that of the belt.
Draw = tuple[Realised, Realised | None]


@dataclass(frozen=True)
class Point:
    """An operating point of an FMU: its words, and the model there as a linear system.

    With a belt, `belt` is the force Q on it over the mean motion of both ends, in which the contact has `weight` [1].
    `discrepancy` [1] is the relative error of K* of the model. `draws` are the system and the belt drawn from the
    uncertainty of the model, with as many numbers each.
    """

    label: str
    system: Realised
    belt: Realised | None = None
    weight: float = 0.0
    discrepancy: float = 0.0
    draws: tuple[Draw, ...] = ()

    @property
    def force_on_belt(self) -> Realised:
        """The force that accelerates the belt, over the mean motion of both ends; none without a belt."""
        nothing, pairs = np.zeros(0), np.zeros(0, dtype=complex)
        return Realised(0.0, 0.0, nothing, nothing, pairs, pairs) if self.belt is None else self.belt


def states_together(system: Realised) -> list[range]:
    """Places of the states of a system that belong together: one of each branch, two of each pair."""
    count, pairs = system.springs.size, system.pair_springs.size
    single = [range(at, at + 1) for at in range(count)]
    return single + [range(count + 2 * at, count + 2 * at + 2) for at in range(pairs)]


def is_belted(points: Sequence[Point]) -> bool:
    """Whether an FMU has the belt of a tyre, and thus two forces."""
    return any(one.belt is not None for one in points)


@dataclass(frozen=True)
class Variable:
    """A variable of an FMU.

    Attributes
    ----------
    name, about, unit : str
        The unit is a key of `UNITS`, or empty for a number of a point.
    causality, variability, initial : str
        As in FMI; `initial` is empty where FMI has none.
    start : float or None
    least : float
        Least value of a parameter.
    most : int, optional
        Greatest value of an integer.
    derivative : int or None
        Place of the state whose time derivative it is.
    """

    name: str
    about: str
    unit: str
    causality: str
    variability: str
    initial: str = ""
    start: float | None = None
    least: float = _ANY
    most: int | None = None
    derivative: int | None = None


def variables_of(points: Sequence[Point]) -> list[Variable]:
    """All variables, each at the place that is its value reference."""
    states, belted = states_of_part(points), is_belted(points)
    first = FIRST_STATE
    found = [
        Variable("time", "Time", "s", "independent", "continuous"),
        _input("contact.displacement", "Displacement of the contact towards the wheel, zero at rest under", "m"),
        _input("contact.velocity", "Its velocity; it also says how the displacement goes on within a step", "m/s"),
        _input("wheel.displacement", "Displacement of the wheel in the same direction, zero at rest under", "m"),
        _input("wheel.velocity", "Its velocity", "m/s"),
        Variable(
            "force",
            "Force on the wheel, away from the contact: preload plus what the deflection adds; positive in compression",
            "N", "output", "continuous", "calculated",
        ),
        Variable("point", f"Operating point: {_listed(points)}", "", "parameter", "fixed", "exact", 1, 1, len(points)),
        Variable("preload", "Static load: the force at zero deflection", "N", "parameter", "fixed", "exact", 0.0),
        Variable("draw", _DRAW, "", "parameter", "fixed", "exact", 0, 0, draws_in(points)),
        *(
            Variable(f"states[{at + 1}]", "Deflection that has relaxed", "m", "local", "continuous", "calculated")
            for at in range(states)
        ),
        *(
            Variable(
                f"der(states[{at + 1}])", "", "m/s", "local", "continuous", "calculated", derivative=first + at
            )
            for at in range(states)
        ),
        *(
            one
            for at, point in enumerate(points, start=1)
            for one in _parameters(f"points[{at}]", point.label, point.system)
        ),
    ]  # fmt: skip
    if not belted:
        return [*found, *_discrepancies(points)]
    for at, point in enumerate(points, start=1):
        found += _parameters(f"belts[{at}]", f"the belt of {point.label}", point.force_on_belt)
    found += _discrepancies(points)
    contact = "Force into the contact: preload plus what the motions add; positive in compression"
    found += [Variable("contact_force", contact, "N", "output", "continuous", "calculated")]
    first = len(found)
    names = [f"belt_states[{at + 1}]" for at in range(states)]
    found += [Variable(one, "State of the belt", "m", "local", "continuous", "calculated") for one in names]
    found += [
        Variable(f"der({one})", "", "m/s", "local", "continuous", "calculated", derivative=first + at)
        for at, one in enumerate(names)
    ]
    return found


def draws_in(points: Sequence[Point]) -> int:
    """Number of draws: none unless all points have as many."""
    return min(len(one.draws) for one in points)


def states_of_part(points: Sequence[Point]) -> int:
    """Number of states of the springs, and as many of the belts: that of the point with the most."""
    systems = (one for point in points for one in (point.system, point.force_on_belt))
    return max(one.springs.size + 2 * one.pair_springs.size for one in systems)


def states_in(points: Sequence[Point]) -> int:
    """Number of states."""
    return states_of_part(points) * (1 + is_belted(points))


def _input(name: str, about: str, unit: str) -> Variable:
    about = about.replace("zero at rest under", "zero at rest under the preload")
    return Variable(name, about, unit, "input", "continuous", "", 0.0)


def _listed(points: Sequence[Point]) -> str:
    return "; ".join(f"{at} = {one.label}" for at, one in enumerate(points, start=1))


def _discrepancies(points: Sequence[Point]) -> Iterator[Variable]:
    """The relative error of each point; they come last, because no number of a point may come between others."""
    for at, point in enumerate(points, start=1):
        about = f"Relative error of K* of {point.label}; for information, it changes no result"
        name = f"points[{at}].discrepancy"
        yield Variable(name, about, "1", "parameter", "fixed", "exact", point.discrepancy, 0.0)


def _parameters(name: str, label: str, system: Realised) -> Iterator[Variable]:
    """The parameters of one point, in the order of its numbers in the C source."""

    def one(which: str, about: str, unit: str, start: float, least: float) -> Variable:
        return Variable(f"{name}.{which}", about, unit, "parameter", "fixed", "exact", float(start), least)

    yield one("stiffness_at_rest", f"Stiffness at rest of {label}", "N/m", system.rest, 0.0)
    yield one("damping", "Viscous damping", "N.s/m", system.damper, 0.0)
    for at, (spring, time) in enumerate(zip(system.springs, system.times, strict=True), start=1):
        yield one(f"branches[{at}].stiffness", "Stiffness that relaxes", "N/m", spring, _ANY)
        yield one(f"branches[{at}].relaxation_time", "Its relaxation time, above zero", "s", time, _ABOVE_ZERO)
    for at, (spring, rate) in enumerate(zip(system.pair_springs, system.pair_rates, strict=True), start=1):
        yield one(f"pairs[{at}].stiffness", "Stiffness of a mode, in phase", "N/m", spring.real, _ANY)
        yield one(f"pairs[{at}].cross_stiffness", "Stiffness of the mode, out of phase", "N/m", spring.imag, _ANY)
        yield one(f"pairs[{at}].decay", "Decay of the mode, above zero", "1/s", rate.real, _ABOVE_ZERO)
        yield one(f"pairs[{at}].frequency", "Frequency of the mode, above zero", "rad/s", rate.imag, _ABOVE_ZERO)
