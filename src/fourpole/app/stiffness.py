"""The command stiffness: K', K'' and loss angle from recordings of a displacement and a force alone."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack
from math import pi, sqrt
from pathlib import Path
from shutil import rmtree
from tempfile import TemporaryDirectory
from typing import Any

import polars as pl

from fourpole import quantities as q
from fourpole.answer import Answer, Part, Table
from fourpole.app.console import OK, SOME_REJECTED, note, progress, say, warn
from fourpole.app.options import MassOptions, RunOptions, Wanted
from fourpole.app.standing import STATEMENT, results_of
from fourpole.campaign import read_campaign
from fourpole.core.checks import Asked, Verdict
from fourpole.core.digits import number
from fourpole.core.polar import value_of
from fourpole.errors import CampaignError
from fourpole.findings.list import checks_by_point
from fourpole.fitting.rows import keys_of
from fourpole.guess import guess_campaign, keep_existing
from fourpole.guess.masses import shows_force
from fourpole.io.door import read_bytes
from fourpole.io.folders import make_folder
from fourpole.io.signals import MAX_FILE_BYTES
from fourpole.io.write import write_bytes, write_text
from fourpole.quantities import Quantity
from fourpole.report.digits import PLUS_MINUS, with_u
from fourpole.study.results import read_results
from fourpole.study.study import Study
from fourpole.words import first_of

#: Share of |K*| that the mass between force cell and specimen takes at the frequency that is named [1].
_TELLING = 0.01
#: A mass before the specimen [kg] of which this is said where none is stated.
_ADAPTER = 0.1
_SHOWN = (q.STORAGE, q.LOSS, q.MODULUS, q.LOSS_ANGLE)
_WHERE = (q.PRELOAD, q.DEFLECTION_AMPLITUDE, q.FREQUENCY)


def run_stiffness(
    recordings: list[Path],
    mass: MassOptions,
    folder: Path | None = None,
    input_mass: float | None = None,
    report: Path | None = None,
    picture: Path | None = None,
) -> Answer:
    """K* of each steady sine in some recordings: init and analyse in one step.

    The far side is fixed, or a mass behind the specimen takes the place of a force cell. Nothing is left but what is
    asked for: the folder of the campaign, the report, a picture.
    """
    files: list[tuple[str, Path]] = []
    with TemporaryDirectory(prefix="fourpole-") as temporary, ExitStack() as stack:
        if folder is not None:
            keep_existing(folder)
            if not folder.exists():
                stack.callback(rmtree, folder, ignore_errors=True)
        place = Path(temporary) if folder is None else make_folder(folder)
        _state(recordings, place, mass, input_mass)
        if folder is None and report is None:
            from fourpole.study import analyse

            with progress("analysing") as advance:
                study = analyse(read_campaign(place), progress=advance)
        else:
            study, page = _with_report(place)
            files += [] if folder is None else [("campaign", folder), ("report", page)]
            if report is not None:
                write_bytes(report, read_bytes(page, max_bytes=MAX_FILE_BYTES))
                files.append(("report", report))
        if picture is not None:
            from fourpole.app.report import draw_one
            from fourpole.plot import Style

            files.append(("picture", draw_one(study, place, "stiffness", picture, Style())))
        stack.pop_all()  # all is done: the folder stays
    note(*study.notes)
    code = SOME_REJECTED if Verdict.REJECTED in study.dynamic[q.VERDICT_K.head] else OK
    return Answer(_parts(study, input_mass), lambda: _document(study), files=files, code=code)


def _with_report(place: Path) -> tuple[Study, Path]:
    """The study of a campaign with its report, as `fourpole analyse` makes them."""
    from fourpole.app.analysis import run_analysis
    from fourpole.study import DRAWS

    run_analysis(place, None, "joint", DRAWS, RunOptions(), Wanted(), as_json=True)
    results = results_of(place, None)
    return read_results(results), results / "report.html"


def _state(recordings: Sequence[Path], folder: Path, mass: MassOptions, input_mass: float | None) -> None:
    """Copy the recordings into a folder, and state what they are guessed to be: a campaign of a bench, or of a mass."""
    if mass.rig and input_mass is not None:
        raise CampaignError(
            "--input-mass is before a force cell, which a mass behind the specimen replaces: leave it out"
        )
    counts: Counter[str] = Counter()
    for path in recordings:
        counts[path.name] += 1
        if path.name in STATEMENT:
            raise CampaignError(f"{path}: is a statement of a campaign, and no recording: leave it out")
        name = path.name if counts[path.name] == 1 else f"{path.parent.name}_{counts[path.name]}_{path.name}"
        write_bytes(folder / name, read_bytes(path, max_bytes=MAX_FILE_BYTES, label=str(path)))
    named = first_of([path.name for path in recordings], 3)
    try:
        with progress("reading") as advance:
            guess = guess_campaign(folder, rig=mass.rig, below=mass.below, progress=advance)
    except CampaignError as error:
        raise CampaignError(str(error).replace(str(folder), named)) from None
    if guess.moving and not mass.rig and "force_in" not in guess.roles:
        raise CampaignError(f"{named}: no force is recorded: --mass-above or --mass-below states a mass in place of it")
    if mass.rig and not shows_force(guess.roles):
        why = "a force" if "force_in" in guess.roles else "no second motion"
        raise CampaignError(
            f"{named}: a mass in place of a force needs a motion before the "
            f"specimen and that of the mass, and here is {why}: put the recordings into a folder and run fourpole init"
        )
    if guess.moving and not guess.blocked and not mass.rig:
        why = "a second motion" if "motion_out" in guess.roles else "no displacement"
        raise CampaignError(
            f"{named}: a bench records one displacement and one force, and "
            f"here is {why}: put the recordings into a folder and run fourpole init, which asks for the rest; "
            "--mass-above or --mass-below states a mass that takes the place of a force"
        )
    guess.write()
    if input_mass is not None:
        stated = read_bytes(folder / "campaign.toml", max_bytes=MAX_FILE_BYTES).decode()
        line = f'[rig]\ninput_mass = "{input_mass:.12g} kg"\n'
        write_text(folder / "campaign.toml", stated.replace("[rig]\n", line, 1))
    for role, one in guess.roles.items():
        say(f"understood {role}: column '{one.column}' [{one.unit}]{', inverted' if one.invert else ''}")
        warn(*(f"{role}: {doubt}" for doubt in one.doubts))


def _causes(study: Study) -> list[str]:
    """What is doubtful in K* of each row in a few words, with what to do."""
    checks = checks_by_point(study.checks.filter(pl.col(q.QUANTITY.head) == Asked.STIFFNESS))
    keys = keys_of(study.dynamic)
    words = {key: [": ".join(filter(None, (one.cause, one.remedy))) for one in rows] for key, rows in checks.items()}
    return ["; ".join(dict.fromkeys(filter(None, words.get(key, ())))) for key in keys]


def _parts(study: Study, input_mass: float | None) -> Iterator[Part]:
    """A table with U of what was found, and what limits it."""
    rows, units = study.dynamic.to_dicts(), study.shown
    places = [units.of(one) for one in _WHERE if any(row[one.head] is not None for row in rows)]
    shown = [units.of(one) for one in _SHOWN]
    cells = [
        [
            row["tyre"] or "",
            *(_plain(row[one.head], one) for one in places),
            *(_found(row, one) for one in shown),
            row[q.VERDICT_K.head],
            cause,
        ]
        for row, cause in zip(rows, _causes(study), strict=True)
    ]
    numbers = [f"{one.symbol} [{one.shown}]" for one in (*places, *shown)]
    if rows:
        yield Table(["specimen", *numbers, "verdict", "remarks"], cells, numbers)
        yield PLUS_MINUS
    known = [found[0] for row in rows if (found := value_of(q.MODULUS, row))]
    if known and study.dynamic[q.ROUTE.head][0] == "mobility":
        mass = input_mass or _ADAPTER
        hertz = sqrt(_TELLING * min(known) / mass) / (2 * pi)
        what = f"{mass:g} kg before the specimen takes 1 % of |K*| at {hertz:.3g} Hz"
        if input_mass:
            yield f"the mass of {what}; it was taken out"
        else:
            yield f"between force cell and specimen, a mass that moves is part of K*: {what}; --input-mass takes it out"
    yield from _static(study)


def _static(study: Study) -> Iterator[Part]:
    """K1 and the loss of each slow loop at the preloads of the sines."""
    units = study.shown
    shown = [units.of(one) for one in (q.PRELOAD, q.K1, q.CYCLE_LOSS)]
    rows = [
        [
            row["tyre"] or "",
            _plain(row[q.PRELOAD.head], shown[0]),
            *(_found(row, one) for one in shown[1:]),
            row["verdict"],
        ]
        for row in study.static.to_dicts()
    ]
    if rows:
        heads = [f"{one.symbol} [{one.shown}]" for one in shown]
        yield Table(["static test", *heads, "verdict"], rows, heads)
        yield "fourpole static FILE --load gives K1 at another load"


def _plain(value: float | None, quantity: Quantity) -> str:
    return "" if value is None else number(value / quantity.scale)


def _found(row: Mapping[str, Any], quantity: Quantity) -> str:
    """A value with U; blank where there is none."""
    found = value_of(quantity, row)
    return "" if found is None else with_u(*found, quantity.scale)


def _document(study: Study) -> list[dict[str, Any]]:
    """A row for each sine, in SI units."""
    heads = [*_WHERE, q.STORAGE, q.LOSS]
    columns = ["test", "tyre", *(head for one in heads for head in one.heads if head in study.dynamic.columns)]
    verdicts = pl.col(q.VERDICT_K.head).alias(q.VERDICT.head)
    return study.dynamic.select(*columns, verdicts, q.REMARKS.head).to_dicts()
