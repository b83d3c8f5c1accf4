"""ASAM MDF 4.10: a channel group per time base, its master the times."""

from __future__ import annotations

import datetime as dt
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from fourpole.errors import TableError
from fourpole.io.formats.guard import need
from fourpole.io.writers.plan import Block, Group, Told, Writer, distinct, time_name

__all__ = ["WRITER"]

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
        master = (time_name(group.tracks), 1)
        self._places[at] = len(self._mdf.groups)
        called = distinct([track.name for track in group.tracks], [master[0]])
        signals = [
            self._library.Signal(
                samples, times, unit=track.unit or "", name=name, comment=track.note, master_metadata=master
            )
            for name, track, samples in zip(called, group.tracks, block.columns, strict=True)
        ]
        self._mdf.append(signals, acq_name=self._names[at] or None, common_timebase=True)


@contextmanager
def _open(path: Path, groups: Sequence[Group], told: Told) -> Iterator[_Sink]:
    asammdf = need("asammdf", path.name, _KIND)
    for group in groups:
        if not group.timed:
            raise TableError(f"{path.name}: MDF needs times, and these have none: {group.words}; write .csv or .h5")
        names = [track.name for track in group.tracks]
        told.renamed(names, distinct(names, [time_name(group.tracks)]))
    named = [group.name[:60] for group in groups]
    names = distinct([name or "recording" for name in named]) if len(groups) > 1 else named
    told.renamed(named if len(groups) == 1 else [name or "recording" for name in named], names)
    with asammdf.MDF(version="4.10") as mdf:
        mdf.header.start_time = dt.datetime(1970, 1, 1, tzinfo=dt.UTC)  # of the recording nothing is known
        mdf.header.comment = "\n".join(told.notes)
        yield _Sink(asammdf, mdf, groups, names)
        mdf.save(path.with_suffix(".mf4"), overwrite=True)
    path.with_suffix(".mf4").rename(path)


WRITER = Writer("mf4", "ASAM MDF 4.10", (".mf4",), False, _open)
