"""A plain Bayesian fit by lmfit: F1 = K* (x1 - x2), with the stated uncertainties of the channels as normal priors."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import lmfit
import numpy as np

from elastomer_truth.adapters import Answer
from elastomer_truth.statement import Campaign, read, static_stiffness


def _fit(campaign: Campaign, test: dict[str, str]) -> list[tuple[str, float, float]]:
    """K', K'' and TR with their standard uncertainties."""
    measured = campaign.phasors(test)
    roles = [role for role in ("F1", "V1", "V2") if role in measured]
    first = measured["F1"] / (measured["V1"] - measured.get("V2", 0.0))
    scale = abs(first)
    noise = {role: campaign.noise(test, role) for role in roles}
    parameters = lmfit.Parameters()
    parameters.add("re", first.real / scale)
    parameters.add("im", first.imag / scale)
    for role in roles:
        parameters.add(f"gain_{role}", 0.0)
        parameters.add(f"phase_{role}", 0.0)
        if role != "F1":
            parameters.add(f"re_{role}", 1.0)
            parameters.add(f"im_{role}", 0.0)

    def residual(p: Any) -> np.ndarray:
        motion = {role: measured[role] * complex(p[f"re_{role}"], p[f"im_{role}"]) for role in roles if role != "F1"}
        true = {**motion, "F1": scale * complex(p["re"], p["im"]) * (motion["V1"] - motion.get("V2", 0.0))}
        parts = []
        for role in roles:
            sensor = campaign.stated["sensors"][role]
            gain, phase = p[f"gain_{role}"].value, p[f"phase_{role}"].value
            miss = (true[role] * (1 + gain) * np.exp(1j * phase) - measured[role]) / noise[role]
            u = max(math.radians(sensor["u_phase_in_degrees"]), 1e-9)
            parts += [miss.real, miss.imag, gain / sensor["u_gain_relative"], phase / u]
        return np.array(parts)

    done = lmfit.minimize(residual, parameters, scale_covar=False)
    u_re, u_im = (scale * float(done.params[name].stderr or np.nan) for name in ("re", "im"))
    found = [("K'", scale * done.params["re"].value, u_re), ("K''", scale * done.params["im"].value, u_im)]
    if "V2" in roles:
        ratio = abs(measured["V2"] / measured["V1"])
        parts = [campaign.stated["sensors"][role]["u_gain_relative"] for role in ("V1", "V2")]
        found.append(("TR", ratio, ratio * math.hypot(*parts)))
    return found


def answer(folder: Path) -> Answer:
    """K*, taken as k21 too, and TR of each sine; K1 of each static test."""
    campaign = read(folder)
    rows = []
    for test in campaign.tests:
        if test["kind"] == "static":
            value = static_stiffness(campaign, test)
            gains = [campaign.stated["sensors"][role]["u_gain_relative"] for role in ("load", "deflection")]
            found = [("K1", value, value * math.hypot(*gains))]
        elif test["kind"] == "sine":
            found = _fit(campaign, test)
            found += [(f"k21{name[1:]}", value, u) for name, value, u in found[:2]]
        else:
            continue
        for name, value, u in found:
            frequency = float(test["frequency [Hz]"] or 0.0)
            rows.append({"test": test["test"], "frequency [Hz]": frequency, "quantity": name, "value": value, "u": u,
                         "lower": value - 1.96 * u, "upper": value + 1.96 * u, "verdict": "ok"})  # fmt: skip
    return rows, []
