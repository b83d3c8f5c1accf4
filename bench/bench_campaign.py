"""Whole campaigns as users run them, beside polars reading the same files: python bench/bench_campaign.py."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from dataclasses import replace
from pathlib import Path
from statistics import median

import numpy as np
import polars as pl
from promises import FOURPOLE, Kept, Used, at_most, in_turn, ratio, report, run
from recordings import Made, make_campaign

#: Tests of the campaign, and rounds.
LARGE, ROUNDS = 1000, 3
#: Most times what polars takes to read the files, with two processes each.
READING = {"csv": 3.0, "parquet": 6.0}
#: Most times what the script of a laboratory takes, which gives amplitudes alone.
OVER_SCRIPT = 1.0
#: CPU time of the calling process at 1000 tests without the joint solution, over that of importing numpy and polars.
SERIAL_CPU = 6.0
#: Most CPU time beyond that of a campaign of one test, a test [ms]: nothing changed; rig and uncertainty refined.
AGAIN, REFINED = 0.3, 4.0
READER, SCRIPT, SERIAL = (str(Path(__file__).parent / name) for name in ("read_all.py", "fit_all.py", "serial.py"))


def analyse(made: Made, workers: int, *, fresh: bool = True) -> Used:
    """Tables only; without what an earlier analysis left, if `fresh`."""
    if fresh:
        shutil.rmtree(made.folder / "results", ignore_errors=True)
    return run([*FOURPOLE, "analyse", str(made.folder), "--tables-only", "--workers", str(workers)], codes=(0, 3))


def check(made: Made) -> str:
    """All tests are used, with amplitudes that are those of the signals; SystemExit if not."""
    made.check_used()
    found = pl.read_parquet(made.folder / "results" / "phasors.parquet")
    off = []
    for at, name in enumerate(("F1 [N]", "V1 [m/s]", "V2 [m/s]")):
        measured = found[f"Re {name}"].to_numpy() + 1j * found[f"Im {name}"].to_numpy()
        variance = np.array(found["covariance Re F1, Im F1, Re V1, Im V1, Re V2, Im V2"].to_list()).reshape(-1, 6, 6)
        u = np.sqrt(variance[:, 2 * at, 2 * at] + variance[:, 2 * at + 1, 2 * at + 1])
        off.append(np.abs(np.abs(measured) - np.abs(made.amplitudes[:, at])) / u)
    worst = float(np.max(off))
    if not worst < 6:  # 3000 moduli, whose largest error is 3.5 of these u at most if all is well
        raise SystemExit(f"{made.folder}: an amplitude is {worst:.1f} of its uncertainties off")
    return f"{len(made.files)} tests, largest error {worst:.1f} u"


def against_reading(made: Made, ending: str) -> Kept:
    """Two workers against polars with two processes, both from the command to its end."""

    def reading() -> Used:
        return run([sys.executable, READER, str(made.folder / "recordings"), ending], POLARS_MAX_THREADS="1")

    analyse(made, 2)
    same = check(made)
    ours, theirs = in_turn([lambda: analyse(made, 2), reading], ROUNDS)
    took = [median(one.wall for one in each) for each in (ours, theirs)]
    detail = f"{took[0]:.1f} s against {took[1]:.1f} s; {same}"
    work = f"{LARGE} recordings of 4 x 20 000, {ending}, tables only, two workers"
    return at_most(work, "polars reading them in two processes", ratio(ours, theirs), READING[ending], detail)


def against_script(made: Made, ending: str) -> Kept:
    """Two workers against the script of a laboratory in two processes, both from the command to its end."""

    def script() -> Used:
        return run([sys.executable, SCRIPT, str(made.folder / "recordings"), ending], POLARS_MAX_THREADS="1")

    ours, theirs = in_turn([lambda: analyse(made, 2), script], 1)
    detail = f"{ours[0].wall:.1f} s against {theirs[0].wall:.1f} s, one round; all of the analysis against amplitudes"
    work = f"{LARGE} recordings of 4 x 20 000, {ending}, tables only, two workers"
    return at_most(
        work, "a script: polars, IEEE 1057 by lstsq, two processes", ratio(ours, theirs), OVER_SCRIPT, detail
    )


def serial(made: Made) -> Kept:
    """CPU time of the calling process, less that of the joint solution, over that of importing numpy and polars."""
    took: list[tuple[float, float]] = []
    for _ in range(ROUNDS):
        shutil.rmtree(made.folder / "results", ignore_errors=True)
        done = subprocess.run([sys.executable, SERIAL, str(made.folder)], capture_output=True, text=True, check=True)
        took.append((float(done.stdout.split()[-1]), run([sys.executable, "-c", "import numpy, polars"]).cpu))
    ours, imports = (median(each) for each in zip(*took, strict=True))
    detail = f"{ours:.2f} s against {imports:.2f} s of CPU time; start, tables and {ours / LARGE * 1e3:.2f} ms a test"
    work = f"the calling process without the joint solution, {LARGE} tests"
    return at_most(work, "import numpy, polars", median(a / b for a, b in took), SERIAL_CPU, detail)


def again(made: Made, alone: Made) -> list[Kept]:
    """A second run, and one with a refined rig; what a campaign of one test takes is not counted."""
    analyse(alone, 2)
    analyse(made, 2)
    same = check(made)
    many, one = in_turn([lambda: analyse(made, 2, fresh=False), lambda: analyse(alone, 2, fresh=False)], ROUNDS)
    count, names = len(made.files) - 1, ("a second run, nothing changed", "rig and a gain refined, second run")
    lines = [_each(names[0], many, one, AGAIN, count, same)]
    for campaign in (made, alone):
        _spoil(campaign)
    used: list[list[Used]] = [[], []]
    for turn in range(ROUNDS):
        for campaign, place in zip((made, alone), used, strict=True):
            _refine(campaign, turn)
            place.append(analyse(campaign, 2, fresh=False))
    opened = made.rejected()  # nobody can read the recordings any more
    same = f"{opened} recordings were opened" if opened else f"no recording opened; {check(made)}"
    line = _each(names[1], *used, REFINED, count, same)
    return [*lines, replace(line, kept=line.kept and not opened)]


def _each(work: str, many: list[Used], one: list[Used], limit: float, count: int, same: str) -> Kept:
    cpu = [median(used.cpu for used in each) for each in (many, one)]
    detail = f"{cpu[0]:.2f} s of CPU time against {cpu[1]:.2f} s of a campaign of one test; {same}"
    work = f"{work}, {count + 1} tests"
    return at_most(work, "start-up: CPU time a test", (cpu[0] - cpu[1]) / count * 1e3, limit, detail, "ms")


def _refine(made: Made, turn: int) -> None:
    """Another uncertainty of the rig and of a gain."""
    path = made.folder / "campaign.toml"
    lines = [
        f'moving_mass = {{ value = 15.0, unit = "kg", std = {0.05 + 0.001 * turn} }}'
        if line.startswith("moving_mass")
        else line.replace('std_gain = "0.5 %"', f'std_gain = "0.{4 - turn} %"', 1)
        for line in path.read_text(encoding="utf-8").splitlines()
    ]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _spoil(made: Made) -> None:
    """Overwrite every recording in its place, with the same size and times: who opens it finds nothing."""
    for file in made.files:
        state = file.stat()
        with file.open("r+b") as opened:
            opened.write(b"\0" * state.st_size)
        os.utime(file, ns=(state.st_atime_ns, state.st_mtime_ns))


def main() -> None:
    lines = []
    with tempfile.TemporaryDirectory(prefix="fourpole-bench-") as place:
        for ending in READING:
            made = make_campaign(Path(place, ending), LARGE, ending)
            lines.append(against_reading(made, ending))
            if ending == "csv":
                lines.append(against_script(made, ending))
                lines += again(made, make_campaign(Path(place, "alone"), 1, ending))
            else:
                lines.append(serial(made))
            shutil.rmtree(made.folder)
    report(lines)


if __name__ == "__main__":
    main()
