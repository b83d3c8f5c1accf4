"""What a joint analysis leaves besides the tables of tests, by closed formulas: rig, residuals, budget, record."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import polars as pl

from fourpole.study.study import Study
from fourpole.study.tables import BUDGET, RESIDUALS, RIG

#: Unit, stated, u(stated), found, u(found), pull, seen from, finding of each value without a second mass.
VALUES: dict[str, tuple[Any, ...]] = {
    "moving_mass": ("kg", 15.0, 0.1, 15.02, 0.01, 0.2, 0.31, "found"),
    "preload_stiffness": ("N/m", 12440.0, 20.0, 12451.0, 6.0, 0.6, 61.0, "found"),
    "gain F1": ("1", 1.0, 0.01, 1.004, 0.0071, 0.6, 0.031, "found"),
    "gain V1": ("1", 1.0, 0.01, 1.0, 0.01, None, None, "not determined"),
    "phase V1": ("rad", 0.0, 0.01, 0.0, 0.01, float("nan"), float("nan"), "not determined"),
    "gain V2": ("1", 1.0, 0.01, 0.996, 0.0071, -0.6, 0.031, "found"),
    "gain F1/V1": ("1", 1.0, 0.0141, 1.004, 0.0122, 0.6, None, "found"),
}
#: The same with the added mass weighed: the channels against each other, but not all of them together.
MASSED = {
    **VALUES,
    "gain V1": ("1", 1.0, 0.01, 0.998, 0.0058, -0.2, None, "found"),
    "phase V1": ("rad", 0.0, 0.01, 0.001, 0.0058, 0.1, None, "found"),
    "gain F1/V1": ("1", 1.0, 0.0141, 1.006, 1e-4, 0.6, 0.043, "found"),
    "phase F1-V1": ("rad", 0.0, 0.0141, 0.002, 1e-4, 0.1, 0.043, "found"),
    "added mass 10 kg": ("kg", 10.0, 0.001, 10.0, 0.00099, 0.1, 0.02, "not determined"),
}
REMARKS = {
    "found": "found from your data",
    "not determined": "not determined by your data, taken from your statement",
    "contradicted": "contradicts your statement: look for the cause before you use it",
    "not calibrated": "the rig as stated does not fit: not calibrated",
    "unstated": "not stated by you, but the tests need it: look for its cause and state it",
}
#: What the tests need besides: a drift of a specimen, a frame and a cross-talk; no statement, no pull, no limit.
UNSTATED: dict[str, tuple[Any, ...]] = {
    "unstated frame": ("m/N", None, None, 1.1e-5, 3e-7, None, None, "unstated"),
    "cross-talk V2 in F1": ("1", None, None, 0.012, 5e-4, None, None, "unstated"),
    "drift of radial": ("1", None, None, -0.021, 1e-3, None, None, "unstated"),
    "loss angle drift of radial": ("rad", None, None, 0.0035, 2e-4, None, None, "unstated"),
}
#: Shares of the variance by source; K2 and C have the same.
SHARES = {"K1 branch gap": 0.5, "sensor noise": 0.3, "gain V1": 0.15, "moving_mass": 0.05}
JOINT: dict[str, Any] = {
    "tests": 120,
    "conditions": 60,
    "shared": 6,
    "chi2": 250.0,
    "dof": 240.0,
    "fits": True,
    "rig_error": 0.0,
    "inflation": 1.0,
    "scatter": 0.0,
    "converged": True,
    "reason": "",
    "steps": 5,
    "notes": [],
    "candidates": [],
    "gain_of_masses": {"without": {"K2": 0.056, "C": 0.086}, "with": {"K2": 0.00037, "C": 0.0004}},
}
MISFIT: dict[str, Any] = {
    "chi2": 2400.0,
    "fits": False,
    "rig_error": 0.02,
    "inflation": 1.5,
    "tied": 2,
    "candidates": [
        {
            "name": "tyre mass",
            "part": "mass",
            "value": 0.81,
            "std": 0.01,
            "unit": "kg",
            "explains": 2100.0,
            "text": "a moving mass 0.81 kg larger than stated, as an undeclared tyre mass would make it",
        },
        {
            "name": "sensor F1",
            "part": "gain F1",
            "value": 0.045,
            "std": 0.001,
            "unit": "1",
            "explains": 2000.0,
            "text": "a gain of F1 off by +4.5 %",
        },
    ],
}


def frame(rows: Sequence[Mapping[str, Any]], columns: Mapping[str, Any]) -> pl.DataFrame:
    return pl.DataFrame({name: [row.get(name) for row in rows] for name in columns}, schema=columns, strict=False)


def rig_table(values: Mapping[str, tuple[Any, ...]] = VALUES, rig: str = "") -> pl.DataFrame:
    names = ("unit", "stated", "u(stated)", "found", "u(found)", "pull [1]", "seen from", "finding")
    rows = []
    for value, cells in values.items():
        row = {"rig": rig, "value": value, **dict(zip(names, cells, strict=True))}
        row["posterior over prior [1]"] = row["u(found)"] / row["u(stated)"] if row["u(stated)"] else None
        rows.append({**row, "remarks": REMARKS[row["finding"]]})
    return frame(rows, RIG.columns)


def residual_table(dynamic: pl.DataFrame, **cells: float) -> pl.DataFrame:
    rows = [
        {
            "test": row["test"],
            "rig": row["rig"],
            "added mass [kg]": row["added mass [kg]"],
            "frequency [Hz]": row["frequency [Hz]"],
            "Re residual [N s/m]": 0.1 * (-1) ** at,
            "Im residual [N s/m]": 0.2 * (-1) ** at,
            "u(Re) [N s/m]": 0.1,
            "u(Im) [N s/m]": 0.2,
            "Re Zr [N s/m]": 15.0,
            "Im Zr [N s/m]": 800.0,
            "chi2 [1]": 2.0,
            "dof [1]": 2.0,
            "outlier [1]": 1.0,
            **cells,
        }
        for at, row in enumerate(dynamic.rows(named=True))
    ]
    return frame(rows, RESIDUALS.columns)


def budget_table(dynamic: pl.DataFrame, shares: Mapping[str, float] = SHARES) -> pl.DataFrame:
    units = {"K2": "N/m", "C": "N s/m", "Re K*": "N/m", "Im K*": "N/m"}
    rows = [
        {"test": test, "quantity": quantity, "unit": unit, "source": source, "u": share**0.5, "share [1]": share}
        for test in dynamic["test"].to_list()
        for quantity, unit in units.items()
        for source, share in shares.items()
    ]
    return frame(rows, BUDGET.columns)


def with_rig_found(
    results: Study,
    values: Mapping[str, tuple[Any, ...]] = VALUES,
    shares: Mapping[str, float] = SHARES,
    route: str = "joint",
    **joint: Any,
) -> Study:
    """The same results as the joint route would have left them; `joint` is what its record has else."""
    rigs = dict.fromkeys(str(name or "") for name in results.dynamic["rig"].to_list()) or {"": None}
    return replace(
        results,
        dynamic=results.dynamic.with_columns(pl.lit(route).alias("route")),
        record={**results.record, "joint": {rig: {**JOINT, **joint} for rig in rigs}},
        rig=pl.concat([rig_table(values, rig) for rig in rigs]),
        residuals=residual_table(results.dynamic),
        budget=budget_table(results.dynamic, shares),
    )
