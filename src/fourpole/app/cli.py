"""The command `fourpole`."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated

import typer

from fourpole.app import model_commands
from fourpole.app.console import ends_well, option, out, progress, say
from fourpole.app.options import JsonFlag, OutFile, rig_of_options
from fourpole.export.kinds import ABOUT

__all__ = ["app", "main"]

app = typer.Typer(
    name="fourpole",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
    context_settings={"help_option_names": ["-h", "--help"]},
    help="From tyre-rig recordings to static stiffness K1, dynamic stiffness K2, damping C, mobility and "
    "transmissibility, with the uncertainty of every number.\n\nStart with [bold]fourpole demo[/bold], which makes a "
    "campaign folder to look at and analyses it; then [bold]fourpole analyse YOUR-FOLDER[/bold].\n\nQuantities are "
    'written with their unit, as in "12.44 kN/m". Exit codes: 0 all used, 2 the input could not be read, 3 done but '
    "some tests were rejected.",
)


def _version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        out(f"fourpole {version('fourpole')}")
        raise typer.Exit


@app.callback()
def _root(
    show: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version.")
    ] = False,
) -> None:
    pass


@app.command()
@ends_well
def demo(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Where to put the campaign.")] = Path("fourpole-demo"),
    seed: Annotated[int, typer.Option(help="Seed of the virtual rig's noise.")] = 1982,
    as_json: JsonFlag = False,
) -> None:
    """Make a campaign of the 1982 paper's kind on the virtual rig, analyse it, and say what was found."""
    from fourpole.app.analysis import run_demo

    raise typer.Exit(run_demo(folder, seed, as_json=as_json))


@app.command()
@ends_well
def simulate(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="New folder for the campaign.")],
    seed: Annotated[int, typer.Option(help="Seed of everything random.")] = 1982,
    clean: Annotated[bool, typer.Option("--clean", help="No noise, no errors: only the physics.")] = False,
) -> None:
    """Record a whole campaign on the virtual rigs: campaign.toml, tests.csv, recordings and truth.csv."""
    from fourpole.virtual import simulate_campaign

    with progress("recording") as advance:
        made = simulate_campaign(folder, seed=seed, clean=clean, progress=advance)
    say(f"{made.tests} tests recorded in {made.folder} (seed {made.seed}); next: fourpole analyse {made.folder}")


@app.command()
@ends_well
def init(
    folder: Annotated[Path, typer.Argument(metavar="FOLDER", help="Folder of recordings in any format.")],
    force: Annotated[bool, typer.Option("--force", help="Replace campaign.toml and tests.csv that are there.")] = False,
    as_json: JsonFlag = False,
) -> None:
    """Make a campaign of a bare folder of recordings: guess channels, kinds and conditions, and say each doubt.

    Names of files and folders, headers, notes beside them and the signals are read; campaign.toml and tests.csv are
    written for you to correct.
    """
    from fourpole.app.init import run_init

    raise typer.Exit(run_init(folder, force=force, as_json=as_json))


@app.command()
@ends_well
def analyse(
    campaign: Annotated[Path, typer.Argument(metavar="CAMPAIGN", help="Folder with campaign.toml and tests.csv.")],
    folder: Annotated[
        Path | None, typer.Option("--out", help="Folder for the results; by default CAMPAIGN/results.")
    ] = None,
    route: Annotated[
        str,
        typer.Option(
            help="How K* is found: joint (all tests of a rig together), mobility (F1, V1 and the rig), "
            "relative (F1, V1, V2), transmissibility (V1, V2 and the rig)."
        ),
    ] = "joint",
    monte_carlo: Annotated[
        int,
        typer.Option(
            metavar="N", min=0, max=10_000_000, help="Draws for intervals of K2 and C that are not normal; 0: none."
        ),
    ] = 10_000,
    tables_only: Annotated[bool, typer.Option("--tables-only", help="No figures and no report.")] = False,
    as_json: JsonFlag = False,
) -> None:
    """Analyse a campaign folder: recordings in; tables of K1, R, I, K*, K2, C and TR, figures and a report out.

    Recordings that are done are kept in the results' folder, so a run that was stopped goes on where it was.
    """
    from fourpole.app.analysis import run_analysis

    raise typer.Exit(run_analysis(campaign, folder, route, monte_carlo, tables_only=tables_only, as_json=as_json))


