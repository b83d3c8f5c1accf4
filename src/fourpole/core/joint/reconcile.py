"""Reconcile the statement with the tests: outliers, contradicted values, missing parts, scatter and noise."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from fourpole.core.arrays import BoolArray, FloatArray
from fourpole.core.joint.misfit import Candidate, Residuals, candidates, is_unlikely, pulls, residuals
from fourpole.core.joint.model import cholesky_qr, part_shapes, projected
from fourpole.core.joint.shared import SharedParameter
from fourpole.core.joint.solve import Problem, Solution, solve, spread
from fourpole.core.sources import PARTS, Kind

#: A stated value contradicts the tests if it departs from its estimate by more than this many standard uncertainties.
_CONFLICT = 3.0
#: A statement is set aside beyond this many standard uncertainties; below, it still counts for the estimates.
_IMPOSSIBLE = 5.0
#: A test is an outlier if its squared residual is this many times the usual one.
_OUTLIER = 50.0
#: Largest share of outliers among all tests, and among tests with the same mass; with more, the statement is wrong.
_FEW, _FEW_OF_A_MASS = 0.1, 0.35
#: A stated value contradicts the tests only if it explains at least this share of what the best unstated part does.
_SHARE_OF_BEST = 0.8
#: Stated values whose departures are at least this share of the largest departure contradict the tests together.
_SHARE_OF_WORST = 0.9
#: A part is a cause of the misfit if it explains at least this share of it.
_SHARE_OF_CAUSE = 0.3
#: An error of Zr below this share of its largest part counts as noise, because no rig is built that accurately.
_NEGLIGIBLE = 1e-4
#: An unstated part is significant if its size is this many standard uncertainties, even without a misfit.
_SIGNIFICANT = 5.0
#: The statement of the rig counts as wrong if all noise is more than this many times that of the recordings.
_NOISE_IN_DOUBT = 2.0
#: An unsteady drive is the cause of the misfit if it explains more than this share of it.
_MOSTLY = 0.7
#: Degrees of freedom of the prior for the noise of one test about the noise of all tests.
_PRIOR_DOF = 4.0
_MOST_ROUNDS = 12


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
        Relative scatter of K* between tests of one condition in addition to the noise; 0 for none.
    unsteady : float [1]
        Relative error of the frequency of each test, from a drive without a steady speed; 0 for none.
    conflicts : tuple of int
        Indices of the shared values that the tests contradict. If chance is excluded, their statement was set aside.
    parts : tuple of str
        Unstated parts, of `core.sources.PARTS`, that were added to the rig; their sizes are among the shared values.
    candidates : tuple of Candidate
        Unstated parts that would explain a misfit, the best first; empty if there is no misfit.
    """

    chi2: float = 0.0
    dof: float = 0.0
    fits: bool = True
    rig_error: float = 0.0
    inflation: float = 1.0
    scatter: float = 0.0
    unsteady: float = 0.0
    conflicts: tuple[int, ...] = ()
    parts: tuple[str, ...] = ()
    candidates: tuple[Candidate, ...] = ()


@dataclass(eq=False)
class _State:
    """The problem, its solution and the misfit after some rounds.

    `doubtful` are conflicts that chance may explain; `negligible` is false if enlarged noise hides an error of Zr.
    """

    problem: Problem
    solution: Solution
    outlier: FloatArray
    misfit: Misfit = field(default_factory=Misfit)
    doubtful: list[int] = field(default_factory=list)
    negligible: bool = True
    finished: bool = True

    @property
    def fits(self) -> bool:
        """Whether rig and channels as stated agree with the tests."""
        as_stated = not (self.misfit.conflicts or self.misfit.parts or self.misfit.rig_error)
        return self.finished and as_stated and (self.negligible or self.misfit.inflation <= _NOISE_IN_DOUBT)

    def solve(self, problem: Problem, **misfit: Any) -> None:
        """Solve a changed problem from the present solution, and note what the misfit has become."""
        self.misfit = replace(self.misfit, **misfit)
        self.problem = problem
        self.solution = solve(problem, self.solution.stiffness, self.solution.z)


