"""The peer of bench_campaign.py: polars reads recordings in two processes. python bench/read_all.py FOLDER ENDING."""

from __future__ import annotations

import multiprocessing
import sys
from pathlib import Path


def read(path: str) -> float:
    """All four columns as arrays; the sum of all values, to show that they were read."""
    import polars as pl

    table = pl.read_csv(path) if path.endswith(".csv") else pl.read_parquet(path)
    return float(sum(table[name].to_numpy().sum() for name in table.columns))


def main() -> None:
    files = sorted(map(str, Path(sys.argv[1]).glob(f"*.{sys.argv[2]}")))
    with multiprocessing.get_context("spawn").Pool(2) as pool:
        print(sum(pool.map(read, files, chunksize=8)), len(files))


if __name__ == "__main__":
    main()
