"""The blocks of an ASAM MDF file, walked before a library reads the file.

Each block must lie in the file, none may be reached twice, and compressed blocks must unpack to what they declare.
Files that were not closed by the program that wrote them are refused, and so is any compression other than deflate.
"""

from __future__ import annotations

import os
import struct
from dataclasses import dataclass, field
from typing import BinaryIO

from fourpole.errors import TableError
from fourpole.io.formats.guard import afford, inflates_to

KIND = "an ASAM MDF file"
#: Channel type of a master whose time is a formula of the number of the sample; types of channels without samples.
VIRTUAL_MASTER, _VIRTUAL = 3, (3, 6)
_CLOSED, _OPEN = b"MDF     ", b"UnFinMF "
_VERSION_4 = 400
_MOST_TEXT = 256_000_000
_MOST_CONVERSIONS = 1_000_000
_DEEPEST = 16
#: Largest ratio of unpacked to packed size: deflate cannot reach it.
_MOST_INFLATED = 1100

# The links of a block that are followed: to the next block of its kind, to its parts and to texts.
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


def recognises(head: bytes) -> bool:
    """Whether a file with these first bytes is an MDF file."""
    return head[:8] in (_CLOSED, _OPEN)


@dataclass
class _Walk:
    """The state of the walk: the blocks that have been reached, and the memory that they stand for."""

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
        """`count` bytes at an address; TableError if the file ends before."""
        if address < 0 or address + count > self.end:
            raise self.bad(f"ends at byte {self.end}, but a block is to be at {address}")
        self.file.seek(address)
        return self.file.read(count)

    def once(self, address: int, kind: bytes) -> None:
        if address in self.seen:
            raise self.bad(f"the block {kind.strip(b'#').decode('latin-1')} at byte {address} is reached twice")
        self.seen.add(address)


def _block_4(walk: _Walk, address: int) -> tuple[bytes, int, tuple[int, ...]]:
    """Kind, length [byte] and links of the block at an address."""
    kind, _, length, count = struct.unpack("<4sIQQ", walk.at(address, 24))
    if kind not in _KNOWN:
        raise walk.bad(f"there is no block at byte {address}")
    if length < 24 or count > (length - 24) // 8 or address + length > walk.end:
        raise walk.bad(f"the block {kind[2:].decode()} at byte {address} ends after the file")
    return kind, length, struct.unpack(f"<{count}Q", walk.at(address + 24, 8 * count))


def _check_4(walk: _Walk) -> None:
    """Walk over the blocks of a file of version 4."""
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
    """Whether a block has the samples of a channel; otherwise it is another group or an attachment."""
    kind, _, _ = _block_4(walk, address)
    return kind in _SAMPLES | _LISTS | {b"##DZ", b"##HL"}


def _check_shared(walk: _Walk, address: int, kind: bytes, length: int, waiting: list[int]) -> None:
    """Count a use of a block that many others may use: each use costs the library memory."""
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
    """Number of scalings and texts that a scaling stands for, with those that it refers to."""
    if depth > _DEEPEST:
        raise walk.bad("its scalings are nested without end")
    if address not in walk.conversions:
        _, _, links = _block_4(walk, address)
        walk.conversions[address] = (
            _MOST_CONVERSIONS + 1
        )  # while its links are followed: a circle of links exceeds the limit
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
    """TableError or FileError if a compressed block unpacks to more than it declares, or than the memory allowed."""
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
    if not inflates_to(walk.file, packed, declared):
        raise walk.bad(f"the block DZ at byte {address} unpacks to more than it declares")


def _check_group_4(walk: _Walk, address: int) -> None:
    """TableError if a data group declares more bytes of records than it has."""
    _, length, links = _block_4(walk, address)
    id_size = walk.at(address + 24 + 8 * len(links), 1)[0] if length > 24 + 8 * len(links) else 0
    declared, group = 0, links[1] if len(links) > 1 else 0
    while group:
        _, length, inner = _block_4(walk, group)
        at = group + 24 + 8 * len(inner)
        _, cycles, flags, _, _, size, invalid = struct.unpack("<QQHHIII", walk.at(at, 32))
        if not flags & 1:  # a set bit means records of variable length
            declared += cycles * (size + invalid + id_size)
            _check_channels_4(walk, inner[1] if len(inner) > 1 else 0, size, invalid)
        group = inner[0] if inner else 0
    there = _held_4(walk, links[2] if len(links) > 2 else 0)
    if declared > there:
        raise walk.bad(f"a data group declares {declared} bytes of samples and has {there}")


def _check_channels_4(walk: _Walk, first: int, size: int, invalid: int) -> None:
    """TableError if a channel lies outside its record: the library does not check this."""
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
    """Size of the samples that a link leads to, unpacked [byte]."""
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
    """Walk over the blocks of a file of version 2 or 3."""
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


def check_blocks(file: BinaryIO, name: str, max_bytes: int) -> None:
    """TableError if the blocks of a file are damaged; the file is at its beginning afterwards."""
    walk = _Walk(file, name, max_bytes, os.fstat(file.fileno()).st_size)
    head = file.read(64)
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
