"""k21 from K* of the springs and specimens.csv of Fourpole."""

from __future__ import annotations

from typing import Any

import numpy as np

#: Spread of the mass of a specimen by the start of its form in a statement.
SPREADS = {"two equal masses": 0.5, "spread evenly": 1.0}


def number(text: str | None) -> float:
    """The number in a cell; not-a-number for a blank one."""
    return float(text) if text else float("nan")


def _chain(stiffness: complex, inertia: float, spread: float) -> complex:
    """k21 over K* of n equal masses between n + 1 equal springs, at a spread of 1 - 1/n; inertia is w^2 m."""
    n = 1 / min(max(1 - spread, 1e-4), 1.0)
    angle = 2 * np.arcsin(np.sqrt(inertia / (4 * n * (n + 1) * stiffness)))
    return complex((n + 1) * np.sin(angle) / np.sin((n + 1) * angle))


def _stated(specimen: dict[str, Any]) -> dict[str, str]:
    """A specimen as stated, as a row of specimens.csv; that of a bench has none."""
    if "mass" not in specimen:
        return {"form": "massless"}
    mass, spread = specimen["mass"], [spread for form, spread in SPREADS.items() if specimen["form"].startswith(form)]
    row = {"form": "rod" if spread else "belt", "belt mass [kg]": str(mass["value"]),
           "u(belt mass) [kg]": str(mass["u"]), "share of springs [1]": "0.2",
           "u(share of springs) [1]": "0.14"}  # fmt: skip
    return row | {"spread of the mass [1]": str(*spread), "u(spread of the mass) [1]": "0"} if spread else row


def transfer(
    stiffness: complex, line: dict[str, str], bodies: list[dict[str, str]], frequency: float, specimen: dict[str, Any]
) -> tuple[complex, float]:
    """k21 over K* of the springs for a mass between two springs, or spread from end to end, and its uncertainty.

    `specimen` is what is stated of it, which counts where a bench has no specimens.csv.
    """
    own = [
        body
        for body in bodies
        if body["tyre"] == line["tyre"] and abs(number(body["preload [N]"]) - number(line["preload [N]"])) < 1
    ] or [_stated(specimen)]
    if line["K* of"] == "driving point":
        return complex("nan"), 0.0  # its mass is not known
    if line["K* of"] != "springs" or own[0]["form"] == "massless":
        return 1.0 + 0j, 0.0
    mass, u = number(own[0]["belt mass [kg]"]), number(own[0]["u(belt mass) [kg]"])
    omega2 = (2 * np.pi * frequency) ** 2
    if own[0]["form"] == "rod":
        spread, u_spread = number(own[0]["spread of the mass [1]"]), number(own[0]["u(spread of the mass) [1]"])
        factor = _chain(stiffness, omega2 * mass, spread)
        by = [_chain(stiffness, omega2 * (mass + u), spread), _chain(stiffness, omega2 * mass, spread - u_spread)]
        return factor, float(np.hypot(*(abs(one - factor) for one in by)))
    share = number(own[0]["share of springs [1]"]) or 1.0
    both = stiffness * (1 + share) ** 2 / share
    factor = 1 / (1 - omega2 * mass / both)
    relative = np.nan_to_num(number(own[0]["u(share of springs) [1]"]) / share * abs((1 - share) / (1 + share)))
    moved = abs(factor) ** 2 * omega2 * mass / abs(both)
    return complex(factor), float(moved * np.hypot(u / max(mass, 1e-12), relative))


def combined(of_springs: float, of_mass: float, *, together: bool) -> float:
    """Uncertainty of k21 by that of K* and of k21 over K*; on a bench one mass moves both the same way."""
    return of_springs + of_mass if together else float(np.hypot(of_springs, of_mass))
