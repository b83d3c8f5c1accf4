"""The command that looks a campaign through without analysing it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from rich import box
from rich.table import Table
from rich.text import Text

from fourpole.app.console import OK, SOME_REJECTED, harmless, out, print_json, progress, say, table_console
from fourpole.campaign import read_campaign
from fourpole.study.check import Checked, Problem, check_campaign

__all__ = ["run_check"]

_MOST_NAMED = 4
_MOST_LISTED = 60


def run_check(campaign: Path, route: str, *, as_json: bool) -> int:
    """Say what would be rejected; the exit code is that of the analysis to come."""
    stated = read_campaign(campaign)
    with progress("checking") as advance:
        checked = check_campaign(stated, route=route, progress=advance)
    if as_json:
        print_json(_document(checked))
    else:
        _list(checked)
    return SOME_REJECTED if checked.counts["rejected"] else OK


def _document(checked: Checked) -> dict[str, object]:
    return {
        "campaign": str(checked.campaign.folder),
        "route": checked.route,
        "verdicts": checked.counts,
        "problems": [asdict(problem) for problem in checked.problems],
        "notes": list(checked.notes),
    }


def _list(checked: Checked) -> None:
    """One line for each kind of problem, with the tests that have it."""
    for note in checked.notes:
        say(f"note: {note}")
    groups: dict[tuple[str, str, str], list[Problem]] = {}
    for problem in sorted(checked.problems, key=lambda one: one.verdict != "rejected"):
        groups.setdefault((problem.verdict, problem.about, problem.message), []).append(problem)
    if groups:
        table = Table(box=box.SIMPLE_HEAD, pad_edge=False, show_edge=False)
        for head in ("verdict", "tests", "rows of tests.csv", "about"):
            table.add_column(Text(head), overflow="fold")
        table.add_column(Text("what is wrong, and what to do"), overflow="fold", ratio=1)
        for (verdict, about, message), several in list(groups.items())[:_MOST_LISTED]:
            names = _some([one.test for one in several])
            rows = _some([str(one.row) for one in several])
            table.add_row(*(Text(harmless(cell)) for cell in (verdict, names, rows, about, message)))
        table_console().print(table)
        if len(groups) > _MOST_LISTED:
            out(f"... and {len(groups) - _MOST_LISTED} more; --json lists all")
        out()
    counts = checked.counts
    out(
        f"{sum(counts.values())} tests, {counts['ok']} ok, {counts['warning']} with a warning, "
        f"{counts['rejected']} would be rejected (route: {checked.route}); nothing was analysed or written"
    )


def _some(names: Sequence[str]) -> str:
    """The first few, and how many more."""
    more = f" and {len(names) - _MOST_NAMED} more" if len(names) > _MOST_NAMED else ""
    return f"{', '.join(names[:_MOST_NAMED])}{more}"
