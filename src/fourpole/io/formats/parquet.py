"""Parquet: each column of numbers is a channel, with units and times as `columnar` says.

References
----------
Apache Parquet, "File Format".
"""

from __future__ import annotations

import base64
import binascii
import os
from typing import BinaryIO

from fourpole.errors import TableError
from fourpole.io.formats.columnar import arrow_schema, caught, columns, stated_units
from fourpole.io.formats.tracks import Content, OpenFile, track_format

_KIND = "a Parquet file"
_MAGIC, _ENCRYPTED = b"PAR1", b"PARE"


def _field_units(encoded: str) -> dict[str, str]:
    """Units of the Arrow fields of which the table was made."""
    try:
        return arrow_schema(base64.b64decode(encoded, validate=True))[0]
    except (binascii.Error, ValueError):
        return {}


def _check_end(file: BinaryIO, name: str) -> None:
    """TableError if a file does not end as a Parquet file does."""
    file.seek(-len(_MAGIC), os.SEEK_END)
    end = file.read()
    if end == _ENCRYPTED:
        raise TableError(f"{name}: is encrypted; save it without encryption")
    if end != _MAGIC:
        raise TableError(f"{name}: is cut short: it does not end as {_KIND} does; copy or export it again")


def _columns(opened: OpenFile) -> Content:
    """The columns of an open file."""
    import polars as pl

    _check_end(opened.file, opened.name)
    # `glob=False`: characters such as * and [ in the file's name mean themselves.
    scan = pl.scan_parquet(opened.path, glob=False, hive_partitioning=False)
    notes: dict[str, str] = caught(pl.read_parquet_metadata, opened.path)
    return columns(scan, opened, "Parquet", notes, stated_units(notes) | _field_units(notes.get("ARROW:schema", "")))


FORMAT = track_format("parquet", "Parquet", (".parquet", ".pq"), _KIND, _columns)
