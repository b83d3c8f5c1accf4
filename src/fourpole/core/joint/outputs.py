"""Outputs of the joint route for each test, with their derivatives by everything that they depend on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from fourpole.core.arrays import ByValue, ComplexArray, FloatArray, parts
from fourpole.core.channelerrors import ChannelUncertainty
from fourpole.core.components import SpecimenUncertainty
from fourpole.core.curvature import Curvature
from fourpole.core.identify import Identification
from fourpole.core.joint.joint import Joint, solve_joint
from fourpole.core.joint.misfit import largest_part
from fourpole.core.joint.scatter import OwnTests, own_tests
from fourpole.core.joint.solve import Problem, Solution
from fourpole.core.phasor import Phasors
from fourpole.core.rig import Rig
from fourpole.core.routes import arm_slopes, maxwell_arm, why_no_arm
from fourpole.core.sources import Kind, Source


@dataclass(frozen=True, eq=False)
class Outputs(ByValue):
    """The six outputs of N tests with their derivatives, in the order of the given tests.

    The error of an output is by_own · e + by_shared · dz + by_k1 · dK1. Here e is the error of log K* from the noise,
    and dz is the error of the shared values. The derivatives have a seventh row for the error w of `curvature`. Rigid
    blocks have no outputs.

    Attributes
    ----------
    value : (N, 6) float array
        Outputs in the order of `core.identify.OUTPUTS`; not-a-number for an output that does not exist.
    by_own : (N, 7, 2) float array
        Derivatives by Re and Im of the error of log K* from the noise.
    by_shared : (N, 7, p) float array
        Total derivatives by the shared values, per stated standard uncertainty.
    by_k1 : (N, 7) float array
        Derivatives by K1.
    curvature : Curvature
        Second-order terms of K2 and C.
    own : (N, 2, 2) float array
        Covariance of log K* of each test for known shared values.
    condition : (N, 2, 2) float array
        Covariance of log K* of each test's condition for known shared values; `own` if K* does not scatter.
    frequency : (N, 2, 2) float array
        The part of `own` from the uncertainty of the frequency.
    covariance : (p, p) float array
        Covariance of the shared values.
    tr_of_rig : (N,) float array [1]
        Standard uncertainty of TR from the model discrepancy of the rig, and from its support.
    """

    value: FloatArray
    by_own: FloatArray
    by_shared: FloatArray
    by_k1: FloatArray
    curvature: Curvature
    own: FloatArray
    condition: FloatArray
    frequency: FloatArray
    covariance: FloatArray
    tr_of_rig: FloatArray

    def covariance_of(self, rows: slice, k1_std: FloatArray) -> FloatArray:
        """First-order covariance (N, k, k) of some of the outputs, with the standard uncertainty of K1 (N,) [N/m]."""
        own, shared, k1 = self.by_own[:, rows], self.by_shared[:, rows], self.by_k1[:, rows]
        with np.errstate(invalid="ignore"):
            by_k1 = np.where(k1 == 0, 0.0, k1 * k1_std[:, None])
            return (
                own @ self.own @ np.swapaxes(own, 1, 2)
                + shared @ self.covariance @ np.swapaxes(shared, 1, 2)
                + by_k1[:, :, None] * by_k1[:, None, :]
            )


def outputs(joint: Joint, phasors: Phasors, k1: ArrayLike) -> Outputs:
    """Outputs of a joint solution for each test at its own frequency, in its own place in the run.

    Parameters
    ----------
    joint : Joint
    phasors : Phasors
        The phasors that `identify_joint` was given.
    k1 : (N,) float array [N/m]
        Static stiffness of each test.
    """
    problem, solution, back = joint.problem, joint.solution, np.argsort(joint.order)
    omega = np.asarray(phasors.omega)
    k1 = np.broadcast_to(np.asarray(k1, dtype=float), omega.shape)
    own = own_tests(problem, solution).part(back)
    stiffness, slope = _own_stiffness(joint, own)
    linear = problem.linearised(solution.z, solution.stiffness)
    found = zip(*((part.impedance, part.impedance_by_shared) for _, _, part in linear), strict=True)
    impedance, impedance_by = (np.concatenate(column)[back] for column in found)
    with np.errstate(divide="ignore", invalid="ignore"):
        by_log_k = stiffness[:, None] * np.array([1.0, 1j])
        by_k = parts(by_log_k, axis=1)
        loss = stiffness.imag / stiffness.real
        by_loss = (by_log_k.imag - loss[:, None] * by_log_k.real) / stiffness.real[:, None]
        k2, c = maxwell_arm(stiffness, k1, omega)
        by = np.concatenate([by_log_k, np.full((k1.size, 1), -1.0 + 0j)], axis=1)  # Re, Im of log K*, and K1
        by_arm = arm_slopes(stiffness, k1, (k2, c), omega, by)
        curvature = Curvature.of(stiffness, k1, omega)
        bending = curvature.by(by)
        held = problem.observed
        light = {name: getattr(held, name)[:, :0] for name in ("whiten", "turns", "disturbed")}  # are not asked here
        observed = replace(held, **light).part(back)
        ends, jw = observed.ends(problem.shared, solution.z, stiffness), 1j * omega
        beyond = impedance + jw * ends.wheel
        ratio = ends.spring / (ends.spring + jw * beyond)
        tr = np.abs(ratio)
        tr_by_zr = -jw / (ends.spring + jw * beyond)
        by_ends = (1 - ratio)[:, None] * ends.by[:, :, 0] + (tr_by_zr * jw)[:, None] * ends.by[:, :, 2]
        by_tr = tr[:, None] * np.stack([by_ends[:, 0].real, -by_ends[:, 0].imag], axis=1)
        direct = tr[:, None] * (tr_by_zr[:, None] * impedance_by).real
        for place, turn, which in observed.belt_columns(problem.shared):
            direct[:, place] += tr * (turn * by_ends[:, which]).real
    rows = [by_k, by_loss[:, None], by_arm[:, :, :2], by_tr[:, None], bending[:, None, :2]]
    by_own = np.concatenate(rows, axis=1)
    by_shared = -by_own @ slope
    by_shared[:, 5] += direct
    by_k1 = np.zeros((omega.size, 7))
    by_k1[:, 3:5], by_k1[:, 6] = by_arm[:, :, 2], bending[:, 2]
    condition = _per_test(joint, solution.own, np.nan)
    doubt = _per_test(joint, solution.doubt + np.zeros_like(solution.own), np.nan)
    observed = problem.observed
    relative = np.hypot(2 * np.pi * observed.frequency_std / observed.omega, joint.misfit.unsteady)
    shifted = own.by_frequency * relative[back][:, None]  # log K* of each test, by its own part alone
    of_condition = _per_test(joint, _by_frequency(problem, solution, relative), np.nan)
    largest = largest_part(problem, solution.z, solution.stiffness)
    return Outputs(
        value=np.stack([stiffness.real, stiffness.imag, loss, k2, c, tr], axis=1),
        by_own=by_own,
        by_shared=by_shared,
        by_k1=by_k1,
        curvature=curvature,
        own=own.covariance + _both_sides(own.keep, condition) + doubt,
        condition=condition + doubt,
        frequency=shifted[:, :, None] * shifted[:, None, :] + _both_sides(own.keep, of_condition),
        covariance=solution.covariance,
        tr_of_rig=tr * np.abs(tr_by_zr) * np.hypot(joint.misfit.rig_error * largest, joint.support)[back],
    )


def _own_stiffness(joint: Joint, own: OwnTests) -> tuple[ComplexArray, FloatArray]:
    """K* (N,) [N/m] of each test at its own frequency, and the fall (N, 2, p) of its logarithm by the shared values."""
    problem, solution, back = joint.problem, joint.solution, np.argsort(joint.order)
    moved = problem.conditions.carried(solution.stiffness) * problem.observed.drifted(problem.shared, solution.z)
    stiffness = np.where(
        joint.condition < 0,
        complex(np.nan, np.nan),
        _per_test(joint, solution.stiffness, np.nan) * moved[back] * np.exp(own.shift @ [1, 1j]),
    )
    slope, conditions = _per_test(joint, solution.slope, 0.0), problem.conditions
    tyre = slice(conditions.first, back.size)
    slope[joint.order[tyre]] -= conditions.lead(solution.slope, tyre, slice(0, conditions.count))
    slope = own.keep @ slope - own.by_shared - problem.observed.by_drift(problem.shared)[back]
    return stiffness, slope


def _both_sides(matrix: FloatArray, covariance: FloatArray) -> FloatArray:
    """A S A^T of matrices A (N, k, k) and covariances S (N, k, k)."""
    return np.asarray(matrix @ covariance @ np.swapaxes(matrix, 1, 2))


def _per_test(joint: Joint, values: np.ndarray, missing: float) -> np.ndarray:
    """Values of the conditions for each test; `missing` for rigid blocks."""
    if not values.shape[0]:
        return np.full((joint.condition.size, *values.shape[1:]), missing, dtype=values.dtype)
    of_tests = values[joint.condition].copy()
    of_tests[joint.condition < 0] = missing
    return of_tests


def _by_frequency(problem: Problem, solution: Solution, relative: FloatArray) -> FloatArray:
    """Covariance (c, 2, 2) of log K* of each condition from the relative uncertainty (N,) of its tests' frequencies."""
    conditions = problem.conditions
    if not np.any(relative > 0):
        return np.zeros((conditions.count, 2, 2))
    change = problem.by_log_frequency(solution.z, solution.stiffness) * relative[:, None]
    by_k = problem.columns("by_stiffness", solution.z, solution.stiffness)
    drawn = np.einsum("nij,ni->nj", by_k, change)
    return np.asarray(solution.own @ conditions.sum(drawn[:, :, None] * drawn[:, None, :]) @ solution.own)


