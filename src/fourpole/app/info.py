"""The command that says what a file holds."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

from rich import box
from rich.table import Table
from rich.text import Text

from fourpole.app.console import OK, harmless, out, print_json, table_console
from fourpole.io.recordings import survey

__all__ = ["run_info"]


def run_info(file: Path, *, as_json: bool) -> int:
    """Format, channels, units, rates and durations of a file."""
    found = survey(file)
    if as_json:
        print_json({"file": file.name, **asdict(found)})
        return OK
    out(f"{file.name}: {found.format}")
    for note in found.notes:
        out(f"  {note}")
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, show_edge=False)
    groups = any(signal.group for signal in found.signals)
    for head in (*(["group"] if groups else []), "channel", "unit", "samples", "rate [Hz]", "start [s]", "length [s]"):
        table.add_column(Text(head), justify="left" if head in ("group", "channel", "unit") else "right")
    table.add_column("note", overflow="fold")
    for signal in found.signals:
        numbers = (signal.rate, signal.start, signal.duration)
        cells = [signal.name, signal.unit or "", str(signal.count), *("" if x is None else f"{x:.6g}" for x in numbers)]
        texts = [*([signal.group] if groups else []), *cells, signal.note]
        table.add_row(*(Text(harmless(text)) for text in texts))
    table_console().print(table)
    return OK
