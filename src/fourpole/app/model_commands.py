"""The commands on single tables and on models, as the command line has them."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Literal

from fourpole.answer import Answer
from fourpole.app.console import frequencies
from fourpole.app.group import registered

if TYPE_CHECKING:  # a command's annotations find these when it is built
    from fourpole.app.options import (
        DataOptions,
        FitOptions,
        RideOptions,
        RigOptions,
        Selection,
        ShiftOptions,
        TableChoice,
    )

#: As `fourpole.models.operating.Purpose`, which loads numpy.
Purpose = Literal["mean", "next", "specimen"]


@registered("tables.run_identify")
def identify(
    table: Path,
    k1: float | None = None,
    *,
    above: RigOptions,
    choice: TableChoice,
    file: Path | None = None,
    as_json: bool = False,
) -> None:
    """K*, K2, C and TR from a table of amplitudes or of K*, or from a frequency response in UFF.

    The table has a frequency and one of (R, I), (F1, V1 or x1, phase), (K', K''), (K', tan delta), (K', C), (|K*|, loss
    angle or tan delta), or the same of a modulus. Amplitudes are both 0 to peak, or both peak to peak; the phase is
    that of the force ahead.
    """


@registered("tables.run_static")
def static(table: Path, load: float, column: list[str] | None = None, group: str = "", as_json: bool = False) -> None:
    """Static stiffness K1 at a load from a load-deflection curve, with secant, loss and non-linearity.

    K1 is the tangent of the mean of the loading and unloading branches over the last complete cycle.
    """


@registered()
def predict(
    k1: float,
    k2: float,
    c: float,
    mass: float,
    preload_stiffness: float,
    frequency: str,
    preload_damping: float | None = None,
    file: Path | None = None,
    as_json: bool = False,  # noqa: ARG001 - of the answer
) -> Answer:
    """K*, R, I and TR that a tyre of known K1, K2 and C has on a rig."""
    from fourpole.app.tables import run_predict
    from fourpole.core.rig import Rig

    rig = Rig(mass, preload_stiffness, preload_damping or 0.0)
    return run_predict((k1, k2, c), rig, frequencies(frequency), file)


@registered("models.run_fit")
def fit(results: Path, model: str = "auto", *, options: FitOptions, as_json: bool = False) -> None:
    """Fit a causal model to K* of each tyre and condition, or choose one and say why.

    The fit is weighted with the whole covariance, with the errors of sensors that tests share, and includes K1 of the
    static test. Models are compared by BIC; AICc, the cross-validation error and parameters on a bound are shown too.
    If the data cannot separate two models, the text under the table says so.
    With --tyre, model.json of a folder keeps the models of other tyres.
    """


@registered("models.run_causality", browser=True)
def causality(results: Path, *, data: DataOptions, as_json: bool = False) -> None:
    """The smallest passive, linear specimen that can have K*: relaxing, with a mass, with resonances, or none of these.

    Sums of passive terms are compared with the data by their covariance, so the test also holds on a narrow band.
    Errors of one number, such as a delay of V1, are named beside it; and frequencies that no such specimen can have.
    """


@registered("models.run_map")
def map_(
    results: Path, model: str = "auto", *, data: Selection, file: Path | None = None, as_json: bool = False
) -> None:
    """Make the operating map of each tyre: a model's parameters as smooth surfaces over pressure and preload.

    Terms and link of the surfaces are chosen by the log predictive density of omitted conditions. Evaluate the map with
    fourpole query.
    """


@registered()
def query(
    model: Path,
    frequency: str,
    pressure: float | None = None,
    preload: float | None = None,
    temperature: float | None = None,
    amplitude: float | None = None,
    at: list[str] | None = None,
    tyre: str | None = None,
    purpose: Purpose | None = None,
    *,
    above: RigOptions,
    beyond: bool = False,
    file: Path | None = None,
    as_json: bool = False,
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
def shift(tables: list[Path], *, options: ShiftOptions, as_json: bool = False) -> None:
    """Shift isotherms onto one master curve by time-temperature superposition, and fit WLF and Arrhenius to the shifts.

    Each pair of neighbouring isotherms gets a verdict on its overlap. Fit a model to the master curve with fourpole
    fit; fourpole query --temperature then answers at any temperature of the isotherms.
    """


@registered(browser=True)
def verify(
    path: Path,
    quick: bool = False,
    campaign: Path | None = None,
    workers: int | None = None,
    copy: Path | None = None,
    remote: bool = False,
    as_json: bool = False,
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
    models: list[Path], road: str = "C", speed: float | None = None, *, options: RideOptions, as_json: bool = False
) -> None:
    """Drive a vehicle over a road on the tyres of models: comfort, wheel load and lost power, with their uncertainty.

    Tyres are compared with the first one; errors that they have in common cancel. The weighted acceleration is that of
    ISO 2631-1. Shown beside: what a spring and a constant damper instead of the model get wrong.
    """
