"""ASAM MDF, versions 2 to 4.2: physical values, with the time of each channel group's master.

A group is called by its acquisition name where no other has the same, else by its number, from 0; a number
is always understood. Samples marked invalid are not-a-number. A virtual master, whose time is a formula of
the sample's number, gives a rate.

Before the library sees the file, its blocks are walked: each must lie in the file, none may be reached
twice, and what is compressed must unpack to what it declares. Refused are files that were not closed by
what wrote them, channels scaled by a formula in text, and compression other than deflate.
"""

from __future__ import annotations

import copy
import os
import struct
import zlib
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from fourpole.errors import TableError
from fourpole.io.formats.guard import Guard, afford, find, floats, of_name, seconds, tidy
from fourpole.io.formats.pieces import Part, Track, by_tracks, remembered
from fourpole.io.signals import MAX_FILE_BYTES, FileInfo, Format, Request, SignalInfo
from fourpole.io.source import name_of, open_regular
from fourpole.units import shown

__all__ = ["FORMAT"]

_KIND = "an ASAM MDF file"
_LIBRARY = "asammdf"
_CLOSED, _OPEN = b"MDF     ", b"UnFinMF "
_VERSION_4 = 400
_MOST_TEXT = 256_000_000
_MOST_CONVERSIONS = 1_000_000
_DEEPEST = 16
_MOST_INFLATED = 1100  # times: more than deflate can
_LOOKED_AT = 1_000_000
_EVEN = 1e-3
_PART = 1 << 23  # bytes of a block of samples that are held at a time

# Which links of a block lead on: to the next of its kind, to its parts, to texts. Of the others none is followed.
_LINKS_4: dict[bytes, tuple[int, ...]] = {
    b"##HD": (0, 1, 3, 4, 5),
    b"##FH": (0, 1),
    b"##AT": (0, 1, 2, 3),
    b"##EV": (0, 3, 4),
    b"##DG": (0, 1, 2, 3),
    b"##CG": (0, 1, 2, 3, 5),
    b"##CN": (0, 1, 2, 3, 4, 5, 6, 7),
    b"##CA": (0,),
    b"##SI": (0, 1, 2),
    b"##HL": (0,),
}
_SHARED = frozenset({b"##TX", b"##MD", b"##SI", b"##CC"})
_SAMPLES = frozenset({b"##DT", b"##DV", b"##DI", b"##SD", b"##RD", b"##RV", b"##RI"})
_LISTS = frozenset({b"##DL", b"##LD"})
_KNOWN = frozenset(_LINKS_4) | _SHARED | _SAMPLES | _LISTS | {b"##DZ", b"##CH", b"##SR"}
_NUMBERS_4 = range(6)
_NUMBERS_3 = (*range(4), *range(9, 17))
_VIRTUAL_MASTER = 3
_VIRTUAL = (3, 6)
_FORMULA_4, _FORMULA_3 = 3, 10
_LINEAR_4, _LINEAR_3, _NONE_3 = 1, 0, 65535
_TIME = 1


def _recognises(head: bytes) -> bool:
    return head[:8] in (_CLOSED, _OPEN)


# --- the walk over the blocks ---


@dataclass
class _Walk:
    """Blocks of a file that have been looked at."""

    file: BinaryIO
    name: str
    max_bytes: int
    end: int
    seen: set[int] = field(default_factory=set)
    conversions: dict[int, int] = field(default_factory=dict)
    expanded: int = 0
    text: int = 0

    def bad(self, what: str) -> TableError:
        return TableError(f"{self.name}: {what}; it is cut short or damaged: copy or export it again")

    def at(self, address: int, count: int) -> bytes:
        """Some bytes that must be there."""
        if address < 0 or address + count > self.end:
            raise self.bad(f"ends at byte {self.end}, but a block is to be at {address}")
        self.file.seek(address)
        return self.file.read(count)

    def once(self, address: int, kind: bytes) -> None:
        if address in self.seen:
            raise self.bad(f"the block {kind.strip(b'#').decode('latin-1')} at byte {address} is reached twice")
        self.seen.add(address)


def _block_4(walk: _Walk, address: int) -> tuple[bytes, int, tuple[int, ...]]:
    """Kind, length and links of a block."""
    kind, _, length, count = struct.unpack("<4sIQQ", walk.at(address, 24))
    if kind not in _KNOWN:
        raise walk.bad(f"there is no block at byte {address}")
    if length < 24 or count > (length - 24) // 8 or address + length > walk.end:
        raise walk.bad(f"the block {kind[2:].decode()} at byte {address} ends after the file")
    return kind, length, struct.unpack(f"<{count}Q", walk.at(address + 24, 8 * count))


