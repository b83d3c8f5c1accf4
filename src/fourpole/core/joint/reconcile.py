"""Reconcile the statement with the tests: scatter, drift, outliers, causes of a misfit, noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from fourpole.core.arrays import ComplexArray, FloatArray
from fourpole.core.joint.misfit import (
    NEGLIGIBLE,
    Candidate,
    Residuals,
    candidates,
    is_unlikely,
    largest_part,
    residuals,
)
from fourpole.core.joint.model import cholesky_qr, part_shapes, projected
from fourpole.core.joint.scatter import root_of
from fourpole.core.joint.shared import SharedParameter
from fourpole.core.joint.solve import Problem, Solution
from fourpole.core.joint.specimens import NOISE_IN_DOUBT, Misfit, SpecimenState, fit_specimens, without_drifts
from fourpole.core.sources import PARTS, Kind, Role, Source

#: A stated value is a cause of the misfit if it departs from its estimate by this many standard uncertainties.
_CONFLICT = 3.0
#: Least fraction of a cause's squared size that widens its statement; it applies where a cause is only just found.
_LEAST_LOSS = 1e-4
#: Causes that explain the misfit within this chi-square of the best one are named with it: 2 standard uncertainties.
_TIE = 4.0
#: A candidate is a cause only if it explains at least this share of what the best candidate explains.
_SHARE_OF_BEST = 0.8
#: A part is a cause of the misfit if it explains at least this share of it.
_SHARE_OF_CAUSE = 0.3
#: Rare errors are named only if they explain nearly the whole misfit: at least this share. They come before a common
#: error only if they leave less than this share of what it leaves.
_RARE, _WHOLE, _HALF = (Kind.CROSSTALK, Kind.GAIN_DRIFT), 0.9, 0.5
#: A candidate is a cause if its size is more than this many standard uncertainties, even without a misfit.
_SIGNIFICANT = 5.0
#: An unsteady drive is the cause of the misfit if it explains more than this share of it.
_MOSTLY = 0.7
#: Degrees of freedom of the prior for the noise of one test about the noise of all tests.
_PRIOR_DOF = 4.0
#: Chi-square below which there is no misfit in any test: that of the exact phasors of a plan is round-off.
_NOTHING = 1e-6
#: Largest number of rounds, each with one remedy.
_MOST_ROUNDS = 12


def reconcile(
    problem: Problem, solution: Solution, start: ComplexArray, gross: Sequence[Candidate] = ()
) -> tuple[Problem, Solution, FloatArray, Misfit]:
    """Repeat remedies until chance explains the residuals: scatter, outliers, drift, causes, noise.

    The specimen comes first, because K* of repeats that scatters looks like an error of any channel.

    Parameters
    ----------
    problem, solution : Problem, Solution
        The tests, and their solution with the statement unchanged.
    start : (c,) complex array [N/m]
        First value of K* of each condition.
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
    state = SpecimenState(problem, solution, start, np.ones(problem.observed.omega.size))
    if not gross and problem.scatter == 0 and solution.objective < _NOTHING:
        misfit = replace(state.misfit, **_unchanged(solution, residuals(problem, solution)))
        return problem, solution, state.outlier, misfit
    for count in range(_MOST_ROUNDS):
        fit_specimens(state)
        left = residuals(state.problem, state.solution)
        if not count:
            state.misfit = replace(state.misfit, **_unchanged(state.solution, left))
        if gross:
            state.misfit = replace(state.misfit, rig_error=1.0, candidates=tuple(gross), tied=len(gross))
            break
        if not _remedied(state, left):
            break
    else:
        state.finished = False
    return state.problem, state.solution, state.outlier, replace(state.misfit, fits=state.fits)


