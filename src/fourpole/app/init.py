"""The command that makes a campaign of a bare folder of recordings."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from rich import box
from rich.table import Table
from rich.text import Text

from fourpole import quantities as q
from fourpole.app.console import OK, harmless, out, print_json, progress, table_console
from fourpole.campaign import read_campaign
from fourpole.errors import CampaignError
from fourpole.guess import Guess, Row, guess_campaign, keep_existing
from fourpole.study.identified import possible_route

__all__ = ["run_init"]

_MOST_LISTED = 40
_ROLES = {"force_in": "F1", "motion_in": "V1", "motion_out": "V2", "load": "load", "deflection": "deflection"}


def run_init(folder: Path, *, force: bool, as_json: bool) -> int:
    """Guess, write, and say what was taken and what is doubtful."""
    if not force:
        keep_existing(folder)
    with progress("looking") as advance:
        guess = guess_campaign(folder, progress=advance)
    guess.write(force=force)
    following = _following(folder)
    if as_json:
        print_json(_document(guess, following))
        return OK
    _tests(guess.rows)
    _channels(guess)
    if guess.doubts:
        out(f"{len(guess.doubts)} doubt{'s' if len(guess.doubts) > 1 else ''}, also written beside what they concern:")
    for number, doubt in enumerate(guess.doubts, 1):
        out(f"{number:>3}. {doubt.text}")
        out(f"     -> {doubt.remedy}")
    out(f"written: campaign.toml and tests.csv in {folder}, {len(guess.rows)} tests")
    out(following)
    return OK


def _following(folder: Path) -> str:
    """What to do next: the command that runs with the campaign as it stands, or what keeps it from running."""
    try:
        campaign = read_campaign(folder)
    except CampaignError as error:
        return f"not ready yet: {error}"
    route, _ = possible_route(campaign, "joint")
    rigless = bool(campaign.of_kind("dynamic")) and not campaign.stated.all_rigs
    if rigless and route in ("mobility", "transmissibility"):
        return f"not ready yet: the {route} route is the only one without all of F1, V1 and V2, and needs the [rig]"
    return f"next: fourpole analyse {folder}{' --route relative' if rigless and route == 'joint' else ''}"


def _document(guess: Guess, following: str) -> dict[str, object]:
    return {
        "folder": str(guess.folder),
        "tests": [
            {
                "test": row.name,
                "file": row.file,
                "kind": row.kind,
                "tyre": row.tyre,
                **row.values,
                "doubts": list(row.doubts),
            }
            for row in guess.rows
        ],
        "channels": {
            role: {"column": one.column, "unit": one.unit, "quantity": one.quantity, "invert": one.invert}
            for role, one in guess.roles.items()
        },
        "rig": dict(guess.rig),
        "doubts": [
            {"about": one.about, "text": one.text, "remedy": one.remedy, "tests": list(one.tests)}
            for one in guess.doubts
        ],
        "left out": [{"file": file, "why": why} for file, why in guess.left_out],
        "next": following,
    }


def _table(heads: Sequence[str]) -> Table:
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, show_edge=False)
    for head in heads:
        table.add_column(Text(head), overflow="fold")
    return table


def _tests(rows: Sequence[Row]) -> None:
    """One line for each kind, tyre, pressure, preload and mass, with how many tests and their frequencies."""
    groups: dict[tuple[str, ...], list[Row]] = {}
    for row in rows:
        cells: tuple[str, ...] = (
            row.kind,
            row.tyre,
            _shown(row.values.get("pressure"), 1e5),
            _shown(row.values.get("preload"), 1.0),
            _shown(row.values.get("added_mass"), 1.0),
        )
        groups.setdefault(cells, []).append(row)
    table = _table(("kind", "tyre", q.PRESSURE.label, q.PRELOAD.head, q.ADDED_MASS.head, "tests", "frequencies [Hz]"))
    for cells, members in list(groups.items())[:_MOST_LISTED]:
        found = sorted({row.values["frequency"] for row in members if "frequency" in row.values})
        listed = list(dict.fromkeys(f"{value:.3g}" for value in found))
        short = listed if len(listed) <= 12 else [*listed[:6], "...", *listed[-3:]]
        table.add_row(*(Text(harmless(cell)) for cell in (*cells, str(len(members)), " ".join(short))))
    table_console().print(table)
    if len(groups) > _MOST_LISTED:
        out(f"... and {len(groups) - _MOST_LISTED} more conditions; see tests.csv")
    out()


def _shown(value: float | None, scale: float) -> str:
    return "" if value is None else f"{value / scale:.4g}"


def _channels(guess: Guess) -> None:
    table = _table(("channel", "column", "unit", "taken as", "sign"))
    if guess.clock is not None:
        table.add_row("time", Text(harmless(guess.clock[0])), Text(harmless(guess.clock[1])), "", "")
    if guess.reference is not None:
        name, unit, pulses = guess.reference
        table.add_row("reference", Text(harmless(name)), Text(harmless(unit)), f"tacho, {pulses} per cycle", "")
    for role, symbol in _ROLES.items():
        if role in guess.roles:
            one = guess.roles[role]
            texts = (symbol, one.column, one.unit or "not known", one.quantity, "turned" if one.invert else "")
            table.add_row(*(Text(harmless(cell)) for cell in texts))
    table_console().print(table)
    out()