def _check_4(walk: _Walk) -> None:
    """Walk over a file of version 4."""
    waiting = [64]
    groups: list[int] = []
    while waiting:
        address = waiting.pop()
        kind, length, links = _block_4(walk, address)
        if kind in _SHARED:
            _check_shared(walk, address, kind, length, waiting)
            continue
        walk.once(address, kind)
        if kind == b"##DZ":
            _check_packed(walk, address, length)
        if kind == b"##DG":
            groups.append(address)
        if kind in _LISTS:
            waiting.extend(link for link in links if link)
            continue
        for number in _LINKS_4.get(kind, ()):
            link = links[number] if number < len(links) else 0
            if link and not (kind == b"##CN" and number == 5 and not _holds_samples(walk, link)):
                waiting.append(link)
    for address in groups:
        _check_group_4(walk, address)


def _holds_samples(walk: _Walk, address: int) -> bool:
    """Whether a channel's data are a block of its own; else they are another group or an attachment."""
    kind, _, _ = _block_4(walk, address)
    return kind in _SAMPLES | _LISTS | {b"##DZ", b"##HL"}


def _check_shared(walk: _Walk, address: int, kind: bytes, length: int, waiting: list[int]) -> None:
    """A block that many may use: each use costs the library time and memory, so their sum is bounded."""
    if kind == b"##CC":
        walk.expanded += _conversions(walk, address, waiting, 0)
        if walk.expanded > _MOST_CONVERSIONS:
            raise walk.bad("its scalings are nested without end")
        return
    walk.text += length
    if walk.text > min(_MOST_TEXT, walk.max_bytes):
        raise walk.bad("its texts are used so often that they would fill the memory")
    if kind == b"##SI" and address not in walk.seen:
        walk.seen.add(address)
        _, _, links = _block_4(walk, address)
        waiting.extend(link for link in links[:3] if link)


def _conversions(walk: _Walk, address: int, waiting: list[int], depth: int) -> int:
    """How many scalings and texts a scaling stands for, with those that it refers to."""
    if depth > _DEEPEST:
        raise walk.bad("its scalings are nested without end")
    if address not in walk.conversions:
        _, _, links = _block_4(walk, address)
        walk.conversions[address] = _MOST_CONVERSIONS + 1  # while it is looked at: a circle is endless
        total = 1
        for number, link in enumerate(links):
            if not link or number == 3:  # the inverse scaling is not used
                continue
            inner, _, _ = _block_4(walk, link)
            if inner == b"##CC":
                total += _conversions(walk, link, waiting, depth + 1)
            elif inner in (b"##TX", b"##MD"):
                total += 1
                waiting.append(link)
            else:
                raise walk.bad(f"the scaling at byte {address} leads to no scaling")
            if total > _MOST_CONVERSIONS:
                raise walk.bad("its scalings are nested without end")
        walk.conversions[address] = total
    return walk.conversions[address]


def _check_packed(walk: _Walk, address: int, length: int) -> None:
    """A compressed block unpacks to what it declares, and no more than may be held."""
    _, way, _, _, declared, packed = struct.unpack("<2sBBIQQ", walk.at(address + 24, 24))
    if way > 1:
        raise TableError(
            f"{walk.name}: is compressed by a method other than deflate; save it with deflate or uncompressed"
        )
    if 48 + packed > length:
        raise walk.bad(f"the block DZ at byte {address} ends after the file")
    afford(2 * declared, walk.max_bytes, walk.name, "one of its compressed blocks")
    if declared > packed * _MOST_INFLATED + 64:
        raise walk.bad(f"the block DZ at byte {address} declares more than it holds")
    if packed * _MOST_INFLATED <= walk.max_bytes // 2:
        return
    walk.file.seek(address + 48)
    stream, total, left = zlib.decompressobj(), 0, packed
    while (left or stream.unconsumed_tail) and not stream.eof:
        part = stream.unconsumed_tail or walk.file.read(min(left, 1 << 16))
        left -= 0 if stream.unconsumed_tail else len(part)
        total += len(stream.decompress(part, 1 << 20))
        if total > declared:
            raise walk.bad(f"the block DZ at byte {address} unpacks to more than it declares")


