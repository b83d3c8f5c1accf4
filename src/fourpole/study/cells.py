"""The cells of one dynamic test: its amplitudes, what was found of it, its verdict and remarks."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from fourpole import quantities as q
from fourpole.campaign.folder import Test
from fourpole.core.checks import Check, Code, told, worst_verdict
from fourpole.core.identification import Identification
from fourpole.study.identified import Identified
from fourpole.study.outcome import Point
from fourpole.study.static import StaticStiffness
from fourpole.study.tables import amplitude_cells, covariance_cells, tyre_cells

__all__ = ["dynamic_cells", "dynamic_checks"]

#: Above this relative uncertainty linear propagation is no longer to be trusted.
_LINEAR = 0.3
#: Where more than this share of what may be is not passive, no passive answer exists.
_NEVER_PASSIVE = 0.975


def dynamic_checks(
    test: Test, point: Point, stiffness: StaticStiffness, found: Identified | None, route: str
) -> tuple[Check, ...]:
    """All checks of a test: those of its reduction, of its K1 and of what was identified."""
    rows = list(point.checks)
    if found is not None:
        rows += _calibration_checks(test) if test.kind == "calibration" else _arm_checks(found, stiffness)
        rows += [stiffness.warning] if stiffness.warning is not None else []
        rows += [told(Code.K1, "ok", why=stiffness.doubt)] if stiffness.doubt else []
        rows += [*_outlier_checks(found), *_convergence_checks(found)]
    elif test.kind == "calibration" and point.phasors is not None and route != "joint":
        rows.append(told(Code.CALIBRATION_UNUSED, "warning", route=route))
    return tuple(rows)


def dynamic_cells(point: Point, found: Identified | None, route: str, checks: Sequence[Check]) -> dict[str, Any]:
    """Cells of a test; one that was rejected has its amplitudes only."""
    cells: dict[str, Any] = {"route": route if found is None else found.group.route}
    if point.phasors is not None:
        cells.update(amplitude_cells(point.phasors))
    if found is not None:
        cells.update(_identified_cells(found.result, found.at))
    cells["verdict"] = worst_verdict(row.verdict for row in checks)
    cells["remarks"] = "; ".join(row.remark for row in checks if row.remark)
    return cells


def _calibration_checks(test: Test) -> list[Check]:
    mass = test.value("added_mass") or 0.0
    return [told(Code.CALIBRATION, "ok", mass=mass)]


def _convergence_checks(found: Identified) -> list[Check]:
    joint = found.group.joint
    if joint is None or joint.converged:
        return []
    return [told(Code.CONVERGENCE, "warning")]


def _outlier_checks(found: Identified) -> list[Check]:
    joint = found.group.joint
    factor = float(joint.outlier[found.at]) if joint is not None else 1.0
    if factor <= 1:
        return []
    return [told(Code.AGREEMENT, "warning", factor, 1.0, times=np.sqrt(factor))]


def _arm_checks(found: Identified, stiffness: StaticStiffness) -> list[Check]:
    """Whether K2 and C exist, and whether they are known at all."""
    result, at = found.result, found.at
    reason, value = result.reasons[at], result.stiffness[at]
    if stiffness.reason and value.real > 0 and value.imag > 0:
        return [told(Code.NO_K1, "warning", why=stiffness.reason)]
    interval = _interval(found, 0) if at in found.group.intervals else ""
    if reason and interval and found.group.intervals[at][0].non_passive_share < _NEVER_PASSIVE:
        share = found.group.intervals[at][0].non_passive_share
        return [told(Code.PASSIVE_ARM, "warning", share, _NEVER_PASSIVE, interval=interval)]
    if reason:
        return [told(Code.PASSIVE_ARM, "rejected", limit=0.0, why=reason)]
    with np.errstate(invalid="ignore"):
        relative = np.sqrt(np.diag(result.arm_covariance[at])) / (result.k2[at], result.c[at])
    worst = float(np.max(relative))
    if worst <= _LINEAR:
        return [Check(Code.UNCERTAINTY, worst, _LINEAR, "ok")]
    which = int(np.argmax(relative))
    what = ("K2", "C")[which]
    interval = _interval(found, which) if at in found.group.intervals else ""
    words = interval or " so its interval is not symmetric"
    return [told(Code.UNCERTAINTY, "warning", worst, _LINEAR, name=what, interval=words)]


def _interval(found: Identified, which: int) -> str:
    """The drawn interval of K2 or C in words."""
    low, _, high = found.group.intervals[found.at][which].quantiles
    unit = ("N/m", "N s/m")[which]
    if not np.isfinite(low):
        return " without a limit"
    upper = f"and {high:.3g} {unit}" if np.isfinite(high) else "and no upper limit"
    return f" between {low:.3g} {unit} {upper} (95 %, drawn)"


def _identified_cells(result: Identification, at: int) -> dict[str, float]:
    u_r, u_i, corr_ri = covariance_cells(result.mobility_covariance[at])
    return {
        q.R.head: float(result.mobility[at].real),
        q.I.head: float(result.mobility[at].imag),
        q.R.u_head: u_r,
        q.I.u_head: u_i,
        q.CORR_R_I.head: corr_ri,
        q.LOSS_FACTOR.head: float(result.loss_factor[at]),
        q.LOSS_FACTOR.u_head: float(result.loss_factor_std[at]),
        **tyre_cells(result, at),
        q.TR_MEASURED.head: float(result.tr_measured[at]),
        q.TR_PREDICTED.head: float(result.tr_predicted[at]),
        q.TR.u_head: float(result.tr_std[at]),
    }