@dataclass(frozen=True, eq=False)
class _Diagnosis:
    """Misfit of a solution that chance cannot explain, and its possible causes.

    `size` is the largest part of Zr of each test; `effect` is the change of Zr, over `size`, by the best candidate.
    """

    left: Residuals
    rig_chi2: float
    rig_dof: float
    tyre_chi2: float
    tyre_dof: float
    named: list[Candidate]
    size: FloatArray
    effect: float

    @property
    def rig_bad(self) -> bool:
        """Whether chance cannot explain the residuals of the rig."""
        return is_unlikely(self.rig_chi2, self.rig_dof)

    @property
    def excess(self) -> float:
        """Chi-square of the rig that chance does not explain."""
        return self.rig_chi2 - self.rig_dof

    @property
    def rest(self) -> float:
        """Chi-square per degree of freedom without the best candidate; at least 1."""
        dof = max(self.rig_dof + self.tyre_dof - 1, 1.0)
        explained = self.named[0].explains if self.named else 0.0
        return max((self.rig_chi2 + self.tyre_chi2 - explained) / dof, 1.0)

    def is_cause(self, candidate: Candidate) -> bool:
        """Whether a candidate by itself explains too much for chance."""
        if candidate.released and candidate.explains > _CONFLICT**2 * self.rest:
            return True
        if candidate.of_rig and candidate is self.named[0] and self.effect < NEGLIGIBLE:
            return False
        significant = candidate.explains > _SIGNIFICANT**2 * self.rest
        return significant or (self.rig_bad and candidate.explains > max(_SHARE_OF_CAUSE * self.excess, _CONFLICT**2))

    @cached_property
    def causes(self) -> list[Candidate]:
        """The best cause, and those that explain the misfit as well; empty if no candidate is a cause."""
        best = next((candidate for candidate in self.named if self.is_cause(candidate)), None)
        if best is None or best.explains < _SHARE_OF_BEST * self.named[0].explains:
            return []
        return [candidate for candidate in self.named if candidate.explains >= best.explains - _TIE * self.rest]

    @cached_property
    def level(self) -> float:
        """Relative random error of Zr with which chance explains the misfit of the rig; 0 without a misfit."""
        if not self.rig_bad:
            return 0.0
        return _level(self.left.rig_part, self.left.rig_weight, self.rig_dof, self.size)


def _diagnosed(state: SpecimenState, left: Residuals) -> _Diagnosis:
    """The diagnosis of the present solution, from its residuals."""
    problem, solution = state.problem, state.solution
    rig_chi2, tyre_chi2 = float(left.rig.sum() + solution.z @ solution.z), float(left.tyre.sum())
    rig_dof = float(left.rig_dof.sum())
    # No candidate explains more than the whole chi-square. The exact phasors of a plan have a chi-square of zero.
    named = candidates(problem, solution) if rig_chi2 + tyre_chi2 > 1 else []
    known = {*state.misfit.added, *(problem.shared.parameters[index].source for index in state.misfit.conflicts)}
    known |= {Source(Kind.UNSTATED, part) for part, value in _TWINS.items() if value in known}
    bad, least = is_unlikely(rig_chi2, rig_dof), max(_WHOLE * (rig_chi2 - rig_dof), _SIGNIFICANT**2)
    named = [
        candidate
        for candidate in named
        if candidate.source not in known
        and (candidate.source.kind not in _RARE or (bad and candidate.explains > least))
    ]
    named = _common_first(named, rig_chi2 + tyre_chi2)
    size = largest_part(problem, solution.z, solution.stiffness)
    effect = np.inf
    if named and named[0].of_rig:
        speed = np.abs(problem.observed.amplitudes[:, 2])
        rig = problem.shared.rig_at(solution.z)
        shapes = part_shapes(problem.observed.omega, rig, speed, problem.observed.rigid)
        shape = shapes.get(named[0].source.of, 1j * problem.observed.omega)
        effect = float(np.max(np.abs(named[0].size * shape) / size))
    return _Diagnosis(
        left=left,
        rig_chi2=rig_chi2,
        rig_dof=rig_dof,
        tyre_chi2=tyre_chi2,
        tyre_dof=2.0 * float((problem.conditions.sizes - 1).sum()),
        named=named,
        size=size,
        effect=effect,
    )


