"""The commands on single tables: identify, static, predict."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import polars.selectors as cs

from fourpole import quantities as q
from fourpole.answer import Answer, Part
from fourpole.app.console import OK, SOME_REJECTED, say, warn
from fourpole.app.options import RigOptions, TableChoice, answered_in
from fourpole.app.show import rows_answer
from fourpole.core.checks import Verdict
from fourpole.core.confidence import COVERAGE_FACTOR
from fourpole.core.loadcurve import LoadCurve, Secant, Tangent
from fourpole.core.recordingchecks import check_resonance
from fourpole.core.reduced import ReducedResult, identify_mobility, identify_stiffness, predict, stiffness_std
from fourpole.core.rig import Rig
from fourpole.errors import LoadCurveError, RigError
from fourpole.io.tables.kstar import KStarTable, read_k_star
from fourpole.io.tables.pair import read_curve
from fourpole.quantities import ShownUnits
from fourpole.report.digits import PLUS_MINUS, number, with_u
from fourpole.study.static import branch_check
from fourpole.words import remark_of


def run_identify(table: Path, k1: float | None, above: RigOptions, choice: TableChoice, file: Path | None) -> Answer:
    """Identify a reduced table; the exit code is `SOME_REJECTED` if rows were rejected."""
    rig = above.rig
    if choice.no_rig and rig is not None:
        raise RigError("--no-rig and the rig's values contradict each other: keep one of them")
    measured = read_k_star(table, choice.table(rig=rig is not None))
    _read_as(measured.understood, measured.warnings)
    if measured.mobility is not None:
        found = identify_mobility(measured.frequency, measured.mobility, np.nan if k1 is None else k1, rig)
    else:
        found = identify_stiffness(
            measured.frequency, np.asarray(measured.stiffness), np.nan if k1 is None else k1, rig
        )
    faults = [_fault(measured, found, row, rig, armed=k1 is not None) for row in range(found.frequency.size)]
    frame = _frame(found, faults).hstack(_beside(measured, found, rig))
    rejected = sum(bool(fault) for fault in faults)
    code = SOME_REJECTED if rejected else OK
    answer = rows_answer(frame, file, answered_in(ShownUnits(), k1), code=code)
    what = "K2 and C" if k1 is not None else "K*"
    say(f"{len(faults)} rows: {len(faults) - rejected} with {what}, {rejected} rejected, each with its reason")
    if k1 is None:
        say("K2 and C need the static stiffness: state --k1")
    return answer


def _read_as(understood: Iterable[str], remarks: Iterable[str]) -> None:
    """Print how the columns of a table were understood, and what is remarkable."""
    for line in understood:
        say(f"understood {line}")
    for line in remarks:
        warn(line)


def _beside(table: KStarTable, found: ReducedResult, rig: Rig | None) -> pl.DataFrame:
    """Uncertainty of K* by the coherence, and the conditions that the table has."""
    columns: dict[str, Any] = {}
    if table.std is not None:
        std = table.std * np.abs(found.stiffness)
        if table.mobility is not None:
            std = stiffness_std(found, table.std, rig)
        columns = dict.fromkeys((q.STORAGE.u_head, q.LOSS.u_head), std)
    heads = [one.head for one in (q.TYRE, q.TEMPERATURE, q.PRESSURE, q.PRELOAD, q.DEFLECTION_AMPLITUDE)]
    heads += [] if columns else [q.STORAGE.u_head, q.LOSS.u_head]
    columns |= {head: table.further[head] for head in heads if head in table.further.columns}
    return pl.DataFrame(columns).with_columns(pl.when(cs.float().is_finite()).then(cs.float()))


def _fault(table: KStarTable, found: ReducedResult, row: int, rig: Rig | None, *, armed: bool) -> str:
    """Why a row has no K*, or no K2 and C where they are wanted (`armed`); empty if it has them."""
    frequency = float(found.frequency[row])
    if not frequency > 0:
        return f"row {table.lines[row]}: the frequency is {frequency:g} Hz, it must be positive"
    if not np.isfinite(found.stiffness[row]):
        return f"row {table.lines[row]}: a value is missing or no number"
    if rig is not None and table.mobility is not None:
        near = check_resonance(frequency, rig, 0.0)
        if near.verdict == Verdict.REJECTED:
            return remark_of(near)
    if armed or not np.isfinite(found.stiffness[row]):
        return found.reasons[row]
    return ""


def _frame(found: ReducedResult, faults: list[str]) -> pl.DataFrame:
    kept = np.array([not fault for fault in faults], dtype=bool)
    columns = _columns(found) | {
        "d [1]": found.d,
        q.K2.head: np.where(kept, found.k2, np.nan),
        q.C.head: np.where(kept, found.c, np.nan),
        "verdict": [str(Verdict.OK if good else Verdict.REJECTED) for good in kept],
        "remarks": faults,
    }
    frame = pl.DataFrame(columns).with_columns(pl.when(cs.float().is_finite()).then(cs.float()))
    before, after = (q.FREQUENCY, q.R, q.I), (q.STORAGE, q.LOSS, q.LOSS_FACTOR, q.K2, q.C, q.TR)
    return frame.select(*(one.head for one in before), "d [1]", *(one.head for one in after), "verdict", "remarks")


def _columns(found: ReducedResult) -> dict[str, Any]:
    """Frequency, K*, R, I and TR by the heads of their columns."""
    return {
        q.FREQUENCY.head: found.frequency,
        q.STORAGE.head: found.stiffness.real,
        q.LOSS.head: found.stiffness.imag,
        q.LOSS_FACTOR.head: found.loss_factor,
        q.R.head: found.mobility.real,
        q.I.head: found.mobility.imag,
        q.TR.head: found.tr,
    }


def run_static(table: Path, load: float, column: Sequence[str] | None, group: str) -> Answer:
    """Evaluate one load-deflection curve at one load."""
    found = read_curve(table, columns=column or (), group=group)
    try:
        curve = LoadCurve(found.deflection, found.load)
        tangent, secant = curve.tangent(load), curve.secant(load)
    except LoadCurveError as error:
        raise LoadCurveError(f"{table.name}: {error}") from None
    branch = [] if curve.measured == "mean" else [remark_of(branch_check(curve.measured))]
    remarks = [*found.warnings, *branch, *curve.remarks, *([f"no secant: {secant.reason}"] if secant.reason else [])]
    document = {
        q.LOAD.head: load,
        q.K1.head: tangent.stiffness,
        q.K1.u_head: tangent.std,
        "u(K1) from fit [N/m]": tangent.fit,
        "u(K1) from cycles [N/m]": tangent.cycles,
        "u(K1) from zero [N/m]": tangent.zero,
        q.K1_OF.head: curve.measured,
        q.K1_LOADING.head: tangent.loading,
        q.K1_UNLOADING.head: tangent.unloading,
        q.GAP.head: tangent.gap,
        q.SECANT.head: secant.stiffness,
        q.CYCLE_LOSS.head: curve.hysteresis_loss,
        q.CYCLE_LOSS.u_head: curve.loss_std,
        q.NONLINEARITY.head: curve.nonlinearity,
        "order [1]": curve.order,
        "cycles [1]": curve.cycles,
        "understood": found.understood,
        "remarks": remarks,
    }

    def parts() -> Iterator[Part]:
        _read_as(found.understood, remarks)
        units = answered_in(ShownUnits(), load)
        yield f"{table.name} at {units.text(q.PRELOAD, load)}"
        yield from _static_shown(curve, tangent, secant, units)

    return Answer(parts(), lambda: document)


def _static_shown(curve: LoadCurve, tangent: Tangent, secant: Secant, units: ShownUnits) -> Iterator[Part]:
    """K1 at a load, and what else a curve says, in lines."""
    loss = "" if np.isnan(curve.hysteresis_loss) else f"{with_u(curve.hysteresis_loss, curve.loss_std)} J"
    unit, scale = units.unit(q.K1.unit)
    parts = ", ".join(
        f"{part} {number(COVERAGE_FACTOR * u / scale, 2)}"
        for part, u in (("fit", tangent.fit), ("cycles", tangent.cycles), ("zero", tangent.zero))
    )
    rows = (
        ("tangent K1", f"{with_u(tangent.stiffness, tangent.std, scale)} {unit}; {PLUS_MINUS}"),
        ("parts of U", f"{parts} {unit}; the sensors' own comes on top"),
        ("secant", f"none: {secant.reason}" if secant.reason else units.text(q.SECANT, secant.stiffness)),
        ("hysteresis loss", loss or "none: one branch only"),
        ("non-linearity", f"{100 * curve.nonlinearity:.2f} % of the load span"),
        ("curve", f"order {curve.order}, {curve.cycles} complete cycles, {curve.load.size} points"),
    )
    for head, text in rows:
        yield f"{head:<16} {text}"


def run_predict(arm: tuple[float, float, float], rig: Rig, frequency: list[float], file: Path | None) -> Answer:
    """Table of K*, R, I and TR of a tyre on a rig."""
    found = predict(frequency, *arm, rig)
    units = answered_in(ShownUnits(), *arm)
    return rows_answer(pl.DataFrame(_columns(found)), file, units)
