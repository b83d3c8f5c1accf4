"""Promises of speed: what was measured and what is promised; run by itself it does nothing.

Each bench_*.py ends with `report`. It prints a line per promise, keeps it for the table, and fails if one is not kept.
"""

from __future__ import annotations

import json
import multiprocessing
import os
import resource
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from statistics import median
from typing import TypeVar

__all__ = [
    "FOURPOLE",
    "Kept",
    "Used",
    "alone",
    "at_least",
    "at_most",
    "in_turn",
    "own_cpu",
    "own_memory",
    "ratio",
    "read_kept",
    "report",
    "run",
]

#: Where each script leaves its lines for the table.
KEPT = Path(__file__).parent / "kept"
#: The command as users run it, on the library of this Python.
FOURPOLE = [sys.executable, "-m", "fourpole"]
_Found = TypeVar("_Found")


@dataclass(frozen=True)
class Kept:
    """One line of the table: a ratio and what is promised of it."""

    work: str
    against: str
    found: float
    promise: str
    kept: bool
    detail: str = ""


@dataclass(frozen=True)
class Used:
    """What a command used: wall time [s], CPU time of it and its children [s], largest memory of one process [B]."""

    wall: float
    cpu: float
    memory: float


def at_least(work: str, against: str, found: float, limit: float, detail: str = "") -> Kept:
    """A ratio that must reach a limit, as how many times faster."""
    return Kept(work, against, found, f"at least {limit:g}", found >= limit, detail)


def at_most(work: str, against: str, found: float, limit: float, detail: str = "", unit: str = "") -> Kept:
    """A ratio, or a value with its unit, that must not exceed a limit."""
    return Kept(work, against, found, f"at most {limit:g}{unit and ' '}{unit}", found <= limit, detail)


def run(command: Sequence[str], *, codes: Sequence[int] = (0,), **environment: str) -> Used:
    """Run a command to its end, in a process that is waited for alone; SystemExit if its exit code is another one."""
    watch = [sys.executable, "-c", _WATCH, *command]
    start = time.perf_counter()
    done = subprocess.run(watch, capture_output=True, text=True, env={**os.environ, **environment}, check=False)
    wall = time.perf_counter() - start
    if done.returncode not in codes:
        raise SystemExit(f"{' '.join(command)}: exit code {done.returncode}: {done.stderr[-2000:]}")
    cpu, memory = done.stderr.rstrip().rpartition("\n")[2].split()
    return Used(wall, float(cpu), float(memory))


#: Runs a command and tells what it used; a process of its own, as the system adds up all children that ended.
_WATCH = """
import resource, subprocess, sys
code = subprocess.run(sys.argv[1:]).returncode
used = resource.getrusage(resource.RUSAGE_CHILDREN)
unit = 1 if sys.platform == "darwin" else 1024
print(f"\\n{used.ru_utime + used.ru_stime} {used.ru_maxrss * unit}", file=sys.stderr)
sys.exit(code)
"""


def in_turn(ways: Sequence[Callable[[], Used]], rounds: int) -> list[list[Used]]:
    """What each way used in each round: A B A B ..., so that a load of the machine meets all of them."""
    turns = [[way() for way in ways] for _ in range(rounds)]
    return [list(each) for each in zip(*turns, strict=True)]


def ratio(ours: Sequence[Used], theirs: Sequence[Used], what: str = "wall") -> float:
    """Our time over that of the peer in the same round, median of all rounds."""
    return median(getattr(a, what) / getattr(b, what) for a, b in zip(ours, theirs, strict=True))


def alone(measure: Callable[[int], _Found], count: int) -> _Found:
    """What `measure` finds for a size, in a process of its own: the system tells only the most memory it ever had."""
    with multiprocessing.get_context("spawn").Pool(1) as process:
        return process.apply(measure, (count,))


def own_cpu() -> float:
    """CPU time of this process [s]."""
    used = resource.getrusage(resource.RUSAGE_SELF)
    return used.ru_utime + used.ru_stime


def own_memory() -> int:
    """Most memory that this process ever had [byte]."""
    most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return most if sys.platform == "darwin" else 1024 * most


def report(lines: Sequence[Kept]) -> None:
    """Print and keep the lines; SystemExit if a promise is not kept."""
    KEPT.mkdir(exist_ok=True)
    name = Path(sys.argv[0]).stem
    (KEPT / f"{name}.json").write_text(json.dumps([asdict(line) for line in lines], indent=1), encoding="utf-8")
    for line in lines:
        print(f"{'ok  ' if line.kept else 'FAIL'} {line.work} against {line.against}: {line.found:.3g}, {line.promise}")
        if line.detail:
            print(f"     {line.detail}")
    broken = [line.work for line in lines if not line.kept]
    if broken:
        raise SystemExit(f"not as promised: {'; '.join(broken)}")


def read_kept(name: str) -> list[Kept]:
    """The lines that a script left; none if it did not run."""
    path = KEPT / f"{name}.json"
    return [Kept(**line) for line in json.loads(path.read_text(encoding="utf-8"))] if path.is_file() else []
