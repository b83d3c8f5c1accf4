"""Files of named variables, as MATLAB and NumPy write them: vectors, columns of matrices and fields as channels.

If the only matrix of a struct, or of the top of the file, has beside it an array with a text per column, the texts are
the names (`names`, `labels`, `channels`, ...) or the units (`units`, ...) of the columns. Two such arrays beside
vectors, or in a struct beside them (`channel.name`, `channel.units`), give the units of the vectors.

The times of a channel are a vector or column beside it that is called `t` or `time` (also `Time`, `zeit`) and has the
same length. If there is none, its rate is a number beside or above it called `fs`, `rate`, `sample_rate`, ..., or the
step `dt`, `Ts`.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fourpole.io.formats.guard import floats, is_time, of_name, tidy
from fourpole.io.formats.tracks import Part, Track, times_by
from fourpole.io.signals import Words

_MOST_COLUMNS = 4096
_RATES = re.compile(r"(?:fs|f_s|rate|sample_?rate|sampling_?rate|sampling_?frequency|samp_?freq)", re.IGNORECASE)
_STEPS = re.compile(r"(?:dt|ts|delta_?t|increment|sample_?time|sampling_?time)", re.IGNORECASE)
_NAMES = re.compile(r"name|label|channel|signal|header|column|title", re.IGNORECASE)
_UNITS = re.compile(r"unit|einheit|dimension", re.IGNORECASE)


@dataclass(frozen=True)
class Table:
    """A matrix of numbers, whose longer axis is the time.

    Attributes
    ----------
    count, width : int
        Its lengths; a vector has the width 1.
    long : bool
        Whether the columns are the channels, not the rows.
    column : callable
        Returns the function that reads a part of a channel, from the number of the channel and its name.
    unit : str or None
        The unit that its type states: "s" for points in time and durations.
    """

    count: int
    width: int
    long: bool
    column: Callable[[int, str], Part]
    unit: str | None = None


#: Names of variables or fields with their values: numbers, a number, a text, texts, or the fields of a struct.
Variables = Mapping[str, Any]


def table(values: Any, name: str, *, dims: tuple[int, ...] = (), unit: str | None = None) -> Table | float | None:
    """The numbers of an array, or of a dataset, or its only number; None if it has more than two dimensions, or none.

    Parameters
    ----------
    values : array
    name : str
        The file's name in messages.
    dims : tuple of int, optional
        Its dimensions if they are stored in reverse, as in MATLAB 7.3.
    unit : str, optional
        See `Table`.
    """
    flat, turned = len(values.shape) == 1, bool(dims)
    dims = dims or (*values.shape, *([1] if flat else []))
    if len(dims) > 2 or (len(dims) == 2 and 0 in dims):
        return None
    if max(dims, default=1) == 1 and unit is None:
        return float(values[()].ravel()[0])
    long = dims[0] >= dims[1]

    def column(at: int, channel: str) -> Part:
        def part(first: int, last: int) -> Any:
            rows = slice(first, last)
            return floats(values[rows if flat else (rows, at) if long != turned else (at, rows)], channel, name)

        return part

    return Table(max(dims), min(dims), long, column, unit)


def tracks_in(found: Variables, name: str, numbered: tuple[str, str]) -> list[Track]:
    """The channels of a file; `numbered` are the endings of a column's and of a row's name, counted from 1."""
    return list(_within(found, (), None, name, numbered))


def words_in(found: Variables, path: tuple[str, ...] = ()) -> list[Words]:
    """The columns of words of a file: texts beside vectors of as many numbers."""
    counts = {one.count for one in found.values() if isinstance(one, Table) and one.width == 1}
    here = [
        ("", ".".join((*path, key)), one) for key, one in found.items() if isinstance(one, list) and len(one) in counts
    ]
    inner = [words_in(one, (*path, key)) for key, one in found.items() if isinstance(one, Mapping)]
    return [*here, *(one for several in inner for one in several)]


def stated(found: Variables) -> list[str]:
    """The numbers and texts at the top of a file, as notes."""
    return [f"{tidy(key)}: {tidy(one)}" for key, one in found.items() if isinstance(one, float | str)][:20]


def _within(
    found: Variables, path: tuple[str, ...], above: float | None, name: str, numbered: tuple[str, str]
) -> Iterator[Track]:
    """The channels of a struct, or of the top of the file; `above` is the rate that a struct above states [Hz]."""
    rate = _rate(found) or above
    every = list(_channels(found, path, numbered))
    clocks = [one for one, moment in every if moment] or [one for one, _ in every if is_time(one.name)]
    times = [(clock, times_by(clock, name)) for clock in clocks]
    for one, _ in every:
        clock, time = next((pair for pair in times if pair[0].count == one.count), (None, None))
        if any(one is other for other in clocks):
            yield one
        elif clock is not None:
            yield replace(one, time=time, note=f"time from {tidy(clock.name)}")
        else:
            yield replace(one, rate=rate)
    for key, one in found.items():
        if isinstance(one, Mapping):
            yield from _within(one, (*path, key), rate, name, numbered)


def _channels(found: Variables, path: tuple[str, ...], numbered: tuple[str, str]) -> Iterator[tuple[Track, bool]]:
    """The vectors and columns among some variables, without their times, and whether they are moments."""
    tables = {key: one for key, one in found.items() if isinstance(one, Table)}
    vectors = [key for key, one in tables.items() if one.width == 1]
    alone = len(vectors) == 1
    unit = next((one for key, one in found.items() if alone and isinstance(one, str) and _UNITS.search(key)), None)
    units = _units_by_name(found, vectors)
    for key, one in tables.items():
        called = ".".join(filter(None, [*path, key]))
        if one.width == 1:
            stated = of_name(key, one.unit or unit or units.get(key))
            yield Track(called, stated, one.count, one.column(0, called)), one.unit is not None
        elif one.width <= _MOST_COLUMNS:
            beside = found if len(tables) - len(vectors) == 1 else {}
            named, stating = (_texts(beside, wanted, one.width) for wanted in (_NAMES, _UNITS))
            for at in range(one.width):
                bare = called + numbered[0 if one.long else 1].format(at + 1)
                column = (named[at] if named else "") or bare
                stated = of_name(column if named else "", stating[at] if stating else None)
                yield Track(column, stated, one.count, one.column(at, column)), one.unit is not None


def _texts(found: Variables, wanted: re.Pattern[str], count: int) -> list[str] | None:
    """The texts beside a matrix, one per column, in an array of a wanted name; None if there is none."""
    lists = (one for key, one in found.items() if isinstance(one, list) and wanted.search(key))
    return next((one for one in lists if len(one) == count), None)


def _units_by_name(found: Variables, vectors: list[str]) -> dict[str, str]:
    """Units of vectors by their names, if two cell arrays beside them, or in a struct beside them, list both."""
    for place in (found, *(one for one in found.values() if isinstance(one, Mapping))):
        units = next((one for key, one in place.items() if isinstance(one, list) and _UNITS.search(key)), [])
        names = _texts(place, _NAMES, len(units)) or []
        if not set(vectors).isdisjoint(names):
            return dict(zip(names, units, strict=True))
    return {}


def _rate(found: Variables) -> float | None:
    """The rate that a number among the variables states [Hz]; None if there is none."""
    for pattern, invert in ((_RATES, False), (_STEPS, True)):
        for key, value in found.items():
            if isinstance(value, float) and pattern.fullmatch(key) and np.isfinite(value) and value > 0:
                return 1.0 / value if invert else value
    return None
