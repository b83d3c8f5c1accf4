"""ISO 10846-3, the indirect method: the force on a blocking mass is its inertia, k21 = -w^2 m a2/a1.

It is valid where the mass moves at least 20 dB less than the drive; other values have a warning. Where the far side is
held and the force is measured there, the direct method of ISO 10846-2 serves.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from elastomer_truth.adapters import Answer
from elastomer_truth.statement import Campaign, read

#: Largest |T| at which the blocking mass counts as blocked.
_LARGEST = 0.1


def _over_drive(campaign: Campaign, test: dict[str, str], role: str, frequencies: list[float]) -> list[complex]:
    """A channel over the displacement at the drive."""
    if test["kind"] == "sine":
        found = campaign.phasors(test)
        return [found[role] / found["V1"]]
    signals = campaign.signals(test)
    length = int(campaign.rate)
    count = signals["V1"].size // length * 2 - 1
    window = np.hanning(length)
    parts = {
        name: np.array([np.fft.rfft(window * values[at * length // 2 :][:length]) for at in range(count)])
        for name, values in signals.items()
        if name in ("V1", role)
    }
    cross = (parts[role] * parts["V1"].conj()).sum(axis=0) / (np.abs(parts["V1"]) ** 2).sum(axis=0)
    lines = [round(f) for f in frequencies]
    return [
        complex(cross[line] * campaign.correction("V1", f) / campaign.correction(role, f))
        for line, f in zip(lines, frequencies, strict=True)
    ]


def answer(folder: Path) -> Answer:
    """k21 of all dynamic tests, taken as K* too."""
    campaign = read(folder)
    rows: list[dict[str, Any]] = []
    at_ground = campaign.stated["rig"]["force_is_measured_at"] == "the far side"
    if campaign.blocked and not at_ground:
        return rows, []
    for test in campaign.tests:
        if test["kind"] == "static":
            continue
        frequencies = campaign.frequencies(test["test"])
        ratios = _over_drive(campaign, test, "F1" if campaign.blocked else "V2", frequencies)
        mass = campaign.value("moving mass")[0] + float(test["added mass [kg]"])
        for frequency, ratio in zip(frequencies, ratios, strict=True):
            stiffness = ratio if campaign.blocked else -((2 * math.pi * frequency) ** 2) * mass * ratio
            verdict = "ok" if campaign.blocked or abs(ratio) <= _LARGEST else "warning"
            for name, value in (
                ("k21'", stiffness.real),
                ("k21''", stiffness.imag),
                ("K'", stiffness.real),
                ("K''", stiffness.imag),
            ):
                rows.append(
                    {
                        "test": test["test"],
                        "frequency [Hz]": frequency,
                        "quantity": name,
                        "value": value,
                        "verdict": verdict,
                    }
                )
    return rows, []
