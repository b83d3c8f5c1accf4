"""NI TDMS: groups of channels with their unit, increment and offset; uneven times are a channel of their own."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from fourpole.io.formats.guard import need
from fourpole.io.writers.plan import Add, Block, Group, Remarks, Writer, WrittenChannel, names_in_group

_KIND = "an NI TDMS file"
_NO_GROUP = "recording"


@contextmanager
def _open(path: Path, groups: Sequence[Group], remarks: Remarks) -> Iterator[Add]:
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

        def add(number: int, block: Block) -> None:
            group, (time, *called) = groups[number], names[number]
            place, is_first = group.name or _NO_GROUP, block.first == 0
            objects = [
                nptdms.ChannelObject(place, name, samples, _properties(group, channel) if is_first else {})
                for name, channel, samples in zip(called, group.channels, block.columns, strict=True)
            ]
            if group.stamped and group.rate is None:
                stated = {"unit_string": "s"} if is_first else {}
                objects.insert(0, nptdms.ChannelObject(place, time, block.stamps, stated))
            file.write_segment(objects)

        yield add


def _properties(group: Group, channel: WrittenChannel) -> dict[str, str | float]:
    """The properties of a channel, which its first block states."""
    stated: dict[str, str | float] = {}
    if group.rate is not None:
        stated |= {"wf_increment": 1.0 / group.rate, "wf_start_offset": float(group.start)}
    if channel.unit:
        stated["unit_string"] = channel.unit
    if channel.note:
        stated["description"] = channel.note
    return stated


WRITER = Writer("tdms", "NI TDMS", (".tdms",), False, _open)
