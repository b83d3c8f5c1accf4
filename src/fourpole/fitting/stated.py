"""What study.json states of a campaign that a model file holds: the shapes of specimens, and the rig."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import polars as pl

from fourpole import quantities as q
from fourpole.core.rig import PARAMETERS
from fourpole.fitting.modelfile import RigFile, RigValue
from fourpole.models.shape import Shape, shape_of


def shapes_in(record: Mapping[str, Any]) -> dict[str, Shape]:
    """Shapes of the specimens that study.json states, by name."""
    specimens = record.get("stated", {}).get("specimens", {})
    stated = specimens.items() if isinstance(specimens, dict) else ()
    found = {name: shape_of(one) for name, one in stated if isinstance(one, dict)}
    return {name: one for name, one in found.items() if one is not None}


def rig_file(record: Mapping[str, Any], found: pl.DataFrame) -> RigFile | None:
    """The only rig of study.json, with values of rig.csv where the joint route found them; None for several rigs."""
    rigs = record.get("stated", {}).get("rigs", {})
    if not isinstance(rigs, dict) or len(rigs) != 1:
        return None
    name, stated = next(iter(rigs.items()))
    rows = found.filter(found["rig"] == name).to_dicts() if found.height else []
    better = {row["value"]: (row["found"], row[q.FOUND.u_head]) for row in rows}
    values = {}
    for symbol, unit in PARAMETERS.items():
        one = stated.get(symbol)
        if isinstance(one, dict) and isinstance(one.get("value"), int | float):
            value, std = better.get(symbol, (one["value"], one.get("std") or 0.0))
            if value is not None and np.isfinite(value):
                values[symbol] = RigValue(value=value, unit=unit, std=std or 0.0)
    return RigFile(output=stated.get("output", "moving"), values=values)
