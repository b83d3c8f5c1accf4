"""The command that gathers the results of many campaigns."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

from fourpole.answer import Answer
from fourpole.app.console import OK, SOME_REJECTED, progress, warn
from fourpole.lab import Gathered, gather


def run_lab(folder: Path, place: Path | None) -> Answer:
    """Gather results into a data set; the exit code is `SOME_REJECTED` if some were not taken."""
    with progress("gathering") as advance:
        made = gather(folder, place, progress=advance)
    for problem in made.problems:
        warn(problem)
    code = SOME_REJECTED if made.left_out else OK
    return Answer([_summary(made)], lambda: {**asdict(made), "folder": str(made.folder)}, code=code)


def _summary(made: Gathered) -> str:
    """The content of the data set, and what was done."""
    done = [f"{made.read} read", f"{made.unchanged} unchanged"]
    done += [f"{made.removed} no longer there"] if made.removed else []
    done += [f"{made.left_out} not taken"] if made.left_out else []
    return f"{made.folder}: {len(made.campaigns)} campaigns, {made.tests} rows of tests ({', '.join(done)})"
