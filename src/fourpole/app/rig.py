"""The command on the rig as found by the joint route: rig, sensors, and what limits the results."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from rich.text import Text

from fourpole.answer import Answer, Part, Table
from fourpole.app.console import without_controls
from fourpole.core.confidence import COVERAGE_FACTOR
from fourpole.errors import CampaignError
from fourpole.io.folders import results_in
from fourpole.report.digits import PLUS_MINUS
from fourpole.report.words.limits import limit_rows, limits
from fourpole.report.words.rig import RigInWords, rigs_in_words
from fourpole.report.words.shared_values import GROUPS, ShownValue
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
    return Answer(_shown(results, found), lambda: _document(results, found))


def _shown(results: Study, found: list[RigInWords]) -> Iterator[Part]:
    for at, about in enumerate(found):
        if at:
            yield ""
        yield from _show(about)
    limited = [f"{f'rig {limit.rig}: ' if limit.rig else ''}{limit.text}" for limit in limits(results)]
    yield from _listed("What limits me", limited)


def _show(about: RigInWords) -> Iterator[Part]:
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
    for line in lines:
        yield f"  - {line}"


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
        " ± ".join(filter(None, value.words("stated", COVERAGE_FACTOR))),
        " ± ".join(filter(None, value.words("found", COVERAGE_FACTOR))),
        value.pull_words,
        value.detection_number,
    )


def _document(results: Study, found: list[RigInWords]) -> dict[str, Any]:
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
