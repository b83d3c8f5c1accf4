"""The command shift: isotherms become a master curve."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from fourpole.answer import Answer, Part, Table
from fourpole.app.console import progress, say, warn
from fourpole.app.options import ShiftOptions
from fourpole.errors import UnitError
from fourpole.fitting.measured import MASTER, NO_STD
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
)
from fourpole.fitting.temperature import miss_in_words
from fourpole.io.door import sha256_of
from fourpole.io.signals import MAX_FILE_BYTES
from fourpole.io.staging import staged
from fourpole.io.write import write_bytes, write_table, write_text
from fourpole.models.overlap import LEVEL, LOSS, ONE_CURVE, Overlap
from fourpole.models.shift_law import CONSTANTS, ShiftLaw
from fourpole.report.digits import PLUS_MINUS, number, with_u

_DECADE = np.log(10.0)
_MOST_ROWS = 60


def run_shift(tables: Sequence[Path], options: ShiftOptions) -> Answer:
    """Shift the isotherms of each specimen onto a master curve, and write it."""
    if options.std is not None and not 0 < options.std < 1:
        raise UnitError("--std: the uncertainty of K* must lie between 0 and 100 %")
    measured = read_isotherms(tables, apart=_kelvin(options.apart), std=options.std, options=options.table())
    measured = measured.only(options.tyre)
    for note in measured.notes:
        if note != NO_STD:
            say(f"note: {note}")
    if not measured.known:
        say("note: the table states no uncertainty of K*: the misfit of the overlaps is taken for it")
    with progress("shifting") as advance:
        found = shift_tyres(measured, options.reference, vertical=options.vertical, progress=advance)
    for one in found:
        _warn(one)
    written = [] if options.folder is None else _written(found, options.folder)
    return Answer(_shown(found, options), lambda: _document(found), [("written", path) for path in written])


def _shown(found: Sequence[TyreShift], options: ShiftOptions) -> Iterator[Part]:
    for one in found:
        yield from _show(one, options.constants_at)
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


def _document(found: Sequence[TyreShift]) -> dict[str, object]:
    """The master curves as one JSON document."""
    laws = [{"tyre": one.tyre, "temperature": law_file(one).model_dump(mode="json")} for one in found]
    return {"shifts": shift_table(found).to_dicts(), "overlaps": overlap_table(found).to_dicts(), "laws": laws}


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
    for each in one.choice.laws:
        yield _law_words(each)
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
    from fourpole.plot.ride import shift_figure_bytes

    folder.mkdir(parents=True, exist_ok=True)
    master, covariance = master_tables(found)
    with staged(folder, last=LAW) as new:
        write_table(new / MASTER, master)
        write_table(new / COVARIANCE, covariance)
        sha256 = sha256_of(new / MASTER, max_bytes=MAX_FILE_BYTES)
        write_text(new / LAW, json.dumps(law_document(found, sha256), indent=1) + "\n")
        write_table(new / "shifts.csv", shift_table(found))
        write_table(new / "overlaps.csv", overlap_table(found))
        for form in ("svg", "png"):
            write_bytes(new / f"shift.{form}", shift_figure_bytes(found, form))
    return [folder / name for name in (MASTER, "shifts.csv", "overlaps.csv", LAW, "shift.svg")]
