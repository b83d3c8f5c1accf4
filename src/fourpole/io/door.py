"""The one door through which the bytes of a campaign or of results come in.

Every file is a regular one of bounded size, and what a folder names lies below that folder after its links are
resolved. A house test lists the few places that open files by themselves.
"""

from __future__ import annotations

import hashlib
import os
import re
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path, PureWindowsPath
from typing import BinaryIO

from fourpole.errors import FileError, FourpoleError, TableError
from fourpole.io.source import AnyPath, name_of, reason
from fourpole.units import shown

#: The file is opened without blocking: what was a regular file may have become a pipe.
_FLAGS = os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0) | getattr(os, "O_CLOEXEC", 0)
#: Names of devices on Windows, whatever follows after a point or a colon.
_DEVICES = re.compile(r"(?:con|prn|aux|nul|conin\$|conout\$|(?:com|lpt)[0-9¹²³])(?: *[.:].*)?", re.IGNORECASE)


def open_regular(path: AnyPath, *, max_bytes: int, label: str | None = None, within: AnyPath | None = None) -> BinaryIO:
    """Open a regular file for reading; a pipe or device is refused before it could block.

    Parameters
    ----------
    path : path
        The file.
    max_bytes : int [byte]
        Largest size.
    label : str, optional
        The file's name in messages; by default the last part of the path.
    within : path, optional
        A folder below which the file lies, after links are resolved.

    Raises
    ------
    FileError
        If the file is missing, no regular file, too large, or outside the folder.
    TableError
        If it is empty.
    """
    name = name_of(path, label)
    try:
        _check(Path(path).stat(), name, max_bytes)
        file = os.fdopen(os.open(path, _FLAGS) if within is None else _opened_below(path, within, name), "rb")
    except FourpoleError:
        raise
    except FileNotFoundError:
        raise FileError(f"{name}: there is no such file; check its name") from None
    except PermissionError:
        raise FileError(f"{name}: reading is not permitted; change the file's permissions") from None
    except (OSError, ValueError, RuntimeError) as error:
        raise FileError(f"{name}: cannot be opened: {reason(error)}") from None
    try:
        _check(os.fstat(file.fileno()), name, max_bytes)  # it may have been replaced since the first check
    except FourpoleError:
        file.close()
        raise
    return file


def read_bytes(path: AnyPath, *, max_bytes: int, label: str | None = None, within: AnyPath | None = None) -> bytes:
    """The bytes of a regular file; see `open_regular`."""
    with open_regular(path, max_bytes=max_bytes, label=label, within=within) as file:
        try:
            return file.read(os.fstat(file.fileno()).st_size)  # as much as was checked, if it still grows
        except OSError as error:
            raise FileError(f"{name_of(path, label)}: cannot be read: {reason(error)}") from None


def sha256_of(path: AnyPath, *, max_bytes: int, label: str | None = None, within: AnyPath | None = None) -> str:
    """SHA-256 of a regular file in hexadecimal digits; the file is read in blocks. See `open_regular`."""
    with open_regular(path, max_bytes=max_bytes, label=label, within=within) as file:
        try:
            return hashlib.file_digest(file, "sha256").hexdigest()  # type: ignore[arg-type]
        except OSError as error:
            raise FileError(f"{name_of(path, label)}: cannot be read: {reason(error)}") from None


@contextmanager
def path_for_library(path: AnyPath, file: BinaryIO, *, label: str | None = None) -> Iterator[Path]:
    """The path of an open file, for a library that opens it once more by its path, in the guarded worker process.

    FileError if another file stands at the path before or after the context.
    """
    _check_same(path, file, name_of(path, label))
    yield Path(path)
    _check_same(path, file, name_of(path, label))


def check_name(name: str) -> None:
    r"""Check a name that a statement, an archive or an upload gives, by its text alone.

    FileError if it has a NUL or half a character, names a device of Windows, or another machine as `\\host\share`.
    """
    if "\0" in name or any("\ud800" <= one <= "\udfff" for one in name):
        fault = "has a character that no name of a file may have: rename the file"
    elif name[:2] in ("\\\\", "//", "\\/", "/\\"):
        fault = "names another machine: copy the file into the campaign folder"
    elif any(_DEVICES.fullmatch(part.rstrip(" .")) for part in PureWindowsPath(name).parts):
        fault = "is the name of a device on Windows: rename the file"
    else:
        return
    raise FileError(f"file {shown(name, 200)} {fault}")


def _opened_below(path: AnyPath, folder: AnyPath, name: str) -> int:
    """An open file below a folder: step by step without following a link, where the system can do so."""
    root, place = Path(os.path.realpath(folder)), Path(os.path.realpath(path))
    if not place.is_relative_to(root):
        raise FileError(f"{name}: lies outside the folder {shown(str(folder), 200)}: copy it into the folder")
    if os.open not in os.supports_dir_fd:
        return os.open(place, _FLAGS)
    *folders, last = place.relative_to(root).parts
    here = os.open(root, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        for part in folders:
            inner = os.open(part, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW | os.O_CLOEXEC, dir_fd=here)
            os.close(here)
            here = inner
        return os.open(last, _FLAGS | os.O_NOFOLLOW, dir_fd=here)
    finally:
        with suppress(OSError):
            os.close(here)


def _check_same(path: AnyPath, file: BinaryIO, name: str) -> None:
    with suppress(OSError):
        if os.path.samestat(os.stat(path), os.fstat(file.fileno())):  # noqa: PTH116 - beside fstat
            return
    raise FileError(f"{name}: was replaced while it was read: run it again")


def _check(found: os.stat_result, name: str, max_bytes: int) -> None:
    if stat.S_ISDIR(found.st_mode):
        raise FileError(f"{name}: is a folder; name a file in it")
    if not stat.S_ISREG(found.st_mode):
        raise FileError(f"{name}: is a pipe or device; copy what it gives into a file first")
    if found.st_size > max_bytes:
        much = f"{_size(found.st_size)}, more than the {_size(max_bytes)} allowed"
        raise FileError(f"{name}: has {much}; make it smaller, or split it")
    if found.st_size == 0:
        raise TableError(f"{name}: is empty; save or copy it again")


def _size(count: int) -> str:
    value, unit = float(count), "bytes"
    for larger in ("kB", "MB", "GB", "TB"):
        if value < 1000:
            break
        value, unit = value / 1000, larger
    return f"{value:.4g} {unit}"
