"""The variables of an FMU: time, motions, force, operating point, states, and the parameters of each point.

The value reference of a variable is its place; sources/branches.h has the same order. Draws of a model from its
uncertainty are linear systems of one structure.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fourpole.core.arrays import FloatArray
from fourpole.errors import ModelError
from fourpole.models.data import StiffnessData
from fourpole.models.fit import fit
from fourpole.models.fractional import arms_at
from fourpole.models.laws import root_of
from fourpole.models.operating import OperatingMap
from fourpole.models.realised import Realised, realised
from fourpole.models.surface import design

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


#: Number of draws that an export keeps, of those made, some of which may have another structure; their seed.
COUNT, _MADE, SEED = 64, 96, 1
#: Times so far below the band are a damper in it; springs so far below the largest are none.
_FAST, _IDLE = 0.01, 1e-9
#: Frequencies of the band at which a draw of K* is made, and step of its direction in standard uncertainties.
_FREQUENCIES, _STEP = 24, 1e-3
#: Relative weight of K* in the fit of its parameters; smaller ones are not told apart.
_CLOSE = 1e-4


def drawn_values(found: OperatingMap, point: FloatArray, count: int = _MADE, seed: int = SEED) -> FloatArray:
    r"""Parameters (count, P) of a map at a point (d,), drawn from its uncertainty.

    A draw of K* over the band is :math:`K^* + \partial K^*/\partial c\,\delta`, the coefficients c having their
    covariance, times a factor with the scatter of conditions and the discrepancy of the model; its parameters are those
    that suit it best. So K* of the draws scatters as the map says where parameters are hardly known each, and their
    distribution is far from normal.

    Examples
    --------
    >>> from fourpole.models.linearised import Scatter
    >>> from fourpole.models.springs import KelvinVoigt
    >>> from fourpole.models.surface import Axes
    >>> from fourpole.models.together import LeaveOneOut
    >>> linked = KelvinVoigt().link(np.array([180e3, 700.0]))[:, None]
    >>> found = OperatingMap(
    ...     KelvinVoigt(),
    ...     Axes((), np.zeros((1, 0)), {}),
    ...     ((),),
    ...     linked,
    ...     np.diag([1e-4, 4e-4]),
    ...     Scatter(),
    ...     (5.0, 50.0),
    ...     LeaveOneOut(),
    ... )
    >>> drawn = drawn_values(found, np.zeros(0))
    >>> (drawn.std(axis=0) / drawn.mean(axis=0)).round(2)
    array([0.01, 0.02])
    """
    rng = np.random.default_rng(seed)
    moves = rng.standard_normal((count, len(found.covariance))) @ root_of(found.covariance).T
    spread = np.hypot(max(found.scatter.condition), max(found.scatter.frequency))
    factor = np.exp(spread * rng.standard_normal(count))
    omega = 2 * np.pi * np.geomspace(*found.band, _FREQUENCIES)
    basis = design(found.terms, found.axes.scaled(point[None]))[0]
    linked, moved = found.coefficients @ basis, moves.reshape(count, *found.coefficients.shape) @ basis
    best, *ends = (found.model.unlink(one)[0] for one in (linked, linked + _STEP * moved, linked - _STEP * moved))
    above, below = (found.model.stiffness(one, omega) for one in ends)
    target = (found.model.stiffness(best, omega) + (above - below) / (2 * _STEP)) * factor[:, None]
    still = np.all(ends[0] == ends[1], axis=0)
    held = [symbol for symbol, one in zip(found.model.symbols, still, strict=True) if one]
    if len(held) == best.size:
        return np.tile(best, (count, 1))
    data = StiffnessData.of(omega, target, _CLOSE * np.abs(target))
    return fit(found.model, data, np.tile(best, (count, 1)), fixed=held).values


def drawn_systems(found: OperatingMap, point: FloatArray, like: Realised) -> Iterator[Realised]:
    """Draws of the model as linear systems with as many branches and pairs as that of the estimate; see `drawn_values`.

    More than `COUNT` draws are made, for some may have no such system.
    """
    least = _FAST / (2 * np.pi * found.band[1])
    rates = 1.0 / like.times if like.times.size else np.ones(1)
    omega = np.geomspace(rates.min(), rates.max(), 3 * rates.size)
    for values in drawn_values(found, point):
        try:
            if like.error and not like.pair_springs.size:  # an approximation by arms keeps their times
                rest, *springs = arms_at(omega, found.model.stiffness(values, omega), like.times)
                one = replace(like, rest=float(rest), springs=np.array(springs))
            else:
                one = _slowed(realised(found.model, values, found.band), least)
            yield alike(one, like)
        except (ModelError, RuntimeError):
            continue


def alike(system: Realised, like: Realised) -> Realised:
    """The system with as many branches as another one, some of them idle; ModelError if it has more, or other pairs."""
    kept = np.abs(system.springs) > _IDLE * np.abs(system.springs).max(initial=0.0)
    more = like.springs.size - int(kept.sum())
    if more < 0 or system.pair_springs.size != like.pair_springs.size:
        raise ModelError("the system has another structure")
    springs, times = np.append(system.springs[kept], np.zeros(more)), np.append(system.times[kept], np.ones(more))
    return replace(system, springs=springs, times=times)


def _slowed(system: Realised, least: float) -> Realised:
    """The system with times of at least `least` [s]; faster branches keep their damping."""
    slow = np.maximum(system.times, least)
    return replace(system, springs=system.springs * system.times / slow, times=slow)
