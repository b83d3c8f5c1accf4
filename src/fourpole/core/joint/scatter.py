r"""K* of single tests: its scatter about K* of the condition, and the K* of a test by itself.

The log K* of test i is that of its condition plus a random part of standard deviation s, in Re and in Im. With the
derivatives B by log K* of the whitened residual r, the weight of the test's own data is :math:`W = B^T B`, and its
random part has the mean :math:`(W + s^{-2})^{-1} B^T r` and the covariance :math:`(W + s^{-2})^{-1}`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import scipy

from fourpole.core.arrays import BoolArray, ByRows, ComplexArray, FloatArray, inverse_of_two
from fourpole.core.joint.conditions import JointConditions
from fourpole.core.joint.misfit import is_unlikely
from fourpole.core.joint.model import inverse_upper, linearise, upper_factor
from fourpole.core.joint.solve import Problem, Solution

#: Median of chi-square with 2 degrees of freedom.
MEDIAN = 1.386
#: Largest scatter of log K*, or error of Zr, that is considered [1].
_MOST = 1.0
#: Least number of tests with a repeat for a robust estimate of the scatter.
_ENOUGH = 6
#: Growth of u of all but this share of the tests by scatter that does not matter, if chance explains the scatter.
_LITTLE, _FEW = 0.01, 0.2
#: Newton steps to the K* of a test by itself.
_NEWTON = 3
#: Largest departure of ln K* of a test from its condition; the steps of a rig that is far from its tests go on and on.
_FARTHEST = 3.0


@dataclass(frozen=True, eq=False)
class Deviations(ByRows):
    """Departure of log K* of each test by itself from that of its condition.

    Attributes
    ----------
    value : (N, 2) float array
        Its Re and Im; 0 for a rigid block.
    covariance : (N, 2, 2) float array
        Its covariance from the noise of the test and from its temperature.
    """

    value: FloatArray
    covariance: FloatArray


def deviations(problem: Problem, z: FloatArray, stiffness: ComplexArray) -> Deviations:
    """The departures at shared values z and K* of each condition, for all tests of the problem."""
    bare = problem.without_spread if np.any(problem.spread) else problem
    linear = [part for _, _, part in bare.linearised(z, stiffness)]
    by_k, residual = (np.concatenate([getattr(part, name) for part in linear]) for name in ("by_stiffness", "residual"))
    root = inverse_upper(upper_factor(np.swapaxes(by_k, 1, 2) @ by_k))
    covariance = root @ np.swapaxes(root, 1, 2)
    value = np.einsum("nij,njk,nk->ni", covariance, np.swapaxes(by_k, 1, 2), residual)
    apart = replace(problem, scatter=0.0).spread
    return Deviations(value, covariance + (apart**2)[:, None, None] * np.eye(2))


def squares(conditions: JointConditions, departures: Deviations, scatter: float) -> FloatArray:
    """Squared normalised departure of each test from the weighted mean of its condition (N,); 0 for a test alone.

    Its expectation over all tests of a condition is 2 (n - 1) for n tests.
    """
    here = slice(conditions.first, None)
    label = conditions.label[here]
    value, weight = departures.value[here], inverse_of_two(departures.covariance[here] + scatter**2 * np.eye(2))
    pull = (weight @ value[..., None])[..., 0]
    starts = conditions.starts - conditions.first
    total = inverse_of_two(np.add.reduceat(weight, starts, axis=0))
    mean = (total @ np.add.reduceat(pull, starts, axis=0)[..., None])[..., 0]
    off = value - mean[label]
    whole = np.zeros(conditions.label.size)
    whole[here] = np.einsum("ni,nij,nj->n", off, weight, off)
    return whole


def scatter_of(problem: Problem, departures: Deviations, used: BoolArray, lost: float = 0.0) -> float:
    """Scatter of log K* with which the squared departures equal their degrees of freedom (Paule and Mandel).

    Parameters
    ----------
    problem : Problem
    departures : Deviations
    used : (N,) bool array
        The tests that count; the others are taken out of their conditions.
    lost : float [1]
        Degrees of freedom of the drifts of the specimens.

    Returns
    -------
    float [1]
        0 if the noise explains the departures.
    """
    conditions = problem.conditions
    if not conditions.count:
        return 0.0
    kept = np.where(used[:, None, None], departures.covariance, 1e12 * np.eye(2))
    counted = replace(departures, covariance=kept)
    sizes = conditions.sum(used.astype(float))
    dof = 2.0 * float(np.sum(np.maximum(sizes - 1, 0))) - lost
    if not dof > 0:
        return 0.0

    def whole(scatter: float) -> float:
        return float(np.sum(squares(conditions, counted, scatter)[used]))

    return _that_matters(root_of(lambda scatter: whole(scatter) - dof), departures, lambda: whole(0.0), dof)


def robust_scatter(problem: Problem, departures: Deviations) -> float:
    """Scatter of log K* by the median of the squared departures, which a few bad tests do not change."""
    conditions = problem.conditions
    sizes = np.ones(conditions.label.size)
    sizes[conditions.first :] = conditions.sizes[conditions.label[conditions.first :]]
    repeated = sizes > 1
    if np.sum(repeated) < _ENOUGH:
        return scatter_of(problem, departures, np.ones(repeated.size, dtype=bool))
    free = 1 - 1 / sizes[repeated]

    def repeats(scatter: float) -> FloatArray:
        return np.asarray(squares(conditions, departures, scatter)[repeated])

    found = root_of(lambda scatter: float(np.median(repeats(scatter) / free)) - MEDIAN)
    return _that_matters(found, departures, lambda: float(np.sum(repeats(0.0))), 2.0 * float(np.sum(free)))


def _that_matters(scatter: float, departures: Deviations, chi2: Callable[[], float], dof: float) -> float:
    """The scatter; 0 if chance explains it, and u of all but a few tests would grow by less than `_LITTLE`.

    `chi2` has chi-square without scatter, which is asked only where little scatter is found.
    """
    if not scatter:
        return 0.0
    variance = 0.5 * float(np.quantile(np.trace(departures.covariance, axis1=1, axis2=2), _FEW))
    return scatter if scatter**2 > 2 * _LITTLE * variance or is_unlikely(chi2(), dof) else 0.0


#: Sizes of a scatter that are compared, and the evidence that each condition apart from the others needs besides the
#: logarithm of their number.
_SIZES, _APART = np.append(0.0, np.geomspace(1e-6, _MOST, 61)), 1.0


def strange_conditions(problem: Problem, departures: Deviations, used: BoolArray) -> FloatArray:
    """Scatter (c,) of each condition whose tests depart much more from each other than those of others; 0 for these.

    Labels that were exchanged, or one test with another sensor, are such.
    """
    conditions = problem.conditions
    own = np.zeros(conditions.count)
    repeated = conditions.sum(used.astype(float)) > 1
    if np.sum(repeated) < 2:
        return own
    kept = np.where(used[:, None, None], departures.covariance, 1e12 * np.eye(2))
    counted = replace(departures, covariance=kept)
    likely = np.stack([_likely(conditions, counted, size) for size in _SIZES], axis=1)[repeated]
    order = np.argsort(-_SIZES[np.argmax(likely, axis=1)], kind="stable")
    likely = likely[order]
    best = np.append(0.0, np.cumsum(likely.max(axis=1)))[: len(likely)]
    rest = np.cumsum(likely[::-1], axis=0)[::-1].max(axis=1)
    whole = best + rest - np.arange(len(likely)) * (np.log(len(likely)) + _APART)
    count = int(np.argmax(whole))
    places = np.flatnonzero(repeated)[order[:count]]
    own[places] = _SIZES[np.argmax(likely[:count], axis=1)]
    return own


def _likely(conditions: JointConditions, departures: Deviations, scatter: float) -> FloatArray:
    """Logarithm of the likelihood (c,) of the departures of each condition, its mean projected out, for a scatter."""
    here = slice(conditions.first, None)
    covariance = departures.covariance[here] + scatter**2 * np.eye(2)
    starts = conditions.starts - conditions.first
    sizes = np.log(np.linalg.det(covariance))
    total = np.log(np.linalg.det(np.add.reduceat(inverse_of_two(covariance), starts, axis=0)))
    chi2 = np.add.reduceat(squares(conditions, departures, scatter)[here], starts)
    return np.asarray(-0.5 * (chi2 + np.add.reduceat(sizes, starts) + total))


def root_of(excess: Callable[[float], float]) -> float:
    """The relative error up to `_MOST` at which a falling function is zero; 0 if it is never positive."""
    if not excess(0.0) > 0:  # nor if it is not-a-number
        return 0.0
    if not excess(_MOST) < 0:
        return _MOST
    return float(scipy.optimize.brentq(excess, 0.0, _MOST, xtol=1e-15, rtol=1e-12))


@dataclass(frozen=True, eq=False)
class OwnTests(ByRows):
    """K* of each test by itself and its condition together.

    Attributes
    ----------
    shift : (N, 2) float array
        Re and Im of log K* of the test less those of its condition.
    keep : (N, 2, 2) float array
        Change of log K* of the test per change of that of its condition; 1 without scatter.
    covariance : (N, 2, 2) float array
        Covariance of log K* of the test for known shared values and a known K* of the condition; 0 without scatter.
    by_shared : (N, 2, p) float array
        Change of `shift` with the shared values for a known K* of the condition.
    by_frequency : (N, 2) float array
        Change of `shift` with log frequency.
    """

    shift: FloatArray
    keep: FloatArray
    covariance: FloatArray
    by_shared: FloatArray
    by_frequency: FloatArray


def own_tests(problem: Problem, solution: Solution) -> OwnTests:
    """K* of each test by itself and its condition together, in the order of the problem."""
    count = problem.conditions.label.size
    spread = problem.spread
    if not np.any(spread):
        zero = np.zeros((count, 2, 2))
        nothing = np.zeros((count, 2, len(problem.shared)))
        return OwnTests(zero[:, 0], zero + np.eye(2), zero, nothing, zero[:, 0])
    plain = problem.without_spread
    square = (spread**2)[:, None, None]
    shift = np.zeros((count, 2))
    for _ in range(_NEWTON):  # the departures may be many times the noise, where the model is no longer linear
        by_k, residual, by_shared, basis = _linear_at(plain, solution, shift)
        weight = np.swapaxes(by_k, 1, 2) @ by_k
        covariance = square * inverse_of_two(np.eye(2) + square * weight)
        drawn = covariance @ np.swapaxes(by_k, 1, 2)
        shift = (drawn @ (residual + np.einsum("nij,nj->ni", by_k, shift))[..., None])[..., 0]
        shift *= np.minimum(1.0, _FARTHEST / np.maximum(np.abs(shift).max(axis=1, keepdims=True), _FARTHEST))
    by_frequency = plain.by_log_frequency(solution.z, solution.stiffness)
    return OwnTests(
        shift=shift,
        keep=np.eye(2) - covariance @ weight,
        covariance=covariance,
        by_shared=-drawn @ by_shared,
        by_frequency=(drawn @ np.swapaxes(basis, 1, 2) @ by_frequency[..., None])[..., 0],
    )


def _linear_at(problem: Problem, solution: Solution, shift: FloatArray) -> list[FloatArray]:
    """Derivatives by log K*, residuals, derivatives by the shared values and their basis, at the K* of each test."""
    conditions = problem.conditions
    stiffness = np.ones(conditions.label.size, dtype=complex)
    here = slice(conditions.first, None)
    if conditions.count:
        stiffness[here] = (solution.stiffness[conditions.label] * conditions.carried(solution.stiffness))[here]
    stiffness = stiffness * np.exp(shift @ [1, 1j])
    made = (linearise(problem.observed.part(rows), problem.shared, solution.z, stiffness[rows])
            for rows, _ in problem.chunks())  # fmt: skip
    parts = [(part.by_stiffness, part.residual, part.by_shared, part.basis) for part in made]
    return [np.concatenate(column) for column in zip(*parts, strict=True)]
