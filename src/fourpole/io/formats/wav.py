"""WAV: the channels are called "1" to "n"; the full scale of integer samples is 1, float samples are as stored."""

from __future__ import annotations

import os

import numpy as np

from fourpole.errors import TableError
from fourpole.io.formats.tracks import Content, OpenFile, Part, Track, track_format

_KIND = "a WAV file"
_COMPRESSED = {2: "ADPCM", 6: "A-law", 7: "µ-law", 17: "IMA ADPCM", 49: "GSM", 80: "MPEG", 85: "MP3"}


def _content(opened: OpenFile) -> Content:
    """The channels of an open file."""
    from scipy.io.wavfile import read as read_wav

    head = opened.file.read(36)
    order = "big" if head[:4] == b"RIFX" else "little"
    tag, size = int.from_bytes(head[20:22], order), int.from_bytes(head[4:8], order)  # type: ignore[arg-type]
    if head[12:16] == b"fmt " and tag in _COMPRESSED:
        raise TableError(f"{opened.name}: its samples are compressed ({_COMPRESSED[tag]}); save it as PCM or float")
    if size + 8 > os.fstat(opened.file.fileno()).st_size and head[:4] != b"RF64":
        raise TableError(f"{opened.name}: is cut short: it declares {size + 8} bytes; copy or export it again")
    try:  # only the samples that are asked for
        rate, values = read_wav(opened.path, mmap=True)
    except ValueError as error:
        if "mmap=True" not in str(error):  # integers of 24 bit
            raise
        opened.file.seek(0)
        rate, values = read_wav(opened.file)
    table = values[:, None] if values.ndim == 1 else values
    kind, bits = table.dtype.kind, 8 * table.dtype.itemsize
    zero, full = (128.0, 128.0) if kind == "u" else (0.0, 1.0 if kind == "f" else 2.0 ** (bits - 1))

    def part(channel: int) -> Part:
        return lambda first, last: (table[first:last, channel].astype(np.float64) - zero) / full

    stated = int.from_bytes(head[34:36], order) if head[12:16] == b"fmt " else bits  # type: ignore[arg-type]
    note = f"{stated} bit {'float' if kind == 'f' else 'integer, full scale 1'}"
    tracks = [Track(str(at + 1), None, len(table), part(at), float(rate), note=note) for at in range(table.shape[1])]
    return Content("WAV", tracks, ["a WAV file states no units: state each channel's sensitivity"], sample_bytes=8)


FORMAT = track_format("wav", "WAV", (".wav", ".wave"), _KIND, _content)
