"""Tables of text: the header has the names of the channels; the lines above it may state a rate."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from pathlib import Path

from fourpole.errors import FourpoleError
from fourpole.io.columns import column_blocks, read_columns, survey_columns
from fourpole.io.formats.guard import afford, seconds, tidy
from fourpole.io.layout import number
from fourpole.io.names import in_group, numbered
from fourpole.io.signals import MAX_FILE_BYTES, FileInfo, Format, Request, Signal, SignalInfo
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
_CATMAN_RATE = re.compile(r"[0-9.,]+ m?s \((?P<value>[0-9]+(?:[.,][0-9]+)?)\s?(?P<after>k?Hz)\)")
#: Lowest and highest rate that is accepted [Hz].
_LOWEST, _HIGHEST = 1e-6, 1e12
_MOST_NOTES = 20
#: Control characters that no text has.
_CONTROLS = bytes([*range(9), *range(14, 26)])
#: Memory of a number [byte].
_NUMBER_SIZE = 8


def _recognises(head: bytes) -> bool:
    """Whether the first bytes are text of any kind: other formats are tried before this one."""
    if head.startswith((b"\xff\xfe", b"\xfe\xff")):
        return True
    return bool(head.strip()) and len(head.translate(None, _CONTROLS)) == len(head)


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
    found = survey_columns(path, max_bytes=max(max_bytes, MAX_FILE_BYTES), label=label)
    rate, layout = _rate(found.above), found.layout
    signals = []
    for index, name in enumerate(numbered([column_unit(one)[0] for one in layout.names])):
        is_clock = index in layout.clocks
        unit, note = ("s", "times of day, read as seconds from the first") if is_clock else (layout.units[index], "")
        if column_unit(layout.names[index])[0]:
            signals.append(SignalInfo.timed(name, unit, "", found.rows, rate=rate, note=note))
    notes = [tidy(line) for line in found.above[: layout.header_line - 1] if line.strip()]
    if len(notes) > _MOST_NOTES:
        notes = [*notes[: _MOST_NOTES - 1], f"{len(notes) - _MOST_NOTES + 1} more lines"]
    between = {"\t": "tabs", " ": "blanks", ",": "commas", ";": "semicolons"}[layout.delimiter]
    decimal = ", decimal commas" if layout.decimal == "," else ""
    return FileInfo(f"text in {found.encoding}, {between} between the cells{decimal}", tuple(signals), tuple(notes))


def _read(request: Request) -> Sequence[Signal]:
    in_group([], request.group, request.label)
    most, count = request.max_file_bytes, max(len(request.names), 1)
    # A cell has one byte at least, so that a short file needs no count of its rows.
    if _NUMBER_SIZE * request.path.stat().st_size > request.max_bytes:
        rows = survey_columns(request.path, max_bytes=most, label=request.label).rows
        afford(_NUMBER_SIZE * rows * count, request.max_bytes, request.label)
    columns = read_columns(request.path, request.names, max_bytes=most, label=request.label)
    rate = _rate(columns.above)
    return [Signal(one, columns.units[one], columns[one], rate=rate) for one in request.names]


def _blocks(request: Request, rows: int) -> Iterator[Sequence[Signal]]:
    in_group([], request.group, request.label)
    done = 0
    for block in column_blocks(
        request.path, request.names, rows, max_bytes=request.max_file_bytes, label=request.label
    ):
        rate = _rate(block.above)
        start = done / rate if rate else 0.0
        yield [Signal(one, block.units[one], block[one], start, rate) for one in request.names]
        done += len(block)


_ENDINGS = (".csv", ".txt", ".asc", ".dat", ".tsv", ".prn")
FORMAT = Format("text", _ENDINGS, _recognises, _survey, _read, blocks=_blocks)
