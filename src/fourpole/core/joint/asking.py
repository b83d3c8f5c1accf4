r"""What the tests ask for: components that are larger than stated, chosen by the evidence of all tests.

Every component of `fourpole.core.components` has a normal prior. A group of components is raised by the factor tau if
the logarithm of the evidence rises by more than `GAIN`; groups that explain the tests nearly as well are raised with
it, so that the uncertainties hold them all. The evidence of a group with derivatives J, after K* is projected out, is

.. math:: \log Z = -\chi^2/2 - \tfrac12 \log\det(1 + \tau^2 J^T P J) - \tfrac12 \log\tau.

References
----------
D. J. C. MacKay, "Bayesian interpolation", Neural Computation 4 (1992), 415-447 (evidence by Laplace's method).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import chain

import numpy as np

from fourpole.core.arrays import ByValue, FloatArray
from fourpole.core.components import BEGINS, Component, component
from fourpole.core.joint.misfit import NEGLIGIBLE, is_unlikely
from fourpole.core.joint.scatter import Deviations, deviations, scatter_of, squares, strange_conditions
from fourpole.core.joint.shared import STEPS, Shared, SharedParameter
from fourpole.core.joint.solve import MUCH, Problem, Solution, reduced, solve_either, sweep
from fourpole.core.sources import PARTS, Kind, Role, Source

#: Least gain in the logarithm of the evidence for which a group is raised.
GAIN = 5.0
#: Groups whose gain is within this of the best are raised with it, if it is enough by itself or almost the best.
_TIE, _ALMOST = 10.0, 2.0
#: Number of groups that are tried in earnest in one round, and of the first steps of each.
_TRIED, _STEPS = 4, 15
#: A search goes on if it leaves no more than this share of the objective, or no more than `MUCH` for each test.
_MOST_LEFT = 0.1
#: Factors that are tried at first: from this to the largest, so many.
_SMALLEST, _FACTORS = 0.3, 30
#: Number of conditions that are set aside by themselves.
_WORST = 3
#: Rare errors need this much more evidence.
_RARE = {Kind.CROSSTALK: 3.0, Kind.GAIN_DRIFT: 3.0, Kind.GAIN_STEP: 5.0, Kind.STEP: 5.0}
#: Step of the logarithm of the resonances at which a mode of a frame is looked for, how far beyond the tests, as a
#: factor, and the evidence that it needs: about the logarithm of their number.
_STEP, _AROUND, _MODE = 0.1, 2.0, 3.0
#: F1 in V1 acts as a compliance of the specimen does, and so does a fixture, for which rigid blocks alone ask.
_ALIKE = Source(Kind.CROSSTALK, "F1 in V1")
_SERIES = Source(Kind.FIXTURE, "V1")
#: A group may be found larger than its bound by this factor.
_BEYOND = 2.0
#: The value of the rig that acts as an unstated part does, in all tests.
TWINS = {
    "spring": Source(Kind.RIG_VALUE, "preload_stiffness"),
    "loss": Source(Kind.RIG_VALUE, "preload_loss_factor"),
    "input": Source(Kind.RIG_VALUE, "input_mass"),
}
#: Largest share by which a stated value of the rig, or a mass, can be wrong.
_LARGEST_SHARE = 0.5
#: Largest factor of the standard uncertainty of all noise: recordings know their noise no worse.
NOISE_IN_DOUBT = 2.0


@dataclass(frozen=True, eq=False)
class Group(ByValue):
    """Components that stand and fall together.

    Attributes
    ----------
    name : str
        Its name, as texts of sources are.
    parameters : tuple of SharedParameter
        Its values, whose `std` is the size that they have for a factor of 1.
    largest : float [1]
        Largest factor.
    """

    name: str
    parameters: tuple[SharedParameter, ...]
    largest: float

    @property
    def of_specimen(self) -> bool:
        """Whether it belongs to the specimens or to the noise, and neither to the rig nor to a sensor."""
        return all(parameter.source.role in (Role.SPECIMEN, Role.TEST) for parameter in self.parameters)

    @property
    def is_mode(self) -> bool:
        """Whether it is a mode of a frame, one of many that are possible."""
        first = self.parameters[0]
        return first.source.kind is Kind.UNSTATED and first.index > 0

    @property
    def cost(self) -> float:
        """Evidence that it needs besides."""
        return _MODE if self.is_mode else _RARE.get(self.parameters[0].source.kind, 0.0)


def _of_tests(kind: Kind, size: float, largest: float) -> Group:
    """A group without a column: a random number of each test."""
    return Group(kind.name.lower(), (SharedParameter(Source(kind), "1", 0, 0.0, size),), largest)


#: Scatter of K* from test to test, a relative error of each frequency, and the factor of all noise.
SCATTER = _of_tests(Kind.SCATTER, 1e-3, 30.0)
UNSTEADY = _of_tests(Kind.UNSTEADY, 1e-5, 10.0)
NOISE = _of_tests(Kind.NOISE, 1.0, NOISE_IN_DOUBT)
#: Conditions whose tests do not go together, as where labels were exchanged; its factor is their number.
STRANGE = _of_tests(Kind.STRANGE, 1.0, np.inf)


@dataclass(frozen=True, eq=False)
class Trial(ByValue):
    """A group raised by a factor: the gain of evidence, the problem and its solution."""

    group: Group
    factor: float
    gain: float
    problem: Problem
    solution: Solution


def groups_of(problem: Problem, stated: Shared) -> list[Group]:
    """All groups that the tests of a problem may ask for; `stated` has the shared values as stated."""
    columns: dict[str, list[tuple[SharedParameter, float]]] = {}
    for name, parameter, largest in chain(*(of(problem, stated) for of in (_stated, _of_channels, _absent))):
        columns.setdefault(name, []).append((parameter, largest / parameter.std))
    return [
        Group(name, tuple(parameter for parameter, _ in listed), max(min(most for _, most in listed), 1.0))
        for name, listed in columns.items()
    ]


#: Name of the group of a value, the value with its size for a factor of 1, and its largest size.
_Column = tuple[str, SharedParameter, float]


def _stated(problem: Problem, stated: Shared) -> Iterator[_Column]:
    """The values of the rig, with parts that nobody stated and that act as they do, and the masses."""
    bound = component(Kind.UNSTATED).bound
    hidden = {TWINS[part].of: bound * whole for part, whole in wholes(problem).items() if part in TWINS}
    hidden["preload_damping"] = bound * stated.rig.critical_damping
    for parameter in stated.parameters:
        if parameter.source.role in (Role.RIG, Role.MASS):
            largest = _LARGEST_SHARE * abs(parameter.stated) or np.inf
            if (part := hidden.get(parameter.source.of)) is not None:
                largest = max(part, _LARGEST_SHARE * abs(parameter.stated))
            yield parameter.source.text, parameter, max(largest, parameter.std)


def _of_channels(problem: Problem, stated: Shared) -> Iterator[_Column]:
    """The errors of the channels, and the drifts and blocks of the specimens."""
    std = {parameter.key: parameter.std for parameter in stated.parameters}
    for index, source in enumerate(problem.errors):
        row = _row(source)
        unit = std.get((source, index)) or row.std or BEGINS * row.bound
        name = f"{row.group} {source.of}" if source.role is Role.MOUNTING else source.text
        name += f" {index}" if source.kind is Kind.GAIN_STEP else ""
        centre = 1.0 if source.kind is Kind.GAIN else 0.0
        yield name, SharedParameter(source, row.unit, index, centre, unit), row.bound
    for parameter in problem.specimens:
        row = component(parameter.source.kind)
        unit = std.get(parameter.key) or row.std or BEGINS * row.bound
        name = f"{row.group} {parameter.index}" if parameter.source.kind in STEPS else row.group
        yield name, replace(parameter, std=unit), row.bound


def _absent(problem: Problem, stated: Shared) -> Iterator[_Column]:
    """The effect of the amplitude, and the parts of the rig that nobody stated."""
    if np.any(problem.observed.deflection):
        source, bound = Source(Kind.AMPLITUDE), component(Kind.AMPLITUDE).bound
        yield source.text, SharedParameter(source, "1", 0, 0.0, BEGINS * bound), bound
    has = {parameter.source for parameter in stated.parameters}
    for part, whole in wholes(problem).items():
        source, bound = Source(Kind.UNSTATED, part), component(Kind.UNSTATED).bound * whole
        if TWINS.get(part) not in has:
            yield source.text, SharedParameter(source, PARTS[part], 0, 0.0, BEGINS * bound), bound
    for index, frequency in enumerate(_resonances(problem), 1):
        bound = component(Kind.UNSTATED).bound / problem.shared.rig.preload_stiffness
        sizes = {"frame": (0.0, BEGINS * bound), "frame resonance": (frequency, _STEP * frequency),
                 "frame damping": (0.0, 1.0)}  # fmt: skip
        for part, (centre, std) in sizes.items():
            source = Source(Kind.UNSTATED, part)
            largest = np.inf if source.is_shape else bound
            yield f"frame at {frequency:g} Hz", SharedParameter(source, PARTS[part], index, centre, std), largest


def _resonances(problem: Problem) -> FloatArray:
    """Frequencies [Hz] at which a mode of a frame may be."""
    frequency = problem.observed.omega / (2 * np.pi)
    low, high = float(frequency.min()) / _AROUND, float(frequency.max()) * _AROUND
    return np.geomspace(low, high, round(np.log(high / low) / _STEP) + 1) if frequency.size > 1 else np.array([])


def _row(source: Source) -> Component:
    """The row of the table for an error of a channel; a calibrated response has the one of gain or phase."""
    plain = {Kind.RESPONSE_GAIN: Kind.GAIN, Kind.RESPONSE_PHASE: Kind.PHASE}
    row = component(plain.get(source.kind, source.kind))
    return replace(row, std=1.0, bound=30.0) if source.kind in plain else row


def wholes(problem: Problem) -> dict[str, float]:
    """The size with which each unstated part of the rig is compared, in its unit."""
    rig, observed = problem.shared.rig, problem.observed
    mass, spring = rig.moving_mass, rig.preload_stiffness
    force = float(np.max(spring / observed.omega * np.abs(observed.amplitudes[:, 2])))  # that of the spring
    return {"mass": mass, "spring": spring, "frame": 1 / spring, "loss": 1.0, "friction": force, "input": mass}


def raised(problem: Problem, z: FloatArray, group: Group, factor: float) -> tuple[Problem, FloatArray]:
    """The problem with a group raised by a factor, and the same shared values in its units."""
    if group is SCATTER:
        return replace(problem, scatter=factor * SCATTER.parameters[0].std), z
    listed, z = list(problem.shared.parameters), z.copy()
    places = {parameter.key: place for place, parameter in enumerate(listed)}
    for parameter in group.parameters:
        place, std = places.get(parameter.key), parameter.std * (1.0 if parameter.source.is_shape else factor)
        if place is None:
            listed.append(replace(parameter, std=std))
            z = np.append(z, 0.0)
        else:
            wider = float(np.hypot(listed[place].std, std))
            z[place] *= listed[place].std / wider
            listed[place] = replace(listed[place], std=wider)
    return replace(problem, shared=replace(problem.shared, parameters=tuple(listed))), z


def trials(
    problem: Problem, solution: Solution, groups: Sequence[Group], outlier: FloatArray, with_scatter: Solution
) -> list[Trial]:
    """The groups that explain the tests best, each raised and solved for by itself; the best first.

    Scatter of K* that is left out may drive a search far away, so that its trial begins at the solution `with_scatter`.
    """
    tried = [*_screened(problem, solution, groups)][:_TRIED]
    made = [_trial(problem, solution, group, factor, outlier) for _, group, factor in tried]
    made += _of_repeats(problem, solution, groups, outlier, with_scatter)
    return sorted((trial for trial in made if trial is not None), key=lambda trial: -trial.gain)


def _screened(problem: Problem, solution: Solution, groups: Sequence[Group]) -> Iterator[tuple[float, Group, float]]:
    """Groups with their gain by the linear model and the factor that gives it, the largest gain first."""
    alike = (_ALIKE,) if problem.observed.rigid.any() else (_ALIKE, _SERIES)
    sources = [group.parameters[0].source for group in groups]
    groups = [group for group, source in zip(groups, sources, strict=True)
              if source.role is not Role.TEST and source not in alike]  # fmt: skip
    extra = [parameter for group in groups for parameter in group.parameters]
    p, e = len(problem.shared), len(extra)
    triangle = widened(problem, solution, extra, slopes=False)[1]
    block, target = triangle[p : p + e, p : p + e], triangle[p : p + e, -1]
    first, gains = 0, []
    for group in groups:
        columns = block[:, first : first + len(group.parameters)]
        first += len(group.parameters)
        gain, factor = gain_of(columns, target, group)
        if gain > (0.0 if problem.scatter else GAIN - _ALMOST):
            gains.append((gain, group, factor))
    best: dict[tuple[Source, int], tuple[float, Group, float]] = {}  # one mode of a frame is enough at a time
    for row in sorted(gains, key=lambda row: -row[0]):
        source, index = row[1].parameters[0].key
        best.setdefault((source, 0 if row[1].is_mode else index), row)
    yield from best.values()


def widened(
    problem: Problem, solution: Solution, extra: Sequence[SharedParameter], *, slopes: bool = True
) -> tuple[Problem, FloatArray, FloatArray]:
    """The problem with further shared values of size 0, its triangle at a solution, and the slope of log K* or 0."""
    e = len(extra)
    wide = replace(problem, shared=replace(problem.shared, parameters=(*problem.shared.parameters, *extra)))
    z = np.append(solution.z, np.zeros(e))
    triangle, _, _, own = reduced(wide, z, solution.stiffness, solution.slope, e, slopes=slopes)
    return wide, triangle, own[1]


def most_explained(problem: Problem, solution: Solution, groups: Sequence[Group]) -> float:
    """Objective that the linear model leaves at a solution, if all groups have any size."""
    extra = [parameter for group in groups for parameter in group.parameters]
    return float(widened(problem, solution, extra, slopes=False)[1][-1, -1] ** 2)


def gain_of(columns: FloatArray, target: FloatArray, group: Group) -> tuple[float, float]:
    """Largest gain of a group by the linear model, and its factor."""
    values, vectors = np.linalg.eigh(columns.T @ columns)
    values, drawn = np.maximum(values, 0.0), (vectors.T @ (columns.T @ target)) ** 2
    factors = np.geomspace(_SMALLEST, max(group.largest, 2 * _SMALLEST), _FACTORS)
    square = (factors**2)[:, None]
    gain = 0.5 * np.sum(drawn * square / (1 + square * values) - np.log1p(square * values), axis=1)
    gain -= 0.5 * np.log(np.maximum(factors, 1.0)) + group.cost
    best = int(np.argmax(gain))
    return float(gain[best]), float(factors[best])


def _scatter(problem: Problem, departures: Deviations, outlier: FloatArray) -> float:
    """Scatter of K* that repeats show, in units of its group; 0 where they show none."""
    return min(scatter_of(problem, departures, outlier == 1) / SCATTER.parameters[0].std, SCATTER.largest)


def _of_repeats(
    problem: Problem, solution: Solution, groups: Sequence[Group], outlier: FloatArray, start: Solution
) -> list[Trial | None]:
    """What repeats may show, as trials: scatter of all tests, and strange conditions; or that of each specimen."""
    made, scattered, each = list[Trial | None](), None, None
    if any(group is SCATTER for group in groups):
        departures = deviations(problem, start.z, start.stiffness)
        if scatter := _scatter(problem, departures, outlier):
            scattered = _trial(problem, solution, SCATTER, scatter, outlier, start)
            each = _uneven(problem, solution, departures, outlier, start)
            made.append(scattered)
    if any(group is STRANGE for group in groups):
        made.append(_strange(problem, solution, scattered, outlier))
    if each is not None and all(other is None or other.gain < each.gain for other in made):
        return [each]
    return made


def _uneven(
    problem: Problem, solution: Solution, departures: Deviations, outlier: FloatArray, start: Solution
) -> Trial | None:
    """Scatter of K* of each specimen by itself, as a trial; None where there is one specimen, or none scatters."""
    if len(problem.names) < 2:
        return None
    alone = [problem.observed.specimen == at for at in range(len(problem.names))]
    factors = np.array([_scatter(problem.part(rows), departures.part(rows), outlier[rows]) for rows in alone])
    apart, after = followed(problem.with_scatter(factors * SCATTER.parameters[0].std), start, start.z)
    gain = after.evidence - solution.evidence + volume(apart, solution) - volume(problem, solution)
    gain -= 0.5 * float(np.sum(np.log(np.maximum(factors, 1.0)))) + np.log(factors.size)
    return Trial(SCATTER, float(factors.max()), float(gain), apart, after) if after.converged else None


def is_uneven(trial: Trial) -> bool:
    """Whether a trial has the scatter of each specimen by itself."""
    return trial.group is SCATTER and not trial.problem.scatter


def _strange(problem: Problem, solution: Solution, scattered: Trial | None, outlier: FloatArray) -> Trial | None:
    """Conditions whose tests do not go together as a trial; None if those of all conditions go together as well.

    One such condition bends the solution, so that others look strange. Each of the worst is set aside by itself, or all
    conditions scatter, before the tests are compared.
    """
    conditions, used = problem.conditions, outlier == 1
    departures = deviations(problem, solution.z, solution.stiffness)
    whole = conditions.sum(np.where(used, squares(conditions, departures, 0.0), 0.0))
    dof = 2.0 * float(np.sum(np.maximum(conditions.sum(used.astype(float)) - 1, 0)))
    if not is_unlikely(float(whole.sum()), dof):
        return None
    starts = [(np.eye(conditions.count)[worst], *_apart(problem, solution, np.eye(conditions.count)[worst]))
              for worst in np.argsort(-whole)[:_WORST].tolist()]  # fmt: skip
    if scattered is not None:
        starts.append((np.zeros(conditions.count), scattered.problem, scattered.solution))
    made = []
    for aside, wide, there in starts:
        departures = deviations(replace(wide, apart=problem.apart), there.z, there.stiffness)
        own = strange_conditions(problem, departures, used)
        for worst in np.flatnonzero(aside).tolist():
            size = np.sqrt(np.mean(departures.value[conditions.label == worst] ** 2))
            own[worst] = own[worst] or size
        wider, after = _apart(problem, there, own)
        gain = after.evidence - solution.evidence + volume(wider, solution) - volume(problem, solution)
        gain -= np.count_nonzero(own) * np.log(conditions.count)
        if after.converged and own.any():
            made.append(Trial(STRANGE, float(np.count_nonzero(own)), float(gain), wider, after))
    return max(made, key=lambda trial: trial.gain, default=None)


def _apart(problem: Problem, solution: Solution, own: FloatArray) -> tuple[Problem, Solution]:
    """The problem with a scatter `own` (c,) of each condition, and its solution."""
    apart = np.append(own, 0.0)[problem.conditions.label]
    wider = replace(problem, apart=np.hypot(apart, 0.0 if problem.apart is None else problem.apart))
    return followed(wider, solution, solution.z)


def followed(problem: Problem, before: Solution, z: FloatArray) -> tuple[Problem, Solution]:
    """The solution from one before; a search that leaves most of a large misfit is not followed to its end."""
    problem, after = solve_either(problem, before.stiffness, z, _STEPS, before.slope, rough=True)
    if after.converged or after.objective > max(_MOST_LEFT * before.objective, MUCH * problem.observed.omega.size):
        return problem, after
    return solve_either(problem, after.stiffness, after.z, slope=after.slope, rough=True)


def _trial(
    problem: Problem,
    solution: Solution,
    group: Group,
    factor: float,
    outlier: FloatArray,
    start: Solution | None = None,
) -> Trial | None:
    """A group raised and solved for; None if its size is impossible or the search fails.

    Scatter that was raised before may have been the group: what is left of it counts.
    """
    start = start or solution
    wider, z = raised(problem, start.z, group, factor)
    wider, after = followed(wider, start, z)
    gain = -0.5 * np.log(max(factor, 1.0)) - group.cost
    if group is not SCATTER and problem.scatter:
        departures = deviations(wider, after.z, after.stiffness)
        less = min(_scatter(wider, departures, outlier) * SCATTER.parameters[0].std, problem.scatter)
        wider, after = followed(replace(wider, scatter=less), after, after.z)
    if wider.scatter != problem.scatter:
        gain += volume(replace(problem, scatter=wider.scatter), solution) - volume(problem, solution)
    gain += after.evidence - solution.evidence
    possible = after.converged and np.isfinite(gain) and _possible(group, wider, after.z)
    return Trial(group, factor, float(gain), wider, after) if possible else None


def volume(problem: Problem, solution: Solution) -> float:
    """The volume that K* of all conditions has at the values of a solution."""
    return sweep(problem, solution.z, solution.stiffness, solution.slope).volume


def _possible(group: Group, problem: Problem, z: FloatArray) -> bool:
    """Whether a group is no larger than it can be, no part of a rig but its mass is negative, and the group matters."""
    shared = problem.shared
    sizes = dict(zip((row.key for row in shared.parameters), z * shared.std, strict=True))
    own = [(sizes.get(row.key, 0.0), row) for row in group.parameters if not row.source.is_shape]
    if group.parameters[0].source.role is Role.TEST:
        return True
    return (
        all(abs(size) <= _BEYOND * group.largest * row.std for size, row in own)
        and not any(size < 0 for size, row in own if row.source.kind is Kind.UNSTATED and row.source.of != "mass")
        and not all(is_negligible(problem, row, size) for size, row in own)
    )


def is_negligible(problem: Problem, parameter: SharedParameter, size: float) -> bool:
    """Whether an error of a channel or a part of the rig is smaller than any laboratory could state it."""
    if parameter.source.of_channel:
        return bool(abs(size) * np.abs(problem.observed.turns[:, parameter.index]).max() < NEGLIGIBLE)
    whole = wholes(problem).get(parameter.source.of)
    return whole is not None and abs(size) < NEGLIGIBLE * whole


def tie(tried: Sequence[Trial]) -> list[Trial]:
    """The trials that are raised together: the best and those that explain the tests nearly as well; or none."""
    if not tried or tried[0].gain <= GAIN:
        return []
    best = tried[0].gain
    least = max(best - _TIE, min(GAIN, best - _ALMOST))
    return [trial for trial in tried if trial.gain >= least]
