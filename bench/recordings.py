"""Campaigns of many recordings for the benchmarks, with known amplitudes; run by itself it does nothing.

The signals are made here with numpy alone: a Zener tyre on the rig of the paper, at one frequency each, with harmonics
of the drive that the rig passes on as it does the fundamental, mains hum, a slow drift and noise. No test is doubtful.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import polars as pl
from numpy.typing import NDArray

__all__ = ["Made", "amplitudes_at", "make_campaign", "write_recording"]

RATE, SAMPLES, FREQUENCIES = 2000.0, 20_000, 40
K1, K2, C = 180e3, 120e3, 1500.0
MASS, PRELOAD, DAMPING, DRIVE = 15.0, 12440.0, 15.0, 0.6e-3
#: Amplitudes relative to the fundamental: harmonics to that of the drive, the others to that of each channel.
NOISE, HUM, DRIFT, HARMONICS = 0.01, 0.005, 0.02, {2: 0.01, 3: 0.005}
_CAMPAIGN = """title = "Benchmark"

[unstated]
ordinary = "zero"

[rig]
moving_mass = {{ value = {mass}, unit = "kg", std = 0.1 }}
preload_stiffness = {{ value = {preload}, unit = "N/m", std = 100 }}
preload_damping = {{ value = {damping}, unit = "N s/m", std = 1 }}

[specimens.bush]

[channels]
time = {{ column = "t", unit = "s" }}
force_in = {{ column = "F1", unit = "N", std_gain = "0.5 %", std_phase = "0.2 deg" }}
motion_in = {{ column = "V1", unit = "m/s", std_gain = "0.5 %", std_phase = "0.2 deg" }}
motion_out = {{ column = "V2", unit = "m/s", std_gain = "0.5 %", std_phase = "0.2 deg" }}
"""


@dataclass(frozen=True)
class Made:
    """A campaign: its folder, its recordings, frequencies [Hz] and amplitudes F1 [N], V1 [m/s], V2 [m/s]."""

    folder: Path
    files: list[Path]
    frequency: NDArray[np.float64]
    amplitudes: NDArray[np.complex128]

    def rejected(self) -> int:
        """Number of tests that the last analysis rejected."""
        table = pl.read_csv(self.folder / "results" / "dynamic.csv", infer_schema_length=None)
        return int((table["verdict"] == "rejected").sum())

    def check_used(self) -> None:
        """SystemExit if the last analysis rejected a test."""
        if rejected := self.rejected():
            raise SystemExit(f"{self.folder}: {rejected} tests are rejected")


def amplitudes_at(frequency: NDArray[np.float64]) -> NDArray[np.complex128]:
    """F1, V1 and V2 of the tyre between the drive and the rig, (n, 3)."""
    jw = 2j * np.pi * frequency
    arm = jw * C * K2 / (K2 + jw * C)
    beyond = 1 / (jw * MASS + DAMPING + PRELOAD / jw)
    v1 = DRIVE * jw
    f1 = v1 / (jw / (K1 + arm) + beyond)
    return np.stack([f1, v1, f1 * beyond], axis=-1)


def signals_of(frequency: float, rng: np.random.Generator, count: int = SAMPLES) -> NDArray[np.float64]:
    """The time and three channels, (4, count)."""
    t = np.arange(count) / RATE
    order, share = np.array([1, *HARMONICS]), np.array([1.0, *HARMONICS.values()])
    amplitudes = amplitudes_at(order * frequency).T
    x = ((amplitudes * share) @ np.exp(2j * np.pi * np.outer(order * frequency, t))).real
    size = np.abs(amplitudes[:, :1])
    x += size * (HUM * np.sin(2 * np.pi * 50 * t + 1.0) + DRIFT * np.cos(np.pi * t / t[-1]))
    x += NOISE * size * rng.standard_normal(x.shape)
    return np.vstack([t, x])


def write_recording(path: Path, signals: NDArray[np.float64]) -> None:
    """Columns t, F1, V1, V2 as CSV of seven digits, or as Parquet."""
    table = pl.DataFrame(dict(zip(("t", "F1", "V1", "V2"), signals, strict=True)))
    if path.suffix == ".csv":
        table.with_columns(pl.col("F1").round(4), pl.col("V1", "V2").round(7)).write_csv(path)
    else:
        table.write_parquet(path)


def make_campaign(folder: Path, count: int, ending: str, *, seed: int = 1982, samples: int = SAMPLES) -> Made:
    """A campaign of `count` dynamic tests of 4 x `samples` values: 40 frequencies at each preload."""
    rng = np.random.default_rng(seed)
    (folder / "recordings").mkdir(parents=True)
    frequency = 8.0137 + 16.0 * (np.arange(count) % FREQUENCIES) / FREQUENCIES
    amplitudes = amplitudes_at(frequency)
    rows, files = ["test,file,kind,specimen,preload [N],frequency [Hz],K1 [N/m],u(K1) [N/m]"], []
    for at, f in enumerate(frequency.tolist()):
        files.append(folder / "recordings" / f"D{at}.{ending}")
        write_recording(files[-1], signals_of(f, rng, samples))
        preload = 1000 * 1.02 ** (at // FREQUENCIES)
        rows.append(f"D{at},recordings/D{at}.{ending},dynamic,bush,{preload:.1f},{f:.5f},{K1:.0f},900")
    (folder / "tests.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")
    text = _CAMPAIGN.format(mass=MASS, preload=PRELOAD, damping=DAMPING)
    (folder / "campaign.toml").write_text(text, encoding="utf-8")
    return Made(folder, files, frequency, amplitudes)
