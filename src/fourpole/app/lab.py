"""The command that gathers the results of many campaigns."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

from fourpole.app.console import OK, SOME_REJECTED, out, print_json, progress, warn
from fourpole.lab import Gathered, gather


def run_lab(folder: Path, place: Path | None, *, as_json: bool) -> int:
    """Gather results into a data set; the exit code is `SOME_REJECTED` if some were not taken."""
    with progress("gathering") as advance:
        made = gather(folder, place, progress=advance)
    for problem in made.problems:
        warn(problem)
    if as_json:
        print_json({**asdict(made), "folder": str(made.folder)})
    else:
        out(_summary(made))
    return SOME_REJECTED if made.left_out else OK


def _summary(made: Gathered) -> str:
    """The content of the data set, and what was done."""
    done = [f"{made.read} read", f"{made.unchanged} unchanged"]
    done += [f"{made.removed} no longer there"] if made.removed else []
    done += [f"{made.left_out} not taken"] if made.left_out else []
    return f"{made.folder}: {len(made.campaigns)} campaigns, {made.tests} rows of tests ({', '.join(done)})"
