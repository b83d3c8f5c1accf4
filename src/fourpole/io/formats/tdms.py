"""NI TDMS: groups of channels, scaled as the file says, evenly spaced where it states an increment.

Only the named file is read, never the index beside it. Where channels were started at different times
(`wf_start_time`), the file's zero is the earliest of them.
"""

from __future__ import annotations

import os
import struct
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from fourpole.errors import TableError
from fourpole.io.formats.guard import Guard, afford, find, floats, of_name, tidy
from fourpole.io.signals import FileInfo, Format, Request, Signal, SignalInfo
from fourpole.io.source import name_of, open_regular
from fourpole.units import shown

__all__ = ["FORMAT"]

_KIND = "an NI TDMS file"
_LIBRARY = "nptdms"
_UNITS = ("unit_string", "NI_UnitDescription", "unit", "Unit", "units")
_NOTES = ("description", "NI_ChannelName", "sensor", "Sensor")
_LEAD_IN = 28
_OPEN_END = 0xFFFFFFFFFFFFFFFF
_METADATA, _NEW_LIST, _BIG_ENDIAN = 1 << 1, 1 << 2, 1 << 6
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
    return 1.0 / increment, start


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


def _info(channel: Any, zero: tuple[int, int] | None) -> SignalInfo:
    rate, start = _timing(channel, zero)
    count = len(channel)
    notes = [tidy(channel.properties[key]) for key in _NOTES if isinstance(channel.properties.get(key), str)]
    if channel.dtype.kind not in "fiub":
        notes.insert(0, "no numbers")
    if "NI_Number_Of_Scales" in channel.properties:
        notes.append("scaled by the file")
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
    with open_regular(path, max_bytes=max_bytes, label=label) as file, Guard(name, _KIND, _LIBRARY) as guard:
        _check(file, name, max_bytes)
        # A file that is open is read by itself; of a path, the library would read the index beside it.
        with guard.load(_LIBRARY).TdmsFile.open(file, raw_timestamps=True) as tdms:
            channels = _channels(tdms)
            zero = _zero(channels)
            notes = [f"{key}: {tidy(value)}" for key, value in tdms.properties.items()][:20]
            version = {4712: "1.0", 4713: "2.0"}.get(tdms.tdms_version, "")
            return FileInfo(f"NI TDMS {version}".strip(), tuple(_info(one, zero) for one in channels), tuple(notes))


def _read(request: Request) -> Sequence[Signal]:
    name = name_of(request.path, request.label)
    with (
        open_regular(request.path, max_bytes=request.max_bytes, label=request.label) as file,
        Guard(name, _KIND, _LIBRARY) as guard,
    ):
        _check(file, name, request.max_bytes)
        with guard.load(_LIBRARY).TdmsFile.open(file, raw_timestamps=True) as tdms:
            channels = _channels(tdms)
            chosen = [channels[one] for one in find([(one.group_name, one.name) for one in channels], request)]
            afford(16 * sum(map(len, chosen)), request.max_bytes, name)
            zero = _zero(channels)
            return [_signal(channel, zero, name) for channel in chosen]


def _signal(channel: Any, zero: tuple[int, int] | None, name: str) -> Signal:
    rate, start = _timing(channel, zero)
    return Signal(channel.name, _unit(channel), _samples(channel, name), start, rate)


def _samples(channel: Any, name: str) -> NDArray[np.float64]:
    """The scaled samples, piece by piece."""
    values = np.empty(len(channel))
    filled = 0
    for number, chunk in enumerate(channel.data_chunks()):
        if max(number, len(values) // max(len(chunk), 1) if number == 0 else 0) > _MOST_PIECES:
            what = f"channel {shown(channel.name)} is in more than {_MOST_PIECES} pieces"
            raise TableError(f"{name}: {what}; defragment the file, or export it again")
        part = floats(chunk[:], channel.name, name) if len(chunk) else np.empty(0)
        values[filled : filled + len(part)] = part
        filled += len(part)
    if filled != len(values):
        raise TableError(
            f"{name}: is cut short: channel {shown(channel.name)} has {filled} of {len(values)} samples; copy it again"
        )
    return values


FORMAT = Format("NI TDMS", (".tdms", ".tdms_index"), _recognises, _survey, _read, "formats")
