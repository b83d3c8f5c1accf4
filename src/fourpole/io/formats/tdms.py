"""NI TDMS: groups of channels, scaled as the file says, evenly spaced where it states an increment.

Only the named file is read, never the index beside it. Where channels were started at different times
(`wf_start_time`), the file's zero is the earliest of them.
"""

from __future__ import annotations

import os
import re
import struct
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from fourpole.errors import TableError
from fourpole.io.formats.guard import Guard, afford, find, floats, of_name, tidy
from fourpole.io.formats.pieces import Part, Track, by_tracks
from fourpole.io.signals import MAX_FILE_BYTES, FileInfo, Format, Request, SignalInfo
from fourpole.io.source import name_of, open_regular
from fourpole.units import shown

__all__ = ["FORMAT"]

_KIND = "an NI TDMS file"
_LIBRARY = "nptdms"
_UNITS = ("unit_string", "NI_UnitDescription", "unit", "Unit", "units")
_NOTES = ("description", "NI_ChannelName", "sensor", "Sensor")
_SCALE = re.compile(r"NI_Scale\[[0-9]+\]_Scale_Type")
_LEAD_IN = 28
_OPEN_END = 0xFFFFFFFFFFFFFFFF
_METADATA, _NEW_LIST, _INTERLEAVED, _BIG_ENDIAN, _DAQMX = (1 << bit for bit in (1, 2, 5, 6, 7))
_AT_ONCE = 1 << 24  # bytes of a chunk that the library may hold
_SAMPLES_AT_ONCE = 1 << 20
_SMALLEST_OBJECT = 12
_MOST_ENTRIES = 20_000_000
_MOST_PIECES = 2_000_000


def _recognises(head: bytes) -> bool:
    return head[:4] in (b"TDSm", b"TDSh")


def _check(file: BinaryIO, name: str, max_bytes: int) -> None:
    """Walk over the segments: a damaged or hostile list of objects is refused before it is built."""
    end = os.fstat(file.fileno()).st_size
    lead = file.read(_LEAD_IN)
    if lead[:4] == b"TDSh":
        raise TableError(f"{name}: is the index of a TDMS file, without samples; name the .tdms file itself")
    position, held, entries = 0, 0, 0
    while len(lead) == _LEAD_IN:
        if lead[:4] != b"TDSm":
            what = "is not " + _KIND if position == 0 else "is damaged"
            raise TableError(f"{name}: {what}: no segment begins at byte {position}; copy or export it again")
        flags = int.from_bytes(lead[4:8], "little")
        order = ">" if flags & _BIG_ENDIAN else "<"
        length, metadata = struct.unpack(f"{order}QQ", lead[12:28])
        if length != _OPEN_END and position + _LEAD_IN + length > end:
            raise TableError(f"{name}: is cut short in the segment at byte {position}; copy or export it again")
        if flags & _METADATA:
            (objects,) = struct.unpack(f"{order}I", file.read(4))
            if objects * _SMALLEST_OBJECT > min(metadata, end - position):
                raise TableError(f"{name}: is damaged: the segment at byte {position} declares {objects} objects")
            held = objects if flags & _NEW_LIST else held + objects
            entries += held
        if entries > _MOST_ENTRIES:
            raise TableError(f"{name}: has more parts than can be kept in order; export it again, defragmented")
        position += _LEAD_IN + length if length != _OPEN_END else end
        file.seek(min(position, end))
        lead = file.read(_LEAD_IN)
    if lead and position < end:
        raise TableError(f"{name}: is cut short at byte {position}; copy or export it again")
    afford(8 * entries, max_bytes, name, "the list of its parts")
    file.seek(0)


def _unit(channel: Any) -> str | None:
    stated = (channel.properties.get(key) for key in _UNITS)
    return of_name(channel.name, next((one for one in stated if isinstance(one, str) and one.strip()), None))


def _timing(channel: Any, zero: tuple[int, int] | None) -> tuple[float | None, float]:
    """Rate and start; both of the waveform that the channel states."""
    try:
        increment = float(channel.properties.get("wf_increment", 0.0))
        start = float(channel.properties.get("wf_start_offset", 0.0))
    except (TypeError, ValueError):
        return None, 0.0
    if not (np.isfinite(increment) and increment > 0 and np.isfinite(start)):
        return None, 0.0
    begun = _begun(channel.properties)
    if begun is not None and zero is not None:
        start += (begun[0] - zero[0]) + (begun[1] - zero[1]) / 2**64
    return float(f"{1.0 / increment:.15g}"), start  # 50000, not 50000.00000000001


