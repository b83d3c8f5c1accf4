"""ASAM MDF 4.10: a channel group per time base; the master of the group has the times."""

from __future__ import annotations

import datetime as dt
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from fourpole.io.formats.guard import need
from fourpole.io.writers.plan import Add, Block, Group, Remarks, Writer, check_timed, distinct, time_name

_KIND = "an ASAM MDF file"


@contextmanager
def _open(path: Path, groups: Sequence[Group], remarks: Remarks) -> Iterator[Add]:
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
        places: dict[int, int] = {}

        def add(number: int, block: Block) -> None:
            group = groups[number]
            times = np.ascontiguousarray(block.times(group))
            if number in places:
                parts = [(np.ascontiguousarray(part), None) for part in (times, *block.columns)]
                mdf.extend(places[number], parts)
                return
            master = (time_name(group.channels), 1)
            places[number] = len(mdf.groups)
            called = distinct([channel.name for channel in group.channels], [master[0]])
            signals = [
                asammdf.Signal(
                    samples, times, unit=channel.unit or "", name=name, comment=channel.note, master_metadata=master
                )
                for name, channel, samples in zip(called, group.channels, block.columns, strict=True)
            ]
            mdf.append(signals, acq_name=names[number] or None, common_timebase=True)

        yield add
        mdf.save(path.with_suffix(".mf4"), overwrite=True)
    path.with_suffix(".mf4").rename(path)


WRITER = Writer("mf4", "ASAM MDF 4.10", (".mf4",), False, _open)
