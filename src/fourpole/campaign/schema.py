"""The content of campaign.toml, validated by pydantic, with quantities in SI; channels.py has the table [channels]."""

from __future__ import annotations

import datetime as dt
from functools import cached_property
from math import sqrt
from typing import Annotated, Any, Literal

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    StrictBool,
    ValidationError,
    ValidationInfo,
    field_validator,
    model_validator,
)

from fourpole import units
from fourpole.campaign import defaults
from fourpole.campaign.channels import (
    CHANNEL_KINDS,
    ChannelFile,
    ChannelsFile,
    File,
    Ratio,
    ReferenceFile,
    TimeFile,
    did_you_mean,
    known_keys,
)
from fourpole.campaign.ordinary import LoggerFile, Ordinary, Stated, UnstatedFile, stated_value
from fourpole.campaign.report import Equipment, ReportFile
from fourpole.core.checks import Asked
from fourpole.core.components import SpecimenUncertainty, component
from fourpole.core.condition import AXES, Axis, Sameness, axis_of
from fourpole.core.phasor import CHANNELS
from fourpole.core.rig import PARAMETERS, Rig
from fourpole.core.sources import Kind
from fourpole.core.specimen import BLOCK, TYRE, Body
from fourpole.errors import CampaignError, TableError
from fourpole.io.documents import toml_of
from fourpole.models.shape import shape_of

#: Most axes of [conditions]: a condition is compared with the others axis by axis.
_MOST_AXES = 20
#: Keys of [conditions] that state uncertainties of the specimens.
_OF_SPECIMENS = ("std_block", "std_drift")
#: Key of [rig] for the spring between V1 and the specimen, which is no part of what the specimen acts on.
_FIXTURE = "fixture_stiffness"
#: Kind of quantity of each value of the rig.
_RIG_KINDS = {name: units.channel_scale(unit, units.KINDS)[0] for name, unit in PARAMETERS.items()}


class RigFile(File):
    """[rig] or [rigs.NAME] of campaign.toml."""

    values: dict[str, Annotated[Stated, BeforeValidator(lambda raw: stated_value(*raw))]] = Field(default_factory=dict)
    fixture: Stated | None = None
    output: Literal["blocked"] | None = None
    force_at: Literal["drive", "ground"] | None = None

    @model_validator(mode="before")
    @classmethod
    def _gather(cls, raw: Any) -> Any:
        if not isinstance(raw, dict):
            raise ValueError("must be a table of values")
        known_keys(raw, (*PARAMETERS, _FIXTURE, "output", "force_at"))
        values = {name: (raw[name], _RIG_KINDS[name]) for name in PARAMETERS if name in raw}
        fixture = None
        if _FIXTURE in raw:
            try:
                fixture = stated_value(raw[_FIXTURE], "stiffness")
            except ValueError as error:
                raise ValueError(f"{_FIXTURE}: {error}") from None
            if not fixture.value > 0:
                raise ValueError(f"{_FIXTURE} is {fixture.value:g} N/m: it must be positive; leave a rigid fixture out")
        return {
            "values": values, "fixture": fixture, "output": raw.get("output"), "force_at": raw.get("force_at"),
        }  # fmt: skip

    @model_validator(mode="after")
    def _complete(self) -> RigFile:
        if self.force_at is not None and self.output != "blocked":
            raise ValueError('force_at is a key of a bench: state output = "blocked" too, or leave it out')
        if self.force_at == "ground" and "input_mass" in self.values:
            raise ValueError('with force_at = "ground" no input mass is between force cell and specimen: leave it out')
        if self.output != "blocked" and "moving_mass" not in self.values:
            raise ValueError('moving_mass is missing: state it, as moving_mass = "15 kg", or output = "blocked"')
        self.rig()
        return self

    def rig(self) -> Rig:
        """The rig as the core has it, with values and standard uncertainties in SI."""
        values = {name: stated.value for name, stated in self.values.items()}
        std = {name: stated.std for name, stated in self.values.items()}
        sides = {"blocked": self.output == "blocked", "at_ground": self.force_at == "ground"}
        return Rig(**values, **sides, std=std)  # type: ignore[arg-type]

    @property
    def stated(self) -> dict[str, Stated]:
        """All that is stated of it, by key."""
        return self.values | ({} if self.fixture is None else {_FIXTURE: self.fixture})

    @property
    def fixture_compliance(self) -> tuple[float, float]:
        """Compliance of the fixture between V1 and the specimen, and its u [m/N]; 0 for a rigid one."""
        if self.fixture is None:
            return 0.0, 0.0
        return 1 / self.fixture.value, self.fixture.std / self.fixture.value**2

    @property
    def unstated_springs(self) -> bool:
        """Whether the moving mass hangs on springs of which nothing is stated, as a blocking mass may."""
        return self.output != "blocked" and "preload_stiffness" not in self.values

    @property
    def with_damping(self) -> RigFile:
        """The rig with a damper of zero where a moving one states none: its uncertainty is a part of the critical."""
        if self.output == "blocked" or self.unstated_springs or "preload_damping" in self.values:
            return self
        critical = 2.0 * sqrt(self.values["preload_stiffness"].value * self.values["moving_mass"].value)
        damping = Stated(0.0, component(Kind.RIG_VALUE).std * critical, assumed=True)
        return self.model_copy(update={"values": {**self.values, "preload_damping": damping}})


