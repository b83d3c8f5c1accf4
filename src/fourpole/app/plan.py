"""The command plan: the uncertainty to expect before testing, advice, and a run sheet."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import polars as pl

from fourpole import quantities as q
from fourpole.app.console import frequencies, out, print_json, print_table, say
from fourpole.app.options import BareRig, PlanOptions
from fourpole.campaign import read_campaign
from fourpole.core.plan import MASSES, PLAN_ROUTES, Advice, Outcome, advise
from fourpole.core.rig import Rig
from fourpole.errors import CampaignError, RigError, UnitError
from fourpole.io.staging import staged
from fourpole.io.write import write_table
from fourpole.planning.plan import (
    AS_STATED,
    CampaignPlan,
    Guess,
    RigPlan,
    Run,
    bare_plan,
    plan_campaign,
    plan_table,
)
from fourpole.planning.runsheet import run_sheet
from fourpole.study.identified import NOT_LINEAR
from fourpole.study.study import make_folder

_SHORT = {"mobility": "mobility", "relative": "relative", "transmissibility": "transmiss.", "joint": "joint"}
_MOST_FREQUENCIES = 16
_MOST_WAYS = 5
#: A remedy that leaves more than this share of the uncertainty is shown as no gain.
_NO_GAIN = 0.98


def run_plan(campaign: Path | None, options: PlanOptions, bare: BareRig, folder: Path | None, *, as_json: bool) -> None:
    """Print the uncertainty to expect; write table and figure, and the run sheet if one is wanted."""
    if options.repeats < 1:
        raise UnitError(f"--repeats: {options.repeats} must be 1 or more")
    added = tuple(dict.fromkeys(options.added_mass or ()))
    planned = _planned(campaign, options, bare)
    frame = plan_table(planned, added or MASSES)
    wanted = options.wanted
    advice = [] if wanted is None else [advise(item.plan, wanted, masses=added or MASSES) for item in planned.rigs]
    target = folder if folder is not None or campaign is None else campaign / "plan"
    files = [] if target is None else _written(frame, make_folder(target), wanted)
    sheet = options.run_sheet
    if sheet is not None:
        files.append(sheet if sheet.suffix else sheet.with_suffix(".csv"))
        write_table(files[-1], run_sheet(planned, masses=added, repeats=options.repeats, seed=options.seed))
    if as_json:
        print_json(_document(planned, frame, advice, files, options.seed))
    else:
        _show(planned, frame, advice, files, None if sheet is None else options.seed)


def _show(
    planned: CampaignPlan, frame: pl.DataFrame, advice: Sequence[Advice], files: Sequence[Path], seed: int | None
) -> None:
    """Print notes, tables, advice and the files written; the last file is the run sheet if a seed is given."""
    for note in planned.notes:
        say(f"note: {note}")
    _show_tables(frame)
    for item, found in zip(planned.rigs, advice, strict=False):
        for line in _advice(item, found, several=len(planned.rigs) > 1):
            out(line)
    for path in files:
        out(f"{'run sheet' if path == files[-1] and seed is not None else 'written'}: {path}")
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
            "--preload-stiffness, --frequency and a guessed tyre, --k1, --k2 and --c"
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
    from fourpole.plot.plan import draw_plan, write_plan_figure

    figure = draw_plan(frame, wanted=wanted)
    with staged(folder) as new:
        write_table(new / "plan.csv", frame)
        for form in ("svg", "png"):
            write_plan_figure(figure, new / f"plan.{form}")
    return [folder / f"plan.{form}" for form in ("csv", "svg", "png")]


def _show_tables(frame: pl.DataFrame) -> None:
    """Print a table for each of K*, K2 and C: a row per frequency, a column per route and added mass."""
    stated = frame.filter(pl.col("plan") == AS_STATED)
    columns = _columns(frame)
    every = sorted(frame[q.FREQUENCY.head].unique().to_list())
    kept = every
    if len(every) > _MOST_FREQUENCIES:
        kept = [every[round(at * (len(every) - 1) / (_MOST_FREQUENCIES - 1))] for at in range(_MOST_FREQUENCIES)]
    tests = frame.select("rig", "test").n_unique()
    out(f"Relative standard uncertainty to expect, in %: {tests} tests, median over those of one frequency")
    for quantity in (q.K_STAR, q.K2, q.C):
        out()
        median = pl.col(quantity.relative_head).median()
        found = [dict(one.group_by(q.FREQUENCY.head).agg(median).iter_rows()) for one in columns.values()]
        heads = (f"u({quantity.symbol}) [%]", *columns)
        rows = [(f"{one:.4g} Hz", *(_percent(each.get(one)) for each in found)) for one in kept]
        print_table(heads, rows, right=heads)
    if len(kept) < len(every):
        out(f"({len(kept)} of {len(every)} frequencies shown; plan.csv has all)")
    high = stated[q.K2.relative_head].max()
    if isinstance(high, float) and high > NOT_LINEAR:
        out("(above some 30 % the true scatter has tails that no standard uncertainty describes)")


def _columns(frame: pl.DataFrame) -> dict[str, pl.DataFrame]:
    """Rows of the plan by the head of their column: each route as stated, then the joint route with each mass."""
    found = {}
    for (plan, route), rows in frame.group_by("plan", "route", maintain_order=True):
        if plan == AS_STATED:
            found[_SHORT[str(route)]] = rows
        elif route == "joint":
            found[f"joint+{str(plan).removeprefix('with ')}"] = rows
    order = [_SHORT[route] for route in PLAN_ROUTES]
    return dict(sorted(found.items(), key=lambda item: order.index(item[0]) if item[0] in order else len(order)))


def _percent(value: float | None) -> str:
    return "-" if value is None else f"{100 * value:.3g}"


def _advice(item: RigPlan, found: Advice, *, several: bool) -> Iterator[str]:
    """Lines that say which remedies reach the wanted uncertainty."""
    yield ""
    where = f"rig {item.name}: " if several else ""
    goal = f"{100 * found.wanted:g} % of K2 and C (median over the tests, {found.route} route)"
    yield f"{where}wanted {goal}; the plan as it is: {_both(found.now)}"
    if found.reached:
        yield "reached: nothing more is needed"
        return
    if found.of_k1 > found.wanted:
        yield (
            f"K1 alone leaves {100 * found.of_k1:.2g} %, however good the dynamic tests are: "
            "every remedy needs better static tests"
        )
    yield "each remedy alone:"
    for outcome in found.alone:
        mark = "reaches it" if outcome.worst <= found.wanted else "not enough"
        mark = "no gain   " if outcome.worst > _NO_GAIN * found.now.worst else mark
        yield f"  {mark}  {_line(outcome)}"
    if found.reaching:
        yield "remedies that reach it, least effort first:"
        for outcome in found.reaching[:_MOST_WAYS]:
            yield f"  {_line(outcome)}"
    else:
        yield f"no remedy tried reaches it; nearest: {_line(found.nearest)}"


def _line(outcome: Outcome) -> str:
    return f"{_duration(outcome.minutes):>7}  {_both(outcome)}  {outcome.text}"


def _duration(minutes: float) -> str:
    return f"{minutes:.0f} min" if minutes < 100 else f"{minutes / 60:.1f} h"


def _both(outcome: Outcome) -> str:
    return f"K2 {100 * outcome.k2:.2g} %, C {100 * outcome.c:.2g} %"


def _document(
    planned: CampaignPlan, frame: pl.DataFrame, advice: Sequence[Advice], files: Sequence[Path], seed: int
) -> dict[str, Any]:
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
        "seed": seed,
        "written": [str(path) for path in files],
    }
