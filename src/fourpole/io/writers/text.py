"""CSV: a column of times, names with their units in brackets, all digits."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from fourpole.io.writers.plan import Block, Group, Told, Writer, distinct, time_name, titled

__all__ = ["WRITER", "columns"]


def columns(group: Group, told: Told) -> list[str]:
    """The heads of a table's columns, that of the times first where they are known."""
    told.no_notes(group.tracks)
    heads = [titled(track) for track in group.tracks]
    found = distinct(heads)
    told.renamed(heads, found)
    return [f"{time_name(group.tracks)} [s]", *found] if group.timed else found


class _Sink:
    def __init__(self, file: BinaryIO, group: Group, heads: list[str]) -> None:
        self._file, self._group, self._heads, self._begun = file, group, heads, False

    def add(self, _at: int, block: Block, /) -> None:
        import polars as pl

        times = block.times(self._group)
        cells = block.columns if times is None else [times, *block.columns]
        frame = pl.DataFrame(dict(zip(self._heads, cells, strict=True))).fill_nan(None)
        frame.write_csv(self._file, include_header=not self._begun)
        self._begun = True


@contextmanager
def _open(path: Path, groups: Sequence[Group], told: Told) -> Iterator[_Sink]:
    with path.open("wb") as file:
        yield _Sink(file, groups[0], columns(groups[0], told))


WRITER = Writer("csv", "CSV", (".csv",), True, _open)
