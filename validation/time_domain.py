"""One campaign in the time domain: its recordings are written, read, demodulated and analysed."""

from __future__ import annotations

import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
from laboratories import MASSES

from fourpole.study import analyse
from fourpole.virtual import CROSS_PLY, RADIAL_PLY, Belt, simulate_campaign

__all__ = ["RANGES", "run"]

_SEED = 2**20  # so that no number is that of an example

RANGES = {
    "gain of F1, V1, V2, each known to": "0.02 % to 3 %, phase to 20 degrees times that",
    "moving mass and preload spring, known to": "0.1 % to 3 %",
    "tests": "8 to 72: one or both virtual tyres at two pressures and 1000 N; 4, 6 or 8 frequencies from 10 to 24 Hz",
    "masses": "0; or 0 and 10; or 0, 5 and 10 kg; known to 0.01 %, and in truth exact",
    "declared, each in 1 of 4 campaigns": "tyre mass 0.8 kg, frame 1 MN/m, loss factor 0.05; each known to 2 %",
    "belts, in 1 of 4 campaigns": "of each tyre 0.5 to 8 kg, springs as 0.2; the cam has 0.5 mm in place of 1 mm",
    "weight of the tyres, stated in half of these": "the belt is 40 to 80 % of it",
    "errors": "normal, but no larger than twice what is stated: their own root mean square is 0.96 of it",
}
_VALUES = {"K'": "Re K* [N/m]", "K''": "Im K* [N/m]", "K1": "K1 [N/m]", "K2": "K2 [N/m]", "C": "C [N s/m]"}


def run(number: int) -> dict[str, Any]:
    """Errors over uncertainty, and uncertainty over value, by quantity."""
    rng = np.random.default_rng(np.random.SeedSequence(_SEED, spawn_key=(number,)))
    gain = float(np.exp(rng.uniform(np.log(2e-4), np.log(0.03))))
    share = float(np.exp(rng.uniform(np.log(1e-3), np.log(0.03))))
    masses = str(rng.choice(list(MASSES)))
    frequencies = np.linspace(10.0, 24.0, int(rng.choice([4, 8] if masses == "one mass" else [4, 6])))
    tyres = [CROSS_PLY, RADIAL_PLY] if rng.random() < 0.5 else [RADIAL_PLY]
    pressures = rng.choice([100e3, 135e3, 170e3, 205e3, 240e3], 2, replace=False)
    further = {"tyre_mass": 0.8, "frame_stiffness": 1e6, "preload_loss_factor": 0.05}
    declared = {name: value for name, value in further.items() if rng.random() < 0.25}
    laden = rng.random() < 0.25
    if laden:
        belts = [float(np.exp(rng.uniform(np.log(0.5), np.log(8.0)))) for _ in tyres]
        weighed = rng.random() < 0.5
        weights = [belt / float(rng.uniform(0.4, 0.8)) if weighed else None for belt in belts]
        tyres = [
            replace(tyre, inertia=Belt(belt), weight=weight)
            for tyre, belt, weight in zip(tyres, belts, weights, strict=True)
        ]
    with tempfile.TemporaryDirectory() as place:
        made = simulate_campaign(
            Path(place) / "campaign",
            seed=_SEED + number,
            tyres=tyres,
            pressures=sorted(pressures.tolist()),
            preloads=[1000.0],
            frequencies=frequencies.tolist(),
            added_masses=MASSES[masses],
            sensors=(gain, float(np.deg2rad(20.0 * gain))),
            rig_std={"moving_mass": 15.0 * share, "preload_stiffness": 12440.0 * share},
            declared=declared,
            eccentricity=0.5e-3 if laden else 1e-3,
        )
        study = analyse(made.folder, route="joint")
        truth = pl.read_csv(made.folder / "truth.csv", infer_schema_length=None)
    rows = study.dynamic.join(truth, on="test", suffix=" true")
    result: dict[str, Any] = {
        "number": number,
        "sensors": gain,
        "rig std": share,
        "masses": masses,
        "belts": [tyre.inertia.mass for tyre in tyres if tyre.inertia],
        "tests": rows.height,
        "verdicts": {str(name): count for name, count in rows["verdict"].value_counts().iter_rows()},
        "routes": sorted(set(rows["route"].to_list())),
        "remarks": sorted({str(remark) for remark in rows["remarks"].drop_nulls().to_list() if remark})[:5],
        "joint": [
            {name: getattr(rig, name) for name in ("chi2", "dof", "fits", "inflation", "scatter")} for rig in study.rigs
        ],
        "z": {},
        "relative": {},
    }
    for name, column in _VALUES.items():
        true = rows[f"{column} true"]
        _add(result, name, rows[column], true, rows[f"u({column.partition(' [')[0]}) {column[column.index('[') :]}"])
    true_loss = rows["Im K* [N/m] true"] / rows["Re K* [N/m] true"]
    _add(result, "loss factor", rows["loss factor [1]"], true_loss, rows["u(loss factor) [1]"])
    _add(result, "TR", rows["TR predicted [1]"], rows["TR [1]"], rows["u(TR) [1]"])
    return result


def _add(result: dict[str, Any], name: str, found: pl.Series, true: pl.Series, u: pl.Series) -> None:
    columns = [each.cast(pl.Float64).fill_null(float("nan")).to_numpy() for each in (found, true, u)]
    value, exact, std = columns
    with np.errstate(divide="ignore", invalid="ignore"):
        for kind, values in (("z", (value - exact) / std), ("relative", std / np.abs(value))):
            result[kind][name] = [float(f"{each:.4g}") if np.isfinite(each) else None for each in values]
