"""What an adapter reads: the statement and recordings of a campaign, and amplitudes by least squares.

Adapters may use it; they need not.
"""

from __future__ import annotations

import csv
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray

#: SI units per unit of a recording.
UNITS = {"N": 1.0, "kN": 1e3, "m": 1.0, "mm": 1e-3, "m/s": 1.0, "mm/s": 1e-3, "m/s2": 1.0}
POWERS = {"force": 0, "displacement": 0, "velocity": 1, "acceleration": 2}


@dataclass(frozen=True)
class Campaign:
    """A campaign as stated."""

    folder: Path
    stated: dict[str, Any]
    tests: list[dict[str, str]]
    asked: list[tuple[str, float, str]]

    @property
    def name(self) -> str:
        return str(self.stated["campaign"])

    @property
    def blocked(self) -> bool:
        return bool(self.stated["rig"]["far_side_is_held"])

    @property
    def rate(self) -> float:
        return float(self.stated["logger"]["rate_in_hertz"])

    def value(self, name: str) -> tuple[float, float]:
        """A value of the rig and its standard uncertainty; 0, 0 if it is not stated."""
        found = self.stated["rig"].get(name, {"value": 0.0, "u": 0.0})
        return float(found["value"]), float(found["u"])

    def frequencies(self, test: str) -> list[float]:
        """Frequencies [Hz] at which values of a test are asked for."""
        return sorted({frequency for name, frequency, _ in self.asked if name == test})

    def table(self, test: dict[str, str]) -> pl.DataFrame:
        """The recording of a test, as it is."""
        path = self.folder / test["file"]
        return pl.read_csv(path) if path.suffix == ".csv" else pl.read_parquet(path)

    def signals(self, test: dict[str, str]) -> dict[str, NDArray[np.float64]]:
        """Channels of a recording (N,) by role [SI], what they are of unchanged."""
        table = self.table(test)
        return {
            role: table[sensor["column"]].to_numpy().astype(float) * UNITS[sensor["unit"]]
            for role, sensor in self.stated["sensors"].items()
            if sensor["column"] in table.columns
        }

    def correction(self, role: str, frequency: Any) -> Any:
        """Recorded amplitude over force or displacement: derivative, delay and filters as stated."""
        sensor = self.stated["sensors"][role]
        f = np.asarray(frequency, dtype=float)
        s = 2j * np.pi * f
        value = s ** POWERS[sensor["quantity"]] * np.exp(-s * sensor.get("delay_in_seconds", 0.0))
        if sensor.get("low_cut_in_hertz"):
            value = value * 1j * f / (1j * f + sensor["low_cut_in_hertz"])
        if "low_pass_in_hertz" in sensor:
            r = 1j * f / sensor["low_pass_in_hertz"]
            value = value / (1 + np.sqrt(2) * r + r * r)
        return value

    def phasors(self, test: dict[str, str]) -> dict[str, complex]:
        """F1, X1, X2 of a sine as amplitudes [N], [m] by least squares at the stated frequency."""
        frequency = float(test["frequency [Hz]"])
        found = {}
        for role, values in self.signals(test).items():
            turn = 2 * np.pi * frequency * np.arange(values.size) / self.rate
            basis = np.stack([np.cos(turn), -np.sin(turn), np.ones_like(turn)], axis=1)
            real, imaginary, _ = np.linalg.lstsq(basis, values, rcond=None)[0]
            found[role] = complex(real, imaginary) / complex(self.correction(role, frequency))
        return found

    def noise(self, test: dict[str, str], role: str) -> float:
        """Standard deviation of an amplitude [N], [m], by what a sine leaves of the recording; at least 1e-5 of it."""
        values, frequency = self.signals(test)[role], float(test["frequency [Hz]"])
        turn = 2 * np.pi * frequency * np.arange(values.size) / self.rate
        basis = np.stack([np.cos(turn), np.sin(turn), np.ones_like(turn)], axis=1)
        fit = np.linalg.lstsq(basis, values, rcond=None)[0]
        spread = float((values - basis @ fit).std()) * np.sqrt(2 / values.size)
        return float(max(spread, 1e-5 * np.hypot(*fit[:2])) / abs(self.correction(role, frequency)))

    def impedance(self, frequency: Any, added: float) -> Any:
        """Force over displacement of the rig beyond the specimen [N/m], by what is stated."""
        w = 2 * np.pi * np.asarray(frequency, dtype=float)
        mass = self.value("moving mass")[0] + added
        return self.value("preload spring")[0] + 1j * w * self.value("preload damping")[0] - w**2 * mass


def read(folder: Path) -> Campaign:
    """The campaign in a folder."""
    stated = tomllib.loads((folder / "statement.toml").read_text(encoding="utf-8"))
    with (folder / "tests.csv").open(encoding="utf-8", newline="") as file:
        tests = list(csv.DictReader(file))
    with (folder / "asked.csv").open(encoding="utf-8", newline="") as file:
        asked = [(row["test"], float(row["frequency [Hz]"]), row["quantity"]) for row in csv.DictReader(file)]
    return Campaign(folder, stated, tests, asked)


def rows_of_stiffness(
    test: str, frequency: float, stiffness: complex, ratio: float | None = None
) -> list[dict[str, Any]]:
    """Rows of values.csv for K*, taken as k21 too, and TR, without uncertainty."""
    key = {"test": test, "frequency [Hz]": frequency, "verdict": "ok"}
    parts = {"K'": stiffness.real, "K''": stiffness.imag, "k21'": stiffness.real, "k21''": stiffness.imag}
    rows = [{**key, "quantity": name, "value": value} for name, value in parts.items()]
    return rows + ([] if ratio is None else [{**key, "quantity": "TR", "value": ratio}])


def static_stiffness(campaign: Campaign, test: dict[str, str]) -> float:
    """K1: slope at the preload of a parabola through both branches of the last cycle, near the preload."""
    signals = campaign.signals(test)
    load, deflection = (signals[role][2 * signals[role].size // 3 :] for role in ("load", "deflection"))
    preload = float(test["preload [N]"])
    middle = deflection[np.abs(load - preload) < 0.05 * preload].mean()
    near = np.abs(deflection - middle) < 0.05 * np.ptp(deflection)
    constant, slope, bend = np.polynomial.polynomial.polyfit(deflection[near] - middle, load[near] - preload, 2)
    at = -constant / slope
    return float(slope + 2 * bend * at)
