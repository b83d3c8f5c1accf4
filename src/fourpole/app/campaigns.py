"""Several campaigns in one command: each is analysed by itself, and one that fails does not stop the others."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import typer

from fourpole.answer import Answer, Table
from fourpole.app.console import OK, SOME_REJECTED, STOPPED, TERMINATED, UNREADABLE, one_of_several, run_to_exit, say
from fourpole.app.show import show
from fourpole.core.checks import VERDICTS
from fourpole.errors import CampaignError, FourpoleError
from fourpole.io.folders import resolved

#: Exit codes from good to bad; of several campaigns, the worst counts. Any other code is a fault of Fourpole.
_ORDER = (OK, SOME_REJECTED, UNREADABLE)


def run_each(campaigns: Sequence[Path], folder: Path | None, run: Callable[[Path], Answer], *, as_json: bool) -> Answer:
    """Run an analysis for each campaign: its answer, or of several a summary with the worst exit code.

    Parameters
    ----------
    campaigns : sequence of Path
        Campaign folders; one that is named twice is analysed once.
    folder : Path or None
        The folder that --out names.
    run : callable
        Analyses one campaign. Of several, each answer is shown when it is there.
    """
    named = list({resolved(campaign): campaign for campaign in reversed(campaigns)}.values())[::-1]
    if len(named) == 1:
        return run(named[0])
    if folder is not None:
        raise CampaignError("--out is for one campaign: the results of several are in CAMPAIGN/results of each")
    rows: list[dict[str, Any]] = []
    for at, campaign in enumerate(named, 1):
        rows.append(_one(campaign, f"{at} of {len(named)}: {campaign}", run, as_json=as_json))
        if rows[-1]["exit code"] in (STOPPED, TERMINATED):
            break
    codes = (row["exit code"] for row in rows)
    worst = max(codes, key=lambda code: _ORDER.index(code) if code in _ORDER else code + 99)
    return Answer(["", _table(rows)], lambda: {"campaigns": rows}, code=worst)


def _one(campaign: Path, head: str, run: Callable[[Path], Answer], *, as_json: bool) -> dict[str, Any]:
    """Analyse one campaign; an error becomes its message and its exit code."""
    row: dict[str, Any] = {"campaign": str(campaign), "exit code": OK}

    def told() -> int | None:
        try:
            answer = run(campaign)
        except FourpoleError as error:
            row["error"] = str(error)
            raise
        row.update(answer.document() if as_json else _counted(campaign, answer.code))
        return answer.code if as_json else show(answer, as_json=False)

    say(head)
    try:
        with one_of_several(head):
            run_to_exit(told)
    except typer.Exit as end:
        row["exit code"] = end.exit_code
    return row


def _counted(campaign: Path, code: int) -> dict[str, Any]:
    """The number of tests by verdict, from the results that were just written."""
    if code not in (OK, SOME_REJECTED):
        return {}
    from fourpole.io.published import published

    record = published(campaign / "results").record
    return {"verdicts": record["verdicts"]}


def _table(rows: Sequence[dict[str, Any]]) -> Table:
    """A line for each campaign."""
    lines = []
    for row in rows:
        counts = row.get("verdicts", {})
        result = row.get("error") or (f"{row['campaign']}/results" if counts else "not analysed")
        lines.append([row["campaign"], *(str(counts.get(name, "-")) for name in VERDICTS), result])
    return Table(["campaign", *VERDICTS, "results, or why there are none"], lines, VERDICTS)
