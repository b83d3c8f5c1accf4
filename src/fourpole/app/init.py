"""The command that makes a campaign of a bare folder of recordings."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict
from pathlib import Path

from fourpole import quantities as q
from fourpole.answer import Answer, Part, Table
from fourpole.app.console import progress
from fourpole.campaign import read_campaign
from fourpole.core.condition import FREQUENCY
from fourpole.errors import CampaignError
from fourpole.guess import GuessedCampaign, Row, guess_campaign, keep_existing
from fourpole.guess.write import WEIGHT
from fourpole.report.digits import spread
from fourpole.study.identify import no_rig, possible_route

_MOST_LISTED = 40
_ROLES = {
    "force_in": "F1",
    "motion_in": "V1",
    "motion_out": "V2",
    "drive": "drive",
    "load": "load",
    "deflection": "deflection",
}


def run_init(folder: Path, pattern: Sequence[str] | None, *, force: bool) -> Answer:
    """Guess a campaign, write it, and show the guess with its doubts."""
    if not force:
        keep_existing(folder)
    with progress("reading") as advance:
        guess = guess_campaign(folder, patterns=pattern or (), progress=advance)
    guess.write(force=force)
    following = _following(folder)
    return Answer(_parts(folder, guess, following), lambda: _document(guess, following))


def _parts(folder: Path, guess: GuessedCampaign, following: str) -> Iterator[Part]:
    yield from _tests(guess.rows)
    yield from _channels(guess)
    if guess.doubts:
        yield f"{len(guess.doubts)} doubt{'s' if len(guess.doubts) > 1 else ''}, also written beside what they concern:"
    for number, doubt in enumerate(guess.doubts, 1):
        yield f"{number:>3}. {doubt.text}"
        yield f"     -> {doubt.remedy}"
    if guess.moving:
        yield f"question: what does each specimen weigh? It may stay open. [tyres.NAME] specimen_mass states {WEIGHT}"
    yield f"written: campaign.toml and tests.csv in {folder}, {len(guess.rows)} tests"
    yield following


def _following(folder: Path) -> str:
    """The command to run next with the campaign as written, or the reason why none can run yet."""
    try:
        campaign = read_campaign(folder)
    except CampaignError as error:
        return f"not ready yet: {error}"
    route, _ = possible_route(campaign, "joint")
    rigless = bool(campaign.of_kind("dynamic")) and not campaign.stated.all_rigs
    if rigless and route in ("mobility", "transmissibility"):
        return f"not ready yet: {no_rig(campaign, route)}"
    return f"next: fourpole analyse {folder}{' --route relative' if rigless and route == 'joint' else ''}"


def _document(guess: GuessedCampaign, following: str) -> dict[str, object]:
    return {
        "folder": str(guess.folder),
        "tests": [
            {
                "test": row.name,
                "file": row.file,
                "kind": row.kind,
                "tyre": row.tyre,
                **row.values,
                **({} if row.band is None else {"band": row.band}),
                "doubts": [{"about": about, "text": text} for about, text in row.doubts],
            }
            for row in guess.rows
        ],
        "channels": {
            role: {"column": one.column, "unit": one.unit, "quantity": one.quantity, "invert": one.invert}
            for role, one in guess.roles.items()
        },
        "rig": dict(guess.rig),
        "doubts": [asdict(doubt) for doubt in guess.doubts],
        "questions": {"specimen_mass": WEIGHT} if guess.moving else {},
        "left out": [{"file": file, "why": why} for file, why in guess.left_out],
        "next": following,
    }


def _tests(rows: Sequence[Row]) -> Iterator[Part]:
    """A row for each kind, tyre, pressure, preload and added mass, with its number of tests and frequencies."""
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
    lines = [(*cells, str(len(members)), _frequencies(members)) for cells, members in groups.items()]
    heads = ("kind", "tyre", q.PRESSURE.label, q.PRELOAD.head, q.ADDED_MASS.head, "tests", "frequencies")
    yield Table(heads, lines[:_MOST_LISTED], right=heads[2:-1])
    if len(groups) > _MOST_LISTED:
        yield f"... and {len(groups) - _MOST_LISTED} more conditions; see tests.csv"
    yield ""


def _frequencies(rows: Sequence[Row]) -> str:
    """The different frequencies of some tests; of more than eight, the lowest and the highest."""
    bands = dict.fromkeys(f"{row.band[0]:g} to {row.band[1]:g} Hz" for row in rows if row.band is not None)
    return ", ".join(bands) or spread([row.values.get("frequency") for row in rows], FREQUENCY, "Hz")


def _shown(value: float | None, scale: float) -> str:
    return "" if value is None else f"{value / scale:.4g}"


def _channels(guess: GuessedCampaign) -> Iterator[Part]:
    rows = []
    if guess.clock is not None:
        rows.append(("time", *guess.clock[:2], "", ""))
    if guess.reference is not None:
        name, unit, pulses = guess.reference
        rows.append(("reference", name, unit, f"tacho, {pulses} per cycle", ""))
    for role, symbol in _ROLES.items():
        if role in guess.roles:
            one = guess.roles[role]
            rows.append((symbol, one.column, one.unit or "not known", one.quantity, "inverted" if one.invert else ""))
    yield Table(("channel", "column", "unit", "taken as", "sign"), rows)
    yield ""
