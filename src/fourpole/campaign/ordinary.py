"""Ordinary errors of a channel, as delay, low-cut, slope and mounting: as stated, or by the table of components."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from pydantic import StrictBool

from fourpole.campaign import defaults
from fourpole.campaign.channels import ChannelFile, ChannelsFile, File
from fourpole.core.components import SpecimenUncertainty, component
from fourpole.core.phasor import CHANNELS
from fourpole.core.sources import Kind


class LoggerFile(File):
    """[logger]: whether one card samples all channels at once."""

    simultaneous: StrictBool = False


class UnstatedFile(File):
    """[unstated]: what counts for the ordinary errors of which nothing is stated."""

    ordinary: Literal["table", "zero"] = "table"


def _pair(gain: Kind, angle: Kind) -> complex:
    """Standard uncertainties of the table, of gain [1] + j angle [rad]."""
    return complex(component(gain).std, component(angle).std)


_MOUNTING = _pair(Kind.MOUNTING_GAIN, Kind.MOUNTING_PHASE)
_REMOUNTING = _pair(Kind.REMOUNTING_GAIN, Kind.REMOUNTING_PHASE)
_BLOCK = _pair(Kind.BLOCK, Kind.ANGLE_BLOCK)
_DRIFT = _pair(Kind.DRIFT, Kind.ANGLE_DRIFT)
#: The assumption of a campaign in which nothing is taken from the table.
_ZERO = (
    '[unstated] ordinary = "zero": delay, low-cut, slope and mounting of the channels, block and drift of the '
    "specimens and the damper of the preload spring count as exactly zero where nothing is stated of them"
)


def _percent(std: float) -> str:
    return f"{100 * std:g} %"


def _degrees(std: float) -> str:
    return f"{np.degrees(std):g} deg"


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
        std = defaults.IEPE_STD if channel.coupling == "iepe" else component(Kind.LOW_CUT).std
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

    def linearity(self, channel: ChannelFile) -> float:
        """Standard uncertainty of the departure of a channel from a straight line, over its range [1]."""
        std = component(Kind.K1_LINEARITY).std
        return self._taken(channel, std) if channel.linearity is None else channel.linearity

    def specimens(self, block: float | None, drift: float | None) -> SpecimenUncertainty:
        """Uncertainties of the specimens for stated sizes of |K*| [1]."""
        return SpecimenUncertainty(
            _scaled(_BLOCK, block, self.counted * _BLOCK), _scaled(_DRIFT, drift, self.counted * _DRIFT)
        )

    def notes(self, channels: ChannelsFile, unstated: Sequence[str]) -> list[str]:
        """What is taken where nothing is stated, each with the key that replaces it.

        `unstated` are the keys of [conditions] that are not stated.
        """
        moving = {role: channel for role in CHANNELS if (channel := channels.named(role)) is not None}
        if not moving or not self.counted:
            return [_ZERO] if moving else []
        notes = []
        for keys, roles, words in self._words():
            lacking = [
                role
                for role, channel in moving.items()
                if role in roles and not channel.exact and all(getattr(channel, key) is None for key in keys)
            ]
            notes += [f"[channels] {', '.join(lacking)}: {words}"] if lacking else []
        for key, words, size in (("std_block", "in the tests with an added mass", _BLOCK),
                                 ("std_drift", "over the run", _DRIFT)):  # fmt: skip
            taken = f"taken as {_percent(size.real)} of |K*| and {size.imag:g} rad {words}"
            notes += [f"[conditions] no {key} stated, {taken}"] if key in unstated else []
        return notes

    def _words(self) -> Iterator[tuple[tuple[str, ...], tuple[str, ...], str]]:
        """The keys of a channel that replace an assumption, the channels that have them, and the assumption."""
        delay, low_cut, slope = (component(kind).std for kind in (Kind.DELAY, Kind.LOW_CUT, Kind.SLOPE))
        one_card = f"{1e6 * defaults.SIMULTANEOUS_STD:g} µs"
        taken = one_card if self.simultaneous else f"{1e6 * delay:g} µs ([logger] simultaneous = true: {one_card})"
        yield ("std_delay",), CHANNELS, f"no std_delay stated, taken as {taken}"
        yield (
            ("coupling", "low_cut", "std_low_cut", "high_pass", "geophone"), CHANNELS,
            f'no coupling stated, the low-cut taken as 0 ± {low_cut:g} Hz (coupling = "dc": none)',
        )  # fmt: skip
        yield (
            ("std_slope", "resonance"), CHANNELS,
            f"no std_slope stated, taken as {_percent(slope)} at the highest frequency (or resonance of the sensor)",
        )  # fmt: skip
        most = f"at most {_percent(_MOUNTING.real)} and {_degrees(_MOUNTING.imag)} of gain and phase"
        by_specimen = f'no mounted stated, taken as "specimen": {most} in each mounting ("drive": a tenth; "rig": none)'
        on_rig = 'no mounted stated, taken as "rig", as it is a displacement and the drive an actuator'
        yield ("mounted", "std_mounting"), ("motion_in",), on_rig if self.on_rig else by_specimen
        most = f"at most {_percent(_REMOUNTING.real)} and {_degrees(_REMOUNTING.imag)} of gain and phase"
        yield (
            ("remounted_with_mass", "std_remounting"), ("force_in", "motion_out"),
            f"no remounted_with_mass stated, taken as {most} with each added mass (false: none; true: more)",
        )  # fmt: skip
