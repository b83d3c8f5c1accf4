"""Checks of points beyond their own recording.

Before the identification the tests are compared with each other: copies, noise, scales, smooth curves of K*. After it
each point is judged: whether K2 and C exist, agreement, the rig.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import combinations, pairwise
from math import log, sqrt

import numpy as np

from fourpole import quantities as q
from fourpole.campaign.folder import Campaign
from fourpole.campaign.row import begun_at, condition_of, condition_words
from fourpole.core.alone import Alone, check_scale, k1_exchanged
from fourpole.core.arrays import BoolArray, FloatArray
from fourpole.core.checks import Check, Code, Verdict, judged, reported
from fourpole.core.condition import SAME_FREQUENCY, Condition
from fourpole.core.confidence import SEARCH_CHANCE
from fourpole.core.curvature import NOT_LINEAR
from fourpole.core.curves import Curves, Samples, curves_of
from fourpole.core.phasor import CHANNELS, SYMBOLS
from fourpole.core.routes import NoArm, no_arm
from fourpole.study.agreement import excitations, mixed_amplitudes
from fourpole.study.identify import RigGroup
from fourpole.study.points import Points, StaticStiffness

#: A channel is noisier than usual above both: noise over the median noise of all tests, and noise over the amplitude.
_NOISIER, _MATTERS = 10.0, 0.003
#: Fewest tests of a rig among which one can be noisier than usual.
_FEWEST = 5
_PRESSURE = q.PRESSURE.key
#: Amplitudes of a copied recording are equal to this share of the standard uncertainty of their noise.
_COPIED = 1e-3
#: Share of a window that another one has in common with it, from which they are copies.
_OVERLAP = 0.5
#: Relative scatter of K* from test to test beyond which more than the specimen differs; tyres repeat to 0.03-1 %.
_MOST_SCATTER = 0.02
#: Standard uncertainties below zero from which K'' is negative.
_NEGATIVE = 1.96
#: Relative uncertainties of K* from which five and two of them reach zero: no interval is symmetric, and none is known.
_UNCERTAIN = 0.2, 0.5
#: Standard uncertainties below zero, and the share of such tests, from which K'' of all tests of a rig is in doubt.
_GIVES, _FEW_GIVE = 4.0, 0.05
#: If at least this share of the Monte Carlo trials is not passive, no passive K2 and C exist.
_NEVER_PASSIVE = 0.975
#: Standard uncertainties of the shared errors of ln K*: drift over the run, and power of the deflection amplitude.
_DRIFT, _POWER = 0.2, 0.03


def compare_points(campaign: Campaign, points: Points) -> tuple[Points, list[tuple[str, Check]], list[str]]:
    """Compare the tests of a campaign with each other and with K1.

    Returns
    -------
    points : Points
        The points with their checks, and those marked whose K* is not that of their condition.
    conditions : list of (str, Check)
        Checks of whole conditions, by the condition in words.
    notes : list of str
        A sentence on the curve that mixes the largest range of amplitudes, where the specimen is not linear.
    """
    sound = points.sound
    used = sound & (points.condition >= 0)
    rigs = {name: rig.rig() for name, rig in campaign.stated.all_rigs.items()}
    added = np.array([test.added_mass for test in points.tests])
    unknown = replace(points.phasors, amplitudes=np.where(used[:, None], points.phasors.amplitudes, np.nan))
    alone = Alone.of(unknown, [rigs.get(test.rig) for test in points.tests], added)
    # K* of a specimen that is not linear depends on the amplitude: it has no curve over frequency.
    bent = [any(row.code is Code.LINEARITY and row.verdict is not Verdict.OK for row in rows) for rows in points.checks]
    # No line of a recording with many can be another's: that would be an error of all its lines.
    single = np.array([test.band is None for test in points.tests], dtype=bool)
    straight = np.flatnonzero(used & single & ~np.array(bent, dtype=bool))
    strange, on_curves = np.zeros(used.size, dtype=bool), []
    if (curves := _curves(campaign, points, alone, straight)) is not None:
        strange[straight[curves.strange]] = True
        on_curves = list(curve_checks(curves, points, straight))
    checks = [
        *copies(points, sound & ~strange),
        *noises(points, sound & single),
        *scales(points, alone),
        *_exchanged_k1(campaign, points, alone, np.flatnonzero(used)),
        *on_curves,
    ]
    further = [axis.name for axis in campaign.stated.sameness.further]
    conditions = list(excitations(points, alone, further))
    notes = mixed_amplitudes(points, alone, further) if any(bent) else []
    return replace(points, strange=strange).with_checks(checks), conditions, notes


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
    # The same holds if K' is far above K1 in a few: K' rises by the loss at lower frequencies, too.
    of_k1 = Counter(k1[row] for row, _ in rows)
    doubted = Counter((k1[row], check.code) for row, check in rows if check.verdict is Verdict.WARNING)
    for row, check in rows:
        few = 2 * doubted[k1[row], check.code] <= of_k1[k1[row]]
        if check.verdict is not Verdict.WARNING or not few or check.code is Code.V1_SCALE:
            yield row, check


def _exchanged_k1(campaign: Campaign, points: Points, alone: Alone, used: np.ndarray) -> Iterator[tuple[int, Check]]:
    """Checks of tyres, or pressures of a tyre, whose K1 looks exchanged, from tests equal in all else."""
    rule = campaign.stated.sameness.without(_PRESSURE)
    of_static: dict[tuple[str, float], _Rows] = {}
    for row in used.tolist():
        if np.isfinite(alone.stiffness[row]) and np.isfinite(points.stiffness[row].value):
            static = points.tests[row].tyre, points.tests[row].value(_PRESSURE) or 0.0
            condition = replace(condition_of(points.tests[row], rule), specimen="")
            of_static.setdefault(static, {}).setdefault(condition, []).append(row)
    logs = np.log(np.maximum(alone.frequency, 1e-300))
    for first, second in combinations(of_static, 2):
        same = first[0] == second[0]
        pairs = _pairs(of_static[first], of_static[second], logs) if same or first[1] == second[1] else []
        static_k1 = np.array([[points.stiffness[row].value for row in pair] for pair in pairs])
        ratios = k1_exchanged(alone.stiffness[np.array(pairs)], static_k1, same=same) if pairs else None
        if ratios is not None:
            a, b, usual = ratios
            unlike, ratio = abs(a - b) / usual, {"first": a, "second": b, "usual": usual}
            check = reported(Code.K1_EXCHANGED, Verdict.WARNING, unlike, statics=(first, second), **ratio)
            for static in (first, second):
                yield from ((row, check) for rows in of_static[static].values() for row in rows)


_Rows = dict[Condition, list[int]]


def _pairs(here: _Rows, there: _Rows, logs: FloatArray) -> list[tuple[int, int]]:
    """Pairs of rows, by condition, with one condition and about one frequency, of which the logarithms are given."""
    return [
        (a, b)
        for condition, rows in here.items()
        for a in rows
        for b in there.get(condition, ())
        if abs(logs[a] - logs[b]) < SAME_FREQUENCY
    ]


def copies(points: Points, sound: BoolArray) -> Iterator[tuple[int, Check]]:
    """Checks of tests with the same recording, whatever the names of their files.

    If only one of them is sound by all other checks, the copy is the other one. Amplitudes are equal within a fraction
    of their noise: their last digits depend on the stated frequency, from which the search begins. Repeats without
    noise are no copies. Parts of one file are copies if their windows overlap.
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
    for rows in map(sorted, (*same, *_overlapping(points))):
        names = list(dict.fromkeys(points.tests[row].name for row in rows))
        single = np.count_nonzero(sound[rows]) == 1
        for row in rows if len(names) > 1 else ():
            if not (single and sound[row]):
                others = tuple(name for name in names if name != points.tests[row].name)
                yield row, reported(Code.COPY, Verdict.WARNING, tests=others)


