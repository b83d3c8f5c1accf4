"""Specimens with a mass of their own: its priors, first values, and a choice by the evidence of all tests.

A tyre's belt is a large error of a massless model, and then other parts are blamed for it. So the tests are explained
by massless specimens, by belts and by rods, each time with all that they ask for; see `fourpole.core.specimen`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from fourpole.core.arrays import BoolArray, ByValue, ComplexArray, FloatArray
from fourpole.core.components import component
from fourpole.core.joint.asking import GAIN, Group, gain_of, volume, widened
from fourpole.core.joint.conditions import JointConditions
from fourpole.core.joint.misfit import residuals
from fourpole.core.joint.model import Observed, whitened
from fourpole.core.joint.scatter import deviations, robust_scatter
from fourpole.core.joint.shared import SharedParameter
from fourpole.core.joint.solve import Problem, Solution, moved, solve, solve_either, sweep
from fourpole.core.sources import Kind, Source
from fourpole.core.specimen import Body, Form, Specimen, log_odds, spread_of

#: Standard uncertainty of a mass of which nothing is stated, over the moving mass.
_UNSTATED = 0.5
#: Centre of the exponent: between springs of one law, and a spring at the rim that is constant.
_EXPONENT = 0.6
#: First values of a mass, over the moving mass: from a mass of zero the search ends in a wrong minimum.
_STARTS = (0.1, 0.3, 0.6)
#: Noise of each amplitude, relative, with which the search begins, one after the other: the stated values count then.
_NOISES = (0.03, 3e-3, 3e-4)
#: A first mass that leaves no more than this of a test needs no other one. A test has four numbers.
_GOOD = 8.0
#: Steps in which a small mass shows.
_FEW_STEPS = 15
#: A mass may be negative by this many standard uncertainties: it is none, then.
_POSSIBLE = 3.0
#: No block is an even rod. Its inertia is off at each frequency by this share of omega^2 m/K, as that of a chain of six
#: springs, whose masses have the inertia of the rod to first order.
_FORM = 5e-3
#: Most shares in one problem: with more conditions, those of a specimen have one.
_MOST_SHARES = 40


def with_references(
    observed: Observed, conditions: JointConditions, references: ComplexArray, *, rod: bool
) -> Observed:
    """The tests with the number of each one's share, and K* (s,) [N/m] at which it is that of the shared values."""
    tyre = ~observed.rigid
    family = np.zeros(tyre.size, dtype=int)
    family[tyre] = np.unique(conditions.family[conditions.label[tyre]], return_inverse=True)[1]
    family = family if family.max(initial=0) < _MOST_SHARES else observed.specimen
    known = np.append(references, np.ones(int(family.max(initial=0)) + 1, dtype=complex))
    return replace(observed, family=family, reference=known[family], rod=np.full(tyre.size, rod))


def references_of(observed: Observed) -> ComplexArray:
    """The K* (s,) of `with_references` [N/m]."""
    found = np.ones(int(observed.family.max(initial=0)) + 1, dtype=complex)
    found[observed.family[~observed.rigid]] = observed.reference[~observed.rigid]
    return found


