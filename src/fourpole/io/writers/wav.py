"""WAV: samples as 64-bit floats, which are exact; names and units are in a comment only."""

from __future__ import annotations

import struct
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from fourpole.errors import TableError
from fourpole.io.writers.plan import Add, Block, Group, Remarks, Writer, titled

_FLOAT, _WIDTH = 3, 8
_MOST = 0xFFFFFFFF - 1_000_000
_HIGHEST = 0xFFFFFFFF


@contextmanager
def _open(path: Path, groups: Sequence[Group], remarks: Remarks) -> Iterator[Add]:
    group = groups[0]
    rate = _whole(group, path.name)
    frame = _WIDTH * len(group.channels)
    if frame * group.count > _MOST or len(group.channels) > 0xFFFF // _WIDTH:
        much = f"{frame * group.count / 1e9:.3g} GB in {len(group.channels)} channels"
        raise TableError(f"{path.name}: a WAV file holds 4 GB; these are {much}: choose --channels or --window")
    _add_remarks(group, remarks)
    comment = "; ".join(f"{at} = {titled(channel)}" for at, channel in enumerate(group.channels, 1)).encode()
    comment += b"\0" * (2 - len(comment) % 2)  # a comment ends with a zero, and has an even length
    said = b"INFOICMT" + struct.pack("<I", len(comment)) + comment
    form = struct.pack("<HHIIHHH", _FLOAT, len(group.channels), rate, rate * frame & _HIGHEST, frame, 8 * _WIDTH, 0)
    with path.open("wb") as file:

        def head(count: int) -> bytes:
            chunks = b"fmt " + struct.pack("<I", len(form)) + form + b"fact" + struct.pack("<II", 4, count)
            chunks += b"LIST" + struct.pack("<I", len(said)) + said + b"data" + struct.pack("<I", count * frame)
            return b"RIFF" + struct.pack("<I", 4 + len(chunks) + count * frame) + b"WAVE" + chunks

        count = 0

        def add(_number: int, block: Block) -> None:
            nonlocal count
            file.write(np.stack(block.columns, axis=1).astype("<f8").tobytes())
            count += len(block)

        file.write(head(0))
        yield add
        file.seek(0)
        file.write(head(count))


def _whole(group: Group, name: str) -> int:
    """The rate as a whole number of Hz; TableError if it is none."""
    if group.rate is None:
        why = "these are not even" if group.stamped else "there are none"
        raise TableError(f"{name}: a WAV file needs a rate in place of times, and {why}: write .csv or .h5")
    if group.rate != int(group.rate) or group.rate > _HIGHEST:
        raise TableError(f"{name}: a WAV file states a whole number of Hz, not {group.rate!r}: write .csv or .h5")
    return int(group.rate)


def _add_remarks(group: Group, remarks: Remarks) -> None:
    names = ", ".join(f"{at} = {titled(channel)}" for at, channel in enumerate(group.channels, 1))
    remarks.lost.append(f"names and units are kept in a comment only, channels are called by number: {names}")
    if group.start:
        remarks.lost.append(f"the start is not kept: the first sample is at 0 s, not at {group.start:.10g} s")
    remarks.by_rate(group)
    remarks.no_notes(group.channels)


WRITER = Writer("wav", "WAV", (".wav",), True, _open)
