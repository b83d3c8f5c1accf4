"""Options of the commands: how a quantity is read, and the groups of options that several commands have.

A group is a dataclass with one field per option. `command` puts the fields of each group on the command line. Groups
have no `__repr__` and `__eq__`, which every command would wait for.
"""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, field, fields, is_dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, get_type_hints

import typer

from fourpole.app.console import Sign, fail, option, run_to_exit
from fourpole.errors import RigError, UnitError
from fourpole.export.kinds import ABOUT  # noqa: F401 - named in the help of export
from fourpole.models.families import NAMES  # noqa: F401 - named in the help of fit

if TYPE_CHECKING:
    from fourpole.core.rig import Rig
    from fourpole.io.tables.kstar import TableOptions
    from fourpole.models.shape import Shape
    from fourpole.quantities import ShownUnits

JsonFlag = Annotated[bool, typer.Option("--json", help="Print one JSON document, in SI units, for programs.")]
OutFile = Annotated[Path | None, typer.Option("--out", help="Write the table to this CSV file instead of printing it.")]

CampaignFolder = Annotated[Path, typer.Argument(metavar="CAMPAIGN", help="Folder with campaign.toml and tests.csv.")]
ResultsFolder = Annotated[
    Path, typer.Argument(metavar="RESULTS", help="Results folder that analyse wrote, or the campaign's folder.")
]
_REMOTE = "Read recordings that tests.csv names by s3://, with your credentials."
RemoteFlag = Annotated[bool, typer.Option("--remote", help=_REMOTE)]
NamePatterns = Annotated[
    list[str] | None,
    typer.Option(
        "--pattern",
        metavar="PATTERN",
        help="What the names state, instead of a guess: {specimen}_{pressure}bar_{frequency}Hz; / for folders, {} for "
        "anything. May be given several times: the first that matches counts.",
    ),
]


def allow_remote(wanted: bool) -> None:
    """Allow this process and its children to read all recordings that a statement names by URL, if that is wanted."""
    if wanted:
        from fourpole.io.remote import EVERY, allow

        allow(EVERY)


def amount(name: str, kind: str, text: str, sign: Sign = "any") -> Any:
    """Option that takes a quantity with its unit and gives it in SI."""
    return typer.Option(name, parser=_reader(kind, name, sign), metavar="QUANTITY", help=text)


class Amount(float):
    """A quantity of the command line in SI, which knows its kind and the text of its unit."""

    kind: str
    unit: str


def _reader(kind: str, name: str, sign: Sign) -> Callable[[str], float]:
    def quantity(written: str) -> float:
        from fourpole.units import unit_in

        try:
            found = Amount(option(written, kind, name, sign))
            found.kind, found.unit = kind, unit_in(written)
        except UnitError as error:
            fail(str(error))
        return found

    return quantity


StaticStiffness = Annotated[float, amount("--k1", "stiffness", 'Static stiffness, as "180 kN/m".', "positive")]


def answered_in(units: ShownUnits, *asked: float | None) -> ShownUnits:
    """The units of an answer: those of the question, and otherwise the given ones."""
    from fourpole.quantities import ShownUnits
    from fourpole.units import si_unit, unit_scale

    wanted = dict(units.wanted)
    for one in reversed(asked):
        if isinstance(one, Amount) and one.kind != "temperature":
            wanted[si_unit(one.kind)] = one.unit, unit_scale(one.unit, one.kind)
    return ShownUnits(wanted)


def command(run: Callable[..., int | None]) -> Callable[..., None]:
    """Function for the command line, with the fields of each group as options, that ends with one message at most.

    Parameters
    ----------
    run : callable
        The command. It returns its exit code; None stands for 0. Its annotations may name what this module defines.
    """
    signature = inspect.signature(run, eval_str=True, locals=globals())
    groups: dict[str, Any] = {
        n: one.annotation for n, one in signature.parameters.items() if is_dataclass(one.annotation)
    }
    parameters: list[inspect.Parameter] = []
    for name, parameter in signature.parameters.items():
        if name in groups:
            parameters += _options_of(groups[name])
        else:
            parameters.append(parameter.replace(kind=parameter.KEYWORD_ONLY))

    @functools.wraps(run)
    def grouped(**given: Any) -> None:
        for name, group in groups.items():
            given[name] = group(**{one.name: given.pop(one.name) for one in fields(group)})
        run_to_exit(run, **given)

    grouped.__annotations__ = {one.name: one.annotation for one in parameters}
    grouped.__signature__ = signature.replace(parameters=parameters, return_annotation=None)  # type: ignore[attr-defined]
    return grouped


