"""NI TDMS: groups of channels, scaled as the file says, and evenly spaced in time if it states an increment.

Only the named file is read, never the index file beside it. If channels were started at different times
(`wf_start_time`), the time zero of the file is the earliest start.
"""

from __future__ import annotations

import os
import re
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fourpole.errors import TableError
from fourpole.io.formats.guard import floats, of_name, tidy
from fourpole.io.formats.tracks import Content, OpenFile, Part, Track, remembered, track_format
from fourpole.units import shown

#: Seconds from the zero of the file's times, in 1904, to 1970.
_1904 = 2_082_844_800
_UNITS = ("unit_string", "NI_UnitDescription", "unit", "Unit", "units")
_NOTES = ("description", "NI_ChannelName", "sensor", "Sensor")
_SCALE = re.compile(r"NI_Scale\[[0-9]+\]_Scale_Type")
#: Least number of samples that are read at a time: the library reads whole chunks, which may be long.
_AT_ONCE = 1 << 22


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


def _unscaled(get_scaling: Any, properties: Sequence[Mapping[str, Any]]) -> str:
    """Why samples cannot be scaled; empty if they can. For an unknown scaling the library returns raw values."""
    for stated in properties:
        ways = [str(value) for key, value in stated.items() if _SCALE.fullmatch(key)]
        if stated.get("NI_Scaling_Status", "unscaled") != "scaled" and ways:
            known = get_scaling(stated, {}, {}) is not None
            return "" if known else f"is scaled by {shown(ways[-1])}, which is not known"
    return ""


def _samples(channel: Any, name: str) -> Part:
    """The function that reads a part of the scaled samples."""

    def read(first: int, last: int) -> NDArray[np.float64]:
        return floats(channel.read_data(first, last - first), channel.name, name)

    held = remembered(read)

    def part(first: int, last: int) -> NDArray[np.float64]:
        steps = range(first // _AT_ONCE * _AT_ONCE, max(last, first + 1), _AT_ONCE)
        pieces = [held(at, min(at + _AT_ONCE, len(channel)))[max(first - at, 0) : last - at] for at in steps]
        return np.concatenate(pieces) if len(pieces) > 1 else pieces[0]

    return part


def _content(opened: OpenFile) -> Content:
    """The channels of an open file."""
    if opened.file.read(4) == b"TDSh":
        raise TableError(f"{opened.name}: is the index of a TDMS file, without samples; name the .tdms file itself")
    opened.file.seek(0)
    # The library gets the open file: if it had the path, it would read the index file beside it.
    tdms = opened.closing.enter_context(opened.load("nptdms").TdmsFile.open(opened.file, raw_timestamps=True))
    ends = [-1 if one.segment_incomplete else one.next_segment_pos for one in tdms._reader._segments]  # noqa: SLF001
    if not ends or ends[-1] < os.fstat(opened.file.fileno()).st_size:
        raise TableError(f"{opened.name}: is cut short in its last segment; copy or export it again")
    channels = [channel for group in tdms.groups() for channel in group.channels()]
    zero, get_scaling = _zero(channels), opened.load("nptdms.scaling").get_scaling
    tracks = []
    for one in channels:
        properties = one.properties
        notes = [tidy(properties[key]) for key in _NOTES if isinstance(properties.get(key), str)]
        unit = next((properties[key] for key in _UNITS if isinstance(properties.get(key), str)), None)
        barred = _unscaled(get_scaling, (properties, tdms[one.group_name].properties, tdms.properties))
        if "NI_Number_Of_Scales" in properties and not barred:
            notes.append("scaled by the file")
        barred = f"{barred}; save its scaled values" if barred else ""
        barred = "holds no numbers" if one.dtype.kind not in "fiub" else barred
        rate, start = _timing(one, zero)
        note, unit = "; ".join(filter(None, notes)), of_name(one.name, unit)
        samples = _samples(one, opened.name)
        tracks.append(Track(one.name, unit, len(one), samples, rate, start, None, one.group_name, note, barred))
    version = {4712: "1.0", 4713: "2.0"}.get(tdms.tdms_version, "")
    notes = [f"{key}: {tidy(value)}" for key, value in tdms.properties.items()][:20]
    began = None if zero is None else zero[0] + zero[1] / 2**64 - _1904
    return Content(f"NI TDMS {version}".strip(), tracks, notes, began)


FORMAT = track_format("tdms", "NI TDMS", (".tdms", ".tdms_index"), "an NI TDMS file", _content)
