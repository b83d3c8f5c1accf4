"""Folders of the user who runs Fourpole, which nobody else can write into."""

from __future__ import annotations

import os
import stat
import sys
from pathlib import Path

from fourpole.errors import FileError
from fourpole.io.source import reason

_NAME = "fourpole"
#: Bits of the mode by which others than the owner could change a folder.
_OTHERS = stat.S_IWGRP | stat.S_IWOTH


def cache_folder() -> Path:
    """The folder for what can be made again: `fourpole` in XDG_CACHE_HOME, or where the system has such folders.

    It is made, with mode 0700, if it is not there.

    Raises
    ------
    FileError
        If it cannot be made, belongs to someone else, or others may write into it.
    """
    return _own(_place("XDG_CACHE_HOME", "LOCALAPPDATA", {"darwin": "Library/Caches"}.get(sys.platform, ".cache")))


def _place(variable: str, windows: str, below_home: str) -> Path:
    """The folder that a variable names, if its path is absolute; else one below the home folder."""
    stated = os.environ.get(windows if sys.platform == "win32" else variable, "")
    try:
        above = Path(stated) if os.path.isabs(stated) else Path.home() / below_home  # noqa: PTH117 - "" is none
    except RuntimeError as error:
        raise FileError(f"the home folder is not known: {error}") from None
    return above / _NAME


def _own(folder: Path) -> Path:
    """A folder that the user alone can write into; FileError if it is none and cannot be made."""
    try:
        folder.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        folder.mkdir(mode=0o700, exist_ok=True)
        about = folder.stat()
    except (OSError, ValueError) as error:
        raise FileError(f"{folder}: cannot be made: {reason(error)}") from None
    if sys.platform != "win32" and (about.st_uid != os.geteuid() or about.st_mode & _OTHERS):
        raise FileError(
            f"{folder}: belongs to someone else, or others may write into it: chmod 700 makes it yours alone"
        )
    return folder