def _options_of(group: type[Any]) -> Iterator[inspect.Parameter]:
    """One parameter for each field of a group."""
    types = get_type_hints(group)
    for one in fields(group):
        shown = one.metadata["option"]
        yield inspect.Parameter(one.name, inspect.Parameter.KEYWORD_ONLY, default=shown, annotation=types[one.name])


def _given(text: str, *names: str, default: Any = None, **more: Any) -> Any:
    """Field of a group for an option with this help."""
    return field(default=default, metadata={"option": typer.Option(default, *names, help=text, **more)})


def _amount(name: str, kind: str, text: str, sign: Sign = "any") -> Any:
    """Field of a group for a quantity; see `amount`."""
    return _given(text, name, parser=_reader(kind, name, sign), metavar="QUANTITY")


def _belt() -> tuple[Any, Any]:
    """Fields of a group for a belt in place of that of the model file: its mass and its share."""
    mass = 'Belt between the springs of the tyre, as "7 kg"; by default that of the model file; "0 kg": none.'
    share = "With --belt-mass: stiffness between contact and belt over that between belt and rim; by default 0.2."
    return _amount("--belt-mass", "mass", mass, "not negative"), _given(share, "--belt-share")


@dataclass(frozen=True, repr=False, eq=False)
class RigOptions:
    """The rig above the tyre [kg], [N/m], [N s/m]; None where an option is not given."""

    mass: float | None = _amount("--mass", "mass", 'Moving mass of the rig, as "15 kg".')
    preload_stiffness: float | None = _amount("--preload-stiffness", "stiffness", 'Preload spring K3, as "12.44 kN/m".')
    preload_damping: float | None = _amount("--preload-damping", "damping", 'Damper c3 beside K3, as "20 N s/m".')

    @property
    def rig(self) -> Rig | None:
        """The rig; None if no option is given."""
        from fourpole.core.rig import Rig

        if all(value is None for value in asdict(self).values()):
            return None
        if self.mass is None or self.preload_stiffness is None:
            raise RigError("the rig needs both --mass and --preload-stiffness")
        return Rig(self.mass, self.preload_stiffness, self.preload_damping or 0.0)


@dataclass(frozen=True, repr=False, eq=False)
class RunOptions:
    """Where the recordings are reduced, and which of them are read again."""

    workers: int | None = _given(
        "Processes that reduce the recordings; 1: this one alone. By default as many as pay.", metavar="N", min=1
    )
    scheduler: str | None = _given('A running Dask cluster to use, as "tcp://10.0.0.5:8786".')
    time_limit: float | None = _amount(
        "--time-limit",
        "time",
        'Processor time after which a recording is given up, as "60 s"; 1 s more per MB.',
        "positive",
    )
    verify: bool = _given(
        "Hash every recording, even if its size, time and inode are as noted.", "--verify", default=False
    )
    remote: bool = _given(_REMOTE, "--remote", default=False)


@dataclass(frozen=True, repr=False, eq=False)
class Wanted:
    """What an analysis writes besides its tables."""

    tables_only: bool = _given(
        "No figures and no report; those of other tables are deleted.", "--tables-only", default=False
    )
    models: bool | None = _given(
        "Choose a model for each tyre, as fit does; by default if that takes seconds, or keep those of the folder.",
        "--models/--no-models",
    )
    png: bool = _given("Write each figure as PNG, too.", "--png", default=False)


@dataclass(frozen=True, repr=False, eq=False)
class InfoOptions:
    """The channels of a file to show, and how."""

    channel: str = _given("Only this channel, with a large outline.", default="")
    group: str = _given("Only the channels of this group.", default="")
    quick: bool = _given("Read no samples: names, units and rates only.", "--quick", default=False)
    no_plot: bool = _given("Numbers only, without outlines.", "--no-plot", default=False)


