"""WAV: channels "1" to "n", their full scale 1 where the samples are integers, as they are where they are floats."""

from __future__ import annotations

import os
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from fourpole.errors import TableError
from fourpole.io.formats.guard import Guard, afford, find
from fourpole.io.formats.pieces import Part, Track, by_tracks
from fourpole.io.signals import MAX_FILE_BYTES, FileInfo, Format, Request, SignalInfo
from fourpole.io.source import name_of, open_regular

__all__ = ["FORMAT"]

_KIND = "a WAV file"
_PCM, _FLOAT, _EXTENSIBLE = 1, 3, 0xFFFE
_STREAMED = 0xFFFFFFFF
_BLOCK = 1 << 20  # bytes that are decoded at a time


@dataclass(frozen=True)
class _Header:
    tag: int
    channels: int
    rate: int
    bits: int
    size: int
    """Bytes of samples."""
    order: str
    """Of bytes: little-endian (<) or big-endian (>)."""

    @property
    def count(self) -> int:
        return self.size // (self.channels * self.width)

    @property
    def width(self) -> int:
        """Bytes of a sample."""
        return (self.bits + 7) // 8

    @property
    def words(self) -> str:
        return f"{self.bits} bit {'float' if self.tag == _FLOAT else 'integer, full scale 1'}"


def _recognises(head: bytes) -> bool:
    return head[:4] in (b"RIFF", b"RIFX", b"RF64") and head[8:12] == b"WAVE"


def _header(file: BinaryIO, name: str) -> _Header:
    """What the chunks say, held against the size of the file."""
    end = os.fstat(file.fileno()).st_size
    head = file.read(12)
    if not _recognises(head):
        raise TableError(f"{name}: is not {_KIND}: it does not begin as one; check what wrote it")
    order = ">" if head[:4] == b"RIFX" else "<"
    form: tuple[int, int, int, int] | None = None
    large = None
    while len(start := file.read(8)) == 8:
        kind, size = struct.unpack(f"{order}4sI", start)
        if kind == b"data":
            size = large if large is not None and size == _STREAMED else size
            return _checked(form, size, end - file.tell(), order, name)
        content = file.read(min(size, 40)) if kind in (b"fmt ", b"ds64") else b""
        if kind == b"fmt " and len(content) >= 16:
            tag, channels, rate, _, _, bits = struct.unpack(f"{order}HHIIHH", content[:16])
            if tag == _EXTENSIBLE and len(content) >= 26:
                (tag,) = struct.unpack(f"{order}H", content[24:26])
            form = tag, channels, rate, bits
        elif kind == b"ds64" and len(content) >= 16:
            (large,) = struct.unpack("<Q", content[8:16])
        file.seek(size - len(content) + size % 2, os.SEEK_CUR)
    raise TableError(f"{name}: is cut short: it ends before its samples begin; copy or export it again")


def _checked(form: tuple[int, int, int, int] | None, size: int, there: int, order: str, name: str) -> _Header:
    if form is None:
        raise TableError(f"{name}: does not say how its samples are written (no 'fmt ' chunk); export it again")
    header = _Header(*form, size, order)
    if header.tag not in (_PCM, _FLOAT):
        raise TableError(f"{name}: its samples are compressed (WAV format {header.tag}); save it as PCM or float")
    widths = (4, 8) if header.tag == _FLOAT else range(1, 9)
    if not (header.channels and header.rate and header.bits and header.width in widths):
        many = f"{header.channels} channels of {header.bits} bit at {header.rate} Hz"
        raise TableError(f"{name}: declares {many}; its header is damaged: export it again")
    if size > there:
        raise TableError(
            f"{name}: is cut short: declares {size} bytes of samples, has {there}; copy or export it again"
        )
    if size % (header.channels * header.width):
        raise TableError(f"{name}: ends within a sample ({size} bytes of samples); copy or export it again")
    return header


def _survey(path: Path, label: str, max_bytes: int) -> FileInfo:
    name = name_of(path, label)
    with open_regular(path, max_bytes=max(max_bytes, MAX_FILE_BYTES), label=label) as file, Guard(name, _KIND):
        header = _header(file, name)
    duration = max(header.count - 1, 0) / header.rate
    signals = tuple(
        SignalInfo(str(one), None, "", header.count, float(header.rate), 0.0, duration, header.words)
        for one in range(1, header.channels + 1)
    )
    return FileInfo("WAV", signals, ("a WAV file states no units: state each channel's sensitivity",))


@contextmanager
def _tracks(request: Request, _: Guard, *, whole: bool) -> Iterator[list[Track]]:
    """The channels of a request, of which any part can be read while the file is open."""
    name = name_of(request.path, request.label)
    with open_regular(request.path, max_bytes=request.max_file_bytes, label=request.label) as file:
        header = _header(file, name)
        begin = file.tell()
        which = find([("", str(one)) for one in range(1, header.channels + 1)], request)
        if whole:
            afford(8 * header.count * len(which), request.max_bytes, name)
        yield [
            Track(str(one + 1), None, header.count, _channel(file, header, begin, one, name), float(header.rate))
            for one in which
        ]


def _channel(file: BinaryIO, header: _Header, begin: int, channel: int, name: str) -> Part:
    """What reads a part of one channel: integers to a full scale of 1."""
    frame = header.channels * header.width
    step = max(_BLOCK // frame, 1)

    def part(first: int, last: int) -> NDArray[np.float64]:
        values = np.empty(last - first)
        file.seek(begin + first * frame)
        for at in range(0, last - first, step):
            count = min(step, last - first - at)
            held = file.read(count * frame)
            if len(held) != count * frame:
                raise TableError(f"{name}: is cut short: it ends within its samples; copy or export it again")
            table = np.frombuffer(held, dtype=np.uint8).reshape(count, header.channels, header.width)
            values[at : at + count] = _decoded(table[:, channel], header)
        return values

    return part


def _decoded(raw: NDArray[np.uint8], header: _Header) -> NDArray[np.float64]:
    """Samples of one channel of (samples, bytes) of each."""
    count, width = raw.shape
    if header.tag == _FLOAT:
        return np.ascontiguousarray(raw).view(f"{header.order}f{width}")[:, 0].astype(np.float64)
    if width == 1:
        return (raw[:, 0].astype(np.float64) - 128.0) / 128.0
    wide = 2 if width == 2 else 4 if width <= 4 else 8
    filled = np.zeros((count, wide), dtype=np.uint8)
    if header.order == "<":
        filled[:, wide - width :] = raw  # the bytes of most weight are last, so that the sign is where it must be
    else:
        filled[:, :width] = raw
    return filled.view(f"{header.order}i{wide}")[:, 0].astype(np.float64) * 2.0 ** (1 - 8 * wide)


_read, _blocks = by_tracks(_KIND, "", _tracks)
FORMAT = Format("WAV", (".wav", ".wave"), _recognises, _survey, _read, blocks=_blocks)
