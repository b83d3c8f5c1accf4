"""The samples of a recording for a picture of any part of it: kept as a file, reduced so that peaks stay."""

from __future__ import annotations

import json
import secrets
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from fourpole.core.arrays import FloatArray
from fourpole.errors import FileError, TableError
from fourpole.io.names import named
from fourpole.io.recordings import survey
from fourpole.io.signals import MAX_FILE_BYTES, FileInfo, Signal
from fourpole.io.stream import surveyed_stream

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
        return {"t": _numbers(start + np.arange(begin, end) / rate), "low": _numbers(shown)}
    if end - begin >= _FROM_BLOCKS * _BLOCK and (end - begin) // _BLOCK >= width:
        ends = np.fromfile(kept.folder / f"{number}.ends", dtype=np.float64).reshape(-1, 2)
        blocks = ends[begin // _BLOCK : -(-end // _BLOCK)]
        low, high = _steps(blocks[:, 0], width, np.fmin), _steps(blocks[:, 1], width, np.fmax)
    else:
        shown = np.asarray(samples[begin:end])
        low, high = _steps(shown, width, np.fmin), _steps(shown, width, np.fmax)
    edges = begin + (np.arange(low.size) + 0.5) * (end - begin) / low.size
    return {"t": _numbers(start + edges / rate), "low": _numbers(low), "high": _numbers(high)}


def _steps(values: FloatArray, width: int, least: Any) -> FloatArray:
    edges = np.unique(np.linspace(0, values.size, width, endpoint=False).astype(int))
    return np.asarray(least.reduceat(values, edges))


def _numbers(values: FloatArray) -> list[float | None]:
    return [None if value != value else float(f"{value:.9g}") for value in values.tolist()]


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


def fresh_name() -> str:
    """Name of a hidden folder in which samples are collected before they are all there."""
    return f"{HIDDEN}{secrets.token_hex(6)}.tmp"
