"""ASAM MDF, versions 2 to 4.2: physical values, with the times of each channel group's master.

A group is called by its acquisition name if no other group has the same, or else by its number, from 0; its number is
always accepted. Samples marked invalid are not-a-number. A virtual master, whose time is a formula of the number of
the sample, gives a rate. Channels that are scaled by a formula in text are not read.
"""

from __future__ import annotations

import io
import math
import mmap
import os
from collections import Counter
from dataclasses import dataclass, replace
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from fourpole.errors import TableError
from fourpole.io.formats.guard import floats, of_name, seconds, tidy
from fourpole.io.formats.tracks import Content, OpenFile, Part, Track, remembered, track_format
from fourpole.io.signals import FileInfo, Request
from fourpole.units import shown

_OPEN = b"UnFinMF "
#: Samples of a time that are checked for equal steps, and largest relative difference between two steps.
_CHECKED = 1_000_000
_EVEN = 1e-3
#: Largest number of reads of the file before its channels are known.
_MOST_READS = 5_000_000
_NUMBERS_4 = range(6)
_NUMBERS_3 = (*range(4), *range(9, 17))
_FORMULA_4, _FORMULA_3 = 3, 10
_LINEAR_4 = 1
_TIME = 1
#: Types of channels of version 4: of texts and of no record; a master whose time is a formula of the sample's number.
_TEXTS, _VIRTUAL_MASTER, _VIRTUAL = (1, 4), 3, (3, 6)
#: Flags of a group whose records have a variable length, and of a channel with a mark for invalid samples.
_VARIABLE, _MARKED = 1, 2
#: Numpy's kinds of number, by the data type and the bits of a channel: unsigned, signed and real, little-endian first.
_KINDS = {
    (kind, bits): f"{'<>'[kind % 2]}{'uif'[kind // 2]}{bits // 8}"
    for kind in range(6)
    for bits in ((8, 16, 32, 64) if kind < 4 else (32, 64))
}
#: Types of channels with one number in each record: samples and times.
_OF_RECORD = (0, 2)


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


