"""The most probable shared values and K* of all conditions, by their structure: cost linear in the tests."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from fourpole.core.arrays import ByValue, ComplexArray, FloatArray
from fourpole.core.joint.conditions import Conditions
from fourpole.core.joint.model import Linear, Observed, inverse_upper, linearise, upper_factor
from fourpole.core.joint.shared import Shared

__all__ = ["Problem", "Solution", "solve", "spread", "with_columns", "without_stiffness"]

#: Tests worked on at once: what fits into the processor's cache many times over, so that memory stays bounded.
_CHUNK = 4096
_BLOCK = 6 * 64
_MOST_STEPS = 60
#: A step below this share of every uncertainty ends the search.
_SMALL = 1e-5
#: Where it does not, a step below this share of every uncertainty is near enough.
_CLOSE = 1e-2
#: The objective may rise by this: K* is carried within a condition by slopes of the step before.
_LAGGED = 1e-3
#: Where a step raises the objective, K* alone is mended this often before the step is halved.
_MENDED = 4


@dataclass(frozen=True)
class Problem:
    """Tests sorted by condition, with what they share."""

    observed: Observed
    conditions: Conditions
    shared: Shared

    def rewhitened(self, whiten: FloatArray) -> Problem:
        """The same tests with other weights."""
        return replace(self, observed=replace(self.observed, whiten=whiten))

    def widened(self, columns: FloatArray) -> Problem:
        """The same tests with noise that has `columns` (N, 6, k), in units of the present noise, in addition."""
        covariance = np.eye(6) + columns @ np.swapaxes(columns, 1, 2)
        return self.rewhitened(np.linalg.solve(np.linalg.cholesky(covariance), self.observed.whiten))

    def chunks(self) -> Iterator[tuple[slice, slice]]:
        """Tests and conditions that are worked on together: whole conditions, rigid blocks by themselves."""
        conditions = self.conditions
        for first in range(0, conditions.first, _CHUNK):
            yield slice(first, min(first + _CHUNK, conditions.first)), slice(0, 0)
        ends = np.append(conditions.starts, conditions.label.size)
        at = 0
        while at < conditions.count:
            to = max(int(np.searchsorted(ends, ends[at] + _CHUNK, side="right")) - 1, at + 1)
            yield slice(int(ends[at]), int(ends[to])), slice(at, to)
            at = to

    def linearised(self, z: FloatArray, stiffness: ComplexArray) -> Iterator[tuple[slice, slice, Linear]]:
        """The model, chunk by chunk, at shared values z and K* of each condition."""
        carried = self.conditions.carried(stiffness)
        label = self.conditions.label
        for rows, group in self.chunks():
            own = stiffness[label[rows]] * carried[rows] if group.stop else np.ones(rows.stop - rows.start, complex)
            yield rows, group, linearise(self.observed.part(rows), self.shared, z, own)

    def columns(self, name: str, z: FloatArray, stiffness: ComplexArray) -> np.ndarray:
        """One part of the linearised model for all tests, by its name in `Linear`."""
        return np.concatenate([getattr(linear, name) for _, _, linear in self.linearised(z, stiffness)])

    def by_log_frequency(self, z: FloatArray, stiffness: ComplexArray) -> FloatArray:
        """Derivative (N, 6) of the residual by log frequency: by a difference, whose error is far below its use."""
        step = 1e-5
        omega = self.observed.omega
        above, below = (
            replace(self, observed=replace(self.observed, omega=omega * side)).columns("residual", z, stiffness)
            for side in (1 + step, 1 - step)
        )
        return (above - below) / (2 * step)


@dataclass(frozen=True, eq=False)
class Solution(ByValue):
    r"""The most probable values, and their joint Gaussian around them.

    The error of log K* of condition c is :math:`\epsilon_c - B_c\,\delta z` with :math:`\epsilon_c` of covariance
    `own` (what the noise would leave if the shared values were known) and :math:`\delta z` of covariance `covariance`.

    Attributes
    ----------
    z : (p,) float array
        Shared values, in their stated uncertainties from what is stated.
    stiffness : (c,) complex array [N/m]
        K* of each condition.
    covariance : (p, p) float array
        Of z.
    own : (c, 2, 2) float array
        Covariance of Re, Im of log K* for known shared values.
    slope : (c, 2, p) float array
        B_c.
    objective : float
        Sum of squared residuals, of the tests and of what is stated.
    steps : int
        Steps taken.
    converged : bool
        False where the search did not come to rest; `reason` says why.
    reason : str
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


@dataclass(frozen=True)
class _Step:
    """What one sweep over all tests gives: the objective here, and the best step from here."""

    objective: float
    dz: FloatArray
    dlog_k: FloatArray
    own_step: FloatArray
    triangle: FloatArray
    own_root: FloatArray
    slope: FloatArray

    @property
    def covariance(self) -> FloatArray:
        root = np.linalg.inv(self.triangle) if self.triangle.size else self.triangle
        return root @ root.T

    @property
    def own(self) -> FloatArray:
        return self.own_root @ np.swapaxes(self.own_root, 1, 2)

    def size(self) -> float:
        """Largest change, in its uncertainty."""
        covariance = self.covariance
        shared = np.abs(self.dz) / np.sqrt(np.diag(covariance))
        spread = np.sqrt(np.diagonal(self.own + self.slope @ covariance @ np.swapaxes(self.slope, 1, 2), 0, 1, 2))
        each = np.abs(self.dlog_k) / spread
        return float(max(shared.max(initial=0.0), each.max(initial=0.0)))


