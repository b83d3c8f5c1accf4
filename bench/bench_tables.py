"""Time and memory from reduced recordings to all tables, over the number of tests: python bench/bench_tables.py."""

from __future__ import annotations

import os
import platform
import tempfile
import textwrap
from dataclasses import dataclass
from pathlib import Path

# One thread of linear algebra, else the times tell what else the machine is doing.
os.environ["OPENBLAS_NUM_THREADS"] = "1"
os.environ["POLARS_MAX_THREADS"] = "1"

import numpy as np
from laboratory import LABORATORY, check_error
from promises import alone, at_most, own_cpu, own_memory, report

from fourpole import analyse
from fourpole.campaign.folder import read_campaign
from fourpole.core.demodulation.preview import BLOCKS, POINTS, Preview
from fourpole.study import analysis as wiring
from fourpole.study.points import Points
from fourpole.virtual.phasor_rig import Conditions, simulate_phasors

SEED = 1982
SIZES = (1_000, 10_000)
#: A campaign ten times as large may take so many times as long, and no more memory than this [bytes].
LINEAR, MOST_MEMORY = 11.0, 500e6
TYRES, FREQUENCIES = 20, np.linspace(10.0, 24.0, 10)
CAMPAIGN = """
[unstated]
ordinary = "zero"
[rig]
moving_mass = { value = 15.0, unit = "kg", std = 0.3 }
preload_stiffness = { value = 12.44, unit = "kN/m", std = 0.25 }
preload_damping = { value = 15.0, unit = "N s/m", std = 5.0 }
[channels]
time = { column = "t", unit = "s" }
force_in = { column = "F1", unit = "N", std_gain = "3 %", std_phase = "1 deg" }
motion_in = { column = "V1", unit = "m/s", std_gain = "3 %", std_phase = "1 deg" }
motion_out = { column = "V2", unit = "m/s", std_gain = "3 %", std_phase = "1 deg" }
"""
NOTES = f"""Tests of {TYRES} tyres, {len(FREQUENCIES)} frequencies per preload, with 0 and 10 kg added; sensors known to
3 % and 1 degree, m and K3 to 2 %, noise 1e-4. From amplitudes with previews, as the cache has them, to the tables in
memory: comparison of tests, joint route, K2 and C, budget, checks. Each size in a process of its own; CPU seconds.
Memory is the most that the process ever had, with Python and its libraries ('before': those, the statement and the
amplitudes). Checked: each test has its row, K* within 6 of its uncertainties; ten times the tests take at most
{LINEAR:g} times the time and {MOST_MEMORY / 1e6:g} MB."""


@dataclass(frozen=True)
class Row:
    """One size: CPU time [s], memory [bytes], largest error of K* in its uncertainty."""

    tests: int
    time: float
    before: int
    most: int
    error: float