def reconcile(problem: Problem, solution: Solution) -> tuple[Problem, Solution, FloatArray, Misfit]:
    """Repeat remedies until chance explains the residuals: outliers, contradictions, missing parts, scatter, noise.

    Returns
    -------
    problem, solution : Problem, Solution
        The problem with the weights and priors of the last round, and its solution.
    outlier : (N,) float array [1]
        Factor by which the variance of each test was enlarged as an outlier; 1 for the others.
    misfit : Misfit
    """
    state = _State(problem, solution, np.ones(problem.observed.omega.size))
    diagnosed = False
    for _ in range(_MOST_ROUNDS):
        left = residuals(state.problem, state.solution)
        strange = _outliers(state, left)
        if strange.any():
            factor = np.where(strange, np.maximum(left.whole / 2, 1.0), 1.0)
            state.outlier = state.outlier * factor
            state.solve(state.problem.reweighted(state.problem.observed.whiten / np.sqrt(factor)[:, None, None]))
            continue
        if not diagnosed:
            state.misfit, diagnosed = _unchanged(state.solution, left), True
        if not _remedied(state, left):
            break
    else:
        state.finished = False
    # Doubtful values keep their estimates; their uncertainties are those without the doubtful statement.
    for at in state.doubtful:
        _set_aside(state, at, _IMPOSSIBLE)
    if state.doubtful:
        state.solution = spread(state.problem, state.solution)
    if not diagnosed:
        state.misfit = _unchanged(state.solution, residuals(state.problem, state.solution))
    return state.problem, state.solution, state.outlier, replace(state.misfit, fits=state.fits)


@dataclass(frozen=True, eq=False)
class _Diagnosis:
    """Misfit of a solution that chance cannot explain, and its possible causes.

    `departures` has the departure of each shared value from its statement, in standard uncertainties of that departure;
    `size` is the largest part of Zr of each test; `effect` is the change of Zr, over `size`, by the best candidate.
    """

    left: Residuals
    rig_chi2: float
    rig_dof: float
    tyre_chi2: float
    tyre_dof: float
    departures: FloatArray
    named: list[Candidate]
    size: FloatArray
    effect: float

    @property
    def bad(self) -> bool:
        """Whether chance cannot explain the residuals of rig or tyre."""
        return self.rig_bad or self.tyre_bad

    @property
    def rig_bad(self) -> bool:
        return is_unlikely(self.rig_chi2, self.rig_dof)

    @property
    def tyre_bad(self) -> bool:
        return is_unlikely(self.tyre_chi2, self.tyre_dof)

    @property
    def excess(self) -> float:
        return self.rig_chi2 - self.rig_dof + self.tyre_chi2 - self.tyre_dof

    @property
    def pull(self) -> float:
        """Largest departure of a shared value from its statement, in standard uncertainties."""
        return float(self.departures.max(initial=0.0))

    @property
    def explained(self) -> float:
        """Fall of chi-square by the best unstated part."""
        return self.named[0].explains if self.named else 0.0

    @property
    def rest(self) -> float:
        """Chi-square per degree of freedom without the statement of largest departure; at least 1."""
        if not self.bad:
            return 1.0
        dof = max(self.rig_dof + self.tyre_dof - 1, 1.0)
        return max((self.rig_chi2 + self.tyre_chi2 - self.pull**2) / dof, 1.0)

    @property
    def contradicted(self) -> bool:
        """Whether a shared value departs too far from its statement, and no unstated part explains much more."""
        best = max(self.explained, self.pull**2)
        return self.pull > _CONFLICT * np.sqrt(self.rest) and self.pull**2 >= _SHARE_OF_BEST * best

    @property
    def scattered(self) -> bool:
        """Whether K* differs between tests of one condition, and no gain or part of the rig explains it."""
        best = max(self.explained, self.pull**2)
        more_tyre = self.tyre_chi2 - self.tyre_dof > self.rig_chi2 - self.rig_dof
        return self.tyre_bad and best < 0.5 * self.excess and more_tyre

    @property
    def part_missing(self) -> bool:
        """Whether one unstated part of the rig explains much of the misfit, or is significant by itself."""
        if not self.named or not self.named[0].of_rig or self.effect < _NEGLIGIBLE:
            return False
        significant = self.explained > _SIGNIFICANT**2 * self.rest
        return significant or (self.rig_bad and self.explained > _SHARE_OF_CAUSE * (self.rig_chi2 - self.rig_dof))

    @cached_property
    def level(self) -> float:
        """Relative random error of Zr with which chance explains the misfit of the rig; 0 without a misfit."""
        if not self.rig_bad:
            return 0.0
        return _level(self.left.rig_part, self.left.rig_weight, self.rig_dof, self.size)


def _diagnosed(state: _State, left: Residuals) -> _Diagnosis:
    """The diagnosis of the present solution, from its residuals."""
    problem, solution = state.problem, state.solution
    rig_chi2, tyre_chi2 = float(left.rig.sum() + solution.z @ solution.z), float(left.tyre.sum())
    # No part explains more than the whole chi-square. The exact phasors of a plan leave none, and need no candidates.
    named = candidates(problem, solution) if rig_chi2 + tyre_chi2 > 1 else []
    size = largest_part(problem, solution)
    effect = 0.0
    if named and named[0].of_rig:
        speed = np.abs(problem.observed.amplitudes[:, 2])
        rig = problem.shared.rig_at(solution.z)
        shape = part_shapes(problem.observed.omega, rig, speed, problem.observed.rigid)[named[0].source.of]
        effect = float(np.max(np.abs(named[0].size * shape) / size))
    return _Diagnosis(
        left=left,
        rig_chi2=rig_chi2,
        rig_dof=float(left.rig_dof.sum()),
        tyre_chi2=tyre_chi2,
        tyre_dof=2.0 * float((problem.conditions.sizes - 1).sum()),
        departures=_departures(state),
        named=named,
        size=size,
        effect=effect,
    )


