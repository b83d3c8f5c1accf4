"""Pairs of virtual campaigns compared, their true differences known: `python validation/compared.py`.

The table of docs/compare.md: for each case, the root mean square of the error of a difference over its uncertainty, and
the share of differences that are seen, by quantity. One condition, four frequencies, sensors known to 0.5 % and 0.2°.
"""

from __future__ import annotations

import argparse
import os
import re
import sys
import tempfile
import warnings
from collections.abc import Callable
from dataclasses import replace
from math import radians
from pathlib import Path
from typing import Any

# One thread of linear algebra: the matrices are small.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
import polars as pl

from fourpole import analyse, compare
from fourpole.findings.compared import COMPARED, DIFFERS, Comparison
from fourpole.study import Study
from fourpole.virtual import RADIAL_PLY, VirtualTyre, simulate_campaign

_WHAT, _STD = ("gain", "phase"), (5e-3, radians(0.2))
_STATIC_STD = 2e-4
_RIG = {"moving_mass": (15.0, 0.15), "preload_stiffness": (12440.0, 120.0), "preload_damping": (15.0, 5.0)}
#: Quantity, error of the difference over its uncertainty, and whether it is seen.
Scores = list[tuple[str, float, bool]]
_FREQUENCIES = [11.0, 14.0, 18.0, 23.0]


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description="Hold compare against virtual campaigns.")
    parser.add_argument(
        "--pairs", type=int, default=50, metavar="N", help="pairs of each case; of runs four times as many"
    )
    asked = parser.parse_args()
    warnings.simplefilter("ignore")  # a campaign's warnings are among its results
    for name, (case, change, count) in CASES.items():
        found = [rows for number in range(count * asked.pairs) for rows in case(number, change)]
        sys.stdout.write(f"{name}, {count * asked.pairs} pairs\n")
        for quantity in COMPARED:
            own = [row for row in found if row[0] == quantity.column]
            rms = float(np.sqrt(np.mean([row[1] ** 2 for row in own])))
            seen = float(np.mean([row[2] for row in own]))
            sys.stdout.write(f"  {quantity.column:12} rms {rms:.2f}, seen {100 * seen:.1f} %\n")
        sys.stdout.flush()
    return 0


def _errors(rng: np.random.Generator) -> dict[str, Any]:
    """Errors of sensors and rig that a laboratory does not know, at most twice their standard uncertainty."""

    def drawn(std: float) -> float:
        return std * float(np.clip(rng.standard_normal(), -2.0, 2.0))

    channels = [
        (f"{what} {one}", std) for what, std in zip(("gain", "phase"), _STD, strict=True) for one in ("F1", "V1", "V2")
    ]
    channels += [("gain F", _STATIC_STD), ("gain x", _STATIC_STD)]
    return {
        "undeclared": {name: drawn(std) for name, std in channels},
        "rig_error": {name: drawn(std / value) for name, (value, std) in _RIG.items()},
    }


def _run(seed: int, tyres: list[VirtualTyre], errors: dict[str, Any], *, serials: bool = False) -> Study:
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place) / "campaign"
        simulate_campaign(
            folder, seed=seed, tyres=tyres, pressures=[170e3], preloads=[1000.0], frequencies=_FREQUENCIES,
            sensors=_STD, rig_std={name: std for name, (_, std) in _RIG.items()}, **errors,
        )  # fmt: skip
        if serials:
            path = folder / "campaign.toml"
            path.write_text(re.sub(r'column = "(F1|V1|V2|F|x)"', r'column = "\1", serial = "SN \1"', path.read_text()))
        return analyse(folder, monte_carlo=0, workers=1)


def _scores(compared: Comparison, change: float) -> Scores:
    """Error of each difference over its uncertainty, and whether it is seen; the loss angle does not change."""
    rows = compared.rows.with_columns(
        (
            pl.col("difference")
            - pl.when(pl.col("quantity") == "loss angle").then(0.0).otherwise(change * pl.col("first"))
        )
        / pl.col("u(difference)")
    )
    return [
        (name, error, verdict == DIFFERS)
        for name, error, verdict in rows.select("quantity", "difference", "verdict").rows()
    ]


def _changed(change: float) -> VirtualTyre:
    return replace(RADIAL_PLY.changed(1.0 + change), name="other" if change else RADIAL_PLY.name)


def _two_runs(number: int, change: float) -> Scores:
    """Two campaigns with the same sensors, which have serial numbers, on the same rig."""
    errors = _errors(np.random.default_rng(1000 + number))
    tyres = RADIAL_PLY, _changed(change)
    pair = (_run(2 * number + at, [tyre], errors, serials=True) for at, tyre in enumerate(tyres))
    return _scores(compare(*pair), change)


def _other_sensors(number: int, change: float) -> Scores:
    """Two campaigns on one rig with sensors of their own, which are stated by the same text without serial numbers."""
    rng = np.random.default_rng(1000 + number)
    first = _errors(rng)
    both = first, {**_errors(rng), "rig_error": first["rig_error"]}
    tyres = RADIAL_PLY, _changed(change)
    pair = (_run(2 * number + at, [tyres[at]], errors) for at, errors in enumerate(both))
    return _scores(compare(*pair), change)


def _one_campaign(number: int, change: float) -> Scores:
    """Two tyres in one campaign."""
    study = _run(number, [RADIAL_PLY, _changed(change)], _errors(np.random.default_rng(1000 + number)))
    return _scores(compare(study, specimens=(RADIAL_PLY.name, "other")), change)


def _apart(number: int, change: float) -> Scores:
    """Two campaigns with sensors and rigs of their own."""
    rng = np.random.default_rng(1000 + number)
    pair = (_run(2 * number + at, [tyre], _errors(rng)) for at, tyre in enumerate((RADIAL_PLY, _changed(change))))
    return _scores(compare(*pair, independent=True), change)


#: Each case: how a pair is compared, the relative change of K1 and K*, and how many times as many pairs it has.
CASES: dict[str, tuple[Callable[[int, float], Scores], float, int]] = {
    "two runs of one tyre, errors in common": (_two_runs, 0.0, 4),
    "two tyres of one campaign, 3 % apart": (_one_campaign, 0.03, 1),
    "two tyres of two campaigns, 3 % apart": (_two_runs, 0.03, 1),
    "two tyres of two campaigns, 15 % apart": (_two_runs, 0.15, 1),
    "two runs of one tyre on one rig, other sensors of equal text": (_other_sensors, 0.0, 1),
    "two runs on sensors and rigs of their own, independent": (_apart, 0.0, 1),
}


if __name__ == "__main__":
    raise SystemExit(main())
