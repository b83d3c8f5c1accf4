"""A recording in whatever format: which it is, what it holds, and columns of numbers out of it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from importlib import import_module
from pathlib import Path

from fourpole.errors import FourpoleError, TableError
from fourpole.io.signals import MAX_FILE_BYTES, FileInfo, Format, Request, Signal
from fourpole.io.source import name_of, open_regular

__all__ = ["Piece", "Source", "format_of", "pieces", "survey"]

#: Modules of `fourpole.io.formats` in the order in which they look at a file; text takes what nobody else knows.
_MODULES = ("mdf", "tdms", "hdf5", "matlab", "parquet", "famos", "uff", "wav", "tydex", "lvm", "text")
_HEAD = 4096
#: A file up to this size is read whole without a look at what it declares [byte].
_SMALL = 20_000_000
#: Channels that take no more memory than this are read whole [byte]; nothing is read that needs more than the other.
_WHOLE, _MOST_MEMORY = 200_000_000, 2_000_000_000
#: Rows of a stretch: 8 MB per channel.
_ROWS = 1 << 20
#: Times of two channels are the same within this share of a step.
_SAME_TIME = 1e-3


def format_of(path: str | Path, *, max_bytes: int, label: str | None = None) -> Format:
    """The format of a file by its content; TableError where no reader knows it."""
    with open_regular(path, max_bytes=max_bytes, label=label) as file:
        head = file.read(_HEAD)
    for module in _MODULES:
        found: Format = import_module(f"fourpole.io.formats.{module}").FORMAT
        if found.recognises(head):
            return found
    raise TableError(f"{name_of(path, label)}: is binary, not text; export it as CSV, in UTF-8 (no reader knows it)")


def survey(path: str | Path, *, max_bytes: int = 4_000_000_000, label: str | None = None) -> FileInfo:
    """What a file says of itself: its format, its channels with units and rates, and notes.

    Raises
    ------
    FileError
        If the file is missing, no regular file, too large, or its library is not installed.
    TableError
        If it cannot be read as what it is.
    """
    name = name_of(path, label)
    return format_of(path, max_bytes=max_bytes, label=name).survey(Path(path), name, max_bytes)


@dataclass(frozen=True)
class Piece:
    """A stretch of a recording.

    Attributes
    ----------
    signals : dict of str to Signal
        By the names that were asked for.
    clock : Signal or None
        The column of times, in its own unit, where the file does not know its times itself, or is a table.
    """

    signals: dict[str, Signal]
    clock: Signal | None


@dataclass(frozen=True)
class Source:
    """A recording to be read: where it is, and what is wanted of it.

    Attributes
    ----------
    path : Path
    names : tuple of str
        The channels.
    clock : str or None
        Column of the time; a file that knows its own time need not have it.
    group : str
        Of a file with several recordings.
    label : str
        The file's name in messages.
    """

    path: Path
    names: tuple[str, ...]
    clock: str | None
    group: str
    label: str


def pieces(source: Source) -> tuple[int, Iterator[Piece]]:
    """The channels of a recording, whole where that takes little memory, else one stretch after the other.

    Parameters
    ----------
    source : Source

    Returns
    -------
    count : int
        Samples of the longest channel wanted; 0 where the recording comes whole.
    pieces : iterator of Piece
        In order of time; each channel's samples put together are the recording's.

    Raises
    ------
    FileError, TableError
        If the file cannot be read, lacks a channel, or does not fit into memory and cannot be read in parts.
    """
    kind = format_of(source.path, max_bytes=MAX_FILE_BYTES, label=source.label)
    names = tuple(dict.fromkeys(source.names))
    if kind.name == "text" and source.clock is not None:
        names = tuple(dict.fromkeys([*names, source.clock]))
    count = _count(kind, source, names, least=_SMALL)
    request = Request(source.path, names, source.group, source.label, _MOST_MEMORY)
    if kind.blocks is None:
        return 0, iter([_piece(kind.read(request), names, source, kind.read)])
    if 8 * count * len(names) <= _WHOLE:
        try:
            few = replace(request, max_bytes=2 * _WHOLE)
            return 0, iter([_piece(kind.read(few), names, source, kind.read)])
        except FourpoleError:  # a small file that unpacks to much is read in stretches; what else is wrong is told
            count = _count(kind, source, names, least=0)
            if 8 * count * len(names) <= _WHOLE:
                raise
    return count, (_piece(block, names, source, None) for block in kind.blocks(request, _ROWS))


def _count(kind: Format, source: Source, names: tuple[str, ...], *, least: int) -> int:
    """Samples of the longest of some channels; 0 where the file has no more than `least` bytes."""
    if source.path.stat().st_size <= least:
        return 0
    found = kind.survey(source.path, source.label, MAX_FILE_BYTES)
    inside = [one.count for one in found.signals if one.name in names and source.group in ("", one.group)]
    return max(inside or [one.count for one in found.signals], default=0)


_Read = Callable[[Request], Sequence[Signal]]


def _piece(signals: Sequence[Signal], names: tuple[str, ...], source: Source, again: _Read | None) -> Piece:
    """Signals by name, the clock apart; a file without times of its own is asked for the clock by its name."""
    by_name = dict(zip(names, signals, strict=True))
    clock = by_name.get(source.clock) if source.clock is not None else None
    timeless = all(one.rate is None and one.time is None for one in signals)
    if clock is None and source.clock is not None and timeless and again is not None:
        request = Request(source.path, (source.clock,), source.group, source.label, _MOST_MEMORY)
        clock = again(request)[0]
    stated = clock is not None and source.clock in names  # a table's own column, whatever its preamble says
    return Piece({name: by_name[name] for name in source.names}, clock if timeless or stated else None)
