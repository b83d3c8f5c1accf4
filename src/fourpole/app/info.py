"""The command that says what a file holds."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from rich.cells import cell_len

from fourpole.app.console import OK, out, print_json, progress, table_console
from fourpole.app.outline import draws_dots, line, picture
from fourpole.io.look import ChannelSummary, look
from fourpole.io.recordings import chosen_of, survey
from fourpole.io.signals import FileInfo, SignalInfo

__all__ = ["Wanted", "run_info"]

#: Channels whose samples are read unless some are named.
_MOST = 64
_LONGEST_NAME, _LEAST_PLOT, _MOST_PLOT = 28, 8, 48
_NUMBER = 11
_HEIGHT = 10


@dataclass(frozen=True)
class Wanted:
    """What is to be shown of a file.

    Attributes
    ----------
    channel, group : str
        Only this one; empty: all.
    quick : bool
        Without reading samples.
    plot : bool
        With outlines.
    """

    channel: str = ""
    group: str = ""
    quick: bool = False
    plot: bool = True


@dataclass(frozen=True)
class _Row:
    """A channel, and what its samples show; a text where they could not be read."""

    info: SignalInfo
    seen: ChannelSummary | str | None

    @property
    def base(self) -> tuple[object, ...]:
        """Group and times, which channels share."""
        one, seen = self.info, self.seen
        if isinstance(seen, ChannelSummary):
            return one.group, seen.count, seen.rate, seen.start, seen.duration, seen.clock, seen.jumps, seen.stops
        return one.group, one.count, one.rate, one.start, one.duration


def run_info(file: Path, wanted: Wanted, *, as_json: bool) -> int:
    """Format, channels, units, rates and durations of a file, and what its samples show."""
    found = survey(file)
    shown = chosen_of(found, wanted.group, [wanted.channel] if wanted.channel else [], file.name)
    some = shown if wanted.channel or wanted.group else shown[:_MOST]
    seen: dict[int, ChannelSummary | str] = {}
    if not wanted.quick:
        with progress("reading") as advance:
            seen = look(file, found, some, label=file.name, progress=advance)
    rows = [_Row(found.signals[at], seen.get(at)) for at in shown]
    if as_json:
        print_json(
            {"file": file.name, "format": found.format, "notes": found.notes, "signals": [_plain(row) for row in rows]}
        )
        return OK
    _print_head(file, found)
    _print_rows(rows, wanted)
    if len(some) < len(shown) and not wanted.quick:
        out(f"\nread were the first {len(some)} of {len(shown)} channels; name others with --group or --channel")
    return OK


def _plain(row: _Row) -> dict[str, Any]:
    """A channel for programs; what the samples showed of its times counts."""
    document: dict[str, Any] = asdict(row.info)
    if isinstance(row.seen, str):
        return document | {"unreadable": row.seen}
    if row.seen is None:
        return document
    found = asdict(row.seen)
    del found["outline"]
    if found["rate"] is None:
        found["rate"] = document["rate"] if not (found["jumps"] or found["stops"]) else None
    for key in ("start", "duration"):
        found[key] = document[key] if found[key] is None else found[key]
    return document | found


def _print_head(file: Path, found: FileInfo) -> None:
    out(f"{file.name}: {found.format}")
    for note in found.notes:
        out(f"  {note}")


def _print_rows(rows: Sequence[_Row], wanted: Wanted) -> None:
    """Channels that share their times together, below a line that says them."""
    width = table_console().width
    if not rows:
        out("  no channels")
    longest = max((cell_len(row.info.name) for row in rows), default=0)
    table = _Layout(
        name=min(max(longest, len("channel")), _LONGEST_NAME),
        unit=max([len("unit"), *(cell_len(row.info.unit or "") for row in rows)]),
        width=width,
        plot=wanted.plot and not wanted.channel and not wanted.quick,
        dots=draws_dots(),
    )
    last: object = None
    for row in rows:
        if row.base != last:
            alike = [one for one in rows if one.base == row.base]
            note = row.info.note if len(alike) > 1 and len({one.info.note for one in alike}) == 1 else ""
            out()
            for text in _times(row):
                out(text)
            if note:
                out(f"each: {note}")
            out(table.head(quick=not isinstance(row.seen, ChannelSummary)))
            last = row.base
        for text in table.lines(row, note=row.info.note != note):
            out(text)
        if wanted.channel and wanted.plot and isinstance(row.seen, ChannelSummary):
            for text in _picture(row, row.seen, width, dots=table.dots):
                out(text)


def _times(row: _Row) -> Iterator[str]:
    """What the channels below share."""
    one, seen = row.info, row.seen
    rate, start, duration = one.rate, one.start, one.duration
    count, clock = one.count, ""
    if isinstance(seen, ChannelSummary):
        count, clock = seen.count, f", times from {seen.clock}" if seen.clock else ""
        rate = seen.rate or (None if seen.clock or seen.jumps or seen.stops else rate)
        start = start if seen.start is None else seen.start
        duration = duration if seen.duration is None else seen.duration
    text = f"{one.group}: {count} samples" if one.group else f"{count} samples"
    if rate:
        text += f" at {rate:.10g} Hz"
    elif start is not None:
        text += " at uneven times" if isinstance(seen, ChannelSummary) else " at times of their own"
    if start is not None and duration is not None:
        text += f", {start:.6g} to {start + duration:.6g} s"
    if start is None:
        known = isinstance(seen, ChannelSummary)
        text += ", without times: state sample_rate or a column of times in campaign.toml" if known else ""
    yield text + clock
    if isinstance(seen, ChannelSummary) and seen.jumps:
        many = "jumps once" if seen.jumps == 1 else f"jumps {seen.jumps} times"
        yield f"  ! the time {many}; the longest step is {seen.longest_step:.4g} s"
    if isinstance(seen, ChannelSummary) and seen.stops:
        yield f"  ! the time repeats itself or goes back {'once' if seen.stops == 1 else f'{seen.stops} times'}"


@dataclass(frozen=True)
class _Layout:
    """Where the columns are."""

    name: int
    unit: int
    width: int
    plot: bool
    dots: bool

    @property
    def _room(self) -> int:
        """Signs left for an outline."""
        return max(_LEAST_PLOT, min(_MOST_PLOT, self.width - 2 - self.name - 2 - self.unit - 4 * _NUMBER - 2))

    def head(self, *, quick: bool) -> str:
        first = f"  {'channel':{self.name}}  {'unit':{self.unit}}"
        if quick:
            return first.rstrip()
        return first + "".join(f"{one:>{_NUMBER}}" for one in ("least", "greatest", "std", "line [Hz]"))

    def lines(self, row: _Row, *, note: bool) -> Iterator[str]:
        """A channel, and below it what is to be said of it."""
        one, seen = row.info, row.seen
        first = f"  {_padded(one.name, self.name)}  {_padded(one.unit or '', self.unit)}"
        if isinstance(seen, ChannelSummary):
            if cell_len(one.name) > self.name:
                yield f"  {one.name}"
                first = f"  {'':{self.name}}  {_padded(one.unit or '', self.unit)}"
            line_at = "" if seen.frequency is None else f"{seen.frequency:.5g}"
            cells = [*(_digits(value) for value in (seen.least, seen.greatest, seen.std)), line_at]
            first += "".join(f"{cell:>{_NUMBER}}" for cell in cells)
            if self.plot:
                first += "  " + line(seen.outline, self._room, dots=self.dots)
        yield first.rstrip()
        if note and one.note and not (isinstance(seen, ChannelSummary) and one.note == f"time from {seen.clock}"):
            yield f"    {one.note}"
        if isinstance(seen, str):
            yield f"    ! not read: {seen}"
        if isinstance(seen, ChannelSummary) and seen.missing:
            some = f"{seen.missing} of {seen.count} samples are missing, at most {seen.longest_gap} in a row"
            yield f"    ! {some if seen.missing < seen.count else 'all samples are missing'}"


def _padded(text: str, width: int) -> str:
    return text + " " * (width - cell_len(text))


def _digits(value: float) -> str:
    return "" if math.isnan(value) else f"{value:.5g}"


def _picture(row: _Row, seen: ChannelSummary, width: int, *, dots: bool) -> Iterator[str]:
    """One channel large, with its limits."""
    unit = f" {row.info.unit}" if row.info.unit else ""
    labels = [f"{_digits(value)}{unit}" for value in (seen.greatest, seen.least)]
    margin = max(cell_len(label) for label in labels)
    drawn = picture(seen.outline, max(_LEAST_PLOT, width - margin - 4), _HEIGHT, dots=dots)
    bar = "│" if dots else "|"
    yield ""
    for at, text in enumerate(drawn):
        label = labels[0] if at == 0 else labels[1] if at == len(drawn) - 1 else ""
        yield f"  {_padded(label, margin)} {bar}{text}"
    if seen.start is not None and seen.duration is not None:
        ends = f"{seen.start:.6g} s", f"{seen.start + seen.duration:.6g} s"
    else:
        ends = "sample 1", f"sample {seen.count}"
    yield f"  {'':{margin}}  {ends[0]}{ends[1]:>{max(1, width - margin - 4 - len(ends[0]))}}"
