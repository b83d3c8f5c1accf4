"""What is true of a laboratory: K*, k21, K1 and TR of what its statement asks for."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from elastomer_truth.laboratory import Laboratory, Test
from elastomer_truth.mechanics import Array, ComplexArray, Network
from elastomer_truth.recording import Motion, static_curve

#: Quantities, with the symbol of their unit.
QUANTITIES = {"K'": "N/m", "K''": "N/m", "k21'": "N/m", "k21''": "N/m", "TR": "1", "K1": "N/m"}
#: Number of frequencies of a recording with many at which values are asked for.
ASKED = 8


def asked_frequencies(test: Test) -> Array:
    """Frequencies [Hz] of a test at which values are asked for."""
    if test.kind == "static":
        return np.array([0.0])
    if test.kind == "sine":
        return np.array([test.frequency])
    low, high = test.band or (5.0, 50.0)
    return np.geomspace(1.15 * low, 0.9 * high, ASKED).round(0 if test.kind == "multisine" else 1)


def asked(lab: Laboratory) -> Iterator[tuple[str, float, str]]:
    """Test, frequency [Hz] and quantity of all that the statement asks for; 0 Hz for K1."""
    for test in lab.tests:
        for frequency in asked_frequencies(test):
            for quantity in QUANTITIES:
                if (quantity == "K1") == (test.kind == "static") and not (quantity == "TR" and lab.blocked):
                    yield test.name, float(frequency), quantity


def values(lab: Laboratory, moved: dict[str, Motion]) -> dict[tuple[str, float, str], float]:
    """The truth of all that is asked for.

    A test whose row is wrong, by its file, preload or mass, has the truth of what the row says.
    """
    found = {}
    for test in lab.tests:
        frequency = asked_frequencies(test)
        if test.kind == "static":
            found[test.name, 0.0, "K1"] = static_stiffness(lab, test)
            continue
        said = replace(test, true={}, file_of="")
        springs, blocked = stiffnesses(lab.network(said), frequency)
        ratio = lab.network(said).state_space().transfer(2 * np.pi * frequency)[:, 2]
        if any(link.slip for link in lab.network(said).links):
            x1, force, x2, _ = moved[test.name].amplitudes[1]
            ratio = np.array([x2 / x1]) if "mass left on" not in test.true else ratio
            if lab.specimens[test.specimen].slip:
                own = force + lab.true("input mass") * (2 * np.pi * test.frequency) ** 2 * x1
                springs = blocked = np.array([own / (x1 - x2)])
        parts = {
            "K'": springs.real,
            "K''": springs.imag,
            "k21'": blocked.real,
            "k21''": blocked.imag,
            "TR": np.abs(ratio),
        }
        for name, each in parts.items():
            if name != "TR" or not lab.blocked:
                found |= {(test.name, float(f), name): float(v) for f, v in zip(frequency, each, strict=True)}
    return found


def stiffnesses(network: Network, frequency: Array) -> tuple[ComplexArray, ComplexArray]:
    """K* of the springs of the specimen, and its blocked transfer stiffness k21 (N,) [N/m]."""
    omega = 2 * np.pi * np.asarray(frequency)
    links = [link for link in network.links if link.first == "contact" or link.first.startswith("specimen ")]
    each = [link.dynamic_stiffness(omega) for link in links]
    springs = 1 / sum(1 / one for one in each)
    # The four-pole of a chain with its far end held: force there over the motion of the contact.
    transfer, force = np.zeros(omega.size, complex), np.ones(omega.size, complex)
    for at in range(len(links) - 1, -1, -1):
        before = transfer + force / each[at]
        inner = network.masses.get(links[at].first, 0.0) if at else 0.0
        transfer, force = before, force - omega**2 * inner * before
    return springs, 1 / transfer


def static_stiffness(lab: Laboratory, test: Test) -> float:
    """K1: tangent at the preload of the mean of both branches of the last cycle, without noise [N/m]."""
    rate = 4000 / test.duration * 3
    x, load = static_curve(lab, test, rate)
    up, down = (slice(-4001, -2000), slice(-2001, None))
    x_up, mean = x[up], 0.5 * (load[up] + load[down][::-1])
    at = float(np.interp(test.preload, mean, x_up))
    near = np.abs(x_up - at) < 0.01 * x_up.max()
    return float(np.polyfit(x_up[near] - at, mean[near], 2)[1])
