"""NI TDMS: groups of channels, scaled as the file says, and evenly spaced in time if it states an increment.

Only the named file is read, never the index file beside it. If channels were started at different times
(`wf_start_time`), the time zero of the file is the earliest start.
"""

from __future__ import annotations

import os
import re
import struct
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from fourpole.errors import TableError
from fourpole.io.formats.guard import afford, floats, of_name, tidy
from fourpole.io.formats.tracks import Content, OpenFile, Part, Track, track_format
from fourpole.io.signals import FileInfo, SignalInfo
from fourpole.units import shown

_KIND = "an NI TDMS file"
_LIBRARY = "nptdms"
#: Seconds from the zero of the file's times, in 1904, to 1970.
_1904 = 2_082_844_800
_UNITS = ("unit_string", "NI_UnitDescription", "unit", "Unit", "units")
_NOTES = ("description", "NI_ChannelName", "sensor", "Sensor")
_SCALE = re.compile(r"NI_Scale\[[0-9]+\]_Scale_Type")
_LEAD_IN = 28
_OPEN_END = 0xFFFFFFFFFFFFFFFF
_METADATA, _NEW_LIST, _INTERLEAVED, _BIG_ENDIAN, _DAQMX = (1 << bit for bit in (1, 2, 5, 6, 7))
#: Largest chunk of the file that the library may read whole [byte].
_AT_ONCE = 1 << 24
_SAMPLES_AT_ONCE = 1 << 20
_SMALLEST_OBJECT = 12
_MOST_ENTRIES = 20_000_000
_MOST_PIECES = 2_000_000


def _check(file: BinaryIO, name: str, max_bytes: int) -> None:
    """Walk over the segments; TableError if one is damaged or its list of objects is too long, before it is built."""
    end = os.fstat(file.fileno()).st_size
    lead = file.read(_LEAD_IN)
    if lead[:4] == b"TDSh":
        raise TableError(f"{name}: is the index of a TDMS file, without samples; name the .tdms file itself")
    position, held, entries = 0, 0, 0
    while len(lead) == _LEAD_IN:
        if lead[:4] != b"TDSm":
            raise TableError(f"{name}: is damaged: no segment begins at byte {position}; copy or export it again")
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
    """Rate [Hz] and start [s] of the waveform that the channel states; (None, 0) if it states none."""
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
    """Time at which a channel was started: whole seconds, and the fraction of a second in units of 2^-64 s."""
    stamp = properties.get("wf_start_time")
    seconds, fraction = getattr(stamp, "seconds", None), getattr(stamp, "second_fractions", None)
    if seconds is None or fraction is None or (int(seconds), int(fraction)) == (0, 0):
        return None
    return int(seconds), int(fraction)


def _zero(channels: Sequence[Any]) -> tuple[int, int] | None:
    """The earliest start; None if any channel states no start, since the starts cannot be compared then."""
    begun = [_begun(one.properties) for one in channels if "wf_increment" in one.properties]
    known = [one for one in begun if one is not None]
    return min(known) if known and len(known) == len(begun) else None


def _info(opened: OpenFile, tdms: Any, channel: Any, zero: tuple[int, int] | None) -> SignalInfo:
    rate, start = _timing(channel, zero)
    notes = [tidy(channel.properties[key]) for key in _NOTES if isinstance(channel.properties.get(key), str)]
    if channel.dtype.kind not in "fiub":
        notes.insert(0, "no numbers")
    if "NI_Number_Of_Scales" in channel.properties:
        notes.append(_unscaled(opened, tdms, channel) or "scaled by the file")
    note = "; ".join(one for one in notes if one)
    unit, group = _unit(channel), channel.group_name
    return SignalInfo.timed(channel.name, unit, group, len(channel), rate=rate, start=start, note=note)


class _Content(Content):
    """The channels of an open file, as the library reads them."""

    def __init__(self, opened: OpenFile) -> None:
        _check(opened.file, opened.name, opened.max_bytes)
        super().__init__(opened)
        self._opened = opened
        # The library gets the open file: if it had the path, it would read the index file beside it.
        library = opened.guard.load(_LIBRARY).TdmsFile
        self._tdms = opened.closing.enter_context(library.open(opened.file, raw_timestamps=True))
        self._channels = [channel for group in self._tdms.groups() for channel in group.channels()]
        self.places = [(one.group_name, one.name) for one in self._channels]
        self._zero = _zero(self._channels)

    def info(self) -> FileInfo:
        notes = [f"{key}: {tidy(value)}" for key, value in self._tdms.properties.items()][:20]
        version = {4712: "1.0", 4713: "2.0"}.get(self._tdms.tdms_version, "")
        signals = tuple(_info(self._opened, self._tdms, one, self._zero) for one in self._channels)
        began = None if self._zero is None else self._zero[0] + self._zero[1] / 2**64 - _1904
        return FileInfo(f"NI TDMS {version}".strip(), signals, tuple(notes), began)

    def track(self, index: int) -> Track:
        channel = self._channels[index]
        rate, start = _timing(channel, self._zero)
        samples = _reader(self._opened, self._tdms, channel)
        return Track(channel.name, _unit(channel), len(channel), samples, rate, start)