def _overlapping(points: Points) -> list[list[int]]:
    """Pairs of rows whose windows of one recording have more than half of the shorter one in common."""
    windows = {test.name: (test.file, *test.window, row)
               for row, test in enumerate(points.tests) if test.window is not None}  # fmt: skip
    return [
        [row, other]
        for (file, low, high, row), (file2, begin, end, other) in pairwise(sorted(windows.values()))
        if file == file2 and min(high, end) - begin > _OVERLAP * min(high - low, end - begin)
    ]


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
    time = np.array(begun_at(tests))
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


# --- each point, once its tests are identified -----------------------------------------------------------------------


def judge_points(points: Points, groups: Sequence[RigGroup], route: str) -> Points:
    """The points with the checks of their identification; that of linearity is the first, because all assume it."""
    unused = np.isfinite(points.phasors.frequency) & (points.condition < 0) & (route != "joint")
    last = [
        (row, reported(Code.CALIBRATION_UNUSED, Verdict.WARNING, route=route))
        for row in np.flatnonzero(unused).tolist()
    ]
    for group in groups:
        giving = _giving(group)
        for place, row in enumerate(group.rows.tolist()):
            stiffness = points.stiffness[row]
            if points.condition[row] < 0:
                last.append((row, reported(Code.CALIBRATION, Verdict.OK, mass=points.tests[row].added_mass)))
            else:
                if giving:
                    last.append((row, reported(Code.OTHERS_GIVE, Verdict.WARNING, giving, _FEW_GIVE)))
                of_row = (_passivity(group, place), _certainty(group, place), _arm_check(group, place, stiffness))
                last += ((row, check) for check in of_row if check is not None)
            if place in group.heavy:
                last.append((row, reported(Code.INERTIA, Verdict.WARNING, route=group.route)))
            of_route = group.checks[place] if group.checks else ()
            last += ((row, check) for check in (*of_route, *stiffness.checks, *_joint_checks(group, place)))
    again = {(row, check.code) for row, check in last}
    earlier = tuple(
        tuple(check for check in checks if (row, check.code) not in again) for row, checks in enumerate(points.checks)
    )
    judged_points = replace(points, checks=earlier).with_checks(last, last=True)
    answered = {row for group in groups if group.joint is not None for row in group.rows.tolist()}
    kept = ([check for check in checks if not (row in answered and _is_answered(check))]
            for row, checks in enumerate(judged_points.checks))  # fmt: skip
    first = (tuple(sorted(rows, key=lambda check: check.code is not Code.LINEARITY)) for rows in kept)
    return replace(judged_points, checks=tuple(first))


