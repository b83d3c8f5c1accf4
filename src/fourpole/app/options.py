"""Options of the commands: how a quantity is read, and the groups of options that several commands have.

A group is a dataclass with one field per option. `command` puts the fields of each group on the command line. The words
of all options are in options.toml. Groups have no `__repr__` and `__eq__`, which every command would wait for.
"""

from __future__ import annotations

import functools
import inspect
import tomllib
from collections.abc import Callable, Iterator, Mapping
from copy import copy
from dataclasses import asdict, dataclass, fields, is_dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, get_args, get_origin, get_type_hints

import typer

from fourpole.app.console import Sign, fail, option, run_to_exit
from fourpole.errors import RigError, UnitError
from fourpole.export.kinds import ABOUT
from fourpole.models.families import NAMES

if TYPE_CHECKING:
    from fourpole.core.rig import Rig
    from fourpole.io.tables.kstar import TableOptions
    from fourpole.models.shape import Shape
    from fourpole.quantities import ShownUnits


#: What a query is for, as `fourpole.models.operating.Purpose`, which loads numpy.
Purpose = Literal["mean", "next", "specimen"]
#: What options.toml says of the parameters of the commands and of the fields of the groups.
_STATED: dict[str, dict[str, Any]] = tomllib.loads(Path(__file__).with_name("options.toml").read_text(encoding="utf-8"))


def allow_remote(wanted: bool) -> None:
    """Allow this process and its children to read all recordings that a statement names by URL, if that is wanted."""
    if wanted:
        from fourpole.io.remote import EVERY, allow

        allow(EVERY)


class Amount(float):
    """A quantity of the command line in SI, which knows its kind and the text of its unit."""

    kind: str
    unit: str


def _reader(name: str, kind: str, sign: Sign) -> Callable[[str], float]:
    """What makes a quantity of the text of an option."""

    def quantity(written: str) -> float:
        from fourpole.units import unit_in

        try:
            found = Amount(option(written, kind, name, sign))
            found.kind, found.unit = kind, unit_in(written)
        except UnitError as error:
            fail(str(error))
        return found

    return quantity


def answered_in(units: ShownUnits, *asked: float | None) -> ShownUnits:
    """The units of an answer: those of the question, and otherwise the given ones."""
    from fourpole.quantities import ShownUnits
    from fourpole.units import si_unit, unit_scale

    wanted = dict(units.wanted)
    for one in reversed(asked):
        if isinstance(one, Amount) and one.kind != "temperature":
            wanted[si_unit(one.kind)] = one.unit, unit_scale(one.unit, one.kind)
    return ShownUnits(wanted)


def command(name: str, run: Callable[..., int | None]) -> Callable[..., None]:
    """Function for the command line, with the fields of each group as options, that ends with one message at most.

    Parameters
    ----------
    name : str
        The name of the command.
    run : callable
        What it does. It returns its exit code; None stands for 0. Its annotations may name what is defined here, and
        options.toml has the words of its parameters, but of those that are `Annotated`.
    """
    signature = inspect.signature(run, eval_str=True, locals=globals())
    of_run = _STATED.get(name, {})
    groups: dict[str, Any] = {}
    parameters: list[inspect.Parameter] = []
    for name, one in signature.parameters.items():
        if is_dataclass(one.annotation):
            groups[name] = one.annotation
            parameters += _options_of(groups[name])
        elif get_origin(one.annotation) is Annotated:
            parameters.append(_own(one))
        else:
            default = ... if one.default is one.empty else one.default
            parameters.append(_shown(name, one.annotation, default, of_run, _STATED["every"]))

    @functools.wraps(run)
    def grouped(**given: Any) -> None:
        for name, group in groups.items():
            given[name] = group(**{one.name: given.pop(one.name) for one in fields(group)})
        run_to_exit(run, **given)

    grouped.__annotations__ = {one.name: one.annotation for one in parameters}
    grouped.__signature__ = signature.replace(parameters=parameters, return_annotation=None)  # type: ignore[attr-defined]
    return grouped


