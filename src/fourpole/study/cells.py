"""The cells of one dynamic test in dynamic.csv: its amplitudes, identified values, verdict and remarks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from fourpole import quantities as q
from fourpole.campaign.folder import Test
from fourpole.core import deflection, stats
from fourpole.core.checks import Check, interval_words, judged, reported, worst_verdict
from fourpole.core.codes import Code
from fourpole.core.confidence import SEARCH_CHANCE
from fourpole.core.joint import Joint
from fourpole.core.joint.outputs import relative_stiffness
from fourpole.core.phasor import Phasors
from fourpole.study.identified import NOT_LINEAR, Identified
from fourpole.study.outcome import Point
from fourpole.study.static import StaticStiffness

#: Relative scatter of K* from test to test beyond which more than the specimen differs; tyres repeat to 0.03-1 %.
_MOST_SCATTER = 0.02
#: If at least this share of the Monte Carlo trials is not passive, no passive K2 and C exist.
_NEVER_PASSIVE = 0.975


def dynamic_checks(
    test: Test, point: Point, stiffness: StaticStiffness, found: Identified | None, route: str
) -> tuple[Check, ...]:
    """All checks of a test: of its reduction, of its K1 and of its identification."""
    rows = list(point.checks)
    if found is not None:
        if test.kind == "calibration":
            rows.append(reported(Code.CALIBRATION, "ok", mass=test.value("added_mass") or 0.0))
        else:
            rows += _arm_checks(found, stiffness)
        rows += stiffness.warnings
        rows += [reported(Code.K1, "ok", why=stiffness.doubt)] if stiffness.doubt else []
        rows += _joint_checks(found)
    elif test.kind == "calibration" and point.phasors is not None and route != "joint":
        rows.append(reported(Code.CALIBRATION_UNUSED, "warning", route=route))
    return tuple(rows)


def dynamic_cells(
    point: Point, found: Identified | None, route: str, checks: Sequence[Check], *, blocked: bool
) -> dict[str, Any]:
    """Cells of a test; a test that was not identified has its amplitudes only."""
    cells: dict[str, Any] = {"route": route if found is None else found.group.route}
    if point.phasors is not None:
        cells |= _amplitude_cells(point.phasors)
        cells[q.DEFLECTION_AMPLITUDE.head] = deflection_amplitude(point.phasors, found, blocked=blocked)
    if found is not None:
        cells |= {head: float(column[found.at]) for head, column in found.group.columns.items()}
    cells["verdict"] = worst_verdict(row.verdict for row in checks)
    cells["remarks"] = "; ".join(row.remark for row in checks if row.remark)
    return cells


def _joint_checks(found: Identified) -> list[Check]:
    """Checks whether a test is an outlier, whether the rig fits, and whether the joint route converged."""
    joint, estimate = found.group.joint, found.group.estimate
    if joint is None or estimate is None:
        return []
    factor = float(joint.outlier[found.at])
    rows = [reported(Code.AGREEMENT, "warning", factor, 1.0, times=np.sqrt(factor))] if factor > 1 else []
    rows += _relative_check(found, joint) if factor == 1 else []
    if not estimate.fits:
        rows.append(reported(Code.RIG, "warning", estimate.chi2_per_dof or np.nan, 1.0, causes=estimate.explained))
    if estimate.scatter > _MOST_SCATTER:
        rows.append(reported(Code.SCATTER, "warning", estimate.scatter, _MOST_SCATTER))
    if estimate.drift_by_mass and estimate.drifts:
        largest = max(abs(one.found or 0.0) for one in estimate.drifts)
        rows.append(reported(Code.DRIFT_BY_MASS, "warning", largest, 0.0))
    return rows if joint.converged else [*rows, reported(Code.CONVERGENCE, "warning")]


def _relative_check(found: Identified, joint: Joint) -> list[Check]:
    """Check whether K* of the test by the relative route, with the gains as found, agrees with that by the joint route.

    Their squared difference over its variance is what F1/V2 - Zr leaves of the test: chi-square with 2 degrees of
    freedom. The limit is for all tests of the rig together.
    """
    left, at = joint.residuals, found.at
    if left.rig_dof[at] < 2:
        return []
    limit = float(stats.chi2.isf(SEARCH_CHANCE / max(left.rig.size, 1), left.rig_dof[at]))
    with np.errstate(divide="ignore", invalid="ignore"):
        other = relative_stiffness(joint, found.group.phasors, at)
    percent = 100 * float(other.real / found.result.stiffness[at].real - 1)
    return [judged(Code.RELATIVE, float(left.rig[at]), limit, percent=percent)]


def _arm_checks(found: Identified, stiffness: StaticStiffness) -> list[Check]:
    """Check whether K2 and C exist, and whether their uncertainty is small enough for propagation."""
    result, at = found.result, found.at
    reason, value = result.reasons[at], result.stiffness[at]
    if stiffness.reason and value.real > 0 and value.imag > 0:
        return [reported(Code.NO_K1, "warning", why=stiffness.reason, remedy=stiffness.remedy)]
    interval = _interval(found, 0)
    if reason and interval and found.group.intervals[at][0].non_passive_share < _NEVER_PASSIVE:
        share = found.group.intervals[at][0].non_passive_share
        return [reported(Code.PASSIVE_ARM, "warning", share, _NEVER_PASSIVE, interval=interval)]
    if reason:
        check = reported(Code.PASSIVE_ARM, "rejected", why=reason)
        return [replace(check, remedy=reason.partition("; ")[2])]
    with np.errstate(invalid="ignore"):
        relative = np.sqrt(np.diag(result.arm_covariance[at])) / (result.k2[at], result.c[at])
    worst = float(np.max(relative))
    if worst <= NOT_LINEAR:
        return [Check(Code.UNCERTAINTY, worst, NOT_LINEAR, "ok")]
    which = int(np.argmax(relative))
    words = _interval(found, which) or " so its interval is not symmetric"
    return [reported(Code.UNCERTAINTY, "warning", worst, NOT_LINEAR, name=("K2", "C")[which], interval=words)]


def _interval(found: Identified, which: int) -> str:
    """The 95 % interval of K2 or C by Monte Carlo, in words; empty if there is none."""
    if found.at not in found.group.intervals:
        return ""
    low, _, high = found.group.intervals[found.at][which].quantiles
    return interval_words(low, high, (q.K2, q.C)[which].unit)


def deflection_amplitude(phasors: Phasors, found: Identified | None, *, blocked: bool) -> float:
    """Amplitude of the specimen's deflection [m]; not-a-number if it is not known."""
    f1, v1, v2 = phasors.amplitudes
    rig = None if found is None else found.group.setup.rig
    force = f1 - (0.0 if rig is None else 1j * phasors.omega * rig.input_mass * v1)
    stiffness = np.nan if found is None else found.result.stiffness[found.at]
    return float(deflection.deflection_amplitude(force, v1, v2, phasors.omega, stiffness=stiffness, blocked=blocked))


def _amplitude_cells(phasors: Phasors) -> dict[str, float]:
    """Cells of frequency, amplitudes and phases of one test."""
    f1, v1, v2 = phasors.amplitudes
    return {
        q.FREQUENCY.head: float(phasors.frequency),
        q.F1.head: float(abs(f1)),
        q.V1.head: float(abs(v1)),
        q.V2.head: float(abs(v2)),
        q.PHASE_F1.head: float(np.angle(f1 / v1)),
        q.PHASE_V2.head: float(np.angle(v2 / v1)),
    }