@app.command()
@ends_well
def check(
    campaign: Annotated[Path, typer.Argument(metavar="CAMPAIGN", help="Folder with campaign.toml and tests.csv.")],
    route: Annotated[str, typer.Option(help="The route it is to be analysed by; see analyse.")] = "joint",
    as_json: JsonFlag = False,
) -> None:
    """Look a campaign through without analysing it: files, channels, units, times, K1, duplicates.

    Says what would be rejected, where it stands and what to do; writes nothing.
    """
    from fourpole.app.check import run_check

    raise typer.Exit(run_check(campaign, route, as_json=as_json))


@app.command()
@ends_well
def info(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A recording in any format.")],
    channel: Annotated[str, typer.Option(help="Only this one, drawn large.")] = "",
    group: Annotated[str, typer.Option(help="Only the channels of this group.")] = "",
    quick: Annotated[bool, typer.Option("--quick", help="Read no samples: names, units and rates only.")] = False,
    no_plot: Annotated[bool, typer.Option("--no-plot", help="Numbers only.")] = False,
    as_json: JsonFlag = False,
) -> None:
    """Say what a file holds: its format, its channels with units, rates, ranges and gaps, and an outline of each.

    The line is the frequency that has most of a channel's variance. A file of many channels has the first 64 read;
    name a group or a channel for others.
    """
    from fourpole.app.info import Wanted, run_info

    raise typer.Exit(run_info(file, Wanted(channel, group, quick, not no_plot), as_json=as_json))


@app.command()
@ends_well
def convert(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A recording in any format.")],
    target: Annotated[
        Path,
        typer.Argument(
            metavar="OUT", help="Its ending says the format: .csv .parquet .mf4 .tdms .uff .unv .mat .h5 .wav .tdx .tyd"
        ),
    ],
    group: Annotated[str, typer.Option(help="Only the channels of this group.")] = "",
    channels: Annotated[str, typer.Option(help="Only these, with commas between.")] = "",
    window: Annotated[str, typer.Option(help='Only these times in seconds, as "2..12".')] = "",
    kind: Annotated[str, typer.Option("--to", metavar="KIND", help="The format, where no ending says it.")] = "",
    force: Annotated[bool, typer.Option("--force", help="Replace OUT if it is there.")] = False,
) -> None:
    """Write a recording in another format, with its units, times and groups, every sample as it is.

    What the format cannot keep is said; where it cannot hold the recording at all, nothing is written.
    """
    from fourpole.app.convert import run_convert
    from fourpole.io.convert import Choice

    names = tuple(name.strip() for name in channels.split(",") if name.strip())
    run_convert(file, target, Choice(group, names, _window(window), kind, force))


def _window(text: str) -> tuple[float, float] | None:
    """Two times with two dots between them."""
    from fourpole.errors import UnitError

    if not text:
        return None
    try:
        low, high = (float(part) for part in text.split(".."))
    except ValueError:
        low, high = 1.0, 0.0
    if not low < high:
        raise UnitError(f"--window: {text!r} is not two times in seconds with two dots, as 2..12")
    return low, high


@app.command()
@ends_well
def identify(
    table: Annotated[Path, typer.Argument(metavar="TABLE", help="Text table with a row per frequency.")],
    k1: Annotated[str, typer.Option("--k1", help='Static stiffness, as "180 kN/m".')],
    mass: Annotated[str | None, typer.Option(help='Moving mass of the rig, as "15 kg".')] = None,
    preload_stiffness: Annotated[str | None, typer.Option(help='Preload spring K3, as "12.44 kN/m".')] = None,
    preload_damping: Annotated[str | None, typer.Option(help='Damper c3 beside it, as "20 N s/m".')] = None,
    no_rig: Annotated[
        bool, typer.Option("--no-rig", help="The specimen's far side does not move: nothing to take away.")
    ] = False,
    file: OutFile = None,
    as_json: JsonFlag = False,
) -> None:
    """K*, K2, C and TR from a table of amplitudes: the paper's FORTRAN program.

    The table has a frequency and one of (R, I), (F1, V1, phase), (F1, x1, phase) or (Re K*, Im K*), amplitudes 0 to
    peak and the phase that of the force ahead of the motion. CSV or white space; units in brackets or in a second row.
    """
    from fourpole.app.reduced import run_identify

    rig = rig_of_options(mass, preload_stiffness, preload_damping, no_rig=no_rig)
    known = no_rig or rig is not None
    raise typer.Exit(run_identify(table, option(k1, "stiffness", "--k1"), rig, file, rig_known=known, as_json=as_json))