def with_belts(problem: Problem, bodies: Mapping[str, Body], stiffness: ComplexArray, *, rod: bool) -> Problem:
    """The problem with a mass in each specimen; `stiffness` (c,) is a first K* of each condition, for the reference."""
    conditions, tyre = problem.conditions, ~problem.observed.rigid
    observed = with_references(problem.observed, conditions, np.ones(0, complex), rod=rod)
    size, family = np.log(np.abs(stiffness))[conditions.label[tyre]], observed.family[tyre]
    # Real references: where the springs are of two laws, the angle of the share is p times that of K*.
    references = np.exp(np.bincount(family, size) / np.maximum(np.bincount(family), 1)) + 0j
    listed = []
    for number in np.unique(observed.specimen[tyre]).tolist():
        name, body = problem.names[number], bodies.get(problem.names[number], Body())
        std = body.mass_std or _UNSTATED * problem.shared.rig.moving_mass
        listed.append(SharedParameter(Source(Kind.BELT_MASS, name), "kg", number, body.mass, std))
        if rod:
            listed.append(_of_springs(Kind.BELT_SPREAD, name, number, body.odds))
            continue
        listed.append(_of_springs(Kind.BELT_EXPONENT, name, number, (_EXPONENT, component(Kind.BELT_EXPONENT).std)))
        for one in np.unique(observed.family[tyre & (observed.specimen == number)]).tolist():
            share = body.springs(float(references[one].real))
            listed.append(_of_springs(Kind.BELT_SHARE, name, one, share))
            listed.append(_of_springs(Kind.BELT_ANGLE, name, one, (0.0, component(Kind.BELT_ANGLE).std)))
    shared = replace(problem.shared, parameters=(*problem.shared.parameters, *listed))
    return replace(problem, observed=with_references(observed, conditions, references, rod=rod), shared=shared)


def _of_springs(kind: Kind, name: str, index: int, stated: tuple[float, float]) -> SharedParameter:
    return SharedParameter(Source(kind, name), component(kind).unit, index, *stated)


def explained(
    problem: Problem, bodies: Mapping[str, Body], stiffness: ComplexArray
) -> list[tuple[float, Problem, Solution]]:
    """Belts of all specimens, and rods where these may be some: the most probable of each form, with its `weight_of`.

    Each is searched from several first masses, and one that converges counts before others. The most probable form is
    the first. A rod explains the tests of a light belt too, with fewer unknowns and another moving mass: no tyre is
    one.
    """
    may_be_rods = all(body.is_block for body in bodies.values())
    forms, good = [False, True] if may_be_rods else [False], False  # rods are searched once if belts leave nothing
    if may_be_rods and any(body.spread is not None for body in bodies.values()):
        forms.remove(False)
    best = []
    for rod in forms:
        wide, made = with_belts(problem, bodies, stiffness, rod=rod), []
        for share in _STARTS:
            found, solution = _searched(wide, _first(wide, share * problem.shared.rig.moving_mass))
            made.append((weight_of(found, solution, problem, 0), found, solution))
            good |= solution.converged and solution.objective < _GOOD * problem.observed.omega.size
            if good:
                break
        best.append(max(made, key=lambda one: (one[2].converged, one[0])))
    return sorted(best, key=lambda one: (one[2].converged, one[0]), reverse=True)


def explains_more(problem: Problem, solution: Solution, bodies: Mapping[str, Body]) -> bool:
    """Whether the smallest of the first masses raises the evidence of a solution in which K* scatters little."""
    wide = with_belts(problem, bodies, solution.stiffness, rod=False)
    z = _first(wide, _STARTS[0] * problem.shared.rig.moving_mass)
    z[: solution.z.size] = solution.z
    after = solve(wide, solution.stiffness, z, _FEW_STEPS)
    return after.evidence > solution.evidence


def _searched(problem: Problem, z: FloatArray) -> tuple[Problem, Solution]:
    """The solution from shared values z, first with more noise than there is: else the springs go astray at once."""
    observed, stiffness = problem.observed, own_stiffness(problem, z)
    size = observed.whiten * np.abs(np.repeat(observed.amplitudes, 2, axis=1))[:, None, :]
    for noise in _NOISES:
        before = solve(problem.widened(noise * size), stiffness, z, rough=True)
        stiffness, z = before.stiffness, before.z
    problem = _with_form(problem, z, stiffness)
    scatter = robust_scatter(problem, deviations(problem, z, stiffness))
    return solve_either(replace(problem, scatter=scatter), stiffness, z)


