"""The command plan: the uncertainty to expect before testing, advice, and a run sheet."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import polars as pl

from fourpole import quantities as q
from fourpole import units
from fourpole.app.console import option, out, print_json, say
from fourpole.campaign import read_campaign
from fourpole.core.plan import MASSES, PLAN_ROUTES, Advice, Outcome, advise
from fourpole.core.rig import Rig
from fourpole.errors import CampaignError, RigError, UnitError
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
    with_kg,
)
from fourpole.planning.runsheet import run_sheet
from fourpole.study.study import make_folder

__all__ = ["PlanOptions", "run_plan"]

_SHORT = {"mobility": "mobility", "relative": "relative", "transmissibility": "transmiss.", "joint": "joint"}
_MOST_FREQUENCIES = 16
_MOST_WAYS = 5
#: What leaves more of an uncertainty than this is of no use.
_NO_GAIN = 0.98


@dataclass(frozen=True)
class PlanOptions:
    """The options of the command as written; None where not given."""

    k1: str | None = None
    k2: str | None = None
    c: str | None = None
    mass: str | None = None
    preload_stiffness: str | None = None
    preload_damping: str | None = None
    frequency: str | None = None
    preload: str | None = None
    std_rig: str | None = None
    std_gain: str | None = None
    std_phase: str | None = None
    std_k1: str | None = None
    noise: str | None = None
    cycles: int | None = None
    eccentricity: str | None = None
    added_mass: Sequence[str] = ()
    wanted: str | None = None
    repeats: int = 1
    seed: int = 1982


#: Options that describe what a campaign states itself.
_OF_THE_RIG = (
    "mass",
    "preload_stiffness",
    "preload_damping",
    "frequency",
    "preload",
    "std_rig",
    "std_gain",
    "std_phase",
)


def run_plan(
    campaign: Path | None, options: PlanOptions, folder: Path | None, sheet: Path | None, *, as_json: bool
) -> None:
    """Say what uncertainty to expect, write table and figure, and the run sheet where one is wanted."""
    wanted = _positive(options.wanted, "ratio", "--wanted")
    given = [_positive(text, "mass", "--added-mass") for text in options.added_mass]
    masses = tuple(dict.fromkeys(mass for mass in given if mass is not None))
    if options.repeats < 1:
        raise UnitError(f"--repeats: {options.repeats} must be 1 or more")
    planned = _planned(campaign, options)
    frame = plan_table(planned, masses or MASSES)
    advice = [] if wanted is None else [advise(item.plan, wanted, masses=masses or MASSES) for item in planned.rigs]
    files = []
    target = folder if folder is not None or campaign is None else campaign / "plan"
    if target is not None:
        files += _written(frame, make_folder(target), wanted)
    if sheet is not None:
        path = sheet if sheet.suffix else sheet.with_suffix(".csv")
        write_table(path, run_sheet(planned, masses=masses, repeats=options.repeats, seed=options.seed))
        files.append(path)
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
    for line in _tables(frame):
        out(line)
    for item, found in zip(planned.rigs, advice, strict=False):
        for line in _advice(item, found, several=len(planned.rigs) > 1):
            out(line)
    for path in files:
        out(f"{'run sheet' if path == files[-1] and seed is not None else 'written'}: {path}")
    if seed is not None:
        say(f"order drawn with seed {seed}; keep it as tests.csv of the campaign")


def _positive(text: str | None, kind: str, name: str) -> float | None:
    """A quantity of an option in SI, None where it is not given."""
    if text is None:
        return None
    value = option(text, kind, name)
    if value <= 0:
        raise UnitError(f"{name}: {units.shown(text)} must be positive")
    return value


def _not_negative(text: str | None, kind: str, name: str) -> float | None:
    if text is None:
        return None
    value = option(text, kind, name)
    if value < 0:
        raise UnitError(f"{name}: {units.shown(text)} must be zero or positive")
    return value


def _planned(campaign: Path | None, options: PlanOptions) -> CampaignPlan:
    guess = Guess(
        k1=_positive(options.k1, "stiffness", "--k1"),
        k2=_positive(options.k2, "stiffness", "--k2"),
        c=_positive(options.c, "damping", "--c"),
        k1_std=_not_negative(options.std_k1, "ratio", "--std-k1"),
    )
    usual = Run()
    noise = _not_negative(options.noise, "ratio", "--noise")
    cycles = usual.cycles if options.cycles is None else float(options.cycles)
    if cycles < 1:
        raise UnitError(f"--cycles: {cycles:g} must be 1 or more")
    run = Run(
        noise=usual.noise if noise is None else noise,
        cycles=cycles,
        eccentricity=_positive(options.eccentricity, "displacement", "--eccentricity") or usual.eccentricity,
    )
    if campaign is not None:
        for name in _OF_THE_RIG:
            if getattr(options, name) is not None:
                raise CampaignError(f"--{name.replace('_', '-')}: the campaign states this itself: change it there")
        return plan_campaign(read_campaign(campaign), guess, run)
    for name in ("mass", "preload_stiffness", "frequency", "k1", "k2", "c"):
        if getattr(options, name) is None:
            raise RigError(
                f"--{name.replace('_', '-')} is missing: name a campaign folder, or give --mass, --preload-stiffness, "
                "--frequency and a guessed tyre, --k1, --k2 and --c"
            )
    assert options.mass is not None
    assert options.preload_stiffness is not None
    assert options.frequency is not None
    rig = Rig(
        moving_mass=option(options.mass, "mass", "--mass"),
        preload_stiffness=option(options.preload_stiffness, "stiffness", "--preload-stiffness"),
        preload_damping=_not_negative(options.preload_damping, "damping", "--preload-damping") or 0.0,
    )
    try:
        grid = units.frequency_grid(options.frequency)
    except UnitError as error:
        raise UnitError(f"--frequency: {error}") from None
    return bare_plan(
        rig,
        guess,
        run,
        grid,
        preload=_positive(options.preload, "force", "--preload"),
        rig_std=_not_negative(options.std_rig, "ratio", "--std-rig"),
        gain_std=_not_negative(options.std_gain, "ratio", "--std-gain"),
        phase_std=_not_negative(options.std_phase, "angle", "--std-phase"),
    )


def _written(frame: pl.DataFrame, folder: Path, wanted: float | None) -> list[Path]:
    """plan.csv and the figure; drawing is loaded here, for it takes a second."""
    from fourpole.plot.plan import draw_plan, write_plan_figure

    write_table(folder / "plan.csv", frame)
    figure = draw_plan(frame, wanted=wanted)
    return [folder / "plan.csv", *(write_plan_figure(figure, folder / f"plan.{form}") for form in ("svg", "png"))]


def _tables(frame: pl.DataFrame) -> Iterator[str]:
    """A table for K*, K2 and C: a row per frequency, a column per route, and of the joint route per mass."""
    stated = pl.col("plan") == AS_STATED
    routes = [route for route in PLAN_ROUTES if route in frame["route"].to_list()]
    columns = [(_SHORT[route], stated & (pl.col("route") == route)) for route in routes]
    if "joint" in routes:
        for plan in frame.filter(~stated)["plan"].unique(maintain_order=True).to_list():
            mass = plan.removeprefix(with_kg(0).split("0")[0])
            columns.append((f"joint+{mass}", (pl.col("plan") == plan) & (pl.col("route") == "joint")))
    frequencies = sorted(frame[q.FREQUENCY.head].unique().to_list())
    kept = frequencies
    if len(kept) > _MOST_FREQUENCIES:
        last = len(kept) - 1
        kept = [frequencies[round(at * last / (_MOST_FREQUENCIES - 1))] for at in range(_MOST_FREQUENCIES)]
    tests = frame.select("rig", "test").n_unique()
    yield f"Relative standard uncertainty to expect, in %: {tests} tests, median over those of one frequency"
    for quantity in ("K*", "K2", "C"):
        yield ""
        yield f"{'u(' + quantity + ') [%]':>10}  " + "  ".join(f"{name:>11}" for name, _ in columns)
        chosen = [
            dict(
                frame.filter(mask)
                .group_by(q.FREQUENCY.head)
                .agg(pl.col(f"u({quantity})/{quantity} [1]").median())
                .iter_rows()
            )
            for _, mask in columns
        ]
        for frequency in kept:
            cells = (_percent(found.get(frequency)) for found in chosen)
            yield f"{frequency:>7.4g} Hz  " + "  ".join(f"{cell:>11}" for cell in cells)
    if len(kept) < len(frequencies):
        yield f"({len(kept)} of {len(frequencies)} frequencies shown; plan.csv has all)"
    high = frame.filter(stated)[q.K2.relative_head].max()
    if isinstance(high, float) and high > 0.3:
        yield "(above some 30 % the true scatter has tails that no standard uncertainty describes)"


def _percent(value: float | None) -> str:
    return "-" if value is None else f"{100 * value:.3g}"


def _advice(item: RigPlan, found: Advice, *, several: bool) -> Iterator[str]:
    """What reaches the wanted uncertainty, in words."""
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
            "better static tests are part of any way there"
        )
    yield "one thing alone:"
    for outcome in found.alone:
        mark = "reaches it" if outcome.worst <= found.wanted else "not enough"
        mark = "no gain   " if outcome.worst > _NO_GAIN * found.now.worst else mark
        yield f"  {mark}  {_line(outcome)}"
    if found.reaching:
        yield "what reaches it, least effort first:"
        for outcome in found.reaching[:_MOST_WAYS]:
            yield f"  {_line(outcome)}"
    else:
        yield f"nothing looked at reaches it; nearest: {_line(found.nearest)}"


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