def _begun(properties: Mapping[str, Any]) -> tuple[int, int] | None:
    """Seconds and their fraction (of 2^64) at which a channel was started."""
    stamp = properties.get("wf_start_time")
    seconds, fraction = getattr(stamp, "seconds", None), getattr(stamp, "second_fractions", None)
    if seconds is None or fraction is None or (int(seconds), int(fraction)) == (0, 0):
        return None
    return int(seconds), int(fraction)


def _zero(channels: Sequence[Any]) -> tuple[int, int] | None:
    """The earliest start; None where only some channels state theirs, since they cannot be compared."""
    begun = [_begun(one.properties) for one in channels if "wf_increment" in one.properties]
    known = [one for one in begun if one is not None]
    return min(known) if known and len(known) == len(begun) else None


def _info(guard: Guard, tdms: Any, channel: Any, zero: tuple[int, int] | None) -> SignalInfo:
    rate, start = _timing(channel, zero)
    count = len(channel)
    notes = [tidy(channel.properties[key]) for key in _NOTES if isinstance(channel.properties.get(key), str)]
    if channel.dtype.kind not in "fiub":
        notes.insert(0, "no numbers")
    if "NI_Number_Of_Scales" in channel.properties:
        notes.append(_unscaled(guard, tdms, channel) or "scaled by the file")
    return SignalInfo(
        channel.name,
        _unit(channel),
        channel.group_name,
        count,
        rate,
        start if rate else None,
        max(count - 1, 0) / rate if rate else None,
        "; ".join(note for note in notes if note),
    )


def _channels(tdms: Any) -> list[Any]:
    return [channel for group in tdms.groups() for channel in group.channels()]


def _survey(path: Path, label: str, max_bytes: int) -> FileInfo:
    name = name_of(path, label)
    most = max(max_bytes, MAX_FILE_BYTES)
    with open_regular(path, max_bytes=most, label=label) as file, Guard(name, _KIND, _LIBRARY) as guard:
        _check(file, name, max_bytes)
        # A file that is open is read by itself; of a path, the library would read the index beside it.
        with guard.load(_LIBRARY).TdmsFile.open(file, raw_timestamps=True) as tdms:
            channels = _channels(tdms)
            zero = _zero(channels)
            notes = [f"{key}: {tidy(value)}" for key, value in tdms.properties.items()][:20]
            version = {4712: "1.0", 4713: "2.0"}.get(tdms.tdms_version, "")
            return FileInfo(
                f"NI TDMS {version}".strip(), tuple(_info(guard, tdms, one, zero) for one in channels), tuple(notes)
            )


@contextmanager
def _tracks(request: Request, guard: Guard, *, whole: bool) -> Iterator[list[Track]]:
    """The channels of a request, of which any part can be read while the file is open."""
    name = name_of(request.path, request.label)
    with open_regular(request.path, max_bytes=request.max_file_bytes, label=request.label) as file:
        _check(file, name, request.max_bytes)
        with guard.load(_LIBRARY).TdmsFile.open(file, raw_timestamps=True) as tdms:
            channels = _channels(tdms)
            chosen = [channels[one] for one in find([(one.group_name, one.name) for one in channels], request)]
            if whole:
                afford(16 * sum(map(len, chosen)), request.max_bytes, name)
            zero = _zero(channels)
            yield [_track(guard, tdms, file, channel, zero, name) for channel in chosen]


def _track(guard: Guard, tdms: Any, file: BinaryIO, channel: Any, zero: tuple[int, int] | None, name: str) -> Track:
    rate, start = _timing(channel, zero)
    return Track(channel.name, _unit(channel), len(channel), _reader(guard, tdms, file, channel, name), rate, start)


