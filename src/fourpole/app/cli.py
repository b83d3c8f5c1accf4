"""The command `fourpole`."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

import fourpole.app.model_commands  # noqa: F401 - which registers its commands
from fourpole.answer import Answer
from fourpole.app.console import end_in_order, out, progress, rising, say, show_warnings, warn
from fourpole.app.events import end_with_caller
from fourpole.app.group import Group, registered
from fourpole.errors import CampaignError
from fourpole.version import VERSION

if TYPE_CHECKING:  # a command's annotations find these when it is built
    from fourpole.app.options import (
        BareRig,
        InfoOptions,
        PlanOptions,
        PlotOptions,
        PointOptions,
        RunOptions,
        ShapeOptions,
        Wanted,
    )

app = typer.Typer(
    name="fourpole",
    cls=Group,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
    help="From tyre-rig recordings to static stiffness K1, dynamic stiffness K2, damping C, mobility and "
    "transmissibility, with the uncertainty of every number.\n\nStart with fourpole demo, which makes a "
    "campaign folder to look at and analyses it; then fourpole analyse YOUR-FOLDER.\n\nQuantities are "
    'written with their unit, as in "12.44 kN/m". Exit codes: 0 all used, 2 the input could not be read, 3 done but '
    "some tests were rejected.",
)


def _version(shown: bool) -> None:
    if shown:
        out(f"fourpole {VERSION}")
        raise typer.Exit


@app.callback()
def _root(
    show: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version.")
    ] = False,
) -> None:
    pass


@registered("analysis.run_demo")
def demo(
    folder: Path = Path("fourpole-demo"), seed: int = 1982, workers: int | None = None, as_json: bool = False
) -> None:
    """Make a campaign of the 1982 paper's kind on the virtual rig, analyse it, and print the findings."""


@registered()
def simulate(folder: Path, seed: int = 1982, clean: bool = False, car: bool = False, massless: bool = False) -> None:
    """Record a whole campaign on the virtual rigs: campaign.toml, tests.csv, recordings and truth.csv."""
    from fourpole.virtual import BELTED, CAR_TYRE, CROSS_PLY, RADIAL_PLY, simulate_campaign

    if car and massless:
        raise CampaignError("--car and --massless contradict each other: the car's tyre is there for its belt")
    plan: dict[str, Any] = {"tyres": (CROSS_PLY, RADIAL_PLY) if massless else BELTED}
    if car:
        plan = {"tyres": [CAR_TYRE], "preloads": [1000.0], "added_masses": (0.0, 10.0), "eccentricity": 0.2e-3}
    with progress("recording") as advance:
        made = simulate_campaign(folder, seed=seed, clean=clean, progress=advance, **plan)
    say(f"{made.tests} tests recorded in {made.folder} (seed {made.seed}); next: fourpole analyse {made.folder}")


@registered("check.run_init")
def init(folder: Path, force: bool = False, pattern: list[str] | None = None, as_json: bool = False) -> None:
    """Make a campaign from a bare folder of recordings: guess channels, kinds and conditions, and list each doubt.

    The names of files and folders, headers, notes beside them and the signals are read. Then campaign.toml and
    tests.csv are written for you to correct.
    """


@registered()
def analyse(
    campaigns: list[Path],
    folder: Path | None = None,
    route: str = "joint",
    monte_carlo: int = 10000,
    *,
    wanted: Wanted,
    options: RunOptions,
    as_json: bool = False,
) -> Answer:
    """Analyse a campaign folder: recordings in; tables of K1, R, I, K*, K2, C and TR, figures and a report out.

    Reduced recordings are kept in the folder of the results, so a run that was stopped continues where it was. Each
    of several campaigns has its own results, and one that cannot be read does not stop the others.
    """
    from fourpole.app.options import allow_remote
    from fourpole.app.standing import answer_of, results_of, run_each, settings_of, standing

    settings = settings_of(route, monte_carlo, wanted)
    allow_remote(options.remote)

    def run(campaign: Path) -> Answer:
        former = standing(campaign, results_of(campaign, folder), settings, verify=options.verify)
        if former is not None:
            return answer_of(former, stands=True)
        from fourpole.app.analysis import run_analysis

        return run_analysis(campaign, folder, route, monte_carlo, options, wanted, as_json=as_json)

    return run_each(campaigns, folder, run, as_json=as_json)


