"""The joint solution of all tests of a rig: K* of each condition, the rig's values and the channels' gains."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from fourpole.core.arrays import BoolArray, ByValue, ComplexArray, FloatArray
from fourpole.core.channelerrors import ChannelError, ChannelUncertainty
from fourpole.core.components import SpecimenUncertainty, component
from fourpole.core.joint.asking import GAIN
from fourpole.core.joint.belts import explained, explains_more, is_possible, linear_gain, second_roots, weight_of
from fourpole.core.joint.conditions import JointConditions, group_conditions
from fourpole.core.joint.misfit import UNITS_AND_SIGNS, Residuals, contradicted_by_neighbours, gross_errors, residuals
from fourpole.core.joint.model import Observed
from fourpole.core.joint.reconcile import is_vain, reconcile, without_rig
from fourpole.core.joint.scatter import deviations, robust_scatter
from fourpole.core.joint.shared import PARTS_OF_RUN, STEPS, Shared, SharedParameter
from fourpole.core.joint.solve import MUCH, Problem, Solution, solution_of_part, solve_either
from fourpole.core.joint.specimens import Misfit
from fourpole.core.phasor import SYMBOLS, Phasors
from fourpole.core.rig import Rig
from fourpole.core.routes import stiffness_by
from fourpole.core.sources import PARTS, Kind, Source
from fourpole.core.specimen import Body
from fourpole.core.unstated import PRESLIDING_STD
from fourpole.errors import RigError

#: Relative difference of the deflection from that of the repeats, and the least number of tests with such a difference,
#: that can show a dependence of K* on the amplitude.
_UNLIKE, _FEWEST_UNLIKE = 0.05, 3
#: Specimens repeat to 1 % and better; if they do not, a mass may be the reason [1].
_SCATTERS = 0.01
#: Whether specimens have a mass is first asked of so many tests.
_MANY = 200


@dataclass(frozen=True, eq=False)
class Joint(ByValue):
    """Result of the joint route, for each test in the order given.

    Attributes
    ----------
    problem, solution : Problem, Solution
        The tests sorted by condition, and the most probable values.
    order : (N,) int array
        Index of the given test for each row of `problem`.
    condition : (N,) int array
        Number of the condition of each test; -1 for a rigid block.
    stated : Shared
        Shared values as stated, and after them drifts, unstated parts and errors, with their size as standard
        uncertainty.
    residuals : Residuals
        Residuals of each test.
    outlier : (N,) float array [1]
        Factor by which the variance of an outlier was enlarged; 1 for the other tests.
    misfit : Misfit
        Agreement of the statement with the tests.
    two_roots : (N,) bool array
        True where another K* of a specimen with a mass explains the test as well.
    support : (N,) float array [N s/m], or 0
        Standard uncertainty of Zr by frame and foundation, for each test in the order of `problem`.
    """

    problem: Problem
    solution: Solution
    order: np.ndarray
    condition: np.ndarray
    stated: Shared
    residuals: Residuals
    outlier: FloatArray
    misfit: Misfit
    two_roots: BoolArray
    support: FloatArray | float = 0.0

    @property
    def converged(self) -> bool:
        """Whether the search for the most probable values converged."""
        return self.solution.converged

    @cached_property
    def gains(self) -> ComplexArray:
        """Complex gains (N, 3) of F1, V1, V2 as found."""
        return self.problem.observed.gains(self.problem.shared, self.solution.z)[np.argsort(self.order)]

    @property
    def found(self) -> FloatArray:
        """Shared values as found, each in its unit."""
        return self.problem.shared.found(self.solution.z)

    @property
    def found_std(self) -> FloatArray:
        """Standard uncertainties of `found`, each in its unit, if all statements as last widened are true."""
        return np.sqrt(np.diag(self.solution.covariance)) * self.problem.shared.std

    def part(self, rows: BoolArray) -> Joint:
        """Some of the tests (N,), and what these alone say about the same values."""
        kept = rows[self.order]
        problem, solution = solution_of_part(self.problem, self.solution, kept)
        order = (np.cumsum(rows) - 1)[self.order[kept]]
        return replace(
            self,
            problem=problem,
            solution=solution,
            order=order,
            condition=problem.conditions.label[np.argsort(order)],
            residuals=self.residuals.part(rows),
            outlier=self.outlier[rows],
            two_roots=self.two_roots[rows],
            support=np.broadcast_to(self.support, kept.shape)[kept],
        )


def solve_joint(
    phasors: Phasors,
    rig: Rig,
    k1: ArrayLike = np.nan,
    *,
    family: ArrayLike = 0,
    nominal_frequency: ArrayLike = np.nan,
    added_mass: ArrayLike = 0.0,
    added_mass_std: ArrayLike = 0.0,
    channels: ChannelUncertainty | None = None,
    specimen: Sequence[str] | None = None,
    time: ArrayLike | None = None,
    apart: ArrayLike = 0.0,
    lines: ArrayLike = 1.0,
    recording: ArrayLike | None = None,
    mounting: Sequence[str] | None = None,
    specimens: SpecimenUncertainty | None = None,
    bodies: Mapping[str, Body] | None = None,
    support: float = 0.0,
    friction: float = 0.0,
) -> Joint:
    """The most probable values of all tests of a rig; the arguments are those of `identify_joint`.

    Of a moving rig of which nothing else is stated, `support` is the standard uncertainty of the force that frame and
    foundation add to that of the preload spring at each frequency, over the latter [1], and `friction` [N] that of the
    dry friction of its guide.
    """
    if rig.blocked:
        raise RigError("a blocked rig has no motion beyond the specimen: use the mobility route")
    count = np.size(phasors.frequency)
    k1, added, added_std = (np.broadcast_to(np.asarray(x, float), count) for x in (k1, added_mass, added_mass_std))
    family = np.broadcast_to(np.asarray(family, dtype=int), count)
    channels = channels or ChannelUncertainty()

    nominal = np.broadcast_to(np.asarray(nominal_frequency, dtype=float), count)
    own = None if recording is None else np.asarray(recording, dtype=int)
    label = group_conditions(family, phasors.frequency, nominal, own)
    order = np.lexsort((np.arange(count), label))
    masses, mass_at, masses_std = _distinct(added, added_std)
    names, number = np.unique(np.array([""] * count if specimen is None else specimen, dtype=str), return_inverse=True)
    when = np.arange(count, dtype=float) if time is None else np.asarray(time, dtype=float)
    run = number[order], _places(number, when)[order], parts_of_run(number, when)[order]
    sensors = number if mounting is None else np.unique(np.array(mounting, dtype=str), return_inverse=True)[1].ravel()
    sensors = sensors if np.ptp(sensors) else number  # a sensor of the rig may be touched with each specimen, too
    groups = (sensors[order], mass_at[order])
    errors = channels.part(order).errors(phasors.omega[order], groups, possible=True)
    together = np.zeros(count, dtype=int)
    errors += _unstated_errors(channels.crosstalk, _places(together, when)[order], parts_of_run(together, when)[order])
    stated = Shared.stated(rig, errors, masses, masses_std)
    possible = of_specimens(names.tolist(), run, mass_at[order], label[order], specimens or SpecimenUncertainty())
    if friction:
        parts = {"friction": friction, "presliding": PRESLIDING_STD}
        listed = (SharedParameter(Source(Kind.UNSTATED, of), PARTS[of], 0, 0.0, std) for of, std in parts.items())
        stated = replace(stated, parameters=(*stated.parameters, *listed))
    stated = replace(stated, parameters=(*stated.parameters, *(value for value in possible if value.std > 0)))
    sorted_phasors = phasors.part(order)
    observed = Observed.of(sorted_phasors, mass_at[order], family[order] < 0, errors, run)
    conditions = JointConditions(label[order], family[order], sorted_phasors.frequency, k1[order])
    deflection = conditions.off_curve(observed.deflection)
    if np.sum(np.abs(deflection) > _UNLIKE) < _FEWEST_UNLIKE:
        # A deflection that changes with frequency alone cannot be distinguished from the slope of K* over frequency.
        deflection = np.zeros(count)
    sources = tuple(error.source for error in errors)
    del errors  # their turns are those of `observed`
    problem = Problem(
        replace(observed, deflection=deflection),
        conditions,
        stated,
        sources,
        tuple(names.tolist()),
        tuple(possible),
        apart=np.broadcast_to(np.asarray(apart, dtype=float), count)[order] if np.any(apart) else None,
        lines=np.broadcast_to(np.asarray(lines, dtype=float), count)[order] if np.any(np.asarray(lines) != 1) else None,
        support=support,
    )
    supported = support * rig.preload_stiffness / observed.omega
    problem, solution, outlier, misfit = _held(_reconciled(problem, channels, bodies or {}, supported))
    unnamed = misfit.fits or not misfit.candidates
    if unnamed and (wrong := contradicted_by_neighbours(problem, solution)):
        misfit = replace(misfit, fits=False, candidates=wrong, tied=len(wrong))
    back = np.argsort(order)
    return Joint(
        problem=problem,
        solution=solution,
        order=order,
        condition=label,
        stated=replace(stated, parameters=(*stated.parameters, *problem.shared.parameters[len(stated) :])),
        residuals=residuals(problem, solution).part(back),
        outlier=outlier[back],
        misfit=misfit,
        two_roots=(np.append(second_roots(problem, solution), [False])[label] if problem.shared.has_belts
                   else np.zeros(count, dtype=bool)),
        support=supported,
    )  # fmt: skip


def of_specimens(
    names: Sequence[str],
    run: tuple[np.ndarray, FloatArray, np.ndarray],
    mass_at: np.ndarray,
    label: np.ndarray,
    std: SpecimenUncertainty,
) -> list[SharedParameter]:
    """The drifts and steps of the specimens, and the blocks of those with several masses; a std of 0 counts as absent.

    Parameters
    ----------
    names : sequence of str
        The specimens.
    run : (N,) int array, (N,) float array, (N,) int array
        Number of the specimen of each test, its place in the run, and the part of the run in which it is.
    mass_at, label : (N,) int arrays
        Number of the added mass of each test, -1 for none, and of its condition, -1 for a rigid block.
    std : SpecimenUncertainty
    """
    specimen, place, part_of_run = run
    tyre, count = label >= 0, int(mass_at.max(initial=-1)) + 1
    listed = []
    for number in np.unique(specimen[tyre]).tolist():
        own = tyre & (specimen == number)
        masses = np.unique(mass_at[own])
        if np.ptp(place[own]):
            for kind, size in ((Kind.DRIFT, std.drift.real), (Kind.ANGLE_DRIFT, std.drift.imag)):
                listed.append(SharedParameter(Source(kind, names[number]), component(kind).unit, number, 0.0, size))
        for part in np.unique(part_of_run[own])[:-1].tolist():
            for kind in STEPS:
                step = number * PARTS_OF_RUN + part
                listed.append(SharedParameter(Source(kind, names[number]), component(kind).unit, step, 0.0, 0.0))
        for mass in masses[1:].tolist():
            for kind, size in ((Kind.BLOCK, std.block.real), (Kind.ANGLE_BLOCK, std.block.imag)):
                place_of = number * count + mass
                listed.append(SharedParameter(Source(kind, names[number]), component(kind).unit, place_of, 0.0, size))
    return listed


_Explained = tuple[Problem, Solution, FloatArray, Misfit]
#: The misfit of tests that were not asked what would explain them.
_UNASKED = Misfit(fits=False)


def _reconciled(
    problem: Problem, channels: ChannelUncertainty, bodies: Mapping[str, Body], support: FloatArray
) -> list[_Explained]:
    """The problem after all remedies, its solution, the factors (N,) of the outliers' variances, and the misfit.

    Where massless specimens do not explain the tests as they are stated, the specimens may have a mass of their own.
    Other explanations that are nearly as probable come after the most probable one.
    """
    as_stated = np.zeros(len(problem.shared))
    start = closed_form_start(problem.observed, problem.conditions, problem.shared, channels)
    observed = problem.observed
    if np.any(observed.frequency_std > 0):  # its effect on the amplitudes counts as noise
        relative = 2 * np.pi * observed.frequency_std / observed.omega
        by_frequency = problem.by_log_frequency(as_stated, start) * relative[:, None]
        problem = problem.widened(by_frequency[:, :, None])
    if support.any():
        problem = problem.widened(problem.columns("by_impedance", as_stated, start) * support[:, None, None])
    massless = _massless(problem, start, hasty=True)
    stated = any(body.mass_std > 0 for body in bodies.values())
    gross = any(cause.form in UNITS_AND_SIGNS for cause in massless[3].candidates)  # no mass looks like these
    if gross or (not stated and _is_enough(massless, bodies)):
        return [massless]
    few = problem.thinned(_MANY)
    if few.observed.omega.size < problem.observed.omega.size and not stated:
        first = closed_form_start(few.observed, few.conditions, few.shared, channels)
        of_few = _with_masses(few, first, bodies, _massless(few, first, hasty=True), stated=False)
        if not any(made[0].shared.has_belts for made in of_few):
            return [_massless(problem, start, hasty=False) if massless[3] is _UNASKED else massless]
    found = _with_masses(problem, start, bodies, massless, stated=stated)
    if found[0][1].objective > MUCH * problem.conditions.label.size:
        massless = _massless(problem, start, hasty=False)
        found = _with_masses(problem, start, bodies, massless, stated=stated)
    return found


def _with_masses(
    problem: Problem, start: ComplexArray, bodies: Mapping[str, Body], massless: _Explained, *, stated: bool
) -> list[_Explained]:
    """The most probable explanation, and after it those within `GAIN`: massless specimens, belts, or rods.

    Each has all that it asks for. A mass that nobody stated has to gain as much as anything else that is asked for, but
    a contradiction of the statement by massless specimens costs as much.
    """
    known, rare = _weight(massless, problem), GAIN if massless[3].fits and not stated else 0.0
    found = [] if stated else [(known, massless)]
    for searched, wide, solution in explained(problem, bodies, start):
        # A search without an end counts where there has to be a mass: what is asked for besides may end it.
        if massless[3].fits and not (solution.converged or stated):
            continue
        best, other = max(found, key=lambda one: one[0], default=(-np.inf, massless))
        # What is asked for gains at most half of what is left beyond the best, and nothing where massless ones fit.
        most = 0.0 if massless[3].fits and not stated else 0.5 * (solution.objective - other[1].objective)
        if searched - rare + max(most, 0.0) < best - GAIN:
            continue
        first = solution.stiffness, solution.z
        scatter = robust_scatter(wide, deviations(wide, solution.z, solution.stiffness))
        made = reconcile(*solve_either(replace(wide, scatter=scatter), *first), first)
        if is_possible(*made[:2]):
            weight = max(searched, _weight(made, problem))  # what ties with the best makes it no less probable
            found.append((weight - rare, (*made[:3], replace(made[3], belts=weight - known))))
    found.sort(key=lambda one: -one[0])
    return [made for weight, made in found if weight > found[0][0] - GAIN] or [massless]


def _held(explanations: Sequence[_Explained]) -> _Explained:
    """The first explanation, whose uncertainty of K* holds that of the others.

    It fits if massless specimens among them do, too: masses of the rig are a cause that is as probable. A rod beside an
    unstated mass is no such cause, for a belt is nearly the same.
    """
    problem, solution, outlier, misfit = explanations[0]
    solution = solution.doubted([other for _, other, *_ in explanations], np.ones(len(explanations)))
    contradicted = next((other for one, *_, other in explanations if not (other.fits or one.shared.has_belts)), misfit)
    misfit = replace(misfit, fits=contradicted.fits, candidates=contradicted.candidates, tied=contradicted.tied)
    return problem, solution, outlier, misfit


def _massless(problem: Problem, start: ComplexArray, *, hasty: bool) -> _Explained:
    """The tests explained by specimens without inertia; if `hasty`, one that is far from them is not reconciled."""
    as_stated = np.zeros(len(problem.shared))
    gross = gross_errors(problem.observed, problem.shared)
    problem = replace(problem, scatter=robust_scatter(problem, deviations(problem, as_stated, start)))
    if gross:
        problem = without_rig(problem, as_stated, start, 1.0)
    problem, solution = solve_either(problem, start)
    if hasty and not gross and is_vain(problem, solution):
        return problem, solution, np.ones(problem.conditions.label.size), _UNASKED
    return reconcile(problem, solution, (start, as_stated), gross)


def _is_enough(found: _Explained, bodies: Mapping[str, Body]) -> bool:
    """Whether massless specimens explain the tests as stated, so that none is likely to have a mass."""
    problem, solution, outlier, misfit = found
    asked = misfit.specimens or misfit.unsteady or misfit.inflation > 1 or np.any(outlier > 1)
    if not problem.conditions.count:
        return True
    if not misfit.fits or asked or misfit.scatter > _SCATTERS:
        return False
    if misfit.scatter:  # as specimens do, or as a small mass makes them do
        return not explains_more(problem, solution, bodies)
    return linear_gain(problem, solution, bodies) < GAIN


def _weight(found: _Explained, plain: Problem) -> float:
    """Evidence of an explanation; each contradiction of the statement is as rare as what it takes to be asked for."""
    problem, solution, outlier, misfit = found
    contradicted = len(misfit.conflicts) + len(misfit.added)
    return weight_of(problem, solution, plain, int(np.count_nonzero(outlier > 1))) - GAIN * contradicted


def _distinct(added: FloatArray, std: FloatArray) -> tuple[FloatArray, np.ndarray, FloatArray]:
    """The distinct added masses [kg], the index of each test's mass (-1 for none), and their standard uncertainties."""
    masses, index = np.unique(added, return_inverse=True)
    spread = np.zeros(masses.size)
    np.maximum.at(spread, index, std)
    real = masses != 0
    number = np.where(real, np.cumsum(real) - 1, -1)
    return masses[real], number[index], spread[real]


