"""Ways to do the same work, timed side by side, as lines of a table; run by itself it does nothing."""

from __future__ import annotations

import platform
import textwrap
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib.metadata import version

import numpy as np
from numpy.typing import NDArray
from promises import Kept, at_least

__all__ = ["Row", "agree", "compare", "kept", "show"]


@dataclass(frozen=True)
class Row:
    """One line of the table: times in seconds, the ratio in each round, and how far the results are apart."""

    work: str
    peer: str
    ours: float
    theirs: float
    ratios: NDArray[np.float64]
    agreement: str


def compare(
    work: str, ours: Callable[[], object], peers: Mapping[str, tuple[Callable[[], object], str]], *, rounds: int
) -> list[Row]:
    """Time ours and each peer in turn, A B A B ..., after one round that does not count.

    `peers` are name -> (way, agreement found before).
    """
    ways = [ours, *(way for way, _ in peers.values())]
    times = np.empty((rounds + 1, len(ways)))
    for turn in times:
        for index, way in enumerate(ways):
            start = time.perf_counter()
            way()
            turn[index] = time.perf_counter() - start
    mine, theirs = times[1:, 0], times[1:, 1:].T
    return [
        Row(work, name, float(np.median(mine)), float(np.median(took)), took / mine, agreement)
        for (name, (_, agreement)), took in zip(peers.items(), theirs, strict=True)
    ]


def agree(found: float, limit: float) -> str:
    """What is shown of a check that results are the same; SystemExit if they are not, for then times mean nothing."""
    if not found <= limit:
        raise SystemExit(f"results differ by {found:.2g}, more than {limit:.2g}: their times say nothing")
    return f"{found:.1e} <= {limit:.0e}"


def kept(rows: list[Row], promised: Mapping[tuple[str, str], float]) -> list[Kept]:
    """The promise of each row that has one: how many times faster than the peer, median of all rounds."""
    lines = []
    for row in rows:
        if (limit := promised.get((row.work, row.peer))) is not None:
            detail = f"{row.ours * 1e3:.2f} ms against {row.theirs * 1e3:.2f} ms; results differ by {row.agreement}"
            lines.append(at_least(row.work, row.peer, float(np.median(row.ratios)), limit, detail))
    return lines


def show(rows: list[Row], notes: Mapping[str, str], packages: list[str]) -> None:
    """The table, and below it what each line compares."""
    print(f"Python {platform.python_version()}, " + ", ".join(f"{name} {version(name)}" for name in packages))
    heads = ("work", "peer", "Fourpole", "peer", "ratio", "rounds", "difference")
    print("{:<34} {:<30} {:>12} {:>12} {:>7}  {:<13} {}".format(*heads))
    for row in rows:
        spread = f"{min(row.ratios):.3g}-{max(row.ratios):.3g}"
        print(
            f"{row.work:<34} {row.peer:<30} {row.ours * 1e3:>9.2f} ms {row.theirs * 1e3:>9.2f} ms "
            f"{np.median(row.ratios):>7.3g}  {spread:<13} {row.agreement}"
        )
    print("\nTimes are medians. ratio: time of the peer over that of Fourpole in the same round, median of all rounds;")
    print("rounds: the least and the greatest.")
    for name, text in notes.items():
        print(textwrap.fill(f"{name}: {' '.join(text.split())}", 120, subsequent_indent="    "))
