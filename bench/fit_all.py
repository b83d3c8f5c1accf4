"""A laboratory's script, the peer of bench_campaign.py: python bench/fit_all.py FOLDER ENDING.

polars reads each recording, and IEEE 1057 fits four parameters to each channel from the largest line of V1, in a pool
of two processes. It knows no rig, no hum, no harmonics, no doubt of a recording, and no K*.
"""

from __future__ import annotations

import multiprocessing
import sys
from pathlib import Path


def fit(path: str) -> list[complex]:
    """Amplitudes of F1, V1 and V2 in the middle of the recording."""
    import numpy as np
    import polars as pl
    from ieee_1057 import ieee_1057

    table = pl.read_csv(path) if path.endswith(".csv") else pl.read_parquet(path)
    time, *signals = table.to_numpy().T
    rate, time = (time.size - 1) / (time[-1] - time[0]), time - time.mean()
    line = int(np.argmax(np.abs(np.fft.rfft(signals[1] - signals[1].mean()))))
    return [ieee_1057(time, samples, 2 * np.pi * rate * line / time.size)[0] for samples in signals]


def main() -> None:
    files = sorted(map(str, Path(sys.argv[1]).glob(f"*.{sys.argv[2]}")))
    with multiprocessing.get_context("spawn").Pool(2) as pool:
        print(len(pool.map(fit, files, chunksize=8)))


if __name__ == "__main__":
    main()