def _own(one: inspect.Parameter) -> inspect.Parameter:
    """A parameter whose annotation has its words, with these as its default, as others have."""
    kind, stated = get_args(one.annotation)
    said = copy(stated)
    if said.default is not ...:  # typer holds the first name of an annotation for its default
        said.param_decls = (said.default, *(said.param_decls or ()))
    said.default = ... if one.default is one.empty else one.default
    return one.replace(kind=one.KEYWORD_ONLY, default=said, annotation=kind)


def _options_of(group: type[Any]) -> Iterator[inspect.Parameter]:
    """One parameter for each field of a group."""
    types, stated = get_type_hints(group), [_STATED.get(one.__name__, {}) for one in group.__mro__]
    for one in fields(group):
        yield _shown(one.name, types[one.name], one.default, *stated)


def _shown(name: str, kind: Any, default: Any, *tables: Mapping[str, Any]) -> inspect.Parameter:
    """A parameter as the command line has it, with what the first table says that names it."""
    said = next(table[name] for table in tables if name in table)
    said = {"help": said} if isinstance(said, str) else dict(said)
    said["help"] = said["help"].replace("{ABOUT}", ABOUT).replace("{NAMES}", NAMES)
    names = said.pop("names", [f"--{name.replace('_', '-')}"])
    if "kind" in said:
        said |= {"parser": _reader(names[0], said.pop("kind"), said.pop("sign", "any")), "metavar": "QUANTITY"}
    if "argument" in said:
        shown = typer.Argument(default, metavar=said.pop("argument"), **said)
    else:
        shown = typer.Option(default, *names, **said)
    return inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=shown, annotation=kind)


@dataclass(frozen=True, repr=False, eq=False)
class RigOptions:
    """The rig above the tyre [kg], [N/m], [N s/m]; None where an option is not given."""

    mass: float | None = None
    preload_stiffness: float | None = None
    preload_damping: float | None = None

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
class MassOptions:
    """A mass behind the specimen that takes the place of a force cell [kg], and its auxiliary springs [N/m]."""

    mass_above: float | None = None
    mass_below: float | None = None
    preload_stiffness: float | None = None

    @property
    def rig(self) -> dict[str, float]:
        """The values that are given, by their keys in [rig]."""
        if self.mass_above is not None and self.mass_below is not None:
            raise RigError("--mass-above and --mass-below: one mass is behind the specimen, keep one of them")
        mass = self.mass_below if self.mass_above is None else self.mass_above
        given = {"moving_mass": mass, "preload_stiffness": self.preload_stiffness}
        return {name: float(value) for name, value in given.items() if value is not None}

    @property
    def below(self) -> bool:
        """Whether the mass is below the specimen."""
        return self.mass_below is not None


@dataclass(frozen=True, repr=False, eq=False)
class SharedErrors:
    """Standard uncertainties of the rig's values, gains and K1 [1], and of a phase [rad]; None: as usual."""

    std_rig: float | None = None
    std_gain: float | None = None
    std_phase: float | None = None
    std_k1: float | None = None


@dataclass(frozen=True, repr=False, eq=False)
class RunOptions:
    """Where the recordings are reduced, and which of them are read again."""

    workers: int | None = None
    scheduler: str | None = None
    time_limit: float | None = None
    verify: bool = False
    remote: bool = False


@dataclass(frozen=True, repr=False, eq=False)
class Wanted:
    """What an analysis writes besides its tables."""

    tables_only: bool = False
    models: bool | None = None
    png: bool = False


@dataclass(frozen=True, repr=False, eq=False)
class InfoOptions:
    """The channels of a file to show, and how."""

    channel: str = ""
    group: str = ""
    quick: bool = False
    no_plot: bool = False