def _with_form(problem: Problem, z: FloatArray, stiffness: ComplexArray) -> Problem:
    """The problem with what the inertia of a rod may be off at each frequency, as noise; the same without rods."""
    observed, shared = problem.observed, problem.shared
    if not np.any(observed.rod):
        return problem
    masses = np.array([row.source.kind is Kind.BELT_MASS for row in shared.parameters])
    along = np.where(masses, shared.found(z) / shared.std, 0.0)  # a relative change of all masses
    change = [np.einsum("nij,njp,p->ni", one.basis, one.by_shared, along)
              for _, _, one in problem.linearised(z, stiffness)]  # fmt: skip
    size = _FORM * observed.omega**2 * observed.belts(shared, z)[0] / np.abs(stiffness[problem.conditions.label])
    return problem.widened((np.concatenate(change) * (observed.rod * size)[:, None])[:, :, None])


def _first(problem: Problem, mass: float) -> FloatArray:
    """Shared values (p,) in which each belt has this mass [kg], and the others are as stated."""
    return np.array([(mass - row.stated) / row.std if row.source.kind is Kind.BELT_MASS else 0.0
                     for row in problem.shared.parameters])  # fmt: skip


def own_stiffness(problem: Problem, z: FloatArray) -> ComplexArray:
    """K* of each condition [N/m] at shared values z, from F1, V1 and V2 of its tests.

    With r the share of the springs, F1 and both motions give K* as a root of a quadratic. At the lowest frequency it is
    the larger one, and then the nearer one.
    """
    conditions, roots = problem.conditions, _roots(problem, z)
    chosen = np.zeros(conditions.count, dtype=complex)
    before: dict[int, complex] = {}
    for condition in np.lexsort((conditions.mean_frequency, conditions.family)).tolist():
        rows = roots[conditions.label == condition]
        family = int(conditions.family[condition])
        if family in before:
            near = np.argmin(np.abs(np.log(rows / before[family])), axis=1)
        else:
            near = np.argmax(np.abs(rows), axis=1)
        value = complex(np.exp(np.mean(np.log(rows[np.arange(len(rows)), near]))))
        chosen[condition] = before[family] = value
    return chosen


def _roots(problem: Problem, z: FloatArray) -> ComplexArray:
    """The two K* (N, 2) [N/m] of each test by F1, or by V2/V1 where there is no F1; 1 for a rigid block."""
    observed, shared = problem.observed, problem.shared
    omega, rig = observed.omega, shared.rig_at(z)
    belt, share, _ = observed.belts(shared, z)
    r = np.exp(share)  # 1 of a rod
    at_contact, at_wheel = belt * r / (1 + r), belt / (1 + r)
    pole = omega**2 * belt * r / (1 + r) ** 2
    f1, v1, v2 = np.where(observed.amplitudes == 0, np.nan, observed.amplitudes).T
    ratio = v2 / v1
    force = 1j * omega * f1 / v1 + omega**2 * rig.input_mass
    beyond = 1j * omega * np.asarray(rig.impedance(omega, observed.added(shared.masses_at(z))))
    by_force = np.stack([1 - ratio, -(omega**2 * at_contact + force), force * pole], axis=1)
    by_motion = np.stack([ratio - 1, ratio * (beyond - omega**2 * at_wheel), -ratio * beyond * pole], axis=1)
    a, b, c = np.where(np.isfinite(by_force).all(axis=1)[:, None], by_force, by_motion).T
    with np.errstate(divide="ignore", invalid="ignore"):
        root = np.sqrt(b * b - 4 * a * c)
        root = np.where((np.conj(b) * root).real < 0, -root, root)
        both = np.stack([-(b + root) / (2 * a), -2 * c / (b + root)], axis=1)
    usable = np.isfinite(both) & (both != 0) & ~observed.rigid[:, None]
    return np.where(usable, both, 1.0)


def weight_of(problem: Problem, solution: Solution, plain: Problem, outliers: int) -> float:
    """Logarithm of the evidence of a solution, comparable with that of another one of the same tests.

    `plain` has the noise of the recordings alone. What enlarges the noise costs its volume; each outlier is rare.
    """
    quiet = replace(problem.reweighted(plain.observed.whiten), scatter=0.0, apart=plain.apart)
    predicted = problem.columns("predicted", solution.z, solution.stiffness)
    scale = _size(problem.observed.whiten, predicted) - _size(plain.observed.whiten, predicted)
    scale += volume(problem, solution) - volume(quiet, solution)
    return solution.evidence + scale - outliers * float(np.log(len(predicted)))