def _is_answered(check: Check) -> bool:
    """Whether a check asks what the joint route answers from all tests: F1 against V2, but for a sign or a unit."""
    return check.code is Code.CONSISTENCY and not check.values.get("looks")


def _joint_checks(group: RigGroup, place: int) -> Iterator[Check]:
    """Checks whether a test is an outlier, whether the rig fits, and whether the joint route converged."""
    joint, estimate = group.joint, group.estimate
    if joint is None or estimate is None:
        return
    # Where the noise explains the test, what F1/V2 - Zr leaves of it is chi-square with 2 degrees of freedom.
    left = joint.residuals
    limit = sqrt(-log(SEARCH_CHANCE / max(left.rig.size, 1)))  # for all tests
    factor = float(joint.outlier[place])
    if factor > 1 or left.rig_dof[place] >= 2:
        times = float(np.sqrt(factor if factor > 1 else left.rig[place] / 2))
        verdict = Verdict.WARNING if factor > 1 or times > limit else Verdict.OK
        yield reported(Code.AGREEMENT, verdict, times, limit)
    if not estimate.fits:
        causes = estimate.causes or estimate.candidates[:1]
        verdict = Verdict.REJECTED if estimate.wrong_channels else Verdict.WARNING
        yield reported(Code.RIG, verdict, estimate.chi2_per_dof or np.nan, 1.0, causes=causes)
    if estimate.scatter > _MOST_SCATTER:
        yield reported(Code.SCATTER, Verdict.WARNING, estimate.scatter, _MOST_SCATTER)
    if joint.two_roots[place]:
        yield reported(Code.TWO_ROOTS, Verdict.WARNING)
    if not joint.converged:
        yield reported(Code.CONVERGENCE, Verdict.WARNING)


