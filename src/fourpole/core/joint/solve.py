"""The most probable shared values and K* of all conditions, at a cost that is linear in the number of tests."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from fourpole.core.arrays import BoolArray, ByValue, ComplexArray, FloatArray
from fourpole.core.joint.conditions import JointConditions
from fourpole.core.joint.model import Linear, Observed, inverse_upper, linearise, upper_factor
from fourpole.core.joint.shared import Shared, SharedParameter
from fourpole.core.sources import Source

#: Number of tests in a chunk, which stays in the cache of the processor and bounds the memory; with more than `_USUAL`
#: shared values there are fewer. Of no more tests than `_KEPT` the linearised model is kept.
_CHUNK, _USUAL, _KEPT = 2048, 64, 4096
#: Rows of a block in the first step of a QR decomposition.
_BLOCK = 4 * 64
#: Weight of a statement that counts for little; without any, columns that are alike have no decomposition.
_LITTLE = 0.03
#: More columns than this are decomposed by a Cholesky step, if more than this fraction of the norm of each remains
#: after projecting out those before it: the round-off of the step grows with the square of its inverse.
_MANY, _REGULAR = 20, 3e-5
_MOST_STEPS = 60
#: The search has converged if a step is below this share of every standard uncertainty.
_SMALL = 1e-5
#: The evidence is known if the next step lowers the objective by less than this, of an objective of this.
_SLIGHT, _ROUGHLY = 0.02, 1e3
#: If no such step is found, a last step below this share of every standard uncertainty is also accepted.
_CLOSE = 1e-2
#: The search has also converged if the objective has not fallen by this much in so many steps of at least this share.
#: If the tests do not distinguish two shared values, the minimum is a curved valley in which every step is long.
_FLAT, _FLAT_STEPS, _FLAT_SHARE = 0.01, 8, 0.1
#: A search that leaves more than this of each test is in vain, and has converged if it falls by less than this share.
MUCH, _VAIN = 40.0, 0.01
#: Allowed rise of the objective, relative and absolute, because K* is updated with the slopes of the previous step.
_ALLOWED_RISE = 1e-3
#: Steps of K* alone that are tried before a step that raises the objective is halved, as long as each takes this share
#: of the rise away.
_CORRECTIONS, _USEFUL = 4, 0.5


@dataclass(frozen=True, eq=False)
class Problem(ByValue):
    """Tests sorted by condition, and what they share.

    Attributes
    ----------
    observed : Observed
    conditions : JointConditions
    shared : Shared
    errors : tuple of Source
        The errors of the channels, in the order of `Observed.turns`.
    names : tuple of str
        The specimens, in the order of `Observed.specimen`.
    specimens : tuple of SharedParameter
        Drifts and blocks that are possible; a standard uncertainty of 0 is not among the shared values.
    scatter : float [1]
        Standard deviation of Re and Im of log K* of a test about those of its condition, besides the noise.
    apart : (N,) float array [1], optional
        The same for each test, because its temperature is not the mean of its condition; by default 0.
    lines : (N,) float array [1], optional
        Number of lines of the recording that a test is one of; by default 1.
    support : float [1]
        Standard uncertainty of what frame and foundation add to the preload spring, over it.
    """

    observed: Observed
    conditions: JointConditions
    shared: Shared
    errors: tuple[Source, ...] = ()
    names: tuple[str, ...] = ("",)
    specimens: tuple[SharedParameter, ...] = ()
    scatter: float = 0.0
    apart: FloatArray | None = None
    lines: FloatArray | None = None
    support: float = 0.0
    _kept: list[Any] = field(default_factory=list, init=False, repr=False, compare=False)

    @property
    def spread(self) -> FloatArray:
        """Standard deviation (N,) of log K* of each test about that of its condition, besides the noise [1].

        The K* of all n lines of a recording may scatter together. They know as much of a shared value as independent
        lines whose scatter is larger by the root of n.
        """
        together = np.ones(self.conditions.label.size) if self.lines is None else np.sqrt(self.lines)
        return np.hypot(self.scatter * together, 0.0 if self.apart is None else self.apart)

    def with_scatter(self, own: FloatArray) -> Problem:
        """The same tests with a scatter (s,) of each specimen in place of one of all [1]."""
        apart = own[self.observed.specimen] * replace(self, scatter=1.0, apart=None).spread
        return replace(self, scatter=0.0, apart=np.hypot(apart, 0.0 if self.apart is None else self.apart))

    @property
    def without_spread(self) -> Problem:
        """The same tests as if K* of a test were that of its condition."""
        return replace(self, scatter=0.0, apart=None)

    def reweighted(self, whiten: FloatArray) -> Problem:
        """The same tests with another matrix of weights."""
        return replace(self, observed=replace(self.observed, whiten=whiten))

    def widened(self, columns: FloatArray) -> Problem:
        """The same tests with additional noise along `columns` (N, 6, k), in units of the present noise."""
        unit = np.broadcast_to(np.eye(6), (len(columns), 6, 6))
        root = np.linalg.qr(np.concatenate([unit, np.swapaxes(columns, 1, 2)], axis=1), mode="r")  # of 1 + C C^T
        root = root * np.sign(np.diagonal(root, axis1=1, axis2=2))[:, :, None]
        return self.reweighted(np.linalg.solve(np.swapaxes(root, 1, 2), self.observed.whiten))

    def thinned(self, most: int) -> Problem:
        """Some of the families, evenly chosen, with about so many tests together; all if there are no more."""
        conditions = self.conditions
        share = most / max(conditions.label.size, 1)
        if share >= 1 or not conditions.count:
            return self
        number = np.unique(conditions.family, return_inverse=True)[1]
        count = int(number.max()) + 1
        kept = np.isin(number, np.linspace(0, count - 1, max(round(share * count), 1)).astype(int))
        return self.part(np.append(kept, [True])[conditions.label])  # rigid blocks stay

    def part(self, rows: BoolArray) -> Problem:
        """Some of the tests."""
        of_test = self.conditions.label[rows]
        label = np.unique(np.append(of_test, -1), return_inverse=True)[1][:-1] - 1
        family, k1 = (np.append(one, [-1])[of_test] for one in (self.conditions.family, self.conditions.k1))
        observed = self.observed.part(rows)
        apart, lines = (one if one is None else one[rows] for one in (self.apart, self.lines))
        fewer = JointConditions(label, family, observed.omega / (2 * np.pi), k1)
        return replace(self, observed=observed, conditions=fewer, apart=apart, lines=lines)

    def chunks(self) -> Iterator[tuple[slice, slice]]:
        """Slices of tests and of conditions that form a chunk: whole conditions, or rigid blocks alone."""
        conditions, most = self.conditions, _CHUNK * _USUAL // max(len(self.shared), _USUAL)
        for first in range(0, conditions.first, most):
            yield slice(first, min(first + most, conditions.first)), slice(0, 0)
        ends = np.append(conditions.starts, conditions.label.size)
        first = 0
        while first < conditions.count:
            to = max(int(np.searchsorted(ends, ends[first] + most, side="right")) - 1, first + 1)
            yield slice(int(ends[first]), int(ends[to])), slice(first, to)
            first = to

    def linearised(self, z: FloatArray, stiffness: ComplexArray) -> Iterator[tuple[slice, slice, Linear]]:
        """The linearised model of each chunk at shared values z and K* of each condition.

        That of few tests is kept for the next call: a solution is examined several times.
        """
        if self._kept and np.array_equal(self._kept[0], z) and np.array_equal(self._kept[1], stiffness):
            yield from self._kept[2]
            return
        carried, label, spread, parts = self.conditions.carried(stiffness), self.conditions.label, self.spread, []
        for rows, group in self.chunks():
            own = stiffness[label[rows]] * carried[rows] if group.stop else np.ones(rows.stop - rows.start, complex)
            linear = linearise(self.observed.part(rows), self.shared, z, own).scattered(spread[rows])
            if label.size <= _KEPT:
                parts.append((rows, group, linear))
            yield rows, group, linear
        if label.size <= _KEPT:
            self._kept[:] = [z.copy(), stiffness.copy(), parts]

    def columns(self, name: str, z: FloatArray, stiffness: ComplexArray) -> np.ndarray:
        """One field of the linearised model for all tests, as `Linear.field` returns it."""
        return np.concatenate([linear.field(name) for _, _, linear in self.linearised(z, stiffness)])

    def by_log_frequency(self, z: FloatArray, stiffness: ComplexArray) -> FloatArray:
        """Derivative (N, 6) of the residual by log frequency, by a central difference."""
        step = 1e-5
        omega = self.observed.omega
        above, below = (
            replace(self, observed=replace(self.observed, omega=omega * side)).columns("residual", z, stiffness)
            for side in (1 + step, 1 - step)
        )
        return (above - below) / (2 * step)


@dataclass(frozen=True, eq=False)
class Solution(ByValue):
    r"""The most probable values, and the normal distribution about them.

    The error of log K* of condition c is :math:`\epsilon_c - B_c\,\delta z`. The covariance of :math:`\epsilon_c`, from
    the noise for known shared values, is `own`; the covariance of :math:`\delta z` is `covariance`.

    Attributes
    ----------
    z : (p,) float array
        Departures of the shared values from the statement, in stated standard uncertainties.
    stiffness : (c,) complex array [N/m]
        K* of each condition.
    covariance : (p, p) float array
        Covariance of z.
    own : (c, 2, 2) float array
        Covariance of Re, Im of log K* for known shared values.
    slope : (c, 2, p) float array
        B_c.
    objective : float
        Sum of squared residuals of the tests and of the statement.
    steps : int
        Number of steps.
    converged : bool
        Whether the search converged.
    reason : str
        Why the search did not converge; empty if it did.
    evidence : float
        Logarithm of the evidence, up to a constant.
    doubt : (c, 2, 2) float array
        Covariance of Re, Im of log K* by other explanations of the tests, besides `own` and that by the slope.
    """

    z: FloatArray
    stiffness: ComplexArray
    covariance: FloatArray
    own: FloatArray
    slope: FloatArray
    objective: float
    steps: int
    converged: bool
    reason: str = ""
    evidence: float = 0.0
    doubt: FloatArray | float = 0.0

    def doubted(self, others: Sequence[Solution], weights: FloatArray) -> Solution:
        """The solution whose uncertainty of K* holds that of others, each with its weight (e,)."""
        stiffness = np.reshape([other.stiffness for other in others], (len(others), self.stiffness.size))
        off = np.log(stiffness / self.stiffness)
        parts = np.stack([off.real, off.imag], axis=-1)
        return replace(self, doubt=self.doubt + np.einsum("e,eci,ecj->cij", weights, parts, parts))


@dataclass(frozen=True, eq=False)
class Step(ByValue):
    """Result of one sweep over all tests: the objective at a point, and the Gauss-Newton step from it.

    `weigh` is the logarithm of the determinant of the weights by scatter.
    """

    objective: float
    dz: FloatArray
    dlog_k: FloatArray
    own_step: FloatArray
    triangle: FloatArray
    own_root: FloatArray
    slope: FloatArray
    weigh: float = 0.0
    fall: float = 0.0

    @property
    def evidence(self) -> float:
        """Logarithm of the evidence for equal `volume`, up to a constant, by the normal distribution about the values.

        K* of a condition has no statement, so that another volume is another unit of K*, and no evidence.
        """
        return self.weigh - 0.5 * self.objective - float(np.sum(np.log(np.abs(np.diag(self.triangle)))))

    @property
    def volume(self) -> float:
        """Logarithm of the volume that K* of all conditions has for known shared values."""
        return float(np.sum(np.log(np.abs(np.linalg.det(self.own_root)))))

    @property
    def covariance(self) -> FloatArray:
        """Covariance (p, p) of z."""
        root = np.linalg.inv(self.triangle) if self.triangle.size else self.triangle
        return root @ root.T

    @property
    def own(self) -> FloatArray:
        """Covariance (c, 2, 2) of log K* for known shared values."""
        return self.own_root @ np.swapaxes(self.own_root, 1, 2)

    @property
    def distribution(self) -> tuple[FloatArray, FloatArray, FloatArray, float]:
        """Covariance, `own`, slope and objective, as a solution has them."""
        return self.covariance, self.own, self.slope, self.objective

    def size(self) -> float:
        """Largest change of a value, in its standard uncertainty [1]."""
        covariance = self.covariance
        shared = np.abs(self.dz) / np.sqrt(np.diag(covariance))
        spread = np.sqrt(np.diagonal(self.own + self.slope @ covariance @ np.swapaxes(self.slope, 1, 2), 0, 1, 2))
        each = np.abs(self.dlog_k) / spread
        return float(max(shared.max(initial=0.0), each.max(initial=0.0)))


def solve(
    problem: Problem,
    start: ComplexArray,
    z: FloatArray | None = None,
    most: int = 0,
    slope: FloatArray | None = None,
    *,
    rough: bool = False,
) -> Solution:
    """Gauss-Newton iteration on the residuals without the drive; a step that does not help is halved.

    Parameters
    ----------
    problem : Problem
        The tests and their weights.
    start : (c,) complex array [N/m]
        First value of K* of each condition.
    z : (p,) float array, optional
        First shared values; by default as stated.
    most : int
        Largest number of steps; 0 for the usual one.
    slope : (c, 2, q) float array, optional
        Slope of log K* by the first q shared values, of a solution nearby.
    rough : bool
        Whether the search ends where the evidence is known, and the values need not be.

    Returns
    -------
    Solution
        The values with the smallest objective found. If the search did not converge, `reason` says why.
    """
    z, most = np.zeros(len(problem.shared)) if z is None else z, most or _MOST_STEPS
    stiffness, step, share = start, sweep(problem, z, start, slope), 1.0
    if problem.conditions.is_apart and slope is None:  # a full sweep needs the slopes of log K*
        step = sweep(problem, z, start, step.slope)
    before = lowest = (z, stiffness, step)
    flat = 0
    reason = f"the search did not converge in {most} steps"
    converged = False
    count = 0
    for count in range(1, most + 1):  # noqa: B007 - the number of steps is reported
        if not no_worse(step, before[2]):
            share *= 0.5
            if share < 1e-6:
                reason = "no step lowers the residual: the rig as stated and the recordings contradict each other"
                break
        else:
            before = (z, stiffness, step)
            vain = _VAIN * max(0.0, step.objective - MUCH * problem.conditions.label.size)
            falls = step.objective < lowest[2].objective - _FLAT - vain
            flat = 0 if falls else flat + (share >= _FLAT_SHARE or vain > 0)
            lowest = before if flat == 0 or step.objective < lowest[2].objective else lowest
            share = min(1.0, 2 * share)
            if step.size() < _SMALL or (rough and step.fall < _SLIGHT * max(1.0, step.objective / _ROUGHLY)):
                converged, reason = True, ""
                break
            if flat > _FLAT_STEPS:
                before, converged, reason = lowest, True, ""
                break
        z0, k0, best = before
        z = z0 + share * best.dz
        stiffness = moved(k0, share * best.dlog_k)
        step = sweep(problem, z, stiffness, best.slope)
        for _ in range(_CORRECTIONS):
            # Steps of poorly known shared values are long, and K* does not follow them linearly.
            if no_worse(step, best):
                break
            follows = moved(stiffness, step.own_step)
            after = sweep(problem, z, follows, best.slope)
            useful = step.objective - after.objective > _USEFUL * (step.objective - best.objective)
            stiffness, step = (follows, after) if after.objective < step.objective else (stiffness, step)
            if not useful:
                break
    z, stiffness, step = before
    if step.size() < _CLOSE:
        converged, reason = True, ""
    return Solution(z, stiffness, *step.distribution, count, converged, reason, step.evidence)


def solution_of_part(problem: Problem, solution: Solution, rows: BoolArray) -> tuple[Problem, Solution]:
    """Some of the tests of a problem, and what these alone say about the values of its solution."""
    few, label = problem.part(rows), problem.conditions.label[rows]
    stiffness = solution.stiffness[np.unique(label[label >= 0])]
    step = sweep(few, solution.z, stiffness)
    step = sweep(few, solution.z, stiffness, step.slope)
    return few, Solution(solution.z, stiffness, *step.distribution, 0, converged=True, evidence=step.evidence)


def solve_either(
    problem: Problem,
    start: ComplexArray,
    z: FloatArray | None = None,
    most: int = 0,
    slope: FloatArray | None = None,
    *,
    rough: bool = False,
) -> tuple[Problem, Solution]:
    """The solution of a problem; if its search does not converge, of the problem with K1 unknown, and that problem.

    K2 and C may vary too fast near their poles to be interpolated; K* itself does not.
    """
    solution = solve(problem, start, z, most, slope, rough=rough)
    if solution.converged or not (problem.conditions.is_apart and np.isfinite(problem.conditions.k1).any()):
        return problem, solution
    simpler = replace(problem, conditions=problem.conditions.without_k1())
    there = sweep(simpler, solution.z, solution.stiffness, solution.slope).objective
    if abs(there - solution.objective) < _FLAT + _ALLOWED_RISE * there:  # this is not the reason
        return problem, solution
    return simpler, solve(simpler, start, z, most, rough=rough)


def no_worse(step: Step, before: Step) -> bool:
    """Whether the objective does not rise by more than the allowance."""
    return bool(step.objective <= before.objective * (1 + _ALLOWED_RISE) + _ALLOWED_RISE)


def moved(stiffness: ComplexArray, dlog_k: FloatArray) -> ComplexArray:
    """K* with changes (c, 2) of Re and Im of its logarithm, each limited to a modulus of 1."""
    change = dlog_k[:, 0] + 1j * dlog_k[:, 1]
    return np.asarray(stiffness * np.exp(change / np.maximum(1.0, np.abs(change))))


def sweep(problem: Problem, z: FloatArray, stiffness: ComplexArray, before: FloatArray | None = None) -> Step:
    """Objective and step from all tests; `before` (c, 2, p) is the slope of log K* from the step before."""
    p = len(problem.shared)
    before = np.zeros((problem.conditions.count, 2, p)) if before is None else before
    triangle, objective, weigh, (own_root, slope, own_step) = reduced(problem, z, stiffness, before)
    dz = np.linalg.solve(triangle[:p, :p], triangle[:p, p]) if p else np.zeros(0)
    fall = objective - float(triangle[p, p] ** 2)
    return Step(objective, dz, own_step - slope @ dz, own_step, triangle[:p, :p], own_root, slope, weigh, fall)


def reduced(
    problem: Problem, z: FloatArray, stiffness: ComplexArray, before: FloatArray, free: int = 0, *, slopes: bool = True
) -> tuple[FloatArray, float, float, tuple[FloatArray, FloatArray, FloatArray]]:
    """All tests reduced to a triangle of the shared values and the residual, with K* of each condition projected out.

    Parameters
    ----------
    problem, z, stiffness
        The tests, and the point at which they are linear.
    before : (c, 2, q) float array
        Slope of log K* by the first q shared values from a step before, or 0.
    free : int
        Number of the last shared values whose statement counts for little here.
    slopes : bool
        Whether the slopes are asked for; without them no memory is taken for them.

    Returns
    -------
    triangle : (p + 1 or more, p + 1) float array
        R of the QR decomposition.
    objective, weigh : float
        Sum of squares, and logarithm of the determinant of the weights by scatter.
    own : tuple of (c, 2, 2), (c, 2, p) and (c, 2) float arrays
        For each K*: the inverse of its own triangle, its slope by the shared values, and its step for known ones.
    """
    p, conditions = len(problem.shared), problem.conditions
    triangle = np.hstack([np.diag(np.append(np.ones(p - free), np.full(free, _LITTLE))), -z[:, None]])
    objective, weigh = float(z @ z), 0.0
    roots, slope, own_step = (np.zeros((conditions.count, *shape)) for shape in ((2, 2), (2, p), (2,)))
    for rows, group, linear in problem.linearised(z, stiffness):
        objective += float(np.sum(linear.residual**2))
        if linear.log_weight is not None:
            weigh += float(np.sum(linear.log_weight))
        columns = np.concatenate([linear.by_shared, linear.residual[:, :, None]], axis=2)
        if group.stop > group.start:
            if conditions.is_apart:
                columns[:, :, : before.shape[2]] += linear.by_stiffness @ conditions.lead(before, rows, group)
            starts = conditions.starts[group] - rows.start
            roots[group], share, columns = without_stiffness(linear.by_stiffness, columns, starts)
            moved = roots[group] @ share
            own_step[group] = moved[:, :, p]
            if slopes:
                slope[group] = moved[:, :, :p]
        triangle = with_columns(triangle, columns, 0.0 if free else _REGULAR)
    return triangle, objective, weigh, (roots, slope, own_step)


def with_columns(triangle: FloatArray, columns: FloatArray, regular: float = _REGULAR) -> FloatArray:
    """R of the QR decomposition of a triangle (k, k) above the columns (N, 4, k).

    They are decomposed in small blocks. Many columns are decomposed, faster, by a Cholesky step, if more than the share
    `regular` of each is left without those before it.
    """
    k = columns.shape[2]
    rows = columns.reshape(-1, k)
    if k > _MANY:
        gram = triangle.T @ triangle + rows.T @ rows
        size = np.sqrt(np.diag(gram))
        with suppress(np.linalg.LinAlgError):
            root = np.linalg.cholesky(gram / np.where(size > 0, np.outer(size, size), 1.0)).T
            if np.min(np.diag(root)) > regular:
                return np.asarray(root * size)
    whole_blocks = rows.shape[0] // _BLOCK * _BLOCK
    blocks = np.asarray(np.linalg.qr(rows[:whole_blocks].reshape(-1, _BLOCK, k), mode="r")).reshape(-1, k)
    return np.asarray(np.linalg.qr(np.vstack([triangle, blocks, rows[whole_blocks:]]), mode="r"))


def without_stiffness(
    by_stiffness: FloatArray, columns: FloatArray, starts: np.ndarray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Project K* of each condition out of columns: R^-1 (c, 2, 2), Q^T columns (c, 2, k), and the rest (N, 4, k)."""
    sizes = np.diff(np.append(starts, by_stiffness.shape[0]))
    basis, root = by_stiffness, np.eye(2)
    for _ in range(2):  # twice, because one pass amplifies round-off by the squared condition number
        inverse = inverse_upper(upper_factor(np.add.reduceat(np.swapaxes(basis, 1, 2) @ basis, starts, axis=0)))
        basis = basis @ np.repeat(inverse, sizes, axis=0)
        root = root @ inverse
    share = np.add.reduceat(np.swapaxes(basis, 1, 2) @ columns, starts, axis=0)
    return root, share, columns - basis @ np.repeat(share, sizes, axis=0)
