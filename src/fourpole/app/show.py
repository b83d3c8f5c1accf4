"""An answer on the terminal, or as the document that --json prints."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from fourpole.answer import Answer, Part, Rows, Table
from fourpole.app import events
from fourpole.app.console import out, print_json, print_table, say, table_width

if TYPE_CHECKING:
    import polars as pl

    from fourpole.quantities import ShownUnits

#: Blanks between two columns of a table with remarks.
_GAP = 2


def show(answer: Answer, *, as_json: bool) -> int:
    """Print an answer, or its document and, on standard error, the files; returns its exit code."""
    if as_json:
        print_json(answer.document())
    if events.wanted(answer=True):
        events.tell(answer=answer.plain())
    for part in () if as_json else answer.shown:
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
    elif isinstance(part, Table) and part.remarks:
        _print_remarked(part)
    elif isinstance(part, Table):
        print_table(part.heads, part.rows, right=part.right)
    else:
        _print_rows(part)


def _print_remarked(table: Table) -> None:
    """Print a table with the remark of each row below it, or, where that is too wide, as one more column."""
    heads, rows = list(table.heads), [[str(cell) for cell in row] for row in table.rows]
    full = [row for row in rows if len(row) > 1]
    widths = [max(map(len, column)) for column in zip(heads, *full, strict=True)]
    if sum(widths) + _GAP * (len(widths) - 1) > table_width():
        print_table([*heads, table.remark], [[*row, said] for row, said in zip(full, table.remarks, strict=True)])
        return
    remarks = iter(table.remarks)
    out(_line(heads, widths))
    for row in rows:
        out(_line(row, widths) if len(row) > 1 else f"\n{row[0]}")
        if len(row) > 1:
            out(f"    {next(remarks)}")
    out()


def _line(cells: Sequence[str], widths: Sequence[int]) -> str:
    first, *others = (
        cell.rjust(width) if at else cell.ljust(width)
        for at, (cell, width) in enumerate(zip(cells, widths, strict=True))
    )
    return (" " * _GAP).join([first, *others]).rstrip()


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
