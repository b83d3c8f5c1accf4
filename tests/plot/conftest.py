"""Results of campaigns that were never run: closed formulas written straight into the tables."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import polars as pl
import pytest
from tests.plot.rig_found import with_rig_found

from fourpole.core.rig import Rig
from fourpole.core.tyre import mobility, transmissibility, zener_stiffness
from fourpole.study.study import Study
from fourpole.study.tables import DYNAMIC, STATIC
from fourpole.virtual import CROSS_PLY, RADIAL_PLY, VirtualTyre

RIG = Rig(moving_mass=15.0, preload_stiffness=12440.0, preload_damping=15.0)
STATED = {
    "": {
        "output": "moving",
        "moving_mass": {"value": 15.0, "std": 0.01, "unit": "kg", "assumed": False},
        "preload_stiffness": {"value": 12440.0, "std": 20.0, "unit": "N/m", "assumed": False},
        "preload_damping": {"value": 15.0, "std": 0.5, "unit": "N s/m", "assumed": False},
    }
}
PRESSURES = (100e3, 135e3, 170e3, 205e3, 240e3)
FREQUENCIES = (10.0, 14.0, 17.0, 18.0, 19.0, 24.0)


def frame(rows: Sequence[dict[str, object]], columns: Mapping[str, Any]) -> pl.DataFrame:
    return pl.DataFrame({name: [row.get(name) for row in rows] for name in columns}, schema=columns, strict=False)


def dynamic_row(tyre: VirtualTyre, pressure: float, preload: float, frequency: float, number: int) -> dict[str, object]:
    """One test whose every cell follows from the tyre's laws and the rig."""
    real = frequency * (1.0 + 0.003 * np.sin(7.0 * number))
    omega = 2 * np.pi * real
    k1 = float(tyre.static_stiffness(pressure, preload))
    k2, c = float(tyre.k2(real, pressure, preload)), float(tyre.c(real, pressure, preload))
    stiffness = complex(zener_stiffness(k1, k2, c, omega))
    rig = {"mass": 15.0, "preload_stiffness": 12440.0, "preload_damping": 15.0}
    v1 = 1e-3 * omega
    f1 = v1 / complex(mobility(stiffness, omega, **rig))
    v2 = v1 * complex(transmissibility(stiffness, omega, **rig))
    return {
        "test": f"D{number}",
        "rig": "",
        "tyre": tyre.name,
        "construction": "",
        "pressure [Pa]": pressure,
        "preload [N]": preload,
        "added mass [kg]": 0.0,
        "frequency [Hz]": real,
        "F1 [N]": abs(f1),
        "V1 [m/s]": v1,
        "V2 [m/s]": abs(v2),
        "phase F1-V1 [rad]": float(np.angle(f1)),
        "phase V2-V1 [rad]": float(np.angle(v2)),
        "R [m/(N s)]": (v1 / f1).real,
        "I [m/(N s)]": (v1 / f1).imag,
        "u(R) [m/(N s)]": 1e-7,
        "u(I) [m/(N s)]": 1e-7,
        "Re K* [N/m]": stiffness.real,
        "Im K* [N/m]": stiffness.imag,
        "u(Re K*) [N/m]": 300.0,
        "u(Im K*) [N/m]": 300.0,
        "loss factor [1]": stiffness.imag / stiffness.real,
        "u(loss factor) [1]": 1e-3,
        "K1 [N/m]": k1,
        "u(K1) [N/m]": 1e3,
        "K2 [N/m]": k2,
        "C [N s/m]": c,
        "u(K2) [N/m]": 0.02 * k2,
        "u(C) [N s/m]": 0.03 * c,
        "TR measured [1]": abs(v2 / v1),
        "TR predicted [1]": abs(v2 / v1) * 1.001,
        "u(TR) [1]": 1e-3,
        "route": "mobility",
        "verdict": "ok",
        "remarks": "",
    }


def static_rows(tyre: VirtualTyre, pressure: float, preloads: Sequence[float], name: str) -> list[dict[str, object]]:
    return [
        {
            "test": name,
            "tyre": tyre.name,
            "construction": "",
            "pressure [Pa]": pressure,
            "preload [N]": preload,
            "K1 [N/m]": float(tyre.static_stiffness(pressure, preload)),
            "u(K1) [N/m]": 1e3,
            "verdict": "ok",
            "remarks": "",
        }
        for preload in preloads
    ]


def results_of(
    tyres: Sequence[VirtualTyre] = (CROSS_PLY, RADIAL_PLY),
    pressures: Sequence[float] = PRESSURES,
    preloads: Sequence[float] = (1000.0, 2000.0),
    frequencies: Sequence[float] = FREQUENCIES,
) -> Study:
    static: list[dict[str, object]] = []
    dynamic: list[dict[str, object]] = []
    previews: list[dict[str, object]] = []
    for tyre in tyres:
        for pressure in pressures:
            name = f"S{len(previews) + 1}"
            static += static_rows(tyre, pressure, preloads, name)
            # A transducer's zero is where it was screwed on.
            x = np.linspace(0.0, tyre.deflection(3500.0, pressure), 60)
            load = tyre.load(x, pressure)
            previews.append({"test": name, "mean deflection [m]": (x + 0.004).tolist(), "mean load [N]": load.tolist()})
            for preload in preloads:
                for frequency in frequencies:
                    dynamic.append(dynamic_row(tyre, pressure, preload, frequency, len(dynamic) + 1))
    results = Study(
        static=frame(static, STATIC.columns),
        dynamic=frame(dynamic, DYNAMIC.columns),
        previews=pl.DataFrame(previews),
        record={"title": "closed formulas", "stated": {"rigs": STATED}},
    )
    return with_rig_found(results, route="mobility")


def empty_results() -> Study:
    return Study(frame([], STATIC.columns), frame([], DYNAMIC.columns), pl.DataFrame(), {})


def renamed(results: Study, names: dict[str, str]) -> Study:
    static, dynamic = (table.with_columns(pl.col("tyre").replace(names)) for table in (results.static, results.dynamic))
    return replace(results, static=static, dynamic=dynamic)


def changed(results: Study, change: Callable[[pl.DataFrame], pl.DataFrame]) -> Study:
    return replace(results, dynamic=change(results.dynamic))


def blank(results: Study, *columns: str) -> Study:
    return changed(results, lambda table: table.with_columns(pl.lit(None, pl.Float64).alias(name) for name in columns))


@pytest.fixture(scope="session")
def study() -> Study:
    """The two tyres at five pressures, two preloads and six frequencies."""
    return results_of()
