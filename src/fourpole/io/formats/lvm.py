"""LabVIEW measurement files (.lvm): a header, and segments of channels with their start and time step.

References
----------
National Instruments, "Specification for the LabVIEW Measurement File (.lvm)", tutorial 4139, versions 1 and 2.
"""

from __future__ import annotations

import io
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fourpole.errors import TableError
from fourpole.io.formats.guard import tidy
from fourpole.io.formats.tracks import Content, OpenFile, Part, Track, track_format
from fourpole.io.layout import is_missing, number
from fourpole.io.names import numbered
from fourpole.io.source import decode
from fourpole.units import column_unit, shown

_END_OF_HEADER = re.compile(r"^\*\*\*End_of_Header\*\*\*[^\n]*(?:\n|\Z)", re.MULTILINE)
_SEGMENT = re.compile(r"^Channels(?=\W)", re.MULTILINE)
_SPECIAL = re.compile(r"\n\*\*\*Start_Special\*\*\*(?s:.*?)(?:\n\*\*\*End_Special\*\*\*[^\n]*|\Z)")
_SEPARATORS = {"tab": "\t", "comma": ",", "semicolon": ";", "space": " "}
#: Shortest and longest time step that is accepted [s].
_SHORTEST, _LONGEST = 1e-12, 1e6
_INFINITE = ("inf", "-inf", "+inf")


@dataclass(frozen=True, eq=False)
class _Channel:
    """One column of a segment, with its x values if these are written and complete."""

    name: str
    unit: str | None
    stated: int
    """The number of samples by the header."""
    start: float
    step: float
    rounding: float
    """One unit in the last digit of the step as it is written."""
    is_time: bool
    note: str
    samples: NDArray[np.float64]
    x: NDArray[np.float64] | None

    def follows(self, before: _Channel) -> bool:
        """Whether it continues in time a channel of the segment before."""
        same = (self.name, self.unit, self.step) == (before.name, before.unit, before.step)
        end = before.start + before.stated * before.step
        return same and self.is_time and self.step > 0 and abs(end - self.start) < self.step / 2

    def rate(self) -> float:
        """Samples per second, by the first and the last x value if these agree with the step within its rounding."""
        count = len(self.samples)
        if self.x is None or count < 2:
            return 1 / self.step
        found = float(self.x[-1] - self.x[0]) / (count - 1)
        if not 0 < abs(found - self.step) <= self.rounding or found <= 0:
            return 1 / self.step
        whole = round(1 / found)
        if whole and abs(1 / whole - found) * (count - 1) <= self.rounding:
            return float(whole)
        return 1 / self.step if abs(found - self.step) * (count - 1) <= self.rounding else 1 / found

    def track(self, group: str) -> Track:
        """The channel with its time base: start and step of the header if the x values agree, or else the x values."""
        count, barred = len(self.samples), ""
        if count < self.stated or not count:
            what = f"{count} of the {self.stated} samples" if self.stated else "no samples"
            barred = f"has {what} that its header states; the file is cut off"
        one = Track(self.name, self.unit, count, _part(self.samples), group=group, note=self.note, barred=barred)
        if self.is_time and self.step > 0:
            rate = self.rate()
            even = self.start + np.arange(count) / rate
            if self.x is None or np.abs(self.x - even).max(initial=0.0) < self.step / 2:
                return replace(one, rate=rate, start=self.start)
        return one if self.x is None or not self.is_time else replace(one, time=_part(self.x))


def _part(values: NDArray[np.float64]) -> Part:
    return lambda first, last: values[first:last]


def _tags(header: str, separator: str) -> dict[str, list[str]]:
    """The cells of each line of a header, by the tag that begins the line."""
    lines = (line.split(separator) for line in header.split("\n") if line.strip())
    return {cells[0].strip(): [cell.strip() for cell in cells[1:]] for cells in lines}


@dataclass(frozen=True)
class _Style:
    """How the cells of a file are written."""

    separator: str
    decimal: str
    columns: str
    """The columns with x values: one, multi (one before each channel) or no."""


def _channels(head: dict[str, list[str]], names: list[str], rows: str, style: _Style, where: str) -> list[_Channel]:
    """The channels of a segment, from its header, its line of names and its rows."""
    multi = style.columns == "multi"
    count = (head.get("Channels") or [""])[0]
    if not count.isascii() or not count.isdigit() or not 0 < int(count[:9]) < 10**6:
        raise TableError(f"{where}: has {shown(count)} as its number of channels; write the file again")
    places = range(1, 1 + (2 if multi else 1) * int(count), 2 if multi else 1)
    if places[-1] >= len(names):
        raise TableError(f"{where}: states {len(places)} channels but names {len(names)} columns; it is cut off")

    def cell(tag: str, at: int) -> str:
        cells = head.get(tag, [])
        filled = [cells[place - 1] for place in places] if len(cells) >= places[-1] else cells
        if multi and not all(filled[: len(places)]) and sum(map(bool, cells)) == len(places):
            filled = [one for one in cells if one]  # the cells stand side by side, not above their columns
        return filled[at] if at < len(filled) else ""

    table = _table(rows, len(names), style, where)
    found = []
    for at, name in enumerate(numbered([names[place] or f"channel {at + 1}" for at, place in enumerate(places)])):
        samples, step, values = cell("Samples", at), number(cell("Delta_X", at), style.decimal), table[places[at]]
        stated = int(samples[:15]) if samples.isascii() and samples.isdigit() else 0
        known = int(np.flatnonzero(np.isfinite(values)).max(initial=-1)) + 1
        known = stated if known < stated <= len(values) else known  # the last samples are stated as missing
        x = table[places[at] - 1 if multi else 0][:known] if style.columns in ("one", "multi") else None
        found.append(
            _Channel(
                name=name,
                unit=cell("Y_Unit_Label", at) or column_unit(name)[1],
                stated=stated,
                start=number(cell("X0", at), style.decimal) or 0.0,
                step=step if step is not None and _SHORTEST < step < _LONGEST else 0.0,
                rounding=_last_digit(cell("Delta_X", at)),
                is_time=cell("X_Dimension", at).lower() in ("", "time"),
                note=tidy(" ".join(filter(None, (cell("Date", at), cell("Time", at))))),
                samples=values[:known],
                x=x if x is not None and np.isfinite(x).all() else None,
            )
        )
    return found


