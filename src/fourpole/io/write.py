"""Writes files in one step: a reader finds the old file or the new file, never a part of it."""

from __future__ import annotations

import errno
import io
import os
import re
import secrets
import shutil
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

from fourpole.errors import FileError
from fourpole.io.source import AnyPath, name_of, reason

if TYPE_CHECKING:
    import polars as pl

#: Number of bytes of the random part of a hidden folder's name, and the names of such folders.
_TOKEN = 6
_HIDDEN = re.compile(r"\..+\.[0-9a-f]{12}\.tmp")
_FULL = {getattr(errno, name) for name in ("ENOSPC", "EDQUOT", "EFBIG") if hasattr(errno, name)}
#: Errors of a disk, a network drive or permissions, and of too many open files: no mistake of the program.
_OF_SYSTEM = {errno.EIO, errno.EACCES, errno.EPERM, errno.EROFS, errno.ENODEV, errno.ENXIO, errno.EBUSY, errno.ESTALE}
_OF_SYSTEM |= {errno.ETIMEDOUT, errno.ENFILE, errno.EMFILE}
#: A hidden folder that was not changed for this time is of a process that was killed [s].
_ABANDONED = 3600.0


def write_text(path: AnyPath, text: str, *, label: str | None = None) -> None:
    r"""Write a text file in UTF-8, in one step.

    Parameters
    ----------
    path : path
        The file, which is replaced if it exists; its folder must exist.
    text : str
        The text, whose line ends are not changed.
    label : str, optional
        The file's name in messages; by default the last part of the path.

    Raises
    ------
    FileError
        If the file cannot be written; an old file is then unchanged.

    Examples
    --------
    >>> import tempfile, pathlib
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_text(pathlib.Path(folder, "note.txt"), "K* [N/m]\n")
    ...     pathlib.Path(folder, "note.txt").read_text()
    'K* [N/m]\n'
    """
    write_bytes(path, text.encode(), label=label)


def write_bytes(path: AnyPath, content: bytes, *, label: str | None = None) -> None:
    """Write a file in one step; see `write_text`.

    Examples
    --------
    >>> import tempfile, pathlib
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_bytes(pathlib.Path(folder, "a.bin"), b"1")
    ...     pathlib.Path(folder, "a.bin").read_bytes()
    b'1'
    """
    with replacing(path, label=label) as file:
        file.write(content)


def write_table(path: AnyPath, frame: pl.DataFrame, *, label: str | None = None) -> None:
    r"""Write a table in one step, as CSV or Parquet by the name's ending.

    Parameters
    ----------
    path : path
        The file, which ends in .csv or .parquet.
    frame : polars.DataFrame
        The table. In CSV, floats have the fewest digits that give the same float back; null and NaN are blank.
    label : str, optional
        The file's name in messages; by default the last part of the path.

    Raises
    ------
    FileError
        If the file cannot be written; an old file is then unchanged.

    Examples
    --------
    >>> import tempfile, pathlib, polars
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_table(pathlib.Path(folder, "a.csv"), polars.DataFrame({"F1 [N]": [0.1 + 0.2, None]}))
    ...     pathlib.Path(folder, "a.csv").read_text()
    'F1 [N]\n0.30000000000000004\n\n'
    """
    ending = Path(path).suffix.lower()
    if ending not in (".csv", ".parquet"):
        raise FileError(f"{name_of(path, label)}: a table is written as .csv or .parquet")
    with replacing(path, label=label) as file:
        content = io.BytesIO()  # written by Python, whose error of a full disk is an OSError with its number
        if ending == ".csv":
            frame.fill_nan(None).write_csv(content)
        else:
            frame.write_parquet(content)
        file.write(content.getbuffer())


@contextmanager
def replacing(path: AnyPath, *, label: str | None = None) -> Iterator[BinaryIO]:
    """A new file that replaces `path` at the end of the context, or is deleted if anything fails.

    Examples
    --------
    >>> import tempfile, pathlib
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     with replacing(pathlib.Path(folder, "a.svg")) as file:
    ...         _ = file.write(b"<svg/>")
    ...     [found.name for found in pathlib.Path(folder).iterdir()]
    ['a.svg']
    """
    with beside(path, label=label) as new, new.open("xb") as file:
        yield file