@dataclass(frozen=True, repr=False, eq=False)
class TableChoice:
    """What a table of K* does not say, as text: its columns and units, its sheet, and the shape of the specimen."""

    column: list[str] | None = _given(
        'Which column is what, as "storage=G\' [kPa]" or "phase=3 [deg]"; may be repeated.', metavar="ROLE=NAME"
    )
    group: str = _given("The sheet or group of the file, if several hold such a table; '*': all together.", default="")
    averages: float | None = _given("Number of independent averages, for the uncertainty by the coherence.")
    shape_factor: str | None = _given('K* per modulus, for a table of G* or E*, as "0.05 m".')
    mode: str | None = _given("With --height and --area: shear (K = G A/h) or compression (K = E A/h).")
    height: str | None = _given('Height of the specimen, as "10 mm".')
    area: str | None = _given('Loaded area of the specimen, as "5 cm^2".')
    bonded: str | None = _given("disc: a disc bonded to rigid plates, in compression.")

    no_rig: bool = _given("The specimen's far side does not move: V1/F1 is its own.", "--no-rig", default=False)

    def table(self, *, rig: bool = False) -> TableOptions:
        """The options of a table; V1/F1 may be taken if the rig is stated (`rig`), or if there is none."""
        from fourpole.io.tables.kstar import TableOptions
        from fourpole.models.shape import shape_of

        stated = {name: text for name in ("mode", "height", "area", "bonded") if (text := getattr(self, name))}
        if stated and self.mode is None:
            raise UnitError("--mode compression or --mode shear says what the height and the area are of: state it")
        if stated and self.shape_factor is not None:
            raise UnitError("--shape-factor and --mode both say how K* follows from a modulus: keep one")
        if self.averages is not None and not self.averages >= 1:
            raise UnitError("--averages: there is at least one average")
        factor = None
        if self.shape_factor is not None:
            factor = option(self.shape_factor, "length", "--shape-factor", "positive")
        columns, shape = tuple(self.column or ()), shape_of(stated)
        return TableOptions(columns, self.group, factor, shape, ratio=rig or self.no_rig, averages=self.averages)


@dataclass(frozen=True, repr=False, eq=False)
class Selection(TableChoice):
    """The tests of a results folder or table to use, as text."""

    tyre: str | None = _given("Only this tyre.")
    band: str | None = _given('Only these frequencies, as "0.1:100 Hz".')
    over: list[str] | None = _given('Further column whose values are separate conditions, as "camber [deg]".')


@dataclass(frozen=True, repr=False, eq=False)
class DataOptions(Selection):
    """The tests to use, with an uncertainty of K* and a static stiffness in place of the table's, as text."""

    std: str | None = _given('Relative uncertainty of K*, in place of the table\'s, as "1 %".')
    k1: str | None = _given('Static stiffness, in place of the table\'s, as "180 kN/m".', "--k1")
    std_k1: str | None = _given('Relative uncertainty of --k1; by default "2 %".', "--std-k1")
    of: str | None = _given("What K* is of: springs, driving point (default), or blocked transfer.", "--of")


@dataclass(frozen=True, repr=False, eq=False)
class FitOptions(DataOptions):
    """The tests to fit, the fixed and shared parameters, and the files to write."""

    fix: list[str] | None = _given('A known parameter, as "K1=180 kN/m"; it is not fitted.')
    share: list[str] | None = _given("A parameter with one value for all conditions of a tyre, as tau_1.")
    static: str | None = _given("K1 of the static test: rest, at zero frequency (default), or ramp, at its own rate.")
    std_static: str | None = _given('For ramp: u of the factor by which K1 differs at its amplitude; by default "5 %".')
    file: Path | None = _given("Model file to write; by default RESULTS/model.json of a folder.", "--out")
    figure: Path | None = _given("Figure to write: .svg, .png or .pdf.")


