"""Reconcile statement and tests: outliers, contradicted values, missing parts, scatter and noise, round by round."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from fourpole.core.arrays import BoolArray, FloatArray
from fourpole.core.joint.misfit import Candidate, Residuals, candidates, is_unlikely, pulls, residuals
from fourpole.core.joint.model import cholesky_qr, part_shapes, projected
from fourpole.core.joint.shared import SharedParameter
from fourpole.core.joint.solve import Problem, Solution, solve, spread
from fourpole.core.sources import PARTS, Kind

__all__ = ["Misfit", "largest_part", "reconcile"]

#: A stated value drawn further than this from what is stated, in standard uncertainties, contradicts the tests; it may
#: still be true by bad luck, so until luck is out of the question only the uncertainties are those without it.
_CONFLICT, _IMPOSSIBLE = 3.0, 5.0
#: A test whose squared residual is this many times the usual one does not belong with the others.
_OUTLIER = 50.0
#: More outliers than this share are no outliers: the rig as stated is wrong.
_FEW, _FEW_OF_A_KIND = 0.1, 0.35
#: A stated value is to blame where nothing unstated would explain much more than it does, and so is any other that
#: is drawn nearly as far: the tests cannot tell them apart.
_AS_GOOD, _AS_FAR = 0.8, 0.9
#: A part that explains less than this share of a misfit is not its cause.
_WORTH_NAMING = 0.3
#: An error of Zr smaller than this, relative to its largest part, is no fault of a rig but noise: no rig is built so.
_TRIFLE = 1e-4
#: An unstated part is plain where its size is this many times its uncertainty, though all else may hide in the noise.
_PLAIN = 5.0
#: Noise may be this many times what each recording by itself says before the rig is doubted.
_NOISE_IN_DOUBT = 2.0
#: A cause that explains more than this share of a misfit is it.
_MOSTLY = 0.7
#: Degrees of freedom with which the noise of a test follows that of all.
_KNOWN = 4.0
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
    unsteady : float [1]
        Relative error that had to be granted to the frequency of each test, whose drive has no one speed; 0 for none.
    conflicts : tuple of int
        Shared values that the tests contradict; where chance is out of the question their statement was set aside.
    parts : tuple of str
        Unstated parts, of `core.sources.PARTS`, that the rig was granted; their sizes are among the shared values.
    candidates : tuple of Candidate
        Unstated parts that would explain a misfit, the best first; empty where all fits.
    """

    chi2: float
    dof: float
    fits: bool = True
    rig_error: float = 0.0
    inflation: float = 1.0
    scatter: float = 0.0
    unsteady: float = 0.0
    conflicts: tuple[int, ...] = ()
    parts: tuple[str, ...] = ()
    candidates: tuple[Candidate, ...] = ()


@dataclass
class _State:
    """How things stand after some rounds."""

    problem: Problem
    solution: Solution
    outlier: FloatArray
    misfit: Misfit | None = None
    conflicts: list[int] = field(default_factory=list)
    doubtful: list[int] = field(default_factory=list)
    parts: list[str] = field(default_factory=list)
    rig_error: float = 0.0
    inflation: float = 1.0
    scatter: float = 0.0
    unsteady: float = 0.0
    trifle: bool = True
    finished: bool = True

    @property
    def fits(self) -> bool:
        """Whether rig and channels as stated go together with the tests."""
        as_stated = not (self.conflicts or self.parts or self.rig_error)
        return self.finished and as_stated and (self.trifle or self.inflation <= _NOISE_IN_DOUBT)

    def solve(self, problem: Problem) -> None:
        self.problem = problem
        self.solution = solve(problem, self.solution.stiffness, self.solution.z)


def reconcile(problem: Problem, solution: Solution) -> tuple[Problem, Solution, FloatArray, Misfit]:
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
        strange = _outliers(state, left)
        if strange.any():
            factor = np.where(strange, np.maximum(left.whole / 2, 1.0), 1.0)
            state.outlier = state.outlier * factor
            state.solve(state.problem.rewhitened(state.problem.observed.whiten / np.sqrt(factor)[:, None, None]))
        elif not _mend(state, left):
            break
    else:
        state.finished = False
    # Doubtful values stay where luck would have them; how well they are known does not rest on luck.
    for at in state.doubtful:
        _set_aside(state, at, _IMPOSSIBLE)
    if state.doubtful:
        state.solution = spread(state.problem, state.solution)
    misfit = state.misfit or _as_it_is(state.solution, residuals(state.problem, state.solution))
    return (
        state.problem,
        state.solution,
        state.outlier,
        replace(
            misfit,
            rig_error=state.rig_error,
            inflation=state.inflation,
            scatter=state.scatter,
            unsteady=state.unsteady,
            conflicts=tuple(state.conflicts),
            parts=tuple(state.parts),
            fits=state.fits,
        ),
    )