class SpecimenFile(BaseModel):
    """[tyres.NAME] or [specimens.NAME]: the construction, the shape, and further keys of any name.

    `fixed` says whether the specimen is held on both sides, so that it can be pulled; None if it is not stated.
    `specimen_mass` is its whole weight, `belt_mass` what moves between its ends, and `belt_frequency` the first
    frequency of this mass with the rim held and the contact free. `mass_spread` is 0 for a mass in the middle, and 1 if
    it is spread evenly from end to end.
    """

    model_config = ConfigDict(extra="allow", frozen=True, defer_build=True)

    construction: str = ""
    fixed: StrictBool | None = None
    specimen_mass: Stated | None = None
    belt_mass: Stated | None = None
    belt_frequency: Stated | None = None
    mass_spread: float | None = Field(default=None, ge=0, le=1)

    @field_validator("specimen_mass", "belt_mass", "belt_frequency", mode="before")
    @classmethod
    def _quantity(cls, raw: Any, info: ValidationInfo) -> Stated:
        stated = stated_value(raw, "frequency" if info.field_name == "belt_frequency" else "mass")
        if not stated.value > 0:
            raise ValueError(f"is {stated.value:g}: state a positive number")
        return stated

    @model_validator(mode="after")
    def _whole(self) -> SpecimenFile:
        if self.belt_frequency is not None and self.belt_mass is None:
            raise ValueError("belt_frequency tells the spring of a belt whose mass is known: state belt_mass too")
        if self.belt_frequency is not None and self.mass_spread is not None:
            raise ValueError(
                "belt_frequency is that of a belt, and mass_spread of a mass between alike springs: state one"
            )
        if self.mass_spread is not None and self.belt_mass is None and self.specimen_mass is None:
            raise ValueError("mass_spread says where a mass is: state specimen_mass or belt_mass too")
        shape_of(self.model_extra or {})
        return self

    def body(self, share: float) -> Body:
        """What is stated of its inertia, with the usual share of its springs."""
        if self.belt_mass is not None:
            frequency = self.belt_frequency or Stated(0.0, 0.0, assumed=False)
            return Body(
                self.belt_mass.value, self.belt_mass.std, share, frequency.value, frequency.std, self.mass_spread
            )
        if self.specimen_mass is None:
            return Body(share=share)
        return Body.weighed(self.specimen_mass.value, share, self.mass_spread)


