"""k21 from K* of the springs and specimens.csv of Fourpole."""

from __future__ import annotations

import numpy as np


def number(text: str | None) -> float:
    """The number in a cell; not-a-number for a blank one."""
    return float(text) if text else float("nan")


def transfer(
    stiffness: complex, line: dict[str, str], bodies: list[dict[str, str]], frequency: float, *, weighed: bool
) -> tuple[complex, float]:
    """k21 over K* of the springs for a mass between two springs, or spread from end to end, and its uncertainty.

    `weighed` says that the statement has a mass of the specimen.
    """
    own = [
        body
        for body in bodies
        if body["tyre"] == line["tyre"] and abs(number(body["preload [N]"]) - number(line["preload [N]"])) < 1
    ]
    if line["K* of"] == "driving point" or (weighed and line["K* of"] == "springs" and not own):
        return complex("nan"), 0.0  # Fourpole has no k21 of it
    if line["K* of"] != "springs" or not own or own[0]["form"] == "massless":
        return 1.0 + 0j, 0.0
    mass, u = number(own[0]["belt mass [kg]"]), number(own[0]["u(belt mass) [kg]"])
    omega2 = (2 * np.pi * frequency) ** 2
    if own[0]["form"] == "rod":
        turn = np.sqrt(omega2 * mass / stiffness)
        return complex(turn / np.sin(turn)), float(omega2 * u / abs(stiffness) / 6)
    share = number(own[0]["share of springs [1]"]) or 1.0
    both = stiffness * (1 + share) ** 2 / share
    factor = 1 / (1 - omega2 * mass / both)
    relative = np.nan_to_num(number(own[0]["u(share of springs) [1]"]) / share * abs((1 - share) / (1 + share)))
    moved = abs(factor) ** 2 * omega2 * mass / abs(both)
    return complex(factor), float(moved * np.hypot(u / max(mass, 1e-12), relative))
