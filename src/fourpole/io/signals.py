"""Signals as a file holds them, each with its own unit and time base, and the interface of a file format."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fourpole.core.arrays import ByValue

MAX_FILE_BYTES = 64_000_000_000
"""Largest file of which a part is read at a time [byte]."""
Progress = Callable[[int, int], None]
"""Is called with the number of samples that are done, and the number of all samples."""
HEAD_BYTES = 4096
"""Number of first bytes by which a format is recognised."""


@dataclass(frozen=True, eq=False)
class Signal(ByValue):
    """One channel of a recording.

    Attributes
    ----------
    name : str
        The name in the file.
    unit : str or None
        The unit that the file states.
    samples : (n,) float array [unit]
        The samples, scaled as the file says; not-a-number where a value is missing or marked invalid.
    start : float [s]
        Time of the first sample, counted from the file's own zero.
    rate : float or None [Hz]
        Samples per second; None if `time` is given instead, or if the file states no times.
    time : (n,) float array or None [s]
        Time of each sample, if the file states each time.
    """

    name: str
    unit: str | None
    samples: NDArray[np.float64]
    start: float = 0.0
    rate: float | None = None
    time: NDArray[np.float64] | None = None


@dataclass(frozen=True)
class SignalInfo:
    """The description of a channel in a file, without its samples.

    Attributes
    ----------
    name, unit : str, str or None
        The name in the file, and the unit that the file states.
    group : str
        The name of its group, as in `file#group`; empty if the file has no groups.
    count : int
        Number of samples.
    rate : float or None [Hz]
        Samples per second; None if the samples are not even in time, or the file states no times.
    start, duration : float or None [s]
        Time of the first sample, and from the first sample to the last one; None if the file states no times.
    note : str
        Further statements of the file on the channel: scaling, comment, sensor.
    """

    name: str
    unit: str | None
    group: str
    count: int
    rate: float | None
    start: float | None
    duration: float | None
    note: str = ""

    @classmethod
    def timed(
        cls,
        name: str,
        unit: str | None,
        group: str,
        count: int,
        *,
        rate: float | None = None,
        start: float = 0.0,
        ends: tuple[float, float] | None = None,
        note: str = "",
    ) -> SignalInfo:
        """A description with the duration that follows from first and last time `ends` [s], or else from the rate."""
        if ends is not None:
            return cls(name, unit, group, count, rate, ends[0], ends[1] - ends[0], note)
        if not rate:
            return cls(name, unit, group, count, None, None, None, note)
        return cls(name, unit, group, count, rate, start, max(count - 1, 0) / rate, note)


@dataclass(frozen=True)
class FileInfo:
    """The description of a file, without its samples.

    Attributes
    ----------
    format : str
        Name and version of the format, such as "ASAM MDF 4.10".
    signals : tuple of SignalInfo
        One per channel, in the order of the file.
    notes : tuple of str
        Statements of the file on the whole recording: date, title, operator; and warnings of its reader.
    began : float, optional [s]
        Time at which the recording began, from 1970 on, where the file states it.
    """

    format: str
    signals: tuple[SignalInfo, ...]
    notes: tuple[str, ...] = ()
    began: float | None = None


@dataclass(frozen=True)
class Request:
    """The channels that are to be read from a file.

    Attributes
    ----------
    path : Path
        The file.
    names : tuple of str
        Names of the channels in the file; another case is accepted if it is unambiguous.
    group : str
        The group that has the channels; empty if only one group has them.
    label : str
        The file's name in messages.
    max_bytes : int [byte]
        Largest memory that the samples may need; a request that needs more is refused.
    """

    path: Path
    names: tuple[str, ...]
    group: str
    label: str
    max_bytes: int


#: A column of words: its group, its name and its cells.
Words = tuple[str, str, list[str]]


@dataclass(frozen=True)
class Format:
    """A file format and its reader. By which first bytes it is recognised, `fourpole.io.recordings` says.

    Attributes
    ----------
    name : str
        The name of the format for messages.
    endings : tuple of str
        Usual endings of a file's name, in lower case, with the dot.
    survey : callable
        Takes path, label and max_bytes, and returns a FileInfo; samples are not read if the format allows it.
    read : callable
        Takes a Request, and returns one Signal per name, in the order of the request.
    blocks : callable
        Takes a Request and a number of rows, and yields the recording in chunks. A chunk has one Signal per name, in
        the order of the request, with its next samples (at most `rows`), their `start` and `time`. Channels of
        different rates advance together in time; a channel that has ended gives empty signals. All chunks of a channel
        together equal the result of `read`.
    by_library : bool
        Whether a library reads the file, which a damaged file may crash or occupy: such a file is read in a worker
        process.
    words : callable, optional
        Takes path and label, and returns the columns of words, which are no channels.
    """

    name: str
    endings: tuple[str, ...]
    survey: Callable[[Path, str, int], FileInfo]
    read: Callable[[Request], Sequence[Signal]]
    blocks: Callable[[Request, int], Iterator[Sequence[Signal]]]
    by_library: bool = False
    words: Callable[[Path, str], list[Words]] | None = None