def _common_first(named: list[Candidate], chi2: float) -> list[Candidate]:
    """The candidates with the best common one first, unless a rare one leaves much less of chi-square."""
    common = next((candidate for candidate in named if candidate.source.kind not in _RARE), None)
    if common is None or chi2 - named[0].explains < _HALF * (chi2 - common.explains):
        return named
    return [common, *(candidate for candidate in named if candidate is not common)]


def _remedied(state: SpecimenState, left: Residuals) -> bool:
    """Apply one remedy to the worst misfit that chance cannot explain; False if there is none."""
    diagnosis, misfit = _diagnosed(state, left), state.misfit
    if misfit.rig_error == 0 and diagnosis.causes:
        _apply(state, diagnosis)
    elif diagnosis.rig_bad and misfit.unsteady == 0 and (drive := _unsteady_drive(state, left, diagnosis)) is not None:
        state.solve(state.problem.widened(drive[1]), unsteady=drive[0])
    elif diagnosis.rig_bad and misfit.rig_error == 0 and _is_of_rig(state, diagnosis):
        _add_rig_error(state, diagnosis)
    elif diagnosis.rig_bad:
        _enlarge_noise(state, diagnosis)
    else:
        return False
    return True


def _is_of_rig(state: SpecimenState, diagnosis: _Diagnosis) -> bool:
    """Whether the misfit that is left is an error of the rig, not noise."""
    if diagnosis.level <= NEGLIGIBLE:
        return False
    noise = state.misfit.inflation * np.sqrt(diagnosis.rig_chi2 / diagnosis.rig_dof)
    return bool(state.misfit.conflicts or state.misfit.added or noise > NOISE_IN_DOUBT)


def _apply(state: SpecimenState, diagnosis: _Diagnosis) -> None:
    """Widen the statements that may be the cause of the misfit, and add the causes that nobody stated."""
    if not state.misfit.candidates:
        state.misfit = replace(state.misfit, candidates=tuple(diagnosis.named), tied=len(diagnosis.causes))
    # The drifts are removed; a drift that was only the effect of the cause is not found again.
    shared, z = without_drifts(state.problem.shared, state.solution.z)
    listed, conflicts, added = list(shared.parameters), list(state.misfit.conflicts), list(state.misfit.added)
    places = {parameter.source: i for i, parameter in enumerate(listed)}
    common = [cause for cause in diagnosis.causes if cause.source.kind not in _RARE]
    for cause in common or diagnosis.causes:
        # An unstated part acts as the value of the rig that the part belongs to, if that value has an uncertainty.
        here = places.get(cause.source, places.get(_TWINS.get(cause.source.of, cause.source)))
        # The part of the cause that widens its statement rises smoothly from `_CONFLICT` standard uncertainties on.
        loss = np.sqrt(max(1.0 - _CONFLICT**2 * diagnosis.rest / cause.explains, _LEAST_LOSS))
        if here is None:
            listed.append(_parameter(cause, loss, len(added), state.problem))
            z = np.append(z, 0.0)
            added.append(cause.source)
        elif here not in conflicts:
            wider = float(np.hypot(listed[here].std, loss * cause.size))
            z[here] *= listed[here].std / wider
            listed[here] = replace(listed[here], std=wider)
            conflicts.append(here)
    state.solution = replace(state.solution, z=z)
    wide = replace(state.problem, shared=replace(shared, parameters=tuple(listed)))
    state.solve(wide, conflicts=tuple(conflicts), added=tuple(added), drifts=())


#: The value of the rig that acts as an unstated part does.
_TWINS = {
    "mass": Source(Kind.RIG_VALUE, "moving_mass"),
    "spring": Source(Kind.RIG_VALUE, "preload_stiffness"),
    "loss": Source(Kind.RIG_VALUE, "preload_loss_factor"),
    "input": Source(Kind.RIG_VALUE, "input_mass"),
}


