"""A Bayesian fit by emcee: F1 = K* (x1 - x2), with the stated uncertainties of the channels as normal priors.

The posterior is sampled, so its 95 % interval need not be symmetric.
"""

from __future__ import annotations

import math
import zlib
from pathlib import Path
from typing import Any

import emcee
import numpy as np

from elastomer_truth.adapters import Answer
from elastomer_truth.statement import Campaign, read, static_stiffness

_WALKERS, _STEPS, _DISCARDED = 128, 120, 20


def _fit(campaign: Campaign, test: dict[str, str]) -> dict[str, Any]:
    """Samples (N,) of K' and K'' [N/m], and of TR if V2 is there."""
    measured = campaign.phasors(test)
    roles = [role for role in ("F1", "V1", "V2") if role in measured]
    count, sensors = len(roles), [campaign.stated["sensors"][role] for role in roles]
    prior = np.array([sensor["u_gain_relative"] for sensor in sensors]
                     + [max(math.radians(sensor["u_phase_in_degrees"]), 1e-9) for sensor in sensors])  # fmt: skip

    def true(errors: Any) -> dict[str, Any]:
        """Amplitudes (W,) of all channels without their errors of gain and phase (W, 2 count)."""
        return {role: measured[role] * np.exp(-1j * errors[:, count + at]) / (1 + errors[:, at])
                for at, role in enumerate(roles)}  # fmt: skip

    def stiffness(errors: Any) -> Any:
        found = true(errors)
        return found["F1"] / (found["V1"] - found.get("V2", 0.0))

    first = complex(stiffness(np.zeros((1, 2 * count)))[0])
    noise = [campaign.noise(test, role) * (1.0 if role == "F1" else abs(first)) for role in roles]
    spread = float(np.linalg.norm(noise)) / abs(measured["F1"])

    def log_probability(p: Any) -> Any:
        miss = first * (p[:, 0] + 1j * p[:, 1]) / stiffness(p[:, 2:]) - 1
        return -0.5 * (np.abs(miss / spread) ** 2 + ((p[:, 2:] / prior) ** 2).sum(axis=1))

    seed = zlib.crc32(f"{campaign.name} {test['test']}".encode())
    rng = np.random.RandomState(seed)
    errors = prior * rng.standard_normal((_WALKERS, 2 * count))
    ratio = stiffness(errors) / first * (1 + spread * (rng.standard_normal((_WALKERS, 2)) @ [1, 1j]))
    sampler = emcee.EnsembleSampler(_WALKERS, 2 + 2 * count, log_probability, vectorize=True)
    start = np.column_stack([ratio.real, ratio.imag, errors])
    sampler.run_mcmc(emcee.State(start, random_state=rng.get_state()), _STEPS)
    chain = sampler.get_chain(discard=_DISCARDED, flat=True)
    k = first * (chain[:, 0] + 1j * chain[:, 1])
    found = {"K'": k.real, "K''": k.imag}
    if "V2" in roles:
        ends = true(chain[:, 2:])
        found["TR"] = np.abs(ends["V2"] / ends["V1"])
    return found


def answer(folder: Path) -> Answer:
    """K*, taken as k21 too, and TR of each sine; K1 of each static test."""
    campaign = read(folder)
    rows = []
    for test in campaign.tests:
        if test["kind"] not in ("static", "sine"):
            continue
        key = {"test": test["test"], "frequency [Hz]": float(test["frequency [Hz]"] or 0.0), "verdict": "ok"}
        if test["kind"] == "static":
            value = static_stiffness(campaign, test)
            gains = [campaign.stated["sensors"][role]["u_gain_relative"] for role in ("load", "deflection")]
            u = value * math.hypot(*gains)
            rows.append({**key, "quantity": "K1", "value": value, "u": u,
                         "lower": value - 1.96 * u, "upper": value + 1.96 * u})  # fmt: skip
        else:
            found = _fit(campaign, test)
            for name, samples in (*found.items(), *((f"k21{part[1:]}", found[part]) for part in ("K'", "K''"))):
                low, high = np.quantile(samples, [0.025, 0.975])
                rows.append({**key, "quantity": name, "value": float(samples.mean()), "u": float(samples.std()),
                             "lower": float(low), "upper": float(high)})  # fmt: skip
    return rows, []
