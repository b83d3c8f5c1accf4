"""The result tables, their columns in the order of the contract."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray

from fourpole.campaign.folder import Campaign, Test
from fourpole.campaign.identified import Group, budget_columns
from fourpole.campaign.outcome import Point
from fourpole.campaign.static import StaticRow, StaticTest
from fourpole.core.demodulation.preview import Preview
from fourpole.core.identify import OUTPUTS, Identification
from fourpole.core.loadcurve import LoadCurve
from fourpole.core.phasor import SYMBOLS, Phasors

__all__ = [
    "BUDGET_COLUMNS",
    "COVARIANCE_COLUMNS",
    "DYNAMIC_COLUMNS",
    "QUANTILE_COLUMNS",
    "RESIDUAL_COLUMNS",
    "RIG_COLUMNS",
    "STATIC_COLUMNS",
    "TEXT_COLUMNS",
    "amplitude_cells",
    "budget_table",
    "correction_table",
    "covariance_cells",
    "covariance_table",
    "dynamic_table",
    "phasor_table",
    "preview_table",
    "quantile_table",
    "residual_table",
    "rig_table",
    "static_table",
    "tyre_cells",
]

STATIC_COLUMNS = (
    "test",
    "tyre",
    "construction",
    "pressure [Pa]",
    "preload [N]",
    "K1 [N/m]",
    "u(K1) [N/m]",
    "secant [N/m]",
    "hysteresis loss [J]",
    "nonlinearity [1]",
    "verdict",
    "remarks",
)

DYNAMIC_COLUMNS = (
    "test",
    "rig",
    "tyre",
    "construction",
    "pressure [Pa]",
    "preload [N]",
    "added mass [kg]",
    "temperature [degC]",
    "frequency [Hz]",
    "F1 [N]",
    "V1 [m/s]",
    "V2 [m/s]",
    "phase F1-V1 [rad]",
    "phase V2-V1 [rad]",
    "R [m/(N s)]",
    "I [m/(N s)]",
    "u(R) [m/(N s)]",
    "u(I) [m/(N s)]",
    "corr(R,I) [1]",
    "Re K* [N/m]",
    "Im K* [N/m]",
    "u(Re K*) [N/m]",
    "u(Im K*) [N/m]",
    "corr(Re,Im K*) [1]",
    "loss factor [1]",
    "u(loss factor) [1]",
    "K1 [N/m]",
    "u(K1) [N/m]",
    "K2 [N/m]",
    "C [N s/m]",
    "u(K2) [N/m]",
    "u(C) [N s/m]",
    "corr(K2,C) [1]",
    "TR measured [1]",
    "TR predicted [1]",
    "u(TR) [1]",
    "route",
    "verdict",
    "remarks",
)
CORRECTION_COLUMNS = (
    "test",
    "frequency [Hz]",
    "channel",
    "correction",
    "gain [1]",
    "phase [rad]",
    "u(gain) [1]",
    "u(phase) [rad]",
)
TEXT_COLUMNS = {
    "channel",
    "correction",
    "test",
    "rig",
    "tyre",
    "construction",
    "route",
    "verdict",
    "remarks",
    "value",
    "unit",
    "finding",
    "quantity",
    "source",
}


def static_table(campaign: Campaign, rows: Sequence[StaticRow]) -> pl.DataFrame:
    """static.csv."""
    return _frame([_static_cells(campaign, row) for row in rows], STATIC_COLUMNS)


def _static_cells(campaign: Campaign, row: StaticRow) -> dict[str, Any]:
    return {
        "test": row.test.name,
        "tyre": row.test.tyre,
        "construction": _construction(campaign, row.test),
        "pressure [Pa]": row.test.value("pressure"),
        "preload [N]": row.preload,
        "K1 [N/m]": row.stiffness,
        "u(K1) [N/m]": row.std,
        "secant [N/m]": row.secant,
        "hysteresis loss [J]": row.loss,
        "nonlinearity [1]": row.nonlinearity,
        "verdict": row.verdict,
        "remarks": "; ".join(row.remarks),
    }


def dynamic_table(campaign: Campaign, tests: Sequence[Test], cells: Sequence[dict[str, Any]]) -> pl.DataFrame:
    """dynamic.csv: identity of each test, what was found of it, and what tests.csv had more."""
    taken = set(DYNAMIC_COLUMNS)
    names = {label: label if label not in taken else f"{label} (tests.csv)" for label in campaign.extra_columns}
    if any(test.window is not None for test in tests):
        names["window [s]"] = "window [s]"
    rows = []
    for test, found in zip(tests, cells, strict=True):
        more = dict(test.extra)
        if test.window is not None:
            more["window [s]"] = f"{test.window[0]:g}..{test.window[1]:g}"
        rows.append(
            {
                "test": test.name,
                "rig": test.rig,
                "tyre": test.tyre,
                "construction": _construction(campaign, test),
                "pressure [Pa]": test.value("pressure"),
                "preload [N]": test.value("preload"),
                "added mass [kg]": test.value("added_mass") or 0.0,
                "temperature [degC]": test.value("temperature"),
                **found,
                **{name: more.get(label) for label, name in names.items()},
            }
        )
    return _frame(rows, DYNAMIC_COLUMNS, tuple(names.values()))


RIG_COLUMNS = (
    "rig",
    "value",
    "unit",
    "stated",
    "u(stated)",
    "found",
    "u(found)",
    "posterior over prior [1]",
    "pull [1]",
    "seen from",
    "finding",
    "remarks",
)
RESIDUAL_COLUMNS = (
    "test",
    "rig",
    "added mass [kg]",
    "frequency [Hz]",
    "Re residual [N s/m]",
    "Im residual [N s/m]",
    "u(Re) [N s/m]",
    "u(Im) [N s/m]",
    "Re Zr [N s/m]",
    "Im Zr [N s/m]",
    "chi2 [1]",
    "dof [1]",
    "outlier [1]",
)
BUDGET_COLUMNS = ("test", "quantity", "unit", "source", "u", "share [1]")
QUANTILE_COLUMNS = ("test", "quantity", "unit", "2.5 %", "50 %", "97.5 %", "impassive share [1]")


def rig_table(groups: Sequence[Group]) -> pl.DataFrame:
    """rig.csv: each shared value as stated and as found."""
    learned = [(group, group.learned) for group in groups if group.learned is not None]
    rows = [{"rig": group.setup.rig_name, **row} for group, found in learned for row in found.values]
    return _frame(rows, RIG_COLUMNS)


def residual_table(groups: Sequence[Group]) -> pl.DataFrame:
    """residuals.csv: F1/V2 - Zr of each test that the joint route used."""
    learned = [(group, group.learned) for group in groups if group.learned is not None]
    rows = [{"rig": group.setup.rig_name, **row} for group, found in learned for row in found.residuals]
    return _frame(rows, RESIDUAL_COLUMNS)


def budget_table(groups: Sequence[Group]) -> pl.DataFrame:
    """budget.csv: what each source gives to the uncertainty of each output of each test."""
    types = {name: pl.Float64 if name in ("u", "share [1]") else pl.String for name in BUDGET_COLUMNS}
    frames = [pl.DataFrame(schema=types)]
    for group in groups:
        columns = {name: np.concatenate(parts) for name, parts in budget_columns(group).items()}
        names = {
            "test": pl.Series(group.names, dtype=pl.String).gather(columns["test"]),
            "quantity": pl.Series(list(OUTPUTS)).gather(columns["quantity"]),
            "unit": pl.Series(list(OUTPUTS.values())).gather(columns["quantity"]),
            "source": pl.Series(list(group.variance)).gather(columns["source"]),
        }
        frames.append(pl.DataFrame({**names, "u": columns["u"], "share [1]": columns["share"]}, schema=types))
    return pl.concat(frames)


def quantile_table(groups: Sequence[Group]) -> pl.DataFrame:
    """quantiles.csv: drawn intervals of K2 and C, where linear propagation fails."""
    rows = []
    for group in groups:
        for at, pair in group.intervals.items():
            for (quantity, unit), drawn in zip((("K2", "N/m"), ("C", "N s/m")), pair, strict=True):
                values = dict(zip(("2.5 %", "50 %", "97.5 %"), drawn.quantiles.tolist(), strict=True))
                row = {"test": group.names[at], "quantity": quantity, "unit": unit, **values}
                rows.append({**row, "impassive share [1]": drawn.impassive})
    return _frame(rows, QUANTILE_COLUMNS)


def correction_table(tests: Sequence[Test], points: Sequence[Point]) -> pl.DataFrame:
    """corrections.csv: what was undone at the amplitudes of each test."""
    rows = [
        {
            "test": test.name,
            "frequency [Hz]": float(item.phasors.frequency),
            "channel": SYMBOLS[row.channel],
            "correction": row.name,
            "gain [1]": row.gain,
            "phase [rad]": row.phase,
            "u(gain) [1]": row.gain_std,
            "u(phase) [rad]": row.phase_std,
        }
        for test, item in zip(tests, points, strict=True)
        if item.phasors is not None
        for row in item.corrections
    ]
    return _frame(rows, CORRECTION_COLUMNS)


def amplitude_cells(phasors: Phasors) -> dict[str, float]:
    """Frequency, amplitudes and phases of one test."""
    f1, v1, v2 = phasors.amplitudes
    return {
        "frequency [Hz]": float(phasors.frequency),
        "F1 [N]": float(abs(f1)),
        "V1 [m/s]": float(abs(v1)),
        "V2 [m/s]": float(abs(v2)),
        "phase F1-V1 [rad]": float(np.angle(f1 / v1)),
        "phase V2-V1 [rad]": float(np.angle(v2 / v1)),
    }


def phasor_table(tests: Sequence[Test], points: Sequence[Point]) -> pl.DataFrame:
    """phasors.parquet: complex amplitudes with their 6×6 covariance, row by row as a list of 36."""
    kept = [(test, item.phasors) for test, item in zip(tests, points, strict=True) if item.phasors is not None]
    columns: dict[str, Any] = {
        "test": [test.name for test, _ in kept],
        "rig": [test.rig for test, _ in kept],
        "frequency [Hz]": [float(p.frequency) for _, p in kept],
        "u(frequency) [Hz]": [float(p.frequency_std) for _, p in kept],
    }
    for i, (name, unit) in enumerate((("F1", "N"), ("V1", "m/s"), ("V2", "m/s"))):
        columns[f"Re {name} [{unit}]"] = [float(p.amplitudes[i].real) for _, p in kept]
        columns[f"Im {name} [{unit}]"] = [float(p.amplitudes[i].imag) for _, p in kept]
    columns["covariance Re F1, Im F1, Re V1, Im V1, Re V2, Im V2"] = [p.covariance.ravel().tolist() for _, p in kept]
    columns["dof [1]"] = [float(p.dof) for _, p in kept]
    types = {name: pl.String if name in TEXT_COLUMNS else pl.Float64 for name in columns}
    listed = "covariance Re F1, Im F1, Re V1, Im V1, Re V2, Im V2"
    return pl.DataFrame(columns, schema={**types, listed: pl.Array(pl.Float64, 36)}, strict=False)


COVARIANCE_COLUMNS = (
    "test",
    "rig",
    "condition",
    "own covariance Re, Im K* [N2/m2]",
    "shared Re K* [N/m]",
    "shared Im K* [N/m]",
)


def covariance_table(groups: Sequence[Group]) -> pl.DataFrame:
    """covariance.parquet: of K* across tests, as each condition's own part and what shared errors do to each test.

    Two tests of a rig have the covariance shared_i · shared_j, summed over the shared errors; those of one condition
    have their own part in common besides.
    """
    types: dict[str, Any] = dict(
        zip(
            COVARIANCE_COLUMNS,
            (pl.String, pl.String, pl.Int64, pl.Array(pl.Float64, 4), pl.List(pl.Float64), pl.List(pl.Float64)),
            strict=True,
        )
    )
    rows = []
    for group in groups:
        shared, condition = group.result.stiffness_shared, group.result.condition
        own = group.result.stiffness_covariance - shared @ np.swapaxes(shared, 1, 2)
        own = (own + np.swapaxes(own, 1, 2)) / 2  # round-off
        rows += [
            (
                group.names[at],
                group.setup.rig_name,
                int(condition[at]),
                own[at].ravel().tolist(),
                shared[at, 0].tolist(),
                shared[at, 1].tolist(),
            )
            for at in np.flatnonzero(np.isfinite(group.result.stiffness)).tolist()
        ]
    return pl.DataFrame(rows, schema=types, orient="row")


def preview_table(statics: Sequence[StaticTest], tests: Sequence[Test], points: Sequence[Point]) -> pl.DataFrame:
    """previews.parquet: per test a few cycles of signal and fit with the residual, or the static loop and its mean."""
    rows = [_static_preview(item.test, item.curve) for item in statics if item.curve is not None]
    rows += [_dynamic_preview(test, one, one.preview) for test, one in zip(tests, points, strict=True) if one.preview]
    types: dict[str, Any] = {"test": pl.String, **dict.fromkeys(_PREVIEW_LISTS, pl.List(pl.Float32))}
    return pl.DataFrame([[_listed(row.get(name)) for row in rows] for name in types], schema=types, strict=False)


def _listed(value: Any) -> Any:
    return value.tolist() if isinstance(value, np.ndarray) else value


_PREVIEW_LISTS = (
    "deflection [m]",
    "load [N]",
    "mean deflection [m]",
    "mean load [N]",
    "time [s]",
    "residual time [s]",
    *(f"{name}{what}" for name in SYMBOLS.values() for what in ("", " fit", " residual")),
)


def _static_preview(test: Test, curve: LoadCurve) -> dict[str, Any]:
    (x, f), (mean_x, mean_f) = curve.loop(), curve.mean_curve()
    return {"test": test.name, **dict(zip(_PREVIEW_LISTS[:4], (x, f, mean_x, mean_f), strict=True))}


def _dynamic_preview(test: Test, found: Point, seen: Preview) -> dict[str, Any]:
    """Signals less their mean, in the SI unit of what each channel recorded."""
    row: dict[str, Any] = {"test": test.name, "time [s]": seen.time, "residual time [s]": seen.blocks}
    for role, signal, fit, residual in zip(found.channels, seen.signals, seen.fit, seen.residual, strict=True):
        name = SYMBOLS[role]
        row |= {name: signal, f"{name} fit": fit, f"{name} residual": residual}
    return row


def covariance_cells(covariance: NDArray[np.float64]) -> tuple[float, float, float]:
    """Two standard uncertainties and their correlation of a 2×2 covariance."""
    first, second = np.sqrt(np.diag(covariance))
    with np.errstate(invalid="ignore", divide="ignore"):
        correlation = covariance[0, 1] / (first * second)
    return float(first), float(second), float(np.clip(correlation, -1.0, 1.0))


def tyre_cells(found: Identification, at: int) -> dict[str, float]:
    """K*, K1, K2 and C of one test, with their uncertainties."""
    u_re, u_im, corr_k = covariance_cells(found.stiffness_covariance[at])
    u_k2, u_c, corr_arm = covariance_cells(found.arm_covariance[at])
    return {
        "Re K* [N/m]": float(found.stiffness[at].real),
        "Im K* [N/m]": float(found.stiffness[at].imag),
        "u(Re K*) [N/m]": u_re,
        "u(Im K*) [N/m]": u_im,
        "corr(Re,Im K*) [1]": corr_k,
        "K1 [N/m]": float(found.k1[at]),
        "u(K1) [N/m]": float(found.k1_std[at]),
        "K2 [N/m]": float(found.k2[at]),
        "C [N s/m]": float(found.c[at]),
        "u(K2) [N/m]": u_k2,
        "u(C) [N s/m]": u_c,
        "corr(K2,C) [1]": corr_arm,
    }


def _construction(campaign: Campaign, test: Test) -> str:
    specimen = campaign.stated.all_specimens.get(test.tyre)
    return specimen.construction if specimen is not None else ""


def _frame(rows: Sequence[dict[str, Any]], columns: Sequence[str], more: Sequence[str] = ()) -> pl.DataFrame:
    types = {name: pl.String if name in TEXT_COLUMNS or name in more else pl.Float64 for name in (*columns, *more)}
    series = {name: [_finite(row.get(name)) for row in rows] for name in types}
    return pl.DataFrame(series, schema=types, strict=False)


def _finite(value: Any) -> Any:
    return None if isinstance(value, float) and not np.isfinite(value) else value
