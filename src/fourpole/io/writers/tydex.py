"""TYDEX 1.3: a table with RUNTIME and thirteen digits; names have eight letters, descriptions the full names."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from fourpole.errors import TableError
from fourpole.io.formats.tydex_file import TydexChannel, TydexFile, meaning, write_tydex
from fourpole.io.writers.plan import Add, FloatArray, Group, Remarks, Writer, WrittenChannel, distinct

_NAME, _DESCRIPTION, _UNIT = 8, 30, 9
#: Largest size of the samples, which are held in memory and written as text [byte].
_MOST = 500_000_000
_PLAIN = str.maketrans({"µ": "u", "μ": "u", "°": "deg", "²": "^2", "³": "^3", "·": "*", "Ω": "Ohm", "–": "-", "−": "-"})


@contextmanager
def _open(path: Path, groups: Sequence[Group], remarks: Remarks) -> Iterator[Add]:
    group = groups[0]
    needed = 8 * group.count * (len(group.channels) + 1)
    if needed > _MOST:
        raise TableError(f"{path.name}: TYDEX is text, and these are {needed / 1e6:.4g} MB of numbers; write .parquet")
    remarks.lost.append("numbers are kept to 13 digits")
    channels = _channels(group.channels, remarks)
    if group.timed:
        channels.insert(0, TydexChannel("RUNTIME", "s", meaning("RUNTIME")))
    comments = tuple(_plain(note) for note in remarks.notes)
    if comments != remarks.notes:
        remarks.lost.append("notes are kept in ASCII")
    parts: list[FloatArray] = []
    yield lambda _, block: parts.append(np.stack(block.table(group), axis=1))
    data = np.concatenate(parts)
    if np.isinf(data).any():
        raise TableError(f"{path.name}: TYDEX cannot hold an infinite value; write .parquet or .h5")
    write_tydex(path, TydexFile(channels=tuple(channels), data=data, comments=comments), label=path.name)


def _plain(text: str) -> str:
    """A text in printable ASCII that does not begin with *, which would open a section."""
    return text.translate(_PLAIN).encode("ascii", "replace").decode().strip().lstrip("*")


def _channels(written: Sequence[WrittenChannel], remarks: Remarks) -> list[TydexChannel]:
    before = [one.name for one in written]
    after = distinct([_short(name) for name in before], ["RUNTIME"], _NAME)
    remarks.renamed(before, after)
    found = []
    for name, one in zip(after, written, strict=True):
        unit = _plain(one.unit or "").replace(" ", "*")
        if len(unit) > _UNIT:
            what = f"the unit of {one.name}, {one.unit}, has more than {_UNIT} characters and is left out"
            remarks.lost.append(what)
            unit = ""
        described = "" if one.name == name else _plain(one.name)[:_DESCRIPTION].strip()
        found.append(TydexChannel(name, unit, described))
    return found


def _short(name: str) -> str:
    return re.sub(r"[^A-Za-z0-9_.+-]+", "", _plain(name))[:_NAME] or "CHANNEL"


WRITER = Writer("tydex", "TYDEX 1.3", (".tdx", ".tyd"), True, _open)
