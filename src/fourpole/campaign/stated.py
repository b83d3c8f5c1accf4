"""A value of a campaign with its standard uncertainty, as a text or a table states it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from fourpole import units
from fourpole.campaign import defaults
from fourpole.campaign.channels import known_keys


@dataclass(frozen=True)
class Stated:
    """A value and its standard uncertainty in SI; `assumed` if campaign.toml does not state the uncertainty."""

    value: float
    std: float
    assumed: bool


def stated_value(raw: Any, kind: str) -> Stated:
    """A rig value from a text such as "15 kg", or from a table of value, unit, std and exact."""
    if isinstance(raw, str):
        raw = {"value": raw}
    if not isinstance(raw, dict):
        raise ValueError(
            f'write it with its unit, as "15 kg" or {{ value = 15.0, unit = "kg", std = 0.1 }}, not {raw!r}'
        )
    known_keys(raw, ("value", "unit", "std", "exact"))
    if "value" not in raw:
        raise ValueError('has no value: write { value = 15.0, unit = "kg", std = 0.1 }')
    unit = raw.get("unit", "1" if kind == "ratio" else None)
    if unit is not None and not isinstance(unit, str):
        raise ValueError(f"unit must be a text, not {unit!r}")
    exact = raw.get("exact", False)
    if not isinstance(exact, bool):
        raise ValueError(f"exact must be true or false, not {exact!r}")
    value = units.quantity(raw["value"], kind, default_unit=unit)
    if exact and "std" in raw:
        raise ValueError("exact = true and std contradict each other: keep one of them")
    if exact:
        return Stated(value, 0.0, assumed=False)
    if "std" not in raw:
        return Stated(value, defaults.RIG_STD * abs(value), assumed=value != 0)
    if isinstance(raw["std"], str) and raw["std"].strip().endswith("%"):
        std = abs(value) * units.quantity(raw["std"], "ratio")
    else:
        std = units.quantity(raw["std"], kind, default_unit=unit)
    if std < 0:
        raise ValueError("std is negative: state a standard uncertainty, zero or positive")
    return Stated(value, std, assumed=False)
