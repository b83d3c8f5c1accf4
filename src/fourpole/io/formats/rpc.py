"""RPC III, the time histories of servohydraulic rigs: 16 bit integers with a scale, or floats, of each channel.

A file begins with records of 128 bytes: a key of 32 bytes and a value of 96, both text. The samples follow in groups:
in each group `PTS_PER_GROUP` samples of the first channel, then those of the next one. A group has whole frames, and
the last one is filled up. The value of a sample is the integer times `SCALE.CHAN_n`; floats are values as they are.

References
----------
Open readers: rpc-reader 0.9 (groups, frames, floats); openfedem, FiRPC3File.C (groups, filling, scale). The first one
multiplies integers by INT_FULL_SCALE/32768 as well.
"""

from __future__ import annotations

import math
import mmap
import os
from collections.abc import Callable
from dataclasses import dataclass
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from fourpole.errors import TableError
from fourpole.io.formats.guard import tidy
from fourpole.io.formats.tracks import Content, OpenFile, Part, Track, track_format
from fourpole.io.names import numbered
from fourpole.units import shown

_KIND = "an RPC III file"
_RECORD, _KEY, _PAGE = 128, 32, 512
_MOST_PAGES, _MOST_CHANNELS = 4096, 4096
_TYPES = {"SHORT_INTEGER": "i2", "FLOATING_POINT": "f4", "DOUBLE_PRECISION": "f8"}
_ORDERS = {"BINARY": "<", "BINARY_IEEE_LITTLE_END": "<", "BINARY_IEEE_BIG_END": ">"}
#: Full scale of an integer of 16 bit.
_FULL_SCALE = 32768
#: Keys that say how the samples are stored.
_STRUCTURE = (
    *("FORMAT", "NUM_HEADER_BLOCKS", "NUM_PARAMS", "FILE_TYPE", "CHANNELS", "DELTA_T"),
    *("PTS_PER_FRAME", "PTS_PER_GROUP", "FRAMES", "PARTITIONS"),
)


def _text(raw: bytes) -> str:
    return raw.split(b"\0")[0].decode("cp1252", errors="replace").strip()


def _keys(file: BinaryIO, name: str) -> dict[str, str]:
    """The values of the header by their keys."""
    first = file.read(2 * _RECORD)
    pages = _text(first[_RECORD + _KEY :])
    if not pages.isdecimal() or not 0 < int(pages) <= _MOST_PAGES:
        raise TableError(f"{name}: declares a header of {shown(pages, 20)} blocks; it is damaged: export it again")
    held = first + file.read(int(pages) * _PAGE - len(first))
    if len(held) < int(pages) * _PAGE:
        raise TableError(f"{name}: is cut short: it ends before its samples begin; copy or export it again")
    records = (held[at : at + _RECORD] for at in range(0, len(held), _RECORD))
    found = {_text(one[:_KEY]).upper(): _text(one[_KEY:]) for one in records}
    return {key: value for key, value in found.items() if key}


@dataclass(frozen=True)
class _Shape:
    """How the samples are stored."""

    begin: int
    """First byte of the samples."""
    kind: np.dtype[np.generic]
    channels: int
    group: int
    """Samples of a channel in a group."""
    count: int
    """Samples of a channel."""
    whole: int
    """Number of whole groups."""
    rest: int
    """Samples of a channel in a last group that is not filled up."""
    step: float
    """Time between two samples [s]."""


def _whole(keys: dict[str, str], key: str, most: int, name: str) -> int:
    value = keys.get(key, "")
    if not (value.isdecimal() and len(value) < 16 and 0 < int(value) <= most):
        said = f"{key} is {shown(value, 40)}" if key in keys else f"has no {key}"
        raise TableError(f"{name}: its header {said}; it is damaged: export it again")
    return int(value)


def _number(text: str | None) -> float | None:
    """The finite number in a value; None if there is none."""
    try:
        value = float(text or "")
    except ValueError:
        return None
    return value if math.isfinite(value) else None


