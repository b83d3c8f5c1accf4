"""The command that writes results for other tools."""

from __future__ import annotations

from pathlib import Path

from fourpole.app.console import out, warn
from fourpole.export import export_results

__all__ = ["run_export"]


def run_export(folder: Path, kind: str, file: Path | None) -> None:
    """Write one kind of file, print its path, and say what is not in it."""
    exported = export_results(folder, kind, file)
    for note in exported.notes:
        warn(note)
    out(f"{kind}: {exported.path}")
