"""Channels of MDF that lie in the file as plain numbers, taken from there: an eighth of the time of the library.

The library copies all records of a group for each of its channels. Here only the numbers of the channel are read, where
nothing has to be unpacked, scaled, sorted or marked invalid; all else is the library's.

References
----------
ASAM MDF 4.1, blocks CG, CN and DT.
"""

from __future__ import annotations

from mmap import mmap
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fourpole.io.formats.tracks import Part

#: Numpy's kinds of number, by the data type and the bits of a channel: unsigned, signed and real, little-endian first.
_KINDS = {
    (kind, bits): f"{order}{letter}{bits // 8}"
    for kind, order, letter, sizes in (
        (0, "<", "u", (8, 16, 32, 64)),
        (1, ">", "u", (8, 16, 32, 64)),
        (2, "<", "i", (8, 16, 32, 64)),
        (3, ">", "i", (8, 16, 32, 64)),
        (4, "<", "f", (32, 64)),
        (5, ">", "f", (32, 64)),
    )
    for bits in sizes
}
#: Types of channels with one number in each record, samples and times; flags of a channel with invalid samples.
_OF_RECORD, _INVALID = (0, 2), 3


def plain(content: mmap, group: Any, channel: Any) -> Part | None:
    """The function that reads a channel from a file of version 4; None where only the library can.

    Parameters
    ----------
    content : mmap
        The file.
    group, channel : asammdf blocks
        The data group and the channel, as the library describes them.
    """
    cells = group.channel_group
    kind = _KINDS.get((channel.data_type, channel.bit_count))
    special = channel.bit_offset or channel.conversion or channel.flags & _INVALID or cells.invalidation_bytes_nr
    if kind is None or special or channel.channel_type not in _OF_RECORD:
        return None
    record, blocks = int(cells.samples_byte_nr), group.data_blocks
    apart = cells.flags or group.uses_ld or group.data_location or group.data_group.record_id_len
    if apart or not group.sorted or not record:
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
