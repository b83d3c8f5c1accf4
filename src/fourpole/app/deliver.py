"""A table of numbers to a file, to a program or to standard output."""

from __future__ import annotations

from pathlib import Path

import polars as pl

from fourpole.app.console import out, print_json, say
from fourpole.io.write import write_table


def deliver(frame: pl.DataFrame, file: Path | None, *, as_json: bool) -> None:
    """Write a table to `file` if it is given, and print it as JSON; without both, print it as CSV."""
    if file is not None:
        path = file if file.suffix else file.with_suffix(".csv")
        write_table(path, frame, label=str(path))
        say(f"written: {path}")
    if as_json:
        print_json({"rows": frame.to_dicts()})
    elif file is None:
        out(frame.write_csv().rstrip("\n"))
