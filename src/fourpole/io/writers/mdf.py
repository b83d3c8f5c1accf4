"""ASAM MDF 4.10: a channel group per time base; the master of the group has the times."""

from __future__ import annotations

import datetime as dt
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from fourpole.io.formats.guard import need
from fourpole.io.writers.plan import Block, Group, Remarks, Writer, check_timed, distinct, time_name

_KIND = "an ASAM MDF file"


class _Sink:
    def __init__(self, asammdf: Any, mdf: Any, groups: Sequence[Group], names: Sequence[str]) -> None:
        self._library, self._mdf, self._groups, self._names = asammdf, mdf, groups, names
        self._places: dict[int, int] = {}

    def add(self, at: int, block: Block, /) -> None:
        group = self._groups[at]
        times = np.ascontiguousarray(block.times(group))
        if at in self._places:
            parts = [times, *block.columns]
            self._mdf.extend(self._places[at], [(np.ascontiguousarray(part), None) for part in parts])
            return
        master = (time_name(group.channels), 1)
        self._places[at] = len(self._mdf.groups)
        called = distinct([channel.name for channel in group.channels], [master[0]])
        signals = [
            self._library.Signal(
                samples, times, unit=channel.unit or "", name=name, comment=channel.note, master_metadata=master
            )
            for name, channel, samples in zip(called, group.channels, block.columns, strict=True)
        ]
        self._mdf.append(signals, acq_name=self._names[at] or None, common_timebase=True)


@contextmanager
def _open(path: Path, groups: Sequence[Group], remarks: Remarks) -> Iterator[_Sink]:
    asammdf = need("asammdf", path.name, _KIND)
    check_timed(groups, path, "MDF")
    for group in groups:
        names = [channel.name for channel in group.channels]
        remarks.renamed(names, distinct(names, [time_name(group.channels)]))
    named = [group.name[:60] for group in groups]
    if len(groups) > 1:
        named = [name or "recording" for name in named]
    names = distinct(named)
    remarks.renamed(named, names)
    with asammdf.MDF(version="4.10") as mdf:
        mdf.header.start_time = dt.datetime(1970, 1, 1, tzinfo=dt.UTC)  # the date of the recording is not known
        mdf.header.comment = "\n".join(remarks.notes)
        yield _Sink(asammdf, mdf, groups, names)
        mdf.save(path.with_suffix(".mf4"), overwrite=True)
    path.with_suffix(".mf4").rename(path)


WRITER = Writer("mf4", "ASAM MDF 4.10", (".mf4",), False, _open)