def _shape(keys: dict[str, str], size: int, name: str) -> _Shape:
    """How the samples are stored; TableError if they cannot be read, or the file is smaller than the header says."""
    order, kind = _ORDERS.get(keys["FORMAT"]), keys.get("DATA_TYPE", "SHORT_INTEGER")
    if order is None or kind not in _TYPES:
        what = f"format {shown(keys['FORMAT'], 40)}, data type {shown(kind, 40)}"
        raise TableError(f"{name}: its samples are of {what}; export it as BINARY with SHORT_INTEGER or FLOATING_POINT")
    if keys.get("FILE_TYPE", "TIME_HISTORY") != "TIME_HISTORY":
        what = f"is of the file type {shown(keys['FILE_TYPE'], 40)}"
        raise TableError(f"{name}: {what}; only a TIME_HISTORY is a recording")
    if keys.get("PARTITIONS", "1") not in ("0", "1", ""):
        raise TableError(f"{name}: has {shown(keys['PARTITIONS'], 20)} partitions; export its channels in one")
    channels = _whole(keys, "CHANNELS", _MOST_CHANNELS, name)
    frame = _whole(keys, "PTS_PER_FRAME", size, name)
    frames = _whole(keys, "FRAMES", size, name)
    group = _whole(keys, "PTS_PER_GROUP", size, name)
    step = _number(keys.get("DELTA_T"))
    if group % frame or not step or not 1e-12 < step < 1e12:
        what = f"PTS_PER_GROUP {group}, PTS_PER_FRAME {frame}, DELTA_T {shown(keys.get('DELTA_T', ''), 40)}"
        raise TableError(f"{name}: its header states {what}, which no recording has; it is damaged: export it again")
    begin, stored = _PAGE * int(keys["NUM_HEADER_BLOCKS"]), frame * frames
    type_ = np.dtype(order + _TYPES[kind])
    there, sample = size - begin, channels * type_.itemsize
    filled = math.ceil(stored / group) * group
    if there < sample * filled and there != sample * stored:
        raise TableError(
            f"{name}: is cut short: declares {sample * filled} bytes of samples, has {there}; copy or export it again"
        )
    whole, rest = divmod(filled if there >= sample * filled else stored, group)
    samples = keys.get("SAMPLES", "")
    count = min(stored, int(samples)) if samples.isdecimal() and len(samples) < 16 else stored
    return _Shape(begin, type_, channels, group, count, whole, rest, step)


def _scale(keys: dict[str, str], channel: int, shape: _Shape, name: str) -> float:
    """Value of one count; 1 for floats."""
    scale = 1.0 if shape.kind.kind == "f" else _number(keys.get(f"SCALE.CHAN_{channel}"))
    if scale is None:
        raise TableError(f"{name}: states no SCALE.CHAN_{channel}; it is damaged: export it again")
    return scale


def _content(opened: OpenFile) -> Content:
    """The channels of an open file."""
    keys = _keys(opened.file, opened.name)
    shape = _shape(keys, os.fstat(opened.file.fileno()).st_size, opened.name)
    numbers, samples, integer = range(1, shape.channels + 1), _samples(opened, shape), shape.kind.kind == "i"
    tracks = []
    for at, name in zip(numbers, numbered([keys.get(f"DESC.CHAN_{at}") or str(at) for at in numbers]), strict=True):
        unit, scale = keys.get(f"UNITS.CHAN_{at}", ""), _scale(keys, at, shape, opened.name)
        note = f"16 bit integer times {scale:.8g}" if integer else ""
        unit_or_none = unit if unit.upper() not in ("", "NONE") else None
        tracks.append(Track(name, unit_or_none, shape.count, samples(at - 1, scale), 1.0 / shape.step, note=note))
    stated = ((key, value) for key, value in keys.items() if "CHAN_" not in key and key not in _STRUCTURE)
    notes = [f"{tidy(key, 40)}: {tidy(value)}" for key, value in stated if value][:20]
    full = _number(keys.get("INT_FULL_SCALE"))
    if integer and full and full != _FULL_SCALE:
        share = f"{100 * (full / _FULL_SCALE - 1):+.3g} %"
        notes.append(f"a program that scales by INT_FULL_SCALE/{_FULL_SCALE} gives values that differ by {share}")
    return Content("RPC III", tracks, notes, sample_bytes=8)


def _samples(opened: OpenFile, shape: _Shape) -> Callable[[int, float], Part]:
    """The function that gives the one which reads a part of a channel, by its place and the value of one count."""
    size = shape.whole * shape.channels * shape.group
    content = mmap.mmap(opened.file.fileno(), 0, access=mmap.ACCESS_READ)
    flat = np.frombuffer(content, shape.kind, size + shape.channels * shape.rest, shape.begin)
    groups, rest = flat[:size].reshape(-1, shape.channels, shape.group), flat[size:].reshape(shape.channels, -1)

    def samples(channel: int, scale: float) -> Part:
        def part(first: int, last: int) -> NDArray[np.float64]:
            low, high = first // shape.group, math.ceil(last / shape.group)
            held = np.append(groups[low:high, channel], rest[channel])  # which is what follows the last whole group
            return held[first - low * shape.group : last - low * shape.group].astype(np.float64) * scale

        return part

    return samples


FORMAT = track_format("rpc", "RPC III", (".rpc", ".rsp", ".tim", ".drv"), _KIND, _content)