@contextmanager
def beside(path: AnyPath, *, label: str | None = None) -> Iterator[Path]:
    """A free path in a hidden folder; the file or folder written there replaces `path` at the end of the context.

    If anything fails, `path` is unchanged. A folder replaces a folder with its whole content.

    Examples
    --------
    >>> import tempfile, pathlib
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     with beside(pathlib.Path(folder, "a.nc")) as new:
    ...         _ = new.write_bytes(b"CDF")
    ...     [found.name for found in pathlib.Path(folder).iterdir()]
    ['a.nc']
    """
    target, name = Path(path), name_of(path, label)
    folder = hidden_folder(target, name)
    new, old = folder / target.name, folder / f"{target.name[:100]}.old"
    try:
        yield new
        if new.is_dir() and target.is_dir():
            target.replace(old)
        new.replace(target)
    except FileError:
        raise
    except OSError as error:
        raise FileError(f"{name}: cannot be written: {why(error)}") from error
    finally:
        with suppress(OSError):
            if old.exists() and not target.exists():
                old.replace(target)
        delete_folder(folder)


def hidden_folder(target: Path, label: str | None = None) -> Path:
    """A new hidden folder beside a file that will be written; FileError if it cannot be made."""
    try:
        # Path.mkdir, not tempfile: folders of tempfile are readable by one user only, but results follow the umask.
        folder = target.with_name(f".{target.name[:100]}.{secrets.token_hex(_TOKEN)}.tmp")
        folder.mkdir()
    except (OSError, ValueError) as error:
        hint = "" if target.parent.is_dir() else "; does its folder exist?"
        raise FileError(f"{name_of(target, label)}: cannot be written: {why(error)}{hint}") from None
    return folder


def delete_folder(folder: Path) -> None:
    """Delete a folder with its content, as far as it can be deleted."""
    with suppress(OSError):  # not all errors are ignored by rmtree
        shutil.rmtree(folder, ignore_errors=True)


def files_below(folder: Path) -> list[str]:
    """Names of all files below a folder, sorted; OSError if a folder cannot be listed, which `rglob` would leave out.

    Examples
    --------
    >>> import tempfile, pathlib
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     pathlib.Path(folder, "figures").mkdir()
    ...     _ = pathlib.Path(folder, "figures", "a.svg").write_text("<svg/>")
    ...     files_below(pathlib.Path(folder))
    ['figures/a.svg']
    """

    def fail(error: OSError) -> None:
        raise error

    return sorted(
        Path(place, name).relative_to(folder).as_posix()
        for place, _, names in os.walk(folder, onerror=fail)
        for name in names
    )


def is_full(error: Exception) -> bool:
    """Whether an error says that a disk is full, a quota is exhausted, or a file is larger than a limit allows."""
    return getattr(error, "errno", None) in _FULL


def is_of_system(error: Exception) -> bool:
    """Whether an error comes from a disk or from permissions, and not from a mistake of the program."""
    return getattr(error, "errno", None) in _OF_SYSTEM


def why(error: Exception) -> str:
    """The reason why something cannot be written, and what to do about a full disk."""
    return f"{reason(error)}{'; free some space and run it again' if is_full(error) else ''}"


def remove_leftovers(folder: AnyPath, *, abandoned: float = _ABANDONED) -> None:
    """Delete hidden folders of `beside` that killed processes left in a folder; a former folder inside is kept.

    Parameters
    ----------
    folder : path
        A folder; one that does not exist or cannot be changed is left as it is.
    abandoned : float [s]
        Time since the last change after which a hidden folder belongs to no running process.
    """
    try:
        found = [path for path in Path(folder).iterdir() if _HIDDEN.fullmatch(path.name) and path.is_dir()]
    except OSError:
        return
    for path in found:
        with suppress(OSError):
            if time.time() - path.stat().st_mtime >= abandoned and not any(path.glob("*.old")):
                shutil.rmtree(path)