def _remedied(state: _State, left: Residuals) -> bool:
    """Apply one remedy to the worst misfit that chance cannot explain; False if there is none."""
    found, misfit = _diagnosed(state, left), state.misfit
    if misfit.rig_error == 0 and found.contradicted:
        _note_contradictions(state, found)
    elif found.scattered:
        _add_scatter(state, found)
    elif found.part_missing and found.named[0].source.of not in misfit.parts:
        _name(state, found.named)
        _add_part(state, found.named[0])
    elif found.rig_bad and misfit.parts and found.level > _NEGLIGIBLE and misfit.rig_error < 1:
        _add_rig_error(state, found)
    elif found.rig_bad and misfit.unsteady == 0 and (drive := _unsteady_drive(state, left, found)) is not None:
        state.solve(state.problem.widened(drive[1]), unsteady=drive[0])
    elif found.bad:
        _enlarge_noise(state, found)
    else:
        return False
    return True


def _note_contradictions(state: _State, found: _Diagnosis) -> None:
    """Note the statements that contradict the tests, and set them aside if chance is excluded."""
    _name(state, found.named)
    worst = np.flatnonzero(found.departures >= _SHARE_OF_WORST * found.pull).tolist()
    conflicts = (*state.misfit.conflicts, *worst)
    if found.pull > _IMPOSSIBLE:
        for at in worst:
            _set_aside(state, at, found.pull)
        state.solve(state.problem, conflicts=conflicts)
    else:
        state.misfit = replace(state.misfit, conflicts=conflicts)
        state.doubtful += worst


def _add_scatter(state: _State, found: _Diagnosis) -> None:
    """Add a random error of K* to each test, of the size that chance then explains."""
    problem, solution, left = state.problem, state.solution, found.left
    scatter = _level(left.tyre_part, left.tyre_weight, found.tyre_dof, np.ones(left.tyre.size))
    columns = problem.columns("by_stiffness", solution.z, solution.stiffness) * scatter
    state.solve(problem.widened(columns), scatter=float(np.hypot(state.misfit.scatter, scatter)))


def _add_rig_error(state: _State, found: _Diagnosis) -> None:
    """Add a random error of Zr to each test, of the size that chance then explains."""
    problem, solution = state.problem, state.solution
    columns = problem.columns("by_impedance", solution.z, solution.stiffness)
    widened = problem.widened(columns * (found.level * found.size)[:, None, None])
    state.solve(widened, rig_error=float(np.hypot(state.misfit.rig_error, found.level)))


def _enlarge_noise(state: _State, found: _Diagnosis) -> None:
    """Enlarge the noise of all tests until chance explains the residuals."""
    if found.level > _NEGLIGIBLE and found.explained > _SHARE_OF_CAUSE * found.excess:
        _name(state, found.named)
    state.negligible = state.negligible and found.level <= _NEGLIGIBLE
    ratio = (found.rig_chi2 + found.tyre_chi2) / (found.rig_dof + found.tyre_dof)
    whiten = state.problem.observed.whiten / np.sqrt(_each(found.left, ratio))[:, None, None]
    state.solve(state.problem.reweighted(whiten), inflation=state.misfit.inflation * float(np.sqrt(ratio)))


def _unsteady_drive(state: _State, left: Residuals, found: _Diagnosis) -> tuple[float, FloatArray] | None:
    """Relative random error of each frequency, and its columns (N, 6, 1), if it explains most of the misfit.

    A drive with a wandering speed has no single frequency, and the inertia of the rig is proportional to its square.
    """
    problem, solution = state.problem, state.solution
    by_k, residual = (problem.columns(name, solution.z, solution.stiffness) for name in ("by_stiffness", "residual"))
    basis, _ = cholesky_qr(by_k)
    by_frequency = problem.by_log_frequency(solution.z, solution.stiffness)
    rest, along = (projected(basis)(columns[..., None])[..., 0] for columns in (residual, by_frequency))
    weight = np.sum(along**2, axis=1)
    used = (left.rig_dof > 0) & (weight > 0)
    part = np.sum(along * rest, axis=1)
    explained = float(np.sum(part[used] ** 2 / weight[used])) - float(used.sum())
    if explained < _MOSTLY * (found.rig_chi2 - found.rig_dof):
        return None
    level = _level(part[used, None], weight[used, None, None], float(used.sum()), np.ones(int(used.sum())))
    return (level, (by_frequency * level)[:, :, None]) if level < _NEGLIGIBLE else None


