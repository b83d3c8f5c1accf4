"""Comparison of the tests with each other before they are identified: copies, noise, smooth curves of K*."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations

import numpy as np

from fourpole import quantities as q
from fourpole.campaign.folder import Campaign, Test, condition_of
from fourpole.core.arrays import FloatArray
from fourpole.core.checks import Check, judged, reported, worst_verdict
from fourpole.core.codes import Code
from fourpole.core.curves import Curves, Samples, curves_of
from fourpole.core.phasor import CHANNELS, SYMBOLS
from fourpole.core.scales import check_scale, k1_exchanged
from fourpole.study.excitations import excitations
from fourpole.study.outcome import Point
from fourpole.study.own import Own, named, own_of

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


@dataclass(frozen=True)
class Compared:
    """Results of the comparison of tests with each other.

    Attributes
    ----------
    checks : dict of int to list of Check
        Checks of each test, by its place.
    strange : frozenset of int
        Tests whose K* is not that of their condition: they must not share it with other tests.
    conditions : list of (str, Check)
        Checks of whole conditions, by the condition in words.
    linear : bool
        Whether no test showed a specimen that is not linear.
    """

    checks: dict[int, list[Check]] = field(default_factory=dict)
    strange: frozenset[int] = frozenset()
    conditions: list[tuple[str, Check]] = field(default_factory=list)
    linear: bool = True

    @property
    def notes(self) -> list[str]:
        """One sentence on the curve that mixes the largest range of amplitudes, where the specimen is not linear."""
        mixed = [check for _, check in self.conditions if check.code is Code.AMPLITUDES and check.remark]
        if self.linear or not mixed:
            return []
        worst = max(mixed, key=lambda check: check.statistic)
        more = f" ({len(mixed) - 1} more curves do so)" if len(mixed) > 1 else ""
        return [f"{worst.cause.removesuffix(': ')}{more}: {worst.remedy}"]


def compare_tests(campaign: Campaign, tests: Sequence[Test], points: Sequence[Point], k1: Sequence[float]) -> Compared:
    """Compare the tests of a campaign with each other, and with K1 [N/m]; `tests` has a test once per point."""
    used = [i for i, point in enumerate(points) if _used(point)]
    members = [i for i in used if tests[i].kind != "calibration"]
    rigs = {name: rig.rig() for name, rig in campaign.stated.all_rigs.items()}
    own = [own_of(points[i].phasors, rigs.get(tests[i].rig), tests[i].value("added_mass") or 0.0) for i in members]
    rows = noises(tests, points, [i for i in used if tests[i].band is None])
    rows += scales(members, points, own, k1)
    rows += exchanged_k1(campaign, [tests[i] for i in members], members, own, [k1[i] for i in members])
    # K* of a specimen that is not linear depends on the amplitude: it has no curve over frequency.
    linear = [i for i in range(len(members)) if not _not_linear(points[members[i]])]
    on_curves = [tests[members[i]] for i in linear]
    curves = _curves(campaign, on_curves, [own[i] for i in linear])
    strange: frozenset[int] = frozenset()
    if curves is not None:
        strange = frozenset(members[linear[i]] for i in np.flatnonzero(curves.strange).tolist())
        rows += [(members[linear[i]], check) for i, check in curve_checks(curves, on_curves)]
    rows = copies(tests, points, frozenset(used) - strange) + rows
    checks: dict[int, list[Check]] = {i: [] for i in range(len(tests))}
    for i, check in rows:
        checks[i].append(check)
    ranges = [
        *amplitudes(campaign, [tests[i] for i in members], own),
        *excitations(campaign, [tests[i] for i in members], own),
    ]
    return Compared(checks, strange, ranges, linear=len(linear) == len(members))


def scales(
    members: Sequence[int], points: Sequence[Point], own: Sequence[Own], k1: Sequence[float]
) -> list[tuple[int, Check]]:
    """Checks of K1 against K'.

    V1 is common to all tests. If a mistake in V1 does not explain most of them, K1 alone is checked.
    """
    for motion in (True, False):
        rows = []
        for i, one in zip(members, own, strict=True):
            phasors = points[i].phasors
            check = None if phasors is None else check_scale(phasors, one.stiffness, k1[i], motion=motion)
            rows += [(i, check)] if check is not None else []
        if 2 * sum(check.code is Code.V1_SCALE for _, check in rows) > len(rows):
            break
    # Many tests have one K1. If K' is below K1 in a few of them only, these tests have a fault of their own.
    # The same holds if K' is far above K1 at a few lines: K' rises by the loss at lower frequencies, too.
    of_k1 = Counter(k1[i] for i, _ in rows)
    doubted = Counter((k1[i], check.code) for i, check in rows if check.verdict == "warning")

    def is_of_few(i: int, check: Check) -> bool:
        alone = check.code is Code.K1_LARGE or (check.code is Code.K1_RATIO and points[i].line is not None)
        return check.verdict == "warning" and alone and 2 * doubted[k1[i], check.code] <= of_k1[k1[i]]

    return [(i, check) for i, check in rows if not is_of_few(i, check)]


def exchanged_k1(
    campaign: Campaign, tests: Sequence[Test], members: Sequence[int], own: Sequence[Own], k1: Sequence[float]
) -> list[tuple[int, Check]]:
    """Checks of tyres, or pressures of a tyre, whose K1 looks exchanged, from tests equal in all else."""
    rule = campaign.stated.sameness
    alike = [replace(test, tyre="", values={**test.values, _PRESSURE: np.nan}) for test in tests]
    conditions = rule.groups([condition_of(test, rule) for test in alike]).tolist()
    logs = [float(np.log(max(one.frequency, 1e-300))) for one in own]
    of_static: dict[tuple[str, float], dict[int, list[int]]] = {}
    for i, test in enumerate(tests):
        if np.isfinite(own[i].stiffness) and np.isfinite(k1[i]):
            group = test.tyre, test.value(_PRESSURE) or 0.0
            of_static.setdefault(group, {}).setdefault(conditions[i], []).append(i)
    rows = []
    for one, other in combinations(of_static, 2):
        if one[0] != other[0] and one[1] != other[1]:
            continue
        pairs = [
            (a, b)
            for condition, here in of_static[one].items()
            for a in here
            for b in of_static[other].get(condition, ())
            if abs(logs[a] - logs[b]) < _SAME_FREQUENCY
        ]
        stiffness = np.array([[own[i].stiffness for i in pair] for pair in pairs]).reshape(-1, 2)
        static = np.array([[k1[i] for i in pair] for pair in pairs]).reshape(-1, 2)
        ratios = k1_exchanged(stiffness, static, same=one[0] == other[0]) if pairs else None
        if ratios is not None:
            a, b, usual = ratios
            unlike, names = abs(a - b) / usual, f"{_static_name(*one)} and {_static_name(*other)}"
            check = reported(Code.K1_EXCHANGED, "warning", unlike, names=names, one=a, other=b, usual=usual)
            rows += [(members[i], check) for group in (one, other) for here in of_static[group].values() for i in here]
    return rows


def _static_name(tyre: str, pressure: float) -> str:
    """A tyre at a pressure [Pa], in words."""
    return f"{tyre} at {pressure / q.PRESSURE.scale:.4g} {q.PRESSURE.shown}" if pressure else tyre


def amplitudes(campaign: Campaign, tests: Sequence[Test], own: Sequence[Own]) -> list[tuple[str, Check]]:
    """Checks of the range of deflection amplitudes of each condition; a range is no fault of a test."""
    rule = campaign.stated.sameness
    groups: dict[int, list[int]] = {}
    for i, number in enumerate(rule.groups([condition_of(test, rule) for test in tests]).tolist()):
        if np.isfinite(own[i].deflection) and own[i].deflection > 0:
            groups.setdefault(number, []).append(i)
    rows = []
    for group in groups.values():
        sizes = [1e3 * own[i].deflection for i in group]
        further = [axis.name for axis in rule.further]
        name, ratio = named(tests[group[0]], further=further), max(sizes) / min(sizes)
        check = Check(Code.AMPLITUDES, ratio, _MIXED, "ok")
        if ratio > _MIXED:
            check = reported(Code.AMPLITUDES, "ok", ratio, _MIXED, name=name, low=min(sizes), high=max(sizes))
        rows.append((name, check))
    return rows


def _used(point: Point) -> bool:
    return point.phasors is not None and worst_verdict(row.verdict for row in point.checks) != "rejected"


def _not_linear(point: Point) -> bool:
    return any(row.code is Code.LINEARITY and row.verdict != "ok" for row in point.checks)


def copies(tests: Sequence[Test], points: Sequence[Point], sound: frozenset[int]) -> list[tuple[int, Check]]:
    """Checks of tests with the same recording, whatever the names of their files.

    If only one of them is sound by all other checks, the copy is the other one.
    """
    same: list[list[int]] = []
    size = [0.0 if point.phasors is None else float(abs(point.phasors.amplitudes[1])) for point in points]
    for i in sorted(range(len(points)), key=lambda i: size[i]):
        if size[i] > 0 and same and _equal(points[same[-1][-1]], points[i]):
            same[-1].append(i)
        elif size[i] > 0:
            same.append([i])
    rows = []
    for group in map(sorted, same):
        names = list(dict.fromkeys(tests[i].name for i in group))
        alone = len(sound.intersection(group)) == 1
        for i in group if len(names) > 1 else ():
            if not (alone and i in sound):
                others = " and ".join(name for name in names if name != tests[i].name)
                rows.append((i, reported(Code.COPY, "warning", others=others)))
    return rows


def _equal(one: Point, other: Point) -> bool:
    """Whether the amplitudes of two tests are equal within a fraction of their noise.

    Their last digits depend on the stated frequency, from which the search begins. Repeats without noise are no copies.
    """
    assert one.phasors is not None
    assert other.phasors is not None
    apart = np.nan_to_num(np.abs(one.phasors.amplitudes - other.phasors.amplitudes))
    noise = np.nan_to_num(other.phasors.std.reshape(3, 2).min(axis=1))
    return bool(np.all(apart <= _COPIED * noise) and noise[1] > 0)


def noises(tests: Sequence[Test], points: Sequence[Point], used: Sequence[int]) -> list[tuple[int, Check]]:
    """Checks of the noise of each channel against that of the other tests of the rig."""
    rows = []
    for rig in dict.fromkeys(tests[i].rig for i in used):
        own = [i for i in used if tests[i].rig == rig]
        for at, name in enumerate(SYMBOLS.values()):
            known = [(i, *_noise(points[i], at)) for i in own]
            known = [one for one in known if np.isfinite(one[1]) and one[1] > 0]
            if len(known) < _FEWEST:
                continue
            usual = float(np.median([noise for _, noise, _ in known]))
            for i, noise, share in known:
                times = noise / usual if share > _MATTERS else 0.0
                rows.append((i, judged(Code.NOISE, times, _NOISIER, channel=name)))
    return rows


def _noise(point: Point, channel: int) -> tuple[float, float]:
    """Standard uncertainty of an amplitude from the noise, in its unit and over the amplitude."""
    assert point.phasors is not None
    noise = float(point.phasors.std[2 * channel : 2 * channel + 2].max())
    return noise, noise / max(float(abs(point.phasors.amplitudes[channel])), 1e-300)


def _curves(campaign: Campaign, tests: Sequence[Test], own: Sequence[Own]) -> Curves | None:
    """The curves of K* over frequency of all conditions."""
    if not tests:
        return None
    rule = campaign.stated.sameness
    specimens = list(dict.fromkeys(test.tyre for test in tests))
    frequency = np.array([one.frequency for one in own])
    deflection = np.log([one.deflection if one.deflection > 0 else np.nan for one in own])
    deflection -= np.mean(deflection[np.isfinite(deflection)]) if np.isfinite(deflection).any() else 0.0
    lever = np.array([one.lever if np.isfinite(one.lever) else complex(np.nan) for one in own])
    place = _places(tests)
    shared = [lever, 1j * lever * frequency / frequency.mean(), place + 0j, deflection + 0j]
    gain = _gain(campaign)
    return curves_of(
        Samples(
            stiffness=np.array([one.stiffness for one in own]),
            noise=np.array([one.noise for one in own]),
            frequency=frequency,
            family=rule.groups([condition_of(test, rule) for test in tests]),
            specimen=np.array([specimens.index(test.tyre) for test in tests]),
            shared=np.stack(shared, axis=1),
            prior=np.array([gain, gain, _DRIFT, _POWER]),
        )
    )


def _places(tests: Sequence[Test]) -> FloatArray:
    """Place of each test in the run, from -0.5 to 0.5: by the stated times if all are stated, else by their order."""
    time = np.array([test.values.get("time", np.nan) for test in tests])
    time = time if np.all(np.isfinite(time)) else np.arange(len(tests), dtype=float)
    return (time - time.min()) / (float(np.ptp(time)) or 1.0) - 0.5


def _gain(campaign: Campaign) -> float:
    """Standard uncertainty of the ratio of the gains of V1 and V2, phase included."""
    channels = [campaign.stated.channels.named(role) for role in CHANNELS[1:]]
    stds = [std for one in channels if one is not None for std in (one.gain_std, one.phase_std)]
    return 2.0 * max(float(np.linalg.norm(stds)), 1e-3)


def curve_checks(curves: Curves, tests: Sequence[Test]) -> list[tuple[int, Check]]:
    """Checks of each test against the curve of its condition; of two exchanged tests both are warned."""
    family, limit = curves.samples.family, curves.limit
    fits = {int(i): _family_of(curves, int(i)) for i in np.flatnonzero(curves.strange)}
    rows = []
    for i in np.flatnonzero(curves.judged).tolist():
        statistic = float(curves.statistic[i])
        if i not in fits:
            rows.append((i, Check(Code.OFF_CURVE, min(statistic, limit), limit, "ok")))
            continue
        percent = 100 * float(abs(np.expm1(curves.off[i])))
        twins = [k for k, there in fits.items() if there == family[i] and fits[i] == family[k]]
        if fits[i] is None:
            check = reported(Code.OFF_CURVE, "warning", statistic, limit, percent=percent)
        elif twins:
            frequency = curves.samples.frequency
            twin = min(twins, key=lambda k: abs(np.log(frequency[k] / frequency[i])))
            pair = sorted((i, twin))
            names = " and ".join(tests[k].name for k in pair)
            check = reported(Code.EXCHANGED, "warning", statistic, limit, names=names, percent=percent)
        else:
            other = named(tests[int(np.flatnonzero(family == fits[i])[0])], tests[i])
            check = reported(Code.OTHER_CURVE, "warning", statistic, limit, other=other, percent=percent)
        rows.append((i, check))
    return rows


def _family_of(curves: Curves, test: int) -> int | None:
    """The other condition on whose curve a strange test lies best; None if it lies on none."""
    own = curves.samples.family[test]
    others = [int(one) for one in np.unique(curves.samples.family) if one != own]
    best = min(others, key=lambda one: curves.distance(test, one), default=None)
    return best if best is not None and curves.distance(test, best) <= curves.limit else None
