"""pyFRF: F1 over the motions of both ends as a system with two inputs (MISO, H1), or over the deflection with one."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyFRF

from elastomer_truth.adapters import Answer
from elastomer_truth.statement import Campaign, read, rows_of_stiffness


def _motions(campaign: Campaign, test: dict[str, str]) -> tuple[np.ndarray, np.ndarray]:
    """F1 (T,), and the displacements (1 or 2, T) of the ends, filters and delays undone on the spectra."""
    signals = campaign.signals(test)
    frequency = np.fft.rfftfreq(signals["F1"].size, 1 / campaign.rate)
    made = {}
    for role, values in signals.items():
        spectrum = np.fft.rfft(values - values.mean())
        spectrum[0] = 0
        # Below 1 Hz the integral of an acceleration is drift only.
        spectrum[frequency < 1] = 0
        spectrum[1:] /= campaign.correction(role, frequency[1:])
        made[role] = np.fft.irfft(spectrum, values.size)
    ends = [made["V1"]] if campaign.blocked else [made["V1"], made["V2"]]
    return made["F1"], np.array(ends)


def answer(folder: Path) -> Answer:
    """K* of random tests, sweeps and multisines; two inputs need two added masses, else they are coherent."""
    campaign = read(folder)
    many = [test for test in campaign.tests if test["kind"] in ("random", "sweep", "multisine")]
    rows = []
    for test in many:
        same = [
            other for other in many
            if all(other[key] == test[key] for key in ("specimen", "preload [N]"))
        ]  # fmt: skip
        masses = {other["added mass [kg]"] for other in same}
        both = len(masses) > 1 and not campaign.blocked
        records = [_motions(campaign, other) for other in (same if both else [test])]
        force = np.array([[force] for force, _ in records])
        ends = np.array([ends for _, ends in records])
        if not both and not campaign.blocked:
            ends = ends[:, :1] - ends[:, 1:]
        length = int(campaign.rate)
        frf = pyFRF.FRF(
            int(campaign.rate), ends, force, exc_type="f", resp_type="d", window="hann",
            nperseg=length, noverlap=length // 2, frf_estimator="H1",
        )  # fmt: skip
        h = np.asarray(frf.get_FRF(frf_estimator="H1", frf_form="receptance"))
        f = np.asarray(frf.get_f_axis())
        for frequency in campaign.frequencies(test["test"]):
            near = int(np.argmin(np.abs(f - frequency)))
            # With two inputs, the second one is -k21.
            driving = complex(h[0, 0, near])
            rows += rows_of_stiffness(test["test"], frequency, -complex(h[0, 1, near]) if both else driving)
    return rows, []
