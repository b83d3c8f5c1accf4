"""Outliers, scatter of K* from test to test and drift over the run, as parts of a joint solution."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from fourpole.core import stats
from fourpole.core.arrays import BoolArray, ByValue, ComplexArray, FloatArray
from fourpole.core.confidence import CHANCE
from fourpole.core.joint.misfit import Candidate, Residuals, is_unlikely, residuals
from fourpole.core.joint.scatter import MEDIAN, deviations, robust_scatter, scatter_of, squares
from fourpole.core.joint.shared import DRIFTS, Shared, SharedParameter
from fourpole.core.joint.solve import Problem, Solution, solve_either, with_columns, without_stiffness
from fourpole.core.sources import Kind, Source

#: The statement of the rig counts as wrong if all noise is more than this many times that of the recordings.
NOISE_IN_DOUBT = 2.0


@dataclass(frozen=True)
class Misfit:
    """Agreement of the stated rig and channels with the tests.

    Attributes
    ----------
    chi2, dof : float [1]
        Chi-square that no tyre can explain, and its degrees of freedom, with the statement unchanged. It includes
        F1/V2 - Zr of all tests, and the departure of the shared values from the statement.
    fits : bool
        False if the tests contradict a stated value, if a part of the rig is missing, or if the misfit is far larger
        than noise could be.
    rig_error : float [1]
        Model discrepancy of the rig: relative error of Zr, of its largest part, in each test; 0 if the rig fits.
    inflation : float [1]
        Factor of all noise over the noise that each recording gives; 1 if the recordings' noise explains the residuals.
    scatter : float [1]
        Relative scatter of K* between tests of one condition in addition to the noise; 0 if the noise explains it.
    unsteady : float [1]
        Relative error of the frequency of each test, from a drive without a steady speed; 0 for none.
    conflicts : tuple of int
        Indices of the shared values that the tests contradict; the uncertainty of their statement was enlarged.
    added : tuple of Source
        Unstated parts of the rig and errors of channels that were added; their sizes are among the shared values.
    drifts : tuple of Source
        Drifts of the specimens that were added to the shared values.
    candidates : tuple of Candidate
        Causes that would explain a misfit, the best first; empty if there is no misfit.
    tied : int
        Number of the first candidates that explain the misfit equally well.
    """

    chi2: float = 0.0
    dof: float = 0.0
    fits: bool = True
    rig_error: float = 0.0
    inflation: float = 1.0
    scatter: float = 0.0
    unsteady: float = 0.0
    conflicts: tuple[int, ...] = ()
    added: tuple[Source, ...] = ()
    drifts: tuple[Source, ...] = ()
    candidates: tuple[Candidate, ...] = ()
    tied: int = 0


@dataclass(eq=False)
class SpecimenState(ByValue):
    """The problem, its solution and the misfit after some rounds.

    `start` is the first K* of each condition; `negligible` is false if enlarged noise hides an error of Zr.
    """

    problem: Problem
    solution: Solution
    start: ComplexArray
    outlier: FloatArray
    misfit: Misfit = field(default_factory=Misfit)
    negligible: bool = True
    finished: bool = True

    @property
    def fits(self) -> bool:
        """Whether rig and channels as stated agree with the tests."""
        as_stated = not (self.misfit.conflicts or self.misfit.added or self.misfit.rig_error)
        return self.finished and as_stated and (self.negligible or self.misfit.inflation <= NOISE_IN_DOUBT)

    def solve(self, problem: Problem, **misfit: Any) -> None:
        """Solve a changed problem from the present solution; `misfit` has the fields of the misfit that changed."""
        self.misfit = replace(self.misfit, **misfit)
        self.problem, self.solution = solve_either(problem, self.solution.stiffness, self.solution.z)


#: A test is an outlier if its squared residual is this many times the usual one.
_OUTLIER = 50.0
#: A bad test bends the solution if the squared residual of the others falls by this factor without it.
_BENT = 10.0
#: If a condition has two tests, both are outliers if the smaller squared residual is at least this share of the larger.
_AS_BAD = 0.5
#: Largest share of outliers among all tests, and among tests with the same mass; with more, the statement is wrong.
_FEW, _FEW_OF_A_MASS = 0.1, 0.35
#: Scatter that changes by less than this share is not solved for again.
_SETTLED = 0.05
#: Prior standard deviation of a drift of log K* over the run.
_DRIFT = 0.3
#: A drift goes with the added mass if less than this share of the squared places is left besides the mass.
_APART = 0.1
_SCATTER_ROUNDS = 4
_MOST_ROUNDS = 12


def fit_specimens(state: SpecimenState) -> None:
    """Find outliers, scatter and drift of K*, as far as chance does not explain the residuals, and solve with them."""
    _set_scatter(state, robust=True)
    for _ in range(_MOST_ROUNDS):
        left = residuals(state.problem, state.solution)
        strange, many = _outliers(state, left)
        if many and _without_worst(state, left):
            continue
        if not strange.any():
            break
        _weaken(state, np.where(strange, np.maximum(left.whole / 2, 1.0), 1.0))
    _set_scatter(state)
    if not state.misfit.drifts and _add_drifts(state):
        _set_scatter(state)


def _weaken(state: SpecimenState, factor: FloatArray) -> None:
    """Enlarge the variance of tests by factors, and solve."""
    state.outlier = state.outlier * factor
    state.solve(state.problem.reweighted(state.problem.observed.whiten / np.sqrt(factor)[:, None, None]))


def _without_worst(state: SpecimenState, left: Residuals) -> bool:
    """Weaken the worst test if the other tests then agree much better; else leave all as it is.

    One bad test may bend the whole solution, so that many tests look bad.
    """
    worst = int(np.argmax(np.where(state.outlier > 1, 0.0, left.whole)))
    others = np.arange(left.whole.size) != worst
    fresh = replace(state.solution, stiffness=state.start, z=np.zeros(len(state.problem.shared)))
    trial = replace(state, solution=fresh)
    _weaken(trial, np.where(others, 1.0, max(left.whole[worst] / 2, 1.0) * _BENT))
    after = residuals(trial.problem, trial.solution).whole[others]
    if np.sum(after) * _BENT > np.sum(left.whole[others]):
        return False
    state.problem, state.solution, state.outlier = trial.problem, trial.solution, trial.outlier
    return True


def _set_scatter(state: SpecimenState, *, robust: bool = False) -> None:
    """Solve with the scatter of K* that its repeats show, until both agree."""
    for _ in range(_SCATTER_ROUNDS):
        departures = deviations(state.problem, state.solution.z, state.solution.stiffness)
        used = state.outlier == 1
        if robust:
            scatter = robust_scatter(state.problem, departures)
        else:
            scatter = scatter_of(state.problem, departures, used, len(state.misfit.drifts))
            sizes = state.problem.conditions.sum(used.astype(float))
            dof = 2.0 * float(np.sum(np.maximum(sizes - 1, 0.0)))
            seen = is_unlikely(float(np.sum(squares(state.problem.conditions, departures, 0.0)[used])), dof)
            state.misfit = replace(state.misfit, scatter=scatter if seen else 0.0)
        if abs(scatter - state.problem.scatter) <= _SETTLED * max(scatter, state.problem.scatter):
            return
        state.solve(replace(state.problem, scatter=scatter))


def _add_drifts(state: SpecimenState) -> bool:
    """Add the drifts of the specimens that were repeated, if chance cannot explain them; False if it can."""
    problem, observed = state.problem, state.problem.observed
    repeated = _repeated(problem)
    if not repeated.size or not np.ptp(observed.place):
        return False
    wider = replace(problem, shared=_with_drifts(problem, repeated, _DRIFT))
    fall, lost = _fall(wider, state.solution), 2.0 * repeated.size
    dof = 2.0 * float((problem.conditions.sizes - 1).sum()) - lost
    tyre = float(residuals(problem, state.solution).tyre.sum())
    # If a scatter was found from the same departures, it contains the drift: chi-square per dof may be far below 1.
    # It is below 1 with many lines in a recording too, which scatter together and need no drift.
    least = 1e-9 if problem.scatter and problem.lines is None else 1.0
    rest = max((tyre - fall) / max(dof, 1.0), least)
    if dof <= 0 or stats.f.sf(fall / lost / rest, lost, dof) > CHANCE:
        return False
    z = np.append(state.solution.z, np.zeros(len(wider.shared) - state.solution.z.size))
    state.solution = replace(state.solution, z=z)
    state.solve(wider)
    drifts = wider.shared.of_specimens_at(state.solution.z, DRIFTS, int(observed.specimen.max()) + 1)[repeated]
    others = np.setdiff1d(np.unique(observed.specimen[problem.conditions.first :]), repeated)
    if others.size:  # specimens without repeats: the drifts found are the prior uncertainty of theirs
        size = float(np.sqrt(np.mean(np.abs(drifts) ** 2)))
        state.solution = replace(state.solution, z=np.append(state.solution.z, np.zeros(2 * others.size)))
        state.solve(replace(state.problem, shared=_with_drifts(state.problem, others, size)))
    listed = tuple(parameter.source for parameter in state.problem.shared.parameters if parameter.source.kind in DRIFTS)
    state.misfit = replace(state.misfit, drifts=listed)
    return True


def goes_with_mass(problem: Problem) -> bool:
    """Whether repeats at another place in the run have another added mass, too.

    An error of a sensor, which acts otherwise with another mass, then looks as a drift does.
    """
    first, observed, conditions = problem.conditions.first, problem.observed, problem.conditions
    label = conditions.label[first:]
    marks = (observed.mass_at[:, None] == np.unique(observed.mass_at)).astype(float)
    apart = np.column_stack([marks, observed.place])
    apart = (apart - conditions.mean(apart)[conditions.label])[first:] if label.size else apart[:0]
    place = apart[:, -1]
    rest = place - apart[:, :-1] @ np.linalg.lstsq(apart[:, :-1], place, rcond=None)[0]
    return bool(place @ place > 0 and rest @ rest < _APART * (place @ place))


def _repeated(problem: Problem) -> np.ndarray:
    """Numbers of the specimens with a repeated condition."""
    conditions = problem.conditions
    many = conditions.sizes[conditions.label[conditions.first :]] > 1
    return np.unique(problem.observed.specimen[conditions.first :][many])


def _with_drifts(problem: Problem, specimens: np.ndarray, std: float) -> Shared:
    """The shared values with drifts of some specimens."""
    names = problem.names
    added = [
        SharedParameter(Source(kind, names[number]), unit, number, 0.0, std)
        for number in specimens.tolist()
        for kind, unit in ((Kind.DRIFT, "1"), (Kind.ANGLE_DRIFT, "rad"))
    ]
    return replace(problem.shared, parameters=(*problem.shared.parameters, *added))


def without_drifts(shared: Shared, z: FloatArray) -> tuple[Shared, FloatArray]:
    """The shared values without drifts, and the rest of z."""
    kept = [index for index, parameter in enumerate(shared.parameters) if parameter.source.kind not in DRIFTS]
    return replace(shared, parameters=tuple(shared.parameters[index] for index in kept)), z[kept]


def _fall(wider: Problem, solution: Solution) -> float:
    """Fall of the objective [1] if the shared values that `wider` has in addition, 0 so far, become free."""
    p, z = len(wider.shared), np.append(solution.z, np.zeros(len(wider.shared) - solution.z.size))
    triangle = np.hstack([np.eye(p), -z[:, None]])
    for rows, group, linear in wider.linearised(z, solution.stiffness):
        columns = np.concatenate([linear.by_shared, linear.residual[:, :, None]], axis=2)
        if group.stop > group.start:
            starts = wider.conditions.starts[group] - rows.start
            columns = without_stiffness(linear.by_stiffness, columns, starts)[2]
        triangle = with_columns(triangle, columns)
    return float(np.sum(triangle[solution.z.size : p, -1] ** 2))


def _outliers(state: SpecimenState, left: Residuals) -> tuple[BoolArray, bool]:
    """Flags (N,) of the tests that do not agree with the others, and whether there are too many of them.

    In each condition only the worst test is flagged. No test is flagged if too many of all tests, of the tests with one
    mass or of the rigid blocks would be: a fault that such a group has in common is information about the rig.
    """
    whole, label = left.whole, state.problem.conditions.label
    limit = _OUTLIER * max(1.0, float(np.median(whole)) / MEDIAN)
    before = state.outlier > 1
    strange = whole > limit
    worst = np.zeros(int(label.max(initial=-1)) + 2)
    np.maximum.at(worst, label, whole)
    # If a condition has only two tests and they disagree, the data do not show which one is wrong.
    pair = np.append(state.problem.conditions.sizes, 0)[label] == 2
    chosen = strange & (whole >= np.where(pair, _AS_BAD, 1.0) * worst[label])
    observed = state.problem.observed
    kinds = np.unique(np.stack([observed.rigid, observed.mass_at], axis=1), axis=0, return_inverse=True)[1].ravel()
    crowded = any(
        np.sum((chosen | before)[kinds == kind]) > _FEW_OF_A_MASS * np.sum(kinds == kind) for kind in np.unique(kinds)
    )
    few = max(_FEW * whole.size, 1.0 if whole.size > 2 else 0.0)
    if crowded or np.sum(strange | before) > few:
        return np.zeros(whole.size, dtype=bool), bool(strange.any())
    return chosen, False
