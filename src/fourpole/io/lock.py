"""One lock for each campaign, held from the check of what stands there until the new files are written.

`staged` replaces some files of a folder together, as the two of a statement. The new files are written into a hidden
folder inside the folder, which is on the same disk, and then renamed into their places one after the other. If one
cannot be renamed, those before it are put back. A process that is killed just then leaves files of both kinds, each of
them whole. Results are more than that: see `fourpole.io.published`.
"""

from __future__ import annotations

import os
import shutil
import sys
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from fourpole.errors import FileError
from fourpole.io.source import AnyPath
from fourpole.io.write import delete_folder, files_below, hidden_folder, remove_leftovers, why


@contextmanager
def staged(folder: AnyPath, obsolete: Iterable[str] = (), *, last: str = "") -> Iterator[Path]:
    """A new folder; at the end of the context all its files replace those of the same name in `folder`.

    If anything fails, the files of `folder` are the former ones. Its other files are not touched.

    Parameters
    ----------
    folder : path
        A folder that exists.
    obsolete : iterable of str
        Files of `folder`, relative to it, that are deleted unless the new folder has them.
    last : str
        The file that is replaced last: it says what the others hold.

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
    ...     [path.name for path in pathlib.Path(folder).iterdir()]
    ['a.csv']
    """
    folder = Path(folder)
    remove_leftovers(folder)
    hidden = hidden_folder(folder / "fourpole", str(folder))
    new, old = hidden / "new", hidden / "old"
    try:
        new.mkdir()
        yield new
        names = files_below(new)
        _exchange(folder, new, old, sorted(names, key=lambda name: name == last))
        for name in obsolete:
            with suppress(OSError):
                if name not in names:
                    (folder / name).unlink()
    finally:
        delete_folder(hidden)


def _exchange(folder: Path, new: Path, old: Path, names: Iterable[str]) -> None:
    """Rename the new files into their places; if one cannot be, the former ones are put back."""
    done: list[str] = []
    name = ""
    try:
        for name in names:
            place, kept = folder / name, old / name
            if place.is_dir():
                raise IsADirectoryError(None, "a folder is in its place")
            for needed in (place, kept):
                needed.parent.mkdir(parents=True, exist_ok=True)
            if place.exists():
                shutil.copy2(place, kept)
            done.append(name)
            (new / name).replace(place)
    except BaseException as error:
        for undone in done:
            with suppress(OSError):
                if (old / undone).exists():
                    (old / undone).replace(folder / undone)
                elif not (new / undone).exists():
                    (folder / undone).unlink()
        if isinstance(error, OSError):
            raise FileError(
                f"{folder / name}: cannot be written: {why(error)}; all files are the former ones"
            ) from error
        raise


#: Longest wait for the lock [s], and time between two looks [s].
_PATIENCE, _LOOK = 30.0, 0.02
_STATEMENT = "campaign.toml"
#: Name of the file that is locked where the system locks no folders.
LOCK = ".fourpole.lock"


@contextmanager
def campaign_lock(folder: AnyPath, *, patience: float = _PATIENCE) -> Iterator[None]:
    """Hold the lock of a campaign, which that of its results is, too; any other folder has a lock of its own.

    It is the lock of the folder itself where the system has such locks, so that no file is made. It ends with the
    context or with the process. A thread that holds it and asks for it again gets the error.

    Parameters
    ----------
    folder : path
        A folder that exists.
    patience : float [s]
        Longest wait for another process that holds the lock.

    Raises
    ------
    FileError
        If another process holds the lock for longer.
    """
    place = Path(folder).absolute()
    if not (place / _STATEMENT).is_file() and (place.parent / _STATEMENT).is_file():
        place = place.parent
    descriptor = opened_folder(place)
    try:
        end = time.monotonic() + patience
        while not is_locked(descriptor):
            if time.monotonic() > end:
                raise FileError(f"{place}: another process has been writing here for {patience:.0f} s: try again later")
            time.sleep(_LOOK)
        yield
    finally:
        os.close(descriptor)


def opened_folder(place: Path) -> int:
    """An open folder, to be locked; FileError if there is none."""
    try:
        if sys.platform == "win32":
            return os.open(place / LOCK, os.O_RDWR | os.O_CREAT)
        return os.open(place, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    except OSError as error:
        raise FileError(f"{place}: cannot be locked: {error.strerror or error}") from None


def is_locked(descriptor: int) -> bool:
    """Lock an open folder until it is closed; False if another process has it, True if the system has no locks."""
    try:
        if sys.platform == "win32":
            import msvcrt

            msvcrt.locking(descriptor, msvcrt.LK_NBLCK, 1)
        else:
            import fcntl

            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except (BlockingIOError, PermissionError):
        return False
    except OSError:
        pass
    return True
