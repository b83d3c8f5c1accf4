"""LabVIEW measurement files (.lvm): a header, and segments of channels with their start and time step.

References
----------
National Instruments, "Specification for the LabVIEW Measurement File (.lvm)", tutorial 4139, versions 1 and 2.
"""

from __future__ import annotations

import io
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fourpole.errors import TableError
from fourpole.io.door import read_bytes
from fourpole.io.formats.guard import afford, find, tidy
from fourpole.io.known import BEGINS
from fourpole.io.layout import is_missing, number
from fourpole.io.names import Place, numbered
from fourpole.io.signals import FileInfo, Format, Request, Signal, SignalInfo
from fourpole.io.source import decode, encoding_of, name_of
from fourpole.units import column_unit, shown

_END_OF_HEADER = re.compile(rb"^\*\*\*End_of_Header\*\*\*[^\n]*(?:\n|\Z)", re.MULTILINE)
_SEGMENT = re.compile(rb"^Channels(?=\W)", re.MULTILINE)
_START_SPECIAL, _END_SPECIAL = b"\n***Start_Special***", b"\n***End_Special***"
_SEPARATORS = {"tab": "\t", "comma": ",", "semicolon": ";", "space": " "}
_LONGEST_HEADER = 4_000_000
_MOST_CHANNELS = 100_000
#: Shortest and longest time step that is accepted [s].
_SHORTEST, _LONGEST = 1e-12, 1e6
_NULLS = ["NaN", "nan", "NAN", "-NaN", "Inf", "-Inf"]


@dataclass(frozen=True)
class _Channel:
    """One column of a segment; `x_column` is the index of the column with its x values, None if there is none."""

    name: str
    unit: str | None
    column: int
    x_column: int | None
    samples: int
    start: float
    step: float
    rounding: float
    """One unit in the last digit of the step as it is written."""
    is_time: bool
    note: str

    def rate(self, count: int, first: float | None, last: float | None) -> float:
        """Samples per second, from the first and the last x value if these agree with the step within its rounding."""
        if first is None or last is None or count < 2:
            return 1 / self.step
        found = (last - first) / (count - 1)
        if not 0 < abs(found - self.step) <= self.rounding or found <= 0:
            return 1 / self.step
        whole = round(1 / found)
        if whole and abs(1 / whole - found) * (count - 1) <= self.rounding:
            return float(whole)
        return 1 / self.step if abs(found - self.step) * (count - 1) <= self.rounding else 1 / found


@dataclass(frozen=True)
class _Segment:
    """The channels of a part of the file, and the bytes that hold its rows."""

    channels: tuple[_Channel, ...]
    width: int
    begin: int
    end: int

    def follows(self, before: _Segment) -> bool:
        """Whether each channel continues in time the channel of the segment `before`."""
        return len(self.channels) == len(before.channels) and all(
            (one.name, one.unit, one.step) == (last.name, last.unit, last.step)
            and one.is_time
            and one.step > 0
            and abs(last.start + last.samples * last.step - one.start) < one.step / 2
            for one, last in zip(self.channels, before.channels, strict=True)
        )


@dataclass(frozen=True)
class _Measurement:
    """The statements of the file's header, and its segments; segments that continue each other are one group."""

    tags: dict[str, str]
    separator: str
    decimal: str
    groups: tuple[tuple[_Segment, ...], ...]

    @property
    def places(self) -> list[Place]:
        """Group and name of each channel."""
        many = len(self.groups) > 1
        return [
            (str(at) if many else "", one.name) for at, group in enumerate(self.groups, 1) for one in group[0].channels
        ]


def _opened(path: Path, label: str, max_bytes: int) -> tuple[bytes, _Measurement, str]:
    """The content of a file with line feeds as line ends, the statements of its headers, and its name in messages."""
    name = name_of(path, label)
    content = read_bytes(path, max_bytes=max_bytes, label=label)
    encoding, mark = encoding_of(content[:65536], name)
    content = decode(content, name)[0].encode() if encoding.startswith("utf-16") else content[mark:]
    if not BEGINS["lvm"](content[:64]):
        raise TableError(f"{name}: is no LabVIEW measurement file: it does not begin with 'LabVIEW Measurement'")
    if b"\r" in content[:_LONGEST_HEADER]:
        content = content.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    content = _without_special(content)
    return content, _measurement(content, name), name


