"""CSV: a column of times, names with their units in brackets, and numbers with all their digits."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from fourpole.io.writers.plan import Block, Group, Remarks, Writer, distinct, time_name, titled


def columns(group: Group, remarks: Remarks) -> list[str]:
    """The heads of a table's columns; the first is that of the times, if they are known."""
    remarks.no_notes(group.channels)
    heads = [titled(channel) for channel in group.channels]
    found = distinct(heads)
    remarks.renamed(heads, found)
    return [f"{time_name(group.channels)} [s]", *found] if group.timed else found


class _Sink:
    def __init__(self, file: BinaryIO, group: Group, heads: list[str]) -> None:
        self._file, self._group, self._heads, self._begun = file, group, heads, False

    def add(self, _at: int, block: Block, /) -> None:
        import polars as pl

        frame = pl.DataFrame(dict(zip(self._heads, block.table(self._group), strict=True))).fill_nan(None)
        frame.write_csv(self._file, include_header=not self._begun)
        self._begun = True


@contextmanager
def _open(path: Path, groups: Sequence[Group], remarks: Remarks) -> Iterator[_Sink]:
    with path.open("wb") as file:
        yield _Sink(file, groups[0], columns(groups[0], remarks))


WRITER = Writer("csv", "CSV", (".csv",), True, _open)
