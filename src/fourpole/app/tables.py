"""The commands on single tables: identify, static, predict, and shift."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import polars.selectors as cs

from fourpole import quantities as q
from fourpole.answer import Answer, Part, Table
from fourpole.app.console import OK, SOME_REJECTED, frequencies, note, progress, say, warn
from fourpole.app.group import rows_answer, write_with_figure
from fourpole.app.model_words import put_back_shown
from fourpole.app.options import RigOptions, SharedErrors, ShiftOptions, TableChoice, answered_in
from fourpole.campaign.defaults import GAIN_STD, K1_STD, PHASE_STD, RIG_STD
from fourpole.core.checks import Verdict
from fourpole.core.confidence import COVERAGE_FACTOR
from fourpole.core.digits import number
from fourpole.core.loadcurve import LoadCurve, Secant, Tangent
from fourpole.core.recordingchecks import check_resonance
from fourpole.core.reduced import (
    ReducedResult,
    identify_mobility,
    identify_stiffness,
    identify_transmissibility,
    predict,
    reduced_uncertainty,
    stiffness_std,
)
from fourpole.core.rig import Rig
from fourpole.errors import LoadCurveError, RigError, TableError, UnitError
from fourpole.fitting.measured import MASTER, NO_STD
from fourpole.fitting.modelparts import PutBackFile
from fourpole.fitting.shifting import (
    APART,
    COVARIANCE,
    LAW,
    TyreShift,
    law_document,
    law_file,
    master_tables,
    overlap_table,
    read_isotherms,
    shift_table,
    shift_tyres,
    shifted_back,
)
from fourpole.fitting.temperature import miss_in_words
from fourpole.io.door import sha256_of
from fourpole.io.lock import staged
from fourpole.io.signals import MAX_FILE_BYTES
from fourpole.io.tables.kstar import KStarTable, read_k_star
from fourpole.io.tables.pair import read_curve
from fourpole.io.write import write_text
from fourpole.models.shift_law import CONSTANTS, LEVEL, LOSS, ONE_CURVE, Overlap, ShiftLaw
from fourpole.quantities import ShownUnits
from fourpole.report.digits import PLUS_MINUS, with_u
from fourpole.study.static import branch_check
from fourpole.words import remark_of


def run_identify(
    table: Path,
    k1: float | None = None,
    *,
    above: RigOptions,
    shared: SharedErrors,
    choice: TableChoice,
    file: Path | None = None,
) -> Answer:
    """Identify a reduced table; the exit code is `SOME_REJECTED` if rows were rejected."""
    rig = above.rig
    if choice.no_rig and rig is not None:
        raise RigError("--no-rig and the rig's values contradict each other: keep one of them")
    measured = read_k_star(table, choice.table(rig=rig is not None))
    _read_as(measured.understood, measured.warnings)
    static = np.nan if k1 is None else k1
    if measured.transmissibility is not None and rig is not None:
        found = identify_transmissibility(measured.frequency, measured.transmissibility, static, rig)
        _check_loss(table, found)
    elif measured.mobility is not None:
        found = identify_mobility(measured.frequency, measured.mobility, static, rig)
        _check_loss(table, found)
    else:
        found = identify_stiffness(measured.frequency, np.asarray(measured.stiffness), static, rig)
    faults = [_fault(measured, found, row, rig, armed=k1 is not None) for row in range(found.frequency.size)]
    frame = _frame(found, faults).hstack(_beside(measured, found, rig))
    known, words = _with_shared(measured, found, k1, rig, shared)
    blank = pl.when(frame[q.C.head].is_not_null())
    frame = frame.hstack(known.with_columns(blank.then(pl.col(one.u_head)).alias(one.u_head) for one in (q.K2, q.C)))
    rejected = sum(bool(fault) for fault in faults)
    code = SOME_REJECTED if rejected else OK
    whole = {one.u_head: one.whole_head for one in (q.STORAGE, q.LOSS)}
    answer = rows_answer(frame, file, answered_in(ShownUnits(), k1), whole=whole, code=code)
    say(*words)
    what = "K2 and C" if k1 is not None else "K*"
    say(f"{len(faults)} rows: {len(faults) - rejected} with {what}, {rejected} rejected, each with its reason")
    if k1 is None:
        say("K2 and C need the static stiffness: state --k1")
    return answer


def _check_loss(table: Path, found: ReducedResult) -> None:
    """TableError if the loss of a specimen that a rig was removed from is negative in all rows."""
    loss = found.stiffness.imag[np.isfinite(found.stiffness)]
    if loss.size and np.all(loss < 0):
        raise TableError(
            f"{table.name}: K'' of the specimen is negative in all rows, that of a passive one is positive: the sign "
            "of the phase (it is that of V2 against V1, or of the force ahead of V1), or a value of the rig, is wrong"
        )


def _with_shared(
    table: KStarTable, found: ReducedResult, k1: float | None, rig: Rig | None, shared: SharedErrors
) -> tuple[pl.DataFrame, list[str]]:
    """U of K*, K2 and C with the errors that all rows share, and in words what they have.

    K* of a table has the errors of a force and a motion, unless the table states its u.
    """
    stated = {head: table.further[head].to_numpy() for head in (q.STORAGE.u_head, q.LOSS.u_head)
              if head in table.further.columns}  # fmt: skip
    noise = np.zeros(found.frequency.size) if table.std is None else table.std
    std = {"rig_std": RIG_STD, "gain_std": GAIN_STD, "phase_std": PHASE_STD, "k1_std": K1_STD}
    if stated:
        noise = np.sqrt(np.mean(np.square([*stated.values()]), axis=0)) / np.abs(found.stiffness)
        std |= {"gain_std": 0.0, "phase_std": 0.0}
    given = {f"{name[4:]}_std": value for name, value in asdict(shared).items() if value is not None}
    across = table.transmissibility
    removed = rig if table.mobility is not None or across is not None else None
    static = np.nan if k1 is None else k1
    u = reduced_uncertainty(found, static, removed, noise=noise, transmissibility=across, **{**std, **given})
    heads = (q.STORAGE.whole_head, q.LOSS.whole_head, q.K2.u_head, q.C.u_head)
    used = {"rig_std": removed is not None, "gain_std": True, "phase_std": True, "k1_std": k1 is not None}
    sizes = [
        f"{name} {number(100 * size, 2) + ' %' if name != 'phases' else number(np.degrees(size), 2) + ' deg'}"
        for (key, size), name in zip({**std, **given}.items(), ("m and K3", "gains", "phases", "K1"), strict=True)
        if used[key] and size
    ]
    words = []
    if sizes:
        of = "K*" if k1 is None else "K*, K2 and C"
        words = [f"u of {of} has {', '.join(sizes)}; others: --std-rig, --std-gain, --std-phase, --std-k1"]
    if (most := u.most_of_c()) is not None:
        source, row, ratio = most
        name = source.text.replace("_", " ")
        words.append(
            f"of these, the uncertainty of {name} moves C most: by up to {number(100 * ratio, 2)} % "
            f"(row {table.lines[row]}, {number(found.frequency[row], 3)} Hz)"
        )
    columns = dict(zip(heads, (u.storage, u.loss, u.k2, u.c), strict=True))
    return pl.DataFrame(columns).with_columns(pl.when(cs.float().is_finite()).then(cs.float())), words


def _read_as(understood: Iterable[str], remarks: Iterable[str]) -> None:
    """Print how the columns of a table were understood, and what is remarkable."""
    say(*(f"understood {line}" for line in understood))
    warn(*remarks)


def _beside(table: KStarTable, found: ReducedResult, rig: Rig | None) -> pl.DataFrame:
    """Uncertainty of K* by the coherence, and the conditions that the table has."""
    columns: dict[str, Any] = {}
    if table.std is not None:
        std = table.std * np.abs(found.stiffness)
        if table.transmissibility is not None:
            std = std / np.abs(1 - table.transmissibility)
        elif table.mobility is not None:
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
    if rig is not None and table.stiffness is None:
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


def run_static(table: Path, load: float, column: list[str] | None = None, group: str = "") -> Answer:
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
    yield from (f"{head:<16} {text}" for head, text in rows)


def run_predict(
    k1: float,
    k2: float,
    c: float,
    mass: float,
    preload_stiffness: float,
    frequency: str,
    preload_damping: float | None = None,
    file: Path | None = None,
) -> Answer:
    """Table of K*, R, I and TR of a tyre on a rig."""
    rig = Rig(mass, preload_stiffness, preload_damping or 0.0)
    found = predict(frequencies(frequency), k1, k2, c, rig)
    return rows_answer(pl.DataFrame(_columns(found)), file, answered_in(ShownUnits(), k1, k2, c))


_DECADE = np.log(10.0)
_MOST_ROWS = 60


def run_shift(tables: list[Path], options: ShiftOptions) -> Answer:
    """Shift the isotherms of each specimen onto a master curve, and write it."""
    if options.std is not None and not 0 < options.std < 1:
        raise UnitError("--std: the uncertainty of K* must lie between 0 and 100 %")
    measured = read_isotherms(tables, apart=_kelvin(options.apart), std=options.std, options=options.table())
    measured = measured.only(options.tyre)
    note(*(said for said in measured.notes if said != NO_STD))
    if not measured.known:
        note("the table states no uncertainty of K*: the misfit of the overlaps is taken for it")
    with progress("shifting") as advance:
        found = shift_tyres(measured, options.reference, vertical=options.vertical, progress=advance)
        back = [shifted_back(one) for one in found]
    for one in found:
        _warn(one)
    written = [] if options.folder is None else _written(found, options.folder)
    return Answer(_shown(found, back, options), lambda: _document(found, back), [("written", path) for path in written])


def _shown(found: Sequence[TyreShift], back: Sequence[PutBackFile | None], options: ShiftOptions) -> Iterator[Part]:
    for one, given in zip(found, back, strict=True):
        yield from _show(one, options.constants_at)
        yield from put_back_shown(given, one.tyre if len(found) > 1 else "")
    if options.folder is None:
        say("state --out FOLDER to write the master curve and its law, for fourpole fit and query")


def _kelvin(text: str | None) -> float:
    """A difference of temperatures [K]."""
    if text is None:
        return APART
    try:
        return float(text.strip().removesuffix("K").strip())
    except ValueError:
        raise UnitError(f"--apart: {text!r} is not a difference of temperatures, as in '1 K'") from None


def _document(found: Sequence[TyreShift], back: Sequence[PutBackFile | None]) -> dict[str, object]:
    """The master curves as one JSON document."""
    laws = [{"tyre": one.tyre, "temperature": law_file(one).model_dump(mode="json")} for one in found]
    given = [None if one is None else one.model_dump() for one in back]
    tables = {"shifts": shift_table(found).to_dicts(), "overlaps": overlap_table(found).to_dicts()}
    return {**tables, "laws": laws, "put back": given}


def _warn(one: TyreShift) -> None:
    """Print what the user has to know before he takes the numbers."""
    found, named = one.found, f"{one.tyre}: " if one.tyre else ""
    if one.rest:
        lost = ", ".join(f"{each.temperature:.4g}" for each in one.rest)
        ends = found.temperatures[[0, -1]]
        edge = min(one.rest, key=lambda each: float(np.min(np.abs(ends - each.temperature))))
        near = float(ends[int(np.argmin(np.abs(ends - edge.temperature)))])
        low, high = sorted((near, edge.temperature))
        warn(
            f"{named}the isotherms at {lost} degC have no shift factor: no overlap links them to the reference, or K* "
            "there hardly depends on frequency, within its uncertainty. If they do not overlap, measure at a "
            f"temperature between {low:.4g} and {high:.4g} degC, or over more decades"
        )
    if found.needs_vertical:
        warn(
            f"{named}horizontal shifts alone do not superpose K*, but together with vertical ones they do: state "
            "--vertical. Until then the uncertainty of the shift factors includes the difference"
        )
    bad = [each for each in one.overlaps if each.verdict in (LOSS, LEVEL)]
    if bad and any(each.verdict == LOSS for each in bad):
        warn(
            f"{named}{len(bad)} of {len(one.overlaps)} pairs of neighbours do not follow one curve, and their loss "
            "factors differ: the material is not thermorheologically simple there, or the loss angle is wrong"
        )
    if not found.converged:
        warn(f"{named}the search for the shift factors did not converge")
    best = one.choice.best
    if not best.fits:
        missed = miss_in_words(best, found.temperatures, found.log_a, found.std)
        warn(
            f"{named}the {best.name} law misses the shift factors found, at worst {missed}. The model file holds the "
            "factors found, and the law serves beyond them only"
        )


def _show(one: TyreShift, constants_at: float | None) -> Iterator[Part]:
    """The overlaps, the shift factors and the laws of a specimen."""
    if one.tyre:
        yield f"Specimen {one.tyre}"
    found, law = one.found, one.choice.best
    heads = ["T [degC]", "log10 aT", "u", f"{law.name}", "bT", "u(bT)"][: 6 if found.vertical else 4]
    rows = []
    for at, t in enumerate(found.temperatures.tolist()):
        cells = [f"{t:.5g}", f"{found.log_a[at] / _DECADE:.4f}", f"{found.std[at] / _DECADE:.2g}"]
        cells.append(f"{law.log_a(t)[0] / _DECADE:.4f}".replace("-0.0000", "0.0000"))
        if found.vertical:
            b = float(np.exp(found.log_b[at]))
            cells += [f"{b:.4f}", f"{b * found.vertical_std[at]:.2g}"]
        rows.append(tuple(cells))
    yield Table(tuple(heads), rows[:_MOST_ROWS], right=heads)
    yield "Overlaps of neighbouring isotherms"
    names = ("T [degC]", "decades", "points", "p-value", "K' [%]", "loss factor [%]", "verdict")
    yield Table(names, [_pair(each) for each in one.overlaps], right=names[1:-1])
    yield from map(_law_words, one.choice.laws)
    if len(one.choice.laws) > 1:
        other = one.choice.laws[1].name
        yield (
            f"{law.name} describes the shift factors better than {other}"
            if one.choice.decided
            else f"the shift factors do not decide between {law.name} and {other}; {law.name} is taken"
        )
    ends = found.temperatures[[0, -1]]
    yield f"{PLUS_MINUS}; u is a standard uncertainty"
    known = f"from {ends[0]:.4g} to {ends[1]:.4g} degC fourpole query interpolates the shift factors found"
    yield f"{known}; beyond, with --beyond, the {law.name} law continues them"
    if constants_at is not None and law.name == "WLF":
        moved = law.at_reference(constants_at)
        yield (
            f"WLF with the reference {constants_at:.4g} degC: "
            f"C1 = {with_u(float(moved.values[0]), float(moved.std[0]))}, "
            f"C2 = {with_u(float(moved.values[1]), float(moved.std[1]))} K"
        )


#: What a verdict on an overlap says.
_VERDICTS = {ONE_CURVE: "one curve", LOSS: "not one curve: loss factor", LEVEL: "not one curve: level"}


def _pair(one: Overlap) -> tuple[str, ...]:
    numbers = [f"{one.chance:.2g}", f"{100 * one.level:+.2g}", f"{100 * one.loss:+.2g}"] if one.dof else ["", "", ""]
    short = f"too short: measure near {np.mean(one.temperatures):.4g} degC"
    verdict = _VERDICTS.get(one.verdict, short)
    cold, warm = one.temperatures
    return f"{cold:.4g} .. {warm:.4g}", f"{one.decades:.2f}", str(one.points), *numbers, verdict


def _law_words(law: ShiftLaw) -> str:
    """A law with its constants, their intervals and the misfit."""
    parts = []
    scale = 1e-3 if law.name == "Arrhenius" else 1.0
    assert law.intervals is not None
    for (symbol, unit), value, std, ends in zip(
        CONSTANTS[law.name], law.values * scale, law.std * scale, law.intervals * scale, strict=True
    ):
        shown = {"J/mol": " kJ/mol", "K": " K", "1": ""}[unit]
        low, high = (with_u(float(end), float(std)).partition(" ")[0] for end in ends)
        parts.append(f"{symbol} = {with_u(float(value), float(std))}{shown} (95 %: {low} .. {high})")
    text = f"{law.name} at {law.reference:.4g} degC: {', '.join(parts)}"
    if law.name == "WLF":
        correlation = law.covariance[0, 1] / (law.std[0] * law.std[1])
        text += f", correlation {correlation:.3f}"
    return f"{text}; chi-square {number(law.chi2, 3)} for {law.dof} degrees of freedom"


def _written(found: Sequence[TyreShift], folder: Path) -> list[Path]:
    """Write the files of the master curve and the figure into the folder, together; the files written."""
    from fourpole.plot.ride import shift_figure

    folder.mkdir(parents=True, exist_ok=True)
    master, covariance = master_tables(found)
    tables = {
        MASTER: master,
        COVARIANCE: covariance,
        "shifts.csv": shift_table(found),
        "overlaps.csv": overlap_table(found),
    }
    with staged(folder, last=LAW) as new:
        write_with_figure(new, "shift", shift_figure(found), tables)
        sha256 = sha256_of(new / MASTER, max_bytes=MAX_FILE_BYTES)
        write_text(new / LAW, json.dumps(law_document(found, sha256), indent=1) + "\n")
    return [folder / name for name in (MASTER, "shifts.csv", "overlaps.csv", LAW, "shift.svg")]