def _without_special(content: bytes) -> bytes:
    """The content without the blocks between Start_Special and End_Special, which have no defined meaning."""
    kept, at = [], 0
    while (begin := content.find(_START_SPECIAL, at)) >= 0 and (end := content.find(_END_SPECIAL, begin)) >= 0:
        kept.append(content[at:begin])
        at = content.find(b"\n", end + 1)
        at = len(content) if at < 0 else at
    return b"".join([*kept, content[at:]]) if kept else content


def _text(content: bytes) -> str:
    try:
        return content.decode()
    except UnicodeDecodeError:
        return content.decode("cp1252", errors="replace")


def _measurement(content: bytes, name: str) -> _Measurement:
    """The headers of a file."""
    first = _END_OF_HEADER.search(content, 0, _LONGEST_HEADER)
    if first is None:
        raise TableError(f"{name}: its header has no end (***End_of_Header***); it is cut off, write it again")
    header = _text(content[: first.start()])
    named = re.search(r"^Separator(\W)(\w*)", header, re.MULTILINE)
    separator = _SEPARATORS.get(named[2].lower(), named[1]) if named else "\t"
    tags = {key: cells[0] for key, cells in _tags(header, separator).items() if cells}
    decimal = "," if tags.get("Decimal_Separator", ".") == "," and separator != "," else "."
    segments: list[_Segment] = []
    at = first.end()
    while begin := _SEGMENT.search(content, at):
        end = _END_OF_HEADER.search(content, begin.start(), begin.start() + _LONGEST_HEADER)
        if end is None:
            raise TableError(f"{name}: segment {len(segments) + 1} has no end of its header; the file is cut off")
        following = _SEGMENT.search(content, end.end())
        at = following.start() if following else len(content)
        line = content.find(b"\n", end.end())
        line = at if line < 0 else line
        head = _tags(_text(content[begin.start() : end.start()]), separator)
        names = [cell.strip().strip('"') for cell in _text(content[end.end() : line]).split(separator)]
        where = f"{name}, segment {len(segments) + 1}"
        channels = _channels(head, names, tags.get("X_Columns", "One").lower(), decimal, where)
        segments.append(_Segment(channels, len(names), min(line + 1, at), at))
    if not segments:
        raise TableError(f"{name}: has a header but no segment of channels below it; write it again, with headers")
    return _Measurement(tags, separator, decimal, _grouped(segments))


def _grouped(segments: Sequence[_Segment]) -> tuple[tuple[_Segment, ...], ...]:
    """The segments, those together that continue each other."""
    groups: list[list[_Segment]] = []
    for segment in segments:
        if groups and segment.follows(groups[-1][-1]):
            groups[-1].append(segment)
        else:
            groups.append([segment])
    return tuple(map(tuple, groups))


def _tags(header: str, separator: str) -> dict[str, list[str]]:
    """The cells of each line of a header, by the tag that begins the line."""
    lines = (line.split(separator) for line in header.split("\n") if line.strip())
    return {cells[0].strip(): [cell.strip() for cell in cells[1:]] for cells in lines}


