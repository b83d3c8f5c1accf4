"""ANSYS APDL input: a material with `TB,PRONY` for each condition of a model file.

The relative moduli are of the instantaneous moduli, which `MP,EX` and `MP,PRXY` state.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from fourpole.core.arrays import FloatArray
from fourpole.export.materials import Material, check_terms, materials_of, no_moduli, number
from fourpole.fitting.modelfile import ModelFile
from fourpole.io.write import write_text
from fourpole.models.shape import Shape

#: Largest number of pairs of TB,PRONY since release 10, and number of constants of one TBDATA command.
_MOST_TERMS, _CONSTANTS = 100, 6


def write(source: ModelFile, path: Path, shape: Shape | None = None) -> tuple[str, ...]:
    """Write the materials, numbered from 1; returns notes on what is left out."""
    materials, notes = materials_of(source, shape)
    check_terms(materials, _MOST_TERMS, "TB,PRONY")
    lines = [
        "! units: SI (m, kg, s, N, Pa); relative moduli of the instantaneous moduli, relaxation times in s",
        "! read it in /PREP7",
    ]
    for at, one in enumerate(materials, start=1):
        lines += _material(at, one)
    write_text(path, "\n".join(lines) + "\n")
    return (*notes, *no_moduli(materials))


def _material(at: int, one: Material) -> Iterator[str]:
    yield "!"
    yield from (f"! {line}" for line in (f"material {at}: {one.name}", *one.about))
    if one.has_moduli:
        assert one.shape is not None
        yield f"MP,EX,{at},{number(one.shape.young * one.arms.instantaneous)}"
        yield f"MP,PRXY,{at},{number(one.shape.poisson or 0.0)}"
    else:
        yield f"! add MP,EX,{at} and MP,PRXY,{at}, instantaneous: the shape, or Poisson's ratio, is not stated"
    yield from _table(at, "SHEAR", one.shares, one)
    if one.bulk_shares.any():
        yield from _table(at, "BULK", one.bulk_shares, one)


def _table(at: int, option: str, shares: FloatArray, one: Material) -> Iterator[str]:
    """A table of pairs of relative modulus and relaxation time."""
    yield f"TB,PRONY,{at},1,{shares.size},{option}"
    yield f"TBTEMP,{0.0 if one.temperature is None else one.temperature:.10g}"
    constants = np.stack([shares, one.arms.times], axis=1).ravel().tolist()
    for first in range(0, len(constants), _CONSTANTS):
        yield ",".join(["TBDATA", str(first + 1), *map(number, constants[first : first + _CONSTANTS])])
