"""The formulas of Nosseir, El-Gindy and El-Saied (1982), as in a spreadsheet, with the rig as stated."""

from __future__ import annotations

import math
from pathlib import Path

from elastomer_truth.adapters import Answer
from elastomer_truth.statement import read, rows_of_stiffness, static_stiffness


def answer(folder: Path) -> Answer:
    """K* of each sine from the driving point mobility V1/F1 and the impedance of mass and preload spring."""
    campaign = read(folder)
    rows = []
    for test in campaign.tests:
        if test["kind"] == "static":
            rows.append({"test": test["test"], "frequency [Hz]": 0.0, "quantity": "K1",
                         "value": static_stiffness(campaign, test), "verdict": "ok"})  # fmt: skip
        elif test["kind"] == "sine":
            found = campaign.phasors(test)
            frequency = float(test["frequency [Hz]"])
            omega = 2 * math.pi * frequency
            mobility = 1j * omega * found["V1"] / found["F1"]
            if campaign.blocked:
                stiffness = 1j * omega / mobility
                ratio = None
            else:
                # R + jI of the specimen alone: that of the whole less that of the rig
                rig = campaign.impedance(frequency, float(test["added mass [kg]"])) / (1j * omega)
                stiffness = 1j * omega / (mobility - 1 / rig)
                ratio = abs(found["V2"] / found["V1"])
            rows += rows_of_stiffness(test["test"], frequency, stiffness, ratio)
    return rows, []
