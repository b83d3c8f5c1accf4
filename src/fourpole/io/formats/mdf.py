"""ASAM MDF, versions 2 to 4.2: physical values, with the times of each channel group's master.

A group is called by its acquisition name if no other group has the same, or else by its number, from 0; its number is
always accepted. Samples marked invalid are not-a-number. A virtual master, whose time is a formula of the number of
the sample, gives a rate. Channels that are scaled by a formula in text are not read.
"""

from __future__ import annotations

import copy
import io
import math
import mmap
import os
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from fourpole.errors import TableError
from fourpole.io.formats.guard import afford, floats, of_name, seconds, tidy
from fourpole.io.formats.tracks import Content, OpenFile, Part, Track, remembered, track_format
from fourpole.io.signals import FileInfo, Request, SignalInfo
from fourpole.units import shown

_KIND = "an ASAM MDF file"
_LIBRARY = "asammdf"
_OPEN = b"UnFinMF "
#: Samples of a time that are checked for equal steps, and largest relative difference between two steps.
_CHECKED = 1_000_000
_EVEN = 1e-3
#: Largest number of reads of the file before its channels are known.
_MOST_READS = 5_000_000
#: Largest part of a block of samples that is held at a time [byte].
_PART = 1 << 23

_NUMBERS_4 = range(6)
_NUMBERS_3 = (*range(4), *range(9, 17))
_FORMULA_4, _FORMULA_3 = 3, 10
_LINEAR_4 = 1
_TIME = 1
#: Type of a master whose time is a formula of the number of the sample; types of channels without samples.
_VIRTUAL_MASTER, _VIRTUAL = 3, (3, 6)
#: Flags of a group whose records have a variable length, and of a channel with a mark for invalid samples.
_VARIABLE, _MARKED = 1, 2
#: Numpy's kinds of number, by the data type and the bits of a channel: unsigned, signed and real, little-endian first.
_KINDS = {
    (kind, bits): f"{'<>'[kind % 2]}{'uif'[kind // 2]}{bits // 8}"
    for kind in range(6)
    for bits in ((8, 16, 32, 64) if kind < 4 else (32, 64))
}
#: Types of channels with one number in each record, samples and times; flags of a channel with invalid samples.
_OF_RECORD, _INVALID = (0, 2), 3


def _check_closed(file: BinaryIO, name: str) -> None:
    """TableError if the program that wrote a file did not close it."""
    head = file.read(64)
    version = int.from_bytes(head[28:30], "little")
    if head[:8] == _OPEN or (410 <= version < 500 and any(head[60:64])):
        raise TableError(
            f"{name}: was not closed by what wrote it (unfinished MDF); open and save it there, or export it"
        )


