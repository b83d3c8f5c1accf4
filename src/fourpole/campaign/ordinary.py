"""Ordinary errors of a channel, as delay, low-cut, slope and mounting: as stated, or by the table of components.

`Stated` is a value with its standard uncertainty, as a text or a table states it; some are doubtful.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, StrictBool

from fourpole import units
from fourpole.campaign import defaults
from fourpole.campaign.channels import ONLY_OF, ChannelFile, ChannelsFile, File, Ratio, known_keys, si
from fourpole.core.channelerrors import ChannelUncertainty
from fourpole.core.components import SpecimenUncertainty, component
from fourpole.core.phasor import CHANNELS
from fourpole.core.sources import Kind


class LoggerFile(File):
    """[logger]: whether one card samples all channels at once."""

    simultaneous: StrictBool = False


class UnstatedFile(File):
    """[unstated]: what counts for the ordinary errors of which nothing is stated.

    `support` is what frame and foundation of a moving rig add to its preload spring, over it, `guide_friction` the dry
    friction of its guide, and `frame` how stiff the frame of a bench is at least, all as standard uncertainties.
    """

    ordinary: Literal["table", "zero"] = "table"
    support: Ratio | None = None
    guide_friction: Annotated[float, si("force"), Field(ge=0)] | None = None
    frame: Annotated[float, si("stiffness"), Field(gt=0)] | None = None

    def rig_std(self, *, rigid: bool, guided: bool) -> dict[str, float]:
        """Standard uncertainties of the support [1], of the friction [N], and of a bench's compliance [m/N].

        `rigid` says that no stiffness of a frame is stated, `guided` that the mass is no blocking mass, which hangs
        freely in place of a force cell.
        """
        counted = self.ordinary == "table"
        support, frame = (defaults.SUPPORT_STD, defaults.FRAME_STD) if counted and rigid else (0.0, 0.0)
        friction = defaults.FRICTION_STD if counted and guided else 0.0
        return {
            "support": support if self.support is None else self.support,
            "friction": friction if self.guide_friction is None else self.guide_friction,
            "frame_std": frame if self.frame is None else 1 / self.frame,
        }


def _pair(gain: Kind, angle: Kind) -> complex:
    """Standard uncertainties of the table, of gain [1] + j angle [rad]."""
    return complex(component(gain).std, component(angle).std)


_MOUNTING = _pair(Kind.MOUNTING_GAIN, Kind.MOUNTING_PHASE)
_REMOUNTING = _pair(Kind.REMOUNTING_GAIN, Kind.REMOUNTING_PHASE)
_BLOCK = _pair(Kind.BLOCK, Kind.ANGLE_BLOCK)
_DRIFT = _pair(Kind.DRIFT, Kind.ANGLE_DRIFT)
#: Fields of the uncertainty of a channel.
_OF_CHANNEL = ("gain", "phase", "delay", "low_cut", "slope", "mounting", "remounting", "crosstalk")
#: The assumption of a campaign in which nothing is taken from the table.
_ZERO = (
    '[unstated] ordinary = "zero": delay, low-cut, slope, mounting, linearity, block, drift and preload damping '
    "that are not stated count as exactly zero"
)

#: The channels that a note names, where not all of the dynamic tests have the key: F1's linearity has no effect.
_NOTED = {**ONLY_OF, "linearity": ("load", "deflection")}


def _scaled(table: complex, gain: float | None, otherwise: complex) -> complex:
    """The pair of a stated gain, whose angle is in the proportion of the table; `otherwise` if none is stated."""
    return otherwise if gain is None else gain * table / table.real


def _half(channel: ChannelFile, most: complex = complex(np.inf, np.inf)) -> complex:
    """Half of the standard uncertainties of gain and phase of a channel, at most those of a pair."""
    return complex(min(channel.gain_std / 2, most.real), min(channel.phase_std / 2, most.imag))


@dataclass(frozen=True)
class Ordinary:
    """Standard uncertainties of the ordinary errors.

    Attributes
    ----------
    counted : bool
        Whether an error of which nothing is stated counts with the size of the table, and not as zero.
    simultaneous : bool
        Whether all channels are sampled at once.
    on_rig : bool
        Whether V1 is taken as a sensor of the rig, which no change of the specimen touches.
    """

    counted: bool = True
    simultaneous: bool = False
    on_rig: bool = False

    def _taken(self, channel: ChannelFile, std: float) -> float:
        return std if self.counted and not channel.exact else 0.0

    def delay(self, channel: ChannelFile) -> float:
        """Standard uncertainty of the delay [s]."""
        std = defaults.SIMULTANEOUS_STD if self.simultaneous else component(Kind.DELAY).std
        return self._taken(channel, std) if channel.std_delay is None else channel.std_delay

    def low_cut(self, channel: ChannelFile) -> float:
        """Standard uncertainty of the corner of a first-order low-cut [Hz]."""
        if (stated := channel.stated_low_cut_std) is not None:
            return stated
        if channel.exact or channel.coupling == "dc" or channel.high_pass is not None:
            return 0.0
        if channel.low_cut is not None:
            return defaults.LOW_CUT_STD * channel.low_cut
        if channel.geophone is not None:
            return 0.0
        supplied = channel.coupling == "iepe" or (channel.coupling is None and channel.accelerates)
        std = defaults.IEPE_STD if supplied else component(Kind.LOW_CUT).std
        return self._taken(channel, std) if channel.coupling is None else std

    def slope(self, channel: ChannelFile, top: float) -> float:
        """Standard uncertainty of the rise of the gain with frequency squared [1/Hz²]; `top` is the highest [Hz]."""
        if channel.resonance is not None:
            return channel.resonance**-2
        std = self._taken(channel, component(Kind.SLOPE).std) if channel.std_slope is None else channel.std_slope
        return std / top**2

    def mounting(self, channel: ChannelFile) -> complex:
        """Standard uncertainty of gain and phase of V1 that is another in each mounting [1] + j [rad]."""
        mounted = channel.mounted or ("rig" if self.on_rig or not self.counted else "specimen")
        share = {"specimen": 1.0, "drive": defaults.ON_DRIVE, "rig": 0.0}[mounted]
        return _scaled(_MOUNTING, channel.std_mounting, share * _half(channel, _MOUNTING))

    def remounting(self, channel: ChannelFile) -> complex:
        """Standard uncertainty of gain and phase of F1 or V2 that is another with each added mass [1] + j [rad]."""
        unstated = _half(channel, _REMOUNTING) if self.counted else 0j
        by_word = {None: unstated, True: _half(channel), False: 0j}[channel.remounted_with_mass]
        return _scaled(_REMOUNTING, channel.std_remounting, by_word)

    def summary(self, role: str, channel: ChannelFile) -> dict[str, float]:
        """The part of gain and phase that is another in each mounting of V1, or of F1 and V2 with each mass, if any."""
        if role not in CHANNELS:
            return {}
        part = self.mounting(channel) if role == "motion_in" else self.remounting(channel)
        return {"mounting gain [1]": part.real, "mounting phase [rad]": part.imag} if part else {}

    def linearity(self, channel: ChannelFile) -> float:
        """Standard uncertainty of the departure of a channel from a straight line, over its range [1]."""
        std = component(Kind.K1_LINEARITY).std
        return self._taken(channel, std) if channel.linearity is None else channel.linearity

    def uncertainty(self, channels: Mapping[str, ChannelFile | None], top: float) -> ChannelUncertainty:
        """Standard uncertainties of F1, V1 and V2 by role, zero for a channel that is not stated; see `slope`."""
        values = np.zeros((8, 3), dtype=complex)
        for column, role in enumerate(CHANNELS):
            if (channel := channels.get(role)) is not None:
                own = self.mounting(channel) if role == "motion_in" else 0j
                with_mass = self.remounting(channel) if role != "motion_in" else 0j
                errors = self.delay(channel), self.low_cut(channel), self.slope(channel, top)
                known = channel.gain_std, channel.phase_std, *errors
                values[:, column] = *known, own, with_mass, channel.std_crosstalk
        named: dict[str, Any] = dict(zip(_OF_CHANNEL, values, strict=True))
        apart = ("mounting", "remounting")
        return ChannelUncertainty(**{name: std if name in apart else std.real for name, std in named.items()})

    def specimens(self, block: float | None, drift: float | None) -> SpecimenUncertainty:
        """Uncertainties of the specimens for stated relative sizes of the modulus of K* [1]."""
        pairs = ((table, size, self.counted * table) for table, size in ((_BLOCK, block), (_DRIFT, drift)))
        return SpecimenUncertainty(*(_scaled(*pair) for pair in pairs))

    def notes(self, channels: ChannelsFile, unstated: Sequence[str]) -> list[str]:
        """What is taken where nothing is stated, each with the key that replaces it.

        `unstated` are the keys of [conditions] that are not stated.
        """
        by_role = {role: one for role, one in channels.by_role.items() if role in CHANNELS or not one.exact}
        if not by_role or not self.counted:
            return [_ZERO] if by_role else []
        inexact, notes = {role: channel for role, channel in by_role.items() if not channel.exact}, []
        for keys, words in self._words().items():
            roles = [role for role in _NOTED.get(keys[0], CHANNELS) if role in inexact]
            lacking = [role for role in roles if all(getattr(inexact[role], key) is None for key in keys)]
            notes += [f"[channels] {', '.join(lacking)}: {words}"] if lacking else []
        sizes = {"std_block": (_BLOCK, "in the tests with an added mass"), "std_drift": (_DRIFT, "over the run")}
        for key, (size, words) in ((key, sizes[key]) for key in unstated if set(CHANNELS) & by_role.keys()):
            taken = f"taken as {100 * size.real:g} % of |K*| and {size.imag:g} rad {words}"
            notes.append(f"[conditions] no {key} stated, {taken}")
        return notes

    def _words(self) -> dict[tuple[str, ...], str]:
        """Each assumption, by the keys of a channel that replace it."""
        delay, low_cut, slope = (component(kind).std for kind in (Kind.DELAY, Kind.LOW_CUT, Kind.SLOPE))
        one_card = f"{1e6 * defaults.SIMULTANEOUS_STD:g} µs"
        taken = one_card if self.simultaneous else f"{1e6 * delay:g} µs ([logger] simultaneous = true: {one_card})"
        mounting, remounting = (
            f"at most {100 * size.real:g} % and {np.degrees(size.imag):g} deg of gain and phase"
            for size in (_MOUNTING, _REMOUNTING)
        )
        mounted = f'"specimen": {mounting} in each mounting ("drive": a tenth; "rig": none)'
        mounted = '"rig", as it is a displacement and the drive an actuator' if self.on_rig else mounted
        hint = "(false: none; true: half of std_gain and std_phase)"
        return {
            ("std_delay",): f"no std_delay stated, taken as {taken}",
            ("coupling", "low_cut", "std_low_cut", "high_pass", "geophone"):
                f"no coupling stated, the low-cut taken as 0 ± {low_cut:g} Hz, of an acceleration ± "
                f'{defaults.IEPE_STD:g} Hz (coupling = "dc": none)',
            ("std_slope", "resonance"):
                f"no std_slope stated, taken as {100 * slope:g} % at the highest frequency (or state its resonance)",
            ("mounted", "std_mounting"): f"no mounted stated, taken as {mounted}",
            ("remounted_with_mass", "std_remounting"):
                f"no remounted_with_mass stated, taken as {remounting} with each added mass {hint}",
            ("linearity",):
                f"no linearity stated, taken as {100 * component(Kind.K1_LINEARITY).std:g} % of the range, in K1",
        }  # fmt: skip


@dataclass(frozen=True)
class Stated:
    """A value and its standard uncertainty in SI; `assumed` if campaign.toml does not state the uncertainty."""

    value: float
    std: float
    assumed: bool


def stated_value(raw: Any, kind: str) -> Stated:
    """A rig value from a text such as "15 kg", or from a table of value, unit, std and exact."""
    if isinstance(raw, str):
        raw = {"value": raw}
    if not isinstance(raw, dict):
        raise ValueError(
            f'write it with its unit, as "15 kg" or {{ value = 15.0, unit = "kg", std = 0.1 }}, not {raw!r}'
        )
    known_keys(raw, ("value", "unit", "std", "exact"))
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
        return Stated(value, defaults.RIG_STD * abs(value), assumed=value != 0)
    if isinstance(raw["std"], str) and raw["std"].strip().endswith("%"):
        std = abs(value) * units.quantity(raw["std"], "ratio")
    else:
        std = units.quantity(raw["std"], kind, default_unit=unit)
    if std < 0:
        raise ValueError("std is negative: state a standard uncertainty, zero or positive")
    return Stated(value, std, assumed=False)


#: A gain, and a value of the rig, is not known at all beyond this relative standard uncertainty; a phase beyond [rad].
_MOST_RATIO, _MOST_PHASE = 0.5, 0.5
#: Values of a rig that are always known roughly; a damping may not be.
_WEIGHED = ("moving_mass", "preload_stiffness")


def doubtful_uncertainties(
    channels: Mapping[str, ChannelFile], rigs: Mapping[str, Mapping[str, Stated]]
) -> Iterator[str]:
    """Standard uncertainties so large that another number was probably meant; equal ones of channels together."""
    for key, most in (("std_gain", _MOST_RATIO), ("std_phase", _MOST_PHASE)):
        alike: dict[float, list[str]] = {}
        for role, channel in channels.items():
            if (std := getattr(channel, key)) is not None and std > most:
                alike.setdefault(std, []).append(role)
        for std, roles in alike.items():
            size = f"{100 * std:g} %" if key == "std_gain" else f"{np.degrees(std):.3g} degrees"
            likely = f' A number alone is a ratio: if {std:g} % is meant, write "{std:g} %".'
            hint = likely if key == "std_gain" and std >= 1 else ""
            yield f"{_of(roles, key)} is {size}, as if {_sensors(roles)} not calibrated: is that so?{hint}"
    for name, rig in rigs.items():
        for part in _WEIGHED:
            weighed = rig.get(part)
            if weighed is not None and abs(weighed.std) > _MOST_RATIO * abs(weighed.value) > 0:
                where = f"campaign.toml: {f'rigs.{name}' if name else 'rig'}.{part}"
                percent = 100 * weighed.std / abs(weighed.value)
                yield f"{where} has a standard uncertainty of {percent:.3g} % of it: is that so?"


def _of(roles: Sequence[str], key: str) -> str:
    """A key of some channels in campaign.toml."""
    if len(roles) == 1:
        return f"campaign.toml: channels.{roles[0]}.{key}"
    return f"campaign.toml: [channels] {key} of {', '.join(roles)}"


def _sensors(roles: Sequence[str]) -> str:
    return "the sensor were" if len(roles) == 1 else "the sensors were"
