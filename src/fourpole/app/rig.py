"""The command on the rig as found by the joint route: rig, sensors, and what limits the results."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rich.text import Text

from fourpole.app.console import out, print_json, print_table, table_width, without_controls
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
#: Blanks between columns.
_GAP = 2
_STYLES = {RigFinding.FOUND: "green", RigFinding.CONTRADICTED: "bold red", RigFinding.NOT_CALIBRATED: "yellow"}


def run_rig(folder: Path, *, as_json: bool) -> None:
    """Print each value of rig and sensors as stated and as found, the fit, and the limits of K2 and C."""
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
    if as_json:
        print_json(_document(results, found))
        return
    for at, about in enumerate(found):
        if at:
            out()
        _show(about)
    _listed("What limits me", [f"{f'rig {limit.rig}: ' if limit.rig else ''}{limit.text}" for limit in limits(results)])


def _show(about: RigInWords) -> None:
    """Print one rig and its sensors as found."""
    if about.estimate.rig:
        out(f"Rig {about.estimate.rig}")
    if about.values:
        _print_values(about.values)
    out(about.fit)
    out(about.summary)
    if about.gain:
        out(about.gain)
    outliers = [f"{item.test} (variance enlarged {item.factor:.2g} times)" for item in about.outliers]
    _listed("The rig as stated does not fit", about.misfit)
    _listed("What explains the tests, the best first", about.candidates)
    _listed("Tests that do not agree with the others", outliers)
    _listed("Remarks", about.remarks)
    _listed("What these data cannot show", about.unseen)


def _listed(heading: str, lines: Sequence[str]) -> None:
    if lines:
        out(f"{heading}:")
    for line in lines:
        out(f"  - {line}")


def _print_values(values: Sequence[ShownValue]) -> None:
    """Print the values in groups, each with its finding below it."""
    rows = [_cells(value) for value in values]
    widths = [max(map(len, column)) for column in zip(_HEADS, *rows, strict=True)]
    if sum(widths) + _GAP * (len(widths) - 1) > table_width():
        findings = [
            Text(without_controls(value.value.remark), style=_STYLES.get(value.finding, "")) for value in values
        ]
        print_table((*_HEADS, "finding"), [(*row, said) for row, said in zip(rows, findings, strict=True)])
    else:
        out(_line(_HEADS, widths))
        group = None
        for value, row in zip(values, rows, strict=True):
            if value.group != group:
                group = value.group
                out(f"\n{GROUPS[group]}")
            out(_line(row, widths))
            out(f"    {value.value.remark}")
        out()
    out(f"{PLUS_MINUS}; pull: found less stated, over u of it; seen from: smallest error that would show")


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


def _line(cells: Sequence[str], widths: Sequence[int]) -> str:
    first, *others = (
        cell.rjust(width) if at else cell.ljust(width)
        for at, (cell, width) in enumerate(zip(cells, widths, strict=True))
    )
    return (" " * _GAP).join([first, *others]).rstrip()


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
