"""[channels] of campaign.toml: the column of each channel, its unit, and the response of its sensor."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Literal

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    StrictBool,
    ValidationInfo,
    field_validator,
    model_validator,
)

from fourpole import units
from fourpole.campaign import defaults
from fourpole.core.chain import Geophone, HighPass, Link, LowPass
from fourpole.core.phasor import CHANNELS
from fourpole.core.recording import DRIVE, CrossTalk
from fourpole.errors import TableError, UnitError
from fourpole.io.stream import agreed
from fourpole.words import first_of

#: Highest order of a filter.
_HIGHEST_ORDER = 12
#: Largest number of known names that a message lists.
_SHOWN = 40
#: Keys that only a channel of dynamic tests has, because they belong to an amplitude at a frequency.
_DYNAMIC_ONLY = (
    "std_delay", "high_pass", "low_pass", "geophone", "response", "crosstalk", "coupling", "low_cut", "std_low_cut",
    "std_slope", "resonance", "std_crosstalk",
)  # fmt: skip
#: The channels of other keys that not every channel has.
ONLY_OF = {
    **dict.fromkeys(("mounted", "std_mounting"), ("motion_in",)),
    **dict.fromkeys(("remounted_with_mass", "std_remounting"), ("force_in", "motion_out")),
    "linearity": ("force_in", "load", "deflection"),
}

#: Keys of a channel that state a standard uncertainty, which a channel that is exact has not.
_STD = (
    "std_gain", "std_phase", "std_delay", "std_low_cut", "std_slope", "resonance", "std_mounting", "std_remounting",
    "std_crosstalk", "linearity",
)  # fmt: skip
#: Keys of a channel that state how uncertain its values are, and change no value.
_UNCERTAINTIES = {*_STD, "exact", "coupling", "mounted", "remounted_with_mass", "serial"}
#: Pairs of keys of a channel that state the same.
_ONE_OF = (("low_cut", "high_pass"), ("std_slope", "resonance"), ("remounted_with_mass", "std_remounting"))


def known_keys(raw: dict[str, Any], known: tuple[str, ...]) -> None:
    """ValueError for an unknown key of a table; the message names the most similar known key."""
    for key in raw:
        if key not in known:
            raise ValueError(f"unknown key {units.shown(key)}{did_you_mean(key, known)}")


def did_you_mean(key: str, known: tuple[str, ...]) -> str:
    """End of a message: the known key most similar to `key`, or all known keys if none is similar."""
    near = units.nearest(key, known, 0.4)
    return f"; did you mean '{near}'?" if near else f"; known are {first_of(known, _SHOWN)}"


def stated_quantity(raw: Any, kind: str) -> float:
    """SI value of a quantity; only a ratio may stand without a unit."""
    return units.quantity(raw, kind, default_unit="1" if kind == "ratio" else None)


def si(kind: str) -> BeforeValidator:
    """Validator that turns a quantity of a kind into its SI value."""
    return BeforeValidator(lambda raw: stated_quantity(raw, kind))


#: A ratio that is not negative, with or without "%".
Ratio = Annotated[float, si("ratio"), Field(ge=0)]


def _numbers(raw: Any, kinds: dict[str, str], example: str) -> dict[str, float]:
    """SI values of a small table, each positive; only "order" may be missing, and a text alone is the first value."""
    if isinstance(raw, str):
        raw = {next(iter(kinds)): raw}
    if not isinstance(raw, dict):
        raise ValueError(f"write it as {example}, not {raw!r}")
    known_keys(raw, tuple(kinds))
    for name in kinds:
        if name not in raw and name != "order":
            raise ValueError(f"{name} is missing: write it as {example}")
    values = {name: stated_quantity(raw[name], kind) for name, kind in kinds.items() if name in raw}
    for name, value in values.items():
        if value <= 0:
            raise ValueError(f"{name} must be positive")
    return values


def _filter(kind: type[HighPass] | type[LowPass]) -> Any:
    """Function that turns a table of corner frequency and order into a filter."""
    example = '{ corner = "0.5 Hz", order = 1 }'

    def read(raw: Any) -> HighPass | LowPass:
        values = _numbers(raw, {"corner": "frequency", "order": "ratio"}, example)
        order = values.get("order", 1.0)
        if order != int(order) or order > _HIGHEST_ORDER:
            raise ValueError(f"order must be a whole number from 1 to {_HIGHEST_ORDER}, not {order:g}")
        return kind(values["corner"], int(order))

    return read


def _is_percent(raw: Any) -> bool:
    return isinstance(raw, str) and raw.strip().endswith("%")


def _corner_std(raw: Any) -> Any:
    """A text with a frequency, or with a ratio in %, as it is; ValueError for another one."""
    if stated_quantity(raw, "ratio" if _is_percent(raw) else "frequency") < 0:
        raise ValueError("is negative: state zero or more")
    return raw


def _geophone(raw: Any) -> Geophone:
    """The geophone of a table of natural frequency and damping ratio."""
    example = '{ natural_frequency = "4.5 Hz", damping = 0.7 }'
    values = _numbers(raw, {"natural_frequency": "frequency", "damping": "ratio"}, example)
    return Geophone(values["natural_frequency"], values["damping"])


def _coefficients(raw: Any) -> dict[str, str]:
    """The coefficients of crosstalk by the channel that they come from, as texts with units."""
    if not isinstance(raw, dict) or not all(isinstance(value, str) for value in raw.values()):
        raise ValueError('write it as { motion_in = "0.02 N/(m/s2)" }')
    known_keys(raw, CHANNELS)
    return raw


class File(BaseModel):
    """A table of campaign.toml; an unknown key is an error."""

    model_config = ConfigDict(extra="forbid", frozen=True, arbitrary_types_allowed=True, defer_build=True)


class ChannelFile(File):
    """One channel of [channels]: its column, and how recorded numbers become SI values.

    It is the mean of its column and of those `beside` it, of further sensors on the same part.
    """

    column: str = Field(min_length=1)
    beside: Annotated[tuple[str, ...], BeforeValidator(lambda raw: [raw] if isinstance(raw, str) else raw)] = ()
    unit: str | None = None
    gain: Annotated[float, AfterValidator(lambda value: units.bounded(value, value))] = 1.0
    offset: float | str = 0.0
    sensitivity: str | None = None
    delay: Annotated[float, si("time")] = 0.0
    std_delay: Annotated[float, si("time"), Field(ge=0)] | None = None
    coupling: Literal["dc", "ac", "iepe"] | None = None
    low_cut: Annotated[float, si("frequency"), Field(gt=0)] | None = None
    std_low_cut: Annotated[str | None, BeforeValidator(_corner_std)] = None
    std_slope: Ratio | None = None
    resonance: Annotated[float, si("frequency"), Field(gt=0)] | None = None
    mounted: Literal["specimen", "drive", "rig"] | None = None
    std_mounting: Ratio | None = None
    remounted_with_mass: StrictBool | None = None
    std_remounting: Ratio | None = None
    std_crosstalk: Ratio = 0.0
    linearity: Ratio | None = None
    serial: str = ""
    high_pass: Annotated[HighPass | None, BeforeValidator(_filter(HighPass))] = None
    low_pass: Annotated[LowPass | None, BeforeValidator(_filter(LowPass))] = None
    geophone: Annotated[Geophone | None, BeforeValidator(_geophone)] = None
    response: str | None = Field(None, min_length=1)
    crosstalk: Annotated[dict[str, str], BeforeValidator(_coefficients)] = {}
    invert: bool = False
    range: float | str | None = None
    std_gain: Ratio | None = None
    std_phase: Annotated[float, si("angle"), Field(ge=0)] | None = None
    exact: bool = False

    @model_validator(mode="after")
    def _readable(self) -> ChannelFile:
        if self.gain == 0:
            raise ValueError("gain is zero: state the factor from the recorded to the true value")
        if self.exact and (doubts := [key for key in _STD if getattr(self, key)]):
            raise ValueError(f"exact = true and {doubts[0]} contradict each other: keep one")
        for one, other in _ONE_OF:
            if {one, other} <= self.model_fields_set:
                raise ValueError(f"{one} and {other} are both stated: keep one of them")
        for key, word, other in (("coupling", "dc", "low_cut"), ("mounted", "rig", "std_mounting")):
            if getattr(self, key) == word and getattr(self, other):
                raise ValueError(f'{key} = "{word}" and {other} contradict each other: keep one')
        if self.std_low_cut is not None and _is_percent(self.std_low_cut) and self.low_cut is None:
            raise ValueError('std_low_cut in % needs low_cut: state both, or a frequency, as "0.05 Hz"')
        return self

    @property
    def stated_low_cut_std(self) -> float | None:
        """Standard uncertainty of the corner of the low-cut as stated, as a frequency or in % of it [Hz]."""
        if self.std_low_cut is None:
            return None
        if self.low_cut is not None and _is_percent(self.std_low_cut):
            return self.low_cut * stated_quantity(self.std_low_cut, "ratio")
        return stated_quantity(self.std_low_cut, "frequency")

    def conversion(self, kinds: tuple[str, ...]) -> Conversion:
        """Conversion of recorded numbers to SI; the channel must record one of `kinds`."""
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
        if self.geophone is not None and kind != "velocity":
            raise TableError(f"geophone is for a sensor of velocity, this one is of {kind}")
        talk = tuple(_crosstalk(source, text, kind) for source, text in self.crosstalk.items())
        low_cut = self.high_pass if self.low_cut is None else HighPass(self.low_cut)
        chain = tuple(link for link in (low_cut, self.low_pass, self.geophone) if link is not None)
        return Conversion(kind, slope, offset, self.delay, limits, chain, talk)

    @property
    def has_no_unit(self) -> bool:
        """Whether campaign.toml states neither unit nor sensitivity, so that the recording must state the unit."""
        return self.unit is None and self.sensitivity is None

    @property
    def plain_unit(self) -> str | None:
        """Unit with which the unit in the recording must agree; None for a channel with a sensitivity."""
        return self.unit if self.sensitivity is None else None

    def volts(self, written: str) -> str | None:
        """Voltage unit of the recorded numbers, for a channel with a sensitivity; the recording states `written`."""
        try:
            units.channel_scale(written, ("voltage",))
        except UnitError:
            raise TableError(
                f"column {units.shown(self.column)} is in {units.shown(written)} by the file, and sensitivity "
                f"{units.shown(self.sensitivity or '')} in campaign.toml is for volts: remove the sensitivity, or "
                "correct the unit in the file"
            ) from None
        stated = self.unit
        if stated is None or units.channel_scale(stated, ("voltage", "force", *units.MOTIONS))[0] != "voltage":
            return written
        return agreed(self.column, written, stated, "voltage")

    def _recorded(self, kinds: tuple[str, ...]) -> tuple[str, float, str]:
        """Kind of the measured quantity, its SI value per recorded unit, and the recorded unit."""
        if self.sensitivity is None:
            if self.unit is None:
                raise TableError(
                    f"the file states no unit of {units.shown(self.column)}: unit is missing in campaign.toml: "
                    'write it, as unit = "N", or give a sensitivity for volts'
                )
            kind, scale = units.channel_scale(self.unit, kinds)
            return kind, scale, self.unit
        volts, kind = units.sensitivity(self.sensitivity)
        if kind not in kinds:
            raise ValueError(f"sensitivity '{self.sensitivity}' is of a {kind}, a {' or '.join(kinds)} is needed")
        unit = self.unit or "V"
        stated, scale = units.channel_scale(unit, ("voltage", *kinds))
        if stated == kind:  # the unit is that of the measured quantity; volts were recorded
            unit, scale = "V", 1.0
        elif stated != "voltage":
            raise ValueError(f"unit '{unit}' and sensitivity '{self.sensitivity}' contradict each other")
        return kind, scale / volts, unit

    @property
    def accelerates(self) -> bool:
        """Whether campaign.toml says by a unit that the sensor is one of acceleration."""
        return not self.has_no_unit and self._recorded(("force", *units.MOTIONS))[0] == "acceleration"

    @staticmethod
    def _in_recorded(value: float | str, unit: str) -> float:
        """Value in the recorded unit of a number, which has this unit already, or of a text with a unit."""
        if isinstance(value, float):
            return units.bounded(value, value)
        kind, scale = units.channel_scale(unit, ("voltage", "force", *units.MOTIONS))
        return units.quantity(value, kind, default_unit=unit) / scale

    @property
    def gain_std(self) -> float:
        """Relative standard uncertainty of the gain."""
        return 0.0 if self.exact else (defaults.GAIN_STD if self.std_gain is None else self.std_gain)

    @property
    def phase_std(self) -> float:
        """Standard uncertainty of the phase [rad]."""
        return 0.0 if self.exact else (defaults.PHASE_STD if self.std_phase is None else self.std_phase)


@dataclass(frozen=True)
class Conversion:
    """Conversion SI value = slope · (recorded − offset); limits and delay are in SI.

    `chain` has the filters and the geophone of the channel, without its calibrated response.
    """

    kind: str
    slope: float
    offset: float
    delay: float
    limits: tuple[float, float] | None
    chain: tuple[Link, ...] = ()
    crosstalk: tuple[CrossTalk, ...] = ()


_AS_IT_IS = Conversion(DRIVE, 1.0, 0.0, 0.0, None)


def _column(raw: Any) -> Any:
    """A table with a column, from the name of the column alone or the table."""
    return {"column": raw} if isinstance(raw, str) else raw


def _crosstalk(source: str, text: str, kind: str) -> CrossTalk:
    """Crosstalk from the channel `source` into a channel of a kind."""
    coefficient, of = units.crosstalk(text, kind)
    if source == "force_in" and of != "force":
        raise ValueError(f"crosstalk of force_in is per force, as in '0.001 ({units.si_unit(kind)})/N', not '{text}'")
    if source != "force_in" and of == "force":
        raise ValueError(f"crosstalk of {source} is per motion, not '{text}'")
    return CrossTalk(source, of, coefficient)


class ReferenceFile(File):
    """Reference of the rotation of the drive: the pulses of a tacho or the angle of an encoder."""

    column: str = Field(min_length=1)
    unit: str = "V"
    pulses: int = Field(1, ge=1, le=100_000)
    cycles: float = Field(1.0, gt=0, allow_inf_nan=False)

    @model_validator(mode="after")
    def _readable(self) -> ReferenceFile:
        if self.is_angle and "pulses" in self.model_fields_set:
            raise ValueError("pulses are of a tacho, an angle has none: leave out pulses, or state its unit in volts")
        return self

    @property
    def is_angle(self) -> bool:
        """Whether the column records an angle rather than pulses."""
        return units.channel_scale(self.unit, ("voltage", "angle"))[0] == "angle" and self.unit not in ("1", "-")


class DriveFile(File):
    """The signal that drives the excitation: any unit, or none."""

    column: str = Field(min_length=1)
    unit: str | None = None

    #: A drive has no unit that must agree with that of the file.
    plain_unit: ClassVar[None] = None


class TimeFile(File):
    """The column of the time, or the sample rate if there is no such column."""

    column: str | None = None
    unit: str = "s"
    sample_rate: Annotated[float, si("frequency"), Field(gt=0)] | None = None

    @model_validator(mode="after")
    def _readable(self) -> TimeFile:
        units.channel_scale(self.unit, ("time",))
        if (self.column is None) == (self.sample_rate is None):
            raise ValueError("state a column or a sample_rate, one of the two")
        return self


CHANNEL_KINDS: dict[str, tuple[str, ...]] = {
    "force_in": ("force",),
    "motion_in": units.MOTIONS,
    "motion_out": units.MOTIONS,
    "load": ("force",),
    "deflection": ("displacement",),
}


class ChannelsFile(File):
    """[channels] of campaign.toml."""

    time: TimeFile | None = None
    sample_rate: Annotated[float, si("frequency"), Field(gt=0)] | None = None
    force_in: ChannelFile | None = None
    motion_in: ChannelFile | None = None
    motion_out: ChannelFile | None = None
    load: ChannelFile | None = None
    deflection: ChannelFile | None = None
    reference: ReferenceFile | None = None
    drive: Annotated[DriveFile | None, BeforeValidator(_column)] = None

    @field_validator(*CHANNEL_KINDS)
    @classmethod
    def _of_role(cls, channel: ChannelFile | None, info: ValidationInfo) -> ChannelFile | None:
        """A channel, checked by itself, so that the faults of all channels are found."""
        role = str(info.field_name)
        if channel is None:
            return None
        # The recording states a missing unit. Any unit of the kind serves to check the other keys.
        unit = {"unit": units.si_unit(CHANNEL_KINDS[role][0])} if channel.has_no_unit else {}
        channel.model_copy(update=unit).conversion(CHANNEL_KINDS[role])
        for key in sorted(channel.model_fields_set):
            if key in _DYNAMIC_ONLY and role not in CHANNELS:
                raise ValueError(f"{key} is for channels of dynamic tests, a static one has none: remove it")
            if role not in ONLY_OF.get(key, (role,)):
                raise ValueError(f"{key} is a key of {' and '.join(ONLY_OF[key])} alone: remove it")
        return channel

    @model_validator(mode="after")
    def _readable(self) -> ChannelsFile:
        """The table; ValueError for crosstalk that does not come from another stated channel of the dynamic tests."""
        if self.time is not None and self.sample_rate is not None:
            raise ValueError("time and sample_rate are both stated: keep one of them")
        for role, channel in self.by_role.items():
            for source in channel.crosstalk:
                if source == role or role not in CHANNELS or self.named(source) is None:
                    why = "itself" if source == role else f"{source}, which is not stated"
                    raise ValueError(f"{role}: crosstalk is of another channel of the dynamic tests, not of {why}")
        return self

    def line(self, role: str) -> ChannelFile | DriveFile | None:
        """The channel of a role, or the drive; None if it is not stated."""
        return self.drive if role == DRIVE else self.named(role)

    @property
    def by_role(self) -> dict[str, ChannelFile]:
        """The channels that are stated, by their roles."""
        return {role: channel for role in CHANNEL_KINDS if (channel := self.named(role)) is not None}

    def named(self, role: str) -> ChannelFile | None:
        """The channel of a role; None if it is not stated."""
        channel: ChannelFile | None = getattr(self, role)
        return channel

    def conversion(self, role: str, written: str | None = None) -> Conversion:
        """Conversion of the numbers of a role to SI; `written` is the unit in the recording, if it states one.

        The numbers of the drive stay as they are.
        """
        if role == DRIVE:
            return _AS_IT_IS
        channel = self.named(role)
        assert channel is not None
        if channel.has_no_unit and written is not None:
            channel = channel.model_copy(update={"unit": written})
        elif channel.sensitivity is not None and written is not None and units.is_unit(written):
            channel = channel.model_copy(update={"unit": channel.volts(written)})
        return channel.conversion(CHANNEL_KINDS[role])

    def kind_of(self, role: str) -> str:
        """Kind of quantity of a channel; empty for one that is not stated, or whose unit the recordings state."""
        channel = self.named(role)
        return "" if channel is None or channel.has_no_unit else self.conversion(role).kind

    @property
    def rate(self) -> float | None:
        """Sample rate stated in place of a column of the time [Hz]; None if none is stated."""
        return self.sample_rate or (self.time.sample_rate if self.time else None)

    def without_uncertainties(self, *parts: str) -> dict[str, Any]:
        """Some parts of [channels], without the keys that state how uncertain a channel is."""
        return self.model_dump(
            include=set(parts), exclude={part: _UNCERTAINTIES for part in parts if part in CHANNEL_KINDS}
        )


#: The classes of which [channels] is made.
CLASSES: tuple[type, ...] = (ChannelsFile, ChannelFile, ReferenceFile, DriveFile, TimeFile, HighPass, LowPass, Geophone)
