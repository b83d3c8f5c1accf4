"""The commands on single tables and on models, as the command line has them."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from fourpole.answer import Answer
from fourpole.app.console import frequencies
from fourpole.app.group import registered

if TYPE_CHECKING:  # a command's annotations find these when it is built
    from fourpole.app.options import (
        DataOptions,
        FitOptions,
        JsonFlag,
        OutFile,
        RemoteFlag,
        RideOptions,
        RigOptions,
        Selection,
        ShiftOptions,
        StaticStiffness,
        TableChoice,
        amount,
    )
    from fourpole.models.families import NAMES

#: As `fourpole.models.operating.Purpose`, which loads numpy.
Purpose = Literal["mean", "next", "specimen"]


@registered("tables.run_identify")
def identify(
    table: Annotated[Path, typer.Argument(metavar="TABLE", help="Table of any format, with a row per frequency.")],
    k1: Annotated[
        float | None, amount("--k1", "stiffness", 'Static stiffness, as "180 kN/m"; K2 and C need it.', "positive")
    ] = None,
    *,
    above: RigOptions,
    choice: TableChoice,
    file: OutFile = None,
    as_json: JsonFlag = False,
) -> None:
    """K*, K2, C and TR from a table of amplitudes or of K*, or from a frequency response in UFF.

    The table has a frequency and one of (R, I), (F1, V1 or x1, phase), (K', K''), (K', tan delta), (K', C), (|K*|, loss
    angle or tan delta), or the same of a modulus. Amplitudes are both 0 to peak, or both peak to peak; the phase is
    that of the force ahead.
    """


@registered("tables.run_static")
def static(
    table: Annotated[Path, typer.Argument(metavar="FILE", help="Table of load and deflection, of any format.")],
    load: Annotated[float, amount("--load", "force", 'Load at which K1 is wanted, as "1000 N".')],
    column: Annotated[
        list[str] | None, typer.Option(metavar="ROLE=NAME", help='Which column is what, as "load=ch7 [kN]".')
    ] = None,
    group: Annotated[str, typer.Option(help="The sheet or group of the file, if several hold a curve.")] = "",
    as_json: JsonFlag = False,
) -> None:
    """Static stiffness K1 at a load from a load-deflection curve, with secant, loss and non-linearity.

    K1 is the tangent of the mean of the loading and unloading branches over the last complete cycle.
    """


@registered()
def predict(
    k1: StaticStiffness,
    k2: Annotated[float, amount("--k2", "stiffness", 'Spring of the arm, as "120 kN/m".', "positive")],
    c: Annotated[float, amount("--c", "damping", 'Damper of the arm, as "700 N s/m".', "positive")],
    mass: Annotated[float, amount("--mass", "mass", 'Moving mass, as "15 kg".')],
    preload_stiffness: Annotated[
        float, amount("--preload-stiffness", "stiffness", 'Preload spring K3, as "12.44 kN/m".')
    ],
    frequency: Annotated[str, typer.Option(help='Frequencies, as "10:24:0.5 Hz" or "10,12,14 Hz".')],
    preload_damping: Annotated[
        float | None, amount("--preload-damping", "damping", 'Damper c3 beside it, as "20 N s/m".')
    ] = None,
    file: OutFile = None,
    as_json: JsonFlag = False,  # noqa: ARG001 - of the answer
) -> Answer:
    """K*, R, I and TR that a tyre of known K1, K2 and C has on a rig."""
    from fourpole.app.tables import run_predict
    from fourpole.core.rig import Rig

    rig = Rig(mass, preload_stiffness, preload_damping or 0.0)
    return run_predict((k1, k2, c), rig, frequencies(frequency), file)


Study = Annotated[
    Path, typer.Argument(metavar="RESULTS", help="Results folder, campaign's folder, or a table that identify wrote.")
]


@registered("models.run_fit")
def fit(
    results: Study,
    model: Annotated[str, typer.Option(help=f"{NAMES}, or auto; without :N the number of arms is chosen.")] = "auto",
    *,
    options: FitOptions,
    as_json: JsonFlag = False,
) -> None:
    """Fit a causal model to K* of each tyre and condition, or choose one and say why.

    The fit is weighted with the whole covariance, with the errors of sensors that tests share, and includes K1 of the
    static test. Models are compared by BIC; AICc, the cross-validation error and parameters on a bound are shown too.
    If the data cannot separate two models, the text under the table says so.
    With --tyre, model.json of a folder keeps the models of other tyres.
    """


@registered("models.run_causality", browser=True)
def causality(results: Study, *, data: DataOptions, as_json: JsonFlag = False) -> None:
    """The smallest passive, linear specimen that can have K*: relaxing, with a mass, with resonances, or none of these.

    Sums of passive terms are compared with the data by their covariance, so the test also holds on a narrow band.
    Errors of one number, such as a delay of V1, are named beside it; and frequencies that no such specimen can have.
    """


@registered("models.run_map")
def map_(
    results: Study,
    model: Annotated[
        str, typer.Option(help="A model as for fit, or auto: the causal one that predicts left-out tests best.")
    ] = "auto",
    *,
    data: Selection,
    file: Annotated[
        Path | None, typer.Option("--out", help="Map to write; by default RESULTS/map.json of a folder.")
    ] = None,
    as_json: JsonFlag = False,
) -> None:
    """Make the operating map of each tyre: a model's parameters as smooth surfaces over pressure and preload.

    Terms and link of the surfaces are chosen by the log predictive density of omitted conditions. Evaluate the map with
    fourpole query.
    """


@registered()
def query(
    model: Annotated[
        Path, typer.Argument(metavar="MODEL", help="Model file that map or fit wrote, or the campaign's folder.")
    ],
    frequency: Annotated[str, typer.Option(help='Frequencies, as "13.7 Hz" or "10:24:0.5 Hz".')],
    pressure: Annotated[float | None, amount("--pressure", "pressure", 'As "1.85 bar".')] = None,
    preload: Annotated[float | None, amount("--preload", "force", 'As "1400 N".')] = None,
    temperature: Annotated[float | None, amount("--temperature", "temperature", 'As "20 degC".')] = None,
    amplitude: Annotated[
        float | None, amount("--amplitude", "displacement", 'Of the deflection, 0-to-peak, as "0.5 mm".', "positive")
    ] = None,
    at: Annotated[list[str] | None, typer.Option(help='Value of a further axis, as "camber [deg] = 2".')] = None,
    tyre: Annotated[str | None, typer.Option(help="Which tyre, if the file has several.")] = None,
    purpose: Annotated[
        Purpose | None, typer.Option("--for", help="What u is for: the mean surface, the next mounting, this specimen.")
    ] = None,
    *,
    above: RigOptions,
    beyond: Annotated[
        bool, typer.Option("--beyond", help="Answer also outside the measured conditions, with the distance.")
    ] = False,
    file: OutFile = None,
    as_json: JsonFlag = False,
) -> Answer:
    """K*, K1, K2, C and TR at an operating point and frequency, each with its uncertainty.

    TR is of the rig of the tests, or of another rig if --mass and --preload-stiffness state one. The uncertainty is
    that of a new mounting of such a specimen (--for next, the default for maps), of the mean surface (--for mean), or
    of the specimen as it was mounted in the test at this condition (--for specimen).
    """
    from fourpole import quantities as q
    from fourpole.app.models import axis_values, run_query
    from fourpole.fitting.query import Query
    from fourpole.io.folders import model_in

    stated = {q.PRESSURE.head: pressure, q.PRELOAD.head: preload, q.TEMPERATURE.head: temperature}
    stated[q.DEFLECTION_AMPLITUDE.head] = amplitude
    state = {column: value for column, value in stated.items() if value is not None} | axis_values(at or [])
    asked = Query(frequencies(frequency), state, tyre, above.rig, beyond, purpose=purpose)
    return run_query(model_in(model), asked, file, as_json=as_json)


@registered("tables.run_shift")
def shift(
    tables: Annotated[
        list[Path],
        typer.Argument(metavar="TABLE...", help="Tables of isotherms: frequency, K*, E* or G*, and temperature."),
    ],
    *,
    options: ShiftOptions,
    as_json: JsonFlag = False,
) -> None:
    """Shift isotherms onto one master curve by time-temperature superposition, and fit WLF and Arrhenius to the shifts.

    Each pair of neighbouring isotherms gets a verdict on its overlap. Fit a model to the master curve with fourpole
    fit; fourpole query --temperature then answers at any temperature of the isotherms.
    """


@registered(browser=True)
def verify(
    path: Annotated[Path, typer.Argument(metavar="PATH", help="Results folder, campaign's folder, or a model file.")],
    quick: Annotated[bool, typer.Option("--quick", help="Compare hashes only; do not run the analysis again.")] = False,
    campaign: Annotated[
        Path | None, typer.Option(metavar="DIR", help="The campaign, if the results are not in its folder.")
    ] = None,
    workers: Annotated[
        int | None, typer.Option("--workers", metavar="N", min=1, help="Processes that read recordings.")
    ] = None,
    copy: Annotated[
        Path | None,
        typer.Option("--seal", metavar="NEW", help="Model file from before seals: write a sealed copy and verify it."),
    ] = None,
    remote: RemoteFlag = False,
    as_json: JsonFlag = False,
) -> Answer:
    """Check that results, or a model file, are as they were written, and that the analysis gives the same again.

    Of results: the recordings and statements by the hashes of study.json, the tables and models by theirs, and every
    table of a second run, cell by cell; nothing is written. Exit code 0: verified; 2: something is not the same, and
    the message names file, test and column; 3: nothing contradicts, but a part could not be checked.
    """
    from fourpole.io.folders import model_in, results_in

    if copy is None and (path.is_dir() or path.name == "study.json"):
        from fourpole.app.options import allow_remote
        from fourpole.app.verify import run_verify_results
        from fourpole.study.verified import folder_of

        allow_remote(remote)
        folder = folder_of(path) or results_in(path)
        return run_verify_results(folder, campaign, quick=quick, workers=workers)
    from fourpole.app.verify import run_verify

    return run_verify(model_in(path), copy, as_json=as_json)


@registered("ride.run_ride")
def ride(
    models: Annotated[
        list[Path], typer.Argument(metavar="MODEL...", help="Model files that fit or map wrote, or campaigns' folders.")
    ],
    road: Annotated[
        str, typer.Option(help='Class A to H, a file of distance and height, or as "cleat 10 mm, 50 mm".')
    ] = "C",
    speed: Annotated[float | None, amount("--speed", "velocity", 'As "60 km/h"; by default "80 km/h".')] = None,
    *,
    options: RideOptions,
    as_json: JsonFlag = False,
) -> None:
    """Drive a vehicle over a road on the tyres of models: comfort, wheel load and lost power, with their uncertainty.

    Tyres are compared with the first one; errors that they have in common cancel. The weighted acceleration is that of
    ISO 2631-1. Shown beside: what a spring and a constant damper instead of the model get wrong.
    """
