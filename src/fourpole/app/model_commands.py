"""The commands on models, as the command line has them: fit, causality, map and query."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import typer

from fourpole.app.console import ends_well
from fourpole.app.options import JsonFlag, OutFile, rig_of_options
from fourpole.models.families import NAMES

__all__ = ["COMMANDS"]

Results = Annotated[
    Path, typer.Argument(metavar="RESULTS", help="Results folder, a dynamic.csv, or a table that identify wrote.")
]
OneTyre = Annotated[str | None, typer.Option(help="Only this tyre.")]
Band = Annotated[str | None, typer.Option(help='Only these frequencies, as "0.1:100 Hz".')]
Over = Annotated[list[str] | None, typer.Option(help='Further column that tells conditions apart, as "camber [deg]".')]
StdOfK = Annotated[str | None, typer.Option(help='Relative uncertainty of K*, in place of the table\'s, as "1 %".')]
KnownK1 = Annotated[str | None, typer.Option("--k1", help='Static stiffness, in place of the table\'s, as "180 kN/m".')]
StdK1 = Annotated[str | None, typer.Option("--std-k1", help='Of --k1; by default "2 %".')]


@ends_well
def fit(
    results: Results,
    model: Annotated[
        str,
        typer.Option(help=f"{NAMES}, or auto; where N may be left out, it is as large as helps."),
    ] = "auto",
    tyre: OneTyre = None,
    band: Band = None,
    over: Over = None,
    std: StdOfK = None,
    k1: KnownK1 = None,
    std_k1: StdK1 = None,
    fix: Annotated[list[str] | None, typer.Option(help='A parameter that is known, as "K1=180 kN/m".')] = None,
    share: Annotated[
        list[str] | None, typer.Option(help="A parameter that all conditions of a tyre have in common, as tau_1.")
    ] = None,
    file: Annotated[
        Path | None, typer.Option("--out", help="Model file to write; by default RESULTS/model.json of a folder.")
    ] = None,
    figure: Annotated[Path | None, typer.Option(help="Figure to write: .svg, .png or .pdf.")] = None,
    as_json: JsonFlag = False,
) -> None:
    """Fit a causal model to K* of each tyre and condition, or choose one and say why.

    Weighted with the whole covariance, errors of the sensors that tests share included, and K1 of the static test. By
    default models are compared by BIC; AICc, frequencies left out and parameters on a bound are shown too, and where
    the data cannot tell models apart, that is said.
    """
    from fourpole.app.models import DataOptions, run_fit

    data = DataOptions(tyre, band, tuple(over or ()), std, k1, std_k1)
    raise typer.Exit(run_fit(results, model, data, fix or [], share or [], file, figure, as_json=as_json))


@ends_well
def causality(
    results: Results,
    tyre: OneTyre = None,
    band: Band = None,
    over: Over = None,
    std: StdOfK = None,
    k1: KnownK1 = None,
    std_k1: StdK1 = None,
    as_json: JsonFlag = False,
) -> None:
    """Say whether any passive linear tyre can have the K* that was measured, and which frequencies it cannot.

    The best non-negative relaxation spectrum is held against the data's covariance: right on a narrow band too.
    """
    from fourpole.app.models import DataOptions, run_causality

    data = DataOptions(tyre, band, tuple(over or ()), std, k1, std_k1)
    raise typer.Exit(run_causality(results, data, as_json=as_json))


@ends_well
def map_(
    results: Results,
    model: Annotated[
        str, typer.Option(help="A model as for fit, or auto: the one that tells conditions left out best.")
    ] = "auto",
    tyre: OneTyre = None,
    band: Band = None,
    over: Over = None,
    file: Annotated[
        Path | None, typer.Option("--out", help="Map to write; by default RESULTS/map.json of a folder.")
    ] = None,
    as_json: JsonFlag = False,
) -> None:
    """Make the operating map of each tyre: a model's parameters as smooth surfaces over pressure and preload.

    Which surface is right is said by conditions left out one at a time. Ask it with fourpole query.
    """
    from fourpole.app.models import DataOptions, run_map

    raise typer.Exit(run_map(results, model, DataOptions(tyre, band, tuple(over or ())), file, as_json=as_json))


@ends_well
def query(
    model: Annotated[Path, typer.Argument(metavar="MODEL", help="Model file that map or fit wrote.")],
    frequency: Annotated[str, typer.Option(help='Frequencies, as "13.7 Hz" or "10:24:0.5 Hz".')],
    pressure: Annotated[str | None, typer.Option(help='As "1.85 bar".')] = None,
    preload: Annotated[str | None, typer.Option(help='As "1400 N".')] = None,
    temperature: Annotated[str | None, typer.Option(help='As "20 degC".')] = None,
    at: Annotated[list[str] | None, typer.Option(help='Value of a further axis, as "camber [deg] = 2".')] = None,
    tyre: Annotated[str | None, typer.Option(help="Which tyre, where the file knows several.")] = None,
    mass: Annotated[str | None, typer.Option(help='For TR, in place of the tests\' rig: as "15 kg".')] = None,
    preload_stiffness: Annotated[str | None, typer.Option(help='K3, as "12.44 kN/m".')] = None,
    preload_damping: Annotated[str | None, typer.Option(help='c3, as "20 N s/m".')] = None,
    beyond: Annotated[
        bool, typer.Option("--beyond", help="Answer outside what was measured too, and say how far outside it is.")
    ] = False,
    file: OutFile = None,
    as_json: JsonFlag = False,
) -> None:
    """K*, K1, K2, C and TR at an operating point and frequency, each with its uncertainty."""
    from fourpole.app.models import run_query, state_of

    state = state_of(pressure, preload, temperature, at or [])
    rig = rig_of_options(mass, preload_stiffness, preload_damping, no_rig=False)
    raise typer.Exit(run_query(model, state, frequency, tyre, rig, beyond=beyond, file=file, as_json=as_json))


#: By name, in the order of the help.
COMMANDS: dict[str, Callable[..., None]] = {"fit": fit, "causality": causality, "map": map_, "query": query}
