"""The command `fourpole`."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from fourpole.answer import Answer
from fourpole.app.console import end_in_order, out, show_warnings
from fourpole.app.events import end_with_caller
from fourpole.app.group import Group
from fourpole.io.kernel import said

if TYPE_CHECKING:
    from fourpole.app.options import PlotOptions, RunOptions, Wanted

app = typer.Typer(
    name="fourpole",
    cls=Group,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
    help="From recordings of tyre and elastomer rigs to the dynamic stiffness K* = K' + jK'', |K*| and loss angle, "
    "static stiffness K1, spring K2 and damper C, mobility and transmissibility, each with its uncertainty."
    "\n\nStart with fourpole demo, which makes a campaign folder to look at and analyses it; then fourpole analyse "
    'YOUR-FOLDER.\n\nQuantities are written with their unit, as in "12.44 kN/m". Exit codes: 0 all used, 2 the input '
    "could not be read, 3 done but some tests were rejected.",
)


def _version(shown: bool) -> None:
    if shown:
        out(said())
        raise typer.Exit


@app.callback()
def _root(
    show: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version.")
    ] = False,
) -> None:
    pass


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
    """Analyse campaigns, but for those whose results stand."""
    from fourpole.app.options import allow_remote
    from fourpole.app.standing import answer_of, results_of, run_each, settings_of, standing

    settings = settings_of(route, monte_carlo, wanted)
    allow_remote(options.remote)

    def run(campaign: Path) -> Answer:
        former = standing(campaign, results_of(campaign, folder), settings, verify=options.verify)
        if former is not None:
            return answer_of(former, stands=True)
        from fourpole.app.analysis import run_analysis  # its modules take a second to load

        return run_analysis(campaign, folder, route, monte_carlo, options, wanted, as_json=as_json)

    return run_each(campaigns, folder, run, as_json=as_json)


def report(
    folder: Path, theme: str = "light", png: bool = False, paper: bool = False, pdf: bool = False, standard: str = ""
) -> Answer:
    """Make figures and report again, or hold the results against a standard."""
    from fourpole.io.folders import results_in
    from fourpole.study.results import read_results

    folder = results_in(folder)
    results = read_results(folder)  # before matplotlib is loaded, so that a wrong name is said at once
    if standard:
        from fourpole.app.verify import run_standard

        return run_standard(results, folder, standard)
    from fourpole.app.report import run_report

    return run_report(results, folder, theme, png=png, paper=paper, pdf=pdf)


def plot(folder: Path, figure: str | None = None, file: Path | None = None, *, options: PlotOptions) -> Answer:
    """Draw one figure from the result tables."""
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