def _check_group_4(walk: _Walk, address: int) -> None:
    """The records of a data group are there."""
    _, length, links = _block_4(walk, address)
    id_size = walk.at(address + 24 + 8 * len(links), 1)[0] if length > 24 + 8 * len(links) else 0
    declared, group = 0, links[1] if len(links) > 1 else 0
    while group:
        _, length, inner = _block_4(walk, group)
        at = group + 24 + 8 * len(inner)
        _, cycles, flags, _, _, size, invalid = struct.unpack("<QQHHIII", walk.at(at, 32))
        if not flags & 1:  # else records of variable length
            declared += cycles * (size + invalid + id_size)
            _check_channels_4(walk, inner[1] if len(inner) > 1 else 0, size, invalid)
        group = inner[0] if inner else 0
    there = _held_4(walk, links[2] if len(links) > 2 else 0)
    if declared > there:
        raise walk.bad(f"a data group declares {declared} bytes of samples and has {there}")


def _check_channels_4(walk: _Walk, first: int, size: int, invalid: int) -> None:
    """Each channel lies in its record: the library takes their places on trust."""
    waiting = [first] if first else []
    while waiting:
        address = waiting.pop()
        kind, _, links = _block_4(walk, address)
        waiting.extend(link for link in links[: 2 if kind == b"##CN" else 1] if link)
        if kind != b"##CN":
            continue
        way, _, _, shift, start, bits, flags, mark = struct.unpack("<4B4I", walk.at(address + 24 + 8 * len(links), 20))
        inside = way in _VIRTUAL or start + (shift + bits + 7) // 8 <= size
        if not inside or (invalid and flags & 2 and mark >= 8 * invalid):
            raise walk.bad(f"the channel at byte {address} lies outside its record")


def _held_4(walk: _Walk, address: int) -> int:
    """Bytes of samples behind a link, unpacked."""
    total, waiting = 0, [address] if address else []
    while waiting:
        one = waiting.pop()
        kind, length, links = _block_4(walk, one)
        if kind == b"##DZ":
            total += struct.unpack("<Q", walk.at(one + 32, 8))[0]
        elif kind in _LISTS or kind == b"##HL":
            waiting.extend(link for link in links if link)
        else:
            total += length - 24 - 8 * len(links)
    return total


def _check_3(walk: _Walk) -> None:
    """Walk over a file of version 2 or 3."""
    order = "<" if struct.unpack("<H", walk.at(24, 2))[0] == 0 else ">"

    def block(address: int, kind: bytes, form: str) -> tuple[int, ...]:
        found, size, *values = struct.unpack(
            f"{order}2sH{form}", walk.at(address, 4 + struct.calcsize(f"{order}{form}"))
        )
        if found != kind:
            raise walk.bad(f"there is no block {kind.decode()} at byte {address}")
        if address + size > walk.end:
            raise walk.bad(f"the block {kind.decode()} at byte {address} ends after the file")
        walk.once(address, kind)
        return tuple(values)

    (data_group,) = block(64, b"HD", "I")
    while data_group:
        data_group, group, _, data, groups, id_size = block(data_group, b"DG", "IIIIHH")
        declared = 0
        for _ in range(groups):
            group, channel, _, _, _, size, cycles = block(group, b"CG", "IIIHHHI")
            declared += cycles * (size + id_size)
            while channel:
                address = channel
                channel, scaling = block(channel, b"CN", "II")
                _check_channel_3(walk, order, address, size)
                if scaling:
                    walk.at(scaling, 46)
        if declared > walk.end - data or (declared and not data):
            raise walk.bad(f"a data group declares {declared} bytes of samples and has {max(walk.end - data, 0)}")


def _check_channel_3(walk: _Walk, order: str, address: int, size: int) -> None:
    (length,) = struct.unpack(f"{order}H", walk.at(address + 2, 2))
    start, bits = struct.unpack(f"{order}HH", walk.at(address + 186, 4))
    (more,) = struct.unpack(f"{order}H", walk.at(address + 226, 2)) if length >= 228 else (0,)
    if 8 * more + start + bits > 8 * size:
        raise walk.bad(f"the channel at byte {address} lies outside its record")


def _check(file: BinaryIO, name: str, max_bytes: int) -> None:
    """Walk over the blocks, and leave the file at its beginning."""
    walk = _Walk(file, name, max_bytes, os.fstat(file.fileno()).st_size)
    head = file.read(64)
    if not _recognises(head):
        raise TableError(f"{name}: is not {_KIND}: it does not begin as one; check what wrote it")
    if len(head) < 64:
        raise walk.bad("ends within its first block")
    (version,) = struct.unpack("<H", head[28:30])
    if version > 500 and struct.unpack(">H", head[28:30])[0] < _VERSION_4:
        version = struct.unpack(">H", head[28:30])[0]
    if head[:8] == _OPEN or (version >= 410 and any(head[60:64])):
        raise TableError(
            f"{name}: was not closed by what wrote it (unfinished MDF); open and save it there, or export it"
        )
    if version >= _VERSION_4:
        _check_4(walk)
    else:
        _check_3(walk)
    file.seek(0)