@app.command()
@ends_well
def static(
    table: Annotated[Path, typer.Argument(metavar="FILE", help="Text table of load and deflection.")],
    load: Annotated[str, typer.Option("--load", help='Load at which K1 is wanted, as "1000 N".')],
    load_column: Annotated[str | None, typer.Option(help="Name of the load's column, if it is unusual.")] = None,
    deflection_column: Annotated[str | None, typer.Option(help="Name of the deflection's column.")] = None,
    as_json: JsonFlag = False,
) -> None:
    """Static stiffness K1 at a load from a load-deflection curve, with secant, loss and non-linearity.

    K1 is the tangent of the mean of the loading and unloading branches over the last complete cycle.
    """
    from fourpole.app.reduced import run_static

    run_static(table, option(load, "force", "--load"), load_column, deflection_column, as_json=as_json)


@app.command()
@ends_well
def predict(
    k1: Annotated[str, typer.Option("--k1", help='Static stiffness, as "180 kN/m".')],
    k2: Annotated[str, typer.Option("--k2", help='Spring of the arm, as "120 kN/m".')],
    c: Annotated[str, typer.Option("--c", help='Damper of the arm, as "700 N s/m".')],
    mass: Annotated[str, typer.Option(help='Moving mass, as "15 kg".')],
    preload_stiffness: Annotated[str, typer.Option(help='Preload spring K3, as "12.44 kN/m".')],
    frequency: Annotated[str, typer.Option(help='Frequencies, as "10:24:0.5 Hz" or "10,12,14 Hz".')],
    preload_damping: Annotated[str | None, typer.Option(help='Damper c3 beside it, as "20 N s/m".')] = None,
    file: OutFile = None,
    as_json: JsonFlag = False,
) -> None:
    """K*, R, I and TR that a tyre of known K1, K2 and C shows on a rig."""
    from fourpole.app.reduced import run_predict

    arm = (option(k1, "stiffness", "--k1"), option(k2, "stiffness", "--k2"), option(c, "damping", "--c"))
    rig = rig_of_options(mass, preload_stiffness, preload_damping, no_rig=False)
    assert rig is not None  # both of its values are required options
    run_predict(arm, rig, frequency, file, as_json=as_json)


@app.command()
@ends_well
def plan(
    campaign: Annotated[
        Path | None, typer.Argument(metavar="CAMPAIGN", help="Folder with campaign.toml and tests.csv; or none.")
    ] = None,
    k1: Annotated[str | None, typer.Option("--k1", "--K1", help='Guessed K1, as "180 kN/m".')] = None,
    k2: Annotated[str | None, typer.Option("--k2", "--K2", help='Guessed K2, as "120 kN/m".')] = None,
    c: Annotated[str | None, typer.Option("--c", "--C", help='Guessed C, as "700 N s/m".')] = None,
    wanted: Annotated[str | None, typer.Option(help='Wanted uncertainty of K2 and C, as "1 %": gives advice.')] = None,
    added_mass: Annotated[
        list[str] | None, typer.Option(help='Mass to look at, as "10 kg"; may be repeated. By default 2, 5, 10, 20 kg.')
    ] = None,
    run_sheet: Annotated[
        Path | None, typer.Option(help="Write a tests.csv in the order to run, with the masses of --added-mass.")
    ] = None,
    repeats: Annotated[int, typer.Option(help="How often the run sheet has each test.")] = 1,
    seed: Annotated[int, typer.Option(help="Seed of the run sheet's order.")] = 1982,
    noise: Annotated[
        str | None, typer.Option(help='Relative uncertainty of an amplitude at 40 cycles; by default "0.01 %".')
    ] = None,
    cycles: Annotated[int | None, typer.Option(help="Cycles per test; by default 40.")] = None,
    eccentricity: Annotated[str | None, typer.Option(help='Amplitude of the contact; by default "1 mm".')] = None,
    std_k1: Annotated[str | None, typer.Option("--std-k1", help='Of K1; by default "2 %", or as found.')] = None,
    mass: Annotated[str | None, typer.Option("--mass", "--moving-mass", help='Without a campaign: as "15 kg".')] = None,
    preload_stiffness: Annotated[str | None, typer.Option(help='Without a campaign: K3, as "12.44 kN/m".')] = None,
    preload_damping: Annotated[str | None, typer.Option(help='Without a campaign: c3, as "20 N s/m".')] = None,
    frequency: Annotated[
        str | None, typer.Option("--frequency", "--frequencies", help='Without a campaign: as "10:24:2 Hz".')
    ] = None,
    preload: Annotated[str | None, typer.Option(help='Without a campaign: load on the tyre, as "1000 N".')] = None,
    std_rig: Annotated[
        str | None, typer.Option(help='Without a campaign: of each rig value; by default "2 %".')
    ] = None,
    std_gain: Annotated[str | None, typer.Option(help='Without a campaign: of each gain; by default "1 %".')] = None,
    std_phase: Annotated[
        str | None, typer.Option(help='Without a campaign: of each phase; by default "0.5 deg".')
    ] = None,
    folder: Annotated[
        Path | None, typer.Option("--out", help="Folder for table and figure; by default CAMPAIGN/plan.")
    ] = None,
    as_json: JsonFlag = False,
) -> None:
    """Before testing: the uncertainty of K*, K2 and C to expect by each route, with and without an added mass.

    For a campaign whose recordings need not exist yet, or for a rig and a guessed tyre. With --wanted, what reaches a
    wanted uncertainty at least effort; with --run-sheet, the tests in the order to run them, with instructions.
    """
    from fourpole.app.plan import PlanOptions, run_plan

    options = PlanOptions(
        k1, k2, c, mass, preload_stiffness, preload_damping, frequency, preload, std_rig, std_gain, std_phase, std_k1,
        noise, cycles, eccentricity, tuple(added_mass or ()), wanted, repeats, seed,
    )  # fmt: skip
    run_plan(campaign, options, folder, run_sheet, as_json=as_json)