def _channels(
    head: dict[str, list[str]], names: list[str], columns: str, decimal: str, where: str
) -> tuple[_Channel, ...]:
    """The channels of a segment, from its header and its line of names."""
    multi = columns == "multi"
    places = _places(head, len(names), 2 if multi else 1, where)

    def cell(tag: str, at: int) -> str:
        cells = head.get(tag, [])
        filled = [cells[place - 1] for place in places] if len(cells) >= places[-1] else cells
        if multi and not all(filled[: len(places)]) and sum(map(bool, cells)) == len(places):
            filled = [one for one in cells if one]  # the cells stand side by side, not above their columns
        return filled[at] if at < len(filled) else ""

    def interval(at: int) -> float:
        step = number(cell("Delta_X", at), decimal) or 0.0
        return step if _SHORTEST < step < _LONGEST else 0.0

    called = [names[place] or f"channel {at + 1}" for at, place in enumerate(places)]
    channels = []
    for at, (name, place) in enumerate(zip(numbered(called), places, strict=True)):
        date = " ".join(filter(None, (cell("Date", at), cell("Time", at))))
        samples = cell("Samples", at)
        channels.append(
            _Channel(
                name=name,
                unit=cell("Y_Unit_Label", at) or column_unit(name)[1],
                column=place,
                x_column=place - 1 if multi else 0 if columns == "one" else None,
                samples=int(samples[:15]) if samples.isascii() and samples.isdigit() else 0,
                start=number(cell("X0", at), decimal) or 0.0,
                step=interval(at),
                rounding=_last_digit(cell("Delta_X", at)),
                is_time=cell("X_Dimension", at).lower() in ("", "time"),
                note=tidy(date),
            )
        )
    return tuple(channels)


def _places(head: dict[str, list[str]], width: int, step: int, where: str) -> list[int]:
    """Indices of the columns of the channels; TableError if their number is none, or more than there are columns."""
    stated = (head.get("Channels") or [""])[0]
    if not stated.isascii() or not stated.isdigit() or not 0 < int(stated[:9]) <= _MOST_CHANNELS:
        raise TableError(f"{where}: has {shown(stated)} as its number of channels; write the file again")
    places = [1 + step * at for at in range(int(stated))]
    if places[-1] >= width:
        raise TableError(f"{where}: states {len(places)} channels but names {width} columns; it is cut off")
    return places


def _last_digit(cell: str) -> float:
    """One unit in the last digit of a number as it is written; 0 if it is no number."""
    digits, _, exponent = cell.strip().replace(",", ".").upper().partition("E")
    try:
        power = int(exponent or "0") - len(digits.partition(".")[2])
    except ValueError:
        return 0.0
    return 10.0**power if -300 < power < 300 else 0.0


def _survey(path: Path, label: str, max_bytes: int) -> FileInfo:
    content, found, _ = _opened(path, label, max_bytes)
    infos: list[SignalInfo] = []
    for group in found.groups:
        rows = sum(_rows(content, found, part) for part in group)
        for at, first in enumerate(group[0].channels):
            count = max(sum(part.channels[at].samples for part in group), rows)
            rate = first.rate(*_x_ends(content, found, group, at)) if first.is_time and first.step > 0 else None
            group_name, start = found.places[len(infos)][0], first.start
            infos.append(
                SignalInfo.timed(first.name, first.unit, group_name, count, rate=rate, start=start, note=first.note)
            )
    tags = ("Date", "Time", "Operator", "Description", "Project")
    notes = [tidy(f"{tag}: {found.tags[tag]}") for tag in tags if found.tags.get(tag)]
    version = found.tags.get("Writer_Version", "")
    return FileInfo(tidy(f"LabVIEW measurement {version}".strip()), tuple(infos), tuple(notes))


def _x_ends(
    content: bytes, found: _Measurement, group: Sequence[_Segment], at: int
) -> tuple[int, float | None, float | None]:
    """Number of rows of a group, and first and last x value of a channel (None if it is not written)."""
    parts = [content[one.begin : one.end].rstrip() for one in group]
    ends = []
    for segment, row in ((group[0], parts[0].partition(b"\n")[0]), (group[-1], parts[-1].rpartition(b"\n")[2])):
        cells, column = _text(row).split(found.separator), segment.channels[at].x_column
        ends.append(number(cells[column], found.decimal) if column is not None and column < len(cells) else None)
    return sum(one.count(b"\n") + 1 for one in parts), ends[0], ends[1]


def _rows(content: bytes, found: _Measurement, segment: _Segment) -> int:
    """Number of lines of a segment if one header serves all segments, since it counts only the first; otherwise 0."""
    if found.tags.get("Multi_Headings", "No").lower() == "yes":
        return 0
    return content[segment.begin : segment.end].strip().count(b"\n") + 1