# --- what the library makes of it ---


@dataclass(frozen=True)
class _Channel:
    """A channel, and where it is."""

    group: str
    name: str
    at: tuple[int, int]
    count: int
    barred: str
    """Why it cannot be read; empty if it can."""


class _File:
    """A file that has passed the walk, as the library has it."""

    def __init__(self, guard: Guard, file: BinaryIO, name: str) -> None:
        # An open file is read by itself; the bus data bases that a path or an attachment names are left alone.
        self.mdf = guard.load(_LIBRARY).MDF(file, process_bus_logging=False)
        self.name = name
        self.is_4 = str(self.mdf.version) >= "4"
        titles = [self._title(group) for group in self.mdf.groups]
        often = Counter(titles)
        self.groups = [title if title and often[title] == 1 else str(number) for number, title in enumerate(titles)]
        for group in self.mdf.groups if self.is_4 else ():
            group.data_blocks = [part for block in group.data_blocks for part in _parted(block)]

    def _title(self, group: Any) -> str:
        stated = getattr(group.channel_group, "acq_name", "") if self.is_4 else group.channel_group.comment
        return tidy(stated or "", 60)

    def channels(self) -> list[_Channel]:
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
        if _formula(channel.conversion, _FORMULA_4 if self.is_4 else _FORMULA_3):
            return "is scaled by a formula, which is not computed; save it with its physical values"
        return ""

    def unit(self, at: tuple[int, int]) -> str | None:
        channel = self.mdf.groups[at[0]].channels[at[1]]
        stated = channel.unit or (getattr(channel.conversion, "unit", "") if channel.conversion else "")
        return of_name(channel.name, stated)

    def master(self, group: int) -> tuple[int, Any] | None:
        """Group and channel of the time of a group."""
        if self.is_4:
            remote = getattr(self.mdf.groups[group].channel_group, "cg_master_index", None)
            group = remote if remote is not None and group not in self.mdf.masters_db else group
        place = self.mdf.masters_db.get(group)
        if place is None:
            return None
        channel = self.mdf.groups[group].channels[place]
        return (group, channel) if not self.is_4 or channel.sync_type == _TIME else None

    def even(self, group: int) -> tuple[float, float] | None:
        """Rate and start of a virtual master."""
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
        """Seconds of each sample of a group, or of some."""
        found = self.master(group)
        if found is None:
            return None
        master = found[1]
        called = f"the time of the group {shown(self.groups[group])}"
        if _formula(master.conversion, _FORMULA_4 if self.is_4 else _FORMULA_3):
            raise TableError(f"{self.name}: {called} is scaled by a formula, which is not computed; export it again")
        scale = seconds(self.unit((found[0], self.mdf.masters_db[found[0]])))
        values = self.mdf.get_master(group, record_offset=first, record_count=count)
        return floats(values, called, self.name) * (1.0 if scale is None else scale)

    def samples(self, one: _Channel, first: int, last: int) -> NDArray[np.float64]:
        """Some samples of a channel; those marked invalid are not-a-number."""
        if first == last:
            return np.empty(0)
        # Without `ignore_...` the library leaves invalid samples out; with it, it says which they are.
        found, invalid = self.mdf.get(
            group=one.at[0],
            index=one.at[1],
            samples_only=True,
            ignore_invalidation_bits=True,
            record_offset=first,
            record_count=last - first,
        )
        values = floats(found, one.name, self.name)
        if invalid is not None and np.any(invalid):
            values = values.copy()
            values[np.asarray(invalid, dtype=bool)] = np.nan
        if len(values) != last - first:
            raise TableError(
                f"{self.name}: is cut short: channel {shown(one.name)} has {first + len(values)} of {one.count} "
                "samples; copy or export it again"
            )
        return values

    def track(self, one: _Channel, times: dict[int, Part]) -> Track:
        """A channel, of which any part can be read; `times` has those of the groups, as they are found."""
        if one.barred:
            raise TableError(f"{self.name}: channel {shown(one.name)} {one.barred}")
        unit, group = self.unit(one.at), one.at[0]

        def samples(first: int, last: int) -> NDArray[np.float64]:
            return self.samples(one, first, last)

        if (even := self.even(group)) is not None:
            return Track(one.name, unit, one.count, samples, *even)
        if self.master(group) is None:
            return Track(one.name, unit, one.count, samples)
        if group not in times:
            times[group] = remembered(lambda first, last: self._times(group, first, last))
        return Track(one.name, unit, one.count, samples, time=times[group])

    def _times(self, group: int, first: int, last: int) -> NDArray[np.float64]:
        time = self.time(group, first=first, count=last - first) if last > first else np.empty(0)
        if time is None or len(time) != last - first:
            found = first + (0 if time is None else len(time))
            raise TableError(f"{self.name}: is cut short: {found} of {last} times are there; copy or export it again")
        return time

    def info(self, one: _Channel, times: dict[int, tuple[float | None, float, float]]) -> SignalInfo:
        rate, start, duration = times.get(one.at[0], (None, None, None))
        channel = self.mdf.groups[one.at[0]].channels[one.at[1]]
        said = [one.barred, tidy(channel.comment) if isinstance(channel.comment, str) else ""]
        note = "; ".join(part for part in said if part and not part.startswith("<"))
        return SignalInfo(one.name, self.unit(one.at), one.group, one.count, rate, start, duration, note)

    def timing(self, group: int, max_bytes: int) -> tuple[float | None, float, float] | None:
        """Rate, start and duration of a group; the rate only where its samples are evenly spaced."""
        count = int(self.mdf.groups[group].channel_group.cycles_nr)
        if self.master(group) is None or not count:
            return None
        if (even := self.even(group)) is not None:
            return even[0], even[1], (count - 1) / even[0]
        afford(16 * min(count, _LOOKED_AT), max_bytes, self.name, "its time")
        time = self.time(group, count=min(count, _LOOKED_AT))
        last = self.time(group, first=count - 1, count=1) if count > _LOOKED_AT else time
        if time is None or last is None or not len(time) or not len(last):
            return None
        span = float(last[-1] - time[0])
        step = span / (count - 1) if count > 1 else 0.0
        steps = np.diff(time)
        is_even = step > 0 and bool(np.all(np.abs(steps - step) <= _EVEN * step))
        return (1.0 / step if is_even else None), float(time[0]), span


