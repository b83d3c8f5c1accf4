"""Analysed campaigns that many tests share: each is made once for the sources as they are, and kept in build/kept.

The name of a kept folder has the hash of all that makes it: the package, the versions of Python and of the libraries,
this file, and the arguments. It is made under a lock, so that of two processes that want it one makes it, and counts as
whole from the moment when an empty file beside it has its name: what was cut short is made anew. Folders of former
sources go when they are a day old.

A test that changes nothing takes the folder itself; all others take a copy.
"""

from __future__ import annotations

import hashlib
import inspect
import os
import shutil
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from importlib.metadata import distributions
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
KEPT = ROOT / "build" / "kept"
#: Age at which a kept folder goes [s].
_DAY = 86_400.0


@cache
def sources() -> str:
    """A hash of what makes the campaigns: the package, this file, Python, and the libraries."""
    found = hashlib.sha256(f"{sys.version} {sys.platform}".encode())
    for name in sorted(f"{one.name} {one.version}" for one in distributions()):
        found.update(name.encode())
    for path in [Path(__file__), *sorted((ROOT / "src" / "fourpole").rglob("*"))]:
        if path.is_file() and path.suffix != ".pyc":
            found.update(path.relative_to(ROOT).as_posix().encode())
            found.update(path.read_bytes())
    return found.hexdigest()


def kept(name: str, make: Callable[[Path], object], *arguments: object) -> Path:
    """The folder of this name that `make` fills, given its path, where it is not there yet.

    Parameters
    ----------
    name : str
        Begins the name of the folder.
    make : function
        Makes the folder at a path, at which nothing stands; its source is part of the hash.
    arguments
        What else decides the content: their reprs are part of the hash.
    """
    what = f"{sources()} {name} {arguments!r} {inspect.getsource(make)}"
    mark = hashlib.sha256(what.encode()).hexdigest()[:16]
    place, whole = KEPT / f"{name}-{mark}", KEPT / f"{name}-{mark}.whole"
    if not whole.exists():
        KEPT.mkdir(parents=True, exist_ok=True)
        with _lock(KEPT / f"{name}-{mark}.lock"):
            if not whole.exists():
                _clear()
                shutil.rmtree(place, ignore_errors=True)
                make(place)
                whole.touch()
    return place


def user_folders(folder: Path) -> dict[str, str]:
    """Variables that name folders of a user in a folder; all have one key, by which each trusts what another made.

    The list of fonts of matplotlib is shared, too.
    """
    KEPT.mkdir(parents=True, exist_ok=True)
    with _lock(KEPT / "key.lock"):
        if not (KEPT / "key").exists():
            (KEPT / "key").write_bytes(os.urandom(32))
    config = folder / "config" / "fourpole"
    config.mkdir(mode=0o700, parents=True)
    shutil.copy(KEPT / "key", config / "key")
    (config / "key").chmod(0o600)
    fonts = {"MPLCONFIGDIR": str(KEPT / "fonts")}  # else each server and each command lists them anew
    return {f"XDG_{name}_HOME": str(folder / name.lower()) for name in ("CONFIG", "CACHE")} | fonts


def _clear() -> None:
    """Remove what stands there for more than a day."""
    for old in KEPT.iterdir():
        if old.name != "key" and time.time() - old.stat().st_mtime > _DAY:
            shutil.rmtree(old) if old.is_dir() else old.unlink(missing_ok=True)


@contextmanager
def _lock(path: Path) -> Iterator[None]:
    """Hold a file until the context or the process ends; without such locks each process makes its own."""
    try:
        import fcntl
    except ImportError:
        yield
        return
    with path.open("w") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        yield
