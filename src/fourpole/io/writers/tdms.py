"""NI TDMS: groups of channels with their unit, increment and offset; uneven times are a channel of their own."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from fourpole.io.formats.guard import need
from fourpole.io.writers.plan import Block, Group, Remarks, Writer, names_in_group

_KIND = "an NI TDMS file"
_NO_GROUP = "recording"


class _Sink:
    def __init__(self, nptdms: Any, file: Any, groups: Sequence[Group], names: Sequence[list[str]]) -> None:
        self._library, self._file, self._groups, self._names = nptdms, file, groups, names
        self._begun: set[int] = set()

    def add(self, at: int, block: Block, /) -> None:
        group, names = self._groups[at], self._names[at]
        objects = [
            self._library.ChannelObject(group.name or _NO_GROUP, name, samples, self._properties(at, number))
            for number, (name, samples) in enumerate(zip(names[1:], block.columns, strict=True))
        ]
        if group.stamped and group.rate is None:
            stated = {} if at in self._begun else {"unit_string": "s"}
            time = self._library.ChannelObject(group.name or _NO_GROUP, names[0], block.stamps, stated)
            objects.insert(0, time)
        self._begun.add(at)
        self._file.write_segment(objects)

    def _properties(self, at: int, number: int) -> dict[str, str | float]:
        """The properties of a channel, in its first block only."""
        if at in self._begun:
            return {}
        group, channel = self._groups[at], self._groups[at].channels[number]
        stated: dict[str, str | float] = {}
        if group.rate is not None:
            stated |= {"wf_increment": 1.0 / group.rate, "wf_start_offset": float(group.start)}
        if channel.unit:
            stated["unit_string"] = channel.unit
        if channel.note:
            stated["description"] = channel.note
        return stated


@contextmanager
def _open(path: Path, groups: Sequence[Group], remarks: Remarks) -> Iterator[_Sink]:
    nptdms = need("nptdms", path.name, _KIND)
    names: list[list[str]] = []
    taken: dict[str, list[str]] = {}
    for group in groups:
        there = taken.setdefault(group.name or _NO_GROUP, [])
        time, after = names_in_group(group, groups, there, remarks)
        there += [time, *after] if group.stamped and group.rate is None else after
        names.append([time, *after])
        remarks.by_rate(group)
    root = nptdms.RootObject({f"note {at}": note for at, note in enumerate(remarks.notes, 1)})
    with nptdms.TdmsWriter(path) as file:
        file.write_segment([root])
        yield _Sink(nptdms, file, groups, names)


WRITER = Writer("tdms", "NI TDMS", (".tdms",), False, _open)