@registered("browse.run_open")
def open_(folder: Path) -> None:
    """Show the report of a campaign in the browser, and print its path."""


@registered("browse.run_app")
def app_(
    folder: Path = Path(),
    port: int = 0,
    host: str = "127.0.0.1",
    no_browser: bool = False,
    no_token: bool = False,
    remote: bool = False,
) -> None:
    """Open the app in the browser: drop recordings, state, analyse, look at every test, results and models.

    It works without a network. What it saves is campaign.toml, tests.csv and the results of the commands. Open the
    whole address that it prints: without its token, other accounts of the machine cannot use it.
    """


@registered("watching.run_watch")
def watch(campaign: Path, remote: bool = False, as_json: bool = False) -> None:
    """Judge each recording as a logger writes it into a campaign's folder, while the specimen is on the rig.

    A recording is judged by itself, and with the rig as the last analysis found it. One that tests.csv does not name
    gets a row of it, as init would guess it. Recordings that are there but not in tests.csv are judged, too.
    """


@registered("check.run_check", browser=True)
def check(
    campaign: Path, route: str = "joint", workers: int | None = None, remote: bool = False, as_json: bool = False
) -> None:
    """Check a campaign without analysing it: files, channels, units, times, K1, duplicates.

    The command lists what analyse would reject, where it stands and what to do. It writes nothing.
    """


@registered("info.run_info")
def info(file: Path, *, options: InfoOptions, as_json: bool = False) -> None:
    """Show what a file holds: its format, its channels with units, rates, ranges and gaps, and an outline of each.

    Column `line`: the frequency with the largest share of the channel's variance. Only the first 64 channels of a file
    are read; name a group or a channel for others.
    """


@registered()
def convert(
    file: Path, target: Path, group: str = "", channels: str = "", window: str = "", kind: str = "", force: bool = False
) -> Answer:
    """Write a recording in another format, with its units, times and groups, every sample as it is.

    A warning names what the format cannot keep. If the format cannot hold the recording at all, nothing is written.
    """
    from fourpole.io.convert import Choice
    from fourpole.io.convert import convert as converted

    names = tuple(name.strip() for name in channels.split(",") if name.strip())
    limits = rising(window, "--window", "2..12") if window else None
    with progress("converting") as advance:
        made = converted(file, target, Choice(group, names, limits, kind, force), progress=advance)
    for sentence in made.lost:
        warn(sentence)
    return Answer(["\n  ".join([f"{target}: {made.format}", *made.groups])])


@registered("plan.run_plan")
def plan(
    campaign: Path | None = None,
    *,
    options: PlanOptions,
    bare: BareRig,
    folder: Path | None = None,
    as_json: bool = False,
) -> None:
    """Before testing: the uncertainty of K*, K2 and C to expect by each route, with and without an added mass.

    The plan is of a campaign, whose recordings need not exist yet, or of a rig and a guessed tyre. With --wanted, it
    says how to reach a wanted uncertainty with the least effort. With --run-sheet, it writes the tests in the order to
    run them, with instructions.
    """


@registered()
def report(
    folder: Path,
    theme: str = "light",
    png: bool = False,
    paper: bool = False,
    pdf: bool = False,
    standard: str = "",
    as_json: bool = False,  # noqa: ARG001 - of the answer
) -> Answer | None:
    """Make the figures and report.html again from the result tables, without reading the recordings.

    The report has the models and maps that fit and map have made of these tables since. With --standard, each
    requirement of a standard is met, not met or not stated, in a table and on a page of its own.
    """
    from fourpole.io.folders import results_in
    from fourpole.study.results import read_results

    folder = results_in(folder)
    results = read_results(folder)  # before matplotlib is loaded, so that a wrong name is said at once
    if standard:
        from fourpole.app.standard import run_standard

        return run_standard(results, folder, standard)
    from fourpole.app.report import run_report

    run_report(results, folder, theme, png=png, paper=paper, pdf=pdf)
    return None