class _Walked(io.BufferedReader):
    """The open file; it ends the library's walk over blocks that lead in a circle.

    A link takes at least four bytes of the file, and what it leads to about two reads.
    """

    def __init__(self, number: int) -> None:
        super().__init__(io.FileIO(number, closefd=False))
        self.left: float = min(1000 + os.fstat(number).st_size // 2, _MOST_READS)

    def read(self, size: int | None = -1, /) -> bytes:
        self.left -= 1
        if self.left < 0:
            raise ValueError("its blocks lead in a circle")
        return super().read(size)


@dataclass(frozen=True)
class _Channel:
    """A channel of the file."""

    group: str
    name: str
    at: tuple[int, int]
    """Indices of its group and of the channel in this group."""
    count: int
    barred: str
    """The reason why it cannot be read; empty if it can."""


class _Content(Content):
    """The channels of an open file."""

    sample_bytes = 24

    def __init__(self, opened: OpenFile) -> None:
        super().__init__(opened)
        self.times: dict[int, Part] = {}
        _check_closed(opened.file, opened.name)
        file = _Walked(opened.file.fileno())
        # The library gets the open file, and reads no bus database that a path or an attachment names.
        self.mdf = opened.guard.load(_LIBRARY).MDF(file, process_bus_logging=False)
        opened.closing.callback(self.mdf.close)
        file.left = math.inf
        self.is_4 = str(self.mdf.version) >= "4"
        titles = [self._title(group) for group in self.mdf.groups]
        often = Counter(titles)
        self.groups = [title if title and often[title] == 1 else str(number) for number, title in enumerate(titles)]
        for group in self.mdf.groups if self.is_4 else ():
            self._check_size(group)
            group.data_blocks = [part for block in group.data_blocks for part in _parted(block)]
        self.channels = self._all_channels()
        self.places = [(one.group, one.name) for one in self.channels]

    def _check_size(self, group: Any) -> None:
        """TableError if a group of version 4 declares more samples than its blocks hold."""
        cells = group.channel_group
        declared, there = cells.cycles_nr * cells.samples_byte_nr, sum(one.original_size for one in group.data_blocks)
        if declared > there and not cells.flags & _VARIABLE:
            what = f"a data group declares {declared} bytes of samples and has {there}"
            raise TableError(f"{self._name}: {what}; it is cut short or damaged: copy or export it again")

    def _title(self, group: Any) -> str:
        stated = getattr(group.channel_group, "acq_name", "") if self.is_4 else group.channel_group.comment
        return tidy(stated or "", 60)

    @cached_property
    def content(self) -> mmap.mmap:
        """The bytes of the file."""
        return mmap.mmap(self._file.fileno(), 0, access=mmap.ACCESS_READ)

    def plain(self, group: int, channel: Any) -> Part | None:
        """The function that takes the numbers of a channel from the file itself; None if they do not lie there so."""
        return _plain(self.content, self.mdf.groups[group], channel) if self.is_4 else None

    def info(self) -> FileInfo:
        times = {group: self.timing(group) for group in range(len(self.groups))}
        signals = tuple(self._info(one, times[one.at[0]]) for one in self.channels)
        began = self.mdf.start_time
        dated = began.year > 1980
        notes = [f"recorded {began.isoformat()}"] if dated else []
        stated = {key: getattr(self.mdf.header, key, "") for key in ("author", "department", "project", "subject")}
        notes += [f"{key}: {tidy(text)}" for key, text in stated.items() if isinstance(text, str) and text.strip()]
        return FileInfo(f"ASAM MDF {self.mdf.version}", signals, tuple(notes), began.timestamp() if dated else None)

    def _info(self, one: _Channel, timing: tuple[float | None, float, float] | None) -> SignalInfo:
        rate, start, duration = timing or (None, None, None)
        channel = self.mdf.groups[one.at[0]].channels[one.at[1]]
        notes = [one.barred, tidy(channel.comment) if isinstance(channel.comment, str) else ""]
        note = "; ".join(part for part in notes if part and not part.startswith("<"))
        return SignalInfo(one.name, self.unit(one.at), one.group, one.count, rate, start, duration, note)

    def tracks(self, request: Request, *, whole: bool) -> list[Track]:
        """The channels of a request, whose group may be a number."""
        group = request.group
        if group.isdecimal() and group not in self.groups and int(group) < len(self.groups):
            request = replace(request, group=self.groups[int(group)])
        return super().tracks(request, whole=whole)

    def _all_channels(self) -> list[_Channel]:
        """The channels of all groups, in the order of the file."""
        found = []
        for number, group in enumerate(self.mdf.groups):
            count = int(group.channel_group.cycles_nr)
            for place, channel in enumerate(group.channels):
                barred = self._barred(group, place, channel)
                found.append(_Channel(self.groups[number], channel.name, (number, place), count, barred))
        return found

    def _barred(self, group: Any, place: int, channel: Any) -> str:
        if channel.data_type not in (_NUMBERS_4 if self.is_4 else _NUMBERS_3):
            return "holds no numbers"
        if group.channel_dependencies[place] is not None:
            return "is a structure or an array; name one of its parts"
        if self.is_4 and channel.channel_type in (1, 4):
            return "holds no numbers"
        if not self._inside(group.channel_group, channel):
            return "lies outside its record: the file is damaged; copy or export it again"
        if _formula(channel.conversion, _FORMULA_4 if self.is_4 else _FORMULA_3):
            return "is scaled by a formula, which is not computed; save it with its physical values"
        return ""

    def _inside(self, cells: Any, channel: Any) -> bool:
        """Whether a channel lies inside the records of its group: the library does not check this."""
        if not self.is_4:
            start = channel.start_offset + 8 * getattr(channel, "additional_byte_offset", 0)
            return bool(start + channel.bit_count <= 8 * cells.samples_byte_nr)
        if cells.flags & _VARIABLE or channel.channel_type in _VIRTUAL:
            return True
        end = channel.byte_offset + (channel.bit_offset + channel.bit_count + 7) // 8
        marks = 8 * cells.invalidation_bytes_nr if channel.flags & _MARKED else 0
        return bool(end <= cells.samples_byte_nr and (not marks or channel.pos_invalidation_bit < marks))

    def unit(self, at: tuple[int, int]) -> str | None:
        channel = self.mdf.groups[at[0]].channels[at[1]]
        stated = channel.unit or (getattr(channel.conversion, "unit", "") if channel.conversion else "")
        return of_name(channel.name, stated)

    def master(self, group: int) -> tuple[int, Any] | None:
        """Index of a group, and the channel in it, that states the times of a group; None if there is none."""
        if self.is_4:
            remote = getattr(self.mdf.groups[group].channel_group, "cg_master_index", None)
            group = remote if remote is not None and group not in self.mdf.masters_db else group
        place = self.mdf.masters_db.get(group)
        if place is None:
            return None
        channel = self.mdf.groups[group].channels[place]
        return (group, channel) if not self.is_4 or channel.sync_type == _TIME else None

    def even(self, group: int) -> tuple[float, float] | None:
        """Rate [Hz] and start [s] of a virtual master; None if the group has no such master."""
        found = self.master(group)
        if found is None:
            return None
        master, way = found[1], found[1].conversion
        if not self.is_4:
            if master.bit_count or not master.sampling_rate > 0:
                return None
            return 1.0 / float(master.sampling_rate), 0.0
        if master.channel_type != _VIRTUAL_MASTER or way is None or way.conversion_type != _LINEAR_4 or not way.a > 0:
            return None
        return 1.0 / float(way.a), float(way.b)

    def time(self, group: int, *, first: int = 0, count: int | None = None) -> NDArray[np.float64] | None:
        """Times [s] of `count` samples of a group from number `first` on; None if the group has no times."""
        found = self.master(group)
        if found is None:
            return None
        master = found[1]
        called = f"the time of the group {shown(self.groups[group])}"
        if not self._inside(self.mdf.groups[found[0]].channel_group, master):
            raise TableError(f"{self._name}: {called} lies outside its record: the file is damaged; export it again")
        if _formula(master.conversion, _FORMULA_4 if self.is_4 else _FORMULA_3):
            raise TableError(f"{self._name}: {called} is scaled by a formula, which is not computed; export it again")
        scale = seconds(self.unit((found[0], self.mdf.masters_db[found[0]])))
        part = self.plain(*found)
        if part is None:
            values = floats(self.mdf.get_master(group, record_offset=first, record_count=count), called, self._name)
        else:
            there = int(self.mdf.groups[found[0]].channel_group.cycles_nr)
            values = part(first, there if count is None else min(first + count, there))
        return values * (1.0 if scale is None else scale)

    def samples(self, one: _Channel, first: int, last: int) -> NDArray[np.float64]:
        """Samples of a channel from number `first` up to `last`; those marked invalid are not-a-number."""
        if first == last:
            return np.empty(0)
        # With `ignore_invalidation_bits` the library returns all samples and marks the invalid; else it omits them.
        found, invalid = self.mdf.get(
            group=one.at[0],
            index=one.at[1],
            samples_only=True,
            ignore_invalidation_bits=True,
            record_offset=first,
            record_count=last - first,
        )
        values = floats(found, one.name, self._name)
        if invalid is not None and np.any(invalid):
            values = values.copy()
            values[np.asarray(invalid, dtype=bool)] = np.nan
        if len(values) != last - first:
            raise TableError(
                f"{self._name}: is cut short: channel {shown(one.name)} has {first + len(values)} of {one.count} "
                "samples; copy or export it again"
            )
        return values

    def track(self, index: int) -> Track:
        one = self.channels[index]
        if one.barred:
            raise TableError(f"{self._name}: channel {shown(one.name)} {one.barred}")
        unit, group = self.unit(one.at), one.at[0]
        samples = self.plain(group, self.mdf.groups[group].channels[one.at[1]])
        samples = samples or (lambda first, last: self.samples(one, first, last))
        if (even := self.even(group)) is not None:
            return Track(one.name, unit, one.count, samples, *even)
        if self.master(group) is None:
            return Track(one.name, unit, one.count, samples)
        if group not in self.times:
            self.times[group] = remembered(lambda first, last: self._times(group, first, last))
        return Track(one.name, unit, one.count, samples, time=self.times[group])

    def _times(self, group: int, first: int, last: int) -> NDArray[np.float64]:
        time = self.time(group, first=first, count=last - first) if last > first else np.empty(0)
        if time is None or len(time) != last - first:
            found = first + (0 if time is None else len(time))
            raise TableError(f"{self._name}: is cut short: {found} of {last} times are there; copy or export it again")
        return time

    def timing(self, group: int) -> tuple[float | None, float, float] | None:
        """Rate [Hz], start [s] and duration [s] of a group; the rate is None if its samples are not evenly spaced."""
        count = int(self.mdf.groups[group].channel_group.cycles_nr)
        if self.master(group) is None or not count:
            return None
        if (even := self.even(group)) is not None:
            return even[0], even[1], (count - 1) / even[0]
        afford(16 * min(count, _CHECKED), self._max_bytes, self._name, "its time")
        time = self.time(group, count=min(count, _CHECKED))
        last = self.time(group, first=count - 1, count=1) if count > _CHECKED else time
        if time is None or last is None or not len(time) or not len(last):
            return None
        span = float(last[-1] - time[0])
        step = span / (count - 1) if count > 1 else 0.0
        steps = np.diff(time)
        is_even = step > 0 and bool(np.all(np.abs(steps - step) <= _EVEN * step))
        return (1.0 / step if is_even else None), float(time[0]), span


def _plain(content: mmap.mmap, group: Any, channel: Any) -> Part | None:
    """The function that reads a channel from a file of version 4; None where only the library can.

    Parameters
    ----------
    content : mmap
        The file.
    group, channel : asammdf blocks
        The data group and the channel, as the library describes them.
    """
    cells, blocks = group.channel_group, group.data_blocks
    kind, record = _KINDS.get((channel.data_type, channel.bit_count)), int(cells.samples_byte_nr)
    if kind is None or not record or not _is_plain(group, channel):
        return None
    if any(one.block_type or one.block_limit is not None or one.original_size % record for one in blocks):
        return None
    pieces = [(int(one.address) + int(channel.byte_offset), int(one.original_size) // record) for one in blocks]
    if sum(count for _, count in pieces) < cells.cycles_nr:
        return None

    def part(first: int, last: int) -> NDArray[np.float64]:
        found = np.empty(last - first)
        begin = 0
        for place, count in pieces:
            low, high = max(first, begin), min(last, begin + count)
            if high > low:
                at = place + (low - begin) * record
                found[low - first : high - first] = np.ndarray((high - low,), kind, content, at, (record,))
            begin += count
        return found

    return part


def _is_plain(group: Any, channel: Any) -> bool:
    """Whether nothing of a channel has to be unpacked, scaled, sorted or marked invalid."""
    cells = group.channel_group
    special = channel.bit_offset or channel.conversion or channel.flags & _INVALID or cells.invalidation_bytes_nr
    apart = cells.flags or group.uses_ld or group.data_location or group.data_group.record_id_len
    return bool(group.sorted and channel.channel_type in _OF_RECORD and not special and not apart)


def _parted(block: Any) -> Iterator[Any]:
    """A block of samples, parted if it is large and not compressed: the library holds a whole block in memory."""
    size = block.original_size
    if block.block_type or block.invalidation_block is not None or block.block_limit is not None or size <= _PART:
        yield block
        return
    for at in range(0, size, _PART):
        part = copy.copy(block)
        part.address = block.address + at
        part.original_size = part.compressed_size = min(_PART, size - at)
        yield part


def _formula(conversion: Any, kind: int) -> bool:
    """Whether a scaling, or a scaling that it refers to, is a formula in text."""
    if conversion is None or isinstance(conversion, bytes | str):
        return False
    if conversion.conversion_type == kind:
        return True
    inner = getattr(conversion, "referenced_blocks", None) or {}
    return any(_formula(one, kind) for one in inner.values())


FORMAT = track_format("mdf", "ASAM MDF", (".mf4", ".mdf", ".dat"), _KIND, _Content, by_library=True)
