"""The command plan: the uncertainty to expect before testing, advice, and a run sheet."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import polars as pl

from fourpole import quantities as q
from fourpole.answer import Answer, Part, Table
from fourpole.app.console import frequencies, note, say
from fourpole.app.group import write_with_figure
from fourpole.app.options import BareRig, PlanOptions
from fourpole.campaign import read_campaign
from fourpole.core.plan import MASSES, Advice, Outcome, advise
from fourpole.core.rig import Rig
from fourpole.errors import CampaignError, RigError, UnitError
from fourpole.io.folders import make_folder
from fourpole.io.lock import staged
from fourpole.io.write import write_table
from fourpole.planning.expected import Guess
from fourpole.planning.plan import CampaignPlan, Run, bare_plan, plan_campaign, plan_table
from fourpole.planning.runsheet import run_sheet
from fourpole.report.words.plan import AdviceInWords, advice_in_words, expected_tables


def run_plan(
    campaign: Path | None = None, *, options: PlanOptions, bare: BareRig, folder: Path | None = None
) -> Answer:
    """The uncertainty to expect; table and figure are written, and the run sheet if one is wanted."""
    if options.repeats < 1:
        raise UnitError(f"--repeats: {options.repeats} must be 1 or more")
    added = tuple(dict.fromkeys(options.added_mass or ()))
    planned = _planned(campaign, options, bare)
    frame = plan_table(planned, added or MASSES)
    wanted = options.wanted
    advice = [] if wanted is None else [advise(item.plan, wanted, masses=added or MASSES) for item in planned.rigs]
    target = folder if folder is not None or campaign is None else campaign / "plan"
    files = [] if target is None else [("written", path) for path in _written(frame, make_folder(target), wanted)]
    if (sheet := options.run_sheet) is not None:
        files.append(("run sheet", sheet if sheet.suffix else sheet.with_suffix(".csv")))
        write_table(files[-1][1], run_sheet(planned, masses=added, repeats=options.repeats, seed=options.seed))
    document = {"seed": options.seed, "written": [str(path) for _, path in files]}
    parts = _show(planned, frame, advice, None if sheet is None else options.seed)
    return Answer(parts, lambda: {**_document(planned, frame, advice), **document}, files)


def _show(planned: CampaignPlan, frame: pl.DataFrame, advice: Sequence[Advice], seed: int | None) -> Iterator[Part]:
    """Notes, tables and advice; `seed` is that of a run sheet, None without one."""
    note(*planned.notes)
    yield from _show_tables(frame)
    for found in advice_in_words(planned, advice):
        yield from _advice(found)
    if seed is not None:
        say(f"random order with seed {seed}; keep the run sheet as tests.csv of the campaign")


def _planned(campaign: Path | None, options: PlanOptions, bare: BareRig) -> CampaignPlan:
    """Plan of the campaign, or of the stated rig and the guessed tyre."""
    guess = Guess(options.k1, options.k2, options.c, options.std_k1)
    stated = {"noise": options.noise, "cycles": options.cycles, "eccentricity": options.eccentricity}
    run = replace(Run(), **{name: value for name, value in stated.items() if value is not None})
    if run.cycles < 1:
        raise UnitError(f"--cycles: {run.cycles:g} must be 1 or more")
    if campaign is None:
        return _without_campaign(guess, run, options, bare)
    for name, value in asdict(bare).items():
        if value is not None:
            raise CampaignError(f"--{name.replace('_', '-')}: the campaign states this itself: change it there")
    return plan_campaign(read_campaign(campaign), guess, run)


def _without_campaign(guess: Guess, run: Run, options: PlanOptions, bare: BareRig) -> CampaignPlan:
    missing = [name for name in ("mass", "preload_stiffness", "frequency") if getattr(bare, name) is None]
    missing += [name for name in ("k1", "k2", "c") if getattr(options, name) is None]
    if missing:
        raise RigError(
            f"--{missing[0].replace('_', '-')} is missing: name a campaign folder, or give --mass, "
            "--preload-stiffness, --frequency and a guessed specimen, --k1, --k2 and --c"
        )
    return bare_plan(
        Rig(bare.mass or 0.0, bare.preload_stiffness or 0.0, bare.preload_damping or 0.0),
        guess,
        run,
        frequencies(bare.frequency or ""),
        preload=bare.preload,
        rig_std=bare.std_rig,
        gain_std=bare.std_gain,
        phase_std=bare.std_phase,
    )


def _written(frame: pl.DataFrame, folder: Path, wanted: float | None) -> list[Path]:
    """Write plan.csv and its figure. The plot room is imported here because that takes a second."""
    from fourpole.plot.plan import draw_plan

    with staged(folder) as new:
        names = write_with_figure(new, "plan", draw_plan(frame, wanted=wanted), {"plan.csv": frame})
    return [folder / name for name in names]


def _show_tables(frame: pl.DataFrame) -> Iterator[Part]:
    """A table for each of K*, K2 and C: a row per frequency, a column per route and added mass."""
    found = expected_tables(frame)
    yield found.heading
    for one in found.tables:
        yield ""
        yield Table(one.heads, one.rows, right=one.heads)
    yield from found.notes


def _advice(found: AdviceInWords) -> Iterator[str]:
    """Lines that say which remedies reach the wanted uncertainty."""
    yield ""
    yield found.goal
    yield from found.remarks
    if not found.alone:
        return
    yield "each remedy alone:"
    yield from (f"  {way.mark:<10}  {way.line}" for way in found.alone)
    if found.nearest is None:
        yield "remedies that reach it, least effort first:"
        yield from (f"  {way.line}" for way in found.reaching)
    else:
        yield f"no remedy tried reaches it; nearest: {found.nearest.line}"


def _document(planned: CampaignPlan, frame: pl.DataFrame, advice: Sequence[Advice]) -> dict[str, Any]:
    def plain(outcome: Outcome) -> dict[str, Any]:
        return {
            "remedies": [remedy.text for remedy in outcome.remedies],
            "effort [min]": outcome.minutes,
            q.K2.relative_head: outcome.k2,
            q.C.relative_head: outcome.c,
        }

    return {
        "assumptions": list(planned.notes),
        "rows": frame.to_dicts(),
        "advice": [
            {
                "rig": item.name,
                "wanted [1]": found.wanted,
                "route": found.route,
                "reached": found.reached,
                "now": plain(found.now),
                "left by K1 [1]": found.of_k1,
                "alone": [plain(outcome) for outcome in found.alone],
                "reaching": [plain(outcome) for outcome in found.reaching],
                "nearest": plain(found.nearest),
            }
            for item, found in zip(planned.rigs, advice, strict=False)
        ],
    }