@dataclass(frozen=True)
class _Diagnosis:
    """What chance cannot explain, and what would."""

    left: Residuals
    rig_chi2: float
    rig_dof: float
    tyre_chi2: float
    tyre_dof: float
    drawn: FloatArray
    named: list[Candidate]
    size: FloatArray
    effect: float

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
        """Of the statement drawn furthest away."""
        return float(self.drawn.max(initial=0.0))

    @property
    def explained(self) -> float:
        """By the best unstated part."""
        return self.named[0].explains if self.named else 0.0

    @property
    def rest(self) -> float:
        """Chi-square per degree of freedom that the statement drawn furthest away does not explain; at least 1."""
        if not (self.rig_bad or self.tyre_bad):
            return 1.0
        dof = max(self.rig_dof + self.tyre_dof - 1, 1.0)
        return max((self.rig_chi2 + self.tyre_chi2 - self.pull**2) / dof, 1.0)

    @property
    def contradicted(self) -> bool:
        """Whether a statement is drawn too far, and nothing unstated would explain much more."""
        best = max(self.explained, self.pull**2)
        return self.pull > _CONFLICT * np.sqrt(self.rest) and self.pull**2 >= _AS_GOOD * best

    @property
    def scattered(self) -> bool:
        """Whether the tyre differs between tests of one condition, and no gain or part explains it."""
        best = max(self.explained, self.pull**2)
        more_tyre = self.tyre_chi2 - self.tyre_dof > self.rig_chi2 - self.rig_dof
        return self.tyre_bad and best < 0.5 * self.excess and more_tyre

    @property
    def part_missing(self) -> bool:
        """Whether one unstated part of the rig explains a good share of a misfit, or is plain by itself."""
        if not self.named or not self.named[0].of_rig or self.effect < _TRIFLE:
            return False
        plain = self.explained > _PLAIN**2 * self.rest
        return plain or (self.rig_bad and self.explained > _WORTH_NAMING * (self.rig_chi2 - self.rig_dof))

    @cached_property
    def level(self) -> float:
        """Relative random error of Zr that would make the misfit of the rig what chance would."""
        if not self.rig_bad:
            return 0.0
        return _level(self.left.rig_part, self.left.rig_weight, self.rig_dof, self.size)


def _diagnosed(state: _State, left: Residuals) -> _Diagnosis:
    problem, solution = state.problem, state.solution
    named = candidates(problem, solution)
    size = largest_part(problem, solution)
    effect = 0.0
    if named and named[0].of_rig:
        speed = np.abs(problem.observed.amplitudes[:, 2])
        rig = problem.shared.rig_at(solution.z)
        shape = part_shapes(problem.observed.omega, rig, speed, problem.observed.rigid)[named[0].source.of]
        effect = float(np.max(np.abs(named[0].size * shape) / size))
    return _Diagnosis(
        left=left,
        rig_chi2=float(left.rig.sum() + solution.z @ solution.z),
        rig_dof=float(left.rig_dof.sum()),
        tyre_chi2=float(left.tyre.sum()),
        tyre_dof=2.0 * float((problem.conditions.sizes - 1).sum()),
        drawn=_drawn(state),
        named=named,
        size=size,
        effect=effect,
    )


def _mend(state: _State, left: Residuals) -> bool:
    """One remedy for the worst of what chance cannot explain; False where there is nothing more to do."""
    found = _diagnosed(state, left)
    state.misfit = state.misfit or _as_it_is(state.solution, left)
    problem, solution = state.problem, state.solution
    if state.rig_error == 0 and found.contradicted:
        _name(state, found.named)
        blamed = np.flatnonzero(found.drawn >= _AS_FAR * found.pull).tolist()
        state.conflicts += blamed
        if found.pull > _IMPOSSIBLE:
            for at in blamed:
                _set_aside(state, at, found.pull)
            state.solve(state.problem)
        else:
            state.doubtful += blamed
    elif found.scattered:
        scatter = _level(left.tyre_part, left.tyre_weight, found.tyre_dof, np.ones(left.tyre.size))
        state.scatter = float(np.hypot(state.scatter, scatter))
        state.solve(problem.widened(problem.columns("by_stiffness", solution.z, solution.stiffness) * scatter))
    elif found.part_missing and found.named[0].source.of not in state.parts:
        _name(state, found.named)
        _add_part(state, found.named[0])
    elif found.rig_bad and state.parts and found.level > _TRIFLE and state.rig_error < 1:
        state.rig_error = float(np.hypot(state.rig_error, found.level))
        columns = problem.columns("by_impedance", solution.z, solution.stiffness)
        state.solve(problem.widened(columns * (found.level * found.size)[:, None, None]))
    elif found.rig_bad and state.unsteady == 0 and (drive := _unsteady_drive(state, left, found)) is not None:
        state.unsteady, columns = drive
        state.solve(problem.widened(columns))
    elif found.rig_bad or found.tyre_bad:
        if found.level > _TRIFLE and found.explained > _WORTH_NAMING * found.excess:
            _name(state, found.named)
        state.trifle = state.trifle and found.level <= _TRIFLE
        ratio = (found.rig_chi2 + found.tyre_chi2) / (found.rig_dof + found.tyre_dof)
        state.inflation *= float(np.sqrt(ratio))
        state.solve(problem.rewhitened(problem.observed.whiten / np.sqrt(_each(left, ratio))[:, None, None]))
    else:
        return False
    return True


