"""What campaign.toml may say, validated by pydantic, quantities turned into SI floats."""

from __future__ import annotations

import difflib
import tomllib
from dataclasses import dataclass
from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError, model_validator
from pydantic.functional_validators import ModelWrapValidatorHandler

from fourpole import units
from fourpole.core.rig import PARAMETERS, Rig
from fourpole.errors import CampaignError

__all__ = ["CampaignFile", "ChannelFile", "Stated", "parse_campaign"]

#: What an unstated uncertainty is taken as.
DEFAULT_RIG_STD = 0.02
DEFAULT_GAIN_STD = 0.01
DEFAULT_PHASE_STD = 0.5 * 3.141592653589793 / 180.0

_RIG_KINDS = {
    "moving_mass": "mass",
    "preload_stiffness": "stiffness",
    "preload_damping": "damping",
    "preload_loss_factor": "ratio",
    "tyre_mass": "mass",
    "frame_stiffness": "stiffness",
    "input_mass": "mass",
}


@dataclass(frozen=True)
class Stated:
    """A value with its standard uncertainty in SI; `assumed` where the uncertainty was not stated."""

    value: float
    std: float
    assumed: bool


def _stated(raw: Any, kind: str) -> Stated:
    """A rig value: "15 kg", or a table of value, unit, std, exact."""
    if isinstance(raw, str):
        raw = {"value": raw}
    if not isinstance(raw, dict):
        raise ValueError(
            f'write it with its unit, as "15 kg" or {{ value = 15.0, unit = "kg", std = 0.1 }}, not {raw!r}'
        )
    _known_keys(raw, ("value", "unit", "std", "exact"))
    if "value" not in raw:
        raise ValueError('has no value: write { value = 15.0, unit = "kg", std = 0.1 }')
    unit = raw.get("unit", "1" if kind == "ratio" else None)
    if unit is not None and not isinstance(unit, str):
        raise ValueError(f"unit must be a text, not {unit!r}")
    exact = raw.get("exact", False)
    if not isinstance(exact, bool):
        raise ValueError(f"exact must be true or false, not {exact!r}")
    value = units.quantity(raw["value"], kind, default_unit=unit)
    if exact and "std" in raw:
        raise ValueError("exact = true and std contradict each other: keep one of them")
    if exact:
        return Stated(value, 0.0, assumed=False)
    if "std" not in raw:
        return Stated(value, DEFAULT_RIG_STD * abs(value), assumed=value != 0)
    std = raw["std"]
    if isinstance(std, str) and std.strip().endswith("%"):
        return _non_negative(value, abs(value) * units.quantity(std, "ratio"))
    return _non_negative(value, units.quantity(std, kind, default_unit=unit))


def _non_negative(value: float, std: float) -> Stated:
    if std < 0:
        raise ValueError("std is negative: state a standard uncertainty, zero or positive")
    return Stated(value, std, assumed=False)


def _known_keys(raw: dict[str, Any], known: tuple[str, ...]) -> None:
    for key in raw:
        if key not in known:
            raise ValueError(f"unknown key {units.shown(key)}{_did_you_mean(key, known)}")


def _did_you_mean(key: str, known: tuple[str, ...]) -> str:
    near = difflib.get_close_matches(key, known, n=1, cutoff=0.4)
    return f"; did you mean '{near[0]}'?" if near else f"; known are {', '.join(known)}"


def _ratio(raw: Any) -> float:
    return units.quantity(raw, "ratio", default_unit="1")


def _time(raw: Any) -> float:
    return units.quantity(raw, "time")


def _angle(raw: Any) -> float:
    return units.quantity(raw, "angle")


def _frequency(raw: Any) -> float:
    return units.quantity(raw, "frequency")


class _File(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, arbitrary_types_allowed=True)