def _last_digit(cell: str) -> float:
    """One unit in the last digit of a number as it is written; 0 if it is no number."""
    digits, _, exponent = cell.strip().replace(",", ".").upper().partition("E")
    try:
        power = int(exponent or "0") - len(digits.partition(".")[2])
    except ValueError:
        return 0.0
    return 10.0**power if -300 < power < 300 else 0.0


def _table(rows: str, width: int, style: _Style, where: str) -> list[NDArray[np.float64]]:
    """The columns of a segment without its comments; TableError at the first cell that is no number."""
    import polars as pl

    if not rows.strip():
        return [np.empty(0)] * width
    full = style.separator * (width - 1) + "\n"  # a row of all columns, since comments may be in none
    frame = pl.read_csv(
        io.BytesIO((full + rows).encode()), has_header=False, schema={str(at): pl.String() for at in range(width)},
        separator=style.separator, quote_char=None, truncate_ragged_lines=True,
    )  # fmt: skip
    columns = []
    for at, cells in enumerate(frame[1:]):
        plain = cells.str.strip_chars()
        plain = plain.str.replace(",", ".", literal=True) if style.decimal == "," else plain
        values = plain.cast(pl.Float64, strict=False)
        odd = (values.is_null() & plain.is_not_null()).arg_true()
        wrong = next((one for one in odd if not is_missing(plain[one]) and plain[one].lower() not in _INFINITE), None)
        if wrong is not None and at < width - 1:
            raise TableError(f"{where} row {wrong + 1}: {shown(cells[wrong])} is no number; mend it, or leave it blank")
        columns.append(values.fill_null(np.nan).to_numpy())
    return columns


def _grouped(segments: Sequence[list[_Channel]]) -> list[list[_Channel]]:
    """The channels of segments; those that continue each other are joined."""
    groups: list[list[_Channel]] = []
    last: list[_Channel] = []
    for segment in segments:
        if len(segment) == len(last) and all(one.follows(was) for one, was in zip(segment, last, strict=True)):
            groups[-1] = [_joined(one, more) for one, more in zip(groups[-1], segment, strict=True)]
        else:
            groups.append(segment)
        last = segment
    return groups


def _joined(one: _Channel, more: _Channel) -> _Channel:
    samples = np.concatenate([one.samples, more.samples])
    x = None if one.x is None or more.x is None else np.concatenate([one.x, more.x])
    return replace(one, samples=samples, x=x, stated=one.stated + more.stated)


def _content(opened: OpenFile) -> Content:
    """The channels of an open file."""
    name = opened.name
    text = decode(opened.file.read(), name)[0].replace("\r\n", "\n").replace("\r", "\n")
    content = _SPECIAL.sub("", text)
    first = _END_OF_HEADER.search(content)
    if first is None:
        raise TableError(f"{name}: its header has no end (***End_of_Header***); it is cut off, write it again")
    header = content[: first.start()]
    stated = re.search(r"^Separator(\W)(\w*)", header, re.MULTILINE)
    separator = _SEPARATORS.get(stated[2].lower(), stated[1]) if stated else "\t"
    tags = {key: cells[0] for key, cells in _tags(header, separator).items() if cells}
    decimal = "," if tags.get("Decimal_Separator", ".") == "," and separator != "," else "."
    style = _Style(separator, decimal, tags.get("X_Columns", "One").lower())
    segments: list[list[_Channel]] = []
    starts = [one.start() for one in _SEGMENT.finditer(content, first.end())]
    for begin, last in zip(starts, [*starts[1:], len(content)], strict=False):
        where, end = f"{name} segment {len(segments) + 1}", _END_OF_HEADER.search(content, begin, last)
        if end is None:
            raise TableError(f"{where} has no end of its header; the file is cut off")
        line, _, rows = content[end.end() : last].partition("\n")
        names = [cell.strip().strip('"') for cell in line.split(separator)]
        head = _tags(content[begin : end.start()], separator)
        segments.append(_channels(head, names, rows, style, where))
    if not segments:
        raise TableError(f"{name}: has a header but no segment of channels below it; write it again, with headers")
    groups = _grouped(segments)
    many = len(groups) > 1
    tracks = [one.track(str(at) if many else "") for at, group in enumerate(groups, 1) for one in group]
    said = ("Date", "Time", "Operator", "Description", "Project")
    notes = [tidy(f"{tag}: {tags[tag]}") for tag in said if tags.get(tag)]
    return Content(tidy(f"LabVIEW measurement {tags.get('Writer_Version', '')}".strip()), tracks, notes)


FORMAT = track_format("lvm", "LabVIEW measurement", (".lvm",), "a LabVIEW measurement file", _content)