def _unsteady_drive(state: _State, left: Residuals, found: _Diagnosis) -> tuple[float, FloatArray] | None:
    """A random error of each frequency, relative, and its columns (N, 6, 1), where it explains most of the misfit.

    A drive whose speed wanders has no one frequency, and the inertia of the rig goes with its square.
    """
    problem, solution = state.problem, state.solution
    by_k, residual = (problem.columns(name, solution.z, solution.stiffness) for name in ("by_stiffness", "residual"))
    basis, _ = cholesky_qr(by_k)
    by_frequency = problem.by_log_frequency(solution.z, solution.stiffness)
    rest, along = (projected(basis)(columns[..., None])[..., 0] for columns in (residual, by_frequency))
    weight = np.sum(along**2, axis=1)
    seen = (left.rig_dof > 0) & (weight > 0)
    part = np.sum(along * rest, axis=1)
    mine = float(np.sum(part[seen] ** 2 / weight[seen])) - float(seen.sum())
    if mine < _MOSTLY * (found.rig_chi2 - found.rig_dof):
        return None
    level = _level(part[seen, None], weight[seen, None, None], float(seen.sum()), np.ones(int(seen.sum())))
    return (level, (by_frequency * level)[:, :, None]) if level < _TRIFLE else None


def _each(left: Residuals, ratio: float) -> FloatArray:
    """By how much the variance of each test is larger: all by the ratio on average, a test that is far off by more.

    The mean of a variance that is itself drawn, with `_KNOWN` degrees of freedom about the ratio, given the residual
    of the test: where noise is larger than the recordings say, it seldom is so in all of them alike.
    """
    return ratio * (_KNOWN + left.rig / ratio) / (_KNOWN + left.rig_dof)


def _name(state: _State, named: list[Candidate]) -> None:
    """Keep the candidates of the first misfit: later ones are judged with the noise enlarged already."""
    assert state.misfit is not None
    if not state.misfit.candidates:
        state.misfit = replace(state.misfit, candidates=tuple(named))


def _as_it_is(solution: Solution, left: Residuals) -> Misfit:
    """The misfit of a solution, before anything is done about it."""
    return Misfit(float(left.rig.sum() + solution.z @ solution.z), float(left.rig_dof.sum()))


def _outliers(state: _State, left: Residuals) -> BoolArray:
    """The few tests that do not go with the others, the worst of each condition at a time.

    They are few in all, and never most of the tests with one mass, or of the rigid blocks: what concerns these
    together is no outlier but what they are there to show.
    """
    whole, label = left.whole, state.problem.conditions.label
    limit = _OUTLIER * max(1.0, float(np.median(whole)) / 1.4)  # 1.4: the median of chi-square with 2 degrees
    before = state.outlier > 1
    strange = (whole > limit) & ~before
    worst = np.zeros(int(label.max(initial=-1)) + 2)
    np.maximum.at(worst, label, whole)
    chosen = strange & (whole >= worst[label])
    observed = state.problem.observed
    kinds = np.unique(np.stack([observed.rigid, observed.mass_at], axis=1), axis=0, return_inverse=True)[1].ravel()
    crowded = any(
        np.sum((chosen | before)[kinds == kind]) > _FEW_OF_A_KIND * np.sum(kinds == kind) for kind in np.unique(kinds)
    )
    few = max(_FEW * whole.size, 1.0 if whole.size > 2 else 0.0)
    if crowded or np.sum(strange | before) > few:
        return np.zeros(whole.size, dtype=bool)
    return chosen


def _drawn(state: _State) -> FloatArray:
    """How far each statement is drawn away, but for those set aside and for what nobody stated."""
    pull = np.abs(np.nan_to_num(pulls(state.solution)))
    pull[state.conflicts] = 0.0
    pull[[at for at, one in enumerate(state.problem.shared.parameters) if one.source.kind is Kind.UNSTATED]] = 0.0
    return pull


def _set_aside(state: _State, at: int, pull: float) -> None:
    """Make a statement so wide that it hardly pulls any more, and count z in the new uncertainty."""
    shared, z = state.problem.shared, state.solution.z.copy()
    wider = 10.0 * max(pull, 1.0)
    listed = list(shared.parameters)
    listed[at] = replace(listed[at], std=listed[at].std * wider)
    z[at] /= wider
    state.problem = replace(state.problem, shared=replace(shared, parameters=tuple(listed)))
    state.solution = replace(state.solution, z=z)


def _add_part(state: _State, candidate: Candidate) -> None:
    """Let the rig have a part that nobody stated, as large as the tests want it, and as uncertain."""
    shared = state.problem.shared
    source, size = candidate.source, abs(candidate.size)
    part = SharedParameter(source, PARTS[source.of], len(state.parts), 0.0, size)
    state.parts.append(source.of)
    state.solution = replace(state.solution, z=np.append(state.solution.z, 1.0))
    state.solve(replace(state.problem, shared=replace(shared, parameters=(*shared.parameters, part))))


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