class RigFile(_File):
    """[rig] or [rigs.NAME]."""

    values: dict[str, Stated] = {}
    output: Literal["blocked"] | None = None

    @model_validator(mode="before")
    @classmethod
    def _gather(cls, raw: Any) -> Any:
        if not isinstance(raw, dict):
            raise ValueError("must be a table of values")
        _known_keys(raw, (*PARAMETERS, "output"))
        values = {}
        for name in PARAMETERS:
            if name in raw:
                try:
                    values[name] = _stated(raw[name], _RIG_KINDS[name])
                except ValueError as error:
                    raise ValueError(f"{name}: {error}") from None
        return {"values": values, "output": raw.get("output")}

    @model_validator(mode="after")
    def _complete(self) -> RigFile:
        if self.output != "blocked":
            for name, example in (("moving_mass", "15 kg"), ("preload_stiffness", "12.44 kN/m")):
                if name not in self.values:
                    raise ValueError(f'{name} is missing: state it, as {name} = "{example}", or output = "blocked"')
        self.rig()
        return self

    def rig(self) -> Rig:
        """The rig in the core's terms."""
        values = {name: stated.value for name, stated in self.values.items()}
        std = {name: stated.std for name, stated in self.values.items()}
        return Rig(**values, blocked=self.output == "blocked", std=std)  # type: ignore[arg-type]

    @property
    def assumed(self) -> list[str]:
        """Values whose uncertainty was not stated."""
        return [name for name, stated in self.values.items() if stated.assumed]


class ChannelFile(_File):
    """One of [channels]: which column it is, and how its numbers become SI values."""

    column: str = Field(min_length=1)
    unit: str | None = None
    gain: float = Field(1.0, allow_inf_nan=False)
    offset: float | str = 0.0
    sensitivity: str | None = None
    delay: Annotated[float, BeforeValidator(_time)] = 0.0
    invert: bool = False
    range: float | str | None = None
    std_gain: Annotated[float, BeforeValidator(_ratio), Field(ge=0)] | None = None
    std_phase: Annotated[float, BeforeValidator(_angle), Field(ge=0)] | None = None
    exact: bool = False

    @model_validator(mode="after")
    def _readable(self) -> ChannelFile:
        if self.gain == 0:
            raise ValueError("gain is zero: state the factor from the recorded to the true value")
        if self.exact and (self.std_gain or self.std_phase):
            raise ValueError("exact = true and std_gain or std_phase contradict each other: keep one of them")
        return self

    def conversion(self, kinds: tuple[str, ...]) -> Conversion:
        """How recorded numbers become SI, for a channel that must be of one of `kinds`."""
        kind, scale, recorded = self._recorded(kinds)
        slope = scale * self.gain * (-1.0 if self.invert else 1.0)
        offset = self._in_recorded(self.offset, recorded)
        limits = None
        if self.range is not None:
            full = self._in_recorded(self.range, recorded)
            if full <= 0:
                raise ValueError("range must be positive: the full scale of the channel")
            low, high = sorted((slope * (-full - offset), slope * (full - offset)))
            limits = (low, high)
        return Conversion(kind, slope, offset, self.delay, limits)

    def _recorded(self, kinds: tuple[str, ...]) -> tuple[str, float, str]:
        """Kind measured, its SI value per recorded unit, and the recorded unit."""
        if self.sensitivity is None:
            if self.unit is None:
                raise ValueError('unit is missing: write it, as unit = "N", or give a sensitivity for volts')
            kind, scale = units.channel_scale(self.unit, kinds)
            return kind, scale, self.unit
        volts, kind = units.sensitivity(self.sensitivity)
        if kind not in kinds:
            raise ValueError(f"sensitivity '{self.sensitivity}' is of a {kind}, a {' or '.join(kinds)} is needed")
        unit = self.unit or "V"
        stated, scale = units.channel_scale(unit, ("voltage", *kinds))
        if stated == kind:  # the unit says what the volts mean, not what was recorded
            unit, scale = "V", 1.0
        elif stated != "voltage":
            raise ValueError(f"unit '{unit}' and sensitivity '{self.sensitivity}' contradict each other")
        return kind, scale / volts, unit

    @staticmethod
    def _in_recorded(value: float | str, unit: str) -> float:
        """A number in the recorded unit, or a quantity turned into it."""
        if isinstance(value, float):
            return value
        kind, scale = units.channel_scale(unit, ("voltage", "force", "displacement", "velocity", "acceleration"))
        return units.quantity(value, kind, default_unit=unit) / scale

    @property
    def gain_std(self) -> float:
        """Relative standard uncertainty of the gain."""
        return 0.0 if self.exact else (DEFAULT_GAIN_STD if self.std_gain is None else self.std_gain)

    @property
    def phase_std(self) -> float:
        """Standard uncertainty of the phase [rad]."""
        return 0.0 if self.exact else (DEFAULT_PHASE_STD if self.std_phase is None else self.std_phase)


