"""An answer on the terminal, or as the document that --json prints."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from fourpole.answer import Answer, Part, Rows, Table
from fourpole.app.console import out, print_json, print_table, say

if TYPE_CHECKING:
    import polars as pl

    from fourpole.quantities import ShownUnits


def show(answer: Answer, *, as_json: bool) -> int:
    """Print an answer, or its document and, on standard error, the files; returns its exit code."""
    if as_json:
        print_json(answer.document())
    for part in () if as_json else answer.parts:
        _print(part)
    for what, path in answer.files:
        (say if as_json else out)(f"{what}: {path}")
    for part in answer.then():
        if not as_json:
            _print(part)
    return answer.code


def _print(part: Part) -> None:
    if isinstance(part, str):
        out(part)
    elif isinstance(part, Table):
        print_table(part.heads, part.rows, right=part.right)
    else:
        _print_rows(part)


def _print_rows(rows: Rows) -> None:
    """Print rows as CSV in SI, or on a terminal as a table, each value with its uncertainty."""
    if not sys.stdout.isatty():
        out(rows.frame.write_csv().rstrip("\n"))
        return
    table = rows.table
    print_table(table.heads, table.rows, right=table.right)
    if note := rows.note:
        out(note)


def rows_answer(
    frame: pl.DataFrame, file: Path | None, units: ShownUnits, *, leave_out: Sequence[str] = (), code: int = 0
) -> Answer:
    """The answer of a command whose result is a table, which goes to `file` if it is given."""
    if file is not None:
        from fourpole.io.write import write_table

        path = file if file.suffix else file.with_suffix(".csv")
        write_table(path, frame, label=str(path))
        say(f"written: {path}")
    parts = [] if file is not None else [Rows(frame, units, leave_out)]
    return Answer(parts, lambda: {"rows": frame.to_dicts()}, code=code)
