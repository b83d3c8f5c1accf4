"""Kinds of files that are no recordings which Fourpole reads: their names, and how to come to one that it does read."""

from __future__ import annotations

import re

_ZIP = b"PK\x03\x04"
#: First bytes that only this kind has.
_STARTS = (
    (b"\x1f\x8b", "is packed by gzip; unpack it"),
    (_ZIP, "is a zip archive; unpack it, and name a file in it"),
    (b"PK\x05\x06", "is a zip archive without files; pack it again"),
    (b"7z\xbc\xaf\x27\x1c", "is a 7z archive; unpack it, and name a file in it"),
    (b"Rar!\x1a\x07", "is a rar archive; unpack it, and name a file in it"),
    (b"BZh", "is packed by bzip2; unpack it"),
    (b"\xfd7zXZ\0", "is packed by xz; unpack it"),
    (b"\x28\xb5\x2f\xfd", "is packed by zstd; unpack it"),
    (b"%PDF-", "is a PDF; export the table from the program that made it, as CSV"),
    (b"{\\rtf", "is a document (RTF); copy its table into a workbook or a CSV file"),
    (b"MULTI_STREAM_FILE_VER", "is a recording of Dewesoft; export it from Dewesoft as MATLAB, UNV or text"),
    (b"DIAEXTENDED", "is a header of DIAdem; save the recording from DIAdem as TDMS or CSV"),
    (b"\x89PNG", "is an image (PNG); export the numbers as CSV"),
    (b"\xff\xd8\xff", "is an image (JPEG); export the numbers as CSV"),
    (b"GIF8", "is an image (GIF); export the numbers as CSV"),
    (b"II*\0", "is an image (TIFF); export the numbers as CSV"),
    (b"MM\0*", "is an image (TIFF); export the numbers as CSV"),
    (b"fLaC", "is sound (FLAC); save it as WAV"),
    (b"OggS", "is sound (Ogg); save it as WAV"),
    (b"ID3", "is sound (MP3), which has lost what a measurement needs; record it as WAV"),
    (b"SQLite format 3\0", "is a data base (SQLite); export its table as CSV or Parquet"),
    (b"CDF\x01", "is netCDF 3; save it as netCDF 4, which is HDF5"),
    (b"CDF\x02", "is netCDF 3; save it as netCDF 4, which is HDF5"),
)
_PICKLE = re.compile(rb"\x80[\x02-\x05][\x95}\](cK]")
_TDM = re.compile(rb"\s*(?:<\?xml[^>]*>\s*)?<usi:tdm", re.IGNORECASE)
_PAGE = re.compile(rb"\s*(?:<!--.{0,1000}?-->\s*)?<(?:!doctype\s+html|html)", re.IGNORECASE | re.DOTALL)
_XML = re.compile(rb"\s*<\?xml\s")
#: Endings of files whose first bytes are not known.
_ENDINGS = {
    ".dxd": "is a recording of Dewesoft; export it from Dewesoft as MATLAB, UNV or text",
    ".d7d": "is a recording of Dewesoft; export it from Dewesoft as MATLAB, UNV or text",
    ".d7z": "is a recording of Dewesoft; export it from Dewesoft as MATLAB, UNV or text",
    ".tdx": "holds the samples of a recording of DIAdem (.tdm); save it from DIAdem as TDMS or CSV",
    ".dac": "is a recording of nCode; export it from nCode as RPC III or CSV",
    ".s3t": "is a recording of nCode; export it from nCode as RPC III or CSV",
    ".mat": "is no file of MATLAB 5 or later; save it from MATLAB with save -v7",
    ".doc": "is a document of Word; copy its table into a workbook or a CSV file",
}


def named_by_start(head: bytes) -> str | None:
    """What a file is and what to do, by its first bytes; None if they are of no kind that is known here."""
    head = head.removeprefix(b"\xef\xbb\xbf")
    if head.startswith(_ZIP) and _first_member(head).lower().endswith((b".tdm", b".tdx")):
        return "is a packed recording of DIAdem (.tdm); save the recording from DIAdem as TDMS or CSV"
    for start, says in _STARTS:
        if head.startswith(start):
            return says
    if _PICKLE.match(head):
        return "is a pickle of Python, which is never opened; save its arrays with numpy.savez"
    if _TDM.match(head):
        return "is a header of DIAdem (.tdm); save the recording from DIAdem as TDMS or CSV"
    if _PAGE.match(head):
        return "is a web page, perhaps one for logging in; save the file that it leads to"
    return "is XML; export its table as CSV" if _XML.match(head) else None


def _first_member(head: bytes) -> bytes:
    """Name of the first file in a zip archive."""
    return head[30 : 30 + int.from_bytes(head[26:28], "little")]


def named_by_ending(ending: str) -> str | None:
    """What a file of an unknown content is and what to do, by the ending of its name; None if it is not known here."""
    return _ENDINGS.get(ending.lower())
