"""Samples of recordings for pictures: reduced so that peaks stay, collected in the background, kept in a cache folder.

Nothing that a campaign folder holds is taken for such samples: who sends a campaign does not decide what its pictures
show.
"""

from __future__ import annotations

import hashlib
import json
import os
import secrets
import shutil
import tempfile
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from concurrent.futures import TimeoutError as LateError
from contextlib import suppress
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from fourpole.core.arrays import FloatArray
from fourpole.errors import CampaignError, FileError, FourpoleError, TableError
from fourpole.io.child import child, read_apart
from fourpole.io.identity import identity_of
from fourpole.io.names import named
from fourpole.io.recordings import survey
from fourpole.io.signals import MAX_FILE_BYTES, FileInfo, Signal
from fourpole.io.stream import surveyed_stream
from fourpole.io.userfolders import cache_folder
from fourpole.study.workers import processors

#: Samples of which an overview keeps the least and the largest.
_BLOCK = 1024
#: From this number of blocks on, a part is drawn from the overview.
_FROM_BLOCKS = 256
#: How the names of folders begin in which samples are collected before they are all there.
HIDDEN = ".signals-"
#: Largest number of channels of a picture, and largest room of the kept samples [byte].
_MOST_CHANNELS, _MOST_ROOM = 12, 4_000_000_000
#: Libraries that take long to load, by the endings of the files that they read; polars reads most others.
_LIBRARIES = {".h5": "h5py", ".hdf5": "h5py", ".mat": "h5py", ".mdf": "asammdf", ".mf4": "asammdf"}


@dataclass(frozen=True)
class Kept:
    """Samples of one recording that are kept in a folder.

    Attributes
    ----------
    folder : Path
        Holds NUMBER.f64, the samples of each channel, and NUMBER.ends, the least and the largest of each block.
    channels : list of dict
        name, unit, count, start [s], rate [Hz] of each; `even` says whether the times are known and even.
    """

    folder: Path
    channels: list[dict[str, Any]]


def keep(
    path: Path, group: str, names: Sequence[str], folder: Path, *, progress: Callable[[int, int], None]
) -> dict[str, Any]:
    """Write the samples of some channels of a recording into a folder, in limited memory; returns what it holds.

    Parameters
    ----------
    path : Path
        The recording.
    group : str
        The group of the channels; empty for the whole file.
    names : sequence of str
        The channels; one that the file lacks is left out. All of a file with few channels if none is named.
    folder : Path
        A new folder, made here.

    Raises
    ------
    FileError, TableError
        If the recording cannot be read, or has no such channel.
    """
    found = survey(path, max_bytes=MAX_FILE_BYTES)
    chosen = _chosen(found, group, names)
    if not chosen:
        raise TableError(f"{path.name}: has none of the channels that the campaign names")
    total = sum(found.signals[at].count for at in chosen)
    if 8 * total > _MOST_ROOM:
        raise FileError(f"{path.name}: {total} samples are too many for a picture")
    folder.mkdir(parents=True)
    run = surveyed_stream(path, found, chosen, label=path.name)
    sinks = [_Sink(folder, number) for number in range(len(chosen))]
    try:
        done = 0
        for chunk in run.chunks:
            for sink, signal in zip(sinks, chunk, strict=True):
                sink.feed(signal)
            done += sum(signal.samples.size for signal in chunk)
            progress(done, max(total, done))
    finally:
        for sink in sinks:
            sink.close()
    about = [
        {"name": found.signals[at].name, "unit": found.signals[at].unit or "", **sink.about()}
        for at, sink in zip(chosen, sinks, strict=True)
    ]
    (folder / "about.json").write_text(json.dumps(about), encoding="utf-8")
    return {"channels": len(about)}


def kept_in(folder: Path) -> Kept:
    """What `keep` wrote into a folder."""
    return Kept(folder, json.loads((folder / "about.json").read_text(encoding="utf-8")))