def _size(whiten: FloatArray, predicted: ComplexArray) -> float:
    """Logarithm of the determinant of the weights of all tests, without the drive of each, which is free."""
    diagonal = np.abs(np.diagonal(whiten, axis1=1, axis2=2))
    drive = whitened(whiten, np.stack([predicted, 1j * predicted], axis=-1))
    free = np.linalg.slogdet(np.swapaxes(drive, 1, 2) @ drive)[1]
    return float(np.sum(np.log(np.where(diagonal > 0, diagonal, 1.0))) - 0.5 * np.sum(free))


def is_possible(problem: Problem, solution: Solution) -> bool:
    """Whether no mass is negative beyond its uncertainty."""
    std = np.sqrt(np.diag(solution.covariance)) * problem.shared.std
    found = zip(problem.shared.parameters, problem.shared.found(solution.z), std, strict=True)
    return all(value > -_POSSIBLE * one for row, value, one in found if row.source.kind is Kind.BELT_MASS)


def linear_gain(problem: Problem, solution: Solution, bodies: Mapping[str, Body]) -> float:
    """Gain of evidence by a small mass in each specimen, by the linear model at a solution without them."""
    wide = with_belts(problem, bodies, solution.stiffness, rod=False)
    extra = [row for row in wide.shared.parameters[len(problem.shared) :] if row.source.kind is Kind.BELT_MASS]
    rest = [row for row in wide.shared.parameters[len(problem.shared) :] if row.source.kind is not Kind.BELT_MASS]
    at = replace(problem, observed=wide.observed)
    p, e = len(problem.shared), len(extra)
    triangle = widened(at, solution, [*extra, *rest], slopes=False)[1]
    return gain_of(triangle[p : p + e, p : p + e], triangle[p : p + e, -1], Group("belt", tuple(extra), 1.0))[0]


#: Steps from the other root of a quadratic to the K* that fits best there, and the change of log K* that is none.
_STEPS, _SAME = 12, 0.01


def second_roots(problem: Problem, solution: Solution) -> BoolArray:
    """Flags (c,) of the conditions whose tests another K* explains as well, within `GAIN` of the evidence.

    V2/V1 is quadratic in K* of a specimen with a mass, and so is F1/V1.
    """
    stiffness = _far_roots(problem, solution)
    for _ in range(_STEPS):
        step = sweep(problem, solution.z, stiffness, solution.slope)
        stiffness = moved(stiffness, step.own_step)
    both = (residuals(problem, replace(solution, stiffness=k)).whole for k in (stiffness, solution.stiffness))
    there, here = (problem.conditions.sum(whole) for whole in both)
    apart = np.abs(np.log(stiffness / solution.stiffness)) > _SAME
    return np.asarray(apart & (there - here < 2 * GAIN))


def _far_roots(problem: Problem, solution: Solution) -> ComplexArray:
    """The root (c,) that is further from K* of each condition [N/m], as the mean of its tests."""
    conditions = problem.conditions
    here = slice(conditions.first, None)
    roots = np.log(_roots(problem, solution.z)[here])
    off = np.abs(roots - np.log(solution.stiffness)[conditions.label[here]][:, None])
    far = roots[np.arange(len(roots)), np.argmax(off, axis=1)]
    return np.exp(np.add.reduceat(far, conditions.starts - conditions.first) / conditions.sizes)


