"""Abaqus input: a material with `*VISCOELASTIC, TIME=PRONY` for each condition of a model file.

The normalised moduli are of the instantaneous modulus. The elastic card states the instantaneous moduli as well: from
the moduli at rest Abaqus would divide by 1 - sum g_i, which loses the digits of a long spectrum.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from fourpole.export.materials import Material, materials_of, no_moduli, number
from fourpole.fitting.modelfile import ModelFile
from fourpole.io.write import write_text
from fourpole.models.shape import Shape


def write(source: ModelFile, path: Path, shape: Shape | None = None) -> tuple[str, ...]:
    """Write the materials; returns notes on what is left out."""
    materials, notes = materials_of(source, shape)
    lines = ["** units: SI (m, kg, s, N, Pa); g_i, k_i of the instantaneous moduli, tau_i in s"]
    for one in materials:
        lines += _material(one)
    write_text(path, "\n".join(lines) + "\n")
    return (*notes, *no_moduli(materials))


def _material(one: Material) -> Iterator[str]:
    yield "**"
    yield from (f"** {line}" for line in one.about)
    yield f"*MATERIAL, NAME={one.name}"
    if one.has_moduli:
        assert one.shape is not None
        young = one.shape.young * one.arms.instantaneous
        yield "*ELASTIC, TYPE=ISOTROPIC, MODULI=INSTANTANEOUS"
        yield f"{number(young)}, {number(one.shape.poisson or 0.0)}"
    else:
        yield "** add *ELASTIC, MODULI=INSTANTANEOUS: the shape of the specimen, or Poisson's ratio, is not stated"
    yield "*VISCOELASTIC, TIME=PRONY"
    for share, bulk, time in zip(one.shares, one.bulk_shares, one.arms.times, strict=True):
        yield f"{number(share)}, {number(bulk)}, {number(time)}"