def part_of(kept: Kept, number: int, first: float, last: float, width: int) -> dict[str, Any]:
    """A part of a channel for a picture: samples, or the least and the largest in each of at most `width` steps.

    Parameters
    ----------
    kept : Kept
    number : int
        Number of the channel.
    first, last : float [s]
        Ends of the part.
    width : int
        Number of steps.

    Returns
    -------
    dict
        `t` and `low` and `high` by step; `low` alone where samples are shown. Not-a-number is None.
    """
    about = kept.channels[number]
    count, rate, start = about["count"], about["rate"], about["start"]
    begin = int(np.clip(np.floor((first - start) * rate), 0, count))
    end = int(np.clip(np.ceil((last - start) * rate) + 1, begin, count))
    samples = np.memmap(kept.folder / f"{number}.f64", dtype=np.float64, mode="r") if count else np.zeros(0)
    if end - begin <= 2 * width:
        shown = np.asarray(samples[begin:end])
        return {"t": plotted(start + np.arange(begin, end) / rate), "low": plotted(shown)}
    if end - begin >= _FROM_BLOCKS * _BLOCK and (end - begin) // _BLOCK >= width:
        ends = np.fromfile(kept.folder / f"{number}.ends", dtype=np.float64).reshape(-1, 2)
        blocks = ends[begin // _BLOCK : -(-end // _BLOCK)]
        low, high = _steps(blocks[:, 0], width, np.fmin), _steps(blocks[:, 1], width, np.fmax)
    else:
        shown = np.asarray(samples[begin:end])
        low, high = _steps(shown, width, np.fmin), _steps(shown, width, np.fmax)
    edges = begin + (np.arange(low.size) + 0.5) * (end - begin) / low.size
    return {"t": plotted(start + edges / rate), "low": plotted(low), "high": plotted(high)}


def _steps(values: FloatArray, width: int, least: Any) -> FloatArray:
    edges = np.unique(np.linspace(0, values.size, width, endpoint=False).astype(int))
    return np.asarray(least.reduceat(values, edges))


def plotted(values: FloatArray, digits: int = 9) -> list[float | None]:
    """Values for a picture, to some digits; None for not-a-number."""
    return [None if value != value else float(f"{value:.{digits}g}") for value in values.tolist()]


def _chosen(found: FileInfo, group: str, names: Sequence[str]) -> list[int]:
    inside = [at for at, one in enumerate(found.signals) if group in ("", one.group) and one.count > 1]
    places = [(one.group, one.name) for one in found.signals]
    wanted = [at for name in names for at in named(places, inside, name)]
    return list(dict.fromkeys(wanted or inside))[:_MOST_CHANNELS]


class _Sink:
    """Takes the samples of a channel chunk by chunk."""

    def __init__(self, folder: Path, number: int) -> None:
        self._samples = (folder / f"{number}.f64").open("wb")
        self._ends = (folder / f"{number}.ends").open("wb")
        self._rest = np.zeros(0)
        self._count = 0
        self._rate: float | None = None
        self._start: float | None = None
        self._first = self._last = np.nan

    def feed(self, signal: Signal) -> None:
        samples = np.ascontiguousarray(signal.samples, dtype=np.float64)
        if not samples.size:
            return
        if self._start is None:
            self._rate, self._start = signal.rate, signal.start
            self._first = float(signal.time[0]) if signal.time is not None else np.nan
        if signal.time is not None:
            self._last = float(signal.time[-1])
        samples.tofile(self._samples)
        self._count += samples.size
        joined = np.concatenate([self._rest, samples]) if self._rest.size else samples
        whole = joined.size // _BLOCK * _BLOCK
        self._write(joined[:whole].reshape(-1, _BLOCK))
        self._rest = joined[whole:].copy()

    def close(self) -> None:
        if self._rest.size:
            self._write(self._rest[None, :])
        self._samples.close()
        self._ends.close()

    def about(self) -> dict[str, Any]:
        """Count, start [s] and rate [Hz]; without times, samples are counted."""
        if self._rate:
            return {"count": self._count, "start": self._start, "rate": self._rate, "even": True}
        if self._count > 1 and self._last > self._first:
            rate = (self._count - 1) / (self._last - self._first)
            return {"count": self._count, "start": self._first, "rate": rate, "even": True}
        return {"count": self._count, "start": 0.0, "rate": 1.0, "even": False}

    def _write(self, blocks: FloatArray) -> None:
        if blocks.size:
            np.stack([np.fmin.reduce(blocks, axis=1), np.fmax.reduce(blocks, axis=1)], axis=1).tofile(self._ends)


def load(endings: Sequence[str]) -> dict[str, Any]:
    """Load what reads recordings with these endings, so that the first of them does not wait for it."""
    for one in endings:
        with suppress(ImportError):  # the reader says what to install
            import_module(_LIBRARIES.get(one, "polars"))
    return {}


#: Recordings that are read at a time, and time that a page waits for one before it shows progress [s].
_AT_ONCE, _WAIT = 2, 1.0
#: Largest room of the samples of all campaigns; those that were used longest ago go first [byte].
_ALL_ROOM = 4_000_000_000
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

        new = folder.with_name(f"{HIDDEN}{secrets.token_hex(6)}.tmp")
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
        if total > _ALL_ROOM:
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
