"""Comparison of the tests with each other before they are identified: copies, noise, smooth curves of K*."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from fourpole import quantities as q
from fourpole.campaign.folder import Campaign
from fourpole.campaign.row import condition_of, condition_words
from fourpole.core.alone import Alone
from fourpole.core.arrays import BoolArray, ByValue
from fourpole.core.checks import Check, Code, Verdict, judged, reported
from fourpole.core.condition import Condition
from fourpole.core.curves import Curves, Samples, curves_of
from fourpole.core.phasor import CHANNELS, SYMBOLS
from fourpole.core.scales import check_scale, k1_exchanged
from fourpole.study.excitations import excitations
from fourpole.study.points import Points
from fourpole.words import said

#: A channel is noisier than usual above both: noise over the median noise of all tests, and noise over the amplitude.
_NOISIER, _MATTERS = 10.0, 0.003
#: Fewest tests of a rig among which one can be noisier than usual.
_FEWEST = 5
#: Largest over smallest deflection amplitude above which a curve mixes amplitudes.
_MIXED = 2.0
_PRESSURE = q.PRESSURE.key
#: Amplitudes of a copied recording are equal to this share of the standard uncertainty of their noise.
_COPIED = 1e-3
#: Relative difference below which the frequencies of tests of two tyres count as equal.
_SAME_FREQUENCY = 0.01
#: Standard uncertainties of the shared errors of ln K*: drift over the run, and power of the deflection amplitude.
_DRIFT, _POWER = 0.2, 0.03


@dataclass(frozen=True, eq=False)
class Compared(ByValue):
    """Results of the comparison of tests with each other.

    Attributes
    ----------
    points : Points
        The points with their checks.
    strange : (N,) bool array
        Rows whose K* is not that of their condition: they must not share it with other tests.
    conditions : tuple of (str, Check)
        Checks of whole conditions, by the condition in words.
    linear : bool
        Whether no test showed a specimen that is not linear.
    """

    points: Points
    strange: BoolArray
    conditions: tuple[tuple[str, Check], ...]
    linear: bool = True

    @property
    def notes(self) -> list[str]:
        """One sentence on the curve that mixes the largest range of amplitudes, where the specimen is not linear."""
        mixed = [check for _, check in self.conditions if check.code is Code.AMPLITUDES and check.values]
        if self.linear or not mixed:
            return []
        worst = max(mixed, key=lambda check: check.statistic)
        more = f" ({len(mixed) - 1} more curves do so)" if len(mixed) > 1 else ""
        cause, remedy = said(worst)
        return [f"{cause.removesuffix(': ')}{more}: {remedy}"]


def compare_points(campaign: Campaign, points: Points) -> Compared:
    """Compare the tests of a campaign with each other and with K1."""
    sound = points.sound
    used = sound & (points.condition >= 0)
    rigs = {name: rig.rig() for name, rig in campaign.stated.all_rigs.items()}
    added = np.array([test.added_mass for test in points.tests])
    unknown = replace(points.phasors, amplitudes=np.where(used[:, None], points.phasors.amplitudes, np.nan))
    alone = Alone.of(unknown, [rigs.get(test.rig) for test in points.tests], added)
    # K* of a specimen that is not linear depends on the amplitude: it has no curve over frequency.
    bent = [any(row.code is Code.LINEARITY and row.verdict is not Verdict.OK for row in rows) for rows in points.checks]
    straight = used & ~np.array(bent, dtype=bool)
    strange, on_curves = np.zeros(len(points), dtype=bool), []
    if (curves := _curves(campaign, points, alone, np.flatnonzero(straight))) is not None:
        strange[np.flatnonzero(straight)[curves.strange]] = True
        on_curves = list(curve_checks(curves, points, np.flatnonzero(straight)))
    checks = [
        *copies(points, sound & ~strange),
        *noises(points, sound & np.array([test.band is None for test in points.tests], dtype=bool)),
        *scales(points, alone),
        *_exchanged_k1(campaign, points, alone, np.flatnonzero(used)),
        *on_curves,
    ]
    further = [axis.name for axis in campaign.stated.sameness.further]
    ranges = [*_amplitudes(points, alone, further), *excitations(points, alone, further)]
    return Compared(points.with_checks(checks), strange, tuple(ranges), bool((straight == used).all()))


def scales(points: Points, alone: Alone) -> Iterator[tuple[int, Check]]:
    """Checks of K1 against K'.

    V1 is common to all tests. If a mistake in V1 does not explain most of them, K1 alone is checked.
    """
    k1 = [stiffness.value for stiffness in points.stiffness]
    for motion in (True, False):
        rows = []
        for row, value in enumerate(alone.stiffness.tolist()):
            if (check := check_scale(points.phasors.part(row), value, k1[row], motion=motion)) is not None:
                rows.append((row, check))
        if 2 * sum(check.code is Code.V1_SCALE for _, check in rows) > len(rows):
            break
    # Many tests have one K1. If K' is below K1 in a few of them only, these tests have a fault of their own.
    # The same holds if K' is far above K1 at a few lines: K' rises by the loss at lower frequencies, too.
    of_k1 = Counter(k1[row] for row, _ in rows)
    doubted = Counter((k1[row], check.code) for row, check in rows if check.verdict is Verdict.WARNING)
    for row, check in rows:
        line = check.code is Code.K1_RATIO and points.tests[row].band is not None
        few = 2 * doubted[k1[row], check.code] <= of_k1[k1[row]]
        if not (check.verdict is Verdict.WARNING and few and (line or check.code is Code.K1_LARGE)):
            yield row, check


def _exchanged_k1(campaign: Campaign, points: Points, alone: Alone, used: np.ndarray) -> Iterator[tuple[int, Check]]:
    """Checks of tyres, or pressures of a tyre, whose K1 looks exchanged, from tests equal in all else."""
    rule = campaign.stated.sameness.without(_PRESSURE)
    of_static: dict[tuple[str, float], dict[Condition, list[int]]] = {}
    for row in used.tolist():
        if np.isfinite(alone.stiffness[row]) and np.isfinite(points.stiffness[row].value):
            static = points.tests[row].tyre, points.tests[row].value(_PRESSURE) or 0.0
            condition = replace(condition_of(points.tests[row], rule), specimen="")
            of_static.setdefault(static, {}).setdefault(condition, []).append(row)
    logs = np.log(np.maximum(alone.frequency, 1e-300))
    for first, second in combinations(of_static, 2):
        if first[0] != second[0] and first[1] != second[1]:
            continue
        pairs = [
            (a, b)
            for condition, here in of_static[first].items()
            for a in here
            for b in of_static[second].get(condition, ())
            if abs(logs[a] - logs[b]) < _SAME_FREQUENCY
        ]
        static_k1 = np.array([[points.stiffness[row].value for row in pair] for pair in pairs]).reshape(-1, 2)
        same = first[0] == second[0]
        ratios = k1_exchanged(alone.stiffness[np.array(pairs)], static_k1, same=same) if pairs else None
        if ratios is not None:
            a, b, usual = ratios
            unlike, ratio = abs(a - b) / usual, {"first": a, "second": b, "usual": usual}
            check = reported(Code.K1_EXCHANGED, Verdict.WARNING, unlike, statics=(first, second), **ratio)
            for static in (first, second):
                yield from ((row, check) for rows in of_static[static].values() for row in rows)


def _amplitudes(points: Points, alone: Alone, further: Sequence[str]) -> Iterator[tuple[str, Check]]:
    """Checks of the range of deflection amplitudes of each condition; a range is no fault of a test."""
    for rows in points.by_condition(alone.deflection > 0):
        sizes = 1e3 * alone.deflection[rows]
        name, ratio = condition_words(points.tests[rows[0]], further=further), float(sizes.max() / sizes.min())
        if ratio > _MIXED:
            ends = {"smallest": float(sizes.min()), "largest": float(sizes.max())}
            yield name, reported(Code.AMPLITUDES, Verdict.OK, ratio, _MIXED, name=name, **ends)
        else:
            yield name, Check(Code.AMPLITUDES, Verdict.OK, ratio, _MIXED)


def copies(points: Points, sound: BoolArray) -> Iterator[tuple[int, Check]]:
    """Checks of tests with the same recording, whatever the names of their files.

    If only one of them is sound by all other checks, the copy is the other one. Amplitudes are equal within a fraction
    of their noise: their last digits depend on the stated frequency, from which the search begins. Repeats without
    noise are no copies.
    """
    amplitudes = points.phasors.amplitudes
    size = np.nan_to_num(np.hypot(amplitudes[:, 1].real, amplitudes[:, 1].imag))
    noise = np.nan_to_num(points.phasors.std.reshape(-1, 3, 2).min(axis=2))
    same: list[list[int]] = []
    for row in np.argsort(size, kind="stable")[np.count_nonzero(size <= 0) :].tolist():
        last = same[-1][-1] if same else row
        apart = np.nan_to_num(np.abs(amplitudes[last] - amplitudes[row]))
        if same and noise[row, 1] > 0 and np.all(apart <= _COPIED * noise[row]):
            same[-1].append(row)
        else:
            same.append([row])
    for rows in map(sorted, same):
        names = list(dict.fromkeys(points.tests[row].name for row in rows))
        single = np.count_nonzero(sound[rows]) == 1
        for row in rows if len(names) > 1 else ():
            if not (single and sound[row]):
                others = tuple(name for name in names if name != points.tests[row].name)
                yield row, reported(Code.COPY, Verdict.WARNING, tests=others)


def noises(points: Points, used: BoolArray) -> Iterator[tuple[int, Check]]:
    """Checks of the noise of each channel against that of the other tests of the rig."""
    std, amplitudes = points.phasors.std.reshape(-1, 3, 2).max(axis=2), points.phasors.amplitudes
    share = std / np.maximum(np.hypot(amplitudes.real, amplitudes.imag), 1e-300)
    rigs = np.array([test.rig for test in points.tests])
    for rig in dict.fromkeys(rigs[used].tolist()):
        for channel, name in enumerate(SYMBOLS.values()):
            known = np.flatnonzero(used & (rigs == rig) & np.isfinite(std[:, channel]) & (std[:, channel] > 0))
            usual = float(np.median(std[known, channel])) if known.size >= _FEWEST else np.nan
            for row in known.tolist() if known.size >= _FEWEST else ():
                times = float(std[row, channel]) / usual if share[row, channel] > _MATTERS else 0.0
                yield row, judged(Code.NOISE, times, _NOISIER, np.inf, name)


def _curves(campaign: Campaign, points: Points, alone: Alone, rows: np.ndarray) -> Curves | None:
    """The curves of K* over frequency of all conditions, from some rows; None without any."""
    if not rows.size:
        return None
    tests, alone = [points.tests[row] for row in rows], alone.part(rows)
    specimens = list(dict.fromkeys(test.tyre for test in tests))
    with np.errstate(divide="ignore", invalid="ignore"):
        deflection = np.log(np.where(alone.deflection > 0, alone.deflection, np.nan))
    deflection -= np.mean(deflection[np.isfinite(deflection)]) if np.isfinite(deflection).any() else 0.0
    lever = np.where(np.isfinite(alone.lever), alone.lever, complex(np.nan))
    # The place in the run, from -0.5 to 0.5: by the stated times if all are stated, else by the order.
    time = np.array([test.values.get("time", np.nan) for test in tests])
    time = time if np.all(np.isfinite(time)) else np.arange(len(tests), dtype=float)
    place = (time - time.min()) / (float(np.ptp(time)) or 1.0) - 0.5
    shared = [lever, 1j * lever * alone.frequency / alone.frequency.mean(), place + 0j, deflection + 0j]
    # The standard uncertainty of the ratio of the gains of V1 and V2, phase included.
    channels = [campaign.stated.channels.named(role) for role in CHANNELS[1:]]
    stds = [std for channel in channels if channel is not None for std in (channel.gain_std, channel.phase_std)]
    gain = 2.0 * max(float(np.linalg.norm(stds)), 1e-3)
    return curves_of(
        Samples(
            stiffness=alone.stiffness,
            noise=alone.noise,
            frequency=alone.frequency,
            family=points.condition[rows],
            specimen=np.array([specimens.index(test.tyre) for test in tests]),
            shared=np.stack(shared, axis=1),
            prior=np.array([gain, gain, _DRIFT, _POWER]),
        )
    )


def curve_checks(curves: Curves, points: Points, rows: np.ndarray) -> Iterator[tuple[int, Check]]:
    """Checks of each of some rows against the curve of its condition; of two exchanged tests both are warned."""
    family, limit, frequency = curves.samples.family, curves.limit, curves.samples.frequency
    fits = {strange: _family_of(curves, strange) for strange in np.flatnonzero(curves.strange).tolist()}
    for place in np.flatnonzero(curves.judged).tolist():
        row, statistic = int(rows[place]), float(curves.statistic[place])
        if place not in fits:
            yield row, Check(Code.OFF_CURVE, Verdict.OK, min(statistic, limit), limit)
            continue
        percent = 100 * float(abs(np.expm1(curves.off[place])))
        twins = [k for k, there in fits.items() if there == family[place] and fits[place] == family[k]]
        if fits[place] is None:
            check = reported(Code.OFF_CURVE, Verdict.WARNING, statistic, limit, percent=percent)
        elif twins:
            twin = min(twins, key=lambda k: abs(np.log(frequency[k] / frequency[place])))
            pair = tuple(points.tests[rows[k]].name for k in sorted((place, twin)))
            check = reported(Code.EXCHANGED, Verdict.WARNING, statistic, limit, tests=pair, percent=percent)
        else:
            there = points.tests[rows[np.flatnonzero(family == fits[place])[0]]]
            other = condition_words(there, points.tests[row])
            check = reported(Code.OTHER_CURVE, Verdict.WARNING, statistic, limit, other=other, percent=percent)
        yield row, check


def _family_of(curves: Curves, test: int) -> int | None:
    """The other condition on whose curve a strange test lies best; None if it lies on none."""
    own = curves.samples.family[test]
    others = [int(family) for family in np.unique(curves.samples.family) if family != own]
    best = min(others, key=lambda family: curves.distance(test, family), default=None)
    return best if best is not None and curves.distance(test, best) <= curves.limit else None
