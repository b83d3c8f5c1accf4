"""From reduced recordings to tables, over the number of tests: python bench/bench_many.py.

The first analysis reduces the recordings, which are short here. The second one takes them from the cache, so that it
does the joint route, the budget and all tables; it is the one that is measured.
"""

from __future__ import annotations

import shutil
import tempfile
from pathlib import Path
from statistics import median

from promises import FOURPOLE, Used, at_most, report, run
from recordings import Made, make_campaign

#: Numbers of tests, samples of each recording, and rounds of the few and of the many.
FEW, MANY, SAMPLES = 1_000, 10_000, 2_000
ROUNDS = {FEW: 3, MANY: 1}
#: Most times the CPU time of the few, and most memory of one process [MB].
LINEAR, MEMORY = 11.0, 500.0


def tables(made: Made) -> list[Used]:
    """What the analysis of reduced recordings used, in each round."""
    results = made.folder / "results"
    command = [*FOURPOLE, "analyse", str(made.folder), "--tables-only"]
    run(command, codes=(0, 3))
    used = []
    for _ in range(ROUNDS[len(made.files)]):
        for path in results.iterdir():  # all but the reduced recordings
            if path.is_file():
                path.unlink()
        used.append(run(command, codes=(0, 3)))
        if not (results / "budget.csv").is_file():
            raise SystemExit(f"{results}: there is no budget")
    shutil.rmtree(made.folder)
    return used


def main() -> None:
    with tempfile.TemporaryDirectory(prefix="fourpole-bench-") as place:
        few, many = (
            tables(make_campaign(Path(place, str(count)), count, "parquet", samples=SAMPLES)) for count in (FEW, MANY)
        )
    cpu = [median(one.cpu for one in each) for each in (few, many)]
    memory = max(one.memory for one in many) / 1e6
    detail = f"{cpu[1]:.1f} s against {cpu[0]:.1f} s of CPU time"
    work = f"joint route, budget and tables of {MANY} tests"
    report(
        [
            at_most(work, f"of {FEW}", cpu[1] / cpu[0], LINEAR, detail),
            at_most(work, "memory of the process", memory, MEMORY, unit="MB"),
        ]
    )


if __name__ == "__main__":
    main()
