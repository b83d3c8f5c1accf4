"""K* of one condition, which a linear specimen has in common by all excitations, amplitudes and masses."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations

import numpy as np

from fourpole.campaign.folder import Campaign
from fourpole.campaign.row import condition_words
from fourpole.core import stats
from fourpole.core.alone import Alone, deflection_amplitude
from fourpole.core.arrays import ComplexArray, FloatArray, IntArray, parts
from fourpole.core.checks import Check, Code, Excitation, Verdict, judged, reported
from fourpole.core.condition import SAME_FREQUENCY
from fourpole.core.confidence import SEARCH_CHANCE
from fourpole.core.identify import Identification
from fourpole.study.identify import RigGroup
from fourpole.study.points import Points
from fourpole.words import said

#: Tests whose deflections differ by less than this factor have one level.
_LEVEL = 1.25
#: Largest over smallest deflection amplitude above which a curve mixes amplitudes.
_MIXED = 2.0
#: Lines within this share of a frequency are compared with it, and the fewest frequencies of a comparison.
_NEAR, _FEWEST_COMMON = 0.06, 3
#: Change of the stiffness between levels up to which ISO 10846-2, 7.7, takes a specimen as linear [dB].
LINEAR = 1.5
#: Change of K* from one amplitude or mass to another that is worth a warning [1]: that of a specimen whose harmonics
#: are at the limit of the check `linearity of the specimen`.
_DEPENDS = 0.06
#: Further tests of about one frequency with which a test is compared, and a floor of the uncertainty for round-off [1].
_FURTHER, _ROUND_OFF = 64, 1e-9
#: The excitation of each kind with a band.
_OF_KIND = {"random": Excitation.RANDOM, "sweep": Excitation.SWEEP}
_DECIBEL = 20.0 / np.log(10.0)


def agreement(campaign: Campaign, points: Points, groups: Sequence[RigGroup]) -> Iterator[tuple[str, Check]]:
    """Checks of each condition with tests at one frequency that differ in the deflection, or in the added mass.

    K* as identified is compared. The uncertainty of a difference has the noise of both tests, and of each error that
    all tests share (rig, sensors, added masses) the part that does not cancel. The statistic is the largest relative
    difference that is no chance, for all pairs of a rig together. A rig that does not fit has a check of its own.
    """
    further = [axis.name for axis in campaign.stated.sameness.further]
    for group in groups:
        rig, result = campaign.stated.all_rigs.get(group.rig_name), group.result
        if group.estimate is not None and not group.estimate.fits:
            continue
        tests = [points.tests[row] for row in group.rows.tolist()]
        force, contact, far = group.phasors.amplitudes.T
        deflection = deflection_amplitude(
            force,
            contact,
            far,
            group.phasors.omega,
            stiffness=result.stiffness,
            blocked=rig is not None and rig.rig().blocked,
        )
        mass = np.array([test.added_mass for test in tests])
        first, second = _pairs(group, points, deflection, mass)
        if not first.size:
            continue
        off, pull = _differences_of(result, first, second)
        chance = pull > np.sqrt(stats.chi2.isf(SEARCH_CHANCE / first.size, 2))
        for number in dict.fromkeys(points.condition[group.rows[first]].tolist()):
            here = points.condition[group.rows[first]] == number
            worst = int(np.argmax(np.where(here & chance, off, -1.0)))
            name = condition_words(tests[first[np.argmax(here)]], further=further)
            if not chance[worst] or not here[worst]:
                yield name, Check(Code.AMPLITUDES, Verdict.OK, 0.0, _DEPENDS)
                continue
            ends = sorted((first[worst], second[worst]), key=lambda place: float(deflection[place]))
            level = [1e3 * float(deflection[place]) for place in ends]
            form = {} if level[1] > _LEVEL * level[0] else {"form": "masses"}
            yield name, judged(
                Code.AMPLITUDES, float(off[worst]), _DEPENDS, name=name, hertz=float(result.frequency[ends[0]]),
                smallest=level[0], largest=level[1], masses=tuple(float(mass[place]) for place in ends),
                percent=100 * float(off[worst]), times=float(pull[worst]), **form,
            )  # fmt: skip


def _pairs(group: RigGroup, points: Points, deflection: FloatArray, mass: FloatArray) -> tuple[IntArray, IntArray]:
    """Places in a group of pairs of tests of one condition and frequency, with another level or mass."""
    known = np.isfinite(group.result.stiffness) & (deflection > 0) & ~points.strange[group.rows]
    condition, logs = points.condition[group.rows], np.log(group.result.frequency)
    order = np.flatnonzero(known & (condition >= 0))
    order = order[np.lexsort((logs[order], condition[order]))]
    pairs = [(order[:0], order[:0])]
    for step in range(1, min(_FURTHER, order.size - 1) + 1):
        first, second = order[:-step], order[step:]
        alike = (condition[first] == condition[second]) & (logs[second] - logs[first] < SAME_FREQUENCY)
        if not alike.any():
            break
        level = np.abs(np.log(deflection[first] / deflection[second]))
        kept = alike & ((level > np.log(_LEVEL)) | (mass[first] != mass[second]))
        pairs.append((first[kept], second[kept]))
    first, second = (np.concatenate(side) for side in zip(*pairs, strict=True))
    return first, second


def _differences_of(result: Identification, first: IntArray, second: IntArray) -> tuple[FloatArray, FloatArray]:
    """Relative difference of K* of pairs of tests [1], and its size in standard uncertainties."""
    turn = parts(np.stack([1.0 / result.stiffness, 1j / result.stiffness], axis=1), axis=1)
    shared = turn @ result.stiffness_shared
    own = turn @ result.stiffness_covariance @ turn.swapaxes(1, 2) - shared @ shared.swapaxes(1, 2)
    apart = np.log(result.stiffness[first] / result.stiffness[second])
    rest = shared[first] - shared[second]
    covariance = own[first] + own[second] + rest @ rest.swapaxes(1, 2) + _ROUND_OFF**2 * np.eye(2)
    off = parts(apart)
    squares = np.einsum("pi,pi->p", off, np.linalg.solve(covariance, off[:, :, None])[:, :, 0])
    return np.abs(np.expm1(np.abs(apart))), np.sqrt(np.maximum(squares, 0.0))


def mixed_amplitudes(points: Points, alone: Alone, further: Sequence[str]) -> list[str]:
    """A sentence on the curve over frequency that mixes the largest range of amplitudes; none if no curve does."""
    ranges = []
    for rows in points.by_condition(alone.deflection > 0):
        sizes = 1e3 * alone.deflection[rows]
        if sizes.max() > _MIXED * sizes.min():
            name = condition_words(points.tests[rows[0]], further=further)
            ranges.append((float(sizes.max() / sizes.min()), name, float(sizes.min()), float(sizes.max())))
    worst = [
        reported(Code.AMPLITUDES, Verdict.WARNING, form="range", name=name, smallest=smallest, largest=largest)
        for _, name, smallest, largest in sorted(ranges, reverse=True)
    ]
    return notes_of(worst)


def notes_of(checks: Sequence[Check]) -> list[str]:
    """A sentence for each code of the warnings of conditions, on the first of them."""
    notes = []
    warned = [check for check in checks if check.verdict is not Verdict.OK]
    for code in dict.fromkeys(check.code for check in warned):
        first, *others = [check for check in warned if check.code is code]
        cause, remedy = said(first)
        more = f" (and of {len(others)} more conditions)" if others else ""
        notes.append(f"{cause.removesuffix(': ')}{more}: {remedy}")
    return notes


# --- K* by different excitations -------------------------------------------------------------------------------------

_Level = tuple[Excitation, float]


def excitations(points: Points, alone: Alone, further: Sequence[str]) -> Iterator[tuple[str, Check]]:
    """Checks of each condition with several excitations: kinds of test, and levels of random tests and sweeps.

    K* is that of each test by itself. Tests with one added mass are compared: the errors of the sensors and of the rig
    are then the same in both and cancel, so that the uncertainty of a difference is that of the noise. Conditions are
    named with their values on `further` axes. The level [mm] is the deflection; the amplitude of a sine may change with
    its frequency.
    """
    deflection, masses = alone.deflection, np.array([test.added_mass for test in points.tests])
    known = np.isfinite(alone.stiffness) & (alone.noise > 0)
    for rows in (of for mass in np.unique(masses) for of in points.by_condition(known & (masses == mass))):
        kinds: dict[_Level, list[int]] = {}
        for row in rows[np.argsort(deflection[rows], kind="stable")].tolist():
            test = points.tests[row]
            kind = Excitation.SINES if test.band is None else _OF_KIND[test.kind]
            levels = [level for level in kinds if level[0] is kind]
            near = levels and (kind is Excitation.SINES or deflection[row] < _LEVEL * deflection[kinds[levels[-1]][0]])
            kinds.setdefault(levels[-1] if near else (kind, 1e3 * float(deflection[row])), []).append(row)
        for pair in combinations(kinds, 2):
            name = condition_words(points.tests[rows[0]], further=further)
            if (check := _compared(name, pair, [alone.part(kinds[key]) for key in pair])) is not None:
                yield name, check


def _compared(name: str, keys: tuple[_Level, ...], pair: Sequence[Alone]) -> Check | None:
    """The check of two excitations; None if they have fewer than three frequencies in common."""
    sparse, dense = sorted(pair, key=lambda alone: alone.noise.size)
    off, variance = _differences(sparse, dense)
    if off.size < _FEWEST_COMMON:
        return None
    if np.sum(np.abs(off) ** 2 / variance) <= stats.chi2.isf(SEARCH_CHANCE, 2 * off.size):
        return Check(Code.EXCITATIONS, Verdict.OK, 0.0, LINEAR)
    sign = 1.0 if sparse is pair[1] else -1.0
    weights = 1.0 / variance
    mean = sign * _DECIBEL * float(np.sum(weights * off.real) / np.sum(weights))
    softer, stiffer = keys if mean > 0 else keys[::-1]
    verdict = Verdict.WARNING if abs(mean) > LINEAR else Verdict.OK
    return reported(
        Code.EXCITATIONS, verdict, abs(mean), LINEAR, name=name, softer=softer, stiffer=stiffer, decibel=abs(mean),
        count=off.size, linear=LINEAR,
    )  # fmt: skip


def _differences(sparse: Alone, dense: Alone) -> tuple[ComplexArray, FloatArray]:
    """Differences of ln K* at the frequencies of the first tests, and the variance of each of their parts."""
    frequency, values, weights = np.log(dense.frequency), np.log(dense.stiffness), dense.noise**-2.0
    off, variance = [], []
    for place in range(sparse.noise.size):
        apart = frequency - np.log(sparse.frequency[place])
        near = np.abs(apart) < _NEAR
        if not (near & (apart <= 1e-9)).any() or not (near & (apart >= -1e-9)).any():
            continue
        line = np.stack([np.ones(near.sum()), apart[near]], axis=1)[:, : min(2, int(near.sum()))]
        normal = np.linalg.pinv((line.T * weights[near]) @ line)
        off.append(np.log(sparse.stiffness[place]) - (normal @ ((line.T * weights[near]) @ values[near]))[0])
        variance.append(sparse.noise[place] ** 2 + normal[0, 0])
    return np.array(off), np.array(variance)