def solve(problem: Problem, start: ComplexArray, z: FloatArray | None = None) -> Solution:
    """Gauss-Newton on the drive-free residuals, steps halved where they do not help.

    Parameters
    ----------
    problem : Problem
        The tests and their weights.
    start : (c,) complex array [N/m]
        K* of each condition to start from.
    z : (p,) float array, optional
        Shared values to start from; as stated without it.

    Returns
    -------
    Solution
        `converged` is False, with a reason, where no rest was found; the values are the best that were met.
    """
    z = np.zeros(len(problem.shared)) if z is None else z
    first = _sweep(problem, z, start)
    stiffness, step, share = start, _sweep(problem, z, start, first.slope), 1.0
    before = (z, stiffness, step)
    reason = f"the search did not come to rest in {_MOST_STEPS} steps"
    converged = False
    count = 0
    for count in range(1, _MOST_STEPS + 1):  # noqa: B007 - the number of steps is reported
        if not _no_worse(step, before[2]):
            share *= 0.5
            if share < 1e-6:
                reason = "no step lowers the residual: the rig as stated and the recordings do not go together"
                break
        else:
            before, share = (z, stiffness, step), min(1.0, 2 * share)
            if step.size() < _SMALL:
                converged, reason = True, ""
                break
        z0, k0, best = before
        z = z0 + share * best.dz
        stiffness = _moved(k0, share * best.dlog_k)
        step = _sweep(problem, z, stiffness, best.slope)
        for _ in range(_MENDED):
            # a step along the shared values is long where they are hardly known: K* does not follow in a straight line
            if _no_worse(step, best):
                break
            stiffness = _moved(stiffness, step.own_step)
            step = _sweep(problem, z, stiffness, best.slope)
    z, stiffness, step = before
    if step.size() < _CLOSE:
        converged, reason = True, ""
    return Solution(z, stiffness, step.covariance, step.own, step.slope, step.objective, count, converged, reason)


def _no_worse(step: _Step, before: _Step) -> bool:
    return bool(step.objective <= before.objective * (1 + _LAGGED) + _LAGGED)


def _moved(stiffness: ComplexArray, dlog_k: FloatArray) -> ComplexArray:
    """K* changed by so much of its logarithm, but by no more than 1."""
    change = dlog_k[:, 0] + 1j * dlog_k[:, 1]
    return np.asarray(stiffness * np.exp(change / np.maximum(1.0, np.abs(change))))


def spread(problem: Problem, solution: Solution) -> Solution:
    """The same values with the uncertainties that another problem gives them."""
    first = _sweep(problem, solution.z, solution.stiffness)
    step = _sweep(problem, solution.z, solution.stiffness, first.slope)
    return replace(solution, covariance=step.covariance, own=step.own, slope=step.slope)


def _sweep(problem: Problem, z: FloatArray, stiffness: ComplexArray, before: FloatArray | None = None) -> _Step:
    """One look at all tests; `before` is the slope of log K* as last known, which the carried K* follow."""
    p = len(problem.shared)
    lead = np.zeros((problem.conditions.label.size, 2, p)) if before is None else problem.conditions.lead(before)
    triangle = np.hstack([np.eye(p), -z[:, None]])
    objective = float(z @ z)
    roots, slopes, own_steps = [], [], []
    for rows, group, linear in problem.linearised(z, stiffness):
        objective += float(np.sum(linear.residual**2))
        by_shared = linear.by_shared + linear.by_stiffness @ lead[rows]
        columns = np.concatenate([by_shared, linear.residual[:, :, None]], axis=2)
        if group.stop > group.start:
            starts = problem.conditions.starts[group] - rows.start
            root, share, columns = without_stiffness(linear.by_stiffness, columns, starts)
            moved = root @ share
            roots.append(root)
            slopes.append(moved[:, :, :p])
            own_steps.append(moved[:, :, p])
        triangle = with_columns(triangle, columns)
    dz = np.linalg.solve(triangle[:p, :p], triangle[:p, p]) if p else np.zeros(0)
    slope = np.concatenate(slopes) if slopes else np.zeros((0, 2, p))
    own_step = np.concatenate(own_steps) if own_steps else np.zeros((0, 2))
    own_root = np.concatenate(roots) if roots else np.zeros((0, 2, 2))
    return _Step(objective, dz, own_step - slope @ dz, own_step, triangle[:p, :p], own_root, slope)


def with_columns(triangle: FloatArray, columns: FloatArray) -> FloatArray:
    """R of a triangle (k, k) on top of the columns (N, 6, k); in small blocks, which need no threads to be quick."""
    k = columns.shape[2]
    rows = columns.reshape(-1, k)
    whole = rows.shape[0] // _BLOCK * _BLOCK
    blocks = np.asarray(np.linalg.qr(rows[:whole].reshape(-1, _BLOCK, k), mode="r")).reshape(-1, k)
    return np.asarray(np.linalg.qr(np.vstack([triangle, blocks, rows[whole:]]), mode="r"))


def without_stiffness(
    by_stiffness: FloatArray, columns: FloatArray, starts: np.ndarray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Fit K* of each condition out of the columns: R^-1, Q^T columns (c, 2, k), and the columns left (N, 6, k)."""

    def sums(values: FloatArray) -> FloatArray:
        return np.add.reduceat(values, starts, axis=0)

    sizes = np.diff(np.append(starts, by_stiffness.shape[0]))
    basis, root = by_stiffness, np.eye(2)
    for _ in range(2):  # twice: the first leaves the square of the conditioning in the basis
        inverse = inverse_upper(upper_factor(sums(np.swapaxes(basis, 1, 2) @ basis)))
        basis = basis @ np.repeat(inverse, sizes, axis=0)
        root = root @ inverse
    share = np.zeros((starts.size, 2, columns.shape[2]))
    for _ in range(2):
        part = sums(np.swapaxes(basis, 1, 2) @ columns)
        columns = columns - basis @ np.repeat(part, sizes, axis=0)
        share = share + part
    return root, share, columns