@dataclass(frozen=True)
class Conversion:
    """SI value = slope · (recorded − offset); the limits and the delay are in SI."""

    kind: str
    slope: float
    offset: float
    delay: float
    limits: tuple[float, float] | None


class TimeFile(_File):
    """The time column, or a sample rate in its place."""

    column: str | None = None
    unit: str = "s"
    sample_rate: Annotated[float, BeforeValidator(_frequency), Field(gt=0)] | None = None

    @model_validator(mode="after")
    def _readable(self) -> TimeFile:
        units.unit_scale(self.unit, "time")
        if (self.column is None) == (self.sample_rate is None):
            raise ValueError("state a column or a sample_rate, one of the two")
        return self


_MOTIONS = ("displacement", "velocity", "acceleration")
_CHANNEL_KINDS: dict[str, tuple[str, ...]] = {
    "force_in": ("force",),
    "motion_in": _MOTIONS,
    "motion_out": _MOTIONS,
    "load": ("force",),
    "deflection": ("displacement",),
}


class ChannelsFile(_File):
    """[channels]."""

    time: TimeFile | None = None
    sample_rate: Annotated[float, BeforeValidator(_frequency), Field(gt=0)] | None = None
    force_in: ChannelFile | None = None
    motion_in: ChannelFile | None = None
    motion_out: ChannelFile | None = None
    load: ChannelFile | None = None
    deflection: ChannelFile | None = None

    @model_validator(mode="after")
    def _readable(self) -> ChannelsFile:
        if self.time is not None and self.sample_rate is not None:
            raise ValueError("time and sample_rate are both stated: keep one of them")
        for role in _CHANNEL_KINDS:
            if self.named(role) is not None:
                try:
                    self.conversion(role)
                except ValueError as error:
                    raise ValueError(f"{role}: {error}") from None
        return self

    def named(self, role: str) -> ChannelFile | None:
        """The channel of a role, if it is stated."""
        channel: ChannelFile | None = getattr(self, role)
        return channel

    def conversion(self, role: str) -> Conversion:
        """How the numbers of a role become SI."""
        channel = self.named(role)
        assert channel is not None
        return channel.conversion(_CHANNEL_KINDS[role])

    @property
    def rate(self) -> float | None:
        """Sample rate stated in place of a time column [Hz]."""
        return self.sample_rate or (self.time.sample_rate if self.time else None)


class SpecimenFile(BaseModel):
    """[tyres.NAME] or [specimens.NAME]: construction, and whatever else is worth noting."""

    model_config = ConfigDict(extra="allow", frozen=True)

    construction: str = ""


