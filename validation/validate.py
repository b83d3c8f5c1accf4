"""Thousands of virtual campaigns through the joint route, their truth known: `python validation/validate.py`.

Part A is at phasor level, part B goes through recordings in the time domain; their tables go to docs/validation.md. The
part "faults" has laboratories with one fault each, and makes docs/faults.md; the part "models" has fits, choices, maps
and verdicts. What is done is kept in
validation/results, campaign by campaign, so that a run that was stopped goes on where it was; results of other code or
settings are begun anew, unless --keep is given.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import sys
import time
import warnings
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, ProcessPoolExecutor, wait
from contextlib import closing
from itertools import islice
from multiprocessing import get_context
from pathlib import Path
from typing import Any

# One thread of linear algebra: the matrices are small.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent
RESULTS = HERE / "results"
DOCUMENT = ROOT / "docs" / "validation.md"
FAULTS = ROOT / "docs" / "faults.md"
PARTS = ("phasors", "recordings", "faults", "models")
BEGIN, END = "<!-- begin: made by make validate -->", "<!-- end: made by make validate -->"
BEGIN_MODELS, END_MODELS = "<!-- begin: models, made by make validate -->", "<!-- end: models -->"

OUTPUTS = ("K'", "K''", "loss factor", "K2", "C", "TR", "R", "I")


def main() -> int:
    """Run what is missing of both parts, then write the document."""
    parser = argparse.ArgumentParser(description="Validate the joint route against virtual campaigns.")
    parser.add_argument("--phasors", type=int, default=2000, metavar="N", help="campaigns at phasor level")
    parser.add_argument("--recordings", type=int, default=200, metavar="N", help="campaigns in the time domain")
    parser.add_argument("--faults", type=int, metavar="N", help="campaigns with a fault; by default all")
    parser.add_argument("--models", type=int, default=600, metavar="N", help="campaigns with models after K*")
    parser.add_argument("--only", choices=PARTS, action="append", help="this part alone; may be given again")
    parser.add_argument("--jobs", type=int, default=os.cpu_count(), help="processes; by default one per core")
    parser.add_argument("--seconds", type=float, default=float("inf"), help="stop after so long; go on another time")
    parser.add_argument("--keep", action="store_true", help="go on with results of other code")
    asked = parser.parse_args()
    warnings.simplefilter("ignore")  # a campaign's warnings are among its results
    from faulty import CELLS  # once the number of threads is set
    from faulty import run as faulty
    from phasor_level import run as phasor_level
    from time_domain import run as time_domain

    from models import run as models

    work = dict(zip(PARTS, (phasor_level, time_domain, faulty, models), strict=True))
    numbers = (asked.phasors, asked.recordings, asked.faults or len(CELLS), asked.models)
    counts = dict(zip(PARTS, numbers, strict=True))
    until = time.monotonic() + asked.seconds
    done = {}
    try:
        for name in asked.only or PARTS:
            part = Part(name, work[name], asked.jobs)
            part.open(keep=asked.keep)
            part.run(counts[name], until)
            done[name] = part.results(counts[name])
    except KeyboardInterrupt:
        _say("\nStopped; what is done is kept, and the same command goes on from there.\n")
        return 130
    if "faults" in done:
        write_faults(done["faults"])
    if "models" in done:
        write_models(done["models"])
    if done.keys() - {"faults", "models"}:
        others = [done.get(name) or Part(name, work[name], 1).results() for name in PARTS[:2]]
        write_document(*others)
    return 0


class Part:
    """Campaigns numbered from 0, one line of JSON each, after a line that says which code made them."""

    def __init__(self, name: str, work: Callable[[int], dict[str, Any]], jobs: int) -> None:
        self.name, self.work, self.jobs = name, work, jobs
        self.file = RESULTS / f"{name}.jsonl"

    def open(self, *, keep: bool) -> None:
        """Drop what other code made, and a line that was being written when the run ended."""
        RESULTS.mkdir(parents=True, exist_ok=True)
        lines = self.file.read_text().splitlines(keepends=True) if self.file.exists() else []
        lines = [line for line in lines if line.endswith("\n")]
        if lines and not keep and json.loads(lines[0]) != {"code": _code()}:
            _say(f"{self.name}: the results were made by other code, begun anew (--keep goes on with them)\n")
            lines = []
        kept = "".join(lines) or json.dumps({"code": _code()}) + "\n"
        self.file.write_text(kept)

    def results(self, count: int = sys.maxsize) -> list[dict[str, Any]]:
        """What is done, in order."""
        found = [json.loads(line) for line in self.file.read_text().splitlines()[1:]] if self.file.exists() else []
        return sorted((each for each in found if each["number"] < count), key=lambda each: each["number"])

    def run(self, count: int, until: float) -> None:
        """The campaigns that are missing."""
        missing = sorted(set(range(count)) - {each["number"] for each in self.results()})
        began, shown = time.monotonic(), 0.0
        with self.file.open("a") as file, closing(self._made(missing, until)) as made:
            for done, result in enumerate(made, start=1):
                file.write(json.dumps(result) + "\n")
                file.flush()
                now = time.monotonic()
                if now - shown > 0.5:
                    left = (now - began) / done * (len(missing) - done)
                    _say(f"\r{self.name}: {count - len(missing) + done} of {count}, {_words(left)} left   ")
                    shown = now
        if missing:
            _say(f"\r{self.name}: {len(self.results(count))} of {count} done                  \n")

    def _made(self, numbers: Sequence[int], until: float) -> Iterator[dict[str, Any]]:
        """The campaigns of some numbers as they are done, in as many processes as asked for."""
        if self.jobs < 2 or len(numbers) < 2:
            yield from (self.work(number) for number in numbers if time.monotonic() < until)
            return
        left = iter(numbers)
        with ProcessPoolExecutor(self.jobs, mp_context=get_context("spawn")) as pool:
            running = {pool.submit(self.work, number) for number in islice(left, self.jobs)}
            while running:
                done, running = wait(running, return_when=FIRST_COMPLETED)
                if time.monotonic() < until:
                    running |= {pool.submit(self.work, number) for number in islice(left, len(done))}
                yield from (each.result() for each in done)


def _words(seconds: float) -> str:
    return f"{seconds / 60:.0f} min" if seconds > 90 else f"{seconds:.0f} s"


def _say(text: str) -> None:
    sys.stderr.write(text)
    sys.stderr.flush()


def _code() -> str:
    """Hash of all that results depend on."""
    names = ("core", "virtual", "units", "io", "campaign", "study", "models")
    files = [file for name in names for file in sorted((ROOT / "src" / "fourpole" / name).rglob("*.py"))]
    own = ("laboratories.py", "phasor_level.py", "bound.py", "time_domain.py", "faulty.py", "models.py")
    files += [HERE / name for name in own]
    return hashlib.sha256(b"".join(file.read_bytes() for file in files)).hexdigest()[:16]


def write_document(phasors: Sequence[dict[str, Any]], recordings: Sequence[dict[str, Any]]) -> None:
    """Put the tables between the marks of the document."""
    from laboratories import RANGES
    from time_domain import RANGES as RANGES_RECORDED

    lines = [*_part("Part A: phasors", phasors, RANGES), *_findings(phasors)]
    lines += _part("Part B: recordings", recordings, RANGES_RECORDED)
    if recordings:
        lines += _verdicts(recordings)
    _put(DOCUMENT, lines)


def write_faults(results: Sequence[dict[str, Any]]) -> None:
    """Put the table of faults between the marks of its document."""
    from faulty import table

    _put(FAULTS, ["", *table(results)])


def write_models(results: Sequence[dict[str, Any]]) -> None:
    """Put the tables on models after K* between their marks of the document."""
    from models import RANGES, table

    rows = [f"| {name} | {words} |" for name, words in RANGES.items()]
    lines = ["", f"{len(results)} campaigns.", "", "| random value | distribution |", "|---|---|", *rows, ""]
    _put(DOCUMENT, [*lines, *table(results), ""], (BEGIN_MODELS, END_MODELS))


def _put(document: Path, lines: Sequence[str], marks: tuple[str, str] = (BEGIN, END)) -> None:
    text = document.read_text()
    begin, end = marks
    before, rest = text.split(begin)
    document.write_text(f"{before}{begin}\n" + "\n".join(lines) + f"\n{end}{rest.split(end)[1]}")
    _say(f"{document.relative_to(ROOT)} is written.\n")


def _part(title: str, results: Sequence[dict[str, Any]], ranges: dict[str, str]) -> list[str]:
    from scores import against_bound, collect, coverage_table

    lines = [f"\n## {title}\n", f"{len(results)} campaigns, numbers 0 to {max([-1, *(r['number'] for r in results)])}."]
    rows = (f"| {name} | {words} |" for name, words in ranges.items())
    lines += ["", "| random value | distribution |", "|---|---|", *rows, ""]
    if len(results) < 2:
        return [*lines, "Too few campaigns for a table."]
    samples = collect(results)
    shared = sorted(name for name in samples if name not in OUTPUTS and name != "K1")
    lines += [*coverage_table(samples, ("K1", *OUTPUTS)), ""]
    if shared:
        lines += ["What the campaign's tests share:", "", *coverage_table(samples, shared), ""]
    for masses in ("one mass", "two masses", "three masses"):
        some = [result for result in results if result["masses"] == masses]
        lines += [f"With {masses} ({len(some)} campaigns):", "", *coverage_table(collect(some), OUTPUTS[:6]), ""]
    some = [result for result in results if result["belts"]]
    if len(some) > 1:
        lines += [f"With belts ({len(some)} campaigns):", "", *coverage_table(collect(some), OUTPUTS[:6]), ""]
    if any("bound" in result for result in results):
        lines += ["Stated uncertainty over the least possible (posterior Cramér-Rao bound at the truth):", ""]
        lines += [*against_bound(results, (*OUTPUTS, *shared)), ""]
    return lines


def _findings(results: Sequence[dict[str, Any]]) -> list[str]:
    """How often something is found amiss where nothing is."""
    from scores import exact_limits

    def share(words: str, met: int, of: int) -> str:
        low, high = exact_limits(met, of)
        return f"| {words} | {met} of {of} | {100 * met / of:.2f} % | {100 * low:.2f} to {100 * high:.2f} % |"

    count, tests = len(results), sum(result["tests"] for result in results)
    lines = [
        "Found amiss though all is as stated:",
        "",
        "| what | how often | share | 95 % limits |",
        "|---|---|---|---|",
    ]
    lines.append(
        share("a stated value contradicted, or the rig or noise enlarged", sum(not r["fits"] for r in results), count)
    )
    lines.append(share("... an unstated part added to the rig", sum(bool(r["parts"]) for r in results), count))
    lines.append(share("noise taken larger than it is", sum(r["inflation"] > 1 for r in results), count))
    lines.append(share("scatter of K* between the tests of a condition", sum(r["scatter"] > 0 for r in results), count))
    for low, high in ((2, 3), (4, 5), (6, 20)):
        some = [r for r in results if low <= r["frequencies"] <= high]
        if some:
            words = f"... in campaigns with {low} to {high} frequencies and more than one mass"
            some = [r for r in some if r["masses"] != "one mass"]
            lines.append(share(words, sum(r["scatter"] > 0 for r in some), max(len(some), 1)))
    laden, massless = ([r for r in results if bool(r["belts"]) is has] for has in (True, False))
    lines.append(share("a mass in massless specimens", sum(r["masses found"] > 0 for r in massless), len(massless)))
    lines.append(share("none found in specimens with belts", sum(not r["masses found"] for r in laden), len(laden)))
    belted = sum(r["tests"] for r in laden)
    lines.append(share("two K* explain a test, of tests with belts", sum(r["two roots"] for r in laden), belted))
    lines.append(share("outliers, of all tests", sum(r["outliers"] for r in results), tests))
    lines.append(share("the search did not come to rest", sum(not r["converged"] for r in results), count))
    lines.append(share("K2 and C blank, of all tests", sum(r["blank"] for r in results), tests))
    named = Counter(name for r in results for name in r["conflicts"])
    told = ", ".join(f"{name} {times}" for name, times in named.most_common())
    return [*lines, "", f"Contradicted: {told or 'none'}.", ""]


def _verdicts(results: Sequence[dict[str, Any]]) -> list[str]:
    total: Counter[str] = Counter()
    for result in results:
        total.update(result["verdicts"])
    told = ", ".join(f"{name} {count}" for name, count in sorted(total.items()))
    routes = Counter(" and ".join(result["routes"]) for result in results)
    rigs = [rig for result in results for rig in result["joint"]]
    chi2, dof = sum(rig["chi2"] for rig in rigs), sum(rig["dof"] for rig in rigs)
    found = {
        "rigs that do not fit, or statements contradicted": sum(not rig["fits"] for rig in rigs),
        "noise found larger than the recordings say": sum(rig["inflation"] > 1 for rig in rigs),
        "scatter of K* found": sum(rig["scatter"] > 0 for rig in rigs),
    }
    return [
        f"Verdicts of the tests: {told}. Routes: {', '.join(f'{route} {times}' for route, times in routes.items())}.",
        f"Of {len(rigs)} rigs: {', '.join(f'{what} {times}' for what, times in found.items())}.",
        f"What no tyre could explain has {chi2 / max(dof, 1):.3f} of the chi-square that is due, all together.",
        "",
    ]


if __name__ == "__main__":
    sys.exit(main())
