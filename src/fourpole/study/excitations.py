"""K* of one condition by different excitations: a linear specimen has the same K* by a sine, by noise, at any level."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from fourpole.campaign.folder import Campaign, Test, condition_of
from fourpole.core import stats
from fourpole.core.arrays import ComplexArray, FloatArray
from fourpole.core.checks import Check, reported
from fourpole.core.codes import Code
from fourpole.core.confidence import SEARCH_CHANCE
from fourpole.study.own import Own, named

#: Tests whose deflections differ by less than this factor have one level.
_LEVEL = 1.25
#: Lines within this share of a frequency are compared with it, and the fewest frequencies of a comparison.
_NEAR, _FEWEST = 0.06, 3
#: Change of the stiffness between levels up to which ISO 10846-2, 7.7, takes a specimen as linear [dB].
LINEAR = 1.5
#: Each kind with a band in words.
_WORDS = {"random": "random excitation", "sweep": "a sweep"}
_DECIBEL = 20.0 / np.log(10.0)


def excitations(campaign: Campaign, tests: Sequence[Test], own: Sequence[Own]) -> list[tuple[str, Check]]:
    """Checks of each condition with several excitations: kinds of test, and levels of random tests and sweeps.

    K* is that of each test by itself. The errors of the sensors and of the rig are the same in both and cancel, so the
    uncertainty of a difference is that of the noise.
    """
    rule = campaign.stated.sameness
    groups: dict[int, list[int]] = {}
    for i, number in enumerate(rule.groups([condition_of(test, rule) for test in tests]).tolist()):
        if np.isfinite(own[i].stiffness) and own[i].noise > 0:
            groups.setdefault(number, []).append(i)
    rows = []
    for group in groups.values():
        kinds = _kinds(tests, own, group)
        for one, other in combinations(kinds, 2):
            name = named(tests[group[0]], further=[axis.name for axis in rule.further])
            check = _compared(name, (one, other), [[own[i] for i in kinds[key]] for key in (one, other)])
            rows += [(name, check)] if check is not None else []
    return rows


def _kinds(tests: Sequence[Test], own: Sequence[Own], group: Sequence[int]) -> dict[str, list[int]]:
    """Tests of a condition by excitation, in words; the amplitude of a sine may change with its frequency."""
    found: dict[str, list[int]] = {}
    for i in sorted(group, key=lambda i: own[i].deflection):
        if tests[i].band is None:
            found.setdefault("sines", []).append(i)
            continue
        levels = [key for key in found if key.startswith(_WORDS[tests[i].kind])]
        if levels and own[i].deflection < _LEVEL * own[found[levels[-1]][0]].deflection:
            found[levels[-1]].append(i)
        else:
            found[f"{_WORDS[tests[i].kind]} of {1e3 * own[i].deflection:.3g} mm"] = [i]
    return found


def _compared(name: str, keys: tuple[str, str], pair: Sequence[Sequence[Own]]) -> Check | None:
    """The check of two excitations; None if they have fewer than three frequencies in common."""
    sparse, dense = sorted(pair, key=len)
    off, variance = _differences(sparse, dense)
    if off.size < _FEWEST:
        return None
    statistic = float(np.mean(np.abs(off) ** 2 / (2.0 * variance)))
    limit = float(stats.chi2.isf(SEARCH_CHANCE, 2 * off.size)) / (2 * off.size)
    if statistic <= limit:
        return Check(Code.EXCITATIONS, statistic, limit, "ok")
    sign = 1.0 if sparse is pair[1] else -1.0
    weights = 1.0 / variance
    mean = sign * _DECIBEL * float(np.sum(weights * off.real) / np.sum(weights))
    one, other = keys if mean > 0 else keys[::-1]
    verdict = "warning" if abs(mean) > LINEAR else "ok"
    return reported(
        Code.EXCITATIONS, verdict, statistic, limit, name=name, one=one, other=other, mean=abs(mean), count=off.size,
        linear=LINEAR,
    )  # fmt: skip


def _differences(sparse: Sequence[Own], dense: Sequence[Own]) -> tuple[ComplexArray, FloatArray]:
    """Differences of ln K* at the frequencies of the first tests, and the variance of each of their parts."""
    frequency = np.log([one.frequency for one in dense])
    values = np.log([one.stiffness for one in dense])
    weights = np.array([one.noise for one in dense]) ** -2.0
    off, variance = [], []
    for one in sparse:
        apart = frequency - np.log(one.frequency)
        near = np.abs(apart) < _NEAR
        if not (near & (apart <= 1e-9)).any() or not (near & (apart >= -1e-9)).any():
            continue
        line = np.stack([np.ones(near.sum()), apart[near]], axis=1)[:, : min(2, int(near.sum()))]
        normal = np.linalg.pinv((line.T * weights[near]) @ line)
        off.append(np.log(one.stiffness) - (normal @ ((line.T * weights[near]) @ values[near]))[0])
        variance.append(one.noise**2 + normal[0, 0])
    return np.array(off), np.array(variance)