@dataclass(frozen=True, eq=False)
class Found(ByValue):
    """The inertia of a specimen at one condition without its frequency, as found.

    Attributes
    ----------
    test : int
        A test of the condition, of the middle one of its frequencies, by its row in the problem.
    specimen : Specimen
    mass_std, spread_std : float [kg], [1]
        Standard uncertainties of its mass, and of the spread of a rod.
    stiffness : complex [N/m]
        K* of this test.
    stds : (3,) float array [Hz], [Hz], [1]
        Standard uncertainties of both first frequencies, and of the modulus of the share, at this K*.
    """

    test: int
    specimen: Specimen
    mass_std: float
    spread_std: float
    stiffness: complex
    stds: FloatArray


def found_specimens(problem: Problem, solution: Solution) -> list[Found]:
    """The specimens at each condition without its frequency; a mass within its uncertainty is none."""
    observed, conditions, shared = problem.observed, problem.conditions, problem.shared
    stds = (np.sqrt(np.diag(solution.covariance)) * shared.std).tolist()
    std = {row.key: one for row, one in zip(shared.parameters, stds, strict=True)}
    place = {row.key: at for at, row in enumerate(shared.parameters)}
    mass, share, exponent = observed.belts(shared, solution.z)
    made = []
    for family in np.unique(conditions.family).tolist():
        own = np.flatnonzero(conditions.family == family)
        middle = int(own[np.argsort(conditions.mean_frequency[own])[own.size // 2]])
        test, stiffness = int(conditions.starts[middle]), complex(solution.stiffness[middle])
        number = int(observed.specimen[test])
        name, at = problem.names[number], int(observed.family[test])
        key = (Source(Kind.BELT_MASS, name), number)
        specimen, own_std = Specimen(), std.get(key, 0.0)
        further: FloatArray = np.zeros(3)
        if mass[test] > 2 * own_std:
            form = Form.ROD if observed.rod[test] else Form.BELT
            springs = complex(np.exp(share[test])), float(exponent[test]), complex(observed.reference[test])
            specimen = Specimen(form, float(mass[test]), *springs, spread=float(spread_of(springs[1])))
            keys = [key, *((Source(kind, name), at) for kind in (Kind.BELT_SHARE, Kind.BELT_ANGLE))]
            keys.append((Source(Kind.BELT_SPREAD if form is Form.ROD else Kind.BELT_EXPONENT, name), number))
            change = np.zeros((6, len(shared)))
            for row, one in enumerate(keys):
                if one in place:
                    change[row, place[one]] = shared.std[place[one]]
            change[4:] = -solution.slope[middle]
            covariance = change @ solution.covariance @ change.T
            covariance[4:, 4:] += solution.own[middle]
            further = _stds(specimen, stiffness, covariance)
        spread_std = std.get((Source(Kind.BELT_SPREAD, name), number), 0.0) * specimen.spread * (1 - specimen.spread)
        made.append(Found(test, specimen, own_std, spread_std, stiffness, further))
    return made


def _stds(specimen: Specimen, stiffness: complex, covariance: FloatArray) -> FloatArray:
    """Standard uncertainties (3,) of both frequencies [Hz] and of the share, by numerical derivatives.

    `covariance` (6, 6) is that of the mass, of Re and Im of the logarithm of the share, of the exponent (for a rod that
    of the odds of its spread), and of Re and Im of log K*.
    """

    def values(change: FloatArray) -> FloatArray:
        mass, real, imag, exponent, *of_k = change.tolist()
        moved_to = replace(
            specimen,
            mass=specimen.mass + mass,
            share=specimen.share * np.exp(real + 1j * imag),
            exponent=specimen.exponent + exponent,
            spread=float(spread_of(log_odds(specimen.spread) + exponent)),
        )
        k = np.array([stiffness * np.exp(complex(*of_k))])
        return np.append(moved_to.frequencies(k)[0], np.abs(moved_to.share_at(k)))

    size = 1e-4 * np.array([specimen.mass, 1.0, 1.0, 1.0, 1.0, 1.0])
    slopes = np.stack([(values(one) - values(-one)) / (2 * one.sum()) for one in np.diag(size)], axis=1)
    return np.asarray(np.sqrt(np.einsum("ij,jk,ik->i", slopes, covariance, slopes)))
