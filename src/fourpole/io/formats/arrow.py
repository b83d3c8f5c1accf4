"""Arrow IPC files, also called Feather: each column of numbers is a channel, with units and times as `columnar` says.

References
----------
Apache Arrow, "Columnar Format", "Serialization and Interprocess Communication".
"""

from __future__ import annotations

import glob
import os
import struct
from typing import BinaryIO

from fourpole.errors import TableError
from fourpole.io.formats.columnar import arrow_schema, caught, columns, stated_units
from fourpole.io.formats.tracks import Content, OpenFile, track_format
from fourpole.io.recordings import LONGEST_SCHEMA

_KIND = "an Arrow file"
_FILE, _OLD = b"ARROW1", b"FEA1"


def _schema(file: BinaryIO, at: int) -> bytes:
    """The message that describes the columns."""
    file.seek(at)
    head = file.read(8)
    length = struct.unpack("<I", head[4:])[0] if len(head) == 8 else 0
    return head + file.read(length) if length <= LONGEST_SCHEMA else b""


def _columns(opened: OpenFile) -> Content:
    """The columns of an open file."""
    import polars as pl

    start = opened.file.read(6)
    if start[:4] == _OLD:
        raise TableError(f"{opened.name}: is Feather version 1, which is no longer in use; save it as version 2")
    is_file = start == _FILE
    if is_file:
        opened.file.seek(-len(_FILE), os.SEEK_END)
        if opened.file.read() != _FILE:
            raise TableError(f"{opened.name}: is cut short: it does not end as {_KIND} does; copy or export it again")
    units, notes = arrow_schema(_schema(opened.file, 8 if is_file else 0))
    if is_file:  # escaped: characters such as * and [ in the file's name mean themselves
        scan = pl.scan_ipc(glob.escape(str(opened.path)), hive_partitioning=False)
    else:
        scan = caught(pl.read_ipc_stream, opened.path).lazy()
    return columns(scan, opened, "Arrow" if is_file else "Arrow stream", notes, stated_units(notes) | units)


FORMAT = track_format("arrow", "Arrow", (".arrow", ".feather", ".ipc", ".arrows"), _KIND, _columns)
