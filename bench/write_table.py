"""The table of docs/speed.md from what the benchmarks have kept: python bench/write_table.py."""

from __future__ import annotations

import os
import platform
import sys
from collections.abc import Iterator
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from promises import KEPT, Kept, read_kept

PAGE = Path(__file__).parents[1] / "docs" / "speed.md"
START, END = "<!-- written by make bench -->", "<!-- end -->"
SCRIPTS = {
    "bench_reduction": "The reduction of a recording",
    "bench_core": "Parts, beside packages that do the same",
    "bench_campaign": "Whole campaigns, as users run them",
    "bench_demo": "The demonstration, beside the version before",
    "bench_tables": "Many tests",
    "bench_joint": "The joint route",
    "bench_models": "Models",
    "bench_ride": "Rides",
    "bench_fmu": "FMUs",
    "bench_cluster": "A cluster",
    "bench_memory": "Memory",
    "bench_app": "The app",
    "bench_start": "Start-up",
}
PACKAGES = (
    *(
        "numpy",
        "scipy",
        "polars",
        "lmfit",
        "pyFRF",
        "pyfar",
        "scikit-rf",
        "pyvisco",
        "pyimpspec",
        "impedance",
        "pythonfmu",
    ),
    "distributed",
)


def machine() -> str:
    """Processor, cores and system, as far as the system tells."""
    name = platform.processor() or platform.machine()
    cpuinfo = Path("/proc/cpuinfo")
    if cpuinfo.is_file():
        models = [line for line in cpuinfo.read_text(encoding="utf-8").splitlines() if line.startswith("model name")]
        name = models[0].partition(": ")[2] if models else name
    return f"{name}, {os.cpu_count()} cores, {platform.system()}"


def versions() -> Iterator[str]:
    """Python and the packages that were compared."""
    yield f"Python {platform.python_version()}"
    for name in PACKAGES:
        try:
            yield f"{name} {version(name)}"
        except PackageNotFoundError:
            continue


def row(line: Kept) -> str:
    found = f"{line.found:.3g}" if line.kept else f"**{line.found:.3g}**"
    against = line.against.replace("*", "\\*")
    return f"| {line.work} | {against} | {found} | {line.promise} | {line.detail} |"


def table() -> Iterator[str]:
    """One section per script."""
    yield f"{machine()}; {', '.join(versions())}."
    for script, title in SCRIPTS.items():
        lines = read_kept(script)
        yield f"\n## {title}\n"
        if not lines:
            yield "Not run."
            continue
        yield "| work | against | found | promised | |\n|---|---|---|---|---|"
        yield from map(row, lines)


def main() -> None:
    page = PAGE.read_text(encoding="utf-8")
    before, _, rest = page.partition(START)
    after = rest.partition(END)[2]
    if not after:
        raise SystemExit(f"{PAGE}: has no place for the table")
    PAGE.write_text(f"{before}{START}\n\n{chr(10).join(table())}\n\n{END}{after}", encoding="utf-8")
    print(f"written: {PAGE}")
    broken = [line for script in SCRIPTS for line in read_kept(script) if not line.kept]
    lacking = [script for script in SCRIPTS if not (KEPT / f"{script}.json").is_file()]
    if broken or lacking:
        said = [
            *(f"not as promised: {line.work}" for line in broken),
            *(f"not run to its end: {one}" for one in lacking),
        ]
        sys.exit("\n".join(said))


if __name__ == "__main__":
    main()