def stated(folder: Path, count: int, rng: np.random.Generator) -> tuple[np.ndarray, ...]:
    """Write campaign.toml and tests.csv; returns frequency, added mass, K1 and the number of the condition."""
    each = 2 * FREQUENCIES.size
    family = np.repeat(np.arange(count // each), each)
    frequency = np.tile(np.repeat(FREQUENCIES, 2), count // each) * (1 + rng.uniform(-3e-3, 3e-3, count))
    added = np.tile([0.0, 10.0], count // 2)
    k1 = rng.uniform(1.2e5, 2.4e5, count // each)[family]
    tyres = "".join(f'[tyres.T{at}]\nconstruction = "radial-ply"\n' for at in range(TYRES))
    (folder / "campaign.toml").write_text(f'title = "bench"\n{CAMPAIGN}{tyres}', encoding="utf-8")
    rows = [
        f"D{at},D{at}.csv,dynamic,T{family[at] % TYRES},1.7,{1000 + 50 * (family[at] // TYRES)},{f:.6g},{mass:g},"
        f"{1e-4 * mass:g},{stiffness:.9g},{0.01 * stiffness:.9g}"
        for at, (f, mass, stiffness) in enumerate(zip(frequency, added, k1, strict=True))
    ]
    head = "test,file,kind,tyre,pressure [bar],preload [N],frequency [Hz],added_mass [kg],u(added_mass) [kg],"
    (folder / "tests.csv").write_text("\n".join([f"{head}K1 [N/m],u(K1) [N/m]", *rows]), encoding="utf-8")
    return frequency, added, k1, family


def preview(rng: np.random.Generator) -> Preview:
    """A preview as large as one can be."""
    shown, blocks = np.linspace(0.0, 0.3, POINTS), np.repeat(np.linspace(0.0, 5.0, BLOCKS), 2)
    signals = rng.standard_normal((3, POINTS)).astype(np.float32)
    return Preview(shown, signals, signals, blocks, rng.standard_normal((3, 2 * BLOCKS)).astype(np.float32))


def measure(count: int) -> Row:
    """CPU time, memory and largest error of K* for this number of tests."""
    rng = np.random.default_rng(SEED)
    with tempfile.TemporaryDirectory() as place:
        frequency, added, k1, family = stated(Path(place), count, rng)
        k2, c = rng.uniform([[8e4], [600.0]], [[1.8e5], [1400.0]], (2, family[-1] + 1))
        arms = k2[family] * (frequency / 15) ** 0.6, c[family] * (frequency / 15) ** 0.2
        run = simulate_phasors(LABORATORY, Conditions(frequency, k1, *arms, added_mass=added), rng)
        roles = ("force_in", "motion_in", "motion_out")
        reduced = Points(
            tests=tuple(read_campaign(place).of_kind("dynamic")),
            phasors=run.phasors,
            checks=((),) * count,
            corrections=((),) * count,
            previews=tuple((roles, preview(rng)) for _ in range(count)),
            began=np.full(count, np.nan),
            sha256=tuple(f"{number:064x}" for number in range(count)),
        )
        wiring.reduce_tests = lambda *_, **__: reduced
        before, start = own_memory(), own_cpu()
        study = analyse(place)
        spent = own_cpu() - start
    table = study.dynamic
    if table.height != count or study.previews.height != count or not study.budget.height:
        raise SystemExit(f"{count} tests have {table.height} rows")
    off = [
        (table[f"{part} K* [N/m]"].to_numpy() - true) / table[f"u({part} K*) [N/m]"].to_numpy()
        for part, true in (("Re", run.stiffness.real), ("Im", run.stiffness.imag))
    ]
    return Row(count, spent, before, own_memory(), float(np.max(np.abs(off))))


def main() -> None:
    print(f"Python {platform.python_version()}, numpy {np.__version__}")
    print(f"{'tests':>8} {'CPU':>9} {'per test':>11} {'memory':>9} {'before':>9}  largest error of K* / u")
    rows = []
    for count in SIZES:
        rows.append(row := alone(measure, count))
        print(
            f"{row.tests:>8} {row.time:>7.2f} s {row.time / row.tests * 1e3:>8.2f} ms {row.most / 1e6:>6.0f} MB "
            f"{row.before / 1e6:>6.0f} MB  {row.error:.1f}"
        )
    print(textwrap.fill(" ".join(NOTES.split()), 120))
    check(rows)


def check(rows: list[Row]) -> None:
    """The promises; SystemExit where a figure is not as promised."""
    for row in rows:
        check_error(row.tests, row.error)
    less, more = rows
    work = f"joint route, budget, tables of {more.tests} tests"
    detail = f"{more.time:.1f} s against {less.time:.1f} s of CPU time; largest error of K* {more.error:.1f} u"
    report(
        [
            at_most(work, f"{less.tests} tests", more.time / less.time, LINEAR, detail),
            at_most(work, "peak memory", more.most / 1e6, MOST_MEMORY / 1e6, unit="MB"),
        ]
    )


if __name__ == "__main__":
    main()
