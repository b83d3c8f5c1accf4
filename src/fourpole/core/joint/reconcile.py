"""Reconcile the statement with the tests: strange tests, what the tests ask for, and whether the rest is white."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import chain
from typing import Any

import numpy as np

from fourpole.core.arrays import ComplexArray, FloatArray
from fourpole.core.joint.asking import (
    GAIN,
    NOISE,
    NOISE_IN_DOUBT,
    SCATTER,
    STRANGE,
    UNSTEADY,
    Group,
    Trial,
    followed,
    groups_of,
    is_negligible,
    is_uneven,
    most_explained,
    raised,
    tie,
    trials,
    volume,
)
from fourpole.core.joint.misfit import NEGLIGIBLE, Candidate, Residuals, cause_of, is_unlikely, largest_part, residuals
from fourpole.core.joint.model import cholesky_qr, projected
from fourpole.core.joint.scatter import root_of, scatter_of
from fourpole.core.joint.shared import Shared, SharedParameter
from fourpole.core.joint.solve import MUCH, Problem, Solution, solve
from fourpole.core.joint.specimens import Misfit, State, restore_tests, settle_scatter, weaken_strange_tests
from fourpole.core.phasor import SYMBOLS
from fourpole.core.sources import Kind, Role, Source

#: A group of the rig or of a sensor contradicts its statement if it is larger than this many standard uncertainties.
_CONFLICT = 3.0
#: Least fraction of a squared size that widens a statement; it applies where a cause is only just found.
_LEAST_LOSS = 1e-4
#: An unsteady drive is the cause of the misfit if it explains more than this share of it.
_MOSTLY = 0.7
#: Degrees of freedom of the prior for the noise of one test about the noise of all tests.
_PRIOR_DOF = 4.0
#: Chi-square below which there is no misfit in any test: that of the exact phasors of a plan is round-off.
_NOTHING = 1e-6
#: What is not white has no cause, unless the causes leave less than this share of the misfit.
_LITTLE = 0.01
#: Noise is as large as what is left of the tests if chi-square is at least this share of its degrees of freedom.
_SETTLED = 0.95
#: Largest number of rounds of asking.
_MOST_ROUNDS = 4


def reconcile(
    problem: Problem, solution: Solution, start: tuple[ComplexArray, FloatArray], gross: Sequence[Candidate] = ()
) -> tuple[Problem, Solution, FloatArray, Misfit]:
    """Weaken strange tests, raise what the tests ask for, and say whether chance explains the rest.

    Parameters
    ----------
    problem, solution : Problem, Solution
        The tests, and their solution with the statement unchanged.
    start : (c,) complex array [N/m], (p,) float array
        First values of K* of each condition, and of the shared values.
    gross : sequence of Candidate
        Gross errors of the statement. If there are any, no smaller cause is looked for.

    Returns
    -------
    problem, solution : Problem, Solution
        The problem with the weights and priors of the last round, and its solution.
    outlier : (N,) float array [1]
        Factor by which the variance of each test was enlarged as an outlier; 1 for the others.
    misfit : Misfit
        Agreement of the statement with the tests, and the size of each remedy.
    """
    state = State(problem, solution, *start, np.ones(problem.observed.omega.size))
    if not gross and problem.scatter == 0 and solution.objective < _NOTHING:
        return problem, solution, state.outlier, _chi2(state)
    weaken_strange_tests(state)
    if gross:
        misfit = replace(_chi2(state), fits=False, rig_error=1.0, candidates=tuple(gross), tied=len(gross))
        return state.problem, state.solution, state.outlier, misfit
    state.problem = with_cross_talk(state.problem, state.solution)
    crossed = any(parameter.source.kind is Kind.CROSSTALK for parameter in problem.shared.parameters)
    scattered = state.solution
    if state.problem.scatter or crossed:
        quiet = replace(state.problem, scatter=0.0)
        state.problem, state.solution = followed(quiet, scattered, scattered.z)
    misfit = _asked(state, problem.shared, scattered)
    return state.problem, state.solution, state.outlier, misfit


def is_vain(problem: Problem, solution: Solution) -> bool:
    """Whether the tests are far from a solution, and all that they could ask for together leaves them so."""
    most = MUCH * problem.conditions.label.size
    if solution.objective < most:
        return False
    crossed = with_cross_talk(problem, solution)
    return most_explained(crossed, solution, groups_of(crossed, problem.shared)) > most


def with_cross_talk(problem: Problem, solution: Solution) -> Problem:
    """The problem with the shape of each cross-talk, from the amplitudes of the model, which have no noise.

    The unit of a cross-talk is the root mean square of the channel that it disturbs over that of its source.
    """
    observed, turns = problem.observed, problem.observed.turns.copy()
    present = np.abs(observed.amplitudes) > 0
    amplitudes = problem.columns("predicted", solution.z, solution.stiffness)
    square = np.sum(np.where(present, np.abs(amplitudes) ** 2, 0.0), axis=0) / np.maximum(present.sum(axis=0), 1)
    scaled = amplitudes / np.sqrt(np.where(square > 0, square, 1.0))
    symbols = list(SYMBOLS.values())
    for index, source in enumerate(problem.errors):
        if source.kind is Kind.CROSSTALK:
            other, channel = (symbols.index(symbol) for symbol in source.of.split(" in "))
            turns[:, index] = np.nan_to_num(scaled[:, other] / scaled[:, channel], posinf=0.0, neginf=0.0)
    return replace(problem, observed=replace(observed, turns=turns))


def _asked(state: State, stated: Shared, scattered: Solution) -> Misfit:
    """Raise what the tests ask for, and then judge what is left; `scattered` is the solution with scatter of K*."""
    misfit, groups, causes = Misfit(), [*groups_of(state.problem, stated), SCATTER, STRANGE, UNSTEADY, NOISE], []
    left: list[tuple[Solution, float]] = []  # before each group was raised, and what raising it gained
    before: Misfit | None = None
    for _ in range(_MOST_ROUNDS):
        tried = trials(state.problem, state.solution, groups, state.outlier, scattered)
        tried += [trial for trial in _of_noise(state) if any(trial.group is group for group in groups)]
        together = tie(sorted(tried, key=lambda trial: -trial.gain))
        if not together:
            break
        if not all(trial.group.of_specimen for trial in together):
            before = before or _chi2(state)
            named = ((trial.group, _cause(trial, state.solution)) for trial in together)
            causes.append(
                [cause for group, cause in named if abs(cause.size) <= group.largest * group.parameters[0].std]
            )
        left.append((state.solution, together[0].gain))
        misfit = _raise(state, together, misfit)
        scattered = state.solution
        groups = [group for group in groups if not any(trial.group is group for trial in together)]
    if any(group is STRANGE for group in groups):  # no condition was set aside
        restore_tests(state)
    misfit = _settled(state, misfit)
    misfit = replace(misfit, **_raised(state, stated))
    before = before or _chi2(state)
    state.solution = _doubted(state.solution, left, [] if together else tried)
    return _judged(state, replace(misfit, chi2=before.chi2, dof=before.dof), causes)


def _doubted(solution: Solution, left: Sequence[tuple[Solution, float]], tried: Sequence[Trial]) -> Solution:
    """The solution with the doubt by those that it was chosen over, by the odds of their evidence.

    These are what was left behind, with what it had less, and what the tests neither ask for nor exclude.
    """
    odds = np.exp([trial.gain - GAIN for trial in tried])
    less = np.exp([GAIN - gain for _, gain in left])
    weights = np.concatenate([less / (1 + less), odds / (1 + odds.sum())])
    return solution.doubted([*(one for one, _ in left), *(trial.solution for trial in tried)], weights)


def _raise(state: State, together: Sequence[Trial], misfit: Misfit) -> Misfit:
    """Raise the groups of a tie together, and solve."""
    problem, z = state.problem, state.solution.z
    for trial in together:
        if trial.group is NOISE:
            problem = _with_noise(problem, residuals(state.problem, state.solution), trial.factor**2)
            misfit = replace(misfit, inflation=trial.factor)
        elif trial.group is STRANGE:
            before = 0.0 if problem.apart is None else problem.apart
            apart = np.zeros(problem.conditions.label.size) if trial.problem.apart is None else trial.problem.apart
            weight = np.where(apart > before, np.maximum((apart / NEGLIGIBLE) ** 2, 2.0), 1.0)
            state.outlier = state.outlier * weight
            problem = replace(problem, apart=trial.problem.apart)
        elif is_uneven(trial):
            problem = replace(problem, apart=trial.problem.apart, scatter=0.0)
            misfit = replace(misfit, scatter=trial.factor * SCATTER.parameters[0].std)
        elif trial.group is UNSTEADY:
            problem = problem.reweighted(trial.problem.observed.whiten)
            misfit = replace(misfit, unsteady=trial.factor * UNSTEADY.parameters[0].std)
        else:
            # A stated value loses its hold smoothly from the least gain on.
            role = trial.group.parameters[0].source.role
            stated = role in (Role.RIG, Role.MASS, Role.CHANNEL) and _has(problem, trial.group)
            loss = max(1 - GAIN / trial.gain, _LEAST_LOSS) if stated else 1.0
            problem, z = raised(problem, z, trial.group, trial.factor * float(np.sqrt(loss)))
    state.solution = replace(state.solution, z=z)
    state.solve(problem)
    if any(trial.group.parameters[0].source.kind is Kind.AMPLITUDE for trial in together):
        state.solve(_bent(state))
    if state.problem.scatter:  # what was raised explains a part of it
        _settle(state)
    return misfit


def _bent(state: State) -> Problem:
    """The problem with the scatter that a bend of log K* over the logarithm of the deflection would be.

    A softening that ends at a plateau has a second derivative of the size of the first.
    """
    bend = 0.5 * abs(state.problem.shared.by_amplitude_at(state.solution.z)) * state.problem.observed.deflection**2
    return replace(state.problem, apart=np.hypot(bend, 0.0 if state.problem.apart is None else state.problem.apart))


def _has(problem: Problem, group: Group) -> bool:
    """Whether a group is among the shared values already."""
    there = {parameter.key for parameter in problem.shared.parameters}
    return all(parameter.key in there for parameter in group.parameters)


def _of_noise(state: State) -> list[Trial]:
    """Larger noise of all tests, and an unsteady drive, as trials; none where the noise of the recordings suffices."""
    chi2, dof = _whole(state)
    if not is_unlikely(chi2, dof):
        return []
    square = min(chi2 / dof, NOISE_IN_DOUBT**2)
    gain = 0.5 * (chi2 * (1 - 1 / square) - dof * np.log(square)) - 0.25 * np.log(square)
    noise = Trial(NOISE, float(np.sqrt(square)), float(gain), state.problem, state.solution)
    drive = _unsteady_drive(state, residuals(state.problem, state.solution))
    return [noise] if drive is None else [noise, drive]


def _whole(state: State) -> tuple[float, float]:
    """Chi-square of all tests and of the statement, and its degrees of freedom."""
    left = residuals(state.problem, state.solution)
    repeats = 2.0 * float((state.problem.conditions.sizes - 1).sum())
    return float(left.whole.sum() + state.solution.z @ state.solution.z), float(left.rig_dof.sum()) + repeats


def _cause(trial: Trial, before: Solution) -> Candidate:
    """The cause that a trial is, with its size as found."""
    group, shared = trial.group, trial.problem.shared
    if group.parameters[0].source.role is Role.TEST:
        size = np.array([trial.factor * group.parameters[0].std])
        return cause_of(group.parameters, size, 0 * size)
    wanted = {parameter.key for parameter in group.parameters}
    places = [place for place, parameter in enumerate(shared.parameters)
              if parameter.key in wanted]  # fmt: skip
    sizes = (trial.solution.z * shared.std)[places]
    std = (np.sqrt(np.diag(trial.solution.covariance)) * shared.std)[places]
    cause = cause_of([shared.parameters[place] for place in places], sizes, std)
    explains = max(before.objective - trial.solution.objective, 0.0)
    return replace(cause, explains=explains, released=len(before.z) == len(shared))


def _settle(state: State) -> None:
    """Solve with the scatter of K* that repeats show."""
    used, most = state.outlier == 1, SCATTER.largest * SCATTER.parameters[0].std
    settle_scatter(state, lambda departures: min(scatter_of(state.problem, departures, used), most))


def _settled(state: State, misfit: Misfit) -> Misfit:
    """The misfit with the scatter of K* that repeats show; chance may be the reason of a small one."""
    asked = state.problem.scatter > 0
    for _ in range(_MOST_ROUNDS):
        chi2, dof = _whole(state)
        if misfit.inflation <= 1 or chi2 > _SETTLED * dof:
            break
        # Other groups have explained what seemed to be noise at first.
        square = max(chi2 / dof, misfit.inflation**-2)
        state.solve(state.problem.reweighted(state.problem.observed.whiten / np.sqrt(square)))
        misfit = replace(misfit, inflation=misfit.inflation * float(np.sqrt(square)))
        _settle(state)
    _settle(state)
    return replace(misfit, scatter=max(misfit.scatter, state.problem.scatter if asked else 0.0))


def _raised(state: State, stated: Shared) -> dict[str, Any]:
    """What was raised: values that the tests contradict, what nobody stated, and components of the specimens."""
    parameters, sizes = state.problem.shared.parameters, state.solution.z * state.problem.shared.std
    known = len(stated)
    conflicts = tuple(
        index
        for index, parameter in enumerate(stated.parameters)
        if parameter.source.role is not Role.SPECIMEN
        and parameters[index].std > parameter.std
        and abs(sizes[index]) > _CONFLICT * parameter.std
    )
    added = [
        row.source
        for row, size in zip(parameters[known:], sizes[known:], strict=True)
        if not (row.source.role is Role.SPECIMEN or row.source.is_shape)
        and not (is_negligible(state.problem, row, size) or _is_ordinary(state.problem, row, size))
    ]
    std = np.append(stated.std, np.zeros(len(parameters) - known))
    specimens = [row.source for row, before in zip(parameters, std, strict=True)
                 if row.source.role is Role.SPECIMEN and row.std > before]  # fmt: skip
    return {"conflicts": conflicts, "added": tuple(added), "specimens": tuple(specimens)}


def _is_ordinary(problem: Problem, parameter: SharedParameter, size: float) -> bool:
    """Whether it is a mode of a frame that gives way, far below its resonance, by no more than a support may."""
    gives_way = abs(size) * problem.shared.rig.preload_stiffness
    mode = parameter.source == Source(Kind.UNSTATED, "frame") and parameter.index > 0
    return mode and gives_way < _CONFLICT * problem.support


def _judged(state: State, misfit: Misfit, causes: Sequence[Sequence[Candidate]]) -> Misfit:
    """The misfit with its causes; what is not white has no cause, and then K* does not rest on the rig."""
    chi2, dof = _whole(state)
    at_fault = bool(misfit.conflicts or misfit.added)
    white = not is_unlikely(chi2, dof) and misfit.inflation < NOISE_IN_DOUBT
    if white or chi2 - dof < _LITTLE * (misfit.chi2 - misfit.dof):
        contradicted = {state.problem.shared.parameters[index].source for index in misfit.conflicts} | {*misfit.added}
        named = list(chain(*causes)) if at_fault else []
        kept = [cause for cause in named if cause.source in contradicted]  # others are small beside these
        misfit = replace(
            misfit,
            fits=not at_fault,
            candidates=(*kept, *(cause for cause in named if cause not in kept)),
            tied=len(kept) or (len(causes[0]) if named else 0),
        )
    else:
        misfit = replace(misfit, conflicts=(), added=())
    if white:
        return misfit
    left = residuals(state.problem, state.solution)
    size = largest_part(state.problem, state.solution.z, state.solution.stiffness)
    level = _level(left.rig_part, left.rig_weight, float(left.rig_dof.sum()), size)
    if level <= NEGLIGIBLE:
        ratio = chi2 / dof
        state.solve(_with_noise(state.problem, left, ratio))
        inflation = misfit.inflation * float(np.sqrt(ratio))
        return replace(misfit, inflation=inflation, fits=inflation <= NOISE_IN_DOUBT and not at_fault)
    state.solve(without_rig(state.problem, state.solution.z, state.solution.stiffness, level))
    return replace(misfit, fits=False, rig_error=level)


def _chi2(state: State) -> Misfit:
    """Chi-square of the rig and its degrees of freedom."""
    left = residuals(state.problem, state.solution)
    z = state.solution.z
    return Misfit(chi2=float(left.rig.sum() + z @ z), dof=float(left.rig_dof.sum()))


def _with_noise(problem: Problem, left: Residuals, ratio: float) -> Problem:
    """The problem with a variance of all noise that is larger by a ratio on average."""
    return problem.reweighted(problem.observed.whiten / np.sqrt(_each(left, ratio))[:, None, None])


def without_rig(problem: Problem, z: FloatArray, stiffness: ComplexArray, level: float) -> Problem:
    """The problem with an error of Zr in each test of a size relative to its largest part.

    The error may be common to all tests. Their mean then knows Zr no better than a single test does, so that its
    variance counts as many times as there are tests. K* then depends on the channels, and hardly on the rig.
    """
    columns = problem.without_spread.columns("by_impedance", z, stiffness)
    size = level * np.sqrt(len(columns)) * largest_part(problem, z, stiffness)
    return problem.widened(columns * size[:, None, None])


def _unsteady_drive(state: State, left: Residuals) -> Trial | None:
    """A relative random error of each frequency as a trial; None if it explains little of the misfit.

    A drive with a wandering speed has no single frequency, and the rig's inertia is proportional to frequency squared.
    """
    problem, solution = state.problem.without_spread, state.solution
    by_k, residual = (problem.columns(name, solution.z, solution.stiffness) for name in ("by_stiffness", "residual"))
    basis, _ = cholesky_qr(by_k)
    by_frequency = problem.by_log_frequency(solution.z, solution.stiffness)
    rest, along = (projected(basis, columns[..., None])[..., 0] for columns in (residual, by_frequency))
    weight = np.sum(along**2, axis=1)
    used = (left.rig_dof > 0) & (weight > 0)
    part = np.sum(along * rest, axis=1)
    explained = float(np.sum(part[used] ** 2 / weight[used])) - float(used.sum())
    if explained < _MOSTLY * (float(left.rig.sum()) - float(left.rig_dof.sum())) or not used.any():
        return None
    level = _level(part[used, None], weight[used, None, None], float(used.sum()), np.ones(int(used.sum())))
    if not 0 < level < NEGLIGIBLE:
        return None
    columns = by_frequency * level
    wider = state.problem.widened(columns[:, :, None])
    after = solve(wider, solution.stiffness, solution.z)
    gain = after.evidence - solution.evidence - 0.5 * float(np.sum(np.log1p(np.sum(columns**2, axis=1))))
    gain += volume(wider, solution) - volume(state.problem, solution)
    return Trial(UNSTEADY, level / UNSTEADY.parameters[0].std, float(gain), wider, after)


def _each(left: Residuals, ratio: float) -> FloatArray:
    """Factor (N,) of each test's variance: the ratio on average, and more for a test with a large residual.

    It is the posterior mean of a variance whose prior has `_PRIOR_DOF` degrees of freedom about the ratio. Noise that
    is larger than the recordings give is seldom equally large in all of them.
    """
    return ratio * (_PRIOR_DOF + left.rig / ratio) / (_PRIOR_DOF + left.rig_dof)


def _level(part: FloatArray, weight: FloatArray, dof: float, size: FloatArray) -> float:
    """Random error, relative to `size`, with which the squared residual in two directions equals `dof`."""
    values, vectors = np.linalg.eigh(weight * (size**2)[:, None, None])
    drawn = np.einsum("nij,ni->nj", vectors, part * size[:, None]) ** 2
    usable = values > 1e-12 * max(float(values.max(initial=0.0)), 1e-300)
    values, drawn = values[usable], drawn[usable]
    return root_of(lambda level: float(np.sum(drawn / values / (1 + level**2 * values))) - dof)