def _parameter(cause: Candidate, loss: float, number: int, problem: Problem) -> SharedParameter:
    """A cause that nobody stated, as a shared value: 0 as stated, with an uncertainty of the estimated size."""
    std = float(loss * abs(cause.size))
    if cause.source.role is Role.UNSTATED:
        return SharedParameter(cause.source, PARTS[cause.source.of], number, 0.0, std)
    if cause.source.kind is Kind.AMPLITUDE:
        return SharedParameter(cause.source, cause.unit, 0, 0.0, std)
    centre = 1.0 if cause.source.kind is Kind.GAIN else 0.0
    index = problem.errors.index(cause.source)
    return SharedParameter(cause.source, cause.unit, index, centre, std)


def _add_rig_error(state: SpecimenState, diagnosis: _Diagnosis) -> None:
    """Add an error of Zr to each test, of the size that chance then explains."""
    widened = without_rig(state.problem, state.solution.z, state.solution.stiffness, diagnosis.level)
    if not state.misfit.candidates:
        likely = [candidate for candidate in diagnosis.named if candidate.explains > _SHARE_OF_CAUSE * diagnosis.excess]
        state.misfit = replace(state.misfit, candidates=tuple(likely))
    state.solve(widened, rig_error=float(np.hypot(state.misfit.rig_error, diagnosis.level)))


def without_rig(problem: Problem, z: FloatArray, stiffness: ComplexArray, level: float) -> Problem:
    """The problem with an error of Zr in each test of a size relative to its largest part.

    The error may be common to all tests. Their mean then knows Zr no better than a single test does, so that its
    variance counts as many times as there are tests. K* then depends on the channels, and hardly on the rig.
    """
    columns = problem.without_spread.columns("by_impedance", z, stiffness)
    size = level * np.sqrt(len(columns)) * largest_part(problem, z, stiffness)
    return problem.widened(columns * size[:, None, None])


def _enlarge_noise(state: SpecimenState, diagnosis: _Diagnosis) -> None:
    """Enlarge the noise of all tests until chance explains the residuals of the rig."""
    state.negligible = state.negligible and diagnosis.level <= NEGLIGIBLE
    ratio = diagnosis.rig_chi2 / diagnosis.rig_dof
    whiten = state.problem.observed.whiten / np.sqrt(_each(diagnosis.left, ratio))[:, None, None]
    state.solve(state.problem.reweighted(whiten), inflation=state.misfit.inflation * float(np.sqrt(ratio)))


def _unsteady_drive(state: SpecimenState, left: Residuals, diagnosis: _Diagnosis) -> tuple[float, FloatArray] | None:
    """Relative random error of each frequency, and its columns (N, 6, 1), if it explains most of the misfit.

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
    if explained < _MOSTLY * (diagnosis.rig_chi2 - diagnosis.rig_dof):
        return None
    level = _level(part[used, None], weight[used, None, None], float(used.sum()), np.ones(int(used.sum())))
    return (level, (by_frequency * level)[:, :, None]) if level < NEGLIGIBLE else None


def _each(left: Residuals, ratio: float) -> FloatArray:
    """Factor (N,) of each test's variance: the ratio on average, and more for a test with a large residual.

    It is the posterior mean of a variance whose prior has `_PRIOR_DOF` degrees of freedom about the ratio. Noise that
    is larger than the recordings give is seldom equally large in all of them.
    """
    return ratio * (_PRIOR_DOF + left.rig / ratio) / (_PRIOR_DOF + left.rig_dof)


def _unchanged(solution: Solution, left: Residuals) -> dict[str, Any]:
    """Chi-square of the rig and its degrees of freedom before any remedy."""
    return {"chi2": float(left.rig.sum() + solution.z @ solution.z), "dof": float(left.rig_dof.sum())}


def _level(part: FloatArray, weight: FloatArray, dof: float, size: FloatArray) -> float:
    """Random error, relative to `size`, with which the squared residual in two directions equals `dof`."""
    values, vectors = np.linalg.eigh(weight * (size**2)[:, None, None])
    drawn = np.einsum("nij,ni->nj", vectors, part * size[:, None]) ** 2
    usable = values > 1e-12 * max(float(values.max(initial=0.0)), 1e-300)
    values, drawn = values[usable], drawn[usable]
    return root_of(lambda level: float(np.sum(drawn / values / (1 + level**2 * values))) - dof)
