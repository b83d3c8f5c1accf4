"""The commands on a statement: init, which makes one of a bare folder, and check."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from pathlib import Path

from fourpole import quantities as q
from fourpole.answer import Answer, Part, Table
from fourpole.app.alike import gathered_alike
from fourpole.app.console import OK, SOME_REJECTED, counted_tests, more, progress, warn
from fourpole.app.options import MassOptions
from fourpole.campaign import Campaign, read_campaign
from fourpole.campaign.row import DOUBTS, columns_in_doubt
from fourpole.core.checks import Verdict
from fourpole.core.condition import FREQUENCY
from fourpole.core.phasor import SYMBOLS
from fourpole.errors import CampaignError
from fourpole.guess import GuessedCampaign, Row, guess_campaign, keep_existing
from fourpole.report.digits import spread
from fourpole.study.check import CampaignProblem, Checked, check_campaign
from fourpole.study.identify import no_rig, possible_route
from fourpole.words import first_of

_MOST_NAMED = 4
_MOST_PROBLEMS = 60
_MOST_OWN = 12


def run_check(campaign: Path, route: str = "joint", workers: int | None = None) -> Answer:
    """What the analysis would reject; the exit code is the same as that of the analysis."""
    checked = _checked(read_campaign(campaign), route, workers)
    warn(*checked.campaign.doubts)
    code = SOME_REJECTED if checked.counts[Verdict.REJECTED] else OK
    parts = [*_list(checked), f"{_counted(checked)}; nothing was analysed or written"]
    return Answer(parts, lambda: _check_document(checked), code=code)


def _checked(campaign: Campaign, route: str = "joint", workers: int | None = None) -> Checked:
    with progress("checking") as advance:
        return check_campaign(campaign, route=route, workers=workers, progress=advance)


def _check_document(checked: Checked) -> dict[str, object]:
    return {
        "campaign": str(checked.campaign.folder),
        "route": checked.route,
        "verdicts": checked.counts,
        "problems": [asdict(problem) for problem in checked.problems],
        "doubts": list(checked.campaign.doubts),
        "notes": list(checked.notes),
    }


def _list(checked: Checked) -> Iterator[Part]:
    """What `analyse` would note, then one row for each kind of problem, with the tests that have it."""
    own = [name for name in checked.campaign.extra_columns if name != DOUBTS]
    yield from (f"note: {note}" for note in (*checked.notes, *_guessed(checked.campaign)))
    if own:
        yield f"note: columns of your own, for the results alone: {first_of(own, _MOST_OWN)}"
    rows = list(_rows(checked.problems))
    if rows:
        yield ""
        yield Table(
            ("verdict", "tests", "rows of tests.csv", "about", "what is wrong, and what to do"), rows[:_MOST_PROBLEMS]
        )
        yield from more(rows, _MOST_PROBLEMS, "; --json lists all")
        yield ""


def _counted(checked: Checked) -> str:
    return f"{counted_tests(checked.counts, 'would be rejected')} (route: {checked.route})"


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


_MOST_CONDITIONS = 40
_ROLES = {**SYMBOLS, **{role: role for role in ("drive", "load", "deflection")}}


def run_init(folder: Path, mass: MassOptions, force: bool = False, pattern: list[str] | None = None) -> Answer:
    """Guess a campaign, write it, and show the guess with its doubts."""
    if not force:
        keep_existing(folder)
    with progress("reading") as advance:
        guess = guess_campaign(folder, patterns=pattern or (), rig=mass.rig, below=mass.below, progress=advance)
    guess.write(force=force)
    checked, following = _following(folder)
    return Answer(_parts(folder, guess, checked, following), lambda: _guess_document(guess, checked, following))


def _parts(folder: Path, guess: GuessedCampaign, checked: Checked | None, following: str) -> Iterator[Part]:
    yield from _tests(guess.rows)
    yield from _channels(guess)
    if guess.doubts:
        yield f"{len(guess.doubts)} doubt{'s' if len(guess.doubts) > 1 else ''}, also written beside what they concern:"
    for number, doubt in enumerate(guess.doubts, 1):
        yield f"{number:>3}. {doubt.text}"
        yield f"     -> {doubt.remedy}"
    yield from (f"question: {question}" for question in guess.questions.values())
    yield f"written: campaign.toml and tests.csv in {folder}, {len(guess.rows)} tests"
    if checked is not None:
        yield "fourpole check says of them:"
        yield from (f"warning: {doubt}" for doubt in checked.campaign.doubts)
        yield from _list(checked)
        yield _counted(checked)
    yield following


def _following(folder: Path) -> tuple[Checked | None, str]:
    """The campaign as written, checked, and the command to run next, or the reason why none can run yet."""
    try:
        campaign = read_campaign(folder)
    except CampaignError as error:
        return None, f"not ready yet: {error}"
    route, _ = possible_route(campaign, "joint")
    rigless = bool(campaign.of_kind("dynamic")) and not campaign.stated.all_rigs
    if rigless and route in ("mobility", "transmissibility"):
        return _checked(campaign), f"not ready yet: {no_rig(campaign, route)}"
    option = " --route relative" if rigless and route == "joint" else ""
    return _checked(campaign), f"next: fourpole analyse {folder}{option}"


def _guess_document(guess: GuessedCampaign, checked: Checked | None, following: str) -> dict[str, object]:
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
        "questions": guess.questions,
        "left out": [{"file": file, "why": why} for file, why in guess.left_out],
        "check": None if checked is None else _check_document(checked),
        "next": following,
    }


def _tests(rows: Sequence[Row]) -> Iterator[Part]:
    """A row for each kind, tyre, pressure, preload and added mass, with its number of tests and frequencies."""
    groups: dict[tuple[str, ...], list[Row]] = {}
    for row in rows:
        values = ((row.values.get(one.key), one.scale) for one in (q.PRESSURE, q.PRELOAD, q.ADDED_MASS))
        cells = ("" if value is None else f"{value / scale:.4g}" for value, scale in values)
        groups.setdefault((row.kind, row.tyre, *cells), []).append(row)
    lines = [(*cells, str(len(members)), _frequencies(members)) for cells, members in groups.items()]
    heads = ("kind", "specimen", q.PRESSURE.label, q.PRELOAD.head, q.ADDED_MASS.head, "tests", "frequencies")
    yield Table(heads, lines[:_MOST_CONDITIONS], right=heads[2:-1])
    yield from more(groups, _MOST_CONDITIONS, " conditions; see tests.csv")
    yield ""


def _frequencies(rows: Sequence[Row]) -> str:
    """The different frequencies of some tests; of more than eight, the lowest and the highest."""
    bands = dict.fromkeys(f"{row.band[0]:g} to {row.band[1]:g} Hz" for row in rows if row.band is not None)
    return ", ".join(bands) or spread([row.values.get("frequency") for row in rows], FREQUENCY, "Hz")


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
