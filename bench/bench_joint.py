"""Time and memory of the joint route over the number of tests: python bench/bench_joint.py."""

from __future__ import annotations

import os
import platform
import textwrap
import time
from dataclasses import dataclass
from itertools import pairwise

# One thread of linear algebra, else the times tell what else the machine is doing.
os.environ["OPENBLAS_NUM_THREADS"] = "1"

import numpy as np
from laboratory import LABORATORY, check_error
from promises import alone, at_most, own_memory, report

from fourpole import Rig
from fourpole.core.channelerrors import ChannelUncertainty
from fourpole.core.joint import solve_joint
from fourpole.core.joint.outputs import identification
from fourpole.virtual.phasor_rig import RIG_VALUES, Conditions, simulate_phasors

SEED = 1982
#: Tests -> rounds.
SIZES = {1_000: 5, 10_000: 3, 100_000: 1}
#: Tests -> most times as long as a tenth of them takes.
LINEAR = {10_000: 11.0, 100_000: 12.0}
#: Tests -> most memory that the process ever has [bytes].
MOST_MEMORY = {10_000: 0.3e9, 100_000: 0.6e9}
NOTES = f"""Tests of many tyres, 10 frequencies each, with 0 and 10 kg added; sensors known to 3 % and 1 degree, m and
K3 to 2 %, noise 1e-4; 10 shared values. 'solve': solve_joint, from amplitudes to the most probable values,
the rig judged; 'outputs': K*, K2, C, TR of each test with all covariances. Each size in a process of its
own; times are medians. Memory is the most that the process ever had, with Python and its libraries
('before': those and the amplitudes). Checked: the search came to rest; K* within 6 of its uncertainties
everywhere; ten times the tests take at most {LINEAR[10_000]:g} times (100 000: {LINEAR[100_000]:g}) the
time; memory below {MOST_MEMORY[10_000] / 1e9:g} GB at 10 000 tests."""


@dataclass(frozen=True)
class Row:
    """One size: times in seconds, memory in bytes, steps of the search, largest error of K* in its uncertainty."""

    tests: int
    solve: float
    outputs: float
    before: int
    most: int
    steps: int
    error: float


def measure(count: int) -> Row:
    """Time, memory and largest error of K* for this number of tests."""
    rng = np.random.default_rng(SEED)
    families = count // 20
    family = np.repeat(np.arange(families), 20)
    frequency = np.tile(np.repeat(np.linspace(10.0, 24.0, 10), 2), families) * (1 + rng.uniform(-3e-3, 3e-3, count))
    added = np.tile([0.0, 10.0], count // 2)
    k1, k2, c = rng.uniform([[1.2e5], [8e4], [600.0]], [[2.4e5], [1.8e5], [1400.0]], (3, families))
    k1 = k1[family]
    tests = Conditions(
        frequency, k1, k2[family] * (frequency / 15) ** 0.6, c[family] * (frequency / 15) ** 0.2, added_mass=added
    )
    run = simulate_phasors(LABORATORY, tests, rng)
    stated = {name: getattr(LABORATORY, name) for name in RIG_VALUES}
    rig = Rig(**{n: value for n, (value, _) in stated.items()}, std={n: std for n, (_, std) in stated.items()})
    channels = ChannelUncertainty(np.array(LABORATORY.std_gain), np.array(LABORATORY.std_phase))
    before = own_memory()

    times = []
    for _ in range(SIZES[count]):
        start = time.perf_counter()
        joint = solve_joint(
            run.phasors, rig, k1, family=family, added_mass=added, added_mass_std=1e-4 * added, channels=channels
        )
        solved = time.perf_counter()
        found = identification(joint, run.phasors, k1, 0.01 * k1)
        times.append((solved - start, time.perf_counter() - solved))
    solve, outputs = np.median(times, axis=0)

    off = found.stiffness - run.stiffness
    u = np.sqrt(np.diagonal(found.stiffness_covariance, axis1=1, axis2=2))
    error = float(np.max(np.abs(np.stack([off.real, off.imag], axis=1)) / u))
    if not joint.solution.converged:
        raise SystemExit(f"{count} tests: {joint.solution.reason}")
    return Row(count, float(solve), float(outputs), before, own_memory(), joint.solution.steps, error)


def main() -> None:
    print(f"Python {platform.python_version()}, numpy {np.__version__}")
    heads = ("tests", "solve", "outputs", "per test", "memory", "before", "steps", "largest error of K* / u")
    print("{:>8} {:>11} {:>11} {:>11} {:>9} {:>9} {:>6}  {}".format(*heads))
    rows = []
    for count in SIZES:
        rows.append(row := alone(measure, count))
        each = (row.solve + row.outputs) / row.tests
        print(
            f"{row.tests:>8} {row.solve * 1e3:>8.1f} ms {row.outputs * 1e3:>8.1f} ms {each * 1e6:>8.1f} us "
            f"{row.most / 1e6:>6.0f} MB {row.before / 1e6:>6.0f} MB {row.steps:>6}  {row.error:.1f}"
        )
    print(textwrap.fill(" ".join(NOTES.split()), 120))
    check(rows)


def check(rows: list[Row]) -> None:
    """SystemExit where a figure is not as promised."""
    for row in rows:
        check_error(row.tests, row.error)
    lines = []
    for less, more in pairwise(rows):
        took = [one.solve + one.outputs for one in (less, more)]
        detail = f"{took[1]:.2f} s against {took[0]:.2f} s"
        work = f"joint route of {more.tests} tests, with all covariances"
        lines.append(at_most(work, f"of {less.tests}", took[1] / took[0], LINEAR[more.tests], detail))
    for row in rows:
        if (limit := MOST_MEMORY.get(row.tests)) is not None:
            work = f"joint route of {row.tests} tests"
            lines.append(at_most(work, "memory of the process", row.most / 1e6, limit / 1e6, unit="MB"))
    report(lines)


if __name__ == "__main__":
    main()