class _Reader:
    """The channels of an open file, as the library reads them."""

    def __init__(self, mdf: Any, content: mmap.mmap, name: str) -> None:
        self._mdf, self._content, self._name = mdf, content, name
        self._is_4 = str(mdf.version) >= "4"
        titles = [
            tidy((getattr(one, "acq_name", "") if self._is_4 else one.comment) or "", 60) for one in self._cells()
        ]
        often = Counter(titles)
        self.groups = [title if title and often[title] == 1 else str(number) for number, title in enumerate(titles)]

    def _cells(self) -> list[Any]:
        return [group.channel_group for group in self._mdf.groups]

    def tracks(self) -> list[Track]:
        """The channels of all groups, in the order of the file."""
        found = []
        for number, group in enumerate(self._mdf.groups):
            rate, start, time = self._timing(number)
            count = int(group.channel_group.cycles_nr)
            for place, one in enumerate(group.channels):
                barred = "holds no numbers" if self._holds_none(one) else self._barred(group, place, one)
                comment = tidy(one.comment) if isinstance(one.comment, str) else ""
                note = "" if comment.startswith("<") else comment
                samples = self._plain(group, one) or self._samples((number, place), one.name)
                unit = self._unit(one)
                found.append(
                    Track(one.name, unit, count, samples, rate, start, time, self.groups[number], note, barred)
                )
        return found

    def _holds_none(self, channel: Any) -> bool:
        of_numbers = channel.data_type in (_NUMBERS_4 if self._is_4 else _NUMBERS_3)
        return not of_numbers or (self._is_4 and channel.channel_type in _TEXTS)

    def _barred(self, group: Any, place: int, channel: Any) -> str:
        """The reason why a channel cannot be read; empty if it can."""
        if group.channel_dependencies[place] is not None:
            return "is a structure or an array; name one of its parts"
        if not self._inside(group.channel_group, channel):
            return "lies outside its record: the file is damaged; copy or export it again"
        if _formula(channel.conversion, _FORMULA_4 if self._is_4 else _FORMULA_3):
            return "is scaled by a formula, which is not computed; save it with its physical values"
        return ""

    def _inside(self, cells: Any, channel: Any) -> bool:
        """Whether a channel lies inside the records of its group: the library does not check this."""
        if not self._is_4:
            start = channel.start_offset + 8 * getattr(channel, "additional_byte_offset", 0)
            return bool(start + channel.bit_count <= 8 * cells.samples_byte_nr)
        if cells.flags & _VARIABLE or channel.channel_type in _VIRTUAL:
            return True
        end = channel.byte_offset + (channel.bit_offset + channel.bit_count + 7) // 8
        marks = 8 * cells.invalidation_bytes_nr if channel.flags & _MARKED else 0
        return bool(end <= cells.samples_byte_nr and (not marks or channel.pos_invalidation_bit < marks))

    def _unit(self, channel: Any) -> str | None:
        stated = channel.unit or (getattr(channel.conversion, "unit", "") if channel.conversion else "")
        return of_name(channel.name, stated)

    def _timing(self, group: int) -> tuple[float | None, float, Part | None]:
        """Rate [Hz] and start [s] by a virtual master, or the function that reads the times of a group [s]."""
        at = group
        if self._is_4 and group not in self._mdf.masters_db:
            at = getattr(self._cells()[group], "cg_master_index", None) or group
        place = self._mdf.masters_db.get(at)
        master = None if place is None else self._mdf.groups[at].channels[place]
        if master is None or (self._is_4 and master.sync_type != _TIME):
            return None, 0.0, None
        way = master.conversion
        if not self._is_4 and not master.bit_count and master.sampling_rate > 0:
            return 1.0 / float(master.sampling_rate), 0.0, None
        linear = self._is_4 and way is not None and way.conversion_type == _LINEAR_4
        if linear and master.channel_type == _VIRTUAL_MASTER and way.a > 0:
            return 1.0 / float(way.a), float(way.b), None
        barred = self._barred(self._mdf.groups[at], place, master)
        plain = self._plain(self._mdf.groups[at], master)
        scale, called = seconds(self._unit(master)) or 1.0, f"the time of the group {shown(self.groups[group])}"

        def times(first: int, last: int) -> NDArray[np.float64]:
            if barred:
                raise TableError(f"{self._name}: {called} {barred}")
            if plain is not None:
                return scale * plain(first, last)
            found = self._mdf.get_master(group, record_offset=first, record_count=last - first) if last > first else []
            return scale * floats(found, called, self._name)

        return None, 0.0, remembered(times)

    def _plain(self, group: Any, channel: Any) -> Part | None:
        """The function that takes numbers of version 4 from the file itself, which is faster; None where it cannot."""
        if not self._is_4:
            return None
        cells, blocks, record = group.channel_group, group.data_blocks, max(int(group.channel_group.samples_byte_nr), 1)
        kind = _KINDS.get((channel.data_type, channel.bit_count))
        packed = channel.bit_offset or channel.conversion or channel.flags & 3 or cells.invalidation_bytes_nr
        apart = cells.flags or group.uses_ld or group.data_location or group.data_group.record_id_len
        odd = any(one.block_type or one.block_limit is not None or one.original_size % record for one in blocks)
        if packed or apart or odd or kind is None or not group.sorted or channel.channel_type not in _OF_RECORD:
            return None
        pieces = [(int(one.address) + int(channel.byte_offset), int(one.original_size) // record) for one in blocks]
        if sum(count for _, count in pieces) < cells.cycles_nr:
            return None

        def part(first: int, last: int) -> NDArray[np.float64]:
            found, begin = np.empty(last - first), 0
            for place, count in pieces:
                low, high = max(first, begin), min(last, begin + count)
                if high > low:
                    at = place + (low - begin) * record
                    held = np.ndarray((high - low,), kind, self._content, at, (record,))
                    found[low - first : high - first] = held
                begin += count
            return found

        return part

    def _samples(self, at: tuple[int, int], name: str) -> Part:
        """The function that reads a part of a channel; samples marked invalid are not-a-number."""

        def part(first: int, last: int) -> NDArray[np.float64]:
            if first == last:
                return np.empty(0)
            # With `ignore_invalidation_bits` the library returns all samples and marks the invalid; else it omits them.
            found, invalid = self._mdf.get(
                group=at[0], index=at[1], samples_only=True, ignore_invalidation_bits=True,
                record_offset=first, record_count=last - first,
            )  # fmt: skip
            values = floats(found, name, self._name)
            return values if invalid is None else np.where(np.asarray(invalid, dtype=bool), np.nan, values)

        return part


def _formula(conversion: Any, kind: int) -> bool:
    """Whether a scaling, or a scaling that it refers to, is a formula in text."""
    if conversion is None or isinstance(conversion, bytes | str):
        return False
    inner = getattr(conversion, "referenced_blocks", None) or {}
    return conversion.conversion_type == kind or any(_formula(one, kind) for one in inner.values())


@dataclass(frozen=True)
class _Content(Content):
    """The channels of an open file, with the names of their groups."""

    groups: tuple[str, ...] = ()

    def info(self) -> FileInfo:
        """The description of the file and its channels, with the rate of those whose times are even."""
        found = super().info()
        rates: dict[Part | None, float | None] = {}
        for one in self.tracks:
            if one.time is not None and one.time not in rates and one.count:
                rates[one.time] = _even_rate(one.time, one.count)
        pairs = zip(found.signals, self.tracks, strict=True)
        return replace(found, signals=tuple(replace(one, rate=rates.get(of.time, one.rate)) for one, of in pairs))

    def asked(self, request: Request) -> list[Track]:
        """The channels of a request, whose group may be a number."""
        group = request.group
        if group.isdecimal() and group not in self.groups and int(group) < len(self.groups):
            request = replace(request, group=self.groups[int(group)])
        return super().asked(request)


def _even_rate(time: Part, count: int) -> float | None:
    """The rate of some times [Hz]; None if they are not evenly spaced."""
    first = time(0, min(count, _CHECKED))
    step = float(time(count - 1, count)[0] - first[0]) / max(count - 1, 1)
    return 1.0 / step if step > 0 and np.all(np.abs(np.diff(first) - step) <= _EVEN * step) else None


def _content(opened: OpenFile) -> Content:
    """The channels of an open file."""
    _check_closed(opened.file, opened.name)
    file = _Walked(opened.file.fileno())
    file.seek(0)
    # The library gets the open file, and reads no bus database that a path or an attachment names.
    mdf = opened.load("asammdf").MDF(file, process_bus_logging=False)
    opened.closing.callback(mdf.close)
    file.left = math.inf
    content = mmap.mmap(opened.file.fileno(), 0, access=mmap.ACCESS_READ)
    reader, began = _Reader(mdf, content, opened.name), mdf.start_time
    dated = began.year > 1980
    notes = [f"recorded {began.isoformat()}"] if dated else []
    stated = {key: getattr(mdf.header, key, "") for key in ("author", "department", "project", "subject")}
    notes += [f"{key}: {tidy(text)}" for key, text in stated.items() if isinstance(text, str) and text.strip()]
    form, zero = f"ASAM MDF {mdf.version}", began.timestamp() if dated else None
    return _Content(form, reader.tracks(), notes, zero, sample_bytes=24, groups=tuple(reader.groups))


FORMAT = track_format("mdf", "ASAM MDF", (".mf4", ".mdf", ".dat"), "an ASAM MDF file", _content)
