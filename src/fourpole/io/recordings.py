"""The format of a recording, the description of its channels, and the channels that a user chooses."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from importlib import import_module
from pathlib import Path

from fourpole.errors import FileError, FourpoleError, TableError
from fourpole.io.door import open_regular
from fourpole.io.known import BEGINS, KINDS_BY_ENDING, named_by_start
from fourpole.io.names import in_group, matching
from fourpole.io.signals import HEAD_BYTES, MAX_FILE_BYTES, FileInfo, Format
from fourpole.io.source import name_of

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