@dataclass(frozen=True, repr=False, eq=False)
class TableChoice:
    """What a table of K* does not say, as text: its columns and units, its sheet, and the shape of the specimen."""

    column: list[str] | None = None
    group: str = ""
    averages: float | None = None
    shape_factor: str | None = None
    mode: str | None = None
    height: str | None = None
    area: str | None = None
    bonded: str | None = None

    no_rig: bool = False

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
        return TableOptions(
            columns, self.group, factor, shape, ratio=rig or self.no_rig, rig=rig, averages=self.averages
        )


@dataclass(frozen=True, repr=False, eq=False)
class Selection(TableChoice):
    """The tests of a results folder or table to use, as text."""

    tyre: str | None = None
    band: str | None = None
    over: list[str] | None = None


@dataclass(frozen=True, repr=False, eq=False)
class DataOptions(Selection):
    """The tests to use, with an uncertainty of K* and a static stiffness in place of the table's, as text."""

    std: str | None = None
    k1: str | None = None
    std_k1: str | None = None
    of: str | None = None


@dataclass(frozen=True, repr=False, eq=False)
class FitOptions(DataOptions):
    """The tests to fit, the fixed and shared parameters, and the files to write."""

    fix: list[str] | None = None
    share: list[str] | None = None
    static: str | None = None
    std_static: str | None = None
    file: Path | None = None
    figure: Path | None = None


@dataclass(frozen=True, repr=False, eq=False)
class ShiftOptions(TableChoice):
    """The isotherms to shift, how they are shifted, and what to write."""

    reference: float | None = None
    vertical: bool = False
    apart: str | None = None
    constants_at: float | None = None
    tyre: str | None = None
    std: float | None = None
    folder: Path | None = None


@dataclass(frozen=True, repr=False, eq=False)
class RideOptions:
    """The vehicle, the operating points of the tyres, and how a ride in time is run."""

    vehicle: str = "golden-car"
    at: list[str] | None = None
    tyre: str | None = None
    beyond: bool = False
    duration: float | None = None
    seed: int = 1
    step: float | None = None
    lift_off: bool = False
    curve: Path | None = None
    column: list[str] | None = None
    belt_mass: float | None = None
    belt_share: float | None = None
    folder: Path | None = None


@dataclass(frozen=True, repr=False, eq=False)
class PlotOptions:
    """What a figure shows, as text, and how it looks; a repeated option names several."""

    over: str | None = None
    specimen: list[str] | None = None
    pressure: list[str] | None = None
    preload: list[str] | None = None
    temperature: list[str] | None = None
    test: list[str] | None = None
    size: str = "report"
    dpi: int | None = None
    theme: str = "light"
    colour: list[str] | None = None
    label: list[str] | None = None
    xlim: str | None = None
    ylim: str | None = None
    paper: bool = False


@dataclass(frozen=True, repr=False, eq=False)
class PlanOptions:
    """A guessed tyre in SI, how its tests are run, and the advice and run sheet to make."""

    k1: float | None = None
    k2: float | None = None
    c: float | None = None
    wanted: float | None = None
    added_mass: list[float] | None = None
    run_sheet: Path | None = None
    repeats: int = 1
    seed: int = 1982
    noise: float | None = None
    cycles: int | None = None
    eccentricity: float | None = None
    std_k1: float | None = None


@dataclass(frozen=True, repr=False, eq=False)
class BareRig(RigOptions):
    """The options of a plan without a campaign, which states the same itself, in SI; None where not given."""

    frequency: str | None = None
    preload: float | None = None
    std_rig: float | None = None
    std_gain: float | None = None
    std_phase: float | None = None


@dataclass(frozen=True, repr=False, eq=False)
class ShapeOptions:
    """The shape of a specimen, for moduli in place of stiffnesses, as text; by default that of the model file."""

    mode: str | None = None
    height: str | None = None
    area: str | None = None
    poisson: float | None = None
    bonded: str | None = None
    bulk: str | None = None

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

    at: list[str] | None = None
    tyre: str | None = None
    frequency: float | None = None
    radius: float | None = None
    belt_mass: float | None = None
    belt_share: float | None = None
