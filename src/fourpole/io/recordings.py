"""The format of a recording, the description of its channels, and the channels that a user chooses.

By its first bytes a file is of a format of recordings, or of a kind that is none, with the way to one.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from functools import cache
from importlib import import_module
from pathlib import Path

from fourpole.errors import FileError, FourpoleError, TableError
from fourpole.io.door import open_regular
from fourpole.io.names import in_group, matching
from fourpole.io.signals import HEAD_BYTES, MAX_FILE_BYTES, FileInfo, Format
from fourpole.io.source import name_of

_BOM, _UTF16 = b"\xef\xbb\xbf", {b"\xff\xfe": "utf-16-le", b"\xfe\xff": "utf-16-be"}
_ZIP = b"PK\x03\x04"
#: Longest description of the columns of an Arrow file [byte].
LONGEST_SCHEMA = 10_000_000
_JSON = re.compile(rb'(?:\xef\xbb\xbf)?\s*(?:\{\s*(?:"|\})|\[\s*[\{\[\]])')
_TYDEX = re.compile(
    rb"(?:\A(?:\xef\xbb\xbf)?|[\r\n])\*\*[ \t\v\f]*(?:HEADER|MEASURCHANNELS|MODELPARAMETERS|CONSTANTS)\b", re.IGNORECASE
)
_UFF = re.compile(rb"[\s\x00]*?[ ]{0,4}-1[ ]*\r?\n[ ]{0,5}[0-9]{1,6}(?:b|\s)", re.IGNORECASE)
#: Control characters that no text has.
_CONTROLS = bytes([*range(9), *range(14, 26)])


def _is_arrow(head: bytes) -> bool:
    length, root = int.from_bytes(head[4:8], "little"), int.from_bytes(head[8:12], "little")
    is_stream = head.startswith(b"\xff\xff\xff\xff") and 0 < length <= LONGEST_SCHEMA and 4 <= root <= 64
    return is_stream or head.startswith((b"ARROW1", b"FEA1"))


def _is_labview(head: bytes) -> bool:
    start = "LabVIEW Measurement"
    marked = tuple(mark + start.encode(encoding) for mark, encoding in _UTF16.items())
    return head.startswith(marked) or head.removeprefix(_BOM).lstrip().startswith(start.encode())


def _is_tydex(head: bytes) -> bool:
    if head[:2] in _UTF16:
        head = head.decode("utf-16", errors="ignore").encode("ascii", errors="ignore")
    return b"**" in head and _TYDEX.search(head) is not None


def _is_text(head: bytes) -> bool:
    return head[:2] in _UTF16 or (bool(head.strip()) and len(head.translate(None, _CONTROLS)) == len(head))


def _is_numpy(head: bytes) -> bool:
    return head.startswith(b"\x93NUMPY") or (head.startswith(_ZIP) and _first_member(head).endswith(b".npy"))


#: Whether first bytes are those of a format, by its module in `fourpole.io.formats`, in the order in which the formats
#: are tried: text is last, for it accepts any text.
BEGINS: dict[str, Callable[[bytes], object]] = {
    "mdf": re.compile(rb"MDF     |UnFinMF ").match,
    "tdms": re.compile(rb"TDS[mh]").match,
    "hdf5": re.compile(rb"(?!MATLAB 7\.3)(?s:.{512}|.{1024}|.{2048})?\x89HDF\r\n\x1a\n").match,
    "matlab": re.compile(rb"MATLAB (?:5\.0|7\.3) MAT-file|MATLAB(?s:.{120})(?:IM|MI)").match,
    "npz": _is_numpy,
    "parquet": re.compile(rb"PAR1").match,
    "arrow": _is_arrow,
    "famos": re.compile(rb"\|CF,[12],").match,
    "rpc": re.compile(rb"FORMAT(?s:.{122})NUM_HEADER_BLOCKS").match,
    "uff": _UFF.match,
    "wav": re.compile(rb"(?:RIF[FX]|RF64)(?s:.{4})WAVE").match,
    "tydex": _is_tydex,
    "lvm": _is_labview,
    "workbook": re.compile(
        rb"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1"
        rb"|PK\x03\x04(?s:.{26})(?:\[Content_Types\]\.xml|_rels/|docProps/|xl/|mimetype|customXml/)"
    ).match,
    "json_columns": _JSON.match,
    "text": _is_text,
}
#: What a file is that is no recording, and what to do, by its first bytes.
_NO_RECORDINGS = tuple(
    (re.compile(start), says)
    for start, says in (
        (rb"\x1f\x8b", "is packed by gzip; unpack it"),
        (rb"PK\x03\x04", "is a zip archive; unpack it, and name a file in it"),
        (rb"PK\x05\x06", "is a zip archive without files; pack it again"),
        (rb"7z\xbc\xaf\x27\x1c", "is a 7z archive; unpack it, and name a file in it"),
        (rb"Rar!\x1a\x07", "is a rar archive; unpack it, and name a file in it"),
        (rb"BZh", "is packed by bzip2; unpack it"),
        (rb"\xfd7zXZ\0", "is packed by xz; unpack it"),
        (rb"\x28\xb5\x2f\xfd", "is packed by zstd; unpack it"),
        (rb"%PDF-", "is a PDF; export the table from the program that made it, as CSV"),
        (rb"\{\\rtf", "is a document (RTF); copy its table into a workbook or a CSV file"),
        (rb"MULTI_STREAM_FILE_VER", "is a recording of Dewesoft; export it from Dewesoft as MATLAB, UNV or text"),
        (rb"DIAEXTENDED", "is a header of DIAdem; save the recording from DIAdem as TDMS or CSV"),
        (rb"\x89PNG", "is an image (PNG); export the numbers as CSV"),
        (rb"\xff\xd8\xff", "is an image (JPEG); export the numbers as CSV"),
        (rb"GIF8", "is an image (GIF); export the numbers as CSV"),
        (rb"II\*\0|MM\0\*", "is an image (TIFF); export the numbers as CSV"),
        (rb"fLaC", "is sound (FLAC); save it as WAV"),
        (rb"OggS", "is sound (Ogg); save it as WAV"),
        (rb"ID3", "is sound (MP3), which has lost what a measurement needs; record it as WAV"),
        (rb"SQLite format 3\0", "is a data base (SQLite); export its table as CSV or Parquet"),
        (rb"CDF[\x01\x02]", "is netCDF 3; save it as netCDF 4, which is HDF5"),
        (
            rb"\x80[\x02-\x05][\x95}\](cK]",
            "is a pickle of Python, which is never opened; save its arrays with numpy.savez",
        ),
        (
            rb"\s*(?:<\?xml[^>]*>\s*)?<(?i:usi:tdm)",
            "is a header of DIAdem (.tdm); save the recording from DIAdem as TDMS or CSV",
        ),
        (
            rb"\s*(?:<!--(?s:.){0,1000}?-->\s*)?<(?i:!doctype\s+html|html)",
            "is a web page, perhaps one for logging in; save the file that it leads to",
        ),
        (rb"\s*<\?xml\s", "is XML; export its table as CSV"),
    )
)
#: What a file of an unknown content is and what to do, by the ending of its name.
KINDS_BY_ENDING = {
    **dict.fromkeys(
        (".dxd", ".d7d", ".d7z"), "is a recording of Dewesoft; export it from Dewesoft as MATLAB, UNV or text"
    ),
    ".tdx": "holds the samples of a recording of DIAdem (.tdm); save it from DIAdem as TDMS or CSV",
    **dict.fromkeys((".dac", ".s3t"), "is a recording of nCode; export it from nCode as RPC III or CSV"),
    ".mat": "is no file of MATLAB 5 or later; save it from MATLAB with save -v7",
    ".doc": "is a document of Word; copy its table into a workbook or a CSV file",
}


def named_by_start(head: bytes) -> str | None:
    """What a file is and what to do, by its first bytes; None if they are of no kind that is known here."""
    head = head.removeprefix(_BOM)
    if head.startswith(_ZIP) and _first_member(head).lower().endswith((b".tdm", b".tdx")):
        return "is a packed recording of DIAdem (.tdm); save the recording from DIAdem as TDMS or CSV"
    return next((says for start, says in _NO_RECORDINGS if start.match(head)), None)


def _first_member(head: bytes) -> bytes:
    """Name of the first file in a zip archive."""
    return head[30 : 30 + int.from_bytes(head[26:28], "little")]


#: The formats whose library opens the file once more, by its path; see `fourpole.io.door.path_for_library`. All others
#: get the open file, or its bytes.
BY_PATH = ("parquet", "arrow", "workbook", "npz", "wav")
#: Endings of the formats that may state when a recording began.
_DATED = (".mf4", ".mf3", ".mdf", ".dat", ".raw", ".tdms")


def format_of(path: str | Path, *, max_bytes: int, label: str | None = None) -> Format:
    """The format of a file by its content; TableError, which names what it is, if no format recognises it."""
    with open_regular(path, max_bytes=max_bytes, label=label) as file:
        head = file.read(HEAD_BYTES)
    module = next((module for module, begins in BEGINS.items() if begins(head)), None)
    says = named_by_start(head) if module in ("text", None) else None
    if module is None or says is not None:
        by_ending = KINDS_BY_ENDING.get(Path(path).suffix.lower())
        says = says or by_ending or "is binary, not text; export it as CSV, in UTF-8 (no reader knows it)"
        raise TableError(f"{name_of(path, label)}: {says}")
    found: Format = import_module(f"fourpole.io.formats.{module}").FORMAT
    return found


@cache
def endings() -> frozenset[str]:
    """Usual endings of the names of recordings, in lower case, with the dot."""
    formats: list[Format] = [import_module(f"fourpole.io.formats.{module}").FORMAT for module in BEGINS]
    return frozenset(ending for one in formats for ending in one.endings)


def survey(path: str | Path, *, max_bytes: int = 4_000_000_000, label: str | None = None) -> FileInfo:
    """The description of a file: its format, its channels with units and rates, and notes.

    Raises
    ------
    FileError
        If the file is missing, no regular file, too large, or its library is not installed.
    TableError
        If the file is damaged, or not readable in the format that its first bytes declare.
    """
    name = name_of(path, label)
    return format_of(path, max_bytes=max_bytes, label=name).survey(Path(path), name, max_bytes)


def began_at(path: Path) -> float | None:
    """Time at which a recording began [s], from 1970 on; None where its file does not state it.

    FileError if the file cannot be opened or read.
    """
    if path.suffix.lower() not in _DATED:
        return None
    try:
        return survey(path, max_bytes=MAX_FILE_BYTES).began
    except FileError:  # a disk that fails now must not make other results than one that does not
        raise
    except FourpoleError:
        return None


def chosen_of(found: FileInfo, group: str, names: Sequence[str], label: str) -> list[int]:
    """Indices in `found.signals` of the named channels of a group; of all its channels if no name is given.

    An empty group means the whole file. A name may be written with its group (`group/name`), in another case, or
    without its unit. TableError if there is no such group or channel.
    """
    places = [(one.group, one.name) for one in found.signals]
    inside = in_group(places, group, label)
    chosen = [at for wanted in names for at in matching(places, inside, wanted, label)]
    return list(dict.fromkeys(chosen)) if names else inside
