"""The commands on files: convert, and info, which shows outlines as braille dots or as ASCII signs."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass
from functools import cached_property
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.cells import cell_len

from fourpole import quantities as q
from fourpole.answer import Answer, Part, Table
from fourpole.app.console import more, progress, rising, table_width, warn
from fourpole.app.options import InfoOptions
from fourpole.core.digits import number
from fourpole.core.segments import Segment, labelled
from fourpole.errors import TableError, UnitError
from fourpole.fitting.document import FORMAT
from fourpole.guess.gather import segments_in
from fourpole.io.child import read_apart
from fourpole.io.convert import Choice, convert
from fourpole.io.door import open_regular
from fourpole.io.look import ChannelSummary, look_at
from fourpole.io.recordings import chosen_of, survey
from fourpole.io.signals import HEAD_BYTES, MAX_FILE_BYTES, FileInfo, SignalInfo
from fourpole.io.tables.kstar import ALL, KStarTable, TableOptions, read_k_star
from fourpole.io.tables.pair import CurveTable, TimeTable, read_curve, read_over_time

#: Number of channels whose samples are read if no channel and no group is named.
_MOST = 64
_LONGEST_NAME, _LEAST_PLOT, _MOST_PLOT = 28, 8, 48
_NUMBER = 11
_HEIGHT = 10
#: The sign of each kind of segment, and most signs of a drawing.
_SIGNS = {"rest": "_", "hold": "-", "ramp": "/", "loop": "^", "sine": "~", "sweep": ">", "random": "#"}
_MOST_DRAWN = 100
#: Rows of the longest table of K* or of load and deflection.
_MOST_ROWS = 20_000


@dataclass(frozen=True)
class _Row:
    """A channel as its file states it, the summary of its samples, and the reason if they cannot be read."""

    info: SignalInfo
    summary: ChannelSummary | None
    unreadable: str = ""

    @cached_property
    def times(self) -> tuple[int, float | None, float | None, float | None]:
        """Count, rate [Hz], start and duration [s]; what the samples show replaces what the file states."""
        one, found = self.info, self.summary
        if found is None:
            return one.count, one.rate, one.start, one.duration
        uneven = found.clock or found.jumps or found.stops
        rate = found.rate if found.rate or uneven else one.rate
        start = one.start if found.start is None else found.start
        return found.count, rate, start, one.duration if found.duration is None else found.duration

    @property
    def base(self) -> tuple[object, ...]:
        """Group and times; channels that share them are listed together."""
        found = self.summary
        return self.info.group, self.times, found and (found.clock, found.jumps, found.stops)

    def time_lines(self) -> Iterator[str]:
        """The times in words, and what is wrong with them."""
        found = self.summary
        count, rate, start, duration = self.times
        text = f"{self.info.group}: {count} samples" if self.info.group else f"{count} samples"
        if rate:
            text += f" at {rate:.10g} Hz"
        elif start is not None:
            text += " at uneven times" if found else " at times of their own"
        if start is not None and duration is not None:
            text += f", {start:.6g} to {start + duration:.6g} s"
        if found and start is None:
            text += ", without times: state sample_rate or a column of times in campaign.toml"
        yield text + (f", times from {found.clock}" if found and found.clock else "")
        if found:
            yield from _time_faults(found)


def _time_faults(found: ChannelSummary) -> Iterator[str]:
    """Lines about times that do not rise evenly."""
    if found.jumps:
        many = "once" if found.jumps == 1 else f"{found.jumps} times"
        yield f"  ! the time jumps {many}; the longest step is {found.longest_step:.4g} s"
    if found.stops:
        yield f"  ! the time repeats itself or goes back {'once' if found.stops == 1 else f'{found.stops} times'}"


def run_info(file: Path, options: InfoOptions) -> Answer:
    """Format, channels, units and times of a file, and a summary of the samples of each channel; what a model holds."""
    if file.suffix.lower() == ".json" and _is_model(file):
        from fourpole.app.verify import run_verify

        return run_verify(file)
    found: FileInfo = read_apart(survey, file, classes=(FileInfo, SignalInfo))
    shown = chosen_of(found, options.group, [options.channel] if options.channel else [], file.name)
    some = shown if options.channel or options.group else shown[:_MOST]
    seen: dict[int, ChannelSummary | str] = {}
    if not options.quick:
        with progress("reading") as advance:
            seen = read_apart(look_at, file, found, some, classes=(ChannelSummary,), progress=advance)
    motion = None if options.quick or options.channel else segments_in(file)
    rows = []
    for at in shown:
        one = seen.get(at)
        rows.append(_Row(found.signals[at], *((None, one) if isinstance(one, str) else (one,))))
    head = {"file": file.name, "format": found.format, "notes": found.notes}
    read = len(shown) if options.quick else len(some)
    whole = not (options.quick or options.channel or options.group)
    table = _table_in(file) if whole and not _is_long(found) else []
    parts = (*_shown(file, found, rows, options, read), *(_motion(*motion) if motion is not None else ()), *table)

    def document() -> dict[str, Any]:
        several = {} if motion is None else {"segments": [{"channel": motion[0], **asdict(one)} for one in motion[2]]}
        return {**head, "signals": [_plain(row) for row in rows], **several, **({"table": table} if table else {})}

    return Answer(parts, document)


def _is_long(found: FileInfo) -> bool:
    """Whether a file has the samples of a recording rather than the rows of a table."""
    return max((one.count for one in found.signals), default=0) > _MOST_ROWS


def _table_in(file: Path) -> list[str]:
    """What a table of K*, of relaxation, or of load and deflection says, by its columns; empty if it is none."""
    options = TableOptions(group=ALL, moduli=True, ratio=True, rig=True)
    tables: dict[str, Callable[[], KStarTable | TimeTable | CurveTable | None]] = {
        "K* over frequency, for fourpole identify, fit and shift": lambda: read_k_star(file, options),
        "relaxation or creep, for fourpole fit": lambda: read_over_time(file, TableOptions(factor=1.0)),
        "load and deflection, for fourpole static": lambda: read_curve(file),
    }
    no_shape = ("times the modulus", "takes the place")
    for name, read in tables.items():
        with suppress(TableError, UnitError):
            if (found := read()) is not None:
                said = [f"  {line}" for line in found.understood if not any(one in line for one in no_shape)]
                return [f"\na table of {name}:", *said]
    return []


def _is_model(file: Path) -> bool:
    """Whether a file begins as a model file does."""
    with open_regular(file, max_bytes=MAX_FILE_BYTES) as opened:
        return f'"{FORMAT}"'.encode() in opened.read(HEAD_BYTES)


def _motion(channel: str, unit: str, segments: Sequence[Segment]) -> Iterator[Part]:
    """What a recording does one after the other, drawn along its time, and as a table."""
    end, width = segments[-1].end, min(table_width(), _MOST_DRAWN)
    edges = segments[0].start + (end - segments[0].start) * (np.arange(width) + 0.5) / width
    drawn = [next((_SIGNS[one.kind] for one in segments if one.start <= at <= one.end), " ") for at in edges]
    signs = ", ".join(f"{_SIGNS[kind]} {kind}" for kind in dict.fromkeys(one.kind for one in segments))
    yield f"\nsegments of {channel!r} ({signs}):\n{''.join(drawn)}"
    heads = ["segment", "from [s]", "to [s]", q.FREQUENCY.label, f"amplitude [{unit}]", f"mean [{unit}]"]
    rows = []
    for label, one in labelled(segments[:_MOST]):
        cycles = (number(one.frequency), number(one.amplitude)) if one.frequency else ("", "")
        rows.append([label, number(one.start), number(one.end), *cycles, number(one.mean)])
    yield Table(heads, rows, heads[1:])
    yield from more(segments, _MOST)


def run_convert(
    file: Path, target: Path, group: str = "", channels: str = "", window: str = "", kind: str = "", force: bool = False
) -> Answer:
    """Write a recording in another format."""
    names = tuple(name.strip() for name in channels.split(",") if name.strip())
    limits = rising(window, "--window", "2..12") if window else None
    with progress("converting") as advance:
        made = convert(file, target, Choice(group, names, limits, kind, force), progress=advance)
    warn(*made.lost)
    return Answer(
        ["\n  ".join([f"{target}: {made.format}", *made.groups])], lambda: {"file": str(target), **asdict(made)}
    )


def _shown(file: Path, found: FileInfo, rows: Sequence[_Row], options: InfoOptions, read: int) -> Iterator[Part]:
    """The file, its channels, and how many of them were read."""
    yield f"{file.name}: {found.format}"
    yield from (f"  {note}" for note in found.notes)
    yield from _print_rows(rows, options)
    if read < len(rows):
        yield f"\nonly the first {read} of {len(rows)} channels were read; name others with --group or --channel"


def _plain(row: _Row) -> dict[str, Any]:
    """A channel for programs; what the samples show of its times replaces what the file states."""
    document: dict[str, Any] = asdict(row.info)
    if row.unreadable:
        return document | {"unreadable": row.unreadable}
    if row.summary is None:
        return document
    document |= asdict(row.summary)
    del document["outline"]
    return document | dict(zip(("count", "rate", "start", "duration"), row.times, strict=True))


def _print_rows(rows: Sequence[_Row], options: InfoOptions) -> Iterator[Part]:
    """The channels, those with equal times together below a line with these times."""
    if not rows:
        yield "  no channels"
    plot = not (options.no_plot or options.quick)
    layout = _Layout(
        name=min(max([len("channel"), *(cell_len(row.info.name) for row in rows)]), _LONGEST_NAME),
        unit=max([len("unit"), *(cell_len(row.info.unit or "") for row in rows)]),
        width=table_width(),
        plot=plot and not options.channel,
        large=plot and bool(options.channel),
        dots=draws_dots(),
    )
    for _, members in groupby(rows, key=lambda row: row.base):
        yield from _print_group(list(members), layout)


def _print_group(rows: Sequence[_Row], layout: _Layout) -> Iterator[Part]:
    """Channels with equal times; a note that all of them have is printed once."""
    notes = {row.info.note for row in rows}
    shared = rows[0].info.note if len(rows) > 1 and len(notes) == 1 else ""
    yield ""
    yield from rows[0].time_lines()
    if shared:
        yield f"each: {shared}"
    yield layout.head(quick=rows[0].summary is None)
    for row in rows:
        yield from layout.lines(row, note=row.info.note != shared)
        yield from _picture(row, layout.width, dots=layout.dots) if layout.large else ()


@dataclass(frozen=True)
class _Layout:
    """Widths of the columns in characters."""

    name: int
    unit: int
    width: int
    plot: bool
    large: bool
    dots: bool

    def head(self, *, quick: bool) -> str:
        first = f"  {'channel':{self.name}}  {'unit':{self.unit}}"
        if quick:
            return first.rstrip()
        return first + "".join(f"{one:>{_NUMBER}}" for one in ("least", "greatest", "std", "line [Hz]"))

    def lines(self, row: _Row, *, note: bool) -> Iterator[str]:
        """A channel, and below it its note and what is wrong with its samples."""
        one, found = row.info, row.summary
        name = one.name
        if found and cell_len(name) > self.name:
            yield f"  {name}"
            name = ""
        first = f"  {_padded(name, self.name)}  {_padded(one.unit or '', self.unit)}"
        yield (first + self._numbers(found) if found else first).rstrip()
        if note and one.note and not (found and one.note == f"time from {found.clock}"):
            yield f"    {one.note}"
        if row.unreadable:
            yield f"    ! not read: {row.unreadable}"
        if found and found.missing:
            some = f"{found.missing} of {found.count} samples are missing, at most {found.longest_gap} in a row"
            yield f"    ! {some if found.missing < found.count else 'all samples are missing'}"

    def _numbers(self, found: ChannelSummary) -> str:
        line_at = "" if found.frequency is None else f"{found.frequency:.5g}"
        cells = (*(_digits(value) for value in (found.least, found.greatest, found.std)), line_at)
        room = max(_LEAST_PLOT, min(_MOST_PLOT, self.width - 2 - self.name - 2 - self.unit - 4 * _NUMBER - 2))
        outline = f"  {line(found.outline, room, dots=self.dots)}" if self.plot else ""
        return "".join(f"{cell:>{_NUMBER}}" for cell in cells) + outline


def _padded(text: str, width: int) -> str:
    return text + " " * (width - cell_len(text))


def _digits(value: float) -> str:
    return "" if math.isnan(value) else f"{value:.5g}"


def _picture(row: _Row, width: int, *, dots: bool) -> Iterator[str]:
    """Lines of a large outline of one channel, with the limits of its values and times."""
    found = row.summary
    if found is None:
        return
    unit = f" {row.info.unit}" if row.info.unit else ""
    greatest, least = (f"{_digits(value)}{unit}" for value in (found.greatest, found.least))
    margin = max(cell_len(greatest), cell_len(least))
    room = max(1, width - margin - 4)
    labels = [greatest, *[""] * (_HEIGHT - 2), least]
    bar = "│" if dots else "|"
    yield ""
    for label, text in zip(labels, picture(found.outline, max(_LEAST_PLOT, room), _HEIGHT, dots=dots), strict=True):
        yield f"  {_padded(label, margin)} {bar}{text}"
    ends = "sample 1", f"sample {found.count}"
    if found.start is not None and found.duration is not None:
        ends = f"{found.start:.6g} s", f"{found.start + found.duration:.6g} s"
    yield f"  {'':{margin}}  {ends[0]}{ends[1]:>{max(1, room - len(ends[0]))}}"


FloatArray = NDArray[np.float64]

_BRAILLE = 0x2800
#: Bit of each dot of a braille sign, by row from the top and by column.
_DOTS = ((0x01, 0x08), (0x02, 0x10), (0x04, 0x20), (0x40, 0x80))
#: ASCII sign for an outline, by the lowest and the highest third of the line that it touches.
_THIRDS = {(0, 0): "_", (0, 1): ",", (0, 2): "|", (1, 1): "-", (1, 2): "'", (2, 2): '"'}


def draws_dots() -> bool:
    """Whether the encoding of standard output has braille signs."""
    try:
        chr(_BRAILLE + 1).encode(getattr(sys.stdout, "encoding", None) or "utf-8")
    except (UnicodeEncodeError, LookupError):
        return False
    return True


def line(outline: FloatArray, width: int, *, dots: bool) -> str:
    """One line of signs for the least and greatest values (places, 2) along a recording."""
    if dots:
        return picture(outline, width, 1, dots=True)[0]
    levels = _levels(_resampled(outline, width), 3)
    return "".join(" " if low < 0 else _THIRDS[int(low), int(high)] for low, high in levels).rstrip()


def picture(outline: FloatArray, width: int, height: int, *, dots: bool) -> list[str]:
    """Several lines of signs for an outline (places, 2), with the greatest value at the top."""
    across, down = (2, 4) if dots else (1, 1)
    levels = _levels(_resampled(outline, width * across), height * down)
    grid = np.zeros((height * down, width * across), dtype=bool)
    for column, (low, high) in enumerate(levels):
        if low >= 0:
            grid[height * down - 1 - high : height * down - low, column] = True
    if not dots:
        return ["".join("#" if dot else " " for dot in row).rstrip() for row in grid]
    bits = np.zeros((height, width), dtype=int)
    for row, signs in enumerate(_DOTS):
        for column, bit in enumerate(signs):
            bits |= bit * grid[row::4, column::2]
    # A blank is the empty braille sign, because a space may have another width.
    return ["".join(chr(_BRAILLE + one) for one in row) for row in bits]


def _resampled(outline: FloatArray, places: int) -> FloatArray:
    """The outline (places, 2) at another number of places; values of a short outline are repeated."""
    edges = np.arange(places) * len(outline) // places
    if len(outline) < places:
        return outline[edges]
    return np.stack([np.fmin.reduceat(outline[:, 0], edges), np.fmax.reduceat(outline[:, 1], edges)], axis=1)


def _levels(outline: FloatArray, levels: int) -> NDArray[np.int64]:
    """Lowest and highest level (places, 2) of each place; -1 at a place without a value."""
    known = np.isfinite(outline)
    if not known.any():
        return np.full(outline.shape, -1)
    bottom, top = outline[known].min(), outline[known].max()
    span = top - bottom
    share = (outline - bottom) / span if np.isfinite(span) and span > 0 else np.where(known, 0.5, np.nan)
    found = np.minimum(np.floor(np.where(known, share, 0.0) * levels), levels - 1).astype(np.int64)
    return np.where(known, found, -1)