def _axis(raw: Any) -> Axis:
    """An axis of [conditions] from a text as "amplitude [mm]", or from a table of column, relative and absolute."""
    if isinstance(raw, str):
        raw = {"column": raw}
    if not isinstance(raw, dict) or not isinstance(raw.get("column"), str) or not raw["column"].strip():
        raise ValueError(
            'name a column of tests.csv: axes = ["batch", { column = "amplitude [mm]", relative = "2 %" }]'
        )
    known_keys(raw, ("column", "relative", "absolute"))
    column = raw["column"].strip()
    name, unit = units.column_unit(column)
    if name.casefold() in {axis.name for axis in AXES}:
        raise ValueError(f"{name} is an axis of every campaign: leave it out")
    try:
        relative = units.quantity(raw.get("relative", 0.0), "ratio", default_unit="1")
        absolute = units.quantity(raw.get("absolute", 0.0), "ratio", default_unit="1")
    except ValueError as error:
        raise ValueError(f"{units.shown(column)}: {error}") from None
    if relative < 0 or absolute < 0:
        raise ValueError(f"{units.shown(column)}: a tolerance is negative: state zero or more")
    if "relative" in raw or "absolute" in raw:
        return Axis(column, relative=relative, absolute=absolute)
    return Axis(column, text=True) if unit is None else axis_of(column)


class ConditionsFile(File):
    """[conditions]: columns of tests.csv that distinguish conditions, besides pressure, preload and temperature."""

    axes: tuple[Axis, ...] = ()
    temperature_sensitivity: float | None = None
    std_block: Ratio | None = None
    std_drift: Ratio | None = None

    @field_validator("temperature_sensitivity", mode="before")
    @classmethod
    def _per_kelvin(cls, raw: Any) -> float:
        """Relative change of K* per kelvin [1/K]."""
        number, mark, unit = raw.rpartition("/") if isinstance(raw, str) else ("", "", "")
        number = number.strip().removesuffix(" 1")
        try:
            if not mark or unit.strip() not in ("K", "degC", "°C"):
                raise ValueError
            change = units.quantity(number.strip(), "ratio", default_unit="1")
        except ValueError:
            raise ValueError(f'write it with its unit, as "1 %/K" or "0.01 1/K", not {raw!r}') from None
        if change < 0:
            raise ValueError("is negative: state how much |K*| changes per kelvin, zero or more")
        return change

    @property
    def per_kelvin(self) -> float:
        """Relative change of K* per kelvin [1/K], as stated or assumed."""
        stated = self.temperature_sensitivity
        return defaults.TEMPERATURE_SENSITIVITY if stated is None else stated

    @field_validator("axes", mode="before")
    @classmethod
    def _read(cls, raw: Any) -> Any:
        if not isinstance(raw, list):
            raise ValueError('must be a list: axes = ["batch", "amplitude [mm]"]')
        if len(raw) > _MOST_AXES:
            raise ValueError(f"has {len(raw)} axes, at most {_MOST_AXES} are taken")
        axes = tuple(map(_axis, raw))
        names = [axis.name for axis in axes]
        for name in names:
            if names.count(name) > 1:
                raise ValueError(f"{units.shown(name)} stands twice: keep one of them")
        return axes


class AnalysisFile(File):
    """[analysis]: the quantities that are asked of the tests; none for those that the campaign can give."""

    asked: tuple[Literal["K*", "K2", "C", "TR"], ...] = ()

    @property
    def quantities(self) -> frozenset[Asked]:
        """The quantities with a verdict of their own."""
        return frozenset(Asked.ARM if name in ("K2", "C") else Asked(name) for name in self.asked)


