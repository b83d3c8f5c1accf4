"""Memory for one recording of 1 GB, as CSV and as Parquet: python bench/bench_memory.py."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
import polars as pl
from promises import FOURPOLE, Kept, at_most, report, run
from recordings import amplitudes_at, make_campaign

#: Samples of each of four columns: 1 GB of Parquet without compression, and some more of CSV.
SAMPLES, RATE, FREQUENCY, CHUNK = 32_000_000, 100_000.0, 13.0137, 1_000_000
#: Foreign lines [Hz] and their size relative to the fundamental; noise.
LINES, SIZE, NOISE = (50.0, 100.0, 150.0, 37.3), 0.02, 0.01
MEMORY = 500.0  # MB
ERROR = 1e-4


def write_csv(path: Path, rng: np.random.Generator) -> None:
    """The recording, written in pieces."""
    amplitudes = amplitudes_at(np.array([FREQUENCY]))[0]
    with path.open("wb") as file:
        for start in range(0, SAMPLES, CHUNK):
            t = np.arange(start, start + CHUNK) / RATE
            lines = sum(SIZE * np.sin(2 * np.pi * line * t + line) for line in LINES)
            columns = {"t": t}
            for name, one in zip(("F1", "V1", "V2"), amplitudes, strict=True):
                wave = (one * np.exp(2j * np.pi * FREQUENCY * t)).real
                columns[name] = wave + abs(one) * (lines + NOISE * rng.standard_normal(t.size))
            table = pl.DataFrame(columns).with_columns(pl.col("F1").round(4), pl.col("V1", "V2").round(7))
            table.write_csv(file, include_header=start == 0)


def measure(folder: Path, ending: str) -> Kept:
    """Memory of the analysis of that recording alone."""
    used = run([*FOURPOLE, "analyse", str(folder), "--tables-only"], codes=(0, 3))
    found = pl.read_parquet(folder / "results" / "phasors.parquet")
    wanted = abs(amplitudes_at(np.array([FREQUENCY]))[0, 1])
    v1 = abs(complex(found["Re V1 [m/s]"][0], found["Im V1 [m/s]"][0]))
    if not abs(v1 / wanted - 1) < ERROR:
        raise SystemExit(f"{ending}: V1 is {v1:.6g} m/s, not {wanted:.6g}")
    size = (folder / "recordings" / f"D0.{ending}").stat().st_size / 1e9
    detail = f"{size:.2f} GB, {SAMPLES / 1e6:.0f} million samples a channel, {used.wall:.0f} s"
    work = f"one recording of 1 GB, {ending}, {len(LINES)} foreign lines"
    return at_most(work, "memory of the largest process", used.memory / 1e6, MEMORY, detail, "MB")


def main() -> None:
    lines = []
    with tempfile.TemporaryDirectory(prefix="fourpole-bench-") as place:
        for ending in ("csv", "parquet"):
            folder = Path(place, ending)
            make_campaign(folder, 1, ending, samples=10)
            tests = folder / "tests.csv"
            tests.write_text(tests.read_text(encoding="utf-8").replace("8.01370", f"{FREQUENCY:.5f}"), encoding="utf-8")
            file = folder / "recordings" / f"D0.{ending}"
            if ending == "csv":
                write_csv(file, np.random.default_rng(1982))
            else:
                source = Path(place, "csv", "recordings", "D0.csv")
                pl.scan_csv(source).sink_parquet(file, compression="uncompressed")
                source.unlink()
            lines.append(measure(folder, ending))
    report(lines)


if __name__ == "__main__":
    main()