@dataclass(frozen=True)
class _Run:
    """Samples of a channel that lie evenly in the file."""

    first: int
    last: int
    begin: int
    step: int
    """Bytes from one sample to the next; 0 where the library reads them."""
    kind: Any
    """Of a sample as it is stored."""

    def read(self, file: BinaryIO, first: int, last: int) -> NDArray[Any]:
        """Some of them, as they are stored."""
        file.seek(self.begin + (first - self.first) * self.step)
        if self.step == self.kind.itemsize:
            return np.frombuffer(file.read((last - first) * self.step), self.kind)
        parts = [np.empty(0, self.kind)]
        for at in range(first, last, rows := max(_AT_ONCE // self.step, 1)):
            held = file.read((min(at + rows, last) - at - 1) * self.step + self.kind.itemsize)
            parts.append(np.ndarray((min(at + rows, last) - at,), self.kind, held, strides=(self.step,)))
            file.seek(self.step - self.kind.itemsize, os.SEEK_CUR)
        return np.concatenate(parts)


def _runs(segments: Sequence[Any], path: str) -> list[_Run]:
    """Where the samples of a channel are; the library holds each chunk whole, which large ones are too large for."""
    runs, at = [], 0
    for segment in segments:
        held = [one for one in segment.ordered_objects if one.has_data]
        own = next((one for one in held if one.path == path), None)
        if own is None or not own.number_values or not segment.num_chunks:
            continue
        ends = segment.final_chunk_lengths_override
        chunk = sum(one.data_size for one in held)
        stored = getattr(own.data_type, "nptype", None)
        if segment.toc_mask & _DAQMX or stored is None or chunk <= _AT_ONCE:
            count = own.number_values * (segment.num_chunks - (ends is not None)) + (ends or {}).get(path, 0)
            runs.append(_Run(at, at + count, 0, 0, None))
            at += count
            continue
        kind = np.dtype(stored).newbyteorder(">" if segment.toc_mask & _BIG_ENDIAN else "<")
        for number in range(segment.num_chunks):
            counts = ends if ends is not None and number == segment.num_chunks - 1 else None
            count = own.number_values if counts is None else counts.get(path, 0)
            before = held[: held.index(own)]
            if segment.toc_mask & _INTERLEAVED:
                step, skipped = sum(one.data_type.size for one in held), sum(one.data_type.size for one in before)
            elif counts is None:
                step, skipped = kind.itemsize, sum(one.data_size for one in before)
            else:
                step, skipped = kind.itemsize, sum(one.data_type.size * counts.get(one.path, 0) for one in before)
            runs.append(_Run(at, at + count, segment.data_position + number * chunk + skipped, step, kind))
            at += count
    return runs


def _unscaled(guard: Guard, tdms: Any, channel: Any) -> str:
    """Why the samples cannot be scaled: of a way that it does not know the library gives them raw, with a warning."""
    get_scaling = guard.load("nptdms.scaling").get_scaling
    for stated in (channel.properties, tdms[channel.group_name].properties, tdms.properties):
        ways = [str(value) for key, value in stated.items() if _SCALE.fullmatch(key)]
        if stated.get("NI_Scaling_Status", "unscaled") == "scaled" or not ways:
            continue
        return "" if get_scaling(stated, {}, {}) is not None else f"is scaled by {shown(ways[-1])}, which is not known"
    return ""


def _reader(guard: Guard, tdms: Any, file: BinaryIO, channel: Any, name: str) -> Part:
    """What reads a part of the scaled samples."""
    if len(channel) and channel.dtype.kind not in "fiub":
        floats(np.empty(1, channel.dtype), channel.name, name)
    if what := _unscaled(guard, tdms, channel):
        raise TableError(f"{name}: channel {shown(channel.name)} {what}; save its scaled values")
    segments = tdms._reader._segments  # noqa: SLF001 - nothing public tells how large a chunk is
    holding = [one for one in segments if channel.path in one.object_index]
    if sum(one.num_chunks for one in holding) > _MOST_PIECES:
        what = f"channel {shown(channel.name)} is in more than {_MOST_PIECES} pieces"
        raise TableError(f"{name}: {what}; defragment the file, or export it again")
    runs = _runs(holding, channel.path)
    if not any(one.step for one in runs):
        runs = [_Run(0, len(channel), 0, 0, None)]
    scaling = guard.load("nptdms.scaling").get_scaling(
        channel.properties, tdms[channel.group_name].properties, tdms.properties
    )
    wrapped = guard.load("nptdms.base_segment").RawChannelDataChunk.channel_data

    def scaled(run: _Run, first: int, last: int) -> Any:
        if not run.step:
            return channel.read_data(first, last - first)
        raw = run.read(file, first, last)
        return raw if scaling is None else scaling.scale(wrapped(raw.astype(raw.dtype.newbyteorder("="))))

    def part(first: int, last: int) -> NDArray[np.float64]:
        values = np.empty(last - first)
        filled = 0
        for run in runs:
            end = min(last, run.last)
            for begin in range(max(first, run.first), end, _SAMPLES_AT_ONCE):
                found = floats(scaled(run, begin, min(begin + _SAMPLES_AT_ONCE, end)), channel.name, name)
                values[filled : filled + len(found)] = found
                filled += len(found)
        if filled != len(values):
            said = f"channel {shown(channel.name)} has {first + filled} of {len(channel)} samples"
            raise TableError(f"{name}: is cut short: {said}; copy it again")
        return values

    return part


_read, _blocks = by_tracks(_KIND, _LIBRARY, _tracks)
FORMAT = Format("NI TDMS", (".tdms", ".tdms_index"), _recognises, _survey, _read, "formats", _blocks)