class CampaignFile(File):
    """The content of campaign.toml."""

    title: str = ""
    laboratory: str = ""
    date: dt.date | None = None
    rig: RigFile | None = None
    rigs: dict[str, RigFile] = Field(default_factory=dict)
    channels: ChannelsFile
    tyres: dict[str, SpecimenFile] = Field(default_factory=dict)
    specimens: dict[str, SpecimenFile] = Field(default_factory=dict)
    conditions: ConditionsFile = ConditionsFile()
    logger: LoggerFile = LoggerFile()
    unstated: UnstatedFile = UnstatedFile()
    analysis: AnalysisFile = AnalysisFile()
    report: ReportFile = ReportFile()

    @model_validator(mode="after")
    def _whole(self) -> CampaignFile:
        twice = sorted(self.tyres.keys() & self.specimens.keys())
        if twice:
            raise ValueError(f"{units.shown(twice[0])} is both under [tyres] and [specimens]: keep one of them")
        for name, rig in {"": self.rig, **self.rigs}.items():
            if rig is not None and rig.unstated_springs and self.channels.force_in is not None:
                raise ValueError(
                    f"[{f'rigs.{name}' if name else 'rig'}] preload_stiffness is missing: state it, as "
                    'preload_stiffness = "12.44 kN/m", or output = "blocked"'
                )
        return self

    @property
    def sameness(self) -> Sameness:
        """The rule that decides whether two tests have the same condition."""
        return Sameness((*AXES, *self.conditions.axes))

    @property
    def all_specimens(self) -> dict[str, SpecimenFile]:
        """Tyres and specimens by name."""
        return {**self.tyres, **self.specimens}

    @cached_property
    def all_rigs(self) -> dict[str, RigFile]:
        """Rigs by name; the name of the rig in [rig] is empty."""
        rigs = {**({"": self.rig} if self.rig is not None else {}), **self.rigs}
        return {name: rig.with_damping for name, rig in rigs.items()} if self.unstated.ordinary == "table" else rigs

    @property
    def ordinary(self) -> Ordinary:
        """Standard uncertainties of the ordinary errors, by channel."""
        blocked = [rig.output == "blocked" for rig in self.all_rigs.values()]
        actuator = self.channels.drive is not None or (bool(blocked) and all(blocked))
        on_rig = actuator and self.channels.kind_of("motion_in") == "displacement"
        return Ordinary(self.unstated.ordinary == "table", self.logger.simultaneous, on_rig)

    @property
    def specimen_uncertainty(self) -> SpecimenUncertainty:
        """Standard uncertainties of the specimens over blocks of tests and over the run."""
        return self.ordinary.specimens(self.conditions.std_block, self.conditions.std_drift)

    @property
    def bodies(self) -> dict[str, Body]:
        """What is stated of the inertia of each specimen."""
        return {name: one.body(TYRE if name in self.tyres else BLOCK) for name, one in self.all_specimens.items()}

    def summary(self) -> dict[str, Any]:
        """Statements on rigs, channels and specimens as plain data, in SI units."""
        return {
            **({"laboratory": self.laboratory} if self.laboratory else {}),
            **({"date": self.date.isoformat()} if self.date else {}),
            **({"report": stated} if (stated := self.report.summary()) else {}),
            "rigs": {
                name: {
                    "output": rig.output or "moving",
                    **{
                        key: {
                            "value": value.value,
                            "std": value.std,
                            "unit": PARAMETERS.get(key, "N/m"),
                            "assumed": value.assumed,
                        }
                        for key, value in rig.stated.items()
                    },
                }
                for name, rig in self.all_rigs.items()
            },
            "channels": {
                role: {
                    **channel.model_dump(exclude_defaults=True),
                    "quantity": self.channels.kind_of(role),
                    "std_gain [1]": channel.gain_std,
                    "std_phase [rad]": channel.phase_std,
                    **self.ordinary.summary(role, channel),
                }
                for role, channel in self.channels.by_role.items()
            },
            "sample_rate [Hz]": self.channels.rate,
            "logger": self.logger.model_dump(),
            "unstated": self.unstated.model_dump(exclude_none=True),
            **({"analysis": {"asked": list(self.analysis.asked)}} if self.analysis.asked else {}),
            "conditions": {
                f"{key} [1]": value for key in _OF_SPECIMENS if (value := getattr(self.conditions, key)) is not None
            },
            **({"reference": self.channels.reference.model_dump()} if self.channels.reference is not None else {}),
            **({"drive": self.channels.drive.model_dump()} if self.channels.drive is not None else {}),
            "specimens": {
                name: specimen.model_dump(mode="json", exclude_none=True)
                for name, specimen in self.all_specimens.items()
            },
        }

    def assumptions(self) -> list[str]:
        """Notes on the uncertainties that are assumed because campaign.toml does not state them."""
        notes = []
        for name, rig in self.all_rigs.items():
            where = f"[rigs.{name}]" if name else "[rig]"
            if assumed := [key for key, value in rig.stated.items() if value.assumed and value.value]:
                notes.append(f"{where} {', '.join(assumed)}: no std stated, taken as 2 % (exact = true if it is exact)")
            if rig.unstated_springs:
                notes.append(
                    f"{where} preload_stiffness: not stated; the auxiliary springs of the mass count as softer than "
                    "the specimen, which is a part of u(K*): state it"
                )
            damping = rig.values.get("preload_damping")
            if damping is not None and damping.assumed and damping.std and not damping.value:
                part = f"{100 * component(Kind.RIG_VALUE).std:g} % of the critical one"
                notes.append(f"{where} preload_damping: not stated, taken as 0 ± {damping.std:.3g} N s/m, {part}")
        inexact = {role: channel for role, channel in self.channels.by_role.items() if not channel.exact}
        for what, default, roles in (("std_gain", "1 %", CHANNEL_KINDS), ("std_phase", "0.5 deg", CHANNELS)):
            lacking = [role for role in inexact if role in roles and getattr(inexact[role], what) is None]
            if lacking:
                notes.append(
                    f"[channels] {', '.join(lacking)}: no {what} stated, taken as {default} (exact = true if exact)"
                )
        conditions = [key for key in _OF_SPECIMENS if getattr(self.conditions, key) is None]
        return [*notes, *self.ordinary.notes(self.channels, conditions)]


