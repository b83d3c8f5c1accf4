"""The samples of recordings, collected in the background and kept in the cache of their campaign."""

from __future__ import annotations

import hashlib
import json
import shutil
import threading
from collections.abc import Iterable
from concurrent.futures import Future, ThreadPoolExecutor
from concurrent.futures import TimeoutError as LateError
from dataclasses import dataclass, field
from pathlib import Path

from fourpole.errors import CampaignError, FileError, FourpoleError
from fourpole.io.child import child, read_apart
from fourpole.io.identity import identity_of
from fourpole.served.signals import Kept, fresh_name, keep, kept_in, load
from fourpole.study.workers import processors

#: Recordings that are read at a time, and time that a page waits for one before it shows progress [s].
_AT_ONCE, _WAIT = 2, 1.0
#: Largest room of the samples of a campaign; those that were used longest ago go first [byte].
_MOST_ROOM = 4_000_000_000


@dataclass(frozen=True)
class Wanted:
    """The channels that are wanted of a recording, and the folder of the cache."""

    path: Path
    group: str
    names: tuple[str, ...]
    cache: Path

    @property
    def folder(self) -> Path:
        """Where they are kept, for this state of the file."""
        mark = json.dumps([str(self.path), self.group, self.names, *map(str, identity_of(self.path).parts)])
        return self.cache / hashlib.sha256(mark.encode()).hexdigest()[:24]


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
            folder = wanted.folder
        except OSError as error:
            raise FileError(f"{wanted.path.name}: {error.strerror or error}") from None
        if (folder / "about.json").is_file():
            (folder / "about.json").touch()
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

    def _collect(self, wanted: Wanted, folder: Path, work: _Work) -> None:
        def progress(done: int, total: int) -> None:
            work.done = done / max(total, 1)

        new = folder.with_name(fresh_name())
        try:
            folder.parent.mkdir(parents=True, exist_ok=True)
            read_apart(keep, wanted.path, wanted.group, list(wanted.names), new, progress=progress)
            _make_room(folder.parent)
            new.rename(folder)
        except BaseException as error:
            shutil.rmtree(new, ignore_errors=True)
            if isinstance(error, OSError) and not isinstance(error, FourpoleError):
                raise CampaignError(f"the recording cannot be shown: {error.strerror or error}") from None
            raise


def _make_room(folder: Path) -> None:
    """Delete the samples that were used longest ago, until the others take less than the largest room."""
    kept = [one for one in folder.iterdir() if (one / "about.json").is_file()]
    sizes = {one: sum(file.stat().st_size for file in one.iterdir()) for one in kept}
    total = sum(sizes.values())
    for one in sorted(kept, key=lambda place: (place / "about.json").stat().st_mtime):
        if total <= _MOST_ROOM:
            return
        shutil.rmtree(one, ignore_errors=True)
        total -= sizes[one]
