"""K* of one condition by different excitations: a linear specimen has the same K* by a sine, by noise, at any level."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations

import numpy as np

from fourpole.campaign.row import Test, condition_words
from fourpole.core import stats
from fourpole.core.alone import Alone
from fourpole.core.arrays import ComplexArray, FloatArray
from fourpole.core.checks import Check, Code, Excitation, Verdict, reported
from fourpole.core.confidence import SEARCH_CHANCE
from fourpole.study.points import Points

#: Tests whose deflections differ by less than this factor have one level.
_LEVEL = 1.25
#: Lines within this share of a frequency are compared with it, and the fewest frequencies of a comparison.
_NEAR, _FEWEST = 0.06, 3
#: Change of the stiffness between levels up to which ISO 10846-2, 7.7, takes a specimen as linear [dB].
LINEAR = 1.5
#: The excitation of each kind with a band.
_OF_KIND = {"random": Excitation.RANDOM, "sweep": Excitation.SWEEP}
_DECIBEL = 20.0 / np.log(10.0)


def excitations(points: Points, alone: Alone, further: Sequence[str]) -> Iterator[tuple[str, Check]]:
    """Checks of each condition with several excitations: kinds of test, and levels of random tests and sweeps.

    K* is that of each test by itself. The errors of the sensors and of the rig are the same in both and cancel, so the
    uncertainty of a difference is that of the noise. Conditions are named with their values on `further` axes.
    """
    for rows in points.by_condition(np.isfinite(alone.stiffness) & (alone.noise > 0)):
        kinds = _kinds(points.tests, alone.deflection, rows)
        for pair in combinations(kinds, 2):
            name = condition_words(points.tests[rows[0]], further=further)
            if (check := _compared(name, pair, [alone.part(kinds[key]) for key in pair])) is not None:
                yield name, check


_Level = tuple[Excitation, float]


def _kinds(tests: Sequence[Test], deflection: FloatArray, rows: np.ndarray) -> dict[_Level, list[int]]:
    """Rows of a condition by excitation and level [mm]; the amplitude of a sine may change with its frequency."""
    found: dict[_Level, list[int]] = {}
    for row in rows[np.argsort(deflection[rows], kind="stable")].tolist():
        kind = Excitation.SINES if tests[row].band is None else _OF_KIND[tests[row].kind]
        levels = [level for level in found if level[0] is kind]
        near = levels and (kind is Excitation.SINES or deflection[row] < _LEVEL * deflection[found[levels[-1]][0]])
        found.setdefault(levels[-1] if near else (kind, 1e3 * float(deflection[row])), []).append(row)
    return found


def _compared(name: str, keys: tuple[_Level, ...], pair: Sequence[Alone]) -> Check | None:
    """The check of two excitations; None if they have fewer than three frequencies in common."""
    sparse, dense = sorted(pair, key=lambda alone: alone.noise.size)
    off, variance = _differences(sparse, dense)
    if off.size < _FEWEST:
        return None
    statistic = float(np.mean(np.abs(off) ** 2 / (2.0 * variance)))
    limit = float(stats.chi2.isf(SEARCH_CHANCE, 2 * off.size)) / (2 * off.size)
    if statistic <= limit:
        return Check(Code.EXCITATIONS, Verdict.OK, statistic, limit)
    sign = 1.0 if sparse is pair[1] else -1.0
    weights = 1.0 / variance
    mean = sign * _DECIBEL * float(np.sum(weights * off.real) / np.sum(weights))
    softer, stiffer = keys if mean > 0 else keys[::-1]
    verdict = Verdict.WARNING if abs(mean) > LINEAR else Verdict.OK
    return reported(
        Code.EXCITATIONS, verdict, statistic, limit, name=name, softer=softer, stiffer=stiffer, decibel=abs(mean),
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
