"""The cells of a workbook, counted before a library holds the rectangle around them in memory."""

from __future__ import annotations

import re
import zipfile
from collections.abc import Iterator

from fourpole.errors import TableError

#: Largest size of a workbook after unpacking, and of its texts [byte], and bytes that are unpacked at a time.
_MOST_UNPACKED, _MOST_TEXT, _PART = 1_000_000_000, 100_000_000, 1 << 20
#: Cells of a rectangle that are allowed for each filled cell, and beside them.
_SPARSE, _BESIDE = 50, 200_000
_CELL = re.compile(rb"<(?:[a-z]+:)?c (?:[^<>]*? )?r=\"([A-Z]{1,3})([0-9]{1,7})\"")
_PLACE = re.compile(rb"<table:(table|table-row|(?:covered-)?table-cell)(?![a-z-])([^<>]*)>")
_FILLED = re.compile(rb"value-type=")
_COLUMNS, _ROWS = (re.compile(rb"number-%s-repeated=\"([0-9]{1,9})\"" % kind) for kind in (b"columns", b"rows"))


def check_cells(archive: zipfile.ZipFile, name: str, most: int) -> None:
    """TableError if a sheet has more cells than `most`, or cells so far apart that the rectangle has."""
    size = sum(one.file_size for one in archive.infolist())
    if size > _MOST_UNPACKED:
        raise TableError(f"{name}: unpacks to {size / 1e6:.4g} MB; save its table as CSV, Parquet or HDF5")
    texts = sum(one.file_size for one in archive.infolist() if one.filename.startswith("xl/sharedStrings"))
    if texts > _MOST_TEXT:
        raise TableError(f"{name}: holds {texts / 1e6:.4g} MB of words; save its table as CSV, Parquet or HDF5")
    for one in archive.namelist():
        if one.startswith("xl/worksheets/") and one.endswith(".xml"):
            _check_excel(archive, one, name, most)
        elif one == "content.xml":
            _check_ods(archive, name, most)


def _parts(archive: zipfile.ZipFile, member: str, end: bytes) -> Iterator[bytes]:
    """The content of a member in parts that end with a given mark."""
    rest = b""
    with archive.open(member) as file:
        while part := file.read(_PART):
            cut = part.rfind(end) + len(end)
            if cut < len(end):
                rest += part
                if len(rest) > 64 * _PART:
                    raise ValueError(f"{member} has a part that does not end")
                continue
            yield rest + part[:cut]
            rest = part[cut:]
    yield rest


def _check_excel(archive: zipfile.ZipFile, member: str, name: str, most: int) -> None:
    count = right = bottom = 0
    for part in _parts(archive, member, b">"):
        found = _CELL.findall(part)
        count += len(found)
        right = max(right, max((_column(one) for one in {column for column, _ in found}), default=0))
        bottom = max(bottom, max((int(row) for _, row in found), default=0))
    _check_rectangle(count, right * bottom, name, most)


def _column(letters: bytes) -> int:
    number = 0
    for one in letters:
        number = 26 * number + one - 64
    return number


def _check_ods(archive: zipfile.ZipFile, name: str, most: int) -> None:
    count = row = column = right = bottom = 0
    repeated = 1
    for part in _parts(archive, "content.xml", b">"):
        for one in _PLACE.finditer(part):
            kind, stated = one[1], one[2]
            if kind == b"table":
                _check_rectangle(count, right * bottom, name, most)
                count = row = right = bottom = 0
                repeated = 0
            elif kind == b"table-row":
                row, column = row + repeated, 0
                repeated = _times(_ROWS, stated)
            else:
                column += _times(_COLUMNS, stated)
                if _FILLED.search(stated):
                    count, right, bottom = count + 1, max(right, column), max(bottom, row + repeated)
    _check_rectangle(count, right * bottom, name, most)


def _times(pattern: re.Pattern[bytes], stated: bytes) -> int:
    found = pattern.search(stated)
    return int(found[1]) if found else 1


def _check_rectangle(count: int, room: int, name: str, most: int) -> None:
    if max(count, room) > most and room <= _SPARSE * count:
        raise TableError(f"{name}: has a sheet of {room} cells; save its table as CSV, Parquet or HDF5")
    if room > _SPARSE * count + _BESIDE:
        what = f"a sheet with {count} filled cells so far apart that the rectangle around them has {room}"
        raise TableError(f"{name}: has {what}; delete the cells that do not belong to the table")
