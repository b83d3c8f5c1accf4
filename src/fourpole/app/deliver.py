"""A table of numbers to a file, to a program, or to the terminal."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

import polars as pl

from fourpole.app.console import out, print_json, say
from fourpole.app.shown import print_rows
from fourpole.io.write import write_table
from fourpole.quantities import ShownUnits


def deliver(
    frame: pl.DataFrame, file: Path | None, units: ShownUnits, *, as_json: bool, leave_out: Sequence[str] = ()
) -> None:
    """Write a table to `file` if it is given, and print it as JSON; without both, print it.

    It is printed as CSV in SI, but on a terminal as a table in the units that people use, without some columns.
    """
    if file is not None:
        path = file if file.suffix else file.with_suffix(".csv")
        write_table(path, frame, label=str(path))
        say(f"written: {path}")
    if as_json:
        print_json({"rows": frame.to_dicts()})
    elif file is None and sys.stdout.isatty():
        print_rows(frame.to_dicts(), units, leave_out)
    elif file is None:
        out(frame.write_csv().rstrip("\n"))
