"""The commands on what results say: the rig as found, two results compared, many campaigns gathered."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from rich.text import Text

from fourpole.answer import Answer, Part, Table
from fourpole.app.console import OK, SOME_REJECTED, more, progress, warn, without_controls
from fourpole.app.options import PointOptions, ShapeOptions
from fourpole.errors import CampaignError
from fourpole.export import export_results
from fourpole.findings.compared import DIFFERS, NOT_SEEN, Comparison, compare
from fourpole.fitting.inertia import belt_stated
from fourpole.fitting.placed import operating_point
from fourpole.io.folders import results_in
from fourpole.io.write import write_table, write_text
from fourpole.lab import Gathered, gather
from fourpole.report.compared import outcome, render_compared, shown_rows
from fourpole.report.digits import PLUS_MINUS
from fourpole.report.words.limits import limit_rows, limits
from fourpole.report.words.rig import GROUPS, RigInWords, ShownValue, rigs_in_words
from fourpole.study.record import section
from fourpole.study.results import read_results
from fourpole.study.rig_estimate import RigFinding
from fourpole.study.study import Study

_HEADS = ("value", "as stated", "as found", "pull", "seen from")
_STYLES = {RigFinding.FOUND: "green", RigFinding.CONTRADICTED: "bold red", RigFinding.NOT_CALIBRATED: "yellow"}


def run_rig(folder: Path) -> Answer:
    """Each value of rig and sensors as stated and as found, the fit, and the limits of K2 and C."""
    folder = results_in(folder)
    results = read_results(folder)
    found = rigs_in_words(results)
    if not found:
        route = str(section(results.record, "settings").get("route") or "")
        made = f"for it was made by the {route} route; " if route else ""
        raise CampaignError(
            f"{folder}: holds no rig.csv, {made}only the joint route finds the rig's "
            "values and the channels' gains: run fourpole analyse CAMPAIGN --route joint, with V1 and V2 measured"
        )
    return Answer(_shown(results, found), lambda: _rig_document(results, found))


def _shown(results: Study, found: list[RigInWords]) -> Iterator[Part]:
    for at, about in enumerate(found):
        if at:
            yield ""
        yield from _show_rig(about)
    limited = [f"{f'rig {limit.rig}: ' if limit.rig else ''}{limit.text}" for limit in limits(results)]
    yield from _listed("What limits me", limited)


def _show_rig(about: RigInWords) -> Iterator[Part]:
    """One rig and its sensors as found."""
    if about.estimate.rig:
        yield f"Rig {about.estimate.rig}"
    if about.values:
        yield from _print_values(about.values)
    yield about.fit
    yield about.summary
    if about.gain:
        yield about.gain
    outliers = [f"{item.test} (variance enlarged {item.factor:.2g} times)" for item in about.outliers]
    yield from _listed("The rig as stated does not fit", about.misfit)
    yield from _listed("What explains the tests, the best first", about.candidates)
    yield from _listed("Tests that do not agree with the others", outliers)
    yield from _listed("Remarks", about.remarks)
    yield from _listed("What these data cannot show", about.unseen)


def _listed(heading: str, lines: Sequence[str]) -> Iterator[Part]:
    if lines:
        yield f"{heading}:"
    yield from (f"  - {line}" for line in lines)


def _print_values(values: Sequence[ShownValue]) -> Iterator[Part]:
    """The values in groups, each with its finding below it."""
    rows: list[Sequence[str]] = []
    group = None
    for value in values:
        if value.group != group:
            group = value.group
            rows.append([GROUPS[group]])
        rows.append(_cells(value))
    findings = [Text(without_controls(one.value.remark), style=_STYLES.get(one.finding, "")) for one in values]
    yield Table(_HEADS, rows, _HEADS[1:], remarks=findings, remark="finding")
    yield f"{PLUS_MINUS}; pull: found less stated, over u of it; seen from: smallest error that would show"


def _cells(value: ShownValue) -> tuple[str, ...]:
    """The numbers of a value, the unit after its name."""
    unit = f" [{value.unit}]" if value.unit else ""
    return (
        f"{value.name}{unit}",
        " ± ".join(filter(None, value.words("stated"))),
        " ± ".join(filter(None, value.words("found"))),
        value.pull_words,
        value.detection_number,
    )


def _rig_document(results: Study, found: list[RigInWords]) -> dict[str, Any]:
    """The printed values for programs, in SI."""
    return {
        "rigs": [
            {
                **about.estimate.record,
                "rig": about.estimate.rig,
                "values": about.estimate.rows,
                "outliers": [{"test": item.test, "factor": item.factor} for item in about.outliers],
                "misfit": list(about.misfit),
                "unseen": list(about.unseen),
            }
            for about in found
        ],
        "limits": limit_rows(limits(results)),
    }


def run_export(
    folder: Path, kind: str, file: Path | None = None, *, asked: PointOptions, specimen: ShapeOptions
) -> Answer:
    """Write the results, or a model, for another tool."""
    exported = export_results(
        folder,
        kind,
        file,
        shape=specimen.shape,
        poisson=None if specimen.mode else specimen.poisson,
        points=tuple(operating_point(text) for text in asked.at or ()),
        specimen=asked.tyre,
        frequency=asked.frequency,
        radius=asked.radius,
        belt=belt_stated(asked.belt_mass, asked.belt_share),
    )
    warn(*exported.notes)
    document = {"kind": kind, "file": str(exported.path), "notes": list(exported.notes)}
    return Answer((), lambda: document, [(kind, exported.path)])


#: Rows that the terminal shows of each verdict.
_MOST = 20


def run_compare(
    first: Path,
    second: Path | None = None,
    specimens: tuple[str, str] | None = None,
    independent: bool = False,
    file: Path | None = None,
    page: Path | None = None,
) -> Answer:
    """The differences, the largest first; all rows and the page are written where they are wanted."""
    if file is not None and file.suffix.lower() != ".csv":
        raise CampaignError(f"--out {file}: the file of all rows is CSV: name it FILE.csv; --page is the HTML page")
    compared = compare(first, second, specimens=specimens, independent=independent)
    if file is not None:
        write_table(file, compared.rows)
    if page is not None:
        write_text(page, render_compared(compared))
    files = [(what, path) for what, path in (("rows", file), ("page", page)) if path is not None]
    return Answer(_show_compared(compared), lambda: _compared_document(compared), files)


def _show_compared(compared: Comparison) -> Iterator[Part]:
    count = compared.rows.height
    if count and (compared.rows["difference"] == 0).all():
        yield f"no difference: all {count} values of {compared.names[1]} are those of {compared.names[0]}"
        return
    rows = shown_rows(compared)
    yield f"{compared.names[1]} less {compared.names[0]}; ± is U (k = 2), z the difference over u"
    for seen, heading in ((True, DIFFERS), (False, NOT_SEEN)):
        part = [row for row in rows if row.seen is seen]
        if part:
            yield ""
            yield f"{heading} ({len(part)} of {len(rows)}):"
            cells = [(row.where, row.quantity, row.first, row.second, row.difference, row.z) for row in part[:_MOST]]
            heads = ("condition", "of", *map(_short, compared.names), "difference", "z")
            yield Table(heads, cells, right=heads[2:])
            yield from more(part, _MOST, " with smaller ratios: --out FILE.csv, --page FILE.html")
    yield ""
    yield outcome(compared)
    yield from compared.common


def _short(name: str) -> str:
    """A name of a column, as narrow as its numbers."""
    return name if len(name) <= 8 else f"{name[:7]}…"


def _compared_document(compared: Comparison) -> dict[str, Any]:
    """The comparison for programs, in SI."""
    return {
        "first": compared.names[0],
        "second": compared.names[1],
        "common": list(compared.common),
        "beyond": compared.beyond,
        "rows": compared.rows.to_dicts(),
    }


def run_lab(folder: Path, place: Path | None = None) -> Answer:
    """Gather results into a data set; the exit code is `SOME_REJECTED` if some were not taken."""
    with progress("gathering") as advance:
        made = gather(folder, place, progress=advance)
    warn(*made.problems)
    code = SOME_REJECTED if made.left_out else OK
    return Answer([_summary(made)], lambda: {**asdict(made), "folder": str(made.folder)}, code=code)


def _summary(made: Gathered) -> str:
    """The content of the data set, and what was done."""
    done = [f"{made.read} read", f"{made.unchanged} unchanged"]
    done += [f"{made.removed} no longer there"] if made.removed else []
    done += [f"{made.left_out} not taken"] if made.left_out else []
    return f"{made.folder}: {len(made.campaigns)} campaigns, {made.tests} rows of tests ({', '.join(done)})"