def _each(left: Residuals, ratio: float) -> FloatArray:
    """Factor (N,) of each test's variance: the ratio on average, and more for a test with a large residual.

    It is the posterior mean of a variance whose prior has `_PRIOR_DOF` degrees of freedom about the ratio. Noise that
    is larger than the recordings give is seldom equally large in all of them.
    """
    return ratio * (_PRIOR_DOF + left.rig / ratio) / (_PRIOR_DOF + left.rig_dof)


def _name(state: _State, named: list[Candidate]) -> None:
    """Keep the candidates of the first misfit; those of later rounds are judged with enlarged noise."""
    if not state.misfit.candidates:
        state.misfit = replace(state.misfit, candidates=tuple(named))


def _unchanged(solution: Solution, left: Residuals) -> Misfit:
    """The misfit of a solution before any remedy."""
    return Misfit(float(left.rig.sum() + solution.z @ solution.z), float(left.rig_dof.sum()))


def _outliers(state: _State, left: Residuals) -> BoolArray:
    """Flags (N,) of the tests that do not agree with the others, the worst of each condition first.

    No test is flagged if too many of all tests, of the tests with one mass or of the rigid blocks would be: what such a
    group has in common is information about the rig.
    """
    whole, label = left.whole, state.problem.conditions.label
    # 1.4 is the median of chi-square with 2 degrees of freedom.
    limit = _OUTLIER * max(1.0, float(np.median(whole)) / 1.4)
    before = state.outlier > 1
    strange = (whole > limit) & ~before
    worst = np.zeros(int(label.max(initial=-1)) + 2)
    np.maximum.at(worst, label, whole)
    chosen = strange & (whole >= worst[label])
    observed = state.problem.observed
    kinds = np.unique(np.stack([observed.rigid, observed.mass_at], axis=1), axis=0, return_inverse=True)[1].ravel()
    crowded = any(
        np.sum((chosen | before)[kinds == kind]) > _FEW_OF_A_MASS * np.sum(kinds == kind) for kind in np.unique(kinds)
    )
    few = max(_FEW * whole.size, 1.0 if whole.size > 2 else 0.0)
    if crowded or np.sum(strange | before) > few:
        return np.zeros(whole.size, dtype=bool)
    return chosen


def _departures(state: _State) -> FloatArray:
    """Departure of each shared value from its statement; 0 for known conflicts and for unstated parts."""
    pull = np.abs(np.nan_to_num(pulls(state.solution)))
    pull[list(state.misfit.conflicts)] = 0.0
    pull[[at for at, one in enumerate(state.problem.shared.parameters) if one.source.kind is Kind.UNSTATED]] = 0.0
    return pull


def _set_aside(state: _State, at: int, pull: float) -> None:
    """Enlarge the uncertainty of a statement until it has hardly any weight, and scale z accordingly."""
    shared, z = state.problem.shared, state.solution.z.copy()
    wider = 10.0 * max(pull, 1.0)
    listed = list(shared.parameters)
    listed[at] = replace(listed[at], std=listed[at].std * wider)
    z[at] /= wider
    state.problem = replace(state.problem, shared=replace(shared, parameters=tuple(listed)))
    state.solution = replace(state.solution, z=z)


def _add_part(state: _State, candidate: Candidate) -> None:
    """Add an unstated part to the rig: its stated size is 0, with the estimated size as standard uncertainty."""
    shared = state.problem.shared
    source, size = candidate.source, abs(candidate.size)
    parts = state.misfit.parts
    part = SharedParameter(source, PARTS[source.of], len(parts), 0.0, size)
    state.solution = replace(state.solution, z=np.append(state.solution.z, 1.0))
    wider = replace(state.problem, shared=replace(shared, parameters=(*shared.parameters, part)))
    state.solve(wider, parts=(*parts, source.of))


def largest_part(problem: Problem, solution: Solution) -> FloatArray:
    """Modulus of the larger part of Zr, mass or spring (N,) [N s/m]; unlike Zr it does not vanish at resonance."""
    rig, omega = problem.shared.rig_at(solution.z), problem.observed.omega
    impedance = problem.columns("impedance", solution.z, solution.stiffness)
    spring = rig.preload_stiffness / omega
    return np.maximum(np.abs(impedance + 1j * spring), spring)


def _level(part: FloatArray, weight: FloatArray, dof: float, size: FloatArray) -> float:
    """Random error, relative to `size`, with which the squared residual in two directions equals `dof`."""
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