@registered()
def export(folder: Path, kind: str, file: Path | None = None, *, asked: PointOptions, specimen: ShapeOptions) -> Answer:
    """Write the results for another tool, or a model for an FE program or a vehicle simulation.

    Results: a workbook, MATLAB, TYDEX 1.3, UFF 58 or NetCDF. Models: Abaqus, ANSYS, LS-DYNA or CSV; .tir and look-up
    tables, of maps too.
    """
    from fourpole.export import export_results
    from fourpole.fitting.inertia import belt_stated
    from fourpole.fitting.placed import operating_point

    exported = export_results(
        folder,
        kind,
        file,
        shape=specimen.shape,
        poisson=None if specimen.mode else specimen.poisson,
        points=tuple(operating_point(text) for text in asked.at or ()),
        specimen=asked.tyre,
        frequency=asked.frequency,
        radius=asked.radius,
        belt=belt_stated(asked.belt_mass, asked.belt_share),
    )
    for note in exported.notes:
        warn(note)
    return Answer(files=[(kind, exported.path)])


@registered("results.run_rig", browser=True)
def rig(folder: Path, as_json: bool = False) -> None:
    """The rig as found by the joint route: values of rig and sensors, as stated and as found, and what limits you.

    The command also says whether the rig as stated fits, what would explain a misfit, and which errors these data
    cannot show.
    """


@registered("results.run_compare")
def compare(
    first: Path,
    second: Path | None = None,
    specimens: tuple[str, str] | None = None,
    independent: bool = False,
    file: Path | None = None,
    page: Path | None = None,
    as_json: bool = False,
) -> None:
    """Compare two runs or two specimens: B less A over its uncertainty, where common errors cancel.

    K1, |K*|, loss angle, K', K'', K2 and C at each condition that both have, the largest ratio first. --page writes a
    page with a figure.
    """


@registered("twoport.run_twoport", browser=True)
def twoport(
    campaign: Path, folder: Path | None = None, workers: int | None = None, remote: bool = False, as_json: bool = False
) -> None:
    """All four poles of each specimen, k11, k12, k21 and k22, without a model of specimen or rig.

    It needs tests with two rigid blocks in place of the specimen (kind = calibration) and tests of the specimen with
    two added masses. Reciprocity, k12 = k21, is the check; a massless spring, a belt and a rod are held against the
    poles. Writes a table, a figure and UFF 58 for substructuring.
    """


@registered("results.run_lab")
def lab(folder: Path, place: Path | None = None, as_json: bool = False) -> None:
    """Gather all results below a folder into one Parquet data set, which DuckDB and polars read.

    Only results that have changed since are read again. docs/lab.md has the columns and queries: one specimen over the
    years, and two campaigns compared.
    """


@registered("standard.run_selftest")
def selftest(file: Path | None = None, laboratory: str = "", operator: str = "", as_json: bool = False) -> None:
    """Check this installation against reference data: formulas, recordings and whole campaigns, in about a minute.

    The values that the package carries were computed with 50 digits from physics that shares no code with it. Exit code
    0: all values pass; 3: some fail. Needs no network and writes nothing but the files of --out.
    """


@registered()
def plot(folder: Path, figure: str | None = None, file: Path | None = None, *, options: PlotOptions) -> Answer:
    """Draw one figure from the result tables: of all tests, or of a specimen, a condition or a test.

    With --over, the figure is any quantity over any axis: fourpole plot results K2 --over pressure.

    Example: fourpole plot results tr --pressure "2.1 bar" --size journal --out tr.png
    """
    from fourpole.io.folders import results_in
    from fourpole.study.results import read_results

    folder = results_in(folder)
    results = read_results(folder)  # before matplotlib is loaded, so that a wrong name is said at once
    from fourpole.app.report import run_plot

    return run_plot(results, folder, figure, file, options)


def main() -> None:
    """Run the command."""
    # Recordings are reduced in parallel; further threads of the linear algebra would compete with each other.
    for name in ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS"):
        os.environ.setdefault(name, "1")
    show_warnings()
    end_in_order()
    end_with_caller()
    app()


if __name__ == "__main__":
    main()