@dataclass(frozen=True, repr=False, eq=False)
class ShiftOptions(TableChoice):
    """The isotherms to shift, how they are shifted, and what to write."""

    reference: float | None = _amount(
        "--reference", "temperature", 'Reference temperature, of one isotherm, as "20 degC"; by default the middle one.'
    )
    vertical: bool = _given("Also fit vertical shift factors bT.", "--vertical", default=False)
    apart: str | None = _given('Largest difference of temperatures of one isotherm; by default "1 K".')
    constants_at: float | None = _amount(
        "--constants-at", "temperature", 'Also state the WLF constants for this reference temperature, as "-60 degC".'
    )
    tyre: str | None = _given("Only this specimen.")
    std: float | None = _amount(
        "--std", "ratio", 'Relative uncertainty of K*, in place of the table\'s, as "1 %".', "positive"
    )
    folder: Path | None = _given("Folder for the master curve, its law, tables and figure.", "--out")


@dataclass(frozen=True, repr=False, eq=False)
class RideOptions:
    """The vehicle, the operating points of the tyres, and how a ride in time is run."""

    vehicle: str = _given("golden-car, large-car, or a TOML file.", default="golden-car")
    at: list[str] | None = _given('Operating point, as "pressure=1.7 bar, preload=3 kN"; a repeated option adds one.')
    tyre: str | None = _given("Only this tyre of each file.")
    beyond: bool = _given("Go also outside the measured conditions.", "--beyond", default=False)
    duration: float | None = _amount(
        "--duration", "time", 'Ride over a road class in time, as "60 s", for crest factor and dose.', "positive"
    )
    seed: int = _given("Seed of a road class in time.", default=1)
    step: float | None = _amount(
        "--step",
        "time",
        'Time step; by default "0.5 ms", shorter with lift-off or for a road of closer points.',
        "positive",
    )
    lift_off: bool = _given("Wheels may leave the road.", "--lift-off", default=False)
    curve: Path | None = _given("Load-deflection curve in place of a straight static load; with lift-off.")
    column: list[str] | None = _given(
        'Which column of a road or a curve is what, as "height=z [mm]" or "load=F [N]"; may be repeated.'
    )
    belt_mass: float | None = _belt()[0]
    belt_share: float | None = _belt()[1]
    folder: Path | None = _given("Folder for table, document and figure.", "--out")


@dataclass(frozen=True, repr=False, eq=False)
class PlotOptions:
    """What a figure shows, as text, and how it looks; a repeated option names several."""

    over: str | None = _given(
        "FIGURE is a quantity, as K2, TR or 'loss factor', and is shown over this axis: frequency, pressure, preload, "
        "temperature, amplitude or order, the order of the tests."
    )
    specimen: list[str] | None = _given("Only this specimen.", "--specimen", "--tyre")
    pressure: list[str] | None = _given('Only tests at this pressure, as "2.1 bar".')
    preload: list[str] | None = _given('Only tests at this preload, as "1000 N".')
    temperature: list[str] | None = _given('Only tests at this temperature, as "23 degC".')
    test: list[str] | None = _given("Only this test, as D12.")
    size: str = _given("report, journal (one column), slide, or width x height as 89x60 mm.", default="report")
    dpi: int | None = _given("Dots per inch of a PNG; by default 150, for a journal 300.")
    theme: str = _given("Colours of the figure: light, dark or print.", default="light")
    colour: list[str] | None = _given("Colour of a specimen, as radial=#0072b2.")
    label: list[str] | None = _given('Text in place of the name of a specimen, as radial="Tyre A".')
    xlim: str | None = _given('Limits of the abscissa in its unit, as "10:24".')
    ylim: str | None = _given('Limits of the ordinate in its unit, as "0:3".')
    paper: bool = _given("Without FIGURE: draw all figures of the 1982 paper.", "--paper", default=False)