def variance_by_source(joint: Joint, values: Outputs, k1_std: ArrayLike) -> dict[Source, FloatArray]:
    """Variance (N, 6) of the outputs by source; the sum over all sources is the total variance.

    The most probable values are linear in the noise and in the stated values, so each stated value has its own share.
    The share of the noise is the rest; it includes scatter and model discrepancy. The second-order part of K2 and C is
    distributed in proportion; see `fourpole.core.curvature.Curvature`.
    """
    moved = values.by_shared @ values.covariance
    by_shared = np.sum(moved * values.by_shared, axis=2)
    stated = moved**2
    own, frequency = (
        np.einsum("nki,nij,nkj->nk", values.by_own, part, values.by_own) for part in (values.own, values.frequency)
    )
    misfit = np.zeros_like(own)
    misfit[:, 5] = values.tr_of_rig**2
    sources = {
        Source(Kind.NOISE): np.maximum(own - frequency + by_shared - stated.sum(axis=2), 0.0),
        Source(Kind.FREQUENCY): frequency,
    }
    for index, parameter in enumerate(joint.stated.parameters):
        sources[parameter.source] = sources.get(parameter.source, 0.0) + stated[:, :, index]
    sources[Source(Kind.RIG_MISFIT)] = misfit
    with np.errstate(invalid="ignore"):
        sources[Source(Kind.K1)] = np.where(values.by_k1 == 0, 0.0, values.by_k1 * np.asarray(k1_std)[..., None]) ** 2
    return values.curvature.distributed(sources)


