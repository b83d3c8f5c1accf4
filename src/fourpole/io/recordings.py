"""A recording in whatever format: which format it is, and what channels it holds."""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module
from pathlib import Path

from fourpole.errors import TableError
from fourpole.io.formats.guard import listed
from fourpole.io.signals import FileInfo, Format, SignalInfo
from fourpole.io.source import name_of, open_regular
from fourpole.units import column_unit, shown

__all__ = ["chosen_of", "format_of", "survey"]

#: Modules of `fourpole.io.formats` in the order in which they look at a file; text takes what nobody else knows.
_MODULES = ("mdf", "tdms", "hdf5", "matlab", "parquet", "famos", "uff", "wav", "tydex", "lvm", "text")
_HEAD = 4096


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


def chosen_of(found: FileInfo, group: str, names: Sequence[str], label: str) -> list[int]:
    """Places of the channels of a group, of all where it is empty, or of those that are named.

    A name is taken as written, with its group as in `group/name`, in another case, or without its unit; TableError
    where there is none.
    """
    signals = found.signals
    places = _in_group(signals, group, label) if group else list(range(len(signals)))
    chosen: list[int] = []
    for wanted in names:
        same = _named(signals, places, wanted)
        if not same:
            there = listed([signals[at].name for at in places], wanted)
            raise TableError(f"{label}: there is no channel {shown(wanted)}{there}")
        chosen += same
    return list(dict.fromkeys(chosen)) if names else places


def _in_group(signals: Sequence[SignalInfo], group: str, label: str) -> list[int]:
    exact = [at for at, one in enumerate(signals) if one.group == group]
    if places := exact or [at for at, one in enumerate(signals) if one.group.casefold() == group.casefold()]:
        return places
    known = list(dict.fromkeys(one.group for one in signals if one.group))
    if not known:
        raise TableError(f"{label}: has no groups; leave out {shown(group)}")
    raise TableError(f"{label}: there is no group {shown(group)}{listed(known, group)}")


def _named(signals: Sequence[SignalInfo], places: Sequence[int], wanted: str) -> list[int]:
    ways: list[list[int]] = [[], [], []]
    bare = column_unit(wanted)[0].casefold()
    for at in places:
        one = signals[at]
        both = (one.name, f"{one.group}/{one.name}")
        ways[0] += [at] * (wanted in both)
        ways[1] += [at] * (wanted.casefold() in (text.casefold() for text in both))
        ways[2] += [at] * (column_unit(one.name)[0].casefold() == bare)
    return next((way for way in ways if way), [])
