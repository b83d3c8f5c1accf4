"""Folders of the user who runs Fourpole, which nobody else can write into, the key of that user, and signatures by it.

By a signature, what this user's Fourpole kept in a folder is told from what anyone else put there. It is an
HMAC-SHA256 with the key of the user (RFC 2104). Unlike the seal of a model file, nobody else can make one. It covers
what the content is for, so that one signed content does not pass for another.
"""

from __future__ import annotations

import hmac
import json
import os
import stat
import sys
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any

from fourpole.errors import FileError, FourpoleError
from fourpole.io.door import open_regular
from fourpole.io.source import reason

_NAME, _KEY, CONFIG = "fourpole", "key", "config.toml"
#: Length of the key [byte], and longest wait for another process that makes it [s].
_LENGTH, _PATIENCE = 32, 5.0
#: Length of a signature [byte].
SIGNATURE_LENGTH = 32
#: Bits of the mode by which others than the owner could change a folder.
_OTHERS = stat.S_IWGRP | stat.S_IWOTH
#: Largest configuration [byte].
_MOST_BYTES = 100_000


def cache_folder() -> Path:
    """The folder for what can be made again: `fourpole` in XDG_CACHE_HOME, or where the system has such folders.

    It is made, with mode 0700, if it is not there.

    Raises
    ------
    FileError
        If it cannot be made, belongs to someone else, or others may write into it.
    """
    return _own(_place("XDG_CACHE_HOME", "LOCALAPPDATA", {"darwin": "Library/Caches"}.get(sys.platform, ".cache")))


def config_folder() -> Path:
    """The folder for what the user states and for the key: `fourpole` in XDG_CONFIG_HOME; see `cache_folder`."""
    below = {"darwin": "Library/Application Support"}.get(sys.platform, ".config")
    return _own(_place("XDG_CONFIG_HOME", "APPDATA", below))


def configuration() -> dict[str, Any]:
    """What the user states in config.toml of `config_folder`; empty where there is no such file.

    Raises
    ------
    FileError, TableError
        If the folder or the file is not the user's, or is not TOML.
    """
    path = config_folder() / CONFIG
    if not path.exists():
        return {}
    with open_regular(path, max_bytes=_MOST_BYTES) as file:
        if sys.platform != "win32" and os.fstat(file.fileno()).st_uid not in (os.geteuid(), 0):
            raise FileError(f"{path}: belongs to someone else: write it anew")
        text = file.read()
    from fourpole.io.documents import toml_of
    from fourpole.io.source import decode

    return toml_of(decode(text, CONFIG)[0], CONFIG)


@cache
def user_key() -> bytes:
    """The key of this user, 32 random bytes that are made once; one of this process alone where none can be kept.

    One that others can read, or made, is replaced.
    """
    from fourpole.io.lock import campaign_lock

    with suppress(FourpoleError, OSError):
        path = config_folder() / _KEY
        if key := _read_key(path):
            return key
        with campaign_lock(path.parent, patience=_PATIENCE):  # another process may have made it meanwhile
            return _read_key(path) or _write_key(path)
    return os.urandom(_LENGTH)


def _read_key(path: Path) -> bytes | None:
    """The key in a file; None unless it is a file of the user's, of 32 bytes, that nobody else can open."""
    with suppress(FourpoleError), open_regular(path, max_bytes=_LENGTH) as file:
        about = os.fstat(file.fileno())
        private = sys.platform == "win32" or (about.st_uid == os.geteuid() and not about.st_mode & 0o077)
        content = file.read()
        return content if private and len(content) == _LENGTH else None
    return None


def _write_key(path: Path) -> bytes:
    """A new key, which the file has in one step."""
    key, new = os.urandom(_LENGTH), path.with_name(f"new-{os.urandom(6).hex()}")
    try:
        with os.fdopen(os.open(new, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "wb") as file:
            file.write(key)
            file.flush()
            os.fsync(file.fileno())
        new.replace(path)
    finally:
        new.unlink(missing_ok=True)
    return key


def _place(variable: str, windows: str, below_home: str) -> Path:
    """The folder that a variable names, if its path is absolute; else one below the home folder."""
    stated = os.environ.get(windows if sys.platform == "win32" else variable, "")
    try:
        above = Path(stated) if os.path.isabs(stated) else Path.home() / below_home  # noqa: PTH117 - "" is none
    except RuntimeError as error:
        raise FileError(f"the home folder is not known: {error}") from None
    if not above.is_absolute():  # below the working folder, others may have put a key
        raise FileError(f"{above}: is no folder of the user: HOME names a whole path")
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


def signature(content: bytes, *purpose: str) -> bytes:
    """The signature of a content for a purpose: its kind, its name or its place."""
    return hmac.digest(user_key(), json.dumps(purpose).encode() + b"\0" + content, "sha256")


def is_signed(content: bytes, signed: bytes, *purpose: str) -> bool:
    """Whether `signed` is the signature that this user gives a content for a purpose.

    Examples
    --------
    >>> is_signed(b"D1", signature(b"D1", "index"), "index"), is_signed(b"D1", signature(b"D1", "index"), "entry")
    (True, False)
    """
    return hmac.compare_digest(signature(content, *purpose), signed)
