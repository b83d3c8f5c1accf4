"""The file of one test becomes channels in SI units, as campaign.toml states its columns."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from fourpole.campaign.channels import ChannelFile, ChannelsFile, DriveFile, ReferenceFile
from fourpole.campaign.place import inside
from fourpole.campaign.row import Test
from fourpole.core.arrays import FloatArray
from fourpole.core.demodulation.demodulate import first_guess
from fourpole.core.loadcurve import LoadCurve
from fourpole.core.recording import Channel, Recording
from fourpole.core.recordingchecks import clipped_share
from fourpole.core.reference import Reference
from fourpole.errors import FileError, FourpoleError, Message, RecordingError, TableError
from fourpole.io.recordings import survey
from fourpole.io.signals import MAX_FILE_BYTES, Signal
from fourpole.io.stream import Chunk, Stream, StreamSource, stream, times_of
from fourpole.study.gather import ChannelBuilder, ReferenceBuilder, Timing
from fourpole.study.response import read_response

MOST_BYTES = MAX_FILE_BYTES
#: Number of samples per chunk where only the first part of a recording is loaded.
_ROWS_OF_PART = 1 << 14
#: Endings of the formats that may state when a recording began.
_DATED = (".mf4", ".mf3", ".mdf", ".dat", ".raw", ".tdms")
#: Relative tolerance within which the reference turns at the frequency of V1.
_SAME_SPEED = 0.03


def group_of(path: Path, test: Test) -> str:
    """The group that `file#group` names; empty where the file itself is named."""
    file, mark, group = test.file.rpartition("#")
    return group if mark and Path(file).name == path.name else ""


def recorded_at(path: Path) -> float | None:
    """Time at which a recording began [s], from 1970 on; None where its file does not state it.

    FileError if the file cannot be opened or read.
    """
    if path.suffix.lower() not in _DATED:
        return None
    try:
        return survey(path, max_bytes=MOST_BYTES).began
    except FileError:  # a disk that fails now must not make other results than one that does not
        raise
    except FourpoleError:
        return None


def load_recording(
    folder: Path, path: Path, test: Test, channels: ChannelsFile, roles: Sequence[str], *, part: float | None = None
) -> tuple[Recording, list[Message]]:
    """The channels `roles` of a dynamic test and the reference of the drive, with remarks on their times.

    With `part` [s], the recording ends this long after its own start, or after the start of the window.
    """
    found, remarks, reference = _gathered(path, test, channels, roles, channels.reference, part=part)
    for role, channel in found.items():
        stated = channels.named(role)
        if isinstance(stated, ChannelFile) and stated.response is not None:
            response = read_response(inside(folder, stated.response), stated.response)
            found[role] = replace(channel, chain=(*channel.chain, response))
    return Recording(found["motion_in"].rate or 1.0, found, test.file, reference), remarks


def load_curve(path: Path, test: Test, channels: ChannelsFile) -> LoadCurve:
    """The load-deflection curve of a static test.

    Channels with different times are interpolated at the times of the channel with the lower sample rate. The curve has
    times where the file or campaign.toml states them.
    """
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
        return LoadCurve(deflection, load, at[within])
    timed = force if test.window is not None else _timed(path, test, channels)
    time = _times(timed) if timed is not None and timed.samples.size == load.size else None
    return LoadCurve(deflection, load, time)


def _timed(path: Path, test: Test, channels: ChannelsFile) -> Channel | None:
    """The load with the times that the file or campaign.toml states; None if they are unknown or not uniform."""
    try:
        return _gathered(path, test, channels, ("load", "deflection"), None)[0]["load"]
    except FileError:
        raise
    except FourpoleError:
        return None


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
    part: float | None = None,
) -> tuple[dict[str, Channel], list[Message], Reference | None]:
    """Channels by role, remarks, and the reference.

    If not `timed`, channels with equal numbers of samples count as sampled at the same times.
    """
    stated = {role: channel for role in roles if (channel := channels.line(role)) is not None}
    near = test.value("frequency") if test.band is None else test.band[1]
    timing = Timing(test.window, near, test.file)
    columns: list[ChannelFile | DriveFile | ReferenceFile] = [
        *stated.values(),
        *([turning] if turning is not None else []),
    ]
    source = source_of(path, test, channels, columns, timed=timed)
    run = stream(source if part is None else replace(source, rows=_ROWS_OF_PART))
    turn = ReferenceBuilder(turning, timing) if turning is not None else None
    lines, timing = _fed(run, channels, stated, turn, timing, part)
    built = {role: line.channel() for role, line in lines.items()}
    found = {role: channel for role, (channel, _) in built.items()}
    remarks = [Message("time base", "", said) for _, said in built.values() if said]
    reference = None
    if turn is not None:
        try:
            reference = _checked(turn.reference(), found, timing)
        except RecordingError as error:
            remarks.append(Message("reference", error.site, f"[channels] reference is not used: {error}"))
    return found, list(dict.fromkeys(remarks)), reference


def _fed(
    run: Stream,
    channels: ChannelsFile,
    stated: Mapping[str, ChannelFile | DriveFile],
    turn: ReferenceBuilder | None,
    timing: Timing,
    part: float | None,
) -> tuple[dict[str, ChannelBuilder], Timing]:
    """The channels by role with all their chunks, and the times that are stated or found."""
    lines: dict[str, ChannelBuilder] = {}
    for chunk in run.chunks:
        signals = dict(zip(stated, chunk, strict=False))
        if not lines:
            if part is not None:
                timing = replace(timing, window=_part_of(chunk, timing.window, part))
            if run.count and timing.near is None and "motion_in" in stated:
                timing = replace(timing, near=_about(signals["motion_in"], channels, timing))
            for role, channel in stated.items():
                made = channels.conversion(role, signals[role].unit)
                lines[role] = ChannelBuilder(channel.column, made, channel.plain_unit, timing, run.count)
        for role, line in lines.items():
            line.feed(signals[role])
        if turn is not None:
            turn.feed(chunk[-1])
        if part is not None and timing.window is not None and _is_behind(chunk, timing.window[1]):
            break
    return lines, timing


def _part_of(chunk: Chunk, window: tuple[float, float] | None, part: float) -> tuple[float, float]:
    """Start and end of the first part of a recording, or of its window [s]."""
    start = window[0] if window is not None else max(float(time[0]) for time in _known_times(chunk))
    return start, min(start + part, window[1] if window is not None else np.inf)


def _is_behind(chunk: Chunk, end: float) -> bool:
    """Whether the chunk ends after the time `end` [s] in all channels."""
    return min((float(time[-1]) for time in _known_times(chunk)), default=-np.inf) > end


def _known_times(chunk: Chunk) -> list[FloatArray]:
    return [time for signal in chunk if signal.samples.size and (time := times_of(signal)) is not None]


def source_of(
    path: Path,
    test: Test,
    channels: ChannelsFile,
    columns: Sequence[ChannelFile | DriveFile | ReferenceFile],
    *,
    timed: bool = True,
) -> StreamSource:
    """The columns that are read of a recording, and the stated times."""
    names = tuple(channel.column for channel in columns)
    source = StreamSource(path, names, test.file, group_of(path, test), needs="times" if timed else "order")
    if not timed or channels.rate is not None or channels.time is None:
        return replace(source, rate=channels.rate if timed else None)
    return replace(source, clock=channels.time.column, unit=channels.time.unit)


def _checked(reference: Reference, found: dict[str, Channel], timing: Timing) -> Reference:
    """The reference; RecordingError where its speed differs from the frequency of V1."""
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


def _about(signal: Signal, channels: ChannelsFile, timing: Timing) -> float | None:
    """Approximate frequency of the excitation [Hz], from V1 in the first chunk of a long recording."""
    role = channels.named("motion_in")
    assert role is not None
    line = ChannelBuilder(role.column, channels.conversion("motion_in", signal.unit), role.plain_unit, timing, 0)
    try:
        line.feed(signal)
        return first_guess(Recording(1.0, {"motion_in": line.channel()[0]}))
    except FourpoleError:
        return None  # the builder of the channel raises the same error
