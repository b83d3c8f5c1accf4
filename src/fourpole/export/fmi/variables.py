"""The variables of an FMU: time, motions, force, operating point, states, and the parameters of each point.

The value reference of a variable is its place; sources/branches.h has the same order.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

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
}
#: Size of a deflection for the tolerance of an integrator [m].
NOMINAL = 1e-3
#: The least positive number, which stands for "above zero".
_ABOVE_ZERO = sys.float_info.min
_ANY = -sys.float_info.max


@dataclass(frozen=True)
class Point:
    """An operating point of an FMU: its words, and the model there as a linear system."""

    label: str
    system: Realised

    @property
    def states(self) -> list[range]:
        """Places of the states that belong together: one of each branch, two of each pair."""
        count, pairs = self.system.springs.size, self.system.pair_springs.size
        single = [range(at, at + 1) for at in range(count)]
        return single + [range(count + 2 * at, count + 2 * at + 2) for at in range(pairs)]


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
    derivative: int | None = None


def variables_of(points: Sequence[Point]) -> list[Variable]:
    """All variables, each at the place that is its value reference."""
    states = states_in(points)
    first = 8
    return [
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
        Variable("point", f"Operating point: {_listed(points)}", "", "parameter", "fixed", "exact", 1, 1),
        Variable("preload", "Static load: the force at zero deflection", "N", "parameter", "fixed", "exact", 0.0),
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
        *(one for at, point in enumerate(points, start=1) for one in _parameters(f"points[{at}]", point)),
    ]  # fmt: skip


def states_in(points: Sequence[Point]) -> int:
    """Number of states: that of the point with the most."""
    return max(len(one.system.space.a) for one in points)


def _input(name: str, about: str, unit: str) -> Variable:
    about = about.replace("zero at rest under", "zero at rest under the preload")
    return Variable(name, about, unit, "input", "continuous", "", 0.0)


def _listed(points: Sequence[Point]) -> str:
    return "; ".join(f"{at} = {one.label}" for at, one in enumerate(points, start=1))


def _parameters(name: str, point: Point) -> Iterator[Variable]:
    """The parameters of one point, in the order of its numbers in the C source."""
    system = point.system

    def one(which: str, about: str, unit: str, start: float, least: float) -> Variable:
        return Variable(f"{name}.{which}", about, unit, "parameter", "fixed", "exact", float(start), least)

    yield one("stiffness_at_rest", f"Stiffness at rest of {point.label}", "N/m", system.rest, 0.0)
    yield one("damping", "Viscous damping", "N.s/m", system.damper, 0.0)
    for at, (spring, time) in enumerate(zip(system.springs, system.times, strict=True), start=1):
        yield one(f"branches[{at}].stiffness", "Stiffness that relaxes", "N/m", spring, _ANY)
        yield one(f"branches[{at}].relaxation_time", "Its relaxation time, above zero", "s", time, _ABOVE_ZERO)
    for at, (spring, rate) in enumerate(zip(system.pair_springs, system.pair_rates, strict=True), start=1):
        yield one(f"pairs[{at}].stiffness", "Stiffness of a mode, in phase", "N/m", spring.real, _ANY)
        yield one(f"pairs[{at}].cross_stiffness", "Stiffness of the mode, out of phase", "N/m", spring.imag, _ANY)
        yield one(f"pairs[{at}].decay", "Decay of the mode, above zero", "1/s", rate.real, _ABOVE_ZERO)
        yield one(f"pairs[{at}].frequency", "Frequency of the mode, above zero", "rad/s", rate.imag, _ABOVE_ZERO)
