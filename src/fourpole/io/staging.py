"""Replaces many files of a folder together: whatever happens, all of them are the former ones or all are the new ones.

New files are written into a hidden folder inside the folder, which is on the same disk. At the end each file is renamed
into its place, and the former file into the hidden folder. A journal says which files are concerned. If the process
ends before the journal is deleted, the next command that uses the folder puts the former files back.
"""

from __future__ import annotations

import json
import os
import secrets
import shutil
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

from fourpole.errors import FileError
from fourpole.io.write import remove_leftovers, why

_HIDDEN = ".fourpole-*.tmp"
_LOCK, _JOURNAL, _NEW, _OLD = "lock", "journal.json", "new", "old"


@contextmanager
def staged(folder: str | os.PathLike[str], obsolete: Iterable[str] = ()) -> Iterator[Path]:
    """A new folder; at the end of the context all its files replace those of the same name in `folder`.

    If anything fails, or the process ends, the files of `folder` are the former ones. Its other files are not touched.

    Parameters
    ----------
    folder : path
        A folder that exists.
    obsolete : iterable of str
        Files of `folder`, relative to it, that are deleted unless the new folder has them.

    Raises
    ------
    FileError
        If a file cannot be written or replaced.

    Examples
    --------
    >>> import tempfile, pathlib
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     with staged(folder, obsolete=["old.csv"]) as new:
    ...         _ = (new / "a.csv").write_text("K1 [N/m]")
    ...     [found.name for found in pathlib.Path(folder).iterdir()]
    ['a.csv']
    """
    folder = Path(folder)
    recover(folder)
    hidden = folder / _HIDDEN.replace("*", secrets.token_hex(6))
    try:
        with _prepared(folder, hidden):
            yield hidden / _NEW
            _exchange(folder, hidden, obsolete)
    finally:
        if not (hidden / _JOURNAL).exists():
            shutil.rmtree(hidden, ignore_errors=True)


def recover(folder: str | os.PathLike[str]) -> None:
    """Put the former files back if a process ended while it replaced files of a folder, and delete what it left.

    A folder that cannot be changed is left as it is, and so are files that a running process replaces.
    """
    for hidden in sorted(Path(folder).glob(_HIDDEN)):
        with suppress(OSError):
            lock = (hidden / _LOCK).open("ab")
            try:
                if _locked(lock):
                    _undo(Path(folder), hidden)
                    (hidden / _JOURNAL).unlink(missing_ok=True)
                else:
                    continue
            finally:
                lock.close()
            shutil.rmtree(hidden)
    remove_leftovers(folder)


def _prepared(folder: Path, hidden: Path) -> BinaryIO:
    """The hidden folder is made; its open lock says that it belongs to a running process."""
    try:
        hidden.mkdir()
        lock = (hidden / _LOCK).open("ab")
        _locked(lock)
        (hidden / _NEW).mkdir()
        (hidden / _OLD).mkdir()
    except (OSError, ValueError) as error:
        raise FileError(f"{folder}: cannot be written: {why(error)}") from None
    return lock


def _locked(file: BinaryIO) -> bool:
    """Lock a file until it is closed or the process ends; False if another process has locked it.

    Where the file system has no locks, True.
    """
    try:
        if sys.platform == "win32":
            import msvcrt

            msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)
        else:
            import fcntl

            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except (BlockingIOError, PermissionError):
        return False
    except OSError:
        pass
    return True


def _exchange(folder: Path, hidden: Path, obsolete: Iterable[str]) -> None:
    """Rename all new files into their places, and the former ones into the hidden folder."""
    new = sorted(path.relative_to(hidden / _NEW).as_posix() for path in (hidden / _NEW).rglob("*") if path.is_file())
    gone = [name for name in dict.fromkeys(obsolete) if name not in new and (folder / name).is_file()]
    name = _JOURNAL
    try:
        part = hidden / f"{_JOURNAL}.part"
        part.write_text(json.dumps({"new": new, "gone": gone}), encoding="utf-8")
        part.replace(hidden / _JOURNAL)
        for name in (*new, *gone):
            if (folder / name).is_dir():
                raise IsADirectoryError(None, "a folder is in its place")
            for place in (folder / name, hidden / _OLD / name):
                place.parent.mkdir(parents=True, exist_ok=True)
            with suppress(FileNotFoundError):
                (folder / name).replace(hidden / _OLD / name)
            if name in new:
                (hidden / _NEW / name).replace(folder / name)
        (hidden / _JOURNAL).unlink()
    except BaseException as error:
        kept = "all files are the former ones"
        try:
            _undo(folder, hidden)
            (hidden / _JOURNAL).unlink(missing_ok=True)
        except OSError:
            kept = "the next command puts the former files back"
        if isinstance(error, OSError):
            raise FileError(f"{folder / name}: cannot be written: {why(error)}; {kept}") from error
        raise


def _undo(folder: Path, hidden: Path) -> None:
    """Put the former files back. Each step can be repeated, in case that this is interrupted, too."""
    try:
        journal = json.loads((hidden / _JOURNAL).read_text(encoding="utf-8"))
    except FileNotFoundError:
        return
    for name in journal["new"]:
        place, staged_at = folder / name, hidden / _NEW / name
        if not staged_at.exists():
            with suppress(FileNotFoundError):
                place.replace(staged_at)
    for name in (*journal["new"], *journal["gone"]):
        with suppress(FileNotFoundError):
            (hidden / _OLD / name).replace(folder / name)
