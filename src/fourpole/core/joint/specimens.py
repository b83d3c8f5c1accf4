"""Tests that do not go with the others, and the misfit of a joint solution."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from fourpole.core.arrays import BoolArray, ByValue, ComplexArray, FloatArray
from fourpole.core.joint.misfit import Candidate, Residuals, residuals
from fourpole.core.joint.scatter import MEDIAN, Deviations, deviations, robust_scatter
from fourpole.core.joint.solve import Problem, Solution, solve_either
from fourpole.core.sources import Source


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
    specimens : tuple of Source
        Drifts, blocks and the effect of the amplitude that the tests ask for.
    candidates : tuple of Candidate
        Causes that would explain a misfit, the best first; empty if there is no misfit.
    tied : int
        Number of the first candidates that explain the misfit equally well.
    belts : float [1]
        Gain of evidence by specimens with a mass of their own; 0 where they have none.
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
    specimens: tuple[Source, ...] = ()
    candidates: tuple[Candidate, ...] = ()
    tied: int = 0
    belts: float = 0.0


@dataclass(eq=False)
class State(ByValue):
    """The problem, its solution and the factors of the outliers' variances; `start` and `first` are K* and z before."""

    problem: Problem
    solution: Solution
    start: ComplexArray
    first: FloatArray
    outlier: FloatArray

    def solve(self, problem: Problem) -> None:
        """Solve a changed problem from the present solution."""
        before = self.solution
        self.problem, self.solution = solve_either(problem, before.stiffness, before.z, slope=before.slope)


#: A test is an outlier if its squared residual is this many times the usual one.
_OUTLIER = 50.0
#: A bad test bends the solution if the squared residual of the others falls by this factor without it.
_BENT = 10.0
#: If a condition has two tests, both are outliers if the smaller squared residual is at least this share of the larger.
_AS_BAD = 0.5
#: Largest share of outliers among all tests, and among tests with the same mass; with more, the statement is wrong.
_FEW, _FEW_OF_A_MASS = 0.1, 0.35
_MOST_ROUNDS = 12


#: Scatter that changes by less than this share is not solved for again.
_SETTLED, _SCATTER_ROUNDS = 0.05, 4


def settle_scatter(state: State, estimate: Callable[[Deviations], float]) -> None:
    """Solve with the scatter of K* that the departures of the tests give, until both agree."""
    for _ in range(_SCATTER_ROUNDS):
        before = state.problem.scatter
        scatter = estimate(deviations(state.problem, state.solution.z, state.solution.stiffness))
        if abs(scatter - before) <= _SETTLED * max(scatter, before):
            return
        state.solve(replace(state.problem, scatter=scatter))


def weaken_strange_tests(state: State) -> None:
    """Find the tests that do not go with the others, and enlarge their variance.

    Scatter of K* by the median of all repeats is noise meanwhile.
    """
    settle_scatter(state, lambda departures: robust_scatter(state.problem, departures))
    for _ in range(_MOST_ROUNDS):
        left = residuals(state.problem, state.solution)
        strange, many = _outliers(state, left)
        if many and _without_worst(state, left):
            continue
        if not strange.any():
            return
        _weaken(state, np.where(strange, np.maximum(left.whole / 2, 1.0), 1.0))


def restore_tests(state: State) -> None:
    """Give back the weight of weakened tests that agree with the others, now that all that is asked for is raised."""
    left = residuals(state.problem, state.solution).whole
    agree = (state.outlier > 1) & (left * state.outlier < _limit(left))
    if agree.any():
        _weaken(state, np.where(agree, 1 / state.outlier, 1.0))


def _limit(whole: FloatArray) -> float:
    """Squared residual beyond which a test is strange, from those of all tests (N,)."""
    return _OUTLIER * max(1.0, float(np.median(whole)) / MEDIAN)


def _weaken(state: State, factor: FloatArray) -> None:
    """Enlarge the variance of tests by factors, and solve."""
    state.outlier = state.outlier * factor
    state.solve(state.problem.reweighted(state.problem.observed.whiten / np.sqrt(factor)[:, None, None]))


def _without_worst(state: State, left: Residuals) -> bool:
    """Weaken the worst test if the other tests then agree much better; else leave all as it is.

    One bad test may bend the whole solution, so that many tests look bad.
    """
    worst = int(np.argmax(np.where(state.outlier > 1, 0.0, left.whole)))
    others = np.arange(left.whole.size) != worst
    fresh = replace(state.solution, stiffness=state.start, z=state.first)
    trial = replace(state, solution=fresh)
    _weaken(trial, np.where(others, 1.0, max(left.whole[worst] / 2, 1.0) * _BENT))
    after = residuals(trial.problem, trial.solution).whole[others]
    if np.sum(after) * _BENT > np.sum(left.whole[others]):
        return False
    state.problem, state.solution, state.outlier = trial.problem, trial.solution, trial.outlier
    return True


def _outliers(state: State, left: Residuals) -> tuple[BoolArray, bool]:
    """Flags (N,) of the tests that do not agree with the others, and whether there are too many of them.

    In each condition only the worst test is flagged. No test is flagged if too many of all tests, of the tests with one
    mass or of the rigid blocks would be: a fault that such a group has in common is information about the rig.
    """
    whole, label = left.whole, state.problem.conditions.label
    before = state.outlier > 1
    strange = whole > _limit(whole)
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