@app.command()
@ends_well
def report(
    folder: Annotated[Path, typer.Argument(metavar="RESULTS", help="Results folder that analyse wrote.")],
    theme: Annotated[str, typer.Option(help="Colours of the figures: light, dark or print.")] = "light",
) -> None:
    """Make the figures and report.html again from the result tables, without reading the recordings."""
    from fourpole.app.report import run_report

    run_report(folder, theme)


@app.command()
@ends_well
def export(
    folder: Annotated[Path, typer.Argument(metavar="SOURCE", help="Results folder that analyse wrote.")],
    kind: Annotated[str, typer.Option("--to", metavar="KIND", help=f"{ABOUT}.")],
    file: Annotated[
        Path | None,
        typer.Option("--out", help="File to write, of tydex a folder; by default in SOURCE."),
    ] = None,
) -> None:
    """Write the results for another tool: a workbook with charts, MATLAB, TYDEX 1.3, UFF 58 or NetCDF."""
    from fourpole.app.export import run_export

    run_export(folder, kind, file)


for name, command in model_commands.COMMANDS.items():
    app.command(name)(command)


@app.command()
@ends_well
def rig(
    folder: Annotated[Path, typer.Argument(metavar="RESULTS", help="Results folder that analyse wrote.")],
    as_json: JsonFlag = False,
) -> None:
    """The rig and the sensors as stated and as the joint route found them, and what limits you.

    Says too whether the rig as stated fits, what would explain a misfit, and which errors these data cannot show.
    """
    from fourpole.app.rig import run_rig

    run_rig(folder, as_json=as_json)


@app.command()
@ends_well
def plot(
    folder: Annotated[Path, typer.Argument(metavar="RESULTS", help="Results folder that analyse wrote.")],
    figure: Annotated[str, typer.Argument(metavar="FIGURE", help="Its name, as fig05 or nyquist.")],
    file: Annotated[Path | None, typer.Option("--out", help="File to write: .svg, .png or .pdf.")] = None,
    theme: Annotated[str, typer.Option(help="Colours: light, dark or print.")] = "light",
    xlim: Annotated[str | None, typer.Option(help='Limits of the abscissa in its unit, as "10:24".')] = None,
    ylim: Annotated[str | None, typer.Option(help='Limits of the ordinate in its unit, as "0:3".')] = None,
) -> None:
    """Draw one figure from the result tables."""
    from fourpole.app.report import run_plot
    from fourpole.plot import Style

    style = Style(theme, xlim=_limits(xlim, "--xlim"), ylim=_limits(ylim, "--ylim"))
    run_plot(folder, figure, file, style)


def _limits(text: str | None, name: str) -> tuple[float, float] | None:
    """Two numbers with a colon between them."""
    if text is None:
        return None
    try:
        low, high = (float(part) for part in text.split(":"))
    except ValueError:
        raise typer.BadParameter(f"{text!r} is not two numbers with a colon, as 10:24", param_hint=name) from None
    return low, high


def main() -> None:
    """Run the command."""
    # Recordings are worked on side by side; a linear algebra that splits each small product again only gets in the way.
    for name in ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS"):
        os.environ.setdefault(name, "1")
    app()
