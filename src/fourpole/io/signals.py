"""Signals as files hold them: each with its own unit and its own time base."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fourpole.core.arrays import ByValue

__all__ = ["MAX_FILE_BYTES", "FileInfo", "Format", "Request", "Signal", "SignalInfo"]

MAX_FILE_BYTES = 64_000_000_000
"""The largest file that is looked at, where what is read of it is a small part at a time."""


@dataclass(frozen=True, eq=False)
class Signal(ByValue):
    """One channel of a recording.

    Attributes
    ----------
    name : str
        As the file has it.
    unit : str or None
        As the file states it.
    samples : (n,) float array
        In that unit, scaled as the file says; not-a-number where a value is missing or marked invalid.
    start : float [s]
        Time of the first sample, from the file's own zero.
    rate : float or None [Hz]
        Samples per second; None where `time` is given instead, or where the file knows neither.
    time : (n,) float array or None [s]
        Time of each sample, where the file states them one by one.
    """

    name: str
    unit: str | None
    samples: NDArray[np.float64]
    start: float = 0.0
    rate: float | None = None
    time: NDArray[np.float64] | None = None


@dataclass(frozen=True)
class SignalInfo:
    """What a file says of a channel, without its samples.

    Attributes
    ----------
    name, unit : str, str or None
    group : str
        What `file#group` would call it; empty where the file has no groups.
    count : int
        Samples.
    rate : float or None [Hz]
    start, duration : float or None [s]
        None where the file has no time.
    note : str
        What else the file says that a reader should know: scaling, comment, sensor.
    """

    name: str
    unit: str | None
    group: str
    count: int
    rate: float | None
    start: float | None
    duration: float | None
    note: str = ""


@dataclass(frozen=True)
class FileInfo:
    """What a file holds.

    Attributes
    ----------
    format : str
        In words, with its version: ASAM MDF 4.10.
    signals : tuple of SignalInfo
    notes : tuple of str
        What the file says of itself as a whole: date, title, operator, and what a reader should know.
    """

    format: str
    signals: tuple[SignalInfo, ...]
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Request:
    """What is wanted of a file.

    Attributes
    ----------
    path : Path
    names : tuple of str
        The channels, as in the file; case does not matter where that is unambiguous.
    group : str
        Where several groups have them; empty where one has.
    label : str
        The file's name in messages.
    max_bytes : int
        Nothing that needs more memory is read.
    max_file_bytes : int
        No larger file is read, in blocks or in part.
    """

    path: Path
    names: tuple[str, ...]
    group: str
    label: str
    max_bytes: int
    max_file_bytes: int = MAX_FILE_BYTES


@dataclass(frozen=True)
class Format:
    """A kind of file: how to know it, what it says of itself, and how to read it.

    Attributes
    ----------
    name : str
        In words.
    endings : tuple of str
        Usual ends of a file's name, in lower case, with the dot.
    recognises : callable
        Whether the first bytes of a file (up to 4096) are of this kind; content goes before the name.
    survey : callable
        FileInfo of (path, label, max_bytes), without reading samples where the format allows.
    read : callable
        One Signal per name of a Request, in its order.
    extra : str
        Extra of the package that must be installed for it; empty where none.
    blocks : callable or None
        Of a Request and a number of rows, the recording piece by piece: each time one Signal per name, in
        the order of the request, with its next samples, `rows` of them at most, and their `start` and
        `time`. Channels of different rates go on together in time; one that has ended gives empty pieces.
        All pieces of a channel together are what `read` gives; memory goes with `rows`, not with the file.
        None where the format cannot be read in part.
    """

    name: str
    endings: tuple[str, ...]
    recognises: Callable[[bytes], bool]
    survey: Callable[[Path, str, int], FileInfo]
    read: Callable[[Request], Sequence[Signal]]
    extra: str = ""
    blocks: Callable[[Request, int], Iterator[Sequence[Signal]]] | None = None
