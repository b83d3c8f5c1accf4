"""TYDEX 1.3: a table with RUNTIME, to thirteen digits; names of eight letters, the full ones as descriptions."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from fourpole.errors import TableError
from fourpole.io.formats.tydex import TydexChannel, TydexFile, meaning, write_tydex
from fourpole.io.writers.plan import Block, FloatArray, Group, Told, Track, Writer, distinct

__all__ = ["WRITER"]

_NAME, _DESCRIPTION, _UNIT = 8, 30, 9
_MOST = 500_000_000  # bytes of samples that are held, and written as text
_PLAIN = str.maketrans({"µ": "u", "μ": "u", "°": "deg", "²": "^2", "³": "^3", "·": "*", "Ω": "Ohm", "–": "-", "−": "-"})


class _Sink:
    def __init__(self, group: Group) -> None:
        self._group = group
        self.parts: list[FloatArray] = []

    def add(self, _at: int, block: Block, /) -> None:
        times = block.times(self._group)
        self.parts.append(np.stack(block.columns if times is None else [times, *block.columns], axis=1))


@contextmanager
def _open(path: Path, groups: Sequence[Group], told: Told) -> Iterator[_Sink]:
    group = groups[0]
    needed = 8 * group.count * (len(group.tracks) + 1)
    if needed > _MOST:
        raise TableError(f"{path.name}: TYDEX is text, and these are {needed / 1e6:.4g} MB of numbers; write .parquet")
    told.lost.append("numbers are kept to 13 digits")
    channels = _channels(group.tracks, told)
    if group.timed:
        channels.insert(0, TydexChannel("RUNTIME", "s", meaning("RUNTIME")))
    comments = tuple(_plain(note) for note in told.notes)
    if comments != told.notes:
        told.lost.append("notes are kept in ASCII")
    sink = _Sink(group)
    yield sink
    data = np.concatenate(sink.parts)
    if np.isinf(data).any():
        raise TableError(f"{path.name}: TYDEX cannot hold an infinite value; write .parquet or .h5")
    write_tydex(path, TydexFile(channels=tuple(channels), data=data, comments=comments), label=path.name)


def _plain(text: str) -> str:
    """A text in printable ASCII that opens no section."""
    return text.translate(_PLAIN).encode("ascii", "replace").decode().strip().lstrip("*")


def _channels(tracks: Sequence[Track], told: Told) -> list[TydexChannel]:
    before = [track.name for track in tracks]
    after = distinct([_short(name) for name in before], ["RUNTIME"], _NAME)
    told.renamed(before, after)
    channels = []
    for name, track in zip(after, tracks, strict=True):
        unit = _plain(track.unit or "").replace(" ", "*")
        if len(unit) > _UNIT:
            told.lost.append(
                f"the unit of {track.name}, {track.unit}, has more than {_UNIT} characters and is left out"
            )
            unit = ""
        described = "" if track.name == name else _plain(track.name)[:_DESCRIPTION].strip()
        channels.append(TydexChannel(name, unit, described))
    return channels


def _short(name: str) -> str:
    return re.sub(r"[^A-Za-z0-9_.+-]+", "", _plain(name))[:_NAME] or "CHANNEL"


WRITER = Writer("tydex", "TYDEX 1.3", (".tdx", ".tyd"), True, _open)