def _unstated_errors(crosstalk: FloatArray, place: FloatArray, part: np.ndarray) -> list[ChannelError]:
    """Errors of the channels that a campaign seldom states: gains that drift or step during the run, and cross-talk.

    Cross-talk has its shape from `reconcile.with_cross_talk`.
    """
    errors = []
    steps = np.unique(part)[1:].tolist()
    for channel, symbol in enumerate(SYMBOLS.values()):
        errors.append(ChannelError(Source(Kind.GAIN_DRIFT, symbol), "1", channel, 0.0, place + 0j))
        step = Source(Kind.GAIN_STEP, symbol)
        errors += [ChannelError(step, "1", channel, 0.0, (part >= first) + 0j) for first in steps]
        for other in SYMBOLS.values():
            if other != symbol:
                source = Source(Kind.CROSSTALK, f"{other} in {symbol}")
                std = float(crosstalk[channel])
                errors.append(ChannelError(source, "1", channel, std, np.zeros(place.size, dtype=complex)))
    return errors


def _places(specimen: np.ndarray, time: FloatArray) -> FloatArray:
    """Place of each test in the run, in lengths of the run, from the mean of its specimen (N,) [1]."""
    length = float(np.ptp(time)) if time.size else 0.0
    if not length > 0:
        return np.zeros(time.size)
    mean = np.bincount(specimen, time) / np.bincount(specimen)
    return np.asarray((time - mean[specimen]) / length)