def _parted(block: Any) -> Iterator[Any]:
    """A block of samples as several, where it is not compressed: the library holds each of them whole."""
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
    """Whether a scaling, or one that it refers to, is a formula in text."""
    if conversion is None or isinstance(conversion, bytes | str):
        return False
    if conversion.conversion_type == kind:
        return True
    inner = getattr(conversion, "referenced_blocks", None) or {}
    return any(_formula(one, kind) for one in inner.values())


def _survey(path: Path, label: str, max_bytes: int) -> FileInfo:
    name = name_of(path, label)
    most = max(max_bytes, MAX_FILE_BYTES)
    with open_regular(path, max_bytes=most, label=label) as file, Guard(name, _KIND, _LIBRARY) as guard:
        _check(file, name, max_bytes)
        content = _File(guard, file, name)
        try:
            times = {}
            for group in range(len(content.groups)):
                if (timing := content.timing(group, max_bytes)) is not None:
                    times[group] = timing
            signals = tuple(content.info(one, times) for one in content.channels())
            began = content.mdf.start_time
            said = [f"recorded {began.isoformat()}"] if began.year > 1980 else []
            fields = ("author", "department", "project", "subject")
            stated = [(key, getattr(content.mdf.header, key, "")) for key in fields]
            said += [f"{key}: {tidy(value)}" for key, value in stated if isinstance(value, str) and value.strip()]
            return FileInfo(f"ASAM MDF {content.mdf.version}", signals, tuple(said))
        finally:
            content.mdf.close()


@contextmanager
def _tracks(request: Request, guard: Guard, *, whole: bool) -> Iterator[list[Track]]:
    """The channels of a request, of which any part can be read while the file is open."""
    name = name_of(request.path, request.label)
    with open_regular(request.path, max_bytes=request.max_file_bytes, label=request.label) as file:
        _check(file, name, request.max_bytes)
        content = _File(guard, file, name)
        try:
            channels = content.channels()
            group = request.group
            if group.isdecimal() and group not in content.groups and int(group) < len(content.groups):
                group = content.groups[int(group)]
            asked = replace(request, group=group)
            chosen = [channels[at] for at in find([(one.group, one.name) for one in channels], asked)]
            if whole:
                afford(24 * sum(one.count for one in chosen), request.max_bytes, name)
            times: dict[int, Part] = {}
            yield [content.track(one, times) for one in chosen]
        finally:
            content.mdf.close()


_read, _blocks = by_tracks(_KIND, _LIBRARY, _tracks)
FORMAT = Format("ASAM MDF", (".mf4", ".mdf", ".dat"), _recognises, _survey, _read, "formats", _blocks)
