"""CSV and Parquet: a column of times, names with their units in brackets, and numbers with all their digits."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from fourpole.io.writers.plan import Add, Block, Group, Remarks, Writer, distinct, time_name, titled

if TYPE_CHECKING:
    import polars as pl


def _heads(group: Group, remarks: Remarks) -> list[str]:
    """The heads of a table's columns; the first is that of the times, if they are known."""
    remarks.no_notes(group.channels)
    heads = [titled(channel) for channel in group.channels]
    found = distinct(heads)
    remarks.renamed(heads, found)
    return [f"{time_name(group.channels)} [s]", *found] if group.timed else found


def _frame(heads: Sequence[str], block: Block, group: Group) -> pl.DataFrame:
    import polars as pl

    return pl.DataFrame(dict(zip(heads, block.table(group), strict=True)))


@contextmanager
def _open_csv(path: Path, groups: Sequence[Group], remarks: Remarks) -> Iterator[Add]:
    heads = _heads(groups[0], remarks)
    with path.open("wb") as file:

        def add(_number: int, block: Block) -> None:
            frame = _frame(heads, block, groups[0]).fill_nan(None)
            frame.write_csv(file, include_header=block.first == 0)

        yield add


@contextmanager
def _open_parquet(path: Path, groups: Sequence[Group], remarks: Remarks) -> Iterator[Add]:
    """Each block goes to a file of its own, and the files are joined at the end: polars cannot append to a file."""
    import polars as pl

    heads = _heads(groups[0], remarks)
    parts: list[Path] = []

    def add(_number: int, block: Block) -> None:
        part = path.with_name(f"{path.name}.{len(parts)}")
        _frame(heads, block, groups[0]).write_parquet(part)
        parts.append(part)

    yield add
    if len(parts) == 1:
        parts[0].rename(path)
    elif parts:
        pl.scan_parquet(parts, glob=False).sink_parquet(path, maintain_order=True)


CSV = Writer("csv", "CSV", (".csv",), True, _open_csv)
PARQUET = Writer("parquet", "Parquet", (".parquet", ".pq"), True, _open_parquet)
