"""WAV: the channels are called "1" to "n"; the full scale of integer samples is 1, float samples are as stored."""

from __future__ import annotations

import os
import struct
from dataclasses import dataclass
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from fourpole.errors import TableError
from fourpole.io.formats.tracks import Content, OpenFile, Part, Track, track_format
from fourpole.io.signals import FileInfo, SignalInfo

_KIND = "a WAV file"
_PCM, _FLOAT, _EXTENSIBLE = 1, 3, 0xFFFE
_COMPRESSED = {2: "ADPCM", 6: "A-law", 7: "µ-law", 17: "IMA ADPCM", 49: "GSM", 80: "MPEG", 85: "MP3"}
_STREAMED = 0xFFFFFFFF
#: Bytes that are decoded at a time.
_BLOCK = 1 << 20


@dataclass(frozen=True)
class _Header:
    tag: int
    channels: int
    rate: int
    bits: int
    size: int
    """Size of all samples [byte]."""
    order: str
    """Byte order: little-endian (<) or big-endian (>)."""

    @property
    def count(self) -> int:
        return self.size // (self.channels * self.width)

    @property
    def width(self) -> int:
        """Size of a sample [byte]."""
        return (self.bits + 7) // 8

    @property
    def words(self) -> str:
        return f"{self.bits} bit {'float' if self.tag == _FLOAT else 'integer, full scale 1'}"


def _header(file: BinaryIO, name: str) -> _Header:
    """The header that the first chunks state; TableError if the file is smaller than they declare."""
    end = os.fstat(file.fileno()).st_size
    order = ">" if file.read(12)[:4] == b"RIFX" else "<"
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
        kind = _COMPRESSED.get(header.tag, f"WAV format {header.tag}")
        raise TableError(f"{name}: its samples are compressed ({kind}); save it as PCM or float")
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


class _Content(Content):
    """The channels of an open file."""

    sample_bytes = 8

    def __init__(self, opened: OpenFile) -> None:
        super().__init__(opened)
        self._header = _header(opened.file, opened.name)
        self._begin = opened.file.tell()
        self.places = [("", str(number)) for number in range(1, self._header.channels + 1)]

    def info(self) -> FileInfo:
        count, rate = self._header.count, float(self._header.rate)
        signals = (SignalInfo.timed(one, None, "", count, rate=rate, note=self._header.words) for _, one in self.places)
        return FileInfo("WAV", tuple(signals), ("a WAV file states no units: state each channel's sensitivity",))

    def track(self, index: int) -> Track:
        return Track(self.places[index][1], None, self._header.count, self._part(index), float(self._header.rate))

    def _part(self, channel: int) -> Part:
        """The function that reads a part of one channel; integers are scaled to a full scale of 1."""
        frame = self._header.channels * self._header.width
        step = max(_BLOCK // frame, 1)

        def part(first: int, last: int) -> NDArray[np.float64]:
            values = np.empty(last - first)
            self._file.seek(self._begin + first * frame)
            for at in range(0, last - first, step):
                count = min(step, last - first - at)
                held = self._file.read(count * frame)
                if len(held) != count * frame:
                    raise TableError(f"{self._name}: is cut short within its samples; copy or export it again")
                table = np.frombuffer(held, dtype=np.uint8).reshape(count, self._header.channels, self._header.width)
                values[at : at + count] = _decoded(table[:, channel], self._header)
            return values

        return part


def _decoded(raw: NDArray[np.uint8], header: _Header) -> NDArray[np.float64]:
    """The samples of one channel from an array (samples, bytes of a sample)."""
    count, width = raw.shape
    if header.tag == _FLOAT:
        return np.ascontiguousarray(raw).view(f"{header.order}f{width}")[:, 0].astype(np.float64)
    if width == 1:
        return (raw[:, 0].astype(np.float64) - 128.0) / 128.0
    wide = 2 if width == 2 else 4 if width <= 4 else 8
    filled = np.zeros((count, wide), dtype=np.uint8)
    if header.order == "<":
        filled[:, wide - width :] = raw  # the most significant byte is last, so that the sign is kept
    else:
        filled[:, :width] = raw
    return filled.view(f"{header.order}i{wide}")[:, 0].astype(np.float64) * 2.0 ** (1 - 8 * wide)


FORMAT = track_format("wav", "WAV", (".wav", ".wave"), _KIND, _Content)
