"""Prony series as materials of FE programs: Abaqus, ANSYS APDL and LS-DYNA keyword input, by a template each.

Abaqus and ANSYS take normalised moduli, of the instantaneous moduli, which the elastic cards state as well: from the
moduli at rest Abaqus would divide by 1 - sum g_i, which loses the digits of a long spectrum. LS-DYNA takes the modulus
or the stiffness of each arm itself, in fields of 20 columns, which the plus sign behind a keyword says: fields of 10
columns hold six digits. Its term with beta = 0 is the modulus at rest.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from fourpole.errors import ModelError
from fourpole.export.materials import Material, check_terms, materials_of, no_moduli, numbers
from fourpole.export.source import filled
from fourpole.fitting.modelfile import ModelFile
from fourpole.io.write import write_text
from fourpole.models.shape import Shape

#: Largest number of pairs of ANSYS TB,PRONY since release 10.
_MOST_PAIRS = 100
#: Largest number of terms of *MAT_GENERAL_VISCOELASTIC (076); one of them is the modulus at rest.
_MOST_TERMS = 18
#: Columns of a field of LS-DYNA, and significant digits of a number, which leave a blank in front of it.
_WIDTH, _DIGITS = 20, 14


def write_abaqus(source: ModelFile, path: Path, shape: Shape | None = None) -> tuple[str, ...]:
    """Write a material with `*VISCOELASTIC, TIME=PRONY` per condition; returns notes on what is left out."""
    materials, notes = materials_of(source, shape)
    _write("abaqus.inp", path, materials)
    return (*notes, *no_moduli(materials))


def write_ansys(source: ModelFile, path: Path, shape: Shape | None = None) -> tuple[str, ...]:
    """Write a material with `TB,PRONY` per condition, numbered from 1; returns notes on what is left out."""
    materials, notes = materials_of(source, shape)
    check_terms(materials, _MOST_PAIRS, "TB,PRONY")
    _write("ansys.mac", path, materials)
    return (*notes, *no_moduli(materials))


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
    _write("lsdyna.k", path, materials)
    return (*notes, "the density is not known to Fourpole: set RO of each *MAT_GENERAL_VISCOELASTIC")


def write_springs(source: ModelFile, path: Path, shape: Shape | None = None) -> tuple[str, ...]:
    """Write springs and dampers of the stiffness itself as discrete elements, to be set parallel; returns notes."""
    materials, notes = materials_of(source, shape)
    _write("springs.k", path, materials)
    return notes


def _write(template: str, path: Path, materials: Sequence[Material]) -> None:
    write_text(path, filled(template, materials=materials, numbers=numbers, card=_card))


def _card(*values: float) -> str:
    """A line of right-aligned fields; a whole number of the type int is written as such."""
    texts = (str(value) if isinstance(value, int) else numbers(value, digits=_DIGITS) for value in values)
    return "".join(text.rjust(_WIDTH) for text in texts)
