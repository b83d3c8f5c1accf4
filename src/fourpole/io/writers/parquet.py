"""Parquet: a column of times, and names with their units in brackets."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from fourpole.io.writers.plan import Block, Group, Remarks, Writer
from fourpole.io.writers.text import columns


class _Sink:
    """Each block goes to a file of its own, and the files are joined at the end: polars cannot append to a file."""

    def __init__(self, path: Path, group: Group, heads: list[str]) -> None:
        self._path, self._group, self._heads = path, group, heads
        self._parts: list[Path] = []

    def add(self, _at: int, block: Block, /) -> None:
        import polars as pl

        part = self._path.with_name(f"{self._path.name}.{len(self._parts)}")
        pl.DataFrame(dict(zip(self._heads, block.table(self._group), strict=True))).write_parquet(part)
        self._parts.append(part)

    def finish(self) -> None:
        import polars as pl

        if len(self._parts) == 1:
            self._parts[0].rename(self._path)
        elif self._parts:
            pl.scan_parquet(self._parts, glob=False).sink_parquet(self._path, maintain_order=True)


@contextmanager
def _open(path: Path, groups: Sequence[Group], remarks: Remarks) -> Iterator[_Sink]:
    sink = _Sink(path, groups[0], columns(groups[0], remarks))
    yield sink
    sink.finish()


WRITER = Writer("parquet", "Parquet", (".parquet", ".pq"), True, _open)