def _read(request: Request) -> Sequence[Signal]:
    content, found, name = _opened(request.path, request.label, request.max_bytes)
    which = find(found.places, request)
    flat = [(group, at) for group in found.groups for at in range(len(group[0].channels))]
    asked = [flat[index] for index in which]
    lines = {id(group): sum(content.count(b"\n", one.begin, one.end) + 1 for one in group) for group, _ in asked}
    afford(sum(16 * lines[id(group)] for group, _ in asked), request.max_bytes, name)
    signals = []
    for group, at in asked:
        parts = [_columns(content, found, segment, segment.channels[at], name) for segment in group]
        samples = np.concatenate([values for values, _ in parts])
        first = group[0].channels[at]
        x = np.concatenate([steps for _, steps in parts if steps is not None] or [np.empty(0)])
        signals.append(_signal(first, samples, x if len(x) == len(samples) else None))
    return signals


def _signal(channel: _Channel, samples: NDArray[np.float64], x: NDArray[np.float64] | None) -> Signal:
    """A channel with its time base: start and step of the header if the x values agree with them, else the x values."""
    if not channel.is_time:
        return Signal(channel.name, channel.unit, samples)
    if channel.step > 0:
        known = x is not None and len(x) > 0
        rate = channel.rate(len(samples), *((float(x[0]), float(x[-1])) if x is not None and known else (None, None)))
        even = channel.start + np.arange(len(samples)) / rate
        if x is None or np.abs(x - even).max(initial=0.0) < channel.step / 2:
            return Signal(channel.name, channel.unit, samples, channel.start, rate)
    return Signal(channel.name, channel.unit, samples, time=x)


def _columns(
    content: bytes, found: _Measurement, segment: _Segment, channel: _Channel, name: str
) -> tuple[NDArray[np.float64], NDArray[np.float64] | None]:
    """The samples of a channel in one segment, and their x values (None if they are not written)."""
    import polars as pl

    wanted = sorted({channel.column, *(() if channel.x_column is None else (channel.x_column,))})
    rows = content[segment.begin : segment.end]
    schema = {str(at): pl.Float64() if at in wanted else pl.String() for at in range(segment.width)}
    try:
        frame = pl.read_csv(
            io.BytesIO(rows),
            has_header=False,
            columns=wanted,
            schema=schema,
            separator=found.separator,
            quote_char=None,
            null_values=_NULLS,
            decimal_comma=found.decimal == ",",
            truncate_ragged_lines=True,
        )
        columns = {at: frame[str(at)].fill_null(np.nan).to_numpy() for at in wanted}
    except (pl.exceptions.PolarsError, pl.exceptions.PanicException, ValueError):
        columns = _slowly(rows, found, wanted, content.count(b"\n", 0, segment.begin), name)
    values = columns[channel.column]
    known = np.flatnonzero(np.isfinite(values))
    count = int(known[-1]) + 1 if len(known) else 0
    if count < channel.samples <= len(values):
        count = channel.samples  # the last samples are stated as missing
    if count < channel.samples or not count:
        what = f"{count} of the {channel.samples} samples" if channel.samples else "no samples"
        raise TableError(
            f"{name}: channel {shown(channel.name)} has {what} that its header states; the file is cut off"
        )
    x = columns[channel.x_column][:count] if channel.x_column is not None else None
    return values[:count], x if x is not None and np.isfinite(x).all() else None


def _slowly(
    rows: bytes, found: _Measurement, wanted: Sequence[int], before: int, name: str
) -> dict[int, NDArray[np.float64]]:
    """The wanted columns, read cell by cell; TableError at the first cell that is no number."""
    columns: dict[int, list[float]] = {at: [] for at in wanted}
    for line, row in enumerate(_text(rows).split("\n"), before + 1):
        cells = row.split(found.separator)
        for at, column in columns.items():
            cell = cells[at] if at < len(cells) else ""
            value = number(cell, found.decimal)
            if value is None and not is_missing(cell) and cell.strip() not in _NULLS:
                raise TableError(f"{name} row {line}: {shown(cell)} is no number; mend it, or leave it blank")
            column.append(np.nan if value is None else value)
    return {at: np.array(column) for at, column in columns.items()}


FORMAT = Format("LabVIEW measurement", (".lvm",), _survey, _read)