def identification(
    joint: Joint, phasors: Phasors, k1: ArrayLike, k1_std: ArrayLike, known: Outputs | None = None
) -> Identification:
    """The result of the joint route: one row per test, with K* not-a-number for rigid blocks.

    `known` is the result of `outputs`, if it is known already.
    """
    known = outputs(joint, phasors, k1) if known is None else known
    omega = np.asarray(phasors.omega)
    k1, k1_std = (np.broadcast_to(np.asarray(x, dtype=float), omega.shape) for x in (k1, k1_std))
    stiffness = known.value[:, 0] + 1j * known.value[:, 1]
    rigid = joint.condition < 0
    with np.errstate(invalid="ignore"):
        reasons = tuple(
            "" if block else why_no_arm(*row)
            for block, *row in zip(rigid, stiffness, k1, known.value[:, 3], known.value[:, 4], strict=True)
        )
        passive = np.array([not reason for reason in reasons], dtype=bool) & ~rigid
        mobility, mobility_covariance = _corrected_mobility(joint, phasors)
        gains = joint.gains
        std = np.sqrt(np.diagonal(known.covariance_of(slice(2, 6), k1_std), 0, 1, 2))
        bending = known.covariance_of(slice(6, 7), k1_std)[:, 0, 0]
        arm_covariance = known.covariance_of(slice(3, 5), k1_std) + known.curvature.covariance(bending)
    squares, vectors = np.linalg.eigh(known.covariance)  # L = vectors sqrt(squares) has L L^T equal to the covariance
    return Identification(
        frequency=phasors.frequency,
        mobility=mobility,
        mobility_covariance=mobility_covariance,
        stiffness=stiffness,
        stiffness_covariance=known.covariance_of(slice(0, 2), k1_std),
        loss_factor=known.value[:, 2],
        loss_factor_std=std[:, 0],
        k1=k1,
        k1_std=k1_std,
        k2=np.where(passive, known.value[:, 3], np.nan),
        c=np.where(passive, known.value[:, 4], np.nan),
        arm_covariance=np.where(passive[:, None, None], arm_covariance, np.nan),
        tr_measured=np.abs(phasors.transmissibility * gains[:, 1] / gains[:, 2]),
        tr_predicted=known.value[:, 5],
        tr_std=np.hypot(std[:, 3], known.tr_of_rig),
        reasons=reasons,
        route="joint",
        stiffness_shared=known.by_shared[:, :2] @ (vectors * np.sqrt(np.maximum(squares, 0.0))),
        condition=joint.condition,
        condition_covariance=_both_sides(known.by_own[:, :2], known.condition),
        joint=joint,
    )


