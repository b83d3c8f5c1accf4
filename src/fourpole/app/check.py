"""The command that checks a campaign without analysing it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from pathlib import Path

from fourpole.answer import Answer, Part, Table
from fourpole.app.alike import gathered_alike
from fourpole.app.console import OK, SOME_REJECTED, counted_tests, progress, say, warn
from fourpole.campaign import Campaign, read_campaign
from fourpole.campaign.row import DOUBTS, columns_in_doubt
from fourpole.core.checks import Verdict
from fourpole.study.check import CampaignProblem, Checked, check_campaign
from fourpole.words import first_of

_MOST_NAMED = 4
_MOST_LISTED = 60
_MOST_OWN = 12


def run_check(campaign: Path, route: str, workers: int | None) -> Answer:
    """What the analysis would reject; the exit code is the same as that of the analysis."""
    stated = read_campaign(campaign)
    with progress("checking") as advance:
        checked = check_campaign(stated, route=route, workers=workers, progress=advance)
    code = SOME_REJECTED if checked.counts[Verdict.REJECTED] else OK
    return Answer(_list(checked), lambda: _document(checked), code=code)


def _document(checked: Checked) -> dict[str, object]:
    return {
        "campaign": str(checked.campaign.folder),
        "route": checked.route,
        "verdicts": checked.counts,
        "problems": [asdict(problem) for problem in checked.problems],
        "doubts": list(checked.campaign.doubts),
        "notes": list(checked.notes),
    }


def _list(checked: Checked) -> Iterator[Part]:
    """One row for each kind of problem, with the tests that have it."""
    for doubt in checked.campaign.doubts:
        warn(doubt)
    own = [name for name in checked.campaign.extra_columns if name != DOUBTS]
    notes = [
        *checked.notes,
        *_guessed(checked.campaign),
        *([f"columns of your own, for the results alone: {first_of(own, _MOST_OWN)}"] if own else []),
    ]
    for note in notes:
        say(f"note: {note}")
    rows = list(_rows(checked.problems))
    if rows:
        yield Table(
            ("verdict", "tests", "rows of tests.csv", "about", "what is wrong, and what to do"), rows[:_MOST_LISTED]
        )
        if len(rows) > _MOST_LISTED:
            yield f"... and {len(rows) - _MOST_LISTED} more; --json lists all"
        yield ""
    counts = counted_tests(checked.counts, "would be rejected")
    yield f"{counts} (route: {checked.route}); nothing was analysed or written"


def _guessed(campaign: Campaign) -> Iterator[str]:
    """The columns that are in doubt since `fourpole init`, with the number of tests of each."""
    count = Counter(column for test in campaign.tests for column in columns_in_doubt(test.extra.get(DOUBTS, "")))
    if count:
        listed = ", ".join(f"{column} ({number})" for column, number in count.items())
        yield (
            f"tests.csv: doubts of fourpole init on {listed}: see the column {DOUBTS}; a doubt goes with the "
            "correction of its cell, delete it where the cell is right"
        )


def _rows(problems: Sequence[CampaignProblem]) -> Iterator[tuple[str, ...]]:
    """A row for each kind of problem, the rejected tests first."""
    places = {one.test: str(one.row) for one in problems}
    groups: dict[tuple[str, str], list[tuple[str, str, str]]] = {}
    for one in sorted(problems, key=lambda each: each.verdict is not Verdict.REJECTED):
        groups.setdefault((one.verdict, one.about), []).append((one.test, one.kind, one.message))
    for (verdict, about), members in groups.items():
        for kind in gathered_alike(members):
            rows = first_of([places[name] for name in kind.names], _MOST_NAMED)
            yield verdict, first_of(kind.names, _MOST_NAMED), rows, about, kind.text
