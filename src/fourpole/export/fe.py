"""Prony series as materials of FE programs: Abaqus, ANSYS APDL and LS-DYNA keyword input.

Abaqus and ANSYS take normalised moduli, of the instantaneous moduli, which the elastic cards state as well: from the
moduli at rest Abaqus would divide by 1 - sum g_i, which loses the digits of a long spectrum. LS-DYNA takes the modulus
or the stiffness of each arm itself, in fields of 20 columns, which the plus sign behind a keyword says: fields of 10
columns hold six digits.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np

from fourpole.core.arrays import FloatArray
from fourpole.errors import ModelError
from fourpole.export.materials import Material, check_terms, materials_of, no_moduli, number
from fourpole.fitting.modelfile import ModelFile
from fourpole.io.write import write_text
from fourpole.models.shape import Shape

#: Largest number of pairs of ANSYS TB,PRONY since release 10, and number of constants of one TBDATA command.
_MOST_PAIRS, _CONSTANTS = 100, 6
#: Largest number of terms of *MAT_GENERAL_VISCOELASTIC (076); one of them is the modulus at rest.
_MOST_TERMS = 18
#: Columns of a field of LS-DYNA, and significant digits of a number, which leave a blank in front of it.
_WIDTH, _DIGITS = 20, 14
#: Cut-off time of *MAT_SPRING_MAXWELL that is never reached [s].
_NEVER = 1e20


def write_abaqus(source: ModelFile, path: Path, shape: Shape | None = None) -> tuple[str, ...]:
    """Write a material with `*VISCOELASTIC, TIME=PRONY` per condition; returns notes on what is left out."""
    materials, notes = materials_of(source, shape)
    lines = ["** units: SI (m, kg, s, N, Pa); g_i, k_i of the instantaneous moduli, tau_i in s"]
    for material in materials:
        lines += _abaqus(material)
    _write(path, lines)
    return (*notes, *no_moduli(materials))


def _abaqus(material: Material) -> Iterator[str]:
    yield "**"
    yield from (f"** {line}" for line in material.about)
    yield f"*MATERIAL, NAME={material.name}"
    if material.elastic is not None:
        yield "*ELASTIC, TYPE=ISOTROPIC, MODULI=INSTANTANEOUS"
        yield ", ".join(map(number, material.elastic))
    else:
        yield "** add *ELASTIC, MODULI=INSTANTANEOUS: the shape of the specimen, or Poisson's ratio, is not stated"
    yield "*VISCOELASTIC, TIME=PRONY"
    for terms in zip(material.shares, material.bulk_shares, material.arms.times, strict=True):
        yield ", ".join(map(number, terms))


def write_ansys(source: ModelFile, path: Path, shape: Shape | None = None) -> tuple[str, ...]:
    """Write a material with `TB,PRONY` per condition, numbered from 1; returns notes on what is left out."""
    materials, notes = materials_of(source, shape)
    check_terms(materials, _MOST_PAIRS, "TB,PRONY")
    lines = [
        "! units: SI (m, kg, s, N, Pa); relative moduli of the instantaneous moduli, relaxation times in s",
        "! read it in /PREP7",
    ]
    for index, material in enumerate(materials, start=1):
        lines += _ansys(index, material)
    _write(path, lines)
    return (*notes, *no_moduli(materials))


def _ansys(index: int, material: Material) -> Iterator[str]:
    yield "!"
    yield from (f"! {line}" for line in (f"material {index}: {material.name}", *material.about))
    if material.elastic is not None:
        young, poisson = material.elastic
        yield f"MP,EX,{index},{number(young)}"
        yield f"MP,PRXY,{index},{number(poisson)}"
    else:
        yield f"! add MP,EX,{index} and MP,PRXY,{index}, instantaneous: the shape, or Poisson's ratio, is not stated"
    yield from _ansys_table(index, "SHEAR", material.shares, material)
    if material.bulk_shares.any():
        yield from _ansys_table(index, "BULK", material.bulk_shares, material)


def _ansys_table(index: int, option: str, shares: FloatArray, material: Material) -> Iterator[str]:
    """A table of pairs of relative modulus and relaxation time."""
    yield f"TB,PRONY,{index},1,{shares.size},{option}"
    yield f"TBTEMP,{0.0 if material.temperature is None else material.temperature:.10g}"
    constants = np.stack([shares, material.arms.times], axis=1).ravel().tolist()
    for first in range(0, len(constants), _CONSTANTS):
        yield ",".join(["TBDATA", str(first + 1), *map(number, constants[first : first + _CONSTANTS])])


def write_lsdyna(source: ModelFile, path: Path, shape: Shape | None = None) -> tuple[str, ...]:
    """Write a `*MAT_GENERAL_VISCOELASTIC` per condition, numbered from 1; returns notes on what is left out.

    Raises
    ------
    ModelError
        If the shape of the specimen is not stated, or there are more than 17 arms.
    """
    materials, notes = materials_of(source, shape)
    if lacking := no_moduli(materials):
        raise ModelError(f"{lacking[0]}; --to lsdyna-springs needs no shape")
    check_terms(materials, _MOST_TERMS - 1, "*MAT_GENERAL_VISCOELASTIC, beside the modulus at rest,")
    _write_keywords(path, (line for index, one in enumerate(materials, start=1) for line in _solid(index, one)))
    return (*notes, "the density is not known to Fourpole: set RO of each *MAT_GENERAL_VISCOELASTIC")


def write_springs(source: ModelFile, path: Path, shape: Shape | None = None) -> tuple[str, ...]:
    """Write springs and dampers of the stiffness itself as discrete elements, to be set parallel; returns notes."""
    materials, notes = materials_of(source, shape)
    lines: list[str] = []
    first = 1
    for material in materials:
        lines += _springs(first, material)
        first += material.arms.springs.size + 1
    _write_keywords(path, lines)
    return notes


def _write_keywords(path: Path, lines: Iterable[str]) -> None:
    units = "$ units: SI (m, kg, s, N, Pa); beta = 1/tau in 1/s; fields of 20 columns where a keyword ends in +"
    _write(path, ["*KEYWORD", units, *lines, "*END"])


def _solid(index: int, material: Material) -> Iterator[str]:
    """Cards of *MAT_GENERAL_VISCOELASTIC: head, no curves, then a term per line; beta = 0 is the modulus at rest."""
    assert material.shape is not None
    arms, shape = material.arms, material.shape
    yield from (f"$ {line}" for line in (f"material {index}: {material.name}", *material.about))
    yield "*MAT_GENERAL_VISCOELASTIC+"
    yield _comment("mid", "ro", "bulk", "pcf", "ef", "tref", "a", "b")
    yield _card(index, 0.0, shape.bulk_modulus * arms.instantaneous, 0.0, 0.0, 0.0, 0.0, 0.0)
    yield _comment("lcid", "nt", "bstart", "tramp", "lcidk", "ntk", "bstartk", "trampk")
    yield " " * (8 * _WIDTH)
    yield _comment("gi", "betai", "ki", "betaki")
    terms = [(arms.rest, 0.0), *zip(arms.springs.tolist(), (1.0 / arms.times).tolist(), strict=True)]
    for stiffness, rate in terms:
        bulk = (shape.bulk_modulus * stiffness, rate) if shape.relaxing_bulk else ()
        yield _card(shape.shear * stiffness, rate, *bulk)


def _springs(first: int, material: Material) -> Iterator[str]:
    """A spring for K_inf and a spring and damper in series for each arm, with consecutive numbers."""
    arms = material.arms
    last = first + arms.springs.size
    yield from (f"$ {line}" for line in (f"materials {first} to {last}, parallel: {material.name}", *material.about))
    yield "*MAT_SPRING_ELASTIC+"
    yield _comment("mid", "k")
    yield _card(first, arms.rest)
    pairs = zip(arms.springs.tolist(), arms.times.tolist(), strict=True)
    for index, (stiffness, time) in enumerate(pairs, start=first + 1):
        yield "*MAT_SPRING_MAXWELL+"
        yield _comment("mid", "k0", "ki", "beta", "tc", "fc", "copt")
        yield _card(index, stiffness, 0.0, 1.0 / time, _NEVER, 0.0, 0.0)


def _card(*values: float) -> str:
    """A line of right-aligned fields; a whole number of the type int is written as such."""
    texts = (str(value) if isinstance(value, int) else number(value, _DIGITS) for value in values)
    return "".join(text.rjust(_WIDTH) for text in texts)


def _comment(first: str, *names: str) -> str:
    """The names of the fields above a card."""
    return f"$#{first.rjust(_WIDTH - 2)}" + "".join(name.rjust(_WIDTH) for name in names)


def _write(path: Path, lines: Iterable[str]) -> None:
    write_text(path, "\n".join(lines) + "\n")
