"""A table of numbers to a file, to a program, or to the terminal with the digits that its uncertainty allows."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import polars as pl

from fourpole.app.console import out, print_json, print_table, say
from fourpole.io.write import write_table
from fourpole.quantities import ShownUnits
from fourpole.report.digits import PLUS_MINUS, cell


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


def print_rows(rows: Sequence[Mapping[str, Any]], units: ShownUnits, leave_out: Sequence[str] = ()) -> None:
    """Print rows of a result table, whose heads have SI units, each value with its uncertainty."""
    heads = [head for head in rows[0] if head not in leave_out and not head.startswith(("u(", "corr("))]
    used = [head for head in heads if any(row[head] not in (None, "") for row in rows)]
    labels = {head: _label(head, units) for head in used}
    numbers = [labels[head] for head in used if any(isinstance(row[head], float) for row in rows)]
    print_table(labels.values(), [[cell(row, head, units) for head in used] for row in rows], right=numbers)
    if any(head.startswith("u(") for head in rows[0]):
        out(PLUS_MINUS)


def _label(head: str, units: ShownUnits) -> str:
    """Head of a column with the unit shown."""
    name, _, si = head.removesuffix("]").partition(" [")
    unit, _ = units.unit(si)
    return f"{name} [{unit}]" if unit else name