@dataclass(frozen=True)
class _Run:
    """Consecutive samples of a channel at equal distances in the file."""

    first: int
    last: int
    begin: int
    step: int
    """Distance from one sample to the next [byte]; 0 if the library reads these samples."""
    kind: Any
    """numpy type of a stored sample."""

    def read(self, file: BinaryIO, first: int, last: int) -> NDArray[Any]:
        """The samples from index `first` up to `last`, as they are stored."""
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
    """The runs of samples of a channel. The library reads a chunk whole; samples in larger chunks are read here."""
    runs, begin = [], 0
    for segment in segments:
        held = [one for one in segment.ordered_objects if one.has_data]
        own = next((one for one in held if one.path == path), None)
        if own is None or not own.number_values or not segment.num_chunks:
            continue
        for count, place, step, kind in _pieces(segment, held, own):
            runs.append(_Run(begin, begin + count, place, step, kind))
            begin += count
    return runs


def _pieces(segment: Any, held: list[Any], own: Any) -> Iterator[tuple[int, int, int, Any]]:
    """Number of samples, first byte, step and type of the runs of the channel `own` in a segment."""
    chunk, ends = sum(one.data_size for one in held), segment.final_chunk_lengths_override
    stored = getattr(own.data_type, "nptype", None)
    if segment.toc_mask & _DAQMX or stored is None or chunk <= _AT_ONCE:
        last = (ends or {}).get(own.path, 0)
        yield own.number_values * (segment.num_chunks - (ends is not None)) + last, 0, 0, None
        return
    kind = np.dtype(stored).newbyteorder(">" if segment.toc_mask & _BIG_ENDIAN else "<")
    for number in range(segment.num_chunks):
        counts = ends if number == segment.num_chunks - 1 else None
        step, skipped = _in_chunk(held, own, counts, interleaved=bool(segment.toc_mask & _INTERLEAVED))
        count = own.number_values if counts is None else counts.get(own.path, 0)
        yield count, segment.data_position + number * chunk + skipped, step or kind.itemsize, kind


def _in_chunk(held: list[Any], own: Any, counts: Mapping[str, int] | None, *, interleaved: bool) -> tuple[int, int]:
    """Distance between the samples of a channel in a chunk (0: their size), and bytes before the first one."""
    before = held[: held.index(own)]
    if interleaved:
        return sum(one.data_type.size for one in held), sum(one.data_type.size for one in before)
    if counts is None:
        return 0, sum(one.data_size for one in before)
    return 0, sum(one.data_type.size * counts.get(one.path, 0) for one in before)


def _unscaled(opened: OpenFile, tdms: Any, channel: Any) -> str:
    """Why samples cannot be scaled; empty if they can. For an unknown scaling the library returns raw values."""
    get_scaling = opened.guard.load("nptdms.scaling").get_scaling
    for stated in (channel.properties, tdms[channel.group_name].properties, tdms.properties):
        ways = [str(value) for key, value in stated.items() if _SCALE.fullmatch(key)]
        if stated.get("NI_Scaling_Status", "unscaled") == "scaled" or not ways:
            continue
        return "" if get_scaling(stated, {}, {}) is not None else f"is scaled by {shown(ways[-1])}, which is not known"
    return ""


def _reader(opened: OpenFile, tdms: Any, channel: Any) -> Part:
    """The function that reads a part of the scaled samples."""
    guard, file, name = opened.guard, opened.file, opened.name
    if len(channel) and channel.dtype.kind not in "fiub":
        floats(np.empty(1, channel.dtype), channel.name, name)
    if what := _unscaled(opened, tdms, channel):
        raise TableError(f"{name}: channel {shown(channel.name)} {what}; save its scaled values")
    segments = tdms._reader._segments  # noqa: SLF001 - no public attribute has the size of a chunk
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
            what = f"channel {shown(channel.name)} has {first + filled} of {len(channel)} samples"
            raise TableError(f"{name}: is cut short: {what}; copy it again")
        return values

    return part


FORMAT = track_format("tdms", "NI TDMS", (".tdms", ".tdms_index"), _KIND, _Content, by_library=True)
