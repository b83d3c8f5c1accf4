"""Static tests: load-deflection curves, and the K1 that each dynamic test takes from them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from fourpole.campaign.folder import Campaign, Test, inside
from fourpole.campaign.load import MOST_BYTES, load_curve
from fourpole.core.loadcurve import LoadCurve
from fourpole.core.sources import Kind, Source
from fourpole.errors import FourpoleError, LoadCurveError
from fourpole.io.source import sha256_of

__all__ = ["StaticRow", "StaticStiffness", "StaticTest", "evaluate_statics", "stiffness_for"]

#: Pressures, and preloads, are the same condition within these.
SAME_PRESSURE = 0.02
_SAME_PRELOAD = 1e-6
#: Standard uncertainty of a K1 that tests.csv states without one.
_UNSTATED_K1_STD = 0.02


@dataclass(frozen=True)
class StaticRow:
    """One row of static.csv: a static test at one preload in use; not-a-number is blank."""

    test: Test
    preload: float
    stiffness: float = float("nan")
    std: float = float("nan")
    secant: float = float("nan")
    loss: float = float("nan")
    nonlinearity: float = float("nan")
    verdict: str = "ok"
    remarks: tuple[str, ...] = ()
    parts: Mapping[Source, float] = field(default_factory=dict)


@dataclass(frozen=True)
class StaticStiffness:
    """K1 for a dynamic test with the parts of its uncertainty and what is doubtful of it, or why there is none."""

    value: float = float("nan")
    std: float = float("nan")
    reason: str = ""
    doubt: str = ""
    parts: Mapping[Source, float] = field(default_factory=dict)


@dataclass(frozen=True)
class StaticTest:
    """One static test: its curve (None where it could not be read), its rows, and the hash of its file."""

    test: Test
    curve: LoadCurve | None
    rows: tuple[StaticRow, ...]
    sha256: str = ""


def evaluate_statics(campaign: Campaign) -> list[StaticTest]:
    """Evaluate every static test at every preload that a dynamic test of its tyre and pressure uses."""
    dynamic = campaign.of_kind("dynamic")
    return [_evaluated(campaign, test, _preloads(test, dynamic)) for test in campaign.of_kind("static")]


def _preloads(test: Test, dynamic: Sequence[Test]) -> list[float]:
    """Preloads in use with a static test, its own included, in rising order."""
    used = [other.values["preload"] for other in dynamic if _same_condition(test, other) and "preload" in other.values]
    if "preload" in test.values:
        used.append(test.values["preload"])
    distinct: list[float] = []
    for load in sorted(used):
        if not distinct or load - distinct[-1] > _SAME_PRELOAD * load:
            distinct.append(load)
    return distinct


def _same_condition(static: Test, other: Test) -> bool:
    if static.tyre != other.tyre:
        return False
    mine, theirs = static.value("pressure"), other.value("pressure")
    if mine is None or theirs is None:
        return mine is None and theirs is None
    return abs(mine - theirs) <= SAME_PRESSURE * max(mine, theirs)


def _evaluated(campaign: Campaign, test: Test, preloads: list[float]) -> StaticTest:
    nowhere = float("nan")
    sha256 = ""
    try:
        if test.problem:
            raise LoadCurveError(test.problem)
        path = inside(campaign.folder, test.file)
        sha256 = sha256_of(path, max_bytes=MOST_BYTES, label=test.file)
        curve = load_curve(path, test, campaign.stated.channels)
        whole = StaticRow(test, nowhere, loss=curve.hysteresis_loss, nonlinearity=curve.nonlinearity)
    except FourpoleError as error:
        remark = str(error)
    except Exception as error:  # noqa: BLE001 - a fault of ours in one test must not stop the others
        remark = f"a fault in Fourpole itself ({type(error).__name__}: {error}); please report it with this recording"
    else:
        return _read(campaign, test, curve, whole, preloads, sha256)
    rows = tuple(StaticRow(test, load, verdict="rejected", remarks=(remark,)) for load in preloads or [nowhere])
    return StaticTest(test, None, rows, sha256)


def _read(
    campaign: Campaign, test: Test, curve: LoadCurve, whole: StaticRow, preloads: list[float], sha256: str
) -> StaticTest:
    """A static test whose curve could be read, at each preload in use."""
    if not preloads:
        remark = "no dynamic test of this tyre and pressure states a preload: state one in this row to get K1"
        return StaticTest(test, curve, (replace(whole, remarks=(remark,)),), sha256)
    return StaticTest(test, curve, tuple(_at(campaign, test, curve, whole, load) for load in preloads), sha256)


def _at(campaign: Campaign, test: Test, curve: LoadCurve, whole: StaticRow, load: float) -> StaticRow:
    channels = campaign.stated.channels
    assert channels.load is not None
    assert channels.deflection is not None
    try:
        tangent = curve.tangent(load)
        secant = curve.secant(load)
    except LoadCurveError as error:
        remark = f"{error}; record the static test past the preload"
        return StaticRow(
            test, load, loss=whole.loss, nonlinearity=whole.nonlinearity, verdict="rejected", remarks=(remark,)
        )
    remarks = [*curve.remarks, *([f"no secant: {secant.reason}"] if secant.reason else [])]
    std = tangent.std_with_gains(channels.load.gain_std, channels.deflection.gain_std)
    parts = {
        Source(Kind.K1_FIT): tangent.fit,
        Source(Kind.K1_GAP): tangent.branches,
        Source(Kind.K1_CYCLES): tangent.cycles,
        Source(Kind.K1_GAINS): float(np.sqrt(max(std**2 - tangent.std**2, 0.0))),
    }
    return StaticRow(
        test,
        load,
        stiffness=tangent.stiffness,
        std=std,
        parts=parts,
        secant=secant.stiffness,
        loss=whole.loss,
        nonlinearity=whole.nonlinearity,
        verdict="warning" if curve.remarks else "ok",
        remarks=tuple(remarks),
    )


def stiffness_for(test: Test, statics: Sequence[StaticRow]) -> StaticStiffness:
    """K1 of a dynamic test: from its own column, else from the static tests of its tyre, pressure and preload."""
    stated = test.value("K1")
    if stated is not None:
        std = test.value("u(K1)")
        std = _UNSTATED_K1_STD * stated if std is None else std
        return StaticStiffness(stated, std, parts={Source(Kind.K1_STATED): std})
    tyre = f"tyre {test.tyre!r}"
    alike = [row for row in statics if _same_condition(row.test, test)]
    if not alike:
        others = sorted(
            {p for row in statics if row.test.tyre == test.tyre and (p := row.test.value("pressure")) is not None}
        )
        at = ", ".join(f"{p / 1e5:.3g} bar" for p in others)
        found = f"; static tests of it are at {at}" if at else ""
        return StaticStiffness(
            reason=f"no static test of {tyre} at this pressure{found}: add one, or state K1 [N/m] in tests.csv"
        )
    preload = test.value("preload")
    if preload is None:
        return StaticStiffness(
            reason="no preload is stated, so K1 cannot be read off the static curve: fill in preload [N]"
        )
    at_load = [row for row in alike if abs(row.preload - preload) <= _SAME_PRELOAD * preload]
    good = [row for row in at_load if row.verdict != "rejected"]
    if not good:
        why = "; ".join(dict.fromkeys(remark for row in at_load for remark in row.remarks))
        return StaticStiffness(
            reason=f"no K1 at {preload:.6g} N: static test {at_load[0].test.name!r} was rejected: {why}"
        )
    nearest = _nearest_pressure(test, good)
    values = np.array([row.stiffness for row in nearest])
    spread = values.std(ddof=1) / np.sqrt(values.size) if values.size > 1 else 0.0
    parts = {part: float(np.mean([row.parts[part] for row in nearest])) for part in nearest[0].parts}
    if spread > 0:
        parts[Source(Kind.K1_REPEATS)] = float(spread)
    std = float(np.hypot(np.mean([row.std for row in nearest]), spread))
    doubts = [f"K1 from {row.test.name}: {'; '.join(row.remarks)}" for row in nearest if row.verdict == "warning"]
    return StaticStiffness(float(values.mean()), std, doubt="; ".join(doubts), parts=parts)


def _nearest_pressure(test: Test, rows: list[StaticRow]) -> list[StaticRow]:
    """Of the static tests within the tolerance, those whose pressure is nearest; repeats all count."""
    pressure = test.value("pressure")
    if pressure is None:
        return rows
    off = [abs((row.test.value("pressure") or 0.0) - pressure) for row in rows]
    return [row for row, distance in zip(rows, off, strict=True) if distance <= min(off) + 1e-9 * pressure]
