"""Tables of text: the header has the names of the channels; the lines above it may state a rate.

A file with several headers, each with rows below it, has a group for each. The first lines tell one table from another;
only if they, or the reading, show more than one header is the whole file looked through.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from itertools import islice, zip_longest
from pathlib import Path

import numpy as np

from fourpole.errors import FourpoleError, TableError
from fourpole.io.columns import Columns, column_blocks, survey_tables
from fourpole.io.formats.guard import afford, find, seconds, tidy
from fourpole.io.layout import Layout, number
from fourpole.io.names import in_group, numbered
from fourpole.io.signals import MAX_FILE_BYTES, FileInfo, Format, Request, Signal, SignalInfo
from fourpole.io.stretches import Stretch
from fourpole.units import column_unit, quantity

_NUMBER = r"(?P<value>(?>[0-9]+(?:[.,][0-9]+)?(?:[eE][+-]?[0-9]+)?))"
_GAP = r"\W{0,4}(?:\[(?P<before>[^\[\]]{1,8})\]|\((?P<round>[^()]{1,8})\))?[\s:=;,\"]{1,6}"
_RATE = re.compile(
    r"(?:sampl(?:e|ing)[ _-]?(?:rate|freq(?:uency|\.)?)|scan[ _-]?rate|abtastrate|abtastfrequenz|messrate|\bfs|\bSR)"
    rf"{_GAP}{_NUMBER}(?!\s*[mµu]?s\b)[\s;,\"]{{0,3}}(?P<after>[kM]?Hz|S/s|kS/s|1/s)?",
    re.IGNORECASE,
)
_INTERVAL = re.compile(
    r"(?:sampl(?:e|ing)[ _-]?(?:interval|period|time)|abtastintervall|abtastzeit|time[ _-]?step|\bdt|delta[ _-]?t)"
    rf"{_GAP}{_NUMBER}[\s;,\"]{{0,3}}(?P<after>[mµu]?s\b)?",
    re.IGNORECASE,
)
_CATMAN_RATE = re.compile(r"(?<![0-9.,])[0-9.,]++ m?s \((?P<value>[0-9]++(?:[.,][0-9]++)?)\s?(?P<after>k?Hz)\)")
#: Lowest and highest rate that is accepted [Hz].
_LOWEST, _HIGHEST = 1e-6, 1e12
_MOST_NOTES = 20
#: Largest number of stretches that are read at the same time.
_TOGETHER = 16
#: Memory of a number [byte].
_NUMBER_SIZE = 8


def _rate(lines: Sequence[str]) -> float | None:
    """The rate that the lines above the rows state [Hz]; None if they state none, or several."""
    found: set[float] = set()
    for line in lines:
        for pattern in (_RATE, _INTERVAL, _CATMAN_RATE):
            for match in pattern.finditer(line[:2000]):
                rate = _hertz(match, inverse=pattern is _INTERVAL)
                if rate is not None and _LOWEST < rate < _HIGHEST:
                    found.add(rate)
    return found.pop() if len(found) == 1 else None


def _hertz(match: re.Match[str], *, inverse: bool) -> float | None:
    """The rate that a line states [Hz]; a number without a unit is in Hz, or in s if it is a step (`inverse`)."""
    groups = match.groupdict()
    stated = groups.get("before") or groups.get("round") or groups.get("after")
    value = number(match["value"], "," if "," in match["value"] else ".")
    if value is None or value <= 0:
        return None
    if inverse:
        step = value * (seconds(stated) or 0.0)
        return float(f"{1 / step:.12g}") if step > 1 / _HIGHEST else None
    if stated is None:
        return value
    unit = stated.strip().replace("kS/s", "kHz").replace("S/s", "Hz").replace("1/s", "Hz")
    try:
        return quantity(f"{value!r} {unit}", "frequency")
    except FourpoleError:
        return None


def _survey(path: Path, label: str, max_bytes: int) -> FileInfo:
    tables, is_one, written = survey_tables(path, max_bytes=max(max_bytes, MAX_FILE_BYTES), label=label)
    layout, above = tables[0].layout, tables[0].above
    if is_one:
        above = above[: layout.header_line - 1]
    many = len(tables) > 1
    signals = [
        signal
        for table in tables
        for signal in _signals(table.layout, table.above, table.rows, table.name if many else "")
    ]
    notes = [tidy(line) for line in above if line.strip()]
    if len(notes) > _MOST_NOTES:
        notes = [*notes[: _MOST_NOTES - 1], f"{len(notes) - _MOST_NOTES + 1} more lines"]
    between = {"\t": "tabs", " ": "blanks", ",": "commas", ";": "semicolons"}[layout.delimiter]
    decimal = ", decimal commas" if layout.decimal == "," else ""
    return FileInfo(f"text in {written}, {between} between the cells{decimal}", tuple(signals), tuple(notes))


def _signals(layout: Layout, above: Sequence[str], rows: int, group: str) -> list[SignalInfo]:
    """The channels of a table; a column without a name is none."""
    signals, rate = [], _rate(above)
    for index, name in enumerate(_names(layout)):
        is_clock = index in layout.clocks
        unit, note = ("s", "times of day, read as seconds from the first") if is_clock else (layout.units[index], "")
        if column_unit(layout.names[index])[0]:
            signals.append(SignalInfo.timed(name, unit, group, rows, rate=rate, note=note))
    return signals


def _names(layout: Layout) -> list[str]:
    return numbered([column_unit(one)[0] for one in layout.names])


def _chosen(request: Request, stretches: Sequence[Stretch]) -> list[tuple[Stretch, dict[int, str]]]:
    """The stretches of a request, with the columns of its names by their index in it."""
    many = len(stretches) > 1
    places = [(one, name) for one in stretches for name in _names(one.layout)]
    groups: dict[str, tuple[Stretch, dict[int, str]]] = {}
    for at, place in enumerate(find([(one.name if many else "", name) for one, name in places], request)):
        stretch, name = places[place]
        groups.setdefault(stretch.name, (stretch, {}))[1][at] = name
    return list(groups.values())


def _several(request: Request, refused: TableError | None = None) -> list[Stretch]:
    """The stretches of a file; empty if it is one table that begins with its first lines.

    The error with which such a table was `refused` is raised again.
    """
    tables, is_one, _ = survey_tables(request.path, max_bytes=MAX_FILE_BYTES, label=request.label)
    if not is_one:
        return tables
    if refused is not None:
        raise refused
    in_group([], request.group, request.label)
    return []


def _read(request: Request) -> Sequence[Signal]:
    # A cell has one byte at least, so that a short file needs no count of its rows.
    if _NUMBER_SIZE * request.path.stat().st_size > request.max_bytes:
        known = _survey(request.path, request.label, MAX_FILE_BYTES).signals
        counts = [known[at].count for at in find([(one.group, one.name) for one in known], request)]
        afford(_NUMBER_SIZE * sum(counts), request.max_bytes, request.label)
    chunks = list(_blocks(request, MAX_FILE_BYTES))  # one of each stretch
    return [max((chunk[at] for chunk in chunks), key=lambda one: one.samples.size) for at in range(len(request.names))]


def _signal(columns: Columns, column: str, name: str, done: int = 0) -> Signal:
    """A column as a signal; `done` rows of it came before."""
    rate = _rate(columns.above)
    return Signal(name, columns.units[column], columns[column], done / rate if rate else 0.0, rate)


def _blocks(request: Request, rows: int) -> Iterator[Sequence[Signal]]:
    done = 0
    if request.group:
        stretches = _several(request)
    else:
        try:
            for chunk in _stretch_blocks(request, rows, None, dict(enumerate(request.names))):
                yield chunk
                done += max(len(one.samples) for one in chunk)
            return
        except TableError as error:
            stretches = _several(request, error)
            if done > max(one.rows for one, _ in _chosen(request, stretches)):
                raise  # what came as one table was none
    # The first rows came from the first table, before it ended.
    yield from islice(_turns(request, rows, stretches), done // rows, None)


def _turns(request: Request, rows: int, stretches: Sequence[Stretch]) -> Iterator[list[Signal]]:
    """The chunks of some columns of several stretches."""
    runs = [_stretch_blocks(request, rows, stretch, names) for stretch, names in _chosen(request, stretches)]
    # The stretches of a test advance together; many at a time are only looked at, one file open after the other.
    turns = zip_longest(*runs) if len(runs) <= _TOGETHER else ((one,) for run in runs for one in run)
    for turn in turns:
        signals = {one.name: one for chunk in turn for one in chunk or ()}
        yield [signals.get(one, Signal(one, None, np.empty(0))) for one in request.names]


def _stretch_blocks(
    request: Request, rows: int, stretch: Stretch | None, names: Mapping[int, str]
) -> Iterator[list[Signal]]:
    """The chunks of some columns of a stretch, or of a file with one table."""
    done = 0
    for block in column_blocks(
        request.path, list(names.values()), rows, max_bytes=MAX_FILE_BYTES, label=request.label, stretch=stretch
    ):
        yield [_signal(block, one, request.names[at], done) for at, one in names.items()]
        done += len(block)


_ENDINGS = (".csv", ".txt", ".asc", ".dat", ".tsv", ".prn")
FORMAT = Format("text", _ENDINGS, _survey, _read, blocks=_blocks)
