"""The command that writes a recording in another format."""

from __future__ import annotations

from pathlib import Path

from fourpole.app.console import out, progress, warn
from fourpole.io.convert import Choice, convert

__all__ = ["run_convert"]


def run_convert(file: Path, target: Path, choice: Choice) -> None:
    """Convert, say what was written, and what could not be kept."""
    with progress("converting") as advance:
        made = convert(file, target, choice, progress=advance)
    for sentence in made.lost:
        warn(sentence)
    out(f"{target}: {made.format}")
    for group in made.groups:
        out(f"  {group}")
