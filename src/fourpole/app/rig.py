"""The command on the rigs and sensors as the joint route found them, and on what limits the results."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

from rich import box
from rich.console import Console
from rich.table import Table
from rich.text import Text

from fourpole.app.console import out, print_json, table_console
from fourpole.errors import CampaignError
from fourpole.report.stated import mapping
from fourpole.report.words.limits import limit_rows, limits
from fourpole.report.words.rig import RigInWords, rigs_in_words
from fourpole.report.words.shared_values import GROUPS, ShownValue
from fourpole.study.results import Results, read_results
from fourpole.study.rig_estimate import Finding

__all__ = ["run_rig"]

_STYLES = {Finding.FOUND: "green", Finding.CONTRADICTED: "bold red", Finding.NOT_CALIBRATED: "yellow"}


def run_rig(folder: Path, *, as_json: bool) -> None:
    """Show each shared value as stated and as found, the fit, what stays unseen, and what limits K2 and C."""
    results = read_results(folder)
    found = rigs_in_words(results)
    if not found:
        route = str(mapping(results.record, "settings").get("route") or "another")
        raise CampaignError(
            f"{folder}: holds no rig.csv, for it was made by the {route} route, and only the joint route finds the "
            "rig's values and the channels' gains: run fourpole analyse CAMPAIGN --route joint, with V1 and V2 measured"
        )
    if as_json:
        print_json(_document(results, found))
        return
    console = table_console()
    for at, about in enumerate(found):
        if at:
            out()
        _show(console, about)
    lines = [f"{f'rig {_plain(limit.rig)}: ' if limit.rig else ''}{limit.text}" for limit in limits(results)]
    _listed("What limits me", lines)


def _show(console: Console, about: RigInWords) -> None:
    """One rig."""
    if about.rig:
        out(f"Rig {_plain(about.rig)}")
    if about.values:
        console.print(_table(about.values))
    out(_plain(about.fit))
    out(about.summary)
    if about.gain:
        out(about.gain)
    _listed("It does not fit", about.misfit)
    _listed("What one added part would explain, the best first", about.candidates)
    strange = [f"{item.test} (variance enlarged {item.factor:.2g} times)" for item in about.outliers]
    _listed("Tests that do not go with the others", strange)
    _listed("To note", about.remarks)
    _listed("What these data cannot show", about.unseen)


def _listed(heading: str, lines: Iterable[str]) -> None:
    for at, line in enumerate(lines):
        if at == 0:
            out(f"{heading}:")
        out(f"  - {_plain(line)}")


def _table(values: Iterable[ShownValue]) -> Table:
    """Values by group; texts of files stand in it as they are, without markup."""
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, show_edge=False)
    table.add_column("value of", no_wrap=True)
    table.add_column("unit", no_wrap=True)
    for name in ("as stated", "as found", "u after/before", "pull", "error shows from"):
        table.add_column(name, justify="right", no_wrap=True)
    table.add_column("finding")
    group = None
    for value in values:
        if value.group != group:
            group = value.group
            table.add_row(Text(GROUPS[group], style="dim"))
        cells = [
            value.name,
            value.unit,
            _pair(*value.stated_words),
            _pair(*value.found_words),
            value.ratio_words,
            value.pull_words,
            value.detection_words,
        ]
        table.add_row(*(Text(_plain(cell)) for cell in cells), Text(_plain(value.value.remark), style=_style(value)))
    return table


def _pair(value: str, std: str) -> str:
    return f"{value} ± {std}" if std else value


def _style(value: ShownValue) -> str:
    return _STYLES.get(value.finding, "")


def _plain(text: str) -> str:
    """Text of a file without what would steer a terminal."""
    return "".join(sign if sign.isprintable() else " " for sign in text)


def _document(results: Results, found: list[RigInWords]) -> dict[str, Any]:
    """The same for programs, values in SI."""
    return {
        "rigs": [
            {
                **mapping(results.record, "joint", about.rig),
                "rig": about.rig,
                "fits": about.fits,
                "values": about.estimate.rows,
                "outliers": [{"test": item.test, "factor": item.factor} for item in about.outliers],
                "misfit": list(about.misfit),
                "unseen": list(about.unseen),
            }
            for about in found
        ],
        "limits": limit_rows(limits(results)),
    }