def _passivity(group: RigGroup, place: int) -> Check:
    """Check whether K* was found, and that the specimen gives no energy by more than the uncertainty of K''."""
    value, variance = complex(group.result.stiffness[place]), float(group.result.stiffness_covariance[place, 1, 1])
    if not np.isfinite(value):
        return reported(Code.PASSIVE, Verdict.REJECTED, because=NoArm.NO_STIFFNESS, storage=np.nan, loss_modulus=np.nan)
    below = max(-value.imag, 0.0)
    times = below / np.sqrt(variance) if variance > 0 else np.inf if below else 0.0
    if times <= _NEGATIVE:
        return Check(Code.PASSIVE, Verdict.OK, times, _NEGATIVE)
    return reported(
        Code.PASSIVE, Verdict.REJECTED, times, _NEGATIVE, because=NoArm.NO_LOSS, storage=value.real,
        loss_modulus=value.imag,
    )  # fmt: skip


def _giving(group: RigGroup) -> float:
    """Share of the tests that give energy; 0 for a few, and where all tests are identified together."""
    if group.joint is not None:
        return 0.0
    known = np.isfinite(group.result.stiffness)
    std = np.sqrt(group.result.stiffness_covariance[known, 1, 1])
    gives = group.result.stiffness.imag[known] < -_GIVES * std
    share = float(gives.mean()) if known.any() else 0.0
    return share if share > _FEW_GIVE and np.count_nonzero(gives) > 1 else 0.0


def _certainty(group: RigGroup, place: int) -> Check | None:
    """Check whether K* is certain enough for propagation; None where it is not found, or a check of its own says so."""
    size = abs(complex(group.result.stiffness[place]))
    variance = float(np.trace(group.result.stiffness_covariance[place])) / 2
    if group.route == "transmissibility" or not (np.isfinite(size) and np.isfinite(variance) and size > 0):
        return None
    return judged(Code.CERTAINTY, np.sqrt(variance) / size, *_UNCERTAIN)


def _arm_check(group: RigGroup, place: int, stiffness: StaticStiffness) -> Check | None:
    """Check whether K2 and C exist, and whether they are certain enough for propagation; None where no K1 is."""
    result = group.result
    value, k1 = complex(result.stiffness[place]), float(result.k1[place])
    reason = no_arm(value, k1, result.k2[place], result.c[place])
    if not np.isfinite(k1) or not np.isfinite(value):
        return stiffness.lack
    if reason is not None:
        share = group.intervals[place][0].non_passive_share if place in group.intervals else np.nan
        if share < _NEVER_PASSIVE:
            return reported(Code.PASSIVE_ARM, Verdict.WARNING, share, _NEVER_PASSIVE, **_ends(group, place, 0))
        return reported(
            Code.PASSIVE_ARM, Verdict.REJECTED, because=reason, storage=value.real, loss_modulus=value.imag, k1=k1
        )
    with np.errstate(invalid="ignore"):
        relative = np.sqrt(np.diag(result.arm_covariance[place])) / (result.k2[place], result.c[place])
    worst, which = float(np.max(relative)), int(np.argmax(relative))
    if worst <= NOT_LINEAR:
        return Check(Code.UNCERTAINTY, Verdict.OK, worst, NOT_LINEAR)
    ends = _ends(group, place, which)
    return reported(Code.UNCERTAINTY, Verdict.WARNING, worst, NOT_LINEAR, name=("K2", "C")[which], **ends)


def _ends(group: RigGroup, place: int, which: int) -> dict[str, float]:
    """The ends of the 95 % interval of K2 or C by Monte Carlo; empty if there is none."""
    if place not in group.intervals:
        return {}
    low, _, high = group.intervals[place][which].quantiles.tolist()
    name = ("K2", "C")[which]
    return {f"low {name}": low, f"high {name}": high}
