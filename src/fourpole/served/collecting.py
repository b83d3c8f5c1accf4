"""The samples of recordings, collected in the background and kept in the user's own cache folder.

Nothing that a campaign folder holds is taken for such samples: who sends a campaign does not decide what its pictures
show.
"""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import tempfile
import threading
import time
from collections.abc import Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from concurrent.futures import TimeoutError as LateError
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

from fourpole.errors import CampaignError, FileError, FourpoleError
from fourpole.io.child import child, read_apart
from fourpole.io.identity import identity_of
from fourpole.io.userfolders import cache_folder
from fourpole.served.signals import HIDDEN, Kept, fresh_name, keep, kept_in, load
from fourpole.study.workers import processors

#: Recordings that are read at a time, and time that a page waits for one before it shows progress [s].
_AT_ONCE, _WAIT = 2, 1.0
#: Largest room of the samples of all campaigns; those that were used longest ago go first [byte].
_MOST_ROOM = 4_000_000_000
#: A hidden folder that was not changed for this time is of a server that was killed [s].
_ABANDONED = 86_400.0


@dataclass(frozen=True)
class Wanted:
    """The channels that are wanted of a recording."""

    path: Path
    group: str
    names: tuple[str, ...]

    @property
    def key(self) -> str:
        """Name of the folder in which they are kept, for this state of the file."""
        mark = json.dumps([str(self.path), self.group, self.names, *map(str, identity_of(self.path).parts)])
        return hashlib.sha256(mark.encode()).hexdigest()


@dataclass(eq=False)
class _Work:
    """A recording that is being read; how much of it is read, 0 to 1."""

    done: float = 0.0
    future: Future[None] = field(default_factory=Future)


class Collector:
    """Reads recordings for pictures, a few at a time, each once."""

    def __init__(self) -> None:
        self._threads = ThreadPoolExecutor(_AT_ONCE, thread_name_prefix="signals")
        self._works: dict[Path, _Work] = {}
        self._lock = threading.Lock()
        self._loaded: set[str] = set()
        self._temporary: Path | None = None
        self._load([])

    def expect(self, files: Iterable[str]) -> None:
        """Load what reads files of these names, so that the first of them is read at once."""
        endings = {Path(one).suffix.lower() for one in files} - self._loaded
        if endings:
            self._loaded |= endings
            self._load(sorted(endings))

    def _load(self, endings: list[str]) -> None:
        """Start the worker processes, each by its thread, and load what reads files of these endings."""
        for _ in range(_AT_ONCE):
            self._threads.submit(lambda: child(processors()).call(load, endings))  # somebody waits for the picture

    def get(self, wanted: Wanted) -> Kept | float:
        """The samples; or, where they take longer, the share that is read.

        Raises
        ------
        FileError, TableError
            If the recording cannot be read.
        """
        try:
            folder = self._folder() / wanted.key
        except OSError as error:
            raise FileError(f"{wanted.path.name}: {error.strerror or error}") from None
        with suppress(FileNotFoundError):
            os.utime(folder / "about.json")
            return kept_in(folder)
        with self._lock:
            work = self._works.get(folder)
            if work is None:
                work = self._works[folder] = _Work()
                work.future = self._threads.submit(self._collect, wanted, folder, work)
        try:
            work.future.result(timeout=_WAIT)
        except LateError:
            return work.done
        finally:
            if work.future.done():
                self._works.pop(folder, None)
        return kept_in(folder)

    def close(self) -> None:
        """Begin no further recording."""
        self._threads.shutdown(wait=False, cancel_futures=True)
        if self._temporary is not None:
            shutil.rmtree(self._temporary, ignore_errors=True)

    def _folder(self) -> Path:
        """Where samples are kept: the user's cache folder; where there is none, a folder of this server alone."""
        with self._lock:
            if self._temporary is None:
                with suppress(OSError):
                    folder = cache_folder() / "signals"
                    folder.mkdir(mode=0o700, exist_ok=True)
                    return folder
                self._temporary = Path(tempfile.mkdtemp(prefix="fourpole-signals-"))
            return self._temporary

    def _collect(self, wanted: Wanted, folder: Path, work: _Work) -> None:
        def progress(done: int, total: int) -> None:
            work.done = done / max(total, 1)

        new = folder.with_name(fresh_name())
        try:
            read_apart(keep, wanted.path, wanted.group, list(wanted.names), new, progress=progress)
            _make_room(folder.parent, _size(new))
            with suppress(OSError):  # another server of this user was faster
                new.rename(folder)
            kept_in(folder)
        except FourpoleError:
            raise
        except OSError as error:
            raise CampaignError(f"the recording cannot be shown: {error.strerror or error}") from None
        finally:
            shutil.rmtree(new, ignore_errors=True)


def _make_room(folder: Path, wanted: int) -> None:
    """Delete the samples that were used longest ago, until there is room for more, and what killed servers left."""
    total = wanted
    for _, size, one in sorted(_kept(folder), reverse=True):
        total += size
        if total > _MOST_ROOM:
            shutil.rmtree(one, ignore_errors=True)


def _kept(folder: Path) -> Iterator[tuple[float, int, Path]]:
    """Time of the last use, size and place of all samples; another server may delete them meanwhile."""
    for place in folder.iterdir():
        with suppress(OSError):
            if not place.name.startswith(HIDDEN):
                yield (place / "about.json").stat().st_mtime, _size(place), place
            elif time.time() - place.stat().st_mtime > _ABANDONED:
                shutil.rmtree(place, ignore_errors=True)


def _size(folder: Path) -> int:
    return sum(file.stat().st_size for file in folder.iterdir())
