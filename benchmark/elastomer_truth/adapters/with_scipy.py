"""scipy as many use it: curve_fit of sines, csd and welch (H1) of random excitation, and the impedance of the rig."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import curve_fit
from scipy.signal import csd, welch

from elastomer_truth.adapters import Answer
from elastomer_truth.statement import Campaign, read, rows_of_stiffness, static_stiffness


def _sine(time: Any, real: float, imaginary: float, offset: float, frequency: float) -> Any:
    turn = 2 * np.pi * frequency * time
    return real * np.cos(turn) - imaginary * np.sin(turn) + offset


def _fitted(campaign: Campaign, test: dict[str, str]) -> dict[str, complex]:
    """Amplitudes of all channels; the frequency is fitted to V1."""
    found, frequency = {}, float(test["frequency [Hz]"])
    signals = campaign.signals(test)
    for role in ("V1", *(role for role in signals if role != "V1")):
        values = signals[role]
        time = np.arange(values.size) / campaign.rate
        size = np.sqrt(2) * values.std()
        if role == "V1":
            guess = np.exp(-2j * np.pi * frequency * time) @ (values - values.mean()) * 2 / values.size
            start = guess.real, guess.imag, values.mean(), frequency
            (real, imaginary, _, frequency), _cov = curve_fit(_sine, time, values, start)
        else:

            def at(t: Any, a: float, b: float, c: float, frequency: float = frequency) -> Any:
                return _sine(t, a, b, c, frequency)

            (real, imaginary, _), _cov = curve_fit(at, time, values, (size, 0.0, values.mean()))
        found[role] = complex(real, imaginary) / complex(campaign.correction(role, frequency))
    return found


def _ratio(campaign: Campaign, test: dict[str, str], over: str, under: str, frequency: list[float]) -> np.ndarray:
    """H1 of one channel over another at some frequencies."""
    signals, length = campaign.signals(test), int(campaign.rate)
    f, cross = csd(signals[under], signals[over], campaign.rate, nperseg=length)
    _, own = welch(signals[under], campaign.rate, nperseg=length)
    ratio = cross / own
    at = np.asarray(frequency)
    found = np.interp(at, f, ratio.real) + 1j * np.interp(at, f, ratio.imag)
    return found * campaign.correction(under, at) / campaign.correction(over, at)


def answer(folder: Path) -> Answer:
    """K* from F1/V1 and the rig as stated; TR from V2/V1."""
    campaign = read(folder)
    rows = []
    for test in campaign.tests:
        name, added = test["test"], float(test["added mass [kg]"])
        if test["kind"] == "static":
            rows.append({"test": name, "frequency [Hz]": 0.0, "quantity": "K1",
                         "value": static_stiffness(campaign, test), "verdict": "ok"})  # fmt: skip
            continue
        frequency = campaign.frequencies(name)
        if test["kind"] == "sine":
            found = _fitted(campaign, test)
            driving = np.array([found["F1"] / found["V1"]])
            moved = np.array([found.get("V2", np.nan) / found["V1"]])
        else:
            driving = _ratio(campaign, test, "F1", "V1", frequency)
            moved = driving if campaign.blocked else _ratio(campaign, test, "V2", "V1", frequency)
        for f, whole, ratio in zip(frequency, driving, moved, strict=True):
            stiffness = whole if campaign.blocked else 1 / (1 / whole - 1 / campaign.impedance(f, added))
            rows += rows_of_stiffness(name, f, complex(stiffness), None if campaign.blocked else abs(ratio))
    return rows, []
