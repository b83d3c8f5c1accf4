"""What contradicts is set aside, noise is taken as large as the tests show it to be, and the rest is solved again."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from fourpole.core.arrays import BoolArray, FloatArray
from fourpole.core.joint.misfit import Candidate, Residuals, candidates, is_unlikely, pulls, residuals
from fourpole.core.joint.solve import Problem, Solution, solve

__all__ = ["Misfit", "largest_part", "settle"]

#: A stated value drawn further than this from what is stated, in standard uncertainties, contradicts the tests.
_CONFLICT = 3.0
#: A test whose squared residual is this many times the usual one does not belong with the others.
_OUTLIER = 50.0
#: More outliers than this share are no outliers: the rig as stated is wrong.
_FEW = 0.1
#: A stated value is to blame where nothing unstated would explain much more than it does.
_AS_GOOD = 0.8
#: A part that explains less than this share of a misfit is not its cause.
_WORTH_NAMING = 0.3
#: Noise may be this many times what each recording by itself says before the rig is doubted.
_NOISE_IN_DOUBT = 2.0
_MOST_ROUNDS = 12


@dataclass(frozen=True)
class Misfit:
    """Whether rig and channels as stated go together with the tests.

    Attributes
    ----------
    chi2, dof : float [1]
        Of what no tyre could explain: F1/V2 - Zr of all tests, and the shared values against what is stated; with the
        statement as it is.
    fits : bool
        False where a stated value contradicts, where a part of the rig is missing, or where the misfit is far larger
        than noise could be.
    rig_error : float [1]
        Relative error that had to be granted to Zr, of its largest part, in each test; 0 where the rig fits.
    inflation : float [1]
        By how much all noise had to be taken larger than each recording by itself says; 1 where it is as it says.
    scatter : float [1]
        Relative scatter of K* between tests of one condition beyond the noise; 0 where there is none.
    conflicts : tuple of int
        Shared values that the tests contradict; what is stated of them was set aside.
    candidates : tuple of Candidate
        Unstated parts that would explain a misfit, the best first; empty where all fits.
    """

    chi2: float
    dof: float
    fits: bool = True
    rig_error: float = 0.0
    inflation: float = 1.0
    scatter: float = 0.0
    conflicts: tuple[int, ...] = ()
    candidates: tuple[Candidate, ...] = ()


@dataclass
class _State:
    """How things stand after some rounds."""

    problem: Problem
    solution: Solution
    outlier: FloatArray
    misfit: Misfit | None = None
    conflicts: list[int] = field(default_factory=list)
    rig_error: float = 0.0
    inflation: float = 1.0
    scatter: float = 0.0

    @property
    def tyre_dof(self) -> float:
        return 2.0 * float((self.problem.conditions.sizes - 1).sum())

    def solve(self, problem: Problem) -> None:
        self.problem = problem
        self.solution = solve(problem, self.solution.stiffness, self.solution.z)


def settle(problem: Problem, solution: Solution) -> tuple[Problem, Solution, FloatArray, Misfit]:
    """Repeat until all that is left can be chance: outliers, contradicted statements, scatter of the tyre, the rig.

    Returns
    -------
    problem, solution : Problem, Solution
        With the weights and priors of the last round.
    outlier : (N,) float array [1]
        By how much the variance of each test was enlarged because it does not go with the others.
    misfit : Misfit
    """
    state = _State(problem, solution, np.ones(problem.observed.omega.size))
    for _ in range(_MOST_ROUNDS):
        left = residuals(state.problem, state.solution)
        strange = _outliers(state.problem, left)
        if strange.any():
            factor = np.where(strange, np.maximum(left.whole / 2, 1.0), 1.0)
            state.outlier = state.outlier * factor
            state.solve(state.problem.rewhitened(state.problem.observed.whiten / np.sqrt(factor)[:, None, None]))
        elif not _mend(state, left):
            break
    misfit = state.misfit
    assert misfit is not None
    return (
        state.problem,
        state.solution,
        state.outlier,
        replace(
            misfit,
            rig_error=state.rig_error,
            inflation=state.inflation,
            scatter=state.scatter,
            conflicts=tuple(state.conflicts),
            fits=not state.conflicts and state.rig_error == 0 and state.inflation <= _NOISE_IN_DOUBT,
        ),
    )


def _mend(state: _State, left: Residuals) -> bool:
    """One remedy for the worst of what chance cannot explain; False where there is nothing more to do."""
    problem, solution = state.problem, state.solution
    rig_chi2, rig_dof = float(left.rig.sum() + solution.z @ solution.z), float(left.rig_dof.sum())
    tyre_chi2 = float(left.tyre.sum())
    state.misfit = state.misfit or Misfit(rig_chi2, rig_dof)
    rig_bad, tyre_bad = is_unlikely(rig_chi2, rig_dof), is_unlikely(tyre_chi2, state.tyre_dof)
    worst, pull = _worst_pull(state)
    if not (rig_bad or tyre_bad or (pull > _CONFLICT and state.rig_error == 0)):
        return False
    named = candidates(problem, solution)
    best = max(named[0].explains if named else 0.0, pull**2)
    excess = rig_chi2 - rig_dof + tyre_chi2 - state.tyre_dof
    rest = max((rig_chi2 + tyre_chi2 - pull**2) / max(rig_dof + state.tyre_dof - 1, 1.0), 1.0)
    if state.rig_error == 0 and pull > _CONFLICT * np.sqrt(rest) and pull**2 >= _AS_GOOD * best:
        _name(state, named)
        state.conflicts.append(worst)
        problem, z = _set_aside(state, worst, pull)
        state.solution = replace(solution, z=z)
        state.solve(problem)
    elif tyre_bad and best < 0.5 * excess and tyre_chi2 - state.tyre_dof > rig_chi2 - rig_dof:
        level = _level(left.tyre_part, left.tyre_weight, state.tyre_dof, np.ones(left.tyre.size))
        state.scatter = float(np.hypot(state.scatter, level))
        state.solve(problem.widened(problem.columns("by_stiffness", solution.z, solution.stiffness) * level))
    elif rig_bad and state.rig_error < 1 and _rig_is_to_blame(state, named, rig_chi2 - rig_dof):
        _name(state, named)
        size = largest_part(problem, solution)
        level = _level(left.rig_part, left.rig_weight, rig_dof, size)
        state.rig_error = float(np.hypot(state.rig_error, level))
        columns = problem.columns("by_impedance", solution.z, solution.stiffness)
        state.solve(problem.widened(columns * (level * size)[:, None, None]))
    elif rig_bad or tyre_bad:
        if named and named[0].explains > _WORTH_NAMING * excess:
            _name(state, named)
        ratio = np.sqrt((rig_chi2 + tyre_chi2) / (rig_dof + state.tyre_dof))
        state.inflation *= float(ratio)
        state.solve(problem.rewhitened(problem.observed.whiten / ratio))
    else:
        return False
    return True


def _rig_is_to_blame(state: _State, named: list[Candidate], excess: float) -> bool:
    """Whether a part of the rig explains a good share of the misfit; else it is as good as noise."""
    if state.rig_error > 0:
        return True
    return bool(named) and named[0].of_rig and named[0].explains > _WORTH_NAMING * excess


def _name(state: _State, named: list[Candidate]) -> None:
    """Keep the candidates of the first misfit: later ones are judged with the noise enlarged already."""
    assert state.misfit is not None
    if not state.misfit.candidates:
        state.misfit = replace(state.misfit, candidates=tuple(named))


def _outliers(problem: Problem, left: Residuals) -> BoolArray:
    """The few tests that do not go with the others, the worst of each condition at a time."""
    whole = left.whole
    limit = _OUTLIER * max(1.0, float(np.median(whole)) / 1.4)  # 1.4: the median of chi-square with 2 degrees
    strange = whole > limit
    few = max(_FEW * whole.size, 1.0 if whole.size > 2 else 0.0)
    if not strange.any() or strange.sum() > few:
        return np.zeros(whole.size, dtype=bool)
    label = problem.conditions.label
    worst = np.zeros(int(label.max(initial=-1)) + 2)
    np.maximum.at(worst, label, whole)
    return strange & (whole >= worst[label])


def _worst_pull(state: _State) -> tuple[int, float]:
    """The shared value drawn furthest from its statement, but for those set aside already."""
    pull = np.abs(np.nan_to_num(pulls(state.solution)))
    pull[state.conflicts] = 0.0
    if not pull.size:
        return -1, 0.0
    worst = int(np.argmax(pull))
    return worst, float(pull[worst])


def _set_aside(state: _State, at: int, pull: float) -> tuple[Problem, FloatArray]:
    """The problem with a statement so wide that it hardly pulls any more, and z counted in the new uncertainty."""
    problem, z = state.problem, state.solution.z.copy()
    wider = 10.0 * max(pull, 1.0)
    listed = list(problem.shared.quantities)
    listed[at] = replace(listed[at], std=listed[at].std * wider)
    z[at] /= wider
    return replace(problem, shared=replace(problem.shared, quantities=tuple(listed))), z


def largest_part(problem: Problem, solution: Solution) -> FloatArray:
    """Size of the largest part of Zr [N s/m], of mass or spring: Zr itself may vanish, what is wrong with it not."""
    rig, omega = problem.shared.rig_at(solution.z), problem.observed.omega
    impedance = problem.columns("impedance", solution.z, solution.stiffness)
    spring = rig.preload_stiffness / omega
    return np.maximum(np.abs(impedance + 1j * spring), spring)


def _level(part: FloatArray, weight: FloatArray, dof: float, size: FloatArray) -> float:
    """Random error, relative to `size`, that makes the squared residual in two directions what chance would."""
    values, vectors = np.linalg.eigh(weight * (size**2)[:, None, None])
    drawn = np.einsum("nij,ni->nj", vectors, part * size[:, None]) ** 2
    usable = values > 1e-12 * max(float(values.max(initial=0.0)), 1e-300)
    values, drawn = values[usable], drawn[usable]
    low, high = 0.0, 1.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        if np.sum(drawn / values / (1 + middle**2 * values)) > dof:
            low = middle
        else:
            high = middle
    return high