class CampaignFile(_File):
    """campaign.toml."""

    title: str = ""
    rig: RigFile | None = None
    rigs: dict[str, RigFile] = {}
    channels: ChannelsFile
    tyres: dict[str, SpecimenFile] = {}
    specimens: dict[str, SpecimenFile] = {}

    @model_validator(mode="wrap")
    @classmethod
    def _once(cls, raw: Any, handler: ModelWrapValidatorHandler[CampaignFile]) -> CampaignFile:
        found = handler(raw)
        twice = sorted(found.tyres.keys() & found.specimens.keys())
        if twice:
            raise ValueError(f"{units.shown(twice[0])} is both under [tyres] and [specimens]: keep one of them")
        return found

    @property
    def all_specimens(self) -> dict[str, SpecimenFile]:
        """Tyres and specimens together."""
        return {**self.tyres, **self.specimens}

    @property
    def all_rigs(self) -> dict[str, RigFile]:
        """Rigs by name; the only one's name is empty."""
        return {**({"": self.rig} if self.rig is not None else {}), **self.rigs}

    def summary(self) -> dict[str, Any]:
        """What is stated of rigs, channels and specimens, in SI units, as plain data."""
        channels = {role: channel for role in _CHANNEL_KINDS if (channel := self.channels.named(role)) is not None}
        return {
            "rigs": {
                name: {
                    "output": rig.output or "moving",
                    **{
                        value: {
                            "value": stated.value,
                            "std": stated.std,
                            "unit": PARAMETERS[value],
                            "assumed": stated.assumed,
                        }
                        for value, stated in rig.values.items()
                    },
                }
                for name, rig in self.all_rigs.items()
            },
            "channels": {
                role: {
                    **channel.model_dump(exclude_defaults=True),
                    "quantity": self.conversion_kind(role),
                    "std_gain [1]": channel.gain_std,
                    "std_phase [rad]": channel.phase_std,
                }
                for role, channel in channels.items()
            },
            "sample_rate [Hz]": self.channels.rate,
            "specimens": {name: specimen.model_dump(mode="json") for name, specimen in self.all_specimens.items()},
        }

    def conversion_kind(self, role: str) -> str:
        """What the channel of a role recorded: force, displacement, velocity or acceleration."""
        return self.channels.conversion(role).kind

    def assumptions(self) -> list[str]:
        """What was taken where an uncertainty is not stated, one sentence each."""
        notes = []
        for name, rig in self.all_rigs.items():
            where = f"[rigs.{name}]" if name else "[rig]"
            if rig.assumed:
                notes.append(
                    f"{where} {', '.join(rig.assumed)}: no std stated, taken as 2 % (exact = true if it is exact)"
                )
        roles = [role for role in _CHANNEL_KINDS if self.channels.named(role) is not None]
        for what, default, which in (
            ("std_gain", "1 %", roles),
            ("std_phase", "0.5 deg", [r for r in roles if r not in ("load", "deflection")]),
        ):
            lacking = [r for r in which if _lacks(self.channels.named(r), what)]
            if lacking:
                notes.append(
                    f"[channels] {', '.join(lacking)}: no {what} stated, taken as {default} (exact = true if exact)"
                )
        return notes


def _lacks(channel: ChannelFile | None, what: str) -> bool:
    return channel is not None and not channel.exact and getattr(channel, what) is None


def parse_campaign(text: str, name: str = "campaign.toml") -> CampaignFile:
    """Parse and validate the text of campaign.toml; CampaignError with one short message where it cannot be used."""
    try:
        raw = tomllib.loads(text)
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        raise CampaignError(f"{name}: not valid TOML: {error}") from None
    try:
        return CampaignFile.model_validate(raw)
    except ValidationError as error:
        raise CampaignError(_explain(error, name)) from None


def _explain(error: ValidationError, name: str) -> str:
    """The first few faults of a campaign file, each with its place and remedy."""
    faults = error.errors(include_url=False)
    lines = [_fault(fault, name) for fault in faults[:3]]
    if len(faults) > 3:
        lines.append(f"... and {len(faults) - 3} more")
    return "\n".join(lines)


def _fault(fault: Any, name: str) -> str:
    path = [str(part) for part in fault["loc"]]
    kind = fault["type"]
    if kind == "extra_forbidden":
        owner: Any = CampaignFile
        for part in path[:-1]:
            owner = {"channels": ChannelsFile, "time": TimeFile}.get(part, ChannelFile)
        problem = f"unknown key{_did_you_mean(path[-1], tuple(owner.model_fields))}"
    elif kind == "missing":
        problem = "is missing"
    else:
        problem = str(fault["msg"]).removeprefix("Value error, ")
        given = fault.get("input")
        if kind != "value_error" and isinstance(given, str | int | float | bool):
            problem += f" (found {units.shown(given)})"
    table = len(path) > 1 or (kind == "value_error" and path)
    where = f"[{path[0]}] {'.'.join(path[1:])}".strip() if table else ".".join(path)
    return f"{name}{': ' + where if where else ''}: {problem}"
