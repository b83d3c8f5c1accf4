"""CPU time from the start of a command to its end, beside an empty Python: python bench/bench_start.py."""

from __future__ import annotations

import sys
from statistics import median

from promises import FOURPOLE, at_most, report, run

ROUNDS = 20
#: Arguments -> most times the CPU time of `python -c pass`.
PROMISED = {"--version": 3.0, "--help": 10.0}
#: Commands that find no file: most times that CPU time until they say so.
MISSING = {"analyse": 50.0, "fit": 80.0, "report": 80.0}


def main() -> None:
    empty = [sys.executable, "-c", "pass"]
    for arguments in PROMISED:  # the first call compiles
        run([*FOURPOLE, arguments])
    times = {"": median(run(empty).cpu for _ in range(ROUNDS))}
    lines = []
    for arguments, limit in PROMISED.items():
        found = median(run([*FOURPOLE, arguments]).cpu for _ in range(ROUNDS))
        detail = f"{found * 1e3:.0f} ms against {times[''] * 1e3:.0f} ms of CPU time, medians of {ROUNDS}"
        lines.append(at_most(f"fourpole {arguments}", "python -c pass", found / times[""], limit, detail))
    for command, limit in MISSING.items():
        found = median(run([*FOURPOLE, command, "no-such-file"], codes=[2]).cpu for _ in range(5))
        detail = f"{found:.2f} s of CPU time"
        lines.append(at_most(f"fourpole {command} NO-SUCH-FILE", "python -c pass", found / times[""], limit, detail))
    report(lines)


if __name__ == "__main__":
    main()
