"""What study.json states of a campaign that a model file holds: the shapes of specimens, and the rig."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal

import numpy as np
import polars as pl
from pydantic import Field

from fourpole import quantities as q
from fourpole.core.rig import PARAMETERS, Rig
from fourpole.errors import ModelError
from fourpole.fitting.modelparts import LARGEST, Strict
from fourpole.models.shape import Shape, shape_of
from fourpole.units import shown


class RigValue(Strict):
    """A value of the rig."""

    value: float
    unit: str
    std: float = Field(ge=0)


class RigFile(Strict):
    """The rig of the tests, with which TR is computed."""

    output: Literal["moving", "blocked"] = "moving"
    values: dict[str, RigValue]


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


def rig_in(file: RigFile | None) -> Rig | None:
    """The rig of a document, or None; ModelError if a value has another unit."""
    if file is None:
        return None
    for name, one in file.values.items():
        if name not in PARAMETERS or PARAMETERS[name] != one.unit:
            raise ModelError(f"the model file's rig has {shown(name)} in {shown(one.unit)}: it was changed")
    values = {name: one.value for name, one in file.values.items()}
    std = {name: one.std for name, one in file.values.items()}
    if max(map(abs, [*values.values(), *std.values()]), default=0.0) > LARGEST:
        raise ModelError("the model file's rig has a number beyond all measure: it was changed")
    return Rig(**values, std=std, blocked=file.output == "blocked")  # type: ignore[arg-type]
