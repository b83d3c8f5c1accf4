"""WAV: channels "1" to "n", their full scale 1 where the samples are integers, as they are where they are floats."""

from __future__ import annotations

import os
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from fourpole.errors import TableError
from fourpole.io.formats.guard import Guard, afford, find
from fourpole.io.signals import FileInfo, Format, Request, Signal, SignalInfo
from fourpole.io.source import name_of, open_regular

__all__ = ["FORMAT"]

_KIND = "a WAV file"
_PCM, _FLOAT, _EXTENSIBLE = 1, 3, 0xFFFE
_STREAMED = 0xFFFFFFFF
_BLOCK = 1 << 16


@dataclass(frozen=True)
class _Header:
    tag: int
    channels: int
    rate: int
    bits: int
    size: int
    """Bytes of samples."""

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
            return _checked(form, size, end - file.tell(), name)
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


def _checked(form: tuple[int, int, int, int] | None, size: int, there: int, name: str) -> _Header:
    if form is None:
        raise TableError(f"{name}: does not say how its samples are written (no 'fmt ' chunk); export it again")
    header = _Header(*form, size)
    if header.tag not in (_PCM, _FLOAT):
        raise TableError(f"{name}: its samples are compressed (WAV format {header.tag}); save it as PCM or float")
    if not (header.channels and header.rate and 0 < header.bits <= 64):
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
    with open_regular(path, max_bytes=max_bytes, label=label) as file, Guard(name, _KIND):
        header = _header(file, name)
    duration = max(header.count - 1, 0) / header.rate
    signals = tuple(
        SignalInfo(str(one), None, "", header.count, float(header.rate), 0.0, duration, header.words)
        for one in range(1, header.channels + 1)
    )
    return FileInfo("WAV", signals, ("a WAV file states no units: state each channel's sensitivity",))


def _read(request: Request) -> Sequence[Signal]:
    name = name_of(request.path, request.label)
    with open_regular(request.path, max_bytes=request.max_bytes, label=request.label) as file, Guard(name, _KIND):
        header = _header(file, name)
        which = find([("", str(one)) for one in range(1, header.channels + 1)], request)
        held = header.size if header.width != 3 else header.size * 7 // 3
        afford(held + 8 * header.count * len(which), request.max_bytes, name)
        file.seek(0)
        from scipy.io import wavfile

        rate, raw = wavfile.read(file)
        table = raw.reshape(len(raw), -1)
        if table.shape != (header.count, header.channels):
            raise TableError(f"{name}: holds {table.shape[0]} samples, not {header.count}; copy or export it again")
        return [Signal(str(one + 1), None, _scaled(table[:, one]), 0.0, float(rate)) for one in which]


def _scaled(raw: NDArray[np.generic]) -> NDArray[np.float64]:
    """One channel, block by block: integers to a full scale of 1."""
    values = np.empty(len(raw))
    kind, bits = raw.dtype.kind, 8 * raw.dtype.itemsize
    offset = 128.0 if kind == "u" else 0.0
    scale = 1.0 if kind == "f" else 2.0 ** (1 - bits)
    for start in range(0, len(raw), _BLOCK):
        part = slice(start, start + _BLOCK)
        values[part] = raw[part]
        if kind != "f":
            values[part] = (values[part] - offset) * scale
    return values


FORMAT = Format("WAV", (".wav", ".wave"), _recognises, _survey, _read)
