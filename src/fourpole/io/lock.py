"""One lock for each campaign, held from the check of what stands there until the new files are written."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from fourpole.errors import FileError
from fourpole.io.source import AnyPath

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
