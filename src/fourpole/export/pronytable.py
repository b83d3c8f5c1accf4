"""A table of the Prony series of a model file: stiffness, its uncertainty and interval, and moduli of each arm."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from fourpole.errors import ModelError
from fourpole.export.materials import materials_of, terms_of
from fourpole.export.source import accuracy_columns
from fourpole.fitting.accuracy import accuracy_of
from fourpole.fitting.modelfile import ConditionFile, ModelEntry, ModelFile, model_of
from fourpole.io.write import write_table
from fourpole.models.shape import Shape

#: Columns of a `Term`.
_HEADS = ("tau [s]", "beta [1/s]", "K [N/m]", "g [1]", "E [Pa]", "G [Pa]", "bulk modulus [Pa]")


def write(source: ModelFile, path: Path, shape: Shape | None = None) -> tuple[str, ...]:
    """Write a row for K_inf and for each arm of each condition, arms at zero included; returns notes."""
    _, notes = materials_of(source, shape)
    rows = [row for entry in source.models for one in entry.conditions for row in _rows(entry, one, shape)]
    write_table(path, pl.DataFrame(rows, infer_schema_length=None))
    return notes


def _rows(entry: ModelEntry, one: ConditionFile, shape: Shape | None) -> list[dict[str, Any]]:
    """The rows of one condition; none if its model is no Prony series."""
    model = model_of(entry)
    try:
        terms = terms_of(model.prony(one.values), shape := shape or entry.shape)
    except ModelError:
        return []
    state = {each.column: each.value for each in one.state}
    heads = _HEADS[: 4 if shape is None else 7 if shape.relaxing_bulk else 6]
    accuracy = accuracy_columns(accuracy_of(entry, one))
    return [
        {"specimen": entry.tyre, **state, "arm": at, **_uncertain(one, model.symbols, at)}
        | dict(zip(heads, term, strict=False))
        | accuracy
        for at, term in enumerate(terms)
    ]


def _uncertain(one: ConditionFile, symbols: list[str], at: int) -> dict[str, float | None]:
    """Standard uncertainty and 95 % interval [N/m] of K_inf or of an arm; blank if the model has another parameter."""
    symbol = f"K_{at}" if at else "K_inf"
    if symbol not in symbols:
        return {"u(K) [N/m]": None, "95 % from [N/m]": None, "95 % to [N/m]": None}
    place = symbols.index(symbol)
    low, high = one.intervals[place]
    std = float(np.sqrt(max(one.covariance[place][place], 0.0)))
    return {"u(K) [N/m]": std, "95 % from [N/m]": low, "95 % to [N/m]": high}
