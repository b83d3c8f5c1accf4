"""The reduction of recordings alone, without statement, tables and start: python bench/bench_reduction.py."""

from __future__ import annotations

import os

# One thread for all: polars and linear algebra would use the second core, and two children share both.
os.environ["OPENBLAS_NUM_THREADS"] = "1"
os.environ["POLARS_MAX_THREADS"] = "1"

import multiprocessing
import tempfile
import time
from pathlib import Path
from statistics import median

import numpy as np
from promises import Kept, at_least, at_most, own_cpu, report
from read_all import read
from recordings import make_campaign

from fourpole.campaign.folder import read_campaign
from fourpole.study.reduce import Reduction, demodulated, jobs_of
from fourpole.study.workers import Workers, reduce_tests

RECORDINGS, ROUNDS = 200, 5
#: CPU time of one CSV recording of 4 x 20 000, in times that of polars reading it, at most.
OVER_READING = 3.5
#: Two children over one, over what two processes get on a loop of numpy, at least.
TWO = 0.9
#: Transforms of three channels of one recording in each piece of that loop, and number of pieces.
TRANSFORMS, PIECES = 40, 100


def over_reading(jobs: list[Reduction], files: list[Path]) -> Kept:
    """CPU time of reading, hashing and reducing each file in this process, over that of reading it by polars."""
    times: list[tuple[float, float]] = []
    for job, file in zip(jobs, files, strict=True):
        start = own_cpu()
        (done,) = demodulated([job])
        between = own_cpu()
        read(str(file))
        times.append((between - start, own_cpu() - between))
        if done.found is None:
            raise SystemExit(f"{file}: is rejected")
    ours, theirs = (float(np.mean(each)) for each in zip(*times[5:], strict=True))
    detail = f"{ours * 1e3:.1f} ms against {theirs * 1e3:.2f} ms of CPU time, means of {len(times) - 5} recordings"
    return at_most("one recording of 4 x 20 000, CSV", "polars reading it", ours / theirs, OVER_READING, detail)


def two_children(jobs: list[Reduction]) -> Kept:
    """Two warm children over one, and two processes over one with numpy alone, in turn."""
    pools, loops = [Workers(1), Workers(2)], [multiprocessing.get_context("spawn").Pool(count) for count in (1, 2)]
    times: list[list[float]] = [[], [], [], []]
    ways = [lambda pool=pool: reduce_tests(jobs, executor=pool) for pool in pools]
    ways += [lambda loop=loop: loop.map(transforms, range(PIECES), chunksize=5) for loop in loops]
    for turn in range(ROUNDS + 1):  # the first starts the processes
        for way, place in zip(ways, times, strict=True):
            start = time.perf_counter()
            way()
            if turn:
                place.append(time.perf_counter() - start)
    for pool in (*pools, *loops):
        pool.__exit__(None, None, None)
    gains = [[one / two for one, two in zip(*pair, strict=True)] for pair in (times[:2], times[2:])]
    found = median(ours / free for ours, free in zip(*gains, strict=True))
    detail = f"{median(gains[0]):.2f} times one child; numpy alone {median(gains[1]):.2f} times; {len(jobs)} recordings"
    return at_least("two children, over one", "the same of a loop of numpy", found, TWO, detail)


def transforms(seed: int) -> float:
    """A piece of the loop: transforms and products of arrays as large as a recording."""
    signals, total = np.random.default_rng(seed).standard_normal((3, 20_000)), 0.0
    for _ in range(TRANSFORMS):
        lines = np.fft.rfft(signals)
        total += float(np.abs(lines @ lines.T.conj()).sum())
    return total


def main() -> None:
    with tempfile.TemporaryDirectory(prefix="fourpole-bench-") as place:
        made = make_campaign(Path(place, "made"), RECORDINGS, "csv")
        campaign = read_campaign(made.folder)
        jobs = jobs_of(campaign, campaign.of_kind("dynamic"), "joint")
        report([over_reading(jobs, made.files), two_children(jobs)])


if __name__ == "__main__":
    main()