def _corrected_mobility(joint: Joint, phasors: Phasors) -> tuple[ComplexArray, FloatArray]:
    """V1/F1 corrected for the gains found, and its covariance from the noise and the uncertainty of the gains."""
    shared = joint.problem.shared
    gains = joint.gains
    mobility = phasors.mobility * gains[:, 0] / gains[:, 1]
    by = np.zeros((*mobility.shape, 4), dtype=complex)
    by[:, 0], by[:, 1] = -mobility / phasors.force_in, -1j * mobility / phasors.force_in
    by[:, 2], by[:, 3] = mobility / phasors.motion_in, 1j * mobility / phasors.motion_in
    by_z = np.zeros((*mobility.shape, len(shared)), dtype=complex)
    observed, back = joint.problem.observed, np.argsort(joint.order)
    sign = np.array([1.0, -1.0, 0.0])[observed.channels]  # of F1 over V1
    for index, parameter in enumerate(shared.parameters):
        if parameter.source.of_channel:
            turn = observed.turns[back, parameter.index] * sign[parameter.index]
            by_z[:, index] = mobility * turn * parameter.std
    noise, rest = parts(by, axis=1), parts(by_z, axis=1)
    covariance = noise @ phasors.covariance[:, :4, :4] @ np.swapaxes(noise, 1, 2)
    return mobility, covariance + rest @ joint.solution.covariance @ np.swapaxes(rest, 1, 2)


