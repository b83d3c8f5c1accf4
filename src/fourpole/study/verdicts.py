"""What is said of each point once its tests are identified: whether K2 and C exist, agreement, the rig."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from fourpole.core import stats
from fourpole.core.checks import Check, Code, Verdict, judged, reported
from fourpole.core.confidence import SEARCH_CHANCE
from fourpole.core.curvature import NOT_LINEAR
from fourpole.core.joint import Joint
from fourpole.core.joint.outputs import relative_stiffness
from fourpole.core.routes import no_arm
from fourpole.study.identify import Group
from fourpole.study.points import Points, StaticStiffness
from fourpole.study.rig_estimate import RigEstimate

#: Relative scatter of K* from test to test beyond which more than the specimen differs; tyres repeat to 0.03-1 %.
_MOST_SCATTER = 0.02
#: If at least this share of the Monte Carlo trials is not passive, no passive K2 and C exist.
_NEVER_PASSIVE = 0.975


def judge_points(points: Points, groups: Sequence[Group], route: str) -> Points:
    """The points with the checks of their identification; that of linearity is the first, because all assume it."""
    unused = points.known & (points.condition < 0) & (route != "joint")
    last = [
        (row, reported(Code.CALIBRATION_UNUSED, Verdict.WARNING, route=route))
        for row in np.flatnonzero(unused).tolist()
    ]
    for group in groups:
        for at, row in enumerate(group.rows.tolist()):
            last += ((row, check) for check in _checks(points, group, at, row))
    judged_points = points.with_checks((), last)
    first = (tuple(sorted(rows, key=lambda check: check.code is not Code.LINEARITY)) for rows in judged_points.checks)
    return replace(judged_points, checks=tuple(first))


def _checks(points: Points, group: Group, at: int, row: int) -> Iterator[Check]:
    """The checks of one row of a group."""
    if points.condition[row] < 0:
        yield reported(Code.CALIBRATION, Verdict.OK, mass=float(group.setup.added_mass[at]))
    else:
        yield _arm_check(group, at, points.stiffness[row])
    yield from points.stiffness[row].checks
    if group.joint is not None and group.estimate is not None:
        yield from _joint_checks(group, group.joint, group.estimate, at)


def _joint_checks(group: Group, joint: Joint, estimate: RigEstimate, at: int) -> Iterator[Check]:
    """Checks whether a test is an outlier, whether the rig fits, and whether the joint route converged."""
    factor = float(joint.outlier[at])
    if factor > 1:
        yield reported(Code.AGREEMENT, Verdict.WARNING, factor, 1.0, times=np.sqrt(factor))
    elif factor == 1:
        yield from _relative_check(group, joint, at)
    if not estimate.fits:
        causes = estimate.causes or estimate.candidates[:1]
        yield reported(Code.RIG, Verdict.WARNING, estimate.chi2_per_dof or np.nan, 1.0, causes=causes)
    if estimate.scatter > _MOST_SCATTER:
        yield reported(Code.SCATTER, Verdict.WARNING, estimate.scatter, _MOST_SCATTER)
    if estimate.drift_by_mass and estimate.drifts:
        largest = max(abs(drift.found or 0.0) for drift in estimate.drifts)
        yield reported(Code.DRIFT_BY_MASS, Verdict.WARNING, largest, 0.0)
    if not joint.converged:
        yield reported(Code.CONVERGENCE, Verdict.WARNING)


def _relative_check(group: Group, joint: Joint, at: int) -> Iterator[Check]:
    """Check whether K* of the test by the relative route, with the gains as found, agrees with that by the joint route.

    Their squared difference over its variance is what F1/V2 - Zr leaves of the test: chi-square with 2 degrees of
    freedom. The limit is for all tests of the rig together.
    """
    left = joint.residuals
    if left.rig_dof[at] >= 2:
        limit = float(stats.chi2.isf(SEARCH_CHANCE / max(left.rig.size, 1), left.rig_dof[at]))
        with np.errstate(divide="ignore", invalid="ignore"):
            other = relative_stiffness(joint, group.phasors, at)
        percent = 100 * float(other.real / group.result.stiffness[at].real - 1)
        yield judged(Code.RELATIVE, float(left.rig[at]), limit, percent=percent)


def _arm_check(group: Group, at: int, stiffness: StaticStiffness) -> Check:
    """Check whether K2 and C exist, and whether their uncertainty is small enough for propagation."""
    result = group.result
    value, k1 = complex(result.stiffness[at]), float(result.k1[at])
    reason = no_arm(value, k1, result.k2[at], result.c[at])
    if stiffness.lack is not None and value.real > 0 and value.imag > 0:
        return stiffness.lack
    if reason is not None:
        share = group.intervals[at][0].non_passive_share if at in group.intervals else np.nan
        if share < _NEVER_PASSIVE:
            return reported(Code.PASSIVE_ARM, Verdict.WARNING, share, _NEVER_PASSIVE, **_ends(group, at, 0))
        found = {"because": reason, "storage": value.real, "loss_modulus": value.imag, "k1": k1}
        return reported(Code.PASSIVE_ARM, Verdict.REJECTED, **found)
    with np.errstate(invalid="ignore"):
        relative = np.sqrt(np.diag(result.arm_covariance[at])) / (result.k2[at], result.c[at])
    worst, which = float(np.max(relative)), int(np.argmax(relative))
    if worst <= NOT_LINEAR:
        return Check(Code.UNCERTAINTY, Verdict.OK, worst, NOT_LINEAR)
    ends = _ends(group, at, which)
    return reported(Code.UNCERTAINTY, Verdict.WARNING, worst, NOT_LINEAR, name=("K2", "C")[which], **ends)


def _ends(group: Group, at: int, which: int) -> dict[str, float]:
    """The ends of the 95 % interval of K2 or C by Monte Carlo; empty if there is none."""
    if at not in group.intervals:
        return {}
    low, _, high = group.intervals[at][which].quantiles.tolist()
    name = ("K2", "C")[which]
    return {f"low {name}": low, f"high {name}": high}
