"""Several campaigns in one command: each is analysed by itself, and one that fails does not stop the others."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import typer

from fourpole.app.console import (
    OK,
    SOME_REJECTED,
    STOPPED,
    TERMINATED,
    UNREADABLE,
    one_of_several,
    out,
    print_json,
    print_table,
    run_to_exit,
    say,
)
from fourpole.core.checks import VERDICTS
from fourpole.errors import CampaignError, FourpoleError
from fourpole.io.folders import resolved

#: Exit codes from good to bad; of several campaigns, the worst counts. Any other code is a fault of Fourpole.
_ORDER = (OK, SOME_REJECTED, UNREADABLE)


def run_each(
    campaigns: Sequence[Path], folder: Path | None, run: Callable[[Path], int | None], *, as_json: bool
) -> int:
    """Run an analysis for each campaign, and print a summary of all; the exit code is the worst.

    Parameters
    ----------
    campaigns : sequence of Path
        Campaign folders; one that is named twice is analysed once.
    folder : Path or None
        The folder that --out names.
    run : callable
        Analyses one campaign and returns its exit code.
    """
    named = list({resolved(campaign): campaign for campaign in reversed(campaigns)}.values())[::-1]
    if len(named) == 1:
        return run(named[0]) or OK
    if folder is not None:
        raise CampaignError("--out is for one campaign: the results of several are in CAMPAIGN/results of each")
    rows: list[dict[str, Any]] = []
    for at, campaign in enumerate(named, 1):
        rows.append(_one(campaign, f"{at} of {len(named)}: {campaign}", run, as_json=as_json))
        if rows[-1]["exit code"] in (STOPPED, TERMINATED):
            break
    if as_json:
        print_json({"campaigns": rows})
    else:
        _show(rows)
    return max((row["exit code"] for row in rows), key=lambda code: _ORDER.index(code) if code in _ORDER else code + 99)


def _one(campaign: Path, head: str, run: Callable[[Path], int | None], *, as_json: bool) -> dict[str, Any]:
    """Analyse one campaign; an error becomes its message and its exit code."""
    said: list[str] = []
    documents: list[Any] = []

    def told() -> int | None:
        try:
            return run(campaign)
        except FourpoleError as error:
            said.append(str(error))
            raise

    say(head)
    code = OK
    try:
        with one_of_several(head, documents):
            run_to_exit(told)
    except typer.Exit as end:
        code = end.exit_code
    document = documents[0] if documents and isinstance(documents[0], dict) else {}
    row = {"campaign": str(campaign), "exit code": code, **(document if as_json else _counted(campaign, code))}
    return {**row, **({"error": said[0]} if said else {})}


def _counted(campaign: Path, code: int) -> dict[str, Any]:
    """The number of tests by verdict, from the results that were just written."""
    if code not in (OK, SOME_REJECTED):
        return {}
    from fourpole.io.published import published

    record = published(campaign / "results").record
    return {"verdicts": record["verdicts"]}


def _show(rows: Sequence[dict[str, Any]]) -> None:
    """A line for each campaign."""
    out()
    lines = []
    for row in rows:
        counts = row.get("verdicts", {})
        result = row.get("error") or (f"{row['campaign']}/results" if counts else "not analysed")
        lines.append([row["campaign"], *(str(counts.get(name, "-")) for name in VERDICTS), result])
    print_table(["campaign", *VERDICTS, "results, or why there are none"], lines, right=VERDICTS)