def identify_joint(
    phasors: Phasors,
    rig: Rig,
    k1: ArrayLike = np.nan,
    *,
    k1_std: ArrayLike = 0.0,
    family: ArrayLike = 0,
    nominal_frequency: ArrayLike = np.nan,
    added_mass: ArrayLike = 0.0,
    added_mass_std: ArrayLike = 0.0,
    channels: ChannelUncertainty | None = None,
    specimen: Sequence[str] | None = None,
    time: ArrayLike | None = None,
    apart: ArrayLike = 0.0,
    lines: ArrayLike = 1.0,
    recording: ArrayLike | None = None,
    mounting: Sequence[str] | None = None,
    specimens: SpecimenUncertainty | None = None,
) -> Identification:
    r"""Find K* of every condition, the rig's values and the channels' gains from all tests of a rig together.

    The result maximises the posterior of a free drive for each test, K* for each condition, and the shared values with
    their statements as priors. K* is interpolated to the frequency of each test by the slopes of 1/K2 and 1/C, or of
    log K* if K1 is unknown. `fourpole.core.joint.model` documents the model.

    Parameters
    ----------
    phasors : Phasors
        Phasors of N tests; not-a-number for an absent channel. Each test needs at least two of the three channels.
    rig : Rig
        The rig as stated, with its uncertainties.
    k1, k1_std : (N,) float arrays [N/m]
        Static stiffness and its standard uncertainty. Not-a-number if unknown; K* does not need it.
    family : (N,) int array
        Number of the condition without its frequency: specimen, pressure, preload, temperature and others. A negative
        number is a rigid block in place of the tyre, whose mass is part of `added_mass`.
    nominal_frequency : (N,) float array [Hz]
        Frequency as stated, which distinguishes repeats from a fine sweep; not-a-number if not stated.
    added_mass, added_mass_std : (N,) float arrays [kg]
        Mass fixed to the moving mass, and its standard uncertainty; tests with the same mass share one error.
    channels : ChannelUncertainty, optional
        Uncertainties of the channels; without it the channels count as exact.
    specimen : sequence of N str, optional
        Name of the specimen of each test; by default all tests are of one specimen.
    time : (N,) float array, optional
        Time of each test, in any unit, along which a specimen may drift; by default the order of the tests.
    apart : (N,) float array [1]
        Standard deviation of log K* of each test about that of its condition, as from another temperature.
    lines : (N,) float array [1]
        Number of lines of the recording that a test is one of: their K* scatters together.
    recording : (N,) int array, optional
        Number of the recording that a test is a line of: each of its lines has a K* of its own.
    mounting : sequence of N str, optional
        Name of the mounting of V1's sensor in each test; by default that of the specimen.
    specimens : SpecimenUncertainty, optional
        Uncertainties of the specimens over blocks and time; without it they do not change.

    Returns
    -------
    Identification
        One row per test, with K* not-a-number for rigid blocks. `joint` has the estimates of the rig's values and of
        the channels' gains.

    Raises
    ------
    RigError
        If the rig is blocked, so that there is no V2.

    References
    ----------
    JCGM 102:2011, 6.3 (covariance of outputs that solve a measurement model), and 6.4 (complex quantities).

    Examples
    --------
    A moving mass of 15.2 kg that is stated as 15.0 ± 0.3 kg:

    >>> omega = 2 * np.pi * np.array([10.0, 12.0])
    >>> impedance = Rig(moving_mass=15.2, preload_stiffness=12440.0).impedance(omega)
    >>> ratio = (2e5 + 4e4j) / (2e5 + 4e4j + 1j * omega * impedance)
    >>> amplitudes = 0.06 * np.stack([impedance * ratio, np.ones(2), ratio], axis=1)
    >>> nothing = np.zeros(2)
    >>> phasors = Phasors(omega / (2 * np.pi), amplitudes, np.zeros((2, 6, 6)), nothing, nothing + np.inf)
    >>> found = identify_joint(phasors, Rig(moving_mass=15.0, preload_stiffness=12440.0, std={"moving_mass": 0.3}))
    >>> found.joint.found.round(4).tolist(), found.stiffness.round(0).tolist()
    ([15.2], [(200000+40000j), (200000+40000j)])
    """
    joint = solve_joint(
        phasors,
        rig,
        k1,
        family=family,
        nominal_frequency=nominal_frequency,
        added_mass=added_mass,
        added_mass_std=added_mass_std,
        channels=channels,
        specimen=specimen,
        time=time,
        apart=apart,
        lines=lines,
        recording=recording,
        mounting=mounting,
        specimens=specimens,
    )
    return identification(joint, phasors, k1, k1_std)