def parts_of_run(specimen: np.ndarray, time: FloatArray) -> np.ndarray:
    """Number of the part of the run of each test's specimen (N,), of `PARTS_OF_RUN` with equally many tests."""
    part = np.zeros(time.size, dtype=int)
    for number in np.unique(specimen):
        own = np.flatnonzero(specimen == number)
        rank = np.searchsorted(np.sort(time[own]), time[own])  # tests of one time are together
        part[own] = PARTS_OF_RUN * rank // own.size
    return part


#: Least relative uncertainty of a channel or of the rig in the comparison of routes.
_LEAST = 1e-4


def closed_form_start(
    observed: Observed, conditions: JointConditions, shared: Shared, channels: ChannelUncertainty
) -> ComplexArray:
    """K* of each condition [N/m], from the stated rig and the amplitudes as measured."""
    rig, omega = shared.rig, observed.omega
    added = observed.added(shared.masses)
    impedance = np.asarray(rig.impedance(omega, added))
    f1, v1, v2 = np.where(observed.amplitudes == 0, np.nan, observed.amplitudes).T
    f1 = f1 - 1j * omega * rig.input_mass * v1
    u_f, u_1, u_2 = np.hypot(np.hypot(channels.gain, channels.phase), _LEAST)
    spread = np.abs(rig.impedance_gradient(omega, added)[:, :-1]) * rig.uncertainties
    with np.errstate(divide="ignore", invalid="ignore"):
        u_z = np.sqrt(np.sum(spread**2, axis=1)) / np.abs(impedance) + _LEAST
        routes = ("relative", "mobility", "transmissibility")
        by_route = np.stack([stiffness_by(route, (f1, v1, v2), impedance, omega) for route in routes])
        apart, tyre = np.abs(v1 - v2), np.abs(v1 / f1 - 1 / impedance)
        off = np.stack(
            [
                np.sqrt(u_f**2 + (np.abs(v1) * u_1 / apart) ** 2 + (np.abs(v2) * u_2 / apart) ** 2),
                np.sqrt(np.abs(v1 / f1) ** 2 * (u_f**2 + u_1**2) + np.abs(u_z / impedance) ** 2) / tyre,
                np.sqrt(u_z**2 + (u_1**2 + u_2**2) * np.abs(v1 / (v1 - v2)) ** 2),
            ]
        )
    off = np.where(np.isfinite(off) & np.isfinite(by_route) & (by_route != 0), off, np.inf)
    best = np.argmin(off, axis=0)
    rows = np.arange(omega.size)
    weight = 1 / np.minimum(off[best, rows], 1e6) ** 2
    value = np.where(np.isfinite(by_route[best, rows]), by_route[best, rows], 1e5)
    return conditions.sum(value * weight) / conditions.sum(weight)
