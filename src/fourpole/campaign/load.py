"""The file of one test becomes SI channels, by what campaign.toml says of its columns."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from fourpole import units
from fourpole.campaign.channels import ChannelsFile, ReferenceFile
from fourpole.campaign.folder import Test, inside
from fourpole.campaign.gather import Gathered, Timing, Turning, agreed
from fourpole.campaign.response import read_response
from fourpole.core.arrays import FloatArray
from fourpole.core.checks import clipped_share
from fourpole.core.demodulation.demodulate import first_guess
from fourpole.core.loadcurve import LoadCurve
from fourpole.core.recording import Channel, Recording
from fourpole.core.reference import Reference
from fourpole.errors import FourpoleError, RecordingError, TableError
from fourpole.io.recordings import Piece, Source, pieces
from fourpole.io.signals import MAX_FILE_BYTES

__all__ = ["MOST_BYTES", "group_of", "load_curve", "load_recording"]

MOST_BYTES = MAX_FILE_BYTES
#: A reference and V1 turn alike within this.
_SAME_SPEED = 0.03


def group_of(path: Path, test: Test) -> str:
    """The group that `file#group` names; empty where the file itself is named."""
    file, mark, group = test.file.rpartition("#")
    return group if mark and Path(file).name == path.name else ""


def load_recording(
    folder: Path, path: Path, test: Test, channels: ChannelsFile, roles: Sequence[str]
) -> tuple[Recording, list[str]]:
    """The channels `roles` of a dynamic test, and the drive's reference, with remarks on their times."""
    found, remarks, reference = _gathered(path, test, channels, roles, channels.reference)
    for role, channel in found.items():
        stated = channels.named(role)
        if stated is not None and stated.response is not None:
            response = read_response(inside(folder, stated.response), stated.response)
            found[role] = replace(channel, chain=(*channel.chain, response))
    return Recording(found["motion_in"].rate or 1.0, found, test.file, reference), remarks


def load_curve(path: Path, test: Test, channels: ChannelsFile) -> LoadCurve:
    """The load-deflection curve of a static test; channels at different times are taken at those of the slower."""
    found = _gathered(path, test, channels, ("load", "deflection"), None, timed=test.window is not None)[0]
    force, travel = found["load"], found["deflection"]
    for name, channel in found.items():
        if channel.limits is not None and clipped_share(channel) > 0:
            raise TableError(f"{name} reaches the end of its stated range: repeat the test with a larger range")
    load, deflection = force.samples, travel.samples
    if (force.rate, force.start, load.size) != (travel.rate, travel.start, deflection.size):
        slow, quick = sorted((force, travel), key=lambda channel: channel.rate or 0.0)
        at = _times(slow)
        within = (at >= _times(quick)[0]) & (at <= _times(quick)[-1])
        brought = np.interp(at[within], _times(quick), quick.samples)
        own = slow.samples[within]
        load, deflection = (own, brought) if slow is force else (brought, own)
    return LoadCurve(deflection, load)


def _times(channel: Channel) -> FloatArray:
    """Time of each sample [s]."""
    return channel.start + np.arange(channel.samples.size) / (channel.rate or 1.0)


def _gathered(
    path: Path,
    test: Test,
    channels: ChannelsFile,
    roles: Sequence[str],
    turning: ReferenceFile | None,
    *,
    timed: bool = True,
) -> tuple[dict[str, Channel], list[str], Reference | None]:
    """Channels by role, remarks, and the reference; not `timed`: channels of as many samples were taken at once."""
    stated = {role: channel for role in roles if (channel := channels.named(role)) is not None}
    timing = Timing(channels.rate if timed else None, test.window, test.value("frequency"), test.file)
    clock = channels.time.column if timed and channels.rate is None and channels.time is not None else None
    columns = [channel.column for channel in stated.values()] + ([turning.column] if turning is not None else [])
    count, stretches = pieces(Source(path, tuple(columns), clock, group_of(path, test), test.file))
    lines: dict[str, Gathered] = {}
    turn = Turning(turning, timing) if turning is not None else None
    for piece in stretches:
        time = _clock_times(piece, channels) if clock is not None else None
        if count and not lines and timing.near is None and "motion_in" in stated:
            timing = replace(timing, near=_about(piece, channels, timing, time))
        by_count = not timed and len({signal.samples.size for signal in piece.signals.values()}) == 1
        for role, channel in stated.items():
            signal = piece.signals[channel.column]
            if role not in lines:
                conversion = channels.conversion(role, signal.unit)
                lines[role] = Gathered(channel.column, conversion, channel.plain_unit, timing, count)
            lines[role].feed(replace(signal, rate=1.0, time=None) if by_count else signal, time)
        if turn is not None and turning is not None:
            turn.feed(piece.signals[turning.column], time)
    found, remarks = {}, []
    for role, line in lines.items():
        found[role], remark = line.channel()
        remarks += [remark] if remark else []
    reference = None
    if turn is not None:
        try:
            reference = _checked(turn.reference(), found, timing)
        except RecordingError as error:
            remarks.append(f"[channels] reference is not used: {error}")
    return found, list(dict.fromkeys(remarks)), reference


def _checked(reference: Reference, found: dict[str, Channel], timing: Timing) -> Reference:
    """The reference; RecordingError where it turns at another speed than V1."""
    recording = Recording(found["motion_in"].rate or 1.0, {"motion_in": found["motion_in"]}, timing.label, reference)
    first, last = recording.span
    turned = reference.omega(first, last) / (2 * np.pi)
    moved = first_guess(recording.between(first, last), timing.near)
    if abs(turned / moved - 1) > _SAME_SPEED:
        raise RecordingError(
            f"it turns at {turned:.5g} Hz, V1 at {moved:.5g} Hz: check pulses and cycles, and that no pulse is lost to "
            "the sample rate"
        )
    return reference


def _about(piece: Piece, channels: ChannelsFile, timing: Timing, clock: FloatArray | None) -> float | None:
    """About the frequency of the excitation, by V1 in the first stretch of a long recording [Hz]."""
    role = channels.named("motion_in")
    assert role is not None
    signal = piece.signals[role.column]
    line = Gathered(role.column, channels.conversion("motion_in", signal.unit), role.plain_unit, timing, 0)
    try:
        line.feed(signal, clock)
        return first_guess(Recording(1.0, {"motion_in": line.channel()[0]}))
    except FourpoleError:
        return None  # whatever is wrong is told where the channel is gathered


def _clock_times(piece: Piece, channels: ChannelsFile) -> FloatArray | None:
    """The column of times in seconds, where the file has one and no times of its own."""
    if piece.clock is None or channels.time is None:
        return None
    column = channels.time.column or ""
    scale = units.unit_scale(agreed(column, piece.clock.unit, channels.time.unit, "time"), "time")
    return piece.clock.samples * scale
