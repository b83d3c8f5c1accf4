"""The analysis of the demonstration campaign beside its former self: python bench/bench_demo.py.

That version cannot be run here. Both are held against a fixed work of the same run: curve_fit of a sine of 4 parameters
to each of the three channels of each dynamic recording, read with polars.
"""

from __future__ import annotations

import os

# One thread of linear algebra, else the times tell what else the machine is doing.
os.environ["OPENBLAS_NUM_THREADS"] = "1"

import shutil
import tempfile
from pathlib import Path
from statistics import median

import numpy as np
import polars as pl
from promises import FOURPOLE, Kept, at_least, own_cpu, report, run
from scipy.optimize import curve_fit

from fourpole.virtual import BELTED, RADIAL_PLY, RUBBER_MOUNT, simulate_campaign

SEED, ROUNDS = 1982, 3
#: CPU time of the analysis with report before all steps of a reduction used one set of sums, over that of the fixed
#: work in the same round: median of three rounds of the commit before, on one machine with two cores.
FORMER = {"--no-models": 4.48, "--models": 6.49}
#: Option -> how many times faster at least.
FASTER = {"--no-models": 1.6, "--models": 1.3}
#: The demonstration of an earlier time, kept by its seed.
CAMPAIGN = {
    "tyres": BELTED,
    "sensors": (5e-3, np.radians(0.2)),
    "rig_std": {"moving_mass": 0.15, "preload_stiffness": 120.0, "preload_damping": 5.0},
    "added_masses": (0.0, 10.0),
    "added_mass_at": (RADIAL_PLY.name, 170e3, 1000.0),
    "mounts": (RUBBER_MOUNT,),
}


def wave(t, cosine, sine, omega, mean):
    return cosine * np.cos(omega * t) - sine * np.sin(omega * t) + mean


def fixed_work(folder: Path) -> float:
    """CPU time of the sine fits [s]; SystemExit if a fit does not find the frequency."""
    start = own_cpu()
    tests = pl.read_csv(folder / "tests.csv").filter(pl.col("kind") == "dynamic")
    for name, frequency in tests.select("file", "frequency [Hz]").rows():
        table = pl.read_csv(folder / name).to_numpy()
        t, omega = table[:, 0] - table[:, 0].mean(), 2 * np.pi * frequency
        for x in table[:, 1:].T:
            guess = 2 * np.mean((x - x.mean()) * np.exp(-1j * omega * t))
            found = curve_fit(wave, t, x, p0=[guess.real, guess.imag, omega, x.mean()])[0]
            if abs(found[2] / omega - 1) > 0.02:
                raise SystemExit(f"{name}: the sine fit has lost the frequency")
    return own_cpu() - start


def analysis(folder: Path, option: str) -> float:
    """CPU time of the analysis with figures and report, and nothing left of a former one [s]."""
    shutil.rmtree(folder / "results", ignore_errors=True)
    return run([*FOURPOLE, "analyse", str(folder), option]).cpu


def check(folder: Path) -> str:
    """All tests are used, and K' is true within 5 of its uncertainties; SystemExit if not."""
    results, truth = folder / "results", pl.read_csv(folder / "truth.csv", infer_schema_length=None)
    rows = pl.read_csv(results / "dynamic.csv", infer_schema_length=None).join(truth, on="test", suffix=" true")
    head = "Re K* [N/m]"
    error = (rows[head] - rows[f"{head} true"]).abs() / rows["u(Re K*) [N/m]"]
    if not (rows.height and float(error.max()) < 5 and (results / "report.html").is_file()):
        raise SystemExit(f"the demonstration's K' is {error.max()} of its uncertainties off, or has no report")
    return f"{rows.height} tests, largest error of K' {float(error.max()):.1f} u"


def main() -> None:
    lines: list[Kept] = []
    with tempfile.TemporaryDirectory(prefix="fourpole-bench-") as place:
        folder = Path(place, "demo")
        simulate_campaign(folder, seed=SEED, **CAMPAIGN)
        for option, former in FORMER.items():
            analysis(folder, option)
            same = check(folder)
            rounds = [(analysis(folder, option), fixed_work(folder)) for _ in range(ROUNDS)]
            found = median(ours / fixed for ours, fixed in rounds)
            took = median(ours for ours, _ in rounds)
            detail = f"{found:.2f} times a fixed work, {former:.1f} before; {took:.1f} s of CPU time; {same}"
            work = f"analyse on the demonstration, report {'with' if option == '--models' else 'without'} models"
            lines.append(at_least(work, "before", former / found, FASTER[option], detail))
    report(lines)


if __name__ == "__main__":
    main()