@dataclass(frozen=True, repr=False, eq=False)
class PlanOptions:
    """A guessed tyre in SI, how its tests are run, and the advice and run sheet to make."""

    k1: float | None = _amount("--k1", "stiffness", 'Guessed K1, as "180 kN/m".', "positive")
    k2: float | None = _amount("--k2", "stiffness", 'Guessed K2, as "120 kN/m".', "positive")
    c: float | None = _amount("--c", "damping", 'Guessed C, as "700 N s/m".', "positive")
    wanted: float | None = _amount("--wanted", "ratio", 'Uncertainty of K2 and C to reach, as "1 %".', "positive")
    added_mass: list[float] | None = _amount(
        "--added-mass",
        "mass",
        'Added mass to try, as "10 kg"; may be repeated. By default 2, 5, 10, 20 kg.',
        "positive",
    )
    run_sheet: Path | None = _given("Write a tests.csv in the order to run, with the masses of --added-mass.")
    repeats: int = _given("How often the run sheet has each test.", default=1)
    seed: int = _given("Seed of the run sheet's order.", default=1982)
    noise: float | None = _amount(
        "--noise", "ratio", 'Relative uncertainty of an amplitude at 40 cycles; by default "0.01 %".', "not negative"
    )
    cycles: int | None = _given("Cycles per test; by default 40.")
    eccentricity: float | None = _amount(
        "--eccentricity", "displacement", 'Amplitude of the contact; by default "1 mm".', "positive"
    )
    std_k1: float | None = _amount(
        "--std-k1", "ratio", 'Relative uncertainty of K1; by default "2 %", or as found.', "not negative"
    )


def _bare(name: str, kind: str, text: str, sign: Sign = "any") -> Any:
    return _amount(name, kind, f"Without a campaign: {text}.", sign)


@dataclass(frozen=True, repr=False, eq=False)
class BareRig:
    """The options of a plan without a campaign, which states the same itself, in SI; None where not given."""

    mass: float | None = _bare("--mass", "mass", 'as "15 kg"')
    preload_stiffness: float | None = _bare("--preload-stiffness", "stiffness", 'K3, as "12.44 kN/m"')
    preload_damping: float | None = _bare("--preload-damping", "damping", 'c3, as "20 N s/m"')
    frequency: str | None = _given('Without a campaign: as "10:24:2 Hz".', "--frequency")
    preload: float | None = _bare("--preload", "force", 'load on the tyre, as "1000 N"', "positive")
    std_rig: float | None = _bare("--std-rig", "ratio", 'of each rig value; by default "2 %"', "not negative")
    std_gain: float | None = _bare("--std-gain", "ratio", 'of each gain; by default "1 %"', "not negative")
    std_phase: float | None = _bare("--std-phase", "angle", 'of each phase; by default "0.5 deg"', "not negative")


@dataclass(frozen=True, repr=False, eq=False)
class ShapeOptions:
    """The shape of a specimen, for moduli in place of stiffnesses, as text; by default that of the model file."""

    mode: str | None = _given("For moduli, if the model file states no shape: compression or shear.", "--mode")
    height: str | None = _given('Height of the specimen, as "10 mm".')
    area: str | None = _given('Loaded area of the specimen, as "5 cm^2".')
    poisson: float | None = _given("Poisson's ratio, as 0.499; without --mode, of the shape in the model file.")
    bonded: str | None = _given("disc: a disc bonded to rigid plates, in compression.")
    bulk: str | None = _given("elastic or relaxing bulk modulus.")

    @property
    def shape(self) -> Shape | None:
        """The shape; None if no option is given."""
        from fourpole.models.shape import shape_of

        stated = {name: value for name, value in asdict(self).items() if value is not None}
        if self.mode is None and stated.keys() - {"poisson"}:
            raise UnitError("--mode compression or --mode shear says what the height and the area are of: state it")
        return shape_of(stated)


@dataclass(frozen=True, repr=False, eq=False)
class PointOptions:
    """Which models of a file are exported, and what a format needs besides."""

    at: list[str] | None = _given('Operating point, as "pressure=1.7 bar, preload=3 kN"; a repeated option adds one.')
    tyre: str | None = _given("Only this specimen of a model file.", "--tyre", "--specimen")
    frequency: float | None = _amount(
        "--frequency", "frequency", 'For tir: frequency of its stiffness and damping, as "20 Hz".', "positive"
    )
    radius: float | None = _amount("--radius", "displacement", 'For tir: unloaded radius, as "316 mm".', "positive")
    belt_mass: float | None = _belt()[0]
    belt_share: float | None = _belt()[1]
