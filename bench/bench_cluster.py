"""Two Dask workers of one thread against one, scheduler and client beside them: python bench/bench_cluster.py."""

from __future__ import annotations

import shutil
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from statistics import median

from promises import FOURPOLE, Used, at_least, report, run
from recordings import Made, make_campaign

#: Recordings and their samples: at least 60 s of work for one worker. Rounds.
COUNT, SAMPLES, ROUNDS, WORK = 600, 120_000, 1, 60.0
TWO = 1.5


@contextmanager
def cluster(workers: int) -> Iterator[str]:
    """A scheduler and workers of one thread on this machine; the address of the scheduler."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    address = f"tcp://127.0.0.1:{port}"
    dask = [sys.executable, "-m", "distributed.cli"]
    commands = [[f"{dask[2]}.dask_scheduler", "--host", "127.0.0.1", "--port", str(port), "--no-dashboard"]]
    commands += [[f"{dask[2]}.dask_worker", address, "--nthreads", "1", "--nworkers", "1", "--no-dashboard"]] * workers
    started = [
        subprocess.Popen([*dask[:2], *one], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) for one in commands
    ]
    try:
        time.sleep(5.0)  # workers that come later would be waited for by the work
        if any(process.poll() is not None for process in started):
            raise SystemExit("a process of the cluster did not start")
        yield address
    finally:
        for process in reversed(started):
            process.terminate()
            process.wait(timeout=30)


def analyse(made: Made, workers: int) -> Used:
    """Tables only, by a cluster of so many workers; all tests are used."""
    shutil.rmtree(made.folder / "results", ignore_errors=True)
    with cluster(workers) as address:
        used = run([*FOURPOLE, "analyse", str(made.folder), "--tables-only", "--scheduler", address], codes=(0, 3))
    made.check_used()
    return used


def main() -> None:
    if not find_spec("distributed"):
        raise SystemExit("bench_cluster.py needs the extra [cluster]: pip install 'fourpole[cluster]'")
    with tempfile.TemporaryDirectory(prefix="fourpole-bench-") as place:
        made = make_campaign(Path(place, "cluster"), COUNT, "parquet", samples=SAMPLES)
        rounds = [(analyse(made, 2), analyse(made, 1)) for _ in range(ROUNDS)]
    took = [median(one.wall for one in each) for each in zip(*rounds, strict=True)]
    detail = f"{took[0]:.0f} s against {took[1]:.0f} s, {COUNT} recordings of 4 x {SAMPLES}"
    if took[1] < WORK:
        detail += f"; less work than {WORK:.0f} s"
    found = median(one.wall / two.wall for two, one in rounds)
    report([at_least("two Dask workers of one thread", "one", found, TWO, detail)])


if __name__ == "__main__":
    main()