def parse_campaign(stated: str | dict[str, Any], name: str = "campaign.toml") -> CampaignFile:
    """The content of campaign.toml from its text or its tables; CampaignError that begins with `name` if not valid.

    The message has the first three faults, each with its place and remedy.
    """
    try:
        return CampaignFile.model_validate(toml_of(stated, name) if isinstance(stated, str) else stated)
    except TableError as error:
        remedy = r"; in a path write / in place of \, or '...' around it" if "\\" in str(error) else ""
        raise CampaignError(f"{error}{remedy}") from None
    except ValidationError as error:
        faults = error.errors(include_url=False)
        lines = [_fault(fault, name) for fault in faults]
        more = [f"... and {len(faults) - 3} more"] if len(faults) > 3 else []
        told = CampaignError("\n".join([*lines[:3], *more]))
        told.faults = tuple(lines)
        raise told from None


#: Class of each table of campaign.toml by its name; the other tables that have keys are channels.
_TABLES: dict[str, Any] = {
    "channels": ChannelsFile,
    "time": TimeFile,
    "reference": ReferenceFile,
    "conditions": ConditionsFile,
    "logger": LoggerFile,
    "unstated": UnstatedFile,
    "analysis": AnalysisFile,
    "report": ReportFile,
    "equipment": Equipment,
}
#: What TOML calls the value that pydantic asks for.
_WANTED = {
    **dict.fromkeys(("tuple_type", "list_type"), "a list, in square brackets"),
    **dict.fromkeys(("dict_type", "model_type", "model_attributes_type"), "a table, as in { key = value }"),
}


def _fault(fault: Any, name: str) -> str:
    """Message on one fault that pydantic found: place, fault and remedy."""
    path = [str(part) for part in fault["loc"] if part != "values"]
    kind = fault["type"]
    if kind == "extra_forbidden":
        owner: Any = CampaignFile
        for part in (part for part in path[:-1] if not part.isdigit()):
            owner = _TABLES.get(part, ChannelFile)
        problem = f"unknown key{did_you_mean(path[-1], tuple(owner.model_fields))}"
    elif kind == "missing":
        problem = "is missing"
    elif kind in _WANTED:
        problem = f"should be {_WANTED[kind]}"
    else:
        problem = str(fault["msg"]).removeprefix("Value error, ")
        given = fault.get("input")
        if kind != "value_error" and isinstance(given, str | int | float | bool):
            problem += f" (found {units.shown(given)})"
    table = len(path) > 1 or (kind == "value_error" and path)
    where = f"[{path[0]}] {'.'.join(path[1:])}".strip() if table else ".".join(path)
    return f"{name}{': ' + where if where else ''}: {problem}"
